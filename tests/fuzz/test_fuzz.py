"""Damaged specs, tables and cells: drillc refuses or compiles, and never does anything else.

The default run takes the first few hundred cases; `pytest -m slow tests/fuzz` takes all of them.
A failure names its seed: `pytest tests/fuzz --fuzz-seed 1234` runs that case alone (also under
`-m slow`), and `python tests/fuzz/show.py 1234 FOLDER` writes its files down.
"""

from __future__ import annotations

import pytest
from fuzz.judging import Bench
from fuzz.mutations import case_of

SMOKE_CASES = 300
ALL_CASES = 20_000
CASES_PER_TEST = 500
#: Failures shown by one test; the others are counted.
SHOWN = 5


def run_all(bench: Bench, seeds: range) -> None:
    failures = []
    for seed in seeds:
        try:
            bench.run(case_of(seed))
        except AssertionError as error:
            failures.append(str(error))
    if failures:
        shown = "\n\n".join(failure[:3000] for failure in failures[:SHOWN])
        pytest.fail(f"{len(failures)} of {len(seeds)} cases failed\n\n{shown}", pytrace=False)


def test_some_damaged_specs(bench: Bench, fuzz_seed: int | None) -> None:
    if fuzz_seed is not None:
        pytest.skip("only --fuzz-seed")
    run_all(bench, range(SMOKE_CASES))


@pytest.mark.slow
@pytest.mark.parametrize("start", range(0, ALL_CASES, CASES_PER_TEST))
def test_all_damaged_specs(bench: Bench, fuzz_seed: int | None, start: int) -> None:
    if fuzz_seed is not None:
        pytest.skip("only --fuzz-seed")
    run_all(bench, range(start, start + CASES_PER_TEST))


def test_one_seed(bench: Bench, fuzz_seed: int | None) -> None:
    if fuzz_seed is None:
        pytest.skip("give --fuzz-seed")
    bench.run(case_of(fuzz_seed))

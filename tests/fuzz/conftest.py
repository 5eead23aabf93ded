"""The bench on which fuzz cases run, and its figures at the end of the run."""

from __future__ import annotations

import pytest
from fuzz.judging import Bench

_BENCHES: list[Bench] = []


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    made = Bench(tmp_path_factory.mktemp("fuzz"))
    _BENCHES.append(made)
    return made


@pytest.fixture(scope="session")
def fuzz_seed(request: pytest.FixtureRequest) -> int | None:
    return request.config.getoption("--fuzz-seed")


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    for bench in _BENCHES:
        if bench.tally.cases:
            terminalreporter.write_line(f"fuzz: {bench.tally}")

"""Every folder of cases/: a spec with one mistake, and all that drillc says about it.

`pytest tests/diagnostics --update-diagnostics` writes the expected texts anew; read the difference.
A case's name begins with the code that it shows; a `mended.drill` beside it is the same spec after
doing what the hint says, and must pass.
"""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from diagnostics.running import CASES, EXPECTED, MENDED, Bench

ALL = sorted(path for path in CASES.iterdir() if path.is_dir())
CODE = re.compile(r"\b(error|warning) ([EW]\d{3}):")


@pytest.fixture
def case(request: pytest.FixtureRequest, bench: Bench) -> Path:
    """The case's folder; its files but the expected text lie in the bench's folder."""
    folder: Path = request.param
    ignored = shutil.ignore_patterns(EXPECTED)
    shutil.copytree(folder, bench.folder, dirs_exist_ok=True, ignore=ignored)
    return folder


def said_by(case: Path, bench: Bench) -> str:
    """What drillc says about the case's spec: a refusal, or for a warning, what check says."""
    if not case.name.startswith("W"):
        return bench.refused()
    ran = bench.run("check", "spec.drill")
    assert ran.code == 0
    assert ran.out.endswith("no errors\n")
    return ran.err


@pytest.mark.parametrize("case", ALL, indirect=True, ids=lambda path: path.name)
def test_what_is_said(case: Path, bench: Bench, request: pytest.FixtureRequest) -> None:
    said = said_by(case, bench)
    expected = case / EXPECTED
    if request.config.getoption("--update-diagnostics"):
        expected.write_text(said, encoding="utf-8")
    assert said == expected.read_text(encoding="utf-8")
    assert {code for _, code in CODE.findall(said)} == set(case.name.split("_")[0].split("+"))


MENDED_CASES = [path for path in ALL if (path / MENDED).exists()]


@pytest.mark.parametrize("case", MENDED_CASES, indirect=True, ids=lambda path: path.name)
def test_the_hint_mends_it(case: Path, bench: Bench) -> None:
    ran = bench.run("check", MENDED)
    assert (ran.code, ran.err) == (0, "")
    assert (case / MENDED).read_bytes() != (case / "spec.drill").read_bytes()


def test_the_carets_stand_under_the_line() -> None:
    """Every message has a place, and every caret line fits the source line above it."""
    for case in ALL:
        lines = (case / EXPECTED).read_text(encoding="utf-8").splitlines()
        for number, line in enumerate(lines):
            if CODE.search(line):
                assert re.match(r"[\w./-]+:\d+:\d+: (error|warning) ", line), (case.name, line)
            if re.fullmatch(r" +\| +\^+", line):
                place = re.match(r" *[\w./-]+:(\d+):(\d+): ", lines[number - 2])
                assert place is not None, (case.name, line)
                source = lines[number - 1]
                assert source.startswith(f"  {place[1]} | "), (case.name, source)
                assert len(line) <= max(len(source), line.index("^") + 1), (case.name, line)


def test_the_cases_cover_what_they_should() -> None:
    assert len(ALL) > 100
    assert len(MENDED_CASES) > 60

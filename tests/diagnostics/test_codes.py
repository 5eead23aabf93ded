"""Every code has a test that shows it and an entry in docs/diagnostics.md, and means one thing."""

from __future__ import annotations

import ast
import re
from collections import defaultdict
from pathlib import Path

import pytest
from diagnostics.running import CASES, EXPECTED

ROOT = Path(__file__).parents[2]
DOCUMENT = ROOT / "docs" / "diagnostics.md"
CODE = re.compile(r"[EW]\d{3}")
#: What belongs together: a code is reported by one of these only.
ROOMS = {
    "language": ["compiler/drillc/language"],
    "planning": ["compiler/drillc/planning"],
    "output": ["compiler/drillc/output", "postprocessors", "compiler/drillc/driver.py"],
    "verification": ["compiler/drillc/verification"],
}
#: The case that an example is taken from, if any, and the example.
_EXAMPLE = re.compile(r"^```text(?: (\S+))?\n((?:.|\n)+?\n)```$", re.MULTILINE)
_MESSAGE = re.compile(r"^(?=[\w./-]+:\d+:\d+: (?:error|warning) |\d+ errors?; )", re.MULTILINE)
_ENTRY = re.compile(r"^### ([EW]\d{3}) (.+)$", re.MULTILINE)


def python_files(places: list[str]) -> list[Path]:
    found = [ROOT / place for place in places]
    return [
        path for place in found for path in ([place] if place.is_file() else place.rglob("*.py"))
    ]


def codes_of(path: Path) -> set[str]:
    """The codes among the strings of a Python file."""
    nodes = ast.walk(ast.parse(path.read_text(encoding="utf-8")))
    texts = [n.value for n in nodes if isinstance(n, ast.Constant) and isinstance(n.value, str)]
    return {text for text in texts if CODE.fullmatch(text)}


def codes_by_room() -> dict[str, set[str]]:
    rooms = {}
    for room, places in ROOMS.items():
        rooms[room] = {code for path in python_files(places) for code in codes_of(path)}
    return rooms


ALL = sorted(set().union(*codes_by_room().values()))


def documented() -> dict[str, str]:
    """Code → title, as the document has it."""
    return dict(_ENTRY.findall(DOCUMENT.read_text(encoding="utf-8")))


def entries() -> dict[str, str]:
    """Code → text of its entry."""
    parts = re.split(r"^##+ ", DOCUMENT.read_text(encoding="utf-8"), flags=re.MULTILINE)
    return {part[:4]: part for part in parts if CODE.match(part)}


def message(case: str, code: str) -> str:
    """The first message with that code of what a case expects."""
    parts = _MESSAGE.split((CASES / case / EXPECTED).read_text(encoding="utf-8"))
    return next(part for part in parts if re.search(rf"^\S+ (error|warning) {code}: ", part))


def said_in_tests() -> set[str]:
    """Codes that the tests' own code names, apart from this file."""
    files = [path for path in (ROOT / "tests").rglob("*.py") if path != Path(__file__)]
    return set(CODE.findall("\n".join(path.read_text(encoding="utf-8") for path in files)))


def test_codes_are_found() -> None:
    assert len(ALL) > 130
    assert {"E101", "E333", "W327", "E406", "E600", "E610"} <= set(ALL)
    assert all(codes_by_room()[room] for room in ("language", "planning", "output"))


def test_no_source_has_a_code_that_is_not_found() -> None:
    """A code that is put together, or hidden in a longer text, would escape these tests."""
    for path in python_files(["compiler", "postprocessors"]):
        text = re.sub(r"#.*", "", path.read_text(encoding="utf-8"))
        text = re.sub(r'"""(?:.|\n)*?"""', "", text)
        assert set(re.findall(r"\b[EW]\d{3}\b", text)) <= set(ALL), path


def test_every_code_has_a_case() -> None:
    """Codes of the input have a folder of their own, or a test where a folder cannot show them;
    those of the output are shown by the posts' own tests."""
    shown = {code for path in CASES.iterdir() for code in CODE.findall(path.name)}
    files = (Path(__file__).parent / "test_files.py").read_text(encoding="utf-8")
    shown |= set(CODE.findall(files))
    assert [c for c in ALL if c[1:] < "600" and c not in shown] == []
    assert [c for c in ALL if c[1:] >= "600" and c not in said_in_tests() | shown] == []


def test_no_case_shows_a_code_that_is_gone() -> None:
    shown = {code for path in CASES.iterdir() for code in CODE.findall(path.name)}
    assert sorted(shown - set(ALL)) == []


def test_every_code_has_one_entry() -> None:
    titles = _ENTRY.findall(DOCUMENT.read_text(encoding="utf-8"))
    codes = [code for code, _ in titles]
    assert sorted(set(ALL) - set(codes)) == []
    assert sorted(set(codes) - set(ALL)) == []
    assert codes == sorted(codes, key=lambda code: (code[1:], code[0]))
    assert len(codes) == len(set(codes))


def test_every_entry_says_cause_example_and_mend() -> None:
    for code, entry in entries().items():
        title, cause, *_ = entry.split("\n\n")
        assert title == f"{code} {documented()[code]}"
        assert cause[0].isupper() or cause[0] in '"`', code
        assert cause.endswith((".", ")")), code
        assert len(_EXAMPLE.findall(entry)) == 1, code
        assert re.search(r"^\*\*Mend:\*\* \S", entry, re.MULTILINE), code


def test_every_example_shows_its_code() -> None:
    for code, entry in entries().items():
        [(_, example)] = _EXAMPLE.findall(entry)
        assert re.match(rf"([\w.]+:\d+:\d+: )?(error|warning) {code}: ", example), code


def test_the_examples_are_what_drillc_says(request: pytest.FixtureRequest) -> None:
    """An example that names a case is the first of that case's messages with the entry's code;
    where a case has the code, the example names one. `--update-diagnostics` writes them anew."""
    text = DOCUMENT.read_text(encoding="utf-8")
    shown = {code for path in CASES.iterdir() for code in CODE.findall(path.name)}
    for code, entry in entries().items():
        [(case, example)] = _EXAMPLE.findall(entry)
        assert bool(case) == (code in shown), code
        if case and request.config.getoption("--update-diagnostics"):
            text = text.replace(
                f"```text {case}\n{example}```", f"```text {case}\n{message(case, code)}```"
            )
    if request.config.getoption("--update-diagnostics"):
        DOCUMENT.write_text(text, encoding="utf-8")
    for code, entry in entries().items():
        [(case, example)] = _EXAMPLE.findall(entry)
        assert not case or example == message(case, code)


def test_a_code_belongs_to_one_room() -> None:
    homes = defaultdict(list)
    for room, codes in codes_by_room().items():
        for code in codes:
            homes[code].append(room)
    assert {code: rooms for code, rooms in homes.items() if len(rooms) > 1} == {}


def test_no_two_codes_mean_the_same() -> None:
    titles = list(documented().values())
    assert sorted({title for title in titles if titles.count(title) > 1}) == []
    # An error and a warning of one number are the two degrees of one thing; there is no other pair.
    numbers = [code[1:] for code in documented()]
    assert sorted(n for n in set(numbers) if numbers.count(n) > 1 and n < "600") == []

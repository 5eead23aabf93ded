"""Inline points: each known by its line and column, every malformed one explained at its first
wrong character, and all of it in a few bulk operations."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import pytest
from drillc.language import points as module
from drillc.language.diagnostics import NAMED_ROWS
from drillc.language.points import BLOCK_POINTS, MAX_ID_LENGTH
from hypothesis import given
from hypothesis import strategies as st
from language.texts import PART, codes, only, planned, points, refused, spots

PIECES = ["P1", "(", "1", ",", "2", ",", "3", ")", "normal", "(", "0", ",", "0", ",", "1", ")"]

# ── where points stand ───────────────────────────────────────────────────────────────────────────

IDS = st.from_regex(r"\A[A-Za-z0-9_][A-Za-z0-9_.:/-]{0,8}\Z")
NUMBERS = st.sampled_from(["0", "-1", "+2.5", ".5", "1.", "1e2", "-.25E-1", "00.10", "-0"])
NORMALS = NUMBERS | st.sampled_from(["nan", "-inf", "Infinity", "NAN"])
COMMENTS = st.sampled_from(["#\n", "# } {\n", "# P9 (1, 2, 3) normal (0, 0, 1)\n", '# é – " ( #\n'])
BLANKS = st.lists(st.sampled_from([" ", "\t", "\n", "\n\n  "]) | COMMENTS, max_size=3).map("".join)
#: Between points, and between an id or `normal` and another word: at least one blank.
GAPS = st.tuples(st.sampled_from([" ", "\n", "\t"]), BLANKS).map("".join)


@dataclass(frozen=True)
class Point:
    id: str
    numbers: Sequence[str]
    blanks: Sequence[str]

    def text(self) -> str:
        numbers = iter(self.numbers)
        pieces = ["" if p in "123" or p in "01" else p for p in PIECES]
        filled = [self.id, *(piece or next(numbers) for piece in pieces[1:])]
        return "".join(p + b for p, b in zip(filled, [*self.blanks, ""], strict=True))


POINTS = st.builds(
    Point,
    IDS,
    st.tuples(*[NUMBERS] * 3, *[NORMALS] * 3),
    st.lists(BLANKS, min_size=15, max_size=15),
)


@given(st.lists(st.tuples(GAPS, POINTS), max_size=6), BLANKS)
def test_every_point_is_read_where_it_stands(found: list[tuple[str, Point]], end: str) -> None:
    before = "drill 1 # é\nregion r {\n  points mm {"
    inside, places = "", []
    for gap, point in found:
        inside += gap
        upto = before + inside
        places.append((upto.count("\n") + 1, len(upto) - (upto.rfind("\n") + 1) + 1))
        inside += point.text()
    raw, report = points(inside + end, before=before)
    assert codes(report) == []
    assert raw.ids.tolist() == [point.id for _, point in found]
    assert list(zip(raw.line.tolist(), raw.column.tolist(), strict=True)) == places
    wanted = [[float(n) for n in point.numbers] for _, point in found]
    read = [[*p, *n] for p, n in zip(raw.position_mm.tolist(), raw.normal.tolist(), strict=True)]
    assert repr(read) == repr(wanted)  # repr, since nan != nan


def test_points_of_one_line_and_of_many() -> None:
    raw, report = points(
        "A(1,2,3)normal(0,0,1)B (4,5,6)normal (0,0,1) # C (7,8,9) normal (0,0,1) }\n"
        "\n  D\n  (\n1 # one\n, 2, 3) # {\n normal\n(0, 0, 1) E (1,1,1) normal (0,0,1)\n",
        before="{",
    )
    assert codes(report) == []
    assert raw.ids.tolist() == ["A", "B", "D", "E"]
    assert list(zip(raw.line.tolist(), raw.column.tolist(), strict=True)) == [
        (1, 2),
        (1, 23),
        (3, 3),
        (8, 11),
    ]


@pytest.mark.parametrize("inside", ["", " \n\t", "# nothing", "# a\n# b\n"])
def test_empty_blocks(inside: str) -> None:
    raw, report = points(inside)
    assert codes(report) == []
    assert len(raw.ids) == 0
    assert raw.position_mm.shape == raw.normal.shape == (0, 3)


def test_a_block_longer_than_what_is_handled_at_a_time() -> None:
    count = BLOCK_POINTS + 3
    inside = "".join(f"H{i} ({i}, 2, 3) normal (0, 0, 1)\n" for i in range(count))
    raw, report = points("\n" + inside)
    assert codes(report) == []
    assert raw.line.tolist() == list(range(2, count + 2))
    assert (raw.column == 1).all()
    assert (raw.position_mm[:, 0] == range(count)).all()
    assert raw.ids[-1] == f"H{count - 1}"


def test_a_mistake_on_the_seam_of_two_blocks() -> None:
    good = "".join(f"H{i} (1, 2, 3) normal (0, 0, 1)\n" for i in range(BLOCK_POINTS))
    for broken in ("X (1, 2, 3) normal (0, 0)\n", "X (1, 2, 3 normal (0, 0, 1)\n"):
        _, report = points("\n" + good + broken + good)
        assert [(code, line) for code, line, _ in spots(report)] == [("E301", BLOCK_POINTS + 2)]


# ── mistakes ─────────────────────────────────────────────────────────────────────────────────────

GOOD = "G{} (9, 9, 9) normal (0, 0, 1)\n"


@pytest.mark.parametrize("place", range(len(PIECES)))
@pytest.mark.parametrize("wrong", ["?", "%", "'x'", "(("])
def test_a_wrong_piece_is_reported_where_it_stands(place: int, wrong: str) -> None:
    if wrong == "((" and PIECES[place] == "(":
        wrong, shift = "((", 1  # the second is the wrong one
    else:
        shift = 0
    pieces = [*PIECES[:place], wrong, *PIECES[place + 1 :]]
    column = len(" ".join(pieces[:place])) + (1 if place else 0) + 1 + shift
    _, report = points("\n" + GOOD.format(1) + " ".join(pieces) + "\n" + GOOD.format(2))
    assert spots(report) == [("E301", 3, column)]


@pytest.mark.parametrize("place", range(1, len(PIECES) - 1))
def test_a_missing_piece_is_reported_where_the_next_one_stands(place: int) -> None:
    pieces = [*PIECES[:place], *PIECES[place + 1 :]]
    column = len(" ".join(pieces[:place])) + 2
    _, report = points("\n" + GOOD.format(1) + " ".join(pieces) + "\n" + GOOD.format(2))
    assert spots(report) == [("E301", 3, column)]


def test_what_is_missing_at_the_end_of_a_line_is_shown_there() -> None:
    line = " ".join(PIECES[:-1])
    _, report = points("\n" + GOOD.format(1) + line + "\n" + GOOD.format(2))
    assert spots(report) == [("E301", 3, len(line))]
    _, report = points("\n" + GOOD.format(1) + line + "\n\n")
    assert spots(report) == [("E301", 3, len(line))]


@pytest.mark.parametrize(
    ("inside", "code", "column", "said"),
    [
        ("P1 (1, 2, 3) normal (0, 0, 1.0.0)", "E301", 31, '")" after the normal'),
        ("P1 (1,5, 2,5, 3) normal (0, 0, 1)", "E301", 11, '")" after the position'),
        ("P1 (1 mm, 2, 3) normal (0, 0, 1)", "E301", 7, '"," after x'),
        ("P1 (1, 2, 3)", "E301", 12, '"normal"'),
        ("P1 (1, 2, 3) norm (0, 0, 1)", "E301", 14, '"normal"'),
        ("P1 (1, 2, 3) normals (0, 0, 1)", "E301", 20, '"("'),
        ("(1, 2, 3) normal (0, 0, 1)", "E301", 1, "a hole id"),
        ("-P (1, 2, 3) normal (0, 0, 1)", "E301", 1, "a hole id"),
        ("P1 (1, nan, 3) normal (0, 0, x)", "E301", 30, "the normal's z"),
        ("P1 (1, −2, 3) normal (0, 0, 1)", "E110", 8, "MINUS SIGN"),
        ("Pé (1, 2, 3) normal (0, 0, 1)", "E110", 2, "U+00E9"),
    ],
)
def test_what_people_write(inside: str, code: str, column: int, said: str) -> None:
    _, report = points(inside, before="\n")
    assert spots(report) == [(code, 2, column)]
    assert said in only(report).message


def test_all_mistakes_of_a_block_are_reported() -> None:
    broken = {3: "P3 1, 2, 3) normal (0, 0, 1)", 4: "P4 (1, 2 3) normal (0, 0, 1)"}
    broken |= {7: "P7 (1, 2, 3) normal", 9: "P9 (1, 2, 3) (0, 0, 1)"}
    lines = [broken.get(n, f"P{n} (1, 2, 3) normal (0, 0, 1)") for n in range(2, 12)]
    raw, report = points("\n" + "\n".join(lines))
    assert [(code, line) for code, line, _ in spots(report)] == [("E301", n) for n in broken]
    assert len(raw.ids) == len(lines) - len(broken)


def test_of_many_mistakes_the_first_are_named() -> None:
    _, report = points("\n" + "P (1, 2) normal (0, 0, 1)\n" * 1000)
    assert [line for _, line, _ in spots(report)] == [*range(2, 2 + NAMED_ROWS + 1)]


def test_the_offset_of_a_block_counts() -> None:
    """The block is somewhere in its file; and comments before it hold braces."""
    before = "drill 1\n# { }\nregion r { points mm { "
    _, report = points("P1 (1, 2, 3) normal (0, 0, !)", before=before)
    assert spots(report) == [("E301", 3, 23 + 28)]


# ── what is well formed but wrong ────────────────────────────────────────────────────────────────


def region(*lines: str, unit: str = "mm") -> str:
    """A spec whose points begin on line 5."""
    block = "\n".join(lines)
    return f"drill 1\n{PART}region r {{ posture x toward +X  points {unit} {{\n{block}\n}} }}\n"


@pytest.mark.parametrize(
    ("point", "code"),
    [
        ("P (1, 2, 3) normal (nan, 0, 1)", "E318"),
        ("P (1, 2, 3) normal (0, 0, -inf)", "E318"),
        ("P (1, 2, 3) normal (0, 0, 1e999)", "E318"),
        ("P (1, nan, 3) normal (0, 0, 1)", "E318"),
        ("P (1, inf, 3) normal (0, 0, 1)", "E318"),
        ("P (1, 1e999, 3) normal (0, 0, 1)", "E205"),
        ("P (1, 1000001, 3) normal (0, 0, 1)", "E205"),
        ("P (1, 2, 3) normal (0, -0, 0.0)", "E320"),
        ("P (1, 2, 3) normal (0, 0, 1.0011)", "E321"),
        ("P (1, 2, 3) normal (0, 0, 1e200)", "E321"),
        (f"{'P' * (MAX_ID_LENGTH + 1)} (1, 2, 3) normal (0, 0, 1)", "E323"),
        ("OK1 (7, 7, 7) normal (0, 0, 1)", "E325"),
        ("P (1, 1, 1.0001) normal (0, 0, 1)", "E326"),
    ],
)
def test_holes_that_cannot_be(tmp_path: Path, point: str, code: str) -> None:
    good = "OK1 (1, 1, 1) normal (0, 0, 1)"
    report = refused(tmp_path, region(good, f"  {point}", "OK2 (2, 1, 1) normal (0, 0, 1)"))
    assert (code, 6, 3) in spots(report)
    assert {code} == {found for found in codes(report) if found.startswith("E")}


def test_normals_in_tolerance_are_made_unit(tmp_path: Path) -> None:
    text = region("A (1, 2, 3) normal (0, 0, 1.0009)", "B (2, 2, 3) normal (0.6, 0, -0.7995)")
    feed = planned(tmp_path, text).job.holes.feed
    assert (feed**2).sum(axis=1) == pytest.approx([1, 1], abs=1e-15)
    assert feed[0].tolist() == [0, 0, 1]


def test_the_unit_of_a_block(tmp_path: Path) -> None:
    places = {
        "mm": "(290, -1.5, 0.001)",
        "m": "(0.29, -0.0015, 0.000001)",
        "um": "(29e4, -1500, 1)",
        "cm": "(29.0, -.15, 1e-4)",
    }
    read = {
        unit: planned(tmp_path, region(f"P {place} normal (0, 0, 1)", unit=unit))
        for unit, place in places.items()
    }
    found = {unit: result.job.holes.position_mm[0].tolist() for unit, result in read.items()}
    assert found == {unit: [290.0, -1.5, 0.001] for unit in places}


# ── bulk ─────────────────────────────────────────────────────────────────────────────────────────


def test_points_are_converted_by_column(monkeypatch: pytest.MonkeyPatch) -> None:
    """Three conversions a block of points, however many; nothing is explained that is fine."""
    calls: list[int] = []
    real = module.numbers

    def counted(texts: Sequence[str], *rest: object) -> object:
        calls.append(len(texts))
        return real(texts, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(module, "numbers", counted)
    monkeypatch.setattr(module, "_explain", lambda *_: pytest.fail("nothing is wrong here"))
    count = BLOCK_POINTS + 100
    points("P (1, 2, 3) normal (0, 0, 1)\n" * count)
    assert calls == [BLOCK_POINTS] * 3 + [100] * 3


HOSTILE: dict[str, Callable[[int], str]] = {
    "letters": lambda n: "A" * n,
    "digits": lambda n: "1" * n,
    "brackets": lambda n: "(" * n,
    "blanks": lambda n: " \t\n" * (n // 3) + "x",
    "ids": lambda n: "A " * (n // 2),
    "beginnings": lambda n: "A (" * (n // 3),
    "lines": lambda n: "A (1, 2, 3) normal (1, 2,\n" * (n // 26),
    "numbers": lambda n: "A (" + "1" * n + ", 1, x",
    "blanks inside": lambda n: "A (" + " " * n + "x",
    "comments": lambda n: "#\n" * (n // 2) + "x",
    "signs": lambda n: "A (" + "-+" * (n // 2),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_what_is_no_point_takes_no_longer_than_its_length(kind: str) -> None:
    def seconds(length: int) -> float:
        text, best = HOSTILE[kind](length), 1e9
        for _ in range(5):
            began = time.process_time()
            points(text)
            best = min(best, time.process_time() - began)
        return best

    gc.disable()  # its passes depend on what else this process holds
    try:
        # Proportional would be 8, quadratic 64.
        assert seconds(240_000) <= 30 * seconds(30_000) + 0.01
    finally:
        gc.enable()

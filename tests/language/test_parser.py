"""The parser: keywords are whole words only where they are expected, all syntax errors of a file
are reported where they are, and nothing takes more than its bound."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from drillc.language import parser
from drillc.language.ast import PointBlock, Quantity, Text, Word
from drillc.language.parser import (
    MAX_NESTING,
    MAX_STRUCTURE_CHARACTERS,
    MAX_SYNTAX_ERRORS,
)
from language.texts import codes, only, parsed, spots

GRAMMAR = (Path(__file__).parents[2] / "grammars" / "drill.lark").read_text()
_RULES = re.sub(r"//[^\n]*", "", GRAMMAR)
#: Every word in quotes of the grammar, and those with a terminal of their own.
KEYWORDS = sorted({word for word in re.findall(r'"([A-Za-z_]+)"', _RULES) if word.isidentifier()})


def test_the_keywords_were_found() -> None:
    assert {"tool", "d", "D", "in", "or", "centre", "unit_tolerance"} <= set(KEYWORDS)
    assert len(KEYWORDS) > 80


# ── words ────────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("word", KEYWORDS)
def test_a_keyword_is_one_only_where_it_is_expected(word: str) -> None:
    text = f"""drill 1
program {word}
tool {word} {{ number 1  tcp (0, 0, 1) mm }}
process {word} {{ travel 1 m/s }}
holes {word} from "a.csv" {{ units mm  columns {{ id {word}  x {word} }} }}
region {word} {{ process {word}  posture x toward +X  select {word} not in {word} }}
skip {word} in {word} where in {word} or not in {word}
expect {word} holes 1
emit {word} {{ value {word} }}
"""
    spec, report = parsed(text)
    assert spec is not None, [d.message for d in report.diagnostics]
    names = [s.name.text for s in spec.statements if s.kind not in {"version", "skip"}]
    assert names == [word] * 7


@pytest.mark.parametrize("word", [w for w in KEYWORDS if w not in {"x", "y", "z"}])
@pytest.mark.parametrize("tail", ["s", "_1", "9"])
def test_a_word_that_begins_with_a_keyword_is_none(word: str, tail: str) -> None:
    """`depths` is not `depth` and `s`: as a name it is whole, as a keyword it is a mistake."""
    spec, _ = parsed(f"drill 1\nregion {word}{tail} {{ process {word}{tail} }}\n")
    assert spec is not None
    assert spec.statements[-1].name.text == word + tail
    [value] = spec.statements[-1].items[0].values
    assert isinstance(value, Word)
    assert value.text == word + tail
    if word + tail not in KEYWORDS:
        spec, report = parsed(f"drill 1\nprocess p {{ travel 1 m/s {word}{tail} 1 mm }}\n")
        assert spec is None
        assert spots(report) == [(codes(report)[0], 2, 26)]


@pytest.mark.parametrize(
    "name", ["7-a", "7", "A.1:2/3-b", "depth", "normal", "1e5", "_", "x", "-1"]
)
def test_hole_ids(name: str) -> None:
    spec, report = parsed(f"drill 1\nexpect {name} at (1, 2, 3) mm within 1 mm\n")
    if name == "-1":
        assert spec is None
        assert spots(report) == [("E101", 2, 8)]
    else:
        assert spec is not None, [d.message for d in report.diagnostics]
        assert spec.statements[-1].name.text == name


def test_numbers_and_ranges() -> None:
    spec, _ = parsed(
        "drill 1\nrobot r portal { limits { q1 -1. m..+.5e1m  q2 0 mm .. 1e-3 mm } }\n"
    )
    assert spec is not None
    limits = spec.statements[-1].items[0].items
    found = [
        (value.low.number, value.low.unit, value.high.number, value.high.unit)
        for item in limits
        for value in item.values
    ]
    assert found == [("-1.", "m", "+.5e1", "m"), ("0", "mm", "1e-3", "mm")]


# ── comments and texts ───────────────────────────────────────────────────────────────────────────


def test_comments_stand_anywhere_and_may_hold_anything() -> None:
    spec, report = parsed(
        '# before { ( " region\ndrill # between\n 1 # }\n'
        'region r # { "\n { # }\n process # tool t {\n p } # the end without a newline'
    )
    # The version must be on the line of its word.
    assert spec is None
    assert codes(report) == ["E104"]
    spec, report = parsed(
        '# before { ( " region\ndrill 1 # }\nregion r # { "\n { # }\n'
        "process # tool t {\n p } # µ – the end without a newline"
    )
    assert spec is not None, [d.message for d in report.diagnostics]
    [value] = spec.statements[-1].items[0].values
    assert isinstance(value, Word)
    assert (value.text, value.span.line, value.span.column) == ("p", 6, 2)


def test_a_text_may_hold_what_begins_a_comment_or_a_block() -> None:
    spec, report = parsed('drill 1\nuse "a#{b(.cell"\nuse "é – °.cell"\n')
    assert spec is not None, [d.message for d in report.diagnostics]
    texts = [s.values[0] for s in spec.statements[1:]]
    assert [t.text for t in texts if isinstance(t, Text)] == ["a#{b(.cell", "é – °.cell"]


def test_a_points_block_is_one_value_with_its_place() -> None:
    inside = " P1 (1, 2, 3) normal (0, 0, 1) # a brace } and {\n  # }\n"
    text = f"drill 1\nregion r {{ points mm {{{inside}}} process p }}\n"
    spec, report = parsed(text)
    assert spec is not None, [d.message for d in report.diagnostics]
    block = spec.statements[-1].items[0].values[0]
    assert isinstance(block, PointBlock)
    assert text[block.start : block.stop] == inside
    assert block.unit is not None
    assert block.unit.text == "mm"
    assert [item.key.text for item in spec.statements[-1].items] == ["points", "process"]


# ── mistakes ─────────────────────────────────────────────────────────────────────────────────────


def test_every_syntax_error_of_a_file_is_reported_at_its_place() -> None:
    text = """drill 1
program 7
part skin { normals sideways }
tool t { number 1  tcp (0 0, 1) mm }

process p {
  approach 60 mm, at 3 mm/s
}
region fine { process p  points mm { P1 (1, 2, 3) normal (0, 0, 1) } }
  holes t from x.csv { units mm }
region r {
  process p
  posture x flat toward +X
}
region s { points mm { } } }
expect P1 at (1, 2, 3) mm within
emit krl { axes q1 U } }
"""
    spec, report = parsed(text)
    assert spec is None
    assert spots(report) == [
        ("E101", 2, 9),
        ("E101", 3, 21),
        ("E101", 4, 27),
        ("E101", 7, 17),
        ("E101", 10, 16),
        ("E101", 13, 13),
        ("E101", 15, 28),
        ("E101", 17, 1),
        ("E101", 17, 17),
    ]


def test_a_mended_file_has_no_error_left() -> None:
    """Recovery invents nothing: what stands between two broken statements is fine."""
    good = "region r { process p  points mm { P1 (1, 2, 3) normal (0, 0, 1) } }\n"
    spec, report = parsed("drill 1\n" + "bogus { ]\n" + good * 3 + "use x\n" + good)
    assert spec is None
    assert spots(report) == [("E101", 2, 1), ("E101", 6, 5)]


def test_an_unclosed_block_does_not_swallow_the_next_statement() -> None:
    text = "drill 1\nregion r {\n  process p\n\ntool t { number 1 }\nprogram 7\n"
    spec, report = parsed(text)
    assert spec is None
    assert spots(report) == [("E105", 2, 10), ("E101", 6, 9)]
    assert report.diagnostics[0].labels[0].span.line == 5


def test_an_unclosed_points_block() -> None:
    text = "drill 1\nregion r {\n  points mm {\n    P1 (1, 2, 3) normal (0, 0, 1)\n\nregion s {\n"
    spec, report = parsed(text)
    assert spec is None
    assert spots(report)[0] == ("E105", 3, 13)


def test_the_number_of_errors_is_bounded() -> None:
    spec, report = parsed("drill 1\n" + "program 1\n" * 1000)
    assert spec is None
    assert spots(report) == [("E101", line, 9) for line in range(2, 2 + MAX_SYNTAX_ERRORS)]


@pytest.mark.parametrize(
    "text", ["", "\n", "#", "drill", "drill 2\n", "drill1\n", "region r { }\n", "\ufeffdrill 1\n"]
)
def test_the_version_comes_first(text: str) -> None:
    spec, report = parsed(text)
    assert spec is None
    assert codes(report) == ["E104"]


@pytest.mark.parametrize("version", ["01", "1.0", "+1", "1e0", "1a"])
def test_no_other_way_to_write_the_version(version: str) -> None:
    spec, report = parsed(f"drill {version}\n")
    assert spec is None
    assert codes(report) == ["E104"]


# ── bounds ───────────────────────────────────────────────────────────────────────────────────────


def nested(depth: int) -> str:
    """A condition inside `depth` brackets, those of its region's block counted."""
    inner = depth - 1
    condition = "(" * inner + "in a" + ")" * inner
    return f"drill 1\nregion r {{ select t where {condition} }}\n"


def test_nesting() -> None:
    assert parsed(nested(MAX_NESTING))[0] is not None
    spec, report = parsed(nested(MAX_NESTING + 1))
    assert spec is None
    column = len("region r { select t where ") + MAX_NESTING
    assert spots(report) == [("E103", 2, column)]
    assert "MAX_NESTING" in only(report).message


def test_brackets_in_comments_texts_and_points_do_not_nest() -> None:
    deep = "{(" * MAX_NESTING
    text = f'drill 1\n# {deep}\nuse "{deep}"\nregion r {{ points mm {{ # {deep}\n}} }}\n'
    spec, report = parsed(text)
    assert spec is not None, [d.message for d in report.diagnostics]


def test_the_size_of_what_is_no_point() -> None:
    head = "drill 1\nprogram P\n"
    fits = head + "#" * (MAX_STRUCTURE_CHARACTERS - len(head))
    assert parsed(fits)[0] is not None
    spec, report = parsed(fits + "#")
    assert spec is None
    assert codes(report) == ["E102"]
    assert "MAX_STRUCTURE_CHARACTERS" in only(report).message


def test_points_do_not_count_as_structure() -> None:
    point = "P1 (1, 2, 3) normal (0, 0, 1)\n"
    inside = point * (MAX_STRUCTURE_CHARACTERS // len(point) + 1)
    for unit in ("", "mm "):
        spec, report = parsed(f"drill 1\nregion r {{ points {unit}{{\n{inside}}} }}\n")
        assert spec is not None, codes(report)


# ── messages ─────────────────────────────────────────────────────────────────────────────────────

TERMINALS = [
    t.name for t in parser._parser().terminals if t.name not in parser._parser().ignore_tokens
]


@pytest.mark.parametrize("name", [*TERMINALS, "$END"])
def test_every_terminal_can_be_said(name: str) -> None:
    said = parser._said([name])
    assert said != "something else"
    assert "(?" not in said
    assert not re.match(r"__|[A-Z]{2}", said)  # not RBRACE, LPAR, __ANON_0


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("program 1", "a name"),
        ("use x", 'a text in "quotes"'),
        ("tool t { number x", "a number"),
        ("region r { points (", "a block of points in { }"),
        ("region r { points (", "a unit"),
        ("region r { posture q", "x, y or z"),
        ("part p { up y", "a signed axis such as -Y"),
        ("region r { select t where x mm", "a comparison"),
        ("expect (", "a hole id"),
        ("robot r portal { side left", "above or below"),
        ("process p [", '"{"'),
        ("robot r portal { limits { q1 0 mm 1 mm", '".."'),
    ],
)
def test_a_message_says_what_is_expected(text: str, wanted: str) -> None:
    spec, report = parsed(f"drill 1\n{text}\n")
    assert spec is None
    found = report.diagnostics[0]
    assert wanted in f"{found.message} {found.hint}"


def test_a_quantity_keeps_its_digits() -> None:
    spec, _ = parsed("drill 1\nprocess p { travel 0.10000000000000000000000000000001 m/s }\n")
    assert spec is not None
    [value] = spec.statements[-1].items[0].values
    assert value == Quantity("0.10000000000000000000000000000001", "m/s", value.span)

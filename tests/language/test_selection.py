"""`where`: and, or, not and comparisons, evaluated on columns and, row by row, in Python."""

from __future__ import annotations

import itertools
import math
import operator
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
from drillc.language.ast import Select
from drillc.language.diagnostics import Report
from drillc.language.points import RawHoles
from drillc.language.selection import select
from hypothesis import given
from hypothesis import strategies as st
from language.texts import codes, parsed

Row = dict[str, object]
Test = Callable[[Row], bool]


@dataclass(frozen=True)
class Written:
    """A condition as text, how tightly its outermost operator binds, and what it means."""

    text: str
    binds: int  # 0 or, 1 and, 2 not, 3 nothing to bind
    means: Test


def condition_of(text: str) -> Select:
    spec, report = parsed(f"drill 1\nregion r {{ select t where {text} }}\n")
    assert spec is not None, [d.message for d in report.diagnostics]
    [value] = spec.statements[-1].items[0].values
    assert isinstance(value, Select)
    return value


def selected(text: str, table: list[Row]) -> list[bool]:
    """What drillc selects; regions A and B are columns of the rows."""

    def column(name: str) -> np.ndarray:
        return np.array([row[name] for row in table], dtype=np.float64)

    zeros = np.zeros(len(table), dtype=np.int32)
    raw = RawHoles(
        ids=np.array([row["id"] for row in table], dtype=np.str_),
        position_mm=np.stack([column(axis) for axis in "xyz"], axis=1),
        normal=np.zeros((len(table), 3)),
        diameter_mm=column("diameter"),
        stack_mm=column("stack"),
        line=zeros,
        column=zeros,
    )
    members = {name: np.array([row[name] for row in table], dtype=np.bool_) for name in "AB"}
    report = Report()
    found = select(condition_of(text).condition, raw, members, report)
    assert codes(report) == []
    assert found.shape == (len(table),)
    return found.tolist()


# ── conditions with their meaning ────────────────────────────────────────────────────────────────

OPERATORS = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
#: Few values, so that equality happens; each with two ways to write it.
VALUES = {"-1 mm": -1.0, "0 m": 0.0, "0.5 mm": 0.5, "500 um": 0.5, "0.002 m": 2.0, "2 mm": 2.0}
COLUMNS = ("x", "y", "z", "diameter", "stack")
IDS = ("F1", "F2", "F10", "T1", "f1")


def like(pattern: str, name: str) -> bool:
    """Independent of fnmatch: * any characters, ? one."""
    pieces = {"*": ".*", "?": "."}
    return bool(re.fullmatch("".join(pieces.get(c, re.escape(c)) for c in pattern), name, re.S))


@st.composite
def leaves(draw: st.DrawFn) -> Written:
    kind = draw(st.sampled_from(["length", "between", "id", "like", "member"]))
    if kind == "member":
        region = draw(st.sampled_from("AB"))
        return Written(f"in {region}", 3, lambda row: bool(row[region]))
    if kind == "id":
        sign, name = draw(st.sampled_from(["==", "!="])), draw(st.sampled_from(IDS))
        return Written(f'id {sign} "{name}"', 3, lambda row: OPERATORS[sign](row["id"], name))
    if kind == "like":
        pattern = draw(st.sampled_from(["F*", "?1", "*1*", "F??", "", "*", "F1"]))
        return Written(f'id like "{pattern}"', 3, lambda row: like(pattern, str(row["id"])))
    column = draw(st.sampled_from(COLUMNS))
    if kind == "between":
        low, high = sorted(draw(st.tuples(*[st.sampled_from(sorted(VALUES))] * 2)), key=VALUES.get)
        return Written(
            f"{column} in {low} .. {high}",
            3,
            lambda row: VALUES[low] <= row[column] <= VALUES[high],
        )
    sign, value = draw(st.sampled_from(sorted(OPERATORS))), draw(st.sampled_from(sorted(VALUES)))
    return Written(
        f"{column} {sign} {value}", 3, lambda row: OPERATORS[sign](row[column], VALUES[value])
    )


@st.composite
def compounds(draw: st.DrawFn, inner: st.SearchStrategy[Written]) -> Written:
    kind = draw(st.sampled_from(["or", "and", "not"]))

    def bracketed(part: Written, least: int) -> str:
        """In parentheses where precedence asks for them, or by whim."""
        asked = part.binds < least
        return f"({part.text})" if asked or draw(st.booleans()) else part.text

    if kind == "not":
        part = draw(inner)
        return Written(f"not {bracketed(part, 2)}", 2, lambda row: not part.means(row))
    parts = draw(st.lists(inner, min_size=2, max_size=4))
    # a and b inside an or needs none; and neither does a or b as the last of an or: it is the same.
    least = 0 if kind == "or" else 1
    text = f" {kind} ".join(bracketed(part, least) for part in parts)
    every = {"or": any, "and": all}[kind]
    return Written(text, least, lambda row: every(part.means(row) for part in parts))


CONDITIONS = st.recursive(leaves(), compounds, max_leaves=12)
LENGTHS = st.sampled_from([-1.0, 0.0, 0.5, 2.0, 3.0])
ROWS = st.fixed_dictionaries(
    {
        "id": st.sampled_from(IDS),
        "x": LENGTHS,
        "y": LENGTHS,
        "z": LENGTHS,
        "diameter": LENGTHS | st.just(math.nan),
        "stack": LENGTHS | st.just(math.nan),
        "A": st.booleans(),
        "B": st.booleans(),
    }
)
#: A table that gives no diameter at all is another matter (E242).
GIVEN = {"id": "F1", "A": True, "B": False} | dict.fromkeys(COLUMNS, 0.5)


@given(CONDITIONS, st.lists(ROWS, max_size=12))
def test_columns_select_what_python_selects(written: Written, some: list[Row]) -> None:
    table = [GIVEN, *some]
    assert selected(written.text, table) == [written.means(row) for row in table]


# ── by hand ──────────────────────────────────────────────────────────────────────────────────────

#: All truth values of a: in A, b: in B, c: x == 0.
TRUTHS = [
    GIVEN | {"A": a, "B": b, "x": 0.0 if c else 1.0}
    for a, b, c in itertools.product([False, True], repeat=3)
]


@pytest.mark.parametrize(
    ("text", "means"),
    [
        ("a or b or c", lambda a, b, c: a or b or c),
        ("a and b and c", lambda a, b, c: a and b and c),
        ("a or b and c", lambda a, b, c: a or (b and c)),
        ("a and b or c", lambda a, b, c: (a and b) or c),
        ("(a or b) and c", lambda a, b, c: (a or b) and c),
        ("a and (b or c)", lambda a, b, c: a and (b or c)),
        ("not a or b", lambda a, b, c: (not a) or b),
        ("not a and b", lambda a, b, c: (not a) and b),
        ("not (a and b)", lambda a, b, c: not (a and b)),
        ("not not c", lambda a, b, c: c),
        ("not not not c", lambda a, b, c: not c),
        ("not not (a or b)", lambda a, b, c: a or b),
        ("a and not b and not c", lambda a, b, c: a and not b and not c),
        ("((((a))))", lambda a, b, c: a),
    ],
)
def test_precedence(text: str, means: Callable[[bool, bool, bool], bool]) -> None:
    letters = {"a": "in A", "b": "in B", "c": "x == 0 mm"}
    written = re.sub(r"\b[abc]\b", lambda m: letters[m[0]], text)
    wanted = [means(*truth) for truth in itertools.product([False, True], repeat=3)]
    assert selected(written, TRUTHS) == wanted


@pytest.mark.parametrize(
    ("text", "means"),
    [
        ("select t in A", lambda a, b: a),
        ("select t not in A", lambda a, b: not a),
        ("select t in A where in B or x == 9 mm", lambda a, b: a and b),
        ("select t not in A where in B or in A", lambda a, b: not a and b),
    ],
)
def test_membership_is_and_with_the_whole_condition(
    text: str, means: Callable[[bool, bool], bool]
) -> None:
    spec, _ = parsed(f"drill 1\nregion r {{ {text} }}\n")
    assert spec is not None
    [value] = spec.statements[-1].items[0].values
    assert isinstance(value, Select)
    truths = [(False, False), (False, True), (True, False), (True, True)]
    raw = RawHoles(
        np.array(["P"] * 4),
        np.zeros((4, 3)),
        np.zeros((4, 3)),
        np.ones(4),
        np.ones(4),
        np.ones(4, np.int32),
        np.ones(4, np.int32),
    )
    members = {name: np.array([truth[i] for truth in truths]) for i, name in enumerate("AB")}
    found = select(value.condition, raw, members, Report())
    assert found.tolist() == [means(*truth) for truth in truths]


def test_what_is_not_given_fails_every_comparison_but_one() -> None:
    table = [GIVEN, GIVEN | {"stack": math.nan}]
    for sign in ("<", "<=", ">", ">=", "=="):
        assert selected(f"stack {sign} 5 mm", table)[1] is False
    assert selected("stack in -9 m .. 9 m", table) == [True, False]
    assert selected("stack != 5 mm", table) == [True, True]
    assert selected("not stack < 5 mm", table) == [False, True]


def test_like_knows_sets_and_is_case_sensitive() -> None:
    table = [GIVEN | {"id": name} for name in ("F1", "G1", "H1", "f1", "F1/2")]
    assert selected('id like "[FG]1"', table) == [True, True, False, False, False]
    assert selected('id like "F*"', table) == [True, False, False, False, True]


@pytest.mark.parametrize("terms", [2000])
def test_many_terms_do_not_nest(terms: int) -> None:
    """a or b or … is one list, not a tree as deep as it is long; so Python's stack is no limit."""
    text = " or ".join(f'id == "F{i}"' for i in range(terms))
    assert selected(text, [GIVEN, GIVEN | {"id": f"F{terms - 1}"}, GIVEN | {"id": "T"}]) == [
        True,
        True,
        False,
    ]
    assert selected("not " * terms + "in A", [GIVEN]) == [True]

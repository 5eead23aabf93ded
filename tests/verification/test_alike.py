"""Stretches of alike lines: nothing lost, nothing doubled, every number in its place."""

from __future__ import annotations

import re

import pytest
from drillc.verification.alike import (
    LEAST,
    NUMBER_SLOT,
    Shapes,
    Stretch,
    shapes_by,
    stretches,
    without,
)
from hypothesis import given
from hypothesis import strategies as st

TOKEN = re.compile(r'"[^"]*"|(?P<name>[A-Za-z_]\w*)|(?P<number>-?\d+(?:\.\d+)?)')
NAMES = {f"P{i}" for i in range(100)}
SHAPE = shapes_by(TOKEN, NAMES)


def rebuilt(stretch: Stretch) -> list[str]:
    """The lines of a stretch, its slots filled again."""

    def filled(text: str, row: tuple[str, ...]) -> str:
        return re.sub(r"([\x01\x02])(\d+)\1", lambda m: row[int(m[2])], text)

    return [
        filled(text, row) for row in zip(*stretch.columns, strict=True) for text in stretch.text
    ]


def test_calls_are_one_stretch() -> None:
    lines = ["start", *(f"drill(P{i},{i}.5)" for i in range(20)), "end"]
    (found,) = stretches(lines, SHAPE)
    assert (found.first, found.count) == (2, 20)
    assert found.text == ("drill(\x020\x02,\x011\x01)",)
    assert found.columns[0][3] == "P3"
    assert found.numbers(1).tolist() == [i + 0.5 for i in range(20)]
    assert found.lines()[:2].tolist() == [[2], [3]]


def test_groups_of_lines_are_one_stretch() -> None:
    lines = [line for i in range(LEAST) for line in ("", f"G0 Z {i}.0", f"call [{i}] [-2.5]")]
    (found,) = stretches(lines, SHAPE)
    assert (found.first, found.count, len(found.text)) == (1, LEAST, 3)
    assert rebuilt(found) == lines
    assert found.lines()[1].tolist() == [4, 5, 6]


@pytest.mark.parametrize("count", [LEAST - 1, LEAST])
def test_few_lines_are_no_stretch(count: int) -> None:
    found = stretches([f"drill(P{i},1)" for i in range(count)], SHAPE)
    assert len(found) == (count >= LEAST)


def test_names_that_are_not_known_and_texts_stay() -> None:
    lines = [f'say(Q{i},"1 of 2",3)' for i in range(LEAST)]
    assert stretches(lines, SHAPE) == []
    (found,) = stretches(['say(Q,"1 of 2",3)'] * LEAST, SHAPE)
    assert found.text == ('say(Q,"1 of 2",\x010\x01)',)


def test_lines_that_hold_slots_themselves_are_left_out() -> None:
    assert stretches(["a \x010\x01 1"] * 20, SHAPE) == []


def test_the_rest_of_the_text_keeps_its_line_numbers() -> None:
    lines = ["start", *(f"drill(P{i},{i})" for i in range(10)), "end"]
    found = stretches(lines, SHAPE)
    text = without(lines, found, lambda index: f"<{index}>").split("\n")
    assert text[:3] == ["start", "<0>", ""]
    assert text[11] == "end"


def test_a_name_that_is_not_known_ends_a_stretch() -> None:
    lines = [f"drill({'Q' if i == 20 else 'P'}{i},{i})" for i in range(40)]
    found = stretches(lines, SHAPE)
    assert [(s.first, s.count) for s in found] == [(1, 20), (22, 19)]
    assert [line for s in found for line in rebuilt(s)] == lines[:20] + lines[21:]


def test_a_sign_is_that_of_a_difference_unless_a_language_says_so() -> None:
    lines = [f"z={sign}{i}" for sign in ("", "-") for i in range(20)]
    (signed,) = stretches(lines, SHAPE)
    assert signed.numbers(0)[[1, 21]].tolist() == [1, -1]
    plain, minus = stretches(lines, Shapes(_unsigned, NAMES, ","))
    assert (plain.text, minus.text) == (("z=\x010\x01",), ("z=-\x010\x01",))
    assert plain.columns == minus.columns


def _unsigned(line: str) -> tuple[str, list[str]]:
    head, number = re.fullmatch(r"(z=-?)(\d+)", line).groups()  # type: ignore[union-attr]
    return head + NUMBER_SLOT, [number]


LINES = st.sampled_from(
    [
        *("", "end", "x", "x 1 2", "x 1 -2", "go P3", "go P4", "go P3 1"),
        *("drill(P1,2)", "drill(P2,-3.5)", "drill(Q1,2)", "drill(P1,2.5,)"),
    ]
)


@given(st.lists(st.tuples(st.lists(LINES, min_size=1, max_size=5), st.integers(1, 15)), max_size=6))
def test_every_line_is_kept_once(groups: list[tuple[list[str], int]]) -> None:
    lines = [line for group, times in groups for line in group * times]
    found = stretches(lines, SHAPE)
    text = without(lines, found, lambda index: f"<{index}>").split("\n")[: len(lines)]
    for stretch in found:
        size = stretch.count * len(stretch.text)
        again = rebuilt(stretch)
        assert again == lines[stretch.first - 1 : stretch.first - 1 + size]
        text[stretch.first - 1 : stretch.first - 1 + size] = again
    assert text == lines

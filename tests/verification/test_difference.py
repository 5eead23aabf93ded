"""Two lists of holes that differ in a known way, and what is said of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drillc.verification.difference import Difference, as_json, as_text, difference
from drillc.verification.made import Made, Step
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

STEPS = (
    Step("go", -62.0, 250.0),
    Step("$OUT[17]", value=1.0),
    Step("$IN[17]", value=1.0, timeout_s=5.0),
    Step("go", 0.0, 5.0),
    Step("go", -62.0, 50.0),
)
DEEP = Rotation.from_euler("x", 180.0, degrees=True).as_matrix()


def made(n: int = 6, named: bool = True) -> Made:
    bottom = np.column_stack([np.arange(n) * 40.0, np.zeros(n), np.zeros(n)])
    names = tuple(f"P{i}" if named else f"line {i}" for i in range(n))
    return Made(
        names,
        bottom,
        np.repeat(DEEP[None], n, axis=0),
        np.full((n, 4), np.nan),
        np.zeros(n, dtype=np.int32),
        (STEPS,),
        lambda row: f"x.src:{row + 10}",
    )


def taken(one: Made, rows: list[int]) -> Made:
    return replace(
        one,
        names=tuple(one.names[i] for i in rows),
        bottom_mm=one.bottom_mm[rows],
        rotation=one.rotation[rows],
        configuration=one.configuration[rows],
        steps=one.steps[rows],
    )


def with_steps(one: Made, row: int, steps: tuple[Step, ...]) -> Made:
    index = one.steps.copy()
    index[row] = 1
    return replace(one, steps=index, step_lists=(*one.step_lists, steps))


def only(found: Difference) -> dict[str, object]:
    (change,) = found.changed
    assert not found.removed
    assert not found.added
    assert not found.order
    return {k: v for k, v in vars(change).items() if v not in (None, ()) and k != "at"}


def test_the_same_is_the_same() -> None:
    found = difference(made(), made())
    assert found.none
    assert as_text(found, "a", "b") == "a and b mean the same: 6 holes\n"


@pytest.mark.parametrize("named", [True, False])
def test_holes_that_come_and_go(named: bool) -> None:
    one, two = made(6, named), taken(made(6, named), [0, 1, 3, 4, 5])
    found = difference(one, two)
    assert [hole for hole, _ in found.removed] == [one.names[2]]
    assert found.removed[0][1] == "x.src:12"
    back = difference(two, one)
    assert [hole for hole, _ in back.added] == [one.names[2]]
    assert (found.changed, found.order, back.changed, back.order) == ((), (), (), ())


def test_a_hole_that_moves() -> None:
    one, two = made(), made()
    two.bottom_mm[3] += [0.3, 0.4, 0.0]
    assert only(difference(one, two)) == {"hole": "P3", "moved_mm": pytest.approx(0.5)}


def test_a_hole_that_is_deeper() -> None:
    one, two = made(), made()
    two.bottom_mm[3] += [0.0, 0.0, -1.5]  # the tool looks down
    found = difference(one, two)
    assert only(found) == {"hole": "P3", "deeper_mm": pytest.approx(1.5)}
    assert "P3  (x.src:13)\n      1.500 mm deeper\n" in as_text(found, "a", "b")


@pytest.mark.parametrize("degrees", [-120.0, 0.01, 90.0, 179.0])
def test_a_heading_that_turns(degrees: float) -> None:
    one, two = made(), made()
    two.rotation[1] = DEEP @ Rotation.from_euler("z", degrees, degrees=True).as_matrix()
    found = only(difference(one, two))
    assert found == {"hole": "P1", "turned_deg": pytest.approx(degrees, abs=1e-9)}


def test_an_axis_that_tilts() -> None:
    one, two = made(), made()
    two.rotation[1] = DEEP @ Rotation.from_euler("y", 2.0, degrees=True).as_matrix()
    assert only(difference(one, two)) == {"hole": "P1", "tilted_deg": pytest.approx(2.0)}


def test_what_is_done_otherwise() -> None:
    one = made()
    slower = (*STEPS[:3], replace(STEPS[3], speed_mm_s=4.0), STEPS[4])
    found = only(difference(one, with_steps(made(), 2, slower)))
    assert found == {"hole": "P2", "steps": ("the plunge: mm/s 5 -> 4",)}
    found = only(difference(one, with_steps(made(), 2, (*STEPS[:2], *STEPS[3:]))))
    assert found == {"hole": "P2", "steps": ("no longer: $IN[17]",)}
    longer = (*STEPS[:2], replace(STEPS[2], timeout_s=3.0), *STEPS[3:])
    found = only(difference(one, with_steps(made(), 2, longer)))
    assert found == {"hole": "P2", "steps": ("$IN[17]: time-out in s 5 -> 3",)}


def pecked(*bottoms: float) -> tuple[Step, ...]:
    moves = [Step("go", -62.0, 250.0), Step("go", -14.0, 50.0)]
    for bottom in bottoms:
        moves += [Step("go", bottom, 5.0), Step("go", -14.0, 50.0), Step("go", bottom - 0.5, 50.0)]
    return (*moves[:-2], Step("go", -62.0, 50.0))


def test_pecks_are_one_plunge() -> None:
    one, two = made(), made()
    one = replace(one, step_lists=(pecked(-11.0, -8.0, -5.0, -2.0, 0.0),))
    two = replace(two, step_lists=(pecked(-10.0, -6.0, -2.0, 0.0),))
    found = difference(one, two)
    assert {change.steps for change in found.changed} == {("the plunge: pecks in mm 3 -> 4",)}
    at_once = replace(two, step_lists=(pecked(0.0),))
    found = difference(one, at_once)
    assert {change.steps for change in found.changed} == {("the plunge: pecks in mm 3 -> none",)}


def test_a_configuration_that_flips() -> None:
    one, two = made(), made()
    one.configuration[:, :2] = [2.0, 43.0]
    two.configuration[:, :2] = [2.0, 43.0]
    two.configuration[4, 0] = 6.0
    assert only(difference(one, two)) == {"hole": "P4", "configuration": ("2 43", "6 43")}


def test_rounding_is_no_change() -> None:
    one, two = made(), made()
    two.bottom_mm[:] += 0.0009
    assert difference(one, two).none


def test_a_hole_that_changes_its_turn() -> None:
    found = difference(made(), taken(made(), [0, 2, 3, 4, 1, 5]))
    assert found.order == ("P1",)
    assert (found.changed, found.removed, found.added) == ((), (), ())


@given(st.permutations(range(8)), st.booleans())
def test_the_fewest_holes_are_out_of_turn(order: list[int], named: bool) -> None:
    found = difference(made(8, named), taken(made(8, named), order))
    longest = [1] * 8
    for i in range(8):
        longest[i] += max((longest[k] for k in range(i) if order[k] < order[i]), default=0)
    assert len(found.order) == 8 - max(longest)
    assert (found.changed, found.removed, found.added) == ((), (), ())


def test_many_changes_are_told_by_their_extent() -> None:
    one, two = made(30), made(30)
    for i in range(30):
        turn = Rotation.from_euler("z", 1.0 + i, degrees=True).as_matrix()
        two.rotation[i] = DEEP @ turn
    found = difference(one, two)
    text = as_text(found, "a", "b")
    assert "changed: 30\n  heading turned: 30 holes, by 1.000 .. 30.000 deg\n" in text
    assert "    and 18 more, each by its own figures\n" in text
    told = as_json(found)
    assert len(told["changed"]) == 30  # type: ignore[arg-type]

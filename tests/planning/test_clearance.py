"""Fixtures and the part: the slab test against points along the segment, and what is reported."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from drillc.geometry.shapes import Mesh, RoundedHull, bounds_mm, capsule, cylinder, placed, sphere
from drillc.geometry.shapes import box as box_between
from drillc.planning.clearance import enters
from hypothesis import assume, example, given
from hypothesis import strategies as st
from language.texts import attempted, codes, only, refused

#: Small whole numbers make segments that touch, graze, or lie in a face.
GRID = st.tuples(*[st.integers(-4, 4).map(float)] * 3)
ANYWHERE = st.tuples(*[st.floats(-4, 4)] * 3)
VECTORS = GRID | ANYWHERE


def box_of(one: tuple[float, ...], other: tuple[float, ...]) -> RoundedHull:
    corners = np.array([one, other])
    return box_between(corners.min(axis=0), corners.max(axis=0))


def entered(start: tuple[float, ...], end: tuple[float, ...], solid: RoundedHull | Mesh) -> bool:
    found = enters(np.array([start]), np.array([end]), solid)
    assert found.shape == (1,)
    return bool(found[0])


@given(VECTORS, VECTORS, VECTORS, VECTORS)
@example((0.0, 0.0, 0.0), (0.0, 0.0, 5e-323), (0.0, 0.0, 0.0), (0.0, 0.0, -1.0))  # 1/5e-323
def test_against_points_along_the_segment(
    start: tuple[float, ...],
    end: tuple[float, ...],
    one: tuple[float, ...],
    other: tuple[float, ...],
) -> None:
    """A point of the segment inside the box means that it enters; none near it means that it does
    not. Points are so dense that a box a little larger than their distance cannot be missed."""
    box = box_of(one, other)
    low_mm, high_mm = bounds_mm(box)
    share = np.linspace(0, 1, 2001)[:, None]
    along = (1 - share) * np.array(start) + share * np.array(end)
    step = float(np.linalg.norm(np.array(end) - np.array(start))) / 2000
    # Rounding may carry a point of a face over it.
    deep = ((along > low_mm + 1e-9) & (along < high_mm - 1e-9)).all(axis=1).any()
    near = ((along >= low_mm - step) & (along <= high_mm + step)).all(axis=1).any()
    found = entered(start, end, box)
    if deep:
        assert found
    if not near:
        assert not found


@given(GRID, GRID, GRID, GRID)
def test_exactly_where_arithmetic_is_exact(
    start: tuple[float, ...],
    end: tuple[float, ...],
    one: tuple[float, ...],
    other: tuple[float, ...],
) -> None:
    """In fractions, touching counts: the box is closed."""
    box = box_of(one, other)
    low_mm, high_mm = bounds_mm(box)
    assume(np.all(high_mm > low_mm))
    least, most = Fraction(0), Fraction(1)
    for a, b, low, high in zip(start, end, low_mm, high_mm, strict=True):
        if a == b:
            if not low <= a <= high:
                least = Fraction(2)
            continue
        first, second = sorted(Fraction(int(v - a), int(b - a)) for v in (low, high))
        least, most = max(least, first), min(most, second)
    assert entered(start, end, box) == (least <= most)
    assert entered(end, start, box) == (least <= most)


UNIT = box_of((0, 0, 0), (1, 1, 1))


@pytest.mark.parametrize(
    ("start", "end", "inside"),
    [
        ((0.5, 0.5, -1), (0.5, 0.5, 2), True),
        ((0.5, 0.5, 0.5), (0.5, 0.5, 0.5), True),
        ((0.2, 0.2, 0.2), (0.8, 0.8, 0.8), True),
        ((1, 0.5, -1), (1, 0.5, 2), True),  # in a face
        ((1, 1, 1), (2, 2, 2), True),  # a corner
        ((-1, 0, 0), (2, 0, 0), True),  # an edge
        ((1 + 1e-9, 0.5, -1), (1 + 1e-9, 0.5, 2), False),
        ((0.5, 0.5, -1), (0.5, 0.5, -1e-9), False),
        ((2, 2, 2), (2, 2, 2), False),
        ((1.6, 0.5, 0), (0.5, 1.6, 0), False),
        ((1.4, 0.5, 0), (0.5, 1.4, 0), True),
        ((1e300, 0.5, 0.5), (-1e300, 0.5, 0.5), True),
    ],
)
def test_by_hand(start: tuple[float, ...], end: tuple[float, ...], inside: bool) -> None:
    assert entered(start, end, UNIT) == inside
    assert entered(end, start, UNIT) == inside


def test_many_segments_at_once() -> None:
    start = np.array([[0.5, 0.5, -1], [5, 5, 5], [0.5, 0.5, 0.5]])
    end = np.array([[0.5, 0.5, 2], [6, 6, 6], [9, 9, 9]])
    assert enters(start, end, UNIT).tolist() == [True, False, True]
    assert enters(start[:0], end[:0], UNIT).tolist() == []


CUBE = Mesh(
    100.0 * UNIT.points_mm,
    np.array(
        [
            *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
            *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
        ]
    ),
)
TURN = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize(
    ("solid", "start", "end", "inside"),
    [
        (sphere((0, 0, 0), 10.0), (-20, 9.9, 0), (20, 9.9, 0), True),
        (sphere((0, 0, 0), 10.0), (-20, 10.1, 0), (20, 10.1, 0), False),
        (sphere((0, 0, 0), 10.0), (1, 0, 0), (2, 0, 0), True),  # wholly inside
        (sphere((0, 0, 0), 10.0), (7.2, 7.2, 0), (20, 20, 0), False),  # in the box around it only
        (capsule((0, 0, 0), (0, 0, 50), 10.0), (9.9, -9, 25), (9.9, 9, 25), True),
        (capsule((0, 0, 0), (0, 0, 50), 10.0), (0, 0, 60.1), (0, 0, 99), False),
        (cylinder((0, 0, 0), (0, 0, 50), 10.0), (9.9, 0, 25), (9.9, 0, 49), True),
        (cylinder((0, 0, 0), (0, 0, 50), 10.0), (10.1, 0, 25), (10.1, 0, 49), False),
        (cylinder((0, 0, 0), (0, 0, 50), 10.0), (9, 9, 25), (9, 9, 49), False),
        # The corner of a turned box is at (0.2, 1.4): the one beside it, (0, 1.4), is outside.
        (placed(UNIT, TURN, (0, 0, 0)), (0.2, 1.3, 0.5), (0.2, 1.2, 0.5), True),
        (placed(UNIT, TURN, (0, 0, 0)), (-0.1, 1.3, 0.5), (-0.3, 1.2, 0.5), False),
        (CUBE, (40, 50, 50), (60, 50, 50), True),  # wholly inside a mesh
        (CUBE, (50, 50, -10), (50, 50, 200), True),
        (CUBE, (100.1, 50, -10), (100.1, 50, 200), False),
    ],
)
def test_other_solids_than_boxes(
    solid: RoundedHull | Mesh, start: tuple[float, ...], end: tuple[float, ...], inside: bool
) -> None:
    assert entered(start, end, solid) == inside
    assert entered(end, start, solid) == inside


# ── what is reported ─────────────────────────────────────────────────────────────────────────────


def spec(points: str, fixture: str, depth: str = "10 mm") -> str:
    return f"""drill 1
program P
part p {{ up +Z  normals into }}
fixture jig {{ {fixture} }}
process d {{ approach 50 mm  retract 30 mm  spindle 3000 rpm  feed 0.1 mm/rev  depth {depth} }}
region r {{ posture x toward +X  process d  points mm {{
{points}
}} }}
"""


A = "A (0, 0, 0) normal (0, 0, -1)"
B = "B (100, 0, 0) normal (0, 0, -1)"


@pytest.mark.parametrize(
    ("fixture", "found"),
    [
        ("box (-5, -5, 45) (5, 5, 49) mm", [("E360", 7)]),  # at A's standoff
        ("box (-5, -5, 51) (5, 5, 60) mm", []),  # above it
        ("box (95, -5, -9) (105, 5, -5) mm", [("E360", 8)]),  # below B, in its hole
        ("box (95, -5, -20) (105, 5, -11) mm", []),  # deeper than the hole
        # From A's retract, 30 mm, to B's approach, 50 mm: at half way 40 mm.
        ("box (49, -5, 38) (51, 5, 42) mm", [("E361", 8)]),
        ("box (49, -5, 43) (51, 5, 90) mm", []),
        ("box (49, -5, 0) (51, 5, 37) mm", []),
        ("box (49, 5, 38) (51, 9, 42) mm  box (-1, -1, 20) (1, 1, 21) mm", [("E360", 7)]),
    ],
)
def test_where_the_path_enters_a_fixture(
    tmp_path: Path, fixture: str, found: list[tuple[str, int]]
) -> None:
    _, report = attempted(tmp_path, spec(f"{A}\n{B}", fixture))
    assert [(d.code, d.span.line) for d in report.diagnostics if d.span] == found
    for diagnostic in report.diagnostics:
        assert diagnostic.labels[0].span.line == 4


def test_between_regions_nothing_is_checked_but_the_plunges(tmp_path: Path) -> None:
    text = spec(A, "box (49, -5, 38) (51, 5, 42) mm")
    text += f"region s {{ posture x toward +X  process d  points mm {{ {B} }} }}\n"
    _, report = attempted(tmp_path, text)
    assert codes(report) == []


def test_tilted_holes_are_followed_along_their_own_axis(tmp_path: Path) -> None:
    point = "A (0, 0, 0) normal (0.6, 0, -0.8)"  # the standoff is at (-30, 0, 40)
    report = refused(tmp_path, spec(point, "box (-31, -1, 39) (-29, 1, 41) mm"))
    assert only(report).code == "E360"
    _, report = attempted(tmp_path, spec(point, "box (29, -1, 39) (31, 1, 41) mm"))
    assert codes(report) == []


def test_a_bulge_between_holes_is_a_warning(tmp_path: Path) -> None:
    """On a cylinder of 1 m radius, 60 degrees apart: it rises by 1000 (1 - cos 30°) = 134 mm over
    the chord; the tool travels min(30, 50) cos 30° = 26 mm over it."""
    half, up = 500.0, 866.02540378
    a = f"A ({-half}, 0, {up}) normal (0.5, 0, -0.8660254)"
    b = f"B ({half}, 0, {up}) normal (-0.5, 0, -0.8660254)"
    fixture = "box (900, 900, 900) (999, 999, 999) mm"
    result, report = attempted(tmp_path, spec(f"{a}\n{b}", fixture))
    assert result is not None
    found = only(report)
    assert found.code == "W362"
    assert "134 mm" in found.message
    assert "60 deg" in found.message
    assert "26 mm" in found.message
    # Seen from inside, the same two holes lie in a hollow.
    inward = f"{a}\n{b}".replace("-0.8660254)", "0.8660254)").replace("(0.5,", "(w,")
    inward = inward.replace("(-0.5,", "(0.5,").replace("(w,", "(-0.5,")
    _, report = attempted(tmp_path, spec(inward, fixture))
    assert codes(report) == []


def test_between_two_stations_of_an_arm_the_tool_does_not_go(tmp_path: Path) -> None:
    text = """drill 1
program P
part p { up +Z  normals into  frame 1 }
tool drill { number 1  tcp (0, 0, 250) mm }
robot arm1 arm { model kuka_kr210_r3100_2
  station one frame 1 at (0, -1800, 0) mm rotate z 90 deg
  station two frame 2 at (0, -1800, 100) mm rotate z 90 deg
  home { A1 0 deg  A2 -90 deg  A3 90 deg  A4 0 deg  A5 30 deg  A6 0 deg } }
region r { station one  posture x horizontal toward +X  turning within 180 deg
           points mm { A (300, 67, 1250) normal (0, 0.866, -0.5) } }
region s { station two  posture x horizontal toward +X  turning within 180 deg
           points mm { B (300, 67, 750) normal (0, 0.866, 0.5) } }
emit krl
"""
    _, report = attempted(tmp_path, text)
    assert codes(report) == []
    # From one station it does go from A to B, over whatever bulges between them.
    _, report = attempted(
        tmp_path,
        text.replace("station two  posture", "station one  posture").replace(
            "  station two frame 2 at (0, -1800, 100) mm rotate z 90 deg\n", ""
        ),
    )
    assert codes(report) == ["W362"]

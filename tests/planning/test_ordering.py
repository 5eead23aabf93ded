"""`order shortest`: what is made is the same, only in a shorter order within each region."""

from __future__ import annotations

from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from drillc.driver import Planned, plan_spec
from drillc.language.diagnostics import Report
from drillc.language.job import ExpectPosition
from drillc.planning.ordering import in_order, take


def planned(folder: Path, points: list[np.ndarray], order: str, more: str = "") -> Planned:
    """Regions r0, r1, … of these points (k, 3), mm."""
    regions = ""
    for i, region in enumerate(points):
        rows = "  ".join(
            f"H{i}_{k} ({x:.17g}, {y:.17g}, {z:.17g}) normal (0, 0, -1)"
            for k, (x, y, z) in enumerate(region.tolist())
        )
        regions += f"region r{i} {{ posture x toward +X  points mm {{ {rows} }} }}\n"
    text = (
        "drill 1\nprogram P\npart p { up +Z  normals into  frame 3 }\n"
        f"tool t {{ number 2  tcp (0, 0, 100) mm }}\n{regions}sequence {{ {order} }}\n{more}"
    )
    path = folder / "spec.drill"
    path.write_text(text, encoding="utf-8")
    return plan_spec(path, None, Report())


def length(points: np.ndarray) -> float:
    return float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())


@pytest.mark.parametrize("seed", range(4))
def test_each_region_is_a_short_tour_of_its_own_holes(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = [rng.uniform(0, 300, (k, 3)) for k in (6, 1, 5)]
    given = planned(tmp_path, points, "order given").job
    made = planned(tmp_path, points, "order shortest").job
    assert sorted(made.holes.ids.tolist()) == sorted(given.holes.ids.tolist())
    assert made.holes.region.tolist() == given.holes.region.tolist()
    for i, region in enumerate(points):
        rows = made.holes.region == i
        least = min(length(region[list(order)]) for order in permutations(range(len(region))))
        assert length(made.holes.position_mm[rows]) <= 1.2 * least + 1e-9
    assert length(made.holes.position_mm) < length(given.holes.position_mm)
    # Everything of a hole goes with it.
    place = {name: row for row, name in enumerate(given.holes.ids.tolist())}
    rows = [place[name] for name in made.holes.ids.tolist()]
    assert rows != sorted(rows)
    for column in ("position_mm", "feed", "line", "column", "source", "region"):
        np.testing.assert_array_equal(
            getattr(made.holes, column), getattr(given.holes, column)[rows]
        )
    assert made.holes.span(0).line == given.holes.span(rows[0]).line


def test_the_order_given_is_kept_unless_asked(tmp_path: Path) -> None:
    points = [np.random.default_rng(0).uniform(0, 300, (8, 3))]
    job = planned(tmp_path, points, "order given").job
    assert job.holes.ids.tolist() == [f"H0_{k}" for k in range(8)]
    assert in_order(job) is job


def test_expectations_follow_their_holes(tmp_path: Path) -> None:
    points = [np.random.default_rng(5).uniform(0, 300, (7, 3)).round(3)]
    more = "".join(
        f"expect H0_{k} at ({x}, {y}, {z}) mm within 0.01 mm\n"
        for k, (x, y, z) in enumerate(points[0].tolist())
    )
    job = planned(tmp_path, points, "order shortest", more + "expect r0 holes 7\n").job
    rows = [e.row for e in job.expects if isinstance(e, ExpectPosition)]
    assert [job.holes.ids[row] for row in rows] == [f"H0_{k}" for k in range(7)]
    assert rows != list(range(7))


def test_the_order_does_not_depend_on_the_order_given(tmp_path: Path) -> None:
    """But for the first hole, which decides at which end to begin."""
    points = np.random.default_rng(3).uniform(0, 300, (20, 3))
    one = planned(tmp_path, [points], "order shortest").job.holes.position_mm
    shuffled = points[np.r_[0, np.random.default_rng(4).permutation(19) + 1]]
    other = planned(tmp_path, [shuffled], "order shortest").job.holes.position_mm
    np.testing.assert_array_equal(one, other)


def test_rows_are_taken_in_the_order_asked_for(tmp_path: Path) -> None:
    holes = planned(tmp_path, [np.arange(12.0).reshape(4, 3)], "order given").job.holes
    some = take(holes, np.array([2, 0]))
    assert some.ids.tolist() == ["H0_2", "H0_0"]
    np.testing.assert_array_equal(some.position_mm, holes.position_mm[[2, 0]])
    assert some.sources == holes.sources

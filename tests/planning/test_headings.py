"""Headings against a search in tenths of a degree: python-fcl for the tool, the arm by py-opw."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drillc.planning.cycle_check import Candidates
from drillc.planning.headings import ARM_FINEST_RAD, FINEST_RAD, preferred, turned
from drillc.planning.tool_sweeps import make_tool_sweeps
from planning.arm_scenes import (
    HIGH,
    LOW,
    Box,
    Capsule,
    Scene,
    cycle_poses,
    cycles_of,
    tool_is_free,
    turn,
)

STEP = np.radians(0.1)
#: The tool looks ahead, its x axis down. With the tool's point on the flange's axis and these
#: limits, the arm follows at every heading.
AHEAD = turn("y", 90)
HOLE = np.array([1900.0, 200.0, 1200.0])
WIDE = {
    "low": LOW - np.array([0, 0, 0, 9, 0, 9]),
    "high": HIGH + np.array([0, 0, 0, 9, 0, 9]),
    "singular_deg": 0.0,
}
#: A spindle and an outrigger along the tool's x, 120 mm behind its point.
BODY = (Capsule((0, 0, 40), (0, 0, 210), 30.0), Capsule((0, 0, 130), (200, 0, 130), 20.0))
FREE = Scene(body=BODY, links=False, **WIDE)


def hole(**kinds):
    return cycles_of([HOLE], AHEAD, approach=30.0, retract=20.0, depth=10.0, **kinds)


def post(heading_deg, out_mm=150.0, wide_mm=30.0):
    """A beam beside the hole, towards the arm, across where the outrigger is at that heading."""
    angle = np.radians(heading_deg)
    # The tool's x axis at heading h is AHEAD @ (cos h, sin h, 0): (0, sin h, -cos h).
    at = HOLE + out_mm * np.array([0.0, np.sin(angle), -np.cos(angle)])
    low, high = at - wide_mm, at + wide_mm
    low[0], high[0] = HOLE[0] - 260, HOLE[0] - 60
    return Box(tuple(low), tuple(high))


def search(scene, cycles, within_deg):
    return turned_with(scene, cycles, np.array([0]), np.radians([within_deg]))


def turned_with(scene, cycles, rows, turning_rad, **more):
    cell = scene.cell()
    return turned(cell, cycles, make_tool_sweeps(cell, cycles), rows, turning_rad, **more)


def follows(scene, cycles, row, heading_rad):
    """Whether some branch takes the arm through the cycle, in its limits, its wrist bent."""
    poses = cycle_poses(cycles, row, heading_rad, step_mm=5.0)
    for start in scene.branches(poses[:1])[0]:
        if np.isnan(start).any():
            continue
        way = scene.follow(start, poses)
        if np.isnan(way).any() or np.abs(np.diff(way, axis=0)).max() > 0.3:
            continue
        bend = np.abs((way[:, 4] + np.pi / 2) % np.pi - np.pi / 2).min()
        turns = 2 * np.pi * np.arange(-3, 4)[:, None]
        low, high = way.min(axis=0) + turns, way.max(axis=0) + turns
        fits = ((low >= scene.low) & (high <= scene.high)).any(axis=0).all()
        if fits and bend >= np.radians(scene.singular_deg):
            return True
    return False


def dense(scene, cycles, within_rad, row=0):
    """The smallest turns that work on either side, positive first; infinite where none does. Looked
    for in steps of a degree, then of a tenth."""
    found = []
    for side in (1.0, -1.0):

        def works(away, side=side):
            heading = side * away
            return tool_is_free(scene, cycles, row, heading) and follows(
                scene, cycles, row, heading
            )

        coarse = np.append(np.arange(0.0, within_rad, 10 * STEP), within_rad)
        least = next((away for away in coarse if works(away)), np.inf)
        finer = least - STEP * np.arange(9, 0, -1)
        found.append(next((away for away in finer if 0 <= away < np.inf and works(away)), least))
    return found


def nearest(candidates: Candidates):
    """Of candidates, the smallest turns on either side."""
    heading = candidates.heading_rad
    return [np.abs(heading[side]).min(initial=np.inf) for side in (heading >= 0, heading <= 0)]


# ── the tool alone ───────────────────────────────────────────────────────────────────────────────

SCENES = {
    "one post": [post(5)],
    "a post to either side": [post(-20), post(25)],
    "close to half a turn": [post(h) for h in range(-135, 150, 15)],
    "only across half a turn": [post(h) for h in range(-150, 165, 15)],
    "a window of a few degrees": [post(0), post(22.5, 190, 20), post(60), post(-30), post(-60)],
    "a wall above": [Box((1600, -400, 1100), (1860, 600, 1150))],
}


@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("clearance", [2.0, 12.0])
def test_the_nearest_free_heading_is_that_of_a_dense_search(name, clearance):
    scene = FREE.with_(guards=(tuple(SCENES[name]),), clearance=((clearance, 2.0),))
    cycles = hole()
    assert not tool_is_free(scene, cycles, 0, 0.0)
    expected = min(dense(scene, cycles, np.pi))
    found = min(nearest(search(scene, cycles, 180)))
    assert found == pytest.approx(expected, abs=2 * FINEST_RAD)
    # Exact distances decide at the edge: a little nearer, fcl finds it too near.
    headings = {h for h in search(scene, cycles, 180).heading_rad if abs(h) == found}
    nearer = [h - np.sign(h) * 0.5 * FINEST_RAD for h in headings]
    assert not all(tool_is_free(scene, cycles, 0, h, step_mm=0.5) for h in nearer)
    # Every one of them is free.
    slack = scene.with_(clearance=((clearance - 0.05, 2.0),))
    for heading in np.unique(search(scene, cycles, 180).heading_rad):
        assert tool_is_free(slack, cycles, 0, heading)


def test_a_range_that_ends_just_before_or_behind_the_nearest_free_heading():
    scene = FREE.with_(guards=(tuple(SCENES["one post"]),), clearance=((12.0, 2.0),))
    cycles = hole()
    least = np.degrees(min(dense(scene, cycles, np.pi)))
    assert len(search(scene, cycles, least - 0.2)) == 0
    assert len(search(scene, cycles, least + 0.5)) > 0


@pytest.mark.parametrize("within_deg", [3.0, 29.0, 77.7, 180.0])
def test_nothing_turns_farther_than_it_may(within_deg):
    scene = FREE.with_(guards=(tuple(SCENES["one post"]),), clearance=((2.0, 2.0),))
    found = turned_with(scene, hole(), np.array([0]), np.radians([within_deg]), enough=1000)
    assert (np.abs(found.heading_rad) <= np.radians(within_deg) + 1e-12).all()
    if within_deg > 40:
        # All of the free range is offered, in steps of a few degrees.
        free = np.sort(np.abs(found.heading_rad))
        assert free[-1] > np.radians(within_deg - 6)
        assert np.diff(free).max() < np.radians(6)


def test_nothing_stands_around():
    """The rule's own heading, and with more asked for, all around."""
    cycles = hole()
    cell = FREE.cell()
    sweeps = make_tool_sweeps(cell, cycles)
    assert (preferred(cell, cycles, sweeps, np.array([0])).heading_rad == 0.0).all()
    assert (search(FREE, cycles, 90).heading_rad == 0.0).any()
    around = turned_with(FREE, cycles, np.array([0]), np.array([np.pi]), enough=1000)
    assert np.ptp(around.heading_rad) == pytest.approx(2 * np.pi)


def test_the_rules_own_heading_is_taken_where_it_is_free():
    scene = FREE.with_(guards=((post(90),),), clearance=((2.0, 2.0),))
    cell, cycles = scene.cell(), cycles_of([HOLE] * 2, AHEAD, approach=30.0, retract=20.0)
    cycles.rotation[1] = AHEAD @ turn("z", 90)
    found = preferred(cell, cycles, make_tool_sweeps(cell, cycles), np.arange(2))
    assert set(found.row.tolist()) == {0}
    assert not found.heading_rad.any()


# ── the arm too ──────────────────────────────────────────────────────────────────────────────────

#: The tool's point aside of the flange's axis: turning it swings the wrist around the hole.
ANGLED = Scene(
    flange_from_tool=(turn("y", -90), np.array([-350.0, 0, 250])),
    body=(Capsule((0, 0, 40), (0, 0, 250), 60.0), Capsule((0, 0, 250), (-280, 0, 250), 40.0)),
    links=False,
)


@pytest.mark.parametrize(
    ("place", "lean"),
    [
        ((2500, 300, 800), (0, 90, 0)),
        ((2700, -600, 500), (0, 110, 20)),
        ((2000, 900, 300), (30, 150, 0)),
        ((2850, 0, 1300), (90, 90, 0)),
    ],
)
def test_the_nearest_heading_at_which_the_arm_follows(place, lean):
    """What the arm cannot do at the rule's heading it can at another."""
    rotation = turn("zyx", *lean)
    cycles = cycles_of([place], rotation, approach=40.0, retract=40.0, depth=10.0)
    steps = np.arange(0, 181, 1.0)
    works = [h for s in (1, -1) for h in s * steps if follows(ANGLED, cycles, 0, np.radians(h))]
    found = search(ANGLED, cycles, 180)
    if not works:
        assert not len(found)
        return
    expected = min(dense(ANGLED, cycles, np.pi))
    tolerance = STEP + (ARM_FINEST_RAD if expected > 0 else 0)
    assert np.abs(found.heading_rad).min() == pytest.approx(expected, abs=tolerance)
    for heading in found.heading_rad:
        assert follows(ANGLED, cycles, 0, heading)


def limited_to(low_deg, high_deg):
    """The arm follows only at headings low … high: A6 alone turns with them."""
    cycles = hole()
    free = FREE.branches(cycle_poses(cycles, 0, 0.0)[:1])[0]
    start = free[~np.isnan(free).any(axis=1) & ((free >= LOW) & (free <= HIGH)).all(axis=1)][0]
    way = FREE.follow(start, cycle_poses(cycles, 0, 0.1)[:1])[0]
    sign = np.sign(way[5] - start[5])
    ends = np.sort(start[5] + sign * np.radians([low_deg, high_deg]))
    low, high = start - 0.3, start + 0.3
    low[5], high[5] = ends
    return FREE.with_(low=low, high=high), cycles


@pytest.mark.parametrize("window", [(75, 90), (-120, -80), (100, 103), (-153, -150), (40.5, 41.7)])
def test_headings_far_away_are_found_though_the_tool_is_free_nearby(window):
    """Posts all around keep any long range of headings from being free; the arm follows only far
    from where the tool first is, and perhaps over a few degrees only."""
    scene, cycles = limited_to(*window)
    posts = tuple(post(h, wide_mm=4.0) for h in (20, 60, 135, 170, -20, -60, -135, -170))
    scene = scene.with_(guards=(posts,), clearance=((2.0, 2.0),))
    expected = min(np.abs(window))
    assert tool_is_free(scene, cycles, 0, np.radians(np.mean(window)))
    found = search(scene, cycles, 180)
    assert len(found)
    assert np.degrees(np.abs(found.heading_rad).min()) == pytest.approx(expected, abs=0.7)


def test_no_heading_works_for_tool_and_arm_at_once():
    scene, cycles = limited_to(10, 40)
    blocked = scene.with_(guards=((post(10), post(40), post(25)),), clearance=((12.0, 2.0),))
    assert dense(blocked, cycles, np.pi) == [np.inf, np.inf]
    assert len(search(blocked, cycles, 180)) == 0


# ── many holes ───────────────────────────────────────────────────────────────────────────────────


def many():
    rng = np.random.default_rng(8)
    n = 12
    position = HOLE + rng.uniform(-60, 60, (n, 3)) * [0.2, 1, 1]
    rotation = np.array([AHEAD @ turn("xyz", *rng.uniform(-20, 20, 3)) for _ in range(n)])
    cycles = cycles_of(position, rotation, approach=30.0, retract=20.0)
    scene = FREE.with_(guards=((post(5), post(60, 200)),), clearance=((5.0, 2.0),))
    turning = np.radians(rng.choice([25.0, 60.0, 180.0], n))
    return scene, cycles, turning


def columns(candidates, rows=None):
    some = slice(None) if rows is None else np.isin(candidates.row, rows)
    return [np.asarray(getattr(candidates, name))[some] for name in ("heading_rad", "joints")]


def test_the_same_again_and_alone_and_in_any_order():
    scene, cycles, turning = many()
    rows = np.arange(len(cycles))
    first = turned_with(scene, cycles, rows, turning)
    again = turned_with(scene, cycles, rows, turning)
    for one, other in zip(columns(first), columns(again), strict=True):
        np.testing.assert_array_equal(one, other)
    order = np.random.default_rng(0).permutation(len(cycles))
    shuffled = replace(
        cycles,
        **{name: getattr(cycles, name)[order] for name in cycles.__dataclass_fields__},
    )
    mixed = turned_with(scene, shuffled, rows, turning[order])
    for row in rows:
        alone = turned_with(scene, cycles, rows[row : row + 1], turning[row : row + 1])
        place = int(np.flatnonzero(order == row)[0])
        mine, other = columns(first, [row]), columns(mixed, [place])
        assert len(mine[0]) == len(other[0])
        for a, b in zip(mine, other, strict=True):
            np.testing.assert_allclose(a, b, atol=1e-9)
        # (Ranges of one's own are halved differently when alone.)
        if len(mine[0]):
            least, best = (np.abs(c[0]).min() for c in (mine, columns(alone)))
            assert least == pytest.approx(best, abs=2 * FINEST_RAD)
        else:
            assert not len(alone)

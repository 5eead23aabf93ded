"""The ways between holes: driven again in fine steps, by python-fcl and py-opw-kinematics."""

from __future__ import annotations

import numpy as np
import pytest
from drillc.planning.arm_travel import LIFTS_MM, make_legs, plan_travel
from drillc.planning.cell import LEAST_GAP_MM
from drillc.planning.cycle_check import assess, join
from drillc.planning.moves import HIT
from planning.arm_scenes import (
    HOME,
    Box,
    Scene,
    cycles_of,
    line,
    matrix,
    turn,
)

AHEAD = turn("y", 90)
SCENE = Scene()
#: A home that is nearer to the arm than any hole or fixture here.
BACK = np.radians([0, -120, 120, 0, 60, 0])
EXACT_MM = 0.05


def holes(places, **kinds):
    kinds = {"approach": 50.0, "retract": 40.0, "depth": 10.0, **kinds}
    return cycles_of(np.array(places, float), AHEAD, **kinds)


def chosen_of(scene, cycles, heading_deg=0.0, prefer=None):
    """For each hole the candidate nearest to `prefer` (home's joints)."""
    n = len(cycles)
    heading = np.radians(np.broadcast_to(np.asarray(heading_deg, float), n))
    every = assess(scene.cell(), cycles, np.arange(n), heading).candidates
    near = np.broadcast_to(HOME if prefer is None else prefer, (n, 6))
    picks = []
    for row in range(n):
        some = np.flatnonzero(every.row == row)
        picks.append(some[np.abs(every.joints[some] - near[row]).sum(axis=1).argmin()])
    return every.take(np.array(picks))


def planned(scene, cycles, chosen, section=None):
    cell = scene.cell()
    legs = make_legs(cell, cycles.region if section is None else np.asarray(section))
    return (*plan_travel(cell, cycles, chosen, legs), legs)


def pose_of(cycles, chosen, row, away_mm):
    rotation = cycles.rotation[row] @ turn("z", np.degrees(chosen.heading_rad[row]))
    position = cycles.position_mm[row] - away_mm * cycles.rotation[row][:, 2]
    return matrix(rotation, position)


def drive(scene, cycles, chosen, vias):
    """Every way between the cycles, (region's number or -1, joints (k, 6)), as the program drives
    it; arrives everywhere where it should, or fails."""
    count = len(cycles)
    ways = []
    now = scene.home
    for hole in range(count + 1):
        inner = 0 < hole < count and cycles.region[hole] == cycles.region[hole - 1]
        region = int(cycles.region[hole]) if inner else -1
        for i in np.flatnonzero(vias.before == hole):
            target = matrix(vias.part_from_tool[i], vias.position_mm[i])
            np.testing.assert_allclose(scene.tool(vias.joints[i][None])[0], target, atol=1e-6)
            if vias.by_joints[i]:
                if now is not None:
                    far = np.abs(vias.joints[i] - now).max()
                    share = np.linspace(0, 1, max(2, int(far / 0.0005)))[:, None]
                    ways.append((region, now + (vias.joints[i] - now) * share))
            else:
                way = scene.follow(now, line(scene.tool(now[None])[0], target))
                np.testing.assert_allclose(way[-1], vias.joints[i], atol=1e-6)
                ways.append((region, way))
            now = vias.joints[i]
        if hole < count:
            standoff = pose_of(cycles, chosen, hole, cycles.approach_mm[hole])
            way = scene.follow(now, line(scene.tool(now[None])[0], standoff))
            np.testing.assert_allclose(way[-1], chosen.standoff[hole], atol=1e-6)
            ways.append((region, way))
            now = chosen.leave[hole]
    if scene.home is not None:
        np.testing.assert_array_equal(now, scene.home)
    return ways


def check_drive(scene, cycles, chosen, vias):
    """Drive and look: clear of everything, within limits, without leaps."""
    ways = drive(scene, cycles, chosen, vias)
    for region, way in ways:
        assert not np.isnan(way).any()
        assert (way >= scene.low - 1e-6).all()
        assert (way <= scene.high + 1e-6).all()
        assert np.abs(np.diff(way, axis=0)).max(initial=0) < 0.1
        some = np.unique(np.append(np.arange(0, len(way), 8), len(way) - 1))
        gaps = scene.gaps_mm(way[some])
        for g, clearance in enumerate(scene.clearance):
            # Between two places that are looked at, nothing moves by more than 8 half steps.
            kept = clearance[region] - LEAST_GAP_MM
            near = some[gaps[g] < kept + 8]
            rows = np.unique((near[:, None] + np.arange(-8, 9)).clip(0, len(way) - 1))
            if len(rows):
                assert scene.gaps_mm(way[rows])[g].min() > kept - EXACT_MM
    return ways


ROW = [(1900, y, 1200) for y in (-150, 0, 150)]


def test_nothing_in_the_way():
    """By joints to the first standoff, straight from hole to hole, by joints home."""
    cycles = holes(ROW)
    chosen = chosen_of(SCENE, cycles)
    vias, blocked, legs = planned(SCENE, cycles, chosen)
    assert blocked == []
    assert legs.leaves.tolist() == [-1, 0, 1, 2]
    assert legs.reaches.tolist() == [0, 1, 2, -1]
    assert legs.section.tolist() == [True, False, False, True]
    assert vias.before.tolist() == [0, 3]
    assert vias.by_joints.tolist() == [True, True]
    np.testing.assert_array_equal(vias.joints, [chosen.standoff[0], HOME])
    check_drive(SCENE, cycles, chosen, vias)


def test_each_section_begins_by_joints():
    cycles = holes(ROW * 2, region=[0, 0, 0, 1, 1, 2])
    chosen = chosen_of(SCENE, cycles)
    vias, blocked, _ = planned(SCENE, cycles, chosen)
    assert blocked == []
    assert vias.before.tolist() == [0, 3, 5, 6]
    assert vias.by_joints.all()
    np.testing.assert_array_equal(vias.joints[:3], chosen.standoff[[0, 3, 5]])
    check_drive(SCENE, cycles, chosen, vias)


@pytest.mark.parametrize("count", [1, 3])
def test_without_a_home(count):
    scene = SCENE.with_(home=None)
    cycles = holes(ROW[:count])
    chosen = chosen_of(scene, cycles)
    vias, blocked, legs = planned(scene, cycles, chosen)
    assert blocked == []
    assert len(legs) == count - 1
    assert vias.before.tolist() == [0]
    assert vias.by_joints.tolist() == [True]
    np.testing.assert_array_equal(vias.joints, chosen.standoff[:1])
    check_drive(scene, cycles, chosen, vias)


def test_one_hole_from_home_and_back():
    cycles = holes(ROW[:1])
    chosen = chosen_of(SCENE, cycles)
    vias, blocked, _ = planned(SCENE, cycles, chosen)
    assert blocked == []
    assert vias.before.tolist() == [0, 1]
    check_drive(SCENE, cycles, chosen, vias)


def fence(out_mm, y=75.0, thick=10.0, low_z=1000.0):
    """A wall between two holes of the row that stands `out_mm` out of the part."""
    return Box((1900 - out_mm, y - thick, low_z), (1950, y + thick, 2000))


@pytest.mark.parametrize("out_mm", [80.0, 140.0, 300.0])
def test_the_tool_withdraws_as_far_as_it_must(out_mm):
    """Of the lifts, the first with which python-fcl finds the straight way clear."""
    guards, clearance = ((fence(out_mm),),), ((12.0, 2.0),)
    scene = SCENE.with_(guards=guards, clearance=clearance, links=False, home=BACK)
    cycles = holes(ROW[1:])
    chosen = chosen_of(scene, cycles)
    vias, blocked, _ = planned(scene, cycles, chosen)
    assert blocked == []
    assert vias.before[:3].tolist() == [0, 1, 1]
    assert (vias.before[3:] == 2).all()
    assert vias.by_joints[:3].tolist() == [True, False, False]
    lift = [
        np.linalg.norm(vias.position_mm[i] - cycles.position_mm[hole]) - away
        for i, hole, away in ((1, 0, 40.0), (2, 1, 50.0))
    ]
    clear = []
    for more in (0.0, *LIFTS_MM):
        start, stop = (pose_of(cycles, chosen, h, a + more) for h, a in ((0, 40.0), (1, 50.0)))
        begin = scene.follow(chosen.leave[0], line(pose_of(cycles, chosen, 0, 40.0), start, 1.0))[
            -1
        ]
        way = scene.follow(begin, line(start, stop, 2.0))
        clear.append(scene.gaps_mm(way).min() > 10.0)
    first = (0.0, *LIFTS_MM)[clear.index(True)]
    assert first > 0
    np.testing.assert_allclose(lift, first, atol=1e-6)
    check_drive(scene, cycles, chosen, vias)


def test_another_branch_or_another_turn_is_reached_by_joints():
    """The same holes with the wrist turned over at the second, and A6 a turn on at the fourth."""
    cycles = holes([(1900, y, 1200) for y in (-150, 0, 150, 300)])
    plain = chosen_of(SCENE, cycles, 90.0)
    over = plain.joints[1] + [0, 0, 0, np.pi, 0, -np.pi]
    over[4] = -over[4]
    over[[3, 5]] = (over[[3, 5]] + np.pi) % (2 * np.pi) - np.pi
    prefer = np.stack([plain.joints[0], over, plain.joints[2], plain.joints[3]])
    chosen = chosen_of(SCENE, cycles, 90.0, prefer)
    assert chosen.branch[1] != chosen.branch[0] == chosen.branch[2]
    prefer[2:, 5] += 2 * np.pi * (1 if plain.joints[2, 5] < 0 else -1)
    wound = chosen_of(SCENE, cycles, 90.0, prefer)
    assert abs(wound.joints[3, 5] - plain.joints[3, 5]) > 6
    mixed = join([chosen.take(np.array([0, 1, 2])), wound.take(np.array([3]))])
    assert mixed.branch[2] == mixed.branch[3]
    vias, blocked, _ = planned(SCENE, cycles, mixed)
    assert blocked == []
    assert vias.before.tolist() == [0, 1, 2, 3, 4]
    assert vias.by_joints.all()
    np.testing.assert_array_equal(vias.joints[:4], mixed.standoff)
    check_drive(SCENE, cycles, mixed, vias)


def test_a_half_turn_of_the_tool_is_not_left_to_the_controller():
    """Straight and turned by half a turn, either way round is as near: it goes by joints."""
    cycles = holes(ROW[:2])
    chosen = chosen_of(SCENE, cycles, heading_deg=[-90.0, 90.0])
    vias, blocked, _ = planned(SCENE, cycles, chosen)
    assert blocked == []
    assert vias.before.tolist() == [0, 1, 2]
    assert vias.by_joints.all()
    check_drive(SCENE, cycles, chosen, vias)


def test_by_way_of_home():
    """A long wall between two holes that no lift and no swing of A1 passes; home is behind it."""
    wall = Box((1050, 65, 300), (1950, 85, 3000))
    scene = SCENE.with_(guards=((wall,),), clearance=((2.0, 2.0),), links=False)
    scene = scene.with_(home=np.radians([0, -140, 160, 0, 60, 0]))
    assert scene.tool(scene.home[None])[0, 0, 3] < 800
    cycles = holes([(1900, -450, 1200), (1900, 600, 1200)])
    chosen = chosen_of(scene, cycles)
    vias, blocked, _ = planned(scene, cycles, chosen)
    assert blocked == []
    at_one = np.flatnonzero(vias.before == 1)
    assert (vias.joints[at_one] == scene.home).all(axis=1).any()
    assert vias.by_joints[at_one[-1]]
    check_drive(scene, cycles, chosen, vias)


def walls_around(low, high):
    """Thin walls around a room, but for the side of the part."""
    walls = []
    for axis, bound, out in (
        (0, low, -10),
        (1, low, -10),
        (1, high, 10),
        (2, low, -10),
        (2, high, 10),
    ):
        one, other = low.copy(), high.copy()
        one[axis], other[axis] = sorted((bound[axis], bound[axis] + out))
        walls.append(Box(tuple(one), tuple(other)))
    return tuple(walls)


def test_a_leg_without_a_way_is_told_with_why_its_plainest_way_fails():
    """Walls all around two holes: the tool can go between them, but neither in nor out."""
    low, high = np.array([1300.0, -400, 800]), np.array([1950.0, 400, 1600])
    scene = SCENE.with_(
        guards=(walls_around(low, high),), clearance=((2.0, 2.0),), links=False, home=None
    )
    cycles = holes([(1900, y, 1200) for y in (-700, 0, 100, 800)])
    chosen = chosen_of(scene, cycles)
    _, blocked, legs = planned(scene, cycles, chosen)
    assert [lost.leg for lost in blocked] == [0, 2]
    assert (legs.leaves[[0, 2]].tolist(), legs.reaches[[0, 2]].tolist()) == ([0, 2], [1, 3])
    for lost in blocked:
        assert lost.verdict.cause.tolist() == [HIT]
    # The plainest way of the first is straight: its side wall, 300 mm along 700, is what it meets.
    assert 0.25 < blocked[0].verdict.share[0] < 0.6


def test_home_is_of_no_use_where_only_the_way_from_it_is_clear():
    """The first hole is in a box; the second is not."""
    low, high = np.array([1300.0, -400, 800]), np.array([1950.0, 400, 1600])
    scene = SCENE.with_(guards=(walls_around(low, high),), clearance=((2.0, 2.0),), links=False)
    scene = scene.with_(home=np.radians([0, -140, 160, 0, 60, 0]))
    cycles = holes([(1900, 0, 1200), (1500, 1300, 1200)])
    chosen = chosen_of(scene, cycles)
    _, blocked, _ = planned(scene, cycles, chosen)
    assert [lost.leg for lost in blocked] == [0, 1]


@pytest.mark.parametrize("seed", range(6))
def test_random_programs_drive_clear(seed):
    """Whatever is planned among random boxes is clear, and whatever is blocked is said so."""
    rng = np.random.default_rng(seed)
    n = 5
    places = np.column_stack(
        [rng.uniform(1800, 2000, n), rng.uniform(-500, 500, n), rng.uniform(900, 1600, n)]
    )
    rotation = np.array([AHEAD @ turn("xyz", *rng.uniform(-30, 30, 3)) for _ in range(n)])
    cycles = cycles_of(
        places,
        rotation,
        region=[0, 0, 0, 1, 1],
        approach=rng.uniform(30, 80, n),
        retract=rng.uniform(30, 80, n),
    )
    heading = np.degrees(rng.uniform(-0.5, 0.5, n))
    stands = np.concatenate([chosen_of(SCENE, cycles, heading).joints, BACK[None]])
    boxes = []
    while len(boxes) < 4:
        centre = rng.uniform([1300, -600, 800], [1900, 600, 1700])
        size = rng.uniform(10, 80, 3)
        box = Box(tuple(centre - size), tuple(centre + size))
        trial = SCENE.with_(guards=((box,),), clearance=((2.0, 2.0),))
        if trial.gaps_mm(stands).min() > 80:
            boxes.append(box)
    scene = SCENE.with_(
        home=BACK,
        guards=(tuple(boxes[:2]), tuple(boxes[2:])),
        clearance=((20.0, 5.0, 2.0), (2.0, 30.0, 2.0)),
    )
    chosen = chosen_of(scene, cycles, heading)
    vias, blocked, legs = planned(scene, cycles, chosen)
    assert blocked == []
    check_drive(scene, cycles, chosen, vias)
    # Each section's first hole is reached by joints, at or behind its standoff.
    for hole in (0, 3):
        last = np.flatnonzero((vias.before == hole) & vias.by_joints)[-1]
        off = vias.position_mm[last] - cycles.position_mm[hole]
        axis = cycles.rotation[hole][:, 2]
        np.testing.assert_allclose(np.cross(off, axis), 0, atol=1e-6)
        assert -off @ axis > cycles.approach_mm[hole] - 1e-6
    assert len(legs) == n + 1


def test_the_same_twice():
    scene = SCENE.with_(guards=((fence(140.0),),), clearance=((12.0, 2.0),), links=False)
    cycles = holes(ROW[1:])
    chosen = chosen_of(scene, cycles)
    one, other = (planned(scene, cycles, chosen)[0] for _ in range(2))
    np.testing.assert_array_equal(one.joints, other.joints)
    np.testing.assert_array_equal(one.before, other.before)

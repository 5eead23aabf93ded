"""Whole cycles at single headings, against independent kinematics and python-fcl."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from drillc.planning.cell import BETWEEN, LEAST_GAP_MM
from drillc.planning.cycle_check import assess, join
from drillc.planning.moves import FINE, HIT, JUMP, LIMIT, REACH, SINGULAR
from planning.arm_scenes import HIGH, LOW, Box, Scene, Sphere, cycle_poses, cycles_of, turn

ROOT = (turn("zx", 20, 5), np.array([300.0, -200.0, 100.0]))
SCENE = Scene(part_from_root=ROOT)
#: The tool looks ahead, its x axis down.
AHEAD = ROOT[0] @ turn("y", 90)


def at_mm(ahead, aside, up):
    """A place in front of the arm, in part coordinates."""
    return ROOT[0] @ [ahead, aside, up] + ROOT[1]


def one(position, rotation=AHEAD, **kinds):
    return cycles_of([position], rotation, **kinds)


def ways(scene, cycles, row, heading_rad):
    """Every continuous way (k, 6) of the arm along a cycle, seen from its innermost place."""
    poses = cycle_poses(cycles, row, heading_rad, step_mm=1.0)[::-1]
    starts = scene.branches(poses[:1])[0]
    return [scene.follow(s, poses)[::-1] for s in starts if not np.isnan(s).any()]


def by_hand(scene, cycles, row, heading_rad):
    """All that can be chosen at a heading: joints at the surface, standoff, leave; margin; bend."""
    found = []
    out = max(cycles.approach_mm[row], cycles.retract_mm[row])
    depth = cycles.depth_mm[row]
    for way in ways(scene, cycles, row, heading_rad):
        if np.isnan(way).any() or np.abs(np.diff(way, axis=0)).max() > 0.1:
            continue
        bend = np.abs((way[:, 4] + np.pi / 2) % np.pi - np.pi / 2).min()
        if bend < np.radians(scene.singular_deg):
            continue
        # Whole turns of A1, A2, A3, A5 never fit; spare the search.
        near = way - 2 * np.pi * np.round(way[-1:] / (2 * np.pi)) * [1, 1, 1, 0, 1, 0]
        share = np.linspace(-out, depth, len(way))
        for a4, a6 in product(range(-3, 4), repeat=2):
            moved = near + 2 * np.pi * np.array([0, 0, 0, a4, 0, a6])
            if ((moved < scene.low) | (moved > scene.high)).any():
                continue
            room = np.minimum(moved - scene.low, scene.high - moved) / (scene.high - scene.low)
            places = [
                [np.interp(d, share, moved[:, j]) for j in range(6)]
                for d in (0.0, -cycles.approach_mm[row], -cycles.retract_mm[row])
            ]
            found.append((*map(np.array, places), room.min(), bend))
    return found


# ── candidates ───────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("seed", range(3))
def test_candidates_are_all_that_independent_kinematics_finds(seed):
    """Branches, windings, joints at the three places, margins and bends; nothing more or less."""
    rng = np.random.default_rng(seed)
    cell, total, wound = SCENE.cell(), 0, 0
    n = 6
    positions = [at_mm(*rng.uniform([1300, -1500, 300], [2600, 1500, 2200])) for _ in range(n)]
    rotations = np.array([ROOT[0] @ turn("yxz", 90, *rng.uniform(-60, 60, 2)) for _ in range(n)])
    cycles = cycles_of(
        positions,
        rotations,
        approach=rng.uniform(20, 120, n),
        retract=rng.uniform(20, 120, n),
        depth=rng.uniform(1, 30, n),
    )
    heading = rng.uniform(-np.pi, np.pi, n)
    found = assess(cell, cycles, np.arange(n), heading)
    candidates = found.candidates
    for row in range(n):
        some = np.flatnonzero(candidates.row == row)
        expected = by_hand(SCENE, cycles, row, heading[row])
        assert len(some) == len(expected)
        left = list(expected)
        for i in some:
            off = [np.abs(e[0] - candidates.joints[i]).max() for e in left]
            surface, standoff, leave, margin, bend = left.pop(int(np.argmin(off)))
            np.testing.assert_allclose(candidates.joints[i], surface, atol=1e-5)
            np.testing.assert_allclose(candidates.standoff[i], standoff, atol=1e-5)
            np.testing.assert_allclose(candidates.leave[i], leave, atol=1e-5)
            assert candidates.margin[i] == pytest.approx(margin, abs=2e-4)
            assert candidates.bend_rad[i] == pytest.approx(bend, abs=2e-3)
        total += len(some)
        wound += len(some) - len(np.unique(candidates.branch[some]))
        fine = np.unique(candidates.branch[some])
        np.testing.assert_array_equal(fine, np.flatnonzero(found.cause[row] == FINE))
    assert total > 10
    assert wound > 5
    # The tool stands where it should.
    for joints, away in (
        (candidates.joints, np.zeros(n)),
        (candidates.standoff, -cycles.approach_mm),
        (candidates.leave, -cycles.retract_mm),
    ):
        tool = SCENE.tool(joints)
        row = candidates.row
        place = cycles.position_mm[row] + away[row, None] * cycles.rotation[row][:, :, 2]
        np.testing.assert_allclose(tool[:, :3, 3], place, atol=1e-6)
        rotation = [
            cycles.rotation[r] @ turn("z", np.degrees(h))
            for r, h in zip(row, candidates.heading_rad, strict=True)
        ]
        np.testing.assert_allclose(tool[:, :3, :3], rotation, atol=1e-9)


@pytest.mark.parametrize(
    ("low_deg", "high_deg", "number"),
    [(-350, 350, 2), (-180, 180, 1), (-540, 540, 3), (30, 410, 2), (361, 720, 1), (-720, -361, 1)],
)
def test_whole_turns_within_the_limits_and_no_others(low_deg, high_deg, number):
    """A6 stands at 40 degrees, or a whole number of turns away."""
    joints = np.radians([0, -80, 100, 20, 40, 40])
    pose = SCENE.tool(joints[None])[0]
    low, high = LOW.copy(), HIGH.copy()
    low[3], high[3] = np.radians([-180, 180])
    low[5], high[5] = np.radians([low_deg, high_deg])
    cell = SCENE.with_(low=low, high=high).cell()
    cycles = one(pose[:3, 3], pose[:3, :3], approach=1.0, retract=1.0, depth=1.0)
    found = assess(cell, cycles, np.array([0]), np.zeros(1))
    candidates = found.candidates
    same = np.abs(candidates.joints[:, :5] - joints[:5]).max(axis=1) < 1e-6
    turns = (candidates.joints[same, 5] - joints[5]) / (2 * np.pi)
    possible = [k for k in range(-4, 5) if low_deg + 1 < 40 + 360 * k < high_deg - 1]
    assert len(possible) == number
    np.testing.assert_allclose(np.sort(turns), possible, atol=1e-6)
    assert FINE in found.cause[0]


def test_a_winding_must_hold_over_the_whole_cycle():
    """A6 turns a little on the way in; a limit between its ends leaves only the other turn."""
    cycles = one(at_mm(1900, 700, 900), ROOT[0] @ turn("yx", 60, 40), approach=120.0, depth=40.0)
    every = by_hand(SCENE, cycles, 0, 0.3)
    way = max(ways(SCENE, cycles, 0, 0.3), key=lambda w: np.nan_to_num(np.ptp(w[:, 5])))
    ends = np.sort([way[0, 5], way[-1, 5]])
    assert ends[1] - ends[0] > np.radians(0.5)
    high = HIGH.copy()
    high[5] = 0.5 * (ends[0] + ends[1]) + (2 * np.pi if ends[0] < 0 else 0)
    narrow = SCENE.with_(high=high)
    expected = by_hand(narrow, cycles, 0, 0.3)
    assert 0 < len(expected) < len(every)
    found = assess(narrow.cell(), cycles, np.array([0]), np.array([0.3])).candidates
    assert len(found) == len(expected)
    assert (found.margin >= 0).all()


# ── what is in the way ───────────────────────────────────────────────────────────────────────────


def causes(scene, cycles, heading_rad=0.0):
    return assess(scene.cell(), cycles, np.array([0]), np.array([heading_rad]))


def test_out_of_reach_at_the_depth_only():
    """The surface is within reach; 30 mm deeper the arm is too short."""
    reach = [
        x
        for x in range(2500, 3600)
        if not np.isnan(SCENE.branches(cycle_poses(one(at_mm(x, 0, 900)), 0, 0.0)[50:51])).all()
    ][-1]
    fine = causes(SCENE.with_(singular_deg=0.0), one(at_mm(reach - 60, 0, 900)))
    assert (fine.cause == FINE).any()
    far = causes(SCENE.with_(singular_deg=0.0), one(at_mm(reach - 5, 0, 900), depth=30.0))
    assert (far.cause == REACH).all()
    assert len(far.candidates) == 0


def test_branches_that_are_not_wanted():
    cycles = one(at_mm(1900, 300, 1200))
    everything = causes(SCENE, cycles)
    best = int(np.argmax(everything.cause[0] == FINE))
    wanted = np.zeros((1, 8), bool)
    wanted[0, best] = True
    found = assess(SCENE.cell(), cycles, np.array([0]), np.zeros(1), wanted)
    assert np.flatnonzero(found.cause[0] != REACH).tolist() == [best]
    some = everything.candidates.branch == best
    np.testing.assert_array_equal(found.candidates.joints, everything.candidates.joints[some])


@pytest.mark.parametrize("joint", range(6))
def test_a_limit_by_how_much_and_of_which_joint(joint):
    """One joint's range is moved until it ends 3 degrees short of what a branch needs."""
    cycles = one(at_mm(1900, 300, 1200), ROOT[0] @ turn("yxz", 70, 25, 30))
    found = causes(SCENE, cycles).candidates
    pick = int(np.argmax(found.margin))
    branch = int(found.branch[pick])
    poses = cycle_poses(cycles, 0, 0.0)
    way = SCENE.follow(found.joints[pick], poses[100::-1])
    way = np.concatenate([way, SCENE.follow(found.joints[pick], poses[100:])])
    low, high = LOW.copy(), HIGH.copy()
    high[joint] = way[:, joint].max() - np.radians(3)
    low[joint] = max(low[joint], high[joint] - np.radians(200))
    narrow = causes(SCENE.with_(low=low, high=high), cycles)
    assert narrow.cause[0, branch] == LIMIT
    assert narrow.joint[0, branch] == joint
    assert np.degrees(narrow.over_rad[0, branch]) == pytest.approx(3, abs=0.01)


def test_a_straight_wrist_and_one_just_bent_enough():
    """Along the cycle the wrist's bend is least somewhere; a hair more is refused."""
    joints = np.radians([0, -80, 90, 0, 5, 0])
    pose = SCENE.tool(joints[None])[0]
    cycles = one(pose[:3, 3], pose[:3, :3], approach=40.0, retract=10.0, depth=20.0)
    way = SCENE.follow(joints, cycle_poses(cycles, 0, 0.0)[80:81])
    way = SCENE.follow(way[-1], cycle_poses(cycles, 0, 0.0))
    least = np.degrees(np.abs(way[:, 4]).min())
    assert 0.5 < least < 5
    for more, cause in ((-0.05, FINE), (0.05, SINGULAR)):
        found = causes(SCENE.with_(singular_deg=least + more), cycles)
        off = SCENE.cell().branches(pose[None, :3, :3], pose[None, :3, 3])[0] - joints
        branch = int(np.nanargmin(np.abs(np.angle(np.exp(1j * off))).max(axis=1)))
        assert found.cause[0, branch] == cause
        assert np.degrees(found.bend_rad[0, branch]) == pytest.approx(least, abs=0.02)


def test_a_leap_where_the_wrist_turns_over():
    """The wrist passes through straight on the way in: as the arm stands, A4 has to leap."""
    joints = np.radians([0, -80, 60, 0, 0.05, 0])
    pose = SCENE.tool(joints[None])[0]
    cycles = one(pose[:3, 3], pose[:3, :3], approach=200.0, retract=10.0, depth=200.0)
    found = causes(SCENE.with_(singular_deg=0.0, links=False), cycles)
    off = SCENE.cell().branches(pose[None, :3, :3], pose[None, :3, 3])[0] - joints
    branch = int(np.nanargmin(np.abs(np.angle(np.exp(1j * off))).max(axis=1)))
    # (With A5 the other way round, the wrist turned over, it is the same.)
    assert found.cause[0, [branch, branch ^ 4]].tolist() == [JUMP, JUMP]
    assert not np.isin(found.candidates.branch, [branch, branch ^ 4]).any()


def test_a_link_that_comes_near_only_at_the_depth_or_only_outside():
    """A ball beside the forearm: the clearance that fcl measures over the cycle decides, less what
    travels may use up; within the finest growth either may be said."""
    cycles = one(at_mm(1900, 300, 1200), approach=150.0, depth=60.0)
    found = causes(SCENE, cycles).candidates
    pick = int(np.argmax(found.margin))
    branch = int(found.branch[pick])
    poses = cycle_poses(cycles, 0, 0.0)
    surface = 300
    way = np.concatenate(
        [
            SCENE.follow(found.joints[pick], poses[surface::-1])[::-1],
            SCENE.follow(found.joints[pick], poses[surface:])[1:],
        ]
    )
    cell = SCENE.cell()
    elbow, wrist = (cell.link_poses(way)[1][:, i] for i in (3, 4))
    beside = np.cross(wrist[0] - elbow[0], [0, 0, 1.0])
    beside /= np.linalg.norm(beside)
    centre = 0.4 * elbow[0] + 0.6 * wrist[-1] + 300 * beside
    ball = SCENE.with_(guards=((Sphere(tuple(centre), 60.0),),), clearance=((2.0, 2.0),))
    gap = ball.gaps_mm(way, tool=False).min()
    assert gap > 30
    for spare, causes_ in ((-1.0, {HIT}), (3.0, {FINE})):
        kept = gap - spare + LEAST_GAP_MM
        scene = ball.with_(clearance=((kept, 2.0),))
        result = causes(scene, cycles)
        assert result.cause[0, branch] in causes_
        if spare < 0:
            mover = scene.cell().movers[result.mover[0, branch]]
            assert mover.link in (3, 4)
            assert branch not in result.candidates.branch


def test_the_tool_itself_is_not_looked_at_here():
    cycles = one(at_mm(1900, 300, 1200))
    block = Box(tuple(at_mm(1900, 300, 1200) - 20), tuple(at_mm(1900, 300, 1200) + 20))
    scene = SCENE.with_(guards=((block,),), clearance=((2.0, 2.0),))
    assert (causes(scene, cycles).cause == causes(SCENE, cycles).cause).all()


def test_each_region_keeps_its_own_clearance():
    cycles = one(at_mm(1900, 300, 1200))
    found = causes(SCENE, cycles).candidates
    elbow = SCENE.cell().link_poses(found.joints)[1][0, 3]
    scene = SCENE.with_(
        guards=((Sphere(tuple(elbow), 50.0),),), clearance=((-np.inf, 5.0, -np.inf),)
    )
    for region, some in ((0, False), (1, True), (BETWEEN, False)):
        at = cycles_of(cycles.position_mm, cycles.rotation, region=[region])
        assert (causes(scene, at).cause >= HIT).any() == some


# ── many at once ─────────────────────────────────────────────────────────────────────────────────


def test_many_are_judged_as_each_alone_and_come_sorted():
    rng = np.random.default_rng(5)
    n = 12
    positions = [at_mm(*rng.uniform([1300, -1500, 300], [2900, 1500, 2200])) for _ in range(n)]
    cycles = cycles_of(
        positions, AHEAD, approach=rng.uniform(20, 200, n), depth=rng.uniform(1, 30, n)
    )
    rows, heading = rng.integers(0, n, 40), rng.uniform(-3, 3, 40)
    centre = at_mm(1500, 0, 1500)
    scene = SCENE.with_(guards=((Sphere(tuple(centre), 150.0),),), clearance=((20.0, 2.0),))
    cell = scene.cell()
    together = assess(cell, cycles, rows, heading)
    alone = [assess(cell, cycles, rows[i : i + 1], heading[i : i + 1]) for i in range(40)]
    np.testing.assert_array_equal(together.cause, np.concatenate([a.cause for a in alone]))
    assert {FINE, HIT, LIMIT, REACH} <= set(together.cause.ravel().tolist())
    joined = join([a.candidates for a in alone])
    assert (np.diff(together.candidates.row) >= 0).all()
    np.testing.assert_array_equal(together.candidates.row, joined.row)
    np.testing.assert_array_equal(together.candidates.heading_rad, joined.heading_rad)
    np.testing.assert_allclose(together.candidates.joints, joined.joints, atol=1e-12)


def test_nothing_asked():
    cycles = one(at_mm(1900, 300, 1200))
    found = assess(SCENE.cell(), cycles, np.empty(0, np.int64), np.empty(0))
    assert found.cause.shape == (0, 8)
    assert len(found.candidates) == 0

"""Proofs that moves are clear, against python-fcl's distances at every half millimetre."""

from __future__ import annotations

import numpy as np
import pytest
from drillc.planning.cell import LEAST_GAP_MM, TOOL
from drillc.planning.moves import FINE, HIT, joint_moves, sample, straight_moves
from drillc.planning.proofs import FINEST_MM, check_moves, find_hits
from planning.arm_scenes import HIGH, LOW, Box, Capsule, Scene, Sphere, line, turn

#: Where fcl's iterations end, on either side.
EXACT_MM = 0.05
START = np.radians([5, -80, 100, 20, 40, 10])
BODY = (Capsule((0, 0, 40), (0, 0, 210), 40.0), Capsule((0, 0, 150), (180, 0, 150), 25.0))


def by_joints(start, stop):
    return joint_moves(np.zeros(1, np.int32), np.array([start], float), np.array([stop], float))


def straight(scene, start, pose):
    """A straight move from joints to a tool pose; the branch is the nearest one."""
    here = scene.tool(start[None])[0]
    off = scene.cell().branches(here[None, :3, :3], here[None, :3, 3])[0] - start
    branch = int(np.nanargmin(np.abs(np.angle(np.exp(1j * off))).max(axis=1)))
    return straight_moves(
        np.zeros(1, np.int32),
        (here[None, :3, :3], here[None, :3, 3]),
        (pose[None, :3, :3], pose[None, :3, 3]),
        np.array([branch], np.int32),
        start[None],
    )


def walk_joints(scene, start, stop):
    """Joints (n, 6) of a move by joints, so fine that the tool moves by half a millimetre."""
    share = np.linspace(0, 1, 400)[:, None]
    coarse = start + (stop - start) * share
    tips = [p[:, :3, 3] for _, _, p in scene.moving(coarse)]
    far = max(np.linalg.norm(np.diff(t, axis=0), axis=1).sum() for t in tips)
    share = np.linspace(0, 1, max(2, int(2 * far)))[:, None]
    return start + (stop - start) * share


def least_gap(scene, way):
    """The least distance from each guard, looked at coarsely first and then where it is small."""
    some = np.unique(np.append(np.arange(0, len(way), 40), len(way) - 1))
    gaps = scene.gaps_mm(way[some])
    # A body moves by at most 1 mm from row to row, wherever it is least.
    near = np.flatnonzero(gaps.min(axis=0) < gaps.min() + 41.0)
    rows = np.unique((some[near][:, None] + np.arange(-40, 41)).clip(0, len(way) - 1))
    return scene.gaps_mm(way[rows]).min(axis=1)


def scene_around(rng, poses, count=2):
    """A few boxes and balls near the tool's way, most of them not in it."""
    bodies = []
    for _ in range(count):
        at = poses[rng.integers(len(poses)), :3, 3]
        centre = at + rng.normal(size=3) * [180, 180, 180]
        size = rng.uniform(20, 90, 3)
        if rng.random() < 0.5:
            bodies.append(Box(tuple(centre - size), tuple(centre + size)))
        else:
            bodies.append(Sphere(tuple(centre), float(size[0])))
    return tuple(bodies)


def judged(scene, moves, way):
    """drillc's verdict and, for each guard, what fcl finds beyond the clearance to be kept."""
    verdict = check_moves(scene.cell(), moves)
    kept = np.array([c[0] for c in scene.clearance]) - LEAST_GAP_MM
    return verdict, least_gap(scene, way) - kept


def random_case(rng):
    """A random move with its dense walk, in a scene of two guards; None where it cannot be made."""
    free = Scene(body=BODY)
    if rng.random() < 0.5:
        stop = START + rng.uniform(-0.6, 0.6, 6)
        moves, way = by_joints(START, stop), walk_joints(free, START, stop)
        poses = free.tool(way[::50])
    else:
        pose = free.tool(START[None])[0].copy()
        pose[:3, 3] += rng.uniform(-200, 200, 3)
        pose[:3, :3] = pose[:3, :3] @ turn("xyz", *rng.uniform(-15, 15, 3))
        moves, poses = straight(free, START, pose), line(free.tool(START[None])[0], pose)
        if sample(free.cell(), moves)[1].cause[0] != FINE:
            return None
        way = free.follow(START, poses)
    guards = (scene_around(rng, poses), scene_around(rng, poses, 1))
    kept = tuple((float(rng.choice([2, 5, 20])),) * 2 for _ in guards)
    return free.with_(guards=guards, clearance=kept), moves, way


def test_what_is_proven_clear_is_clear_and_what_is_far_is_proven():
    """Never clear where fcl finds less than the clearance, less what travels may use up; always
    clear where fcl finds more than that and the finest growth."""
    rng = np.random.default_rng(7)
    clear = blocked = 0
    for _ in range(26):
        case = random_case(rng)
        if case is None:
            continue
        verdict, spare = judged(*case)
        if verdict.cause[0] == FINE:
            clear += 1
            assert spare.min() > -EXACT_MM
        else:
            blocked += 1
            assert verdict.cause[0] >= HIT
            # (Half a millimetre of it may be missed between two places of the walk.)
            assert spare[verdict.cause[0] - HIT] < FINEST_MM + 1.0
    assert clear >= 7
    assert blocked >= 6


@pytest.mark.parametrize("gap_mm", [-1.0, -0.2, 2.0, 20.0])
def test_a_wall_beside_a_straight_way(gap_mm):
    """A wall so far beside the tool's way that exactly so much is left over."""
    scene = Scene(links=False, body=(Capsule((0, 0, 100), (0, 0, 200), 30.0),))
    pose = scene.tool(START[None])[0]
    along, aside = pose[:3, 0], pose[:3, 1]
    stop = pose.copy()
    stop[:3, 3] += 300 * along
    start = scene.follow(START, pose[None])[0]
    # A great ball, whose nearest point lies beside the middle of the way.
    near = pose[:3, 3] + 150 * along - 100 * pose[:3, 2] + (30 + 8 + gap_mm) * aside
    wall = Sphere(tuple(near + 1e3 * aside), 1e3)
    guarded = scene.with_(guards=((wall,),), clearance=((8 + LEAST_GAP_MM,) * 2,))
    verdict = check_moves(guarded.cell(), straight(scene, start, stop))
    assert verdict.cause.tolist() == [FINE if gap_mm > 0 else HIT]


@pytest.mark.parametrize("joint", [3, 5])
@pytest.mark.parametrize("turns", [0.97, 16.0])
def test_whole_turns_of_a_wrist_joint_sweep_all_that_is_around(joint, turns):
    """The places where the move begins, is halfway and ends are much alike, and so are those at the
    ends of many halves of it; a ball stands where the tool's outrigger passes between."""
    start = np.radians([0, -90, 90, 0, 30, 0])
    stop = start.copy()
    start[joint], stop[joint] = -2 * np.pi * turns, 2 * np.pi * turns
    low, high = LOW.copy(), HIGH.copy()
    low[joint], high[joint] = start[joint], stop[joint]
    scene = Scene(body=BODY, links=False, low=low, high=high)
    opposite = start.copy()
    opposite[joint] = np.radians(170)
    tip = (scene.flange(opposite[None])[0] @ [180, 0, 150, 1])[:3]
    still = np.stack([start, 0.5 * (start + stop), stop])
    guarded = scene.with_(guards=((Sphere(tuple(tip), 20.0),),), clearance=((2.0, 2.0),))
    assert guarded.gaps_mm(still).min() > 20
    assert guarded.gaps_mm(opposite[None]).min() < 0
    verdict = check_moves(guarded.cell(), by_joints(start, stop))
    assert verdict.cause.tolist() == [HIT]


@pytest.mark.parametrize("kind", ["straight", "by joints"])
def test_nothing_on_the_way_is_too_small_to_be_met(kind):
    """A thin tool meets a grain wherever it lies on the way of one of its points."""
    scene = Scene(links=False, body=(Capsule((0, 0, 100), (0, 0, 200), 1.0),))
    if kind == "straight":
        pose = scene.tool(START[None])[0].copy()
        pose[:3, 3] += [-100, 250, 120]
        pose[:3, :3] = pose[:3, :3] @ turn("xyz", 10, 15, -20)
        moves = straight(scene, START, pose)
        way = scene.follow(START, line(scene.tool(START[None])[0], pose))
    else:
        stop = START + np.array([0.5, 0.1, -0.2, 0.8, 0.3, 0.4])
        moves, way = by_joints(START, stop), walk_joints(scene, START, stop)
    rng = np.random.default_rng(0)
    flange = scene.flange(way)
    for row in rng.integers(0, len(way), 40):
        at = flange[row] @ [0, 0, rng.uniform(100, 200), 1]
        grain = scene.with_(guards=((Sphere(tuple(at[:3]), 0.5),),), clearance=((2.0, 2.0),))
        verdict = check_moves(grain.cell(), moves)
        assert verdict.cause.tolist() == [HIT]
        assert verdict.share[0] == pytest.approx(row / (len(way) - 1), abs=0.02)


def test_joints_that_swing_out_and_back_are_seen_out_there():
    """A2 and A3 against each other: the flange goes out and comes back while they go on."""
    start = np.radians([0, -80, 60, 0, 30, 0])
    stop = np.radians([0, -10, 150, 0, 30, 0])
    scene = Scene(body=BODY)
    way = walk_joints(scene, start, stop)
    tips = scene.tool(way)[:, :3, 3]
    out = int(np.argmax(tips[:, 0]))
    assert 0.1 * len(way) < out < 0.9 * len(way)
    ball = Sphere(tuple(tips[out] + [30.0, 0, 0]), 20.0)
    guarded = scene.with_(guards=((ball,),), clearance=((2.0, 2.0),))
    assert check_moves(guarded.cell(), by_joints(start, stop)).cause.tolist() == [HIT]


def test_what_is_hit_where_and_by_what():
    """The first guard, by the tool, a third of the way along."""
    scene = Scene(body=(Capsule((0, 0, 100), (0, 0, 200), 30.0),))
    pose = scene.tool(START[None])[0]
    stop = pose.copy()
    stop[:3, 3] += 300 * pose[:3, 0]
    at = pose[:3, 3] + 130 * pose[:3, 0] - 100 * pose[:3, 2]
    far = Sphere(tuple(at + np.array([0, 0, 5000])), 10.0)
    guarded = scene.with_(guards=((far,), (Sphere(tuple(at), 10.0),)), clearance=((2.0, 2.0),) * 2)
    cell = guarded.cell()
    verdict = check_moves(cell, straight(scene, START, stop))
    assert verdict.cause.tolist() == [HIT + 1]
    assert cell.movers[verdict.mover[0]].link == TOOL
    # Contact begins at (130 - 30 - 10) mm and ends at (130 + 30 + 10) mm.
    assert 80 / 300 <= verdict.share[0] <= 170 / 300


def test_regions_that_keep_nothing_and_movers_left_out():
    scene = Scene(body=(Capsule((0, 0, 100), (0, 0, 200), 30.0),))
    pose = scene.tool(START[None])[0]
    stop = pose.copy()
    stop[:3, 3] += 100 * pose[:3, 0]
    ball = Sphere(tuple(pose[:3, 3] - 100 * pose[:3, 2]), 20.0)
    guarded = scene.with_(guards=((ball,),), clearance=((2.0, -np.inf, 2.0),))
    cell = guarded.cell()
    for region, cause in ((0, HIT), (1, FINE), (-1, HIT)):
        moves = straight(scene, START, stop)
        moves.region[0] = region
        assert check_moves(cell, moves).cause.tolist() == [cause]
    sampled, _ = sample(cell, straight(scene, START, stop))
    links = tuple(mover for mover in cell.movers if mover.link != TOOL)
    assert find_hits(cell, sampled, np.array([0]), links).guard.tolist() == [-1]


def test_many_moves_are_judged_as_each_alone():
    rng = np.random.default_rng(11)
    scene = Scene(body=BODY)
    stops = START + rng.uniform(-0.5, 0.5, (12, 6))
    poses = scene.tool(stops)
    guards = (scene_around(rng, poses, 4), scene_around(rng, poses, 3))
    cell = scene.with_(guards=guards, clearance=((10.0, 10.0),) * 2).cell()
    moves = joint_moves(np.zeros(12, np.int32), np.tile(START, (12, 1)), stops)
    together = check_moves(cell, moves)
    alone = [check_moves(cell, moves.take(np.array([i]))) for i in range(12)]
    assert together.cause.tolist() == [int(v.cause[0]) for v in alone]
    assert len(set(together.cause.tolist())) == 3
    assert together.mover.tolist() == [int(v.mover[0]) for v in alone]
    np.testing.assert_array_equal(together.share, [v.share[0] for v in alone])

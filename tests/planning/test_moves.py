"""Moves against inverse kinematics that shares no code, followed in far finer steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drillc.planning.moves import (
    FINE,
    JUMP,
    LIMIT,
    MISSED,
    REACH,
    SINGULAR,
    joint_moves,
    joints_at,
    sample,
    straight_moves,
)
from planning.arm_scenes import HIGH, HOME, LOW, Scene, line, matrix, turn

SCENE = Scene(part_from_root=(turn("zx", 20, 5), np.array([300.0, -200.0, 100.0])))
CELL = SCENE.cell()


def straight(scene, start_joints, stop_pose, *, stop_joints=None, branch=None):
    """One straight move of drillc, from joints to a tool pose, and its poses in fine steps."""
    start_joints = np.asarray(start_joints, float)
    start = scene.tool(start_joints[None])[0]
    if branch is None:
        off = scene.cell().branches(start[None, :3, :3], start[None, :3, 3])[0] - start_joints
        branch = int(np.nanargmin(np.abs(np.angle(np.exp(1j * off))).max(axis=1)))
    moves = straight_moves(
        np.zeros(1, np.int32),
        (start[None, :3, :3], start[None, :3, 3]),
        (stop_pose[None, :3, :3], stop_pose[None, :3, 3]),
        np.array([branch], np.int32),
        start_joints[None],
        None if stop_joints is None else np.asarray(stop_joints, float)[None],
    )
    return moves, line(start, stop_pose)


def random_straight(rng):
    """A move of up to 400 mm and 60 degrees from somewhere inside the limits."""
    joints = rng.uniform(LOW, HIGH)
    pose = SCENE.tool(joints[None])[0].copy()
    pose[:3, 3] += rng.uniform(-230, 230, 3)
    pose[:3, :3] = pose[:3, :3] @ turn("xyz", *rng.uniform(-35, 35, 3))
    return joints, pose


def expected_of(scene, way):
    """What a fine walk says: the first cause along it, told with room to either side."""
    if np.isnan(way).any():
        return REACH
    if ((way < scene.low - 1e-6) | (way > scene.high + 1e-6)).any():
        return LIMIT
    return FINE


def test_straight_moves_follow_independent_inverse_kinematics():
    rng = np.random.default_rng(1)
    fine = refused = 0
    for _ in range(60):
        joints, pose = random_straight(rng)
        moves, poses = straight(SCENE, joints, pose)
        sampled, verdict = sample(CELL, moves)
        way = SCENE.follow(joints, poses)
        bend = np.abs((way[:, 4] + np.pi / 2) % np.pi - np.pi / 2).min()
        jump = np.abs(np.diff(way, axis=0)).max()
        if verdict.cause[0] == FINE:
            fine += 1
            assert expected_of(SCENE, way) == FINE
            share = np.linspace(0.0, 1.0, len(way))
            at = joints_at(CELL, sampled, np.zeros(len(way), np.int64), share)
            np.testing.assert_allclose(at, way, atol=1e-7)
            np.testing.assert_allclose(verdict.end_joints[0], way[-1], atol=1e-7)
            assert bend > np.radians(2.0) - 0.02
        else:
            refused += 1
            reasons = (
                np.isnan(way).any()
                or expected_of(SCENE, way) == LIMIT
                or bend < np.radians(3.0)
                or jump > 0.05
            )
            assert reasons
    assert fine > 20
    assert refused > 5


@pytest.mark.parametrize("turns", [-1, 0, 1])
def test_the_winding_is_that_of_the_start(turns):
    """A4 and A6 stay in the turn in which the move begins, and pass half a turn without leaping."""
    joints = np.radians([5, -80, 100, 170, 40, 175])
    joints[5] = np.radians(175 - 360 if turns < 0 else 175)
    joints[3] = np.radians(170 - 360 if turns > 0 else 170)
    pose = SCENE.tool(joints[None])[0] @ matrix(turn("z", -30), np.zeros(3))
    moves, poses = straight(SCENE, joints, pose)
    way = SCENE.follow(joints, poses)
    assert np.abs(way[-1] - joints)[5] > np.radians(20)
    sampled, verdict = sample(CELL, moves)
    assert verdict.cause.tolist() == [FINE]
    np.testing.assert_allclose(verdict.end_joints[0], way[-1], atol=1e-7)
    np.testing.assert_allclose(sampled.joints[0], joints, atol=1e-7)


def test_samples_are_evenly_spaced_and_include_both_ends():
    joints = np.radians([5, -80, 100, 20, 40, 10])
    pose = SCENE.tool(joints[None])[0].copy()
    pose[:3, 3] += [0, 0, 210]
    moves, _ = straight(SCENE, joints, pose)
    sampled, _ = sample(CELL, moves)
    assert sampled.first.tolist() == [0, 12]  # 210 mm in steps of at most 20
    tips = SCENE.tool(sampled.joints)[:, :3, 3]
    np.testing.assert_allclose(np.diff(tips, axis=0), np.tile([0, 0, 210 / 11], (11, 1)), atol=1e-6)


# ── each verdict ─────────────────────────────────────────────────────────────────────────────────

FROM = np.radians([5, -80, 100, 20, 40, 10])


def test_out_of_reach():
    pose = SCENE.tool(FROM[None])[0].copy()
    pose[:3, 3] += SCENE.part_from_root[0] @ [2000.0, 0, 0]
    moves, poses = straight(SCENE, FROM, pose)
    _, verdict = sample(CELL, moves)
    assert verdict.cause.tolist() == [REACH]
    lost = np.isnan(SCENE.branches(poses)).all(axis=(1, 2))
    assert verdict.share[0] == pytest.approx(lost.argmax() / (len(poses) - 1), abs=20 / 2000 + 1e-3)


@pytest.mark.parametrize("joint", range(6))
@pytest.mark.parametrize("upper", [False, True])
def test_the_limit_that_is_overstepped_is_named(joint, upper):
    """The move is fine; with one limit put halfway along what that joint does, it is not."""
    pose = SCENE.tool(FROM[None])[0].copy()
    pose[:3, 3] += [-150, 130, -120]
    pose[:3, :3] = pose[:3, :3] @ turn("xyz", 20, -15, 25)
    moves, poses = straight(SCENE, FROM, pose)
    assert sample(CELL, moves)[1].cause.tolist() == [FINE]
    way = SCENE.follow(FROM, poses)[:, joint]
    low, high = LOW.copy(), HIGH.copy()
    rising = way[-1] > way[0]
    if rising != upper:
        moves = replace(moves, start_joints=SCENE.follow(FROM, poses)[-1:])
        moves, poses = straight(SCENE, moves.start_joints[0], poses[0])
        way = way[::-1]
    bound = 0.5 * (way[0] + way[-1])
    (high if upper else low)[joint] = bound
    _, verdict = sample(SCENE.with_(low=low, high=high).cell(), moves)
    assert (verdict.cause[0], verdict.detail[0]) == (LIMIT, joint)
    beyond = (way > bound) if upper else (way < bound)
    assert verdict.share[0] == pytest.approx(beyond.argmax() / (len(way) - 1), abs=0.15)


def test_a_limit_is_named_even_where_another_joint_leaps_too():
    """The start is a turn beyond A6's limit, and A1's is not where the move begins."""
    start = FROM.copy()
    start[5] += 2 * np.pi
    moves, _ = straight(SCENE, start, SCENE.tool(FROM[None])[0])
    moves.start_joints[0, 0] += 1e-4
    _, verdict = sample(CELL, moves)
    assert (verdict.cause[0], verdict.detail[0]) == (LIMIT, 5)


def test_a_straight_wrist():
    """The tool turns about the arm's own y axis through the wrist's straight position."""
    start = np.radians([0, -90, 90, 0, 30, 0])
    stop = np.radians([0, -90, 90, 0, 1.0, 0])
    moves, _ = straight(SCENE, start, SCENE.tool(stop[None])[0])
    _, verdict = sample(CELL, moves)
    assert verdict.cause.tolist() == [SINGULAR]
    assert 0.8 < verdict.share[0] <= 1.0
    assert sample(SCENE.with_(singular_deg=0.5).cell(), moves)[1].cause.tolist() == [FINE]


def test_a_leap_where_the_wrist_passes_its_singularity():
    """Through the straight wrist and out on the other side A4 turns over, unless A5 may cross."""
    start = np.radians([0, -90, 90, 0, 8, 0])
    stop = np.radians([0, -90, 90, 0, -8.5, 0])
    moves, _ = straight(SCENE, start, SCENE.tool(stop[None])[0])
    _, verdict = sample(SCENE.with_(singular_deg=0.0).cell(), moves)
    assert verdict.cause.tolist() == [JUMP]
    assert verdict.detail[0] in (3, 5)


def test_a_start_that_is_not_where_the_joints_are():
    moves, _ = straight(SCENE, FROM, SCENE.tool(FROM[None] + 0.05)[0])
    moves.start_joints[0, 2] += 1e-4
    _, verdict = sample(CELL, moves)
    assert (verdict.cause[0], verdict.detail[0], verdict.share[0]) == (JUMP, 2, 0.0)


def test_an_end_a_turn_away_is_missed():
    pose = SCENE.tool(FROM[None])[0].copy()
    pose[:3, 3] += [0, 50, 50]
    _, poses = straight(SCENE, FROM, pose)
    end = SCENE.follow(FROM, poses)[-1]
    good, _ = straight(SCENE, FROM, pose, stop_joints=end)
    assert sample(CELL, good)[1].cause.tolist() == [FINE]
    wound, _ = straight(SCENE, FROM, pose, stop_joints=end - [0, 0, 0, 0, 0, 2 * np.pi])
    _, verdict = sample(CELL, wound)
    assert (verdict.cause[0], verdict.share[0]) == (MISSED, 1.0)


# ── by joints, nothing, and nowhere ──────────────────────────────────────────────────────────────


def test_moves_by_joints_go_in_proportion_and_mind_the_limits():
    stop = np.radians([60, -40, 60, -300, -50, 340])
    moves = joint_moves(np.zeros(2, np.int32), np.stack([FROM, FROM]), np.stack([stop, stop]))
    moves.stop_joints[1, 3] = LOW[3] - 1e-3
    sampled, verdict = sample(CELL, moves)
    assert verdict.cause.tolist() == [FINE, LIMIT]
    assert verdict.detail[1] == 3
    np.testing.assert_array_equal(verdict.end_joints[0], stop)
    first = sampled.joints[sampled.first[0] : sampled.first[1]]
    share = np.linspace(0, 1, len(first))[:, None]
    np.testing.assert_allclose(first, FROM + (stop - FROM) * share, atol=1e-12)
    assert np.abs(np.diff(first, axis=0)).max() <= np.radians(5) + 1e-9


def test_a_move_by_joints_may_pass_a_straight_wrist_and_turn_over():
    stop = FROM * [1, 1, 1, 1, -1, 1]
    moves = joint_moves(np.zeros(1, np.int32), FROM[None], stop[None])
    assert sample(CELL, moves)[1].cause.tolist() == [FINE]


def test_no_moves_at_all():
    none = np.empty((0, 6))
    for moves in (
        joint_moves(np.empty(0, np.int32), none, none),
        straight_moves(
            np.empty(0, np.int32),
            (np.empty((0, 3, 3)), np.empty((0, 3))),
            (np.empty((0, 3, 3)), np.empty((0, 3))),
            np.empty(0, np.int32),
            none,
        ),
    ):
        sampled, verdict = sample(CELL, moves)
        assert len(verdict.cause) == len(sampled.joints) == 0
        assert verdict.end_joints.shape == (0, 6)


def test_moves_to_where_the_arm_is():
    moves, _ = straight(SCENE, FROM, SCENE.tool(FROM[None])[0], stop_joints=FROM)
    _, verdict = sample(CELL, moves)
    assert verdict.cause.tolist() == [FINE]
    np.testing.assert_allclose(verdict.end_joints[0], FROM, atol=1e-9)
    _, verdict = sample(CELL, joint_moves(np.zeros(1, np.int32), HOME[None], HOME[None]))
    assert verdict.cause.tolist() == [FINE]


def test_many_moves_are_judged_as_each_alone():
    rng = np.random.default_rng(3)
    each = [straight(SCENE, *random_straight(rng))[0] for _ in range(30)]
    whole = replace(each[0], **{
        name: np.concatenate([getattr(one, name) for one in each])
        for name in each[0].__dataclass_fields__
    })  # fmt: skip
    together = sample(CELL, whole)[1]
    alone = [sample(CELL, one)[1] for one in each]
    assert together.cause.tolist() == [int(v.cause[0]) for v in alone]
    assert len(set(together.cause.tolist())) > 2
    np.testing.assert_array_equal(together.detail, [v.detail[0] for v in alone])
    np.testing.assert_array_equal(together.share, [v.share[0] for v in alone])
    fine = together.cause == FINE
    ends = np.concatenate([v.end_joints for v in alone])
    np.testing.assert_allclose(together.end_joints[fine], ends[fine], atol=1e-9)


def test_a_limit_between_two_samples_is_seen():
    """Limits that the samples just keep, but the way between them does not."""
    rng = np.random.default_rng(11)
    overstepped = 0
    for _ in range(120):
        joints, pose = random_straight(rng)
        moves, _ = straight(SCENE, joints, pose)
        sampled, verdict = sample(CELL, moves)
        if verdict.cause[0] not in (FINE, LIMIT) or len(sampled.joints) < 3:
            continue
        shares = np.linspace(0.0, 1.0, 40 * len(sampled.joints))
        way = joints_at(CELL, sampled, np.zeros(len(shares), np.int64), shares)
        tight = replace(
            CELL,
            low_rad=sampled.joints.min(axis=0) - 1e-7,
            high_rad=sampled.joints.max(axis=0) + 1e-7,
        )
        beyond = max((tight.low_rad - way).max(), (way - tight.high_rad).max())
        if beyond > 2e-6:
            overstepped += 1
            assert sample(tight, moves)[1].cause[0] == LIMIT
    assert overstepped > 10

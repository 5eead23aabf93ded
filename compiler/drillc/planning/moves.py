"""The moves of an arm between two places: within reach and limits, and in one branch?

A move is a straight one of the tool (position and orientation go in proportion, the orientation
about one axis) or one by joints (all in proportion). It is judged at samples; whether it is clear
of what stands around, `proofs.py` proves.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from drillc.kernels.arm import singularity
from drillc.language.job import Floats, Ints
from drillc.planning.cell import Cell, pick

Bools = NDArray[np.bool_]

#: A straight move is sampled at least so densely, for reach, limits and branch.
STEP_MM, STEP_RAD = 20.0, np.radians(2.0)
#: Between two samples no joint may turn by more: beyond it, the arm is at a singularity.
JUMP_RAD = 0.5
#: A move by joints is sampled at least so densely.
JOINT_STEP_RAD = np.radians(5.0)
#: A parabola through three samples rises by this share of its second difference between two.
BULGE = 0.125
#: What a joint may overstep a limit by, and a given place be missed by: rounding.
SLACK_RAD = 1e-9
CLOSURE_RAD = 1e-6
#: Samples whose branches are found together.
_BLOCK = 4096

#: Why a move cannot be made. From `HIT` on, `HIT + guard` says what the arm or its tool meets.
FINE, REACH, LIMIT, SINGULAR, JUMP, MISSED, HIT = range(7)


@dataclass(frozen=True, eq=False)
class Moves:
    """m moves, in columns. `region` (m,) says whose clearances hold.

    Straight ones go from start_mm (m, 3) to stop_mm, turned as `rotation` (m, 3, 3) at first and
    then about the vector `turn_rad` (m, 3) in tool coordinates, in branch `branch` (m,). Those with
    `by_joints` go from start_joints (m, 6) to stop_joints. A straight one begins at start_joints
    too; it has to end at stop_joints unless these are NaN.
    """

    region: Ints
    by_joints: Bools
    start_mm: Floats
    stop_mm: Floats
    rotation: Floats
    turn_rad: Floats
    branch: Ints
    start_joints: Floats
    stop_joints: Floats

    def __len__(self) -> int:
        return len(self.region)

    def take(self, rows: NDArray[np.int64] | Bools) -> Moves:
        """Some of the moves."""
        return Moves(**{f.name: getattr(self, f.name)[rows] for f in fields(self)})


@dataclass(frozen=True, eq=False)
class Sampled:
    """Moves with their joints at samples: those of move i are `first[i]` … `first[i + 1]`, evenly
    spaced from start to stop, both included."""

    moves: Moves
    first: NDArray[np.int64]  # (m + 1,)
    joints: Floats  # (N, 6)


@dataclass(frozen=True, eq=False)
class Verdict:
    """`cause` (m,): FINE or why not; `share` (m,): where along the move; `mover` (m,): index into
    the cell's movers of what meets a guard; `detail` (m,): a joint's index (LIMIT, JUMP);
    `end_joints` (m, 6): where the move ends, in the winding in which it was made."""

    cause: Ints
    share: Floats
    mover: Ints
    detail: Ints
    end_joints: Floats

    @property
    def fine(self) -> Bools:
        return np.asarray(self.cause == FINE)


def straight_moves(
    region: Ints,
    start: tuple[Floats, Floats],
    stop: tuple[Floats, Floats],
    branch: Ints,
    start_joints: Floats,
    stop_joints: Floats | None = None,
) -> Moves:
    """Straight moves between poses (rotation (m, 3, 3), position (m, 3))."""
    count = len(region)
    turn = np.swapaxes(start[0], 1, 2) @ stop[0]
    return Moves(
        region,
        np.zeros(count, dtype=np.bool_),
        start[1],
        stop[1],
        start[0],
        Rotation.from_matrix(turn).as_rotvec() if count else np.empty((0, 3)),
        branch,
        start_joints,
        np.full((count, 6), np.nan) if stop_joints is None else stop_joints,
    )


def joint_moves(region: Ints, start_joints: Floats, stop_joints: Floats) -> Moves:
    """Moves by joints."""
    count = len(region)
    nowhere = np.full((count, 3), np.nan)
    return Moves(
        region,
        np.ones(count, dtype=np.bool_),
        nowhere,
        nowhere,
        np.full((count, 3, 3), np.nan),
        nowhere,
        np.zeros(count, dtype=np.int32),
        start_joints,
        stop_joints,
    )


# ── reach, limits, branch ────────────────────────────────────────────────────────────────────────


def sample(cell: Cell, moves: Moves) -> tuple[Sampled, Verdict]:
    """The joints along each move, and whether they exist, keep the branch and stay in limits."""
    steps = _steps(moves)
    first = np.concatenate([[0], np.cumsum(steps + 1)])
    row = np.repeat(np.arange(len(moves)), steps + 1)
    place = np.arange(len(row)) - first[row]
    share = place / steps[row]
    joints = np.empty((len(row), 6))
    turning = np.asarray(moves.by_joints[row])
    joints[turning] = _between(moves, row[turning], share[turning])
    going = np.flatnonzero(~turning)
    rotation, position_mm = _tool_between(moves, row[going], share[going])
    for start in range(0, len(going), _BLOCK):
        some = slice(start, start + _BLOCK)
        found = cell.branches(rotation[some], position_mm[some])
        joints[going[some]] = pick(found, moves.branch[row[going[some]]])
    begins = np.zeros(len(row), dtype=np.bool_)
    begins[first[:-1]] = True
    joints, jump = _unwrapped(joints, begins, moves, row)
    sampled = Sampled(moves, first, joints)
    return sampled, _judge(cell, sampled, row, share, turning, jump)


def _steps(moves: Moves) -> NDArray[np.int64]:
    length = np.linalg.norm(moves.stop_mm - moves.start_mm, axis=1) / STEP_MM
    angle = np.linalg.norm(moves.turn_rad, axis=1) / STEP_RAD
    joint = np.abs(moves.stop_joints - moves.start_joints).max(axis=1, initial=0.0) / JOINT_STEP_RAD
    steps = np.where(moves.by_joints, joint, np.maximum(length, angle))
    return np.asarray(np.maximum(1, np.ceil(np.nan_to_num(steps, nan=1.0))), dtype=np.int64)


def _unwrapped(
    joints: Floats, begins: Bools, moves: Moves, row: NDArray[np.int64]
) -> tuple[Floats, Floats]:
    """Joints continued from each move's start by less than half a turn from sample to sample, and
    the step (N, 6) that leads to each."""
    before = np.empty_like(joints)
    before[1:] = joints[:-1]
    before[begins] = moves.start_joints[row[begins]]
    step = joints - before
    straight = np.asarray(~moves.by_joints[row])
    step[straight] -= 2 * np.pi * np.round(step[straight] / (2 * np.pi))
    # A running sum over all samples, less what it was where each move begins.
    known = np.nan_to_num(step)
    total = np.cumsum(known, axis=0)
    start = (total - known)[begins]
    continued = moves.start_joints[row] + total - start[row]
    turns = np.round((continued - joints) / (2 * np.pi))
    return np.where(straight[:, None], joints + 2 * np.pi * turns, joints), step


def _judge(
    cell: Cell,
    sampled: Sampled,
    row: NDArray[np.int64],
    share: Floats,
    turning: Bools,
    step: Floats,
) -> Verdict:
    moves, joints, first = sampled.moves, sampled.joints, sampled.first
    count = len(moves)
    cause = np.zeros(len(row), dtype=np.int32)
    detail = np.zeros(len(row), dtype=np.int32)
    lost = np.asarray(np.isnan(joints).any(axis=1))
    begins = np.zeros(len(row), dtype=np.bool_)
    begins[first[:-1]] = True
    over = np.maximum(cell.low_rad - joints, joints - cell.high_rad) + _bulge_rad(step, begins)
    worst = np.nanmax(np.where(lost[:, None], -np.inf, over), axis=1, initial=-np.inf)
    outside = np.asarray(worst > SLACK_RAD)
    jump = np.where(np.isnan(step), 0.0, np.abs(step)).max(axis=1, initial=0.0)
    jumps = np.asarray(~turning & np.where(begins, jump > CLOSURE_RAD, jump > JUMP_RAD))
    bend = np.full(len(row), np.inf)
    straight = ~turning & ~lost
    if straight.any():
        bend[straight] = singularity(cell.geometry, joints[straight]).wrist_rad
    for bad, why in (
        (jumps, JUMP),
        (bend < cell.singular_rad, SINGULAR),
        (outside, LIMIT),
        (lost, REACH),
    ):
        cause[bad] = why
    detail[jumps] = np.abs(np.nan_to_num(step)).argmax(axis=1)[jumps]
    detail[outside] = np.where(lost[:, None], -np.inf, over).argmax(axis=1)[outside]
    # The first bad sample of each move speaks for it.
    bad_at = np.where(cause > 0, np.arange(len(row)), len(row))
    worst_at = np.minimum.reduceat(bad_at, first[:-1]) if count else np.empty(0, dtype=np.int64)
    good = worst_at >= len(row)
    at = np.where(good, first[:-1], worst_at)
    end = joints[first[1:] - 1] if count else np.empty((0, 6))
    verdict_cause = np.where(good, FINE, cause[at]).astype(np.int32)
    asked = ~np.isnan(moves.stop_joints).any(axis=1) & ~moves.by_joints
    missed = good & asked & ~(np.abs(end - moves.stop_joints).max(axis=1) <= CLOSURE_RAD)
    verdict_cause[missed] = MISSED
    return Verdict(
        verdict_cause,
        np.where(missed, 1.0, share[at]),
        np.full(count, -1, dtype=np.int32),
        detail[at],
        end,
    )


def _bulge_rad(step: Floats, begins: Bools) -> Floats:
    """How far joints (N, 6) may go beyond two neighbouring samples on the way between them: an
    eighth of the change of their steps, as a parabola through three samples does."""
    change = np.zeros_like(step)
    change[1:-1] = np.nan_to_num(np.abs(step[2:] - step[1:-1])) * BULGE
    change[begins] = 0.0
    change[:-1][begins[1:]] = 0.0
    bulge = change.copy()
    np.maximum(bulge[1:], change[:-1], out=bulge[1:])
    np.maximum(bulge[:-1], change[1:], out=bulge[:-1])
    return bulge


def joints_at(cell: Cell, sampled: Sampled, row: NDArray[np.int64], share: Floats) -> Floats:
    """Joints (k, 6) at a share of the moves `row` (k,): exact, in the winding of the samples."""
    moves, first = sampled.moves, sampled.first
    joints = np.empty((len(row), 6))
    turning = moves.by_joints[row]
    joints[turning] = _between(moves, row[turning], share[turning])
    going = np.flatnonzero(~turning)
    if len(going):
        some, at = row[going], share[going]
        found = pick(cell.branches(*_tool_between(moves, some, at)), moves.branch[some])
        steps = first[some + 1] - first[some] - 1
        near = sampled.joints[first[some] + np.rint(at * steps).astype(np.int64)]
        joints[going] = found - 2 * np.pi * np.round((found - near) / (2 * np.pi))
    return joints


def _between(moves: Moves, row: NDArray[np.int64], share: Floats) -> Floats:
    start, stop = moves.start_joints[row], moves.stop_joints[row]
    return np.asarray(start + (stop - start) * share[:, None])


def _tool_between(moves: Moves, row: NDArray[np.int64], share: Floats) -> tuple[Floats, Floats]:
    position_mm = moves.start_mm[row] + (moves.stop_mm - moves.start_mm)[row] * share[:, None]
    rotation = moves.rotation[row]
    turns = np.flatnonzero((moves.turn_rad[row] != 0).any(axis=1))
    if len(turns):
        turned = Rotation.from_rotvec(moves.turn_rad[row[turns]] * share[turns, None]).as_matrix()
        rotation[turns] = rotation[turns] @ turned
    return rotation, position_mm

"""Proof that an arm's moves keep clear of what stands around, of all bodies at every place.

Every stretch of a move is proven clear at its middle, of bodies grown by as much as they move
within the stretch; stretches that are not proven are halved until the growth is `FINEST_MM`. What
passes is clear everywhere, not only at samples.

From the middle of a stretch to an end of it no point goes farther than to the end itself, and the
most that its way can leave the chord between: an eighth of its greatest acceleration, the half
stretch being the unit of time. While joint i turns by q_i, that is at most the sum over i and j of
|q_i q_j| times the distance from the axis of the later of the two joints.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats, Ints
from drillc.planning.cell import LEAST_GAP_MM, TOOL, Cell, Guard, Mover
from drillc.planning.moves import HIT, Bools, Moves, Sampled, Verdict, joints_at, sample

#: By how much a body is grown to stand for a stretch of a move: the next of these above its motion.
_GROWTHS_MM = np.array([1.5, 4.0, 10.0, 25.0, 60.0, 150.0])
FINEST_MM = float(_GROWTHS_MM[0])
#: What every move keeps beside its clearance, because a controller does not follow it to the last
#: digit: the printed numbers are rounded, and a program in joints goes in short chords.
OFF_THE_WAY_MM = 0.3
#: On a straight move of the tool, the joints' own acceleration is measured at three places of a
#: stretch, and may be so many times greater between.
_UNEVEN = 2.0
#: A stretch this short that still moves too far is a leap of the joints: it is never proven.
_SHORTEST = 1e-6
#: Stretches with which a proof begins.
_FIRST = 4
_BLOCK = 4096


def check_moves(cell: Cell, moves: Moves) -> Verdict:
    """Judge every move."""
    sampled, verdict = sample(cell, moves)
    rows = np.flatnonzero(verdict.fine)
    hits = find_hits(cell, sampled, rows, cell.movers)
    cause, share, mover = verdict.cause.copy(), verdict.share.copy(), verdict.mover.copy()
    hit = hits.guard >= 0
    cause[rows[hit]] = HIT + hits.guard[hit]
    share[rows[hit]] = hits.share[hit]
    mover[rows[hit]] = hits.mover[hit]
    return Verdict(cause, share, mover, verdict.detail, verdict.end_joints)


@dataclass(frozen=True, eq=False)
class Hits:
    """Per move: which guard is not proven clear of (-1: none), by which mover, and where."""

    guard: Ints
    mover: Ints
    share: Floats


def find_hits(
    cell: Cell,
    sampled: Sampled,
    rows: NDArray[np.int64],
    movers: tuple[Mover, ...],
    stretches: int = _FIRST,
) -> Hits:
    """Prove the moves `rows` clear of every guard by its region's clearance less `LEAST_GAP_MM`;
    what cannot be proven at the finest growth is a hit. The proof begins with so many `stretches`
    of each."""
    guard = np.full(len(rows), -1, dtype=np.int32)
    mover_at = np.full(len(rows), -1, dtype=np.int32)
    share = np.full(len(rows), np.nan)
    moving = [
        _Moving(i, mover, _levers_mm(cell, mover))
        for i, mover in enumerate(cell.movers)
        if mover in movers and mover.link > 0
    ]
    for g, wanted in enumerate(cell.guards):
        clearance_mm = wanted.clearance_mm[sampled.moves.region[rows]]
        open_ = np.flatnonzero((guard < 0) & np.isfinite(clearance_mm))
        for start in range(0, len(open_), _BLOCK):
            some = open_[start : start + _BLOCK]
            found = _first_hits(
                cell, sampled, rows[some], clearance_mm[some], moving, wanted, stretches
            )
            hit = found.mover >= 0
            guard[some[hit]] = g
            mover_at[some[hit]] = found.mover[hit]
            share[some[hit]] = found.share[hit]
    return Hits(guard, mover_at, share)


@dataclass(frozen=True, eq=False)
class _Moving:
    """A body, its index among the cell's, and how far it reaches from each joint's axis (6,), in
    mm; 0: that joint does not move it."""

    index: int
    mover: Mover
    levers_mm: Floats


@dataclass(frozen=True, eq=False)
class _Places:
    """The arm at k places: joints (k, 6), and links and tool, rotation (k, 8, 3, 3) and origin
    (k, 8, 3)."""

    joints: Floats
    rotation: Floats
    origin_mm: Floats

    def of(self, mover: Mover) -> tuple[Floats, Floats]:
        """Where a body is."""
        return self.rotation[:, mover.link], self.origin_mm[:, mover.link]


def _first_hits(
    cell: Cell,
    sampled: Sampled,
    rows: NDArray[np.int64],
    clearance_mm: Floats,
    moving: list[_Moving],
    guard: Guard,
    stretches: int,
) -> Hits:
    """Halve what is not proven, all moves together; of the stretches that cannot be, the one
    nearest to the start is told, by its middle."""
    mover_at = np.full(len(rows), -1, dtype=np.int32)
    first = np.full(len(rows), np.inf)  # where that stretch begins
    share = np.full(len(rows), np.nan)
    which = np.repeat(np.arange(len(rows)), stretches)  # stretch → move
    low = np.tile(np.arange(stretches) / stretches, len(rows))
    high = low + 1.0 / stretches
    while len(which):
        middle = 0.5 * (low + high)
        ends = [_places(cell, sampled, rows[which], s) for s in (low, high)]
        at = _places(cell, sampled, rows[which], middle)
        split = np.zeros(len(which), dtype=np.bool_)
        for body in moving:
            mover, place = body.mover, at.of(body.mover)
            motion_mm = np.maximum(
                _displacement(mover, place, ends[0].of(mover)),
                _displacement(mover, place, ends[1].of(mover)),
            ) + _bulge_mm(body, sampled.moves, rows[which], 0.5 * (high - low), at, ends)
            level = np.searchsorted(_GROWTHS_MM, motion_mm)
            blocked = level >= len(_GROWTHS_MM)
            asked_mm = np.maximum(0.0, clearance_mm[which] - LEAST_GAP_MM) + OFF_THE_WAY_MM
            growth = asked_mm + _GROWTHS_MM[np.minimum(level, len(_GROWTHS_MM) - 1)]
            for exact in (False, True):  # exact where no shorter stretch will be asked
                todo = np.flatnonzero(~blocked & ~split & ((level == 0) == exact))
                blocked[todo] = ~_clear(guard, mover, growth[todo], place, todo, exact=exact)
            final = blocked & ((level == 0) | (high - low < _SHORTEST))
            # Where the body itself is too near, no shorter stretch can help.
            rest = np.flatnonzero(blocked & ~final & ~split)
            final[rest] = ~_clear(guard, mover, asked_mm[rest], place, rest, exact=True)
            for stretch in np.flatnonzero(final).tolist():
                move = which[stretch]
                if low[stretch] < first[move]:
                    first[move], mover_at[move] = low[stretch], body.index
                    share[move] = middle[stretch]
            split |= blocked
        # A move that is known to hit needs no more proof, but for what lies before its hit.
        split &= low < first[which]
        which = np.repeat(which[split], 2)
        cut = np.stack([low[split], middle[split], high[split]], axis=1)
        low, high = cut[:, :2].reshape(-1), cut[:, 1:].reshape(-1)
    return Hits(np.where(mover_at >= 0, 0, -1).astype(np.int32), mover_at, share)


def _clear(
    guard: Guard,
    mover: Mover,
    growth_mm: Floats,
    place: tuple[Floats, Floats],
    rows: NDArray[np.int64],
    *,
    exact: bool,
) -> Bools:
    """Whether the body, grown by growth_mm (k,), is proven clear at places `rows` (k,)."""
    clear = np.empty(len(rows), dtype=np.bool_)
    for value in np.unique(growth_mm).tolist():
        some = np.flatnonzero(growth_mm == value)
        at = rows[some]
        clear[some] = guard.obstacles.clear(
            mover.probe(value), place[0][at], place[1][at], exact=exact
        )
    return clear


def _places(cell: Cell, sampled: Sampled, row: NDArray[np.int64], share: Floats) -> _Places:
    """Where the arm is at a share of the moves."""
    joints = joints_at(cell, sampled, row, share)
    rotation, origin_mm = np.empty((len(row), 8, 3, 3)), np.empty((len(row), 8, 3))
    rotation[:, :TOOL], origin_mm[:, :TOOL] = cell.link_poses(joints)
    rotation[:, TOOL], origin_mm[:, TOOL] = cell.tool_pose(joints)
    return _Places(joints, rotation, origin_mm)


def _displacement(mover: Mover, one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> Floats:
    """How far the farthest corner of the body (k,) is from one pose to the other."""
    turned = np.einsum("nij,cj->nci", one[0] - other[0], mover.corners_mm)
    moved = turned + (one[1] - other[1])[:, None]
    return np.asarray(np.sqrt(np.einsum("nci,nci->nc", moved, moved).max(axis=1)))


def _levers_mm(cell: Cell, mover: Mover) -> Floats:
    """No point of the body is farther from the axis of joint i than element i (6,): along the arm
    from there, and across the body."""
    geometry, corners_mm = cell.geometry, mover.corners_mm
    if mover.link == TOOL:
        pose = cell.flange_from_tool
        corners_mm = corners_mm @ pose.rotation.T + pose.translation_mm
    to_next = np.array(
        [
            np.hypot(geometry.a1_mm, geometry.b_mm),
            geometry.c2_mm,
            geometry.forearm_mm,
            0.0,
            geometry.c4_mm,
        ]
    )
    link = min(mover.link, 6)
    levers_mm = np.zeros(6)
    for joint in range(link):
        levers_mm[joint] = to_next[joint : link - 1].sum()
    levers_mm[:link] += np.linalg.norm(corners_mm, axis=1).max()
    return levers_mm


def _bulge_mm(
    body: _Moving,
    moves: Moves,
    row: NDArray[np.int64],
    half: Floats,
    middle: _Places,
    ends: list[_Places],
) -> Floats:
    """By how much (k,) the body's way from the middle of a stretch to its ends, each `half` (k,) of
    the move away, may leave the chords at most."""
    before, after = middle.joints - ends[0].joints, ends[1].joints - middle.joints
    turn = np.maximum(np.abs(before), np.abs(after))
    # The lever of a pair of joints is the later one's: 2 Σ_{i<j} + Σ_{i=j}.
    earlier = np.cumsum(turn, axis=1) - turn
    bent_mm = (turn * (turn + 2.0 * earlier)) @ body.levers_mm
    bent_mm += _UNEVEN * (np.abs(after - before) @ body.levers_mm)
    if body.mover.link == TOOL:
        # On a straight move the tool only turns, evenly and about its own point.
        lever_mm = np.linalg.norm(body.mover.corners_mm, axis=1).max()
        own_mm = lever_mm * (half * np.linalg.norm(moves.turn_rad[row], axis=1)) ** 2
        bent_mm = np.where(moves.by_joints[row], bent_mm, own_mm)
    return np.asarray(bent_mm / 8.0)

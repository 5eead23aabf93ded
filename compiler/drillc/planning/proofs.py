"""Proof that an arm's moves keep clear of what stands around, of all bodies at every place.

Every stretch of a move is proven clear at its middle, of bodies grown by as much as they move
within the stretch; stretches that are not proven are halved until the growth is `FINEST_MM`. What
passes is clear everywhere, not only at samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats, Ints
from drillc.planning.cell import LEAST_GAP_MM, TOOL, Cell, Guard, Mover
from drillc.planning.moves import HIT, Bools, Moves, Sampled, Verdict, joints_at, sample

#: By how much a body is grown to stand for a stretch of a move: the next of these above its motion.
_GROWTHS_MM = np.array([0.8, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0, 256.0])
FINEST_MM = float(_GROWTHS_MM[0])
#: The corners' motion is measured from a stretch's middle to its ends; a curved way in between may
#: lead this share farther.
_CURVED = 1.05
#: A stretch this short that still moves too far is a leap of the joints: it is never proven.
_SHORTEST = 1e-6
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
    cell: Cell, sampled: Sampled, rows: NDArray[np.int64], movers: tuple[Mover, ...]
) -> Hits:
    """Prove the moves `rows` clear of every guard by its region's clearance, less `LEAST_GAP_MM`;
    what cannot be proven at the finest growth is a hit."""
    guard = np.full(len(rows), -1, dtype=np.int32)
    mover_at = np.full(len(rows), -1, dtype=np.int32)
    share = np.full(len(rows), np.nan)
    moving = [(i, m) for i, m in enumerate(cell.movers) if m in movers and m.link > 0]
    for g, wanted in enumerate(cell.guards):
        clearance_mm = wanted.clearance_mm[sampled.moves.region[rows]]
        open_ = np.flatnonzero((guard < 0) & np.isfinite(clearance_mm))
        for start in range(0, len(open_), _BLOCK):
            some = open_[start : start + _BLOCK]
            found = _first_hits(cell, sampled, rows[some], clearance_mm[some], moving, wanted)
            hit = found.mover >= 0
            guard[some[hit]] = g
            mover_at[some[hit]] = found.mover[hit]
            share[some[hit]] = found.share[hit]
    return Hits(guard, mover_at, share)


def _first_hits(
    cell: Cell,
    sampled: Sampled,
    rows: NDArray[np.int64],
    clearance_mm: Floats,
    moving: list[tuple[int, Mover]],
    guard: Guard,
) -> Hits:
    """Halve what is not proven, all moves together; the stretch nearest to the start is told."""
    mover_at = np.full(len(rows), -1, dtype=np.int32)
    share = np.full(len(rows), np.inf)
    which = np.arange(len(rows))  # stretch → move
    low, high = np.zeros(len(rows)), np.ones(len(rows))
    while len(which):
        middle = 0.5 * (low + high)
        poses = [_poses(cell, sampled, rows[which], s) for s in (low, middle, high)]
        split = np.zeros(len(which), dtype=np.bool_)
        for index, mover in moving:
            places = [(rotation[:, mover.link], at[:, mover.link]) for rotation, at in poses]
            motion_mm = _CURVED * np.maximum(
                _displacement(mover, places[1], places[0]),
                _displacement(mover, places[1], places[2]),
            )
            level = np.searchsorted(_GROWTHS_MM, motion_mm)
            blocked = level >= len(_GROWTHS_MM)
            asked_mm = np.maximum(0.0, clearance_mm[which] - LEAST_GAP_MM)
            growth = asked_mm + _GROWTHS_MM[np.minimum(level, len(_GROWTHS_MM) - 1)]
            todo = np.flatnonzero(~blocked & ~split)
            blocked[todo] = ~_clear(guard, mover, growth[todo], places[1], todo)
            final = blocked & ((level == 0) | (high - low < _SHORTEST))
            # Where the body itself is too near, no shorter stretch can help.
            rest = np.flatnonzero(blocked & ~final & ~split)
            final[rest] = ~_clear(guard, mover, asked_mm[rest], places[1], rest)
            for stretch in np.flatnonzero(final).tolist():
                move = which[stretch]
                if low[stretch] < share[move]:
                    share[move], mover_at[move] = low[stretch], index
            split |= blocked
        # A move that is known to hit needs no more proof, but for what lies before its hit.
        split &= low < share[which]
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
) -> Bools:
    """Whether the body, grown by growth_mm (k,), is proven clear at places `rows` (k,)."""
    clear = np.empty(len(rows), dtype=np.bool_)
    for value in np.unique(growth_mm).tolist():
        some = np.flatnonzero(growth_mm == value)
        at = rows[some]
        clear[some] = guard.obstacles.clear(mover.probe(value), place[0][at], place[1][at])
    return clear


def _poses(
    cell: Cell, sampled: Sampled, row: NDArray[np.int64], share: Floats
) -> tuple[Floats, Floats]:
    """Links and tool at a share of the moves: rotation (k, 8, 3, 3), origin (k, 8, 3)."""
    joints = joints_at(cell, sampled, row, share)
    rotation, origin_mm = np.empty((len(row), 8, 3, 3)), np.empty((len(row), 8, 3))
    rotation[:, :TOOL], origin_mm[:, :TOOL] = cell.link_poses(joints)
    rotation[:, TOOL], origin_mm[:, TOOL] = cell.tool_pose(joints)
    return rotation, origin_mm


def _displacement(mover: Mover, one: tuple[Floats, Floats], other: tuple[Floats, Floats]) -> Floats:
    """How far the farthest corner of the body (k,) is from one pose to the other."""
    turned = np.einsum("nij,cj->nci", one[0] - other[0], mover.corners_mm)
    moved = turned + (one[1] - other[1])[:, None]
    return np.asarray(np.sqrt(np.einsum("nci,nci->nc", moved, moved).max(axis=1)))

"""Joints along straight moves, for controllers that know only joints that move in proportion.

A straight move of the tool is bent in the joints. Cut at places so near to each other that the
joints' own straight ways between them leave it by less than a tolerance, it can be driven by any
controller. How far they leave it is measured half way between two places, where it is farthest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats, Ints
from drillc.planning.cell import TOOL, Cell
from drillc.planning.moves import Moves, Sampled, joints_at, sample

Rows = NDArray[np.int64]

#: What must keep to the straight way: the tool's point, or every point of the arm and its tool.
Kept = Literal["point", "bodies"]


@dataclass(frozen=True, eq=False)
class Nodes:
    """Places along w moves: those of move i are `first[i]` … `first[i + 1]`, evenly spaced from
    start to stop, both included."""

    first: Rows  # (w + 1,)
    joints: Floats  # (N, 6) rad


def end_joints(cell: Cell, moves: Moves) -> Floats:
    """The joints (w, 6) in which moves end, in the winding in which they are made."""
    return _sampled(cell, moves)[1]


def steps_needed(cell: Cell, moves: Moves, within_mm: float, kept: Kept) -> Rows:
    """Into how many even steps (w,) each move must be cut for what is `kept` to stay `within_mm`
    of where it would be, when all joints move in proportion in every step.

    Raises ValueError for a move that the arm cannot make: planning has proven that it can.
    """
    sampled, _ = _sampled(cell, moves)
    steps = np.maximum(1, np.diff(sampled.first) // 2)  # so that what is measured is as dense
    open_ = np.arange(len(moves))
    while len(open_):
        left_mm = _left_mm(cell, sampled, open_, steps[open_], kept)
        far = left_mm > within_mm
        open_ = open_[far]
        # A chord leaves its arc by a quarter as much when it is half as long.
        grown = np.ceil(steps[open_] * np.sqrt(left_mm[far] / within_mm)).astype(np.int64)
        steps[open_] = np.maximum(steps[open_] + 1, grown)
    return np.asarray(steps)


def place_nodes(cell: Cell, moves: Moves, steps: Rows) -> Nodes:
    """The joints of every move at the ends of its `steps` (w,)."""
    sampled, _ = _sampled(cell, moves)
    first, row, place = _spread(steps)
    return Nodes(first, joints_at(cell, sampled, row, place / steps[row]))


def branch_of(cell: Cell, pose: tuple[Floats, Floats], joints: Floats) -> Ints:
    """The branch (w,) in which `joints` (w, 6) bring the tool to a pose."""
    away = cell.branches(*pose) - joints[:, None]
    away -= 2 * np.pi * np.round(away / (2 * np.pi))
    far = np.nan_to_num(np.abs(away).max(axis=2, initial=0.0), nan=np.inf)
    return np.asarray(far.argmin(axis=1), dtype=np.int32)


def _sampled(cell: Cell, moves: Moves) -> tuple[Sampled, Floats]:
    """Samples of the moves, and the joints in which they end."""
    sampled, verdict = sample(cell, moves)
    if not verdict.fine.all():
        row = int(np.argmin(verdict.fine))
        raise ValueError(f"straight move {row} of a program fails: cause {verdict.cause[row]}")
    return sampled, verdict.end_joints


def _spread(steps: Rows) -> tuple[Rows, Rows, Rows]:
    """The places of moves cut into `steps` (k,): where each move's begin (k + 1,), and of each
    place the move (N,) and its number there (N,)."""
    first = np.concatenate([[0], np.cumsum(steps + 1)])
    row = np.repeat(np.arange(len(steps)), steps + 1)
    return first, row, np.arange(len(row)) - first[row]


def _left_mm(cell: Cell, sampled: Sampled, rows: Rows, steps: Rows, kept: Kept) -> Floats:
    """How far (k,) moves `rows` (k,), cut into `steps` (k,), leave their straight way."""
    _, row, place = _spread(2 * steps)
    joints = joints_at(cell, sampled, rows[row], place / (2 * steps[row]))
    middle = np.flatnonzero(place % 2)
    chord = 0.5 * (joints[middle - 1] + joints[middle + 1])
    measure = _point_moves_mm if kept == "point" else _bodies_move_mm
    left_mm = measure(cell, joints[middle], chord)
    return np.asarray(np.maximum.reduceat(left_mm, np.cumsum(steps) - steps))


def _point_moves_mm(cell: Cell, joints: Floats, other: Floats) -> Floats:
    """How far apart the tool's point is, (k,)."""
    apart = cell.tool_pose(joints)[1] - cell.tool_pose(other)[1]
    return np.asarray(np.linalg.norm(apart, axis=1))


def _bodies_move_mm(cell: Cell, joints: Floats, other: Floats) -> Floats:
    """How far apart the farthest point of arm and tool is, (k,)."""
    farthest = np.zeros(len(joints))
    links = cell.link_poses(joints), cell.link_poses(other)
    tools = cell.tool_pose(joints), cell.tool_pose(other)
    for mover in cell.movers:
        if mover.link == TOOL:
            (turn, place), (other_turn, other_place) = tools
        else:
            (turn, place), (other_turn, other_place) = (
                (rotation[:, mover.link], origin[:, mover.link]) for rotation, origin in links
            )
        moved = np.einsum("nij,cj->nci", turn - other_turn, mover.corners_mm)
        moved += (place - other_place)[:, None]
        farthest = np.maximum(farthest, np.linalg.norm(moved, axis=2).max(axis=1))
    return farthest

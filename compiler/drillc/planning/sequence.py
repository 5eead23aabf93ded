"""One candidate for each hole: the choice that costs the least over the whole sequence.

The cost is in seconds (`language.job.Weights`): leaving the rule's heading, joint travel from
standoff to standoff at the joints' full speeds, closeness to limits and to the wrist's singularity,
and a change of branch. `heading_jump` is a limit, not a cost.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drillc.kernels.ladder import Choice, Ladder
from drillc.kernels.posture import heading_turn_rad
from drillc.kernels.wound_ladder import best_wound_ladder
from drillc.language.job import Floats, Weights
from drillc.planning.cell import Cell
from drillc.planning.cycle_check import (
    ENOUGH_BEND_RAD,
    ENOUGH_LIMIT,
    Candidates,
    Cycles,
    join,
)
from drillc.planning.headings import turned
from drillc.planning.tool_sweeps import ToolSweeps

#: What changing the branch costs, beside the joints' travel: a stop, and a move by joints.
BRANCH_CHANGE_S = 2.0
#: Where leaving the rule costs less than so many times the travel, every hole that may turn is
#: searched over its whole range, not only those whose rule's heading fails.
SEARCH_ALL_BELOW = 5.0
#: Holes to either side of one that cannot be reached within `heading_jump` that are searched too.
_AROUND = 8
#: More headings than a grid has.
_ALL = 1000

Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Sequence:
    """The chosen candidate of each hole, or (with `blocked`) the first hole that none of the
    choices before it can be continued to within `heading_jump`."""

    chosen: Candidates
    total_s: float
    blocked: int | None


def choose(
    cell: Cell,
    cycles: Cycles,
    sweeps: ToolSweeps,
    candidates: Candidates,
    turning_rad: Floats,
    jump_limit_rad: Floats,
    weights: Weights,
) -> Sequence:
    """The best sequence. Every hole has candidates; turning_rad (n,) says how far each may turn,
    jump_limit_rad (n - 1,) how far the heading may jump to the next. Where that cannot be kept with
    the candidates at hand, more are sought around the hole in question."""
    searched = np.zeros(len(cycles), dtype=np.bool_)
    if weights.deviation < SEARCH_ALL_BELOW * weights.travel:
        rows = np.flatnonzero(turning_rad > 0)
        searched[rows] = True
        candidates = join([candidates, _all(cell, cycles, sweeps, rows, turning_rad)])
    jump_rad = heading_turn_rad(cycles.rotation)
    while True:
        choice = _best(cell, candidates, len(cycles), jump_rad, jump_limit_rad, weights)
        if choice.blocked is None:
            return Sequence(candidates.take(choice.index), choice.total, None)
        rows = _unsearched(choice.blocked, (turning_rad > 0) & ~searched)
        if not len(rows):
            return Sequence(candidates.take(choice.index), choice.total, choice.blocked)
        searched[rows] = True
        candidates = join([candidates, _all(cell, cycles, sweeps, rows, turning_rad)])


def _unsearched(blocked: int, free: NDArray[np.bool_]) -> Rows:
    """Holes that may still be searched (`free`, n) around the one that is blocked: those nearby,
    or where there are none, those of the next wider stretch."""
    around = _AROUND
    while True:
        first = max(0, blocked - around)
        rows = first + np.flatnonzero(free[first : blocked + around])
        if len(rows) or (first == 0 and blocked + around >= len(free)):
            return rows
        around *= 2


def _all(
    cell: Cell, cycles: Cycles, sweeps: ToolSweeps, rows: Rows, turning_rad: Floats
) -> Candidates:
    """Candidates over the whole range of each hole."""
    return turned(cell, cycles, sweeps, rows, turning_rad[rows], enough=_ALL)


def _best(
    cell: Cell,
    candidates: Candidates,
    count: int,
    jump_rad: Floats,
    jump_limit_rad: Floats,
    weights: Weights,
) -> Choice:
    cost = weights.deviation * np.abs(candidates.heading_rad)
    cost = cost + weights.margin * closeness(candidates)
    home = cell.arm.home_rad
    weight = weights.travel / cell.speed_rad_s
    if home is not None:
        ends = (
            (candidates.row == 0, candidates.standoff),
            (candidates.row == count - 1, candidates.leave),
        )
        for which, joints in ends:
            cost[which] += np.abs(joints[which] - home) @ weight
    ladder = Ladder(
        joints=candidates.standoff,
        start=np.searchsorted(candidates.row, np.arange(count + 1)),
        cost=cost,
        heading_rad=candidates.heading_rad,
        jump_rad=jump_rad,
        jump_limit_rad=jump_limit_rad,
        weight=weight,
        group=candidates.branch,
        group_cost=BRANCH_CHANGE_S,
    )
    return best_wound_ladder(ladder, _poses(candidates))


def _poses(candidates: Candidates) -> Rows:
    """A number (m,) for what candidates that follow each other are windings of."""
    columns = candidates.row, candidates.heading_rad, candidates.branch
    changes = [column[1:] != column[:-1] for column in columns]
    return np.cumsum(np.append(False, np.any(changes, axis=0)))


def closeness(candidates: Candidates) -> Floats:
    """How close each candidate (m,) comes to a limit and to the wrist's singularity: 0 where there
    is enough room, growing to 1 for each of the two where there is none."""
    limit = 1.0 - np.minimum(1.0, candidates.margin / ENOUGH_LIMIT)
    bend = 1.0 - np.minimum(1.0, candidates.bend_rad / ENOUGH_BEND_RAD)
    return np.asarray(limit**2 + bend**2)

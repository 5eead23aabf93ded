"""Candidates for each hole: headings at which the tool keeps clear, with the joints that hold them.

Lazily: first the rule's own heading, exactly. Only where that fails (or where more choice is asked
for) are intervals of headings tested, nearest to the rule's first, halving each until it is proven
free, proven blocked, or as narrow as `FINEST_RAD`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats
from drillc.planning.cell import Cell
from drillc.planning.cycle_check import Candidates, Cycles, assess, join
from drillc.planning.moves import FINE
from drillc.planning.tool_sweeps import ToolSweeps

#: Intervals of headings are halved until they are this narrow: how exactly a turn is the smallest.
FINEST_RAD = np.radians(0.1)
#: How exactly the turn is the smallest where it is the arm, not the tool, that asks for it.
ARM_FINEST_RAD = np.radians(0.5)
#: Headings within a free stretch stand this far apart.
GRID_RAD = np.radians(5.0)
#: Beyond the nearest free heading on a side, so much more of that side is searched.
SPREAD_RAD = np.radians(45.0)

Rows = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class _Stretches:
    """Headings proven free: `low` … `high` (k,), radians away from the rule's on side +1 or -1."""

    row: Rows
    side: Floats
    low: Floats
    high: Floats


def preferred(cell: Cell, cycles: Cycles, sweeps: ToolSweeps, rows: Rows) -> Candidates:
    """The candidates of holes at their rule's own heading."""
    clear = rows[sweeps.clear(rows, np.zeros(len(rows)))]
    return assess(cell, cycles, clear, np.zeros(len(clear))).candidates


def turned(
    cell: Cell,
    cycles: Cycles,
    sweeps: ToolSweeps,
    rows: Rows,
    turning_rad: Floats,
    *,
    enough: int = 1,
) -> Candidates:
    """Candidates of holes `rows` at other headings, at most `turning_rad` (k,) away: the nearest
    that works on either side, and up to `enough` of a grid behind it. What is nearest is exact to
    `FINEST_RAD` where the tool decides, to `ARM_FINEST_RAD` where the arm does."""
    free = _free_stretches(sweeps, rows, turning_rad)
    if not len(free.row):
        return assess(cell, cycles, np.empty(0, np.int64), np.empty(0)).candidates
    row, side, away, works, found = _on_grid(cell, cycles, free, enough)
    nearest = _nearest(cell, cycles, free, row, side, away, works)
    exact = _exact(sweeps, nearest, free)
    at_edges = assess(cell, cycles, exact[0], exact[1]).candidates
    return _distinct(join([at_edges, *found]))


# ── stretches of free headings ───────────────────────────────────────────────────────────────────


def _free_stretches(sweeps: ToolSweeps, rows: Rows, turning_rad: Floats) -> _Stretches:
    """Intervals of headings, on both sides of the rule's, over which the tool is proven clear."""
    # One task for each hole and side; cells of it are halved together, level by level.
    row = np.concatenate([rows, rows])
    side = np.repeat([1.0, -1.0], len(rows))
    task = np.arange(len(row))
    width = np.concatenate([turning_rad, turning_rad])
    low = np.zeros(len(row))
    nearest = np.full(len(row), np.inf)
    found: list[tuple[Rows, Floats, Floats]] = []
    for half in _halves(float(turning_rad.max(initial=0.0))):
        # Ranges differ between regions: a cell is tested when the common halving reaches its width.
        now = width > 1.5 * half
        free = np.zeros(len(task), dtype=np.bool_)
        blocked = np.zeros(len(task), dtype=np.bool_)
        middle = side[task] * (low + 0.5 * width)
        for value in np.unique(width[now]).tolist():
            some = np.flatnonzero(now & (width == value))
            free[some] = sweeps.clear(row[task[some]], middle[some], 0.5 * value)
            rest = some[~free[some]]
            if value > FINEST_RAD:
                blocked[rest] = sweeps.blocked(row[task[rest]], middle[rest], 0.5 * value)
        np.minimum.at(nearest, task[free], low[free])
        found.append((task[free], low[free], low[free] + width[free]))
        keep = ~free & ~blocked & (width > FINEST_RAD)
        keep &= low < nearest[task] + SPREAD_RAD
        # Behind the nearest free heading a coarse picture is enough.
        keep &= (low < nearest[task]) | (width > GRID_RAD)
        split = keep & now
        task = np.concatenate([np.repeat(task[split], 2), task[keep & ~now]])
        low = np.concatenate(
            [
                np.stack([low[split], low[split] + 0.5 * width[split]], axis=1).ravel(),
                low[keep & ~now],
            ]
        )
        width = np.concatenate([np.repeat(0.5 * width[split], 2), width[keep & ~now]])
        if not len(task):
            break
    which = np.concatenate([f[0] for f in found])
    begin, end = (np.concatenate([f[i] for f in found]) for i in (1, 2))
    order = np.lexsort((begin, which))
    return _merged(row, side, which[order], begin[order], end[order])


def _halves(greatest_rad: float) -> Floats:
    """Half widths, from half the greatest range down to `FINEST_RAD`."""
    levels = max(1, int(np.ceil(np.log2(max(greatest_rad / FINEST_RAD, 2.0)))) + 1)
    return np.asarray(0.5 * greatest_rad * 0.5 ** np.arange(levels))


def _merged(row: Rows, side: Floats, task: Rows, low: Floats, high: Floats) -> _Stretches:
    """Neighbouring cells as one stretch."""
    if not len(task):
        return _Stretches(task, np.empty(0), low, high)
    new = np.ones(len(task), dtype=np.bool_)
    new[1:] = (task[1:] != task[:-1]) | (low[1:] > high[:-1] + 1e-9)
    first = np.flatnonzero(new)
    return _Stretches(
        row[task[first]], side[task[first]], low[first], np.maximum.reduceat(high, first)
    )


def _grid(free: _Stretches) -> tuple[Rows, Floats, Floats]:
    """Headings of every stretch: its nearer end, its farther end, and a grid between them."""
    number = 1 + np.ceil((free.high - free.low) / GRID_RAD).astype(np.int64)
    which = np.repeat(np.arange(len(free.row)), number)
    place = np.arange(len(which)) - np.repeat(np.cumsum(number) - number, number)
    share = place / np.maximum(1, number - 1)[which]
    away = free.low[which] + (free.high - free.low)[which] * share
    return free.row[which], free.side[which], away


def _on_grid(
    cell: Cell, cycles: Cycles, free: _Stretches, enough: int
) -> tuple[Rows, Floats, Floats, NDArray[np.bool_], list[Candidates]]:
    """Assess the grid outwards, on each side of each hole until `enough` headings work: the
    headings that were assessed (row, side, away, which branches work), and the candidates."""
    row, side, away = _grid(free)
    order = np.lexsort((away, side, row))
    row, side, away = row[order], side[order], away[order]
    new = np.ones(len(row), dtype=np.bool_)
    new[1:] = (row[1:] != row[:-1]) | (side[1:] != side[:-1])
    task = np.cumsum(new) - 1
    place = np.arange(len(row)) - np.flatnonzero(new)[task]
    working = np.zeros(int(new.sum()), dtype=np.int64)
    seen = np.zeros(len(row), dtype=np.bool_)
    works = np.zeros((len(row), 8), dtype=np.bool_)
    found: list[Candidates] = []
    wave = 0
    while True:
        some = np.flatnonzero((place // enough == wave) & (working[task] < enough))
        if not len(some) and wave * enough > place.max(initial=0):
            return row[seen], side[seen], away[seen], works[seen], found
        result = assess(cell, cycles, row[some], side[some] * away[some])
        seen[some] = True
        works[some] = result.cause == FINE
        np.add.at(working, task[some], works[some].any(axis=1))
        found.append(result.candidates)
        wave += 1


def _nearest(
    cell: Cell,
    cycles: Cycles,
    free: _Stretches,
    row: Rows,
    side: Floats,
    away: Floats,
    works: NDArray[np.bool_],
) -> tuple[Rows, Floats, Floats]:
    """For each hole and side, the heading nearest to the rule's at which the arm follows too: by
    halving, in a branch that works (k, 8) at the nearest heading of the grid."""
    good = np.flatnonzero(works.any(axis=1))
    if not len(good):
        return row[:0], side[:0], away[:0]
    new = np.ones(len(good), dtype=np.bool_)
    new[1:] = (row[good[1:]] != row[good[:-1]]) | (side[good[1:]] != side[good[:-1]])
    first = good[new]
    best = away[first].copy()
    # Only the nearer of a hole's two sides is worth the search. It goes between the heading and the
    # one before it in the same free stretch, at which the arm does not follow.
    before = np.maximum(first - 1, 0)
    stretch = _stretch_low(free, row[first], side[first], away[first])
    same = (first > 0) & (row[before] == row[first]) & (side[before] == side[first])
    worst = np.where(same & (away[before] >= stretch), away[before], np.nan)
    least = np.full(int(row.max()) + 1, np.inf)
    np.minimum.at(least, row[first], best)
    open_ = np.flatnonzero(~np.isnan(worst) & (worst < least[row[first]]))
    while len(open_) and (best[open_] - worst[open_]).max() > ARM_FINEST_RAD:
        middle = 0.5 * (best[open_] + worst[open_])
        at = first[open_]
        found = assess(cell, cycles, row[at], side[at] * middle, works[at])
        nearer = (found.cause == FINE).any(axis=1)
        best[open_] = np.where(nearer, middle, best[open_])
        worst[open_] = np.where(nearer, worst[open_], middle)
    return row[first], side[first], best


def _stretch_low(free: _Stretches, row: Rows, side: Floats, away: Floats) -> Floats:
    """Where the free stretch around each heading begins."""
    low = np.empty(len(row))
    for i in range(len(row)):
        inside = (free.row == row[i]) & (free.side == side[i])
        inside &= (free.low <= away[i] + 1e-12) & (free.high >= away[i] - 1e-12)
        low[i] = free.low[inside].max()
    return low


def _exact(
    sweeps: ToolSweeps, nearest: tuple[Rows, Floats, Floats], free: _Stretches
) -> tuple[Rows, Floats]:
    """Where the nearest heading is at the tool's edge of freedom: the sweeps' hulls and the finest
    interval leave something over; the exact distance tells how much nearer the heading may be."""
    row, side, away = nearest
    heading = side * away
    begins = _stretch_low(free, row, side, away)
    for i in np.flatnonzero((away <= begins + 1e-12) & (away > 0)).tolist():
        clear, near = away[i], max(0.0, away[i] - 8 * FINEST_RAD)
        while clear - near > 0.25 * FINEST_RAD:
            middle = 0.5 * (clear + near)
            if sweeps.gap_mm(int(row[i]), side[i] * middle)[0] >= 0.0:
                clear = middle
            else:
                near = middle
        heading[i] = side[i] * clear
    return row, heading


def _distinct(candidates: Candidates) -> Candidates:
    """Without candidates that repeat a hole, heading, branch and winding."""
    key = np.column_stack(
        [candidates.row, candidates.heading_rad, candidates.branch, candidates.joints]
    )
    _, first = np.unique(key, axis=0, return_index=True)
    return candidates.take(np.sort(first))

"""Candidates for each hole: headings at which the tool keeps clear, with the joints that hold them.

Lazily: first the rule's own heading, exactly. Only where that fails (or where more choice is asked
for) are intervals of headings tested, nearest to the rule's first, halving each until it is proven
free, proven blocked, or as narrow as `FINEST_RAD`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats
from drillc.planning.cell import Cell
from drillc.planning.cycle_check import Candidates, Cycles, assess, join
from drillc.planning.free_headings import (
    FINEST_RAD,
    GRID_RAD,
    Stretches,
    free_stretches,
    nearest_free,
)
from drillc.planning.moves import FINE
from drillc.planning.tool_sweeps import ToolSweeps

#: How exactly the turn is the smallest where it is the arm, not the tool, that asks for it.
ARM_FINEST_RAD = np.radians(0.5)
#: How much nearer than proven a heading may be free: what the sweeps' hulls leave over.
_OVER_RAD = 8 * FINEST_RAD

Rows = NDArray[np.int64]


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
    `FINEST_RAD` where the tool decides, to `ARM_FINEST_RAD` where the arm does. Where the arm
    follows over less than `GRID_RAD`, that may be overlooked; where nothing else is found, only if
    it is less than `THOROUGH_RAD`."""
    if enough > 1:
        return _within(cell, cycles, sweeps, free_stretches(sweeps, rows, turning_rad), enough)[0]
    free = nearest_free(sweeps, rows, turning_rad)
    found, lost = _within(cell, cycles, sweeps, free, enough)
    if not len(lost):
        return found
    # Where the tool is free but the arm does not follow, the whole range is searched.
    wide = np.isin(rows, lost)
    free = free_stretches(sweeps, rows[wide], turning_rad[wide])
    more, _ = _within(cell, cycles, sweeps, free, enough)
    found = join([found.take(~np.isin(found.row, lost)), more])
    none = np.isin(rows, np.setdiff1d(lost, more.row))
    if not none.any():
        return found
    free = free_stretches(sweeps, rows[none], turning_rad[none], thorough=True)
    return join([found, _within(cell, cycles, sweeps, free, enough)[0]])


def _within(
    cell: Cell, cycles: Cycles, sweeps: ToolSweeps, free: Stretches, enough: int
) -> tuple[Candidates, Rows]:
    """Candidates among free headings; and the holes for which none works on some side, though one
    behind these might be nearer than what works on the other."""
    if not len(free.row):
        return assess(cell, cycles, np.empty(0, np.int64), np.empty(0)).candidates, free.row
    row, side, away, works, found = _on_grid(cell, cycles, free, enough)
    lost = _lost(free, row, side, away, np.asarray(works.any(axis=1)))
    nearest = _nearest(cell, cycles, free, row, side, away, works)
    exact = _exact(sweeps, nearest, free)
    at_edges = assess(cell, cycles, exact[0], exact[1]).candidates
    return _distinct(join([at_edges, *found])), lost


def _lost(free: Stretches, row: Rows, side: Floats, away: Floats, good: NDArray[np.bool_]) -> Rows:
    count = int(free.row.max()) + 1
    begins, works = np.full((2, 2 * count), np.inf)
    np.minimum.at(begins, 2 * free.row + (free.side > 0), free.low)
    np.minimum.at(works, 2 * row[good] + (side[good] > 0), away[good])
    best = works.reshape(count, 2).min(axis=1)
    lost = np.isinf(works.reshape(count, 2)) & (begins.reshape(count, 2) < best[:, None])
    return np.flatnonzero(lost.any(axis=1))


def _grid(free: Stretches) -> tuple[Rows, Floats, Floats]:
    """Headings of every stretch: its nearer end, its farther end, and a grid between them."""
    number = 1 + np.ceil((free.high - free.low) / free.grid_rad).astype(np.int64)
    which = np.repeat(np.arange(len(free.row)), number)
    place = np.arange(len(which)) - np.repeat(np.cumsum(number) - number, number)
    share = place / np.maximum(1, number - 1)[which]
    away = free.low[which] + (free.high - free.low)[which] * share
    return free.row[which], free.side[which], away


def _on_grid(
    cell: Cell, cycles: Cycles, free: Stretches, enough: int
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
    at_once = max(enough, round(GRID_RAD / free.grid_rad))
    wave = 0
    while True:
        some = np.flatnonzero((place // at_once == wave) & (working[task] < enough))
        if not len(some) and wave * at_once > place.max(initial=0):
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
    free: Stretches,
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


def _stretch_low(free: Stretches, row: Rows, side: Floats, away: Floats) -> Floats:
    """Where the free stretch around each heading begins."""
    count = len(free.row)
    begin = np.concatenate([free.low, away + 1e-12])
    asked = np.arange(len(begin)) >= count
    order = np.lexsort(
        (asked, begin, np.concatenate([free.side, side]), np.concatenate([free.row, row]))
    )
    # In this order, the last stretch before a heading is the one around it.
    last = np.maximum.accumulate(np.where(asked[order], 0, np.arange(len(order))))
    low = np.empty(len(row))
    low[order[asked[order]] - count] = begin[order[last[asked[order]]]]
    return low


def _exact(
    sweeps: ToolSweeps, nearest: tuple[Rows, Floats, Floats], free: Stretches
) -> tuple[Rows, Floats]:
    """Where the nearest heading is at the tool's edge of freedom: the sweeps' hulls and the finest
    interval leave something over; the exact distance tells how much nearer the heading may be."""
    row, side, away = nearest
    heading = side * away
    begins = _stretch_low(free, row, side, away)
    at_edge = (away <= begins + 1e-12) & (away > 0)
    # The other side, if it is farther away, needs no such care.
    least = np.full(int(row.max(initial=0)) + 1, np.inf)
    np.minimum.at(least, row, away)
    for i in np.flatnonzero(at_edge & (away <= least[row] + _OVER_RAD)).tolist():
        clear, near = away[i], max(0.0, away[i] - _OVER_RAD)
        while clear - near > 0.25 * FINEST_RAD:
            # The edge is within the first quarter as a rule.
            middle = max(0.5 * (clear + near), clear - 0.25 * _OVER_RAD)
            if sweeps.gap_mm(int(row[i]), side[i] * middle)[0] >= 0.0:
                clear = middle
            else:
                near = middle
        heading[i] = side[i] * clear
    return row, heading


def _distinct(candidates: Candidates) -> Candidates:
    """Without candidates that repeat a hole and heading: what is found there is always the same."""
    row, heading = candidates.row, candidates.heading_rad
    new = np.ones(len(row), dtype=np.bool_)
    new[1:] = (row[1:] != row[:-1]) | (heading[1:] != heading[:-1])
    first = np.flatnonzero(new)
    order = np.lexsort((heading[first], row[first]))
    row, heading = row[first[order]], heading[first[order]]
    once = np.ones(len(first), dtype=np.bool_)
    once[order[1:]] = (row[1:] != row[:-1]) | (heading[1:] != heading[:-1])
    return candidates.take(np.repeat(once, np.diff(np.append(first, len(candidates)))))

"""Headings over which the tool is proven clear, nearest to the rule's first.

Intervals are tested whole, and halved until each is proven free, proven blocked, or as narrow as
`FINEST_RAD`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats
from drillc.planning.tool_sweeps import ToolSweeps

#: Intervals of headings are halved until they are this narrow: how exactly a turn is the smallest.
FINEST_RAD = np.radians(0.1)
#: Headings within a free stretch stand this far apart.
GRID_RAD = np.radians(5.0)
#: Beyond the nearest free heading on a side, so much more of that side is searched.
SPREAD_RAD = np.radians(45.0)
#: In a thorough search, which goes over the whole range, they stand this far apart.
THOROUGH_RAD = np.radians(1.0)
#: Where only the nearest free heading is sought, no interval is wider.
WIDEST_RAD = np.radians(12.0)

Rows = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Stretches:
    """Headings proven free: `low` … `high` (k,), radians away from the rule's on side +1 or -1.
    Sorted by side (+1 first), hole as given, and nearness. `grid_rad`: how far apart headings
    within them are to be looked at."""

    row: Rows
    side: Floats
    low: Floats
    high: Floats
    grid_rad: float = GRID_RAD


def nearest_free(sweeps: ToolSweeps, rows: Rows, turning_rad: Floats) -> Stretches:
    """On either side of each hole's rule, the first interval that is free; all nearer ones are
    proven blocked, or narrow and not proven free."""
    row, side, width = _sides(rows, turning_rad)
    # Places and sizes of intervals count in the finest ones, of which a side has 2 ** levels.
    levels = np.ceil(np.log2(np.maximum(1.0, width / FINEST_RAD))).astype(np.int64)
    whole = 1 << levels
    finest = width / whole
    most = np.ceil(np.log2(np.maximum(1.0, width / WIDEST_RAD))).astype(np.int64)
    widest = whole >> np.minimum(levels, most)
    place, size = np.zeros(len(row), dtype=np.int64), widest.copy()
    found = np.zeros(len(row), dtype=np.bool_)
    open_ = np.flatnonzero(width > 0)
    while len(open_):
        half = 0.5 * (size * finest)[open_]
        middle = side[open_] * (finest[open_] * place[open_] + half)
        last = size[open_] == 1
        # Behind headings that are not free, a wide interval that is free as a whole is not to be
        # expected: only whether it is blocked is worth a test.
        hopeful = last | (place[open_] == 0)
        free, blocked = _judge(sweeps, row[open_], middle, half, last, hopeful)
        found[open_[free]] = True
        size[open_[~free & ~blocked & ~last]] >>= 1
        passed = open_[~free & (blocked | last)]
        place[passed] += size[passed]
        # The widest interval that begins here in the halving of the whole side.
        size[passed] = np.minimum(widest[passed], place[passed] & -place[passed])
        open_ = open_[~found[open_] & (place[open_] < whole[open_])]
    low = finest * place
    return Stretches(row[found], side[found], low[found], (low + finest * size)[found])


def free_stretches(
    sweeps: ToolSweeps, rows: Rows, turning_rad: Floats, *, thorough: bool = False
) -> Stretches:
    """All intervals of headings, on both sides of the rule's, over which the tool is proven clear;
    behind the nearest, those of some width, and not all too far away unless `thorough`."""
    grid_rad, spread_rad = (THOROUGH_RAD, np.inf) if thorough else (GRID_RAD, SPREAD_RAD)
    # One task for each hole and side; cells of it are halved together, level by level.
    row, side, width = _sides(rows, turning_rad)
    task = np.arange(len(row))
    low = np.zeros(len(row))
    nearest = np.full(len(row), np.inf)
    found: list[tuple[Rows, Floats, Floats]] = []
    for half in _halves(float(turning_rad.max(initial=0.0))):
        # Ranges differ between regions: a cell is tested when the common halving reaches its width.
        now = width > 1.5 * half
        free = np.zeros(len(task), dtype=np.bool_)
        blocked = np.zeros(len(task), dtype=np.bool_)
        some = np.flatnonzero(now)
        middle = side[task[some]] * (low + 0.5 * width)[some]
        free[some], blocked[some] = _judge(
            sweeps,
            row[task[some]],
            middle,
            0.5 * width[some],
            width[some] <= FINEST_RAD,
            np.ones(len(some), dtype=np.bool_),
        )
        np.minimum.at(nearest, task[free], low[free])
        found.append((task[free], low[free], low[free] + width[free]))
        keep = ~free & ~blocked & (width > FINEST_RAD)
        keep &= low < nearest[task] + spread_rad
        # Behind the nearest free heading a coarse picture is enough.
        keep &= (low < nearest[task]) | (width > grid_rad)
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
    merged = _merged(row, side, which[order], begin[order], end[order])
    return replace(merged, grid_rad=grid_rad)


def _sides(rows: Rows, turning_rad: Floats) -> tuple[Rows, Floats, Floats]:
    """Both sides of every hole: its row, the side, and how far it may turn."""
    return (
        np.concatenate([rows, rows]),
        np.repeat([1.0, -1.0], len(rows)),
        np.concatenate([turning_rad, turning_rad]),
    )


def _judge(
    sweeps: ToolSweeps, row: Rows, middle: Floats, half: Floats, last: Bools, hopeful: Bools
) -> tuple[Bools, Bools]:
    """Which intervals (k,) are proven free, where that is `hopeful`, and which blocked. Those that
    are the `last` and will not be halved are tested exactly."""
    free, blocked = np.zeros(len(row), dtype=np.bool_), np.zeros(len(row), dtype=np.bool_)
    for value in np.unique(half).tolist():
        some = np.flatnonzero(half == value)
        blocked[some] = sweeps.blocked(row[some], middle[some], value)
        some = some[hopeful[some] & ~blocked[some]]
        for exact in (False, True):
            these = some[last[some] == exact]
            if len(these):
                free[these] = sweeps.clear(row[these], middle[these], value, exact=exact)
    return free, blocked


def _halves(greatest_rad: float) -> Floats:
    """Half widths, from half the greatest range down to `FINEST_RAD`."""
    levels = max(1, int(np.ceil(np.log2(max(greatest_rad / FINEST_RAD, 2.0)))) + 1)
    return np.asarray(0.5 * greatest_rad * 0.5 ** np.arange(levels))


def _merged(row: Rows, side: Floats, task: Rows, low: Floats, high: Floats) -> Stretches:
    """Neighbouring cells as one stretch."""
    if not len(task):
        return Stretches(task, np.empty(0), low, high)
    new = np.ones(len(task), dtype=np.bool_)
    new[1:] = (task[1:] != task[:-1]) | (low[1:] > high[:-1] + 1e-9)
    first = np.flatnonzero(new)
    return Stretches(
        row[task[first]], side[task[first]], low[first], np.maximum.reduceat(high, first)
    )

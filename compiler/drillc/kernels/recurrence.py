"""The best way through the rungs of a ladder: forward what each candidate costs, backward the way.

Of the jump limits, few bind as a rule, and without limits wide rungs take less than half the time.
So limits are looked at where the way found without them breaks them, and around there, until it
breaks none: then none that are left out would change it.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from math import inf

import numpy as np
from numpy.typing import NDArray

from .narrow_rungs import WIDEST, narrow_arrivals, narrow_predecessors
from .rungs import Floats, Rungs, forbid_jumps
from .wide_rungs import wide_arrivals, wide_predecessor

# Steps of narrow rungs that are worked on at once: 16 MB at the greatest width.
_STEPS_AT_ONCE = 1 << 15
#: Candidates a rung from which on leaving out limits is worth it.
_WIDE = 64
#: Steps to either side of one that breaks its limit whose limits are looked at too; twice as many
#: in each round that follows.
_AROUND = 6
_ROUNDS = 6


def best_of_rungs(rungs: Rungs) -> tuple[int, NDArray[np.intp]]:
    """How many rungs can be reached from the first, and the best candidates of these (end,); of
    equals the lowest, the last rung deciding first."""
    count = len(rungs.start) - 1
    if len(rungs.node) > _WIDE * count and (rungs.jump_limit_rad < inf).any():
        found = _few_limits(rungs)
        if found is not None:
            return count, found
    reach = _forward(rungs)
    # Where a rung cannot be reached, neither can any after it.
    reached = np.minimum.reduceat(reach, rungs.start[:-1]) < inf
    end = count if reached[-1] else int(reached.argmin())
    index = np.full(end, -1, dtype=np.intp)
    if end:
        _backward(rungs, reach, index, end)
    return end, index


def _few_limits(rungs: Rungs) -> NDArray[np.intp] | None:
    """The best candidates (n,), by looking at few limits; None where that does not find them."""
    count = len(rungs.start) - 1
    some = replace(rungs, jump_limit_rad=np.full(count - 1, inf))
    reach = _forward(some)
    index = np.full(count, -1, dtype=np.intp)
    end, same_until = count, -1
    for turn in range(_ROUNDS):
        if not (reach[rungs.start[-2] :] < inf).any():
            return None
        _backward(some, reach, index, end, same_until)
        broken = _broken(rungs, index)
        if not len(broken):
            return index
        around = (_AROUND << turn) * np.array([[-1], [1]]) + broken
        limit_rad = some.jump_limit_rad.copy()
        for first, last in np.clip(around, 0, count - 1).T.tolist():
            limit_rad[first : last + 1] = rungs.jump_limit_rad[first : last + 1]
        changed = np.flatnonzero(limit_rad != some.jump_limit_rad)
        some = replace(some, jump_limit_rad=limit_rad)
        end, same_until = _forward_again(some, changed, reach), int(changed[0])
    return None


def _broken(rungs: Rungs, index: NDArray[np.intp]) -> NDArray[np.intp]:
    """The steps between candidates (n,) that break their jump limits."""
    heading_rad, cost = rungs.heading_rad[index], np.zeros(len(index) - 1)
    forbid_jumps(cost, heading_rad[:-1], heading_rad[1:], rungs.jump_rad, rungs.jump_limit_rad)
    return np.flatnonzero(cost == inf)


def _forward_again(rungs: Rungs, changed: NDArray[np.intp], reach: Floats) -> int:
    """Correct `reach` (m,), which holds but for the limits of the steps that `changed`. Returns the
    end of the rungs in which it changes by more than a constant."""
    start, count = rungs.start, len(rungs.start) - 1
    k = int(changed[0])
    while k < count - 1:
        before = reach[start[k + 1] : start[k + 2]].copy()
        wide_arrivals(rungs, k, reach)
        k += 1
        shift = _shift(before, reach[start[k] : start[k + 1]])
        if shift is not None:
            # What a whole rung costs more, all after it do, up to the next step that changed.
            later = int(np.searchsorted(changed, k))
            following = int(changed[later]) if later < len(changed) else count - 1
            reach[start[k + 1] : start[following + 1]] += shift
            if later == len(changed):
                return k + 1
            k = following
    return count


def _shift(before: Floats, after: Floats) -> float | None:
    """How much more every candidate of a rung costs; None where that differs."""
    known = before < inf
    if not known.any() or ((after < inf) != known).any():
        return None
    more = after[known] - before[known]
    return float(more[0]) if (more == more[0]).all() else None


def _stretches(rungs: Rungs, end: int) -> list[tuple[int, int, bool]]:
    """The steps 0 .. end - 2 in runs: first, past the last, whether all their rungs are narrow.

    Step k goes from rung k to rung k + 1.
    """
    width = np.diff(rungs.start[: end + 1])
    narrow = (width[:-1] <= WIDEST) & (width[1:] <= WIDEST)
    cuts = [0, *(np.flatnonzero(np.diff(narrow)) + 1).tolist(), len(narrow)]
    return [
        (first, min(first + _STEPS_AT_ONCE, stop), bool(narrow[begin]))
        for begin, stop in pairwise(cuts)
        for first in range(begin, stop, _STEPS_AT_ONCE)
    ]


def _forward(rungs: Rungs) -> Floats:
    """The least cost (m,) of arriving at each candidate, itself included; inf: unreachable."""
    reach = rungs.node.copy()
    for first, stop, narrow in _stretches(rungs, len(rungs.start) - 1):
        if narrow:
            narrow_arrivals(rungs, first, stop, reach)
        else:
            for k in range(first, stop):
                wide_arrivals(rungs, k, reach)
    return reach


def _backward(
    rungs: Rungs, reach: Floats, index: NDArray[np.intp], end: int, same_until: int = -1
) -> None:
    """Fill in `index` (n,), the best candidates, before rung `end`: before the last one of all, or
    before the candidate that stands at end - 1. Up to rung `same_until`, what leads to a candidate
    is what led to it when `index` was filled in."""
    start = rungs.start
    if end == len(index):
        last = slice(start[end - 1], start[end])
        index[end - 1] = last.start + int(reach[last].argmin())
    j = int(index[end - 1] - start[end - 1])
    for first, stop, narrow in reversed(_stretches(rungs, end)):
        if narrow:
            came_from = narrow_predecessors(rungs, first, stop, reach).tolist()
        for k in range(stop - 1, first - 1, -1):
            if narrow:
                j = came_from[k - first][j]
            else:
                j = wide_predecessor(rungs, k, int(index[k + 1]), reach)
            if k <= same_until and index[k] == start[k] + j:
                return
            index[k] = start[k] + j

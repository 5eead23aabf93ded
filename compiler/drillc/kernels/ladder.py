"""One candidate for each hole of a sequence, so that the whole costs the least. Exact.

A rung holds the candidates of one hole: a heading and a branch of the inverse kinematics, as joint
values. Dynamic programming goes from rung to rung with the least cost of arriving at each
candidate. That is all that is kept, 8 bytes a candidate and no transition: backward, a candidate's
predecessor is the one that explains its cost, which takes arithmetic without rounding (`rungs`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import fsum, inf

import numpy as np
from numpy.typing import NDArray

from .narrow_rungs import WIDEST, narrow_arrivals, narrow_predecessors
from .rungs import Floats, Ints, Rungs, on_grid
from .wide_rungs import wide_arrivals, wide_predecessor

# Steps of narrow rungs that are worked on at once: 16 MB at the greatest width.
_STEPS_AT_ONCE = 1 << 15


#: Candidates a rung from which on a ladder is wide.
_WIDE = 64


@dataclass(frozen=True, eq=False)
class Ladder:
    """n rungs with m candidates in all; rung k holds the candidates start[k] .. start[k + 1] - 1.

    joints (m, 6), rad. start (n + 1,). cost (m,): of the candidate itself, in s; inf: not allowed,
    its joints may then be NaN. heading_rad (m,): its turn away from its hole's preferred heading.
    jump_rad (n - 1,): the turn about the tool axis from each hole's preferred heading to the next
    one's; jump_limit_rad (n - 1,): a step i -> j is allowed where |jump + heading[j] - heading[i]|,
    wrapped to (-pi, pi], is at most the limit (+ 1e-12); inf: always. weight (6,), s/rad, >= 0: a
    step costs the sum of weight |dq|, and group_cost, in s and >= 0, more if its ends differ in
    group (m,).
    """

    joints: Floats
    start: Ints
    cost: Floats
    heading_rad: Floats
    jump_rad: Floats
    jump_limit_rad: Floats
    weight: Floats
    group: Ints
    group_cost: float


@dataclass(frozen=True, eq=False)
class Choice:
    """index (n,): the chosen candidates, in 0 .. m - 1; total: what they cost, in s.

    blocked: None, or the first rung of which no candidate can be reached from the first rung.
    Then total is inf and index (blocked,) holds a best choice for the rungs before it.
    """

    index: NDArray[np.intp]
    total: float
    blocked: int | None


def best_ladder(ladder: Ladder) -> Choice:
    """The choice of least total; of equals the lowest index, the last rung deciding first.

    Times are rounded to 2**-51 of the worst total (5e-11 s if that is a day), and what then follows
    is exact. Raises ValueError for weights or a group cost that are negative or not finite, for a
    limit that is NaN, a cost that is NaN or -inf, and joints that are not finite where the cost is.
    """
    _check(ladder)
    if len(ladder.cost) > _WIDE * len(ladder.start) and (ladder.jump_limit_rad < inf).any():
        # The limits seldom bind, and without them a wide ladder takes half the time.
        free = _best(replace(ladder, jump_limit_rad=np.full_like(ladder.jump_limit_rad, inf)))
        if free.blocked is None and _obeys(ladder, free.index):
            return free
    return _best(ladder)


def _obeys(ladder: Ladder, index: NDArray[np.intp]) -> bool:
    """Whether a choice (n,) keeps all jump limits."""
    jump = ladder.jump_rad + np.diff(ladder.heading_rad[index])
    jump -= 2.0 * np.pi * np.rint(jump / (2.0 * np.pi))
    return bool((np.abs(jump) <= ladder.jump_limit_rad).all())


def _best(ladder: Ladder) -> Choice:
    allowed = np.flatnonzero(ladder.cost < inf)
    start = np.searchsorted(allowed, ladder.start)
    count = len(start) - 1
    empty = np.flatnonzero(np.diff(start) == 0)
    n = int(empty[0]) if len(empty) else count
    end, index = 0, np.empty(0, dtype=np.intp)
    if n:
        rungs = _rungs(ladder, allowed[: start[n]], start[: n + 1])
        reach = _forward(rungs)
        # Where a rung cannot be reached, neither can any after it.
        reached = np.minimum.reduceat(reach, rungs.start[:-1]) < inf
        end = n if reached[-1] else int(reached.argmin())
        index = allowed[_backward(rungs, reach, end)]
    if end < count:
        return Choice(index, inf, end)
    return Choice(index, ladder_cost(ladder, index), None)


def ladder_cost(ladder: Ladder, index: NDArray[np.intp]) -> float:
    """What a choice (n,) costs, in s; jump limits are not looked at."""
    moved = np.abs(np.diff(ladder.joints[index], axis=0)) @ ladder.weight
    changes = np.count_nonzero(np.diff(ladder.group[index]))
    return fsum([*ladder.cost[index].tolist(), *moved.tolist(), ladder.group_cost * changes])


def _check(ladder: Ladder) -> None:
    weights = [*ladder.weight.tolist(), ladder.group_cost]
    if not all(0.0 <= weight < inf for weight in weights):
        raise ValueError(f"the weights and the group cost {weights} are not all >= 0 and finite")
    if np.isnan(ladder.jump_limit_rad).any():
        raise ValueError("a jump limit is NaN")
    if not (ladder.cost > -inf).all():
        raise ValueError("a cost is NaN or -inf")
    if not np.isfinite(ladder.joints[ladder.cost < inf]).all():
        raise ValueError("a candidate that is allowed has a joint value that is not finite")


def _rungs(ladder: Ladder, allowed: NDArray[np.intp], start: NDArray[np.intp]) -> Rungs:
    """The allowed candidates alone."""
    return on_grid(
        start,
        ladder.joints[allowed] * ladder.weight,
        ladder.cost[allowed],
        ladder.heading_rad[allowed],
        ladder.group[allowed],
        ladder.group_cost,
        ladder.jump_rad,
        ladder.jump_limit_rad,
    )


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


def _backward(rungs: Rungs, reach: Floats, end: int) -> NDArray[np.intp]:
    """Trace the best way to rung end - 1; candidates (end,)."""
    start = rungs.start
    index = np.empty(end, dtype=np.intp)
    j = int(reach[start[end - 1] : start[end]].argmin())
    index[-1] = start[end - 1] + j
    for first, stop, narrow in reversed(_stretches(rungs, end)):
        if narrow:
            came_from = narrow_predecessors(rungs, first, stop, reach).tolist()
        for k in range(stop - 1, first - 1, -1):
            if narrow:
                j = came_from[k - first][j]
            else:
                j = wide_predecessor(rungs, k, int(index[k + 1]), reach)
            index[k] = start[k] + j
    return index

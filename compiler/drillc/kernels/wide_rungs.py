"""The step between two rungs of many candidates: exact, without costing every transition.

A candidate is superfluous where another one that costs less leads anywhere for no more, which the
triangle inequality tells from the way between the two. Under a jump limit that holds only as far as
the other's window of headings reaches. What is left to the candidate then is an interval of
headings: often a thin one at the edge of its own window, more often none.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, pi

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from .rungs import Around, Floats, Ints, Rungs, forbid_jumps, way, ways, wrapped

_PIVOTS = 8
# Fewer transitions than this are all costed: to rule some out would take longer.
_FEW = 24576
# More transitions than this are not listed one by one.
_LISTED = 24576
# Rows of the table of transitions that are worked on at once, for the sake of the cache.
_ROWS_AT_ONCE = 64
# Wider than any rounding of angles, so that an interval never loses what the jump limit allows.
_SLACK_RAD = 1e-9


def wide_arrivals(rungs: Rungs, k: int, reach: Floats) -> None:
    """Fill in `reach` (m,), the least cost of arriving, for rung k + 1 from that of rung k."""
    a, b, c = rungs.start[k : k + 3].tolist()
    source, target = _side(rungs, slice(a, b), reach), _side(rungs, slice(b, c), reach)
    step = _Step(
        source,
        target,
        float(rungs.jump_rad[k]),
        float(rungs.jump_limit_rad[k]),
        rungs.group_cost,
        rungs.around,
    )
    if (b - a) * (c - b) <= _FEW:
        reach[b:c] = _over_all(step) + rungs.node[b:c]
        return
    if step.limit_rad >= pi:
        reach[b:c] = _over_all(_without_superfluous(step)) + rungs.node[b:c]
    else:
        step = replace(step, source=source.take(_in_order(source)))
        order = np.argsort(target.heading_rad, kind="stable")
        step = replace(step, target=target.take(order))
        reach[b + order] = _inside_windows(step) + rungs.node[b + order]


def wide_predecessor(rungs: Rungs, k: int, after: int, reach: Floats) -> int:
    """The first candidate of rung k, by its place, over which `after` is reached at its cost."""
    before = slice(rungs.start[k], rungs.start[k + 1])
    cost = ways(rungs.travel[before] - rungs.travel[after], rungs.around)
    if rungs.group_cost:
        cost += rungs.group_cost * (rungs.group[before] != rungs.group[after])
    forbid_jumps(
        cost,
        rungs.heading_rad[before],
        rungs.heading_rad[after],
        float(rungs.jump_rad[k]),
        float(rungs.jump_limit_rad[k]),
    )
    return int(np.argmax(reach[before] + cost + rungs.node[after] == reach[after]))


@dataclass(frozen=True, eq=False)
class _Side:
    """Candidates (p,) of one rung: travel (p, 6); value (p,), the cost of having come here."""

    travel: Floats
    heading_rad: Floats
    group: Ints
    value: Floats

    def take(self, rows: NDArray[np.intp] | slice) -> _Side:
        return _Side(self.travel[rows], self.heading_rad[rows], self.group[rows], self.value[rows])


@dataclass(frozen=True, eq=False)
class _Step:
    """From s sources to t targets."""

    source: _Side
    target: _Side
    jump_rad: float
    limit_rad: float
    group_cost: float
    around: Around


def _side(rungs: Rungs, rows: slice, reach: Floats) -> _Side:
    return _Side(rungs.travel[rows], rungs.heading_rad[rows], rungs.group[rows], reach[rows])


def _over_all(step: _Step) -> Floats:
    """The least cost (t,) of arriving at each target, by costing every transition."""
    source, target = step.source, step.target
    least = np.full(len(target.value), inf)
    for first in range(0, len(source.value), _ROWS_AT_ONCE):
        some = source.take(slice(first, first + _ROWS_AT_ONCE))
        cost = _table(some, target, step)
        forbid_jumps(
            cost, some.heading_rad[:, None], target.heading_rad, step.jump_rad, step.limit_rad
        )
        np.minimum(least, cost.min(axis=0), out=least)
    return least


def _inside_windows(step: _Step) -> Floats:
    """The same, by costing only what the sources are needed for. Targets are sorted by heading."""
    source, target = step.source, step.target
    size = len(target.value)
    from_rad, to_rad = _needed(step)
    needed = np.flatnonzero(from_rad <= to_rad)
    source = source.take(needed)
    from_rad = source.heading_rad - step.jump_rad + from_rad[needed]
    to_rad = source.heading_rad - step.jump_rad + to_rad[needed]
    # Intervals may pass ±pi, so the targets are laid out three times around.
    around = (target.heading_rad + 2.0 * pi * np.arange(-1, 2)[:, None]).ravel()
    target_around = np.tile(np.arange(size), 4)
    first = np.searchsorted(around, from_rad)
    count = np.minimum(np.searchsorted(around, to_rad, side="right") - first, size)
    total = int(count.sum())
    least = np.full(size, inf)
    if total <= _LISTED:
        i = np.repeat(np.arange(len(count)), count)
        j = np.arange(total) + np.repeat(first - np.cumsum(count) + count, count)
        j = target_around.take(j)
        leg = source.travel.take(i, axis=0)
        leg -= target.travel.take(j, axis=0)
        cost = ways(leg, step.around)
        cost += source.value.take(i)
        if step.group_cost:
            cost += step.group_cost * (source.group[i] != target.group[j])
        before_rad, after_rad = source.heading_rad.take(i), target.heading_rad.take(j)
        forbid_jumps(cost, before_rad, after_rad, step.jump_rad, step.limit_rad)
        np.minimum.at(least, j, cost)
        return least
    for begin in range(0, size, _ROWS_AT_ONCE):
        rows = slice(begin, begin + _ROWS_AT_ONCE)
        some = target.take(rows)
        low_rad, high_rad = some.heading_rad[[0, -1]].tolist()
        apart = wrapped(0.5 * (from_rad + to_rad) - 0.5 * (low_rad + high_rad))
        half_rad = 0.5 * (to_rad - from_rad) + 0.5 * (high_rad - low_rad)
        near = source.take(np.flatnonzero(np.abs(apart) <= half_rad + _SLACK_RAD))
        least[rows] = _over_all(replace(step, source=near, target=some))
    return least


def _table(source: _Side, target: _Side, step: _Step) -> Floats:
    """The cost (s, t) of arriving at each target through each source; step: how it is counted."""
    if not step.around:
        cost = cdist(source.travel, target.travel, "cityblock")
    else:
        plain = [joint for joint in range(6) if joint not in dict(step.around)]
        cost = cdist(source.travel[:, plain], target.travel[:, plain], "cityblock")
        for joint, period in step.around:
            cost += way(source.travel[:, joint, None] - target.travel[:, joint], period)
    if step.group_cost:
        cost += step.group_cost * (source.group[:, None] != target.group)
    cost += source.value[:, None]
    return cost


def _led_by_neighbours(step: _Step) -> NDArray[np.bool_]:
    """Whether the neighbours before and behind make each source superfluous where they can lead;
    (2, s)."""
    source = step.source
    apart = ways(np.diff(source.travel, axis=0), step.around)
    if step.group_cost:
        apart += step.group_cost * (source.group[1:] != source.group[:-1])
    before, behind = source.value[:-1], source.value[1:]
    led = np.zeros((2, len(source.value)), dtype=np.bool_)
    # Of two that are the same in everything, neither makes the other superfluous.
    led[0, 1:] = (before + apart <= behind) & (before < behind)
    led[1, :-1] = (behind + apart <= before) & (behind < before)
    return led


def _led_by_pivots(step: _Step, pivots: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Whether the pivots (p,) do; (p, s)."""
    source = step.source
    cost = _table(source.take(pivots), source, step)
    return (cost <= source.value) & (source.value[pivots, None] < source.value)


def _pivots(value: Floats) -> NDArray[np.intp]:
    """The cheapest candidate of each of some equal parts."""
    parts = min(_PIVOTS, len(value))
    cuts = [part * len(value) // parts for part in range(parts + 1)] if parts else []
    return np.array([a + int(value[a:b].argmin()) for a, b in pairwise(cuts)], dtype=np.intp)


def _without_superfluous(step: _Step) -> _Step:
    """Where all turns are allowed, all can lead anywhere: the cheapest makes most superfluous, and
    if many are left, others are tried."""
    source = step.source
    cheapest = np.array([source.value.argmin()])
    reached = source.value < inf
    step = _with(step, np.flatnonzero(reached & ~_led_by_pivots(step, cheapest)[0]))
    if _are_few(step):
        return step
    step = _with(step, _in_order(step.source))
    step = _with(step, np.flatnonzero(~_led_by_neighbours(step).any(axis=0)))
    if _are_few(step):
        return step
    led = _led_by_pivots(step, _pivots(step.source.value))
    return _with(step, np.flatnonzero(~led.any(axis=0)))


def _with(step: _Step, some: NDArray[np.intp]) -> _Step:
    """The step from some of the sources."""
    return replace(step, source=step.source.take(some))


def _are_few(step: _Step) -> bool:
    return len(step.source.value) * len(step.target.value) <= _FEW


def _in_order(source: _Side) -> NDArray[np.intp]:
    """The sources (s,) that are reached, so that neighbours have much to do with each other."""
    order = np.argsort(source.heading_rad + 8.0 * source.group, kind="stable")
    return order[source.value[order] < inf]


def _needed(step: _Step) -> tuple[Floats, Floats]:
    """The least and the greatest turn (s,) for which each source may be needed; the former is the
    greater one where it is not."""
    heading_rad = step.source.heading_rad
    pivots = _pivots(step.source.value)
    others_rad = np.empty((len(pivots) + 2, len(heading_rad)))
    others_rad[:-2] = heading_rad[pivots, None]
    others_rad[-2], others_rad[-1] = np.roll(heading_rad, 1), np.roll(heading_rad, -1)
    led = np.concatenate([_led_by_pivots(step, pivots), _led_by_neighbours(step)])
    turn_rad = wrapped(others_rad - heading_rad)
    above_rad = np.where(led & (turn_rad >= 0.0), turn_rad, inf).min(axis=0)
    below_rad = np.where(led & (turn_rad <= 0.0), turn_rad, -inf).max(axis=0)
    limit_rad = step.limit_rad
    # What lies a turn above reaches from the turn less the limit on.
    return (
        np.maximum(-limit_rad, below_rad + limit_rad) - _SLACK_RAD,
        np.minimum(limit_rad, above_rad - limit_rad) + _SLACK_RAD,
    )

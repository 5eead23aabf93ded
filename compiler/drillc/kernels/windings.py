"""Which turn of a rotary axis to take at each hole, so that a sequence turns the least. Exact."""

from __future__ import annotations

from array import array
from math import inf

import numpy as np
from numpy.typing import NDArray

_TURN_RAD = 2.0 * np.pi
_SLACK_RAD = 1e-12

# The search counts in whole units of 2 pi / 2**40, 6e-12 rad. Adding a turn is then exact, so
# that sequences a turn apart tie exactly and the tie is not settled by rounding.
_TURN_UNITS = 1 << 40

# Travel ranks before the distance from the middle of the limits: one number, travel above.
_TRAVEL_SHIFT = 96


def unwrap(angle_rad: NDArray[np.float64], low_rad: float, high_rad: float) -> NDArray[np.float64]:
    """Add whole turns to angles (n,) so that all are within limits and the axis turns the least.

    Minimises the sum of |difference| of neighbours over every choice of turns for which each value
    is inside [low, high] (1e-12 rad outside is let pass). Ties go to the sequence that stays
    nearest to the middle of the limits (least sum of distances), then to the greater angle, so
    that ±pi becomes +pi. NaN where no turn fits or the angle is NaN; those are skipped over: the
    values around them are neighbours. Exact to 6e-12 rad a step. The time is linear in n, and in
    the number of windings that the angles have a use for, so that an endless axis may have limits
    of any size. Raises ValueError unless the limits are finite and low <= high.
    """
    if not (-inf < low_rad <= high_rad < inf):
        raise ValueError(f"limits {low_rad} .. {high_rad} rad are not finite and in order")
    angle = np.where(np.isfinite(angle_rad), angle_rad, np.nan)
    low_rad, high_rad = _useful(angle, low_rad, high_rad)
    first = np.ceil((low_rad - _SLACK_RAD - angle) / _TURN_RAD)
    last = np.floor((high_rad + _SLACK_RAD - angle) / _TURN_RAD)
    fits = first <= last
    turns = np.where(fits, first, np.nan)
    if (first < last).any():
        middle_rad = 0.5 * (low_rad + high_rad)
        turns[fits] += _least_turning(
            (angle[fits] + first[fits] * _TURN_RAD - middle_rad) / _TURN_RAD,
            (last[fits] - first[fits]).astype(np.int64),
        )
    return angle + turns * _TURN_RAD + 0.0


def _useful(angle: NDArray[np.float64], low_rad: float, high_rad: float) -> tuple[float, float]:
    """Limits as far as they matter: the least travel that there is spans `span_rad`, and of all
    sequences with that travel the one nearest to the middle begins less than a turn from it."""
    there = angle[~np.isnan(angle)]
    span_rad = float(np.ptp(np.unwrap(there))) if len(there) else 0.0
    middle_rad, reach_rad = 0.5 * (low_rad + high_rad), span_rad + 2.0 * _TURN_RAD
    return max(low_rad, middle_rad - reach_rad), min(high_rad, middle_rad + reach_rad)


def _least_turning(lowest_turns: NDArray[np.float64], more: NDArray[np.int64]) -> NDArray[np.int64]:
    """How many turns (m,) to add, each 0 .. more, by dynamic programming over the windings.

    lowest_turns (m,): the lowest winding that fits, in turns from the middle of the limits.
    """
    units = np.rint(lowest_turns * _TURN_UNITS).astype(np.int64).tolist()
    width = int(more.max()) + 1
    # came_from[i * width + s]: the best winding of i - 1 for winding s of i
    came_from = array("H" if width <= 1 << 16 else "L", [0]) * (width * len(units))
    values: list[int] = []
    costs: list[int] = []
    for i, (lowest, spare) in enumerate(zip(units, more.tolist(), strict=True)):
        old_values, old_costs = values, costs
        values = [lowest + s * _TURN_UNITS for s in range(spare + 1)]
        if not old_values:
            costs = [abs(value) for value in values]
            continue
        best = _cheapest(values, old_values, old_costs)
        costs = [abs(value) + cost for value, (cost, _) in zip(values, best, strict=True)]
        for s, (_, r) in enumerate(best):
            came_from[i * width + s] = r
    s = min(reversed(range(len(costs))), key=costs.__getitem__)
    added = np.empty(len(units), dtype=np.int64)
    for i in range(len(units) - 1, -1, -1):
        added[i] = s
        s = came_from[i * width + s]
    return added


def _cheapest(
    values: list[int], old_values: list[int], old_costs: list[int]
) -> list[tuple[int, int]]:
    """For each of `values`, the least of old cost and travel, and from which old value: the last of
    equals. Both lists of values ascend, so that one walk up and one walk down find all."""
    found: list[tuple[int, int]] = []
    r, best, best_from = 0, None, 0
    for value in values:  # from below, or from the same value
        while r < len(old_values) and old_values[r] <= value:
            cost = old_costs[r] - (old_values[r] << _TRAVEL_SHIFT)
            if best is None or cost <= best:
                best, best_from = cost, r
            r += 1
        found.append((-1 if best is None else best + (value << _TRAVEL_SHIFT), best_from))
    r, best, best_from = len(old_values) - 1, None, 0
    for s in range(len(values) - 1, -1, -1):  # from above
        while r >= 0 and old_values[r] > values[s]:
            cost = old_costs[r] + (old_values[r] << _TRAVEL_SHIFT)
            if best is None or cost < best:
                best, best_from = cost, r
            r -= 1
        if best is not None:
            cost = best - (values[s] << _TRAVEL_SHIFT)
            if found[s][0] < 0 or cost <= found[s][0]:
                found[s] = cost, best_from
    return found

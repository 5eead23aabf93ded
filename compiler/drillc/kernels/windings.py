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
    values around them are neighbours. Exact to 6e-12 rad a step. Linear time.
    Raises ValueError unless the limits are finite and low <= high.
    """
    if not (-inf < low_rad <= high_rad < inf):
        raise ValueError(f"limits {low_rad} .. {high_rad} rad are not finite and in order")
    angle = np.where(np.isfinite(angle_rad), angle_rad, np.nan)
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


def _least_turning(lowest_turns: NDArray[np.float64], more: NDArray[np.int64]) -> NDArray[np.int64]:
    """How many turns (m,) to add, each 0 .. more, by dynamic programming over the windings.

    lowest_turns (m,): the lowest winding that fits, in turns from the middle of the limits.
    """
    units = np.rint(lowest_turns * _TURN_UNITS).astype(np.int64).tolist()
    width = int(more.max()) + 1
    # came_from[i * width + s]: the best winding of i - 1 for winding s of i
    came_from = array("H", bytes(2 * width * len(units)))
    values: list[int] = []
    costs: list[int] = []
    for i, (lowest, spare) in enumerate(zip(units, more.tolist(), strict=True)):
        old_values, old_costs = values, costs
        values = [lowest + s * _TURN_UNITS for s in range(spare + 1)]
        costs = []
        for s, value in enumerate(values):
            best, best_from = (None if old_values else 0), 0
            for r, old_value in enumerate(old_values):
                cost = old_costs[r] + (abs(value - old_value) << _TRAVEL_SHIFT)
                if best is None or cost <= best:
                    best, best_from = cost, r
            costs.append(abs(value) + (best or 0))
            came_from[i * width + s] = best_from
    s = min(reversed(range(len(costs))), key=costs.__getitem__)
    added = np.empty(len(units), dtype=np.int64)
    for i in range(len(units) - 1, -1, -1):
        added[i] = s
        s = came_from[i * width + s]
    return added

"""The rungs of a ladder in whole units, and what a step between two candidates costs.

All seconds are counted in units of a power of two so small that 2**51 of them hold the worst total.
Sums and differences are then exact in any order, so that bounds need no slack and equality means
equal.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.integer]
Around = tuple[tuple[int, float], ...]

_JUMP_SLACK_RAD = 1e-12
_ONES = np.ones(6)


@dataclass(frozen=True, eq=False)
class Rungs:
    """The allowed candidates (m,) of n rungs, none of them empty; a `Ladder` on the grid.

    travel (m, 6): joints times weights, so that a step costs the sum of |dtravel|, and group_cost
    more where the group differs. around: joints, with the travel after which they stand as before;
    they go the shorter way, and their travel is in 0 .. that. node (m,): the cost of the candidate
    itself.
    """

    start: NDArray[np.intp]
    travel: Floats
    around: Around
    node: Floats
    heading_rad: Floats
    group: Ints
    group_cost: float
    jump_rad: Floats
    jump_limit_rad: Floats


def on_grid(
    start: NDArray[np.intp],
    travel_s: Floats,
    around_s: Around,
    node_s: Floats,
    heading_rad: Floats,
    group: Ints,
    group_cost_s: float,
    jump_rad: Floats,
    jump_limit_rad: Floats,
) -> Rungs:
    """Round times to the grid; travel_s (m, 6), which changes."""
    first = start[:-1]
    for joint, period_s in around_s:
        travel_s[:, joint] %= period_s
    # What all candidates of a rung have in common decides nothing.
    node_s = node_s - np.repeat(np.minimum.reduceat(node_s, first), np.diff(start))
    low = np.minimum.reduceat(travel_s, first)
    high = np.maximum.reduceat(travel_s, first)
    farthest = np.maximum(high[1:] - low[:-1], high[:-1] - low[1:])
    worst = (
        float(np.maximum.reduceat(node_s, first).sum())
        + float(farthest.sum())
        + group_cost_s * len(first)
        + float(max(-low.min(), high.max(), 0.0))
    )
    shift = 51 - int(np.frexp(worst)[1])  # worst < 2**exponent
    return Rungs(
        start=start,
        travel=np.rint(np.ldexp(travel_s, shift, out=travel_s), out=travel_s),
        around=tuple((joint, float(np.rint(np.ldexp(turn, shift)))) for joint, turn in around_s),
        node=np.rint(np.ldexp(node_s, shift)),
        heading_rad=wrapped(heading_rad),
        group=group,
        group_cost=float(np.rint(np.ldexp(group_cost_s, shift))),
        jump_rad=wrapped(jump_rad),
        jump_limit_rad=jump_limit_rad,
    )


def step_cost(
    rungs: Rungs,
    before: NDArray[np.intp],
    after: NDArray[np.intp],
    jump_rad: Floats | float,
    jump_limit_rad: Floats | float,
) -> Floats:
    """What the steps from candidates `before` to `after` cost, inf where the jump is too great.

    All arguments but the first broadcast; `jump_rad` and its limit are those of the steps.
    """
    cost: Floats = np.zeros(np.broadcast_shapes(before.shape, after.shape))
    period = dict(rungs.around)
    for joint, travel in enumerate(rungs.travel.T):
        cost += way(travel[before] - travel[after], period.get(joint))
    if rungs.group_cost:
        cost += rungs.group_cost * (rungs.group[before] != rungs.group[after])
    forbid_jumps(
        cost, rungs.heading_rad[before], rungs.heading_rad[after], jump_rad, jump_limit_rad
    )
    return cost


def way(leg: Floats, period: float | None) -> Floats:
    """How far a joint goes for its legs; the shorter way if it has a period. Changes `leg`."""
    np.abs(leg, out=leg)
    if period is not None:
        np.minimum(leg, period - leg, out=leg)
    return leg


def ways(legs: Floats, around: Around) -> Floats:
    """How far all joints go for legs (k, 6), together. Changes `legs`."""
    np.abs(legs, out=legs)
    for joint, period in around:
        legs[:, joint] = way(legs[:, joint], period)
    return np.asarray(legs @ _ONES)


def forbid_jumps(
    cost: Floats,
    before_rad: Floats,
    after_rad: Floats,
    jump_rad: Floats | float,
    jump_limit_rad: Floats | float,
) -> None:
    """Set costs to inf where the turn from heading to heading exceeds its limit."""
    if np.min(jump_limit_rad, initial=inf) >= pi:
        return
    turn = np.abs(jump_rad + after_rad - before_rad)  # of three angles in -pi .. pi: 0 .. 3 pi
    np.minimum(turn, np.abs(turn - 2.0 * pi), out=turn)
    cost[turn > jump_limit_rad + _JUMP_SLACK_RAD] = inf


def wrapped(angle_rad: Floats) -> Floats:
    """The same direction in -pi .. pi; angles that are there already do not change."""
    return np.asarray(angle_rad - 2.0 * pi * np.rint(angle_rad / (2.0 * pi)))

"""One candidate for each hole of a sequence, so that the whole costs the least. Exact.

A rung holds the candidates of one hole: a heading and a branch of the inverse kinematics, as joint
values. Dynamic programming goes from rung to rung with the least cost of arriving at each
candidate. That is all that is kept, 8 bytes a candidate and no transition: backward, a candidate's
predecessor is the one that explains its cost, which takes arithmetic without rounding (`rungs`).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import fsum, inf, pi

import numpy as np
from numpy.typing import NDArray

from .recurrence import best_of_rungs
from .rungs import Floats, Ints, Rungs, on_grid


@dataclass(frozen=True, eq=False)
class Ladder:
    """n rungs with m candidates in all; rung k holds the candidates start[k] .. start[k + 1] - 1.

    joints (m, 6), rad. start (n + 1,). cost (m,): of the candidate itself, in s; inf: not allowed,
    its joints may then be NaN. heading_rad (m,): its turn away from its hole's preferred heading.
    jump_rad (n - 1,): the turn about the tool axis from each hole's preferred heading to the next
    one's; jump_limit_rad (n - 1,): a step i -> j is allowed where |jump + heading[j] - heading[i]|,
    wrapped to (-pi, pi], is at most the limit (+ 1e-12); inf: always. weight (6,), s/rad, >= 0: a
    step costs the sum of weight |dq|, and group_cost, in s and >= 0, more if its ends differ in
    group (m,). endless: the joints, 0 .. 5, of which whole turns count for nothing: |dq| is the
    shorter way around.
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
    endless: tuple[int, ...] = ()


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
    allowed = np.flatnonzero(ladder.cost < inf)
    joints = ladder.joints.take(allowed, axis=0)
    check(ladder, joints)
    start = np.searchsorted(allowed, ladder.start)
    count = len(start) - 1
    empty = np.flatnonzero(np.diff(start) == 0)
    n = int(empty[0]) if len(empty) else count
    end, index = 0, np.empty(0, dtype=np.intp)
    if n:
        some = slice(start[n])
        end, index = best_of_rungs(_rungs(ladder, allowed[some], joints[some], start[: n + 1]))
    if end < count:
        return Choice(allowed[index], inf, end)
    return Choice(allowed[index], ladder_cost(ladder, allowed[index]), None)


def ladder_cost(ladder: Ladder, index: NDArray[np.intp]) -> float:
    """What a choice (n,) costs, in s; jump limits are not looked at."""
    leg = np.diff(ladder.joints[index], axis=0)
    for joint in ladder.endless:
        leg[:, joint] -= 2.0 * pi * np.rint(leg[:, joint] / (2.0 * pi))
    moved = np.abs(leg) @ ladder.weight
    changes = np.count_nonzero(np.diff(ladder.group[index]))
    return fsum([*ladder.cost[index].tolist(), *moved.tolist(), ladder.group_cost * changes])


def check(ladder: Ladder, joints: Floats) -> None:
    """Raise ValueError for what `best_ladder` refuses; joints: those of the allowed candidates."""
    weights = [*ladder.weight.tolist(), ladder.group_cost]
    if not all(0.0 <= weight < inf for weight in weights):
        raise ValueError(f"the weights and the group cost {weights} are not all >= 0 and finite")
    if np.isnan(ladder.jump_limit_rad).any():
        raise ValueError("a jump limit is NaN")
    if not (ladder.cost > -inf).all():
        raise ValueError("a cost is NaN or -inf")
    if not np.isfinite(joints).all():
        raise ValueError("a candidate that is allowed has a joint value that is not finite")


def _rungs(
    ladder: Ladder, allowed: NDArray[np.intp], joints: Floats, start: NDArray[np.intp]
) -> Rungs:
    """The allowed candidates alone, with their joints."""
    turns_s = [(joint, 2.0 * pi * float(ladder.weight[joint])) for joint in ladder.endless]
    return on_grid(
        start,
        joints * ladder.weight,
        tuple((joint, turn_s) for joint, turn_s in turns_s if turn_s > 0.0),
        ladder.cost[allowed],
        ladder.heading_rad[allowed],
        ladder.group[allowed],
        ladder.group_cost,
        ladder.jump_rad,
        ladder.jump_limit_rad,
    )

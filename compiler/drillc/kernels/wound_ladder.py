"""A ladder of joints that reach farther than a turn, so that a pose is a candidate in each winding.

Where poses alone are chosen, each joint going the shorter way around, no choice costs more than it
does in any windings. If windings of the chosen poses cost no more than that either, they are the
best of all. Only otherwise are all candidates looked at.
"""

from __future__ import annotations

from dataclasses import replace
from math import inf, pi

import numpy as np
from numpy.typing import NDArray

from .ladder import Choice, Ladder, best_ladder, check, ladder_cost
from .rungs import Ints

#: How much two totals may differ that are the same but for rounding.
_SAME_S = 1e-9


def best_wound_ladder(ladder: Ladder, pose: Ints) -> Choice:
    """The choice of least total, to 1e-9 s.

    pose (m,): candidates of a rung that follow each other with the same number differ in their
    cost, and by whole turns of joints, and in nothing else. Of choices that cost the same it is
    always the same one, but not always the one that `best_ladder` takes. Raises ValueError as
    `best_ladder` does.
    """
    check(ladder, ladder.joints[ladder.cost < inf])
    new = np.ones(len(pose), dtype=np.bool_)
    new[1:] = pose[1:] != pose[:-1]
    new[ladder.start[ladder.start < len(pose)]] = True
    if new.all():
        return best_ladder(ladder)
    first = np.flatnonzero(new)
    cheapest = _cheapest(ladder.cost, first, np.cumsum(new) - 1)
    turned = np.abs(np.diff(ladder.joints, axis=0))[~new[1:]] > pi
    poses = replace(
        _taken(ladder, cheapest, np.searchsorted(first, ladder.start)),
        endless=tuple(np.flatnonzero(turned.any(axis=0)).tolist()),
    )
    chosen = best_ladder(poses)
    past = np.append(first, len(pose))
    wound = [np.arange(past[i], past[i + 1]) for i in chosen.index.tolist()]
    start = np.cumsum([0, *(len(each) for each in wound)])
    some = np.concatenate([np.empty(0, dtype=np.intp), *wound])
    choice = best_ladder(_taken(ladder, some, start))
    if choice.total > ladder_cost(poses, chosen.index) + _SAME_S:
        return best_ladder(ladder)
    total = choice.total if chosen.blocked is None else inf
    return Choice(some[choice.index], total, chosen.blocked)


def _cheapest(cost: NDArray[np.float64], first: NDArray[np.intp], run: NDArray[np.intp]) -> Ints:
    """The first candidate (r,) of least cost in each of the runs, which begin at `first` (r,)."""
    least = np.flatnonzero(cost == np.minimum.reduceat(cost, first)[run])
    return least[np.searchsorted(run[least], np.arange(len(first)))]


def _taken(ladder: Ladder, some: Ints, start: Ints) -> Ladder:
    """The ladder of some of the candidates, of the first rungs."""
    steps = max(0, len(start) - 2)
    return replace(
        ladder,
        joints=ladder.joints[some],
        start=start,
        cost=ladder.cost[some],
        heading_rad=ladder.heading_rad[some],
        jump_rad=ladder.jump_rad[:steps],
        jump_limit_rad=ladder.jump_limit_rad[:steps],
        group=ladder.group[some],
    )

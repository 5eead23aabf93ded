"""Steps between rungs of a few candidates each, thousands of steps at once.

A million rungs of one to eight candidates leave numpy nothing to do in one step. So a run of steps
is cut into blocks that are walked side by side: first from every entry of a block to its every exit
(products of (min, +) matrices), then from block to block, then inside the blocks from the entries
that are known by now. In exact arithmetic the order of the sums makes no difference.
"""

from __future__ import annotations

from math import inf, isqrt

import numpy as np
from numpy.typing import NDArray

from .rungs import Floats, Rungs, step_cost

WIDEST = 8


def narrow_arrivals(rungs: Rungs, first: int, stop: int, reach: Floats) -> None:
    """Fill in `reach` (m,), the least cost of arriving, for the rungs first + 1 .. stop.

    Step k goes from rung k to rung k + 1. None of the rungs has more than WIDEST candidates.
    """
    blocks = isqrt(stop - first)
    length = -(-(stop - first) // blocks)
    # The steps in the order in which they are walked: step t of every block, then t + 1.
    order = (first + np.arange(length)[:, None] + length * np.arange(blocks)).ravel()
    beyond = order >= stop  # only at the end of the last block, where nothing follows
    steps = np.minimum(order, stop - 1)
    _, after, cost = _steps(rungs, steps)
    width = len(cost)
    idle = np.where(np.eye(width, dtype=np.bool_), 0.0, inf)[:, :, None]
    cost = cost.reshape(width, width, length, blocks)

    through = np.repeat(idle, blocks, axis=2)  # entry, place so far, block
    for t in range(length):
        through = _least([through[:, p, None] + cost[p, :, t] for p in range(width)])
    entry = np.full((width, blocks), inf)
    size = rungs.start[first + 1] - rungs.start[first]
    entry[:size, 0] = reach[rungs.start[first] : rungs.start[first + 1]]
    for block in range(blocks - 1):
        entry[:, block + 1] = np.min(entry[:, block, None] + through[:, :, block], axis=0)
    arrival = np.empty((width, length, blocks))
    place = entry
    for t in range(length):
        place = _least([place[p] + cost[p, :, t] for p in range(width)])
        arrival[:, t] = place
    real = (after >= 0) & ~beyond
    reach[after[real]] = arrival.reshape(width, -1)[real]


def narrow_predecessors(rungs: Rungs, first: int, stop: int, reach: Floats) -> NDArray[np.intp]:
    """For steps first .. stop - 1, from which candidate each candidate of the rung after is reached
    at its least cost: the first such, by its place in its rung; (steps, width), padded."""
    before, after, cost = _steps(rungs, np.arange(first, stop))
    cost += reach[before][:, None]
    came_from: NDArray[np.intp] = np.argmax(cost == reach[after], axis=0)
    return came_from.T


def _steps(
    rungs: Rungs, steps: NDArray[np.intp]
) -> tuple[NDArray[np.intp], NDArray[np.intp], Floats]:
    """Candidates before and after steps (s,), each (width, s) and -1 where there is none, and what
    each step costs with the candidate it leads to, (width, width, s): from, to."""
    start = rungs.start
    width = int(
        np.max(np.maximum(start[steps + 1] - start[steps], start[steps + 2] - start[steps + 1]))
    )
    place = np.arange(width)[:, None]
    before, after = start[steps] + place, start[steps + 1] + place
    before[before >= start[steps + 1]] = -1
    after[after >= start[steps + 2]] = -1
    cost = step_cost(
        rungs,
        before[:, None],
        after,
        rungs.jump_rad[steps],
        rungs.jump_limit_rad[steps],
    )
    cost += rungs.node[after]
    cost[np.broadcast_to((before[:, None] < 0) | (after < 0), cost.shape)] = inf
    return before, after, cost


def _least(terms: list[Floats]) -> Floats:
    least = terms[0]
    for term in terms[1:]:
        np.minimum(least, term, out=least)
    return least

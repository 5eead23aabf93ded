"""The portal's free height along a sequence of holes, chosen for the least joint travel. Exact.

With q1 = h + delta, q2 = h - delta, q6 = h + lift (see `portal`), the step from hole k to k + 1
costs a convex function of dh = h[k+1] - h[k] with three kinks,

    g(dh) = w1 |dh + ddelta| + w2 |dh - ddelta| + w6 |dh + dlift|

so the least cost f_k(h) of arriving at hole k with height h is convex and piecewise linear too:
f_{k+1} is the infimal convolution of f_k and g, cut to [low, high]. Its slopes are among
±w1 ± w2 ± w6 and 0 (f_0 = 0), so f_k is known from a handful of breakpoints x, one for each gap
between neighbouring slopes: the height where the slope passes through that gap.

* Infimal convolution adds breakpoints gap by gap: x + b, where b are those of g.
* Cutting to [low, high] clips them. Hence x' = clip(x + b, low', high').

Such clipped shifts compose into clipped shifts, so the recurrence is scanned in sqrt(n) blocks side
by side. Backward, h[k+1] lies on one slope of f_k's convolution with g; h[k] may be anything
on f_k's piece of that slope from which g's piece of that slope leads to h[k+1]. Ties are common
and the preferred height settles them.
"""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from math import inf, isqrt

import numpy as np
from numpy.typing import NDArray

Weights = tuple[float, float, float]

# Slopes closer than this, relative to the steepest, are one slope. Without the merging, equal
# weights would split each flat of the optimum and `preferred_mm` could not use all of it.
_SAME_SLOPE = 1e-12


def travel_cost(
    height_mm: NDArray[np.float64],
    delta_mm: NDArray[np.float64],
    lift_mm: NDArray[np.float64],
    weights: Weights,
) -> float:
    """The sum over steps of w1 |dq1| + w2 |dq2| + w6 |dq6| for heights h; all columns (n,).

    With weights 1/speed in s/mm it is in seconds. Holes whose height is NaN are left out, as if
    they were not in the sequence.
    """
    there = ~np.isnan(height_mm)
    h, delta, lift = height_mm[there], delta_mm[there], lift_mm[there]
    w1, w2, w6 = weights
    return float(
        w1 * np.abs(np.diff(h + delta)).sum()
        + w2 * np.abs(np.diff(h - delta)).sum()
        + w6 * np.abs(np.diff(h + lift)).sum()
    )


def least_travel(
    low_mm: NDArray[np.float64],
    high_mm: NDArray[np.float64],
    delta_mm: NDArray[np.float64],
    lift_mm: NDArray[np.float64],
    weights: Weights,
    preferred_mm: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Heights h (n,), low <= h <= high, in mm, whose `travel_cost` is least of all.

    low, high: from `portal.height_interval`; delta, lift: `portal.Offsets`. weights (w1, w2, w6):
    one over the speeds of q1, q2 and q6, all > 0. preferred (n,): among equally good heights of
    a hole (given the heights of those after it) the nearest to this one is taken.

    NaN where there is no solution: low > high, or an input is NaN. The travel is then least along
    the remaining holes. Raises ValueError for weights that are not positive and finite.
    Linear time, some 150 bytes a hole. The portal's exam takes h = H/2
    throughout and leaves any better choice open.
    """
    if not all(0.0 < weight < inf for weight in weights):
        raise ValueError(f"the weights {weights} are not all positive and finite")
    solvable = low_mm <= high_mm
    for column in (delta_mm, lift_mm, preferred_mm):
        solvable = solvable & np.isfinite(column)
    height_mm = np.full(len(low_mm), np.nan)
    if solvable.any():
        low, high, preferred = low_mm[solvable], high_mm[solvable], preferred_mm[solvable]
        gaps = _gaps(weights)
        steps = _blocked_steps(low, high, np.diff(delta_mm[solvable]), np.diff(lift_mm[solvable]))
        before, last = _forward(steps, gaps, low[0], high[0])
        height_mm[solvable] = _backward(steps, gaps, before, last, low, high, preferred)
    return height_mm


@dataclass(frozen=True)
class _Gaps:
    """The gaps between neighbouring slopes of a cost-to-come, flattest slopes in the middle.

    a, b, c: the joint (0 q1, 1 q2, 2 q6) of the least, middle and greatest weight.
    c_outweighs: weight c >= weights a + b. keep: which of the eight gaps of `_step_breakpoints`
    are between slopes that differ. left_of_zero: how many of those precede the slope 0.
    """

    a: int
    b: int
    c: int
    c_outweighs: bool
    keep: tuple[int, ...]
    left_of_zero: int


def _gaps(weights: Weights) -> _Gaps:
    a, b, c = sorted(range(3), key=lambda joint: weights[joint])
    wa, wb, wc = weights[a], weights[b], weights[c]
    rising = [0.0, abs(wa + wb - wc), wa + wc - wb, wb + wc - wa, wa + wb + wc]
    slopes = [-slope for slope in reversed(rising[1:])] + rising
    least = _SAME_SLOPE * slopes[-1]
    keep = tuple(gap for gap in range(8) if slopes[gap + 1] - slopes[gap] > least)
    return _Gaps(a, b, c, wc >= wa + wb, keep, sum(gap < 4 for gap in keep))


def _step_breakpoints(kinks: NDArray[np.float64], gaps: _Gaps) -> NDArray[np.float64]:
    """Where the step cost's slope passes each kept gap: kinks (3, ...) by joint to (m, ...).

    Joint i adds 2 w_i to the slope at kink i. The slope is past a gap as soon as the kinks passed
    weigh enough: for the outermost gap any kink will do, for the next b or c, and so on.
    """
    a, b, c = kinks[gaps.a], kinks[gaps.b], kinks[gaps.c]
    ab_first, ab_last = np.minimum(a, b), np.maximum(a, b)
    bc_first, bc_last = np.minimum(b, c), np.maximum(b, c)
    # c alone, or any two of the three: their median
    middle = c if gaps.c_outweighs else np.maximum(ab_first, np.minimum(ab_last, c))
    every = (
        np.minimum(a, bc_first),
        bc_first,
        np.minimum(c, ab_last),
        middle,
        middle,
        np.maximum(c, ab_first),
        bc_last,
        np.maximum(a, bc_last),
    )
    return np.stack([every[gap] for gap in gaps.keep])


@dataclass(frozen=True)
class _Steps:
    """The steps from hole to hole as `length` rows by `blocks` columns, in order down a column.

    kinks (3, length, blocks): the dh at which joint i stands still. low, high (length, blocks):
    the interval of the hole stepped to. Past `count` the steps are padded with do-nothings.
    """

    count: int
    kinks: NDArray[np.float64]
    low: NDArray[np.float64]
    high: NDArray[np.float64]


def _blocked_steps(
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    delta_change: NDArray[np.float64],
    lift_change: NDArray[np.float64],
) -> _Steps:
    count = len(delta_change)
    length = isqrt(count) + 1
    blocks = count // length + 1

    def by_block(column: NDArray[np.float64], padding: float) -> NDArray[np.float64]:
        padded = np.full(blocks * length, padding)
        padded[:count] = column
        return np.ascontiguousarray(padded.reshape(blocks, length).T)

    changes = (-delta_change, delta_change, -lift_change)
    return _Steps(
        count,
        np.stack([by_block(change, 0.0) for change in changes]),
        by_block(low[1:], -inf),
        by_block(high[1:], inf),
    )


def _forward(
    steps: _Steps, gaps: _Gaps, first_low: float, first_high: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Breakpoints (length, m, blocks) of the cost-to-come before each step, and (m,) after all."""
    length, blocks = steps.low.shape
    m = len(gaps.keep)

    # What each block does as a whole: clip(x + shift, floor, ceiling).
    shift, floor, ceiling = (
        np.zeros((m, blocks)),
        np.full((m, blocks), -inf),
        np.full((m, blocks), inf),
    )
    for t in range(length):
        b = _step_breakpoints(steps.kinks[:, t], gaps)
        shift += b
        floor = np.minimum(np.maximum(floor + b, steps.low[t]), steps.high[t])
        ceiling = np.minimum(np.maximum(ceiling + b, steps.low[t]), steps.high[t])

    # f_0 is 0 on [low, high]: every falling slope ends at low, every rising one starts at high.
    x = np.full(m, first_high)
    x[: gaps.left_of_zero] = first_low
    entry = np.empty((m, blocks))
    for block in range(blocks):
        entry[:, block] = x
        x = np.minimum(np.maximum(x + shift[:, block], floor[:, block]), ceiling[:, block])

    before = np.empty((length, m, blocks))
    state = entry
    for t in range(length):
        before[t] = state
        b = _step_breakpoints(steps.kinks[:, t], gaps)
        state = np.minimum(np.maximum(state + b, steps.low[t]), steps.high[t])
    return before, state[:, -1]


def _backward(
    steps: _Steps,
    gaps: _Gaps,
    before: NDArray[np.float64],
    last: NDArray[np.float64],
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    preferred: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Trace an optimum from the last hole to the first; heights (n,)."""
    length, blocks = steps.low.shape
    ends = [float(low[-1]), *last.tolist(), float(high[-1])]
    flat_from, flat_to = ends[gaps.left_of_zero], ends[gaps.left_of_zero + 1]
    h = min(max(float(preferred[-1]), flat_from), flat_to)
    heights = np.empty(steps.count + 1)
    heights[-1] = h
    for block in reversed(range(blocks)):
        rows = slice(block * length, min((block + 1) * length, steps.count))
        size = rows.stop - rows.start
        x = before[:size, :, block]
        b = _step_breakpoints(steps.kinks[:, :size, block], gaps).T
        # Segment j of the sum runs from ends[j] + shifts[j] to ends[j + 1] + shifts[j + 1].
        ends_of = np.column_stack([low[rows], x, high[rows]]).tolist()
        shifts_of = np.pad(b, ((0, 0), (1, 1)), constant_values=((0, 0), (-inf, inf))).tolist()
        sums_of = (x + b).tolist()
        wanted = preferred[rows].tolist()
        chosen = []
        for t in range(size - 1, -1, -1):
            j = bisect_left(sums_of[t], h)
            end, shift, choice = ends_of[t], shifts_of[t], wanted[t]
            # First the reach of the step, then f_k's own piece, so that rounding in the former
            # can never put the height outside its interval.
            if choice < h - shift[j + 1]:
                choice = h - shift[j + 1]
            elif choice > h - shift[j]:
                choice = h - shift[j]
            if choice < end[j]:
                choice = end[j]
            elif choice > end[j + 1]:
                choice = end[j + 1]
            h = choice
            chosen.append(h)
        heights[rows] = chosen[::-1]
    return heights

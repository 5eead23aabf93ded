"""The fewest places from which all is served, and of those the ones whose worst service is best.

Places serve regions with a score each, or not at all. With few regions the search is exact: sets of
regions that k places can serve are found from those that k - 1 can (at most 2^r of them). With more
it is greedy: the place that serves the most of what is left.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: Up to so many regions, the fewest places are found exactly.
EXACT_REGIONS = 12


def best_cover(score: Floats, most: int) -> Ints | None:
    """The place (r,) of each region, for scores (p, r), -inf where a place does not serve a region;
    None where `most` places do not serve all. Of the fewest places, those with the greatest worst
    score; of equals, the ones found first, in the order of the places."""
    levels = np.unique(score[np.isfinite(score)])
    if not len(levels) or not np.isfinite(score).any(axis=0).all():
        return None
    found = None
    for size in range(1, min(most, score.shape[1]) + 1):
        found = _cover(score, levels[0], size)
        if found is not None:
            break
    if found is None:
        return None
    # The more is asked of a place the less it serves: the greatest level that can be met.
    low, high = 0, len(levels)
    while high - low > 1:
        middle = (low + high) // 2
        better = _cover(score, levels[middle], size)
        if better is None:
            high = middle
        else:
            low, found = middle, better
    chosen = np.unique(found)
    return np.asarray(chosen[np.argmax(score[chosen], axis=0)])


def _cover(score: Floats, least: float, size: int) -> Ints | None:
    """At most `size` places that serve every region with `least` or better."""
    serves = score >= least
    if score.shape[1] > EXACT_REGIONS:
        return _greedy(score, serves, size)
    return _exact(score, serves, size)


def _exact(score: Floats, serves: NDArray[np.bool_], size: int) -> Ints | None:
    bits = 1 << np.arange(score.shape[1], dtype=np.int64)
    everything = int(bits.sum())
    mask_of = serves @ bits
    masks = np.unique(mask_of)
    masks = masks[masks > 0]
    came: dict[int, tuple[int, int]] = {0: (0, 0)}  # what is served → what was before, and by whom
    edge = [0]
    for _ in range(size):
        new: list[int] = []
        for served in edge:
            wanted = ~served & (served + 1)  # the first region that is not served yet
            for mask in masks[(masks & wanted) > 0].tolist():
                if served | mask not in came:
                    came[served | mask] = served, mask
                    new.append(served | mask)
        if everything in came:
            break
        edge = new
    if everything not in came:
        return None
    places, served = [], everything
    while served:
        served, mask = came[served]
        places.append(_best_with(score, mask_of == mask, (mask & bits) > 0))
    return np.array(places, dtype=np.int64)


def _greedy(score: Floats, serves: NDArray[np.bool_], size: int) -> Ints | None:
    left = np.ones(score.shape[1], dtype=np.bool_)
    places: list[int] = []
    while left.any() and len(places) < size:
        count = (serves & left).sum(axis=1)
        if not count.max():
            return None
        place = int(np.argmax(count))
        places.append(place)
        left &= ~serves[place]
    return None if left.any() else np.array(places, dtype=np.int64)


def _best_with(score: Floats, some: NDArray[np.bool_], regions: NDArray[np.bool_]) -> int:
    """Of some places, the one that serves its worst of these regions best."""
    worst = np.where(some, score[:, regions].min(axis=1), -np.inf)
    return int(np.argmax(worst))

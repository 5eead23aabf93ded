"""The fewest places, and of those the best: against all choices."""

from itertools import combinations

import numpy as np
import pytest
from drillc.kernels.covering import EXACT_REGIONS, best_cover


def by_hand(score, most):
    """The least number of places and their best worst score, over all sets of places."""
    for size in range(1, most + 1):
        worth = max(
            score[list(some)].max(axis=0).min() for some in combinations(range(len(score)), size)
        )
        if np.isfinite(worth):
            return size, worth
    return None


@pytest.mark.parametrize("seed", range(60))
def test_against_all_choices(seed):
    rng = np.random.default_rng(seed)
    score = rng.integers(1, 12, (9, rng.integers(1, 8))).astype(float)
    score[rng.random(score.shape) < rng.uniform(0.2, 0.8)] = -np.inf
    expected, found = by_hand(score, 3), best_cover(score, 3)
    if expected is None:
        assert found is None
        return
    regions = np.arange(score.shape[1])
    assert (len(np.unique(found)), score[found, regions].min()) == expected
    assert np.array_equal(score[found, regions], score[np.unique(found)].max(axis=0))


def test_many_regions_are_covered_all_the_same():
    """Beyond the exact search's size the answer need not be the least, but it is one."""
    score = np.full((6, 3 * EXACT_REGIONS), -np.inf)
    for place in range(6):
        score[place, 6 * place : 6 * place + 6] = 1.0 + place
    found = best_cover(score, 6)
    assert np.array_equal(found, np.repeat(np.arange(6), 6))
    assert best_cover(score, 5) is None


def test_nothing_to_choose_from():
    assert best_cover(np.full((3, 2), -np.inf), 2) is None
    assert best_cover(np.empty((0, 2)), 2) is None

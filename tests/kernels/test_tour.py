"""Tours against every permutation, against the nearest neighbour's, and on rows.

Integer coordinates keep shifts and powers of two exact.
"""

from itertools import permutations

import numpy as np
import pytest
from drillc.kernels import tour
from drillc.kernels.curve_tour import curve_tour
from drillc.kernels.tour import short_tour, tour_mm
from hypothesis import given, settings
from hypothesis import strategies as st

COORDINATE = st.integers(-1000, 1000)
POINTS = st.lists(st.tuples(COORDINATE, COORDINATE, COORDINATE), min_size=1, max_size=60).map(
    lambda rows: np.array(rows, dtype=np.float64)
)


def is_permutation(order, n):
    return sorted(order.tolist()) == list(range(n))


def panel(rng, n):
    """Points on a curved panel, no two distances equal."""
    x, around = rng.uniform(0, 3000, n), rng.uniform(-0.4, 0.4, n)
    return np.stack([x, 2000 * np.sin(around), 2000 * np.cos(around)], axis=-1)


def rivet_rows(rng, rows, length):
    """Rows of a pitch of 25.4 mm, 60 mm apart and each set off a little, in random order."""
    place, row = np.meshgrid(np.arange(length) * 25.4, np.arange(rows))
    x = place + rng.uniform(-5, 5, (rows, 1))
    points = np.stack([x, row * 60.0, 0.0 * x], axis=-1).reshape(-1, 3)
    return points[rng.permutation(len(points))]


def nearest_neighbour(points):
    left = set(range(len(points)))
    order = [min(left, key=lambda i: tuple(points[i]))]
    while True:
        left.discard(order[-1])
        if not left:
            return np.array(order)
        order.append(min(left, key=lambda i: np.linalg.norm(points[i] - points[order[-1]])))


@settings(max_examples=30)
@given(points=POINTS)
def test_it_visits_each_point_once(points):
    order = short_tour(points)
    assert is_permutation(order, len(points))
    ends = np.linalg.norm(points[order[[0, -1]]] - points[0], axis=1)
    assert ends[0] <= ends[1]


@settings(max_examples=30)
@given(points=POINTS, shift=COORDINATE, power=st.integers(-3, 5))
def test_a_shift_and_a_power_of_two_change_nothing(points, shift, power):
    order = short_tour(points)
    np.testing.assert_array_equal(short_tour(points + shift), order)
    np.testing.assert_array_equal(short_tour(points * 2.0**power), order)


@settings(max_examples=30)
@given(points=POINTS, seed=st.integers(0, 1000))
def test_the_order_given_does_not_matter(points, seed):
    """Save that the first point decides which end comes first."""
    points = np.unique(points, axis=0)
    shuffled = points[np.random.default_rng(seed).permutation(len(points))]
    one, other = points[short_tour(points)].tolist(), shuffled[short_tour(shuffled)].tolist()
    assert other in (one, one[::-1])


@pytest.mark.parametrize("n", [2, 3, 5, 7, 8])
def test_small_tours_against_every_permutation(n):
    rng = np.random.default_rng(n)
    shortest = 0
    for _ in range(8):
        points = panel(rng, n)
        best = min(tour_mm(points, np.array(order)) for order in permutations(range(n)))
        ours = tour_mm(points, short_tour(points))
        assert ours <= best * 1.1
        shortest += ours <= best * (1 + 1e-9)
    assert shortest >= 7


@pytest.mark.parametrize("n", [2, 10, 100, 400])
def test_never_longer_than_the_nearest_neighbours(n):
    rng = np.random.default_rng(n)
    for points in (panel(rng, n), rivet_rows(rng, -(-n // 100), min(n, 100))):
        greedy = tour_mm(points, nearest_neighbour(points))
        assert tour_mm(points, short_tour(points)) <= greedy * (1 + 1e-9)
    if n == 400:
        points = panel(rng, n)
        greedy = tour_mm(points, nearest_neighbour(points))
        assert tour_mm(points, short_tour(points)) < 0.88 * greedy


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 0.0, -2.0), (3.0, -1.0, 7.0)])
def test_a_row_is_walked_along(direction):
    rng = np.random.default_rng(1)
    along = rng.permutation(500)
    points = np.array([100.0, -20.0, 3.0]) + along[:, None] * np.array(direction)
    walked = along[short_tour(points)]
    assert walked.tolist() in (list(range(500)), list(range(500))[::-1])
    assert (walked[0] == 0) == (along[0] < 250)


def test_rows_are_walked_to_and_fro():
    points = rivet_rows(np.random.default_rng(2), 12, 50)
    assert tour_mm(points, short_tour(points)) < 1.02 * (12 * 49 * 25.4 + 11 * 60.0)


def test_the_same_place_many_times():
    points = np.repeat([[1.0, 2, 3], [4, 5, 6], [-0.0, 0, 0]], [40, 1, 30], axis=0)
    order = short_tour(points)
    assert order.tolist() == [*range(41, 71), *range(40), 40][:: 1 if order[0] == 41 else -1] or (
        order.tolist() == [40, *range(40), *range(41, 71)]
    )
    assert short_tour(np.zeros((5, 3))).tolist() == [0, 1, 2, 3, 4]
    assert short_tour(np.zeros((1, 3))).tolist() == [0]
    assert short_tour(np.empty((0, 3))).tolist() == []


def test_twice_the_same():
    points = panel(np.random.default_rng(6), 300)
    np.testing.assert_array_equal(short_tour(points), short_tour(points.copy()))


@settings(max_examples=30)
@given(points=POINTS)
def test_the_curve_visits_each_point_once(points):
    assert is_permutation(curve_tour(points), len(points))


def test_the_curve_is_a_fair_tour(monkeypatch):
    rng = np.random.default_rng(7)
    points = panel(rng, 500)
    good = tour_mm(points, short_tour(points))
    monkeypatch.setattr(tour, "MANY", 100)
    quick = short_tour(points)
    assert is_permutation(quick, 500)
    assert good < tour_mm(points, quick) < 1.3 * good

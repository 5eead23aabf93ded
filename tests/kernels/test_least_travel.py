"""The height scan against linear programming."""

import numpy as np
import pytest
from drillc.kernels.least_travel import least_travel, travel_cost
from scipy.optimize import linprog
from scipy.sparse import coo_array


def programme(low, high, delta, lift, weights):
    """Cost vector, A_ub, b_ub, bounds of: variables h (n) and one |step| per joint and step."""
    n = len(low)
    offsets = (delta, -delta, lift)
    rows, columns, values, b = [], [], [], []
    cost = [0.0] * n
    for weight, offset in zip(weights, offsets, strict=True):
        for k in range(n - 1):
            bound = len(cost)
            cost.append(weight)
            change = offset[k + 1] - offset[k]
            for sign in (1.0, -1.0):  # sign * (h[k+1] - h[k] + change) <= |step|
                rows += [len(b)] * 3
                columns += [k + 1, k, bound]
                values += [sign, -sign, -1.0]
                b.append(-sign * change)
    A = coo_array((values, (rows, columns)), shape=(len(b), len(cost))).tocsr() if b else None
    bounds = [*zip(low, high, strict=True), *[(0, None)] * (len(cost) - n)]
    return cost, A, (b or None), bounds


def optimum(low, high, delta, lift, weights):
    cost, A, b, bounds = programme(low, high, delta, lift, weights)
    if A is None:
        return 0.0
    result = linprog(cost, A, b, bounds=bounds)
    assert result.status == 0
    return result.fun


def instance(rng, n, grid=None):
    """A random instance; with a grid, all numbers are multiples of it, so that ties abound."""
    delta = rng.uniform(-900, 900, n)
    lift = rng.uniform(-1500, 1500, n)
    low = rng.uniform(0, 2600, n)
    high = low + rng.uniform(0, 2500, n)
    preferred = rng.uniform(0, 5000, n)
    columns = [low, high, delta, lift, preferred]
    if grid:
        columns = [np.rint(column / grid) * grid for column in columns]
    return columns


def check(low, high, delta, lift, weights, preferred):
    h = least_travel(low, high, delta, lift, weights, preferred)
    assert h.shape == low.shape
    assert np.all((h >= low) & (h <= high))
    best = optimum(low, high, delta, lift, weights)
    ours = travel_cost(h, delta, lift, weights)
    assert ours == pytest.approx(best, rel=1e-7, abs=1e-6)
    return h


WEIGHTS = {
    "equal": lambda rng: (1.0, 1.0, 1.0),
    "random": lambda rng: tuple(rng.uniform(0.1, 3.0, 3)),
    "one outweighs": lambda rng: tuple(rng.permutation([0.5, 0.7, 4.0])),
    "one balances two": lambda rng: tuple(rng.permutation([1.0, 2.0, 3.0])),
    "two equal": lambda rng: tuple(rng.permutation([1.0, 1.0, 0.3])),
    "extreme": lambda rng: tuple(rng.permutation([1e-6, 1.0, 1e3])),
}


@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize("grid", [None, 500.0])
def test_the_cost_is_the_linear_programmes(weights, grid):
    rng = np.random.default_rng(len(weights))
    for _ in range(60):
        low, high, delta, lift, preferred = instance(rng, int(rng.integers(1, 14)), grid)
        check(low, high, delta, lift, WEIGHTS[weights](rng), preferred)


def degenerate_flat(rng, low, high, delta, lift):
    delta[:] = 300.0


def degenerate_points(rng, low, high, delta, lift):
    high[:] = low


def degenerate_some_points(rng, low, high, delta, lift):
    pinned = rng.random(len(low)) < 0.4
    high[pinned] = low[pinned]


def degenerate_free(rng, low, high, delta, lift):
    low[:], high[:] = -np.inf, np.inf


def degenerate_still(rng, low, high, delta, lift):
    lift[:] = delta


@pytest.mark.parametrize(
    "degenerate",
    [degenerate_flat, degenerate_points, degenerate_some_points, degenerate_free, degenerate_still],
)
@pytest.mark.parametrize("weights", ["equal", "random"])
def test_degenerate_instances(degenerate, weights):
    rng = np.random.default_rng(11)
    for _ in range(30):
        low, high, delta, lift, preferred = instance(rng, int(rng.integers(1, 12)))
        degenerate(rng, low, high, delta, lift)
        check(low, high, delta, lift, WEIGHTS[weights](rng), preferred)


@pytest.mark.parametrize("n", [200, 601])
@pytest.mark.parametrize("weights", [(1.0, 1.0, 1.0), (0.8, 1.1, 0.4), (3.0, 1.0, 1.0)])
def test_long_sequences(n, weights):
    """Smooth as a panel is, with intervals that bind: many blocks, few clips."""
    rng = np.random.default_rng(n)
    delta = 600 * np.sin(np.linspace(0, 9, n)) + rng.normal(0, 5, n)
    lift = 1500 * np.cos(np.linspace(0, 14, n)) + rng.normal(0, 20, n)
    A, B = np.maximum(np.abs(delta), -lift), np.maximum(np.abs(delta), lift)
    low, high = A, 5000 - B
    assert np.all(low < high)
    check(low, high, delta, lift, weights, (low + high) / 2)


@pytest.mark.parametrize("weights", ["equal", "one balances two", "random"])
def test_ties_go_to_the_preferred_height(weights):
    """Given the heights after it, no equally good height is nearer to the preferred one.

    On a coarse grid ties are everywhere. The oracle asks linprog for the nearest.
    """
    rng = np.random.default_rng(5)
    moved = 0
    for _ in range(25):
        n = int(rng.integers(1, 6))
        low, high, delta, lift, preferred = instance(rng, n, 500.0)
        chosen = WEIGHTS[weights](rng)
        h = check(low, high, delta, lift, chosen, preferred)
        cost, A, b, bounds = programme(low, high, delta, lift, chosen)
        best = travel_cost(h, delta, lift, chosen)
        for k in range(n):
            fixed = [*bounds[: k + 1], *((v, v) for v in h[k + 1 :]), *bounds[n:]]
            reach = []
            for sense in (1.0, -1.0):
                objective = np.zeros(len(cost))
                objective[k] = sense
                if A is None:
                    reach.append((low[k], high[k])[sense < 0])
                    continue
                dense = np.vstack([A.toarray(), cost])
                result = linprog(objective, dense, [*b, best + 1e-7], bounds=fixed)
                assert result.status == 0
                reach.append(result.x[k])
            nearest = min(max(preferred[k], reach[0]), reach[1])
            assert h[k] == pytest.approx(nearest, abs=1e-4)
            moved += reach[1] - reach[0] > 1.0
    assert moved > 5  # the instances did have ties


def test_equal_weights_follow_q6_within_the_free_band():
    """Any |dh| <= |ddelta| costs q1 and q2 nothing extra, so q6 can stand still."""
    delta = np.array([0.0, 100.0, 0.0])
    lift = np.array([0.0, 70.0, -20.0])
    wide = np.zeros(3), np.full(3, 5000.0)
    h = least_travel(*wide, delta, lift, (1.0, 1.0, 1.0), np.full(3, 2500.0))
    np.testing.assert_allclose(np.diff(h + lift), 0.0, atol=1e-12)
    assert travel_cost(h, delta, lift, (1.0, 1.0, 1.0)) == pytest.approx(400.0)
    assert h[-1] == 2500.0  # and the tie that is left goes to the preferred height


def test_the_cost_of_a_trip_by_hand():
    h, delta, lift = np.array([10.0, 14.0, 9.0]), np.array([1.0, -2.0, 0.0]), np.array([5.0, 6, 7])
    # q1 11 12 9, q2 9 16 9, q6 15 20 16
    assert travel_cost(h, delta, lift, (1.0, 10.0, 100.0)) == 4.0 + 140.0 + 900.0


def test_holes_without_a_solution_are_left_out():
    rng = np.random.default_rng(8)
    low, high, delta, lift, preferred = instance(rng, 9)
    keep = np.array([False, True, True, False, True, False, True, True, False])
    whole = least_travel(
        low[keep], high[keep], delta[keep], lift[keep], (1.0, 2.0, 1.5), preferred[keep]
    )
    low[0], delta[3], lift[5], high[8] = np.nan, np.nan, np.nan, low[8] - 1.0
    h = least_travel(low, high, delta, lift, (1.0, 2.0, 1.5), preferred)
    np.testing.assert_array_equal(h[keep], whole)
    assert np.isnan(h[~keep]).all()
    assert travel_cost(h, delta, lift, (1.0, 2.0, 1.5)) == pytest.approx(
        travel_cost(whole, delta[keep], lift[keep], (1.0, 2.0, 1.5))
    )
    nothing = least_travel(low + 1, low, delta, lift, (1.0, 1.0, 1.0), preferred)
    assert np.isnan(nothing).all()
    empty = np.empty(0)
    assert least_travel(empty, empty, empty, empty, (1.0, 1.0, 1.0), empty).shape == (0,)


@pytest.mark.parametrize("weights", [(0.0, 1.0, 1.0), (1.0, -1.0, 1.0), (1.0, 1.0, np.nan)])
def test_weights_must_be_positive(weights):
    one = np.ones(1)
    with pytest.raises(ValueError, match="weights"):
        least_travel(one, one, one, one, weights, one)

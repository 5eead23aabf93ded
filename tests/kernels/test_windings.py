"""Windings against trying every combination."""

import itertools

import numpy as np
import pytest
from drillc.kernels.windings import unwrap

TURN = 2 * np.pi


def every_choice(angles, low, high):
    """All sequences of windings within limits, each with its travel; NaN angles left out."""
    options = [
        [a + TURN * k for k in range(-6, 7) if low - 1e-12 <= a + TURN * k <= high + 1e-12]
        for a in angles
    ]
    options = [o for o in options if o]
    return [(float(np.abs(np.diff(c)).sum()), np.array(c)) for c in itertools.product(*options)]


LIMITS = [
    (-np.pi, np.pi),
    (-6.1, 6.1),
    (-3.2, 3.2),
    (-1.0, 9.0),
    (-9.5, 9.5),
    (2.0, 7.0),
    (0.5, 2.0),
]


@pytest.mark.parametrize(("low", "high"), LIMITS)
@pytest.mark.parametrize("grid", [None, np.pi / 3])
def test_the_travel_is_the_least_of_all(low, high, grid):
    rng = np.random.default_rng(1)
    for _ in range(60):
        angles = rng.uniform(-np.pi, np.pi, int(rng.integers(1, 7)))
        if grid:
            angles = np.rint(angles / grid) * grid
        result = unwrap(angles, low, high)
        choices = every_choice(angles, low, high)
        there = ~np.isnan(result)
        assert there.sum() == len(choices[0][1])
        got = result[there]
        assert np.all((got >= low - 1.1e-12) & (got <= high + 1.1e-12))
        turns = (got - angles[there]) / TURN
        np.testing.assert_allclose(turns, np.rint(turns), atol=1e-12)
        least = min(travel for travel, _ in choices)
        assert np.abs(np.diff(got)).sum() == pytest.approx(least, abs=1e-9)
        # among equal travel, nobody stays nearer to the middle of the limits
        middle = (low + high) / 2
        nearest = min(np.abs(c - middle).sum() for travel, c in choices if travel < least + 1e-9)
        assert np.abs(got - middle).sum() == pytest.approx(nearest, abs=1e-9)


def test_a_steady_turn_is_followed_past_half_a_turn():
    smooth = np.linspace(-5.5, 5.5, 200)
    wrapped = np.angle(np.exp(1j * smooth))
    np.testing.assert_allclose(unwrap(wrapped, -6.1, 6.1), smooth, atol=1e-12)


def test_it_turns_back_before_the_limit_stops_it():
    """Ending at 1044° - 360° j <= 350° takes two turns back, and no more."""
    smooth = np.linspace(0.0, 2.9 * TURN, 300)
    result = unwrap(np.angle(np.exp(1j * smooth)), np.deg2rad(-350), np.deg2rad(350))
    assert np.abs(result).max() <= np.deg2rad(350) + 1e-12
    assert (np.abs(np.diff(result)) > 1.0).sum() == 2
    np.testing.assert_allclose(np.exp(1j * result), np.exp(1j * smooth), atol=1e-12)


@pytest.mark.parametrize("shift", [0.0, 1e-3, 0.1234567])
def test_ties_are_settled_by_the_middle_and_not_by_rounding(shift):
    """Two constant or parallel sequences a turn apart: the one nearer the middle, always."""
    angles = np.cumsum(np.full(500, 1e-3)) + shift
    np.testing.assert_array_equal(unwrap(angles, -6.2, 6.2), angles)
    np.testing.assert_allclose(unwrap(angles, 0.0, 14.0), angles + TURN, atol=1e-12)


@pytest.mark.parametrize("half_turn", [np.pi, -np.pi])
def test_half_a_turn_is_positive(half_turn):
    assert unwrap(np.array([half_turn]), -np.pi, np.pi).tolist() == [np.pi]
    assert unwrap(np.array([half_turn, 0.0]), -np.pi, np.pi).tolist() == [np.pi, 0.0]


def test_it_turns_back_on_the_longest_step():
    """Turning back over a step d costs 2 pi - d for d, so a micro-radian decides where.

    The middle of the limits would have it two steps later.
    """
    smooth = np.array([0.0, 1.0, 2.000001, 3.0, 4.0, 5.0, 6.0, 7.0])
    result = unwrap(np.angle(np.exp(1j * smooth)), -6.1, 6.1)
    back = np.array([0, 0, 1, 1, 1, 1, 1, 1]) * TURN
    np.testing.assert_allclose(result, smooth - back, atol=1e-12)


def test_what_does_not_fit_is_skipped_over():
    angles = np.array([3.0, np.nan, -3.0, 0.0, -3.0, np.inf])
    result = unwrap(angles, 1.0, 5.0)
    np.testing.assert_allclose(result, [3.0, np.nan, TURN - 3, np.nan, TURN - 3, np.nan])
    wide = unwrap(np.array([3.0, np.nan, -3.0, np.nan]), -6.0, 6.0)
    np.testing.assert_allclose(wide, [3.0, np.nan, TURN - 3.0, np.nan])
    assert np.isnan(unwrap(np.full(3, np.nan), -6.0, 6.0)).all()
    assert unwrap(np.empty(0), -6.0, 6.0).shape == (0,)


def test_one_winding_everywhere_is_only_a_shift():
    angles = np.array([0.5, -0.0, 7.0, -12.0])
    result = unwrap(angles, -3.0, 3.0)
    np.testing.assert_allclose(result, [0.5, 0.0, 7.0 - TURN, 2 * TURN - 12.0], atol=1e-14)
    assert not np.signbit(result[1])


@pytest.mark.parametrize("limits", [(1.0, 0.0), (-np.inf, 1.0), (0.0, np.nan)])
def test_limits_must_be_finite_and_in_order(limits):
    with pytest.raises(ValueError, match="limits"):
        unwrap(np.zeros(2), *limits)

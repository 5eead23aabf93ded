"""Whole turns, against trying every number of turns one by one."""

import itertools

import numpy as np
import pytest
from drillc.kernels.turns import all_turns
from hypothesis import given
from hypothesis import strategies as st

TURN = 2.0 * np.pi
KUKA = np.radians([185.0, 140.0, 168.0, 350.0, 125.0, 350.0])

ANGLE = st.floats(-np.pi, np.pi) | st.sampled_from([0.0, np.pi, np.pi / 2, np.nan])
ROWS = st.lists(st.tuples(*[ANGLE] * 6), max_size=4).map(
    lambda rows: np.array(rows, dtype=float).reshape(-1, 6)
)
LIMIT = st.tuples(st.floats(-8.0, 8.0), st.floats(0.0, 9.0)).map(lambda v: (v[0], v[0] + v[1]))
LIMITS = st.tuples(*[LIMIT] * 6).map(lambda pairs: np.array(pairs).T)


def tried(angle, low, high):
    """The values of one joint inside its limits, ascending."""
    values = (angle + k * TURN for k in range(-4, 5))
    return [value for value in values if low - 1e-12 <= value <= high + 1e-12]


@given(rows=ROWS, limits=LIMITS)
def test_all_turns_are_what_trying_finds(rows, limits):
    index, joints = all_turns(rows, *limits)
    expected = [
        (i, combination)
        for i, row in enumerate(rows)
        for combination in itertools.product(*map(tried, row, *limits))
    ]
    assert index.tolist() == [i for i, _ in expected]
    np.testing.assert_allclose(
        joints, np.array([values for _, values in expected]).reshape(-1, 6), atol=1e-14
    )


def test_axes_4_and_6_of_a_kuka_have_two_turns_each():
    pose = np.radians([[10.0, -90.0, 90.0, 20.0, 30.0, -40.0], [10.0, 150.0, 90.0, 0.0, 0.0, 0.0]])
    index, joints = all_turns(pose, -KUKA, KUKA)
    assert index.tolist() == [0, 0, 0, 0]  # axis 2 of the second pose is past its limit
    np.testing.assert_allclose(
        np.degrees(joints[:, [3, 5]]), [[-340, -40], [-340, 320], [20, -40], [20, 320]]
    )


def test_a_half_turn_is_reached_from_both_ends_and_rounding_is_let_pass():
    half = np.full(6, np.pi)
    index, joints = all_turns(np.array([[np.pi, 0, 0, 0, 0, 0]]), -half, half)
    assert index.tolist() == [0, 0]
    assert joints[:, 0].tolist() == [-np.pi, np.pi]
    tight = np.array([np.pi - 1e-13, 1, 1, 1, 1, 1])
    assert len(all_turns(np.array([[np.pi, 0, 0, 0, 0, 0]]), -tight, tight)[0]) == 2
    tight[0] = np.pi - 1e-11
    assert len(all_turns(np.array([[np.pi, 0, 0, 0, 0, 0]]), -tight, tight)[0]) == 0


def test_the_order_is_that_of_the_rows_and_the_work_is_done_at_once():
    rng = np.random.default_rng(3)
    rows = rng.uniform(-np.pi, np.pi, (20_000, 6))
    rows[::7] = np.nan
    index, joints = all_turns(rows, -KUKA, KUKA)
    assert np.all(np.diff(index) >= 0)
    assert not np.isin(index, np.arange(0, 20_000, 7)).any()
    np.testing.assert_allclose(np.exp(1j * joints), np.exp(1j * rows[index]), atol=1e-14)
    assert np.all(np.abs(joints) <= KUKA)
    keys = np.column_stack([index, joints])
    assert np.array_equal(np.lexsort(keys.T[::-1]), np.arange(len(keys)))


@pytest.mark.parametrize(("low", "high"), [(1.0, 0.0), (-np.inf, 1.0), (0.0, np.nan)])
def test_impossible_limits_are_refused(low, high):
    with pytest.raises(ValueError, match="limits"):
        all_turns(np.zeros((1, 6)), np.full(6, low), np.full(6, high))

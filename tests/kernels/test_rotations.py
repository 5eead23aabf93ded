"""Rotations against scipy, at and around every singularity."""

import itertools
import warnings

import numpy as np
import pytest
from drillc.kernels import rotations
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

SEQUENCES = ["".join(s) for s in itertools.product("xyz", repeat=3) if s[0] != s[1] != s[2]]
PROPER = [s for s in SEQUENCES if s[0] == s[2]]
# All 24 ways to put a cube on a table: every entry 0 or ±1, so every lock and every ±180° occurs.
CUBE = np.array(
    [
        np.diag(signs)[list(order)]
        for order in itertools.permutations(range(3))
        for signs in itertools.product((1.0, -1.0), repeat=3)
        if np.linalg.det(np.diag(signs)[list(order)]) > 0
    ]
)
ANY_ANGLE = st.floats(-np.pi, np.pi) | st.sampled_from(
    [k * np.pi / 4 for k in range(-4, 5)] + [np.pi / 2 - 1e-7, 1e-9, -np.pi / 2 + 1e-12, -0.0]
)


def random_rotations(n, seed=0):
    return Rotation.from_quat(np.random.default_rng(seed).normal(size=(n, 4))).as_matrix()


def assert_canonical_angles(angles, sequence):
    low, high = (0.0, np.pi) if sequence in PROPER else (-np.pi / 2, np.pi / 2)
    assert np.all((angles[..., 1] >= low) & (angles[..., 1] <= high))
    outer = angles[..., [0, 2]]
    assert np.all((outer > -np.pi) & (outer <= np.pi))
    assert not np.any(np.signbit(angles) & (angles == 0.0)), "-0.0"


def test_there_are_twelve_sequences():
    assert len(SEQUENCES) == 12
    assert len(CUBE) == 24


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_quarter_turns_are_exact(axis):
    for quarter in range(-8, 9):
        R = rotations.rotation_about(axis, np.deg2rad(90.0 * quarter))
        expected = np.rint(Rotation.from_euler("xyz"[axis], 90 * quarter, degrees=True).as_matrix())
        assert np.array_equal(R, expected)
        assert not np.any(np.signbit(R) & (R == 0.0))


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_rotation_about_agrees_with_scipy(axis):
    for angle in (0.3, -2.9, 1e-8, 5.0):
        expected = Rotation.from_euler("xyz"[axis], angle).as_matrix()
        np.testing.assert_allclose(rotations.rotation_about(axis, angle), expected, atol=1e-15)


def test_a_bad_axis_or_sequence_is_refused():
    with pytest.raises(ValueError, match="axis 3"):
        rotations.rotation_about(3, 0.0)
    for sequence in ("zyy", "zy", "ZYX", "abc", "", "zyxz", "xxy"):
        with pytest.raises(ValueError, match="Euler sequence"):
            rotations.euler_from_matrix(np.eye(3), sequence)
        with pytest.raises(ValueError, match="Euler sequence"):
            rotations.matrix_from_euler(np.zeros(3), sequence)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_matrix_from_euler_is_scipys_intrinsic_rotation(sequence):
    angles = np.random.default_rng(1).uniform(-7.0, 7.0, (500, 3))
    expected = Rotation.from_euler(sequence.upper(), angles).as_matrix()
    np.testing.assert_allclose(rotations.matrix_from_euler(angles, sequence), expected, atol=4e-15)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_euler_from_matrix_is_scipys_away_from_lock(sequence):
    R = random_rotations(20_000)  # more than one block
    angles = rotations.euler_from_matrix(R, sequence)
    assert_canonical_angles(angles, sequence)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        expected = Rotation.from_matrix(R).as_euler(sequence.upper())
    difference = (angles - expected + np.pi) % (2 * np.pi) - np.pi
    np.testing.assert_allclose(difference, 0.0, atol=1e-8)  # scipy itself loses digits near lock


@pytest.mark.parametrize("sequence", SEQUENCES)
@given(angles=st.tuples(ANY_ANGLE, ANY_ANGLE, ANY_ANGLE))
def test_angles_give_the_rotation_back(sequence, angles):
    R = Rotation.from_euler(sequence.upper(), angles).as_matrix()
    read = rotations.euler_from_matrix(R, sequence)
    assert_canonical_angles(read, sequence)
    back = Rotation.from_euler(sequence.upper(), read).as_matrix()
    np.testing.assert_allclose(back, R, atol=1e-12)


@pytest.mark.parametrize("sequence", SEQUENCES)
def test_the_product_holds_through_gimbal_lock(sequence):
    """From a degree away down to lock itself, from both sides, with noisy matrices."""
    rng = np.random.default_rng(2)
    locks = (0.0, np.pi) if sequence in PROPER else (-np.pi / 2, np.pi / 2)
    away = np.concatenate([10.0 ** np.arange(-18.0, -1.5, 0.25), [0.0]])
    for lock in locks:
        for side in (away, -away):
            angles = rng.uniform(-np.pi, np.pi, (len(side), 3))
            angles[:, 1] = lock + side
            R = Rotation.from_euler(sequence.upper(), angles).as_matrix()
            R += rng.uniform(-2e-16, 2e-16, R.shape)
            read = rotations.euler_from_matrix(R, sequence)
            assert_canonical_angles(read, sequence)
            back = Rotation.from_euler(sequence.upper(), read).as_matrix()
            np.testing.assert_allclose(back, R, atol=1e-12)
            assert np.all(read[np.abs(side) < 1e-15, 2] == 0.0)  # canonical in lock
            assert np.all(read[np.abs(side) > 1e-12, 2] != 0.0)  # and only there


@pytest.mark.parametrize("sequence", SEQUENCES)
@pytest.mark.parametrize("noise", [0.0, 3e-15])
def test_the_cubes_orientations_have_stable_round_angles(sequence, noise):
    R = CUBE + noise * np.random.default_rng(3).uniform(-1, 1, CUBE.shape)
    angles = rotations.euler_from_matrix(R, sequence)
    assert_canonical_angles(angles, sequence)
    exact = rotations.euler_from_matrix(CUBE, sequence)
    np.testing.assert_allclose(angles, exact, atol=1e-14)  # noise never swaps pi and -pi
    quarters = exact / (np.pi / 2)
    np.testing.assert_allclose(quarters, np.rint(quarters), atol=1e-15)
    assert np.array_equal(rotations.matrix_from_euler(exact, sequence), CUBE)


def test_kuka_angles_of_the_articles_lower_holes():
    """Table rows P7, P8 as R = Rz(gamma) Ry(beta) Rx(alpha), in canonical form."""
    table = np.array([[-6.483, -102.533, 0.0], [-7.416, -111.641, 0.0]])
    R = Rotation.from_euler("ZYX", table, degrees=True).as_matrix()
    abc = rotations.kuka_abc_from_matrix(R)
    expected = [[173.517, -77.467, 180.0], [172.584, -68.359, 180.0]]
    np.testing.assert_allclose(np.rad2deg(abc), expected, atol=1e-9)
    np.testing.assert_allclose(rotations.matrix_from_kuka_abc(abc), R, atol=1e-15)


def test_canonical_angle():
    given_rad = np.array([-np.pi, np.pi, -0.0, 1.0, np.nan, -np.pi + 1e-15, -np.pi + 1e-9])
    expected = np.array([np.pi, np.pi, 0.0, 1.0, np.nan, np.pi, -np.pi + 1e-9])
    result = rotations.canonical_angle(given_rad)
    np.testing.assert_array_equal(result, expected)
    assert not np.signbit(result[2])


def test_quaternions_are_scipys():
    R = random_rotations(20_000)
    expected = Rotation.from_matrix(R).as_quat(canonical=True)[:, [3, 0, 1, 2]]
    q = rotations.quaternion_from_matrix(R)
    assert np.all(q[:, 0] > 0)
    np.testing.assert_allclose(q, expected, atol=1e-14)
    np.testing.assert_allclose(rotations.matrix_from_quaternion(q), R, atol=1e-14)
    np.testing.assert_allclose(rotations.matrix_from_quaternion(-3.0 * q), R, atol=1e-14)


def test_quaternions_of_the_cubes_orientations():
    q = rotations.quaternion_from_matrix(CUBE)
    first = np.array([row[np.flatnonzero(row)[0]] for row in q])
    assert np.all(first > 0)
    assert not np.any(np.signbit(q) & (q == 0.0))
    expected = Rotation.from_matrix(CUBE).as_quat(canonical=True)[:, [3, 0, 1, 2]]
    np.testing.assert_allclose(q, expected, atol=1e-15)


@given(
    axis=st.tuples(*[st.sampled_from([-2.0, -1.0, 0.0, 1.0, 3.0])] * 3).filter(any),
    seed=st.integers(0, 10_000),
)
def test_half_turns_have_one_quaternion_whatever_the_rounding(axis, seed):
    unit = np.array(axis) / np.linalg.norm(axis)
    R = 2.0 * np.outer(unit, unit) - np.eye(3)
    noisy = R + np.random.default_rng(seed).uniform(-2e-15, 2e-15, (3, 3))
    q = rotations.quaternion_from_matrix(noisy)
    assert q[0] == 0.0
    assert not np.signbit(q[0])
    expected = unit * np.sign(unit[np.flatnonzero(unit)[0]])
    np.testing.assert_allclose(q[1:], expected, atol=1e-14)


@pytest.mark.parametrize(
    "angle", [0.0, 1e-15, 1e-12, 1e-8, 0.5, np.pi - 1e-8, np.pi - 1e-12, np.pi]
)
def test_angle_between_keeps_its_digits_at_both_ends(angle):
    axis = np.array([1.0, -2.0, 0.5]) / np.linalg.norm([1.0, -2.0, 0.5])
    Ra = random_rotations(50)
    Rb = (Rotation.from_matrix(Ra) * Rotation.from_rotvec(angle * axis)).as_matrix()
    np.testing.assert_allclose(rotations.angle_between(Ra, Rb), angle, atol=2e-15)


def test_angle_between_agrees_with_scipy():
    Ra, Rb = random_rotations(1000, 4), random_rotations(1000, 5)
    expected = (Rotation.from_matrix(Ra).inv() * Rotation.from_matrix(Rb)).magnitude()
    np.testing.assert_allclose(rotations.angle_between(Ra, Rb), expected, atol=1e-13)
    np.testing.assert_allclose(rotations.angle_between(Ra[0], Rb)[0], expected[0], atol=1e-13)


def test_leading_shapes_are_kept():
    R = random_rotations(24).reshape(2, 3, 4, 3, 3)
    angles = rotations.euler_from_matrix(R, "zyz")
    q = rotations.quaternion_from_matrix(R)
    assert angles.shape == (2, 3, 4, 3)
    assert q.shape == (2, 3, 4, 4)
    np.testing.assert_allclose(rotations.matrix_from_euler(angles, "zyz"), R, atol=1e-14)
    np.testing.assert_allclose(rotations.matrix_from_quaternion(q), R, atol=1e-14)
    assert rotations.angle_between(R, R).shape == (2, 3, 4)
    assert rotations.euler_from_matrix(R[0, 0, 0], "zyx").shape == (3,)
    assert rotations.quaternion_from_matrix(np.empty((0, 3, 3))).shape == (0, 4)


def test_nan_stays_in_its_row_and_nothing_warns():
    R = np.stack([np.eye(3), np.full((3, 3), np.nan), np.zeros((3, 3)), -np.eye(3) * 0.0])
    for sequence in SEQUENCES:
        angles = rotations.euler_from_matrix(R, sequence)
        assert np.all(np.isnan(angles[1]))
        assert np.all(angles[0] == 0.0)
    assert np.all(np.isnan(rotations.quaternion_from_matrix(R)[1]))
    assert np.isnan(rotations.angle_between(R, R)[1])
    q = np.array([[0.0, 0, 0, 0], [np.nan] * 4, [1.0, 0, 0, 0]])
    back = rotations.matrix_from_quaternion(q)
    assert np.all(np.isnan(back[:2]))
    assert np.array_equal(back[2], np.eye(3))
    assert np.all(np.isnan(rotations.matrix_from_euler([np.nan, np.nan, np.nan], "zyx")[0, :2]))

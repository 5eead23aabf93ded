"""The posture rules against the article's table, scipy and their own definition."""

import itertools

import numpy as np
import pytest
from drillc.kernels import posture
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

UP = (0.0, 0.0, 1.0)
# Normals, printed (alpha, beta, gamma), and which axis is horizontal in which sense. The angles
# reproduce as Rz(gamma) Ry(beta) Rx(alpha); which axis is horizontal follows from them.
TABLE = {
    "P1": ((-0.233, -0.012, 0.972), (0.0, 13.469, -177.035), 1, (0, -1, 0)),
    "P2": ((-0.236, -0.011, 0.972), (0.0, 13.634, -177.222), 1, (0, -1, 0)),
    "P4": ((-0.693, 0.035, 0.721), (43.898, 0.0, -92.889), 0, (0, -1, 0)),
    "P5": ((-0.754, 0.037, 0.655), (49.047, 0.0, -92.826), 0, (0, -1, 0)),
    "P7": ((-0.970, 0.110, -0.217), (0.0, -102.533, -6.483), 1, (0, 1, 0)),
    "P8": ((-0.922, 0.120, -0.369), (0.0, -111.641, -7.416), 1, (0, 1, 0)),
}
COMPONENT = st.floats(-1.0, 1.0, allow_subnormal=False)
DIRECTION = st.tuples(COMPONENT, COMPONENT, COMPONENT).filter(lambda v: np.linalg.norm(v) > 1e-3)


def assert_rotations(R, feed):
    feed = np.asarray(feed, dtype=float)
    unit = feed / np.linalg.norm(feed, axis=-1, keepdims=True)
    gram = np.swapaxes(R, -1, -2) @ R
    np.testing.assert_allclose(gram, np.broadcast_to(np.eye(3), gram.shape), atol=2e-15)
    np.testing.assert_allclose(np.linalg.det(R), 1.0, atol=3e-15)
    np.testing.assert_allclose(R[..., 2], unit, atol=3e-16)


@pytest.mark.parametrize("hole", TABLE)
@pytest.mark.parametrize("up", [(0, 0, 1), (0, 0, -1)])
def test_the_articles_table(hole, up):
    """`toward` makes the result independent of which way along Z is up."""
    normal, (alpha, beta, gamma), axis, sense = TABLE[hole]
    printed = Rotation.from_euler("ZYX", (gamma, beta, alpha), degrees=True).as_matrix()
    ours = posture.horizontal(np.array([normal]), up, axis, sense, 0.01).part_from_tool[0]
    assert np.rad2deg(np.arccos(ours[:, 2] @ printed[:, 2])) < 0.05
    assert np.rad2deg(np.arccos(min(1.0, ours[:, axis] @ printed[:, axis]))) < 0.2


def test_the_articles_formulas_with_the_second_axis_right_handed():
    """Step 2's n, and Step 3's o with the sign that makes det R = +1."""
    ax, ay, az = np.array([-0.693, 0.035, 0.721]) / np.linalg.norm([-0.693, 0.035, 0.721])
    s = np.hypot(ax, ay)
    result = posture.horizontal(np.array([[-0.693, 0.035, 0.721]]), UP, 0, None, 0.0)
    R = result.part_from_tool[0]
    np.testing.assert_allclose(R[:, 0], np.array([-ay, ax, 0.0]) / s, atol=1e-15)
    np.testing.assert_allclose(R[:, 1], np.array([-ax * az, -ay * az, s * s]) / s, atol=1e-15)


@pytest.mark.parametrize("axis", [0, 1])
@given(feed=DIRECTION, up=DIRECTION, sense=DIRECTION | st.none())
def test_horizontal_is_what_it_says(axis, feed, up, sense):
    result = posture.horizontal(np.array([feed]), up, axis, sense, 0.02)
    R, unit_up = result.part_from_tool[0], np.array(up) / np.linalg.norm(up)
    a = np.array(feed) / np.linalg.norm(feed)
    sine = np.linalg.norm(np.cross(unit_up, a))
    np.testing.assert_allclose(result.tilt_rad, np.arctan2(sine, abs(unit_up @ a)), atol=1e-15)
    assert result.undefined[0] == (result.tilt_rad[0] < 0.02)
    assert np.isnan(R).all() == (result.undefined[0] or result.ambiguous[0])
    assert not (result.undefined[0] and result.ambiguous[0])
    if result.undefined[0]:
        return
    held = np.cross(unit_up, a) / sine
    if sense is None:
        assert not result.ambiguous[0]
    else:
        cosine = held @ sense / np.linalg.norm(sense)
        if abs(abs(cosine) - 1e-6) > 1e-12:
            assert result.ambiguous[0] == (abs(cosine) < 1e-6)
        if result.ambiguous[0]:
            return
        held *= np.sign(cosine)
    assert_rotations(R, feed)
    np.testing.assert_allclose(R[:, axis], held, atol=1e-13)


@pytest.mark.parametrize("axis", [0, 1])
@given(feed=DIRECTION, direction=DIRECTION)
def test_toward_is_the_projection(axis, feed, direction):
    result = posture.toward(np.array([feed]), direction, axis, 0.02)
    R, wanted = result.part_from_tool[0], np.array(direction) / np.linalg.norm(direction)
    a = np.array(feed) / np.linalg.norm(feed)
    projected = wanted - (wanted @ a) * a
    tilt = np.arctan2(np.linalg.norm(projected), abs(wanted @ a))
    np.testing.assert_allclose(result.tilt_rad, tilt, atol=1e-14)
    assert not result.ambiguous[0]
    if result.undefined[0]:
        assert tilt < 0.02 + 1e-12
        assert np.isnan(R).all()
        return
    assert_rotations(R, feed)
    np.testing.assert_allclose(R[:, axis], projected / np.linalg.norm(projected), atol=1e-12)


@pytest.mark.parametrize("tilt", [3e-9, 1e-8, 1e-6, 1e-3])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_rotations_stay_orthonormal_next_to_the_singular_line(tilt, sign):
    base = Rotation.from_rotvec([0.7, 0.4, -0.1])
    up = 1.3 * base.apply([0.0, 0.0, 1.0])
    azimuth = np.linspace(0.1, 6.2, 500)
    local = np.stack(
        [
            np.sin(tilt) * np.cos(azimuth),
            np.sin(tilt) * np.sin(azimuth),
            azimuth * 0 + np.cos(tilt),
        ],
        axis=-1,
    )
    feed = sign * base.apply(local)
    for axis in (0, 1):
        for result in (
            posture.horizontal(feed, up, axis, None, 0.0),
            posture.toward(feed, up, axis, 0.0),
        ):
            np.testing.assert_allclose(result.tilt_rad, tilt, atol=1e-15)
            assert not result.undefined.any()
            assert_rotations(result.part_from_tool, feed)


def test_what_the_rule_cannot_decide_is_said_and_nan():
    feed = np.array([[0, 0, 1.0], [0, 0, -2.0], [0, 0, 0], [np.nan, 0, 1], [1, 0, 0], [0, 1, 0]])
    for cone in (0.0, 0.05):
        result = posture.horizontal(feed, UP, 0, (0.0, 1.0, 0.0), cone)
        assert result.undefined.tolist() == [True, True, True, True, False, False]
        assert result.ambiguous.tolist() == [False, False, False, False, False, True]
        assert np.isnan(result.part_from_tool).all(axis=(1, 2)).tolist() == [True] * 4 + [
            False,
            True,
        ]
        assert result.tilt_rad[:2].tolist() == [0.0, 0.0]
        assert np.isnan(result.tilt_rad[2:4]).all()
        np.testing.assert_array_equal(result.part_from_tool[4][:, 0], [0, 1, 0])
    along_up = posture.horizontal(feed, UP, 0, (0.0, 0.0, 1.0), 0.0)
    assert along_up.ambiguous[4:].all()  # up is perpendicular to everything horizontal
    for off_axis, ambiguous in ((1e-5, False), (1e-7, True)):  # the threshold is 1e-6
        sense = (np.sin(off_axis), np.cos(off_axis), 0.0)  # the feed's horizontal axis is -x
        nearly = posture.horizontal(np.array([[0.0, 1.0, 0.5]]), UP, 1, sense, 0.0)
        assert nearly.ambiguous[0] == ambiguous
    everywhere = posture.toward(feed, (0.0, 0.0, -1.0), 1, 0.0)
    assert everywhere.undefined.tolist() == [True] * 4 + [False] * 2


def test_the_cone_is_the_threshold():
    angles = np.array([0.02, 0.0499, 0.0501, 0.2])
    feed = np.stack([np.sin(angles), 0 * angles, -np.cos(angles)], axis=-1)
    assert posture.horizontal(feed, UP, 1, None, 0.05).undefined.tolist() == [
        True,
        True,
        False,
        False,
    ]
    assert posture.toward(feed, UP, 1, 0.05).undefined.tolist() == [True, True, False, False]


def test_directions_without_direction_are_refused():
    feed = np.array([[1.0, 0, 0]])
    for nothing in ((0, 0, 0), (np.nan, 0, 1), (np.inf, 0, 0)):
        with pytest.raises(ValueError, match="up"):
            posture.horizontal(feed, nothing, 0, None, 0.0)
        with pytest.raises(ValueError, match="toward"):
            posture.horizontal(feed, UP, 0, nothing, 0.0)
        with pytest.raises(ValueError, match="direction"):
            posture.toward(feed, nothing, 0, 0.0)
    for rule in (
        lambda: posture.horizontal(feed, UP, 2, None, 0.0),
        lambda: posture.toward(feed, UP, -1, 0.0),
    ):
        with pytest.raises(ValueError, match="axis"):
            rule()


def test_many_holes_are_the_same_as_one_at_a_time():
    """Blocks: rows on both sides of every block border."""
    feed = np.random.default_rng(0).normal(size=(3 * posture._BLOCK + 5, 3))
    many = posture.horizontal(feed, UP, 1, (1.0, 2.0, 0.0), 0.3)
    jumps = posture.heading_jump_rad(many.part_from_tool)
    assert many.undefined.any()
    assert jumps.shape == (len(feed) - 1,)
    for border in range(0, len(feed), posture._BLOCK):
        for k in range(max(border - 2, 0), min(border + 2, len(feed) - 1)):
            pair = posture.horizontal(feed[k : k + 2], UP, 1, (1.0, 2.0, 0.0), 0.3)
            np.testing.assert_array_equal(pair.part_from_tool, many.part_from_tool[k : k + 2])
            np.testing.assert_array_equal(pair.tilt_rad, many.tilt_rad[k : k + 2])
            np.testing.assert_array_equal(pair.undefined, many.undefined[k : k + 2])
            np.testing.assert_array_equal(
                posture.heading_jump_rad(pair.part_from_tool), jumps[k : k + 1]
            )
    strided = posture.horizontal(np.asfortranarray(feed), UP, 1, (1.0, 2.0, 0.0), 0.3)
    np.testing.assert_array_equal(strided.part_from_tool, many.part_from_tool)


def transported_jump(R0, R1):
    """The definition, step by step: smallest rotation, then the angle about the new axis."""
    z0, z1 = R0[:, 2], R1[:, 2]
    axis = np.cross(z0, z1)
    length = np.linalg.norm(axis)
    turn = np.arctan2(length, z0 @ z1)
    carry = Rotation.from_rotvec(axis / length * turn if length > 0 else np.zeros(3))
    carried = carry.apply(R0[:, 0])
    return abs(np.arctan2(np.cross(carried, R1[:, 0]) @ z1, carried @ R1[:, 0]))


def test_heading_jump_is_parallel_transport():
    R = Rotation.from_quat(np.random.default_rng(7).normal(size=(300, 4))).as_matrix()
    expected = [transported_jump(R0, R1) for R0, R1 in itertools.pairwise(R)]
    np.testing.assert_allclose(posture.heading_jump_rad(R), expected, atol=1e-11)


@given(seed=st.integers(0, 1000), twist=st.floats(-np.pi, np.pi), lean=st.floats(0.0, 3.14))
def test_a_lean_is_no_jump_and_a_twist_is(seed, twist, lean):
    rng = np.random.default_rng(seed)
    R0 = Rotation.from_quat(rng.normal(size=4))
    azimuth = rng.uniform(0, 2 * np.pi)
    swing = Rotation.from_rotvec(lean * np.array([np.cos(azimuth), np.sin(azimuth), 0.0]))
    R1 = R0 * swing * Rotation.from_rotvec([0.0, 0.0, twist])
    jump = posture.heading_jump_rad(np.stack([R0.as_matrix(), R1.as_matrix()]))
    np.testing.assert_allclose(jump, [abs(twist)], atol=1e-9)


def test_heading_jump_where_the_tool_turns_over_and_where_there_is_none():
    """The second step of `over` is half a turn about z, not a flip."""
    over = np.stack([np.eye(3), np.diag([-1.0, 1.0, -1.0]), np.diag([1.0, -1.0, -1.0])])
    np.testing.assert_allclose(posture.heading_jump_rad(over), [0.0, np.pi], atol=1e-15)
    for seed in range(20):  # rounding does not choose among the half turns
        R = Rotation.from_quat(np.random.default_rng(seed).normal(size=4))
        turned = R * Rotation.from_rotvec([np.pi, 0.0, 0.0]) * Rotation.from_rotvec([0, 0, seed])
        pair = np.stack([R.as_matrix(), turned.as_matrix()])
        assert posture.heading_jump_rad(pair).tolist() == [0.0]
    gap = np.stack([np.eye(3), np.full((3, 3), np.nan), np.eye(3), np.eye(3)])
    np.testing.assert_array_equal(posture.heading_jump_rad(gap), [np.nan, np.nan, 0.0])
    assert posture.heading_jump_rad(gap[:1]).shape == (0,)
    assert posture.heading_jump_rad(gap[:0]).shape == (0,)
    assert posture.horizontal(np.empty((0, 3)), UP, 0, None, 0.0).part_from_tool.shape == (0, 3, 3)

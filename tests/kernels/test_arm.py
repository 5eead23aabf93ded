"""The arm against published URDFs, products of exponentials, py-opw-kinematics and itself.

py-opw-kinematics works in any length unit; millimetres here. Its branch order is the kernel's, its
`forward_frames` is wrong (as it says itself) and not used.
"""

import numpy as np
import pytest
from drillc.kernels.arm import LANDMARKS, ArmGeometry, forward, landmarks, link_frames, singularity
from drillc.kernels.arm_inverse import inverse, inverse_columns
from hypothesis import given
from hypothesis import strategies as st
from py_opw_kinematics import KinematicModel, Robot
from scipy.spatial.transform import RigidTransform, Rotation


def kuka(*dimensions):
    return ArmGeometry(
        *dimensions, np.radians([0, -90, 0, 0, 0, 0]), np.array([-1.0, 1, 1, -1, 1, -1])
    )


def abb(*dimensions):
    return ArmGeometry(*dimensions, np.radians([0, 0, -90, 0, 0, 0]), np.ones(6))


ARMS = {
    "kr6_r900_2": kuka(25, -25, 0, 400, 455, 420, 90),
    "kr150_r3100_2": kuka(330, -115, 0, 645, 1350, 1420, 215),
    "kr120_r2500_pro": kuka(350, 41, 0, 675, 1150, 1000, 215),
    "irb2400_10": abb(100, -135, 0, 615, 705, 755, 85),
    "irb6640_185_280": abb(320, -200, 0, 780, 1075, 1392, 200),
}
# Not machines: an offset b, every joint's zero and sense turned; and arms that can fold completely.
ODD = ArmGeometry(
    120, -60, 45, 500, 700, 650, 90, np.radians([30, -90, 20, 180, -45, 90]), -np.ones(6)
)
FOLDING = abb(100, 300, -20, 615, 500, 400, 85)
UPRIGHT = abb(0, 0, 0, 300, 500, 500, 0)
ALL = {**ARMS, "odd": ODD, "folding": FOLDING, "upright": UPRIGHT}

each_arm = pytest.mark.parametrize("name", ARMS)
any_arm = st.sampled_from(sorted(ALL))

# Joints at and around every singularity: quarter turns, angles given below, and next to them.
NEAR = st.sampled_from([0.0, 1e-15, -1e-13, 3e-12, -1e-9, 1e-6, -1e-3])
ANGLE = st.floats(-np.pi, np.pi) | st.builds(
    lambda quarter, near: quarter * np.pi / 2 + near, st.integers(-2, 2), NEAR
)
JOINTS = st.tuples(*[ANGLE] * 6).map(np.array)


def random_joints(n, seed=0):
    return np.random.default_rng(seed).uniform(-np.pi, np.pi, (n, 6))


def apart(first, second):
    """The angle, rad, between two values of a joint."""
    return np.abs(np.angle(np.exp(1j * (first - second))))


def there(solutions):
    return ~np.isnan(solutions[..., 0])


def paper_frames_at_zero(arm):
    """The paper's rotations after 0 … 6 joints where the controller's joints are zero."""
    frames = [Rotation.identity()]
    for axis, angle in zip("zyyzyz", -arm.offset_rad, strict=True):
        frames.append(frames[-1] * Rotation.from_euler(axis, angle))
    return frames


def opw(arm):
    model = KinematicModel(
        arm.a1_mm, arm.a2_mm, arm.b_mm, arm.c1_mm, arm.c2_mm, arm.c3_mm, arm.c4_mm,
        tuple(arm.offset_rad), tuple(bool(sign < 0) for sign in arm.sign),
    )  # fmt: skip
    return Robot(model, degrees=False)


# ── forward ──────────────────────────────────────────────────────────────────────────────────────

# Joint origins (m) and axes from the support packages of kuka_experimental and abb; the tool frames
# add a quarter turn about y, which is the flange's z along the last axis.
URDFS = {
    "kr150_r3100_2": (
        [(0, 0, 0.645), (0.33, 0, 0), (1.35, 0, 0), (1.42, 0, 0.115), (0, 0, 0), (0.215, 0, 0)],
        [(0, 0, -1), (0, 1, 0), (0, 1, 0), (-1, 0, 0), (0, 1, 0), (-1, 0, 0)],
    ),
    "irb2400_10": (
        [
            (0, 0, 0),
            (0.1, 0, 0.615),
            (0, 0, 0.705),
            (0.258, 0, 0.135),
            (0.497, 0, 0),
            (0.085, 0, 0),
        ],
        [(0, 0, 1), (0, 1, 0), (0, 1, 0), (1, 0, 0), (0, 1, 0), (1, 0, 0)],
    ),
}


@pytest.mark.parametrize("name", URDFS)
def test_forward_and_link_frames_are_those_of_the_published_urdf(name):
    joints = random_joints(500)
    rotation, position = forward(ARMS[name], joints)
    frames, origins = link_frames(ARMS[name], joints)
    assert np.array_equal(frames[:, 0], np.broadcast_to(np.eye(3), (500, 3, 3)))
    assert not origins[:, 0].any()
    pose = RigidTransform.identity(500)
    for i, (origin, axis) in enumerate(zip(*URDFS[name], strict=True), start=1):
        turn = Rotation.from_rotvec(joints[:, i - 1, None] * axis)
        pose = pose * RigidTransform.from_components(1000.0 * np.array(origin), turn)
        np.testing.assert_allclose(frames[:, i], pose.rotation.as_matrix(), atol=1e-14)
        # The same axis; where along it the frame sits is each package's own choice.
        along = np.cross(origins[:, i] - pose.translation, pose.rotation.apply(axis))
        np.testing.assert_allclose(along, 0.0, atol=1e-9)
    tool = pose.rotation * Rotation.from_euler("y", 90, degrees=True)
    np.testing.assert_allclose(rotation, tool.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(position, pose.translation, atol=1e-9)
    np.testing.assert_allclose(origins[:, 6], position, atol=1e-9)


@pytest.mark.parametrize("name", ALL)
def test_link_frames_and_landmarks_are_products_of_exponentials(name):
    """Each joint turns everything beyond it about its axis, taken where all joints are zero."""
    arm, joints = ALL[name], random_joints(200, seed=4)
    still = paper_frames_at_zero(arm)
    points = np.zeros((7, 3))
    steps = [(0, 0, arm.c1_mm), (arm.a1_mm, arm.b_mm, 0), (0, 0, arm.c2_mm), (arm.a2_mm, 0, 0)]
    steps += [(0, 0, arm.c3_mm), (0, 0, arm.c4_mm)]
    for i, (frame, step) in enumerate(zip((0, 1, 2, 3, 3, 6), steps, strict=True)):
        points[i + 1] = points[i] + still[frame].apply(step)
    on_axis = [points[1], points[2], points[3], points[5], points[5], points[5]]
    beyond = [2, 3, 4, 6, 6, 7]  # the first landmark that each joint moves
    pose = RigidTransform.identity(200)
    moved = np.tile(points, (200, 1, 1))
    frames, origins = link_frames(arm, joints)
    for i in range(6):
        axis = still[i].apply([0, 0, 1] if "zyyzyz"[i] == "z" else [0, 1, 0]) * arm.sign[i]
        turn = Rotation.from_rotvec(joints[:, i, None] * axis)
        pose = pose * RigidTransform.from_components(on_axis[i] - turn.apply(on_axis[i]), turn)
        np.testing.assert_allclose(frames[:, i + 1], pose.rotation.as_matrix(), atol=1e-14)
        for k in range(beyond[i], 7):
            moved[:, k] = pose.apply(points[k])
    np.testing.assert_allclose(landmarks(arm, joints), moved, atol=1e-9)
    np.testing.assert_allclose(origins, moved[:, [0, 1, 2, 3, 5, 5, 6]], atol=1e-9)
    rotation, position = forward(arm, joints)
    np.testing.assert_allclose(rotation, (pose.rotation * still[6]).as_matrix(), atol=1e-14)
    np.testing.assert_allclose(position, moved[:, 6], atol=1e-9)
    assert len(LANDMARKS) == 7


@pytest.mark.parametrize("name", ALL)
def test_at_zero_the_links_are_parallel_to_the_root(name):
    frames, _ = link_frames(ALL[name], np.zeros((1, 6)))
    np.testing.assert_allclose(frames, np.broadcast_to(np.eye(3), (1, 7, 3, 3)), atol=1e-15)


# ── inverse ──────────────────────────────────────────────────────────────────────────────────────


@each_arm
def test_the_branches_are_those_of_opw_kinematics(name):
    """20,000 poses an arm, 100,000 in all; a quarter of them anywhere, so also out of reach."""
    arm, n = ARMS[name], 20_000
    rng = np.random.default_rng(7)
    oracle = opw(arm)
    reachable = oracle.batch_forward(random_joints(3 * n // 4, seed=8))
    size = 1.3 * (arm.a1_mm + arm.c2_mm + arm.c3_mm)
    anywhere = RigidTransform.from_components(
        rng.uniform(-size, size, (n // 4, 3)), Rotation.random(n // 4, rng)
    )
    poses = RigidTransform.concatenate([reachable, anywhere])
    ours = inverse(arm, poses.rotation.as_matrix(), poses.translation)
    theirs = oracle.reach(poses).joints
    assert np.array_equal(np.isnan(ours), np.isnan(theirs))
    found = there(ours)
    assert 0.5 * found.size < np.count_nonzero(found) < found.size
    near = singularity(arm, ours[found])
    clear = (near.wrist_rad > 1e-4) & (near.elbow_rad > 1e-4) & (near.shoulder_mm > 1e-2)
    assert np.count_nonzero(clear) > 0.999 * len(clear)
    assert apart(ours[found], theirs[found])[clear].max() < 1e-9
    one = oracle.batch_inverse(poses)  # a solution a pose, NaN where it finds none
    solved = there(one)
    assert np.array_equal(solved, found.any(axis=1))
    off = apart(ours[solved], one[solved, None]).max(axis=2)
    assert np.nanmax(np.nanmin(off, axis=1)) < 1e-7  # of all, also those next to a singularity


@pytest.mark.parametrize("name", ALL)
def test_forward_undoes_inverse(name):
    arm = ALL[name]
    rotation, position = forward(arm, random_joints(20_000, seed=1))
    solutions = inverse(arm, rotation, position)
    assert_solves(arm, solutions, rotation, position)
    assert there(solutions).any(axis=1).all()


def assert_solves(arm, solutions, rotation, position):
    """All or nothing is NaN in a branch; the angles are canonical and give the pose back."""
    found = there(solutions)
    assert np.array_equal(np.isnan(solutions), np.broadcast_to(~found[..., None], solutions.shape))
    joints, pose = solutions[found], np.nonzero(found)[0]
    assert np.all((joints > -np.pi) & (joints <= np.pi))
    assert not np.any(np.signbit(joints) & (joints == 0.0)), "-0.0"
    turned, moved = forward(arm, joints)
    np.testing.assert_allclose(turned, rotation[pose], atol=5e-12)
    np.testing.assert_allclose(moved, position[pose], atol=1e-9)


@given(name=any_arm, joints=JOINTS, elbow=st.none() | st.sampled_from([0.0, np.pi]), near=NEAR)
def test_next_to_singularities_every_solution_holds_and_none_is_lost(name, joints, elbow, near):
    arm = ALL[name]
    if elbow is not None:  # stretched or folded: the edges of reach
        joints[2] = (elbow + near - arm.forearm_rad + arm.offset_rad[2]) * arm.sign[2]
    rotation, position = forward(arm, joints[None])
    solutions = inverse(arm, rotation, position)
    assert_solves(arm, solutions, rotation, position)
    folded_away = np.linalg.norm(np.diff(landmarks(arm, joints[None])[0, [2, 5]], axis=0)) < 1e-9
    if folded_away:
        return
    found = there(solutions)[0]
    assert found.any()
    assert np.array_equal(found[:4], found[4:])  # with both wrists, always
    at = singularity(arm, joints)
    if min(at.wrist_rad, at.elbow_rad) > 1e-5 and at.shoulder_mm > 1e-2:
        assert apart(solutions[0, found], joints).max(axis=1).min() < 1e-7


@given(name=any_arm, joints=JOINTS)
def test_a_branch_keeps_its_meaning(name, joints):
    """The bits of the index, seen in space: where wrist centre, elbow and flange are."""
    arm = ALL[name]
    solutions = inverse(arm, *forward(arm, joints[None]))[0]
    branches = np.flatnonzero(there(solutions))
    if not len(branches):
        return
    solutions = solutions[branches]
    _, column, shoulder, elbow, _, wrist, flange = landmarks(arm, solutions).swapaxes(0, 1)
    # The axis of joint 2, from joint 1 alone; those of 4, 5 and 6 move with links 3, 4 and 6.
    angle = arm.sign[0] * solutions[:, 0] - arm.offset_rad[0]
    sideways = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=-1)
    in_front = np.einsum("ij,ij->i", np.cross(sideways, [0, 0, 1]), wrist - column)
    bend = np.einsum("ij,ij->i", np.cross(elbow - shoulder, wrist - elbow), sideways)
    still, frames = paper_frames_at_zero(arm), link_frames(arm, solutions)[0]
    fourth = frames[:, 3] @ still[3].apply([0.0, 0.0, 1.0])
    fifth = frames[:, 4] @ still[4].apply([0.0, 1.0, 0.0])
    sixth = frames[:, 6] @ still[6].apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(wrist + arm.c4_mm * sixth, flange, atol=1e-9)
    tilt = np.einsum("ij,ij->i", np.cross(fourth, sixth), fifth)
    for bit, value, noise in ((2, in_front, 1e-6), (1, bend, 1e-3), (4, tilt, 1e-11)):
        assert np.all(value[branches & bit == 0] > -noise)
        assert np.all(value[branches & bit != 0] < noise)


def test_a_straight_wrist_has_both_its_branches():
    """Angle 4 is 0 or a half turn, and angle 6 does what is left; the library omits these."""
    arm = ARMS["kr150_r3100_2"]
    joints = np.array([[0.3, -1.5, 1.2, 0.7, 0.0, 0.4]])
    solutions = inverse(arm, *forward(arm, joints))[0]
    assert np.flatnonzero(there(solutions)).tolist() == [0, 1, 4, 5]  # it does not reach back
    same_arm = np.flatnonzero(np.abs(solutions - joints)[:, :3].max(axis=1) < 1e-9)
    assert same_arm.tolist() == [0, 4]
    np.testing.assert_allclose(solutions[0, 3:], [0.0, 0.0, 1.1], atol=1e-9)
    np.testing.assert_allclose(solutions[4, 3:], [np.pi, 0.0, 1.1 - np.pi], atol=1e-9)
    assert singularity(arm, solutions[[0, 4]]).wrist_rad.max() < 1e-12
    assert solutions[0, 3] == 0.0
    assert solutions[4, 3] == np.pi


def test_a_wrist_centre_on_axis_1_leaves_the_arm_where_it_is():
    for arm in (ARMS["irb2400_10"], UPRIGHT):
        rotation = Rotation.from_euler("y", 0.4).as_matrix()[None]
        position = np.array([[0.0, 0.0, 1300.0]]) if arm is not UPRIGHT else np.array([[0, 0, 900]])
        solutions = inverse(arm, rotation, position + arm.c4_mm * rotation[:, :, 2])
        assert there(solutions).all()
        np.testing.assert_allclose(solutions[0, [0, 1, 4, 5], 0], 0.0, atol=1e-12)
        np.testing.assert_allclose(solutions[0, [2, 3, 6, 7], 0], np.pi, atol=1e-12)
        assert singularity(arm, solutions).shoulder_mm.max() < 1e-9


def test_with_an_offset_b_the_wrist_centre_keeps_that_far_from_axis_1():
    rotation = np.eye(3)[None]
    for distance, reachable in ((44.9, False), (45.0, True), (45.1, True)):
        position = np.array([[0.0, distance, 1300.0 + ODD.c4_mm]])
        assert there(inverse(ODD, rotation, position)).any() == reachable


def test_the_edge_of_reach_forgives_rounding_and_nothing_more():
    arm = ARMS["irb6640_185_280"]
    farthest = arm.a1_mm + arm.c2_mm + arm.forearm_mm
    for beyond, reachable in ((-1e-3, True), (0.0, True), (5e-11, True), (1e-9, False)):
        position = np.array([[farthest + beyond, 0.0, arm.c1_mm + arm.c4_mm]])
        assert there(inverse(arm, np.eye(3)[None], position)).any() == reachable


def test_a_wrist_centre_on_the_shoulder_has_no_solution():
    """There joint 2 could be anything, and no machine can fold like that: all of it is NaN."""
    nothing = inverse(UPRIGHT, np.eye(3)[None], np.array([[0.0, 0.0, UPRIGHT.c1_mm]]))
    assert np.isnan(nothing).all()


@each_arm
def test_a_row_does_not_depend_on_the_others_nor_on_the_layout(name):
    """Equal to the last bit whatever the blocks, so that work can be cut up."""
    arm = ARMS[name]
    rotation, position = forward(arm, random_joints(5000, seed=2))
    rotation[17], position[4000] = np.nan, np.nan
    together = inverse(arm, rotation, position)
    assert np.isnan(together[[17, 4000]]).all()
    for first, last in ((0, 1), (17, 18), (2047, 2050), (1, 4096), (4999, 5000), (3, 3)):
        part = inverse(arm, rotation[first:last], position[first:last])
        assert np.array_equal(part, together[first:last], equal_nan=True)
    turned = np.ascontiguousarray(rotation.transpose(0, 2, 1)).transpose(0, 2, 1)
    again = inverse(arm, turned, np.asfortranarray(position))
    assert np.array_equal(again, together, equal_nan=True)
    columns = inverse_columns(arm, rotation, position)
    assert columns.shape == (8, 6, 5000)
    assert columns.flags.c_contiguous
    assert np.array_equal(columns.transpose(2, 0, 1), together, equal_nan=True)


# ── singularities ────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("name", ALL)
def test_the_distances_multiply_to_the_jacobians_determinant(name):
    """det J = c2 k · shoulder · sin(elbow) · sin(wrist), J by differences of forward at the wrist
    centre (moving the point along the flange does not change a determinant)."""
    arm, joints, step = ALL[name], random_joints(300, seed=5), 1e-6
    columns = []
    for i in range(6):
        ahead, behind = joints.copy(), joints.copy()
        ahead[:, i] += step
        behind[:, i] -= step
        (Ra, pa), (Rb, pb) = forward(arm, ahead), forward(arm, behind)
        turn = Rotation.from_matrix(Ra @ Rb.swapaxes(1, 2)).as_rotvec()
        columns.append(np.concatenate([pa - pb, turn], axis=1) / (2.0 * step))
    determinant = np.abs(np.linalg.det(np.stack(columns, axis=-1)))
    at = singularity(arm, joints)
    expected = arm.c2_mm * arm.forearm_mm * at.shoulder_mm * np.sin(at.elbow_rad)
    expected *= np.sin(at.wrist_rad)
    np.testing.assert_allclose(determinant, expected, atol=1e-5 * expected.max())
    assert at.wrist_rad.max() <= np.pi / 2
    assert at.elbow_rad.max() <= np.pi / 2


def test_singularities_of_any_shape_and_of_branches_that_are_not_there():
    arm = ARMS["kr6_r900_2"]
    at = singularity(arm, np.full((2, 8, 6), np.nan))
    assert at.wrist_rad.shape == at.elbow_rad.shape == at.shoulder_mm.shape == (2, 8)
    assert np.isnan(at.shoulder_mm).all()
    bent = singularity(arm, np.radians([0, -90, 90, 40, -175, 0]))
    assert np.degrees(bent.wrist_rad) == pytest.approx(5.0)

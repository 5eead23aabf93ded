"""KUKA's S and T and ABB's configuration data, bit by bit, against points along the arm.

The points come from a chain of scipy rotations: the wrist centre, the elbow and the shoulder are
looked at in space, no angle of the closed form is used. IK only gives the eight postures.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from drillc.catalogue import models
from drillc.kernels.arm import ArmGeometry, forward
from drillc.kernels.arm_inverse import inverse
from drillc.language.job import Floats
from drillc.postprocessors._configuration import (
    abb_cfx,
    abb_quadrants,
    kuka_status,
    kuka_turn,
)
from scipy.spatial.transform import Rotation

DECIMALS = 4
KUKA = ("kuka_kr210_r3100_2", "kuka_kr16_2", "kuka_kr240_r3330", "kuka_kr4_r600", "in_line")
ABB = ("abb_irb6640_185_280", "abb_irb1600_8_145", "abb_irb120_3_58")

#: By branch of `arm_inverse`, whose bits are elbow, shoulder, wrist.
STATUS = (2, 0, 3, 1, 6, 4, 7, 5)
CFX = (0, 2, 4, 6, 1, 3, 5, 7)


def geometry_of(name: str) -> ArmGeometry:
    if name == "in_line":  # no catalogue KUKA has axes 3 and 4 that meet
        return replace(models()["kuka_kr16_2"].geometry, a2_mm=0.0)
    return models()[name].geometry


def test_the_models_have_offsets_of_either_sign_and_none() -> None:
    for names in (KUKA, ABB):
        assert min(geometry_of(name).a2_mm for name in names) < 0.0
        assert any(geometry_of(name).a2_mm == 0.0 for name in names)
    assert max(geometry_of(name).a2_mm for name in KUKA) > 0.0


def seen(geometry: ArmGeometry, joints_rad: Floats) -> tuple[bool, bool]:
    """Of joints (6,): is the wrist centre behind axis 1, and is the elbow bent forward, as a man's
    knee bends back: by where axis 2, axis 3 and the wrist centre are in the arm's own plane."""
    t1, t2, t3, *_ = geometry.sign * joints_rad - geometry.offset_rad
    column = Rotation.from_rotvec([0.0, 0.0, t1])
    upper = column * Rotation.from_rotvec([0.0, t2, 0.0])
    lower = upper * Rotation.from_rotvec([0.0, t3, 0.0])
    shoulder = column.apply([geometry.a1_mm, geometry.b_mm, geometry.c1_mm])
    elbow = shoulder + upper.apply([0.0, 0.0, geometry.c2_mm])
    wrist = elbow + lower.apply([geometry.a2_mm, 0.0, geometry.c3_mm])
    ahead, aside = column.apply([1.0, 0.0, 0.0]), column.apply([0.0, 1.0, 0.0])
    return bool(wrist @ ahead < 0.0), bool(np.cross(elbow - shoulder, wrist - elbow) @ aside > 0.0)


def postures(geometry: ArmGeometry) -> Floats:
    """Joints (n, 8, 6): poses that all eight branches reach, no posture near a singularity."""
    random = np.random.default_rng(5)
    joints = random.uniform(-np.pi, np.pi, (1000, 6))
    branches = inverse(geometry, *forward(geometry, joints))
    found = branches[np.isfinite(branches).all(axis=(1, 2))]
    assert len(found) > 30
    return found[:40]


@pytest.mark.parametrize("name", KUKA)
def test_status_of_all_eight_branches(name: str) -> None:
    geometry = geometry_of(name)
    for branches in postures(geometry):
        assert kuka_status(geometry, branches, DECIMALS).tolist() == list(STATUS)
        for joints, status in zip(branches, STATUS, strict=True):
            behind, forward_elbow = seen(geometry, joints)
            assert status == behind + 2 * forward_elbow + 4 * (joints[4] < 0.0)


@pytest.mark.parametrize("name", ABB)
def test_cfx_of_all_eight_branches(name: str) -> None:
    geometry = geometry_of(name)
    for branches in postures(geometry):
        assert abb_cfx(geometry, branches, DECIMALS).tolist() == list(CFX)
        for joints, cfx in zip(branches, CFX, strict=True):
            behind, forward_elbow = seen(geometry, joints)
            assert cfx == 4 * behind + 2 * (not forward_elbow) + (joints[4] < 0.0)


def test_the_controllers_own_examples() -> None:
    """Both cells' usual home: in front, elbow up, wrist straight."""
    kuka = np.deg2rad([[0.0, -90.0, 90.0, 0.0, 0.0, 0.0]])
    assert kuka_status(geometry_of("kuka_kr210_r3100_2"), kuka, DECIMALS) == [2]
    assert kuka_turn(kuka, DECIMALS) == [2]
    abb = np.deg2rad([[0.0, 0.0, 0.0, 0.0, 30.0, 0.0]])
    assert abb_cfx(geometry_of("abb_irb6640_185_280"), abb, DECIMALS) == [0]
    assert abb_quadrants(abb, DECIMALS).tolist() == [[0, 0, 0]]


# ── where bit 1 changes ──────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("name", "stretched_deg"),
    [
        ("in_line", 0.0),
        ("kuka_kr210_r3100_2", np.degrees(np.arctan(115 / 1420))),  # the wrist above the elbow
        ("kuka_kr16_2", -np.degrees(np.arctan(35 / 670))),  # and below it
    ],
)
@pytest.mark.parametrize("a2_deg", [-30.0, -90.0, -140.0])
def test_the_elbow_of_a_kuka(name: str, stretched_deg: float, a2_deg: float) -> None:
    """Axes 2 and 3 and the wrist centre in line is the limit, wherever the arm leans."""
    joints = np.zeros((4, 6))
    joints[:, 1] = a2_deg
    joints[:, 2] = stretched_deg + np.array([-90.0, -1e-3, 1e-3, 90.0])
    bits = kuka_status(geometry_of(name), np.deg2rad(joints), DECIMALS) & 2
    assert bits.tolist() == [0, 0, 2, 2]


def test_where_axes_3_and_4_meet_zero_counts_as_positive() -> None:
    joints = np.zeros((3, 6))
    joints[:, 2] = np.deg2rad([0.0, -0.0, -1e-9])
    assert (kuka_status(geometry_of("in_line"), joints, DECIMALS) & 2).tolist() == [2, 2, 2]


@pytest.mark.parametrize("name", ABB)
@pytest.mark.parametrize("a2_deg", [-40.0, 0.0, 80.0])
def test_the_lower_arm_of_an_abb(name: str, a2_deg: float) -> None:
    geometry = geometry_of(name)
    stretched_deg = -90.0 - np.degrees(np.arctan(geometry.a2_mm / geometry.c3_mm))
    joints = np.zeros((4, 6))
    joints[:, 1] = a2_deg
    joints[:, 2] = stretched_deg + np.array([-90.0, -1e-3, 1e-3, 90.0])
    bits = abb_cfx(geometry, np.deg2rad(joints), DECIMALS) & 2
    assert bits.tolist() == [2, 2, 0, 0]


@pytest.mark.parametrize("name", [*KUKA, *ABB])
def test_axis_1_and_the_hand_do_not_change_the_arms_bits(name: str) -> None:
    geometry = geometry_of(name)
    random = np.random.default_rng(9)
    joints = random.uniform(-3.0, 3.0, (200, 6))
    turned = joints.copy()
    turned[:, [0, 3, 5]] = random.uniform(-6.0, 6.0, (200, 3))
    for computed in (kuka_status, abb_cfx):
        before = computed(geometry, joints, DECIMALS)
        np.testing.assert_array_equal(before, computed(geometry, turned, DECIMALS))


# ── signs and quadrants ──────────────────────────────────────────────────────────────────────────


def test_turn_of_every_combination_of_signs() -> None:
    for signs in itertools.product((1, -1), repeat=6):
        joints = np.array([signs]) * np.deg2rad([10.0, 20.0, 30.0, 190.0, 50.0, 340.0])
        binary = "".join("1" if sign < 0 else "0" for sign in reversed(signs))
        assert kuka_turn(joints, DECIMALS) == [int(binary, 2)]


@pytest.mark.parametrize("axis", range(6))
def test_a_joint_that_prints_as_zero_sets_no_bit(axis: int) -> None:
    joints_deg = np.zeros((5, 6))
    joints_deg[:, axis] = [0.0, -0.0, -1e-12, -0.00004, -0.0001]
    joints = np.deg2rad(joints_deg)
    assert kuka_turn(joints, DECIMALS).tolist() == [0, 0, 0, 0, 1 << axis]
    assert kuka_turn(joints, 3).tolist() == [0, 0, 0, 0, 0]


def test_a_wrist_that_prints_as_straight_is_not_flipped() -> None:
    joints = np.zeros((5, 6))
    joints[:, 4] = np.deg2rad([0.0, -0.0, -1e-12, -0.00004, -0.0001])
    status = kuka_status(geometry_of("kuka_kr16_2"), joints, DECIMALS)
    assert (status & 4).tolist() == [0, 0, 0, 0, 4]
    cfx = abb_cfx(geometry_of("abb_irb120_3_58"), joints, DECIMALS)
    assert (cfx & 1).tolist() == [0, 0, 0, 0, 1]


@pytest.mark.parametrize(
    ("angle_deg", "quadrant"),
    [
        (0.0, 0), (-0.0, 0), (1e-9, 0), (-1e-9, 0), (-0.00004, 0), (-0.0001, -1), (45.0, 0),
        (89.9999, 0), (89.99999, 1), (90.0, 1), (135.0, 1), (180.0, 2), (225.0, 2), (270.0, 3),
        (359.9999, 3), (360.0, 4), (400.0, 4), (-45.0, -1), (-90.0, -1), (-90.00001, -1),
        (-90.0001, -2), (-135.0, -2), (-180.0, -2), (-180.0001, -3), (-225.0, -3), (-270.0, -3),
        (-360.0, -4), (-400.0, -5),
    ],
)  # fmt: skip
def test_quadrants(angle_deg: float, quadrant: int) -> None:
    for column, axis in enumerate((0, 3, 5)):
        joints = np.full((1, 6), np.deg2rad(200.0))
        joints[0, axis] = np.deg2rad(angle_deg)
        expected = [2, 2, 2]
        expected[column] = quadrant
        assert abb_quadrants(joints, DECIMALS).tolist() == [expected]


def test_no_rows_and_whole_numbers() -> None:
    none, geometry = np.zeros((0, 6)), geometry_of("kuka_kr16_2")
    found = [kuka_status(geometry, none, 4), kuka_turn(none, 4), abb_cfx(geometry, none, 4)]
    assert [array.shape for array in found] == [(0,)] * 3
    assert abb_quadrants(none, 4).shape == (0, 3)
    one = np.zeros((1, 6))
    found = [kuka_status(geometry, one, 4), kuka_turn(one, 4), abb_cfx(geometry, one, 4)]
    assert {array.dtype for array in [*found, abb_quadrants(one, 4)]} == {np.dtype(np.int32)}

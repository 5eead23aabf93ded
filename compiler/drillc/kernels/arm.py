"""Ortho-parallel six-axis arms with a spherical wrist: their geometry and forward kinematics.

Source: Brandstötter, Angerer, Hofbaur: "An Analytical Solution of the Inverse Kinematics Problem of
Industrial Serial Manipulators with an Ortho-parallel Basis and a Spherical Wrist" (2014), with the
signs and the flange of ros-industrial's `opw_kinematics`.

With all paper angles zero the arm stands upright: the shoulder at (a1, b, c1), the elbow c2 above
it, the wrist centre a2 forward of the elbow and c3 above it, the flange c4 above that, every frame
parallel to the root's (x forward, z up). Joints 1, 4 and 6 turn about z, joints 2, 3 and 5 about y:

    root_from_flange = Rz(t1) Ry(t2 + t3) Rz(t4) Ry(t5) Rz(t6)

"The arm's plane" is the root's x, z plane turned by t1 (and shifted by b): joints 2 and 3 move the
wrist centre in it. Lengths are in mm, angles in radians. `arm_inverse.py` solves the other way.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .rotations import rotation_about

Floats = NDArray[np.float64]

#: The points that `landmarks` gives, in its order.
LANDMARKS = ("root", "column", "shoulder", "elbow", "forearm", "wrist", "flange")

#: The axis (1 y, 2 z) about which each joint turns.
_AXES = (2, 1, 1, 2, 1, 2)

_BLOCK = 1024


@dataclass(frozen=True, eq=False)
class ArmGeometry:
    """The seven dimensions (mm), and how the controller's joint angles relate to the paper's:
    theta_paper = sign * q - offset_rad, joint by joint, as in ros-industrial's `opw_kinematics`."""

    a1_mm: float
    a2_mm: float
    b_mm: float
    c1_mm: float
    c2_mm: float
    c3_mm: float
    c4_mm: float
    offset_rad: Floats  # (6,)
    sign: Floats  # (6,) of +1 and -1

    @property
    def forearm_mm(self) -> float:
        """The distance from the elbow's axis to the wrist centre."""
        return float(np.hypot(self.a2_mm, self.c3_mm))

    @property
    def forearm_rad(self) -> float:
        """By how much the elbow's offset a2 leans the wrist centre forward: psi3 in the paper."""
        return float(np.arctan2(self.a2_mm, self.c3_mm))

    @cached_property
    def paper_from_link(self) -> Floats:
        """Rotations (7, 3, 3) from the links' frames, which are parallel to the root's where the
        controller's joints are zero, to the paper's, which are where its own angles are."""
        turns = [np.eye(3)]
        for axis, offset_rad in zip(_AXES, self.offset_rad, strict=True):
            turns.append(rotation_about(axis, float(offset_rad)) @ turns[-1])
        return np.stack(turns)

    def paper_angles(self, joints_rad: Floats) -> Floats:
        """The paper's angles (..., 6) of the controller's joints (..., 6)."""
        paper: Floats = self.sign * joints_rad - self.offset_rad
        return paper


@dataclass(frozen=True, eq=False)
class Singularity:
    """How far joints (..., 6) are from each singularity; 0 in it. Shapes (...).

    wrist_rad: the bend of joint 5 away from straight or folded back, 0 to pi/2; at 0 the axes of
        joints 4 and 6 coincide.
    elbow_rad: likewise the angle between upper arm and elbow-to-wrist; at 0 the wrist centre is at
        the edge of its reach, outer or inner.
    shoulder_mm: the distance of the wrist centre from axis 1, in the arm's plane (so without b);
        at 0 joint 1 turns on the spot.
    """

    wrist_rad: Floats
    elbow_rad: Floats
    shoulder_mm: Floats


def forward(geometry: ArmGeometry, joints_rad: Floats) -> tuple[Floats, Floats]:
    """root_from_flange of joints (n, 6): rotation (n, 3, 3) and position (n, 3) in mm.

    The flange's z axis points away from the arm. NaN joints give NaN.
    """
    n = len(joints_rad)
    rotation, position_mm = np.empty((n, 3, 3)), np.empty((n, 3))
    for rows, axes, points in _chain(geometry, joints_rad):
        rotation[rows] = axes[6].transpose(2, 0, 1)
        position_mm[rows] = points[6].T
    return rotation, position_mm


def link_frames(geometry: ArmGeometry, joints_rad: Floats) -> tuple[Floats, Floats]:
    """root_from_link of joints (n, 6): rotations (n, 7, 3, 3) and origins (n, 7, 3) in mm.

    Link 0 is the root and stands still; link i moves with joint i. With all *controller* joints at
    zero every link's frame is parallel to the root's, as in the URDFs of ROS-Industrial's
    `kuka_experimental`. The origins lie on the joints' axes: of link 1 at the height c1, of 2 at
    the shoulder, of 3 at the elbow, of 4 and 5 at the wrist centre, of 6 at the flange.
    """
    n = len(joints_rad)
    rotation, origin_mm = np.empty((n, 7, 3, 3)), np.empty((n, 7, 3))
    turn = geometry.paper_from_link
    for rows, axes, points in _chain(geometry, joints_rad):
        frames = axes[:, :, 0, None] * turn[:, None, 0, :, None]
        for k in (1, 2):
            frames += axes[:, :, k, None] * turn[:, None, k, :, None]
        rotation[rows] = frames.transpose(3, 0, 1, 2)
        origin_mm[rows] = points[[0, 1, 2, 3, 5, 5, 6]].transpose(2, 0, 1)
    return rotation, origin_mm


def landmarks(geometry: ArmGeometry, joints_rad: Floats) -> Floats:
    """Points (n, 7, 3) along the arm's structure in the root's frame, mm, as `LANDMARKS` names.

    root: the origin. column: axis 1 at the height c1. shoulder: on axis 2, a1 forward and b aside
    of the column. elbow: on axis 3, c2 from the shoulder. forearm: where axis 4 begins, a2 beside
    the elbow. wrist: the wrist centre, c3 along axis 4. flange: c4 along axis 6. Link i reaches
    from point i to point i + 1, save that link 3 also spans the elbow's offset (points 3, 4, 5),
    that links 4 and 5 are at point 5, and that link 6 reaches from 5 to 6.
    """
    points_mm = np.empty((len(joints_rad), 7, 3))
    for rows, _, points in _chain(geometry, joints_rad):
        points_mm[rows] = points.transpose(2, 0, 1)
    return points_mm


def singularity(geometry: ArmGeometry, joints_rad: Floats) -> Singularity:
    """The distances of joints (..., 6) from the arm's singularities. NaN joints give NaN."""
    paper = geometry.paper_angles(np.asarray(joints_rad, dtype=np.float64))
    shoulder, elbow = paper[..., 1], paper[..., 2] + geometry.forearm_rad
    return Singularity(
        wrist_rad=_from_half_turn(paper[..., 4]),
        elbow_rad=_from_half_turn(elbow),
        shoulder_mm=np.abs(
            geometry.a1_mm
            + geometry.c2_mm * np.sin(shoulder)
            + geometry.forearm_mm * np.sin(shoulder + elbow)
        ),
    )


def _from_half_turn(angle_rad: Floats) -> Floats:
    """The distance of angles (...) from the nearest multiple of pi, rad."""
    return np.abs(angle_rad - np.pi * np.rint(angle_rad / np.pi))


def _chain(geometry: ArmGeometry, joints_rad: Floats) -> Iterator[tuple[slice, Floats, Floats]]:
    """Along the arm, for blocks of joints (n, 6) that fit the cache: the rows, and of these m rows

    axes (7, 3, 3, m): component, then axis, of the frames after joints 0 … 6 in the paper's
        convention (parallel to the root's where the paper's angles are zero);
    points (7, 3, m): the landmarks, mm.
    """
    paper = geometry.paper_angles(np.asarray(joints_rad, dtype=np.float64))
    for start in range(0, len(paper), _BLOCK):
        rows = slice(start, min(start + _BLOCK, len(paper)))
        angles = np.ascontiguousarray(paper[rows].T)
        axes = _axes(np.cos(angles), np.sin(angles))
        points = np.zeros((7, 3, angles.shape[1]))
        points[1, 2] = geometry.c1_mm
        points[2] = points[1] + geometry.a1_mm * axes[1, :, 0] + geometry.b_mm * axes[1, :, 1]
        points[3] = points[2] + geometry.c2_mm * axes[2, :, 2]
        points[4] = points[3] + geometry.a2_mm * axes[3, :, 0]
        points[5] = points[4] + geometry.c3_mm * axes[3, :, 2]
        points[6] = points[5] + geometry.c4_mm * axes[6, :, 2]
        yield rows, axes, points


def _axes(cos: Floats, sin: Floats) -> Floats:
    """The frames (7, 3, 3, m) of `_chain` from cos and sin (6, m) of the paper's angles."""
    axes = np.empty((7, 3, 3, cos.shape[1]))
    axes[0] = np.eye(3)[:, :, None]
    for joint, axis in enumerate(_AXES):
        before, after = axes[joint], axes[joint + 1]
        p, q = (axis + 1) % 3, (axis + 2) % 3
        c, s = cos[joint], sin[joint]
        after[:, axis] = before[:, axis]
        after[:, p] = c * before[:, p] + s * before[:, q]
        after[:, q] = c * before[:, q] - s * before[:, p]
    return axes

"""Two real arms in numbers of their own: where joints take the flange, and what bits say so.

It shares no code with drillc: chains of scipy's rotations, points of the arm in space, and for the
way back Newton's method. Lengths are mm, angles degrees.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Dimensions:
    """An arm as its maker draws it: `turned` says which joints count clockwise, `straight` where
    each joint stands with the arm stretched upwards."""

    a1: float
    a2: float
    c1: float
    c2: float
    c3: float
    c4: float
    turned: tuple[int, ...]
    straight: tuple[float, ...]


#: Published by the makers, and in ROS-Industrial's support packages.
KR210 = Dimensions(330.0, -115.0, 645.0, 1350.0, 1420.0, 240.0, (1, 4, 6), (0, -90, 0, 0, 0, 0))
IRB6640 = Dimensions(320.0, -200.0, 780.0, 1075.0, 1392.0, 200.0, (), (0, 0, -90, 0, 0, 0))


def _angles(arm: Dimensions, joints_deg: Sequence[float]) -> list[float]:
    signs = [-1.0 if i + 1 in arm.turned else 1.0 for i in range(6)]
    return [s * (q - at) for s, q, at in zip(signs, joints_deg, arm.straight, strict=True)]


def points(arm: Dimensions, joints_deg: Sequence[float]) -> dict[str, Array]:
    """Shoulder, elbow, wrist centre and flange in the root's frame, and some directions there."""
    q1, q2, q3, q4, q5, q6 = _angles(arm, joints_deg)
    column = Rotation.from_euler("Z", q1, degrees=True)
    upper = column * Rotation.from_euler("Y", q2, degrees=True)
    fore = upper * Rotation.from_euler("Y", q3, degrees=True)
    hand = fore * Rotation.from_euler("ZYZ", [q4, q5, q6], degrees=True)
    shoulder = column.apply([arm.a1, 0.0, arm.c1])
    elbow = shoulder + upper.apply([0.0, 0.0, arm.c2])
    wrist = elbow + fore.apply([arm.a2, 0.0, arm.c3])
    flange = wrist + hand.apply([0.0, 0.0, arm.c4])
    return {
        "shoulder": shoulder,
        "elbow": elbow,
        "wrist": wrist,
        "flange": flange,
        "flange turned": hand.as_matrix(),
        "forward": column.apply([1.0, 0.0, 0.0]),
        "aside": column.apply([0.0, 1.0, 0.0]),
    }


def root_from_flange(arm: Dimensions, joints_deg: Sequence[float]) -> Array:
    """(4, 4) in mm."""
    at = points(arm, joints_deg)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = at["flange turned"], at["flange"]
    return pose


def joints_near(arm: Dimensions, target: Array, start_deg: Sequence[float]) -> list[float]:
    """The joints that bring the flange to `target` (4, 4), found by Newton's steps from a near
    start: so the branch is the start's. Raises AssertionError where none are found."""
    joints = np.array(start_deg, dtype=np.float64)

    def missing(q: Array) -> Array:
        pose = root_from_flange(arm, q.tolist())
        turn = Rotation.from_matrix(target[:3, :3] @ pose[:3, :3].T).as_rotvec()
        return np.concatenate([target[:3, 3] - pose[:3, 3], 1000.0 * turn])

    for _ in range(50):
        error = missing(joints)
        if np.abs(error).max() < 1e-10:
            break
        slope = np.stack([missing(joints + step) - error for step in 1e-5 * np.eye(6)], axis=1)
        joints = joints - np.linalg.solve(slope / 1e-5, error)
    assert np.abs(missing(joints)).max() < 1e-6
    return joints.tolist()


def _behind(arm: Dimensions, joints_deg: Sequence[float]) -> bool:
    """Whether the wrist centre is behind axis 1."""
    at = points(arm, joints_deg)
    return float(at["wrist"] @ at["forward"]) < 0.0


def _elbow(arm: Dimensions, joints_deg: Sequence[float]) -> float:
    """Positive where the forearm hangs forward of the upper arm's line."""
    at = points(arm, joints_deg)
    turn = np.cross(at["elbow"] - at["shoulder"], at["wrist"] - at["elbow"])
    return float(turn @ at["aside"])


def status_and_turn(arm: Dimensions, joints_deg: Sequence[float]) -> tuple[int, int]:
    """KUKA's S and T."""
    status = _behind(arm, joints_deg) + 2 * (_elbow(arm, joints_deg) >= 0) + 4 * (joints_deg[4] < 0)
    return status, sum(2**i for i in range(6) if joints_deg[i] < 0.0)


def confdata(arm: Dimensions, joints_deg: Sequence[float]) -> tuple[int, int, int, int]:
    """ABB's cf1, cf4, cf6, cfx."""
    cfx = 4 * _behind(arm, joints_deg) + 2 * (_elbow(arm, joints_deg) < 0) + (joints_deg[4] < 0)
    cf1, cf4, cf6 = (int(joints_deg[i] // 90.0) for i in (0, 3, 5))
    return cf1, cf4, cf6, cfx

"""An arm for the walk: joints to points with scipy, poses to joints with py-opw-kinematics.

Nothing here is drillc's. Joints are in degrees as the controller counts them, lengths in mm, frames
as the arm's root has them: x forward, z up.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from py_opw_kinematics import KinematicModel, Robot
from scipy.spatial.transform import RigidTransform, Rotation

Array = np.ndarray


@dataclass(frozen=True)
class Arm:
    """An arm as its maker draws it. `sign` and `zero_deg` lead from the controller's angles to
    those that are zero with the arm stretched upwards: sign (q - zero)."""

    a1: float
    a2: float
    c1: float
    c2: float
    c3: float
    c4: float
    sign: tuple[int, ...]
    zero_deg: tuple[float, ...]
    limits_deg: tuple[tuple[float, float], ...]

    @property
    def low(self) -> Array:
        return np.array(self.limits_deg)[:, 0]

    @property
    def high(self) -> Array:
        return np.array(self.limits_deg)[:, 1]

    @cached_property
    def solver(self) -> Robot:
        offsets = tuple(float(s * z) for s, z in zip(self.sign, self.zero_deg, strict=True))
        flips = tuple(s < 0 for s in self.sign)
        dimensions = (self.a1, self.a2, 0.0, self.c1, self.c2, self.c3, self.c4)
        return Robot(KinematicModel(*dimensions, offsets, flips), degrees=True)

    def points(self, joints: Array) -> dict[str, Array]:
        """Of joints (n, 6): points (n, 3) along the arm, and the flange's rotation (n, 3, 3)."""
        angle = np.array(self.sign) * (joints - np.array(self.zero_deg))
        turn = Rotation.from_euler("Z", angle[:, :1], degrees=True)
        column = np.tile([0.0, 0.0, self.c1], (len(joints), 1))
        shoulder = column + turn.apply([self.a1, 0.0, 0.0])
        turn = turn * Rotation.from_euler("Y", angle[:, 1:2], degrees=True)
        elbow = shoulder + turn.apply([0.0, 0.0, self.c2])
        turn = turn * Rotation.from_euler("Y", angle[:, 2:3], degrees=True)
        forearm = elbow + turn.apply([self.a2, 0.0, 0.0])
        wrist = forearm + turn.apply([0.0, 0.0, self.c3])
        turn = turn * Rotation.from_euler("ZYZ", angle[:, 3:], degrees=True)
        return {
            "column": column,
            "shoulder": shoulder,
            "elbow": elbow,
            "forearm": forearm,
            "wrist": wrist,
            "flange": wrist + turn.apply([0.0, 0.0, self.c4]),
            "turn": turn.as_matrix(),
        }

    def branches(self, root_from_flange: Array) -> Array:
        """All joints (n, 8, 6) for flange poses (n, 4, 4), each from -180 to 180; NaN: none."""
        found = self.solver.reach(RigidTransform.from_matrix(root_from_flange)).joints
        return np.array((found + 180.0) % 360.0 - 180.0)

    def bend(self, joints: Array) -> Array:
        """How far the wrist (n,) is from straight, or from folded back."""
        angle = joints[..., 4] - self.zero_deg[4]
        return np.abs(angle - 180.0 * np.rint(angle / 180.0))

    def status_and_turn(self, joints: Array) -> tuple[int, int]:
        """KUKA's S and T of joints (6,), from where the arm's points lie: S bit 0: the wrist centre
        is behind axis 1; bit 1: the forearm hangs forward of the upper arm's line; bit 2: A5 is
        negative. T: a bit for each negative axis."""
        at = {name: values[0] for name, values in self.points(joints[None]).items()}
        around = np.radians(self.sign[0] * (joints[0] - self.zero_deg[0]))
        forward = np.array([np.cos(around), np.sin(around), 0.0])
        aside = np.array([-forward[1], forward[0], 0.0])
        upper, fore = at["elbow"] - at["shoulder"], at["wrist"] - at["elbow"]
        status = int(at["wrist"] @ forward < 0)
        status += 2 * int(np.cross(upper, fore) @ aside >= 0) + 4 * int(joints[4] < 0)
        return status, sum(1 << i for i in range(6) if joints[i] < 0)


#: Published by the maker (and in ROS-Industrial's support packages): KUKA KR 210 R3100-2.
KR210 = Arm(
    a1=330.0,
    a2=-115.0,
    c1=645.0,
    c2=1350.0,
    c3=1420.0,
    c4=240.0,
    sign=(-1, 1, 1, -1, 1, -1),
    zero_deg=(0.0, -90.0, 0.0, 0.0, 0.0, 0.0),
    limits_deg=((-185, 185), (-140, -5), (-120, 168), (-350, 350), (-122.5, 122.5), (-350, 350)),
)

"""Which of an arm's postures a pose means: KUKA's status and turn, ABB's configuration data.

A controller counts a joint's sign or quadrant from the value it is told, so every function here
first rounds the joints as they are printed (`decimals` of a degree): rounding noise about 0, and
-0.0, must not set a bit. Bits of the sides of axis 1 and of the elbow are read from the geometry.

Sources: Siemens, SINUMERIK ONE, NC programming (12/2019), STAT, which states KUKA's three bits with
figures; ABB, RAPID reference, data type `confdata`. That "behind the lower arm" is a side of the
lower arm itself agrees with the RAPID post of visose's Robots.
"""

from __future__ import annotations

import numpy as np
from drillc.kernels.arm import ArmGeometry
from drillc.language.job import Floats, Ints

_QUADRANT_DEG = 90.0


def kuka_status(geometry: ArmGeometry, joints_rad: Floats, decimals: int) -> Ints:
    """S (n,) of joints (n, 6).

    Bit 0: the wrist centre is behind axis 1 (overhead). Bit 1: the elbow is bent to the side of
    positive A3, or stretched; where axes 3 and 4 meet, that is A3 >= 0. Bit 2: A5 < 0.
    """
    printed_deg = _as_printed(joints_rad, decimals)
    wrist_mm, elbow = _sides(geometry, printed_deg)
    flipped = printed_deg[:, 4] < 0.0
    return (wrist_mm < 0.0) * np.int32(1) + (elbow >= 0.0) * np.int32(2) + flipped * np.int32(4)


def kuka_turn(joints_rad: Floats, decimals: int) -> Ints:
    """T (n,) of joints (n, 6): bit i - 1 is set where Ai is negative."""
    negative = _as_printed(joints_rad, decimals) < 0.0
    turn: Ints = negative @ (1 << np.arange(6, dtype=np.int32))
    return turn


def abb_quadrants(joints_rad: Floats, decimals: int) -> Ints:
    """cf1, cf4 and cf6 (n, 3) of joints (n, 6): the quarter turn in which axes 1, 4 and 6 are,
    0 from 0 to below 90 degrees, -1 from -90 to below 0."""
    printed_deg = _as_printed(joints_rad, decimals)[:, [0, 3, 5]]
    return np.floor(printed_deg / _QUADRANT_DEG).astype(np.int32)


def abb_cfx(geometry: ArmGeometry, joints_rad: Floats, decimals: int) -> Ints:
    """cfx (n,) of joints (n, 6), for six-axis arms without a parallel linkage.

    4 where the wrist centre is behind axis 1, plus 2 where it is behind the lower arm, plus 1 where
    axis 5 is negative. Behind the lower arm is a side of the arm itself, whichever way it leans.
    """
    printed_deg = _as_printed(joints_rad, decimals)
    wrist_mm, elbow = _sides(geometry, printed_deg)
    flipped = printed_deg[:, 4] < 0.0
    return (wrist_mm < 0.0) * np.int32(4) + (elbow < 0.0) * np.int32(2) + flipped * np.int32(1)


def _as_printed(joints_rad: Floats, decimals: int) -> Floats:
    """Degrees (n, 6), rounded, without -0.0."""
    joints_deg: Floats = np.rad2deg(joints_rad)
    return joints_deg.round(decimals) + 0.0


def _sides(geometry: ArmGeometry, joints_deg: Floats) -> tuple[Floats, Floats]:
    """The wrist centre's coordinate x (n,) in mm in the frame that turns with axis 1, and the sine
    (n,) of the angle at the elbow: 0 where axis 2, axis 3 and the wrist centre are in line.

    The line from axis 3 to the wrist centre is slanted by atan2(a2, c3) against the forearm, so
    the elbow is stretched at A3 = -atan2(a2, c3) of a KUKA, not at 0.
    """
    paper = geometry.paper_angles(np.deg2rad(joints_deg))
    shoulder_rad, elbow_rad = paper[:, 1], paper[:, 2] + geometry.forearm_rad
    wrist_mm = (
        geometry.a1_mm
        + geometry.c2_mm * np.sin(shoulder_rad)
        + geometry.forearm_mm * np.sin(shoulder_rad + elbow_rad)
    )
    return wrist_mm, np.sin(elbow_rad)

"""Inverse kinematics of ortho-parallel arms: all eight branches of every pose, in closed form.

The geometry, the conventions and the source are those of `arm.py`. Branch k of a pose is, by the
bits of k (the order of `opw_kinematics`' Rust port):

    bit 0  elbow     0: paper angle 3 plus psi3 is in [0, pi]    1: it is in [-pi, 0]
    bit 1  shoulder  0: the arm faces the wrist centre           1: it reaches back over itself
    bit 2  wrist     0: paper angle 5 is in [0, pi]              1: it is in [-pi, 0]

With elbow 0 the elbow is above the line from shoulder to wrist centre when the arm reaches forward,
and below it when it reaches backward. With shoulder 0 the wrist centre is in front of axis 1 in the
arm's plane (or on it), with shoulder 1 behind. psi3 is `ArmGeometry.forearm_rad`.

The paper takes arc functions of joint angles and then their sines again. Here sines and cosines are
carried along algebraically and each angle is taken once, at the end. What depends on the noise of
another angle near a singularity (2 on 3, 6 on 4) is computed *given* that angle, so that even there
the solution gives its pose back to rounding. The work is done column by column on blocks that fit
the cache; every row's result is independent of the others.
"""

from __future__ import annotations

import numpy as np

from .arm import ArmGeometry, Floats

# A wrist bent by less is straight. A thousand times the noise of a chain of matrix products, and
# still less than 1e-9 mm at the flange of any arm.
_STRAIGHT_RAD = 1e-12

# A wrist centre out of reach by less is at the edge of reach, and one nearer to axis 1 is on it.
_EDGE_MM = 1e-10

_TURN_RAD = 2.0 * np.pi

_BLOCK = 2048


def inverse(geometry: ArmGeometry, rotation: Floats, position_mm: Floats) -> Floats:
    """The joints (n, 8, 6) of all branches that put the flange at root_from_flange.

    rotation (n, 3, 3), orthonormal; position (n, 3) in mm. Branches in the module's order, angles
    in the controller's convention, in (-pi, pi] and never -0.0; limits are not applied. A branch
    that does not exist, or whose pose is NaN, is NaN throughout. Where the wrist is straight, paper
    angle 4 could be anything: it is 0, and pi in the branches with bit 2. Where the wrist centre is
    on axis 1 (and b is 0), paper angle 1 is 0, and pi in the branches with bit 1. How near a
    solution is to such places, `arm.singularity` tells.

    The result is a view of `inverse_columns`: the 48 numbers of a row lie far apart in memory.
    """
    return inverse_columns(geometry, rotation, position_mm).transpose(2, 0, 1)


def inverse_columns(geometry: ArmGeometry, rotation: Floats, position_mm: Floats) -> Floats:
    """What `inverse` gives, as it is computed: (8, 6, n), each joint of a branch contiguous."""
    rotation = np.asarray(rotation, dtype=np.float64)
    position_mm = np.asarray(position_mm, dtype=np.float64)
    n = len(position_mm)
    joints = np.empty((2, 2, 2, 6, n))  # by wrist, shoulder, elbow
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for start in range(0, n, _BLOCK):
            rows = slice(start, start + _BLOCK)
            axes = np.ascontiguousarray(rotation[rows].transpose(1, 2, 0))
            position = np.ascontiguousarray(position_mm[rows].T)
            _solve(geometry, axes, position, joints[..., rows])
    return joints.reshape(8, 6, n)


def _solve(geometry: ArmGeometry, axes: Floats, position_mm: Floats, joints: Floats) -> None:
    """One block of m poses: fills joints (2, 2, 2, 6, m) by wrist, shoulder and elbow.

    axes (3, 3, m): component, then axis, of the flange. Below, arrays have the leading shape
    (shoulder,) or (shoulder, elbow).
    """
    x, y, z = position_mm - geometry.c4_mm * axes[:, 2]  # the wrist centre
    cos_1, sin_1, ahead = _shoulder(geometry, x, y)
    lean = _elbow(geometry, ahead - geometry.a1_mm, z - geometry.c1_mm, joints[0])
    _wrist(geometry, axes, (cos_1, sin_1), lean, joints)
    present = 0.0 * lean[0][:, 0]  # 0, or NaN where the wrist centre is out of reach
    joints[0, :, :, 0] = _controller(geometry, 0, np.arctan2(sin_1, cos_1) + present)[:, None]
    joints[1, :, :, :3] = joints[0, :, :, :3]
    beyond = joints <= -np.pi
    if beyond.any():
        joints[beyond] = np.pi


def _shoulder(geometry: ArmGeometry, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
    """Joint 1 turns the arm's plane onto the wrist centre at x, y (m,).

    Returns cos and sin of paper angle 1 and the wrist centre's signed distance from axis 1 in the
    arm's plane, mm; each (2, m).
    """
    b = geometry.b_mm
    square = x * x + y * y
    distance = np.sqrt(square)
    ahead = np.sqrt(_inside((distance - abs(b)) * (distance + abs(b)), abs(b)))
    cos_1 = np.stack([b * y + ahead * x, b * y - ahead * x]) / square
    sin_1 = np.stack([ahead * y - b * x, -ahead * y - b * x]) / square
    on_axis = distance < _EDGE_MM
    if b == 0.0 and on_axis.any():
        cos_1[:, on_axis], sin_1[:, on_axis] = [[1.0], [-1.0]], 0.0
    return cos_1, sin_1, np.stack([ahead, -ahead])


def _elbow(
    geometry: ArmGeometry, ahead: Floats, above: Floats, joints: Floats
) -> tuple[Floats, Floats]:
    """Joints 2 and 3 by the triangle of shoulder, elbow and wrist centre.

    The wrist centre is `ahead` (2, m) and `above` (m,) of the shoulder, mm. Fills joints
    (2, 2, 6, m). Returns cos and sin (2, 2, m) of paper angles 2 and 3 together: how the forearm
    leans.
    """
    upper, fore = geometry.c2_mm, geometry.forearm_mm
    square = ahead * ahead + above * above
    reach = np.sqrt(np.where(square > 0.0, square, np.nan))
    # Differences of squares are taken as products, so that nothing cancels at the edges of reach.
    longest, shortest = upper + fore, abs(upper - fore)
    outer = _inside((longest - reach) * (longest + reach), longest)
    inner = _inside((reach - shortest) * (reach + shortest), shortest)
    # The wrist centre across the upper arm, and along it from the shoulder and from the elbow.
    across = _both(np.sqrt(outer * inner) / (2.0 * upper))
    along = ((square + (upper - fore) * longest) / (2.0 * upper))[:, None]
    beyond = along - upper
    ahead = ahead[:, None]
    sin_2, cos_2 = along * ahead - across * above, along * above + across * ahead
    bend = np.arctan2(across[:, 0], beyond[:, 0])
    joints[:, :, 1] = _controller(geometry, 1, np.arctan2(sin_2, cos_2))
    joints[:, :, 2] = _controller(geometry, 2, _both(bend), -geometry.forearm_rad)
    cos_psi, sin_psi = geometry.c3_mm / fore, geometry.a2_mm / fore
    sin_3, cos_3 = cos_psi * across - sin_psi * beyond, cos_psi * beyond + sin_psi * across
    scale = (1.0 / (fore * square))[:, None]
    return (cos_2 * cos_3 - sin_2 * sin_3) * scale, (sin_2 * cos_3 + cos_2 * sin_3) * scale


def _wrist(
    geometry: ArmGeometry,
    axes: Floats,
    plane: tuple[Floats, Floats],
    lean: tuple[Floats, Floats],
    joints: Floats,
) -> None:
    """Joints 4 to 6 from the flange's axes (3, 3, m) as the forearm sees them.

    plane: cos and sin (2, m) of paper angle 1. lean: of angles 2 and 3 together, (2, 2, m).
    """
    (cos_1, sin_1), (cos_23, sin_23) = plane, lean
    cos_1, sin_1, up = cos_1[:, None], sin_1[:, None], axes[2]
    ahead = (cos_1 * axes[0] + sin_1 * axes[1])[:, None]
    aside = (cos_1 * axes[1] - sin_1 * axes[0])[:, None]
    across = cos_23[:, :, None] * ahead - sin_23[:, :, None] * up
    out = sin_23 * ahead[:, :, 2] + cos_23 * up[2]  # along the forearm, of the flange's z
    bent = np.sqrt(across[:, :, 2] ** 2 + aside[:, :, 2] ** 2)
    cos_4, sin_4 = across[:, :, 2] / bent, aside[:, :, 2] / bent
    straight = bent < _STRAIGHT_RAD
    if straight.any():
        cos_4[straight], sin_4[straight] = 1.0, 0.0
    sin_6 = cos_4 * aside[:, :, 0] - sin_4 * across[:, :, 0]
    cos_6 = cos_4 * aside[:, :, 1] - sin_4 * across[:, :, 1]
    bend = np.arctan2(bent, out)
    joints[0, :, :, 3] = _controller(geometry, 3, np.arctan2(sin_4, cos_4))
    joints[0, :, :, 4] = _controller(geometry, 4, bend)
    joints[0, :, :, 5] = _controller(geometry, 5, np.arctan2(sin_6, cos_6))
    for half_turned in (3, 5):
        angle = joints[0, :, :, half_turned]
        np.subtract(angle, np.copysign(np.pi, angle), out=joints[1, :, :, half_turned])
    joints[1, :, :, 4] = _controller(geometry, 4, -bend)


def _inside(square: Floats, length_mm: float) -> Floats:
    """(length - d) (length + d), either sign, with d beyond the length by rounding put onto it and
    farther out NaN."""
    inside: Floats = np.maximum(square, 0.0)
    return np.where(square < -2.0 * length_mm * _EDGE_MM, np.nan, inside)


def _both(values: Floats) -> Floats:
    """Values (2, m) by shoulder to (2, 2, m) by shoulder and elbow, of which elbow 1's is minus."""
    return np.stack([values, -values], axis=1)


def _controller(
    geometry: ArmGeometry, joint: int, paper_rad: Floats, more_rad: float = 0.0
) -> Floats:
    """The controller's angles of a joint (from 0) whose paper angles are `paper_rad` + `more_rad`,
    the former in [-pi, pi]. In [-pi, pi], never -0.0."""
    sign = geometry.sign[joint]
    shift = sign * (geometry.offset_rad[joint] + more_rad) + 0.0
    angle: Floats = (shift + paper_rad) if sign > 0.0 else (shift - paper_rad)
    if shift != 0.0:
        angle -= _TURN_RAD * np.rint(angle * (1.0 / _TURN_RAD))
    return angle

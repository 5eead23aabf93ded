"""Rotation matrices, Euler angles of every sequence, and quaternions, over any leading shape.

One derivation serves all twelve sequences. With i the first axis, j the second, k the one left
over and e = +1 when (i, j, k) is a cyclic order of (x, y, z), else -1,

    R = R_i(a0) R_j(a1) R_m(a2)        m = k (Tait-Bryan) or m = i (proper Euler)

a0 and a1 are read from the row and the column that the third and the first rotation leave alone;
a2 is read from row j of R_i(-a0) R, which is row j of R_m(a2) *whatever* a0 is. So noise in a0
next to gimbal lock is taken back by a2 and the product stays R to rounding.

These are plain matrix conventions; which of them a controller uses is the controller's affair.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Inside this distance (as cos of the middle angle, or sin for proper sequences) from gimbal lock
# the third angle is set to 0. That alters the rotation by at most twice the distance, and it is a
# thousand times the noise of a chain of matrix products, so true lock always lands inside.
_LOCK = 1e-13

# Angles this close above -pi are printed as +pi, and quaternion components this small count as 0
# when a half turn's sign is chosen: otherwise rounding would decide between two equal answers.
_CRUMB = 1e-13

# cos and sin are snapped to 0 and ±1 below this: deg2rad(90) is 6e-17 short of a quarter turn.
_QUARTER = 1e-15

_BLOCK = 8192


class _Sequence(NamedTuple):
    first: int
    second: int
    left_over: int
    sign: float
    proper: bool


def _axes_of(sequence: str) -> tuple[int, int, int]:
    axes = tuple("xyz".find(letter) for letter in sequence)
    if len(axes) != 3 or -1 in axes or axes[0] == axes[1] or axes[1] == axes[2]:
        raise ValueError(
            f"{sequence!r} is not an Euler sequence: three of the letters x, y, z, "
            "no letter twice in a row"
        )
    return axes[0], axes[1], axes[2]


def _parse(sequence: str) -> _Sequence:
    first, second, third = _axes_of(sequence)
    sign = 1.0 if second == (first + 1) % 3 else -1.0
    return _Sequence(first, second, 3 - first - second, sign, third == first)


def canonical_angle(angle_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Angles in [-pi, pi], any shape, moved into (-pi, pi] and rid of -0.0."""
    return np.where(angle_rad < _CRUMB - np.pi, np.pi, angle_rad) + 0.0


def _cos_sin(angle_rad: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    cos, sin = np.cos(angle_rad), np.sin(angle_rad)
    quarter = (np.abs(cos) < _QUARTER) | (np.abs(sin) < _QUARTER)
    return np.where(quarter, np.rint(cos), cos) + 0.0, np.where(quarter, np.rint(sin), sin) + 0.0


def _turn_rows(R: NDArray[np.float64], axis: int, angle_rad: NDArray[np.float64]) -> None:
    """R becomes R_axis(angle) @ R, in place."""
    p, q = (axis + 1) % 3, (axis + 2) % 3
    cos, sin = (factor[..., None] for factor in _cos_sin(angle_rad))
    row_p, row_q = R[..., p, :].copy(), R[..., q, :].copy()
    # + 0.0: an exact quarter turn of the identity should not be littered with -0.0
    R[..., p, :] = cos * row_p - sin * row_q + 0.0
    R[..., q, :] = sin * row_p + cos * row_q + 0.0


def _identities(shape: tuple[int, ...]) -> NDArray[np.float64]:
    R = np.zeros((*shape, 3, 3))
    for axis in range(3):
        R[..., axis, axis] = 1.0
    return R


def _in_blocks(
    kernel: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    array: NDArray[np.float64],
    row: tuple[int, ...],
    out_row: tuple[int, ...],
) -> NDArray[np.float64]:
    """Apply kernel (m, *row) -> (m, *out_row) block by block: temporaries stay in the cache."""
    flat = array.reshape(-1, *row)
    out = np.empty((len(flat), *out_row))
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for start in range(0, len(flat), _BLOCK):
            out[start : start + _BLOCK] = kernel(flat[start : start + _BLOCK])
    return out.reshape(*array.shape[: array.ndim - len(row)], *out_row)


def rotation_about(axis: int, angle_rad: float) -> NDArray[np.float64]:
    """The (3, 3) rotation by angle_rad about axis 0 (x), 1 (y) or 2 (z), right-handed.

    Exact (entries 0 and ±1) for multiples of a quarter turn within ±2 turns.
    Raises ValueError for another axis.
    """
    if axis not in (0, 1, 2):
        raise ValueError(f"axis {axis} is not 0 (x), 1 (y) or 2 (z)")
    R = _identities(())
    _turn_rows(R, axis, np.asarray(angle_rad, dtype=np.float64))
    return R


def matrix_from_euler(angles_rad: ArrayLike, sequence: str) -> NDArray[np.float64]:
    """Angles (..., 3) in rad to R (..., 3, 3) = R_first(a0) @ R_second(a1) @ R_third(a2).

    sequence names the axes as written, e.g. "zyx" for R_z R_y R_x: intrinsic rotations in the
    written order. Raises ValueError for anything but the twelve sequences.
    """
    axes = _axes_of(sequence)

    def block(angles: NDArray[np.float64]) -> NDArray[np.float64]:
        R = _identities((len(angles),))
        for place in (2, 1, 0):
            _turn_rows(R, axes[place], angles[:, place])
        return R

    return _in_blocks(block, np.asarray(angles_rad, dtype=np.float64), (3,), (3, 3))


def euler_from_matrix(R: ArrayLike, sequence: str) -> NDArray[np.float64]:
    """Rotations (..., 3, 3) to canonical angles (..., 3) in rad, the inverse of matrix_from_euler.

    The middle angle is in [-pi/2, pi/2] (Tait-Bryan) or [0, pi] (proper), the others are in
    (-pi, pi], none is -0.0. In gimbal lock the third angle is 0. The angles give R back to 1e-12
    everywhere. NaN rows stay NaN. Raises ValueError for anything but the twelve sequences.

    The posture article's Step 4 is "zyx"; its cos(beta) = 0 case is the lock handled here.
    """
    order = _parse(sequence)
    return _in_blocks(
        lambda block: _euler_block(block, order), np.asarray(R, dtype=np.float64), (3, 3), (3,)
    )


def _euler_block(R: NDArray[np.float64], order: _Sequence) -> NDArray[np.float64]:
    i, j, k, sign, proper = order
    if proper:
        sin_0, cos_0 = R[:, j, i], -sign * R[:, k, i]
        distance = np.hypot(R[:, i, j], R[:, i, k])
        middle = np.arctan2(distance, R[:, i, i])
    else:
        sin_0, cos_0 = -sign * R[:, j, k], R[:, k, k]
        distance = np.hypot(R[:, i, i], R[:, i, j])
        middle = np.arctan2(sign * R[:, i, k], distance)
    locked = distance < _LOCK
    sin_0 = np.where(locked, sign * R[:, k, j], sin_0)
    cos_0 = np.where(locked, R[:, j, j], cos_0)
    # Row j of R_i(-a0) R, at column j (cos a2) and at the column that holds ± sin a2.
    length = np.hypot(sin_0, cos_0)
    turn_sin, turn_cos = sign * sin_0 / length, cos_0 / length
    column, sin_sign = (k, -sign) if proper else (i, sign)
    sin_2 = sin_sign * (turn_cos * R[:, j, column] + turn_sin * R[:, k, column])
    cos_2 = turn_cos * R[:, j, j] + turn_sin * R[:, k, j]
    out = np.empty((len(R), 3))
    out[:, 0] = canonical_angle(np.arctan2(sin_0, cos_0))
    out[:, 1] = middle + 0.0
    out[:, 2] = canonical_angle(np.where(locked, 0.0, np.arctan2(sin_2, cos_2)))
    return out


def kuka_abc_from_matrix(R: ArrayLike) -> NDArray[np.float64]:
    """R (..., 3, 3) to KUKA's A, B, C (..., 3) in rad: R = R_z(A) R_y(B) R_x(C)."""
    return euler_from_matrix(R, "zyx")


def matrix_from_kuka_abc(abc_rad: ArrayLike) -> NDArray[np.float64]:
    """KUKA's A, B, C (..., 3) in rad to R (..., 3, 3) = R_z(A) R_y(B) R_x(C)."""
    return matrix_from_euler(abc_rad, "zyx")


def _raw_quaternion(R: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 3, 3) to (m, 4): a multiple, of either sign, of the quaternion w, x, y, z.

    The matrix 4 q qT is linear in R. Its column with the largest diagonal entry is divided by
    the largest component of q, so nothing cancels (Shepperd's method).
    """
    xx, yy, zz = R[:, 0, 0], R[:, 1, 1], R[:, 2, 2]
    outer = np.empty((len(R), 4, 4))
    outer[:, 0, 0] = 1.0 + xx + yy + zz
    outer[:, 1, 1] = 1.0 + xx - yy - zz
    outer[:, 2, 2] = 1.0 - xx + yy - zz
    outer[:, 3, 3] = 1.0 - xx - yy + zz
    for p, q in ((0, 1), (1, 2), (2, 0)):
        w_term = R[:, q, p] - R[:, p, q]
        rest = 3 - p - q
        outer[:, 0, 1 + rest] = w_term
        outer[:, 1 + rest, 0] = w_term
        mixed = R[:, q, p] + R[:, p, q]
        outer[:, 1 + p, 1 + q] = mixed
        outer[:, 1 + q, 1 + p] = mixed
    largest = np.argmax(outer[:, range(4), range(4)], axis=1)
    column: NDArray[np.float64] = outer[np.arange(len(R)), largest]
    return column


def _quaternion_block(R: NDArray[np.float64]) -> NDArray[np.float64]:
    raw = _raw_quaternion(R)
    q: NDArray[np.float64] = raw / np.sqrt((raw * raw).sum(axis=1))[:, None]
    half_turn = np.abs(q[:, 0]) < _CRUMB
    q[half_turn[:, None] & (np.abs(q) < _CRUMB)] = 0.0
    # The first component that is not 0 decides the sign; only in a half turn can w be 0.
    leading = np.argmax(q != 0.0, axis=1)
    q[q[np.arange(len(q)), leading] < 0.0] *= -1.0
    np.add(q, 0.0, out=q)
    return q


def quaternion_from_matrix(R: ArrayLike) -> NDArray[np.float64]:
    """R (..., 3, 3) to unit quaternions (..., 4) in the order w, x, y, z, with a canonical sign.

    w > 0; for half turns (|w| < 1e-13, then written as 0) the first of x, y, z that is not 0 is
    positive. Never -0.0. NaN rows stay NaN.
    """
    return _in_blocks(_quaternion_block, np.asarray(R, dtype=np.float64), (3, 3), (4,))


def _matrix_block(q: NDArray[np.float64]) -> NDArray[np.float64]:
    w, x, y, z = (q / np.sqrt((q * q).sum(axis=1, keepdims=True))).T
    R = np.empty((len(q), 3, 3))
    R[:, 0, 0] = 1.0 - 2.0 * (y * y + z * z)
    R[:, 1, 1] = 1.0 - 2.0 * (x * x + z * z)
    R[:, 2, 2] = 1.0 - 2.0 * (x * x + y * y)
    R[:, 0, 1] = 2.0 * (x * y - w * z)
    R[:, 1, 0] = 2.0 * (x * y + w * z)
    R[:, 0, 2] = 2.0 * (x * z + w * y)
    R[:, 2, 0] = 2.0 * (x * z - w * y)
    R[:, 1, 2] = 2.0 * (y * z - w * x)
    R[:, 2, 1] = 2.0 * (y * z + w * x)
    return R


def matrix_from_quaternion(quaternion: ArrayLike) -> NDArray[np.float64]:
    """Quaternions (..., 4), w, x, y, z, of any length and sign, to R (..., 3, 3).

    A zero quaternion gives NaN.
    """
    return _in_blocks(_matrix_block, np.asarray(quaternion, dtype=np.float64), (4,), (3, 3))


def angle_between(Ra: ArrayLike, Rb: ArrayLike) -> NDArray[np.float64]:
    """The angle (...) in rad, 0 to pi, of the rotation from Ra to Rb, both (..., 3, 3).

    Accurate to rounding at both ends, where the arccos of a trace would lose half the digits.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        relative = np.swapaxes(np.asarray(Ra, dtype=np.float64), -1, -2) @ np.asarray(
            Rb, dtype=np.float64
        )
    q = _in_blocks(_raw_quaternion, relative, (3, 3), (4,))
    with np.errstate(invalid="ignore", over="ignore"):
        angle: NDArray[np.float64] = 2.0 * np.arctan2(
            np.sqrt((q[..., 1:] ** 2).sum(axis=-1)), np.abs(q[..., 0])
        )
    return angle

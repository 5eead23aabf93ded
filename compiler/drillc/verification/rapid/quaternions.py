"""Quaternions as they are printed, and the rotations that the controller makes of them.

An orientation is a list of four values q1 … q4, q1 the scalar; each is a number or one a lane.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from ..events import Floats
from .types import Value


def decimals(text: str) -> int:
    """How many decimals a number is printed with."""
    mantissa, _, exponent = text.lower().partition("e")
    _, _, fraction = mantissa.partition(".")
    return len(fraction) - int(exponent or 0)


def not_normalised(texts: Sequence[str]) -> str:
    """What is wrong with the length of a quaternion, as printed; nothing if the digits explain it:
    rounding to d decimals changes the length by at most 10^-d. Whole numbers are not rounded."""
    parts = [float(text) for text in texts]
    length = math.sqrt(sum(part * part for part in parts))
    digits = max(map(decimals, texts))
    if length == 1.0 or (digits > 0 and abs(length - 1.0) <= 1.0000001 * 10.0**-digits):
        return ""
    return f"the quaternion [{','.join(texts)}] has length {length:.8f}, not 1"


def check_columns(texts: Sequence[Sequence[str]], q: Floats) -> Iterator[tuple[int, str]]:
    """Rows whose quaternions (4, n) are not normalised as printed, and what is wrong."""
    digits = np.zeros(q.shape[1], dtype=np.int64)
    for column in texts:
        dots = [len(text) - text.rfind(".") - 1 if "." in text else 0 for text in column]
        digits = np.maximum(digits, np.array(dots))
    suspect = np.abs(np.sqrt((q * q).sum(axis=0)) - 1.0) > 10.0**-digits
    suspect |= (digits > 15) | (digits < 1)  # an exponent, or whole numbers
    for row in np.flatnonzero(suspect).tolist():
        if message := not_normalised([column[row].replace(" ", "") for column in texts]):
            yield row, message


def rotation(orient: Value) -> Floats:
    """Rotation matrices (1 or lanes, 3, 3) of an orientation, which is normalised first."""
    entries = entries_of(orient)
    lanes = max([len(e) for e in entries if isinstance(e, np.ndarray)], default=1)
    matrix = np.empty((lanes, 3, 3))
    for i, entry in enumerate(entries):
        matrix[:, i // 3, i % 3] = entry
    return matrix


def entries_of(orient: Value) -> list[Any]:
    """The nine entries of the rotation matrix, row by row."""
    w, x, y, z = orient
    s = 2.0 / (w * w + x * x + y * y + z * z)
    xs, ys, zs = x * s, y * s, z * s
    wx, wy, wz = w * xs, w * ys, w * zs
    xx, xy, xz = x * xs, x * ys, x * zs
    yy, yz, zz = y * ys, y * zs, z * zs
    return [
        1.0 - (yy + zz), xy - wz, xz + wy,
        xy + wz, 1.0 - (xx + zz), yz - wx,
        xz - wy, yz + wx, 1.0 - (xx + yy),
    ]  # fmt: skip


def turned(orient: Value, vector: Value) -> Value:
    """A vector [x, y, z] given in the turned frame, as it is outside."""
    if not any(isinstance(part, np.ndarray) or part != 0.0 for part in vector[:2]):
        return [entry * vector[2] for entry in axis_of(orient)]
    entries = entries_of(orient)
    return [
        entries[row] * vector[0] + entries[row + 1] * vector[1] + entries[row + 2] * vector[2]
        for row in (0, 3, 6)
    ]


def axis_of(orient: Value) -> list[Any]:
    """The z axis of the turned frame: the last column of the rotation matrix."""
    w, x, y, z = orient
    s = 2.0 / (w * w + x * x + y * y + z * z)
    xs, ys = x * s, y * s
    return [z * xs + w * ys, z * ys - w * xs, 1.0 - (x * xs + y * ys)]


def product(one: Value, two: Value) -> Value:
    """First turned by `one`, then, in what is turned so, by `two`; normalised."""
    a, b = _unit(one), _unit(two)
    return [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]


def inverse(orient: Value) -> Value:
    w, x, y, z = _unit(orient)
    return [w, -x, -y, -z]


def about(axis: int, degrees: Value) -> Value:
    """A turn about axis 0, 1 or 2."""
    half = np.radians(degrees) / 2.0
    orient: list[Any] = [plain(np.cos(half)), 0.0, 0.0, 0.0]
    orient[axis + 1] = plain(np.sin(half))
    return orient


def plain(value: Any) -> Value:
    """A number of numpy as one of Python; arrays stay."""
    return value if isinstance(value, np.ndarray) else float(value)


def _unit(orient: Value) -> Value:
    w, x, y, z = orient
    length = plain(np.sqrt(w * w + x * x + y * y + z * z))
    return [w / length, x / length, y / length, z / length]

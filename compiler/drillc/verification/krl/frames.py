"""Frames: X, Y, Z in mm and A, B, C in degrees, about z, then y, then x of what has turned so far.

Components are numbers, or one a lane. The product of two, KRL's `:`, is kept as matrices.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .words import EXTERNAL_AXES, FRAME, PLACE, STATUS

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Pose:
    """`rotation` (3, 3) or (lanes, 3, 3), None for none; `position_mm` (3,) or (lanes, 3). `said`:
    S, T and the external axes, as far as they are given."""

    rotation: Floats | None
    position_mm: Floats
    said: Mapping[str, Any] = field(default_factory=dict)

    def matrix(self) -> Floats:
        """The rotation as a matrix, whatever it is."""
        return np.eye(3) if self.rotation is None else self.rotation


def rotation_from(a_deg: Any, b_deg: Any, c_deg: Any) -> Floats:
    """Rz(A) Ry(B) Rx(C): (3, 3), or (lanes, 3, 3)."""
    a, b, c = np.broadcast_arrays(*(np.radians(angle) for angle in (a_deg, b_deg, c_deg)))
    ca, sa, cb, sb, cc, sc = np.cos(a), np.sin(a), np.cos(b), np.sin(b), np.cos(c), np.sin(c)
    matrix = np.empty((*a.shape, 3, 3))
    matrix[..., 0, 0] = ca * cb
    matrix[..., 0, 1] = ca * sb * sc - sa * cc
    matrix[..., 0, 2] = ca * sb * cc + sa * sc
    matrix[..., 1, 0] = sa * cb
    matrix[..., 1, 1] = sa * sb * sc + ca * cc
    matrix[..., 1, 2] = sa * sb * cc - ca * sc
    matrix[..., 2, 0] = -sb
    matrix[..., 2, 1] = cb * sc
    matrix[..., 2, 2] = cb * cc
    return matrix


def position_from(x: Any, y: Any, z: Any) -> Floats:
    """(3,), or (lanes, 3)."""
    if not any(isinstance(value, np.ndarray) for value in (x, y, z)):
        return np.array([x, y, z], dtype=np.float64)
    return np.stack(np.broadcast_arrays(x, y, z), axis=-1).astype(np.float64)


class Poses:
    """Makes poses of components, and keeps the last few: a hole is used in many moves."""

    _MOST = 16

    def __init__(self) -> None:
        self._known: dict[tuple[int, ...], tuple[list[Any], Pose]] = {}

    def of(self, value: Mapping[str, Any]) -> Pose:
        """The pose with these components, all of `FRAME`."""
        parts = [value[name] for name in FRAME]
        turns = any(isinstance(angle, np.ndarray) or angle != 0.0 for angle in parts[3:])
        said = {name: value[name] for name in (*STATUS, *EXTERNAL_AXES) if name in value}
        if not turns:
            return Pose(None, position_from(*parts[:3]), said)
        key = tuple(id(part) for part in parts)
        known = self._known.get(key)  # it holds the parts, so no id is used again
        if known is not None:
            return Pose(known[1].rotation, known[1].position_mm, said)
        pose = Pose(rotation_from(*parts[3:]), position_from(*parts[:3]), said)
        if len(self._known) >= self._MOST:
            self._known.pop(next(iter(self._known)))
        self._known[key] = (parts, pose)
        return pose


def product(left: Pose, right: Pose) -> Pose:
    """`left : right`: right, given in left. The result is of the type of the right operand, so what
    the left says of status and turn is gone."""
    position = right.position_mm
    if left.rotation is not None:
        position = _turned(left.rotation, position)
    if left.rotation is None or right.rotation is None:
        rotation = left.rotation if right.rotation is None else right.rotation
    else:
        rotation = left.rotation @ right.rotation
    return Pose(rotation, left.position_mm + position, right.said)


def _turned(rotation: Floats, position: Floats) -> Floats:
    """rotation @ position, without the axes that the position does not use."""
    used = [i for i in range(3) if np.any(position[..., i])]
    terms = [rotation[..., :, i] * position[..., i, None] for i in used]
    return sum(terms[1:], terms[0]) if terms else np.zeros(3)


def components(pose: Pose) -> dict[str, Any]:
    """X … C of a pose, and what it says beside them."""
    matrix = pose.matrix()
    b = np.arctan2(-matrix[..., 2, 0], np.hypot(matrix[..., 0, 0], matrix[..., 1, 0]))
    locked = np.hypot(matrix[..., 0, 0], matrix[..., 1, 0]) < 1e-12
    a = np.where(locked, 0.0, np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0]))
    # C from the row that A leaves as it is, whatever A is
    c = np.arctan2(
        np.sin(a) * matrix[..., 0, 2] - np.cos(a) * matrix[..., 1, 2],
        np.cos(a) * matrix[..., 1, 1] - np.sin(a) * matrix[..., 0, 1],
    )
    values: dict[str, Any] = {}
    for i, name in enumerate(PLACE):
        values[name] = _number(pose.position_mm[..., i])
    for name, angle in zip(FRAME[3:], (a, b, c), strict=True):
        values[name] = _number(np.degrees(angle))
    return {**values, **pose.said}


def _number(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else np.asarray(value)

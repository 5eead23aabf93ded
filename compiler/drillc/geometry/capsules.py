"""Capsules that come in any number and length: arm links, and the ways of single points."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .bvh import Body
from .field import DistanceField
from .polyhedra import inner, outer
from .shapes import Floats, capsule

HALVINGS = 6
STEP_MM = 1.0  # lengths and radii are rounded to this, so that few different bodies are needed
MOST_KEPT = 512


class Capsules:
    """Keeps the polyhedra around and inside capsules by their rounded length and radius."""

    def __init__(self) -> None:
        self._kept: dict[tuple[int, int], Body] = {}
        self._kept_inside: dict[tuple[int, int], Body | None] = {}

    def bodies(
        self, start_mm: Floats, end_mm: Floats, radius_mm: float
    ) -> tuple[Body, Body | None]:
        """A body around the capsule and one inside it (None for a thin one), both in place."""
        along = end_mm - start_mm
        length_mm = float(np.linalg.norm(along))
        turn = _from_z(along / length_mm) if length_mm > 0.0 else np.eye(3)
        outside = self._outside(int(length_mm / STEP_MM) + 1, int(radius_mm / STEP_MM) + 1)
        inside = self._inside(int(length_mm / STEP_MM), int(radius_mm / STEP_MM))
        outside.move(turn, start_mm)
        if inside is not None:
            inside.move(turn, start_mm)
        return outside, inside

    def _outside(self, length: int, radius: int) -> Body:
        if (length, radius) not in self._kept:
            if len(self._kept) >= MOST_KEPT:
                self._kept.clear()
            hull = capsule((0, 0, 0), (0, 0, length * STEP_MM), radius * STEP_MM)
            self._kept[length, radius] = Body(outer(hull).mesh)
        return self._kept[length, radius]

    def _inside(self, length: int, radius: int) -> Body | None:
        if (length, radius) not in self._kept_inside:
            if len(self._kept_inside) >= MOST_KEPT:
                self._kept_inside.clear()
            made = inner(capsule((0, 0, 0), (0, 0, length * STEP_MM), radius * STEP_MM))
            self._kept_inside[length, radius] = None if made is None else Body(made.mesh)
        return self._kept_inside[length, radius]


def near_capsules(
    field: DistanceField, start_mm: Floats, end_mm: Floats, radius_mm: Floats
) -> NDArray[np.bool_]:
    """Which capsules (n,) the field cannot tell to be clear: balls along each, ever smaller."""
    near = np.zeros(len(start_mm), dtype=np.bool_)
    number = np.arange(len(start_mm))
    for halving in range(HALVINGS + 1):
        half_mm = 0.5 * np.linalg.norm(end_mm - start_mm, axis=1)
        middle = 0.5 * (start_mm + end_mm)
        away = field.distance_mm(middle)
        near[number[away == 0.0]] = True
        rest = (away <= (half_mm + radius_mm) * (1.0 + 1e-9)) & ~near[number]
        # Smaller balls gain nothing where the field is coarser than they are.
        if halving == HALVINGS:
            near[number[rest]] = True
            break
        fine = rest & (half_mm < 0.5 * field.voxel_mm)
        near[number[fine]] = True
        rest &= ~near[number]
        number = np.concatenate([number[rest], number[rest]])
        start_mm, end_mm = (
            np.concatenate([start_mm[rest], middle[rest]]),
            np.concatenate([middle[rest], end_mm[rest]]),
        )
        radius_mm = np.concatenate([radius_mm[rest], radius_mm[rest]])
        if not len(number):
            break
    return near


def _from_z(direction: Floats) -> Floats:
    """A rotation (3, 3) that takes z to a unit direction (3,)."""
    across = np.cross(np.eye(3)[np.argmin(np.abs(direction))], direction)
    across /= np.linalg.norm(across)
    return np.column_stack([across, np.cross(direction, across), direction])

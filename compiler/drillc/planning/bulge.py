"""How far a curved part may rise between two holes, judged from what a job knows of it: normals.

The surface itself is not known. Between neighbours whose normals lean apart it is taken as a
circular arc: over a chord c, with normals turned by θ, an arc rises by c/2 · tan(θ/4); the tangents
at its ends meet at c/2 · tan(θ/2), which no convex curve between them exceeds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats


def turned_rad(axis: Floats) -> Floats:
    """The angle (n - 1,) between the tool axes (n, 3) of neighbours."""
    across = np.linalg.norm(axis[1:] - axis[:-1], axis=1)
    along = np.linalg.norm(axis[1:] + axis[:-1], axis=1)
    return np.asarray(2.0 * np.arctan2(across, along))


def rises(position_mm: Floats, axis: Floats) -> NDArray[np.bool_]:
    """Whether the part bulges towards the tool between neighbours (n - 1,).

    position (n, 3); axis (n, 3) the directions in which the tool works: each hole lies below the
    tangent plane of the other.
    """
    step = position_mm[1:] - position_mm[:-1]
    first = np.einsum("ij,ij->i", axis[:-1], step)
    second = np.einsum("ij,ij->i", axis[1:], step)
    return np.asarray((first > 0) & (second < 0))


def arc_rise_mm(position_mm: Floats, axis: Floats) -> Floats:
    """The likely rise (n - 1,) over the chord between neighbours: that of a circular arc."""
    return _rise(position_mm, axis, 0.25)


def greatest_rise_mm(position_mm: Floats, axis: Floats) -> Floats:
    """The rise (n - 1,) that no convex surface with these normals exceeds; infinite where the
    normals turn by half a turn."""
    return _rise(position_mm, axis, 0.5)


def _rise(position_mm: Floats, axis: Floats, share: float) -> Floats:
    chord = np.linalg.norm(position_mm[1:] - position_mm[:-1], axis=1)
    rise = 0.5 * chord * np.tan(np.minimum(turned_rad(axis) * share, 0.5 * np.pi - 1e-9))
    return np.where(rises(position_mm, axis), rise, 0.0)

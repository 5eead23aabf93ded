"""How often closed surfaces wind around a point: 0 outside, 1 inside a solid, 0 in its cavity."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .shapes import Floats, Mesh

# Rays run along z in a frame turned to no edge that a drawing is likely to hold: columns are the
# axes. (A quaternion of small primes, normalised; any would do.)
_GENERIC = np.array([[97.0, 34.0, 58.0], [58.0, 31.0, -98.0], [-46.0, 109.0, 7.0]])


class Windings:
    """Winding numbers of the closed surface of a mesh, its faces outward (a cavity's, inward)."""

    def __init__(self, mesh: Mesh) -> None:
        self._turn = np.linalg.qr(_GENERIC)[0]
        corner = (mesh.vertices_mm @ self._turn)[mesh.faces]
        self._corner = corner
        self._low = corner[:, :, :2].min(axis=1).T.copy()
        self._high = corner.max(axis=1).T.copy()

    def number(self, points_mm: Floats) -> NDArray[np.int64]:
        """The winding number (n,) at points (n, 3), by the crossings of a ray from each.

        Meaningless within rounding of the surface itself.
        """
        turned = np.atleast_2d(points_mm) @ self._turn
        return np.array([self._count(point) for point in turned], dtype=np.int64)

    def _count(self, point: Floats) -> int:
        near = np.flatnonzero(
            (self._low[0] <= point[0])
            & (self._high[0] >= point[0])
            & (self._low[1] <= point[1])
            & (self._high[1] >= point[1])
            & (self._high[2] >= point[2])
        )
        corner = self._corner[near] - point
        x, y, z = np.moveaxis(corner, -1, 0)
        # side[i] is exactly opposite for the two faces of an edge, so no ray slips between them.
        after = [1, 2, 0]
        side = x * y[:, after] - y * x[:, after]
        within = (side > 0.0).all(axis=1) | (side < 0.0).all(axis=1)
        area = side.sum(axis=1)
        # side[i] weighs the corner opposite to edge i.
        with np.errstate(divide="ignore", invalid="ignore"):
            height = (side * z[:, [2, 0, 1]]).sum(axis=1) / area
        crossed = within & (height > 0.0)
        return int(np.sign(area[crossed]).sum())

"""Standing solids prepared for queries: their surfaces, what is inside them, their trees."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .bvh import Body
from .polyhedra import inner, outer
from .probe import core
from .shapes import Floats, Mesh, RoundedHull, bounds_mm
from .topology import closed, components
from .winding import Windings

Bools = NDArray[np.bool_]


class StandingHull:
    """A rounded hull that stands still. `marks_mm` (1, 3) is a point of it."""

    def __init__(self, hull: RoundedHull) -> None:
        self.radius_mm = hull.radius_mm
        self.low_mm, self.high_mm = bounds_mm(hull)
        self._hull = hull
        self._outer = outer(hull)
        self._core = core(hull)
        self.outside = self._outer.mesh
        self.marks_mm = hull.points_mm[:1]

    @cached_property
    def inside(self) -> Mesh | None:
        """A closed surface that the solid contains, if it is thick enough to have one."""
        made = inner(self._hull)
        return None if made is None else made.mesh

    @cached_property
    def core_body(self) -> Body:
        return Body(self._core.mesh)

    def contains(self, points_mm: Floats) -> Bools:
        """Which points (n, 3) the polyhedron `outside` holds."""
        return _below(self._outer.planes, points_mm)

    def core_contains(self, points_mm: Floats) -> Bools:
        """Which points (n, 3) belong to the solid without its radius."""
        return _below(self._core.planes, points_mm)


class StandingMesh:
    """A mesh that stands still: its surface, and what its closed pieces enclose.

    `marks_mm` (p, 3) is a point of each connected piece of the surface.
    """

    def __init__(self, mesh: Mesh) -> None:
        self.radius_mm = 0.0
        self.low_mm, self.high_mm = bounds_mm(mesh)
        self.outside = self.inside = mesh
        piece = components(mesh.faces)
        _, first = np.unique(piece, return_index=True)
        self.marks_mm = mesh.vertices_mm[mesh.faces[first, 0]]
        solid = closed(mesh.faces, piece)[piece]
        self._windings = Windings(Mesh(mesh.vertices_mm, mesh.faces[solid]))

    @cached_property
    def core_body(self) -> Body:
        return Body(self.outside)

    def contains(self, points_mm: Floats) -> Bools:
        """Which points (n, 3) the closed pieces enclose."""
        return self._windings.number(points_mm) > 0

    core_contains = contains


Standing = StandingHull | StandingMesh


def standing(solid: RoundedHull | Mesh) -> Standing:
    """A solid of either kind, prepared."""
    return StandingMesh(solid) if isinstance(solid, Mesh) else StandingHull(solid)


def _below(planes: Floats, points_mm: Floats) -> Bools:
    return np.asarray((points_mm @ planes[:, :3].T <= planes[:, 3]).all(axis=1))

"""Rounded hulls as polyhedra: one that contains the hull, one that the hull contains."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from .shapes import Floats, Mesh, RoundedHull

# A radius below this is rounded with a cube instead of a ball: it stands out by less than 0.01 mm.
CUBE_BELOW_MM = 0.01

# What the polyhedron around a ball of radius 1 stands out by at most, by number of subdivisions.
# Two suffice because what falls between the outer and the inner polyhedron is decided by distance.
SUBDIVISIONS = 2
EXCESS = 0.0181

# Points nearer than this count as one; a hull thinner than this is thickened by it.
THIN_MM = 1e-3


@dataclass(frozen=True, eq=False)
class Polyhedron:
    """A closed convex mesh, and its faces' planes (p, 4): inside is plane[:3] @ p <= plane[3]."""

    mesh: Mesh
    planes: Floats


def outer(hull: RoundedHull, extra_mm: float = THIN_MM) -> Polyhedron:
    """A closed convex polyhedron that contains all points within `extra_mm` > 0 of the hull.

    It stands out from them by at most 1.81 % of radius + extra (0.73 times that, below 0.01 mm).
    """
    radius_mm = hull.radius_mm + extra_mm
    if radius_mm < CUBE_BELOW_MM:
        return _convex(_sums(hull.points_mm, radius_mm * _cube()))
    return _convex(_sums(hull.points_mm, radius_mm * (1.0 + EXCESS) * _ball()))


def inner(hull: RoundedHull) -> Polyhedron | None:
    """A closed convex polyhedron inside the hull; None where the hull is too thin to hold one.

    It stays within 1.81 % of the radius of the hull's own surface.
    """
    if hull.radius_mm >= CUBE_BELOW_MM:
        return _convex(_sums(hull.points_mm, hull.radius_mm * _ball()))
    spread = np.linalg.svd(hull.points_mm - hull.points_mm.mean(axis=0), compute_uv=False)
    return _convex(hull.points_mm) if len(spread) == 3 and spread[2] > THIN_MM else None


def _sums(points: Floats, around: Floats) -> Floats:
    return (points[:, None] + around).reshape(-1, 3)


def _cube() -> Floats:
    return np.array(np.meshgrid([-1.0, 1.0], [-1.0, 1.0], [-1.0, 1.0])).reshape(3, 8).T


@cache
def _ball(subdivisions: int = SUBDIVISIONS) -> Floats:
    """Points on the unit sphere: an icosahedron, each face halved along its edges."""
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = [[0.0, s, t * golden] for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    vertices = np.array([np.roll(c, k) for k in range(3) for c in corners])
    hull = _convex(vertices).mesh
    vertices, faces = hull.vertices_mm, hull.faces
    for _ in range(subdivisions):
        a, b, c = vertices[faces].swapaxes(0, 1)
        vertices = np.concatenate([vertices, a + b, b + c, c + a])
        hull = _convex(vertices / np.linalg.norm(vertices, axis=1, keepdims=True)).mesh
        vertices, faces = hull.vertices_mm, hull.faces
    return np.asarray(vertices / np.linalg.norm(vertices, axis=1, keepdims=True))


def _convex(points: Floats) -> Polyhedron:
    """The convex hull of points (k, 3), faces turned outward."""
    from scipy.spatial import ConvexHull  # takes longer to import than most specs to compile

    centre = points.mean(axis=0)
    hull = ConvexHull(points - centre)
    used, faces = np.unique(hull.simplices, return_inverse=True)
    faces = faces.reshape(-1, 3).astype(np.int64)
    a, b, c = (points[used][faces[:, i]] for i in range(3))
    normal = hull.equations[:, :3]
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), normal) < 0.0
    faces[inward] = faces[inward][:, ::-1]
    offset = normal @ centre - hull.equations[:, 3]
    planes = np.unique(np.column_stack([normal, offset]), axis=0)
    return Polyhedron(Mesh(points[used], faces), planes)

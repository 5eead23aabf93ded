"""Solids as data: convex shapes with rounded edges, and triangle meshes. All lengths in mm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class RoundedHull:
    """All points within `radius_mm` of the convex hull of `points_mm` (k, 3), k >= 1.

    A sphere is one point with a radius, a capsule two, a box eight without one.
    """

    points_mm: Floats
    radius_mm: float


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh: `vertices_mm` (v, 3), `faces` (f, 3) indices, normals outward."""

    vertices_mm: Floats
    faces: NDArray[np.int64]


def box(low_mm: ArrayLike, high_mm: ArrayLike) -> RoundedHull:
    """The box between two opposite corners (3,), parallel to the axes."""
    ends = np.array([low_mm, high_mm], dtype=np.float64)
    pick = np.indices((2, 2, 2)).reshape(3, 8).T
    return RoundedHull(ends[pick, np.arange(3)], 0.0)


def sphere(centre_mm: ArrayLike, radius_mm: float) -> RoundedHull:
    """A ball about a point (3,)."""
    return RoundedHull(np.array([centre_mm], dtype=np.float64), float(radius_mm))


def capsule(start_mm: ArrayLike, end_mm: ArrayLike, radius_mm: float) -> RoundedHull:
    """All points within a radius of the segment between two points (3,)."""
    return RoundedHull(np.array([start_mm, end_mm], dtype=np.float64), float(radius_mm))


def cylinder(
    start_mm: ArrayLike, end_mm: ArrayLike, radius_mm: float, sides: int = 32
) -> RoundedHull:
    """A cylinder between the centres (3,) of its flat ends, as the prism around it.

    The prism's edges stand out by radius (1 / cos(pi / sides) - 1): 0.5 % at 32 sides.
    """
    start, end = np.array(start_mm, dtype=np.float64), np.array(end_mm, dtype=np.float64)
    axis = (end - start) / np.linalg.norm(end - start)
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    angle_rad = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.outer(np.cos(angle_rad), across) + np.outer(np.sin(angle_rad), np.cross(axis, across))
    ring *= radius_mm / np.cos(np.pi / sides)
    return RoundedHull(np.concatenate([start + ring, end + ring]), 0.0)


def placed(hull: RoundedHull, rotation: ArrayLike, translation_mm: ArrayLike) -> RoundedHull:
    """The hull moved by to_from_its: rotation (3, 3), then translation (3,)."""
    turned = hull.points_mm @ np.asarray(rotation, dtype=np.float64).T
    return RoundedHull(turned + np.asarray(translation_mm, dtype=np.float64), hull.radius_mm)


def grown(hull: RoundedHull, by_mm: float) -> RoundedHull:
    """The hull and all points within a distance of it."""
    return RoundedHull(hull.points_mm, hull.radius_mm + by_mm)


def bounds_mm(solid: RoundedHull | Mesh) -> tuple[Floats, Floats]:
    """The lowest and highest coordinates (3,), (3,) of a solid."""
    points, radius_mm = (
        (solid.vertices_mm, 0.0) if isinstance(solid, Mesh) else (solid.points_mm, solid.radius_mm)
    )
    return points.min(axis=0) - radius_mm, points.max(axis=0) + radius_mm


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Several meshes as one; vertices and faces in the meshes' order."""
    starts = np.cumsum([0, *(len(mesh.vertices_mm) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices_mm for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]),
    )

"""Convex solids that contain all that a rounded hull passes through. Tool coordinates: the
spindle is the z axis through the origin."""

from __future__ import annotations

import numpy as np

from .shapes import Floats, RoundedHull

# An arc of this half angle or less is enclosed by three points, one beyond its middle.
ARC_HALF_RAD = np.pi / 12


def swept_along_z(hull: RoundedHull, low_mm: float, high_mm: float) -> RoundedHull:
    """Exactly what the hull passes through while it moves along z by low_mm to high_mm."""
    shift = np.array([[0.0, 0.0, low_mm], [0.0, 0.0, high_mm]])
    points = (hull.points_mm + shift[:, None]).reshape(-1, 3)
    return RoundedHull(_corners(points), hull.radius_mm)


def turned_about_z(hull: RoundedHull, half_angle_rad: float) -> RoundedHull:
    """A convex solid that contains the hull turned about z by every angle up to half_angle_rad
    either way; from pi on, a full turn.

    A point's way is an arc, cut into parts of half angle a <= 15 degrees; each part lies in the
    triangle of its ends and the point where the tangents there meet, 1 / cos(a) times as far out
    as the arc (3.6 % at most, less for small angles: a² / 2).
    """
    half_rad = min(float(half_angle_rad), np.pi)
    parts = max(1, int(np.ceil(half_rad / ARC_HALF_RAD - 1e-9)))
    step_rad = half_rad / parts
    ends = np.linspace(-half_rad, half_rad, parts + 1)
    middles = ends[:-1] + step_rad
    angle = np.concatenate([ends, middles])
    reach = np.concatenate([np.ones(parts + 1), np.full(parts, 1.0 / np.cos(step_rad))])
    x, y, z = hull.points_mm.T[:, :, None]
    cos, sin = reach * np.cos(angle), reach * np.sin(angle)
    points = np.stack([x * cos - y * sin, x * sin + y * cos, z + 0.0 * angle], axis=-1)
    return RoundedHull(_corners(points.reshape(-1, 3)), hull.radius_mm)


def _corners(points: Floats) -> Floats:
    """The points without doubles and, where there are many, without those inside their hull."""
    points = np.unique(points, axis=0)
    if len(points) <= 16:
        return points
    from scipy.spatial import ConvexHull, QhullError  # slow to import

    try:
        return points[np.sort(ConvexHull(points).vertices)]
    except QhullError:  # the points lie in a plane or on a line
        return points

"""Geometry by brute force, sharing no code with drillc: sums over triangles, linear programs."""

import numpy as np
from drillc.geometry.shapes import Mesh
from scipy.optimize import linprog, lsq_linear


def mesh_of(made):
    """A trimesh as a drillc mesh."""
    return Mesh(np.array(made.vertices, dtype=float), np.array(made.faces, dtype=np.int64))


def winding(mesh, points):
    """Winding numbers (n,) as solid angles (van Oosterom and Strackee 1983)."""
    result = []
    for point in points:
        a, b, c = (mesh.vertices_mm[mesh.faces[:, i]] - point for i in range(3))
        la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
        top = np.einsum("ij,ij->i", a, np.cross(b, c))
        bottom = la * lb * lc + (a * b).sum(1) * lc + (b * c).sum(1) * la + (c * a).sum(1) * lb
        result.append(np.arctan2(top, bottom).sum() / (2 * np.pi))
    return np.array(result)


def hull_distance_mm(hull, point):
    """How far a point is from a rounded hull, by least squares over its points' weights."""
    columns = (hull.points_mm - point).T
    scale = max(np.abs(columns).max(), 1.0)
    weight = 1e4  # of the row that makes the weights add up to one
    rows = np.vstack([columns / scale, np.full(columns.shape[1], weight)])
    wanted = np.array([0.0, 0.0, 0.0, weight])
    share = lsq_linear(rows, wanted, bounds=(0.0, np.inf), method="bvls", tol=1e-14).x
    share = share / share.sum()
    return max(np.linalg.norm(columns @ share) - hull.radius_mm, 0.0)


def in_hull(points, point, slack=1e-9):
    """Whether a point is a convex combination of points (k, 3), by a linear program."""
    scale = max(np.abs(points).max(), 1e-3)
    system = np.vstack([points.T / scale, np.ones(len(points))])
    wanted = np.append(point / scale, 1.0)
    # Minimise the total that the combination is off by.
    off = np.hstack([np.eye(4), -np.eye(4)])
    cost = np.append(np.zeros(len(points)), np.ones(8))
    found = linprog(cost, A_eq=np.hstack([system, off]), b_eq=wanted, method="highs")
    return found.status == 0 and found.fun <= slack


def spread(hull, rng, count):
    """Random points (count, 3) of a rounded hull, many of them at its rim."""
    weights = rng.dirichlet(np.full(len(hull.points_mm), 0.2), count)
    away = rng.normal(size=(count, 3))
    away *= (hull.radius_mm * rng.random(count) ** 0.2 / np.linalg.norm(away, axis=1))[:, None]
    return weights @ hull.points_mm + away

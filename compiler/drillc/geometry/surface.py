"""The nearest point of a surface mesh, and its normal there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .shapes import Floats, Mesh

Ints = NDArray[np.int64]

SMOOTH_RAD = np.pi / 6  # facets that meet at more than this meet at an edge of the part
BLOCK = 1 << 19  # pairs of a point and a triangle that are worked on at once
FIRST, ENOUGH = 8, 128  # triangles that are looked at for each point; for a far one at most
FAR = 10.0  # triangles' sizes
MOST_PARTS = 2_000_000
SIZES = 6  # triangles are kept apart by size down to 2^-6 of the common one's


@dataclass(frozen=True, eq=False)
class Closest:
    """For n points: how far the surface is, where it is nearest, and its unit normal there.

    The normal is that of a smooth surface through the mesh's corners: between a facet's corners it
    is interpolated, and a corner's is the mean of those facets around it that meet the facet's own
    at less than 30 degrees, weighted by their angles there. On a surface of radius r with edges e
    it is right to about (e / r)², where a facet's own is off by e / r.
    """

    distance_mm: Floats  # (n,)
    point_mm: Floats  # (n, 3)
    normal: Floats  # (n, 3)
    face: Ints  # (n,)


def closest(mesh: Mesh, points_mm: Floats) -> Closest:
    """The nearest point of a mesh to each of points (n, 3); all NaN (face -1) for a NaN point.

    Exact up to a distance of ten triangles' sizes. Farther away, the point may be that of a
    triangle beside the nearest, and farther by less than one triangle's size.
    """
    n = len(points_mm)
    found = Closest(
        np.full(n, np.inf), np.full((n, 3), np.nan), np.full((n, 3), np.nan), np.full(n, -1)
    )
    rows = np.flatnonzero(np.isfinite(points_mm).all(axis=1))
    for search in _searches(mesh.vertices_mm[mesh.faces]):
        search.improve(found, points_mm, rows)
    found.distance_mm[found.face < 0] = np.nan
    rows = np.flatnonzero(found.face >= 0)
    found.normal[rows] = _normals(mesh, found.face[rows], found.point_mm[rows])
    return found


@dataclass(frozen=True, eq=False)
class _Search:
    """Triangles (k, 3, 3) of about one size, parts of a mesh's faces (k,), and what they reach at
    most around their middles."""

    corner: Floats
    face: Ints
    reach_mm: float

    def improve(self, found: Closest, points_mm: Floats, rows: Ints) -> None:
        """Put in what these triangles have that is nearer to the points `rows`."""
        from scipy.spatial import cKDTree  # slow to import

        tree = cKDTree(self.corner.mean(axis=1))
        count = min(FIRST, len(self.corner))
        while len(rows):
            unsure = []
            for start in range(0, len(rows), max(1, BLOCK // count)):
                some = rows[start : start + max(1, BLOCK // count)]
                found_mm, found_part = tree.query(points_mm[some], k=count)
                middle_mm = np.reshape(found_mm, (-1, count))
                part = np.reshape(found_part, (-1, count))
                self._try(found, points_mm, some, middle_mm[:, :1], part[:, :1])
                self._try(found, points_mm, some, middle_mm[:, 1:], part[:, 1:])
                far = FAR * self.reach_mm if count >= ENOUGH else np.inf
                least = found.distance_mm[some]
                more = (middle_mm[:, -1] - self.reach_mm < least) & (least < far)
                unsure.append(some[more])
            if count == len(self.corner):
                break
            rows, count = np.concatenate(unsure), min(4 * count, len(self.corner))

    def _try(
        self, found: Closest, points_mm: Floats, rows: Ints, middle_mm: Floats, part: Ints
    ) -> None:
        """The same with certain triangles (n, c) for each row, their middles so far away."""
        # No triangle is nearer than its middle by more than its reach.
        row, column = np.nonzero(middle_mm - self.reach_mm < found.distance_mm[rows, None])
        if not len(row):
            return
        tried, point = part[row, column], points_mm[rows[row]]
        on = _on_triangles(self.corner[tried], point)
        distance = np.linalg.norm(on - point, axis=1)
        # The first of each row's nearest: rows stand together, and sorting keeps their order.
        order = np.lexsort((distance, row))
        best = order[np.concatenate([[True], row[order][1:] != row[order][:-1]])]
        best = best[distance[best] < found.distance_mm[rows[row[best]]]]
        target = rows[row[best]]
        found.distance_mm[target] = distance[best]
        found.point_mm[target] = on[best]
        found.face[target] = self.face[tried[best]]


def _searches(corner: Floats) -> list[_Search]:
    """Triangles (f, 3, 3), the great ones halved to about the size of the common ones, by size."""
    reach = _reach(corner)
    common = max(float(np.median(reach)), 1e-9)
    done_corner, done_face, face = [], [], np.arange(len(corner))
    parts = len(corner)
    while len(corner):
        great = _reach(corner) > 2.0 * common
        parts += int(np.count_nonzero(great))
        if parts > MOST_PARTS + len(reach):
            great[:] = False
        done_corner.append(corner[~great])
        done_face.append(face[~great])
        corner, face = _halved(corner[great]), np.tile(face[great], 2)
    corner, face = np.concatenate(done_corner), np.concatenate(done_face)
    reach = _reach(corner)
    size = np.floor(np.log2(np.maximum(reach / common, 2.0**-SIZES))).astype(np.int64)
    return [
        _Search(corner[size == s], face[size == s], float(reach[size == s].max()))
        for s in np.unique(size)
    ]


def _reach(corner: Floats) -> Floats:
    """How far triangles (f, 3, 3) reach around the mean of their corners, and a little more."""
    around = np.linalg.norm(corner - corner.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    return np.asarray(around * (1.0 + 1e-9) + 1e-12)


def _halved(corner: Floats) -> Floats:
    """The halves (2 f, 3, 3) of triangles cut across their longest edges, first halves first."""
    square = np.square(corner - corner[:, [1, 2, 0]]).sum(axis=2)
    first = np.argmax(square, axis=1)[:, None]
    turned = np.take_along_axis(corner, ((first + np.arange(3)) % 3)[:, :, None], axis=1)
    a, b, c = turned.swapaxes(0, 1)
    middle = 0.5 * (a + b)
    return np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])


def _on_triangles(corner: Floats, point: Floats) -> Floats:
    """The nearest points (…, 3) on triangles (…, 3, 3), which may be without area."""
    best = np.empty((*corner.shape[:-2], 3))
    least = np.full(corner.shape[:-2], np.inf)
    for i in range(3):
        start = corner[..., i, :]
        along = corner[..., (i + 1) % 3, :] - start
        length = np.maximum(np.einsum("...i,...i", along, along), 1e-300)
        share = np.clip(np.einsum("...i,...i", point - start, along) / length, 0.0, 1.0)
        on = start + share[..., None] * along
        square = np.square(on - point).sum(axis=-1)
        nearer = square < least
        best[nearer], least[nearer] = on[nearer], square[nearer]
    weight, over = _weights(corner, point)
    inner = (weight >= 0.0).all(axis=-1)
    foot = np.broadcast_to(point, best.shape) - over
    best[inner] = foot[inner]
    return best


def _weights(corner: Floats, point: Floats) -> tuple[Floats, Floats]:
    """A point as weights (…, 3) of a triangle's corners, and what it is off their plane (…, 3).

    NaN for a triangle without area.
    """
    a, b, c = np.moveaxis(corner, -2, 0)
    ab, ac, ap = b - a, c - a, point - a
    normal = np.cross(ab, ac)
    square = np.einsum("...i,...i", normal, normal)
    square = np.where(square > 0.0, square, np.nan)
    second = np.einsum("...i,...i", np.cross(ap, ac), normal) / square
    third = np.einsum("...i,...i", np.cross(ab, ap), normal) / square
    over = normal * (np.einsum("...i,...i", ap, normal) / square)[..., None]
    return np.stack([1.0 - second - third, second, third], axis=-1), over


def _normals(mesh: Mesh, face: Ints, point: Floats) -> Floats:
    """Interpolated unit normals (n, 3) at points on faces (n,)."""
    corner = mesh.vertices_mm[mesh.faces]
    facet = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    facet = facet / np.maximum(np.linalg.norm(facet, axis=1, keepdims=True), 1e-300)
    used = np.unique(face)
    at_corner = _corner_normals(mesh, corner, facet, used)[np.searchsorted(used, face)]
    weight, _ = _weights(corner[face], point)
    weight = np.clip(np.where(np.isnan(weight), 1.0 / 3.0, weight), 0.0, 1.0)
    normal = np.einsum("nk,nkx->nx", weight, at_corner)
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.asarray(np.where(size > 1e-9, normal / np.maximum(size, 1e-9), facet[face]))


def _corner_normals(mesh: Mesh, corner: Floats, facet: Floats, used: Ints) -> Floats:
    """Normals (k, 3, 3) at the three corners of the faces `used` (k,), smooth across flat edges."""
    angle = np.stack([_angle(corner, i) for i in range(3)], axis=1).ravel()
    vertex = mesh.faces.ravel()
    order = np.argsort(vertex, kind="stable")  # all corners, by the vertex they are at
    first = np.searchsorted(vertex[order], np.arange(len(mesh.vertices_mm) + 1))
    at = mesh.faces[used].ravel()
    count = first[at + 1] - first[at]
    own = np.repeat(np.arange(len(at)), count)
    before = np.cumsum(count) - count
    other = order[np.arange(len(own)) - np.repeat(before - first[at], count)]
    own_facet = facet[used[own // 3]]
    smooth = np.einsum("ij,ij->i", own_facet, facet[other // 3]) >= np.cos(SMOOTH_RAD)
    share = np.where(smooth, angle[other], 0.0)[:, None] * facet[other // 3]
    total = np.stack([np.bincount(own, share[:, k], minlength=len(at)) for k in range(3)], axis=1)
    size = np.linalg.norm(total, axis=1, keepdims=True)
    mean = np.where(size > 0.0, total / np.maximum(size, 1e-300), np.repeat(facet[used], 3, axis=0))
    return np.asarray(mean.reshape(-1, 3, 3))


def _angle(corner: Floats, i: int) -> Floats:
    """The angle (f,) of each triangle at its corner i."""
    first = corner[:, (i + 1) % 3] - corner[:, i]
    second = corner[:, (i + 2) % 3] - corner[:, i]
    across = np.linalg.norm(np.cross(first, second), axis=1)
    return np.asarray(np.arctan2(across, np.einsum("ij,ij->i", first, second)))

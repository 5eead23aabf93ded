"""A grid around solids: at any point, a distance that they are certainly away, and which side of
their surfaces it is on. Built once, asked millions of times."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .shapes import Floats, Mesh, joined

OUTSIDE, INSIDE, UNSURE = 0, 1, 2

# At most this many voxels: 4 bytes of distance and 1 of side each, and while building 40 more.
MOST_VOXELS = 2_500_000
MOST_ALONG = 600  # one axis: a long thin solid needs no finer grid than a bulky one
SMALLEST_MM = 0.5
MARGIN = 2  # voxels around the solids, so that all outside hangs together

HALF_DIAGONAL = 0.5 * 3.0**0.5 * (1.0 + 1e-9)  # of a voxel of edge 1


@dataclass(frozen=True, eq=False)
class DistanceField:
    """Voxels of edge `voxel_mm`; number 0, 0, 0 begins at `origin_mm` (3,).

    away_mm (a, b, c): no solid is nearer to the voxel's centre. side (a, b, c): whether the voxel
    is wholly OUTSIDE all solids, wholly INSIDE one, or UNSURE, because a surface is in or near it.
    """

    origin_mm: Floats
    voxel_mm: float
    away_mm: NDArray[np.float32]
    side: NDArray[np.int8]

    def distance_mm(self, points_mm: Floats) -> Floats:
        """A lower bound (n,) of the distance from points (n, 3) to the solids; 0 inside.

        Short of the truth by at most 3.5 voxels, and within the grid by about two.
        """
        voxel, outside = self._voxel(points_mm)
        away = self.away_mm.ravel()[voxel.flat]
        # Beyond the grid its nearest point q is at a right angle or more from all solids:
        # |p - s|² >= |p - q|² + |q - s|².
        within = np.maximum(away - voxel.off_centre_mm, 0.0)
        return np.sqrt(within * within + outside)

    def side_of(self, points_mm: Floats) -> NDArray[np.int8]:
        """OUTSIDE, INSIDE or UNSURE, for points (n, 3)."""
        voxel, outside = self._voxel(points_mm)
        side = self.side.ravel()[voxel.flat]
        return np.where(outside > 0.0, np.int8(OUTSIDE), side)

    def _voxel(self, points_mm: Floats) -> tuple[_Voxel, Floats]:
        """Where the nearest points of the grid are in it, and the squared distance to them."""
        shape = self.away_mm.shape
        flat: NDArray[np.int64] = np.zeros(len(points_mm), dtype=np.int64)
        off_centre, outside = np.zeros(len(points_mm)), np.zeros(len(points_mm))
        for axis in range(3):
            at = (points_mm[:, axis] - self.origin_mm[axis]) / self.voxel_mm
            held = np.clip(at, 0.0, shape[axis])
            number = np.minimum(held.astype(np.int64), shape[axis] - 1)
            flat = flat * shape[axis] + number
            off_centre += np.square(held - (number + 0.5))
            outside += np.square(at - held)
        return (
            _Voxel(flat, self.voxel_mm * np.sqrt(off_centre)),
            self.voxel_mm * self.voxel_mm * outside,
        )


@dataclass(frozen=True, eq=False)
class _Voxel:
    flat: NDArray[np.int64]
    off_centre_mm: Floats


def distance_field(
    surfaces: Sequence[Mesh], inside: Callable[[Floats], NDArray[np.bool_]]
) -> DistanceField:
    """The field of solids bounded by the surfaces; `inside` tells of points (n, 3) off the
    surfaces whether they are in a solid. It is asked once per region that the surfaces cut off.
    """
    from scipy import ndimage  # slow to import

    surface = joined(surfaces)
    used = surface.vertices_mm[np.unique(surface.faces)]
    low, high = used.min(axis=0), used.max(axis=0)
    voxel_mm = _voxel_mm(high - low)
    origin = low - MARGIN * voxel_mm
    shape = tuple(np.ceil((high - low) / voxel_mm).astype(int) + 2 * MARGIN)
    touched = _touched(surface, origin, voxel_mm, shape)
    side = np.where(touched, np.int8(UNSURE), np.int8(OUTSIDE))
    region, _ = ndimage.label(~touched)
    for number, part in enumerate(ndimage.find_objects(region), start=1):
        own = region[part] == number
        first = [s.start for s in part] + np.argwhere(own)[0]
        centre = origin + (first + 0.5) * voxel_mm
        if inside(centre[None])[0]:
            side[part][own] = INSIDE
    away = _away(touched, voxel_mm)
    away[side != OUTSIDE] = 0.0
    return DistanceField(origin, voxel_mm, away, side)


def _voxel_mm(extent_mm: Floats) -> float:
    """The edge with which a box of the given extent (3,) keeps to the bounds above."""
    low_mm = max(float(extent_mm.max()) / MOST_ALONG, SMALLEST_MM)
    high_mm = max(low_mm, float(extent_mm.max()) + 1.0)
    for _ in range(40):
        middle = 0.5 * (low_mm + high_mm)
        if np.prod(np.ceil(extent_mm / middle) + 2 * MARGIN) <= MOST_VOXELS:
            high_mm = middle
        else:
            low_mm = middle
    return high_mm


def _touched(
    surface: Mesh, origin: Floats, voxel_mm: float, shape: tuple[int, ...]
) -> NDArray[np.bool_]:
    """The voxels that a surface passes through, and some of their neighbours."""
    touched = np.zeros(shape, dtype=np.bool_)
    reach = 0.5  # voxels
    for points in _samples((surface.vertices_mm - origin) / voxel_mm, surface.faces, reach):
        # What the surface passes through is within `reach` of a sample, so in one of the (at
        # most eight) voxels of the cube around it.
        ends = np.stack([points - reach, points + reach]).astype(np.int64)
        for x in (0, 1):
            for y in (0, 1):
                for z in (0, 1):
                    touched[ends[x, :, 0], ends[y, :, 1], ends[z, :, 2]] = True
    return touched


def _samples(vertices: Floats, faces: NDArray[np.int64], reach: float) -> Iterator[Floats]:
    """Points (k, 3) on the faces, in blocks, so that all of a face is within reach of its own.

    A triangle is cut into n² like ones. No point of a triangle is farther from the nearest corner
    than the longest edge over the root of three.
    """
    corner = vertices[faces]
    edges = corner - corner[:, [1, 2, 0]]
    longest = np.sqrt(np.square(edges).sum(axis=2).max(axis=1))
    cuts = np.maximum(np.ceil(longest * (1.0 + 1e-9) / (reach * 3.0**0.5)), 1.0).astype(np.int64)
    # Few different numbers of cuts: powers of the root of two, rounded up.
    cuts = np.ceil(2.0 ** (np.ceil(2.0 * np.log2(cuts)) / 2.0) - 1e-9).astype(np.int64)
    for n in np.unique(cuts):
        i, j = np.divmod(np.arange((n + 1) ** 2), n + 1)
        keep = i + j <= n
        weight = np.stack([i[keep], j[keep], n - i[keep] - j[keep]], axis=1) / n
        chosen = corner[cuts == n]
        block = max(1, 1_000_000 // len(weight))
        for start in range(0, len(chosen), block):
            yield np.einsum("wk,fkx->fwx", weight, chosen[start : start + block]).reshape(-1, 3)


def _away(touched: NDArray[np.bool_], voxel_mm: float) -> NDArray[np.float32]:
    """From each voxel's centre, how far the surface in the touched ones certainly is."""
    from scipy import ndimage  # slow to import

    nearest = ndimage.distance_transform_edt(~touched, return_distances=False, return_indices=True)
    away = np.empty(touched.shape, dtype=np.float32)
    axes = [np.arange(size, dtype=np.float32) for size in touched.shape]
    for slab in range(len(away)):
        square = np.square(nearest[0, slab] - axes[0][slab])
        square = square + np.square(nearest[1, slab] - axes[1][:, None])
        square = square + np.square(nearest[2, slab] - axes[2])
        # The surface may be anywhere in the nearest voxel that it touches; 1e-6 covers float32.
        centre_mm = voxel_mm * (np.sqrt(square) * (1.0 - 1e-6) - HALF_DIAGONAL)
        away[slab] = np.maximum(centre_mm, 0.0)
    return away

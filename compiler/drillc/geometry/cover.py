"""A mesh as convex pieces that together contain it, inside and all.

A solid is cut by planes parallel to the axes, where that saves most volume. The piece of a cell
is the convex hull of what the cell holds of the solid: its corners are vertices of the surface
clipped to the cell, or corners of the cell that are inside the solid.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .shapes import Floats, Mesh, RoundedHull
from .topology import closed, components, volume_mm3
from .winding import Windings

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

MOST_PIECES = 48
WORTH = 0.003  # a cut must save this share of the whole hull's volume
CUTS = (0.25, 0.5, 0.75)  # of a cell's size; the middle one second
ENOUGH = 400  # so many of a cell's triangles tell where it is best cut
PROMISING = 0.05  # a single cut that saves this share is taken without looking further
MOST_POINTS = 128
STANDS_OUT = 0.005  # of a piece's size: how far its simplified hull may

# Corners of a cell, as its low (0) or high (1) end along each axis.
_CORNERS = np.indices((2, 2, 2)).reshape(3, 8).T


def convex_cover(mesh: Mesh, most: int = MOST_PIECES) -> tuple[RoundedHull, ...]:
    """At most `most` hulls, without radius, that together contain the mesh.

    What a closed piece encloses is contained too, its cavities filled; of an open piece, its
    surface. A piece's hull may stand out from the true one by 0.5 % of its size; a round one, which
    128 points describe less well, by up to 3 %.
    """
    cells = _first_cells(mesh, most)
    enough = WORTH * sum(cell.volume for cell in cells)
    # The number settles ties, so that the order never depends on the cells themselves.
    heap = [(-gain, i, axis, at) for i, (gain, axis, at) in enumerate(c.best_cut() for c in cells)]
    heapq.heapify(heap)
    count, split = len(cells), set[int]()
    while heap and -heap[0][0] > enough and count < most:
        _, number, axis, at = heapq.heappop(heap)
        halves = [half for half in cells[number].cut(axis, at) if len(half.triangles)]
        count += len(halves) - 1
        split.add(number)
        for half in halves:
            gain, axis, at = half.best_cut()
            heapq.heappush(heap, (-gain, len(cells), axis, at))
            cells.append(half)
    whole = [cell for i, cell in enumerate(cells) if i not in split]
    return tuple(RoundedHull(_simplified(cell.points()), 0.0) for cell in whole)


@dataclass(frozen=True, eq=False)
class _Cell:
    """A box low … high (3,), what it holds of the surface as loose triangles (k, 3, 3), and which
    of its corners (8,) are inside the solid."""

    low: Floats
    high: Floats
    triangles: Floats
    inside: Bools
    windings: Windings | None  # None: a surface without an inside

    def points(self) -> Floats:
        """The corners of what the cell holds, and more that are inside them."""
        corners = np.stack([self.low, self.high])[_CORNERS, np.arange(3)]
        return np.concatenate([self.triangles.reshape(-1, 3), corners[self.inside]])

    @cached_property
    def volume(self) -> float:
        """Of the hull of what the cell holds."""
        return _hull_volume(self.points())

    def best_cut(self) -> tuple[float, int, float]:
        """The volume that the best cut saves or promises (0: none does), its axis, and where."""
        places = [
            (axis, self.low[axis] + share * (self.high[axis] - self.low[axis]))
            for axis in range(3)
            for share in CUTS
        ]
        thin = replace(self, triangles=self.triangles[:: -(-len(self.triangles) // ENOUGH)])
        left = [sum(half.volume for half in thin.cut(*place)) for place in places]
        best = places[int(np.argmin(left))]
        gain = self.volume - sum(half.volume for half in self.cut(*best))
        if gain < PROMISING * self.volume:
            # A ring shows its hole only when it is cut twice: see what is left of the eighths.
            middle = 0.5 * (self.low + self.high)
            eighths = [self]
            for axis in range(3):
                eighths = [half for each in eighths for half in each.cut(axis, middle[axis])]
            promised = 0.5 * (self.volume - sum(each.volume for each in eighths))
            if promised > gain:
                longest = int(np.argmax(self.high - self.low))
                best, gain = (longest, middle[longest]), promised
        return (gain, *best)

    def cut(self, axis: int, at: float) -> tuple[_Cell, _Cell]:
        """What is below the plane, and what is above."""
        below, above = _clipped(self.triangles, axis, at)
        plane = np.stack([self.low, self.high])
        plane[:, axis] = at
        lower = _CORNERS[:, axis] == 0
        middle = np.zeros(8, dtype=np.bool_)
        if self.windings is not None:
            face = plane[_CORNERS[lower], np.arange(3)]
            held = self.windings.number(face) != 0
            middle[lower] = middle[~lower] = held
        return (
            self._half(below, "high", axis, at, np.where(lower, self.inside, middle)),
            self._half(above, "low", axis, at, np.where(lower, middle, self.inside)),
        )

    def _half(self, triangles: Floats, end: str, axis: int, at: float, inside: Bools) -> _Cell:
        low, high = self.low.copy(), self.high.copy()
        (high if end == "high" else low)[axis] = at
        return _Cell(low, high, triangles, inside, self.windings)


def _first_cells(mesh: Mesh, most: int) -> list[_Cell]:
    """One cell around each connected piece; one around all where these are too many."""
    piece = components(mesh.faces)
    shut = closed(mesh.faces, piece)
    # What is a cavity in one piece is filled by that piece's own cell.
    outward = ~shut | (volume_mm3(mesh, piece) > 0.0)
    if not outward.any() or 2 * np.count_nonzero(outward) > most:
        piece, shut, outward = np.zeros_like(piece), shut[piece], np.array([True])
        solids = [mesh.faces[shut]]
    else:
        solids = [mesh.faces[piece == i] if shut[i] else mesh.faces[:0] for i in range(len(shut))]
    cells = []
    for number in np.flatnonzero(outward):
        triangles = mesh.vertices_mm[mesh.faces[piece == number]]
        low, high = triangles.min(axis=(0, 1)), triangles.max(axis=(0, 1))
        windings = Windings(Mesh(mesh.vertices_mm, solids[number])) if len(solids[number]) else None
        nothing = np.zeros(8, dtype=np.bool_)  # the box's corners can only touch the solid
        cells.append(_Cell(low, high, triangles, nothing, windings))
    return cells


def _clipped(triangles: Floats, axis: int, at: float) -> tuple[Floats, Floats]:
    """Triangles (k, 3, 3) cut at a plane: what is below it, what is above."""
    height = triangles[:, :, axis] - at
    below, above = (height <= 0.0).all(axis=1), (height >= 0.0).all(axis=1)
    cut, height = triangles[~below & ~above], height[~below & ~above]
    # Turn each so that corner 0 is alone on its side (or the plane passes through one of the
    # other two, which makes an empty triangle).
    up = height > 0.0
    alone = np.argmax(up == (up.sum(axis=1) == 1)[:, None], axis=1)
    order = (alone[:, None] + np.arange(3)) % 3
    cut = np.take_along_axis(cut, order[:, :, None], axis=1)
    height = np.take_along_axis(height, order, axis=1)
    a, b, c = cut.swapaxes(0, 1)
    ha, hb, hc = height.T[:, :, None]
    ab, ac = a + (b - a) * (ha / (ha - hb)), a + (c - a) * (ha / (ha - hc))
    ab[:, axis] = ac[:, axis] = at
    tip = np.stack([a, ab, ac], axis=1)
    rest = np.concatenate([np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)])
    tip_up = height[:, 0] > 0.0
    rest_up = np.concatenate([tip_up, tip_up])
    return (
        np.concatenate([triangles[below], tip[~tip_up], rest[rest_up]]),
        np.concatenate([triangles[above], tip[tip_up], rest[~rest_up]]),
    )


def _hull_volume(points: Floats) -> float:
    from scipy.spatial import ConvexHull, QhullError  # slow to import

    if len(points) < 4:
        return 0.0
    try:
        return float(ConvexHull(points).volume)
    except QhullError:  # flat
        return 0.0


def _simplified(points: Floats) -> Floats:
    """Few points whose hull contains that of the points (k, 3)."""
    from scipy.spatial import ConvexHull, QhullError  # slow to import

    try:
        corners = points[np.sort(ConvexHull(points).vertices)]
    except QhullError:
        return _flat(points)
    size = float(np.ptp(corners, axis=0).max())
    chosen = np.unique(np.concatenate([corners.argmin(axis=0), corners.argmax(axis=0)]))
    while len(chosen) < len(corners):
        try:
            hull = ConvexHull(corners[chosen])
        except QhullError:
            return corners
        # Blown up about its middle until nothing stands out, the hull contains all corners.
        middle = corners[chosen].mean(axis=0)
        depth = -(hull.equations[:, :3] @ middle + hull.equations[:, 3])
        reach = (corners - middle) @ hull.equations[:, :3].T
        factor = reach.max(axis=0) / depth
        if (factor.max() - 1.0) * 0.5 * size <= STANDS_OUT * size or len(chosen) >= MOST_POINTS:
            return np.asarray(middle + (corners[chosen] - middle) * (factor.max() + 1e-12))
        # Take in what is highest over the faces that are passed the farthest.
        worst = np.argsort(-factor, kind="stable")[: min(len(chosen), MOST_POINTS - len(chosen))]
        chosen = np.union1d(chosen, reach[:, worst].argmax(axis=0))
    return corners


def _flat(points: Floats) -> Floats:
    """The corners of points that lie in a plane or on a line, or the box around the points."""
    if len(points) <= MOST_POINTS:
        return points
    ends = np.stack([points.min(axis=0), points.max(axis=0)])
    return np.unique(ends[_CORNERS, np.arange(3)], axis=0)

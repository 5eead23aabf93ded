"""A moving body prepared for queries: balls that cover it, coarse to fine, and its surfaces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .bvh import Body
from .polyhedra import Polyhedron, inner, outer
from .shapes import Floats, RoundedHull, joined

FINEST = 4  # times that a hull's box is cut in two along its long sides


@dataclass(frozen=True, eq=False)
class Balls:
    """Balls centre_mm (k, 3), radius_mm (k,). What ball i covers, the next level's balls
    first_child[i] … first_child[i + 1] cover too. `solid`: the centre belongs to the body."""

    centre_mm: Floats
    radius_mm: Floats
    solid: NDArray[np.bool_]
    first_child: NDArray[np.int64]  # (k + 1,), all 0 on the finest level


class Probe:
    """A body made of rounded hulls, in its own coordinates. Prepare it once, ask often."""

    def __init__(self, hulls: Sequence[RoundedHull]) -> None:
        if not hulls:
            raise ValueError("a probe needs at least one hull")
        self.hulls = tuple(hulls)
        #: All hulls' points, where each hull's begin, and their radii.
        self.points_mm = np.concatenate([hull.points_mm for hull in hulls])
        self.first_point = np.cumsum([0, *(len(hull.points_mm) for hull in hulls[:-1])])
        self.radius_mm = np.array([hull.radius_mm for hull in hulls])

    @cached_property
    def levels(self) -> tuple[Balls, ...]:
        """Coverings of the body, coarse to fine: the first is one ball."""
        return _levels(self.hulls)

    @cached_property
    def outer(self) -> tuple[Polyhedron, ...]:
        """Around each hull."""
        return tuple(outer(hull) for hull in self.hulls)

    @cached_property
    def outer_body(self) -> Body:
        """All hulls' outer polyhedra as one."""
        return Body(joined([each.mesh for each in self.outer]))

    @cached_property
    def inner_body(self) -> Body | None:
        """The polyhedra inside the hulls as one; None where all hulls are too thin."""
        inside = [each.mesh for each in map(inner, self.hulls) if each is not None]
        return Body(joined(inside)) if inside else None

    @cached_property
    def cores(self) -> tuple[Polyhedron, ...]:
        """The hulls without their radius."""
        return tuple(map(core, self.hulls))

    @cached_property
    def core_bodies(self) -> tuple[Body, ...]:
        return tuple(Body(each.mesh) for each in self.cores)

    @cached_property
    def witnesses(self) -> tuple[Floats, ...]:
        """Points (k, 3) of each hull, far apart, its middle first."""
        return tuple(
            np.concatenate([hull.points_mm.mean(axis=0, keepdims=True), hull.points_mm])
            for hull in self.hulls
        )


def core(hull: RoundedHull) -> Polyhedron:
    """The hull without its radius; where that is thin, thickened by two micrometres at most."""
    sharp = RoundedHull(hull.points_mm, 0.0)
    return inner(sharp) or outer(sharp)


def _levels(hulls: Sequence[RoundedHull]) -> tuple[Balls, ...]:
    cells = [_Cells.around(hull) for hull in hulls]
    low = np.min([hull.points_mm.min(axis=0) - hull.radius_mm for hull in hulls], axis=0)
    high = np.max([hull.points_mm.max(axis=0) + hull.radius_mm for hull in hulls], axis=0)
    middle = 0.5 * (low + high)
    reach = max(
        np.linalg.norm(hull.points_mm - middle, axis=1).max() + hull.radius_mm for hull in hulls
    )
    solid = any((middle @ c.planes[:, :3].T <= c.planes[:, 3]).all() for c in cells)
    levels = [Balls(middle[None], np.array([reach]), np.array([solid]), np.array([0, len(hulls)]))]
    for depth in range(FINEST + 1):
        halved = [each.halved() if depth < FINEST else (each, None) for each in cells]
        counts = [
            np.zeros(len(each.middle), dtype=np.int64) if made is None else made
            for each, (_, made) in zip(cells, halved, strict=True)
        ]
        levels.append(
            Balls(
                np.concatenate([each.middle @ each.axes.T for each in cells]),
                np.concatenate([each.radius_mm() for each in cells]),
                np.concatenate([each.solid() for each in cells]),
                np.concatenate([[0], np.cumsum(np.concatenate(counts))]),
            )
        )
        cells = [each for each, _ in halved]
    return tuple(levels)


@dataclass(frozen=True, eq=False)
class _Cells:
    """Equal boxes that together cover a hull's core, in its principal axes (3, 3), columns."""

    hull: RoundedHull
    axes: Floats
    planes: Floats  # of the core, in the body's coordinates
    middle: Floats  # (k, 3), along the axes
    half_mm: Floats  # (3,)

    @classmethod
    def around(cls, hull: RoundedHull) -> _Cells:
        centred = hull.points_mm - hull.points_mm.mean(axis=0)
        _, axes = np.linalg.eigh(centred.T @ centred)
        along = hull.points_mm @ axes
        low, high = along.min(axis=0), along.max(axis=0)
        planes = outer(RoundedHull(hull.points_mm, 0.0)).planes
        return cls(hull, axes, planes, 0.5 * (low + high)[None], 0.5 * (high - low))

    def radius_mm(self) -> Floats:
        corner = np.linalg.norm(self.half_mm) + self.hull.radius_mm
        return np.full(len(self.middle), corner * (1.0 + 1e-9) + 1e-6)

    def solid(self) -> NDArray[np.bool_]:
        return np.asarray((self._height() <= 0.0).all(axis=1))

    def halved(self) -> tuple[_Cells, NDArray[np.int64]]:
        """Each cell's parts that may hold some of the core, and how many each has."""
        longest = self.half_mm.max()
        cut = (self.half_mm > 0.5 * longest) & (self.half_mm > 0.0)
        half = np.where(cut, 0.5 * self.half_mm, self.half_mm)
        steps = np.array(
            np.meshgrid(*[[-1.0, 1.0] if c else [0.0] for c in cut], indexing="ij")
        ).reshape(3, -1)
        middle = (self.middle[:, None] + steps.T * half).reshape(-1, 3)
        cells = _Cells(self.hull, self.axes, self.planes, middle, half)
        reach = np.abs(self.planes[:, :3] @ self.axes) @ half
        keep = (cells._height() <= reach).all(axis=1)
        made = keep.reshape(len(self.middle), -1).sum(axis=1)
        return _Cells(self.hull, self.axes, self.planes, middle[keep], half), made

    def _height(self) -> Floats:
        """Of each cell's middle over each plane of the core (k, p)."""
        return self.middle @ (self.planes[:, :3] @ self.axes).T - self.planes[:, 3]

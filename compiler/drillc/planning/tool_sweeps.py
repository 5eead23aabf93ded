"""Whether the tool's own body keeps clear over a hole's whole cycle, for intervals of headings.

The body is swept along its axis from the outmost standoff to the depth, and about it over half the
interval either way; both sweeps are enclosed in convex hulls, so one yes/no test proves a whole
interval of headings free. A body that every heading of the interval contains proves it blocked.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drillc.geometry.probe import Probe
from drillc.geometry.shapes import RoundedHull, grown
from drillc.geometry.sweeps import swept_along_z, turned_about_z
from drillc.language.job import Floats
from drillc.planning.cell import TOOL, Cell
from drillc.planning.cycle_check import Cycles

Bools = NDArray[np.bool_]

#: Depths of a table are rounded up to whole multiples of this, where there are many.
DEPTH_STEP_MM = 2.0
MANY_DEPTHS = 4


@dataclass(frozen=True, eq=False)
class ToolSweeps:
    """The tool's swept bodies of one cell, made as they are asked for."""

    cell: Cell
    cycles: Cycles
    depth_mm: Floats  # (n,) rounded up, so that there are few sweeps
    _probes: dict[tuple[float, ...], Probe] = field(default_factory=dict, repr=False)

    @property
    def hulls(self) -> tuple[RoundedHull, ...]:
        return next(mover.hulls for mover in self.cell.movers if mover.link == TOOL)

    def clear(
        self,
        row: NDArray[np.int64],
        heading_rad: Floats,
        half_rad: float = 0.0,
        *,
        exact: bool = True,
    ) -> Bools:
        """Whether every heading within `half_rad` of `heading_rad` (k,) is proven free (k,).
        Without `exact` fewer are proven, but quicker."""
        result = np.ones(len(row), dtype=np.bool_)
        for g in range(len(self.cell.guards)):
            open_ = np.flatnonzero(result)
            result[open_] = self._clear_of(g, row[open_], heading_rad[open_], half_rad, exact)
        return result

    def blocked(self, row: NDArray[np.int64], heading_rad: Floats, half_rad: float) -> Bools:
        """Whether every heading within `half_rad` (k,) is surely not free."""
        result = np.zeros(len(row), dtype=np.bool_)
        rotation, position_mm = self._places(row, heading_rad)
        for g, guard in enumerate(self.cell.guards):
            for some, key in self._alike(g, row, ~result):
                probe = self._probe(*key, half_rad, inner=True)
                if probe is not None:
                    result[some] = guard.obstacles.meets(probe, rotation[some], position_mm[some])
        return result

    def hit(self, row: NDArray[np.int64], heading_rad: Floats) -> NDArray[np.int32]:
        """Which guard the tool is not proven clear of (k,); -1: none."""
        found = np.full(len(row), -1, dtype=np.int32)
        for g in range(len(self.cell.guards)):
            open_ = np.flatnonzero(found < 0)
            clear = self._clear_of(g, row[open_], heading_rad[open_], 0.0, exact=True)
            found[open_[~clear]] = g
        return found

    def gap_mm(self, row: int, heading_rad: float) -> tuple[float, int]:
        """By how much more than its clearance (negative: less) the tool stays away over the cycle,
        exactly, and from which guard; infinite, -1 where there is none."""
        least, which = np.inf, -1
        rows = np.array([row])
        rotation = self.cycles.turned(rows, np.array([heading_rad]))[0]
        out, depth = float(self.cycles.out_mm[row]), float(self.cycles.depth_mm[row])
        key = (out, depth)
        if key not in self._probes:
            self._probes[key] = Probe([swept_along_z(hull, -out, depth) for hull in self.hulls])
        at_mm = self.cycles.position_mm[row]
        for g, guard in enumerate(self.cell.guards):
            clearance = float(guard.clearance_mm[self.cycles.region[row]])
            if np.isfinite(clearance):
                gap, _ = guard.obstacles.gap_mm(
                    self._probes[key], rotation, at_mm, beyond_mm=least + clearance
                )
                if gap - clearance < least:
                    least, which = gap - clearance, g
        return float(least), which

    def _clear_of(
        self,
        guard: int,
        row: NDArray[np.int64],
        heading_rad: Floats,
        half_rad: float,
        exact: bool,
    ) -> Bools:
        """As `clear`, but of one guard only."""
        result = np.ones(len(row), dtype=np.bool_)
        obstacles = self.cell.guards[guard].obstacles
        rotation, position_mm = self._places(row, heading_rad)
        for some, key in self._alike(guard, row, result.copy()):
            probe = self._probe(*key, half_rad, inner=False)
            if probe is not None:
                at = rotation[some], position_mm[some]
                result[some] = obstacles.clear(probe, *at, exact=exact)
        return result

    def _places(self, row: NDArray[np.int64], heading_rad: Floats) -> tuple[Floats, Floats]:
        return self.cycles.turned(row, heading_rad), self.cycles.position_mm[row]

    def _alike(
        self, guard: int, row: NDArray[np.int64], wanted: Bools
    ) -> Iterator[tuple[NDArray[np.int64], tuple[float, float, float]]]:
        """Those of the holes (k,) that are `wanted` (k,) and keep away from a guard, by what they
        ask for: how far the tool goes out and in, and how much clearance."""
        clearance = self.cell.guards[guard].clearance_mm[self.cycles.region[row]]
        asked = np.stack([self.cycles.out_mm[row], self.depth_mm[row], clearance], axis=1)
        keys, which = np.unique(asked, axis=0, return_inverse=True)
        for number, (out, depth, keep) in enumerate(keys.tolist()):
            some = np.flatnonzero((which.ravel() == number) & wanted)
            if np.isfinite(keep) and len(some):
                yield some, (out, depth, keep)

    def _probe(
        self, out_mm: float, depth_mm: float, growth_mm: float, half_rad: float, *, inner: bool
    ) -> Probe | None:
        key = (out_mm, depth_mm, growth_mm, half_rad, float(inner))
        if key not in self._probes:
            hulls = [swept_along_z(hull, -out_mm, depth_mm) for hull in self.hulls]
            if inner:
                shrunk = (_within(hull, growth_mm, half_rad) for hull in hulls)
                hulls = [hull for hull in shrunk if hull is not None]
            else:
                hulls = [grown(turned_about_z(hull, half_rad), growth_mm) for hull in hulls]
            if not hulls:
                return None
            self._probes[key] = Probe(hulls)
        return self._probes[key]


def make_tool_sweeps(cell: Cell, cycles: Cycles) -> ToolSweeps:
    """Ready to test; nothing is swept yet."""
    depth_mm = cycles.depth_mm
    if len(np.unique(depth_mm)) > MANY_DEPTHS:
        depth_mm = np.ceil(depth_mm / DEPTH_STEP_MM) * DEPTH_STEP_MM
    return ToolSweeps(cell, cycles, depth_mm)


def _within(hull: RoundedHull, growth_mm: float, half_rad: float) -> RoundedHull | None:
    """A body that the grown hull contains at every heading within `half_rad`: no point of it moves
    farther than its lever times the angle, so that much is taken off all round. None: nothing is
    left."""
    lever_mm = float(np.hypot(hull.points_mm[:, 0], hull.points_mm[:, 1]).max()) + hull.radius_mm
    radius = hull.radius_mm + growth_mm - lever_mm * half_rad
    if radius >= 0.0:
        return RoundedHull(hull.points_mm, radius)
    centre = hull.points_mm.mean(axis=0)
    inside = _inradius(hull.points_mm, centre)
    if inside <= 0.0 or -radius >= inside:
        return None
    return RoundedHull(centre + (hull.points_mm - centre) * (1.0 + radius / inside), 0.0)


def _inradius(points_mm: Floats, centre: Floats) -> float:
    """How far the hull of the points reaches around `centre` in all directions; 0 if it is flat."""
    from scipy.spatial import ConvexHull, QhullError

    if len(points_mm) < 4:
        return 0.0
    try:
        equations = ConvexHull(points_mm).equations
    except QhullError:
        return 0.0
    return float(-(equations[:, :3] @ centre + equations[:, 3]).max())

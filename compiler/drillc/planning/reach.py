"""What an arm reaches from where it stands, and what it would reach from elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from drillc.kernels.arm import ArmGeometry
from drillc.language.job import Floats, Pose
from drillc.planning.cell import Cell
from drillc.planning.cycle_check import Cycles

Rows = NDArray[np.int64]


def wrist_centres(
    geometry: ArmGeometry, flange_from_tool: Pose, rotation: Floats, position_mm: Floats
) -> Floats:
    """Where the wrist centre is (n, 3) for part_from_tool: rotation (n, 3, 3), position (n, 3);
    in part coordinates, mm. It does not depend on where the arm stands."""
    part_from_flange = rotation @ flange_from_tool.rotation.T
    flange_mm = position_mm - part_from_flange @ flange_from_tool.translation_mm
    return np.asarray(flange_mm - geometry.c4_mm * part_from_flange[:, :, 2])


def lacking_mm(geometry: ArmGeometry, wrist_mm: Floats) -> Floats:
    """By how much wrist centres (..., 3) in the root's frame are out of reach, too far or too near;
    not more than zero where one can be reached, limits of the joints aside. Shape (...)."""
    x, y, z = np.moveaxis(wrist_mm, -1, 0)
    aside = abs(geometry.b_mm)
    distance = np.hypot(x, y)
    ahead = np.sqrt(np.maximum(distance**2 - aside**2, 0.0))
    upper, fore = geometry.c2_mm, geometry.forearm_mm
    ways = []
    for forward in (ahead, -ahead):
        span = np.hypot(forward - geometry.a1_mm, z - geometry.c1_mm)
        ways.append(np.maximum(span - (upper + fore), abs(upper - fore) - span))
    return np.asarray(np.maximum(np.minimum(*ways), aside - distance))


def as_if_moved(cycles: Cycles, row: Rows, move_mm: Floats) -> Cycles:
    """Holes `row` (k,) as they appear to an arm that would stand `move_mm` (k, 3) from where it
    does, turned alike. What else stands around does not appear so."""
    return Cycles(
        cycles.region[row],
        cycles.position_mm[row] - move_mm,
        cycles.rotation[row],
        cycles.approach_mm[row],
        cycles.retract_mm[row],
        cycles.depth_mm[row],
    )


def moved(cell: Cell, move_mm: Floats) -> Cell:
    """The same arm, standing `move_mm` (3,) away."""
    root = cell.station.part_from_root
    place = Pose(root.rotation, root.translation_mm + move_mm)
    return replace(cell, station=replace(cell.station, part_from_root=place))

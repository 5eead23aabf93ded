"""Whether a hole can be made at a heading, by brute force: the tool's true body every half
millimetre along the cycle, python-fcl's exact distance, py-opw-kinematics for the joints.

Slow and plain on purpose; the compiler's answers are held against it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation
from walk.scene import Scene

Array = np.ndarray

#: Places along the cycle at which tool and arm are looked at.
TOOL_STEP_MM, ARM_STEP_MM = 0.5, 5.0
LEAP_DEG = 30.0


@dataclass(frozen=True)
class Cycle:
    """A hole's cycle: part_from_tool (4, 4) at the surface as the rule holds the tool, how far the
    tool goes out and in along its z, and what it keeps from each fixture, in mm."""

    part_from_tool: Array
    out_mm: float
    depth_mm: float
    clearance_mm: dict[str, float]

    def poses(self, heading_deg: float, step_mm: float) -> Array:
        """The tool's poses (n, 4, 4) at a heading, from the standoff to the full depth."""
        steps = max(1, int(np.ceil((self.out_mm + self.depth_mm) / step_mm)))
        poses = np.tile(self.part_from_tool, (steps + 1, 1, 1))
        turn = Rotation.from_euler("z", heading_deg, degrees=True).as_matrix()
        poses[:, :3, :3] = self.part_from_tool[:3, :3] @ turn
        along = np.linspace(-self.out_mm, self.depth_mm, steps + 1)
        poses[:, :3, 3] += along[:, None] * self.part_from_tool[:3, 2]
        return poses


@dataclass(frozen=True)
class Dense:
    """The judge before one scene. `singular_deg`: what the wrist keeps from straight."""

    scene: Scene
    flange_from_tool: Array
    singular_deg: float

    def works(self, cycle: Cycle, heading_deg: float) -> bool:
        return self.tool_is_clear(cycle, heading_deg) and self.arm_follows(cycle, heading_deg)

    def tool_is_clear(self, cycle: Cycle, heading_deg: float) -> bool:
        """Whether every part of the tool keeps every clearance, at every place of the cycle."""
        tool_from_flange = np.linalg.inv(self.flange_from_tool)
        flange = cycle.poses(heading_deg, TOOL_STEP_MM) @ tool_from_flange
        parts = self.scene.tool_parts(flange)
        return all(self.scene.keeps(part, cycle.clearance_mm) for part in parts)

    def arm_follows(self, cycle: Cycle, heading_deg: float) -> bool:
        """Whether some branch keeps reach, limits, the singularity's margin and the clearances of
        the arm's links, continuously over the cycle."""
        poses = np.linalg.inv(self.scene.part_from_root) @ cycle.poses(heading_deg, ARM_STEP_MM)
        branches = self.scene.arm.branches(poses @ np.linalg.inv(self.flange_from_tool))
        for slot in range(8):
            way = branches[:, slot]
            if np.isnan(way).any():
                continue
            way = np.unwrap(way, axis=0, period=360.0)
            if np.abs(np.diff(way, axis=0)).max() > LEAP_DEG:
                continue
            if self.scene.arm.bend(way).min() < self.singular_deg:
                continue
            if self._fits(way) and self._links_are_clear(cycle, way):
                return True
        return False

    def _fits(self, way: Array) -> bool:
        """Whether every joint has a winding in which the whole way is within its limits."""
        arm = self.scene.arm
        turns = 360.0 * np.arange(-2, 3)[:, None]
        low, high = way.min(axis=0) + turns, way.max(axis=0) + turns
        return bool(((low >= arm.low) & (high <= arm.high)).any(axis=0).all())

    def _links_are_clear(self, cycle: Cycle, way: Array) -> bool:
        links = self.scene.links(way)
        return all(self.scene.keeps(link, cycle.clearance_mm) for link in links)


def smallest_turns(judge: Dense, cycle: Cycle, within_deg: float, step_deg: float) -> list[float]:
    """The smallest turn that works on either side, or infinity: positive first."""
    found = []
    for side in (1.0, -1.0):
        steps = np.arange(0.0, within_deg + 1e-9, step_deg)
        works = (side * away for away in steps if judge.works(cycle, side * float(away)))
        found.append(next(works, np.inf))
    return found

"""The straight ways of a program for an arm: into its holes, to its holes, and to its vias.

A post that programs poses leaves these ways to the controller. One that programs joints asks here
where they lead, and `arm_nodes.py` for the joints along them. Everything is computed for some holes
or vias at a time, from the Program alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats
from drillc.planning.arm_nodes import Nodes, branch_of, end_joints
from drillc.planning.cell import Cell, make_cell
from drillc.planning.moves import Moves, straight_moves
from drillc.planning.program import ArmMotion, Cycle, MoveTo, Program

Rows = NDArray[np.int64]

#: Joints that differ by less are the same place: rounding.
_SAME_RAD = 1e-9


@dataclass(frozen=True, eq=False)
class Travels:
    """Straight travels, w of them: `rows` (w,) are the holes or vias that they lead to, `holes`
    (w,) those whose process says how fast; n stands for the end."""

    rows: Rows
    holes: Rows
    moves: Moves


@dataclass(frozen=True, eq=False)
class ArmWays:
    """The straight ways of one program, whose arm is `arm`. Per hole, (n,), along the tool's axis:
    `outmost_mm` is the depth of the place farthest out, `leave_mm` that where the cycle ends."""

    program: Program
    arm: ArmMotion
    cell: Cell
    outmost_mm: Floats
    approach_mm: Floats
    leave_mm: Floats
    travel_mm_s: Floats

    def into_holes(self, start: int, stop: int) -> Moves:
        """Along the tool's axis, from the place farthest out to the bottom, of each hole."""
        rows = np.arange(start, stop)
        begin, joints = self._on_axis(rows, self.outmost_mm[rows])
        return self._moves(begin, self._pose(rows, self.program.depth_mm[rows]), joints)

    def to_holes(self, start: int, stop: int) -> Travels:
        """To the standoffs of the holes `start` … `stop`, but where a via has ended there."""
        rows = np.arange(start, stop)
        before = self.arm.vias.before
        via = np.searchsorted(before, rows, side="right") - 1
        via[(via < 0) | (before[via] != rows)] = -1
        joints = self.arm.standoff_joints
        begin, from_joints = self._places(rows - 1, via)
        far = np.abs(joints[rows] - from_joints).max(axis=1, initial=0.0) > _SAME_RAD
        rows = rows[far]
        begin = begin[0][far], begin[1][far]
        end = self._pose(rows, -self.approach_mm[rows])
        return Travels(rows, rows, self._moves(begin, end, from_joints[far], joints[rows]))

    def to_vias(self, start: int, stop: int) -> Travels:
        """To those of the vias `start` … `stop` that are reached straight."""
        vias = self.arm.vias
        rows = start + np.flatnonzero(~vias.by_joints[start:stop])
        hole = vias.before[rows].astype(np.int64)
        via = np.where((rows > 0) & (vias.before[rows - 1] == vias.before[rows]), rows - 1, -1)
        begin, joints = self._places(hole - 1, via)
        end = vias.part_from_tool[rows], vias.position_mm[rows]
        return Travels(rows, hole, self._moves(begin, end, joints, vias.joints[rows]))

    def seconds(self, travels: Travels, nodes: Nodes) -> Floats:
        """How long each step of travels takes (Σ steps,): at the process' travel speed, and no
        joint faster than it can."""
        moves, last = travels.moves, len(self.travel_mm_s) - 1
        steps = np.diff(nodes.first) - 1
        length_mm = np.linalg.norm(moves.stop_mm - moves.start_mm, axis=1)
        evenly = length_mm / steps / self.travel_mm_s[np.minimum(travels.holes, last)]
        turned = np.abs(np.diff(nodes.joints, axis=0))
        inside = np.ones(len(turned), dtype=np.bool_)
        inside[nodes.first[1:-1] - 1] = False  # from one way's end to the next one's start
        at_most = (turned[inside] / self.cell.speed_rad_s).max(axis=1, initial=0.0)
        return np.asarray(np.maximum(np.repeat(evenly, steps), at_most))

    def _places(self, hole: Rows, via: Rows) -> tuple[tuple[Floats, Floats], Floats]:
        """The pose and the joints (k, 6) at vias (k,), or where that is -1, where the cycles of
        holes (k,) leave the tool, or where that is -1 too, at home."""
        vias, home = self.arm.vias, self.arm.arm.home_rad
        count = len(hole)
        rotation, position_mm, joints = (
            np.empty((count, 3, 3)),
            np.empty((count, 3)),
            np.empty((count, 6)),
        )
        left = np.flatnonzero((via < 0) & (hole >= 0))
        pose, joints[left] = self._on_axis(hole[left], self.leave_mm[hole[left]])
        rotation[left], position_mm[left] = pose
        passed = np.flatnonzero(via >= 0)
        rotation[passed] = vias.part_from_tool[via[passed]]
        position_mm[passed] = vias.position_mm[via[passed]]
        joints[passed] = vias.joints[via[passed]]
        first = np.flatnonzero((via < 0) & (hole < 0))
        if len(first):
            if home is None:
                raise ValueError("a straight way begins where nobody knows where the arm is")
            (rotation[first],), (position_mm[first],) = self.cell.tool_pose(home[None])
            joints[first] = home
        return (rotation, position_mm), joints

    def _pose(self, rows: Rows, depth_mm: Floats) -> tuple[Floats, Floats]:
        """The tool's pose, `depth_mm` (k,) along the axes of holes `rows` (k,)."""
        rotation = self.program.part_from_tool[rows]
        position_mm = self.program.holes.position_mm[rows]
        return rotation, position_mm + rotation[:, :, 2] * depth_mm[:, None]

    def _on_axis(self, rows: Rows, depth_mm: Floats) -> tuple[tuple[Floats, Floats], Floats]:
        """The same, and the joints there, as the arm comes to them from the hole's surface."""
        surface, there = self._pose(rows, np.zeros(len(rows))), self._pose(rows, depth_mm)
        moves = self._moves(surface, there, self.arm.joints[rows])
        return there, end_joints(self.cell, moves)

    def _moves(
        self,
        begin: tuple[Floats, Floats],
        end: tuple[Floats, Floats],
        joints: Floats,
        end_joints: Floats | None = None,
    ) -> Moves:
        nowhere = np.zeros(len(joints), dtype=np.int32)  # what is around was looked at in planning
        branch = branch_of(self.cell, begin, joints)
        return straight_moves(nowhere, begin, end, branch, joints, end_joints)


def arm_ways(program: Program) -> ArmWays:
    """The ways of a program for an arm."""
    arm, tool = program.arm, program.tool
    if arm is None or tool is None:
        raise ValueError("only a program for an arm has ways")
    cycles = [program.cycles[section.cycle] for section in program.sections]
    counts = [section.stop - section.start for section in program.sections]

    def per_hole(values: list[float]) -> Floats:
        return np.repeat(np.array(values, dtype=np.float64), counts)

    return ArmWays(
        program,
        arm,
        make_cell(arm.arm, arm.station, tool, ()),
        per_hole([outmost_mm(cycle) for cycle in cycles]),
        per_hole([cycle.process.approach_mm for cycle in cycles]),
        per_hole([_leave_mm(cycle) for cycle in cycles]),
        per_hole([cycle.process.travel_mm_s for cycle in cycles]),
    )


def outmost_mm(cycle: Cycle) -> float:
    """The depth of the place farthest out to which a cycle, or its fault, moves the tool."""
    moves = [step.depth_mm for step in (*cycle.steps, *cycle.fault) if isinstance(step, MoveTo)]
    return min([-cycle.process.approach_mm, *moves])


def _leave_mm(cycle: Cycle) -> float:
    moves = [step.depth_mm for step in cycle.steps if isinstance(step, MoveTo)]
    return moves[-1] if moves else -cycle.process.approach_mm

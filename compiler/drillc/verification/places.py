"""Where the tool is after each move, in part coordinates, whatever the program states it in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from drillc.catalogue.model import JOINT_NAMES
from drillc.kernels import arm, portal
from drillc.language.job import Emit, Job, Portal, Pose
from drillc.planning.program import ArmMotion, Program

from .events import Events, Floats, placed_of
from .reading import Precision
from .vectors import length

Bools = NDArray[np.bool_]

#: base_from_tool of a portal: z is where the tool feeds; it stands below the plate or above.
_PORTAL_TOOL = {"below": np.eye(3), "above": np.diag([1.0, -1.0, -1.0])}


@dataclass(frozen=True, eq=False)
class Places:
    """Of n events. `position_mm` (n, 3) and `rotation` (n, 3, 3): the tool in the part; NaN where
    an event is no move, or nobody can know. `joints` (n, k): in the spec's order, mm and radians;
    NaN where the move is given by a pose."""

    position_mm: Floats
    rotation: Floats
    joints: Floats

    @cached_property
    def axis(self) -> Floats:
        """Where the tool feeds, (n, 3)."""
        return np.ascontiguousarray(self.rotation[:, :, 2])

    def take(self, rows: NDArray[np.intp] | Bools | slice) -> Places:
        """Those of some rows, in the order given."""
        return Places(*(getattr(self, field.name)[rows] for field in fields(self)))


@dataclass(frozen=True, eq=False)
class Machine:
    """How joints become places. `columns` (k,): which of the run's axes each joint is, -1 where it
    has none; `scale` (k,): radians per degree, or 1."""

    columns: NDArray[np.intp]
    scale: Floats
    portal: Portal | None
    arm: ArmMotion | None
    flange_from_tool: Pose | None

    @property
    def known(self) -> bool:
        """Whether joints say where the tool is."""
        return bool(len(self.columns)) and bool((self.columns >= 0).all())

    def joints(self, events: Events) -> Floats:
        """The joints (n, k) that events state."""
        if not self.known:
            return np.full((len(events), len(self.columns)), np.nan)
        return events.joints[:, self.columns] * self.scale

    def tool(self, joints: Floats) -> tuple[Floats, Floats]:
        """The tool in the part, of joints (n, k): position (n, 3) and rotation (n, 3, 3)."""
        if self.portal is not None:
            spec = self.portal
            geometry = portal.PortalGeometry(
                spec.column_distance_mm, spec.column_height_mm, spec.hinge_inset_mm
            )
            turn, shift, tool = portal.forward(geometry, joints)
            part_from_base = np.swapaxes(turn, 1, 2)
            position = np.einsum("nij,nj->ni", part_from_base, tool - shift)
            return position, part_from_base @ _PORTAL_TOOL[spec.side]
        assert self.arm is not None
        assert self.flange_from_tool is not None
        rotation, position = arm.forward(self.arm.arm.model.geometry, joints)
        root, flange = self.arm.station.part_from_root, self.flange_from_tool
        part_from_flange = root.rotation @ rotation
        return (
            position @ root.rotation.T
            + root.translation_mm
            + part_from_flange @ flange.translation_mm,
            part_from_flange @ flange.rotation,
        )

    def places(self, events: Events) -> Places:
        """Where the tool is after each event that moves it; NaN after others."""
        joints = self.joints(events)
        position, rotation = events.position_mm, events.rotation
        moves = placed_of(events.kind)
        if (~moves & np.isfinite(position[:, 0])).any():
            position = np.where(moves[:, None], position, np.nan)
        by_joints = np.flatnonzero(moves & np.isnan(position[:, 0]))
        if len(by_joints) and self.known:
            position, rotation = position.copy(), rotation.copy()
            position[by_joints], rotation[by_joints] = self.tool(joints[by_joints])
        return Places(position, rotation, joints)

    def rounding(self, joints: Floats, precision: Precision) -> tuple[Floats, Floats]:
        """By how much the tool may be off, (n,) mm and (n,) rad, when all joints (n, k) are off by
        half of their last digit."""
        half = np.where(self.scale != 1.0, precision.joint_rad, precision.joint_mm)
        position, rotation = self.tool(joints)
        moved, turned = np.zeros(len(joints)), np.zeros(len(joints))
        for k, step in enumerate(1e3 * half):
            other = joints.copy()
            other[:, k] += step
            there, turn = self.tool(other)
            moved += length(there - position) / 1e3
            turned += np.linalg.norm(turn - rotation, axis=(1, 2)) / 1e3
        return moved, turned


def machine_of(job: Job, program: Program, emit: Emit, axes: Sequence[str]) -> Machine:
    """What moves the tool of `program`; `axes` names the columns of the run's joints."""
    of_joint = {joint.text.upper(): axis.text.upper() for joint, axis in emit.axes}
    known = [axis.upper() for axis in axes]
    if program.motion is not None:
        names = [axis.name for axis in program.motion.axes]
        rotary = [axis.rotary for axis in program.motion.axes]
        robot = job.robot if isinstance(job.robot, Portal) else None
        # A robot's own axes are called otherwise than the spec's, so an unmapped joint has none.
        columns = [_column(known, of_joint.get(name.upper(), name.upper())) for name in names]
        if robot is None:  # then nobody knows where joints take the tool
            columns = [-1] * len(names)
        return Machine(np.array(columns), _scale(rotary), robot, None, None)
    if program.arm is not None and program.tool is not None:
        columns = [
            _column(known, of_joint.get(name, name), f"RAX_{k + 1}")
            for k, name in enumerate(JOINT_NAMES)
        ]
        flange = program.tool.flange_from_tool
        return Machine(np.array(columns), _scale([True] * 6), None, program.arm, flange)
    return Machine(np.empty(0, dtype=np.intp), np.empty(0), None, None, None)


def _column(known: Sequence[str], *names: str) -> int:
    return next((known.index(name) for name in names if name in known), -1)


def _scale(rotary: Sequence[bool]) -> Floats:
    return np.where(np.array(rotary, dtype=np.bool_), np.pi / 180.0, 1.0)

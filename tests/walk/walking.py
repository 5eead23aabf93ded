"""Walks the motions of an emitted program: all joints that the arm passes, in small steps.

What is emitted is text, read by `readers.krl`. A PTP to axes goes there in proportion; a PTP to a
pose means the joints that its S and T say; a LIN is followed by inverse kinematics from where the
arm stands, always to the nearest joints. Joints are in degrees, lengths in mm.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from readers.events import Event, Move
from scipy.spatial.transform import Rotation
from walk.arm import Arm

Array = np.ndarray

#: How densely the ways are walked: neither elbow, wrist, flange nor the tool's point go farther
#: between two steps, and in a move by joints no joint turns by more.
STEP_MM, STEP_DEG = 1.0, 0.5
#: Between two steps no joint may turn by more: on a straight line, next to the wrist's singularity,
#: joints turn much faster than the tool.
LEAP_DEG = 5.0
#: A step's rounding in the emitted text: positions have three decimals, angles more.
ROUNDING_MM, ROUNDING_DEG = 0.01, 0.01


class WalkError(AssertionError):
    """The arm cannot go, or goes where it must not."""


@dataclass
class Walk:
    """Where the arm has been: `joints` are arrays (k, 6), one a move, each begun where the last one
    ended. `stops` (m, 6): where each move ended; `moves` the moves themselves."""

    joints: list[Array] = field(default_factory=list)
    moves: list[Move] = field(default_factory=list)

    @property
    def stops(self) -> Array:
        return np.array([part[-1] for part in self.joints])


def walk(
    arm: Arm,
    events: Iterable[Event],
    root_from_part: Array,
    flange_from_tool: Array,
    home: Array,
) -> Walk:
    """Follow every move of a program, from home (6,)."""
    found = Walk()
    now = home
    tool_from_flange = np.linalg.inv(flange_from_tool)
    for event in events:
        if not isinstance(event, Move):
            continue
        if event.joints is not None:
            target = np.array([event.joints[f"A{i}"] for i in range(1, 7)])
            way = by_joints(arm, now, target, flange_from_tool)
        elif event.pose is None:
            raise WalkError("$H_POS: only the controller knows where that is")
        else:
            flange = root_from_part @ event.pose @ tool_from_flange
            if event.straight:
                way = straight(arm, now, flange, flange_from_tool)
            else:
                target = said(arm, flange, event.configuration)
                way = by_joints(arm, now, target, flange_from_tool)
        found.joints.append(way)
        found.moves.append(event)
        now = way[-1]
    return found


def flange_poses(arm: Arm, joints: Array) -> Array:
    """(n, 4, 4) of joints (n, 6)."""
    at = arm.points(joints)
    poses = np.tile(np.eye(4), (len(joints), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = at["turn"], at["flange"]
    return poses


def by_joints(arm: Arm, start: Array, stop: Array, flange_from_tool: Array) -> Array:
    """All joints in proportion (k, 6), so densely that no point of the arm skips a millimetre."""
    steps = max(1, int(np.ceil(np.abs(stop - start).max() / STEP_DEG)))
    coarse = start + (stop - start) * np.linspace(0.0, 1.0, steps + 1)[:, None]
    at = arm.points(coarse)
    tool = (flange_poses(arm, coarse) @ flange_from_tool)[:, :3, 3]
    ways = [at[name] for name in ("elbow", "wrist", "flange")] + [tool]
    far = max(float(np.linalg.norm(np.diff(way, axis=0), axis=1).max()) for way in ways)
    steps *= max(1, int(np.ceil(far / STEP_MM)))
    return start + (stop - start) * np.linspace(0.0, 1.0, steps + 1)[:, None]


def straight(arm: Arm, start: Array, flange: Array, flange_from_tool: Array) -> Array:
    """The tool's point along a line, its orientation about one axis: joints (k, 6)."""
    here = (flange_poses(arm, start[None]) @ flange_from_tool)[0]
    there = flange @ flange_from_tool
    turn = Rotation.from_matrix(here[:3, :3].T @ there[:3, :3]).as_rotvec()
    length = float(np.linalg.norm(there[:3, 3] - here[:3, 3]))
    turned = float(np.degrees(np.linalg.norm(turn)))
    steps = max(1, int(np.ceil(length / STEP_MM)), int(np.ceil(turned / STEP_DEG)))
    share = np.linspace(0.0, 1.0, steps + 1)[1:, None]
    poses = np.tile(np.eye(4), (steps, 1, 1))
    poses[:, :3, 3] = here[:3, 3] + (there[:3, 3] - here[:3, 3]) * share
    poses[:, :3, :3] = here[:3, :3] @ Rotation.from_rotvec(turn * share).as_matrix()
    branches = arm.branches(poses @ np.linalg.inv(flange_from_tool))
    way = [start]
    for choices in branches:
        step = (choices - way[-1] + 180.0) % 360.0 - 180.0
        far = np.abs(step).max(axis=1)
        if np.isnan(far).all():
            raise WalkError("out of reach on a straight line")
        best = int(np.nanargmin(far))
        if far[best] > LEAP_DEG:
            raise WalkError(f"a joint leaps by {far[best]:.1f} deg on a straight line")
        way.append(way[-1] + step[best])
    return np.array(way)


def said(arm: Arm, flange: Array, status_and_turn: tuple[int, ...]) -> Array:
    """The joints (6,) that S and T mean at a flange pose: within the limits there is one."""
    found = []
    for joints in arm.branches(flange[None])[0]:
        if np.isnan(joints).any():
            continue
        for turns in np.stack(np.meshgrid(*[[-360.0, 0.0, 360.0]] * 3), axis=-1).reshape(-1, 3):
            whole = joints + np.array([turns[0], 0, 0, turns[1], 0, turns[2]])
            inside = (whole >= arm.low - 1e-6).all() and (whole <= arm.high + 1e-6).all()
            if inside and arm.status_and_turn(whole) == status_and_turn:
                found.append(whole)
    if len(found) != 1:
        raise WalkError(f"S and T {status_and_turn} mean {len(found)} places")
    return found[0]


def outside(arm: Arm, joints: Array) -> float:
    """By how much joints (n, 6) overstep the limits at worst, in degrees."""
    return float(np.maximum(arm.low - joints, joints - arm.high).max())

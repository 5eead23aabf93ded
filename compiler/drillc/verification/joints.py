"""Joints: inside their limits wherever they are stated, and at each hole those that are planned."""

from __future__ import annotations

import numpy as np

from drillc.language.source import Span
from drillc.planning.cell import Cell

from .case import Case, half_digit, joint_limits
from .checks import Made
from .events import Floats
from .postures import cell_of, nearest
from .verdict import Rows
from .visits import Path

#: Joints that are out of range are told for so many moves.
_MOST_TOLD = 100


def check_range(case: Case, path: Path) -> None:
    """Where joints are stated, none is beyond its limits by more than rounding; and no axis is
    moved that the spec does not have."""
    _check_others(case, path)
    low, high, names = joint_limits(case)
    if not len(low):
        return
    joints = path.places.joints
    at = np.flatnonzero(path.moves & np.isfinite(joints).any(axis=1))
    case.tally.compared("joints", len(at))
    slack = half_digit(case) + 1e-9
    with np.errstate(invalid="ignore"):
        beyond = (joints[at] < low - slack) | (joints[at] > high + slack)
    rows = np.flatnonzero(beyond.any(axis=1))
    scale = case.machine.scale
    for row in rows[:_MOST_TOLD].tolist():
        k = int(np.argmax(beyond[row]))
        unit = "deg" if scale[k] != 1.0 else "mm"
        value = joints[at[row], k] / scale[k]
        case.fail(
            "joints",
            f"{names[k]} goes to {value:.3f} {unit}; its limits are {low[k] / scale[k]:.3f} and"
            f" {high[k] / scale[k]:.3f} {unit}",
            path,
            int(at[row]),
            alike=max(len(rows) - _MOST_TOLD, 0) if row == rows[:_MOST_TOLD][-1] else 0,
        )


def _check_others(case: Case, path: Path) -> None:
    """A pose states no axes beside it. Joints of a machine that has fewer are 0 in those that it
    does not have."""
    if not np.isfinite(path.events.joints).any():
        return
    known = case.machine.columns[case.machine.columns >= 0]
    free = np.setdiff1d(np.arange(path.events.joints.shape[1]), known)
    values = path.events.joints[:, free]
    told = path.moves[:, None] & np.isfinite(values)
    poses = np.isfinite(path.events.position_mm[:, :1])
    moved = told & (poses | ((values != 0.0) & case.machine.known))
    rows = np.flatnonzero(moved.any(axis=1))
    if len(rows):
        row = int(rows[0])
        k = int(np.argmax(moved[row]))
        case.fail(
            "joints",
            f"{case.run.axes[free[k]]} is moved to {values[row, k]:g}, the spec has no such joint",
            path,
            row,
            alike=len(rows) - 1,
        )


def check_joints(case: Case, path: Path, made: Made) -> None:
    """At each hole's standoff, and for poses at its surface too, the joints are those planned."""
    program = case.program
    if program.motion is not None and case.machine.known:
        others = np.arange(len(program.motion.axes)) != program.motion.feed_axis
        at = path.places.joints[made.cores.first]
        planned = program.motion.joints[made.hole]
        slack = np.tile(half_digit(case) + 1e-9, (len(made), 1))
        names = tuple(axis.name for axis in program.motion.axes)
        _compare(case, path, made, at, planned, slack, others, names, "")
        return
    cell = cell_of(case)
    if program.arm is None or cell is None:
        return
    standoff, surface = program.arm.standoff_joints[made.hole], program.arm.joints[made.hole]
    names = tuple(f"A{k + 1}" for k in range(6))
    every = np.ones(6, dtype=np.bool_)
    first = made.cores.first
    if case.arm_by_joints:
        slack = np.full((len(made), 6), case.precision.joint_rad + 1e-6)
        _compare(case, path, made, path.places.joints[first], standoff, slack, every, names, "")
        return
    rotation = path.places.rotation[first]
    there = path.places.position_mm[first]
    inwards = there - rotation[:, :, 2] * made.depth_mm[first][:, None]
    for position, planned, what in (
        (there, standoff, " standoff"),
        (inwards, surface, " surface"),
    ):
        joints = nearest(cell, rotation, position, planned)
        slack = _slack(case, cell, planned, made.hole)
        _compare(case, path, made, joints, planned, slack, every, names, what)
        beyond = (joints < cell.low_rad - slack) | (joints > cell.high_rad + slack)
        for k in np.flatnonzero(beyond.any(axis=1))[:_MOST_TOLD].tolist():
            j = int(np.argmax(beyond[k]))
            case.fail(
                "joints",
                f"A{j + 1} at {case.hole(int(made.hole[k]))} goes to"
                f" {np.degrees(joints[k, j]):.3f} deg, beyond its limits",
                path,
                int(first[k]),
                int(made.hole[k]),
                body=True,
            )


def _compare(
    case: Case,
    path: Path,
    made: Made,
    joints: Floats,
    planned: Floats,
    slack: Floats,
    which: np.ndarray[tuple[int], np.dtype[np.bool_]],
    names: tuple[str, ...],
    what: str,
) -> None:
    """Joints (m, k) against the planned ones; the figure is a share of what is allowed."""
    share = np.where(which, np.abs(joints - planned) / slack, 0.0)
    worst = np.nan_to_num(share, nan=np.inf).argmax(axis=1)
    scale = case.machine.scale if len(case.machine.scale) else np.full(6, np.pi / 180.0)

    def say(k: int) -> tuple[str, Span | None]:
        j = int(worst[k])
        unit = "deg" if scale[j] != 1.0 else "mm"
        return (
            f"{names[j]} at the{what or ' standoff'} of {case.hole(int(made.hole[k]))} is"
            f" {joints[k, j] / scale[j]:.4f} {unit}, {planned[k, j] / scale[j]:.4f} {unit} is"
            " planned",
            None,
        )

    figure = share[np.arange(len(share)), worst]
    case.figures("joints", figure, 1.0, path, made.cores.first, made.hole, say, body=True)


def _slack(case: Case, cell: Cell, planned: Floats, hole: Rows) -> Floats:
    """By how much joints (m, 6) move when the pose is off by what printing makes of it: more where
    the wrist is nearly straight, or its centre near axis 1."""
    moved, turned = case.limits.position_mm[hole], case.limits.angle_rad[hole]
    rotation, position = cell.tool_pose(planned)
    slack = np.zeros_like(planned)
    step_mm, step_rad = 1e-3, 1e-6
    for axis in range(3):
        there = position.copy()
        there[:, axis] += step_mm
        off = np.abs(nearest(cell, rotation, there, planned) - planned)
        slack += off * (moved / step_mm)[:, None]
        turn = np.eye(3)
        a, b = (axis + 1) % 3, (axis + 2) % 3
        turn[b, a], turn[a, b] = step_rad, -step_rad
        off = np.abs(nearest(cell, turn @ rotation, position, planned) - planned)
        slack += off * (turned / step_rad)[:, None]
    return slack * 1.1 + 1e-7

"""Tool and base: those that the spec states, else those that it names."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from drillc.kernels.rotations import angle_between
from drillc.language.job import Pose, Tool

from .case import NOISE_MM, Case
from .events import ToolFrame, placed_of
from .verdict import Rows
from .visits import Path

#: What languages call the flange and the world.
_NONE = ("0", "TOOL0", "WOBJ0", "$NULLFRAME", "$WORLD", "NULLFRAME")


def check_frames(case: Case, path: Path) -> None:
    """Each move in poses is made with the spec's tool, in its base; a move by the joints of an arm
    that is told poses too is made with the tool, whose load counts."""
    program = case.program
    moves = placed_of(path.events.kind)
    poses = moves & np.isfinite(path.events.position_mm[:, 0])
    loaded = moves if program.arm is not None and not case.arm_by_joints else poses
    case.tally.compared("frames", int(np.count_nonzero(loaded)))
    if not loaded.any():
        return
    tool, frame = program.tool, program.frame
    asked = (
        _Asked("tool", None)
        if tool is None
        else _Asked("tool", tool.number, (tool.name.text,), tool.flange_from_tool, tool)
    )
    _check(case, path, np.flatnonzero(loaded), asked)
    asked = (
        _Asked("base", None)
        if frame is None
        else _Asked("base", frame.number, (), frame.world_from_part)
    )
    _check(case, path, np.flatnonzero(poses), asked)


@dataclass(frozen=True, eq=False)
class _Asked:
    """What the spec says of a tool or base: its number, its names, and where it is."""

    what: str
    number: int | None
    names: tuple[str, ...] = ()
    pose: Pose | None = None
    tool: Tool | None = None


def _check(case: Case, path: Path, moves: Rows, asked: _Asked) -> None:
    what = asked.what
    used = getattr(path.events, what)[moves]
    if len(used) and (used == used[0]).all():  # as in most programs
        numbers, first, counts = used[:1], np.zeros(1, dtype=np.intp), np.array([len(used)])
    else:
        numbers, first, counts = np.unique(used, return_index=True, return_counts=True)
    setting = _setting(case, "tooldata" if what == "tool" else "wobjdata")
    for k, index in enumerate(numbers.tolist()):
        wrong = (
            f"no {what} is active"
            if index < 0
            else _wrong(case, case.run.frames[index], asked, setting)
        )
        if wrong:
            event = int(moves[first[k]])
            case.fail("frames", wrong, path, event, alike=int(counts[k]) - 1)


def _wrong(case: Case, frame: ToolFrame, asked: _Asked, setting: str | None) -> str:
    what, number, pose = asked.what, asked.number, asked.pose
    called = re.search(r"(?:^|\[)(\d+)\]?$", frame.name)
    if called is not None and number is not None and int(called[1]) != number:
        return f"{what} {frame.name} is active, the spec asks for {what} {number}"
    if called is not None and number is None and int(called[1]) != 0:
        return f"{what} {frame.name} is active, the spec has none"
    if setting is not None:
        same = frame.name.upper() == setting.upper()
        return "" if same else f"{what} {frame.name} is active, the spec names {setting}"
    if frame.rotation is None or frame.position_mm is None:
        if pose is not None:
            return f"{what} {frame.name} is used, and the program does not state where it is"
        if called is not None or (frame.name.upper() in _NONE and number is None):
            return ""
        known = [name.upper() for name in asked.names]
        return "" if frame.name.upper() in known else f"what {what} {frame.name} is, nobody states"
    if pose is None and number is not None:
        return ""  # the shop's own
    rotation = np.eye(3) if pose is None else pose.rotation
    position = np.zeros(3) if pose is None else pose.translation_mm
    away = float(np.linalg.norm(frame.position_mm - position))
    turned = float(angle_between(frame.rotation, rotation))
    if not away <= np.sqrt(3.0) * case.precision.length_mm + NOISE_MM:
        return f"{what} {frame.name} is {away:.3f} mm away from where the spec has it"
    if not turned <= 3.0 * case.precision.angle_rad + 1e-7:
        return f"{what} {frame.name} is turned {np.degrees(turned):.4f} deg from the spec's"
    return "" if asked.tool is None else _wrong_load(case, frame, asked.tool)


def _wrong_load(case: Case, frame: ToolFrame, tool: Tool) -> str:
    """Mass and centre of gravity, where the spec gives both and the language has them."""
    if not case.states_loads or tool.mass_kg is None or tool.centre_of_gravity_mm is None:
        return ""
    if frame.mass_kg is None or frame.centre_of_gravity_mm is None:
        return f"tool {frame.name} is used, and the program does not state its load"
    half = case.precision.length_mm + NOISE_MM  # kg are printed as mm are
    if not abs(frame.mass_kg - tool.mass_kg) <= half:
        return f"tool {frame.name} has {frame.mass_kg:g} kg, the spec's has {tool.mass_kg:g} kg"
    away = float(np.abs(frame.centre_of_gravity_mm - tool.centre_of_gravity_mm).max())
    if not away <= half:
        return f"the load of tool {frame.name} is {away:.3f} mm away from where the spec has it"
    return ""


def _setting(case: Case, name: str) -> str | None:
    for setting in case.emit.settings:
        if setting.name.text == name:
            return str(setting.value)
    return None

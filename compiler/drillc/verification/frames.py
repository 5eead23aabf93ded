"""Tool and base: those that the spec states, where the program states them, else by their name."""

from __future__ import annotations

import re

import numpy as np

from drillc.kernels.rotations import angle_between
from drillc.language.job import Pose

from .case import NOISE_MM, Case
from .events import Kind, ToolFrame
from .visits import Path

#: What languages call the flange and the world.
_NONE = ("0", "TOOL0", "WOBJ0", "$NULLFRAME", "$WORLD", "NULLFRAME")


def check_frames(case: Case, path: Path) -> None:
    """Each move in poses is made with the spec's tool, in its base."""
    program = case.program
    moves = np.isin(path.events.kind, (int(Kind.STRAIGHT), int(Kind.JOINTS)))
    poses = np.flatnonzero(moves & np.isfinite(path.events.position_mm[:, 0]))
    case.tally.compared("frames", len(poses))
    if not len(poses):
        return
    tool, frame = program.tool, program.frame
    number = None if tool is None else tool.number
    names = () if tool is None else (tool.name.text,)
    _check(
        case, path, poses, "tool", number, names, None if tool is None else tool.flange_from_tool
    )
    pose = None if frame is None else frame.world_from_part
    number = None if frame is None else frame.number
    _check(case, path, poses, "base", number, (), pose)


def _check(
    case: Case,
    path: Path,
    poses: np.ndarray[tuple[int], np.dtype[np.intp]],
    what: str,
    number: int | None,
    names: tuple[str, ...],
    pose: Pose | None,
) -> None:
    used = getattr(path.events, what)[poses]
    numbers, first, counts = np.unique(used, return_index=True, return_counts=True)
    setting = _setting(case, "tooldata" if what == "tool" else "wobjdata")
    for k, index in enumerate(numbers.tolist()):
        wrong = (
            f"no {what} is active"
            if index < 0
            else _wrong(case, case.run.frames[index], what, number, names, pose, setting)
        )
        if wrong:
            event = int(poses[first[k]])
            case.fail("frames", wrong, path, event, alike=int(counts[k]) - 1)


def _wrong(
    case: Case,
    frame: ToolFrame,
    what: str,
    number: int | None,
    names: tuple[str, ...],
    pose: Pose | None,
    setting: str | None,
) -> str:
    called = re.search(r"(?:^|\[)(\d+)\]?$", frame.name)
    if called is not None and number is not None and int(called[1]) != number:
        return f"{what} {frame.name} is active, the spec asks for {what} {number}"
    if called is not None and number is None and int(called[1]) != 0:
        return f"{what} {frame.name} is active, the spec has none"
    if setting is not None:
        same = frame.name.upper() == setting.upper()
        return "" if same else f"{what} {frame.name} is active, the spec names {setting}"
    if frame.rotation is None or frame.position_mm is None:
        if called is not None or (frame.name.upper() in _NONE and number is None):
            return ""
        known = [name.upper() for name in names]
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
    return ""


def _setting(case: Case, name: str) -> str | None:
    for setting in case.emit.settings:
        if setting.name.text == name:
            return str(setting.value)
    return None

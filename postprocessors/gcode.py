"""G-code as LinuxCNC reads it (RS274/NGC), for programs in joints, any joint on any letter.

A process is an O-word subroutine, called once per hole. Where one axis feeds the tool, it is given
that axis's place at the hole and the depth. An arm moves all of its joints to go straight: each
hole brings them at places along the tool's axis, and the routine goes from one to the next
(`_gcode_arm.py`). A program in poses without an arm is refused: no robot stands behind it.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

import numpy as np
from drillc.language.diagnostics import Label, Report
from drillc.output.acceptance import ANY_MAKER
from drillc.output.names import Kind, NameRules
from drillc.output.numbers import Column, Fixed, fixed
from drillc.output.post import Accepts, PostProcessor, Task
from drillc.planning.program import (
    Cycle,
    JointMotion,
    MoveTo,
    Plunge,
    SetAnalog,
    StartSpindle,
    WaitInput,
)

from ._gcode_arm import (
    ANGLE_DECIMALS,
    LETTERS,
    TURNING,
    arm_context,
    hole_columns,
    via_columns,
    warn_of_lengths,
)
from ._robot import clear_of_all_mm

LENGTH_DECIMALS = 4
FEED_DECIMALS = 3
TIME_DECIMALS = 3
SHARE_DECIMALS = 5


class GcodePost(PostProcessor):
    """LinuxCNC: `{program}.ngc`, and a subroutine file per module when there are several."""

    name: ClassVar[str] = "gcode"
    title: ClassVar[str] = "G-code for LinuxCNC (RS274/NGC), joints on X Y Z A B C U V W"
    accepts: ClassVar[Accepts] = Accepts(
        joints=True,
        arms=("kuka", "abb", ANY_MAKER),
        spindle="native",
        axes=LETTERS,
        inputs=range(64),
        outputs=range(64),
        analogs=range(64),
    )
    # LinuxCNC lower-cases O-names and looks for files by them, so everything is lower case. Lines
    # may have 252 characters; a name never comes near that.
    names: ClassVar[NameRules] = NameRules(max_length=60, lower=True)
    named: ClassVar[tuple[Kind, ...]] = ("program", "module", "process")
    files: ClassVar[dict[str, str]] = {"{program}.ngc": "gcode/program.ngc.j2"}
    split_files: ClassVar[dict[str, str]] = {
        "{program}.ngc": "gcode/main.ngc.j2",
        "{module}.ngc": "gcode/part.ngc.j2",
    }
    holes_per_module: ClassVar[int] = 10_000
    newline = "\n"
    length_decimals: ClassVar[int] = LENGTH_DECIMALS
    # Comments do not nest; and ; would begin another kind of comment in some readers.
    comment_forbidden: ClassVar[str] = "();"
    hole_line: ClassVar[str] = r"\(hole (.*)\)"
    filters: ClassVar[dict[str, Callable[[float], str]]] = {
        "per_minute": lambda per_second: per_minute(per_second),
        "rpm": lambda rev_s: rpm(rev_s),
        "length": lambda mm: fixed(mm, LENGTH_DECIMALS),
        "time": lambda seconds: fixed(seconds, TIME_DECIMALS),
        "share": lambda share: fixed(share, SHARE_DECIMALS),
    }

    def check(self, task: Task, report: Report) -> None:
        """Speeds and times that vanish when written, and axes of another kind than the joint."""
        for cycle in task.program.cycles:
            _check_vanishing(cycle, task, report)
            _check_analogs(cycle, task, report)
        if task.program.motion is None:
            warn_of_lengths(task, report)
        else:
            _warn_of_kinds(task.program.motion, task, report)

    def columns(self, task: Task) -> dict[str, Column]:
        """A column per letter; `feed`, the feed axis at the hole; `withdraw`, where it waits. An
        arm has none of these: see `_gcode_arm.hole_columns`."""
        motion = task.program.motion
        if motion is None:
            return hole_columns(task)
        columns: dict[str, Column] = {
            letter: _joint_column(motion, joint) for joint, letter in enumerate(task.axes)
        }
        columns["feed"] = columns[task.axes[motion.feed_axis]]
        columns["withdraw"] = Fixed(motion.withdraw_mm, LENGTH_DECIMALS)
        return columns

    def via_columns(self, task: Task) -> dict[str, Column]:
        return via_columns(task)

    def context(self, task: Task) -> dict[str, object]:
        """`feed_axis` and `other_axes` (letters), `joints` (joint, letter), `clear`, where the feed
        axis is out of reach of all holes, and the depths: `at`
        writes a fixed depth as a place of the feed axis, `deeper` is the sign of going deeper,
        `bottom` the parameter that has the hole's own. An arm has no `feed_axis`."""
        motion = task.program.motion
        if motion is None:
            return {"feed_axis": "", "bottom": "#1", **arm_context(task)}
        feed = task.axes[motion.feed_axis]
        return {
            "feed_axis": feed,
            "clear": fixed(clear_of_all_mm(task.program, motion), LENGTH_DECIMALS),
            "bottom": "#2",
            "other_axes": tuple(x for x in LETTERS if x in task.axes and x != feed),
            "joints": tuple(zip((axis.name for axis in motion.axes), task.axes, strict=True)),
            "at": lambda depth_mm: place_at(depth_mm, motion.feed_sign),
            "deeper": "+" if motion.feed_sign > 0 else "-",
        }


def place_at(depth_mm: float, feed_sign: int) -> str:
    """The feed axis's place at `depth_mm`, from #1, its place at the hole.

    >>> place_at(-60.0, 1), place_at(-60.0, -1), place_at(0.0, 1)
    ('[#1 - 60.0000]', '[#1 + 60.0000]', '#1')
    """
    size = fixed(abs(depth_mm), LENGTH_DECIMALS)
    if float(size) == 0.0:
        return "#1"
    return f"[#1 {'+' if depth_mm * feed_sign > 0 else '-'} {size}]"


def _joint_column(motion: JointMotion, joint: int) -> Fixed:
    """Lengths in mm, angles in degrees."""
    values = motion.joints[:, joint]
    if motion.axes[joint].rotary:
        return Fixed(np.degrees(values), ANGLE_DECIMALS)
    return Fixed(values, LENGTH_DECIMALS)


def per_minute(per_second: float) -> str:
    """A feed: mm/s as F counts it, in mm/min."""
    return fixed(per_second * 60.0, FEED_DECIMALS)


def rpm(rev_s: float) -> str:
    """A spindle speed: rev/s as S counts it."""
    return fixed(rev_s * 60.0, FEED_DECIMALS)


def _warn_of_kinds(motion: JointMotion, task: Task, report: Report) -> None:
    joints = {axis.name: axis for axis in motion.axes}
    for joint, target in task.emit.axes:
        axis, letter = joints.get(joint.text), target.text.upper()
        if axis is None or letter not in LETTERS or axis.rotary == (letter in TURNING):
            continue
        report.warn(
            "W650",
            f"joint {axis.name} {'turns' if axis.rotary else 'slides'}, but {letter} is"
            f" {'a length' if axis.rotary else 'an angle'}: its"
            f" {'degrees' if axis.rotary else 'mm'} are written as plain numbers",
            target.span,
            hint="X Y Z U V W are lengths and A B C angles, unless the machine's configuration"
            " says otherwise",
        )


def _check_vanishing(cycle: Cycle, task: Task, report: Report) -> None:
    """F0 never moves, and M66 with Q0 does not wait: neither may come from rounding."""
    for step in (*cycle.steps, *cycle.fault):
        numbers: list[tuple[str, str, float]] = []
        match step:
            case MoveTo():
                numbers = [("a speed", per_minute(step.speed_mm_s), step.speed_mm_s)]
            case Plunge():
                numbers = [("a feed", per_minute(step.feed_mm_s), step.feed_mm_s)]
                if step.peck_mm is not None:
                    numbers += [
                        ("a return speed", per_minute(step.return_mm_s), step.return_mm_s),
                        ("a peck", fixed(step.peck_mm, LENGTH_DECIMALS), step.peck_mm),
                    ]
            case StartSpindle():
                numbers = [("a spindle speed", rpm(step.rev_s), step.rev_s)]
            case WaitInput():
                numbers = [("a timeout", fixed(step.timeout_s, TIME_DECIMALS), step.timeout_s)]
        for what, text, value in numbers:
            if float(text) <= 0.0:
                report.error(
                    "E651",
                    f"process {cycle.process.name} has {what} of {value:g}, which is written as"
                    f" {text}: the machine would stand still",
                    cycle.process.span or task.emit.post.span,
                    hint="check its unit",
                )


def _check_analogs(cycle: Cycle, task: Task, report: Report) -> None:
    """M68 is given a share of the full scale, so the scale must be known and must reach so far."""
    for step in (*cycle.steps, *cycle.fault):
        signal = task.program.signals.get(step.role) if isinstance(step, SetAnalog) else None
        if signal is None or not isinstance(step, SetAnalog):
            continue  # a signal that is missing is reported by the base
        if not signal.full_scale:
            report.error(
                "E624",
                f"{signal.role} is written as a share of its full scale, which io does not state",
                signal.span,
                hint=f"say what it stands for: {signal.role} analog {signal.number} full …",
            )
        elif not 0.0 <= step.value <= signal.full_scale:
            report.error(
                "E623",
                f"process {cycle.process.name} sets {signal.role} to {step.value:g}; its full scale"
                f" is {signal.full_scale:g}",
                cycle.process.span or signal.span,
                labels=[Label(signal.span, "its full scale")],
                hint="correct the value, or the signal's full scale",
            )

"""G-code as LinuxCNC reads it (RS274/NGC), for programs in joints.

A process is an O-word subroutine, called once per hole with the feed axis's place at the hole and
the depth. Any joint may be on any of the nine letters. A program in poses is refused: LinuxCNC's
letters are joints here, and no robot stands behind them.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from drillc.language.diagnostics import Label, Report
from drillc.output.names import Kind, NameRules
from drillc.output.numbers import Column, Fixed, fixed
from drillc.output.post import Accepts, PostProcessor, Task
from drillc.planning.program import Cycle, JointMotion, MoveTo, Plunge, StartSpindle, WaitInput

LENGTH_DECIMALS = 4
ANGLE_DECIMALS = 5
#: In the order in which one writes them.
LETTERS = ("X", "Y", "Z", "A", "B", "C", "U", "V", "W")
_TURNING = ("A", "B", "C")


class GcodePost(PostProcessor):
    """LinuxCNC: `{program}.ngc`, and a subroutine file per module when there are several."""

    name: ClassVar[str] = "gcode"
    title: ClassVar[str] = "G-code for LinuxCNC (RS274/NGC), joints on X Y Z A B C U V W"
    accepts: ClassVar[Accepts] = Accepts(
        joints=True,
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
    comment_forbidden: ClassVar[str] = "()"

    def check(self, task: Task, report: Report) -> None:
        motion = task.program.motion
        if motion is None:
            return
        _check_small_numbers(task, report)
        for joint, (named, target) in _mapped(motion, task):
            turning = target in _TURNING
            if motion.axes[joint].rotary != turning:
                is_, wants = ("turns", "mm") if motion.axes[joint].rotary else ("slides", "degrees")
                report.warn(
                    "W650",
                    f"joint {motion.axes[joint].name} {is_}, but {target} counts in {wants}: its"
                    f" {'degrees' if wants == 'mm' else 'mm'} are written as they are",
                    named,
                    hint="make sure that the machine's configuration has this axis so",
                )

    def columns(self, task: Task) -> dict[str, Column]:
        """`withdraw` and `feed` (the feed axis at the hole), and each letter's own place."""
        motion = task.program.motion
        assert motion is not None
        columns: dict[str, Column] = {
            letter: _joint_column(motion, joint) for joint, letter in enumerate(task.axes)
        }
        columns["feed"] = columns[task.axes[motion.feed_axis]]
        columns["withdraw"] = Fixed(motion.withdraw_mm, LENGTH_DECIMALS)
        return columns

    def context(self, task: Task) -> dict[str, object]:
        motion = task.program.motion
        assert motion is not None
        feed = task.axes[motion.feed_axis]
        return {
            "feed_axis": feed,
            "other_axes": tuple(x for x in LETTERS if x in task.axes and x != feed),
            "joints": tuple(zip((axis.name for axis in motion.axes), task.axes, strict=True)),
            "at": lambda depth_mm: _at(depth_mm, motion.feed_sign),
            "sign": "+" if motion.feed_sign > 0 else "-",
        }

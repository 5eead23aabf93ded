"""The Boreas controller, which does not exist: one small class and a folder of templates.

Boreas takes poses (a position and a quaternion) and joints, has names of at most 16 characters in
which case matters, and quotes texts.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from drillc.language.diagnostics import Report
from drillc.language.job import Pose
from drillc.output.names import NameRules
from drillc.output.numbers import Column, Fixed, fixed
from drillc.output.post import Accepts, Option, PostProcessor, Task
from scipy.spatial.transform import Rotation

AXES = tuple(f"J{i}" for i in range(1, 10))


def _place(pose: Pose) -> str:
    """x y z, and a quaternion w x y z in brackets."""
    x, y, z, w = Rotation.from_matrix(pose.rotation).as_quat()
    lengths = " ".join(fixed(value, 3) for value in pose.translation_mm)
    return f"{lengths} [{' '.join(fixed(value, 9) for value in (w, x, y, z))}]"


class BoreasPost(PostProcessor):
    """One .bor file; with several modules, a main file that chains parts."""

    name = "boreas"
    title = "Boreas (invented, for drillc's own tests)"
    accepts = Accepts(poses=True, joints=True, axes=AXES, inputs=range(1, 33), outputs=range(1, 33))
    names = NameRules(
        max_length=16,
        case_sensitive=True,
        keywords=frozenset({"program", "routine", "end", "point", "axes", "run", "chain"}),
        reserved=frozenset({"here", "depth"}),
    )
    options = (Option("blend", "number", 0.0, "length", low=0.0, high=50.0),)
    files: ClassVar[dict[str, str]] = {"{program}.bor": "templates/program.bor.j2"}
    split_files: ClassVar[dict[str, str]] = {
        "{program}.bor": "templates/main.bor.j2",
        "{module}.bor": "templates/part.bor.j2",
    }
    holes_per_module = 500
    newline = "\n"
    template_package = "boreas_post"
    comment_forbidden = '"\\'
    hole_line = r"run \w+ at (\w+) .*"

    def check(self, task: Task, report: Report) -> None:
        if task.program.motion is None and task.program.tool is None:
            report.error("E901", "boreas needs to know the tool", task.emit.post.span)

    def columns(self, task: Task) -> dict[str, Column]:
        motion = task.program.motion
        if motion is None:
            quaternions = Rotation.from_matrix(task.program.part_from_tool).as_quat()
            columns: dict[str, Column] = {
                letter: Fixed(task.program.holes.position_mm[:, i], 3)
                for i, letter in enumerate("xyz")
            }
            for i, letter in enumerate("xyzw"):
                columns[f"q{letter}"] = Fixed(quaternions[:, i], 9)
            return columns
        columns = {"withdraw": Fixed(motion.withdraw_mm, 4)}
        for i, axis in enumerate(motion.axes):
            values = motion.joints[:, i]
            columns[task.axes[i]] = Fixed(np.degrees(values) if axis.rotary else values, 5)
        return columns

    def context(self, task: Task) -> dict[str, object]:
        motion = task.program.motion
        if motion is None:
            tool, frame = task.program.tool, task.program.frame
            tool_text = f"{tool.number} {_place(tool.flange_from_tool)}" if tool else ""
            base_text = "0" if frame is None else str(frame.number)
            if frame is not None and frame.world_from_part is not None:
                base_text += f" {_place(frame.world_from_part)}"
            return {"joints": False, "tool_text": tool_text, "base_text": base_text}
        return {"joints": True, "feed": task.axes[motion.feed_axis], "sign": motion.feed_sign}

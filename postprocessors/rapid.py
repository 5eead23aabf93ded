"""ABB RAPID: one module and its .pgf, or a main module and parts for a long program.

Programs in poses give one robtarget a hole and one procedure a process, which moves along the
tool's axis by RelTool. With an arm, its vias are data beside the holes. Programs in joints give one
jointtarget a hole; the procedure moves single axes. An external axis alone has a speed in mm/s
(`v_leax`), so a drill can be fed by one; a joint on a robot axis (`rax_…`) has none that is exact,
so there only visits and rivets are written.

RAPID knows data and signals by name: tool and work object are declared from the spec, or are the
cell's own where the settings `tooldata` and `wobjdata` name them; a signal is its alias in io, else
its role.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from drillc.kernels.rotations import quaternion_from_matrix
from drillc.language.diagnostics import Label, Report
from drillc.language.job import Floats, Pose, Tool
from drillc.output.acceptance import ANY_MAKER
from drillc.output.numbers import Column, Fixed, Whole, fixed
from drillc.output.post import Accepts, Option, PostProcessor, Task
from drillc.planning.program import ArmMotion, JointMotion, Plunge

from ._configuration import abb_cfx, abb_quadrants
from ._rapid_names import RULES, check_names, signal_name, tool_name, wobj_name
from ._robot import (
    analog_shown,
    check_fault,
    check_full_scale,
    clear_of_all_mm,
    last_row,
    rpm,
    speed_text,
    wait_message,
)

LENGTH_DECIMALS = 3
#: A joint turns the whole part, so its degrees are finer than its millimetres.
ANGLE_DECIMALS = 5
QUATERNION_DECIMALS = 8

#: What stands for "no such axis" in a target.
UNUSED = "9E+09"
ROBOT_AXES = tuple(f"rax_{i}" for i in range(1, 7))
EXTERNAL_AXES = tuple(f"eax_{letter}" for letter in "abcdef")

#: The maker whose arms have configuration data.
MAKER = "abb"


# ── texts and columns ────────────────────────────────────────────────────────────────────────────


def rounded_quaternions(rotations: Floats) -> Floats:
    """Rotations (n, 3, 3) as quaternions (n, 4), w first, that have length 1 *as printed*.

    All components are rounded; then the largest is chosen anew, so that what rounding took from the
    length goes where it turns the tool least. What remains is below one unit of the last digit.
    """
    q = np.round(quaternion_from_matrix(rotations), QUATERNION_DECIMALS)
    rows = np.arange(len(q))
    largest = np.argmax(np.abs(q), axis=1)
    rest = (q * q).sum(axis=1) - q[rows, largest] ** 2
    q[rows, largest] = np.copysign(np.sqrt(1.0 - rest), q[rows, largest])
    return np.round(q, QUATERNION_DECIMALS) + 0.0


def signed_text(depth_mm: float, feed_sign: int) -> str:
    """A depth as it is added to the feed joint: its sign, always, and the joint's sense.

    >>> signed_text(-60.0, 1), signed_text(-60.0, -1), signed_text(0.0, -1)
    ('-60.000', '+60.000', '+0.000')
    """
    text = fixed(feed_sign * depth_mm, LENGTH_DECIMALS)
    return text if text.startswith("-") else f"+{text}"


def _list(values: Floats, decimals: int) -> str:
    return "[" + ",".join(fixed(float(value), decimals) for value in values) + "]"


def _pose_text(pose: Pose) -> str:
    quaternion = rounded_quaternions(pose.rotation[None])[0]
    return (
        f"[{_list(pose.translation_mm, LENGTH_DECIMALS)},{_list(quaternion, QUATERNION_DECIMALS)}]"
    )


def _tooldata(tool: Tool) -> str:
    """A tool that the robot holds. Inertia 0 means a point mass, which RAPID takes as stated."""
    if tool.mass_kg is None or tool.centre_of_gravity_mm is None:  # refused in check
        raise ValueError(f"tool {tool.name.text} has no load")
    centre = _list(tool.centre_of_gravity_mm, LENGTH_DECIMALS)
    load = f"[{fixed(tool.mass_kg, 3)},{centre},[1,0,0,0],0,0,0]"
    return f"[TRUE,{_pose_text(tool.flange_from_tool)},{load}]"


def _wobjdata(world_from_part: Pose) -> str:
    """A work object that stands still in the world; the object frame is the user frame."""
    return f'[FALSE,TRUE,"",{_pose_text(world_from_part)},[[0,0,0],[1,0,0,0]]]'


def _pose_columns(position_mm: Floats, part_from_tool: Floats) -> dict[str, Column]:
    quaternions = rounded_quaternions(part_from_tool)
    columns: dict[str, Column] = {
        "xyz"[i]: Fixed(position_mm[:, i], LENGTH_DECIMALS) for i in range(3)
    }
    for i in range(4):
        columns[f"q{i + 1}"] = Fixed(quaternions[:, i], QUATERNION_DECIMALS)
    return columns


def _configuration_columns(arm: ArmMotion, joints: Floats) -> dict[str, Column]:
    """cf1, cf4, cf6 and cfx of joints (n, 6): 0 for an arm that is not of this maker."""
    data = np.zeros((len(joints), 4), dtype=np.int32)
    if arm.arm.model.maker == MAKER:
        data[:, :3] = abb_quadrants(joints, ANGLE_DECIMALS)
        data[:, 3] = abb_cfx(arm.arm.model.geometry, joints, ANGLE_DECIMALS)
    names = ("cf1", "cf4", "cf6", "cfx")
    return {name: Whole(data[:, i]) for i, name in enumerate(names)}


def _axis_columns(motion: JointMotion, axes: Sequence[str]) -> dict[str, Column]:
    columns: dict[str, Column] = {"withdraw": Fixed(motion.withdraw_mm, LENGTH_DECIMALS)}
    for i, (axis, joint) in enumerate(zip(axes, motion.axes, strict=True)):
        values = motion.joints[:, i]
        columns[axis] = (
            Fixed(np.degrees(values), ANGLE_DECIMALS)
            if joint.rotary
            else Fixed(values, LENGTH_DECIMALS)
        )
    return columns


def _component(axis: str) -> str:
    """Where an axis stands in a jointtarget."""
    return f"{'robax' if axis in ROBOT_AXES else 'extax'}.{axis}"


# ── the post ─────────────────────────────────────────────────────────────────────────────────────


class RapidPost(PostProcessor):
    name = "rapid"
    title = "ABB RAPID (IRC5, OmniCore)"
    accepts = Accepts(
        poses=True,
        joints=True,
        arms=(MAKER, ANY_MAKER),
        joint_feed=True,
        spindle="signals",
        axes=ROBOT_AXES + EXTERNAL_AXES,
        # signals have names here, so their numbers may be anything
        inputs=range(1_000_000),
        outputs=range(1_000_000),
        analogs=range(1_000_000),
    )
    names = RULES
    options = (
        Option("tooldata", "name", None),
        Option("wobjdata", "name", None),
        Option("rotary_speed", "number", None, "turning speed", low=1e-3, high=100.0),
    )
    files: ClassVar = {
        "{program}.mod": "rapid/program.mod.j2",
        "{program}.pgf": "rapid/program.pgf.j2",
    }
    split_files: ClassVar = {
        "{program}.mod": "rapid/main.mod.j2",
        "{module}.mod": "rapid/part.mod.j2",
        "{program}.pgf": "rapid/program.pgf.j2",
    }
    holes_per_module = 1000
    newline = "\r\n"
    filters: ClassVar = {
        "speed": speed_text,
        "rpm": rpm,
        "signed": signed_text,
        "shown_for": lambda value, signal: analog_shown(signal, value),
        "last_row": last_row,
    }

    def check(self, task: Task, report: Report) -> None:
        program = task.program
        _check_tool(task, report)
        if program.motion is None:
            _check_frame(task, report)
        elif task.axes:
            _check_feed(task, program.motion, report)
            if _rotary_speed(task) is None:
                report.error(
                    "E649",
                    "rapid needs to know how fast the rotary external axes may turn",
                    task.emit.post.span,
                    hint="give the joint a speed: robot … { speeds { … } }; or emit rapid "
                    "{ rotary_speed 10 deg/s }",
                )
        check_names(task, report)
        check_full_scale(program, "E646", report)
        for cycle in program.cycles:
            check_fault(cycle)

    def columns(self, task: Task) -> dict[str, Column]:
        program, motion = task.program, task.program.motion
        if motion is not None:
            return _axis_columns(motion, task.axes)
        columns = _pose_columns(program.holes.position_mm, program.part_from_tool)
        if program.arm is not None:
            columns.update(_configuration_columns(program.arm, program.arm.joints))
        return columns

    def via_columns(self, task: Task) -> dict[str, Column]:
        arm = task.program.arm
        assert arm is not None  # nothing else has vias
        columns = _pose_columns(arm.vias.position_mm, arm.vias.part_from_tool)
        columns.update(_configuration_columns(arm, arm.vias.joints))
        joints_deg = np.degrees(arm.vias.joints)
        for i, axis in enumerate(ROBOT_AXES):
            columns[axis] = Fixed(joints_deg[:, i], ANGLE_DECIMALS)
        return columns

    def context(self, task: Task) -> dict[str, object]:
        program, motion, settings = task.program, task.program.motion, task.settings
        tool, frame = program.tool, program.frame
        context: dict[str, object] = {
            "tool_name": tool_name(task),
            "wobj_name": wobj_name(task),
            "tooldata": _tooldata(tool) if tool and not settings["tooldata"] else "",
            "wobjdata": "",
            "signal_names": {r: signal_name(s) for r, s in program.signals.items()},
            "standoffs": [-cycle.process.approach_mm for cycle in program.cycles],
            "wait_message": wait_message,
        }
        if frame and frame.world_from_part and not settings["wobjdata"]:
            context["wobjdata"] = _wobjdata(frame.world_from_part)
        if program.arm is not None:
            home = program.arm.arm.home_rad
            context["home"] = "" if home is None else _list(np.degrees(home), ANGLE_DECIMALS)
            context["robot_axes"] = ROBOT_AXES
        if motion is not None:
            feed = task.axes[motion.feed_axis]
            context["feed"] = _component(feed)
            context["feed_axis"] = feed
            context["feed_sign"] = motion.feed_sign
            context["clear"] = fixed(clear_of_all_mm(program, motion), LENGTH_DECIMALS)
            context["rotary"] = speed_text(np.degrees(_rotary_speed(task) or 0.0))
            context["robot_axes"] = ROBOT_AXES
            context["external_axes"] = EXTERNAL_AXES
            context["others"] = tuple(_component(a) for a in task.axes if a != feed)
            context["unused_external"] = UNUSED
            # An arm with fewer axes has 0 in the rest; a task without an arm has none at all.
            context["unused_robot"] = "0" if set(task.axes) & set(ROBOT_AXES) else UNUSED
        return context


def _rotary_speed(task: Task) -> float | None:
    """rad/s for rotary external axes: the setting, else the slowest of their own speeds.

    Robot axes need none. Where no external axis turns, the value is RAPID's usual one.
    """
    motion = task.program.motion
    if task.settings["rotary_speed"] is not None:
        return float(task.settings["rotary_speed"])
    if motion is None:
        return None
    rotary = [
        speed
        for axis, joint, speed in zip(task.axes, motion.axes, motion.speeds, strict=True)
        if joint.rotary and axis in EXTERNAL_AXES
    ]
    known = [speed for speed in rotary if speed is not None]
    if len(known) < len(rotary):
        return None
    return min(known, default=np.radians(1000.0))


# ── what is checked ──────────────────────────────────────────────────────────────────────────────


def _check_tool(task: Task, report: Report) -> None:
    """A tool without its load would be moved with a guessed one, and miss or stop."""
    tool, span = task.program.tool, task.emit.post.span
    if task.settings["tooldata"]:
        return
    name_it = "name the cell's own: emit rapid { tooldata NAME }"
    if tool is None:
        if task.program.motion is None:
            report.error(
                "E644",
                "rapid needs the tool whose centre point the poses are for",
                span,
                hint=f"describe the tool: tool NAME {{ … }}; or {name_it}",
            )
        return
    stated = {"mass": tool.mass_kg, "centre of gravity": tool.centre_of_gravity_mm}
    missing = [what for what, value in stated.items() if value is None]
    if missing:
        report.error(
            "E643",
            f"rapid moves a tool by its load, but tool {tool.name.text} has no"
            f" {' and no '.join(missing)}",
            span,
            labels=[Label(tool.name.span, "the tool")],
            hint=f"give the tool its mass and cog; or {name_it}",
        )
    elif tool.mass_kg is not None and tool.mass_kg < 0.001:
        report.error(
            "E643",
            f"rapid takes no tool of {tool.mass_kg:g} kg: the least is 0.001 kg",
            span,
            labels=[Label(tool.name.span, "the tool")],
            hint=f"give the tool its mass; or {name_it}",
        )
    elif tool.centre_of_gravity_mm is not None and not np.any(
        np.abs(tool.centre_of_gravity_mm) >= 0.001
    ):
        report.error(
            "E643",
            f"rapid takes no load whose centre of gravity is in the flange, as tool"
            f" {tool.name.text} has it",
            span,
            labels=[Label(tool.name.span, "the tool")],
            hint=f"give the tool its centre of gravity; or {name_it}",
        )


def _check_frame(task: Task, report: Report) -> None:
    frame, span = task.program.frame, task.emit.post.span
    if task.settings["wobjdata"]:
        return
    if frame is None:
        report.warn(
            "W643",
            "the part has no frame, so rapid programs the poses in the world (wobj0)",
            span,
            hint="say where the part stands; or emit rapid { wobjdata NAME }",
        )
    elif frame.world_from_part is None:
        report.error(
            "E645",
            f"rapid knows work objects by name, so frame {frame.number} says nothing to it",
            frame.span,
            labels=[Label(span, "emitted for this controller")],
            hint="say where the part stands; or name the cell's own: emit rapid { wobjdata NAME }",
        )


def _check_feed(task: Task, motion: JointMotion, report: Report) -> None:
    axis, joint = task.axes[motion.feed_axis], motion.axes[motion.feed_axis].name
    if axis in EXTERNAL_AXES:
        return
    for cycle in task.program.cycles:
        if any(isinstance(step, Plunge) for step in cycle.steps):
            place = next((a.span for j, a in task.emit.axes if j.text == joint), None)
            report.error(
                "E648",
                f"process {cycle.process.name} feeds {joint} in mm/s, which rapid can do with an"
                f" external axis, but not with {axis}",
                place or task.emit.post.span,
                labels=[Label(cycle.process.span, "needed here")] if cycle.process.span else [],
                hint=f"map {joint} to one of {', '.join(EXTERNAL_AXES)}",
            )

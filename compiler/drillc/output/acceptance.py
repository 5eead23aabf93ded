"""What every post refuses in the same way: what its `Accepts` says it cannot express."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from drillc.catalogue.model import JOINT_NAMES
from drillc.language.diagnostics import NAMED_ROWS, Label, Report
from drillc.language.fields import did_you_mean
from drillc.language.job import Arm, Emit, Floats, Named, Process
from drillc.output.post import Accepts
from drillc.planning.program import (
    Plunge,
    Program,
    SetAnalog,
    StartSpindle,
    StopSpindle,
    SwitchOutput,
    WaitInput,
)

#: What is reported of a program that is of a kind that the post does not write at all.
KIND_CODES = ("E610", "E611", "E660", "E661")
#: The maker of arms of which it is not known whose controller runs them.
ANY_MAKER = "other"
#: The signals that switch a spindle where the language itself cannot.
SPINDLE_ON, SPINDLE_SPEED, SPINDLE_RUNNING = "spindle_on", "spindle_speed", "spindle_running"


def check_accepted(program: Program, accepts: Accepts, emit: Emit, report: Report) -> None:
    """Report what the controller cannot be told: the kind of program, its feeds, its signals."""
    post, span = emit.post.text, emit.post.span
    if program.arm is not None:
        _check_arm(program.arm.arm, accepts, emit, report)
    elif program.motion is None and not accepts.poses:
        report.error(
            "E610",
            f"{post} writes programs in joints, but this program is in poses",
            span,
            hint="give a robot whose joints drillc solves, or emit for a robot controller",
        )
    if program.motion is not None and not accepts.joints:
        report.error(
            "E611",
            f"{post} writes programs in poses, but this program is in the robot's joints",
            span,
            hint="emit for a controller that is programmed in joints",
        )
    if program.motion is not None and not accepts.joint_feed:
        for cycle in program.cycles:
            if any(isinstance(step, Plunge) for step in cycle.steps):
                report.error(
                    "E618",
                    f"{post} cannot feed a single joint in mm/s, as process"
                    f" {cycle.process.name} needs to drill",
                    span,
                    labels=_process_label(cycle.process),
                    hint="emit for a controller that can, such as gcode",
                )
    _check_signals(program, accepts, emit, report)
    _check_distances(program, accepts, report)


def _check_arm(arm: Arm, accepts: Accepts, emit: Emit, report: Report) -> None:
    """A program for an arm is nothing without its vias, nor on the controller of another maker."""
    post, robot, title = emit.post.text, arm.name.text, arm.model.title
    code = hint = ""
    if not accepts.arms:
        code = "E661"
        what = f"{post} cannot say by which way robot {robot} ({title}) goes to its holes"
        hint = "emit for a controller that can, such as krl or rapid"
    elif arm.model.maker not in accepts.arms:
        code = "E660"
        makers = " and ".join(maker for maker in accepts.arms if maker != ANY_MAKER)
        what = (
            f"{post} is for arms of {makers}, but robot {robot} ({title}) is of {arm.model.maker}"
        )
        hint = "emit for the arm's own controller; or correct the robot's model"
    if code:
        report.error(
            code, what, emit.post.span, labels=[Label(arm.name.span, "the arm")], hint=hint
        )


def mapped_joints(program: Program, accepts: Accepts) -> tuple[str, ...]:
    """The joints that need an axis each: those of a program in joints, and an arm's where the
    controller takes no poses."""
    if not accepts.joints:
        return ()
    if program.motion is not None:
        return tuple(axis.name for axis in program.motion.axes)
    return JOINT_NAMES if program.arm is not None and not accepts.poses else ()


def read_axes(
    joints: Sequence[str], accepts: Accepts, emit: Emit, report: Report
) -> tuple[str, ...]:
    """The controller's axis of each of the joints, in their order; empty after an error."""
    before = len(report.diagnostics)
    if not emit.axes:
        example = "  ".join(f"{j} {a}" for j, a in zip(joints, accepts.axes, strict=False))
        report.error(
            "E612",
            f"{emit.post.text} does not know which axis each joint is",
            emit.post.span,
            hint=f"say it: emit {emit.post.text} {{ axes {{ {example} }} }}",
        )
        return ()
    legal = {axis.lower(): axis for axis in accepts.axes}
    by_joint: dict[str, Named] = {}
    by_axis: dict[str, Named] = {}
    for joint, target in emit.axes:
        axis = legal.get(target.text.lower())
        if joint.text not in joints:
            hint = did_you_mean(joint.text, joints)
            report.error("E613", f"there is no joint {joint.text}", joint.span, hint=hint)
        if axis is None:
            report.error(
                "E615",
                f"{emit.post.text} has no axis {target.text}",
                target.span,
                hint=f"its axes are {', '.join(accepts.axes)}",
            )
        for table, key, place in ((by_joint, joint.text, joint), (by_axis, axis or "", target)):
            if key in table:
                report.error(
                    "E614",
                    f"{key} is mapped twice",
                    place.span,
                    labels=[Label(table[key].span, "first mapped here")],
                )
            elif key:
                table[key] = target
    missing = [joint for joint in joints if joint not in by_joint]
    if missing:
        verb = "is" if len(missing) == 1 else "are"
        report.error(
            "E616",
            f"axes does not say which axis {', '.join(missing)} {verb}",
            emit.axes[0][0].span,
            hint=f"every joint needs an axis; {emit.post.text} has {', '.join(accepts.axes)}",
        )
    if len(report.diagnostics) > before:
        return ()
    return tuple(legal[by_joint[joint].text.lower()] for joint in joints)


def refuse_axes(emit: Emit, report: Report) -> None:
    """An axis map that nothing would use is a misunderstanding: say so."""
    if emit.axes:
        report.error(
            "E617",
            "this program is in poses, so no joint is mapped to an axis",
            emit.axes[0][0].span,
            hint="leave axes out",
        )


def roles_used(program: Program, accepts: Accepts) -> Iterator[tuple[str, str, Process]]:
    """Every signal that the cycles need: its role, its kind, and the process that needs it."""
    for cycle in program.cycles:
        for step in (*cycle.steps, *cycle.fault):
            match step:
                case SwitchOutput():
                    yield step.role, "output", cycle.process
                case SetAnalog():
                    yield step.role, "analog", cycle.process
                case WaitInput():
                    yield step.role, "input", cycle.process
                case StartSpindle() | StopSpindle() if accepts.spindle == "signals":
                    yield SPINDLE_ON, "output", cycle.process


def _check_signals(program: Program, accepts: Accepts, emit: Emit, report: Report) -> None:
    ranges = {"input": accepts.inputs, "output": accepts.outputs, "analog": accepts.analogs}
    needed = {role: (kind, process) for role, kind, process in roles_used(program, accepts)}
    turning = [c.process for c in program.cycles for s in c.steps if isinstance(s, StartSpindle)]
    if turning and SPINDLE_RUNNING in program.signals:  # used when the cell has it
        needed.setdefault(SPINDLE_RUNNING, ("input", turning[0]))
    if turning and accepts.spindle == "signals":
        if SPINDLE_SPEED in program.signals:
            needed.setdefault(SPINDLE_SPEED, ("analog", turning[0]))
        else:
            report.warn(
                "W622",
                f"{emit.post.text} cannot tell the spindle its speed: io gives no {SPINDLE_SPEED}",
                turning[0].span or emit.post.span,
                hint=f"set the speed at the spindle; or add to io: {SPINDLE_SPEED} analog 1 full …",
            )
    for role, (kind, process) in needed.items():
        signal = program.signals.get(role)
        if signal is None or signal.kind != kind:
            report.error(
                "E619",
                f"process {process.name} needs the {kind} {role}, which io does not give",
                process.span or emit.post.span,
                hint=f"add to io: {role} {kind} 1 (its number on the controller)",
            )
        elif signal.number not in ranges[kind]:
            low, high = ranges[kind][0], ranges[kind][-1]
            report.error(
                "E620",
                f"{role} is {kind} {signal.number}; {emit.post.text} has {low} to {high}",
                signal.span,
                labels=[Label(emit.post.span, "emitted for this controller")],
                hint="give the number under which this controller knows the signal",
            )


def _check_distances(program: Program, accepts: Accepts, report: Report) -> None:
    columns: list[tuple[str, Floats]] = [("depth", program.depth_mm)]
    if program.motion is None:
        columns.append(("position", np.abs(program.holes.position_mm).max(axis=1, initial=0.0)))
    else:
        lengths = [i for i, axis in enumerate(program.motion.axes) if not axis.rotary]
        joints = np.abs(program.motion.joints[:, lengths]).max(axis=1, initial=0.0)
        columns += [("joint", joints), ("withdrawal", program.motion.withdraw_mm)]
    for what, values in columns:
        rows = np.flatnonzero(np.abs(values) > accepts.farthest_mm)
        for row in rows[:NAMED_ROWS].tolist():
            report.error(
                "E621",
                f"hole {program.holes.ids[row]}: its {what} reaches {values[row]:.6g} mm; beyond"
                f" {accepts.farthest_mm:g} mm the controller's numbers are too coarse",
                program.holes.span(row),
                hint="check the units; or place the part nearer to its origin",
            )
        if len(rows) > NAMED_ROWS:
            more, span = len(rows) - NAMED_ROWS, program.holes.span(int(rows[NAMED_ROWS]))
            report.error("E621", f"{more} more holes as far out, the first of them here", span)


def _process_label(process: Process) -> list[Label]:
    return [Label(process.span, "needed here")] if process.span else []

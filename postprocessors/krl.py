"""KUKA KRL: a .src and a .dat a program, or a main module and parts for a long one.

Programs in poses give one E6POS a hole and one routine a process, which moves along the tool's axis
by the geometric operator `HOLE:AT`. With an arm, its vias are arrays beside the holes. Programs in
joints give one E6AXIS a hole; the routine moves single axes. KRL has no speed in mm/s for a single
axis, so joints cannot feed a drill here.

Written for KSS 8 (KRC4 and later): the fault message is MsgNotify of R1/System/MsgLib, on which BAS
itself relies there. What is not KSS 8's alone is used in its oldest form.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np
from drillc.catalogue.model import JOINT_NAMES
from drillc.kernels.rotations import kuka_abc_from_matrix
from drillc.language.diagnostics import Label, Report
from drillc.language.job import (
    Floats,
    Ints,
    Pose,
    Signal,
    Texts,
    Tool,
)
from drillc.language.source import Span
from drillc.output.acceptance import ANY_MAKER
from drillc.output.names import NameRules
from drillc.output.numbers import Column, Fixed, Whole, fixed
from drillc.output.post import Accepts, Option, PostProcessor, Task
from drillc.output.vias import plain_kinds
from drillc.planning.program import ArmMotion, JointMotion, Program
from numpy.typing import NDArray

from ._configuration import kuka_status, kuka_turn
from ._robot import (
    analog_shown,
    analog_uses,
    check_fault,
    check_full_scale,
    clear_of_all_mm,
    last_row,
    rpm,
    speed_text,
    wait_message,
)

#: Angles to 1e-4 deg: A, B and C together turn the tool by less than 2e-4 deg, in gimbal lock too.
ANGLE_DECIMALS = 4
#: A joint turns the whole part, and a frame carries it: one digit more, where REAL ends.
FINE_DECIMALS = 5
LENGTH_DECIMALS = 3

#: The maker whose arms have S and T.
MAKER = "kuka"
#: A place is told by S and T only if they stay the same when any axis is off by this much: what
#: rounding to a pose, and the controller's own idea of its arm's dimensions, may come to. T is 1
#: below 0 deg, so an axis that stands at -0.01 deg would be sent once around for a hair's breadth.
_STEADY_RAD = np.radians(0.1)

#: TOOL_DATA and BASE_DATA begin at 1 (0 is the flange, and the world); 128 is KSS 8's largest.
FRAME_NUMBERS = range(1, 129)

KEYWORDS = frozenset(
    """
    AND ANIN ANOUT ASYPTP AXIS BOOL BRAKE B_AND B_EXOR B_NOT B_OR CASE CAST_FROM CAST_TO CCLOSE
    CHANNEL CHAR CIRC CIRC_REL CONFIRM CONST CONST_KEY CONTINUE COPEN CREAD CWRITE C_DIS C_ORI
    C_PTP C_SPL C_VEL DECL DEF DEFAULT DEFDAT DEFFCT DELAY DIGIN DISTANCE DO DRIVE E3AXIS E3POS
    E6AXIS E6POS ELSE ELSEIF END ENDDAT ENDFCT ENDFOR ENDIF ENDLOOP ENDSPLINE ENDSWITCH ENDWHILE
    ENUM ERR_RAISE EXIT EXOR EXT EXTFCT FALSE FOR FRAME GLOBAL GOTO HALT IF IMPORT IN INOUT INT
    INTERRUPT IS LIN LIN_REL LOOP MAXIMUM MINIMUM NOT OFF ON ONPATH ON_ERROR_PROCEED OR OUT PATH
    POS PRIO PTP PTP_REL PTP_SPLINE PUBLIC PULSE REAL REPEAT RESUME RETURN SCIRC SCIRC_REL SEC
    SIGNAL SLIN SLIN_REL SPL SPLINE SPL_REL SPTP SPTP_REL SREAD STEP STOP STRUC SWITCH SWRITE SYN
    SYNC TASK THEN TIME_BLOCK TO TRIGGER TRUE UNTIL WAIT WHEN WHILE WITH
    """.split()  # noqa: SIM905 (a table of words)
)
#: Names of the controller, which share the one name space, and names of the templates.
RESERVED = frozenset(
    """
    ABS ACOS ATAN2 COS SIN SQRT TAN ROUND FORWARD INVERSE VARSTATE STRADD STRCLEAR STRCOMP STRCOPY
    STRDECLLEN STRFIND STRLEN SET_KRLMSG EXISTS_KRLMSG CLEAR_KRLMSG MSGNOTIFY MSGQUIT MSGSTATE
    MSGLOOP MSGDIALOG MSGLIB BAS BAS_COMMAND CELL IR_STOPM P00 SPS SUCCESS USER USER_GRP
    TOOL_DATA BASE_DATA LOAD_DATA TOOL_NAME BASE_NAME TOOL_CORR BASE_CORR LOAD MACHINE_DEF
    FDAT PDAT LDAT FDAT_ACT PDAT_ACT LDAT_ACT HOME XHOME FHOME PDEFAULT LDEFAULT INITMOV FRAMES
    LAST_BASIS LAST_TP_PARAMS
    HOLE DEPTH WITHDRAW AT NOW BOTTOM STANDOFF VIA_HOME VIA_PTP VIA_AXIS VIA_LIN
    """.split()  # noqa: SIM905 (a table of words)
)


# ── texts ────────────────────────────────────────────────────────────────────────────────────────


def share_text(value: float, signal: Signal) -> str:
    """What $ANOUT is set to: the share of the signal's full scale, 0 to 1."""
    if signal.full_scale is None:  # refused in check
        raise ValueError(f"{signal.role} has no full scale")
    return fixed(value / signal.full_scale, 6)


def signed_text(depth_mm: float, feed_sign: int) -> str:
    """A depth as it is added to the feed joint: its sign, always, and the joint's sense.

    >>> signed_text(-60.0, 1), signed_text(-60.0, -1), signed_text(0.0, -1)
    ('-60.000', '+60.000', '+0.000')
    """
    text = fixed(feed_sign * depth_mm, LENGTH_DECIMALS)
    return text if text.startswith("-") else f"+{text}"


def _frame_text(pose: Pose) -> str:
    """The inside of a FRAME: X, Y, Z in mm and A, B, C in degrees."""
    abc_deg = np.degrees(kuka_abc_from_matrix(pose.rotation))
    place = _parts("XYZ", pose.translation_mm, LENGTH_DECIMALS)
    return f"{place},{_parts('ABC', abc_deg, FINE_DECIMALS)}"


def _load_text(tool: Tool) -> str:
    """The inside of a LOAD, where the spec states it; the controller's own data is used otherwise.

    Inertia 0 makes BAS take the controller's default for it.
    """
    if tool.mass_kg is None or tool.centre_of_gravity_mm is None:
        return ""
    centre = _parts("XYZ", tool.centre_of_gravity_mm, LENGTH_DECIMALS)
    return f"M {fixed(tool.mass_kg, 3)},CM {{{centre},A 0.0,B 0.0,C 0.0}},J {{X 0.0,Y 0.0,Z 0.0}}"


def _parts(names: Sequence[str], values: Floats, decimals: int) -> str:
    return ",".join(
        f"{name} {fixed(float(value), decimals)}" for name, value in zip(names, values, strict=True)
    )


def _axis_columns(motion: JointMotion, axes: Sequence[str]) -> dict[str, Column]:
    columns: dict[str, Column] = {"withdraw": Fixed(motion.withdraw_mm, LENGTH_DECIMALS)}
    for i, (axis, joint) in enumerate(zip(axes, motion.axes, strict=True)):
        values = motion.joints[:, i]
        columns[axis] = (
            Fixed(np.degrees(values), FINE_DECIMALS)
            if joint.rotary
            else Fixed(values, LENGTH_DECIMALS)
        )
    return columns


def _pose_columns(position_mm: Floats, part_from_tool: Floats) -> dict[str, Column]:
    abc_deg = np.degrees(kuka_abc_from_matrix(part_from_tool))
    columns: dict[str, Column] = {}
    for i in range(3):
        columns["xyz"[i]] = Fixed(position_mm[:, i], LENGTH_DECIMALS)
        columns["abc"[i]] = Fixed(abc_deg[:, i], ANGLE_DECIMALS)
    return columns


def _status_columns(arm: ArmMotion, joints: Floats) -> dict[str, Column]:
    """S and T of joints (n, 6); none for an arm that is no KUKA."""
    if arm.arm.model.maker != MAKER:
        return {}
    status, turn = _status_and_turn(arm, joints)
    return {"s": Whole(status), "t": Whole(turn)}


def _status_and_turn(arm: ArmMotion, joints: Floats) -> tuple[Ints, Ints]:
    geometry = arm.arm.model.geometry
    return kuka_status(geometry, joints, FINE_DECIMALS), kuka_turn(joints, FINE_DECIMALS)


def told_by_status(arm: ArmMotion, joints: Floats) -> NDArray[np.bool_]:
    """Which joints (n, 6) an E6POS tells: S and T are unmistakable, and no axis is beyond half a
    turn. T is an axis's sign, which says where it is up to a whole turn, but only an E6AXIS says it
    whatever the controller takes for the axis's range."""
    told: NDArray[np.bool_] = np.all(np.abs(joints) < np.pi - _STEADY_RAD, axis=1)
    if arm.arm.model.maker != MAKER:
        return np.zeros_like(told)
    meant = _status_and_turn(arm, joints)
    for axis in range(6):
        for off_rad in (-_STEADY_RAD, _STEADY_RAD):
            near = joints.copy()
            near[:, axis] += off_rad
            for bits, own in zip(_status_and_turn(arm, near), meant, strict=True):
                told &= bits == own
    return told


# ── the post ──────────────────────────────────────────────────────────────────────────────────────


class KrlPost(PostProcessor):
    name = "krl"
    title = "KUKA KRL (KRC4 and later)"
    accepts = Accepts(
        poses=True,
        joints=True,
        arms=(MAKER, ANY_MAKER),
        joint_feed=False,
        spindle="signals",
        axes=tuple(f"A{i}" for i in range(1, 7)) + tuple(f"E{i}" for i in range(1, 7)),
        inputs=range(1, 8193),
        outputs=range(1, 8193),
        analogs=range(1, 33),
    )
    names = NameRules(max_length=24, keywords=KEYWORDS, reserved=RESERVED)
    options = (
        Option("velocity", "number", 0.10, "share", low=0.01, high=1.0),
        Option("timer", "count", 16, low=1, high=64),
    )
    files: ClassVar = {
        "{program}.src": "krl/program.src.j2",
        "{program}.dat": "krl/program.dat.j2",
    }
    split_files: ClassVar = {
        "{program}.src": "krl/main.src.j2",
        "{program}.dat": "krl/main.dat.j2",
        "{module}.src": "krl/part.src.j2",
        "{module}.dat": "krl/part.dat.j2",
    }
    holes_per_module = 800
    newline = "\r\n"
    comment_forbidden = ";%"  # a FOLD line's second ; begins what the editor hides
    filters: ClassVar = {
        "m_per_s": lambda mm_s: speed_text(mm_s / 1000.0),
        "milliseconds": lambda seconds: math.ceil(round(seconds * 1000.0, 6)),
        "share_of": share_text,
        "shown_for": lambda value, signal: analog_shown(signal, value),
        "signed": signed_text,
        "rpm": rpm,
        "last_row": last_row,
    }

    def check(self, task: Task, report: Report) -> None:
        program, span = task.program, task.emit.post.span
        if program.motion is None:
            if program.tool is None:
                report.error(
                    "E626",
                    "krl needs the number of the tool whose centre point the poses are for",
                    span,
                    hint="describe the tool: tool NAME { number 1  tcp … }",
                )
            if program.frame is None:
                report.warn(
                    "W623",
                    "the part has no frame, so krl programs the poses in $WORLD (base 0)",
                    span,
                    hint="give the part its base: part NAME { … frame 1 }",
                )
        else:
            _warn_of_speeds(program, span, report)
        for what, number, place in _frame_numbers(program):
            if number not in FRAME_NUMBERS:
                report.error(
                    "E625",
                    f"krl has no {what} {number}: the numbers are {FRAME_NUMBERS[0]} to"
                    f" {FRAME_NUMBERS[-1]}",
                    place,
                    labels=[Label(span, "emitted for this controller")],
                    hint="number it as on the controller",
                )
        _check_scales(program, report)
        check_full_scale(program, "E623", report)
        for cycle in program.cycles:
            check_fault(cycle)

    def columns(self, task: Task) -> dict[str, Column]:
        program = task.program
        if program.motion is not None:
            return _axis_columns(program.motion, task.axes)
        columns = _pose_columns(program.holes.position_mm, program.part_from_tool)
        if program.arm is not None:
            columns.update(_status_columns(program.arm, program.arm.joints))
        return columns

    def via_kinds(self, task: Task) -> Texts:
        """`joints` become `pose`, reached by its S and T, or `axes` where these say too little."""
        arm = task.program.arm
        assert arm is not None  # nothing else has vias
        kinds = plain_kinds(arm)
        told = np.where(told_by_status(arm, arm.vias.joints), "pose", "axes")
        return np.where(kinds == "joints", told, kinds)

    def via_columns(self, task: Task) -> dict[str, Column]:
        arm = task.program.arm
        assert arm is not None
        columns = _pose_columns(arm.vias.position_mm, arm.vias.part_from_tool)
        columns.update(_status_columns(arm, arm.vias.joints))
        joints_deg = np.degrees(arm.vias.joints)
        for i, axis in enumerate(JOINT_NAMES):
            columns[axis] = Fixed(joints_deg[:, i], FINE_DECIMALS)
        return columns

    def context(self, task: Task) -> dict[str, object]:
        program, motion = task.program, task.program.motion
        frame = program.frame
        context: dict[str, object] = {
            "velocity": speed_text(task.settings["velocity"] * 100.0, 1),
            "timer": task.settings["timer"],
            "tool_data": _frame_text(program.tool.flange_from_tool) if program.tool else "",
            "load_data": _load_text(program.tool) if program.tool else "",
            "base_data": "",
            "wait_message": wait_message,
        }
        if frame is not None and frame.world_from_part is not None:
            context["base_data"] = _frame_text(frame.world_from_part)
        if program.arm is not None:
            arm = program.arm.arm
            context["home"] = ""
            if arm.home_rad is not None:
                context["home"] = _parts(JOINT_NAMES, np.degrees(arm.home_rad), FINE_DECIMALS)
            context["has_status"] = arm.model.maker == MAKER
            context["joint_names"] = JOINT_NAMES
        if motion is not None:
            context["feed"] = task.axes[motion.feed_axis]
            context["feed_sign"] = motion.feed_sign
            context["clear"] = fixed(clear_of_all_mm(program, motion), LENGTH_DECIMALS)
            context["moved"] = tuple(axis for axis in self.accepts.axes if axis in task.axes)
        return context


# ── what is checked ──────────────────────────────────────────────────────────────────────────────


def _frame_numbers(program: Program) -> Iterator[tuple[str, int, Span]]:
    if program.tool is not None:
        yield "tool", program.tool.number, program.tool.name.span
    if program.frame is not None:
        yield "base", program.frame.number, program.frame.span


def _warn_of_speeds(program: Program, emit_span: Span, report: Report) -> None:
    """Speeds along the tool's axis are stated in mm/s, and an axis alone has none."""
    for cycle in program.cycles:
        process = cycle.process
        report.warn(
            "W624",
            f"krl moves single axes at a share of their full speed, so process {process.name} does"
            f" not keep its speeds (approach {process.approach_mm_s:g} mm/s, retract"
            f" {process.retract_mm_s:g} mm/s, travel {process.travel_mm_s:g} mm/s)",
            process.span or emit_span,
            labels=[Label(emit_span, "emitted in joints")],
            hint="choose the share: emit krl { velocity 10 % }; or emit for a controller that can",
        )


def _check_scales(program: Program, report: Report) -> None:
    """$ANOUT is a share of the full scale, so that must be known: once for each signal."""
    unknown: dict[str, Signal] = {}
    for _, signal, _ in analog_uses(program):
        if signal.full_scale is None or signal.full_scale <= 0.0:
            unknown.setdefault(signal.role, signal)
    for signal in unknown.values():
        report.error(
            "E624",
            f"krl gives {signal.role} as a share of its full scale, which io does not state",
            signal.span,
            hint=f"say what full scale stands for: {signal.role} analog {signal.number} full …",
        )

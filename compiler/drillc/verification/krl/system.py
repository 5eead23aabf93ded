"""System variables, signals, timers, and the controller's own data, such as TOOL_DATA[3]."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from drillc.verification.events import Kind, ToolFrame
from drillc.verification.machine import UNDECIDED, Machine

from .arithmetic import is_number, number, one, shown, truth
from .constants import whole
from .frames import Pose
from .references import Evaluate
from .state import Notes, arrive, flag_of, must_have_arrived
from .words import FRAME, PLACE

#: System variables that change nothing of what is judged here: how quickly speeds are reached, how
#: corners would be rounded, what is displayed.
WITHOUT_EFFECT = frozenset(
    """
    $ACC $ACC_AXIS $ACC_EXTAX $APO $LOAD $LOAD_A1 $LOAD_A2 $LOAD_A3 $JERK $GEAR_JERK $CIRC_TYPE
    $BWDSTART $FILTER $TARGET_STATUS $ORI_CHECK $ACT_TOOL $ACT_BASE $COMMENT $LOOP_MSG $SINGUL_CP
    $CP_VEL_TYPE $EX_AX_IGNORE $VEL_EXTAX $ECO_LEVEL $ROUNDING $DISTANCE $REDVEL
    $COLLMON_TOL_PRO $TORQMON
    """.split()  # noqa: SIM905 (a table of words)
)
#: System variables that nobody knows before the program runs.
UNKNOWN = frozenset(
    """
    $MODE_OP $STOPMESS $PRO_STATE $PRO_STATE1 $ROB_STOPPED $IN_HOME $PERI_RDY $EXT $T1 $T2 $AUT
    $MOVE_ENABLE $ALARM_STOP $USER_SAF $ON_PATH $NEAR_POSRET $POS_RET $DATE $ROB_TIMER $POWER_FAIL
    $COLD_BOOT $ERR $MOVE_STATE $PRO_MODE $INTERPRETER $INPOSITION $TECH_ACT
    """.split()  # noqa: SIM905 (a table of words)
)
#: Components of $VEL and $ACC turn the tool, not its point.
_TURNING = frozenset({"ORI1", "ORI2"})


def signal_read(variable: str, place: Evaluate, going_on: bool) -> Evaluate:
    """The value of $IN[n], $OUT[n], $ANIN[n] or $ANOUT[n]; `going_on`: after CONTINUE."""

    def read(m: Machine) -> Any:
        index = one(m, place(m), f"the number of {variable}")
        if not going_on:
            arrive(m)
        if variable in ("$OUT", "$ANOUT"):
            value = m.state["outputs"].get(f"{variable}[{index}]", math.nan)
            if variable == "$ANOUT":
                return value
            unknown = np.isnan(value)
            if np.any(unknown):
                if np.ndim(unknown) and not np.all(unknown):
                    m.part(unknown)
                return UNDECIDED
            return value > 0.5
        return UNDECIDED if variable == "$IN" else math.nan

    return read


def signal_written(
    variable: str, place: Evaluate, value: Evaluate, notes: Notes, going_on: bool
) -> Callable[[Machine], None]:
    """$OUT[n]=… or $ANOUT[n]=…"""

    def act(m: Machine) -> None:
        index = one(m, place(m), f"the number of {variable}")
        name = f"{variable}[{index}]"
        if variable == "$OUT":
            told = truth(m, value(m))
            if told is UNDECIDED:
                raise m.fail(f"{name} would be set to what is not known")
            amount = told.astype(float) if isinstance(told, np.ndarray) else float(told)
        else:
            amount = number(m, value(m))
            if np.any(np.abs(amount) > 1.0):
                notes.find(m, "rules", f"{name} is {shown(amount)}, and goes from -1 to 1")
        switched = "is switched" if variable == "$OUT" else "is set"
        must_have_arrived(m, notes, f"{name} {switched}")
        if variable == "$OUT" and not going_on:
            arrive(m)
        kind = Kind.OUTPUT if variable == "$OUT" else Kind.ANALOG
        m.emit(kind, signal=m.signal(name), value=amount)
        m.state["outputs"][name] = amount

    return act


# ── timers ───────────────────────────────────────────────────────────────────────────────────────


def timer_of(m: Machine, place: Evaluate) -> tuple[str, dict[str, Any]]:
    """A timer's number, as a key, and what is known of it."""
    key = str(one(m, place(m), "the number of the timer"))
    known = m.state["timers"].get(key)
    return key, dict(known or {"ms": math.nan, "runs": False, "flag": math.nan})


def timer_read(variable: str, place: Evaluate) -> Evaluate:
    """$TIMER[n], $TIMER_STOP[n] or $TIMER_FLAG[n]."""

    def read(m: Machine) -> Any:
        _, timer = timer_of(m, place)
        if variable == "$TIMER":
            return timer["ms"]
        if variable == "$TIMER_STOP":
            return not timer["runs"]
        return UNDECIDED if math.isnan(timer["flag"]) else timer["flag"] > 0.5

    return read


def timer_written(
    variable: str, place: Evaluate, value: Evaluate, notes: Notes
) -> Callable[[Machine], None]:
    """$TIMER[n]=… in ms, or $TIMER_STOP[n]=…"""

    def act(m: Machine) -> None:
        key, timer = timer_of(m, place)
        if variable == "$TIMER":
            ms = number(m, value(m))
            if isinstance(ms, np.ndarray):
                ms = one(m, ms, "the time")
            timer["ms"], timer["flag"] = float(ms), flag_of(float(ms))
            if timer["runs"]:
                must_have_arrived(m, notes, f"$TIMER[{key}] is set")
        else:
            stop = truth(m, value(m))
            if not isinstance(stop, bool):
                raise m.fail("whether the timer stops is not known")
            timer["runs"] = not stop
            if timer["runs"]:
                must_have_arrived(m, notes, f"$TIMER[{key}] is started")
        m.state["timers"][key] = timer

    return act


# ── tools and bases ──────────────────────────────────────────────────────────────────────────────


def data_written(table: str, place: Evaluate, value: Evaluate) -> Callable[[Machine], None]:
    """TOOL_DATA[n]=…, LOAD_DATA[n]=… or BASE_DATA[n]=…: it counts when the tool or base is
    chosen."""

    def act(m: Machine) -> None:
        index = one(m, place(m), f"the number of {table}")
        if not 1 <= index <= 128:
            raise m.fail(f"there is no {table}[{index}]")
        given = value(m)
        if table != "LOAD_DATA" and isinstance(given, dict) and (lacks := whole("FRAME", given)):
            raise m.fail(f"{table}[{index}]: {lacks}")
        m.state[table.lower()][str(index)] = given

    return act


def choose(m: Machine, notes: Notes, what: str, index: int) -> None:
    """Tool or base `index` becomes active, as its data is now."""
    if index < 0 or index > 128:
        raise m.fail(f"there is no {what.upper()}_DATA[{index}]")
    data = m.state[f"{what}_data"].get(str(index))
    name = f"{what.upper()}_DATA[{index}]"
    load = m.state["load_data"].get(str(index)) if what == "tool" else None
    activate(m, notes, what, name, data, load)


def activate(
    m: Machine, notes: Notes, what: str, name: str, value: Any, load: Mapping[str, Any] | None
) -> None:
    """$TOOL or $BASE; `value` is the frame, or None if only the controller knows it; so is the
    `load` of the tool."""
    m.state["place"] = {}
    mass_kg, centre_mm = _mass_and_centre(m, load or {})
    if value is None:
        m.state[what] = m.frame(ToolFrame(name, None, None, mass_kg, centre_mm))
        return
    pose = value if isinstance(value, Pose) else notes.poses.of(value)
    if pose.matrix().ndim > 2 or pose.position_mm.ndim > 1:
        raise m.fail(f"{name} differs from hole to hole")
    m.state[what] = m.frame(ToolFrame(name, pose.matrix(), pose.position_mm, mass_kg, centre_mm))


def _mass_and_centre(m: Machine, load: Mapping[str, Any]) -> tuple[float | None, Any]:
    """What a load says of them, in kg and mm; None where it says nothing."""
    mass, centre = load.get("M"), load.get("CM", {})
    places = [centre.get(axis) for axis in PLACE]
    for value in (mass, *places):
        if value is not None and not is_number(value):
            raise m.fail("a load has a mass M and a centre of gravity CM {X …,Y …,Z …}")
    return (
        None if mass is None else float(mass),
        None if None in places else np.array(places, dtype=np.float64),
    )


def active(m: Machine, what: str) -> Any:
    """The components of $TOOL or $BASE. Raises ReadError where the program does not state them."""
    index = m.state[what]
    frame = m.frames[index] if index >= 0 else None
    if frame is None or frame.rotation is None or frame.position_mm is None:
        raise m.fail(f"what ${what.upper()} is, only the controller knows")
    return Pose(frame.rotation, frame.position_mm)


def null_frame(_: Machine) -> dict[str, float]:
    """$NULLFRAME."""
    return dict.fromkeys(FRAME, 0.0)


def override(m: Machine, value: Any) -> None:
    """$OV_PRO=…, in percent."""
    percent = number(m, value)
    if np.any(np.asarray(percent) <= 0.0) or np.any(np.asarray(percent) > 100.0):
        raise m.fail(f"$OV_PRO is {shown(percent)}, and goes from 1 to 100")
    m.state["override_percent"] = percent


def speed(m: Machine, value: Any) -> None:
    """$VEL.CP=…, in m/s."""
    given = number(m, value)
    if np.any(np.asarray(given) <= 0.0):
        raise m.fail(f"$VEL.CP is {shown(given)}: no speed")
    m.state["speed_m_s"] = given


def axis_speed(m: Machine, value: Any, axis: int | None = None) -> None:
    """The speed of moves by axes, in percent: of one of the arm's axes, or of all."""
    percent = number(m, value)
    if np.any(np.asarray(percent) <= 0.0) or np.any(np.asarray(percent) > 100.0):
        raise m.fail(f"the speed of the axes is {shown(percent)} %: it goes from 1 to 100")
    speeds = m.state["axis_percent"]
    if axis is None:
        m.state["axis_percent"] = [percent] * len(speeds)
    elif 1 <= axis <= len(speeds):
        m.state["axis_percent"] = [*speeds[: axis - 1], percent, *speeds[axis:]]
    else:
        raise m.fail(f"$VEL_AXIS has elements 1 to {len(speeds)}, not {axis}")

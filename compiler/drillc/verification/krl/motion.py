"""Moves: PTP goes by the axes, LIN straight; either to a pose, PTP to axes too."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from drillc.verification.events import Kind
from drillc.verification.machine import Machine

from .frames import Pose, components, product
from .references import Evaluate
from .state import Notes, pass_time
from .words import AXES, EXTERNAL_AXES, FRAME, STATUS


def motion(
    word: str,
    target: Evaluate,
    flags: Sequence[str],
    in_tool: bool,
    notes: Notes,
    where: str,
) -> Callable[[Machine], None]:
    """The act of a move. `word` is PTP, LIN, SPTP, SLIN or one of these with _REL; `where` the
    target as it is written."""
    straight = "LIN" in word
    relative = word.endswith("_REL")

    def act(m: Machine) -> None:
        value = target(m)
        for flag in flags:
            message = f"{flag}: the tool passes {where} by instead of going there"
            notes.find(m, "position", message)
        if relative:
            _relative(m, notes, straight, value, in_tool)
        elif isinstance(value, Pose):
            _to_pose(m, notes, straight, value)
        elif isinstance(value, dict) and not any(name in value for name in FRAME):
            _to_axes(m, straight, value)
        elif isinstance(value, dict):
            _to_pose(m, notes, straight, pose_of(m, notes, value, where))
        else:
            raise m.fail(f"{where} is no place")
        m.state["ahead"] = m.state["advance"] != 0
        m.state["moved"] = True
        pass_time(m, math.nan)

    return act


def pose_of(m: Machine, notes: Notes, value: Any, where: str) -> Pose:
    """A frame or position as a pose. Raises ReadError where it is not complete."""
    if isinstance(value, Pose):
        return value
    if not isinstance(value, dict):
        raise m.fail(f"{where} is no frame")
    if lacks := [name for name in FRAME if name not in value]:
        raise m.fail(f"{where}: {', '.join(lacks)} {'has' if len(lacks) == 1 else 'have'} no value")
    return notes.poses.of(value)


def go_home(m: Machine, notes: Notes) -> None:
    """PTP $H_POS, or XHOME: a place of the controller, unless the program says where it is."""
    if m.state["home"]:
        _to_axes(m, False, m.state["home"])
    else:
        m.emit(Kind.HOME, value=_axis_share(m))
        m.state["axes"] = dict.fromkeys(AXES, math.nan)
    m.state["ahead"] = m.state["advance"] != 0
    m.state["moved"] = True
    m.state["place"] = {}
    pass_time(m, math.nan)


def _to_axes(m: Machine, straight: bool, value: Mapping[str, Any]) -> None:
    if straight:
        raise m.fail("LIN goes to a pose, not to axes")
    axes = {**m.state["axes"], **{name: value[name] for name in AXES if name in value}}
    m.emit(Kind.JOINTS, joints=_row(axes), value=_axis_share(m), tool=m.state["tool"])
    m.state["axes"] = axes
    m.state["place"] = {}


def _to_pose(m: Machine, notes: Notes, straight: bool, pose: Pose) -> None:
    fields: dict[str, Any] = {
        "position_mm": pose.position_mm,
        "rotation": pose.matrix(),
        "tool": m.state["tool"],
        "base": m.state["base"],
    }
    external = {name: pose.said[name] for name in EXTERNAL_AXES if name in pose.said}
    if not any(np.any(value) for value in external.values()):
        external = {}  # as the controller itself writes them, for axes that there are not
    axes = {**dict.fromkeys(AXES, math.nan), **{n: m.state["axes"][n] for n in EXTERNAL_AXES}}
    axes.update(external)
    if external:
        given = {**dict.fromkeys(AXES, math.nan), **external}
        fields["joints"] = _row(given)
    if straight:
        _straight_rules(m, notes)
        metres = m.state["speed_m_s"] * m.state["override_percent"] / 100.0
        fields["speed_mm_s"] = metres * 1000.0
    else:
        fields["value"] = _axis_share(m)
        status = [pose.said.get(name, math.nan) for name in STATUS]
        if any(not _is_nan(part) for part in status):
            fields["configuration"] = _stacked([*status, math.nan, math.nan])
    m.emit(Kind.STRAIGHT if straight else Kind.JOINTS, **fields)
    m.state["axes"] = axes
    if notes.follows_place:
        m.state["place"] = components(Pose(pose.rotation, pose.position_mm))


def _straight_rules(m: Machine, notes: Notes) -> None:
    if not m.state["moved"]:
        notes.find(m, "configuration", "the first move is no PTP: the controller refuses it")
    if m.state["turning"] != "#VAR":
        message = f"with $ORI_TYPE={m.state['turning']} the tool does not turn as it is told"
        notes.find(m, "axis", message)
    if np.any(np.isnan(m.state["speed_m_s"])):
        message = "a straight move before $VEL.CP is set: its speed is the controller's own"
        notes.find(m, "speed", message)


def _relative(m: Machine, notes: Notes, straight: bool, value: Any, in_tool: bool) -> None:
    """{Z 300}: what is not given is 0; in the base, or in the tool where it stands."""
    if not isinstance(value, dict):
        raise m.fail("a relative move takes an aggregate such as {Z 100}")
    if any(name in value for name in AXES):
        if straight or not all(name in AXES for name in value):
            raise m.fail("a relative move is by a pose or by axes, not both")
        moved = {name: m.state["axes"][name] + value[name] for name in value}
        _to_axes(m, straight, moved)
        return
    shift = notes.poses.of({**dict.fromkeys(FRAME, 0.0), **value})
    here = place(m, notes)
    if in_tool:
        _to_pose(m, notes, straight, product(here, Pose(shift.rotation, shift.position_mm)))
        return
    rotation = here.rotation
    if shift.rotation is not None:
        # A, B and C are added, each for itself, as X, Y and Z are
        angles = components(here)
        turned = {name: angles[name] + value.get(name, 0.0) for name in FRAME}
        rotation = notes.poses.of(turned).rotation
    _to_pose(m, notes, straight, Pose(rotation, here.position_mm + shift.position_mm))


def place(m: Machine, notes: Notes) -> Pose:
    """Where the last move led, in the active base. Raises ReadError where that is not known."""
    if not m.state["place"]:
        raise m.fail("where the tool is cannot be known here: the last move was not to a pose")
    return notes.poses.of(m.state["place"])


def _axis_share(m: Machine) -> Any:
    """The share of full speed at which the axes move; NaN where they differ, or it is not set."""
    first, *others = m.state["axis_percent"]
    if any(np.any(other != first) for other in others):
        return math.nan
    return first * m.state["override_percent"] / 1e4


def _row(axes: Mapping[str, Any]) -> Any:
    return _stacked([axes[name] for name in AXES])


def _stacked(values: Sequence[Any]) -> Any:
    """(n,) of numbers, (lanes, n) where one of them is an array."""
    if not any(isinstance(value, np.ndarray) for value in values):
        return np.array(values, dtype=np.float64)
    return np.stack(np.broadcast_arrays(*values), axis=-1)


def _is_nan(value: Any) -> bool:
    return not isinstance(value, np.ndarray) and math.isnan(value)

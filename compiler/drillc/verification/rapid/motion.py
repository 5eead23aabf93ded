"""Moves: where they go, with which tool and base, how fast, and whether they get there exactly."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..events import Kind, ToolFrame
from ..machine import Machine
from ..reading import Finding
from .arguments import Arguments
from .expressions import Scope
from .quaternions import rotation
from .state import NO_TARGET, per_lane
from .types import (
    INSTALLED,
    JOINTTARGET,
    NO_AXIS,
    NUM,
    ROBTARGET,
    SPEEDDATA,
    TOOLDATA,
    WOBJDATA,
    ZONEDATA,
    Type,
    Value,
)

Act = Callable[[Machine], None]
_OPTIONS = ("v", "z", "inpos", "wobj", "id", "tload")
#: A way that goes on goes straight on if the cosine of the turn is no farther from 1; and one that
#: is so short leads nowhere.
_STRAIGHT_ON, _SAME_MM = 1e-9, 1e-6


@dataclass(frozen=True)
class _Move:
    """What all moves have: how fast the tool is in mm/s, and external axes where they move alone;
    whether to the very end; and tool and base."""

    speed: Callable[[Machine], Value]
    external: Callable[[Machine], Value]
    exact: Callable[[Machine], Value]
    zone: str
    frames: Callable[[Machine], tuple[int, int]]


def move(name: str, arguments: Arguments) -> Act:
    """What MoveJ, MoveL or MoveAbsJ does. Raises ReadError."""
    arguments.count(4)
    arguments.only(*_OPTIONS, *(["noeoffs"] if name == "moveabsj" else []))
    parts = _common(arguments, "" if name == "moveabsj" else "wobj0")
    if name == "moveabsj":
        return _by_joints(arguments, parts)
    straight = name == "movel"
    target = arguments.of_type(0, ROBTARGET)
    watched = "confl" if straight else "confj"
    program = arguments.scope.program

    def act(m: Machine) -> None:
        goes = target.get(m)
        tool, base = parts.frames(m)
        turn = rotation(goes[1])
        m.emit(
            Kind.STRAIGHT if straight else Kind.JOINTS,
            position_mm=per_lane(m, goes[0]),
            rotation=turn,
            joints=_external(m, goes[3]),
            configuration=per_lane(m, goes[2]) if m.state[watched] else np.nan,
            speed_mm_s=parts.speed(m),
            tool=tool,
            base=base,
        )
        if not program.asks:
            return
        _check_passing(m, program.findings, goes[0], parts.speed(m) if straight else np.nan)
        _note_zone(m, parts, goes[0])
        m.state["target"] = goes
        m.state["tool"], m.state["base"] = tool, base
        m.state["joints"] = [np.nan] * 6 + [
            _used(new) if not _absent(new) else old
            for new, old in zip(goes[3], m.state["joints"][6:], strict=True)
        ]

    return act


def _by_joints(arguments: Arguments, parts: _Move) -> Act:
    target = arguments.of_type(0, JOINTTARGET)
    program = arguments.scope.program

    def act(m: Machine) -> None:
        goes = target.get(m)
        values = [_used(value) for group in goes for value in group]
        tool, base = parts.frames(m)
        alone = all(map(_absent, goes[0]))
        m.emit(
            Kind.JOINTS,
            joints=per_lane(m, values),
            speed_mm_s=(parts.external if alone else parts.speed)(m),
            tool=tool,
            base=base,
        )
        if not program.asks:
            return
        _check_passing(m, program.findings, NO_TARGET[0], np.nan)
        _note_zone(m, parts, NO_TARGET[0])
        m.state["joints"] = [
            old if _absent(new) else value
            for new, value, old in zip(
                (v for group in goes for v in group), values, m.state["joints"], strict=True
            )
        ]
        m.state["target"] = NO_TARGET
        m.state["tool"], m.state["base"] = tool, base

    return act


def _external(m: Machine, axes: Value) -> Value:
    """Joints where only external axes are given, if any is."""
    if all(map(_absent, axes)):
        return np.nan
    return per_lane(m, [np.nan] * 6 + [_used(value) for value in axes])


def _used(value: Value) -> Value:
    """The place of an axis; NaN for one that is not there."""
    if isinstance(value, np.ndarray):
        return np.where(value >= NO_AXIS, np.nan, value)
    return np.nan if value >= NO_AXIS else value


def _absent(value: Value) -> bool:
    return not isinstance(value, np.ndarray) and bool(value >= NO_AXIS)


# ── what all moves have ──────────────────────────────────────────────────────────────────────────


def _common(arguments: Arguments, wobj: str) -> _Move:
    speed = arguments.of_type(1, SPEEDDATA)
    zone = arguments.of_type(2, ZONEDATA)
    slower = arguments.option("v", NUM)
    wider = arguments.option("z", NUM)
    arguments.option("id", NUM)
    tree = arguments.given[2]
    name = str(tree.children[0]) if tree.data == "variable" else "a zone"
    if not (zone.fixed and wider is None and zone.get(None)[0] is True):  # type: ignore[arg-type]
        arguments.scope.program.asks = True

    def mm_s(m: Machine) -> Value:
        return speed.get(m)[0] if slower is None else slower.get(m)

    def exact(m: Machine) -> Value:
        return zone.get(m)[0] if wider is None else False

    def external(m: Machine) -> Value:
        return speed.get(m)[2]

    return _Move(mm_s, external, exact, name, frame_numbers(arguments, arguments.given[3], wobj))


def frame_numbers(
    arguments: Arguments, tool: Any = None, wobj: str = ""
) -> Callable[[Machine], tuple[int, int]]:
    """The numbers of tool and base: of a move, whose base is `wobj` where it names none, or of the
    options \\Tool and \\WObj. -1: none is named."""
    scope, options = arguments.scope, arguments.options
    of_tool = _frame(scope, options.get("tool") if tool is None else tool, TOOLDATA, "")
    of_base = _frame(scope, options.get("wobj"), WOBJDATA, wobj)
    return lambda m: (of_tool(m), of_base(m))


def _frame(scope: Scope, tree: Any, kind: Type, default: str) -> Callable[[Machine], int]:
    if tree is None and not default:
        return lambda m: -1
    make = _tool if kind == TOOLDATA else _base
    if tree is None:
        installed = make(default, INSTALLED[default.upper()][1])
        return lambda m: m.frame(installed)
    typed, name = scope.named(tree, kind)
    if typed.fixed:
        value = typed.get(None)  # type: ignore[arg-type]  # hangs on nothing
        _check_held(scope, tree, kind, value)
        known = make(name(None), value)  # type: ignore[arg-type]
        return lambda m: m.frame(known)

    def number(m: Machine) -> int:
        value = typed.get(m)
        _check_held(scope, tree, kind, value)
        return m.frame(make(name(m), value))

    return number


def _check_held(scope: Scope, tree: Any, kind: Type, value: Value) -> None:
    """Notes where tool and work object have changed places: where they are, is not said then."""
    if value is None or value[0] is (kind == TOOLDATA):
        return
    what = "stands still in the room" if kind == TOOLDATA else "is held by the robot"
    scope.finding("frames", tree, f"{kind.name} {tree.children[0]} {what}")


def _tool(name: str, value: Value) -> ToolFrame:
    if value is None or value[0] is not True:
        return ToolFrame(name)
    position, orient = value[1]
    mass, centre, *_ = value[2]
    return ToolFrame(
        name,
        rotation(orient)[0],
        np.array(position, dtype=np.float64),
        float(mass),
        np.array(centre, dtype=np.float64),
    )


def _base(name: str, value: Value) -> ToolFrame:
    """The user frame, and in it the object frame; where a user frame is moved by the cell, the
    program does not say where it is."""
    if value is None or value[0] is not False or value[1] is not True:
        return ToolFrame(name)
    (user_at, user_turn), (own_at, own_turn) = value[3], value[4]
    turn = rotation(user_turn)[0]
    place = np.array(user_at, dtype=np.float64) + turn @ np.array(own_at, dtype=np.float64)
    return ToolFrame(name, turn @ rotation(own_turn)[0], place)


# ── zones ────────────────────────────────────────────────────────────────────────────────────────


def standing(m: Machine, findings: list[Finding], what: str) -> None:
    """Something is done that wants the axes to stand: notes it where they do not."""
    passed = m.state["passed"]
    if passed:
        _find(findings, passed, what)


def ending(m: Machine, findings: list[Finding]) -> None:
    """EXIT: at once, wherever the tool then is."""
    standing(m, findings, "EXIT")
    m.stop()


def _find(findings: list[Finding], passed: Value, what: str) -> None:
    file, line, zone = int(passed[0]), int(passed[1]), passed[2]
    finding = Finding("process", file, line, 1, f"the move ends in {zone}, not fine, before {what}")
    if finding not in findings:
        findings.append(finding)


def _note_zone(m: Machine, parts: _Move, goes: Value) -> None:
    """Keeps what must be known of a move that is not carried through to its end."""
    if parts.exact(m) is True:
        m.state["passed"] = []
        return
    place = [float(m.at.file), float(m.at.line), parts.zone]
    m.state["passed"] = [*place, m.state["target"][0], goes, parts.speed(m)]


def _check_passing(m: Machine, findings: list[Finding], goes: Value, speed: Value) -> None:
    """What does not end where it is told is no harm only where the tool goes straight on, no faster
    and no slower; or where it is there already."""
    passed = m.state["passed"]
    if not passed:
        return
    came, there = passed[3], passed[4]
    one, two = (_way(*ends) for ends in ((came, there), (there, goes)))
    lengths = [np.sqrt(sum(part * part for part in way)) for way in (one, two)]
    along = sum(a * b for a, b in zip(one, two, strict=True))
    onward = along >= lengths[0] * lengths[1] * (1.0 - _STRAIGHT_ON)
    good = (onward & (np.asarray(speed) == passed[5])) | (lengths[1] <= _SAME_MM)
    if not np.all(good):
        _find(findings, passed, "the tool turns, or is faster or slower")


def _way(came: Value, goes: Value) -> list[Any]:
    return [np.asarray(b) - np.asarray(a) for a, b in zip(came, goes, strict=True)]

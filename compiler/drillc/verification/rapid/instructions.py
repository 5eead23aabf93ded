"""The controller's own instructions: moves, signals, waits, and what is said to the operator."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from ..events import Kind
from ..machine import Machine
from .arguments import Arguments
from .motion import move, standing
from .types import BOOL, NUM, STRING, TYPES, Value
from .values import whole

Act = Callable[[Machine], None]
Lower = Callable[[str, Arguments], Act | None]


def lowered(arguments: Arguments) -> Act | None:
    """What an instruction does; None for one that does nothing which is seen. Raises ReadError for
    one that is not read."""
    name = arguments.at.lower()
    if name in REFUSED:
        raise arguments.error(f"{arguments.at} is not read: {REFUSED[name]}")
    if name not in INSTRUCTIONS:
        raise arguments.error(f"{arguments.at} is no procedure that is declared or read")
    return INSTRUCTIONS[name](name, arguments)


# ── signals ──────────────────────────────────────────────────────────────────────────────────────


def _digital(name: str, arguments: Arguments) -> Act:
    """SetDO, Set, Reset."""
    arguments.only()
    arguments.count(2 if name == "setdo" else 1)
    signal = arguments.scope.signal(arguments.given[0])
    fixed = {"set": 1.0, "reset": 0.0}.get(name)
    value = arguments.of_type(1, NUM).get if fixed is None else lambda m: fixed

    def act(m: Machine) -> None:
        to = value(m)
        if not np.isin(to, (0.0, 1.0)).all():
            raise m.fail(f"{signal} is set to something else than 0 and 1")
        standing(m, arguments.scope.program.findings, str(arguments.at))
        m.emit(Kind.OUTPUT, signal=m.signal(signal), value=to)

    return act


def _pulse(name: str, arguments: Arguments) -> Act:
    arguments.only("plength", "high")
    arguments.count(1)
    signal = arguments.scope.signal(arguments.given[0])
    arguments.option("plength", NUM)
    high = "high" in arguments.options

    def act(m: Machine) -> None:
        standing(m, arguments.scope.program.findings, str(arguments.at))
        m.emit(Kind.OUTPUT, signal=m.signal(signal), value=1.0)
        if not high:
            m.emit(Kind.OUTPUT, signal=m.signal(signal), value=0.0)

    return act


def _analog(name: str, arguments: Arguments) -> Act:
    arguments.only()
    arguments.count(2)
    signal = arguments.scope.signal(arguments.given[0])
    value = arguments.of_type(1, NUM)

    def act(m: Machine) -> None:
        standing(m, arguments.scope.program.findings, str(arguments.at))
        m.emit(Kind.ANALOG, signal=m.signal(signal), value=value.get(m))

    return act


# ── waiting ──────────────────────────────────────────────────────────────────────────────────────


def _wait_signal(name: str, arguments: Arguments) -> Act:
    """WaitDI, WaitDO."""
    arguments.count(2)
    value = arguments.of_type(1, NUM)
    return _waits(arguments, arguments.given[0], value.get)


def _wait_until(name: str, arguments: Arguments) -> Act:
    """WaitUntil signal=value."""
    arguments.count(1)
    condition = arguments.given[0]
    value = 1.0
    if condition.data == "not":
        condition, value = condition.children[0], 0.0
    if condition.data == "comparison" and str(condition.children[1]) == "=" and value == 1.0:
        left, _, right = condition.children
        if left.data == "function_call" and str(left.children[0]).lower() in ("dinput", "doutput"):
            left = left.children[1].children[0]
        number = arguments.scope.of_type(right, NUM)
        return _waits(arguments, left, number.get)
    if condition.data == "function_call" and str(condition.children[0]).lower() == "testdi":
        return _waits(arguments, condition.children[1].children[0], lambda m: value)
    raise arguments.error("WaitUntil is read for one signal only: WaitUntil signal=1")


def _waits(arguments: Arguments, tree: object, wanted: Callable[[Machine], Value]) -> Act:
    arguments.only("maxtime", "timeflag", "inpos", "polltime")
    scope = arguments.scope
    signal = scope.signal(tree)
    limit = arguments.option("maxtime", NUM)
    arguments.option("polltime", NUM)
    flag = None
    if "timeflag" in arguments.options:
        variable = scope.variable(arguments.options["timeflag"])
        if variable.typed.kind != BOOL or variable.set is None:
            raise arguments.error("\\TimeFlag needs a bool variable")
        flag = variable.set
    in_place = "inpos" in arguments.options

    def act(m: Machine) -> None:
        to = wanted(m)
        if isinstance(to, np.ndarray):
            to = whole(to)
        if to not in (0, 1):
            raise m.fail(f"{signal} never is something else than 0 and 1")
        if not in_place:
            standing(m, scope.program.findings, str(arguments.at))
        came = m.wait(signal, float(to), math.inf if limit is None else limit.get(m))
        if flag is not None:
            flag(m, not came)
        elif not came and limit is not None:
            # an error, and no handler: the program stands until somebody starts it again
            m.emit(Kind.PAUSE, value=math.inf)

    return act


def _wait_time(name: str, arguments: Arguments) -> Act:
    arguments.only("inpos")
    arguments.count(1)
    seconds = arguments.of_type(0, NUM)
    in_place = "inpos" in arguments.options

    def act(m: Machine) -> None:
        if in_place:
            m.state["passed"] = []
        standing(m, arguments.scope.program.findings, str(arguments.at))
        m.emit(Kind.PAUSE, value=seconds.get(m))

    return act


def _wait_in_place(name: str, arguments: Arguments) -> Act:
    """WaitRob: until the axes stand."""
    arguments.only("inpos", "zerospeed")
    arguments.count(0)

    def act(m: Machine) -> None:
        m.state["passed"] = []

    return act


def _wait_tasks(name: str, arguments: Arguments) -> Act:
    """SyncMoveOn and the like: other robots' programs have to come there, too."""
    for i in range(len(arguments.given)):
        arguments.scope.expression(arguments.given[i])
    signal = f"{arguments.at} {arguments.given[0].children[0]}" if arguments.given else name

    def act(m: Machine) -> None:
        m.wait(signal, 1.0, math.inf)

    return act


def _stand_still(name: str, arguments: Arguments) -> Act:
    """Stop and Break: until somebody presses start."""
    arguments.only("noregain", "allmovetasks")
    arguments.count(0)

    def act(m: Machine) -> None:
        standing(m, arguments.scope.program.findings, str(arguments.at))
        m.emit(Kind.PAUSE, value=math.inf)

    return act


# ── settings ─────────────────────────────────────────────────────────────────────────────────────


def _watch(name: str, arguments: Arguments) -> Act:
    """ConfJ and ConfL. Without a switch they are on."""
    arguments.only("on", "off")
    arguments.count(0)
    on = "off" not in arguments.options

    def act(m: Machine) -> None:
        m.state[name] = on

    return act


def _acceleration(name: str, arguments: Arguments) -> None:
    arguments.only("finepointramp")
    arguments.count(2)
    for i in range(2):
        arguments.of_type(i, NUM)


def _singular(name: str, arguments: Arguments) -> None:
    """Only where the wrist is stretched does it matter; poses stay what they are."""
    arguments.only("wrist", "off", "locaxis4")
    arguments.count(0)


def _speeds(name: str, arguments: Arguments) -> Act:
    """VelSet slows every move: what it leaves is not computed, so only the default is read."""
    arguments.only()
    arguments.count(2)
    override, most = arguments.of_type(0, NUM), arguments.of_type(1, NUM)

    def act(m: Machine) -> None:
        if override.get(m) != 100.0 or np.any(np.asarray(most.get(m)) < 5000.0):
            raise m.fail("VelSet is read only where it slows nothing: VelSet 100,5000 or faster")

    return act


def _change(name: str, arguments: Arguments) -> Act:
    """Incr, Decr, Add, Clear."""
    arguments.only()
    arguments.count(2 if name == "add" else 1)
    variable = arguments.scope.variable(arguments.given[0])
    if variable.typed.kind != NUM or variable.set is None:
        raise arguments.error(f"{arguments.at} changes a variable of type num")
    put = variable.set
    by = arguments.of_type(1, NUM).get if name == "add" else None
    step = {"incr": 1.0, "decr": -1.0}.get(name, 0.0)

    def act(m: Machine) -> None:
        if name == "clear":
            put(m, 0.0)
        else:
            put(m, variable.typed.get(m) + (step if by is None else by(m)))

    return act


# ── messages ─────────────────────────────────────────────────────────────────────────────────────


def _write(name: str, arguments: Arguments) -> Act:
    arguments.only("num", "bool", "pos", "orient", "dnum")
    arguments.count(1)
    arguments.of_type(0, STRING)
    for option, kind in (("num", NUM), ("bool", BOOL), ("dnum", NUM)):
        arguments.option(option, kind)
    for option in ("pos", "orient"):
        arguments.option(option, TYPES[option])
    return lambda m: m.emit(Kind.MESSAGE)


def _log(name: str, arguments: Arguments) -> Act:
    """ErrWrite."""
    arguments.only("w", "i", "rl2", "rl3", "rl4")
    arguments.count(2)
    arguments.of_type(0, STRING)
    arguments.of_type(1, STRING)
    return lambda m: m.emit(Kind.MESSAGE)


def _clear_screen(name: str, arguments: Arguments) -> None:
    arguments.only()
    arguments.count(0)


def _clock(name: str, arguments: Arguments) -> None:
    arguments.only()
    arguments.count(1)
    arguments.of_type(0, TYPES["clock"])


INSTRUCTIONS: Mapping[str, Lower] = {
    "movej": move,
    "movel": move,
    "moveabsj": move,
    "setdo": _digital,
    "set": _digital,
    "reset": _digital,
    "pulsedo": _pulse,
    "setao": _analog,
    "waitdi": _wait_signal,
    "waitdo": _wait_signal,
    "waituntil": _wait_until,
    "waittime": _wait_time,
    "waitrob": _wait_in_place,
    "syncmoveon": _wait_tasks,
    "syncmoveoff": _wait_tasks,
    "waitsynctask": _wait_tasks,
    "stop": _stand_still,
    "break": _stand_still,
    "confj": _watch,
    "confl": _watch,
    "accset": _acceleration,
    "singarea": _singular,
    "velset": _speeds,
    "incr": _change,
    "decr": _change,
    "add": _change,
    "clear": _change,
    "tpwrite": _write,
    "tperase": _clear_screen,
    "errwrite": _log,
    "clkreset": _clock,
    "clkstart": _clock,
    "clkstop": _clock,
}

#: Instructions that programs hold now and then, and why they are not read.
REFUSED: Mapping[str, str] = {
    "movec": "a tool that goes in an arc drills nothing",
    "movejdo": "the signal would be set while the axes move",
    "moveldo": "the signal would be set while the axes move",
    "movelao": "the signal would be set while the axes move",
    "setgo": "a group of signals has no name for each of them",
    "exitcycle": "it would begin the program anew",
    "eoffson": "positions of the external axes would mean something else",
    "eoffsset": "positions of the external axes would mean something else",
    "pdispon": "positions would mean something else",
    "pdispset": "positions would mean something else",
    "searchl": "where it ends is not known",
    "triggl": "the signal would be set while the axes move",
    "triggj": "the signal would be set while the axes move",
}

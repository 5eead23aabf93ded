"""What a block does, in LinuxCNC's order: feed, spindle, signals, dwell, modes, motion, stop."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..events import Kind
from ..machine import UNDECIDED, Machine
from ..statements import Act, At, Do, Evaluate, If, Statement
from .cycles import cycle
from .expressions import Slots, compiled, never, whole_number
from .motion import arrive, go, targets
from .parameters import set_named, set_numbered
from .state import MM_PER_INCH, MOTIONS, uniform
from .syntax import Block, Message, Named
from .words import CYCLES, Words, words_of

#: What a block's codes say of the machine's modes, when it comes to them.
_MODES: dict[str, tuple[str, Any]] = {
    "G17": ("plane", "Z"),
    "G18": ("plane", "Y"),
    "G19": ("plane", "X"),
    "G90": ("absolute", True),
    "G91": ("absolute", False),
    "G98": ("back_to_r", False),
    "G99": ("back_to_r", True),
    "G61": ("blends", False),
    "G61.1": ("blends", False),
    "G64": ("blends", True),
}
#: M66 L: what it waits for. L0 only looks.
_WAITS = {1: 1.0, 2: 0.0, 3: 1.0, 4: 0.0}


def statements_of(block: Block, at: At, slots: Slots, last: bool) -> tuple[Statement, ...]:
    """The statements of a block; `last`: nothing follows it, so that M2 is the normal end. Raises
    Misread."""
    words = words_of(block)
    values = {letter: compiled(value, slots) for letter, value in words.values.items()}
    done: list[Statement] = []
    hold: list[Act] = []
    if "units" in words.codes and values:
        # A place that is read in such a block is still in the old units.
        hold, values = _held(values)
    acts = [
        *hold,
        *_messages(block),
        *_feed_and_speed(words, values),
        *_signals(words, values),
        *_spindle(words),
        *_dwell_and_modes(words, values),
    ]
    motion = _motion(words, values, at)
    settings = _settings(block, slots)
    if settings:
        # All values are worked out before any of them counts.
        acts = [settings[0], *acts]
        motion = (*motion, Do(at, settings[1]))
    stop = _stop(words, last)
    if len(motion) == 1 and isinstance(motion[0], Do):
        acts, motion = [*acts, motion[0].act], ()
    if not motion:
        acts, stop = [*acts, *stop], []
    if acts:
        done.append(Do(at, _all(acts)))
    done += motion
    if stop:
        done.append(Do(at, _all(stop)))
    if block.deletable:
        return (If(at, lambda machine: UNDECIDED, (), tuple(done)),)
    return tuple(done)


def _all(acts: list[Act]) -> Act:
    if len(acts) == 1:
        return acts[0]

    def act(machine: Machine) -> None:
        for part in acts:
            part(machine)

    return act


# ── parameters and messages ──────────────────────────────────────────────────────────────────────

#: Variables of the routine; no parameter is named so.
_HELD, _WORDS = "(settings)", "(words)"


def _settings(block: Block, slots: Slots) -> tuple[Act, Act] | None:
    """Two acts: work out the values of a block's settings; and let them count."""
    parts: list[tuple[str | Evaluate, Evaluate]] = []
    for setting in block.settings:
        where = setting.parameter
        place = where.name if isinstance(where, Named) else compiled(where.index, slots)
        parts.append((place, compiled(setting.value, slots)))
    if not parts:
        return None

    def work_out(machine: Machine) -> None:
        machine.locals[_HELD] = [
            [place if isinstance(place, str) else place(machine), value(machine)]
            for place, value in parts
        ]

    def count(machine: Machine) -> None:
        for place, value in machine.locals.pop(_HELD):
            if isinstance(place, str):
                set_named(machine, place, value)
            else:
                set_numbered(machine, place, value)

    return work_out, count


def _messages(block: Block) -> list[Act]:
    told = any(isinstance(item, Message) for item in block.items)
    return [lambda machine: machine.emit(Kind.MESSAGE)] if told else []


def _held(values: dict[str, Evaluate]) -> tuple[list[Act], dict[str, Evaluate]]:
    """An act that works out all values, and functions that give what it found."""

    def hold(machine: Machine) -> None:
        machine.locals[_WORDS] = {letter: value(machine) for letter, value in values.items()}

    def given(letter: str) -> Evaluate:
        return lambda machine: machine.locals[_WORDS][letter]

    return [hold], {letter: given(letter) for letter in values}


# ── feed, spindle, signals ───────────────────────────────────────────────────────────────────────


def _feed_and_speed(words: Words, values: dict[str, Evaluate]) -> list[Act]:
    acts: list[Act] = []
    mode = words.codes.get("feed")
    if mode is not None:

        def set_mode(machine: Machine) -> None:
            machine.state["modes"]["feed"] = mode
            machine.state["feed"] = machine.state["feed_mm"] = float("nan")

        acts.append(set_mode)
    if "F" in values:

        def set_feed(machine: Machine) -> None:
            feed = values["F"](machine)
            never(machine, feed < 0.0, "F is negative")
            machine.state["feed"] = feed
            machine.state["feed_mm"] = feed * machine.state["modes"]["unit"]

        acts.append(set_feed)
    if "S" in values:

        def set_speed(machine: Machine) -> None:
            speed = values["S"](machine)
            never(machine, speed < 0.0, "S is negative")
            machine.state["speed"] = speed
            if machine.state["spindle"] and "spindle" not in words.codes:
                _turn(machine)

        acts.append(set_speed)
    return acts


def _spindle(words: Words) -> list[Act]:
    acts: list[Act] = []
    code = words.codes.get("spindle")
    if code is not None:
        way = {"M3": 1.0, "M4": -1.0, "M5": 0.0}[code]

        def turn(machine: Machine) -> None:
            machine.state["spindle"] = way
            _turn(machine)

        acts.append(turn)
    coolant = words.codes.get("coolant")
    if coolant is not None:
        switched = {"M7": ("mist",), "M8": ("flood",), "M9": ("mist", "flood")}[coolant]

        def cool(machine: Machine) -> None:
            for name in switched:
                on = 0.0 if coolant == "M9" else 1.0
                machine.emit(Kind.OUTPUT, signal=machine.signal(name), value=on)

        acts.append(cool)
    return acts


def _turn(machine: Machine) -> None:
    arrive(machine)
    state = machine.state
    machine.emit(Kind.SPINDLE, value=state["spindle"] * state["speed"] / 60.0 + 0.0)


def _signals(words: Words, values: dict[str, Evaluate]) -> list[Act]:
    code = words.codes.get("signal")
    if code is None:
        return []
    if code == "M66":
        return [lambda machine: _wait(machine, values)]
    if code in ("M67", "M68"):

        def set_analog(machine: Machine) -> None:
            number = whole_number(machine, values["E"](machine), "E")
            value = values["Q"](machine) if "Q" in values else 0.0
            _set(machine, f"analog {number}", value, now=code == "M68")

        return [set_analog]

    def set_output(machine: Machine) -> None:
        number = whole_number(machine, values["P"](machine), "P")
        on = 1.0 if code in ("M62", "M64") else 0.0
        _set(machine, f"out {number}", on, now=code in ("M64", "M65"))

    return [set_output]


def _set(machine: Machine, signal: str, value: Any, *, now: bool) -> None:
    """At once, which waits for the last move to end; or when the next move begins."""
    if now:
        arrive(machine)
        kind = Kind.ANALOG if signal.startswith("analog") else Kind.OUTPUT
        machine.emit(kind, signal=machine.signal(signal), value=value)
    else:
        machine.state["pending"] = [*machine.state["pending"], [signal, value]]


def _wait(machine: Machine, values: dict[str, Evaluate]) -> None:
    number = whole_number(machine, values["P"](machine), "P")
    how = whole_number(machine, values["L"](machine), "L") if "L" in values else 0
    if how not in _WAITS:
        raise machine.fail(f"M66 L{how} only looks at the input: what it sees is not known")
    timeout = values["Q"](machine) if "Q" in values else 0.0
    never(machine, np.less_equal(timeout, 0.0), "M66 without a time to wait for (Q)")
    arrive(machine)
    came = machine.wait(f"in {number}", _WAITS[how], timeout)
    machine.state["input"] = _WAITS[how] if came else -1.0


# ── dwell, modes, motion, stop ───────────────────────────────────────────────────────────────────


def _dwell_and_modes(words: Words, values: dict[str, Evaluate]) -> list[Act]:
    acts: list[Act] = []
    if words.codes.get("dwell"):

        def dwell(machine: Machine) -> None:
            seconds = values["P"](machine)
            never(machine, seconds < 0.0, "a dwell of less than no time")
            arrive(machine)
            machine.emit(Kind.PAUSE, value=seconds)

        acts.append(dwell)
    units = words.codes.get("units")
    if units:
        acts.append(
            lambda machine: machine.state["modes"].update(
                unit=MM_PER_INCH if units == "G20" else 1.0
            )
        )
    stated = {group: True for group in ("units", "distance") if words.codes.get(group)}
    if stated:
        acts.append(lambda machine: machine.state["stated"].update(stated))
    changes = dict(_MODES[code] for code in words.codes.values() if code in _MODES)
    if changes:
        acts.append(lambda machine: machine.state["modes"].update(changes))
    if words.codes.get("path") == "G64":

        def set_tolerance(machine: Machine) -> None:
            given = values["P"](machine) if "P" in values else float("inf")
            machine.state["tolerance_mm"] = given * machine.state["modes"]["unit"]

        acts.append(set_tolerance)
    return acts


def _motion(words: Words, values: dict[str, Evaluate], at: At) -> tuple[Statement, ...]:
    code = words.codes.get("motion")
    axes = {letter: values[letter] for letter in words.axes}
    if code == "G80":
        return (Do(at, lambda machine: _set_motion(machine, MOTIONS[0])),)
    if code in CYCLES:
        return cycle(at, code, values)
    if code is not None:
        return (Do(at, _straight(code, axes, values)),)
    if not axes:
        return ()
    straight = Do(at, _straight(None, axes, values, words.cycle_words))
    turning = [letter for letter in axes if letter not in ("X", "Y", "Z")]
    otherwise: tuple[Statement, ...] = (straight,)
    if not turning:  # it may go on with the cycle of a block before
        for name in sorted(CYCLES):
            otherwise = (If(at, _goes_on_with(name), cycle(at, name, values), otherwise),)
    return otherwise


def _goes_on_with(code: str) -> Evaluate:
    return lambda machine: machine.state["modes"]["motion"] == MOTIONS.index(code)


def _set_motion(machine: Machine, code: str) -> None:
    machine.state["modes"]["motion"] = MOTIONS.index(code)
    machine.state["cycle"] = {"initial": float("nan")}


def _straight(
    code: str | None,
    axes: dict[str, Evaluate],
    values: dict[str, Evaluate],
    cycle_words: bool = False,
) -> Act:
    """G0, G1, or what the block before did (`code` None)."""

    def act(machine: Machine) -> None:
        modes = machine.state["modes"]
        motion = code or MOTIONS[uniform(machine, modes["motion"])]
        if motion not in ("G0", "G1"):
            none = motion == MOTIONS[0]
            said = "no code says how to move" if none else f"{motion} takes no such axis"
            raise machine.fail(f"{next(iter(axes))}, but {said}")
        if cycle_words:
            raise machine.fail("R, Q or L without a cycle that uses it")
        _set_motion(machine, motion)
        if not axes:
            return
        inverse = None
        if motion == "G1" and modes["feed"] == "G93":
            if "F" not in values:
                raise machine.fail("G1 without F, while G93 counts F anew in each block")
            inverse = machine.state["feed"]
        ends = targets(machine, axes)
        go(machine, ends, feed=motion == "G1", minutes_inverse=inverse)

    return act


def _stop(words: Words, last: bool) -> list[Act]:
    code = words.codes.get("stop")
    if code is None:
        return []
    if code in ("M2", "M30"):
        if not last:
            return [_end]
        return [lambda machine: machine.state.update(ended=True)]

    def pause(machine: Machine) -> None:
        arrive(machine)
        machine.emit(Kind.PAUSE, value=float("inf"))

    return [pause]


def _end(machine: Machine) -> None:
    machine.state["ended"] = True
    machine.stop()

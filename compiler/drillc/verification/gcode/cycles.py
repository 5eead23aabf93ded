"""Canned cycles: G81, G82, G83 and G73, as LinuxCNC takes them apart into straight moves.

What a cycle needs is kept in the routine's variables under the name `CYCLE`, so that it is run by
the machine like any other loop, in all lanes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..events import Kind
from ..machine import Machine
from ..statements import At, Do, Evaluate, If, Statement, While
from .expressions import Number, never, plain, truth, whole_number
from .motion import arrive, go
from .state import MM_PER_INCH, MOTIONS, uniform, unit_of

#: The routine's variable; no parameter is named so.
CYCLE = "(cycle)"
#: How far a peck comes back, or stops above the last one.
_PECK_CLEARANCE_MM = {1.0: 0.254, MM_PER_INCH: 0.254}
#: Across the axis along which the tool goes: the first two letters of LinuxCNC's plane.
_ACROSS = {"Z": ("X", "Y"), "X": ("Y", "Z"), "Y": ("Z", "X")}


def cycle(at: At, code: str, words: Mapping[str, Evaluate]) -> tuple[Statement, ...]:
    """The statements of a block that drills by a cycle."""

    def begin(machine: Machine) -> None:
        _begin(machine, code, words)

    def below_r(machine: Machine) -> Any:
        now = machine.locals[CYCLE]
        return truth(machine, _number(now["old"] < now["r"]))

    def rise(machine: Machine) -> None:
        now = machine.locals[CYCLE]
        _to(machine, now["r"], sideways=False)
        now["old"] = now["height"] = now["r"]

    def clear(machine: Machine) -> None:
        now = machine.locals[CYCLE]
        now["clear"] = now["r"] if machine.state["modes"]["back_to_r"] else now["old"]
        lower = now["height"] <= now["r"]
        now["height"] = plain(np.where(lower, now["clear"], now["height"])[()])

    def repeats(machine: Machine) -> bool:
        return bool(machine.locals[CYCLE]["times"] > 0)

    def step(machine: Machine) -> None:
        now = machine.locals[CYCLE]
        for k in (0, 1):
            now["across"][k] = now["across"][k] + now["steps"][k]

    def high(machine: Machine) -> Any:
        """Whether the tool comes from above R."""
        now = machine.locals[CYCLE]
        return truth(machine, _number(now["height"] > now["r"]))

    def aside(machine: Machine) -> None:
        _to(machine, machine.locals[CYCLE]["height"])

    def to_r(machine: Machine) -> None:
        _to(machine, machine.locals[CYCLE]["r"])

    def done(machine: Machine) -> None:
        now = machine.locals[CYCLE]
        _to(machine, now["clear"])
        now["height"] = now["clear"]
        now["times"] -= 1

    def end(machine: Machine) -> None:
        del machine.locals[CYCLE]

    return (
        Do(at, begin),
        If(at, below_r, (Do(at, rise),)),
        Do(at, clear),
        While(
            at,
            repeats,
            (
                Do(at, step),
                Do(at, aside),
                If(at, high, (Do(at, to_r),)),
                *_drilling(at, code),
                Do(at, done),
            ),
        ),
        Do(at, end),
    )


def _begin(machine: Machine, code: str, words: Mapping[str, Evaluate]) -> None:
    """Work out what the cycle needs; words that are left out are those of the cycle before."""
    modes, place = machine.state["modes"], machine.state["place"]
    drilled = modes["plane"]
    across = _ACROSS[drilled]
    same = MOTIONS[uniform(machine, modes["motion"])] == code
    known = machine.state["cycle"] if same else {}
    wrong = [letter for letter in "ABCUVW" if letter in words]
    if wrong:
        raise machine.fail(f"{wrong[0]} within {code}, which drills along {drilled} only")
    if modes["feed"] == "G93":
        raise machine.fail(f"{code} with G93: a cycle takes no time of its own")
    never(machine, machine.state["feed"] <= 0.0, "a feed with F0: the machine would stand still")

    def length(letter: str) -> Number:
        unit = unit_of(machine, letter)
        if letter in words:
            return words[letter](machine) * unit
        if letter not in known:
            raise machine.fail(f"{code} without {letter}")
        return known[letter]

    kept: dict[str, Any] = {"R": length("R"), drilled: length(drilled)}
    now: dict[str, Any] = {}
    if code in ("G83", "G73"):
        kept["Q"] = now["peck"] = length("Q")
        never(machine, now["peck"] <= 0.0, f"{code} with a Q that is not positive")
    if code == "G82":
        kept["P"] = words["P"](machine) if "P" in words else known.get("P")
        if kept["P"] is None:
            raise machine.fail("G82 without P")
        now["dwell"] = kept["P"]
    height = place[drilled]
    initial = machine.state["cycle"]["initial"]
    if np.isnan(initial).all():
        initial = height
    never(machine, np.isnan(initial), f"{code} begins where {drilled} is not known")
    kept["initial"] = initial
    if modes["absolute"]:
        now["r"], now["bottom"], steps = kept["R"], kept[drilled], [0.0, 0.0]
        now["across"] = [
            words[x](machine) * unit_of(machine, x) if x in words else place[x] for x in across
        ]
    else:
        now["r"] = initial + kept["R"]
        now["bottom"] = now["r"] + kept[drilled]
        steps = [words[x](machine) * unit_of(machine, x) if x in words else 0.0 for x in across]
        now["across"] = [place[x] for x in across]
    never(machine, now["r"] < now["bottom"], f"{code} with R below {drilled}")
    now["times"] = whole_number(machine, words["L"](machine), "L") if "L" in words else 1
    never(machine, now["times"] <= 0, "L0: the cycle does nothing")
    now |= {"steps": steps, "old": initial, "height": height, "clear": initial}
    machine.locals[CYCLE] = now
    machine.state["cycle"] = kept
    modes["motion"] = MOTIONS.index(code)


def _drilling(at: At, code: str) -> tuple[Statement, ...]:
    """From R to the bottom."""

    def down(machine: Machine) -> None:
        _to(machine, machine.locals[CYCLE]["bottom"], feed=True)

    def dwell(machine: Machine) -> None:
        arrive(machine)
        machine.emit(Kind.PAUSE, value=machine.locals[CYCLE]["dwell"])

    if code == "G81":
        return (Do(at, down),)
    if code == "G82":
        return (Do(at, down), Do(at, dwell))

    def first(machine: Machine) -> None:
        now = machine.locals[CYCLE]
        now["depth"] = now["r"] - now["peck"]

    def not_deep(machine: Machine) -> Any:
        now = machine.locals[CYCLE]
        return truth(machine, _number(now["depth"] > now["bottom"]))

    def peck(machine: Machine) -> None:
        now = machine.locals[CYCLE]
        _to(machine, now["depth"], feed=True)
        if code == "G83":
            _to(machine, now["r"])
        gap = _PECK_CLEARANCE_MM[machine.state["modes"]["unit"]]
        _to(machine, now["depth"] + gap)
        now["depth"] = now["depth"] - now["peck"]

    return (Do(at, first), While(at, not_deep, (Do(at, peck),)), Do(at, down))


def _to(machine: Machine, height: Number, *, feed: bool = False, sideways: bool = True) -> None:
    """Within a cycle the machine stops at the end of every move."""
    now = machine.locals[CYCLE]
    drilled = machine.state["modes"]["plane"]
    ends = dict(zip(_ACROSS[drilled], now["across"], strict=True)) if sideways else {}
    go(machine, {**ends, drilled: height}, feed=feed, exact=True)


def _number(condition: Any) -> Number:
    return condition * 1.0

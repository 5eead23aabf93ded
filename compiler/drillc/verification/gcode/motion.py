"""Straight moves: where they lead, how long they take, and whether their end is reached."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..events import Kind
from ..machine import Machine
from ..statements import Evaluate
from .expressions import Number, never
from .state import LETTERS, TURNING, uniform, unit_of

#: What must be stated before anything moves.
_NEEDED = {"units": "G20 or G21", "distance": "G90 or G91"}
#: F is counted along the first of these of which an axis moves.
_COUNTED = (("X", "Y", "Z"), ("U", "V", "W"), TURNING)
#: LinuxCNC takes an axis to stand still that moves by less, in mm or degrees.
LEAST_MOVE = 1e-7
#: Where the way turns by more than this, something of it is cut off in passing.
_STRAIGHT_ON = 0.9986  # the cosine of 3°
#: A tolerance (G64 P) that is not worth mentioning.
_LITTLE_MM = 0.001

#: Values of a MESSAGE that is a note of the reader's own: the move before is cut short, or not.
#: It is an event, because only what happens in the end counts, and for each lane by itself.
CUT, NOT_CUT = -1.0, 0.0


def targets(machine: Machine, words: Mapping[str, Evaluate]) -> dict[str, Number]:
    """Where the axis words of a block lead, in mm and degrees."""
    place = machine.state["place"]
    absolute = machine.state["modes"]["absolute"]
    ends = {}
    for letter, value in words.items():
        end = value(machine) * unit_of(machine, letter)
        ends[letter] = end if absolute else place[letter] + end
    return ends


def go(
    machine: Machine,
    ends: Mapping[str, Number],
    *,
    feed: bool,
    minutes_inverse: Number | None = None,
    exact: bool = False,
) -> None:
    """Move the axes of `ends` there in proportion; `minutes_inverse` is F of G93; `exact`: whatever
    G64 says."""
    state = machine.state
    for mode, codes in _NEEDED.items():
        if not uniform(machine, state["stated"][mode]):
            raise machine.fail(f"a move before {codes}: what was active before is not known")
    place = state["place"]
    after = {**place, **ends}
    _set_pending(machine)
    _mind_corner(machine, place, after, exact)
    joints = np.empty((machine.lanes, len(LETTERS)))
    for k, letter in enumerate(LETTERS):
        joints[:, k] = after[letter]
    if feed:
        length, turning = _length(place, after)
        if minutes_inverse is None:
            speed = _per_second(machine, turning)
            seconds = length / speed
        else:
            never(machine, minutes_inverse <= 0.0, "a feed with F0: the machine would stand still")
            seconds = 60.0 / minutes_inverse
            speed = length / seconds
        machine.emit(Kind.STRAIGHT, joints=joints, value=seconds, speed_mm_s=speed)
    else:
        machine.emit(Kind.STRAIGHT, joints=joints)
    state["place"] = after


def arrive(machine: Machine) -> None:
    """LinuxCNC waits here until the last move has ended, so that its end is reached."""
    if uniform(machine, machine.state["modes"]["blends"]):
        machine.state["corner"] = [0.0] * len(LETTERS)


def _per_second(machine: Machine, turning: Any) -> Number:
    """F, in mm or degrees per second; `turning`: whether it is counted in degrees."""
    state = machine.state
    never(machine, np.isnan(state["feed"]), "a feed before any F")
    never(machine, state["feed"] <= 0.0, "a feed with F0: the machine would stand still")
    rate = state["feed_mm"]
    if np.any(turning):
        rate = np.where(turning, state["feed"], state["feed_mm"])
    if state["modes"]["feed"] == "G95":
        never(machine, state["speed"] == 0.0, "a feed per turn of a spindle without speed")
        rate = rate * state["speed"]
    return rate / 60.0


def _length(place: Mapping[str, Number], after: Mapping[str, Number]) -> tuple[Number, Any]:
    """The length along which F is counted, and whether it is an angle."""
    length: Number = 0.0
    turning: Any = False
    decided: Any = False  # in which lanes an earlier group moves
    for group in _COUNTED:
        ways = [after[x] - place[x] for x in group if after[x] is not place[x]]
        if not ways:
            continue
        stands = [np.abs(way) < LEAST_MOVE for way in ways]
        squares = sum(
            np.where(still, 0.0, way * way) for still, way in zip(stands, ways, strict=True)
        )
        moves = ~np.logical_and.reduce(stands)
        length = np.where(decided, length, np.sqrt(squares))
        turning = ~np.bool_(decided) & moves if group is TURNING else turning
        decided = decided | moves
    return length, turning


def _mind_corner(
    machine: Machine,
    place: Mapping[str, Number],
    after: Mapping[str, Number],
    exact: bool,
) -> None:
    """With G64 the machine does not stop between two moves: it leaves the first before its end.

    The way of a move that may be left so is kept until the next move begins, or until something
    makes LinuxCNC wait for its end.
    """
    state = machine.state
    before = state["corner"]
    blends = uniform(machine, state["modes"]["blends"]) and not exact
    open_before = any(isinstance(way, np.ndarray) or way != 0.0 for way in before)  # NaN too
    if not blends and not open_before:
        return
    ways = [0.0 if after[x] is place[x] else after[x] - place[x] for x in LETTERS]
    if open_before:
        along = sum(one * two for one, two in zip(before, ways, strict=True))
        sizes = sum(way * way for way in before) * sum(way * way for way in ways)
        # Where it came from, or goes to, may not be known: then it turns.
        turned = ~(sizes == 0.0) & ~(along >= _STRAIGHT_ON * np.sqrt(sizes))
        if np.any(turned):
            machine.emit(Kind.MESSAGE, value=np.where(turned, CUT, NOT_CUT))
    blends = blends and state["tolerance_mm"] > _LITTLE_MM
    state["corner"] = ways if blends else [0.0] * len(LETTERS)


def _set_pending(machine: Machine) -> None:
    """Signals that were to be set when the next move begins."""
    pending = machine.state["pending"]
    for signal, value in pending:
        kind = Kind.ANALOG if signal.startswith("analog") else Kind.OUTPUT
        machine.emit(kind, signal=machine.signal(signal), value=value)
    if pending:
        machine.state["pending"] = []

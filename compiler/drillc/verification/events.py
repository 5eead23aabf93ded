"""What a program does when it runs, in columns: the common ground of all readers and all checks.

An event is a row: a move, a signal, a pause, a wait. Numbers are as the controller counts them,
lengths in mm and angles in degrees only where they are joints; nothing here knows a spec.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int32]


class Kind(IntEnum):
    """What an event is, and what its `value` means."""

    STRAIGHT = (
        0  #: the tool (or, in joints, every axis in proportion) goes straight; at `speed_mm_s`
    )
    JOINTS = (
        1  #: all axes at once, by the controller's own way; `value`: share of full speed, or NaN
    )
    OUTPUT = 2  #: a digital output; `value` 1 or 0
    ANALOG = 3  #: an analog output; `value` as the controller counts it
    SPINDLE = 4  #: the language's own word for the spindle; `value` rev/s, 0: off
    PAUSE = 5  #: `value` in seconds; inf: until somebody presses start
    WAIT = 6  #: waits for a digital input to be `value`; `timeout_s`, inf: for ever
    MESSAGE = 7  #: tells the operator
    STOP = 8  #: the program has ended, and pressing start does not make it go on
    HOME = 9  #: all axes to a place that the controller knows, not the program


@dataclass(frozen=True)
class ToolFrame:
    """A tool or base that was active: what the program calls it, and its rotation (3, 3) and
    position (3,) in mm where the program itself states them; of a tool also its mass and centre of
    gravity (3,) in mm, from the flange."""

    name: str
    rotation: Floats | None = None
    position_mm: Floats | None = None
    mass_kg: float | None = None
    centre_of_gravity_mm: Floats | None = None


@dataclass(frozen=True, eq=False)
class Events:
    """n events in the order in which they happen.

    `file` and `line` are where the statement stands that does it; `call_file` and `call_line` the
    statement of the program's body that led there (the same, where no routine is called).
    `position_mm` and `rotation` place the tool in the active base (`base_from_tool`); NaN for moves
    that are given by joints. `joints` (n, k) go by the reader's `axes`; NaN where not given.
    `configuration` (n, 4): what a target says of the arm's posture, NaN where it says nothing or
    the move does not go by it. `signal`: index into the run's `signals`, or -1. `tool`, `base`:
    index into the run's `frames`, or -1.
    """

    kind: NDArray[np.uint8]
    file: Ints
    line: Ints
    call_file: Ints
    call_line: Ints
    position_mm: Floats  # (n, 3)
    rotation: Floats  # (n, 3, 3)
    joints: Floats  # (n, k)
    configuration: Floats  # (n, 4)
    speed_mm_s: Floats
    value: Floats
    timeout_s: Floats
    signal: Ints
    tool: Ints
    base: Ints

    def __len__(self) -> int:
        return len(self.kind)

    def take(self, rows: NDArray[np.intp] | NDArray[np.bool_] | slice) -> Events:
        """The events of some rows, in the order given."""
        return Events(*(getattr(self, field.name)[rows] for field in fields(self)))


def moves_of(kind: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Which events (n,) are moves."""
    return np.asarray((kind == Kind.STRAIGHT) | (kind == Kind.JOINTS) | (kind == Kind.HOME))


def placed_of(kind: NDArray[np.uint8]) -> NDArray[np.bool_]:
    """Which events (n,) are moves to a place that the program states."""
    return np.asarray((kind == Kind.STRAIGHT) | (kind == Kind.JOINTS))


def joined(parts: Sequence[Events]) -> Events:
    """The events of all parts, one after another; at least one part is needed."""
    return Events(
        *(np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(Events))
    )


def no_events(axes: int) -> Events:
    """None at all, of a machine with so many axes."""
    return blank(0, axes)


def blank(count: int, axes: int) -> Events:
    """Rows to be filled in: everything NaN, -1 or 0."""

    def nan(*shape: int) -> Floats:
        return np.full((count, *shape), np.nan)

    def minus() -> Ints:
        return np.full(count, -1, dtype=np.int32)

    return Events(
        kind=np.zeros(count, dtype=np.uint8),
        file=minus(),
        line=minus(),
        call_file=minus(),
        call_line=minus(),
        position_mm=nan(3),
        rotation=nan(3, 3),
        joints=nan(axes),
        configuration=nan(4),
        speed_mm_s=nan(),
        value=nan(),
        timeout_s=nan(),
        signal=minus(),
        tool=minus(),
        base=minus(),
    )


@dataclass(frozen=True, eq=False)
class Alternative:
    """What would happen instead of a stretch of the main run, if an answer did not come in time or
    the axes stood elsewhere at the start.

    `events` are those after the choice, for every lane it concerns, one lane after another:
    `starts` (m + 1,) says where each lane begins. `call_line` and `call_file` (m,) name the
    statement of the body, `line` and `file` the choice itself. `timeout`: a wait that ran out; else
    a condition that hangs on where the machine stands at the start. `ends`: the program stops for
    good there; else it goes on.
    """

    events: Events
    starts: NDArray[np.intp]
    call_file: Ints
    call_line: Ints
    file: int
    line: int
    timeout: bool
    ends: bool


Step = Events | Alternative

"""Where lanes stand in a program that they run together, such that they can go on from there twice.

A `Course` is all that is needed to run on: the statements that are being run, one inside another,
and the state. A copy of it, kept before a statement that chooses between two ways, is where the
other way begins, and where lanes that part go on apart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .events import Kind
from .statements import At, Call, Forever, Repeated, Statement, While
from .values import Lanes, Value, copied, select


class Returned(Exception):  # noqa: N818 (a way of control, like those below)
    """Leaves the routine of the program's frame."""


class Stopped(Exception):  # noqa: N818
    """Ends the program."""


class Parted(Exception):  # noqa: N818
    """Lanes go different ways; `truth` says which of them go the first."""

    def __init__(self, truth: NDArray[np.bool_]) -> None:
        super().__init__()
        self.truth = truth


class Unforeseen(Exception):  # noqa: N818
    """A statement chooses, of which it was not known that it does: nothing was kept before it."""


@dataclass(frozen=True)
class Made:
    """One event of a batch: its fields as values, the same in all `lanes` or one a lane."""

    lanes: Lanes
    kind: Kind
    at: At
    top: int  # which statement of the body it belongs to
    fields: Mapping[str, Value]


@dataclass(eq=False, slots=True)
class Frame:
    """Statements that are run one after another, and which of them is the `next`.

    `of` is what they are the body of: a loop in its turn `turns` (from 0), a call of a routine, or
    repeated statements in that lane, with `columns` of their own. `begun` is what an endless loop
    began its turn with, and after how many events.
    """

    body: Sequence[Statement]
    of: While | Forever | Call | Repeated | None = None
    next: int = 0
    turns: int = 0
    columns: Sequence[Any] | None = None
    begun: tuple[Value, int] | None = None

    def again(self) -> Frame:
        """A copy."""
        return Frame(self.body, self.of, self.next, self.turns, self.columns, self.begun)


@dataclass(frozen=True)
class Choice:
    """One of two ways, at a statement that was about to be run when `course` was kept: the
    `number`-th that it chose, after so many `events` since. `timeout`: it waited."""

    course: Course
    number: int
    events: int
    at: At
    top: int
    timeout: bool


@dataclass(eq=False)
class Course:
    """What some lanes of a batch do together: `lanes` of it, with the columns of the repeated
    statements, what is being run (from the batch's body inwards), the state, what has happened so
    far, and the choices that were come by."""

    lanes: Lanes
    columns: Sequence[Any]
    frames: list[Frame]
    state: dict[str, Any]
    made: list[Made] = field(default_factory=list)
    choices: list[Choice] = field(default_factory=list)

    @property
    def top(self) -> int:
        """Which statement of the batch's body is being run."""
        return self.frames[0].next - 1

    @property
    def depth(self) -> int:
        """How many calls deep it is."""
        return sum(isinstance(frame.of, Call) for frame in self.frames)

    def column(self, number: int) -> Value:
        """A column of the repeated statements that are being run."""
        for frame in reversed(self.frames):
            if frame.columns is not None:
                return frame.columns[number]
        return self.columns[number]

    def kept(self) -> Course:
        """A copy that this one does not change any more."""
        return Course(
            self.lanes,
            self.columns,
            [frame.again() for frame in self.frames],
            copied(self.state),
            self.made.copy(),
            self.choices.copy(),
        )

    def part(self, some: Lanes) -> Course:
        """Only some of the lanes, from here on; they come by new choices only."""
        frames = [frame.again() for frame in self.frames]
        for frame in frames:
            if frame.begun is not None:
                frame.begun = (select(frame.begun[0], some), frame.begun[1])
        columns = [of_lanes(column, some) for column in self.columns]
        state, made = select(self.state, some), self.made.copy()
        return Course(self.lanes[some], columns, frames, state, made)


def of_lanes(column: Any, lanes: Lanes) -> Any:
    """A column of some lanes; a list has an item for each."""
    return [column[i] for i in lanes] if isinstance(column, list) else select(column, lanes)

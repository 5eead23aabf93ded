"""Runs a program's statements in lanes, and lists what it does.

A stretch of statements that are repeated with other numbers is run once, with arrays in place of
the numbers. That is sound because of how a lane begins: each begins with the state in which the
lane before it ended. The machine first supposes that all begin alike, runs them, and runs them
again from the states in which they then ended, until nothing changes; what is then consistent is,
lane by lane, what happens one after another. Where lanes part ways (a loop that some run once more)
they go on apart.

At each wait the answer comes. What happens where it does not is run too, from there on, as an
`Alternative`, and so is the other way of a condition that hangs on where the axes stand before the
program starts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import groupby
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from .batch import Batch, Path, flat, in_order
from .course import (
    Choice,
    Course,
    Frame,
    Made,
    Parted,
    Returned,
    Stopped,
    Unforeseen,
    of_lanes,
)
from .events import Alternative, Kind, Step, ToolFrame
from .reading import ReadError
from .statements import (
    At,
    Call,
    Do,
    Exit,
    Forever,
    If,
    Repeated,
    Return,
    Routine,
    Statement,
    While,
)
from .values import (
    NotUniform,
    Value,
    carried,
    copied,
    gathered,
    last_lane,
    passed_on,
    same,
)

#: A loop that runs longer than this never ends.
MOST_TURNS = 100_000
#: Routines that call one another deeper than this never return.
DEEPEST = 50
#: So many lanes are run together, which bounds the memory that their events take.
MOST_LANES = 1 << 12
#: How often lanes are run before they are run one by one instead.
_MOST_TRIES = 6


class Undecided:
    """The truth of a condition that hangs on what the program does not know."""


UNDECIDED = Undecided()


@dataclass(eq=False)
class Machine:
    """`state` is all that lasts from statement to statement, a tree of dictionaries and lists of
    values that the reader lays out; `state["locals"]` is a list with the variables of each routine
    that is running. `constants` is what no statement changes. `signals` and `frames` give numbers
    to names as they turn up. `lanes` is how many are being run.
    """

    axes: tuple[str, ...]
    state: dict[str, Any]
    constants: Any = None
    signals: dict[str, int] = field(default_factory=dict)
    frames: list[ToolFrame] = field(default_factory=list)
    lanes: int = 1
    _batch: Batch | None = None
    _course: Course = field(
        default_factory=lambda: Course(np.arange(1), (), [Frame(())], {"locals": []})
    )
    _at: At = field(default_factory=lambda: At(-1, 0))
    #: Statements that choose, or part lanes: before they are run, their course is kept.
    _choosing: set[At] = field(default_factory=set)
    _kept: Course | None = None  # the course before the statement that is being run
    _chosen: int = 0  # how often it has chosen
    _other_way: int | None = None  # which of its choices is to go the other way

    # ── what readers use in their functions ──────────────────────────────────────────────────────

    @property
    def locals(self) -> dict[str, Any]:
        """The variables of the routine that is running."""
        variables: dict[str, Any] = self.state["locals"][-1]
        return variables

    @property
    def at(self) -> At:
        """The statement that is being run; of repeated ones, that in the first lane."""
        batch, course = self._batch, self._course
        if batch is not None and batch.has(course.top, self._at):
            return At(batch.file, int(batch.lines[course.lanes[0], course.top]))
        return self._at

    def column(self, number: int) -> Value:
        """Column `number` of the repeated statements, one value a lane."""
        return self._course.column(number)

    def emit(self, kind: Kind, **fields: Value) -> None:
        """Let something happen. `fields` are those of `Events`: single values, or one a lane."""
        course = self._course
        course.made.append(Made(course.lanes, kind, self._at, course.top, fields))

    def signal(self, name: str) -> int:
        """The number of a signal."""
        return self.signals.setdefault(name, len(self.signals))

    def frame(self, frame: ToolFrame) -> int:
        """The number of a tool or base; one that is named and placed alike has the same number."""
        for number, known in enumerate(self.frames):
            if known is frame or (
                known.name == frame.name
                and _alike(known.rotation, frame.rotation)
                and _alike(known.position_mm, frame.position_mm)
                and known.mass_kg == frame.mass_kg
                and _alike(known.centre_of_gravity_mm, frame.centre_of_gravity_mm)
            ):
                return number
        self.frames.append(frame)
        return len(self.frames) - 1

    def wait(self, signal: str, value: float, timeout_s: Value) -> bool:
        """Wait for an input; whether it came. In the main run it does."""
        self.emit(Kind.WAIT, signal=self.signal(signal), value=value, timeout_s=timeout_s)
        return not self._choose(timeout=True)

    def part(self, truth: NDArray[np.bool_]) -> NoReturn:
        """Let lanes go on apart: those for which `truth` (lanes,) holds, and the others. It holds
        for some and not for all."""
        raise Parted(truth)

    def stop(self) -> None:
        """End the program for good."""
        self.emit(Kind.STOP)
        raise Stopped

    def fail(self, message: str) -> ReadError:
        """An error at the statement that is being run, to be raised."""
        return ReadError(self.at.file, self.at.line, 1, message)

    # ── the program ──────────────────────────────────────────────────────────────────────────────

    def run(self, routine: Routine) -> Iterator[Step]:
        """Everything that happens, in order. Raises ReadError."""
        with suppress(Stopped, Returned):
            yield from self._body(routine.body, 0)

    def _body(self, body: Sequence[Statement], depth: int) -> Iterator[Step]:
        """Statements of the program's frame: acts in a row as one batch, all others singly."""
        if depth > DEEPEST:
            raise self.fail("routines call one another without an end")
        for acts, some in groupby(body, key=lambda statement: isinstance(statement, Do)):
            if acts:
                yield from self._acts(list(some))
                continue
            for statement in some:
                yield from self._singly(statement, depth)

    def _singly(self, statement: Statement, depth: int) -> Iterator[Step]:
        if isinstance(statement, Repeated):
            for first in range(0, len(statement.lines), MOST_LANES):
                lanes = np.arange(first, min(first + MOST_LANES, len(statement.lines)))
                columns = [of_lanes(column, lanes) for column in statement.columns]
                yield from self._in_lanes(
                    Batch(statement.body, columns, statement.lines[lanes], statement.file)
                )
        elif isinstance(statement, Call) and (routine := statement.routine()).steps:
            self._at = statement.at
            self.state["locals"].append(statement.enter(self))
            with suppress(Returned):
                yield from self._body(routine.body, depth + 1)
            variables = self.state["locals"].pop()
            if statement.leave is not None:
                statement.leave(self, variables)
        elif isinstance(statement, Return):
            raise Returned
        else:
            yield from self._in_lanes(_batch_of([statement]))

    def _acts(self, acts: Sequence[Statement]) -> Iterator[Step]:
        """Acts one after another. What an alternative leads to ends with its statement, so where
        one of them chooses they are run singly."""
        batch = _batch_of(acts)
        if len(acts) > 1:
            paths, choices = self._consistent(batch)
            if not choices:
                yield from self._told(batch, paths, choices)
                return
        for one in acts:
            yield from self._in_lanes(_batch_of([one]))

    # ── batches ──────────────────────────────────────────────────────────────────────────────────

    def _in_lanes(self, batch: Batch) -> Iterator[Step]:
        """Run a batch, one lane after another: together, if that can be."""
        count = len(batch.lines)
        try:
            paths, choices = self._consistent(batch)
        except NotUniform:
            # A variable that has its first value now, say. After one lane it has one.
            if count == 1:
                raise
            yield from self._in_lanes(batch.part(np.arange(1)))
            yield from self._rest(batch.part(np.arange(1, count)))
            return
        yield from self._told(batch, paths, choices)

    def _rest(self, batch: Batch) -> Iterator[Step]:
        """All lanes but the first: if they cannot be run together, one by one."""
        try:
            paths, choices = self._consistent(batch)
        except NotUniform:
            for lane in range(len(batch.lines)):
                yield from self._in_lanes(batch.part(np.array([lane])))
            return
        yield from self._told(batch, paths, choices)

    def _consistent(self, batch: Batch) -> tuple[list[Path], list[Choice]]:
        """What the lanes do, such that each begins as the one before ends. Raises NotUniform."""
        count = len(batch.lines)
        lanes = np.arange(count)
        first: dict[str, Any] = self.state
        begin, wrote = first, None
        for _ in range(_MOST_TRIES):
            try:
                start = Course(lanes, batch.columns, [Frame(batch.body)], begin)
                paths, choices = self._paths(batch, start)
            except ReadError:
                if count == 1:
                    raise
                # It may come of a guess at how a lane begins. If not, it comes again, in its lane.
                raise NotUniform from None
            if count == 1:
                break
            if any(path.stopped or path.returned for path in paths):
                raise NotUniform  # what comes after a stop does not happen: one by one
            ends = _ends(paths)
            again = passed_on(first, ends, count)
            if same(again, begin):
                break
            begin, wrote = carried(first, begin, ends, wrote, count)
        else:
            raise NotUniform
        return paths, choices

    def _told(self, batch: Batch, paths: list[Path], choices: list[Choice]) -> Iterator[Step]:
        """The events of a batch, and what might happen instead; the state after it."""
        yield in_order(batch, paths, len(self.axes))
        for choice in choices:
            for other in self._other(batch, choice):
                yield self._alternative(batch, other, choice)
        self.state = last_lane(_ends(paths))
        if any(path.stopped for path in paths):
            raise Stopped
        if any(path.returned for path in paths):
            raise Returned

    def _other(self, batch: Batch, choice: Choice) -> list[Path]:
        """What happens from a choice on, the other way; events from its statement on."""
        start = replace(choice.course, made=[], choices=[])
        return self._paths(batch, start, choice.number)[0]

    def _alternative(self, batch: Batch, path: Path, choice: Choice) -> Alternative:
        made = path.made[choice.events :]
        lanes = len(path.lanes)
        return Alternative(
            events=flat(batch, path.lanes, made, len(self.axes)),
            starts=np.arange(lanes + 1) * len(made),
            call_file=np.full(lanes, batch.file, dtype=np.int32),
            call_line=batch.lines[path.lanes, choice.top],
            file=choice.at.file,
            line=choice.at.line,
            timeout=choice.timeout,
            ends=path.stopped,
        )

    # ── lanes that go together ───────────────────────────────────────────────────────────────────

    def _paths(
        self, batch: Batch, start: Course, other_way: int | None = None
    ) -> tuple[list[Path], list[Choice]]:
        """What lanes do from `start` on, those that go the same way together, and the choices that
        they come by. The first statement goes the other way at its choice number `other_way`."""
        whole, course = self.state, self._course
        self._batch = batch
        try:
            while True:
                try:
                    return self._apart(start.kept(), other_way)
                except Unforeseen:
                    self._choosing.add(self._at)
        finally:
            self.state, self._course, self._batch = whole, course, None

    def _apart(self, course: Course, other_way: int | None) -> tuple[list[Path], list[Choice]]:
        paths: list[Path] = []
        choices: list[Choice] = []
        todo = [(course, other_way)]
        while todo:
            course, other_way = todo.pop()
            stopped = returned = False
            try:
                self._follow(course, other_way)
            except Stopped:
                stopped = True
            except Returned:
                returned = True
            except Parted as parted:
                kept = self._kept
                if kept is None:
                    raise Unforeseen from None
                choices += kept.choices
                way = self._other_way
                sides = (np.flatnonzero(parted.truth), np.flatnonzero(~parted.truth))
                todo += [(kept.part(side), way) for side in reversed(sides)]
                continue
            choices += course.choices
            paths.append(Path(course.lanes, course.made, course.state, stopped, returned))
        return paths, choices

    def _follow(self, course: Course, other_way: int | None) -> None:
        """Run on to the end of the body."""
        self._course, self.state, self.lanes = course, course.state, len(course.lanes)
        self._other_way = other_way
        frames = course.frames
        while True:
            frame = frames[-1]
            ended = frame.next == len(frame.body)
            statement = frame.of if ended else frame.body[frame.next]
            if statement is None:
                if len(frames) == 1:
                    return
                frames.pop()
                continue
            self._kept, self._chosen = None, 0
            if not isinstance(statement, Repeated):
                self._at = statement.at
                if statement.at in self._choosing:
                    self._kept = course.kept()
            if ended:
                self._end(frame)
            else:
                frame.next += 1
                self._begin(statement, frames)
            self._other_way = None

    # ── statements ───────────────────────────────────────────────────────────────────────────────

    def _begin(self, statement: Statement, frames: list[Frame]) -> None:
        match statement:
            case Do():
                statement.act(self)
            case If():
                truth = self._truth(statement.condition(self))
                if body := statement.then if truth else statement.otherwise:
                    frames.append(Frame(body))
            case While():
                if self._truth(statement.condition(self)):
                    frames.append(Frame(statement.body, statement))
            case Forever():
                frames.append(Frame(statement.body, statement, begun=self._now()))
            case Call():
                if self._course.depth >= DEEPEST:
                    raise self.fail("routines call one another without an end")
                self.state["locals"].append(statement.enter(self))
                frames.append(Frame(statement.routine().body, statement))
            case Repeated():
                if len(statement.lines):
                    frames.append(_one_of(statement, 0))
            case Exit():
                while not isinstance(frames[-1].of, While | Forever):
                    if len(frames) == 1 or isinstance(frames[-1].of, Call):
                        raise self.fail("there is no loop to be left")
                    frames.pop()
                frames.pop()
            case Return():
                while frames and not isinstance(frames[-1].of, Call):
                    frames.pop()
                if not frames:
                    raise Returned
                self._end(frames[-1])

    def _end(self, frame: Frame) -> None:
        """The end of a loop's turn, of a routine, or of one lane of repeated statements."""
        frames, loop = self._course.frames, frame.of
        match loop:
            case Call():
                frames.pop()
                variables = self.state["locals"].pop()
                self._at = loop.at
                if loop.leave is not None:
                    loop.leave(self, variables)
            case While():
                frame.turns += 1
                self._not_for_ever(frame)
                if self._truth(loop.condition(self)):
                    frame.next = 0
                else:
                    frames.pop()
            case Forever():
                state, made = frame.begun or (None, 0)
                if len(self._course.made) == made and same(state, self.state):
                    self.stop()  # it changes nothing and moves nothing: the end of the program
                frame.turns += 1
                self._not_for_ever(frame)
                frame.next, frame.begun = 0, self._now()
            case Repeated():
                frames.pop()
                if frame.turns + 1 < len(loop.lines):
                    frames.append(_one_of(loop, frame.turns + 1))

    def _now(self) -> tuple[Value, int]:
        return copied(self.state), len(self._course.made)

    def _not_for_ever(self, frame: Frame) -> None:
        if frame.turns >= MOST_TURNS:
            raise self.fail(f"the loop has not ended after {MOST_TURNS:,} turns")

    def _truth(self, value: Value) -> bool:
        if value is UNDECIDED:
            return self._choose(timeout=False)
        if isinstance(value, np.ndarray):
            if value.dtype != np.bool_:
                raise self.fail("a condition is no truth")
            if value.any() and not value.all():
                raise Parted(value)
            return bool(value[0])
        if not isinstance(value, bool | np.bool_):
            raise self.fail("a condition is no truth")
        return bool(value)

    def _choose(self, timeout: bool) -> bool:
        """False, but True at the choice at which the other way is to be taken."""
        course, kept = self._course, self._kept
        if kept is None:
            raise Unforeseen
        events = len(course.made) - len(kept.made)
        course.choices.append(Choice(kept, self._chosen, events, self._at, course.top, timeout))
        self._chosen += 1
        return self._chosen - 1 == self._other_way


def _batch_of(statements: Sequence[Any]) -> Batch:
    """Statements that are run once."""
    lines = np.array([[statement.at.line for statement in statements]], dtype=np.int32)
    return Batch(statements, (), lines, statements[0].at.file)


def _one_of(repeated: Repeated, lane: int) -> Frame:
    """One lane of repeated statements, within a routine that is run as a whole, or a loop."""
    only = np.array([lane])
    columns = [last_lane(of_lanes(column, only)) for column in repeated.columns]
    body = [
        replace(statement, at=At(repeated.file, line))  # type: ignore[arg-type]
        for statement, line in zip(repeated.body, repeated.lines[lane].tolist(), strict=True)
    ]
    return Frame(body, repeated, turns=lane, columns=columns)


def _ends(paths: Sequence[Path]) -> Value:
    """The state of each lane at the end."""
    return gathered([(path.lanes, path.state) for path in paths], sum(len(p.lanes) for p in paths))


def _alike(one: Any, two: Any) -> bool:
    if one is None or two is None:
        return one is two
    return bool(np.array_equal(one, two))

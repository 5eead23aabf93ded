"""Runs a program's statements in lanes, and lists what it does.

A stretch of statements that are repeated with other numbers is run once, with arrays in place of
the numbers. That is sound because of how a lane begins: each begins with the state in which the
lane before it ended. The machine first supposes that all begin alike, runs them, and runs them
again from the states in which they then ended, until nothing changes; what is then consistent is,
lane by lane, what happens one after another. Where lanes part ways (a loop that some run once more)
they go on apart.

At each wait the answer comes. What happens where it does not is run too, as an `Alternative`, and
so is the other way of a condition that hangs on where the axes stand before the program starts.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from .events import Alternative, Events, Kind, Step, ToolFrame, blank
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
    Lanes,
    NotUniform,
    Value,
    carried,
    copied,
    gathered,
    last_lane,
    passed_on,
    same,
    select,
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


class _Exit(Exception):  # noqa: N818
    """Leaves a loop."""


class _Return(Exception):  # noqa: N818
    """Leaves a routine."""


class _Stop(Exception):  # noqa: N818
    """Ends the program."""


class _Parted(Exception):  # noqa: N818
    """Lanes go different ways; `truth` says which of them go the first."""

    def __init__(self, truth: NDArray[np.bool_]) -> None:
        super().__init__()
        self.truth = truth


@dataclass(frozen=True)
class _Made:
    """One event of a batch: its fields as values, the same in all lanes or one a lane."""

    kind: Kind
    at: At
    top: int  # which statement of the body it belongs to
    fields: Mapping[str, Value]


@dataclass(frozen=True)
class _Choice:
    """A choice that a batch came by: how many events had happened, where, in which statement of
    the body, and whether it waits."""

    events: int
    at: At
    top: int
    timeout: bool


@dataclass(frozen=True)
class _Path:
    """What some lanes did together."""

    lanes: Lanes
    made: Sequence[_Made]
    choices: Sequence[_Choice]
    state: Value
    stopped: bool


@dataclass(eq=False)
class Machine:
    """`state` is all that lasts from statement to statement, a tree of dictionaries and lists of
    values that the reader lays out; `state["locals"]` is a list with the variables of each routine
    that is running. `constants` is what no statement changes. `signals` and `frames` give numbers
    to names as they turn up.
    """

    axes: tuple[str, ...]
    state: dict[str, Any]
    constants: Any = None
    signals: dict[str, int] = field(default_factory=dict)
    frames: list[ToolFrame] = field(default_factory=list)
    lanes: int = 1
    _columns: Sequence[Any] = ()
    _made: list[_Made] = field(default_factory=list)
    _choices: list[_Choice] = field(default_factory=list)
    _other_way: int | None = None  # the choice at which the other way is taken
    _top: int = 0
    _at: At = field(default_factory=lambda: At(-1, 0))
    _running: tuple[_Batch, Lanes] | None = None

    # ── what readers use in their functions ──────────────────────────────────────────────────────

    @property
    def locals(self) -> dict[str, Any]:
        """The variables of the routine that is running."""
        variables: dict[str, Any] = self.state["locals"][-1]
        return variables

    @property
    def at(self) -> At:
        """The statement that is being run; of repeated ones, that in the first lane."""
        if self._running is not None:
            batch, lanes = self._running
            if self._top < len(batch.body) and _stands_at(batch.body[self._top], self._at):
                return At(batch.file, int(batch.lines[lanes[0], self._top]))
        return self._at

    def column(self, number: int) -> Value:
        """Column `number` of the repeated statements, one value a lane."""
        return self._columns[number]

    def emit(self, kind: Kind, **fields: Value) -> None:
        """Let something happen. `fields` are those of `Events`: single values, or one a lane."""
        self._made.append(_Made(kind, self._at, self._top, fields))

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
        raise _Parted(truth)

    def stop(self) -> None:
        """End the program for good."""
        self.emit(Kind.STOP)
        raise _Stop

    def fail(self, message: str) -> ReadError:
        """An error at the statement that is being run, to be raised."""
        return ReadError(self.at.file, self.at.line, 1, message)

    # ── the program ──────────────────────────────────────────────────────────────────────────────

    def run(self, routine: Routine) -> Iterator[Step]:
        """Everything that happens, in order. Raises ReadError."""
        try:
            yield from self._frame_of(routine.body, 0)
        except _Stop:
            return
        except _Return:
            return

    def _frame_of(self, body: Sequence[Statement], depth: int) -> Iterator[Step]:
        """Statements of the program's frame, each of them a batch of its own."""
        if depth > DEEPEST:
            raise self.fail("routines call one another without an end")
        for statement in body:
            if isinstance(statement, Repeated):
                for first in range(0, len(statement.lines), MOST_LANES):
                    some = np.arange(first, min(first + MOST_LANES, len(statement.lines)))
                    columns = [_of_lanes(column, some) for column in statement.columns]
                    yield from self._batch(
                        statement.body, columns, statement.lines[some], statement.file
                    )
            elif isinstance(statement, Call) and (routine := statement.routine()).steps:
                self._at = statement.at
                self.state["locals"].append(statement.enter(self))
                with suppress(_Return):
                    yield from self._frame_of(routine.body, depth + 1)
                variables = self.state["locals"].pop()
                if statement.leave is not None:
                    statement.leave(self, variables)
            elif isinstance(statement, Return):
                raise _Return
            else:
                at = statement.at
                yield from self._batch(
                    (statement,), (), np.array([[at.line]], dtype=np.int32), at.file
                )

    # ── batches ──────────────────────────────────────────────────────────────────────────────────

    def _batch(
        self, body: Sequence[Statement], columns: Sequence[Any], lines: NDArray[np.int32], file: int
    ) -> Iterator[Step]:
        """Run `body` once in each lane, one lane after another."""
        count = len(lines)
        everything = np.arange(count)
        batch = _Batch(body, columns, lines, file)
        try:
            begin, paths = self._consistent(batch, everything)
        except NotUniform:
            # A variable that has its first value now, say. After one lane it has one.
            if count == 1:
                raise
            for part in (everything[:1], everything[1:]):
                yield from self._part(batch, part)
            return
        yield from self._told(batch, begin, paths, everything)

    def _part(self, batch: _Batch, part: Lanes) -> Iterator[Step]:
        """Some lanes together; if that cannot be, one by one."""
        sub = batch.part(part)
        everything = np.arange(len(part))
        try:
            begin, paths = self._consistent(sub, everything)
        except NotUniform:
            for lane in part:
                yield from self._part(batch, np.array([lane]))
            return
        yield from self._told(sub, begin, paths, everything)

    def _consistent(self, batch: _Batch, everything: Lanes) -> tuple[Value, list[_Path]]:
        """How the lanes begin, and what they do, such that each begins as the one before ends."""
        count = len(everything)
        first = copied(self.state)
        begin = first
        wrote: Value = None
        for _ in range(_MOST_TRIES):
            try:
                paths = self._paths(batch, begin, everything, None)
            except ReadError:
                if count == 1:
                    raise
                # It may come of a guess at how a lane begins. If not, it comes again, in its lane.
                raise NotUniform from None
            if count == 1:
                break
            if any(path.stopped for path in paths):
                raise NotUniform  # what comes after a stop does not happen: one by one
            ends = gathered([(path.lanes, path.state) for path in paths], count)
            again = passed_on(first, ends, count)
            if same(again, begin):
                break
            begin, wrote = carried(first, begin, ends, wrote, count)
        else:
            raise NotUniform
        return begin, paths

    def _told(
        self, batch: _Batch, begin: Value, paths: list[_Path], everything: Lanes
    ) -> Iterator[Step]:
        """The events of a batch, and what might happen instead; the state after it."""
        count = len(everything)
        yield _in_order(batch, paths, len(self.axes))
        for path in paths:
            for number, choice in enumerate(path.choices):
                for other in self._paths(batch, begin, path.lanes, number):
                    yield self._alternative(batch, other, choice)
        ends = gathered([(path.lanes, path.state) for path in paths], count)
        self.state = last_lane(ends)
        if any(path.stopped for path in paths):
            raise _Stop

    def _alternative(self, batch: _Batch, path: _Path, choice: _Choice) -> Alternative:
        made = path.made[choice.events :]
        lanes = len(path.lanes)
        return Alternative(
            events=_flat(batch, path.lanes, made, len(self.axes)),
            starts=np.arange(lanes + 1) * len(made),
            call_file=np.full(lanes, batch.file, dtype=np.int32),
            call_line=batch.lines[path.lanes, choice.top],
            file=choice.at.file,
            line=choice.at.line,
            timeout=choice.timeout,
            ends=path.stopped,
        )

    def _paths(
        self, batch: _Batch, begin: Value, lanes: Lanes, other_way: int | None
    ) -> list[_Path]:
        """What some lanes do, those that go the same way together."""
        self.lanes = len(lanes)
        self._columns = [_of_lanes(column, lanes) for column in batch.columns]
        whole = self.state
        self.state = copied(select(begin, lanes))
        self._made, self._choices, self._other_way = [], [], other_way
        self._running = (batch, lanes)
        stopped = False
        try:
            for top, statement in enumerate(batch.body):
                self._top = top
                self._run(statement, 0)
        except _Stop:
            stopped = True
        except _Parted as parted:
            self.state = whole
            sides = (lanes[parted.truth], lanes[~parted.truth])
            return [path for side in sides for path in self._paths(batch, begin, side, other_way)]
        except (NotUniform, ReadError):
            self.state = whole
            raise
        path = _Path(lanes, self._made, self._choices, self.state, stopped)
        self.state = whole
        return [path]

    # ── statements ───────────────────────────────────────────────────────────────────────────────

    def _run(self, statement: Statement, depth: int) -> None:
        if isinstance(statement, Repeated):
            self._one_by_one(statement, depth)
            return
        self._at = statement.at
        match statement:
            case Do():
                statement.act(self)
            case If():
                truth = self._truth(statement.condition(self))
                self._all(statement.then if truth else statement.otherwise, depth)
            case While():
                self._loop(statement, depth)
            case Forever():
                self._forever(statement, depth)
            case Call():
                self._call(statement, depth)
            case Exit():
                raise _Exit
            case Return():
                raise _Return

    def _one_by_one(self, repeated: Repeated, depth: int) -> None:
        """Repeated statements within a routine that is run as a whole, or a loop."""
        outer = self._columns
        for lane, lines in enumerate(repeated.lines.tolist()):
            only = np.array([lane])
            self._columns = [last_lane(_of_lanes(column, only)) for column in repeated.columns]
            for statement, line in zip(repeated.body, lines, strict=True):
                here = replace(statement, at=At(repeated.file, line))  # type: ignore[arg-type]
                self._run(here, depth)
        self._columns = outer

    def _all(self, body: Sequence[Statement], depth: int) -> None:
        for statement in body:
            self._run(statement, depth)

    def _loop(self, loop: While, depth: int) -> None:
        for _ in range(MOST_TURNS):
            self._at = loop.at
            if not self._truth(loop.condition(self)):
                return
            try:
                self._all(loop.body, depth)
            except _Exit:
                return
        raise self.fail(f"the loop has not ended after {MOST_TURNS:,} turns")

    def _forever(self, loop: Forever, depth: int) -> None:
        """A loop that changes nothing and moves nothing is the end of the program."""
        for _ in range(MOST_TURNS):
            before, made = copied(self.state), len(self._made)
            try:
                self._all(loop.body, depth)
            except _Exit:
                return
            if len(self._made) == made and same(before, self.state):
                self._at = loop.at
                self.stop()
        raise self.fail(f"the loop has not ended after {MOST_TURNS:,} turns")

    def _call(self, call: Call, depth: int) -> None:
        if depth >= DEEPEST:
            raise self.fail("routines call one another without an end")
        self.state["locals"].append(call.enter(self))
        with suppress(_Return):
            self._all(call.routine().body, depth + 1)
        self._at = call.at
        variables = self.state["locals"].pop()
        if call.leave is not None:
            call.leave(self, variables)

    def _truth(self, value: Value) -> bool:
        if value is UNDECIDED:
            return self._choose(timeout=False)
        if isinstance(value, np.ndarray):
            if value.dtype != np.bool_:
                raise self.fail("a condition is no truth")
            if value.any() and not value.all():
                raise _Parted(value)
            return bool(value[0])
        if not isinstance(value, bool | np.bool_):
            raise self.fail("a condition is no truth")
        return bool(value)

    def _choose(self, timeout: bool) -> bool:
        """False, but True at the choice at which the other way is to be taken."""
        self._choices.append(_Choice(len(self._made), self._at, self._top, timeout))
        return len(self._choices) - 1 == self._other_way


# ── events ───────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True, eq=False)
class _Batch:
    body: Sequence[Statement]
    columns: Sequence[Any]
    lines: NDArray[np.int32]  # (lanes, len(body))
    file: int

    def part(self, lanes: Lanes) -> _Batch:
        columns = [_of_lanes(column, lanes) for column in self.columns]
        return _Batch(self.body, columns, self.lines[lanes], self.file)


def _of_lanes(column: Any, lanes: Lanes) -> Any:
    return [column[i] for i in lanes] if isinstance(column, list) else select(column, lanes)


def _in_order(batch: _Batch, paths: Sequence[_Path], axes: int) -> Events:
    """The events of all paths, lane by lane."""
    if len(paths) == 1:
        return _flat(batch, paths[0].lanes, paths[0].made, axes)
    each = np.empty(sum(len(path.lanes) for path in paths), dtype=np.intp)
    for path in paths:
        each[path.lanes] = len(path.made)
    starts = np.cumsum(each) - each
    events = blank(int(each.sum()), axes)
    for path in paths:
        rows = [starts[path.lanes] + k for k in range(len(path.made))]
        _fill_in(events, rows, batch, path.lanes, path.made)
    return events


def _flat(batch: _Batch, lanes: Lanes, made: Sequence[_Made], axes: int) -> Events:
    """Events of some lanes: all of the first lane, all of the second, and so on."""
    each = len(made)
    events = blank(len(lanes) * each, axes)
    _fill_in(events, [slice(k, None, each) for k in range(each)], batch, lanes, made)
    return events


def _fill_in(
    events: Events,
    rows: Sequence[slice | NDArray[np.intp]],
    batch: _Batch,
    lanes: Lanes,
    made: Sequence[_Made],
) -> None:
    """Write what some lanes made: event k of all lanes into `rows[k]`."""
    for row, event in zip(rows, made, strict=True):
        lines = batch.lines[lanes, event.top]
        events.kind[row] = event.kind
        events.file[row] = event.at.file
        events.line[row] = lines if _is_top(batch, event) else event.at.line
        events.call_file[row] = batch.file
        events.call_line[row] = lines
        for name, value in event.fields.items():
            getattr(events, name)[row] = value


def _is_top(batch: _Batch, event: _Made) -> bool:
    """Whether an event is made by a statement of the body itself, which has another line in each
    lane: its own place is that of the first lane."""
    return _stands_at(batch.body[event.top], event.at)


def _stands_at(statement: Statement, at: At) -> bool:
    return not isinstance(statement, Repeated) and statement.at == at


def _alike(one: Any, two: Any) -> bool:
    if one is None or two is None:
        return one is two
    return bool(np.array_equal(one, two))

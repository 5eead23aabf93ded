"""From the rows of a file to statements: what O-words hold together."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ..machine import Machine
from ..statements import (
    At,
    Call,
    Do,
    Evaluate,
    Exit,
    Forever,
    If,
    Repeated,
    Return,
    Routine,
    Statement,
    While,
)
from .batches import Group, groups
from .blocks import statements_of
from .expressions import Slots, compiled, never, truth
from .sources import Source, column_slots, shown
from .syntax import Block, Control, Misread, Value

#: Variables of a routine; no parameter is named so.
_VALUE, _LEFT, _TIMES = "(value)", "(left {})", "(times {})"
#: How many arguments a routine can be given: #1 to #30.
_MOST_ARGUMENTS = 30


class Routines(Protocol):
    """Where routines are found by name."""

    def knows(self, label: str) -> bool: ...

    def routine(self, label: str) -> Routine: ...


@dataclass(frozen=True)
class _Loop:
    label: str
    has_continue: bool


@dataclass(eq=False)
class Body:
    """Lowers the rows of a routine, or of the main program (`frame`: run step by step)."""

    source: Source
    routines: Routines
    frame: bool
    last_row: int = -1  # of the main program: M2 there is its normal end
    _loops: list[_Loop] = field(default_factory=list)
    _labels: dict[str, int] = field(default_factory=dict)

    def routine(self, first: int, last: int) -> Routine:
        """The routine from its `sub` in row `first` to its `endsub` in row `last`."""
        control = self.source.control(last)
        body = self.rows(first + 1, last)
        if control.values:
            body = (*body, self._value(control, last))
        return Routine(control.label, body, steps=self.frame)

    def rows(self, first: int, last: int) -> tuple[Statement, ...]:
        """The statements of rows from `first` to before `last`. Raises ReadError."""
        done: list[Statement] = []
        row = first
        while row < last:
            mark = self._mark(row, last)
            done += self._plain(row, mark)
            row = mark
            if row < last:
                statements, row = self._controlled(row, last)
                done += statements
        return tuple(done)

    # ── O-words ──────────────────────────────────────────────────────────────────────────────────

    def _mark(self, row: int, last: int) -> int:
        """The next row from `row` on with an O-word that is no call."""
        at = bisect_left(self.source.marks, row)
        return min(self.source.marks[at], last) if at < len(self.source.marks) else last

    def _controlled(self, row: int, last: int) -> tuple[list[Statement], int]:
        """What begins in a row with an O-word, and the row after it."""
        control, at = self.source.control(row), self.source.at(row)
        if control.deletable:
            raise self.source.error(row, "an O-word that / may delete is not understood")
        match control.kind:
            case "if":
                return [self._if(row, last, at)], self._close(row, last, {"endif"}) + 1
            case "while":
                end = self._close(row, last, {"endwhile"})
                return self._loop(row, end, self._condition(row)), end + 1
            case "repeat":
                end = self._close(row, last, {"endrepeat"})
                return self._repeat(row, end), end + 1
            case "do":
                end = self._close(row, last, {"while"})
                return self._do(row, end), end + 1
            case "break" | "continue":
                return self._leave(row), row + 1
            case "return":
                value = [self._value(control, row)] if control.values else []
                return [*value, Return(at)], row + 1
        raise self.source.error(
            row, f"{shown(control)} {control.kind} belongs to nothing before it"
        )

    def _close(self, row: int, last: int, kinds: set[str]) -> int:
        """The row that closes what a row opens."""
        opened = self.source.control(row)
        at = bisect_left(self.source.marks, row) + 1
        for mark in self.source.marks[at:]:
            if mark >= last:
                break
            control = self.source.control(mark)
            if control.kind in kinds and control.label == opened.label:
                return mark
        raise self.source.error(row, f"{shown(opened)} {opened.kind} is never closed")

    def _open(self, row: int) -> None:
        """A label may stand for one thing only in a routine."""
        control = self.source.control(row)
        before = self._labels.setdefault(control.label, row)
        if before != row:
            line = self.source.lines.number[before]
            raise self.source.error(row, f"{shown(control)} stands for line {line} already")

    def _if(self, row: int, last: int, at: At) -> Statement:
        self._open(row)
        end = self._close(row, last, {"endif"})
        label = self.source.control(row).label
        parts = [row]
        index = bisect_left(self.source.marks, row) + 1
        for mark in self.source.marks[index:]:
            control = self.source.control(mark)
            if mark >= end:
                break
            if control.label == label and control.kind in ("elseif", "else"):
                if self.source.control(parts[-1]).kind == "else":
                    raise self.source.error(mark, f"{shown(control)} {control.kind} after else")
                parts.append(mark)
        otherwise: tuple[Statement, ...] = ()
        bounds = [*parts, end]
        for k in reversed(range(len(parts))):
            body = self.rows(parts[k] + 1, bounds[k + 1])
            if self.source.control(parts[k]).kind == "else":
                otherwise = body
            else:
                place = self.source.at(parts[k])
                otherwise = (If(place, self._condition(parts[k]), body, otherwise),)
        return otherwise[0]

    def _loop(self, row: int, end: int, condition: Evaluate) -> list[Statement]:
        """While `condition`; with CONTINUE, each turn is a loop of its own that is left early."""
        self._open(row)
        at = self.source.at(row)
        loop, body = self._turn(row, end)
        if not loop.has_continue:
            return [While(at, condition, body)]
        left = _LEFT.format(loop.label)

        def goes_on(machine: Machine) -> object:
            return False if machine.locals[left] else condition(machine)

        return [
            Do(at, _assigned(left, False)),
            While(at, goes_on, (Forever(at, (*body, Exit(at))),)),
        ]

    def _do(self, row: int, end: int) -> list[Statement]:
        self._open(row)
        at, tested = self.source.at(row), self.source.at(end)
        loop, body = self._turn(row, end)
        condition = self._condition(end)
        if not loop.has_continue:
            again = If(tested, condition, (), (Exit(tested),))
            return [Forever(at, (*body, again))]
        left = _LEFT.format(loop.label)

        def goes_on(machine: Machine) -> object:
            return False if machine.locals[left] else condition(machine)

        turn = Forever(at, (*body, Exit(tested)))
        return [
            Do(at, _assigned(left, False)),
            Forever(at, (turn, If(tested, goes_on, (), (Exit(tested),)))),
        ]

    def _repeat(self, row: int, end: int) -> list[Statement]:
        at, label = self.source.at(row), self.source.control(row).label
        times = _TIMES.format(label)
        count = self._value_of(row)

        def begin(machine: Machine) -> None:
            number = count(machine)
            never(machine, np.isnan(number), "how often to repeat is not known")
            machine.locals[times] = np.round(number) + 0.0

        def goes_on(machine: Machine) -> object:
            if np.all(machine.locals[times] <= 0):
                return False
            return machine.locals[times] > 0

        def one_less(machine: Machine) -> None:
            machine.locals[times] = machine.locals[times] - 1

        looped = self._loop(row, end, goes_on)
        inner = looped[-1]
        assert isinstance(inner, While)
        turned = While(at, inner.condition, (Do(at, one_less), *inner.body))
        return [Do(at, begin), *looped[:-1], turned]

    def _turn(self, row: int, end: int) -> tuple[_Loop, tuple[Statement, ...]]:
        """The body of a loop from a row to another."""
        label = self.source.control(row).label
        marks = self.source.marks
        inside = marks[bisect_left(marks, row) + 1 : bisect_left(marks, end)]
        controls = [self.source.control(mark) for mark in inside]
        loop = _Loop(label, any(c.kind == "continue" and c.label == label for c in controls))
        self._loops.append(loop)
        body = self.rows(row + 1, end)
        self._loops.pop()
        return loop, body

    def _leave(self, row: int) -> list[Statement]:
        control, at = self.source.control(row), self.source.at(row)
        if not self._loops or self._loops[-1].label != control.label:
            raise self.source.error(
                row, f"{shown(control)} {control.kind} is not in a loop {shown(control)} of its own"
            )
        loop = self._loops[-1]
        if control.kind == "break" and loop.has_continue:
            return [Do(at, _assigned(_LEFT.format(loop.label), True)), Exit(at)]
        return [Exit(at)]

    def _condition(self, row: int) -> Evaluate:
        value = self._value_of(row)
        return lambda machine: truth(machine, value(machine))

    def _value_of(self, row: int) -> Evaluate:
        return compiled(self.source.control(row).values[0], self.source.slots(row))

    def _value(self, control: Control, row: int) -> Statement:
        """What a routine hands back."""
        value = compiled(control.values[0], self.source.slots(row))

        def act(machine: Machine) -> None:
            machine.locals[_VALUE] = value(machine)

        return Do(self.source.at(row), act)

    # ── blocks and calls ─────────────────────────────────────────────────────────────────────────

    def _plain(self, first: int, last: int) -> list[Statement]:
        """Rows without structure; where the program's frame repeats itself, all at once."""
        if not self.frame or self._loops:
            return [s for row in range(first, last) for s in self._row(row)]
        done: list[Statement] = []
        row = first
        for group in groups(self.source, first, last):
            done += [s for r in range(row, group.first) for s in self._row(r)]
            done.append(self._repeated(group))
            row = group.last
        done += [s for r in range(row, last) for s in self._row(r)]
        return done

    def _row(self, row: int) -> tuple[Statement, ...]:
        return self._said(row, self.source.at(row), self.source.slots(row))

    def _said(self, row: int, at: At, slots: Slots) -> tuple[Statement, ...]:
        said = self.source.line(row)
        try:
            if isinstance(said, Block):
                return statements_of(said, at, slots, row == self.last_row)
        except Misread as misread:
            raise self.source.error(row, misread.message, misread.position) from None
        return (self._call(row, said, at, slots),)

    def _call(self, row: int, control: Control, at: At, slots: Slots) -> Statement:
        label = control.label
        if control.deletable:
            raise self.source.error(row, "an O-word that / may delete is not understood")
        if not self.routines.knows(label):
            raise self.source.error(
                row,
                f"{shown(control)} is called, but there is neither such a sub nor a file"
                f" {label}.ngc",
            )
        if len(control.values) > _MOST_ARGUMENTS:
            raise self.source.error(row, f"more than {_MOST_ARGUMENTS} arguments")
        return Call(
            at, lambda: self.routines.routine(label), _enter(control.values, slots), _leave_call
        )

    def _repeated(self, group: Group) -> Repeated:
        """A lane for each row; of the statements, each lane runs those of its own kind. All stand
        where the first lane stands: the machine knows the lines of the others."""
        lines = self.source.lines.number[group.rows]
        at = At(self.source.lines.file, int(lines[0]))
        body: list[Statement] = [Do(at, group.declare)]
        for kind in group.kinds:
            load = () if kind.load is None else (Do(at, kind.load),)
            said = self._said(kind.row, at, column_slots(kind.column))
            body.append(If(at, _column(kind.member), (*load, *said)))
        each = np.repeat(lines[:, None], len(body), axis=1)
        return Repeated(at.file, each, tuple(body), group.columns)


def _column(number: int) -> Evaluate:
    return lambda machine: machine.column(number)


def _assigned(name: str, value: bool) -> Evaluate:
    def act(machine: Machine) -> None:
        machine.locals[name] = value

    return act


def _enter(values: tuple[Value, ...], slots: Slots) -> Evaluate:
    """The callee's variables: arguments that are not given are 0."""
    arguments = [compiled(value, slots) for value in values]

    def enter(machine: Machine) -> dict[object, object]:
        given = [argument(machine) for argument in arguments]
        given += [0.0] * (_MOST_ARGUMENTS - len(given))
        return dict(enumerate(given, 1))

    return enter


def _leave_call(machine: Machine, variables: dict[str, object]) -> None:
    named = machine.state["named"]
    named["_value"] = variables.get(_VALUE, 0.0)
    named["_value_returned"] = 1.0 if _VALUE in variables else 0.0

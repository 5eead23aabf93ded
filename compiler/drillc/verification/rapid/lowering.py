"""Routines of RAPID into the statements that the machine runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lark import Token, Tree

from ..machine import Machine
from ..reading import ReadError
from ..statements import (
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
from . import functions, instructions
from .arguments import Arguments, sorted_arguments
from .binding import bound
from .data import Head
from .expressions import NotAlike, Scope
from .modules import array_sizes, type_named
from .motion import ending
from .program import Program
from .syntax import Bulk, Node, singly, subtrees
from .types import BOOL, NUM, TOOLDATA, WOBJDATA, Type, Value, array_of, initial
from .values import compared
from .variables import NAME_OF, Local, Typed
from .waits import has_flag, is_outermost, together

_RESULT = "result"
Block = tuple[Statement, ...]


@dataclass(eq=False)
class Lowered:
    """A routine; `first`: what its variables hold as it begins."""

    routine: Routine
    first: dict[str, Value] = field(default_factory=dict)


@dataclass(eq=False)
class _Place:
    """Where statements are lowered: in which routine, and whether in the program's frame."""

    head: Head
    scope: Scope
    lowered: Lowered
    frame: bool
    first_line: int = 0  # what stands before the lines of a stretch
    temporaries: int = 0


@dataclass(eq=False)
class Lowering:
    """All routines of a program, each lowered when it is first asked for: as part of the program's
    frame, whose statements are run one after another, or to be run as a whole."""

    program: Program
    _done: dict[tuple[Head, bool], Lowered] = field(default_factory=dict)

    def routine(self, head: Head, frame: bool) -> Lowered:
        """Raises ReadError."""
        if (head, frame) in self._done:
            return self._done[head, frame]
        lowered = self._done[head, frame] = Lowered(Routine(head.name, (), frame))
        scope = Scope(self.program, head.module, head.place.file)
        for parameter in head.parameters:
            scope.variables[parameter.name] = Local(parameter.kind, parameter.name)
        if head.result is not None:
            lowered.first[_RESULT] = initial(head.result)
        place = _Place(head, scope, lowered, frame)
        body = self._block(place, subtrees(head.body), frame)
        lowered.routine = Routine(head.name, body, frame)
        return lowered

    def complete(self, head: Head) -> None:
        """Read a routine that may never be called, too."""
        if not any((head, frame) in self._done for frame in (True, False)):
            self.routine(head, False)

    # ── statements ───────────────────────────────────────────────────────────────────────────────

    def _block(self, place: _Place, trees: Sequence[Node], frame: bool = False) -> Block:
        before, place.frame = place.frame, frame
        made: list[Statement] = []
        waits: int | None = None  # where the last wait with a flag stands
        for tree in trees:
            outer, place.scope.before = place.scope.before, []
            statements = self._statement(place, tree)
            made += [*place.scope.before, *statements]
            place.scope.before = outer
            if frame and has_flag(tree):
                waits = len(made) - 1
            elif waits is not None and any(map(is_outermost, statements)):
                waits = None
            elif waits is not None and isinstance(made[-1], If | While):
                made[waits:] = [together(made[waits:])]
                waits = None
        place.frame = before
        return tuple(made)

    def _statement(self, place: _Place, tree: Node) -> Sequence[Statement]:
        scope, at = place.scope, At(place.scope.file, tree.meta.line + place.first_line)
        match tree.data:
            case "declaration":
                self._variable(place, tree)
                return ()
            case "assignment":
                return [Do(at, self._assignment(scope, tree))]
            case "call":
                return self._call(place, at, tree)
            case "if_block" | "if_short":
                return [self._if(place, at, list(tree.children))]
            case "while":
                return [self._while(place, at, tree)]
            case "for":
                return self._for(place, at, tree)
            case "test":
                return self._test(place, at, tree)
            case "stretch":
                return self._stretch(place, tree)
            case "return":
                return self._return(place, at, tree)
            case "exit":
                return [Do(at, lambda m: ending(m, self.program.findings))]
            case "empty":
                return ()
        raise scope.error(tree, _REFUSED.get(tree.data, f"{tree.data} is not read"))

    def _variable(self, place: _Place, tree: Node) -> None:
        """A variable of the routine: it begins with the same value each time."""
        scope = place.scope
        _, storage, kind_name, name, sizes, value = tree.children
        assert isinstance(kind_name, Token)
        assert isinstance(name, Token)
        module = self.program.modules[scope.module]
        kind = type_named(kind_name, module.types, scope.file)
        if isinstance(sizes, Tree):
            kind = array_of(kind, array_sizes(sizes, scope.file))
        key = name.upper()
        if key in scope.variables:
            scope.finding("rules", name, f"{name} is declared a second time in {place.head.name}")
        first = initial(kind)
        if isinstance(value, Tree):
            found = scope.of_type(value, kind)
            if not found.fixed:
                raise scope.error(value, f"{name} needs a value that is constant")
            first = found.get(None)  # type: ignore[arg-type]  # hangs on nothing
        scope.variables[key] = Local(kind, key, str(storage).upper() == "CONST")
        place.lowered.first[key] = first
        if kind in (TOOLDATA, WOBJDATA):
            place.lowered.first[NAME_OF + key] = str(name)

    def _assignment(self, scope: Scope, tree: Node) -> Callable[[Machine], None]:
        target, value = tree.children
        variable = scope.variable(target)
        put = variable.set
        if put is None:
            raise scope.error(tree, "a constant is given another value")
        found = scope.of_type(value, variable.typed.kind)
        return lambda m: put(m, found.get(m))

    def _return(self, place: _Place, at: At, tree: Node) -> Sequence[Statement]:
        value, result = tree.children[0], place.head.result
        if (value is None) != (result is None):
            what = "needs a value" if value is None else "has no value to return"
            raise place.scope.error(tree, f"{place.head.name} {what}")
        if result is None:
            return [Return(at)]
        found = place.scope.of_type(value, result)

        def act(m: Machine) -> None:
            m.locals[_RESULT] = found.get(m)

        return [Do(at, act), Return(at)]

    # ── control flow ─────────────────────────────────────────────────────────────────────────────

    def _if(self, place: _Place, at: At, children: list[Any]) -> If:
        """IF condition block {ELSEIF condition block} [ELSE block], or one statement alone."""
        condition, then, *rest = children
        test = place.scope.of_type(condition, BOOL)
        block = self._block(place, subtrees(then) if then.data == "block" else [then])
        rest = [part for part in rest if part is not None]
        otherwise: Block = ()
        if rest and rest[0].data == "elseif":
            own = At(at.file, rest[0].meta.line + place.first_line)
            outer, place.scope.before = place.scope.before, []
            inner = self._if(place, own, [*rest[0].children, *rest[1:]])
            otherwise = (*place.scope.before, inner)
            place.scope.before = outer
        elif rest:
            otherwise = self._block(place, subtrees(rest[0].children[0]))
        return If(at, test.get, block, otherwise)

    def _while(self, place: _Place, at: At, tree: Any) -> Statement:
        condition, block = tree.children
        if condition.data == "truth" and condition.children[0].upper() == "TRUE":
            return Forever(at, self._block(place, subtrees(block)))
        outer, place.scope.before = place.scope.before, []
        test = place.scope.of_type(condition, BOOL)
        calls, place.scope.before = place.scope.before, outer
        body = self._block(place, subtrees(block))
        if calls:
            return Forever(at, (*calls, If(at, test.get, (), (Exit(at),)), *body))
        return While(at, test.get, body)

    def _for(self, place: _Place, at: At, tree: Any) -> Sequence[Statement]:
        name, start, end, step, block = tree.children
        scope = place.scope
        first, last = scope.of_type(start, NUM), scope.of_type(end, NUM)
        by = None if step is None else scope.of_type(step, NUM)
        counter, limit, stride = (self._temporary(place, NUM) for _ in range(3))
        outer = scope.variables.get(name.upper())
        scope.variables[name.upper()] = Local(NUM, counter, constant=True)
        body = self._block(place, subtrees(block))
        if outer is None:
            del scope.variables[name.upper()]
        else:
            scope.variables[name.upper()] = outer

        def begin(m: Machine) -> None:
            a, b = first.get(m), last.get(m)
            own = m.locals
            own[counter], own[limit] = a, b
            own[stride] = _sign(a, b) if by is None else by.get(m)

        def goes_on(m: Machine) -> Value:
            a, b, s = (m.locals[key] for key in (counter, limit, stride))
            return compared("<=", (a - b) * _sign(0.0, s), 0.0)

        def advance(m: Machine) -> None:
            m.locals[counter] = m.locals[counter] + m.locals[stride]

        return [Do(at, begin), While(at, goes_on, (*body, Do(at, advance)))]

    def _test(self, place: _Place, at: At, tree: Any) -> Sequence[Statement]:
        subject, *cases = tree.children
        scope = place.scope
        value = scope.expression(subject)
        kept = self._temporary(place, value.kind)

        def keep(m: Machine) -> None:
            m.locals[kept] = value.get(m)

        otherwise: Block = ()
        for case in reversed([case for case in cases if case is not None]):
            *choices, block = case.children
            inside = self._block(place, subtrees(block))
            if case.data == "default":
                otherwise = inside
                continue
            own = At(at.file, case.meta.line + place.first_line)
            for choice in reversed(choices):
                wanted = scope.of_type(choice, value.kind)
                otherwise = (If(own, _equals(kept, wanted), inside, otherwise),)
        return [Do(at, keep), *otherwise]

    def _temporary(self, place: _Place, kind: Type) -> str:
        place.temporaries += 1
        key = f"temporary {place.temporaries}"
        place.lowered.first[key] = initial(kind)
        return key

    # ── stretches ────────────────────────────────────────────────────────────────────────────────

    def _stretch(self, place: _Place, tree: Any) -> Sequence[Statement]:
        module = self.program.modules[place.scope.module]
        bulk = module.bulk[int(str(tree.children[0]).strip("\x03"))]
        if place.frame:
            try:
                return [self._repeated(place, bulk)]
            except (NotAlike, ReadError):
                pass  # line by line, so that an error has its place
        trees = singly(place.scope.file, bulk.stretch, module.code)
        return self._block(place, trees, place.frame)

    def _repeated(self, place: _Place, bulk: Bulk) -> Repeated:
        scope, stretch = place.scope, bulk.stretch
        found = len(self.program.findings)
        scope.bulk, scope.columns = bulk, {}
        place.first_line = stretch.first - 1
        try:
            body = self._block(place, subtrees(bulk.tree))
        except ReadError:
            del self.program.findings[found:]
            raise
        finally:
            scope.bulk, place.first_line = None, 0
        lines = stretch.lines()
        tops = np.array([s.at.line - stretch.first for s in body if not isinstance(s, Repeated)])
        columns = tuple(scope.columns.get(i) for i in range(len(stretch.columns)))
        return Repeated(scope.file, lines[:, tops], body, columns)

    # ── calls ────────────────────────────────────────────────────────────────────────────────────

    def _call(self, place: _Place, at: At, tree: Any) -> Sequence[Statement]:
        name, given = tree.children
        arguments = sorted_arguments(place.scope, name, given)
        head = self.program.find(name.upper(), place.scope.module)
        if isinstance(head, Head):
            if head.result is not None:
                raise arguments.error(f"{name} is a function, and its value is not used")
            frame = (
                place.frame
                and not head.parameters
                and not any(map(has_flag, head.body.iter_subtrees()))
            )
            return [self._to(at, head, arguments, frame, None)]
        if head is not None or name.upper() in place.scope.variables:
            raise arguments.error(f"{name} is data, not a procedure")
        act = instructions.lowered(arguments)
        return [] if act is None else [Do(at, act)]

    def function(self, scope: Scope, tree: Any) -> Typed:
        """A function's value in an expression. Raises ReadError."""
        name, given = tree.children
        arguments = sorted_arguments(scope, name, given)
        head = self.program.find(name.upper(), scope.module)
        if isinstance(head, Head):
            if head.result is None:
                raise arguments.error(f"{name} is a procedure and has no value")
            if scope.before is None:
                raise arguments.error(f"function {name} of the program cannot be called here")
            kept = f"result {tree.meta.line}:{tree.meta.column}"
            line = tree.meta.line + (scope.bulk.stretch.first - 1 if scope.bulk else 0)
            scope.before.append(self._to(At(scope.file, line), head, arguments, False, kept))
            return Typed(head.result, lambda m: m.locals[kept])
        lower = name.lower()
        if found := functions.asks_machine(lower, arguments):
            return found
        if lower not in functions.FUNCTIONS:
            raise arguments.error(f"{name} is no function that is declared or read")
        return functions.call(functions.FUNCTIONS[lower], arguments)

    def _to(self, at: At, head: Head, arguments: Arguments, frame: bool, kept: str | None) -> Call:
        """A call of a routine of the program; its result is put among the caller's variables."""
        lowered = self.routine(head, frame)
        gets, backs = bound(head, arguments)

        def enter(m: Machine) -> dict[str, Value]:
            return {**lowered.first, **{name: get(m) for name, get in gets.items()}}

        def leave(m: Machine, variables: dict[str, Value]) -> None:
            for name, put in backs.items():
                put(m, variables[name])
            if kept is not None:
                m.locals[kept] = variables[_RESULT]

        return Call(
            at, lambda: lowered.routine, enter, leave if backs or kept is not None else None
        )


def _sign(one: Value, two: Value) -> Value:
    """1 where `two` is not less than `one`, else -1."""
    sign = np.where(np.asarray(two) >= np.asarray(one), 1.0, -1.0)
    return sign if sign.ndim else float(sign)


def _equals(key: str, wanted: Typed) -> Callable[[Machine], Value]:
    return lambda m: compared("=", m.locals[key], wanted.get(m))


_REFUSED = {
    "late": "a routine whose name is computed (%…%) is not read",
    "goto": "GOTO is not read",
    "label": "GOTO and its labels are not read",
    "raise": "error handlers (RAISE, RETRY, TRYNEXT) are not read",
    "connect": "interrupts (CONNECT) are not read",
    "handler": "error handlers are not read",
}

"""Routines as they were read → statements that the machine runs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from lark import Tree

from drillc.verification.machine import Machine
from drillc.verification.reading import ReadError
from drillc.verification.statements import (
    At,
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

from . import arithmetic as ar
from .acts import for_one_move, halt, is_one_of, pause
from .assignments import Assignments
from .calls import RESULT, Calls
from .expressions import described
from .modules import Alike, Line, Module, RoutineText
from .motion import go_home, motion
from .scope import Files, Scope, Uneven
from .tree import Node, Parser, plain_name, trees, upper
from .waiting import waiting

#: What closes each block, and what divides it.
_CLOSING = {
    "if": "endif",
    "while": "endwhile",
    "for": "endfor",
    "loop": "endloop",
    "repeat": "until",
    "switch": "endswitch",
}
_DIVIDING = {"if": frozenset({"else"}), "switch": frozenset({"case", "default"})}
_BLOCK_WORDS = frozenset(_CLOSING.values()) | frozenset({"else", "case", "default"})


class Lowering:
    """Lowers one routine. `code`: the lines of its file."""

    def __init__(
        self,
        files: Files,
        module: Module,
        routine: RoutineText,
        code: Sequence[str],
        parser: Parser,
    ) -> None:
        self.routine, self.code, self.parser = routine, code, parser
        self.scope = Scope(files, module, routine)
        self.calls = Calls(self.scope)
        self.values = self.calls.values
        self.assignments = Assignments(self.scope, self.values)
        self.notes = files.notes
        self.items: list[Line | Alike] = []
        self.next = 0

    def run(self, steps: bool) -> Routine:
        """The routine. `steps`: it belongs to the program's frame. Raises ReadError."""
        self.items = list(self.routine.items) if steps else self._single(self.routine.items)
        body = self._block(None, top=steps)
        return Routine(self.routine.name, tuple(body), steps)

    def _single(self, items: Sequence[Line | Alike]) -> list[Line | Alike]:
        """The same lines, one by one."""
        found: list[Line | Alike] = []
        for item in items:
            if isinstance(item, Line):
                found.append(item)
                continue
            for number in item.lines.ravel().tolist():
                tree = self.parser.line(self.routine.file, number, self.code[number - 1])
                found.append(Line(number, tree))
        return found

    def _at(self) -> At:
        return At(self.routine.file, self.scope.line)

    # ── blocks ───────────────────────────────────────────────────────────────────────────────────

    def _block(self, opened: str | None, top: bool = False) -> list[Statement]:
        """Statements until what closes or divides the block that was opened; that stays."""
        opening = self.scope.line
        found: list[Statement] = []
        while self.next < len(self.items):
            item = self.items[self.next]
            if isinstance(item, Alike):
                if not top:
                    self.items[self.next : self.next + 1] = self._single([item])
                    continue
                self.next += 1
                found += self._alike(item)
                continue
            self.scope.line = item.line
            kind = str(item.tree.data)
            if opened is not None and (
                kind == _CLOSING[opened] or kind in _DIVIDING.get(opened, ())
            ):
                return found
            if kind in _BLOCK_WORDS:
                raise self.scope.fail(item.tree, f"{kind.upper()} belongs to no block here")
            self.next += 1
            if top and kind == "wait_for" and "$TIMER_FLAG" in described(item.tree).upper():
                found.append(self._with_its_answer(item.tree))
            else:
                found += self._statement(item.tree)
        if opened is None:
            return found
        raise ReadError(
            self.routine.file, opening, 1, f"{opened.upper()} has no {_CLOSING[opened].upper()}"
        )

    def _with_its_answer(self, wait: Node) -> Statement:
        """A wait in the program's frame and what follows it up to the question whether the time
        ran out: one statement, so that both answers are followed to there."""
        at = self._at()
        found = self._statement(wait)
        while self.next < len(self.items):
            item = self.items[self.next]
            if isinstance(item, Alike) or item.tree.data in _BLOCK_WORDS:
                break
            self.next += 1
            self.scope.line = item.line
            found += self._statement(item.tree)
            if item.tree.data == "if":
                break
        return If(at, lambda m: True, tuple(found))

    def _close(self) -> Node:
        """The line that closes or divides a block."""
        item = self.items[self.next]
        assert isinstance(item, Line)
        self.next += 1
        self.scope.line = item.line
        return item.tree

    def _ready(self, statement: Statement) -> list[Statement]:
        """A statement, after the calls of functions in it."""
        before, self.scope.before = self.scope.before, []
        return [*before, statement]

    def _alike(self, item: Alike) -> list[Statement]:
        self.scope.begin(item)
        self.scope.line = int(item.lines[0, 0])
        try:
            body: list[Statement] = []
            for number, tree in enumerate(item.trees):
                self.scope.line = int(item.lines[0, number])
                body += self._plain(tree)
                if self.scope.before or len(body) != number + 1:
                    raise Uneven
            columns = tuple(self.scope.columns)
            return [Repeated(self.routine.file, item.lines, tuple(body), columns)]
        except (Uneven, ReadError):
            self.scope.before = []
            self.scope.begin(None)
            found: list[Statement] = []
            for line in self._single([item]):
                assert isinstance(line, Line)
                self.scope.line = line.line
                found += self._statement(line.tree)
            return found
        finally:
            self.scope.begin(None)

    # ── statements ───────────────────────────────────────────────────────────────────────────────

    def _statement(self, tree: Node) -> list[Statement]:
        match tree.data:
            case "if":
                return self._if(tree)
            case "while":
                return self._while(tree)
            case "repeat":
                return self._repeat()
            case "loop":
                return self._loop()
            case "for":
                return self._for(tree)
            case "switch":
                return self._switch(tree)
            case "continue":
                self.values.going_on = True
                try:
                    if self.next < len(self.items) and isinstance(self.items[self.next], Alike):
                        self.items[self.next : self.next + 1] = self._single(
                            [self.items[self.next]]
                        )
                    if self.next >= len(self.items):
                        return []
                    following = self._close()
                    return self._statement(following)
                finally:
                    self.values.going_on = False
            case _:
                return self._plain(tree)

    def _if(self, tree: Node) -> list[Statement]:
        at = self._at()
        condition = self.values.value(tree.children[0])
        before, self.scope.before = self.scope.before, []
        self.values.going_on = False
        then = self._block("if")
        otherwise: list[Statement] = []
        if self._close().data == "else":
            otherwise = self._block("if")
            closing = self._close()
            if closing.data != "endif":
                raise self.scope.fail(closing, "ELSE stands twice")
        return [*before, If(at, condition, tuple(then), tuple(otherwise))]

    def _while(self, tree: Node) -> list[Statement]:
        at = self._at()
        condition = self.values.value(tree.children[0])
        before, self.scope.before = self.scope.before, []
        body = self._block("while")
        self._close()
        if not before:
            return [While(at, condition, tuple(body))]
        leaves = If(at, lambda m: ar.opposite(m, condition(m)), (Exit(at),))
        return [Forever(at, (*before, leaves, *body))]

    def _repeat(self) -> list[Statement]:
        at = self._at()
        body = self._block("repeat")
        condition = self.values.value(self._close().children[0])
        # what is not known is taken to be so, as a wait is taken to end
        goes_on = If(self._at(), lambda m: ar.opposite(m, condition(m)), (), (Exit(self._at()),))
        return [Forever(at, (*body, *self._ready(goes_on)))]

    def _loop(self) -> list[Statement]:
        at = self._at()
        begin = self.next
        body = self._block("loop")
        inside = self.items[begin : self.next]
        self._close()
        if inside and all(isinstance(i, Line) and i.tree.data == "halt" for i in inside):
            # pressing start only halts again
            return [Do(at, Machine.stop)]
        return [Forever(at, tuple(body))]

    def _for(self, tree: Node) -> list[Statement]:
        at = self._at()
        counter_tree, first, last, step = tree.children
        assert isinstance(counter_tree, Tree)
        counter = self.values.reference(counter_tree)
        if counter.write is None or counter.type != "INT":
            raise self.scope.fail(counter_tree, f"{counter.name} is no variable of type INT")
        write = counter.write
        begins, ends = self.values.value(first), self.values.value(last)
        steps = self.values.value(step) if step is not None else lambda m: 1
        before, self.scope.before = self.scope.before, []
        end_key, step_key = f"TO {at.line}", f"STEP {at.line}"

        def begin(m: Machine) -> None:
            m.locals[end_key] = ar.number(m, ends(m))
            m.locals[step_key] = ar.one(m, steps(m), "the step")
            if m.locals[step_key] == 0:
                raise m.fail("FOR with a step of 0 does not end")
            write(m, begins(m))

        def goes_on(m: Machine) -> Any:
            sign = "<=" if m.locals[step_key] > 0 else ">="
            return ar.compare(m, sign, counter.read(m), m.locals[end_key])

        def count(m: Machine) -> None:
            write(m, ar.calculate(m, "+", counter.read(m), m.locals[step_key]))

        body = self._block("for")
        self._close()
        return [*before, Do(at, begin), While(at, goes_on, (*body, Do(at, count)))]

    def _switch(self, tree: Node) -> list[Statement]:
        at = self._at()
        selector = self.values.value(tree.children[0])
        before, self.scope.before = self.scope.before, []
        if self._block("switch"):
            raise ReadError(at.file, at.line + 1, 1, "a statement between SWITCH and CASE")
        cases: list[tuple[At, Any, list[Statement]]] = []
        default: list[Statement] = []
        closing = self._close()
        while closing.data != "endswitch":
            where = self._at()
            if closing.data == "case":
                wanted = [self.values.value(child) for child in closing.children]
                cases.append((where, wanted, self._block("switch")))
            else:
                default = self._block("switch")
            closing = self._close()
        chain: tuple[Statement, ...] = tuple(default)
        for where, wanted, body in reversed(cases):
            chain = (If(where, is_one_of(selector, wanted), tuple(body), chain),)
        return [*before, *chain]

    def _plain(self, tree: Node) -> list[Statement]:
        """A statement that is no block."""
        at = self._at()
        match tree.data:
            case "assign":
                return self._ready(Do(at, self.assignments.act(tree)))
            case "call":
                return self._ready(self.calls.statement(tree, at))
            case "move":
                return self._ready(Do(at, self._move(tree)))
            case "halt":
                return [Do(at, halt)]
            case "exit":
                return [Exit(at)]
            case "return":
                return self._return(tree, at)
            case "wait_sec":
                seconds = self.values.value(tree.children[0])
                return self._ready(Do(at, lambda m: pause(m, seconds(m))))
            case "wait_for":
                going_on = self.values.going_on
                act = waiting(tree.children[0], self.scope, self.values, going_on)
                return self._ready(Do(at, act))
            case "interrupt_declare" | "interrupt_switch":
                return [Do(at, self._interrupt(tree))]
            case "refused":
                word = str(tree.children[0]).split()[0].upper()
                raise self.scope.fail(tree, f"{word} is not read")
        raise self.scope.fail(tree, f"{described(tree)} does not belong here")

    def _return(self, tree: Node, at: At) -> list[Statement]:
        value = tree.children[0]
        if (value is not None) != bool(self.routine.result):
            what = "returns a value" if self.routine.result else "returns no value"
            raise self.scope.fail(tree, f"{self.routine.name} {what}")
        if value is None:
            return [Return(at)]
        read = self.values.value(value)

        def hand_back(m: Machine) -> None:
            m.locals[RESULT] = read(m)

        return [*self._ready(Do(at, hand_back)), Return(at)]

    def _interrupt(self, tree: Node) -> Callable[[Machine], None]:
        """Only the controller's own, of the INI fold: it stops the program when it is told to."""
        if tree.data == "interrupt_declare":
            condition, call = trees(tree, "comparison"), trees(tree, "call")
            is_own = condition and plain_name(condition[0].children[0]) == "$STOPMESS"
            if not is_own or upper(call[0].children[0]) != "IR_STOPM":
                raise self.scope.fail(tree, "INTERRUPT of the program's own is not read")
        return lambda m: None

    def _move(self, tree: Node) -> Callable[[Machine], None]:
        word, target, frame, *_ = tree.children
        flags = [str(child.children[0]).upper() for child in trees(tree, "flag")]
        assert isinstance(target, Tree)
        in_tool = False
        if frame is not None:
            in_tool = described(frame).upper() == "#TOOL"
            if not str(word).upper().endswith("_REL"):
                raise self.scope.fail(frame, f"{described(frame)} is for relative moves")
        name = plain_name(target)
        kind = str(word).upper()
        if name == "$H_POS" or (name == "XHOME" and not self.scope.is_known("XHOME")):
            if "PTP" not in kind:
                raise self.scope.fail(target, "home is reached by PTP: it is given by axes")
            act: Callable[[Machine], None] = lambda m: go_home(m, self.notes)  # noqa: E731
        else:
            value = self.values.value(target)
            if kind.endswith("_REL"):
                self.notes.follows_place = True
            act = motion(kind, value, flags, in_tool, self.notes, described(target))
        withs = trees(tree, "with")
        if not withs:
            return act
        settings = [self.assignments.act(child) for child in trees(withs[0], "assign")]
        return for_one_move(settings, act)

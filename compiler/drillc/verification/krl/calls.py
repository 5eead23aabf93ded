"""Calls: of the program's own routines, and of those that every controller has."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from lark import Tree

from drillc.verification.events import Kind
from drillc.verification.machine import Machine
from drillc.verification.reading import ReadError
from drillc.verification.statements import At, Call, Do, Routine, Statement

from . import arithmetic as ar
from . import system
from .expressions import Expressions
from .modules import RoutineText
from .references import Evaluate, Reference, fitted, unset
from .scope import Scope
from .state import must_have_arrived
from .tree import Node, plain_name, upper, written
from .words import NAME_LENGTH

#: What a function returns, among its own variables; what it returned, among the caller's.
RESULT = "RETURN"

#: BAS commands that choose a number or set a speed; others are refused.
_ACCELERATIONS = frozenset({"#ACC_CP", "#ACC_PTP", "#ACC_GLUE"})


class Calls:
    """Lowers the calls of one routine."""

    def __init__(self, scope: Scope) -> None:
        self.scope = scope
        self.values = Expressions(scope, self.function)

    def statement(self, tree: Node, at: At) -> Statement:
        """A call that stands alone. Raises ReadError."""
        name_tree, arguments = tree.children
        assert isinstance(name_tree, Tree)
        name = upper(name_tree)
        given = [child.children[0] for child in arguments.children] if arguments else []
        if (routine := self.scope.routine_named(name)) is not None:
            return self._own(tree, routine, given, at, None)
        match name:
            case "BAS":
                return Do(at, self._bas(tree, given))
            case "MSGNOTIFY":
                return Do(at, self._notify(tree, given))
            case "PULSE":
                return Do(at, self._pulse(tree, given))
            case "IR_STOPM":
                return Do(at, _nothing)
        raise self.scope.fail(name_tree, f"{written(name_tree)} is not declared")

    def function(self, tree: Node) -> Evaluate:
        """A call within an expression: it is run before the statement."""
        name_tree, arguments = tree.children
        assert isinstance(name_tree, Tree)
        routine = self.scope.routine_named(upper(name_tree))
        assert routine is not None
        if not routine.result:
            raise self.scope.fail(name_tree, f"{routine.name} returns nothing")
        given = [child.children[0] for child in arguments.children] if arguments else []
        at = At(self.scope.routine.file, self.scope.line)
        key = f"{RESULT} {at.line} {len(self.scope.before)}"
        self.scope.before.append(self._own(tree, routine, given, at, key))

        def read(m: Machine) -> Any:
            if key not in m.locals:
                raise m.fail(f"{routine.name} returned nothing")
            return m.locals[key]

        return read

    # ── the program's own ────────────────────────────────────────────────────────────────────────

    def _own(
        self, tree: Node, routine: RoutineText, given: Sequence[Any], at: At, result: str | None
    ) -> Call:
        parameters = routine.parameters
        if len(given) != len(parameters):
            wanted = f"{len(parameters)} {'value' if len(parameters) == 1 else 'values'}"
            raise self.scope.fail(tree, f"{routine.name} takes {wanted}, not {len(given)}")
        reads: list[tuple[str, str, Evaluate]] = []
        backs: list[tuple[str, Reference]] = []
        for parameter, argument in zip(parameters, given, strict=True):
            type_ = routine.locals[parameter.name].type
            if not parameter.handed_back:
                reads.append((parameter.name, type_, self._argument(argument, type_)))
                continue
            if not isinstance(argument, Tree) or argument.data != "reference":
                message = f"{parameter.name} is handed back, so it takes a variable"
                raise self.scope.fail(argument or tree, message)
            reference = self.values.reference(argument)
            if reference.write is None:
                message = f"{reference.name} cannot be handed back: it is no variable"
                raise self.scope.fail(argument, message)
            backs.append((parameter.name, reference))
        fresh = [(name, local) for name, local in routine.locals.items()]

        def enter(m: Machine) -> dict[str, Any]:
            variables = {name: unset(local.type, local.dims) for name, local in fresh}
            for name, type_, read in reads:
                variables[name] = fitted(m, read(m), type_, name)
            for name, reference in backs:
                variables[name] = _or_unset(m, reference, variables[name])
            return variables

        def leave(m: Machine, variables: dict[str, Any]) -> None:
            for name, reference in backs:
                assert reference.write is not None
                if not _is_unset(variables[name]):
                    reference.write(m, variables[name])
            if result is not None and RESULT in variables:
                m.locals[result] = variables[RESULT]

        key = (routine.module, routine.name.upper())
        routines = self.scope.files.routines

        def called() -> Routine:
            return routines[key]

        return Call(at, called, enter, leave if backs or result is not None else None)

    def _argument(self, argument: Any, type_: str) -> Evaluate:
        if argument is None:
            raise self.scope.fail(argument, "a value is missing")
        if isinstance(argument, Tree) and argument.data == "aggregate":
            return self.values.aggregate(argument, type_)
        return self.values.value(argument)

    # ── the controller's ─────────────────────────────────────────────────────────────────────────

    def _bas(self, tree: Node, given: Sequence[Any]) -> Callable[[Machine], None]:
        command = given[0] if given else None
        if len(given) not in (1, 2) or not isinstance(command, Tree) or command.data != "constant":
            raise self.scope.fail(tree, "BAS takes a command such as #TOOL, and a number")
        word = str(command.children[0]).upper()
        value = self.values.value(given[1]) if len(given) == 2 else lambda m: 0
        notes = self.scope.files.notes

        def initialise(m: Machine) -> None:
            # which tool and base are active afterwards differs from one BAS to another
            m.state.update(initialised=True, tool=-1, base=-1, speed_m_s=math.nan, turning="#VAR")
            m.state["advance"] = 3
            system.axis_speed(m, 100.0)

        def frame(m: Machine) -> None:
            what = "tool" if word == "#TOOL" else "base"
            system.choose(m, notes, what, ar.one(m, value(m), f"the number of the {what}"))

        def parameters(m: Machine) -> None:
            data = m.state["system"].get("FDAT_ACT")
            if not isinstance(data, dict):
                raise m.fail(f"BAS({word}) needs FDAT_ACT, which has no value")
            if word == "#PTP_PARAMS":
                system.axis_speed(m, value(m))
            else:
                system.speed(m, value(m))
            for what in ("tool", "base"):
                system.choose(m, notes, what, ar.one(m, data.get(f"{what.upper()}_NO"), what))

        acts: dict[str, Callable[[Machine], None]] = {
            "#INITMOV": initialise,
            "#TOOL": frame,
            "#BASE": frame,
            "#VEL_PTP": lambda m: system.axis_speed(m, value(m)),
            "#VEL_CP": lambda m: system.speed(m, value(m)),
            "#PTP_PARAMS": parameters,
            "#CP_PARAMS": parameters,
        }
        if word in _ACCELERATIONS:
            return _nothing
        if word not in acts:
            raise self.scope.fail(command, f"BAS({word}) is not read")

        def act(m: Machine) -> None:
            if word != "#INITMOV" and not m.state["initialised"]:
                notes.find(m, "rules", f"BAS({word}) before BAS(#INITMOV,0)")
            acts[word](m)

        return act

    def _notify(self, tree: Node, given: Sequence[Any]) -> Callable[[Machine], None]:
        if not 1 <= len(given) <= 5:
            raise self.scope.fail(tree, "MsgNotify takes a message and the name of a module")
        for argument in given:
            if argument is not None:
                self.values.value(argument)
        notes = self.scope.files.notes
        sender = given[1] if len(given) > 1 else None
        says = str(sender.children[0])[1:-1] if isinstance(sender, Tree) else ""
        too_long = len(says) > NAME_LENGTH

        def act(m: Machine) -> None:
            must_have_arrived(m, notes, "the operator is told")
            if too_long:
                notes.find(m, "rules", f"a message's module has at most {NAME_LENGTH} characters")
            m.emit(Kind.MESSAGE)

        return act

    def _pulse(self, tree: Node, given: Sequence[Any]) -> Callable[[Machine], None]:
        """PULSE($OUT[1],TRUE,0.5): the output goes back while the program goes on."""
        reference = given[0] if len(given) == 3 else None
        name = plain_name(reference)
        signal = self.scope.signal(name) if name is not None else None
        if signal is not None:
            place: Evaluate = lambda m: signal.first  # noqa: E731
            is_output = signal.variable == "$OUT"
        elif isinstance(reference, Tree) and reference.data == "reference":
            place = self.values.index_of(reference)
            is_output = upper(reference.children[0]) == "$OUT"
        else:
            is_output = False
        if not is_output:
            raise self.scope.fail(tree, "PULSE takes an output, its value and a time")
        on, seconds = self.values.value(given[1]), self.values.value(given[2])
        notes = self.scope.files.notes
        there = system.signal_written("$OUT", place, on, notes, False)
        back = system.signal_written("$OUT", place, lambda m: ar.opposite(m, on(m)), notes, False)

        def act(m: Machine) -> None:
            ar.number(m, seconds(m))
            there(m)
            back(m)

        return act


def _or_unset(m: Machine, reference: Reference, nothing: Any) -> Any:
    """What a variable that is handed back begins with: its value, or none yet."""
    try:
        return reference.read(m)
    except ReadError:
        return nothing


def _nothing(m: Machine) -> None:
    """Nothing that can be seen."""


def _is_unset(value: Any) -> bool:
    return value is None or (isinstance(value, dict) and not value)

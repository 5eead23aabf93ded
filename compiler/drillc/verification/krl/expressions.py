"""Expressions → functions of the machine that give their value."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from lark import Token, Tree

from drillc.verification.machine import UNDECIDED, Machine

from . import arithmetic as ar
from . import system
from .constants import aggregate, bits
from .frames import components, product
from .motion import place, pose_of
from .references import Evaluate, Index, Part, Reference, Suffix
from .scope import Scope
from .state import arrive
from .tree import Node, number_of, slot_of, upper, written
from .words import AXES

_ONE_ARGUMENT: Mapping[str, Callable[[Any], Any]] = {
    "ABS": np.abs,
    "SIN": lambda x: np.sin(np.radians(x)),
    "COS": lambda x: np.cos(np.radians(x)),
    "TAN": lambda x: np.tan(np.radians(x)),
    "ACOS": lambda x: np.degrees(np.arccos(x)),
    "SQRT": np.sqrt,
}
#: Functions of the inline forms: they hand their first argument on.
_HANDED_ON = frozenset({"SVEL_JOINT", "SVEL_CP"})
#: Operators that bind more than a comparison, whatever one is used to from other languages.
_LOGICAL = frozenset({"either", "apart", "both"})


class Expressions:
    """Lowers the expressions of one routine; `call` lowers a call of a function of the program, and
    returns what reads its result."""

    def __init__(self, scope: Scope, call: Callable[[Node], Evaluate]) -> None:
        self.scope, self._call = scope, call
        self.going_on = False  # after CONTINUE

    def value(self, tree: Any) -> Evaluate:
        """The function that gives the value. Raises ReadError."""
        if not isinstance(tree, Tree):
            raise self.scope.fail(tree, "a value is missing")
        number = number_of(tree)
        if number is not None:
            return lambda m: number
        children = tree.children
        match tree.data:
            case "number":
                slot = slot_of(tree)
                assert slot is not None
                return self.scope.number_column(slot)
            case "truth":
                truth = str(children[0]).upper() == "TRUE"
                return lambda m: truth
            case "text":
                text = str(children[0])[1:-1]
                return lambda m: text
            case "constant":
                name = str(children[0]).upper()
                return lambda m: name
            case "bits":
                whole = bits(str(children[0]))
                return lambda m: whole
            case "bracketed":
                return self.value(children[0])
            case "aggregate":
                return self.aggregate(tree, "")
            case "reference":
                return self.reference(tree).read
            case "call":
                return self._function(tree)
            case "minus":
                inner = self.value(children[0])
                return lambda m: -ar.number(m, inner(m))
            case "not":
                word, operand = str(children[0]).upper(), self.value(children[1])
                if word == "B_NOT":
                    return lambda m: ~ar.number(m, operand(m))
                return lambda m: ar.opposite(m, operand(m))
            case "chain":
                return self._chain(tree)
            case _:
                return self._binary(tree)

    def aggregate(self, tree: Node, type_: str) -> Evaluate:
        """{X 1,Y 2}: constants only, as everywhere in KRL."""
        scope = self.scope
        read = aggregate(tree, type_, scope.types(), lambda column, text: _at(scope, column, text))
        if all(ar.is_number(part) for part in read.values()):
            read = {name: float(part) for name, part in read.items()}
        return lambda m: dict(read)

    def _binary(self, tree: Node) -> Evaluate:
        left_tree, sign, right_tree = tree.children
        if tree.data == "comparison":
            for side in (left_tree, right_tree):
                if isinstance(side, Tree) and side.data in _LOGICAL:
                    message = f"a comparison beside {str(side.children[1]).upper()} needs brackets"
                    raise self.scope.fail(side, f"{message}: KRL compares last")
        left, right = self.value(left_tree), self.value(right_tree)
        word = str(sign).upper()
        if tree.data == "comparison":
            return lambda m: ar.compare(m, word, left(m), right(m))
        if tree.data in _LOGICAL:
            return lambda m: ar.combine(m, word, left(m), right(m))
        return lambda m: ar.calculate(m, word, left(m), right(m))

    def _chain(self, tree: Node) -> Evaluate:
        left, right = self.value(tree.children[0]), self.value(tree.children[1])
        names = [described(child) for child in tree.children]
        notes = self.scope.files.notes

        def read(m: Machine) -> Any:
            one = pose_of(m, notes, left(m), names[0])
            return product(one, pose_of(m, notes, right(m), names[1]))

        return read

    def _function(self, tree: Node) -> Evaluate:
        name_tree, arguments = tree.children
        name = upper(name_tree)
        given = [child.children[0] for child in arguments.children] if arguments else []
        if self.scope.routine_named(name) is not None:
            return self._call(tree)
        if name in _ONE_ARGUMENT and len(given) == 1:
            operand, apply = self.value(given[0]), _ONE_ARGUMENT[name]
            return lambda m: _plain(apply(ar.number(m, operand(m))))
        if name == "ATAN2" and len(given) == 2:
            y, x = self.value(given[0]), self.value(given[1])
            return lambda m: _plain(np.degrees(np.arctan2(ar.number(m, y(m)), ar.number(m, x(m)))))
        if name in _HANDED_ON and given:
            return self.value(given[0])
        message = f"{written(name_tree)} is not declared"
        raise self.scope.fail(tree, message)

    # ── references ───────────────────────────────────────────────────────────────────────────────

    def reference(self, tree: Node) -> Reference:
        """What a reference reads, and writes if it can. Raises ReadError."""
        name_tree, *suffix_trees = tree.children
        assert isinstance(name_tree, Tree)
        name = upper(name_tree)
        if not self.scope.is_known(name) and slot_of(name_tree) is None:
            special = self._special(tree, name, suffix_trees)
            if special is not None:
                return special
        type_ = self.scope.type_of(name)
        suffixes: list[Suffix] = []
        places: list[Sequence[int]] = []
        for suffix in suffix_trees:
            assert isinstance(suffix, Tree)
            part = suffix.children[0]
            if suffix.data == "part":
                type_ = self.scope.check_part(type_, part)
                suffixes.append(Part(upper(part)))
            elif all(child is None for child in suffix.children):
                continue  # NAME[] is the whole text
            else:
                suffixes.append(Index(tuple(self.value(child) for child in suffix.children)))
                numbers = [self.scope.numbers_in(child) for child in suffix.children]
                places += [number for number in numbers if number is not None]
        return self.scope.variable(tree, suffixes, places)

    def index_of(self, tree: Node) -> Evaluate:
        """The index of a reference such as $OUT[1]. Raises ReadError."""
        suffixes = tree.children[1:]
        is_index = len(suffixes) == 1 and isinstance(suffixes[0], Tree)
        if not is_index or suffixes[0].data != "index" or len(suffixes[0].children) != 1:
            raise self.scope.fail(tree, f"{written(tree.children[0])} needs a number in brackets")
        return self.value(suffixes[0].children[0])

    def _special(self, tree: Node, name: str, suffixes: Sequence[Any]) -> Reference | None:
        """Signals, timers, system variables."""
        read = self._special_read(tree, name, suffixes)
        if read is None:
            return None
        kept_name = name + "".join(described(suffix) for suffix in suffixes)

        def now(m: Machine) -> Any:
            known = m.state["system"].get(kept_name)
            return read(m) if known is None else known

        def write(m: Machine, value: Any) -> None:
            m.state["system"][kept_name] = value

        writable = name == "$FLAG" or name in system.WITHOUT_EFFECT
        return Reference(kept_name, "", now, write if writable else None)

    def _special_read(self, tree: Node, name: str, suffixes: Sequence[Any]) -> Evaluate | None:
        if (signal := self.scope.signal(name)) is not None:
            if signal.first != signal.last:
                raise self.scope.fail(tree, f"{name} is a group of signals, which is not read")
            return system.signal_read(signal.variable, lambda m: signal.first, self.going_on)
        if name in ("$IN", "$OUT", "$ANIN", "$ANOUT"):
            return system.signal_read(name, self.index_of(tree), self.going_on)
        if name in ("$TIMER", "$TIMER_STOP", "$TIMER_FLAG"):
            return system.timer_read(name, self.index_of(tree))
        if name in ("$NULLFRAME", "$WORLD"):
            return _with_part(system.null_frame, suffixes)
        if name in ("$AXIS_ACT", "$AXIS_INT"):
            return _with_part(_axes, suffixes)
        if name in ("$POS_ACT", "$POS_INT"):
            notes = self.scope.files.notes
            notes.follows_place = True
            return _with_part(lambda m: _stopped(m, components(place(m, notes))), suffixes)
        if name in ("$TOOL", "$BASE"):
            what = name[1:].lower()
            return _with_part(lambda m: components(system.active(m, what)), suffixes)
        if name == "$OV_PRO":
            return lambda m: m.state["override_percent"]
        if name == "$ADVANCE":
            return lambda m: m.state["advance"]
        if name == "$VEL" and described(suffixes[0] if suffixes else None) == ".CP":
            return lambda m: m.state["speed_m_s"]
        if name in ("TOOL_DATA", "BASE_DATA"):
            index, table = self.index_of(tree), name
            return lambda m: _controller_data(m, table, index)
        if name in system.UNKNOWN or name in system.WITHOUT_EFFECT or name == "$FLAG":
            return lambda m: UNDECIDED
        return None


def described(tree: Any) -> str:
    """A part of a line, as it is written but for spaces."""
    if isinstance(tree, Token):
        return str(tree)
    if not isinstance(tree, Tree):
        return ""
    parts = [described(child) for child in tree.children]
    match tree.data:
        case "index":
            return f"[{','.join(parts)}]"
        case "part":
            return f".{parts[0].upper()}"
        case "chain":
            return ":".join(parts)
        case "aggregate":
            return "the aggregate"
        case "minus":
            return f"-{parts[0]}"
        case "bracketed":
            return f"({parts[0]})"
        case "name" | "number" if parts[0][0] in "\x01\x02":
            return "the position"
        case _:
            return "".join(parts)


def _at(scope: Scope, column: int, message: str) -> Exception:
    error = scope.fail(None, message)
    error.column = column
    return error


def _plain(value: Any) -> Any:
    return float(value) if np.ndim(value) == 0 else value


def _axes(m: Machine) -> dict[str, Any]:
    arrive(m)
    return {name: m.state["axes"][name] for name in AXES}


def _stopped(m: Machine, value: Any) -> Any:
    arrive(m)
    return value


def _with_part(read: Evaluate, suffixes: Sequence[Any]) -> Evaluate:
    if not suffixes:
        return read
    name = described(suffixes[0]).lstrip(".")

    def part(m: Machine) -> Any:
        value = read(m)
        if name not in value or len(suffixes) > 1:
            raise m.fail(f"there is no component {name}")
        return value[name]

    return part


def _controller_data(m: Machine, table: str, index: Evaluate) -> Any:
    number = ar.one(m, index(m), f"the number of {table}")
    value = m.state[table.lower()].get(str(number))
    if value is None:
        raise m.fail(f"what {table}[{number}] is, only the controller knows")
    return value

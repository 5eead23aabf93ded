"""Expressions of RAPID into functions of the machine, each with its type."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lark import Token, Tree

from ..machine import UNDECIDED, Machine
from ..reading import Finding, ReadError
from ..statements import Statement
from .data import Datum, Head
from .modules import error, number_of, numbers_of, slot
from .program import Program, Row, key
from .quaternions import not_normalised
from .syntax import Bulk, Node, subtrees
from .types import BOOL, INSTALLED, NUM, ORIENT, STRING, TOOLDATA, WOBJDATA, Type, Value, initial
from .values import both, compared, denied, divided, either, one_of, whole
from .variables import NAME_OF, Get, Local, Typed, Variable, in_state, part, set_data, set_local


@dataclass(eq=False)
class Scope:
    """Where an expression stands. `bulk`: the stretch that it is the shape of. `before`: the calls
    of functions that have to be made first, where they can be made."""

    program: Program
    module: int
    file: int
    variables: dict[str, Local] = field(default_factory=dict)
    bulk: Bulk | None = None
    columns: dict[int, Any] = field(default_factory=dict)  # of the stretch, by slot
    before: list[Statement] | None = None

    def error(self, at: Token | Node, message: str) -> ReadError:
        return error(self.file, at, message)

    def finding(self, check: str, at: Token | Node, message: str) -> None:
        place = self.error(at, message)
        self.program.findings.append(Finding(check, place.file, place.line, place.column, message))

    # ── expressions ──────────────────────────────────────────────────────────────────────────────

    def of_type(self, tree: Any, kind: Type) -> Typed:
        """An expression that must be of a type. Raises ReadError."""
        found = self.expression(tree, kind)
        if found.kind != kind:
            raise self.error(tree, f"a {kind.name} is wanted here, not a {found.kind.name}")
        return found

    def expression(self, tree: Any, wanted: Type | None = None) -> Typed:
        match tree.data:
            case "number":
                return self._number(tree)
            case "string":
                text = str(tree.children[0])[1:-1].replace('""', '"').replace("\\\\", "\\")
                return Typed(STRING, lambda m: text, True)
            case "truth":
                truth = tree.children[0].upper() == "TRUE"
                return Typed(BOOL, lambda m: truth, True)
            case "variable":
                return self.variable(tree).typed
            case "aggregate":
                return self._aggregate(tree, wanted)
            case "function_call":
                found: Typed = self.program.calls.function(self, tree)
                return found
            case "signed":
                return self._signed(tree)
            case "arithmetic":
                return self._arithmetic(tree)
            case "comparison":
                return self._comparison(tree)
            case "not":
                one = self.of_type(tree.children[0], BOOL)
                return Typed(BOOL, lambda m: denied(one.get(m)), one.fixed)
            case "and" | "or" | "xor":
                join = {"and": both, "or": either, "xor": one_of}[tree.data]
                one, two = (self.of_type(child, BOOL) for child in tree.children)
                return Typed(BOOL, lambda m: join(one.get(m), two.get(m)), one.fixed and two.fixed)
        raise self.error(tree, f"{tree.data} is not read here")

    def _number(self, tree: Node) -> Typed:
        token = tree.children[0]
        assert isinstance(token, Token)
        number = slot(token)
        if number is None:
            value = number_of(token)
            return Typed(NUM, lambda m: value, True)
        assert self.bulk is not None
        texts = self.bulk.stretch.columns[number]
        if texts[0] == texts[-1] and len(set(texts)) == 1:
            same = number_of(texts[0])
            return Typed(NUM, lambda m: same)
        self.columns[number] = numbers_of(texts)
        return Typed(NUM, lambda m: m.column(number))

    def _signed(self, tree: Node) -> Typed:
        sign, operand = tree.children
        one = self.expression(operand)
        if one.kind == NUM:
            return one if sign == "+" else Typed(NUM, lambda m: -one.get(m), one.fixed)
        if one.kind.name == "pos" and sign == "-":
            return Typed(one.kind, lambda m: [-part for part in one.get(m)], one.fixed)
        raise self.error(tree, f"a {one.kind.name} has no sign")

    def _arithmetic(self, tree: Node) -> Typed:
        left, token, right = tree.children
        operator = str(token).upper()
        one = self.expression(left)
        two = self.expression(right, one.kind)
        fixed = one.fixed and two.fixed
        kinds = (one.kind.name, operator, two.kind.name)
        match kinds:
            case ("num", "+", "num"):
                return Typed(NUM, lambda m: one.get(m) + two.get(m), fixed)
            case ("num", "-", "num"):
                return Typed(NUM, lambda m: one.get(m) - two.get(m), fixed)
            case ("num", "*", "num"):
                return Typed(NUM, lambda m: one.get(m) * two.get(m), fixed)
            case ("num", "/" | "DIV" | "MOD", "num"):

                def ratio(m: Machine) -> Value:
                    by = two.get(m)
                    if np.any(np.asarray(by) == 0.0):
                        raise self.error(tree, "a division by 0")
                    return divided(operator, one.get(m), by)

                return Typed(NUM, ratio, fixed)
            case ("string", "+", "string"):
                return Typed(STRING, lambda m: one.get(m) + two.get(m), fixed)
            case ("pos", "+" | "-", "pos"):
                sign = 1.0 if operator == "+" else -1.0
                return Typed(
                    one.kind,
                    lambda m: [a + sign * b for a, b in zip(one.get(m), two.get(m), strict=True)],
                    fixed,
                )
            case ("pos", "*", "num") | ("num", "*", "pos"):
                vector, factor = (one, two) if two.kind == NUM else (two, one)
                return Typed(
                    vector.kind, lambda m: [factor.get(m) * v for v in vector.get(m)], fixed
                )
        raise self.error(tree, f"{kinds[0]} {operator} {kinds[2]} has no meaning that is read")

    def _comparison(self, tree: Node) -> Typed:
        left, token, right = tree.children
        operator = str(token)
        if self.signal_name(left) is not None:
            self.of_type(right, NUM)
            return Typed(BOOL, lambda m: UNDECIDED)
        one = self.expression(left)
        two = self.expression(right, one.kind)
        if one.kind != two.kind:
            raise self.error(tree, f"a {one.kind.name} is compared with a {two.kind.name}")
        if operator not in ("=", "<>") and one.kind != NUM:
            raise self.error(tree, f"a {one.kind.name} is neither less nor more than another")
        return Typed(
            BOOL, lambda m: compared(operator, one.get(m), two.get(m)), one.fixed and two.fixed
        )

    def _aggregate(self, tree: Node, wanted: Type | None) -> Typed:
        if wanted is None or not wanted.parts:
            what = f"a {wanted.name} is wanted here, not" if wanted else "nothing says the type of"
            raise self.error(tree, f"{what} a list in [ ]")
        children = subtrees(tree)
        if len(children) != len(wanted.parts):
            raise self.error(
                tree,
                f"{len(children)} values are given where {wanted.name} has {len(wanted.parts)}"
                " (decimals are written with a point)",
            )
        parts = [self.of_type(c, kind) for c, kind in zip(children, wanted.parts, strict=True)]
        fixed = all(part.fixed for part in parts)
        if wanted == ORIENT and fixed:
            self._check_quaternion(tree, children)
        gets = [part.get for part in parts]
        return Typed(wanted, lambda m: [get(m) for get in gets], fixed)

    def _check_quaternion(self, tree: Node, children: Sequence[Node]) -> None:
        texts = []
        for child in children:
            sign = "-" if child.data == "signed" and child.children[0] == "-" else ""
            number = child.children[1] if child.data == "signed" else child
            if not isinstance(number, Tree) or number.data != "number":
                return
            texts.append(sign + str(number.children[0]))
        if message := not_normalised(texts):
            self.finding("quaternions", tree, message)

    # ── names ────────────────────────────────────────────────────────────────────────────────────

    def variable(self, tree: Any) -> Variable:
        """A name with its parts. Raises ReadError where it is not declared."""
        name, *path = tree.children
        root = self._root(name)
        if not path:
            return root
        kind, places = root.typed.kind, list[int | Typed]()
        for step in path:
            if step.data == "member":
                word = step.children[0]
                where = kind.where(word)
                if where is None:
                    raise self.error(word, f"a {kind.name} has no component {word}")
                places.append(where)
                kind = kind.parts[where]
                continue
            for index in step.children:
                if kind.element is None:
                    raise self.error(step, f"a {kind.name} has no elements")
                places.append(self._index(index, kind.size))
                kind = kind.element
        return part(root, kind, places)

    def _index(self, tree: Any, size: int) -> Typed:
        index = self.of_type(tree, NUM)

        def place(m: Machine) -> int:
            number = whole(index.get(m))
            if number is None or not 1 <= number <= size:
                raise self.error(tree, f"there are elements 1 to {size} only")
            return number - 1

        return Typed(NUM, place, index.fixed)

    def _root(self, token: Token) -> Variable:
        if (number := slot(token)) is not None:
            return Variable(self._in_lanes(number, token), None)
        name = token.upper()
        if local := self.variables.get(name):
            at = local.key
            typed = Typed(local.kind, lambda m: m.locals[at])
            return Variable(typed, None if local.constant else set_local(at))
        match self.program.find(name, self.module):
            case Datum() as datum:
                self.program.used.add(datum)
                return self._datum(datum, name)
            case Row() as row:
                row.positions.used[row.row] = True
                return self._position(row, name)
            case Head():
                raise self.error(token, f"{token} is a routine, not data")
        if name in INSTALLED:
            kind, value = INSTALLED[name]
            return Variable(Typed(kind, lambda m: value, True), None)
        raise self.error(token, f"{token} is not declared")

    def _datum(self, datum: Datum, name: str) -> Variable:
        constant = datum.storage == "CONST"
        if name not in self.program.assigned or constant:
            if not datum.linked:
                link(self.program, datum)
            value = datum.value
            fixed = Typed(datum.kind, lambda m: value, True)
            return Variable(fixed, None if constant else set_data(key(name, datum.module)))
        return in_state(datum.kind, key(name, datum.module))

    def _position(self, row: Row, name: str) -> Variable:
        constant = bool(row.positions.constant[row.row])
        kind = row.positions.kind
        if name in self.program.assigned and not constant:
            return in_state(kind, key(name, row.module))
        value = row.positions.value(row.row)
        typed = Typed(kind, lambda m: value, True)
        return Variable(typed, None if constant else set_data(key(name, row.module)))

    def _in_lanes(self, number: int, token: Token) -> Typed:
        """The position that each line of a stretch names; they must be of one module and type."""
        assert self.bulk is not None
        names = [text.upper() for text in self.bulk.stretch.columns[number]]
        first = self.program.find(names[0], self.module)
        if not isinstance(first, Row) or not self.program.assigned.isdisjoint(names):
            raise NotAlike
        positions = first.positions
        try:
            rows = np.array([positions.rows[name] for name in names], dtype=np.intp)
        except KeyError:
            raise NotAlike from None
        if first.module != self.module and positions.local[rows].any():
            raise NotAlike
        positions.used[rows] = True
        self.columns[number] = rows
        return Typed(positions.kind, lambda m: positions.in_lanes(m.column(number)))

    # ── what the cell has and programs do not declare ────────────────────────────────────────────

    def signal_name(self, tree: Any) -> str | None:
        """The name of a signal, if it is one: a name that nothing here declares."""
        if tree.data != "variable" or len(tree.children) != 1:
            return None
        name = tree.children[0]
        if slot(name) is not None or self.declared(name):
            return None
        return str(name).lower()

    def signal(self, tree: Any) -> str:
        """Raises ReadError where it is something else."""
        name = self.signal_name(tree)
        if name is None:
            raise self.error(tree, "a signal is wanted here: a name that the program declares not")
        return name

    def declared(self, token: Token) -> bool:
        name = token.upper()
        return (
            name in self.variables
            or name in INSTALLED
            or self.program.find(name, self.module) is not None
        )

    def named(self, tree: Any, kind: Type) -> tuple[Typed, Get]:
        """A tool or a work object and the name of it. One that is not declared is the cell's own:
        its value is None."""
        assert kind in (TOOLDATA, WOBJDATA)
        if tree.data != "variable" or len(tree.children) != 1 or slot(tree.children[0]) is not None:
            raise self.error(tree, f"a {kind.name} is named here")
        token = tree.children[0]
        name, text = token.upper(), str(token)
        if name in self.variables:
            return self.of_type(tree, kind), lambda m: m.locals[NAME_OF + name]
        if not self.declared(token):
            return Typed(kind, lambda m: None, True), lambda m: text
        return self.of_type(tree, kind), lambda m: text


class NotAlike(Exception):  # noqa: N818 (its lines are read one by one)
    """The lines of a stretch differ in more than numbers."""


def link(program: Program, datum: Datum) -> None:
    """Give data of a module its initial value. Raises ReadError."""
    datum.linked = True
    if datum.expression is None:
        datum.value = initial(datum.kind)
        return
    scope = Scope(program, datum.module, datum.place.file)
    found = scope.of_type(datum.expression, datum.kind)
    if not found.fixed:
        raise scope.error(datum.expression, f"{datum.name} needs a value that is constant")
    # nothing in it asks the machine
    datum.value = found.get(None)  # type: ignore[arg-type]

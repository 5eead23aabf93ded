"""Reads .src files: routines, their parameters and declarations, and lines of statements."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
from lark import Tree
from numpy.typing import NDArray

from drillc.verification.alike import Stretch, shapes_by, stretches
from drillc.verification.reading import Finding, ReadError

from .data import TOKEN
from .modules import Alike, Line, Local, Module, Names, Parameter, RoutineText
from .text import Text
from .tree import Node, Parser, column_of, modifiers, number_of, trees, upper, written
from .words import OTHER_TYPES, STRUCTURES, WITHOUT_DECL, can_be_declared

#: Statements that may be repeated; blocks and declarations are read line by line.
_REPEATABLE = frozenset({"assign", "call", "move", "wait_sec", "wait_for", "halt"})


class Source:
    """Reads one .src into its module; routines that others can call, into `shared` too."""

    def __init__(self, module: Module, shared: Names, text: Text, parser: Parser) -> None:
        self.module, self.shared, self.text, self.parser = module, shared, text, parser
        self.line = 0
        self._routine: RoutineText | None = None
        self._has_statements = False

    def read(self, positions: Collection[str]) -> None:
        """`positions`: names that alike lines may differ in, in upper case. Raises ReadError."""
        code = self.text.code
        done = 0
        for stretch in stretches(code, shapes_by(TOKEN, positions)):
            self._singly(done, stretch.first - 1)
            end = stretch.first - 1 + stretch.count * len(stretch.text)
            if not self._in_bulk(stretch):
                self._singly(stretch.first - 1, end)
            done = end
        self._singly(done, len(code))
        if self._routine is not None:
            end_word = "ENDFCT" if self._routine.result else "END"
            self.line = len(code) - 1 if not code[-1] else len(code)
            raise self.fail(1, f"{self._routine.name} does not end with {end_word}")
        if not self.module.own.routines:
            raise ReadError(self.text.file, 1, 1, "the file has no DEF")

    def fail(self, column: int, message: str) -> ReadError:
        return ReadError(self.text.file, self.line, column, message)

    def _find(self, column: int, message: str) -> None:
        found = Finding("rules", self.text.file, self.line, column, message)
        self.module.findings.append(found)

    def _singly(self, begin: int, end: int) -> None:
        for index in range(begin, end):
            code = self.text.code[index]
            if code and not code.isspace():
                self.line = index + 1
                self._statement(self.parser.line(self.text.file, index + 1, code))

    def _in_bulk(self, stretch: Stretch) -> bool:
        if self._routine is None:
            return False
        parsed: list[Node] = []
        kept: list[int] = []
        for number, text in enumerate(stretch.text):
            if not text or text.isspace():
                continue
            try:
                tree = self.parser.line(self.text.file, stretch.first + number, text)
            except ReadError:
                return False
            if tree.data not in _REPEATABLE:
                return False
            parsed.append(tree)
            kept.append(number)
        if not parsed:
            return False
        columns = tuple(
            column if f"\x02{slot}\x02" in "".join(stretch.text) else _numbers(column)
            for slot, column in enumerate(stretch.columns)
        )
        lines = stretch.lines()[:, kept]
        texts = tuple(stretch.text[number] for number in kept)
        self._has_statements = True
        self._routine.items.append(Alike(lines, tuple(parsed), texts, columns))
        return True

    # ── one line ─────────────────────────────────────────────────────────────────────────────────

    def _statement(self, tree: Node) -> None:
        match tree.data:
            case "routine" | "function":
                self._head(tree)
            case "end" | "end_function":
                self._end(tree)
            case "data_head" | "data_end":
                raise self.fail(column_of(tree), "this belongs in a data list")
            case "external":
                self.module.externals.add(upper(tree.children[1]))
            case "import" | "struc" | "enum" | "signal":
                raise self.fail(1, f"{str(tree.data).upper()} belongs in the data list")
            case _ if self._routine is None:
                raise self.fail(column_of(tree), "a statement outside of DEF and END")
            case "declare":
                self._declare(tree, self._routine)
            case _:
                self._has_statements = True
                self._routine.items.append(Line(self.line, tree))

    def _head(self, tree: Node) -> None:
        if self._routine is not None:
            message = f"{self._routine.name} has not ended"
            raise self.fail(column_of(tree), message)
        result = ""
        if tree.data == "routine":
            is_global, name, parameters = tree.children
        else:
            is_global, type_, _, name, parameters = tree.children
            result = upper(type_)
        assert isinstance(name, Tree)
        first = not self.module.own.routines
        key, column = upper(name), column_of(name)
        if first and key != self.text.stem.upper():
            message = f"the module is called {written(name)}, its file {self.text.stem}"
            self._find(column, message)
        made = RoutineText(
            name=written(name),
            module=self.module.name,
            file=self.text.file,
            line=self.line,
            column=column,
            result=result,
            is_global=is_global is not None or first,
            parameters=tuple(self._parameters(parameters)),
        )
        if wrong := can_be_declared(key):
            self._find(column, f"{written(name)} {wrong}")
        if key in self.module.own.routines:
            raise self.fail(column, f"{written(name)} is defined twice")
        if made.is_global and key in self.shared.routines:
            other = self.shared.routines[key].module
            raise self.fail(column, f"{written(name)} is defined in {other} too")
        is_data = self.module.own.declares(key) or (made.is_global and self.shared.declares(key))
        if is_data and key != self.module.name:
            self._find(column, f"{written(name)} is data, too")
        self.module.own.routines[key] = made
        if made.is_global:
            self.shared.routines[key] = made
        self._routine, self._has_statements = made, False

    def _parameters(self, tree: object) -> list[Parameter]:
        found: list[Parameter] = []
        for parameter in trees(tree, "parameter") if isinstance(tree, Tree) else ():
            name, _, way = parameter.children
            key = upper(name)
            if any(other.name == key for other in found):
                raise self.fail(column_of(parameter), f"{key} is a parameter twice")
            # without a word, a parameter is :OUT
            handed_back = way is None or str(way).upper() == "OUT"
            found.append(Parameter(key, handed_back, column_of(parameter)))
        return found

    def _end(self, tree: Node) -> None:
        routine = self._routine
        if routine is None:
            raise self.fail(1, "END without DEF")
        if (tree.data == "end_function") != bool(routine.result):
            raise self.fail(1, f"{routine.name} ends with the wrong word")
        for parameter in routine.parameters:
            if parameter.name not in routine.locals:
                message = f"{routine.name}: the type of {parameter.name} is not declared"
                raise ReadError(routine.file, routine.line, parameter.column, message)
        self._routine = None

    def _declare(self, tree: Node, routine: RoutineText) -> None:
        parts = [c for c in tree.children if isinstance(c, Tree) and c.data != "modifier"]
        words = modifiers(tree)
        type_ = upper(parts[0])
        if "DECL" not in words and type_ not in WITHOUT_DECL:
            raise self.fail(column_of(tree), f"{written(parts[0])} is not understood here")
        if self._has_statements:
            self._find(column_of(tree), "a declaration stands after a statement")
        if not self._is_type(type_):
            raise self.fail(column_of(parts[0]), f"{written(parts[0])} is no type")
        for variable in parts[1:]:
            name, dims, value = variable.children
            assert isinstance(name, Tree)
            key = upper(name)
            if value is not None:
                raise self.fail(column_of(value), "a declaration with a value is for data lists")
            if wrong := can_be_declared(key):
                self._find(column_of(name), f"{written(name)} {wrong}")
            if key in routine.locals:
                raise self.fail(column_of(name), f"{written(name)} is declared twice")
            sizes: tuple[int, ...] = ()
            if isinstance(dims, Tree):
                sizes = tuple(int(number_of(size) or 0) for size in dims.children)
            routine.locals[key] = Local(type_, sizes)

    def _is_type(self, type_: str) -> bool:
        return (
            type_ in WITHOUT_DECL
            or type_ in STRUCTURES
            or type_ in OTHER_TYPES
            or any(
                type_ in names.structures or type_ in names.enums
                for names in (self.module.own, self.shared)
            )
        )


def _numbers(column: Sequence[str]) -> NDArray[Any]:
    """Whole numbers as such: KRL divides them without a rest."""
    if all(text.lstrip("-").isdigit() for text in column):
        return np.array([int(text) for text in column], dtype=np.int64)
    return np.fromiter(map(float, column), dtype=np.float64, count=len(column))

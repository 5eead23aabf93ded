"""Reads data lists (.dat): declarations with their values, in bulk where lines are alike."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from lark import Tree

from drillc.verification.alike import Stretch, shapes_by, stretches
from drillc.verification.reading import Finding, ReadError

from .constants import constant, status_fault, whole
from .modules import Module, Names, SignalName, Table, Variable
from .text import Text
from .tree import Node, Parser, column_of, has, modifiers, number_of, slot_of, trees, upper, written
from .words import (
    OTHER_TYPES,
    POSITIONS,
    STATUS,
    STRUCTURES,
    WITHOUT_DECL,
    can_be_declared,
)

#: What alike lines may differ in. A number has its sign where there is nothing to subtract from.
TOKEN = re.compile(
    r'"[^"]*"|\'[^\']*\'|(?P<name>[#$]?[A-Za-z_][\w$]*)'
    r"|(?P<number>(?<![\w)\].])-?(?:\d+\.\d*|\d+)(?:[Ee][+-]?\d+)?(?![\w.]))"
)
_DECLARED = re.compile(r"^[ \t]*DECL[ \t]+(?:GLOBAL[ \t]+)?\w+[ \t]+(\w+)[ \t]*=", re.M | re.I)


class DataList:
    """Reads one data list into a module, and what is global in it into `shared`."""

    def __init__(self, module: Module, shared: Names, text: Text, parser: Parser) -> None:
        self.module, self.shared, self.text, self.parser = module, shared, text, parser
        self.line = 0

    def read(self) -> None:
        """Raises ReadError."""
        code = self.text.code
        filled = [i for i, line in enumerate(code) if line and not line.isspace()]
        if not filled:
            raise ReadError(self.text.file, 1, 1, "the data list is empty: no DEFDAT")
        first, last = filled[0], filled[-1]
        self._head(self._tree(first))
        if self._tree(last).data != "data_end":
            raise self.fail(1, "the data list does not end with ENDDAT")
        lines = code[first + 1 : last]
        names = {name.upper() for name in _DECLARED.findall("\n".join(lines))}
        done = 0
        for stretch in stretches(lines, shapes_by(TOKEN, names)):
            self._singly(lines, first + 1, done, stretch.first - 1)
            end = stretch.first - 1 + stretch.count * len(stretch.text)
            if not self._in_bulk(stretch, first + 1):
                self._singly(lines, first + 1, stretch.first - 1, end)
            done = end
        self._singly(lines, first + 1, done, len(lines))

    def fail(self, column: int, message: str) -> ReadError:
        return ReadError(self.text.file, self.line, column, message)

    def _find(self, check: str, column: int, message: str, line: int = 0) -> None:
        place = line or self.line
        self.module.findings.append(Finding(check, self.text.file, place, column, message))

    def _tree(self, index: int) -> Node:
        self.line = index + 1
        return self.parser.line(self.text.file, index + 1, self.text.code[index])

    def _head(self, tree: Node) -> None:
        if tree.data != "data_head":
            raise self.fail(column_of(tree), "the data list does not begin with DEFDAT")
        name = tree.children[0]
        assert isinstance(name, Tree)
        self.module.is_public = has(tree, "PUBLIC")
        if upper(name) != self.text.stem.upper():
            message = f"the data list is called {written(name)}, its file {self.text.stem}"
            self._find("rules", column_of(name), message)

    def _singly(self, lines: Sequence[str], offset: int, begin: int, end: int) -> None:
        for index in range(begin, end):
            if lines[index] and not lines[index].isspace():
                self._statement(self._tree(offset + index))

    # ── one line ─────────────────────────────────────────────────────────────────────────────────

    def _statement(self, tree: Node) -> None:
        match tree.data:
            case "declare":
                self._declare(tree)
            case "assign":
                self._assign(tree)
            case "external":
                name = tree.children[1]
                assert isinstance(name, Tree)
                self.module.externals.add(upper(name))
            case "signal":
                self._signal(tree)
            case "struc":
                self._structure(tree)
            case "enum":
                self._scope("GLOBAL" in modifiers(tree)).enums.add(upper(trees(tree, "name")[0]))
            case "import":
                raise self.fail(1, "IMPORT is not read: declare the data as GLOBAL")
            case _:
                raise self.fail(column_of(tree), "this does not belong in a data list")

    def _scope(self, is_global: bool, column: int = 1) -> Names:
        if self.module.name == "$CONFIG":
            return self.shared  # the controller's own list, whose data everybody sees
        if is_global and not self.module.is_public:
            self._find("rules", column, "GLOBAL in a data list that is not PUBLIC")
        return self.shared if is_global else self.module.own

    def _types(self) -> dict[str, dict[str, str]]:
        return self.shared.structures | self.module.own.structures

    def _declare(self, tree: Node) -> None:
        type_tree, *variables = [
            child for child in tree.children if isinstance(child, Tree) and child.data != "modifier"
        ]
        words = modifiers(tree)
        type_ = upper(type_tree)
        self._check_type(type_tree, "DECL" in words)
        for variable in variables:
            name, dims, value = variable.children
            assert isinstance(name, Tree)
            sizes = self.sizes(dims)
            made = self._new(self._scope("GLOBAL" in words, column_of(name)), name, type_, sizes)
            if value is not None:
                if sizes and type_ != "CHAR":
                    raise self.fail(column_of(value), "an array has its values in lines of its own")
                made.value = constant(value, type_, self._types(), self.fail)
                self._check_whole(made.name, type_, made.value, column_of(value))

    def _check_type(self, type_: Node, with_decl: bool) -> None:
        name = upper(type_)
        if not with_decl and name not in WITHOUT_DECL:
            raise self.fail(column_of(type_), f"{written(type_)} is not understood here")
        if name in WITHOUT_DECL or name in STRUCTURES or name in OTHER_TYPES:
            return
        if self.module.name.startswith("$"):
            return  # a list of the controller's own, which knows more types
        if not any(
            name in names.structures or name in names.enums
            for names in (self.module.own, self.shared)
        ):
            raise self.fail(column_of(type_), f"{written(type_)} is no type")

    def _new(self, scope: Names, name: Node, type_: str, dims: tuple[int, ...]) -> Variable:
        key, column = upper(name), column_of(name)
        if wrong := can_be_declared(key):
            self._find("rules", column, f"{written(name)} {wrong}")
        if key == self.module.name:
            self._find("rules", column, f"{written(name)} is the name of its module")
        if scope.declares(key):
            raise self.fail(column, f"{written(name)} is declared twice")
        made = Variable(written(name), type_, dims, self.text.file, self.line, column)
        scope.variables[key] = made
        return made

    def sizes(self, dims: object) -> tuple[int, ...]:
        """The sizes of an array; 0 for one that its text decides."""
        if not isinstance(dims, Tree):
            return ()
        sizes = [0 if size is None else number_of(size) for size in dims.children]
        if not all(isinstance(size, int) and size >= 0 for size in sizes):
            raise self.fail(column_of(dims), "the size of an array is a whole number")
        return tuple(int(size) for size in sizes if size is not None)

    def _check_whole(self, name: str, type_: str, value: Any, column: int) -> None:
        if type_ not in POSITIONS or not isinstance(value, dict):
            return
        if lacks := whole(type_, value):
            self._find("rules", column, f"{name}: {lacks}")
        for part in STATUS:
            if part in value and (wrong := status_fault(part, value[part])):
                self._find("rules", column, f"{name}: {wrong}")

    def _assign(self, tree: Node) -> None:
        reference, value = tree.children
        assert isinstance(reference, Tree)
        name, *suffixes = reference.children
        assert isinstance(name, Tree)
        variable = self._known(name)
        if not suffixes or suffixes[0].data != "index" or len(suffixes) > 1:
            raise self.fail(column_of(reference), "only elements of an array get a value here")
        index = self._place(variable, suffixes[0].children, reference)
        read = constant(value, variable.type, self._types(), self.fail)
        self._element(variable, index, read, column_of(reference))

    def _known(self, name: Node) -> Variable:
        key = upper(name)
        variable = self.module.own.variables.get(key) or self.shared.variables.get(key)
        if variable is None:
            raise self.fail(column_of(name), f"{written(name)} is not declared")
        return variable

    def _place(self, variable: Variable, children: Sequence[Any], at: Node) -> int:
        """Where an element is: its place, counted through all dimensions."""
        dims = variable.dims
        if variable.type == "CHAR" and children[-1] is None:
            children, dims = children[:-1], dims[:-1]  # the whole text
        numbers = [number_of(child) for child in children]
        if len(numbers) != len(dims):
            raise self.fail(column_of(at), f"{variable.name} has {len(variable.dims)} dimensions")
        place = 0
        for number, size in zip(numbers, dims, strict=True):
            if not isinstance(number, int):
                raise self.fail(column_of(at), "the place of an element is a whole number")
            if not 1 <= number <= size:
                message = f"{variable.name} has elements 1 to {size}, not {number}"
                raise self.fail(column_of(at), message)
            place = place * size + number - 1
        return place + 1

    def _element(self, variable: Variable, index: int, value: Any, column: int) -> None:
        if variable.value is None:
            variable.value = {}
        if index in variable.value:
            raise self.fail(column, f"{variable.name}[{index}] has its value already")
        variable.value[index] = value
        self._check_whole(f"{variable.name}[{index}]", variable.type, value, column)

    def _signal(self, tree: Node) -> None:
        parts = [child for child in tree.children if isinstance(child, Tree)]
        name, *ends = [part for part in parts if part.data != "modifier"]
        scope = self._scope("GLOBAL" in modifiers(tree), column_of(name))
        key = upper(name)
        if key.startswith("$"):
            return  # the controller's own signals are its own affair
        places: list[int] = []
        variable = ""
        for end in ends:
            if end.data == "truth":
                return
            if end.data != "reference" or len(end.children) != 2:
                raise self.fail(column_of(end), "a signal is a name for such as $OUT[1]")
            base, index = end.children
            assert isinstance(base, Tree)
            assert isinstance(index, Tree)
            variable = upper(base)
            place = number_of(index.children[0]) if index.data == "index" else None
            if not isinstance(place, int) or variable not in ("$OUT", "$IN", "$ANOUT", "$ANIN"):
                raise self.fail(column_of(end), "a signal is a name for such as $OUT[1]")
            places.append(place)
        if scope.declares(key):
            raise self.fail(column_of(name), f"{written(name)} is declared twice")
        scope.signals[key] = SignalName(variable, places[0], places[-1])

    def _structure(self, tree: Node) -> None:
        name = trees(tree, "name")[0]
        fields: dict[str, str] = {}
        type_ = ""
        for field in trees(tree, "field"):
            written_type, part, _ = field.children
            if written_type is not None:
                type_ = upper(written_type)
            fields[upper(part)] = type_
        self._scope("GLOBAL" in modifiers(tree), column_of(name)).structures[upper(name)] = fields

    # ── many lines ───────────────────────────────────────────────────────────────────────────────

    def _in_bulk(self, stretch: Stretch, offset: int) -> bool:
        """Whether the stretch could be read as a whole: positions, or elements of an array."""
        if len(stretch.text) != 1:
            return False
        self.line = offset + stretch.first
        try:
            tree = self.parser.line(self.text.file, self.line, stretch.text[0])
        except ReadError:
            return False
        if tree.data == "declare":
            return self._positions(tree, stretch)
        return tree.data == "assign" and self._elements(tree, stretch)

    def _elements(self, tree: Node, stretch: Stretch) -> bool:
        """NAME[1]={…} and so on, of an array of positions."""
        reference, value = tree.children
        assert isinstance(reference, Tree)
        name, *suffixes = reference.children
        assert isinstance(name, Tree)
        if slot_of(name) is not None or len(suffixes) != 1 or not isinstance(value, Tree):
            return False
        index = suffixes[0].children[0]
        variable = self._known(name)
        is_slot = isinstance(index, Tree) and index.data == "number"
        slot = slot_of(index) if is_slot else None
        if slot is None or len(variable.dims) != 1 or variable.type not in POSITIONS:
            return False
        places = stretch.columns[slot]
        columns = _columns(value, stretch, variable.type)
        if columns is None or not all(place.isdigit() for place in places):
            return False
        rows = zip(*(column.tolist() for column in columns.values()), strict=True)
        for row, place in zip(rows, places, strict=True):
            if not 1 <= int(place) <= variable.dims[0]:
                message = f"{variable.name} has elements 1 to {variable.dims[0]}, not {place}"
                raise self.fail(column_of(reference), message)
            read = dict(zip(columns, row, strict=True))
            self._element(variable, int(place), read, column_of(reference))
            self.line += 1
        return True

    def _positions(self, tree: Node, stretch: Stretch) -> bool:
        words = modifiers(tree)
        names, variables = trees(tree, "name"), trees(tree, "variable")
        type_ = upper(names[0])
        if "DECL" not in words or type_ not in POSITIONS or len(variables) != 1:
            return False
        name, dims, value = variables[0].children
        slot = slot_of(name)
        if slot is None or dims is not None or not isinstance(value, Tree):
            return False
        columns = _columns(value, stretch, type_)
        if columns is None or whole(type_, columns):
            return False
        for part in STATUS:
            if part in columns and any(status_fault(part, v) for v in np.unique(columns[part])):
                return False
        scope = self._scope("GLOBAL" in words, column_of(tree))
        written_names = stretch.columns[slot]
        upper_names = [name.upper() for name in written_names]
        rows = dict(zip(upper_names, range(len(upper_names)), strict=True))
        if len(rows) < len(upper_names) or any(map(scope.variables.__contains__, upper_names)):
            return False
        if any(map(scope.signals.__contains__, upper_names)) or self.module.name in rows:
            return False
        if any(not rows.keys().isdisjoint(table.rows) for table in scope.tables):
            return False
        if any(map(can_be_declared, upper_names)):
            return False
        lines = np.arange(stretch.count, dtype=np.int32) + np.int32(self.line)
        scope.tables.append(
            Table(
                type_,
                written_names,
                rows,
                lines,
                column_of(variables[0]),
                self.text.file,
                columns,
                np.zeros(stretch.count, dtype=np.bool_),
            )
        )
        return True


def _columns(tree: Node, stretch: Stretch, type_: str) -> dict[str, Any] | None:
    """The components of alike aggregates by name; None if they are anything but numbers."""
    if tree.data != "aggregate" or tree.children[0] is not None:
        return None
    columns: dict[str, Any] = {}
    for component in tree.children[1:]:
        assert isinstance(component, Tree)
        name, dims, value = component.children
        key = upper(name)
        if dims is not None or key in columns or key not in STRUCTURES[type_]:
            return None
        if not isinstance(value, Tree):
            return None
        number = number_of(value)
        if number is not None:
            columns[key] = np.full(stretch.count, float(number))
        elif value.data == "number" and (slot := slot_of(value)) is not None:
            columns[key] = stretch.numbers(slot)
        else:
            return None
    return columns

"""What names mean in a routine: its own variables, its module's data, what is global."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from lark import Tree

from drillc.verification.machine import Machine
from drillc.verification.reading import ReadError
from drillc.verification.statements import Routine, Statement

from .constants import components_of
from .modules import Alike, Module, Names, RoutineText, SignalName, Table, Variable
from .references import Evaluate, Index, Part, Reference, Suffix, by_lane, kept, listed
from .state import Notes
from .tree import Node, column_of, number_of, slot_of, upper, written
from .words import POSITIONS, PREDEFINED, STRUCTURES


@dataclass(eq=False)
class Files:
    """All that was read. `changed`: names of variables that statements write, in upper case;
    `routines`: routines as the machine runs them, by module and name."""

    modules: dict[str, Module]
    shared: Names
    changed: set[str]
    notes: Notes = field(default_factory=Notes)
    routines: dict[tuple[str, str], Routine] = field(default_factory=dict)


class Scope:
    """The names of one routine. `line` is the one that is being lowered."""

    def __init__(self, files: Files, module: Module, routine: RoutineText) -> None:
        self.files, self.module, self.routine = files, module, routine
        self.line = routine.line
        self.before: list[Statement] = []  # calls of functions, to be run before the statement
        self.columns: list[Any] = []  # of alike statements
        self._alike: Alike | None = None

    def fail(self, tree: Any, message: str) -> ReadError:
        """An error at a part of the line."""
        return ReadError(self.routine.file, self.line, column_of(tree), message)

    # ── alike statements ─────────────────────────────────────────────────────────────────────────

    def begin(self, alike: Alike | None) -> None:
        """The trees that follow have the slots of `alike`, or none."""
        self._alike, self.columns = alike, []

    def number_column(self, slot: int) -> Evaluate:
        """The numbers in a slot."""
        assert self._alike is not None
        return self._column(self._alike.columns[slot])

    def _column(self, values: Any) -> Evaluate:
        self.columns.append(values)
        index = len(self.columns) - 1
        return lambda m: m.column(index)

    def _position_column(self, slot: int, name: Node) -> Evaluate:
        assert self._alike is not None
        names = [text.upper() for text in self._alike.columns[slot]]
        table = self._table(names[0])
        if table is not None and all(map(table.rows.__contains__, names)):
            if not self.files.changed.isdisjoint(names):
                raise Uneven
            rows = np.array([table.rows[text] for text in names])
            table.used[rows] = True
            return self._column({key: column[rows] for key, column in table.columns.items()})
        values = []
        for text in names:
            value = self._constant(text)
            if value is None:
                raise Uneven
            values.append(value)
        gathered = by_lane(values)
        if gathered is None:
            raise Uneven
        return self._column(gathered)

    def _constant(self, name: str) -> Any:
        """The value of a position that no statement writes; None if there is none."""
        if name in self.files.changed or name in self.routine.locals:
            return None
        if (table := self._table(name)) is not None:
            table.used[table.rows[name]] = True
            return table.value(table.rows[name])
        variable = self._variable(name)
        if variable is None or variable.dims or variable.type not in POSITIONS:
            return None
        variable.used = True
        return variable.value

    # ── names ────────────────────────────────────────────────────────────────────────────────────

    def _table(self, name: str) -> Table | None:
        return self.module.own.table_of(name) or self.files.shared.table_of(name)

    def _variable(self, name: str) -> Variable | None:
        own = self.module.own.variables.get(name)
        return own if own is not None else self.files.shared.variables.get(name)

    def signal(self, name: str) -> SignalName | None:
        """What a signal's name stands for."""
        if name in self.routine.locals:
            return None
        own = self.module.own.signals.get(name)
        return own if own is not None else self.files.shared.signals.get(name)

    def routine_named(self, name: str) -> RoutineText | None:
        """A routine that can be called here."""
        own = self.module.own.routines.get(name)
        return own if own is not None else self.files.shared.routines.get(name)

    def types(self) -> Mapping[str, Mapping[str, str]]:
        """The program's own structures that are known here."""
        return self.files.shared.structures | self.module.own.structures

    def is_known(self, name: str) -> bool:
        """Whether it is data of the program."""
        return (
            name in self.routine.locals
            or self._variable(name) is not None
            or self._table(name) is not None
        )

    def variable(self, tree: Node, suffixes: Sequence[Suffix], places: Sequence[Any]) -> Reference:
        """A variable of the program, with the suffixes of the reference `tree`; `places`: the
        number that is the last index, if it is one. Raises ReadError."""
        name_tree = tree.children[0]
        assert isinstance(name_tree, Tree)
        if (slot := slot_of(name_tree)) is not None:
            read = self._position_column(slot, name_tree)
            return kept("the position", "", self._final("", suffixes), read, None, suffixes)
        name, label = upper(name_tree), written(name_tree)
        if name in self.routine.locals:
            local = self.routine.locals[name]
            final = self._final(local.type, suffixes)
            return kept(label, local.type, final, _local(name), _into_local(name), suffixes)
        if (table := self._table(name)) is not None:
            table.used[table.rows[name]] = True
            final = self._final(table.type, suffixes)
            if name in self.files.changed:
                key = f"{self._owner(name)}.{name}"
                return kept(label, table.type, final, _datum(key), _into_datum(key), suffixes)
            value = table.value(table.rows[name])
            return kept(label, table.type, final, lambda m: value, None, suffixes)
        if (variable := self._variable(name)) is not None:
            return self._data(name, variable, suffixes, places)
        if name in PREDEFINED:
            final = self._final(PREDEFINED[name], suffixes)
            return kept(label, PREDEFINED[name], final, _system(name), _into_system(name), suffixes)
        raise self.fail(name_tree, f"{label} is not declared")

    def _data(
        self, name: str, variable: Variable, suffixes: Sequence[Suffix], places: Sequence[Any]
    ) -> Reference:
        variable.used = True
        if variable.dims and suffixes and isinstance(suffixes[0], Index):
            if len(places) == 1 and len(variable.dims) == 1:
                variable.used_elements.update(places[0])
            else:
                variable.used_elements.update(range(1, int(np.prod(variable.dims)) + 1))
        final = self._final(variable.type, suffixes)
        if name in self.files.changed:
            key = f"{self._owner(name)}.{name}"
            write = _into_datum(key)
            return kept(variable.name, variable.type, final, _datum(key), write, suffixes)
        value = initial(variable)
        return kept(variable.name, variable.type, final, lambda m: value, None, suffixes)

    def _owner(self, name: str) -> str:
        own = self.module.own
        return self.module.name if name in own.variables or own.table_of(name) is not None else ""

    def _final(self, type_: str, suffixes: Sequence[Suffix]) -> str:
        """The type of the part that the suffixes lead to; empty if it is not known."""
        types = self.types()
        for suffix in suffixes:
            if isinstance(suffix, Index):
                continue
            if type_ in types:
                type_ = types[type_].get(suffix.name, "")
            elif type_ in POSITIONS:
                type_ = "REAL"
            else:
                type_ = ""
        return type_

    def check_part(self, type_: str, part: Node) -> str:
        """The type of a component. Raises ReadError if the type has no such component."""
        known = components_of(type_, self.types())
        if type_ and known is not None and upper(part) not in known:
            raise self.fail(part, f"{type_} has no component {written(part)}")
        return self._final(type_, [Part(upper(part))])

    def type_of(self, name: str) -> str:
        """The type of a variable; empty if it is not known."""
        if name in self.routine.locals:
            return self.routine.locals[name].type
        if (table := self._table(name)) is not None:
            return table.type
        variable = self._variable(name)
        return variable.type if variable is not None else PREDEFINED.get(name, "")

    def numbers_in(self, tree: Any) -> Sequence[int] | None:
        """The whole numbers that an index stands for, if they are written."""
        if isinstance(tree, Tree) and tree.data == "number":
            slot = slot_of(tree)
            if slot is not None and self._alike is not None:
                values = self._alike.columns[slot]
                return [int(v) for v in np.asarray(values, dtype=np.float64).tolist()]
        number = number_of(tree)
        return [number] if isinstance(number, int) else None


class Uneven(Exception):  # noqa: N818 (handled where alike lines are lowered)
    """Lines that look alike are not: they have to be read one by one."""


def initial(variable: Variable) -> Any:
    """The value of a variable of a data list before the program starts."""
    if variable.dims and variable.type != "CHAR":
        return listed(variable.value or {}, variable.type, variable.dims)
    if variable.value is None and variable.type in STRUCTURES:
        return {}
    return variable.value


def _local(name: str) -> Evaluate:
    return lambda m: m.locals.get(name)


def _into_local(name: str) -> Callable[[Machine, Any], None]:
    def write(m: Machine, value: Any) -> None:
        m.locals[name] = value

    return write


def _datum(key: str) -> Evaluate:
    return lambda m: m.state["data"].get(key)


def _into_datum(key: str) -> Callable[[Machine, Any], None]:
    def write(m: Machine, value: Any) -> None:
        m.state["data"][key] = value

    return write


def _system(name: str) -> Evaluate:
    return lambda m: m.state["system"].get(name)


def _into_system(name: str) -> Callable[[Machine, Any], None]:
    def write(m: Machine, value: Any) -> None:
        m.state["system"][name] = value

    return write

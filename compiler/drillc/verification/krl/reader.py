"""The reader of KRL: files → programs that can be run."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import ClassVar

import numpy as np
from lark import Tree

from drillc.language.job import Signal
from drillc.verification.events import Step
from drillc.verification.machine import Machine
from drillc.verification.reading import Finding, Precision, Reader, ReadError, Run

from .data import DataList
from .lowering import Lowering
from .modules import Alike, Module, Names, RoutineText, Variable
from .references import unset
from .scope import Files, initial
from .source import Source
from .state import Notes, at_the_start
from .text import Text, read_text
from .tree import Node, Parser, upper
from .words import AXES, POSITIONS

_NAME = re.compile(r"[A-Za-z_][\w$]*(?:\[\d+\])?")


class KrlReader(Reader):
    """Reads KRL of KSS 8, `.src` and `.dat`; files of other kinds are left alone."""

    name: ClassVar[str] = "krl"
    states_loads: ClassVar[bool] = True
    # A speed in m/s has as many decimals as keep it within 1e-4 of itself.
    precision: ClassVar[Precision] = Precision(
        length_mm=0.0005,
        angle_rad=math.radians(5e-5),
        joint_mm=0.0005,
        joint_rad=math.radians(5e-6),
        speed_share=1e-4,
        analog=0.5e-6,
    )

    def read(self, files: Mapping[str, bytes]) -> Sequence[Run]:
        """The programs: modules that no other module calls. Raises ReadError."""
        paths = list(files)
        loaded = _Loaded(paths)
        texts = [(i, p) for i, p in enumerate(paths) if p.lower().endswith((".dat", ".src"))]
        texts.sort(key=lambda text: not text[1].lower().endswith("$config.dat"))  # first, for types
        for number, path in texts:
            if path.lower().endswith(".dat"):
                loaded.read_data(read_text(number, path, files[path]))
        for number, path in texts:
            if path.lower().endswith(".src"):
                loaded.read_source(read_text(number, path, files[path]))
        lowered = loaded.lowered()
        mains = loaded.mains()
        if loaded.modules and not mains:
            raise ReadError(-1, 0, 0, "no program: every module is called by another")
        return [KrlRun(loaded, lowered, module) for module in mains]

    def signal_name(self, signal: Signal, renamed: Mapping[str, str]) -> str:
        """Signals have numbers, whatever they are called."""
        variable = {"input": "$IN", "output": "$OUT", "analog": "$ANOUT"}[signal.kind]
        return f"{variable}[{signal.number}]"

    def analog_value(self, signal: Signal, value: float) -> float:
        """An analog output is set to a share of its full scale."""
        return value / signal.full_scale if signal.full_scale else math.nan


class _Loaded:
    """All files of a program's folder, read."""

    def __init__(self, paths: Sequence[str]) -> None:
        self.paths = paths
        self.modules: dict[str, Module] = {}
        self.shared = Names()
        self.code: dict[int, list[str]] = {}
        self.parser = Parser()
        self.called: dict[str, set[str]] = {}  # module → modules whose routines it calls

    def _module(self, text: Text) -> Module:
        module = self.modules.setdefault(text.stem.upper(), Module(text.stem.upper()))
        module.findings += text.findings
        return module

    def read_data(self, text: Text) -> None:
        module = self._module(text)
        module.data = text.file
        DataList(module, self.shared, text, self.parser).read()

    def read_source(self, text: Text) -> None:
        module = self._module(text)
        module.source = text.file
        self.code[text.file] = text.code
        positions = set(module.own.positions())
        if any(True for _ in self.shared.positions()):
            positions |= set(self.shared.positions())
        Source(module, self.shared, text, self.parser).read(positions)

    def lowered(self) -> Files:
        """The routines of all modules as the machine runs them."""
        routines = [r for module in self.modules.values() for r in module.own.routines.values()]
        names = {r.name.upper(): r for r in routines}
        changed: set[str] = set()
        for routine in routines:
            called = self.called.setdefault(routine.module, set())
            for tree in _trees(routine):
                _look_at(tree, names, changed, called)
        files = Files(self.modules, self.shared, changed)
        for routine in routines:
            module = self.modules[routine.module]
            steps = next(iter(module.own.routines.values())) is routine
            code = self.code[routine.file]
            made = Lowering(files, module, routine, code, self.parser).run(steps)
            files.routines[routine.module, routine.name.upper()] = made
            routine.items.clear()
        self.parser = Parser()  # its trees are needed no more
        return files

    def mains(self) -> list[Module]:
        """Modules whose own routine no other module calls, by name."""
        firsts = {next(iter(m.own.routines)): m for m in self.modules.values() if m.own.routines}
        called = {
            name
            for module, names in self.called.items()
            for name in names
            if name in firsts and firsts[name].name != module
        }
        found = [module for name, module in firsts.items() if name not in called]
        return sorted(found, key=lambda module: module.name)

    def belonging(self, main: Module) -> list[Module]:
        """The main module and all that it reaches; and data lists without routines."""
        found, todo = [main], [main.name]
        while todo:
            for name in sorted(self.called.get(todo.pop(), ())):
                routine = self.shared.routines.get(name)
                if routine is not None and self.modules[routine.module] not in found:
                    found.append(self.modules[routine.module])
                    todo.append(routine.module)
        return found + [m for m in self.modules.values() if not m.own.routines]


class KrlRun(Run):
    """One main module with all that it calls."""

    def __init__(self, loaded: _Loaded, files: Files, main: Module) -> None:
        self._loaded, self._main = loaded, main
        self._files = Files(files.modules, files.shared, files.changed, files.notes, files.routines)
        first: RoutineText = next(iter(main.own.routines.values()))
        self.name = first.name
        self._text = first
        self.files = loaded.paths
        self.axes = AXES
        self._notes: Notes = files.notes
        self._machine = Machine(AXES, at_the_start(self._data()))
        self.signals = self._machine.signals
        self.frames = self._machine.frames

    def steps(self) -> Iterator[Step]:
        """Run it. Raises ReadError where it cannot go on."""
        text = self._text
        if text.parameters or text.result:
            raise ReadError(text.file, text.line, text.column, "a program has no parameters")
        machine = self._machine
        machine.state = at_the_start(self._data())
        routine = self._files.routines[text.module, text.name.upper()]

        variables = {name: unset(local.type, local.dims) for name, local in text.locals.items()}
        machine.state["locals"].append(variables)
        yield from machine.run(routine)

    def findings(self) -> Sequence[Finding]:
        """Rules that the text breaks, by file and line."""
        belonging = self._loaded.belonging(self._main)
        found = [finding for module in belonging for finding in module.findings]
        own = {number for module in belonging for number in (module.source, module.data)}
        found += [finding for finding in self._notes.findings() if finding.file in own]
        for module in belonging:
            found += _unused(module.own)
        found += [one for one in _unused(self._loaded.shared) if one.file in own]
        return sorted(found, key=lambda one: (one.file, one.line, one.column, one.message))

    def name_of(self, file: int, line: int) -> str | None:
        """The position in a line, such as P7 or VIA_PTP[2]."""
        code = self._loaded.code.get(file)
        if code is None or not 1 <= line <= len(code):
            return None
        module = next(m for m in self._loaded.modules.values() if m.source == file)
        for match in _NAME.finditer(code[line - 1]):
            name = match.group().split("[")[0].upper()
            for names in (module.own, self._loaded.shared):
                variable = names.variables.get(name)
                if names.table_of(name) or (variable and variable.type in POSITIONS):
                    return match.group()
        return None

    def _data(self) -> dict[str, object]:
        """Variables of data lists that statements write, with the values they begin with."""
        found: dict[str, object] = {}
        scopes = [(module.name, module.own) for module in self._files.modules.values()]
        for owner, names in (*scopes, ("", self._files.shared)):
            for name in self._files.changed:
                if name in names.variables:
                    found[f"{owner}.{name}"] = initial(names.variables[name])
                elif (table := names.table_of(name)) is not None:
                    found[f"{owner}.{name}"] = table.value(table.rows[name])
        return found


# ── what statements do with names ────────────────────────────────────────────────────────────────


def _trees(routine: RoutineText) -> Iterator[Node]:
    for item in routine.items:
        yield from item.trees if isinstance(item, Alike) else (item.tree,)


def _look_at(
    tree: Node, names: Mapping[str, RoutineText], changed: set[str], called: set[str]
) -> None:
    """Note which variables a statement writes and which routines it calls."""
    if tree.data in ("assign", "for"):
        changed.add(upper(tree.children[0].children[0]))
    if tree.data == "call":
        name = upper(tree.children[0])
        called.add(name)
        arguments = tree.children[1]
        if name in names and isinstance(arguments, Tree):
            given = [child.children[0] for child in arguments.children]
            for parameter, argument in zip(names[name].parameters, given, strict=False):
                is_variable = isinstance(argument, Tree) and argument.data == "reference"
                if parameter.handed_back and is_variable:
                    changed.add(upper(argument.children[0]))
    for child in tree.children:
        if isinstance(child, Tree):
            _look_at(child, names, changed, called)


def _unused(names: Names) -> Iterator[Finding]:
    for table in names.tables:
        for row in np.flatnonzero(~table.used).tolist():
            message = f"{table.names[row]} is never used"
            yield Finding("used", table.file, int(table.lines[row]), table.column, message)
    for variable in names.variables.values():
        if variable.type in POSITIONS:
            yield from _unused_variable(variable)


def _unused_variable(variable: Variable) -> Iterable[Finding]:
    if not variable.used:
        message = f"{variable.name} is never used"
        yield Finding("used", variable.file, variable.line, variable.column, message)
    elif variable.dims and variable.used_elements:
        for place in variable.value or ():
            if place not in variable.used_elements:
                message = f"{variable.name}[{place}] is never used"
                yield Finding("used", variable.file, variable.line, variable.column, message)

"""Reads ABB RAPID: a .pgf and its modules, or modules alone."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

from drillc.language.job import Signal

from ..events import Step, ToolFrame
from ..machine import Machine
from ..reading import Finding, Precision, Reader, ReadError, Run
from . import modules
from .data import Module
from .linking import linked
from .listing import Listing, listing
from .lowering import Lowering
from .motion import standing
from .program import Program
from .state import AXES, first_state

_MODULE = (".mod", ".modx", ".prg", ".sys", ".sysx")
_WORD = re.compile(r"[A-Za-z]\w*")


@dataclass(eq=False)
class RapidRun(Run):
    """One program in modules."""

    name: str
    files: Sequence[str]
    program: Program
    lowering: Lowering
    problems: Sequence[Finding]
    axes: tuple[str, ...] = AXES
    signals: Mapping[str, int] = field(default_factory=dict)
    frames: Sequence[ToolFrame] = ()

    def steps(self) -> Iterator[Step]:
        main = self.lowering.routine(self.program.main(), True)
        state = first_state(self.program.initial_state())
        state["locals"] = [dict(main.first)]
        machine = Machine(self.axes, state)
        self.signals, self.frames = machine.signals, machine.frames
        yield from machine.run(main.routine)
        standing(machine, self.program.findings, "the program ends")

    def findings(self) -> Sequence[Finding]:
        found = list(self.problems)
        for module in self.program.modules:
            found += module.findings
        found += self.program.findings
        found += self.program.unused()
        return sorted(dict.fromkeys(found), key=lambda f: (f.file, f.line, f.column, f.check))

    def name_of(self, file: int, line: int) -> str | None:
        for module in self.program.modules:
            if module.file == file and 1 <= line <= len(module.code):
                for word in _WORD.findall(module.code[line - 1])[1:]:
                    if module.position(word.upper()) or _is_position(self.program, word, module):
                        return str(word)
        return None


def _is_position(program: Program, word: str, module: Module) -> bool:
    return hasattr(program.find(word.upper(), module.index), "positions")


class RapidReader(Reader):
    name: ClassVar[str] = "rapid"
    states_loads: ClassVar[bool] = True
    #: 3 decimals of mm, mm/s and analog values, 8 of a quaternion, 5 of an axis in degrees.
    precision: ClassVar[Precision] = Precision(
        length_mm=0.5e-3,
        angle_rad=1e-8,
        joint_mm=0.5e-3,
        joint_rad=math.radians(0.5e-5),
        speed_mm_s=0.5e-3,
        analog=0.5e-3,
    )

    def read(self, files: Mapping[str, bytes]) -> Sequence[Run]:
        listings = [
            listing(path, raw) for path, raw in files.items() if path.lower().endswith(".pgf")
        ]
        found = [path for path in files if path.lower().endswith(_MODULE)]
        if not listings:
            if not found:
                raise ReadError(-1, 1, 1, "no module of RAPID (.mod) is there")
            listings = [Listing("", (), ())]
        runs = [_run(files, found, one, whole=len(listings) == 1) for one in listings]
        left = set(found) - {path for run in runs for path in run.files}
        if left:  # several programs: nobody knows whose it is
            runs[0].problems = [*runs[0].problems, *map(_left_out, sorted(left))]
        return sorted(runs, key=lambda run: run.name)

    def signal_name(self, signal: Signal, renamed: Mapping[str, str]) -> str:
        name = signal.alias or signal.role
        return renamed.get(name, name).lower()

    def analog_value(self, signal: Signal, value: float) -> float:
        """Turns a minute for a spindle, newtons for a force."""
        return value * 60.0 if signal.role == "spindle_speed" else value


def _run(files: Mapping[str, bytes], found: Sequence[str], one: Listing, whole: bool) -> RapidRun:
    """One program: the modules that its listing names, or all where there is no listing."""
    own = [one.path] if one.path else []
    by_name = {path.rsplit("/", 1)[-1].lower(): path for path in found}
    problems = list(one.findings)
    if own:
        for line, name in one.modules:
            path = by_name.get(name.replace("\\", "/").rsplit("/", 1)[-1].lower())
            if path is None:
                raise ReadError(0, line, 1, f"module {name} is listed, but there is no such file")
            own.append(path)
        if whole:
            problems += [_left_out(path) for path in found if path not in own]
    else:
        own = list(found)
    read = [
        modules.read(index, own.index(path), path, files[path])
        for index, path in enumerate(path for path in own if path.lower().endswith(_MODULE))
    ]
    lowering = linked(read)
    main = lowering.program.main()
    lowering.routine(main, True)
    for module in read:
        for head in module.routines.values():
            if head is not main:
                lowering.complete(head)
    name = one.path.rsplit("/", 1)[-1].rsplit(".", 1)[0]
    if not one.path:
        name = read[main.module].name
    return RapidRun(name, own, lowering.program, lowering, problems)


def _left_out(path: str) -> Finding:
    name = path.rsplit("/", 1)[-1]
    return Finding("rules", 0, 1, 1, f"{name} is there, but the program does not list it")

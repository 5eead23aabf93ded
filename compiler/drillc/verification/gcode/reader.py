"""Reads G-code programs for LinuxCNC and runs them."""

from __future__ import annotations

import math
import re
from bisect import bisect_left
from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import PurePosixPath
from typing import ClassVar

import numpy as np

from drillc.language.job import Signal

from ..events import Events, Kind, Step, ToolFrame
from ..machine import Machine
from ..reading import Finding, Precision, Reader, ReadError, Run
from ..statements import Routine
from .motion import CUT
from .sources import Source, routine_rows, source_of
from .state import LETTERS, at_the_start
from .structure import Body
from .syntax import Constant, Control, Line

SUFFIX = ".ngc"
_O_WORD = rb"^[ \t]*(?:n *\d+)?[ \t]*o[ \t]*(?:<([^<>\n]*)>|(\d+))[ \t]*"
_CALLED = re.compile(_O_WORD + rb"call[ \t]*(\[?)", re.I | re.M)
_SUB = re.compile(_O_WORD + rb"sub\b", re.I | re.M)
_ENDS = (Constant(2.0), Constant(30.0))
_CUT = "the move before this one ends in a corner that G64 rounds off: G61 stops there"
_OPENS = frozenset({"sub", "if", "do", "repeat", "while"})
_COMMENT = re.compile(r"[ \t]*\(\s*(?:hole\s+)?([^()]*?)\s*\)\s*$")


class GcodeReader(Reader):
    """Programs are the `.ngc` files that are not a routine's own file."""

    name: ClassVar[str] = "gcode"
    native_spindle: ClassVar[bool] = True
    # Lengths are printed with four decimals, angles and shares with five, feeds (a minute) with
    # three.
    precision: ClassVar[Precision] = Precision(
        length_mm=0.5e-4,
        angle_rad=math.radians(0.5e-5),
        joint_mm=0.5e-4,
        joint_rad=math.radians(0.5e-5),
        speed_mm_s=0.5e-3 / 60.0,
        analog=0.5e-5,
    )

    def read(self, files: Mapping[str, bytes]) -> Sequence[Run]:
        programs = {
            path: File(data, _calls(data)) for path, data in files.items() if path.endswith(SUFFIX)
        }
        own = {path for path, file in programs.items() if _is_routine(path, file.data)}
        mains = sorted(path for path in programs if path not in own)
        if own and not mains:
            raise ReadError(-1, 0, 0, "there are routines in files of their own, but no program")
        called = {label for file in programs.values() for label, _ in file.calls}
        unused = {path for path in own if _stem(path) not in called}
        runs = []
        for path in mains:
            folder = PurePosixPath(path).parent
            beside = [other for other in own if PurePosixPath(other).parent == folder]
            order = [path, *sorted(beside, key=_natural)]
            runs.append(GcodeRun({name: programs[name] for name in order}, unused))
            unused = set()
        return runs

    def signal_name(self, signal: Signal, renamed: Mapping[str, str]) -> str:
        kind = {"input": "in", "output": "out", "analog": "analog"}[signal.kind]
        return f"{kind} {signal.number}"

    def analog_value(self, signal: Signal, value: float) -> float:
        """A share of the signal's full scale."""
        return value / signal.full_scale if signal.full_scale else math.nan


@dataclass(frozen=True)
class File:
    """A file, and how often it calls each routine (with arguments or without)."""

    data: bytes
    calls: Counter[tuple[str, bool]]


class GcodeRun(Run):
    """One main file, and the files of its routines."""

    axes = LETTERS

    def __init__(self, data: Mapping[str, File], unused: Collection[str]) -> None:
        self.files = tuple(data)
        self.name = _stem(self.files[0])
        self._data = data
        self._findings: list[Finding] = []
        self._noted: set[tuple[int, int]] = set()
        self._known: dict[str, Line] = {}
        self._own = {_stem(path): index for index, path in enumerate(self.files) if index}
        self._routines: dict[str, Routine] = {}
        self._main = source_of(0, data[self.files[0]].data, self._findings, self._known)
        self._subs = routine_rows(self._main)
        self._parts = self._parts_of_main()
        self._machine = Machine(LETTERS, at_the_start())
        self._body = self._lowered_main()
        self._note_uncalled(unused)

    # ── Run ──────────────────────────────────────────────────────────────────────────────────────

    @property
    def signals(self) -> Mapping[str, int]:  # type: ignore[override]
        return self._machine.signals

    @property
    def frames(self) -> Sequence[ToolFrame]:  # type: ignore[override]
        return self._machine.frames

    def steps(self) -> Iterator[Step]:
        machine = self._machine = Machine(LETTERS, at_the_start(), signals=self._machine.signals)
        stopped = False
        for step in machine.run(self._body):
            if isinstance(step, Events) and len(step):
                stopped = bool(step.kind[-1] == Kind.STOP)
                yield self._without_notes(step)
            else:
                yield step
        if not (stopped or machine.state["ended"] or self._main.lines.percent):
            last = int(self._main.lines.number[-1]) if len(self._main.lines.number) else 1
            raise ReadError(0, last, 1, "the program ends without M2, M30 or %")

    def _without_notes(self, events: Events) -> Events:
        """Takes the notes of corners out of what happens, and makes findings of them."""
        notes = (events.kind == Kind.MESSAGE) & ~np.isnan(events.value)
        if not notes.any():
            return events
        cut = notes & (events.value == CUT)
        for at in zip(events.file[cut].tolist(), events.line[cut].tolist(), strict=True):
            if at not in self._noted:
                self._noted.add(at)
                self._findings.append(Finding("process", *at, 1, _CUT))
        return events.take(~notes)

    def findings(self) -> Sequence[Finding]:
        return self._findings

    def name_of(self, file: int, line: int) -> str | None:
        """The comment above the line."""
        raw = self._data[self.files[file]].data.split(b"\n")
        for text in reversed(raw[:line]):
            match = _COMMENT.match(text.decode("latin-1"))
            if match:
                return match[1]
        return None

    # ── routines ─────────────────────────────────────────────────────────────────────────────────

    def knows(self, label: str) -> bool:
        return label in self._subs or label in self._own

    def routine(self, label: str) -> Routine:
        """By name. Parts of the main program are read when their turn comes, and not kept."""
        if label in self._routines:
            return self._routines[label]
        if label in self._subs:
            body = Body(self._main, self, frame=False)
            self._routines[label] = body.routine(*self._subs[label])
            return self._routines[label]
        index = self._own[label]
        source = source_of(index, self._data[self.files[index]].data, self._findings, self._known)
        subs = routine_rows(source)
        if label not in subs:
            raise ReadError(index, 1, 1, f"the file holds no o<{label}> sub")
        first, last = subs[label]
        self._note_outside(source, first, last, label)
        body = Body(source, self, frame=label in self._parts)
        routine = body.routine(first, last)
        if not routine.steps:
            self._routines[label] = routine
        return routine

    def _lowered_main(self) -> Routine:
        """The main program. All its routines are lowered too, so that what is wrong in them is said
        even where nothing calls them."""
        for label in self._subs:
            self.routine(label)
        rows = len(self._main.lines.number)
        bounds = [(-1, -1), *sorted(self._subs.values()), (rows, rows)]
        stretches = [(before[1] + 1, after[0]) for before, after in pairwise(bounds)]
        self._check_order(stretches)
        last = max((stop - 1 for start, stop in stretches if stop > start), default=-1)
        body = Body(self._main, self, True, last)
        statements = [part for start, stop in stretches for part in body.rows(start, stop)]
        return Routine(self.name, tuple(statements), steps=True)

    def _check_order(self, stretches: Sequence[tuple[int, int]]) -> None:
        """LinuxCNC finds a routine that stands after its call, but refuses it when it comes to it
        afterwards; after the program's end it never does."""
        called: set[str] = set()
        at = dict(sorted((first, label) for label, (first, _) in self._subs.items()))
        for start, stop in stretches:
            for row in range(start, stop):
                said = self._main.line(row)
                if isinstance(said, Control):
                    if said.kind == "call":
                        called.add(said.label)
                elif any(word.letter == "m" and word.value in _ENDS for word in said.words):
                    return
            if at.get(stop) in called:
                raise self._main.error(
                    stop,
                    f"o<{at[stop]}> stands after its call: LinuxCNC refuses it, before M2 at least",
                )

    def _parts_of_main(self) -> frozenset[str]:
        """Routines in files of their own that are called once, by the main program, with nothing:
        parts of it."""
        counted: Counter[str] = Counter()
        for file in self._data.values():
            for (label, _), count in file.calls.items():
                counted[label] += count
        return frozenset(
            label
            for label, given in self._data[self.files[0]].calls
            if not given and counted[label] == 1 and label in self._own and self._in_frame(label)
        )

    def _in_frame(self, label: str) -> bool:
        """Whether the main program calls a routine outside of all routines and loops."""
        main = self._main
        shapes = [
            isinstance(s, Control) and (s.kind, s.label) == ("call", label) for s in main.said
        ]
        rows = np.flatnonzero(np.array(shapes)[main.lines.shape]).tolist()
        if len(rows) != 1:
            return False
        before = [main.control(mark) for mark in main.marks[: bisect_left(main.marks, rows[0])]]
        begun = {control.label for control in before if control.kind == "do"}
        depth = 0
        for control in before:
            closes = control.kind.startswith("end") or (
                control.kind == "while" and control.label in begun
            )
            depth += -1 if closes else control.kind in _OPENS
        return depth == 0

    def _note_uncalled(self, unused: Collection[str]) -> None:
        called = {label for file in self._data.values() for label, _ in file.calls}
        for label, (first, _) in self._subs.items():
            if label not in called:
                line = self._main.at(first).line
                self._findings.append(Finding("used", 0, line, 1, f"nothing calls o<{label}>"))
        for index, path in enumerate(self.files):
            if path in unused:
                said = f"nothing calls o<{_stem(path).lower()}>"
                self._findings.append(Finding("used", index, 1, 1, said))

    def _note_outside(self, source: Source, first: int, last: int, label: str) -> None:
        rows = len(source.lines.number)
        stray = 0 if first > 0 else last + 1 if last + 1 < rows else None
        if stray is not None:
            at = source.at(stray)
            self._findings.append(
                Finding(
                    "rules", at.file, at.line, 1, f"this stands outside of o<{label}>: never run"
                )
            )


def _is_routine(path: str, data: bytes) -> bool:
    """Whether a file holds the routine that is named like it, and so is no program itself."""
    stem = _stem(path).lower().replace(" ", "")
    return any(_name(named or numbered) == stem for named, numbered in _SUB.findall(data))


def _calls(data: bytes) -> Counter[tuple[str, bool]]:
    """How often a file calls each routine, with arguments and without."""
    return Counter(
        {
            (_name(named or numbered), bool(given)): count
            for (named, numbered, given), count in Counter(_CALLED.findall(data)).items()
        }
    )


def _name(label: bytes) -> str:
    return "".join(label.decode("latin-1").split()).lower()


def _stem(path: str) -> str:
    return PurePosixPath(path).stem


def _natural(path: str) -> list[tuple[int, str]]:
    """Part 2 before part 10."""
    return [(int(text), "") if text.isdigit() else (-1, text) for text in re.split(r"(\d+)", path)]

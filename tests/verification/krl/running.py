"""Runs KRL by drillc's reader, for tests: one program, its events as rows, its findings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from drillc.verification.events import Alternative, Events, Kind, joined, no_events
from drillc.verification.krl.reader import KrlReader
from drillc.verification.reading import Finding, Run
from drillc.verification.statements import At

HEAD = """&ACCESS RVP
&REL 1
"""
INI = """  BAS(#INITMOV,0)
  BAS(#TOOL,3)
  BAS(#BASE,2)
  BAS(#VEL_PTP,10)
"""


@dataclass(frozen=True, eq=False)
class Ran:
    """A run: its events as one, its alternatives, and the run itself."""

    run: Run
    events: Events
    others: Sequence[Alternative]

    def kinds(self) -> list[str]:
        """The kinds of all events by name."""
        return [Kind(kind).name for kind in self.events.kind.tolist()]

    def findings(self, check: str = "") -> list[str]:
        """Messages with their lines, of one check or of all."""
        return [f"{f.line}: {f.message}" for f in self.run.findings() if check in ("", f.check)]

    def signals(self) -> list[str]:
        """The signals of all events that have one."""
        names = {number: name for name, number in self.run.signals.items()}
        return [names[number] for number in self.events.signal.tolist() if number >= 0]


def ran(run: Run) -> Ran:
    """Run it to its end."""
    steps = list(run.steps())
    parts = [step for step in steps if isinstance(step, Events)]
    events = joined(parts) if parts else no_events(12)
    return Ran(run, events, [step for step in steps if isinstance(step, Alternative)])


def program(
    body: str, data: str = "", *, routines: str = "", declare: str = ""
) -> dict[str, bytes]:
    """The files of module CELL: `body` after the INI lines, `data` in its list."""
    source = f"{HEAD}DEF CELL( )\n{declare}{INI}{body}END\n{routines}"
    listed = f"{HEAD}DEFDAT CELL\n{data}ENDDAT\n"
    return {"krl/CELL.src": crlf(source), "krl/CELL.dat": crlf(listed)}


def crlf(text: str) -> bytes:
    """The text as the controller keeps it."""
    return text.replace("\n", "\r\n").encode("latin-1")


def read(files: Mapping[str, bytes]) -> Run:
    """The one program in the files."""
    (run,) = KrlReader().read(files)
    return run


def run(body: str, data: str = "", *, routines: str = "", declare: str = "") -> Ran:
    """Read and run a program."""
    return ran(read(program(body, data, routines=routines, declare=declare)))


def finding(made: Finding) -> tuple[str, int, str]:
    """What a test asks of a finding."""
    return made.check, made.line, made.message


def tables(events: Events) -> dict[str, Any]:
    """All columns, to be compared."""
    return {name: getattr(events, name) for name in Events.__dataclass_fields__}


def same_events(one: Events, two: Events, but: Sequence[str] = ()) -> bool:
    """Whether two runs did the same, but for some columns."""
    first, second = tables(one), tables(two)
    return len(one) == len(two) and all(
        np.array_equal(first[name], second[name], equal_nan=name != "kind")
        if first[name].dtype.kind == "f"
        else np.array_equal(first[name], second[name])
        for name in first
        if name not in but
    )


def place(at: At) -> tuple[int, int]:
    """File and line."""
    return at.file, at.line

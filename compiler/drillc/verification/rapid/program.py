"""All modules of a program together: which name means what, and what its data hold at first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..reading import Finding, ReadError
from .data import Datum, Head, Module, Place, Positions
from .types import INSTALLED, Value


@dataclass(frozen=True, eq=False)
class Row:
    """A position in a table."""

    positions: Positions
    row: int
    module: int


@dataclass(eq=False)
class Program:
    """The modules that are loaded together. `assigned` are the names that some statement gives a
    value: these are part of the machine's state, all others are constants. `asks`: some statement
    wants to know where the axes stand, so that has to be kept."""

    modules: Sequence[Module]
    assigned: frozenset[str] = frozenset()
    findings: list[Finding] = field(default_factory=list)
    used: set[Datum] = field(default_factory=set)
    asks: bool = False
    calls: Any = None  # makes values of calls of functions: see lowering.py
    shared: dict[str, Datum | Head] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for module in self.modules:
            own: dict[str, Datum | Head] = {**module.data, **module.routines}
            for name, item in own.items():
                if not item.local:
                    self._share(name, item)

    def find(self, name: str, module: int) -> Datum | Head | Row | None:
        """What a name in capital letters means in a module: its own things hide those of others."""
        own = self.modules[module]
        if found := own.data.get(name) or own.routines.get(name):
            return found
        if row := own.position(name):
            return Row(*row, module)
        if shared := self.shared.get(name):
            return shared
        for other in self.modules:
            if (row := other.position(name)) and not row[0].local[row[1]]:
                return Row(*row, other.index)
        return None

    def initial_state(self) -> dict[str, Value]:
        """What the data that statements change hold at first, by `key`."""
        state: dict[str, Value] = {}
        for module in self.modules:
            for name, datum in module.data.items():
                if name in self.assigned:
                    state[key(name, module.index)] = datum.value
            for name in self.assigned:
                if row := module.position(name):
                    state[key(name, module.index)] = row[0].value(row[1])
        return state

    def unused(self) -> list[Finding]:
        """A finding for each position that no statement uses."""
        found = []
        for module in self.modules:
            for positions in module.positions.values():
                names = None
                for row, used in enumerate(positions.used.tolist()):
                    if used:
                        continue
                    names = names or list(positions.rows)
                    line = int(positions.line[row])
                    code = module.code[line - 1]
                    at = code.upper().find(names[row])
                    name = code[at : at + len(names[row])] if at >= 0 else names[row]
                    found.append(
                        Finding(
                            "used",
                            module.file,
                            line,
                            max(at, 0) + 1,
                            f"{positions.kind.name} {name} is declared and never used",
                        )
                    )
            found += [
                Finding(
                    "used",
                    datum.place.file,
                    datum.place.line,
                    datum.place.column,
                    f"{datum.kind.name} {datum.name} is declared and never used",
                )
                for datum in module.data.values()
                if datum.kind.name.split(" ")[0] in ("robtarget", "jointtarget")
                and datum not in self.used
            ]
        return found

    def _share(self, name: str, item: Datum | Head) -> None:
        if other := self.shared.get(name):
            self._twice(item.name, item.place, other.place)
        elif name in INSTALLED:
            self.findings.append(
                Finding(
                    "rules",
                    item.place.file,
                    item.place.line,
                    item.place.column,
                    f"{item.name} is a name that the controller has taken",
                )
            )
        for module in self.modules:
            if module.name.upper() == name and module.index != item.module:
                self._twice(item.name, item.place, module.place)
        self.shared.setdefault(name, item)

    def _twice(self, name: str, place: Place, other: Place) -> None:
        where = f"line {other.line}"
        if place.file != other.file:
            where = f"{where} of another module"
        self.findings.append(
            Finding(
                "rules",
                place.file,
                place.line,
                place.column,
                f"{name} is declared a second time; the first is in {where}",
            )
        )

    def check_positions(self) -> None:
        """Names of positions against those of routines, modules and other data."""
        seen: dict[str, Place] = {}
        tables = [(m, p) for m in self.modules for p in m.positions.values()]
        for module, positions in tables:
            own: dict[str, Datum | Head] = {**module.data, **module.routines}
            clashes = own.keys() & positions.rows.keys()
            if not positions.local.all():
                lonely = {m.name.upper(): m.place for m in self.modules}
                shared = {n: i.place for n, i in self.shared.items()} | lonely | seen
                clashes |= shared.keys() & positions.rows.keys()
            else:
                shared = {}
            for name in sorted(clashes):
                row = positions.rows[name]
                if name not in own and positions.local[row]:
                    continue
                other = own[name].place if name in own else shared[name]
                self._twice(name, Place(module.file, int(positions.line[row]), 1), other)
            if len(tables) > 2 and not positions.local.all():
                seen |= {
                    name: Place(module.file, int(positions.line[row]), 1)
                    for name, row in positions.rows.items()
                    if not positions.local[row]
                }

    def main(self) -> Head:
        """The procedure that the program begins with. Raises ReadError."""
        found = [m.routines["MAIN"] for m in self.modules if "MAIN" in m.routines]
        if not found:
            raise ReadError(self.modules[0].file if self.modules else -1, 1, 1, "no PROC main")
        if len(found) > 1:
            place = found[1].place
            raise ReadError(place.file, place.line, place.column, "main is declared twice")
        return found[0]


def key(name: str, module: int) -> str:
    """The name of data in the machine's state."""
    return f"{module}.{name}"

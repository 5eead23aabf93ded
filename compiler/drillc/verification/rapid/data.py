"""What the modules of a program declare: data, positions in columns, and the heads of routines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..events import Floats, Ints
from ..reading import Finding
from .syntax import Bulk, Node
from .types import JOINTTARGET, ROBTARGET, Type, Value, flat, leaves, shaped

Truths = NDArray[np.bool_]


@dataclass(frozen=True)
class Place:
    """Where a name is declared."""

    file: int
    line: int
    column: int


@dataclass(eq=False)
class Datum:
    """A single piece of data of a module. `value` is its initial value once the program is linked;
    `expression` what it is computed from."""

    name: str
    kind: Type
    storage: str  # CONST, VAR or PERS
    local: bool
    module: int
    place: Place
    expression: Node | None = None
    value: Value = None
    linked: bool = False


@dataclass(frozen=True)
class Parameter:
    """Of a routine. `by_reference`: what the routine gives it, the caller sees."""

    name: str
    kind: Type
    by_reference: bool
    optional: bool
    switch: bool


@dataclass(frozen=True, eq=False)
class Head:
    """A procedure or, with a `result`, a function."""

    name: str
    parameters: Sequence[Parameter]
    result: Type | None
    local: bool
    module: int
    place: Place
    body: Node


@dataclass(eq=False)
class Positions:
    """The robtargets or the jointtargets of a module, n of them in columns.

    `rows`: the number of each by its name in capital letters. `values` (leaves of the type, n).
    `used` is set when a statement uses one.
    """

    kind: Type
    rows: dict[str, int] = field(default_factory=dict)
    values: Floats = field(default_factory=lambda: np.zeros((0, 0)))
    line: Ints = field(default_factory=lambda: np.zeros(0, dtype=np.int32))
    local: Truths = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    constant: Truths = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    used: Truths = field(default_factory=lambda: np.zeros(0, dtype=np.bool_))
    _alike: list[float | None] | None = None

    def extend(self, parts: Sequence[tuple[Floats, Ints, bool, bool]]) -> None:
        """Add the columns of some stretches: values, lines, whether LOCAL, whether CONST."""
        if not parts:
            return
        width = leaves(self.kind)
        self.values = np.concatenate([self.values.reshape(width, -1), *(p[0] for p in parts)], 1)
        self.line = np.concatenate([self.line, *(p[1] for p in parts)])
        self.local = np.concatenate([self.local, *(np.full(len(p[1]), p[2]) for p in parts)])
        self.constant = np.concatenate([self.constant, *(np.full(len(p[1]), p[3]) for p in parts)])
        self.used = np.zeros(len(self.line), dtype=np.bool_)

    def value(self, row: int) -> Value:
        """One position."""
        return shaped(self.kind, iter(self.values[:, row].tolist()))

    def in_lanes(self, rows: NDArray[np.intp]) -> Value:
        """Many positions as one value; what is the same in all of them stays a single number."""
        if self._alike is None:
            first = self.values[:, 0]
            same = (self.values == first[:, None]).all(axis=1)
            self._alike = [v if s else None for v, s in zip(first.tolist(), same, strict=True)]
        singles = iter(
            self.values[i][rows] if alike is None else alike for i, alike in enumerate(self._alike)
        )
        return shaped(self.kind, singles)


@dataclass(eq=False)
class Module:
    """What a module declares, by names in capital letters."""

    name: str
    index: int
    file: int
    place: Place
    bulk: Sequence[Bulk]
    code: Sequence[str]
    types: dict[str, Type] = field(default_factory=dict)
    data: dict[str, Datum] = field(default_factory=dict)
    routines: dict[str, Head] = field(default_factory=dict)
    positions: Mapping[str, Positions] = field(
        default_factory=lambda: {kind.name: Positions(kind) for kind in (ROBTARGET, JOINTTARGET)}
    )
    findings: list[Finding] = field(default_factory=list)

    def position(self, name: str) -> tuple[Positions, int] | None:
        """The table and the row of a position."""
        for positions in self.positions.values():
            if (row := positions.rows.get(name)) is not None:
                return positions, row
        return None


def column_of(value: Any) -> Floats:
    """A single position as the column of a table (leaves, 1)."""
    return np.array([list(flat(value))], dtype=np.float64).T

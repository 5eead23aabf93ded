"""What a KRL module is: its data list and its routines, as they were read."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drillc.verification.reading import Finding

from .tree import Node
from .words import STRUCTURES


@dataclass(eq=False)
class Variable:
    """A variable of a data list. `value`: a number, truth, text or the components of a structure;
    None without one. Of an array, the values of its elements by their place (from 1)."""

    name: str  # as written
    type: str
    dims: tuple[int, ...]
    file: int
    line: int
    column: int
    value: Any = None
    used: bool = False
    used_elements: set[int] = field(default_factory=set)


@dataclass(frozen=True, eq=False)
class Table:
    """Positions that alike lines declare: `names` as written, `rows` by names in upper case."""

    type: str
    names: tuple[str, ...]
    rows: dict[str, int]
    lines: NDArray[np.int32]
    column: int  # where the names begin
    file: int
    columns: dict[str, NDArray[np.float64]]
    used: NDArray[np.bool_]  # whether a statement reads it; filled in while statements are lowered

    def value(self, row: int) -> dict[str, float]:
        """The components of one position."""
        return {name: float(column[row]) for name, column in self.columns.items()}


@dataclass(frozen=True)
class SignalName:
    """A name for `$OUT[17]`, or for a group of outputs."""

    variable: str  # such as $OUT
    first: int
    last: int


@dataclass(frozen=True)
class Parameter:
    name: str
    handed_back: bool  # not :IN
    column: int


@dataclass(frozen=True)
class Local:
    """A variable of a routine."""

    type: str
    dims: tuple[int, ...]


@dataclass(frozen=True, eq=False)
class Alike:
    """Statements that differ only in numbers and names: `columns[k]` are those of slot k."""

    lines: NDArray[np.int32]  # (count, len(trees))
    trees: tuple[Node, ...]
    texts: tuple[str, ...]
    columns: tuple[NDArray[Any] | tuple[str, ...], ...]


@dataclass(frozen=True)
class Line:
    line: int
    tree: Node


@dataclass(eq=False)
class RoutineText:
    """A routine; `result`: the type of what a function returns, else empty."""

    name: str  # as written
    module: str
    file: int
    line: int
    column: int
    result: str
    is_global: bool
    parameters: tuple[Parameter, ...]
    items: list[Line | Alike] = field(default_factory=list)
    locals: dict[str, Local] = field(default_factory=dict)


@dataclass(eq=False)
class Names:
    """Names by upper case: of a data list, or of all that is global."""

    variables: dict[str, Variable] = field(default_factory=dict)
    tables: list[Table] = field(default_factory=list)
    signals: dict[str, SignalName] = field(default_factory=dict)
    structures: dict[str, dict[str, str]] = field(default_factory=dict)
    enums: set[str] = field(default_factory=set)
    routines: dict[str, RoutineText] = field(default_factory=dict)

    def table_of(self, name: str) -> Table | None:
        """The table with a position, if any."""
        for table in self.tables:
            if name in table.rows:
                return table
        return None

    def declares(self, name: str) -> bool:
        """Whether it is the name of a variable, signal or type."""
        return (
            name in self.variables
            or name in self.signals
            or name in self.structures
            or name in self.enums
            or self.table_of(name) is not None
        )

    def positions(self) -> Iterator[str]:
        """Names of all positions, and of arrays of them."""
        for table in self.tables:
            yield from table.rows
        yield from (n for n, variable in self.variables.items() if variable.type in STRUCTURES)


@dataclass(eq=False)
class Module:
    """A .src and its .dat; `source` and `data` are the indices of the files, -1 for none."""

    name: str  # upper case
    source: int = -1
    data: int = -1
    is_public: bool = False
    own: Names = field(default_factory=Names)
    externals: set[str] = field(default_factory=set)
    findings: list[Finding] = field(default_factory=list)

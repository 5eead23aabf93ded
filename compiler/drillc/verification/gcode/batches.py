"""Finds rows that repeat themselves with other numbers, so that they are run at once.

A program for many holes says the same few lines for each, not always equally often: an arm goes
straight to one hole in three steps, to another in five. So a lane is one row, of whatever kind,
together with the rows before it that do nothing but load parameters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..machine import Machine
from .parameters import LAST_FREE, LAST_LOCAL
from .sources import Source
from .syntax import Block, Constant, Line, Numbered, Setting, Slot
from .text import SLOT

#: Fewer of a kind are not worth it; and so many lanes at a time, which bounds the memory.
LEAST, MOST = 8, 8192
#: A variable that gets its first value in some of the lanes keeps them from being run at once, so
#: the first of each kind is run before, if they are not more than this.
_MOST_FIRST = 64

Rows = NDArray[np.intp]
Act = Callable[[Machine], None]


@dataclass(frozen=True, eq=False)
class Kind:
    """Rows that say the same: one of them, the first of the columns with their numbers, the column
    that tells the lanes of this kind, and the act that loads parameters first."""

    row: int
    column: int
    member: int
    load: Act | None


@dataclass(frozen=True, eq=False)
class Group:
    """Rows from `first` to before `last`; `rows` (lanes,) are those that are lanes. `declare` is an
    act to begin with."""

    first: int
    last: int
    rows: Rows
    kinds: tuple[Kind, ...]
    columns: tuple[Any, ...]
    declare: Act


def groups(source: Source, first: int, last: int) -> Iterator[Group]:
    """Groups among some rows, in order."""
    if last - first < LEAST:
        return
    loading = np.array([_loads(said) for said in source.said], dtype=bool)
    shape = source.lines.shape[first:last]
    rows = np.flatnonzero(~loading[shape])
    if not len(rows):
        return
    loads = np.diff(rows, prepend=-1) - 1  # how many rows before each do nothing but load
    kind = 2 * shape[rows] + (loads > 0)
    _, inverse, counts = np.unique(kind, return_inverse=True, return_counts=True)
    common = (counts >= LEAST)[inverse]
    rows += first
    edges = np.flatnonzero(np.diff(common, prepend=False, append=False))
    for k, (start, stop) in enumerate(edges.reshape(-1, 2).tolist()):
        if k == 0:
            occur = np.unique(kind[start:stop], return_index=True)[1]
            peeled = int(occur.max()) + 1
            start += peeled if peeled <= _MOST_FIRST else 0
        for i in range(start, stop, MOST):
            part = slice(i, min(i + MOST, stop))
            if part.stop - i >= LEAST:
                yield _group(source, rows[part], loads[part], kind[part])


def _loads(said: Line) -> bool:
    """Whether a line does nothing but give numbers to parameters of the whole program."""
    return (
        isinstance(said, Block)
        and not said.deletable
        and bool(said.items)
        and all(
            isinstance(item, Setting)
            and isinstance(item.value, Slot)
            and _number_of(item) is not None
            for item in said.items
        )
    )


def _number_of(setting: Setting) -> int | None:
    where = setting.parameter
    if not isinstance(where, Numbered) or not isinstance(where.index, Constant):
        return None
    number = round(where.index.value)
    whole = number == where.index.value
    return number if whole and LAST_LOCAL < number <= LAST_FREE else None


def _group(source: Source, rows: Rows, loads: Rows, kind: NDArray[np.intp]) -> Group:
    columns: list[Any] = []
    lines = source.lines
    loaded = _loaded(source, rows, loads)
    load = _load(loaded, columns) if loaded else None
    kinds = []
    for each in np.unique(kind).tolist():
        member = kind == each
        those = rows[member]
        number = len(columns)
        columns.append(member)
        slots = lines.shapes[lines.shape[those[0]]].count(SLOT)
        for slot in range(slots):
            column = np.full(len(rows), np.nan)
            column[member] = lines.values[lines.start[those] + slot]
            columns.append(column)
        kinds.append(Kind(int(those[0]), number + 1, number, load if each % 2 else None))

    def declare(machine: Machine) -> None:
        """All lanes have the same parameters, some of them without a value yet."""
        for number in loaded:
            machine.state["parameters"].setdefault(number, float("nan"))

    begin = int(rows[0] - loads[0])
    return Group(begin, int(rows[-1]) + 1, rows, tuple(kinds), tuple(columns), declare)


def _load(loaded: dict[int, NDArray[np.float64]], columns: list[Any]) -> Act:
    """The act that loads parameters; one that a lane does not load stays as it is."""
    told = []
    for number, column in loaded.items():
        told.append((number, len(columns)))
        columns.append(column)

    def act(machine: Machine) -> None:
        parameters = machine.state["parameters"]
        for number, column in told:
            value = machine.column(column)
            missing = np.isnan(value)
            if missing.any():
                value = np.where(missing, parameters[number], value)
            parameters[number] = value

    return act


def _loaded(source: Source, rows: Rows, loads: Rows) -> dict[int, NDArray[np.float64]]:
    """The value (lanes,) that each parameter is loaded with; NaN where it is not."""
    found: dict[int, tuple[NDArray[np.float64], Rows]] = {}  # values, and the rows they stand in
    lanes = len(rows)
    lines = source.lines
    lane_of = np.repeat(np.arange(lanes), loads)
    each = np.repeat(rows - np.cumsum(loads), loads) + np.arange(int(loads.sum()))
    order = np.argsort(lines.shape[each], kind="stable")
    # Rows of one shape load the same parameters.
    bounds = np.flatnonzero(np.diff(lines.shape[each][order])) + 1
    for those in np.split(order, bounds):
        if not len(those):
            continue
        said = source.line(int(each[those[0]]))
        assert isinstance(said, Block)
        for setting in said.settings:
            number = _number_of(setting)
            assert number is not None
            assert isinstance(setting.value, Slot)
            column, held = found.setdefault(
                number, (np.full(lanes, np.nan), np.full(lanes, -1, dtype=np.intp))
            )
            later = those[each[those] > held[lane_of[those]]]  # the last row counts
            column[lane_of[later]] = lines.values[lines.start[each[later]] + setting.value.index]
            held[lane_of[later]] = each[later]
    return {number: column for number, (column, _) in found.items()}

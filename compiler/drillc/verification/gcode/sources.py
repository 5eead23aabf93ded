"""A file of G-code, its lines parsed: what its rows say, and where its routines stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..reading import Finding, ReadError
from ..statements import At, Evaluate
from .expressions import Slots
from .syntax import Control, Line, Misread, parsed
from .text import Lines, lines_of


@dataclass(frozen=True, eq=False)
class Source:
    """`said` is what each shape says; `marks` are the rows, in order, with an O-word that is no
    call."""

    lines: Lines
    said: Sequence[Line]
    marks: Sequence[int]

    def line(self, row: int) -> Line:
        return self.said[int(self.lines.shape[row])]

    def control(self, row: int) -> Control:
        said = self.line(row)
        assert isinstance(said, Control)
        return said

    def at(self, row: int) -> At:
        return At(self.lines.file, int(self.lines.number[row]))

    def error(self, row: int, message: str, position: int = 0) -> ReadError:
        return self.lines.error(row, position, message)

    def slots(self, row: int) -> Slots:
        """The numbers of one row."""
        start = int(self.lines.start[row])

        def slot(index: int) -> Evaluate:
            value = float(self.lines.values[start + index])
            return lambda machine: value

        return slot


def source_of(file: int, data: bytes, findings: list[Finding], known: dict[str, Line]) -> Source:
    """Read a file; `known` has shapes that were parsed before. Raises ReadError."""
    lines = lines_of(file, data, findings)
    said: list[Line] = []
    for index, shape in enumerate(lines.shapes):
        if shape not in known:
            try:
                known[shape] = parsed(shape)
            except Misread as misread:
                row = int(np.argmax(lines.shape == index))
                raise lines.error(row, misread.position, misread.message) from None
        said.append(known[shape])
    marking = np.array([isinstance(s, Control) and s.kind != "call" for s in said], dtype=bool)
    marks = np.flatnonzero(marking[lines.shape]).tolist()
    return Source(lines, said, marks)


def column_slots(first: int) -> Slots:
    """The numbers of repeated rows, which are columns from `first` on."""

    def slot(index: int) -> Evaluate:
        number = first + index
        return lambda machine: machine.column(number)

    return slot


def routine_rows(source: Source) -> dict[str, tuple[int, int]]:
    """Where each routine stands: the rows of its `sub` and its `endsub`. Raises ReadError."""
    found: dict[str, tuple[int, int]] = {}
    opened: int | None = None
    for row in source.marks:
        control = source.control(row)
        if control.kind == "sub":
            if opened is not None:
                raise source.error(
                    row, f"{shown(control)} sub within {shown(source.control(opened))}"
                )
            if control.label in found:
                raise source.error(row, f"{shown(control)} is defined twice")
            opened = row
        elif control.kind == "endsub":
            if opened is None:
                raise source.error(row, f"{shown(control)} endsub ends no routine")
            begun = source.control(opened)
            if control.label != begun.label:
                raise source.error(row, f"{shown(control)} endsub ends {shown(begun)} sub")
            found[control.label] = (opened, row)
            opened = None
    if opened is not None:
        raise source.error(opened, f"{shown(source.control(opened))} sub has no endsub")
    return found


def shown(control: Control) -> str:
    """An O-word as it is written."""
    label = control.label
    return f"o{label}" if label.isdigit() else f"o<{label}>"

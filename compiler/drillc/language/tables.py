"""CSV hole tables, read in columns. Every bad row or cell is named by file, row and column."""

from __future__ import annotations

import csv
import difflib
import io
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from drillc.language.ast import Text, Word
from drillc.language.columns import numbers
from drillc.language.diagnostics import NAMED_ROWS, Report
from drillc.language.job import Floats
from drillc.language.points import RawHoles
from drillc.language.source import Source, Span
from drillc.language.units import UNITS, Unit

#: Rows handled at a time: bounds the memory that their texts take.
BLOCK_ROWS = 65536

#: What a table's columns may be mapped to; the first seven must be.
KEYS = ("id", "x", "y", "z", "i", "j", "k", "diameter", "stack")
REQUIRED = KEYS[:7]


@dataclass(frozen=True)
class TableSpec:
    """How to read a table: what `holes NAME from FILE { … }` says."""

    name: Word
    delimiter: str
    unit: Unit
    columns: dict[str, Word | Text]
    path: Text


@dataclass
class _Faults:
    """Bad cells by code, so that a million of them are a handful of messages."""

    report: Report
    source: Source
    seen: dict[str, int] = field(default_factory=dict)

    def add(self, code: str, line: int, message: str, hint: str | None = None) -> None:
        count = self.seen[code] = self.seen.get(code, 0) + 1
        if count <= NAMED_ROWS:
            span = Span(self.source, line, 1, max(1, len(self.source.line_text(line))))
            self.report.error(code, message, span, hint=hint)

    def finish(self) -> None:
        for code, count in self.seen.items():
            if count > NAMED_ROWS:
                self.report.error(
                    code,
                    f"{count - NAMED_ROWS:,} more such rows in {self.source.shown}",
                    Span(self.source, 1, 1),
                )


def read_table(spec: TableSpec, source: Source, report: Report) -> RawHoles | None:
    """Read the mapped columns of a table. Reports all its mistakes; None when there are any."""
    faults = _Faults(report, source)
    before = len(report.diagnostics)
    rows = _rows(spec, source, faults)
    header = next(rows, None)
    if header is None:
        report.error("E311", f"{source.shown} is empty; it needs a header line", spec.path.span)
        return None
    places = _places(spec, source, header[1], report)
    if places is None:
        return None
    lines: list[Floats] = []
    ids: list[str] = []
    blocks: dict[str, list[Floats]] = {key: [] for key in places if key != "id"}
    width = len(header[1])
    while block := list(islice(rows, BLOCK_ROWS)):
        kept = [(line, cells) for line, cells in block if _fits(line, cells, width, faults)]
        if not kept:
            continue
        columns = list(zip(*(cells for _, cells in kept), strict=True))
        line_numbers = [line for line, _ in kept]
        lines.append(np.array(line_numbers))
        ids += [text.strip() for text in columns[places["id"]]]
        for key in blocks:
            blocks[key].append(
                _numbers(
                    key, columns[places[key]], spec, header[1][places[key]], line_numbers, faults
                )
            )
    faults.finish()
    if len(report.diagnostics) > before:
        return None
    return _joined(ids, lines, blocks)


def _joined(ids: list[str], lines: list[Floats], blocks: dict[str, list[Floats]]) -> RawHoles:
    count = len(ids)

    def column(key: str) -> Floats:
        parts = blocks.get(key)
        return np.concatenate(parts) if parts else np.full(count, np.nan)

    return RawHoles(
        ids=np.array(ids, dtype=np.str_) if ids else np.empty(0, dtype="<U1"),
        position_mm=np.stack([column(key) for key in "xyz"], axis=1),
        normal=np.stack([column(key) for key in "ijk"], axis=1),
        diameter_mm=column("diameter"),
        stack_mm=column("stack"),
        line=np.concatenate(lines).astype(np.int32) if lines else np.empty(0, dtype=np.int32),
        column=np.ones(count, dtype=np.int32),
    )


def _rows(spec: TableSpec, source: Source, faults: _Faults) -> Iterator[tuple[int, list[str]]]:
    """(line number, cells) of each non-empty row."""
    reader = csv.reader(io.StringIO(source.text, newline=""), delimiter=spec.delimiter, strict=True)
    line = 1
    try:
        for cells in reader:
            if cells:
                yield line, cells
            line = reader.line_num + 1
    except csv.Error as error:
        faults.add("E312", line, f"this row cannot be read: {error}", "check its quotes")


def _fits(line: int, cells: list[str], width: int, faults: _Faults) -> bool:
    if len(cells) == width:
        return True
    faults.add(
        "E313",
        line,
        f"row {line} has {len(cells)} cells; the header has {width}",
        "check the delimiter, and quote cells that contain it",
    )
    return False


def _places(
    spec: TableSpec, source: Source, header: list[str], report: Report
) -> dict[str, int] | None:
    """Where each mapped column stands in the header."""
    titles = [title.strip() for title in header]
    places: dict[str, int] = {}
    complete = True
    for key, written in spec.columns.items():
        found = [i for i, title in enumerate(titles) if title == written.text]
        if len(found) == 1:
            places[key] = found[0]
            continue
        complete = False
        if found:
            message = f'{source.shown} has {len(found)} columns called "{written.text}"'
            report.error("E314", message, written.span, hint="give each column its own title")
            continue
        near = difflib.get_close_matches(written.text, titles, 1)
        hint = f'did you mean "{near[0]}"?' if near else f"it has {', '.join(titles[:20])}"
        if len(titles) == 1 and not near:
            hint += f'; is "{spec.delimiter}" the delimiter?'
        report.error(
            "E314", f'{source.shown} has no column "{written.text}"', written.span, hint=hint
        )
    return places if complete else None


def _numbers(
    key: str,
    texts: tuple[str, ...],
    spec: TableSpec,
    title: str,
    lines: list[int],
    faults: _Faults,
) -> Floats:
    unit = UNITS["mm"] if key in "ijk" else spec.unit
    cells = numbers(texts, unit, optional=key in {"diameter", "stack"})
    for row, code, what in cells.bad:
        faults.add(code, lines[row], f"row {lines[row]}, column {title}: the {_SAID[key]} {what}")
    return cells.values


_SAID = {
    "x": "position's x",
    "y": "position's y",
    "z": "position's z",
    "i": "normal's x",
    "j": "normal's y",
    "k": "normal's z",
    "diameter": "diameter",
    "stack": "stack thickness",
}

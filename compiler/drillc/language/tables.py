"""CSV hole tables, read in columns. Every bad row or cell is named by file, row and column."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice

import numpy as np

from drillc.language.ast import Text, Word
from drillc.language.columns import numbers
from drillc.language.diagnostics import NAMED_ROWS, Report
from drillc.language.fields import did_you_mean
from drillc.language.job import Floats, Ints
from drillc.language.points import RawHoles, id_column
from drillc.language.source import Source, Span
from drillc.language.units import UNITS, Unit

#: Rows handled at a time: bounds the memory that their texts take.
BLOCK_ROWS = 8192

#: What a table's columns may be mapped to; the first seven must be.
KEYS = ("id", "x", "y", "z", "i", "j", "k", "diameter", "stack")
REQUIRED = KEYS[:7]
#: Those that hold the normal, which a part's surface may give instead.
NORMAL = KEYS[4:7]
#: Those that are lengths, in the table's unit or their own.
LENGTHS = ("x", "y", "z", "diameter", "stack")


@dataclass(frozen=True)
class TableSpec:
    """How to read a table: what `holes NAME from FILE { … }` says."""

    name: Word
    delimiter: str
    unit: Unit
    units: dict[str, Unit]  # of the columns that state one of their own
    columns: dict[str, Word | Text]
    path: Text


@dataclass(frozen=True, eq=False)
class Table:
    """A hole table that was read, and where it was declared."""

    name: Word
    source: Source
    holes: RawHoles

    def span(self, row: int) -> Span:
        """Where a row is written."""
        return self.holes.span(row, self.source)


@dataclass
class _Faults:
    """Bad cells by code, so that a million of them are a handful of messages."""

    report: Report
    source: Source
    delimiter: str
    seen: dict[str, int] = field(default_factory=dict)
    more: dict[str, Span] = field(default_factory=dict)

    def add(
        self, code: str, line: int, message: str, hint: str | None = None, cell: int | None = None
    ) -> None:
        """Report the row that begins at `line`, or its cell number `cell`."""
        count = self.seen[code] = self.seen.get(code, 0) + 1
        if count <= NAMED_ROWS:
            start, end = _row(self.source, line)
            if cell is not None:
                start, end = _cell(self.source.text, start, self.delimiter, cell)
            self.report.error(code, message, self.source.span(start, end), hint=hint)
        elif count == NAMED_ROWS + 1:
            self.more[code] = self.source.span(*_row(self.source, line))

    def finish(self) -> None:
        """Say how many more there are, at the first that was not named."""
        for code, span in self.more.items():
            more = f"and {self.seen[code] - NAMED_ROWS:,} more like this"
            self.report.error(code, more, span)


def read_table(spec: TableSpec, source: Source, report: Report) -> RawHoles | None:
    """Read the mapped columns of a table. Reports all its mistakes; None when there are any."""
    faults = _Faults(report, source, spec.delimiter)
    before = len(report.diagnostics)
    rows = _rows(spec, source, faults)
    header = next(rows, None)
    if header is None:
        report.error(
            "E311",
            f"{source.shown} is empty",
            spec.path.span,
            hint="a table begins with a line of column titles",
        )
        return None
    places = _places(spec, source, header[1], report)
    if places is None:
        return None
    lines: list[Ints] = []
    starts: list[Ints] = []
    ids: list[str] = []
    blocks: dict[str, list[Floats]] = {key: [] for key in places if key != "id"}
    width = len(header[1])
    while block := list(islice(rows, BLOCK_ROWS)):
        kept = [row for row in block if _fits(row[0], row[1], width, faults)]
        if not kept:
            continue
        columns = list(zip(*(cells for _, cells in kept), strict=True))
        line_numbers = [line for line, _ in kept]
        id_lines, id_starts = _id_places(source, columns[: places["id"] + 1], line_numbers, faults)
        lines.append(id_lines)
        starts.append(id_starts)
        ids += [text.strip() for text in columns[places["id"]]]
        for key in blocks:
            place = places[key]
            title = header[1][place].strip()
            found = numbers(
                columns[place],
                UNITS["mm"] if key in "ijk" else spec.units.get(key, spec.unit),
                optional=key in {"diameter", "stack"},
            )
            for row, code, what in found.bad:
                line = line_numbers[row]
                message = f"row {line}, column {title}: the {_SAID[key]} {what}"
                faults.add(code, line, message, _HINTS[code], place)
            blocks[key].append(found.values)
    faults.finish()
    if len(report.diagnostics) > before:
        return None
    return _joined(ids, lines, starts, blocks)


def _joined(
    ids: list[str], lines: list[Ints], starts: list[Ints], blocks: dict[str, list[Floats]]
) -> RawHoles:
    count = len(ids)
    none = np.empty(0, dtype=np.int32)

    def column(key: str) -> Floats:
        parts = blocks.get(key)
        return np.concatenate(parts) if parts else np.full(count, np.nan)

    return RawHoles(
        ids=id_column(ids) if ids else np.empty(0, dtype="<U1"),
        position_mm=np.stack([column(key) for key in "xyz"], axis=1),
        normal=np.stack([column(key) for key in "ijk"], axis=1),
        diameter_mm=column("diameter"),
        stack_mm=column("stack"),
        line=np.concatenate([none, *lines]),
        column=np.concatenate([none, *starts]),
    )


def _rows(spec: TableSpec, source: Source, faults: _Faults) -> Iterator[tuple[int, list[str]]]:
    """(line number, cells) of each row that is not blank."""
    reader = csv.reader(io.StringIO(source.text, newline=""), delimiter=spec.delimiter, strict=True)
    line = 1
    try:
        for cells in reader:
            if any(map(str.strip, cells)):
                yield line, cells
            line = reader.line_num + 1
    except csv.Error as error:
        faults.add("E312", line, f"this row cannot be read: {error}", "check its quotes")


def _fits(line: int, cells: list[str], width: int, faults: _Faults) -> bool:
    if len(cells) == width:
        return True
    hint = "check the delimiter, and quote cells that contain it"
    if len(cells) > width and faults.delimiter == ",":
        hint += "; or are these decimal commas?"
    were = "1 cell" if len(cells) == 1 else f"{len(cells)} cells"
    faults.add("E313", line, f"row {line} has {were}; the header has {width}", hint)
    return False


def _places(
    spec: TableSpec, source: Source, header: list[str], report: Report
) -> dict[str, int] | None:
    """Where each mapped column stands in the header."""
    titles = [title.strip() for title in header]
    if len(titles) == 1:
        found = [other for other in ",;\t|" if other in titles[0]]
        delimiter = "\\t" if found == ["\t"] else "".join(found[:1]) or "…"
        report.error(
            "E314",
            f'{source.shown} has but one column, "{titles[0][:60]}"',
            spec.path.span,
            hint=f'say what separates its cells: delimiter "{delimiter}"',
        )
        return None
    places: dict[str, int] = {}
    complete = True
    for key, written in spec.columns.items():
        same = [i for i, title in enumerate(titles) if title == written.text]
        if len(same) == 1:
            places[key] = same[0]
            continue
        complete = False
        if same:
            message = f'{source.shown} has {len(same)} columns called "{written.text}"'
            report.error("E314", message, written.span, hint="give each column its own title")
            continue
        hint = did_you_mean(written.text, titles)
        message = f'{source.shown} has no column "{written.text}"'
        report.error("E314", message, written.span, hint=hint)
    return places if complete else None


_HINTS = {
    "E315": "a cell is a number alone, such as -12.5; its unit is said once, by units",
    "E316": "export the table with decimal points",
    "E317": "mend the formula in the spreadsheet",
    "E318": "give it a value, or leave the row out of the file",
}
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


# ── where a row and its cells stand in the file ──────────────────────────────────────────────────


def _row(source: Source, line: int) -> tuple[int, int]:
    """The offsets at which the line `line` begins and ends."""
    start = source.line_starts()[line - 1]
    return start, start + max(1, len(source.line_text(line)))


def _cell(text: str, start: int, delimiter: str, cell: int) -> tuple[int, int]:
    """The offsets of a cell's content, without blanks and quotes, in the row that begins at
    `start`. A quoted cell may contain the delimiter, line breaks and doubled quotes."""
    for number in range(cell + 1):
        end = start
        if text[start : start + 1] == '"':
            end = text.index('"', start + 1)
            while text[end + 1 : end + 2] == '"':
                end = text.index('"', end + 2)
            start += 1
        else:
            stops = (text.find(delimiter, start), text.find("\n", start), len(text))
            end = min(stop for stop in stops if stop >= 0)
        if number < cell:
            start = text.index(delimiter, end) + 1
    blank = len(text[start:end]) - len(text[start:end].lstrip())
    return start + blank, max(start + blank, start + len(text[start:end].rstrip()))


def _id_places(
    source: Source, before: Sequence[tuple[str, ...]], rows: list[int], faults: _Faults
) -> tuple[Ints, Ints]:
    """Line and column of the file at which each row's id stands. `before`: the columns up to the
    id's; `rows`: the lines at which the rows begin.

    Without a quote in the file the cells' lengths tell; else each row is looked at.
    """
    if '"' in source.text:
        starts, text, last = source.line_starts(), source.text, len(before) - 1
        places = []
        for row in rows:
            at, _ = _cell(text, starts[row - 1], faults.delimiter, last)
            line = row + text.count("\n", starts[row - 1], at)
            places.append((line, at - starts[line - 1] + 1))
        lines, columns = np.array(places, dtype=np.int32).T
        return lines, columns
    column = np.full(len(rows), len(before), dtype=np.int32)
    for cells in before[:-1]:
        column += np.fromiter(map(len, cells), np.int32, len(rows))
    blanks = (len(cell) - len(cell.lstrip()) for cell in before[-1])
    column += np.fromiter(blanks, np.int32, len(rows))
    return np.array(rows, dtype=np.int32), column

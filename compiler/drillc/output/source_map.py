"""The source map: for every emitted line, what it is about, and where that is written.

Three tables in a folder of their own, described in docs/source-maps.md. Holes come in runs of equal
blocks of lines, so a run is one row, however many holes it has: the lines follow from what each
block of text does to them when it is poured, and no hole is looked at. The holes themselves, their
ids and places, are a table that all files share.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np

from drillc.language.diagnostics import printable
from drillc.language.job import HoleTable, Named
from drillc.language.source import Source, Span
from drillc.output.emission import OutFile
from drillc.output.marks import Mark
from drillc.output.pouring import CHUNK_CHARACTERS, Body, Breaks, Rows, StagedText
from drillc.planning.program import Cycle, Program, Section

#: The folder in the output folder. No post can have this name.
FOLDER = "source-map"
LINES = f"{FOLDER}/lines.csv"
HOLES = f"{FOLDER}/holes.csv"
REGIONS = f"{FOLDER}/regions.csv"

LINES_HEAD = ("file", "first", "last", "what", "name", "spec", "line", "row", "each")
HOLES_HEAD = ("id", "spec", "line")
REGIONS_HEAD = (
    *("first_row", "last_row", "region", "spec", "line"),
    *("process", "process_spec", "process_line"),
)
#: The line of holes.csv on which the first hole stands.
FIRST_ROW = 2

#: Holes that are written at once.
_BLOCK = 8192


def source_map(files: Sequence[OutFile], statement: Named) -> list[OutFile]:
    """The map of `files` as more files. `statement` names the program in the spec. Read last, it
    costs least: what pouring did to the lines has then been noted."""
    programs = {id(file.program): file.program for file in files if file.program is not None}
    first_rows, row = {}, FIRST_ROW
    for key, program in programs.items():
        first_rows[key] = row
        row += len(program.holes)
    mapped = [(file, first_rows.get(id(file.program), 0)) for file in files]
    starts = [(program, first_rows[key]) for key, program in programs.items()]
    return [
        OutFile(LINES, _Table(LINES_HEAD, lambda: _lines(mapped, statement))),
        OutFile(HOLES, _Table(HOLES_HEAD, lambda: _holes(programs.values()))),
        OutFile(REGIONS, _Table(REGIONS_HEAD, lambda: _regions(starts))),
    ]


@dataclass(frozen=True, eq=False)
class _Table:
    """A CSV as chunks of UTF-8. `blocks` makes its rows, some at a time."""

    head: tuple[str, ...]
    blocks: Callable[[], Iterator[Iterable[tuple[object, ...]]]]

    def __iter__(self) -> Iterator[bytes]:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        for rows in chain([[self.head]], self.blocks()):
            writer.writerows(rows)
            if text.tell() >= CHUNK_CHARACTERS:
                yield text.getvalue().encode("utf-8", "surrogateescape")
                text.seek(0)
                text.truncate()
        yield text.getvalue().encode("utf-8", "surrogateescape")


def _place(span: Span | None) -> tuple[str, object]:
    return ("", "") if span is None else (_key(span.source), span.line)


def _key(source: Source) -> str:
    """As in the manifest, on one line."""
    return printable(source.key)


# ── holes and regions ────────────────────────────────────────────────────────────────────────────


def _holes(programs: Iterable[Program]) -> Iterator[Iterable[tuple[object, ...]]]:
    for program in programs:
        holes = program.holes
        keys = np.array([_key(source) for source in holes.sources], dtype=object)
        for start in range(0, len(holes), _BLOCK):
            rows = slice(start, start + _BLOCK)
            columns = holes.ids[rows], keys[holes.source[rows]], holes.line[rows]
            yield zip(*(column.tolist() for column in columns), strict=True)


def _regions(programs: Iterable[tuple[Program, int]]) -> Iterator[Iterable[tuple[object, ...]]]:
    for program, first_row in programs:
        for section in program.sections:
            if section.stop > section.start:
                process = program.cycles[section.cycle].process
                yield [
                    (
                        *(first_row + section.start, first_row + section.stop - 1),
                        *(section.region, *_place(section.span)),
                        *(process.name, *_place(process.span)),
                    )
                ]


# ── lines ────────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Run:
    """`lines` lines in a row whose first characters stand in one part of a text: in text about
    `subject` (None: the program), or in the rows of a body, `each` lines a row."""

    lines: int
    subject: object
    rows: Rows | None = None
    each: int = 0

    def joined(self, after: Run) -> Run | None:
        """Both as one, if they are of one kind."""
        if self.rows is None or after.rows is None:
            same = self.rows is after.rows is None and self.subject is after.subject
            return replace(self, lines=self.lines + after.lines) if same else None
        if (self.rows.stop, self.each) != (after.rows.start, after.each):
            return None
        if self.rows.table != after.rows.table:
            return None
        rows = replace(self.rows, stop=after.rows.stop)
        return replace(self, lines=self.lines + after.lines, rows=rows)


def runs(text: StagedText) -> Iterator[Run]:
    """All lines of a text, in order. A line belongs to the part in which it begins."""
    last: Run | None = None
    for run in _runs(text):
        if last is not None and (both := last.joined(run)) is not None:
            last = both
            continue
        if last is not None:
            yield last
        last = run
    if last is not None:
        yield last


def _runs(text: StagedText) -> Iterator[Run]:
    about: list[object] = []
    fresh = True  # whether the next character begins a line
    for index, part in enumerate(text.parts):
        if isinstance(part, Mark):
            _turn(about, part)
        elif isinstance(part, Body):
            for rows, breaks in text.breaks(index):
                if breaks is None:
                    begun, fresh = _even(part, rows, fresh)
                else:
                    begun, fresh = _uneven(rows, breaks, fresh)
                yield from begun
        else:
            ends = part.endswith("\n")
            lines = fresh + part.count("\n") - ends
            fresh = ends
            if lines:
                yield Run(lines, about[-1] if about else None)


def _turn(about: list[object], mark: Mark) -> None:
    """Begin or end what the text is about. A template can print what it captured anywhere, so an
    end may come without its beginning."""
    if mark.begins:
        about.append(mark.subject)
    elif mark.subject in about:
        while about.pop() is not mark.subject:
            pass


def _even(body: Body, rows: Rows, fresh: bool) -> tuple[list[Run], bool]:
    """Rows that all break lines alike."""
    ends = body.format.endswith("\n")
    each = body.format.count("\n") + (not ends)  # of a row that begins a line
    first, rest = replace(rows, stop=rows.start + 1), replace(rows, start=rows.start + 1)
    counts = each - (not fresh), each - (not ends)
    begun = [
        Run(count * len(some), None, some, count)
        for some, count in zip((first, rest), counts, strict=True)
    ]
    return [run for run in begun if run.lines], ends


def _uneven(rows: Rows, breaks: Breaks, fresh: bool) -> tuple[list[Run], bool]:
    """Rows whose cells hold line breaks of their own."""
    begun = []
    for row, (count, ends) in enumerate(breaks.tolist() if breaks is not None else (), rows.start):
        if ends < 0:
            continue
        lines = fresh + count - ends
        fresh = bool(ends)
        if lines:
            begun.append(Run(lines, None, replace(rows, start=row, stop=row + 1), lines))
    return begun, fresh


def _lines(
    files: Iterable[tuple[OutFile, int]], statement: Named
) -> Iterator[Iterable[tuple[object, ...]]]:
    of_program = "program", statement.text, *_place(statement.span), "", ""
    for file, first_row in files:
        if file.staged is None or file.program is None:
            yield [(file.path, 1, _line_count(file.chunks), *of_program)]
            continue
        line = 1
        for run in runs(file.staged):
            said = _said(run, file.program, first_row)
            yield [
                (file.path, line + first, line + last, *(what or of_program))
                for first, last, what in said
            ]
            line += run.lines


def _said(
    run: Run, program: Program, first_row: int
) -> Iterator[tuple[int, int, tuple[object, ...] | None]]:
    """The rows of a run: its first and last line, counted from where it begins, and the columns
    from `what` on; None for the program."""
    if run.rows is None:
        yield 0, run.lines - 1, _statement(run.subject)
    elif run.rows.table == "hole":
        hole = run.rows.start
        yield 0, run.lines - 1, ("hole", *_hole(program.holes, hole), first_row + hole, run.each)
    elif program.arm is not None:
        before = program.arm.vias.before[run.rows.start : run.rows.stop]
        edges = [0, *(np.flatnonzero(np.diff(before)) + 1).tolist(), len(before)]
        for start, stop in pairwise(edges):
            hole = int(before[start])
            there = hole < len(program.holes)
            what = ("via", *_hole(program.holes, hole), first_row + hole, "") if there else None
            yield run.each * start, run.each * stop - 1, what


def _statement(subject: object) -> tuple[object, ...] | None:
    if isinstance(subject, Section):
        return "region", subject.region, *_place(subject.span), "", ""
    if isinstance(subject, Cycle) and subject.process.span is not None:
        return "process", subject.process.name, *_place(subject.process.span), "", ""
    return None


def _hole(holes: HoleTable, row: int) -> tuple[object, ...]:
    return str(holes.ids[row]), _key(holes.sources[holes.source[row]]), int(holes.line[row])


def _line_count(chunks: Iterable[bytes]) -> int:
    count, last = 0, b""
    for chunk in chunks:
        count, last = count + chunk.count(b"\n"), chunk or last
    return count + (last[-1:] not in (b"\n", b""))

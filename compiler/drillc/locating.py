"""`drillc locate`: from a line of an emitted file to the spec, and from the spec to such lines.

Reads the source map in an output folder (docs/source-maps.md); no spec is compiled for it.
"""

from __future__ import annotations

import csv
import hashlib
import json
import os
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TextIO

from drillc.language.diagnostics import printable
from drillc.output.source_map import FIRST_ROW, HOLES, LINES, REGIONS
from drillc.output.writing import MANIFEST

#: Where output folders are looked for when none is named: `drillc compile` writes there.
OUT = Path("out")


class NotLocated(Exception):  # noqa: N818  (a wrong question, no error of the program)
    """There is no such file, or no output folder to look in."""


@dataclass(frozen=True)
class Statement:
    """A place in a spec or a table: what is written there, in which file (as the manifest names
    it, below the spec's root) and line. A process that nobody states has no place."""

    what: str
    name: str
    spec: str | None
    line: int | None


@dataclass(frozen=True)
class Emitted:
    """Lines `first` … `last` of an emitted file, and what they are about: "hole", "via" (the way to
    a hole), "region", "process" or "program". Holes and vias have a region and a process, too."""

    file: str
    first: int
    last: int
    about: Statement
    region: Statement | None = None
    process: Statement | None = None


@dataclass(frozen=True)
class Answer:
    """What was found, file by file and line by line, and what makes it doubtful."""

    found: tuple[Emitted, ...]
    notes: tuple[str, ...]


def locate(question: str, out: Path | None) -> Answer:
    """Answer FILE:LINE, of an emitted file or of a spec or table, or a hole's id. What is not an
    emitted file is looked up in the map of `out`, or of every folder below out/. Raises
    `NotLocated`."""
    path, line = _split(question)
    if line is not None and path.is_file() and (maps := _home(path)) is not None:
        return _of_emitted(maps, path, line)
    folders = _folders(out)
    if line is not None:
        answers = [_of_input(one, key, path, line) for one in folders for key in one.input(path)]
        if answers:
            return _together(answers)
    found = [each for one in folders for each in one.emitted(one.holes(id_=question))]
    if line is not None and not found:
        shown = ", ".join(str(each.folder) for each in folders)
        raise NotLocated(
            f"{path} was neither written to {shown} nor read for it; name the output folder with -o"
            if path.is_file()
            else f"there is no file {path}"
        )
    return Answer(tuple(found), ())


def write_answer(answer: Answer, as_json: bool, stream: TextIO) -> None:
    """Print it: as JSON, or a line for each stretch of lines."""
    if as_json:
        found = [asdict(each) for each in answer.found]
        print(json.dumps({"found": found, "notes": answer.notes}, indent=2), file=stream)
        return
    for each in answer.found:
        lines = f"{each.first}" if each.first == each.last else f"{each.first}-{each.last}"
        parts = [_said(each.about), *(_said(s) for s in (each.region, each.process) if s)]
        print(printable(f"{each.file}:{lines}: {', '.join(parts)}"), file=stream)


def _said(statement: Statement) -> str:
    name = "the way to hole" if statement.what == "via" else statement.what
    place = f" ({statement.spec}:{statement.line})" if statement.spec else ""
    return f"{name} {statement.name}{place}"


# ── questions ────────────────────────────────────────────────────────────────────────────────────


def _split(question: str) -> tuple[Path, int | None]:
    file, colon, number = question.rpartition(":")
    if file and colon and number.isascii() and number.isdecimal() and len(number) < 12:
        return Path(file), int(number)
    return Path(question), None


def _home(path: Path) -> SourceMap | None:
    """The map of the output folder to which a file belongs, if drillc wrote it there."""
    real = path.resolve()
    for folder in real.parents:
        if (folder / MANIFEST).is_file():
            depth = len(real.relative_to(folder).parts)
            typed = path.parents[depth - 1] if depth <= len(path.parents) else folder
            found = SourceMap.of(typed if typed.resolve() == folder else folder)
            if found is not None and real.relative_to(folder).as_posix() in found.outputs:
                return found
    return None


def _folders(out: Path | None) -> list[SourceMap]:
    if out is not None:
        found = SourceMap.of(out)
        if found is None:
            raise NotLocated(f"{out} is no output folder of drillc with a source map")
        return [found]
    below = sorted(OUT.iterdir()) if OUT.is_dir() else []
    maps = [found for folder in below if (found := SourceMap.of(folder)) is not None]
    if not maps:
        raise NotLocated(f"there is no output folder below {OUT}; name one with -o")
    return maps


def _of_emitted(maps: SourceMap, path: Path, line: int) -> Answer:
    file = path.resolve().relative_to(maps.folder.resolve()).as_posix()
    notes = []
    if _sha256(path) != maps.outputs[file]:
        notes.append(f"{path} was changed after drillc wrote it: its lines may have moved")
    for row in maps.lines(file):
        if row.first <= line <= row.last:
            return Answer((maps.at(row, line),), tuple(notes))
    return Answer((), tuple(notes))


def _of_input(maps: SourceMap, key: str, path: Path, line: int) -> Answer:
    notes = []
    if path.is_file() and _sha256(path) != maps.inputs[key]:
        notes.append(
            f"{path} was changed after {maps.folder} was written from it: its lines may have moved"
        )
    holes = maps.holes(spec=printable(key), line=line)
    return Answer(tuple(_joined(maps.emitted(holes, printable(key), line))), tuple(notes))


def _together(answers: Sequence[Answer]) -> Answer:
    return Answer(
        tuple(each for answer in answers for each in answer.found),
        tuple(dict.fromkeys(note for answer in answers for note in answer.notes)),
    )


def _sha256(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


# ── the map ──────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Lines:
    """A row of lines.csv. `row` is a line of holes.csv (0: none); `each`, how many lines each of
    the holes from there on has (0: the row is about one hole only)."""

    file: str
    first: int
    last: int
    about: Statement
    row: int
    each: int


@dataclass(frozen=True)
class Regions:
    """A row of regions.csv: holes on the lines `first` … `last` of holes.csv."""

    first: int
    last: int
    region: Statement
    process: Statement


@dataclass(frozen=True)
class SourceMap:
    """The map in `folder`; hashes by file, as in the manifest."""

    folder: Path
    inputs: dict[str, str]
    outputs: dict[str, str]
    regions: tuple[Regions, ...]

    @staticmethod
    def of(folder: Path) -> SourceMap | None:
        """None where there is no map of ours. Raises `NotLocated` for one that was changed: what
        is read here is as drillc wrote it."""
        try:
            manifest = json.loads((folder / MANIFEST).read_bytes())
        except (OSError, ValueError, RecursionError):
            return None
        if not isinstance(manifest, dict) or "drillc" not in manifest:
            return None
        tables = [manifest.get("inputs"), manifest.get("outputs")]
        inputs, outputs = ({**t} if isinstance(t, dict) else {} for t in tables)
        if not all(name in outputs for name in (LINES, HOLES, REGIONS)):
            return None
        for name in (LINES, HOLES, REGIONS):
            if not (folder / name).is_file() or _sha256(folder / name) != outputs[name]:
                raise NotLocated(f"{folder / name} is not as drillc wrote it; compile again")
        return SourceMap(folder, inputs, outputs, tuple(_regions(folder)))

    def input(self, path: Path) -> list[str]:
        """The input that a path means: none, or the longest that the path ends with; rather one
        whose content is the same."""
        parts = Path(os.path.abspath(path)).parts
        keys = [key for key in self.inputs if parts[-len(ends := Path(key).parts) :] == ends]
        if path.is_file() and keys:
            digest = _sha256(path)
            keys = [key for key in keys if self.inputs[key] == digest] or keys
        return [max(keys, key=len)] if keys else []

    def lines(self, file: str | None = None) -> Iterator[Lines]:
        """All rows of lines.csv, or those of one emitted file."""
        for row in _rows(self.folder / LINES):
            if file is None or row[0] == file:
                about = Statement(row[3], row[4], row[5] or None, _number(row[6]) or None)
                first, last, at, each = map(_number, (row[1], row[2], row[7], row[8]))
                yield Lines(row[0], first, last, about, at, each)

    def hole(self, row: int) -> Statement:
        """The hole on a line of holes.csv."""
        with _open(self.folder / HOLES) as file:
            [cells] = csv.reader(islice(file, row - 1, row))
        return Statement("hole", cells[0], cells[1], _number(cells[2]))

    def holes(self, id_: str = "", spec: str = "", line: int = 0) -> dict[int, Statement]:
        """The holes of an id, or those written at a place, by their lines of holes.csv."""
        found = {}
        ends = f",{line}\n"
        with _open(self.folder / HOLES) as file:
            for number, text in enumerate(islice(file, FIRST_ROW - 1, None), FIRST_ROW):
                # Most of the millions of lines are not even taken apart.
                if id_ in text if id_ else text.endswith(ends):
                    [(name, where, place)] = csv.reader([text])
                    if name == id_ or (where, _number(place)) == (spec, line):
                        found[number] = Statement("hole", name, where, _number(place))
        return found

    def at(self, lines: Lines, line: int) -> Emitted:
        """What an emitted line is about: of a run of holes, its own hole's lines."""
        if not lines.each:
            return self._emitted(lines, lines.first, lines.last, lines.about, lines.row)
        place = (line - lines.first) // lines.each
        first, row = lines.first + place * lines.each, lines.row + place
        return self._emitted(lines, first, first + lines.each - 1, self.hole(row), row)

    def emitted(
        self, holes: dict[int, Statement], spec: str = "", line: int = 0
    ) -> Iterator[Emitted]:
        """The lines about `holes` and the ways to them, and about what is stated at a place: of a
        region, those about its holes too."""
        regions = [r for r in self.regions if (r.region.spec, r.region.line) == (spec, line)]
        for lines in self.lines():
            if (lines.about.spec, lines.about.line) == (spec, line) and not lines.row:
                yield self._emitted(lines, lines.first, lines.last, lines.about)
            for region in regions:
                if part := _overlap(lines, region.first, region.last):
                    yield self._emitted(lines, *part, region.region)
            for row, hole in holes.items():
                if part := _overlap(lines, row, row):
                    about = hole if lines.each else lines.about
                    yield self._emitted(lines, *part, about, row)

    def _emitted(
        self, lines: Lines, first: int, last: int, about: Statement, row: int = 0
    ) -> Emitted:
        file = (self.folder / lines.file).as_posix()
        of = next((each for each in self.regions if each.first <= row <= each.last), None)
        region, process = (of.region, of.process) if of is not None else (None, None)
        return Emitted(file, first, last, about, region, process)


def _overlap(lines: Lines, first_row: int, last_row: int) -> tuple[int, int] | None:
    """Which of the lines are about the holes of these rows, from the first to the last."""
    if not lines.row:
        return None
    if not lines.each:
        return (lines.first, lines.last) if first_row <= lines.row <= last_row else None
    count = (lines.last - lines.first + 1) // lines.each
    start = max(first_row - lines.row, 0)
    stop = min(last_row + 1 - lines.row, count)
    if start >= stop:
        return None
    return lines.first + start * lines.each, lines.first + stop * lines.each - 1


def _regions(folder: Path) -> Iterator[Regions]:
    for row in _rows(folder / REGIONS):
        region, process = (
            Statement(what, name, spec or None, _number(line) or None)
            for what, (name, spec, line) in (("region", row[2:5]), ("process", row[5:8]))
        )
        yield Regions(_number(row[0]), _number(row[1]), region, process)


def _rows(table: Path) -> Iterator[list[str]]:
    with _open(table) as file:
        yield from islice(csv.reader(file), 1, None)


def _open(table: Path) -> TextIO:
    return table.open(encoding="utf-8", errors="surrogateescape", newline="")


def _number(text: str) -> int:
    """0 where there is none."""
    return int(text) if text else 0


def _joined(found: Iterable[Emitted]) -> Iterator[Emitted]:
    """Stretches that follow each other and are about the same, as one."""
    last: Emitted | None = None
    for each in found:
        if last is not None and each == replace(last, first=last.last + 1, last=each.last):
            last = replace(last, last=each.last)
            continue
        if last is not None:
            yield last
        last = each
    if last is not None:
        yield last

"""Reading a spec and the files that it uses, inside one folder tree and inside bounds.

A path in a spec is relative to the file that holds it, and must stay inside the root (the spec's
folder, or `--root`) after every link is followed.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath, PureWindowsPath

from drillc.language.ast import SpecFile, Statement, Text
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import of_type
from drillc.language.parser import parse
from drillc.language.source import Source, Span

#: Bytes of a spec or cell file.
MAX_SPEC_BYTES = 512 * 1024 * 1024
#: Bytes of a CSV table.
MAX_TABLE_BYTES = 4 * 1024 * 1024 * 1024
#: How deep `use` may nest.
MAX_USE_DEPTH = 16

#: What a cell file, brought in by `use`, may declare.
CELL_STATEMENTS = frozenset({"version", "use", "tool", "robot", "fixture", "io", "process"})


@dataclass
class Loader:
    """Reads files for one compile and remembers them, in reading order."""

    root: Path
    report: Report
    inputs: list[Source] = field(default_factory=list)

    def read(self, path: Path, limit: int, span: Span | None) -> Source | None:
        """Read one text file; None after reporting why it cannot be read."""
        shown = Path(os.path.normpath(path)).as_posix()
        try:
            size = path.stat().st_size
            if not path.is_file():
                self.report.error("E121", f"{shown} is not a file", span)
                return None
            if size > limit:
                self.report.error(
                    "E122", f"{shown} has {size:,} bytes; the limit is {limit:,}", span
                )
                return None
            raw = path.read_bytes()
        except FileNotFoundError:
            self.report.error("E120", f"there is no file {shown}", span)
            return None
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "its name is not usable"
            self.report.error("E121", f"{shown} cannot be read: {reason}", span)
            return None
        source = self._decoded(raw, path, shown, span)
        if source is not None:
            self.inputs.append(source)
        return source

    def _decoded(self, raw: bytes, path: Path, shown: str, span: Span | None) -> Source | None:
        try:
            # utf-8-sig drops the byte-order mark that spreadsheets write.
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            line = raw.count(b"\n", 0, error.start) + 1
            byte = raw[error.start]
            self.report.error(
                "E123",
                f"{shown} is not UTF-8: byte 0x{byte:02X} at line {line}",
                span,
                hint="save it as UTF-8 (a spreadsheet calls it “CSV UTF-8”)",
            )
            return None
        if "\0" in text:
            line = text.count("\n", 0, text.index("\0")) + 1
            self.report.error(
                "E123", f"{shown} is not a text file: it has a zero byte at line {line}", span
            )
            return None
        real = path.resolve()
        # Only the spec itself, named by the user and not by a file, can lie outside the root.
        inside = real.is_relative_to(self.root)
        key = real.relative_to(self.root).as_posix() if inside else path.name
        lines = text.replace("\r\n", "\n").replace("\r", "\n")
        return Source(path, shown, lines, key, hashlib.sha256(raw).hexdigest())

    def resolve(self, written: Text, holder: Source) -> Path | None:
        """The path that `written` means in the file `holder`, checked to stay inside the root."""
        name = written.text
        windows = PureWindowsPath(name)
        if not name.strip() or not name.isprintable():
            self.report.error(
                "E124", "this path is empty or has unprintable characters", written.span
            )
            return None
        if (
            PurePosixPath(name).is_absolute()
            or windows.is_absolute()
            or windows.drive
            or "\\" in name
        ):
            self.report.error(
                "E124",
                f'"{name}" is not a relative path with forward slashes',
                written.span,
                hint="write it relative to this file, and put the file inside the spec's folder",
            )
            return None
        path = holder.path.parent / name
        try:
            real = path.resolve()
        except (OSError, RuntimeError):
            self.report.error("E121", f'"{name}" leads into a loop of links', written.span)
            return None
        if not real.is_relative_to(self.root):
            through = " through a link" if ".." not in PurePosixPath(name).parts else ""
            self.report.error(
                "E125",
                f'"{name}" leads{through} out of the spec\'s folder',
                written.span,
                hint="widen what may be read with --root",
            )
            return None
        return path


@dataclass
class Loaded:
    """The statements of a spec and of everything that it uses, in order of use."""

    spec: SpecFile
    statements: list[Statement]


def load(path: Path, root: Path | None, report: Report) -> tuple[Loader, Loaded | None]:
    """Read and parse the spec at `path` and its cell files. All syntax errors are reported."""
    loader = Loader((root or path.parent).resolve(), report)
    source = loader.read(path, MAX_SPEC_BYTES, None)
    spec = parse(source, report) if source else None
    if spec is None:
        return loader, None
    statements: list[Statement] = []
    _check_version(spec, report)
    _collect(spec, loader, statements, [(path.resolve(), None)], set(), report)
    return loader, Loaded(spec, statements)


def _collect(
    file: SpecFile,
    loader: Loader,
    into: list[Statement],
    trail: list[tuple[Path, Span | None]],
    done: set[Path],
    report: Report,
) -> None:
    for statement in file.statements:
        if statement.kind == "version":
            continue
        if statement.kind != "use":
            into.append(statement)
            continue
        written = of_type(statement.values[0], Text)
        path = loader.resolve(written, file.source)
        real = path.resolve() if path else None
        if path is None or real is None or real in done:
            continue
        cycle = [span for seen, span in trail if seen == real]
        if cycle:
            report.error(
                "E126",
                f'"{written.text}" uses itself',
                written.span,
                labels=[Label(span, "on the way here") for _, span in trail if span],
            )
            continue
        if len(trail) > MAX_USE_DEPTH:
            report.error(
                "E127",
                f"`use` is nested {len(trail)} deep; the limit (MAX_USE_DEPTH) is {MAX_USE_DEPTH}",
                written.span,
            )
            continue
        source = loader.read(path, MAX_SPEC_BYTES, written.span)
        cell = parse(source, report) if source else None
        if cell is None:
            continue
        _check_version(cell, report)
        _check_cell(cell, report)
        _collect(cell, loader, into, [*trail, (real, written.span)], done, report)
        done.add(real)


def _check_version(file: SpecFile, report: Report) -> None:
    version = file.statements[0]
    value = version.values[0]
    number = getattr(value, "number", "")
    if number != "1":
        report.error(
            "E104",
            f"this is a spec of language version {number}; this drillc knows version 1",
            version.span,
            hint="begin the file with: drill 1",
        )


def _check_cell(file: SpecFile, report: Report) -> None:
    for statement in file.statements:
        if statement.kind not in CELL_STATEMENTS:
            report.error(
                "E128",
                f'"{statement.kind}" does not belong in a file that others use',
                statement.name.span,
                hint="a cell file declares tools, robots, fixtures, signals and processes",
            )

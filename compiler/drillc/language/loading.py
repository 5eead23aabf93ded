"""Reading a spec and the files that it uses, inside one folder tree and inside bounds.

A path in a spec is relative to the file that holds it, and must stay inside the root (the spec's
folder, or `--root`) after every link is followed.
"""

from __future__ import annotations

import difflib
import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath, PureWindowsPath

from drillc.language.ast import SpecFile, Statement, Text
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import of_type
from drillc.language.parser import parse
from drillc.language.source import Source, Span


@dataclass(frozen=True)
class Limit:
    """How many bytes a kind of file may have, and what a message calls that limit."""

    name: str
    size: int


#: A spec or cell file.
SPEC_LIMIT = Limit("MAX_SPEC_BYTES", 512 * 1024 * 1024)
#: A CSV table.
TABLE_LIMIT = Limit("MAX_TABLE_BYTES", 4 * 1024 * 1024 * 1024)
#: A mesh.
MESH_LIMIT = Limit("MAX_MESH_BYTES", 256 * 1024 * 1024)
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

    def read(
        self, path: Path, limit: Limit, span: Span | None, instead: Path | None = None
    ) -> Source | None:
        """Read one text file; None after reporting why it cannot be read. With `instead`, that
        file's text is read, as if it stood at `path`."""
        raw = self._bytes(instead or path, limit, span)
        text = None if raw is None else self._decoded(raw, path, span)
        return None if raw is None or text is None else self._remembered(path, raw, _unix(text))

    def read_binary(self, path: Path, limit: Limit, span: Span) -> bytes | None:
        """Read one file that is no text; None after reporting why it cannot be read."""
        raw = self._bytes(path, limit, span)
        if raw is not None:
            self._remembered(path, raw, "")
        return raw

    def _bytes(self, path: Path, limit: Limit, span: Span | None) -> bytes | None:
        shown = _shown(path)
        try:
            size = path.stat().st_size
            if not path.is_file():
                what = "a folder" if path.is_dir() else "no regular file"
                self.report.error("E121", f"{shown} is {what}", span, hint="name a file")
                return None
            if size > limit.size:
                self.report.error(
                    "E122",
                    f"{shown} has {size:,} bytes; the limit ({limit.name}) is {limit.size:,}",
                    span,
                )
                return None
            return path.read_bytes()
        except FileNotFoundError:
            self.report.error("E120", f"there is no file {shown}", span, hint=_near_file(path))
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or "its name is not usable"
            self.report.error("E121", f"{shown} cannot be read: {reason}", span)
        return None

    def _remembered(self, path: Path, raw: bytes, text: str) -> Source:
        real = path.resolve()
        # Only the spec itself, named by the user and not by a file, can lie outside the root.
        inside = real.is_relative_to(self.root)
        key = real.relative_to(self.root).as_posix() if inside else path.name
        source = Source(path, _shown(path), text, key, hashlib.sha256(raw).hexdigest())
        self.inputs.append(source)
        return source

    def _decoded(self, raw: bytes, path: Path, span: Span | None) -> str | None:
        try:
            # utf-8-sig drops the byte-order mark that spreadsheets write.
            text = raw.decode("utf-8-sig")
        except UnicodeDecodeError as error:
            before = bytes(error.object[: error.start])
            hint = "save it as UTF-8 (a spreadsheet calls it “CSV UTF-8”)"
            if raw[:2] in (b"\xff\xfe", b"\xfe\xff"):
                hint = "it is UTF-16; " + hint
            fault = f"byte 0x{error.object[error.start]:02X} is not UTF-8"
            self._report_bytes(raw, len(before.decode()), path, fault, hint, span)
            return None
        if "\0" in text:
            self._report_bytes(
                raw, text.index("\0"), path, "a zero byte: this is no text file", None, span
            )
            return None
        return text

    def _report_bytes(
        self,
        raw: bytes,
        at: int,
        path: Path,
        fault: str,
        hint: str | None,
        named: Span | None,
    ) -> None:
        """Point at character `at` of a file that is no text, and at the place that names it."""
        text = raw.decode("utf-8-sig", errors="replace")
        at -= text.count("\r\n", 0, at)
        self.report.error(
            "E123",
            fault,
            Source(path, _shown(path), _unix(text)).span(at, at + 1),
            labels=[Label(named, "read because of this")] if named else [],
            hint=hint,
        )

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
                hint="put it inside; or widen what may be read: --root DIR",
            )
            return None
        return path


@dataclass
class Loaded:
    """The statements of a spec and of everything that it uses, in order of use."""

    spec: SpecFile
    statements: list[Statement]


def load(
    path: Path, root: Path | None, report: Report, instead: Path | None = None
) -> tuple[Loader, Loaded | None]:
    """Read and parse the spec at `path` and its cell files. All syntax errors are reported.

    `instead` holds another version of the spec, whose paths still go from `path`.
    """
    # realpath, since resolve() raises on a loop of links; reading then says what is wrong.
    loader = Loader(Path(os.path.realpath(root or path.parent)), report)
    if root is not None and not root.is_dir():
        report.error("E121", f"the root {root} is not a folder", hint="--root DIR: a folder")
        return loader, None
    source = loader.read(path, SPEC_LIMIT, None, instead)
    spec = parse(source, report) if source else None
    if spec is None:
        return loader, None
    statements: list[Statement] = []
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
        if path is None:
            continue
        real = path.resolve()
        if any(seen == real for seen, _ in trail):
            report.error(
                "E126",
                f'"{written.text}" uses itself',
                written.span,
                labels=[Label(span, "by way of this") for _, span in trail if span],
                hint="move what both need into a third file",
            )
            continue
        if real in done:
            continue
        done.add(real)
        if len(trail) > MAX_USE_DEPTH:
            report.error(
                "E127",
                f"`use` is nested {len(trail)} deep; the limit (MAX_USE_DEPTH) is {MAX_USE_DEPTH}",
                written.span,
            )
            continue
        source = loader.read(path, SPEC_LIMIT, written.span)
        cell = parse(source, report) if source else None
        if cell is None:
            continue
        _check_cell(cell, report)
        _collect(cell, loader, into, [*trail, (real, written.span)], done, report)


def _check_cell(file: SpecFile, report: Report) -> None:
    for statement in file.statements:
        if statement.kind not in CELL_STATEMENTS:
            report.error(
                "E128",
                f'"{statement.kind}" does not belong in a file that others use',
                statement.span,
                hint="a cell file declares tools, robots, fixtures, signals and processes",
            )


def _shown(path: Path) -> str:
    return Path(os.path.normpath(path)).as_posix()


def _unix(text: str) -> str:
    return text.replace("\r\n", "\n").replace("\r", "\n")


def _near_file(path: Path) -> str:
    """A hint: a file of nearly that name in the same folder."""
    try:
        names = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        names = []
    near = difflib.get_close_matches(path.name, names, 1)
    if near:
        return f'did you mean "{near[0]}"?'
    return "a path is relative to the file in which it is written"

"""One post, one program → files: refused as a whole, or rendered and ready to be poured.

Everything that can fail happens before the first byte is asked for: checks, columns, templates.
What is returned only formats numbers when it is iterated, a chunk at a time.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drillc.language.diagnostics import Report
from drillc.language.job import Emit, Process, Texts
from drillc.output.acceptance import check_accepted, read_axes, refuse_axes
from drillc.output.names import map_names, names_csv
from drillc.output.numbers import Column, Fixed, Text
from drillc.output.post import Option, PostProcessor, Task
from drillc.output.settings import read_settings
from drillc.output.staging import Rows, Stage, StagingError
from drillc.planning.program import Program, Step

#: The table of changed names, beside a post's own files.
NAMES_FILE = "names.csv"


class PostError(Exception):
    """A post is wrong, or its templates are: a bug, never a mistake in a spec."""


@dataclass(frozen=True, eq=False)
class OutFile:
    """A file to be written: its path under the output folder, with /, and its bytes in chunks.

    `chunks` can be iterated more than once and gives the same bytes each time.
    """

    path: str
    chunks: Iterable[bytes]

    def read(self) -> bytes:
        """All of it at once: for tests and small files."""
        return b"".join(self.chunks)


# ── what templates see ───────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class ProgramView:
    """`name` is the controller's name, `title` the spec's (safe in a comment)."""

    name: str
    title: str
    holes: int


@dataclass(frozen=True)
class CycleView:
    """The routine of one process: `name` on the controller, `title` in the spec."""

    name: str
    title: str
    index: int
    process: Process
    steps: tuple[Step, ...]
    fault: tuple[Step, ...]


@dataclass(frozen=True)
class SectionView:
    """A run of holes of one region. `first` is its first hole, `rest` all others."""

    name: str
    region: str
    rows: Rows
    cycle: CycleView

    @property
    def first(self) -> Rows:
        return Rows(self.rows.start, min(self.rows.start + 1, self.rows.stop))

    @property
    def rest(self) -> Rows:
        return Rows(self.first.stop, self.rows.stop)


@dataclass(frozen=True)
class ModuleView:
    """A stretch of the program that has its own file or routine; `index` counts from 1."""

    name: str
    index: int
    rows: Rows
    sections: tuple[SectionView, ...]


# ── emission ─────────────────────────────────────────────────────────────────────────────────────


def emit_files(post: PostProcessor, program: Program, emit: Emit, report: Report) -> list[OutFile]:
    """Emit `program` through `post` as `emit` asks: files under `{post.name}/`.

    A mistake of the user's is added to `report`, all of them at once, and no file is returned. A
    mistake of the post's raises `PostError`.
    """
    found = Report()
    task, modules = _prepared(post, program, emit, found)
    if not _failed_kind(found):
        post.check(task, found)
    report.diagnostics.extend(found.diagnostics)
    if found.failed:
        return []
    try:
        files = _rendered(post, task, modules)
    except Exception as error:
        kind = "" if isinstance(error, StagingError) else f"{type(error).__name__}: "
        raise PostError(f"the post {post.name} failed: {kind}{error}") from error
    return files


def options_of(post: PostProcessor | type[PostProcessor]) -> tuple[Option, ...]:
    """All settings of a post, with the one that every post that splits has."""
    if not post.split_files:
        return post.options
    return (Option("holes_per_module", "count", post.holes_per_module, low=1), *post.options)


def context_of(post: PostProcessor, task: Task, modules: Sequence[ModuleView]) -> dict[str, object]:
    """What every template has: program, modules, cycles (those in use), frame, tool, signals (by
    role), settings, axes, and the post's own context. A file per module has `module` too."""
    program = task.program
    cycles = {s.cycle.index: s.cycle for module in modules for s in module.sections}
    return {
        "program": ProgramView(task.names.program, post.comment(program.name), len(program.holes)),
        "modules": tuple(modules),
        "cycles": tuple(cycles[index] for index in sorted(cycles)),
        "frame": program.frame,
        "tool": program.tool,
        "signals": program.signals,
        "settings": task.settings,
        "axes": task.axes,
        **post.context(task),
    }


def _failed_kind(report: Report) -> bool:
    """Whether the program is of a kind that the post's own check need not understand."""
    return any(d.code in ("E610", "E611") for d in report.diagnostics)


def _prepared(
    post: PostProcessor, program: Program, emit: Emit, report: Report
) -> tuple[Task, list[ModuleView]]:
    _check_covered(program)
    settings = read_settings(options_of(post), post.names, emit, report)
    check_accepted(program, post.accepts, emit, report)
    axes: tuple[str, ...] = ()
    if program.motion is not None and post.accepts.joints:
        axes = read_axes(program.motion, post.accepts, emit, report)
    elif program.motion is None:
        refuse_axes(emit, report)
    count = len(program.holes)
    size = settings["holes_per_module"] if post.split_files else max(1, count)
    stretches = [Rows(i, min(i + size, count)) for i in range(0, count, size)] or [Rows(0, 0)]
    names = map_names(program, post.names, post.named, len(stretches), emit.post.span, report)
    task = Task(program, emit, settings, axes, names)
    return task, [] if report.failed else _modules(post, task, stretches)


def _modules(post: PostProcessor, task: Task, stretches: Sequence[Rows]) -> list[ModuleView]:
    names = task.names
    cycles = [
        CycleView(name, post.comment(c.process.name), i, c.process, c.steps, c.fault)
        for i, (name, c) in enumerate(zip(names.processes, task.program.cycles, strict=True))
    ]
    starts = [section.start for section in task.program.sections]
    views = []
    for index, rows in enumerate(stretches):
        sections = tuple(
            SectionView(
                names.regions[section.region],
                post.comment(section.region),
                Rows(max(section.start, rows.start), min(section.stop, rows.stop)),
                cycles[section.cycle],
            )
            for section in task.program.sections[
                max(0, bisect_right(starts, rows.start) - 1) : bisect_left(starts, rows.stop)
            ]
            if section.stop > max(section.start, rows.start)
        )
        views.append(ModuleView(names.modules[index], index + 1, rows, sections))
    return views


def _rendered(post: PostProcessor, task: Task, modules: Sequence[ModuleView]) -> list[OutFile]:
    columns = _columns(post, task)
    stage = Stage(post.template_package, columns, post.filters)
    context = context_of(post, task, modules)
    patterns = post.split_files if len(modules) > 1 else post.files
    files: list[OutFile] = []
    for pattern, template in patterns.items():
        for module in modules if "{module}" in pattern else modules[:1]:
            path = pattern.format(program=task.names.program, module=module.name)
            text = stage.render(template, {**context, "module": module}, post.newline)
            files.append(OutFile(f"{post.name}/{path}", text))
    if table := names_csv(task.names):
        files.append(OutFile(f"{post.name}/{NAMES_FILE}", [table]))
    return files


def _columns(post: PostProcessor, task: Task) -> Mapping[str, Column]:
    """All columns; each must have a cell per hole, or holes would get each other's numbers."""
    columns: dict[str, Column] = {
        "id": Text(_comments(post, task.program.holes.ids)),
        "depth": Fixed(task.program.depth_mm, post.length_decimals),
    }
    if task.names.holes is not None:
        columns["name"] = Text(task.names.holes)
    columns.update(post.columns(task))
    for name, column in columns.items():
        if len(column) != len(task.program.holes):
            raise ValueError(
                f"column {name} has {len(column)} cells for {len(task.program.holes)} holes"
            )
    return columns


def _comments(post: PostProcessor, ids: Texts) -> Texts:
    """Hole ids as they may stand in a comment; unchanged, and untouched, in nearly all cases."""
    texts: list[str] = ids.tolist()
    if (
        type(post).comment is PostProcessor.comment
        and ids.dtype.itemsize // 4 <= post.comment_length
    ):
        joined = "\n".join(texts)
        if not any(character in joined for character in post.comment_forbidden):
            return ids
    return np.array([post.comment(text) for text in texts], dtype=np.str_)


def _check_covered(program: Program) -> None:
    """Each hole is in exactly one section, in order: else it would be drilled twice, or never."""
    at = 0
    for section in program.sections:
        if section.start != at or section.stop < at:
            raise ValueError(f"section {section.region} begins at {section.start}, not at {at}")
        at = section.stop
    if at != len(program.holes):
        raise ValueError(f"the sections hold {at} of {len(program.holes)} holes")

"""One post, one program → files: refused as a whole, or rendered and ready to be poured.

Everything that can fail happens before the first byte is asked for: checks, columns, templates.
What is returned only formats numbers when it is iterated, a chunk at a time.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from drillc.language.diagnostics import Diagnostic, Report
from drillc.language.job import Emit, Process, Texts
from drillc.output.acceptance import (
    KIND_CODES,
    check_accepted,
    mapped_joints,
    read_axes,
    refuse_axes,
)
from drillc.output.names import Kind, map_names, names_csv
from drillc.output.numbers import Column, Fixed, Text, Whole
from drillc.output.post import Option, PostProcessor, Task
from drillc.output.pouring import Rows, StagedText
from drillc.output.settings import read_settings
from drillc.output.staging import Stage, StagingError
from drillc.output.vias import (
    HOLES,
    Stretch,
    check_vias,
    destinations,
    stretches,
    via_numbers,
    vias_before,
)
from drillc.planning.program import Cycle, Program, Section, Step

#: The table of changed names, beside a post's own files.
NAMES_FILE = "names.csv"


class PostError(Exception):
    """A post is wrong, or its templates are: a bug, never a mistake in a spec."""


@dataclass(frozen=True, eq=False)
class OutFile:
    """A file to be written: its path under the output folder, with /, and its bytes in chunks.

    `chunks` can be iterated more than once and gives the same bytes each time. `staged` is the text
    of a post's own file, whose bodies are rows of `program`, its marks that program's cycles and
    sections.
    """

    path: str
    chunks: Iterable[bytes]
    staged: StagedText | None = None
    program: Program | None = None

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
    """A run of holes of one region. `first` is its first hole, `rest` all others. `stretches` are
    its holes and, with an arm, the vias before, between and after them, in order."""

    name: str
    region: str
    rows: Rows
    cycle: CycleView
    stretches: tuple[Stretch, ...]

    @property
    def first(self) -> Rows:
        return Rows(self.rows.start, min(self.rows.start + 1, self.rows.stop))

    @property
    def rest(self) -> Rows:
        return Rows(self.first.stop, self.rows.stop)


@dataclass(frozen=True)
class ModuleView:
    """A part of the program that has its own file or routine; `index` counts from 1."""

    name: str
    index: int
    rows: Rows
    sections: tuple[SectionView, ...]

    @property
    def vias(self) -> tuple[Stretch, ...]:
        """The stretches of vias, in order; none without an arm."""
        runs = (run for section in self.sections for run in section.stretches)
        return tuple(run for run in runs if run.kind != HOLES)

    @property
    def via_counts(self) -> Mapping[str, int]:
        """How many vias there are of each kind, in the order in which the kinds first appear."""
        counts: dict[str, int] = {}
        for run in self.vias:
            counts[run.kind] = counts.get(run.kind, 0) + len(run.rows)
        return counts


# ── emission ─────────────────────────────────────────────────────────────────────────────────────


def emit_files(post: PostProcessor, program: Program, emit: Emit, report: Report) -> list[OutFile]:
    """Emit `program` through `post` as `emit` asks: files under `{post.name}/`.

    A mistake of the user's is added to `report`, all of them at once, and no file is returned. A
    mistake of the post's raises `PostError`.
    """
    return emit_programs(post, (program,), emit, report)


def emit_programs(
    post: PostProcessor, programs: Sequence[Program], emit: Emit, report: Report
) -> list[OutFile]:
    """The same for the programs of an arm's stations, side by side in one folder, with one table
    of names. What is wrong with several of them in the same way is said once."""
    said: list[Diagnostic] = []
    files: dict[str, OutFile] = {}
    changed: list[tuple[Kind, str, str]] = []
    for program in programs:
        found = Report()
        task, parts = _prepared(post, program, emit, found)
        if not _failed_kind(found):
            post.check(task, found)
        if not found.failed:
            _add_files(files, _files(post, task, parts), program, emit, found)
            changed += task.names.changed
        said += [diagnostic for diagnostic in found.diagnostics if diagnostic not in said]
    report.diagnostics.extend(said)
    if Report(said).failed:
        return []
    if len(programs) > 1:
        changed = list(dict.fromkeys(changed))  # a process of both stations is named once
    table = [OutFile(f"{post.name}/{NAMES_FILE}", [names_csv(changed)])] if changed else []
    return [*files.values(), *table]


def _files(post: PostProcessor, task: Task, parts: Sequence[Rows]) -> list[OutFile]:
    """The program's own files; whatever goes wrong now is the post's mistake."""
    try:
        return _rendered(post, task, parts)
    except Exception as error:
        kind = "" if isinstance(error, StagingError) else f"{type(error).__name__}: "
        raise PostError(f"the post {post.name} failed: {kind}{error}") from error


def _add_files(
    files: dict[str, OutFile], more: Sequence[OutFile], program: Program, emit: Emit, report: Report
) -> None:
    """Add to `files`, which go by their paths in lower case, as on Windows; no two may be one."""
    for file in more:
        if file.path.lower() in files:
            report.error(
                "E663",
                f"program {program.name} would write {file.path}, which is another program's",
                emit.post.span,
                hint="give the program or its stations names that differ more",
            )
            return
        files[file.path.lower()] = file


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
    return any(d.code in KIND_CODES for d in report.diagnostics)


def _prepared(
    post: PostProcessor, program: Program, emit: Emit, report: Report
) -> tuple[Task, list[Rows]]:
    """The task, and the holes of each module."""
    _check_covered(program)
    check_vias(program)
    settings = read_settings(options_of(post), post.names, emit, report)
    check_accepted(program, post.accepts, emit, report)
    axes: tuple[str, ...] = ()
    if joints := mapped_joints(program, post.accepts):
        axes = read_axes(joints, post.accepts, emit, report)
    elif program.motion is None:
        refuse_axes(emit, report)
    count = len(program.holes)
    size = settings["holes_per_module"] if post.split_files else max(1, count)
    parts = [Rows(i, min(i + size, count)) for i in range(0, count, size)] or [Rows(0, 0)]
    names = map_names(program, post.names, post.named, len(parts), emit.post.span, report)
    return Task(program, emit, settings, axes, names), parts


def _modules(
    post: PostProcessor, task: Task, parts: Sequence[Rows], kinds: Texts
) -> list[ModuleView]:
    names = task.names
    cycles = [
        CycleView(name, post.comment(c.process.name), i, c.process, c.steps, c.fault)
        for i, (name, c) in enumerate(zip(names.processes, task.program.cycles, strict=True))
    ]
    starts = [section.start for section in task.program.sections]
    views = []
    for index, part in enumerate(parts):
        sections = []
        for section in task.program.sections[
            max(0, bisect_right(starts, part.start) - 1) : bisect_left(starts, part.stop)
        ]:
            rows = Rows(max(section.start, part.start), min(section.stop, part.stop))
            if rows:
                name, region = names.regions[section.region], post.comment(section.region)
                runs = _stretches(task.program, rows, kinds)
                sections.append(SectionView(name, region, rows, cycles[section.cycle], runs))
        views.append(ModuleView(names.modules[index], index + 1, part, tuple(sections)))
    return views


def _stretches(program: Program, rows: Rows, kinds: Texts) -> tuple[Stretch, ...]:
    if program.arm is None:
        return (Stretch(HOLES, rows),)
    before = program.arm.vias.before
    vias = vias_before(rows, before, len(program.holes))
    return tuple(stretches(rows, vias, before, kinds))


def _rendered(post: PostProcessor, task: Task, parts: Sequence[Rows]) -> list[OutFile]:
    kinds = _via_kinds(post, task)
    modules = _modules(post, task, parts, kinds)
    via_columns = _via_columns(post, task, parts, kinds)
    stage = Stage(
        post.template_package,
        _columns(post, task),
        post.filters,
        via_columns,
        _subject_of(task.program),
    )
    context = context_of(post, task, modules)
    patterns = post.split_files if len(modules) > 1 else post.files
    files: list[OutFile] = []
    for pattern, template in patterns.items():
        for module in modules if "{module}" in pattern else modules[:1]:
            path = pattern.format(program=task.names.program, module=module.name)
            text = stage.render(template, {**context, "module": module}, post.newline)
            files.append(OutFile(f"{post.name}/{path}", text, text, task.program))
    return files


def _subject_of(program: Program) -> Callable[[object], Cycle | Section | None]:
    """What the text of a template's loop is about, if it runs over cycles or over sections."""
    starts = [section.start for section in program.sections]

    def subject(item: object) -> Cycle | Section | None:
        if isinstance(item, CycleView):
            return program.cycles[item.index]
        if isinstance(item, SectionView):
            return program.sections[bisect_right(starts, item.rows.start) - 1]
        return None

    return subject


def _columns(post: PostProcessor, task: Task) -> Mapping[str, Column]:
    """All columns; each must have a cell per hole, or holes would get each other's numbers."""
    columns: dict[str, Column] = {
        "id": Text(_comments(post, task.program.holes.ids)),
        "depth": Fixed(task.program.depth_mm, post.length_decimals),
    }
    if task.names.holes is not None:
        columns["name"] = Text(task.names.holes)
    columns.update(post.columns(task))
    _check_lengths(columns, len(task.program.holes), "holes")
    return columns


def _via_kinds(post: PostProcessor, task: Task) -> Texts:
    """A kind for each via (m,); no kind is empty, or that of the holes."""
    arm = task.program.arm
    if arm is None:
        return np.zeros(0, dtype=np.str_)
    kinds = post.via_kinds(task)
    if len(kinds) != len(arm.vias.before):
        raise ValueError(f"there are {len(kinds)} kinds for {len(arm.vias.before)} vias")
    if np.isin(kinds, ["", HOLES]).any():
        raise ValueError(f"a via cannot be of the kind {HOLES!r}, or of none")
    return kinds


def _via_columns(
    post: PostProcessor, task: Task, parts: Sequence[Rows], kinds: Texts
) -> Mapping[str, Column]:
    """All columns of the vias; none without an arm."""
    arm, holes = task.program.arm, task.program.holes
    if arm is None:
        return {}
    before = arm.vias.before
    modules = [vias_before(part, before, len(holes)) for part in parts]
    columns: dict[str, Column] = {
        "number": Whole(via_numbers(modules, kinds)),
        "to": Text(destinations(arm, _comments(post, holes.ids))),
    }
    columns.update(post.via_columns(task))
    _check_lengths(columns, len(before), "vias")
    return columns


def _check_lengths(columns: Mapping[str, Column], count: int, what: str) -> None:
    for name, column in columns.items():
        if len(column) != count:
            raise ValueError(f"column {name} has {len(column)} cells for {count} {what}")


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

"""`drillc diff`: two specs, two programs, or a spec and a program, compared by meaning.

An operand is a spec, or a folder that drillc has written, or a file in one. What is compared is
what is made, hole by hole (`verification.made`), so a program that was emitted otherwise but does
the same is the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from drillc.driver import Planned, plan_spec
from drillc.language.diagnostics import Refused, Report
from drillc.language.job import Emit, Job, Named, Portal
from drillc.language.source import Source, Span
from drillc.planning.program import Program
from drillc.verification.difference import Difference, difference
from drillc.verification.folder import program_files, renamed_in
from drillc.verification.listing import made_of_plan, made_of_run, planned_words
from drillc.verification.made import MOVE_STEP, Made
from drillc.verification.places import Machine, machine_of
from drillc.verification.reading import Reader, ReadError, Run
from drillc.verification.registry import find_readers
from drillc.verifying import MANIFEST, NotVerifiable, read_manifest, spec_of


class NotComparable(Exception):  # noqa: N818 (an answer, no error of the program)
    """An operand cannot be read or understood; the text says why."""


@dataclass(frozen=True, eq=False)
class Side:
    """An operand: a planned spec, or the programs of an output folder by post. `spec` of a folder:
    the plan that says which machine moves by its joints, where one is at hand."""

    shown: str
    planned: Planned | None
    runs: dict[str, tuple[Reader, tuple[Run, ...]]]
    renamed: dict[str, dict[str, str]]
    emits: tuple[Emit, ...]


@dataclass(frozen=True, eq=False)
class Compared:
    """One program against its other version. `post` is empty for two specs."""

    program: str
    post: str
    difference: Difference


@dataclass(frozen=True, eq=False)
class Comparison:
    """`alone`: programs that only one side has, in words."""

    before: str
    after: str
    programs: tuple[Compared, ...]
    alone: tuple[str, ...]

    @property
    def same(self) -> bool:
        """Whether both sides mean the same."""
        return not self.alone and all(one.difference.none for one in self.programs)


def compare(before: Side, after: Side) -> Comparison:
    """Compare program by program. Raises NotComparable."""
    pairs, alone = _pairs(before, after)
    compared = []
    for post, one, two in pairs:
        try:
            found = difference(_made(before, post, one, after), _made(after, post, two, before))
        except ReadError as error:
            raise NotComparable(_told(error, one, two)) from None
        compared.append(Compared(two or one, post, found))
    return Comparison(before.shown, after.shown, tuple(compared), tuple(alone))


# ── operands ─────────────────────────────────────────────────────────────────────────────────────


def side_of(
    path: Path, spec: Path | None, root: Path | None, report: Report, instead: Path | None = None
) -> Side:
    """Read an operand. `spec` names the spec of a folder of programs; `instead` another version of
    a spec at `path`. Raises NotComparable, and Refused for a spec with errors."""
    if path.is_dir() or (instead is None and (path.parent / MANIFEST).is_file()):
        return _folder(path if path.is_dir() else path.parent, spec, root, report)
    if instead is None and (path.parent.parent / MANIFEST).is_file():
        return _folder(path.parent.parent, spec, root, report)
    planned = plan_spec(path, root, report, instead=instead)
    return Side(str(path), planned, {}, {}, planned.job.emits)


def _folder(path: Path, spec: Path | None, root: Path | None, report: Report) -> Side:
    try:
        manifest = read_manifest(path)
        found = spec or spec_of(path, manifest)
    except NotVerifiable as wrong:
        raise NotComparable(str(wrong)) from None
    planned = plan_spec(found, root, report) if found is not None else None
    posts = [str(post) for post in manifest["posts"]]
    nowhere = Span(Source(path, str(path), ""), 1, 1)
    readers = find_readers([Named(post, nowhere) for post in posts], report)
    report.stop_if_failed()
    files = program_files(path, posts)
    runs = {}
    for post, reader in readers.items():
        mine = {name: files[name] for name in files if name.startswith(f"{post}/")}
        try:
            runs[post] = (reader, tuple(reader.read(mine)))
        except ReadError as error:
            place = list(mine)[error.file] if 0 <= error.file < len(mine) else post
            raise NotComparable(f"{path}/{place}:{error.line}: {error.message}") from None
    emits = planned.job.emits if planned is not None else ()
    return Side(str(path), planned, runs, renamed_in(path, posts), emits)


# ── pairs ────────────────────────────────────────────────────────────────────────────────────────


def _pairs(before: Side, after: Side) -> tuple[list[tuple[str, str, str]], list[str]]:
    """Post and names of what is compared with what, and what stands alone."""
    posts = sorted({*before.runs, *after.runs}) or [""]
    pairs, alone = [], []
    for post in posts:
        names = []
        for side in (before, after):
            has = not side.runs or post in side.runs
            names.append(_names(side, post) if has else {})
        one, two = names
        if len(one) == 1 and len(two) == 1:
            two = {next(iter(one)): next(iter(two.values()))}
        for key in dict.fromkeys([*one, *two]):
            if key in one and key in two:
                pairs.append((post, one[key], two[key]))
            else:
                side, name = (before, one[key]) if key in one else (after, two[key])
                alone.append(f"only {side.shown} has {f'{post} ' if post else ''}program {name}")
    return pairs, alone


def _names(side: Side, post: str) -> dict[str, str]:
    """Programs by their names on the controller, in upper case."""
    if post in side.runs:
        return {run.name.upper(): run.name for run in side.runs[post][1]}
    assert side.planned is not None
    return {program.name.upper(): program.name for program in side.planned.programs}


def _made(side: Side, post: str, name: str, other: Side) -> Made:
    if post not in side.runs:
        assert side.planned is not None
        program = next(one for one in side.planned.programs if one.name == name)
        reader = other.runs[post][0] if post in other.runs else None
        words = planned_words(program, reader, other.renamed.get(post, {}))
        return made_of_plan(program, words, from_below(side.planned.job))
    reader, runs = side.runs[post]
    run = next(one for one in runs if one.name == name)
    planned = side.planned or other.planned
    if planned is None:
        return made_of_run(run, None, None)
    renamed = side.renamed.get(post, {})
    program = next(
        (p for p in planned.programs if renamed.get(p.name, p.name).upper() == name.upper()),
        planned.programs[0],
    )
    words = planned_words(program, reader, renamed)
    plan = made_of_plan(program, words, from_below(planned.job))
    ends = [[s.depth_mm for s in steps if s.what == MOVE_STEP] for steps in plan.step_lists]
    standoffs = sorted({depth for depths in ends for depth in (depths[0], depths[-1])})
    return made_of_run(run, _machine(planned, post, run, program), words, standoffs)


def from_below(job: Job) -> bool:
    """Whether the tool comes against the direction that the holes' normals give."""
    return isinstance(job.robot, Portal) and job.robot.side == "below"


def _machine(planned: Planned, post: str, run: Run, program: Program) -> Machine | None:
    emit = next((one for one in planned.job.emits if one.post.text == post), None)
    if emit is None:
        emit = Emit(Named(post, planned.job.program.span), (), ())
    machine = machine_of(planned.job, program, emit, run.axes)
    return machine if machine.known else None


def _told(error: ReadError, *names: str) -> str:
    return f"{' and '.join(dict.fromkeys(names))}: line {error.line}: {error.message}"


# ── telling ──────────────────────────────────────────────────────────────────────────────────────


def as_text(found: Comparison) -> str:
    """For a person."""
    from drillc.verification.difference import as_text as told

    lines = [f"{line}\n" for line in found.alone]
    for one in found.programs:
        head = f"{one.post} {one.program}: " if one.post else f"{one.program}: "
        lines.append(head + told(one.difference, found.before, found.after))
    return "".join(lines)


def as_json(found: Comparison) -> dict[str, object]:
    """The same as plain data, nothing left out."""
    from drillc.verification.difference import as_json as told

    return {
        "before": found.before,
        "after": found.after,
        "same": found.same,
        "alone": list(found.alone),
        "programs": [
            {"program": one.program, "post": one.post, **told(one.difference)}
            for one in found.programs
        ],
    }


# ── git ──────────────────────────────────────────────────────────────────────────────────────────


def git_diff(arguments: Sequence[str], report: Report) -> str:
    """What git asks an external diff driver for: path, old-file, old-hex, old-mode, new-file,
    new-hex, new-mode (and the new path and similarity of a renamed file). Never raises for what a
    spec holds: versions that cannot be compared by meaning are compared as text."""
    path, old, new = arguments[0], arguments[1], arguments[4]
    target = arguments[7] if len(arguments) > 7 else path
    head = f"drillc diff {path}" + (f" -> {target}" if target != path else "") + "\n"
    if old == "/dev/null" or new == "/dev/null":
        return head + ("new file\n" if old == "/dev/null" else "deleted file\n")
    if path.endswith(".drill"):
        try:
            one = side_of(Path(path), None, None, report, instead=Path(old))
            two = side_of(Path(target), None, None, report, instead=Path(new))
            return head + as_text(compare(one, two)).replace(f"{path} -> {target}: ", "", 1)
        except Refused:
            head += "one of the versions has errors, so they are compared as text\n"
        except NotComparable as wrong:
            head += f"{wrong}; compared as text\n"
    return head + _text_diff(Path(old), Path(new), path, target)


def _text_diff(old: Path, new: Path, path: str, target: str) -> str:
    from difflib import unified_diff

    one, two = (
        file.read_bytes().decode("utf-8", errors="replace").splitlines() for file in (old, new)
    )
    lines = unified_diff(one, two, f"a/{path}", f"b/{target}", lineterm="")
    return "".join(f"{line}\n" for line in lines)

"""The passes, in the order they run.

    text ─parse→ tree ─resolve→ Job ─pose→ postures ─solve→ joints ─plan→ Program ─emit→ files
        ─verify→ written

Each stage reports all its mistakes and stops there; nothing is written before all has passed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from drillc.language.diagnostics import Refused, Report
from drillc.language.job import Arm, Emit, Floats, Job, Named, Portal
from drillc.planning.arm_joints import ArmSolution
from drillc.planning.portal_joints import Solution
from drillc.planning.program import Program
from drillc.verification.registry import find_readers

if TYPE_CHECKING:
    from drillc.output.emission import OutFile
    from drillc.verification.verdict import Verdict


#: Told in a few words what is being done, for a person who waits.
Progress = Callable[[str], None]


def quiet(doing: str) -> None:
    """Progress that nobody watches."""


@dataclass(frozen=True, eq=False)
class Planned:
    """What a spec comes to, before any controller: the job, the poses, the joints, the program."""

    job: Job
    part_from_tool: Floats  # (n, 3, 3)
    solution: Solution | ArmSolution | None
    programs: tuple[Program, ...]  # one; for an arm, one a station


def plan_spec(
    path: Path,
    root: Path | None,
    report: Report,
    progress: Progress = quiet,
    instead: Path | None = None,
) -> Planned:
    """Run every pass up to the Program. Raises `Refused` at the end of the first stage with errors;
    warnings stay in `report`. `instead` holds another version of the spec at `path`."""
    from drillc.planning.depths import plunge_depths

    job = read_job(path, root, report, progress, instead)
    progress(f"solving {len(job.holes):,} holes")
    depth_mm = plunge_depths(job, report)
    if isinstance(job.robot, Portal):
        return _plan_portal(job, job.robot, depth_mm, report, progress)
    if isinstance(job.robot, Arm):
        return _plan_arm(job, job.robot, depth_mm, report, progress)
    return _plan_poses(job, depth_mm, report, progress)


def read_job(
    path: Path,
    root: Path | None,
    report: Report,
    progress: Progress = quiet,
    instead: Path | None = None,
) -> Job:
    """Run the passes up to the Job, its holes in the order in which they are made."""
    from drillc.language.loading import load
    from drillc.language.resolve import resolve
    from drillc.planning.ordering import in_order
    from drillc.planning.surface import fit_to_surface

    progress("reading the spec")
    loader, loaded = load(path, root, report, instead)
    report.stop_if_failed()
    if loaded is None:
        raise AssertionError("nothing was loaded and nothing was said")
    progress("reading the holes")
    job = resolve(loaded, loader, report)
    return in_order(fit_to_surface(job, report))


def _plan_portal(
    job: Job, robot: Portal, depth_mm: Floats, report: Report, progress: Progress
) -> Planned:
    from drillc.planning.clearance import check_fixtures
    from drillc.planning.expected import check_expectations
    from drillc.planning.plan import plan
    from drillc.planning.portal_joints import solve_portal, travel_points
    from drillc.planning.postures import check_heading_jumps

    solution = solve_portal(job, robot, depth_mm, report)
    report.stop_if_failed()
    if solution is None:
        raise AssertionError("no solution and nothing was said")
    part_from_tool, motion = solution.part_from_tool, solution.motion
    progress(f"checking {len(job.holes):,} holes")
    check_heading_jumps(job, part_from_tool, report)
    between = travel_points(robot, solution) if job.fixtures else []
    check_fixtures(job, part_from_tool, depth_mm, between, report)
    check_expectations(job, part_from_tool, motion.joints, report)
    report.stop_if_failed()
    program = plan(job, part_from_tool, depth_mm, motion)
    return Planned(job, part_from_tool, solution, (program,))


def _plan_arm(job: Job, arm: Arm, depth_mm: Floats, report: Report, progress: Progress) -> Planned:
    from drillc.planning.arm_joints import solve_arm
    from drillc.planning.clearance import check_travel
    from drillc.planning.expected import check_expectations
    from drillc.planning.parking import park
    from drillc.planning.plan import plan_stations
    from drillc.planning.postures import resolve_postures

    preferred = resolve_postures(job, report)
    report.stop_if_failed()
    job, arm = park(job, arm, preferred, depth_mm, report, progress)
    solution = solve_arm(job, arm, preferred, depth_mm, report, progress)
    report.stop_if_failed()
    if solution is None:
        raise AssertionError("no solution and nothing was said")
    progress(f"checking {len(job.holes):,} holes")
    check_travel(job, solution.part_from_tool, report)
    check_expectations(job, solution.part_from_tool, solution.joints, report)
    report.stop_if_failed()
    return Planned(job, solution.part_from_tool, solution, plan_stations(job, solution, depth_mm))


def _plan_poses(job: Job, depth_mm: Floats, report: Report, progress: Progress) -> Planned:
    from drillc.planning.clearance import check_fixtures, check_travel
    from drillc.planning.expected import check_expectations
    from drillc.planning.plan import plan
    from drillc.planning.postures import check_heading_jumps, resolve_postures

    part_from_tool = resolve_postures(job, report)
    report.stop_if_failed()
    progress(f"checking {len(job.holes):,} holes")
    check_heading_jumps(job, part_from_tool, report)
    check_travel(job, part_from_tool, report)
    check_fixtures(job, part_from_tool, depth_mm, [], report)
    check_expectations(job, part_from_tool, None, report)
    report.stop_if_failed()
    return Planned(job, part_from_tool, None, (plan(job, part_from_tool, depth_mm, None),))


def check_spec(path: Path, report: Report, *, root: Path | None = None) -> Planned:
    """Everything that `compile_spec` does but writing: also what the posts would refuse."""
    planned = plan_spec(path, root, report)
    _emit(planned, planned.job.emits, report)
    return planned


class NotProven(Exception):  # noqa: N818 (a verdict on what was emitted)
    """A program that was read back does not do what the spec says; nothing was written."""

    def __init__(self, verdicts: Sequence[Verdict]) -> None:
        super().__init__("a program does not do what the spec says")
        self.verdicts = verdicts


@dataclass(frozen=True)
class Compiled:
    """The files written, sorted, and what was proven of each program (nothing, if not verified)."""

    paths: tuple[Path, ...]
    verdicts: tuple[Verdict, ...]


def compile_spec(
    path: Path,
    out: Path,
    report: Report,
    *,
    root: Path | None = None,
    posts: Sequence[str] = (),
    verify: bool = True,
    progress: Progress = quiet,
) -> Compiled:
    """Compile a spec into the folder `out`: emit, read back, prove, and only then move into place.

    `posts` narrows the spec's `emit` statements, or adds posts that it does not name. On any error
    `Refused` is raised, and `NotProven` where a program does not do what the spec says; then `out`
    is as it was.
    """
    from drillc.output.source_map import source_map
    from drillc.output.writing import write_outputs

    planned = plan_spec(path, root, report, progress)
    progress("preparing the files")
    emits = wanted_emits(planned.job, posts, report)
    files = _emit(planned, emits, report)
    files += source_map(files, planned.job.program)
    watched = [replace(file, chunks=_watched(file, progress)) for file in files]
    if verify:
        find_readers([emit.post for emit in emits], report)
        report.stop_if_failed()
    verdicts: list[Verdict] = []

    def proven(folder: Path) -> None:
        if verify:
            verdicts.extend(prove(planned, emits, folder, report, progress))
            if not all(verdict.passed for verdict in verdicts):
                raise NotProven(verdicts)

    paths = write_outputs(
        out,
        watched,
        planned.job,
        report,
        posts=[emit.post.text for emit in emits],
        verified=verify,
        before_move=proven,
    )
    return Compiled(tuple(paths), tuple(verdicts))


def prove(
    planned: Planned,
    emits: Sequence[Emit],
    folder: Path,
    report: Report,
    progress: Progress = quiet,
) -> list[Verdict]:
    """Read the programs in `folder` back and compare what they do with what is planned: a verdict
    for each. Raises `Refused` where a post has no reader."""
    from drillc.verification.folder import program_files, renamed_in
    from drillc.verification.proof import verify_folder

    readers = find_readers([emit.post for emit in emits], report)
    report.stop_if_failed()
    posts = [emit.post.text for emit in emits]
    return list(
        verify_folder(
            planned.job,
            planned.programs,
            emits,
            readers,
            program_files(folder, posts),
            renamed_in(folder, posts),
            progress,
        )
    )


def _emit(planned: Planned, emits: Sequence[Emit], report: Report) -> list[OutFile]:
    """The files of every post, rendered but not yet poured; raises `Refused` with all errors."""
    from drillc.output.emission import emit_programs
    from drillc.output.registry import find_posts

    chosen = find_posts([emit.post for emit in emits], report)
    report.stop_if_failed()
    files = [
        file
        for emit, post in zip(emits, chosen, strict=True)
        for file in emit_programs(post, planned.programs, emit, report)
    ]
    report.stop_if_failed()
    return files


def _watched(file: OutFile, progress: Progress) -> Iterator[bytes]:
    written = 0
    for chunk in file.chunks:
        progress(f"writing {file.path}, {written / 1e6:.1f} MB")
        written += len(chunk)
        yield chunk


def wanted_emits(job: Job, posts: Sequence[str], report: Report) -> list[Emit]:
    """The `emit` statements to follow; one for each post named on the command line."""
    if not posts:
        if not job.emits:
            report.error(
                "E600",
                "the spec does not say what to emit",
                job.program.span,
                hint="add: emit krl; or name a post with --post",
            )
            raise Refused(report)
        return list(job.emits)
    declared = {emit.post.text: emit for emit in job.emits}
    plain = {name: Emit(Named(name, job.program.span), (), ()) for name in posts}
    return [declared.get(name, plain[name]) for name in dict.fromkeys(posts)]

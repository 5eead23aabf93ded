"""Proves programs: what they do when they run, hole by hole, against what the spec asks for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from drillc.language.job import Emit, Job, Portal
from drillc.planning.program import Program

from .case import CHORD_ROUNDED_MM, Case, arm_by_joints, limits_of, roles_of
from .checks import Made, check_places, depths_of
from .coverage import Coverage, check_extra
from .events import Alternative, Events, Kind, Step, joined, moves_of
from .expected import MOVE, codes_of, wanted_of, words_of
from .faults import Faults
from .frames import check_frames
from .joints import check_joints, check_range
from .matching import Marks, Matcher
from .places import machine_of
from .postures import check_configuration
from .reading import Reader, ReadError, Run
from .steps import check_steps
from .travels import Legs
from .vectors import length
from .verdict import Tally, Verdict
from .visits import Path, Visits, cores_of, items_of, visits_of
from .ways import check_homes, check_ways

#: So many events of the main run are looked at together.
CHUNK = 1 << 15


def verify_program(
    run: Run,
    reader: Reader,
    job: Job,
    program: Program,
    renamed: Mapping[str, str],
    emit: Emit,
    chunk: int = CHUNK,
) -> Verdict:
    """Run a program and compare all that it does with what is planned. Never raises for what is
    wrong with the program; `renamed` are the names that were changed for the controller."""
    tally = Tally(run.files)
    name = emit.post.text
    try:
        proof = _Proof(_case(run, reader, job, program, renamed, emit, tally), chunk)
        for step in run.steps():
            proof.take(step)
        proof.finish()
        tally.compared("reads", 1)
    except ReadError as error:
        tally.compared("reads", 1)
        tally.fail("reads", error.message, file=error.file, line=error.line)
    for finding in run.findings():
        tally.fail(finding.check, finding.message, file=finding.file, line=finding.line)
    for check in ("rules", "used", "quaternions"):
        tally.compared(check, 1)
    return tally.verdict(program.name, name, len(program.holes))


def verify_folder(
    job: Job,
    programs: Sequence[Program],
    emits: Sequence[Emit],
    readers: Mapping[str, Reader],
    files: Mapping[str, bytes],
    renamed: Mapping[str, Mapping[str, str]],
    progress: Callable[[str], None] = lambda doing: None,
) -> Iterator[Verdict]:
    """Prove all programs of all posts, one verdict each. `files` (path under the output folder →
    bytes) may read them when they are asked for; `renamed`: each post's changed names."""
    for emit in emits:
        post = emit.post.text
        reader = readers[post]
        mine = _Part(files, [path for path in files if path.startswith(f"{post}/")])
        yield from _verify_post(job, programs, emit, reader, mine, renamed.get(post, {}), progress)


@dataclass(frozen=True)
class _Part(Mapping[str, bytes]):
    """Some of the files, still read only when they are asked for."""

    files: Mapping[str, bytes]
    paths: Sequence[str]

    def __getitem__(self, path: str) -> bytes:
        return self.files[path]

    def __iter__(self) -> Iterator[str]:
        return iter(self.paths)

    def __len__(self) -> int:
        return len(self.paths)


def _verify_post(
    job: Job,
    programs: Sequence[Program],
    emit: Emit,
    reader: Reader,
    files: Mapping[str, bytes],
    renamed: Mapping[str, str],
    progress: Callable[[str], None],
) -> Iterator[Verdict]:
    paths = list(files)
    try:
        runs = list(reader.read(files))
    except ReadError as error:
        tally = Tally(paths)
        tally.compared("reads", 1)
        tally.fail("reads", error.message, file=error.file, line=error.line)
        holes = sum(len(program.holes) for program in programs)
        yield tally.verdict(programs[0].name if programs else "", emit.post.text, holes)
        return
    named = {run.name.upper(): run for run in runs}
    for program in programs:
        name = renamed.get(program.name, program.name)
        run = named.pop(name.upper(), None)
        if run is None and len(programs) == 1 and len(named) == 1:
            _, run = named.popitem()
        if run is None:
            tally = Tally(paths)
            tally.compared("reads", 1)
            tally.fail("reads", f"there is no program {name} for {emit.post.text}")
            yield tally.verdict(program.name, emit.post.text, len(program.holes))
            continue
        progress(f"verifying {emit.post.text} {program.name}")
        yield verify_program(run, reader, job, program, renamed, emit)
    for run in named.values():
        tally = Tally(run.files)
        tally.compared("coverage", 1)
        tally.fail("coverage", f"program {run.name} is not asked for by the spec", file=0)
        yield tally.verdict(run.name, emit.post.text, 0)


def _case(
    run: Run,
    reader: Reader,
    job: Job,
    program: Program,
    renamed: Mapping[str, str],
    emit: Emit,
    tally: Tally,
) -> Case:
    words = words_of(program, reader, renamed, reader.native_spindle)
    machine = machine_of(job, program, emit, run.axes)
    robot = job.robot
    arm = arm_by_joints(program, run)
    by_joints = machine.known and (program.motion is not None or arm)
    return Case(
        job=job,
        program=program,
        emit=emit,
        run=run,
        wanted=wanted_of(program, words, isinstance(robot, Portal) and robot.side == "below"),
        words=words,
        machine=machine,
        precision=reader.precision,
        limits=limits_of(program, machine, reader.precision, by_joints, arm),
        tally=tally,
        states_loads=reader.states_loads,
    )


@dataclass(eq=False)
class _Proof:
    """Goes through a run in chunks. `held` are events that are not judged yet; the event before
    them, where the tool then was, is the first of them once anything is judged (`known`)."""

    case: Case
    chunk: int
    held: list[Events] = field(default_factory=list)
    known: bool = False
    coverage: Coverage = field(init=False)
    matcher: Matcher = field(init=False)
    faults: Faults = field(default_factory=Faults)
    count: int = 0  # events that came since anything was judged
    seen: int = 0  # moves that came so far
    judged: int = 0  # moves before those that are held
    #: Moves that had come when the program asked where the machine stands.
    questions: list[int] = field(default_factory=list)

    def __post_init__(self) -> None:
        wanted = self.case.wanted
        self.coverage = Coverage(len(wanted))
        bottoms = wanted.position_mm + wanted.bottom_mm[:, None] * wanted.axis
        self.matcher = Matcher(Marks(bottoms, wanted.axis))

    def take(self, step: Step) -> None:
        """The next part of the run."""
        if isinstance(step, Alternative):
            self.faults.alternatives.append(step)
            if not step.timeout:
                self.questions.append(self.seen)
        elif len(step):
            self.held.append(step)
            self.count += len(step)
            self.seen += int(np.count_nonzero(moves_of(step.kind)))
        if self.count >= self.chunk:
            self.count = 0
            self._judge(last=False)
            self.faults.check(self.case, last=False)

    def finish(self) -> None:
        """All that is left, and what can only be told at the end."""
        self._judge(last=True)
        self.faults.check(self.case, last=True)
        check_homes(self.case)
        self.coverage.finish(self.case)

    # ── one stretch of the run ───────────────────────────────────────────────────────────────────

    def _judge(self, *, last: bool) -> None:
        if not self.held:
            return
        case, fresh = self.case, int(self.known)
        path = self._path(joined(self.held))
        self.held = [path.events]
        visits = visits_of(path, fresh)
        if not last:
            visits = visits.take(slice(0, max(len(visits) - 1, 0)))
        made, extra = self._match(path, visits)
        if not last and not len(made):
            return  # until there is a hole again
        end = len(path) if last else int(made.cores.last[-1]) + 1
        told = slice(fresh, end)
        check_extra(case, path.take(slice(0, end)), extra, made, known=self.known)
        legs = self._legs(made, end, last=last)
        # A question that was asked after the m-th move of the path stands before event m + 1 of
        # its moves.
        check_ways(case, path, legs, np.array(self.questions, dtype=np.intp) - self.judged)
        judged = path.take(told)
        check_frames(case, judged)
        check_range(case, judged)
        check_configuration(case, judged)
        if len(made):
            check_places(case, path, made)
            check_steps(case, path, made)
            check_joints(case, path, made)
            self.faults.add(path, made)
            self.coverage.count(case, path, made)
        moves = np.flatnonzero(path.moves[:end])
        here = moves[-1:] if len(moves) else np.arange(min(1, end))
        self.judged += max(len(moves) - 1, 0)
        self.held = [path.events.take(np.concatenate([here, np.arange(end, len(path))]))]
        self.known = True

    def _path(self, events: Events) -> Path:
        case = self.case
        events = _complete(events)
        places = case.machine.places(events)
        codes = codes_of(events.kind, roles_of(case, events), events.value)
        moves = codes == MOVE
        before = np.maximum.accumulate(np.where(moves, np.arange(len(events)), -1))
        before = np.concatenate([[-1], before[:-1]])
        speed, slack = events.speed_mm_s, np.zeros(len(events))
        middle = np.full((len(events), 3), np.nan)
        if case.by_joints:
            straight = np.flatnonzero((events.kind == Kind.STRAIGHT) & (before >= 0))
            start = before[straight]
            way = length(places.position_mm[straight] - places.position_mm[start])
            # A feed may be counted along some axes only; the time says how fast the tool is.
            with np.errstate(divide="ignore", invalid="ignore"):
                told = way / events.value[straight]
            if case.arm_by_joints:
                slack[straight] = CHORD_ROUNDED_MM / np.maximum(way, CHORD_ROUNDED_MM)
            speed = speed.copy()
            speed[straight] = np.where(np.isnan(told), speed[straight], told)
            if case.arm_by_joints and len(straight):
                half = 0.5 * (places.joints[straight] + places.joints[start])
                middle[straight] = case.machine.tool(half)[0]
        return Path(events, places, codes, speed, slack, middle)

    def _match(self, path: Path, visits: Visits) -> tuple[Made, Visits]:
        """The visits that make a hole, and those that make none but switch something."""
        case, place = self.case, path.places
        counts = visits.stop - visits.start
        ends = np.concatenate([[0], np.cumsum(path.moves)])
        busy = counts > ends[visits.stop] - ends[visits.start]
        found = Marks(place.position_mm[visits.deepest], place.axis[visits.deepest])
        needs = all(
            any(item.code != MOVE for item in template.items) for template in case.wanted.templates
        )
        likely = np.flatnonzero(busy) if needs else np.arange(len(visits))
        hole = np.full(len(visits), -1, dtype=np.intp)
        hole[likely] = self.matcher.match(found.take(likely), self.coverage.next_hole)
        makes = hole >= 0
        extra = visits.take(~makes & busy)
        visits, hole = visits.take(makes), hole[makes]
        depth = depths_of(case, path, visits, hole)
        wanted = case.wanted
        cores = cores_of(path, visits, depth, wanted.approach_mm[hole], wanted.exit_mm[hole])
        items = items_of(path, cores, depth, together=False)
        return Made(visits, hole, depth, cores, items), extra

    def _legs(self, made: Made, end: int, *, last: bool) -> Legs:
        n = len(self.case.wanted)
        start = np.concatenate([[int(self.known)], made.cores.last + 1])
        stop = np.append(made.cores.first + 1, end)
        hole = np.append(made.hole, n)
        if not last:
            start, stop, hole = start[:-1], stop[:-1], hole[:-1]
        return Legs(start, np.maximum(stop, start), hole, self.known)


def _complete(events: Events) -> Events:
    """A halt that waits for nothing is no event."""
    nothing = (events.kind == Kind.PAUSE) & (events.value == 0.0)
    return events.take(~nothing) if nothing.any() else events

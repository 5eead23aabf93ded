"""Runs made by hand: what an oracle says a Program asks for, as the events of a program that prints
its numbers with three and four decimals. Nothing of drillc's proof is used."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import Any, ClassVar

import numpy as np
from drillc.language.job import Emit, Job, Signal, Weights
from drillc.planning.program import Program
from drillc.verification.events import Alternative, Events, Kind, Step, ToolFrame, blank
from drillc.verification.reading import Finding, Precision, Reader, ReadError, Run
from output.programs import named
from readers import events as oracle
from scipy.spatial.transform import Rotation

#: The statement of hole i's call stands in this line plus i, of file 0; routines in file 1.
BODY_LINE = 100


class HandReader(Reader):
    name: ClassVar[str] = "hand"
    precision: ClassVar[Precision] = Precision(
        0.0005, np.radians(0.5e-4), 0.0005, np.radians(0.5e-5), 1e-4, analog=0.5e-6
    )

    def read(self, files: Mapping[str, bytes]) -> Sequence[Run]:
        raise NotImplementedError

    def signal_name(self, signal: Signal, renamed: Mapping[str, str]) -> str:
        return f"{signal.kind} {signal.number}"

    def analog_value(self, signal: Signal, value: float) -> float:
        return value / (signal.full_scale or 1.0)


@dataclass
class HandRun(Run):
    """Events as rows (dicts of `Events` fields), and for each wait what happens without answer."""

    rows: list[dict[str, Any]]
    faults: list[list[dict[str, Any]]]  # one for each wait among the rows, in their order
    axes: tuple[str, ...] = ()
    signals: dict[str, int] = field(default_factory=dict)
    frames: list[ToolFrame] = field(default_factory=list)
    name: str = "PROGRAM"
    files: tuple[str, ...] = ("hand/body.src", "hand/routines.src")
    ends: bool = True
    error: ReadError | None = None
    pieces: int = 7

    def steps(self) -> Iterator[Step]:
        """In a few pieces, alternatives after the piece that has their waits."""
        edges = np.linspace(0, len(self.rows), self.pieces + 1).astype(int)
        wait = 0
        for a, b in pairwise(edges):
            yield table(self.rows[a:b], len(self.axes))
            for row in self.rows[a:b]:
                if row["kind"] == Kind.WAIT:
                    fault = self.faults[wait]
                    wait += 1
                    yield Alternative(
                        events=table(fault, len(self.axes)),
                        starts=np.array([0, len(fault)]),
                        call_file=np.array([row["call_file"]], dtype=np.int32),
                        call_line=np.array([row["call_line"]], dtype=np.int32),
                        file=row["file"],
                        line=row["line"],
                        timeout=True,
                        ends=self.ends,
                    )
        if self.error is not None:
            raise self.error

    def findings(self) -> Sequence[Finding]:
        return []


def table(rows: Sequence[Mapping[str, Any]], axes: int) -> Events:
    events = blank(len(rows), axes)
    for i, row in enumerate(rows):
        for name, value in row.items():
            if name not in ("hole", "role"):
                getattr(events, name)[i] = value
    return events


def printed(program: Program) -> Program:
    """The program as it can be printed: three decimals, and four of Euler angles."""
    holes = replace(program.holes, position_mm=np.round(program.holes.position_mm, 3))
    rotations = _printed(program.part_from_tool)
    motion, arm = program.motion, program.arm
    if motion is not None:
        joints = motion.joints.copy()
        for k, axis in enumerate(motion.axes):
            joints[:, k] = (
                np.radians(np.round(np.degrees(joints[:, k]), 5))
                if axis.rotary
                else np.round(joints[:, k], 3)
            )
        motion = replace(motion, joints=joints, withdraw_mm=np.round(motion.withdraw_mm, 3))
    if arm is not None:
        vias = replace(
            arm.vias,
            joints=np.radians(np.round(np.degrees(arm.vias.joints), 5)),
            position_mm=np.round(arm.vias.position_mm, 3),
            part_from_tool=_printed(arm.vias.part_from_tool),
        )
        arm = replace(arm, vias=vias)
    return replace(
        program,
        holes=holes,
        part_from_tool=rotations,
        depth_mm=np.round(program.depth_mm, 3),
        motion=motion,
        arm=arm,
    )


def _printed(rotations: Any) -> Any:
    if not len(rotations):
        return rotations
    angles = Rotation.from_matrix(rotations).as_euler("ZYX", degrees=True)
    return Rotation.from_euler("ZYX", np.round(angles, 4), degrees=True).as_matrix()


def run_of(program: Program, axes: Sequence[str] = ()) -> HandRun:
    """What a good program does. `axes`: the controller's names of a portal's joints."""
    text = printed(program)
    made = _Maker(text, list(axes) or [f"A{k}" for k in range(1, 7)])
    made.all()
    frames = [_frame("1", None), _frame("2", None)]
    if program.tool is not None:
        frames[0] = _frame(str(program.tool.number), program.tool.flange_from_tool)
    if program.frame is not None:
        frames[1] = _frame(str(program.frame.number), program.frame.world_from_part)
    return HandRun(made.rows, made.faults, tuple(made.axes), made.signals, frames)


def _frame(name: str, pose: Any) -> ToolFrame:
    if pose is None:
        return ToolFrame(name)
    return ToolFrame(name, pose.rotation, pose.translation_mm)


@dataclass
class _Maker:
    program: Program
    axes: list[str]
    rows: list[dict[str, Any]] = field(default_factory=list)
    faults: list[list[dict[str, Any]]] = field(default_factory=list)
    signals: dict[str, int] = field(default_factory=dict)

    def all(self) -> None:
        program = self.program
        cycles = [s.cycle for s in program.sections for _ in range(s.start, s.stop)]
        starts = {s.start for s in program.sections if s.stop > s.start}
        n = len(program.holes)
        if program.arm is not None:
            whole = oracle.expected(program, home=True)
            self._arm(whole, cycles)
            return
        self._body([oracle.Move(False)] if program.motion is None else [], 0, 1)
        for row in range(n):
            process = program.cycles[cycles[row]].process
            if program.motion is None and row in starts:
                there = oracle._pose(program, row, -process.approach_mm)
                self._body([oracle.Move(False, there)], row, BODY_LINE + row)
            self._hole(row, cycles[row])
        if program.motion is not None:  # nobody knows where the other axes are before they move
            feed = program.motion.feed_axis
            first = self.rows[0]["joints"]
            self.rows[0]["joints"] = [q if k == feed else np.nan for k, q in enumerate(first)]
        else:
            self._body([oracle.Move(False)], n - 1, BODY_LINE + n)

    def _arm(self, whole: list[oracle.Event], cycles: list[int]) -> None:
        """Vias of the oracle's list, and its holes' steps in turn."""
        at = 0
        for row in range(len(cycles)):
            steps: list[oracle.Event] = []
            oracle._hole(self.program, row, cycles[row], (), oracle.World(), steps)
            while not _same(whole[at], steps[0]):
                self._body([whole[at]], row, BODY_LINE + row)
                at += 1
            at += len(steps)
            self._hole(row, cycles[row])
        for event in whole[at:]:
            self._body([event], len(cycles) - 1, BODY_LINE + len(cycles))

    def _hole(self, row: int, cycle: int) -> None:
        steps: list[oracle.Event] = []
        before = self._last_joints()
        if before is not None:
            steps.append(oracle.Move(True, joints=before))
        fresh = len(steps)
        oracle._hole(self.program, row, cycle, self.axes, oracle.World(), steps)
        for k, event in enumerate(steps[fresh:]):
            self.rows.append(self._row(event, row, 10 + 100 * cycle + k))
            if isinstance(event, oracle.Await):
                self.faults.append(self._fault(row, cycle, event, before))

    def _fault(self, row: int, cycle: int, wait: oracle.Await, before: Any) -> list[dict[str, Any]]:
        steps: list[oracle.Event] = [] if before is None else [oracle.Move(True, joints=before)]
        try:
            oracle._hole(self.program, row, cycle, self.axes, oracle.World({wait.signal: 0}), steps)
        except oracle.TimedOutError:
            steps.append(oracle.Stop())
        came = next(i for i, e in enumerate(steps) if isinstance(e, oracle.Await) and not e.came)
        return [self._row(event, row, 60) for event in steps[came + 1 :]]

    def _last_joints(self) -> dict[str, float] | None:
        if self.program.motion is None:
            return None
        for row in reversed(self.rows):
            if row["kind"] in (Kind.STRAIGHT, Kind.JOINTS):
                return dict(zip(self.axes, row["joints"], strict=True))
        return None

    def _body(self, events: Sequence[oracle.Event], row: int, line: int) -> None:
        for event in events:
            made = self._row(event, row, line)
            made.update(file=0, call_line=line)
            self.rows.append(made)

    def _row(self, event: oracle.Event, hole: int, line: int) -> dict[str, Any]:
        row: dict[str, Any] = {
            "file": 1,
            "line": line,
            "call_file": 0,
            "call_line": BODY_LINE + hole,
            "hole": hole,
        }
        match event:
            case oracle.Move(pose=None, joints=None):
                row["kind"] = Kind.HOME
            case oracle.Move():
                by_joints = not event.straight and event.pose is not None and not event.joints
                row["kind"] = Kind.JOINTS if by_joints or event.joints else Kind.STRAIGHT
                if event.joints is not None:
                    row["joints"] = [event.joints[axis] for axis in self.axes]
                    if self.program.arm is not None:
                        row["tool"] = 0
                    if event.pose is None and self.program.arm is None and event.speed:
                        row["speed_mm_s"] = event.speed
                elif event.pose is not None:
                    row["position_mm"] = event.pose[:3, 3]
                    row["rotation"] = event.pose[:3, :3]
                    row.update(tool=0, base=1)
                    if not by_joints:
                        row["speed_mm_s"] = event.speed
            case oracle.Output():
                row.update(kind=Kind.OUTPUT, value=float(event.on))
                row.update(signal=self._signal(event.signal), role=event.signal)
            case oracle.Analog():
                full = self.program.signals[event.signal].full_scale or 1.0
                row.update(kind=Kind.ANALOG, value=round(event.value / full, 6))
                row.update(signal=self._signal(event.signal), role=event.signal)
            case oracle.Pause():
                row.update(kind=Kind.PAUSE, value=event.seconds)
            case oracle.Await():
                row.update(kind=Kind.WAIT, value=1.0, timeout_s=event.timeout_s)
                row.update(signal=self._signal(event.signal), role=event.signal)
            case oracle.Message():
                row["kind"] = Kind.MESSAGE
            case oracle.Stop():
                row["kind"] = Kind.STOP
        return row

    def _signal(self, role: str) -> int:
        signal = self.program.signals[role]
        name = f"{signal.kind} {signal.number}"
        return self.signals.setdefault(name, len(self.signals))


def _same(one: oracle.Event, two: oracle.Event) -> bool:
    return (
        isinstance(one, oracle.Move)
        and isinstance(two, oracle.Move)
        and one.joints is None
        and one.straight == two.straight
        and one.pose is not None
        and two.pose is not None
        and bool(np.array_equal(one.pose, two.pose))
    )


def job_of(program: Program, robot: Any = None) -> Job:
    """A job with nothing in it but what the program itself says."""
    return Job(
        program=named(program.name, 1),
        part=None,  # type: ignore[arg-type]
        tool=program.tool,
        robot=robot if program.arm is None else program.arm.arm,
        fixtures=(),
        signals=program.signals,
        processes=tuple(cycle.process for cycle in program.cycles),
        regions=(),
        holes=program.holes,
        heading_jump_max_rad=None,
        order_shortest=False,
        weights=Weights(),
        expects=(),
        emits=(),
        inputs=(),
    )


def emit_of(axes: Mapping[str, str] | None = None) -> Emit:
    pairs = tuple((named(q, 1), named(a, 1)) for q, a in (axes or {}).items())
    return Emit(named("hand", 1), (), pairs)

"""What a robot program does, free of its language: the common ground of the mini readers.

A reader runs a program's text and lists events. `expected` lists what a `Program` asks for, with
scipy's rotations and arithmetic of its own. Both say places as poses (4, 4) in part coordinates, or
as joints by axis, so that a test compares matrices and numbers, never texts.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from drillc.planning.program import (
    Dwell,
    MoveTo,
    Plunge,
    Program,
    SetAnalog,
    StartSpindle,
    Step,
    StopSpindle,
    SwitchOutput,
    WaitInput,
)

Matrix = np.ndarray[Any, np.dtype[np.float64]]


class ReadError(AssertionError):
    """The text is not what the reader's language allows."""


@dataclass(frozen=True, eq=False)
class Move:
    """`pose` or `joints` is given, or neither for home. `straight`: along a line, at `speed` mm/s.

    `speed` is None where the language states only a share of full speed. An expected move of an
    arm's axes has both pose and joints. `configuration`: what the target says of the arm's posture,
    in the language's own numbers, where the move goes by it.
    """

    straight: bool
    pose: Matrix | None = None
    joints: Mapping[str, float] | None = None
    speed: float | None = None
    tool: str = ""
    frame: str = ""
    configuration: tuple[int, ...] = ()


@dataclass(frozen=True)
class Output:
    signal: str
    on: bool


@dataclass(frozen=True)
class Analog:
    signal: str
    value: float


@dataclass(frozen=True)
class Pause:
    seconds: float


@dataclass(frozen=True)
class Await:
    signal: str
    timeout_s: float
    came: bool


@dataclass(frozen=True)
class Message:
    text: str


@dataclass(frozen=True)
class Stop:
    """The program has ended, and pressing start does not make it go on."""


Event = Move | Output | Analog | Pause | Await | Message | Stop


@dataclass
class World:
    """The machine that a reader moves: inputs come at once, save those in `dead`.

    `dead_after` lets an input come that many times before it dies.
    """

    dead: Mapping[str, int] = field(default_factory=dict)
    joints: dict[str, float] = field(default_factory=dict)
    asked: dict[str, int] = field(default_factory=dict)

    def comes(self, signal: str) -> bool:
        self.asked[signal] = self.asked.get(signal, 0) + 1
        return signal not in self.dead or self.asked[signal] <= self.dead[signal]


# ── what a Program asks for ──────────────────────────────────────────────────────────────────────


def pecks(depth: float, step: Plunge) -> Iterator[tuple[float, float]]:
    """(place, speed) of a plunge, from the definition in planning/program.py."""
    if step.peck_mm is not None:
        count = math.ceil((depth - step.from_mm - 0.001) / step.peck_mm)
        for k in range(1, count):
            bottom = step.from_mm + k * step.peck_mm
            yield bottom, step.feed_mm_s
            yield step.from_mm, step.return_mm_s
            yield bottom - step.peck_gap_mm, step.return_mm_s
    yield depth, step.feed_mm_s


class TimedOutError(Exception):
    """An expected wait ends the expected program."""


def expected(
    program: Program,
    *,
    axes: Sequence[str] = (),
    parts: Sequence[range] = (),
    home: bool,
    dead: Mapping[str, int] | None = None,
) -> list[Event]:
    """The events of a whole program, `parts` after one another; `dead` speaks in roles.

    Without `home` a program in poses begins and ends wherever it is; one for an arm makes its vias,
    and its parts follow on one another. What a program in joints does before its first hole and
    after its last depends on where the machine stands, so tests state it.
    """
    world = World(dead or {})
    events: list[Event] = []
    try:
        if program.arm is not None:
            _with_vias(program, world, events)
            return events
        for part in parts or [range(len(program.holes))]:
            events += [Move(False)] if home else []
            for section in program.sections:
                rows = [row for row in part if section.start <= row < section.stop]
                for row in rows:
                    if program.motion is None and row == rows[0]:
                        cycle = program.cycles[section.cycle]
                        there = _pose(program, row, -cycle.process.approach_mm)
                        events.append(Move(False, there, speed=cycle.process.travel_mm_s))
                    _hole(program, row, section.cycle, axes, world, events)
            events += [Move(False)] if home else []
    except TimedOutError:
        events.append(Stop())
    return events


def _with_vias(program: Program, world: World, events: list[Event]) -> None:
    """From home, where there is one, the holes in order, each after its vias; what follows the last
    hole is of its process."""
    assert program.arm is not None
    vias, last = program.arm.vias, len(program.holes)
    home = program.arm.arm.home_rad
    if home is not None and not (len(vias.joints) and np.array_equal(vias.joints[0], home)):
        degrees = (home * 180.0 / math.pi).tolist()
        events.append(Move(False, None, {f"A{k + 1}": degrees[k] for k in range(6)}))
    cycles = [s.cycle for s in program.sections for _ in range(s.start, s.stop)]
    for row in range(last + 1):
        travel = program.cycles[cycles[min(row, last - 1)]].process.travel_mm_s
        for i in [i for i, before in enumerate(vias.before.tolist()) if before == row]:
            pose = np.eye(4)
            pose[:3, :3], pose[:3, 3] = vias.part_from_tool[i], vias.position_mm[i]
            degrees = (vias.joints[i] * 180.0 / math.pi).tolist()
            joints = {f"A{k + 1}": degrees[k] for k in range(6)} if vias.by_joints[i] else None
            events.append(Move(joints is None, pose, joints, travel))
        if row < last:
            _hole(program, row, cycles[row], (), world, events)


def _pose(program: Program, row: int, depth: float) -> Matrix:
    pose = np.eye(4)
    pose[:3, :3] = program.part_from_tool[row]
    pose[:3, 3] = program.holes.position_mm[row] + depth * program.part_from_tool[row][:, 2]
    return pose


def joints_at(program: Program, row: int, depth: float, axes: Sequence[str]) -> dict[str, float]:
    """Joints in mm and degrees by axis, the feed joint moved by `depth`."""
    motion = program.motion
    assert motion is not None
    values = motion.joints[row].copy()
    for i, axis in enumerate(motion.axes):
        if axis.rotary:
            values[i] = values[i] * 180.0 / math.pi
    values[motion.feed_axis] += motion.feed_sign * depth
    return dict(zip(axes, values.tolist(), strict=True))


def _hole(
    program: Program,
    row: int,
    index: int,
    axes: Sequence[str],
    world: World,
    events: list[Event],
) -> None:
    cycle = program.cycles[index]
    motion = program.motion
    travel = cycle.process.travel_mm_s

    def go(depth: float, speed: float) -> None:
        if motion is None:
            events.append(Move(True, _pose(program, row, depth), speed=speed))
        else:
            events.append(Move(True, joints=joints_at(program, row, depth, axes), speed=speed))

    if motion is not None:
        feed, out = axes[motion.feed_axis], float(motion.withdraw_mm[row])
        moves = [event for event in events if isinstance(event, Move) and event.joints]
        before = dict(moves[-1].joints or {}) if moves else joints_at(program, row, 0.0, axes)
        events.append(Move(True, joints={**before, feed: out}, speed=travel))
        there = joints_at(program, row, 0.0, axes)
        events.append(Move(False, joints={**there, feed: out}, speed=travel))
    go(-cycle.process.approach_mm, travel)

    def wait(role: str, timeout_s: float) -> None:
        if world.comes(role):
            events.append(Await(role, timeout_s, True))
            return
        events.append(Await(role, timeout_s, False))
        do(cycle.fault)
        events.append(Message(f"{cycle.process.name} {role}"))
        raise TimedOutError

    def do(steps: Sequence[Step]) -> None:
        for step in steps:
            match step:
                case MoveTo():
                    go(step.depth_mm, step.speed_mm_s)
                case Plunge():
                    for place, speed in pecks(float(program.depth_mm[row]), step):
                        go(place, speed)
                case StartSpindle():
                    if "spindle_speed" in program.signals:
                        events.append(Analog("spindle_speed", step.rev_s))
                    events.append(Output("spindle_on", True))
                    if "spindle_running" in program.signals:
                        wait("spindle_running", step.timeout_s)
                case StopSpindle():
                    events.append(Output("spindle_on", False))
                    if "spindle_speed" in program.signals:
                        events.append(Analog("spindle_speed", 0.0))
                case Dwell():
                    events.append(Pause(step.seconds))
                case SwitchOutput():
                    events.append(Output(step.role, step.on))
                case SetAnalog():
                    events.append(Analog(step.role, step.value))
                case WaitInput():
                    wait(step.role, step.timeout_s)

    do(cycle.steps)


# ── comparison ───────────────────────────────────────────────────────────────────────────────────


def compare(
    found: Sequence[Event],
    wanted: Sequence[Event],
    *,
    mm: float,
    deg: float,
    joint_mm: float = 0.0015,
    share: float = 2e-4,
) -> None:
    """Event by event: same kinds in the same order, places and values within tolerances."""
    for place, (one, two) in enumerate(zip(found, wanted, strict=False)):
        where = f"event {place}: found {one}, wanted {two}"
        assert type(one) is type(two), where
        match one, two:
            case Move(), Move():
                _compare_moves(one, two, where, mm, deg, joint_mm, share)
            case Analog(), Analog():
                assert one.signal == two.signal, where
                assert math.isclose(one.value, two.value, rel_tol=share, abs_tol=1e-9), where
            case Message(), Message():
                assert all(word in one.text for word in two.text.split()), where
            case _:
                assert one == two, where
    assert len(found) == len(wanted), (
        f"found {len(found)} events, wanted {len(wanted)}; the first too many:"
        f" {(list(found[len(wanted) :]) or list(wanted[len(found) :]))[0]}"
    )


def _compare_moves(
    one: Move, two: Move, where: str, mm: float, deg: float, joint_mm: float, share: float
) -> None:
    assert (one.pose is None) == (two.pose is None), where
    assert (one.joints is None) == (two.joints is None), where
    if two.pose is not None and one.pose is not None:
        assert one.straight == two.straight, where
        assert np.abs(one.pose[:3, 3] - two.pose[:3, 3]).max() <= mm, where
        turn = one.pose[:3, :3].T @ two.pose[:3, :3]
        # the sine of the angle keeps its digits where the cosine has none
        sine = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
        angle = math.degrees(math.atan2(float(np.linalg.norm(sine)), float(np.trace(turn)) - 1.0))
        assert angle <= deg, f"{where}: turned by {angle} deg"
    if two.joints is not None and one.joints is not None:
        assert set(one.joints) == set(two.joints), where
        for axis, value in two.joints.items():
            assert abs(one.joints[axis] - value) <= joint_mm, f"{where}: {axis}"
    if one.speed is not None and two.speed is not None:
        assert math.isclose(one.speed, two.speed, rel_tol=share), where

"""What is being proven, and how exact a printed program can be."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Arm, Emit, Job, Portal
from drillc.language.source import Span
from drillc.planning.program import Program

from .events import Events, Floats
from .expected import Wanted, Words, unknown_role
from .places import Machine
from .reading import Precision, Run
from .verdict import Rows, Tally
from .visits import Path

#: What floating point makes of positions (mm), angles, and shares of a value.
NOISE_MM, NOISE_RAD, NOISE_SHARE = 1e-6, 1e-8, 1e-8
#: An arm whose joints move in proportion is straight between two places no better than this, on
#: the tool's axis and on travels; and turned no better.
CHORD_MM, TRAVEL_CHORD_MM, CHORD_RAD = 0.0125, 0.3, 1e-3
#: By what share it is faster or slower on the tool's axis.
CHORD_SPEED = 0.01
#: Of a chord so long, nothing is known of the speed: both of its ends are rounded.
CHORD_ROUNDED_MM = 4e-3
#: Times are printed in milliseconds, some of them rounded up.
TIME_S = 1e-3 + 1e-9


@dataclass(frozen=True, eq=False)
class Limits:
    """How far what is printed may be from what is planned, by hole (n,), in mm and radians; a speed
    by a share of itself and by so many mm/s, an analog value as the controller counts it."""

    position_mm: Floats
    angle_rad: Floats
    depth_mm: Floats
    straight_mm: Floats
    speed_share: float
    speed_mm_s: float
    analog: float

    def speeds(self, asked_mm_s: Floats) -> Floats:
        """By what share speeds may differ from those that are asked for."""
        return np.asarray(self.speed_share + self.speed_mm_s / asked_mm_s + NOISE_SHARE)

    def analogs(self, asked: float) -> float:
        """By how much an analog value may differ from the one that is asked for."""
        return self.analog + NOISE_SHARE * max(abs(asked), 1.0)


@dataclass(frozen=True, eq=False)
class Case:
    """One program, its run, and what is known of both."""

    job: Job
    program: Program
    emit: Emit
    run: Run
    wanted: Wanted
    words: Words
    machine: Machine
    precision: Precision
    limits: Limits
    tally: Tally
    states_loads: bool  # whether a program says what its tool weighs
    #: Where a part of a program in poses begins or ends: whether it goes home there, and the event.
    homes: list[tuple[bool, Path]] = field(default_factory=list)

    @property
    def by_joints(self) -> bool:
        """Whether all moves are given by joints: a portal's, or an arm's without poses."""
        return self.machine.known and (self.program.motion is not None or self.arm_by_joints)

    @property
    def arm_by_joints(self) -> bool:
        """Whether an arm's ways are given by its joints, in short pieces."""
        return arm_by_joints(self.program, self.run)

    def hole(self, row: int) -> str:
        """What the spec calls a hole."""
        return str(self.program.holes.ids[row])

    def span(self, row: int) -> Span | None:
        """Where a hole is written."""
        return self.program.holes.span(row) if len(self.program.holes.sources) else None

    def signal(self, number: int) -> str:
        """What the program calls a signal."""
        return next((name for name, n in self.run.signals.items() if n == number), "a signal")

    def fail(
        self,
        check: str,
        message: str,
        path: Path,
        event: int,
        hole: int | None = None,
        *,
        body: bool = False,
        span: Span | None = None,
        alike: int = 0,
    ) -> None:
        """A failure at an event: at its own statement, or in the program's `body`."""
        events = path.events
        file, line = (events.call_file, events.call_line) if body else (events.file, events.line)
        self.tally.fail(
            check,
            message,
            hole=None if hole is None else self.hole(hole),
            file=int(file[event]),
            line=int(line[event]),
            span=span or (None if hole is None else self.span(hole)),
            alike=alike,
        )

    def figures(
        self,
        check: str,
        errors: Floats,
        limits: Floats | float,
        path: Path,
        event: Rows,
        hole: Rows,
        say: Callable[[int], tuple[str, Span | None]],
        *,
        body: bool = False,
    ) -> None:
        """Compare errors (k,) at events of holes; failures of one hole, or by one line, are told as
        one, that which is worst. `say` names one of them, and where the spec asks for it."""
        events = path.events
        file, line = (events.call_file, events.call_line) if body else (events.file, events.line)

        def place(k: int) -> tuple[str | None, int, int]:
            return self.hole(int(hole[k])), int(file[event[k]]), int(line[event[k]])

        bad = self.tally.figures(check, errors, limits, place)
        if not len(bad):
            return
        share = np.nan_to_num(errors[bad] / np.broadcast_to(limits, errors.shape)[bad], nan=np.inf)
        bad = bad[np.argsort(-share, kind="stable")]
        _, worst = np.unique(hole[bad], return_index=True)  # the first of each hole is its worst
        bad = bad[np.sort(worst)]
        lines = file[event[bad]].astype(np.int64) * (1 << 32) + line[event[bad]]
        _, first, counts = np.unique(lines, return_index=True, return_counts=True)
        order = np.argsort(first, kind="stable")
        for done, i in enumerate(order.tolist()):
            if self.tally.full(check):
                self.tally.more(check, int(counts[order[done:]].sum()))
                return
            k = int(bad[first[i]])
            message, span = say(k)
            alike = int(counts[i]) - 1
            self.fail(
                check, message, path, int(event[k]), int(hole[k]), body=body, span=span, alike=alike
            )


def arm_by_joints(program: Program, run: Run) -> bool:
    """Whether the controller knows no poses: it calls its axes by letters."""
    return program.arm is not None and all(len(axis) == 1 for axis in run.axes)


def limits_of(
    program: Program, machine: Machine, precision: Precision, by_joints: bool, arm: bool
) -> Limits:
    """What rounding explains. Three coordinates that are each off by half a digit make √3 of it;
    three angles no more than their sum."""
    n = len(program.holes)
    if by_joints and n:
        joints = program.motion.joints if program.motion is not None else program.arm.joints  # type: ignore[union-attr]
        moved, turned = machine.rounding(joints, precision)
        chord, chord_rad = (CHORD_MM, CHORD_RAD) if arm else (0.0, 0.0)
        position = moved + chord + NOISE_MM
        depth = position + precision.joint_mm + (precision.length_mm if arm else 0.0)
        return Limits(
            position,
            turned + chord_rad + NOISE_RAD,
            depth,
            position + CHORD_MM * arm,
            CHORD_SPEED if arm else precision.speed_share,
            precision.speed_mm_s,
            precision.analog,
        )
    half = np.sqrt(3.0) * precision.length_mm
    return Limits(
        np.full(n, half + NOISE_MM),
        np.full(n, 3.0 * precision.angle_rad + NOISE_RAD),
        np.full(n, half + precision.length_mm + NOISE_MM),
        np.full(n, 2.0 * half + NOISE_MM),
        precision.speed_share,
        precision.speed_mm_s,
        precision.analog,
    )


def joint_limits(case: Case) -> tuple[Floats, Floats, tuple[str, ...]]:
    """Lowest and highest (k,) of the machine's joints, and their names."""
    robot = case.program.arm.arm if case.program.arm is not None else case.job.robot
    if not isinstance(robot, Portal | Arm) or not len(case.machine.columns):
        return np.empty(0), np.empty(0), ()
    low = np.array([limit.low for limit in robot.limits])
    high = np.array([limit.high for limit in robot.limits])
    names = tuple(f"q{k + 1}" if isinstance(robot, Portal) else f"A{k + 1}" for k in range(6))
    return low, high, names


def half_digit(case: Case) -> Floats:
    """Half of the last digit of each joint (k,), mm and radians."""
    precision = case.precision
    return np.where(case.machine.scale != 1.0, precision.joint_rad, precision.joint_mm)


def roles_of(case: Case, events: Events) -> NDArray[np.int32]:
    """The role (n,) of each event's signal; -1 where there is none."""
    table = np.full(max(case.run.signals.values(), default=-1) + 2, -1, dtype=np.int32)
    numbers = np.arange(len(table) - 1, dtype=np.int32)
    table[:-1] = unknown_role(numbers)
    for name, number in case.run.signals.items():
        if name in case.words.signals:
            table[number] = case.words.signals[name]
    return table[np.where(events.signal < 0, len(table) - 1, events.signal)]

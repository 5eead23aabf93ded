"""Hand-made Programs and Emits for tests of the output stage: no parser, no planner.

`from output.programs import joint_rivet, pose_drill, emit_of, …`. All values are chosen, not
computed by drillc, so that a test can state what the emitted text must say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from drillc.language.job import (
    Clamp,
    Drill,
    Emit,
    Floats,
    Handshake,
    HoleTable,
    Named,
    Pose,
    Process,
    Rivet,
    Setting,
    Signal,
    Tool,
    WorkFrame,
)
from drillc.language.source import Source, Span
from drillc.planning.program import (
    Cycle,
    Dwell,
    JointAxis,
    JointMotion,
    MoveTo,
    Plunge,
    Program,
    Section,
    SetAnalog,
    StartSpindle,
    Step,
    StopSpindle,
    SwitchOutput,
    WaitInput,
)

#: The text that spans point into; long enough for every line and column used here.
SOURCE = Source(
    Path("cell.drill"), "cell.drill", "\n".join(f"line {i:04d} of it" for i in range(1, 4000))
)


def span(line: int, column: int = 1, length: int = 4) -> Span:
    """A place in SOURCE."""
    return Span(SOURCE, line, column, length)


def named(text: str, line: int = 90) -> Named:
    return Named(text, span(line, 6, len(text)))


def emit_of(
    post: str,
    axes: Mapping[str, str] | None = None,
    *,
    line: int = 90,
    **settings: float | str | tuple[float, str],
) -> Emit:
    """`emit post { axes {…} name value … }`: a tuple is (value in base units, unit as written)."""
    given = []
    for i, (name, value) in enumerate(settings.items()):
        number, unit = value if isinstance(value, tuple) else (value, "")
        given.append(Setting(named(name, line + 1 + i), number, unit, span(line + 1 + i)))
    pairs = (axes or {}).items()
    mapped = tuple((named(joint, line + 20), named(axis, line + 20)) for joint, axis in pairs)
    return Emit(named(post, line), tuple(given), mapped)


# ── holes ────────────────────────────────────────────────────────────────────────────────────────


def hole_table(ids: Sequence[str], position_mm: Floats, feed: Floats) -> HoleTable:
    """Hole i is written in line 100 + i, column 5."""
    n = len(ids)
    return HoleTable(
        ids=np.array(ids, dtype=np.str_) if n else np.zeros(0, dtype="<U1"),
        position_mm=position_mm,
        feed=feed,
        diameter_mm=np.full(n, np.nan),
        stack_mm=np.full(n, np.nan),
        region=np.zeros(n, dtype=np.int32),
        source=np.zeros(n, dtype=np.int32),
        line=(100 + np.arange(n)).astype(np.int32),
        column=np.full(n, 5, dtype=np.int32),
        sources=(SOURCE,),
    )


def some_ids(n: int) -> list[str]:
    return [f"P{i + 1}" for i in range(n)]


# ── signals, processes, cycles ───────────────────────────────────────────────────────────────────

_SIGNALS = {
    "spindle_on": ("output", 11, None, "do_spindle_on"),
    "spindle_speed": ("analog", 1, 200.0, "ao_spindle_speed"),  # rev/s at full scale
    "spindle_running": ("input", 12, None, "di_spindle_running"),
    "clamp": ("output", 13, None, "do_clamp"),
    "clamped": ("input", 14, None, "di_clamped"),
    "released": ("input", 15, None, "di_released"),
    "clamp_force": ("analog", 2, 2000.0, "ao_clamp_force"),  # N at full scale
    "set": ("output", 16, None, "do_set"),
    "set_done": ("input", 17, None, "di_set_done"),
}


def signals() -> dict[str, Signal]:
    return {
        role: Signal(role, kind, number, full, alias, span(20 + i))  # type: ignore[arg-type]
        for i, (role, (kind, number, full, alias)) in enumerate(_SIGNALS.items())
    }


def drill_cycle(
    name: str = "drill6", *, peck_mm: float | None = None, clamp: bool = False, line: int = 40
) -> Cycle:
    """Approach 60 mm, feed from -2 mm at 5 mm/s, dwell 0.5 s, back to -60 mm."""
    handshake = Handshake(3.0, span(line + 1))
    process = Process(
        name=name,
        span=span(line),
        approach_mm=60.0,
        clearance_mm=2.0,
        retract_mm=60.0,
        travel_mm_s=250.0,
        approach_mm_s=100.0,
        retract_mm_s=150.0,
        clamp=Clamp(800.0, handshake) if clamp else None,
        drill=Drill(50.0, 5.0, 12.0, False, peck_mm, 0.5),
    )
    clamping: tuple[Step, ...] = (
        SetAnalog("clamp_force", 800.0),
        SwitchOutput("clamp", True),
        WaitInput("clamped", 3.0),
    )
    letting_go: tuple[Step, ...] = (SwitchOutput("clamp", False), WaitInput("released", 3.0))
    steps: tuple[Step, ...] = (
        StartSpindle(50.0, 4.0),
        *(clamping if clamp else ()),
        MoveTo(-2.0, 100.0),
        Plunge(-2.0, 5.0, 150.0, peck_mm, 0.5),
        Dwell(0.5),
        MoveTo(-2.0, 150.0),
        MoveTo(-60.0, 150.0),
        *(letting_go if clamp else ()),
        StopSpindle(),
    )
    fault: tuple[Step, ...] = (
        StopSpindle(),
        *((SwitchOutput("clamp", False),) if clamp else ()),
        MoveTo(-60.0, 150.0),
    )
    return Cycle(process, steps, fault)


def rivet_cycle(name: str = "rivet", *, line: int = 60) -> Cycle:
    """Approach 40 mm, clamp, set the rivet, let go, back to -50 mm."""
    handshake = Handshake(3.0, span(line + 1))
    process = Process(
        name=name,
        span=span(line),
        approach_mm=40.0,
        clearance_mm=0.0,
        retract_mm=50.0,
        travel_mm_s=300.0,
        approach_mm_s=80.0,
        retract_mm_s=120.0,
        clamp=Clamp(800.0, handshake),
        rivet=Rivet(handshake),
    )
    steps: tuple[Step, ...] = (
        MoveTo(0.0, 80.0),
        SetAnalog("clamp_force", 800.0),
        SwitchOutput("clamp", True),
        WaitInput("clamped", 3.0),
        SwitchOutput("set", True),
        WaitInput("set_done", 5.0),
        SwitchOutput("set", False),
        SwitchOutput("clamp", False),
        WaitInput("released", 3.0),
        MoveTo(-50.0, 120.0),
    )
    fault: tuple[Step, ...] = (
        SwitchOutput("set", False),
        SwitchOutput("clamp", False),
        MoveTo(-50.0, 120.0),
    )
    return Cycle(process, steps, fault)


def visit_cycle(name: str = "visit", *, line: int = 80) -> Cycle:
    """Only there and back: no drill, no rivet, no signal."""
    process = Process(name, span(line), 25.0, 0.0, 25.0, 200.0, 50.0, 100.0)
    return Cycle(process, (MoveTo(0.0, 50.0), MoveTo(-25.0, 100.0)), ())


# ── programs ─────────────────────────────────────────────────────────────────────────────────────


def _sections(counts: Sequence[tuple[str, int, int]]) -> tuple[Section, ...]:
    """(region, cycle, holes) … in order; region k is written in line 70 + k."""
    sections, at = [], 0
    for k, (region, cycle, count) in enumerate(counts):
        sections.append(Section(region, cycle, at, at + count, span(70 + k)))
        at += count
    return tuple(sections)


def _rotations(n: int) -> Floats:
    """n proper rotations that differ from each other, without help from the code under test."""
    from scipy.spatial.transform import Rotation

    angles = np.stack(
        [20.0 + 3.0 * np.arange(n), -40.0 + 1.5 * np.arange(n) % 80, 10.0 + 0.7 * np.arange(n)], 1
    )
    matrices: Floats = Rotation.from_euler("ZYX", angles, degrees=True).as_matrix().reshape(n, 3, 3)
    return matrices


def pose_program(
    sections: Sequence[tuple[str, int, int]],
    cycles: Sequence[Cycle],
    *,
    name: str = "PANEL_7L",
    ids: Sequence[str] | None = None,
) -> Program:
    """A program in poses: (region, index of the cycle, number of holes) per section."""
    n = sum(count for _, _, count in sections)
    rotations = _rotations(n) if n else np.zeros((0, 3, 3))
    steps = np.arange(n, dtype=np.float64)
    row, column = np.divmod(steps, 500)
    position = np.stack(
        [
            240.0 + 36.5 * column,
            2379.0 - 43.25 * column,
            -542.0 + 0.125 * (steps % 2000) + 30.0 * (row % 1000),
        ],
        1,
    )
    tool = Tool(
        named("ee90", 5),
        number=3,
        flange_from_tool=Pose(
            np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]),
            np.array([-350.0, 0.0, 250.0]),
        ),
        mass_kg=None,
        centre_of_gravity_mm=None,
    )
    return Program(
        name=name,
        frame=WorkFrame(2, None, span(6)),
        tool=tool,
        signals=signals(),
        cycles=tuple(cycles),
        sections=_sections(sections),
        holes=hole_table(ids or some_ids(n), position, rotations[:, :, 2].copy()),
        part_from_tool=rotations,
        depth_mm=12.0 + 0.25 * (steps % 4),
        motion=None,
    )


#: The portal's joints as the design's example maps them.
PORTAL_AXES = {"q1": "U", "q2": "V", "q3": "A", "q4": "X", "q5": "Y", "q6": "Z"}


def joint_program(
    sections: Sequence[tuple[str, int, int]],
    cycles: Sequence[Cycle],
    *,
    name: str = "PORTAL_A",
    ids: Sequence[str] | None = None,
    feed_sign: int = 1,
) -> Program:
    """A program in the portal's six joints (q3 turns); the tool moves along q6."""
    n = sum(count for _, _, count in sections)
    i = np.arange(n, dtype=np.float64)
    joints = np.stack(
        [
            46.3 + 11.25 * (i % 500),
            4953.7 - 7.5 * (i % 500),
            np.radians(110.0 - 1.25 * i % 60),
            5619.9 + 33.3 * i % 2000,
            290.5 - 21.7 * i % 700,
            2611.4 + 0.8 * i % 100,
        ],
        axis=1,
    )
    return Program(
        name=name,
        frame=None,
        tool=None,
        signals=signals(),
        cycles=tuple(cycles),
        sections=_sections(sections),
        holes=hole_table(
            ids or [f"R{k + 1}" for k in range(n)],
            np.zeros((n, 3)),
            np.tile([0.0, 0.0, 1.0], (n, 1)),
        ),
        part_from_tool=np.tile(np.eye(3), (n, 1, 1)),
        depth_mm=12.0 + 0.25 * (i % 4),
        motion=JointMotion(
            axes=tuple(JointAxis(f"q{k}", rotary=k == 3) for k in range(1, 7)),
            joints=joints,
            feed_axis=5,
            feed_sign=1 if feed_sign > 0 else -1,
            withdraw_mm=joints[:, 5] - feed_sign * (400.0 + i % 5),
            speeds=(500.0, 500.0, 0.5, 500.0, 500.0, 400.0),
        ),
    )


def pose_drill(n: int = 3, **options: object) -> Program:
    """One region, one drill process, in poses."""
    return pose_program([("upper", 0, n)], [drill_cycle(**options)])  # type: ignore[arg-type]


def joint_rivet(n: int = 3, *, feed_sign: int = 1) -> Program:
    """One region, one rivet process, in joints."""
    return joint_program([("plate", 0, n)], [rivet_cycle()], feed_sign=feed_sign)


def joint_drill(n: int = 3, *, feed_sign: int = 1, **options: object) -> Program:
    """One region, one drill process, in joints."""
    cycle = drill_cycle(**options)  # type: ignore[arg-type]
    return joint_program([("plate", 0, n)], [cycle], feed_sign=feed_sign)


def mixed(program_of: object = pose_program, counts: tuple[int, int, int] = (4, 3, 5)) -> Program:
    """Three sections and two processes; the third section goes on with the first process."""
    make = joint_program if program_of is joint_program else pose_program
    a, b, c = counts
    return make(
        [("upper", 0, a), ("lower", 1, b), ("rim", 0, c)], [drill_cycle(peck_mm=3.0), rivet_cycle()]
    )


def without_signal(program: Program, role: str) -> Program:
    return replace(program, signals={r: s for r, s in program.signals.items() if r != role})


def with_ids(program: Program, ids: Sequence[str]) -> Program:
    return replace(program, holes=replace(program.holes, ids=np.array(ids, dtype=np.str_)))

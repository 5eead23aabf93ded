"""drillc's reader against the mini reader of the tests, which shares no code with it.

Both run the same emitted programs; every event of the one has to be the other's.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from drillc.driver import plan_spec
from drillc.language.diagnostics import Report
from drillc.output.emission import emit_files
from drillc.planning.program import Program
from drillc.postprocessors.krl import KrlPost
from drillc.verification.events import Alternative, Events, Kind
from drillc.verification.krl.reader import KrlReader
from drillc.verification.reading import Run
from output.arm_programs import Way, arm_program
from output.programs import (
    drill_cycle,
    emit_of,
    joint_rivet,
    mixed,
    pose_drill,
    pose_program,
    rivet_cycle,
    visit_cycle,
)
from readers import krl as mini
from readers.events import Analog, Await, Event, Message, Move, Output, Pause, Stop, World
from verification.krl.running import ran

AXES = {"q1": "A1", "q2": "A2", "q3": "A4", "q4": "E1", "q5": "E2", "q6": "A3"}

PROGRAMS: dict[str, Callable[[], Program]] = {
    "drill": lambda: pose_drill(4),
    "many": lambda: pose_drill(40, peck_mm=3.0),
    "peck": lambda: pose_drill(6, peck_mm=3.0, clamp=True),
    "rivet": lambda: pose_program([("rim", 0, 30)], [rivet_cycle()]),
    "visit": lambda: pose_program([("rim", 0, 3)], [visit_cycle()]),
    "mixed": mixed,
    "two": lambda: pose_program(
        [("a", 0, 12), ("b", 1, 11), ("c", 0, 9)], [drill_cycle(peck_mm=2.5), rivet_cycle()]
    ),
    "none": lambda: pose_program([], []),
    "arm": lambda: arm_program([("a", 0, 14), ("b", 1, 3)], [drill_cycle(), rivet_cycle()]),
    "ways": lambda: arm_program(
        [("a", 0, 3), ("b", 0, 2)],
        [drill_cycle(peck_mm=3.0)],
        ways={1: [Way(False, (20.0, -60.0, 90.0, 30.0, 40.0, 10.0))]},
    ),
    "no_home": lambda: arm_program([("a", 0, 12)], [drill_cycle()], home_deg=None),
}


def emitted(program: Program, **settings: float) -> dict[str, bytes]:
    axes = AXES if program.motion is not None else None
    made = emit_files(KrlPost(), program, emit_of("krl", axes, **settings), Report())
    return {file.path: file.read() for file in made}


def agree(event: Event, events: Events, row: int, run: Run) -> None:
    """The mini reader's event and a row of drillc's say the same."""
    names = {number: name for name, number in run.signals.items()}
    kind = Kind(int(events.kind[row]))
    where = f"{event} and {kind.name} of line {events.line[row]}"
    value = float(events.value[row])
    match event:
        case Move() if event.pose is not None:
            assert kind == (Kind.STRAIGHT if event.straight else Kind.JOINTS), where
            assert np.abs(events.position_mm[row] - event.pose[:3, 3]).max() < 1e-9, where
            assert np.abs(events.rotation[row] - event.pose[:3, :3]).max() < 1e-12, where
            if event.straight:
                assert events.speed_mm_s[row] == pytest.approx(event.speed), where
            tool, base = (run.frames[int(c[row])].name for c in (events.tool, events.base))
            assert (tool, base) == (f"TOOL_DATA[{event.tool}]", f"BASE_DATA[{event.frame}]"), where
            said = events.configuration[row]
            assert tuple(said[~np.isnan(said)].astype(int)) == event.configuration, where
        case Move() if event.joints is not None:
            assert kind == Kind.JOINTS, where
            for axis, joint in zip(run.axes, events.joints[row].tolist(), strict=True):
                assert np.isnan(joint) or joint == pytest.approx(event.joints[axis]), where
        case Move():
            assert kind == Kind.HOME, where
        case Output(signal, on):
            assert (kind, names[int(events.signal[row])], value) == (Kind.OUTPUT, signal, on), where
        case Analog(signal, amount):
            assert (kind, names[int(events.signal[row])]) == (Kind.ANALOG, signal), where
            assert value == pytest.approx(amount), where
        case Pause(seconds):
            assert (kind, value) == (Kind.PAUSE, seconds), where
        case Await(signal, timeout_s):
            assert (kind, names[int(events.signal[row])]) == (Kind.WAIT, signal), where
            assert (value, float(events.timeout_s[row])) == (1.0, timeout_s), where
        case Message():
            assert kind == Kind.MESSAGE, where
        case Stop():
            assert kind == Kind.STOP, where


def all_agree(wanted: list[Event], events: Events, run: Run) -> None:
    for row, event in enumerate(wanted[: len(events)]):
        agree(event, events, row, run)
    assert len(wanted) == len(events)


def by_both(files: Mapping[str, bytes], name: str, home: Mapping[str, float]) -> None:
    """The main run; and what happens when each of the waits is the first that gets no answer."""
    (run,) = [r for r in KrlReader().read(files) if r.name == name]
    found = ran(run)
    assert run.findings() == []
    joints = dict.fromkeys(mini.AXES, 1.0) | dict(home)
    loaded = mini.load(files)
    main = mini.run(loaded, name, World(joints=dict(joints)), home=home)
    all_agree(main.events, found.events, run)
    waits = [e.signal for e in main.events if isinstance(e, Await)]
    late = sorted(
        (int(row), other.events.take(slice(begin, end)))
        for other in found.others
        if other.timeout
        for row, begin, end in _departures(other, found.events)
    )
    assert [row for row, _ in late] == np.flatnonzero(found.events.kind == Kind.WAIT).tolist()
    few = {0, 1, len(waits) // 2, len(waits) - 1} if len(waits) < 100 else {0, 50}
    for turn in few & set(range(len(waits))):
        times = waits[:turn].count(waits[turn])
        world = World({waits[turn]: times}, joints=dict(joints))
        dead = mini.run(loaded, name, world, home=home).events
        row, instead = late[turn]
        all_agree(dead[row + 1 :], instead, run)


def _departures(other: Alternative, events: Events) -> list[tuple[int, int, int]]:
    """For each lane the row of the wait it departs from, and its part of the alternative."""
    found = []
    for lane, line in enumerate(other.call_line.tolist()):
        here = (events.call_line == line) & (events.call_file == other.call_file[lane])
        rows = np.flatnonzero(here & (events.line == other.line) & (events.file == other.file))
        assert len(rows) == 1
        found.append((int(rows[0]), int(other.starts[lane]), int(other.starts[lane + 1])))
    return found


@pytest.mark.parametrize("name", PROGRAMS)
@pytest.mark.parametrize("size", [800, 5])
def test_emitted_programs(name: str, size: int) -> None:
    program = PROGRAMS[name]()
    by_both(emitted(program, holes_per_module=float(size)), program.name, {})


@pytest.mark.parametrize("size", [800, 5])
def test_emitted_programs_in_joints(size: int) -> None:
    program = joint_rivet(12)
    home = dict.fromkeys(mini.AXES, 10.0) | {"A3": 0.0}
    by_both(emitted(program, holes_per_module=float(size)), program.name, home)


SAMPLES = Path(__file__).parents[3] / "samples"


@pytest.mark.parametrize(
    "name", ["nacelle", "panel", pytest.param("fuselage_arm", marks=pytest.mark.slow)]
)
def test_samples(name: str) -> None:
    planned = plan_spec(SAMPLES / f"{name}.drill", None, Report())
    for program in planned.programs:
        by_both(emitted(program), program.name, {})

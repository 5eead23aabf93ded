"""Emitted programs: what the reader says they do, against a reader that shares no code with it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from drillc.language.diagnostics import Report
from drillc.language.job import Emit, Pose, WorkFrame
from drillc.output.emission import emit_files
from drillc.planning.program import Program
from drillc.postprocessors.rapid import RapidPost
from drillc.verification.events import Events, Kind
from drillc.verification.rapid.reader import RapidReader
from drillc.verification.rapid.state import AXES
from output import arm_programs
from output.programs import (
    drill_cycle,
    emit_of,
    joint_drill,
    joint_program,
    joint_rivet,
    mixed,
    pose_drill,
    pose_program,
    rivet_cycle,
    span,
    visit_cycle,
    without_signal,
)
from readers import rapid as mini
from readers.events import Analog, Await, Event, Message, Move, Output, Pause, Stop, World
from scipy.spatial.transform import Rotation
from verification.rapid.running import Done, done, pose

PORTAL = {f"q{i + 1}": axis for i, axis in enumerate(mini.EXTERNAL)}
MIXED = {**PORTAL, "q1": "rax_1", "q3": "rax_3", "q6": "eax_a"}
#: Where the axes stand before programs in joints: out of the way of every hole.
STANDS = dict.fromkeys(AXES, 0.0)
FAR_OUT = -1e5


def loaded(program: Program) -> Program:
    """With a tool that has a load, and a frame that stands somewhere."""
    if program.tool is None:
        return program
    centre = np.array([-120.0, 0.5, 130.25])
    tool = replace(program.tool, mass_kg=31.25, centre_of_gravity_mm=centre)
    turn = Rotation.from_euler("ZYX", [30.0, -12.5, 171.0], degrees=True).as_matrix()
    frame = WorkFrame(7, Pose(turn, np.array([1500.5, -20.25, 900.0])), span(6))
    return replace(program, tool=tool, frame=frame)


def emitted(program: Program, emit: Emit | None = None) -> dict[str, bytes]:
    report = Report()
    made = emit_files(RapidPost(), program, emit or emit_of("rapid"), report)
    assert not report.failed, [d.message for d in report.diagnostics]
    return {file.path: file.read() for file in made}


def arm(counts: tuple[int, ...] = (3,), **options: object) -> Program:
    sections = [(f"r{k}", 0, count) for k, count in enumerate(counts)]
    made = arm_programs.arm_program(sections, [drill_cycle(clamp=True)], maker="abb", **options)
    return replace(loaded(made), frame=made.frame)


def by_joints(make: Callable[[], Program], axes: dict[str, str], sign: int = 1) -> object:
    return make(), emit_of("rapid", axes, rotary_speed=(0.2, "rad/s"))


PROGRAMS: dict[str, Callable[[], tuple[Program, Emit | None]]] = {
    "drill": lambda: (loaded(pose_drill()), None),
    "clamped, in pecks": lambda: (loaded(pose_drill(20, peck_mm=3.0, clamp=True)), None),
    "mixed": lambda: (loaded(mixed()), None),
    "many": lambda: (
        loaded(
            pose_program([("a", 0, 30), ("b", 1, 9), ("c", 0, 12)], [drill_cycle(), rivet_cycle()])
        ),
        emit_of("rapid", holes_per_module=25.0),
    ),
    "visits": lambda: (loaded(pose_program([("a", 0, 12)], [visit_cycle()])), None),
    "no spindle answer": lambda: (
        loaded(without_signal(pose_drill(12, clamp=True), "spindle_running")),
        None,
    ),
    "cell's own tool": lambda: (pose_drill(), emit_of("rapid", tooldata="tCell", wobjdata="wCell")),
    "joints, rivet": lambda: by_joints(lambda: joint_rivet(11), PORTAL),  # type: ignore[dict-item]
    "joints, drill": lambda: by_joints(lambda: joint_drill(11, peck_mm=3.0), PORTAL),  # type: ignore[dict-item]
    "joints, the other way": lambda: by_joints(lambda: joint_drill(9, feed_sign=-1), MIXED),  # type: ignore[dict-item]
    "joints, mixed": lambda: by_joints(lambda: mixed(joint_program), PORTAL),  # type: ignore[dict-item]
    "arm": lambda: (arm(), None),
    "arm, ways": lambda: (
        arm(
            (12, 9),
            ways={
                4: [arm_programs.Way(True, (10.0, 10.0, 10.0, 20.0, 30.0, 40.0))],
                15: [arm_programs.Way(False, (12.0, 15.0, 10.0, 20.0, 30.0, 40.0))],
            },
        ),
        None,
    ),
}


def wanted(program: Program, files: dict[str, bytes], dead: dict[str, int]) -> list[Event]:
    joints = dict(STANDS)
    if program.motion is not None:
        sign = program.motion.feed_sign
        joints = dict.fromkeys(AXES, sign * FAR_OUT)
    world = World(dead, joints)
    names = [(s.alias or s.role).lower() for s in program.signals.values()]
    texts = {path: raw for path, raw in files.items() if not path.endswith(".csv")}
    known = ("tool0", "wobj0", "tCell", "wCell")
    return mini.run(mini.load(texts), world, names, known).events


def check(found: Done, events: Events, expected: list[Event]) -> None:
    names = {number: name for name, number in found.run.signals.items()}
    assert len(events) == len(expected)
    for row, event in enumerate(expected):
        kind, value = Kind(events.kind[row]), events.value[row]
        signal = names.get(int(events.signal[row]), "")
        match event:
            case Move(joints=joints) if joints is not None:
                assert kind is Kind.JOINTS
                for i, axis in enumerate(AXES):
                    if np.isnan(events.joints[row, i]):
                        assert abs(joints.get(axis, 0.0)) in (0.0, -FAR_OUT)
                    else:
                        assert events.joints[row, i] == joints[axis]
                assert events.speed_mm_s[row] == event.speed
            case Move():
                assert kind is (Kind.STRAIGHT if event.straight else Kind.JOINTS)
                assert np.abs(pose(events, row) - event.pose).max() < 1e-9
                assert events.speed_mm_s[row] == event.speed
                assert found.run.frames[events.tool[row]].name.lower() == event.tool
                assert found.run.frames[events.base[row]].name.lower() == event.frame
            case Output():
                assert (kind, signal, value) == (Kind.OUTPUT, event.signal, float(event.on))
            case Analog():
                assert (kind, signal, value) == (Kind.ANALOG, event.signal, event.value)
            case Pause():
                assert (kind, value) == (Kind.PAUSE, event.seconds)
            case Await():
                assert (kind, signal, value) == (Kind.WAIT, event.signal, 1.0)
                assert events.timeout_s[row] == event.timeout_s
            case Message():
                assert kind is Kind.MESSAGE
            case Stop():
                assert kind is Kind.STOP


@pytest.mark.parametrize("name", PROGRAMS)
def test_what_happens(name: str) -> None:
    program, emit = PROGRAMS[name]()
    files = emitted(program, emit)
    found = done(files)
    check(found, found.events, wanted(program, files, {}))
    assert found.run.findings() == []


@pytest.mark.parametrize("name", PROGRAMS)
def test_what_happens_where_an_answer_does_not_come(name: str) -> None:
    program, emit = PROGRAMS[name]()
    files = emitted(program, emit)
    found = done(files)
    names = {number: signal for signal, number in found.run.signals.items()}
    others = {
        (other.call_file[lane], other.call_line[lane], other.file, other.line): (other, lane)
        for other in found.others
        if other.timeout
        for lane in range(len(other.call_line))
    }
    e = found.events
    waits = np.flatnonzero(e.kind == Kind.WAIT)
    assert len(waits) == len(others)
    asked: dict[str, int] = {}
    for row in waits.tolist():
        signal = names[int(e.signal[row])]
        other, lane = others[e.call_file[row], e.call_line[row], e.file[row], e.line[row]]
        expected = wanted(program, files, {signal: asked.get(signal, 0)})
        asked[signal] = asked.get(signal, 0) + 1
        assert isinstance(expected[row], Await)
        assert other.ends
        ends = other.events.take(slice(int(other.starts[lane]), int(other.starts[lane + 1])))
        check(found, ends, expected[row + 1 :])


@pytest.mark.parametrize("name", PROGRAMS)
def test_places_of_what_happens(name: str) -> None:
    """Each event is in the line that does it, below a line of main or a part that names a hole."""
    program, emit = PROGRAMS[name]()
    files = emitted(program, emit)
    found = done(files)
    e, words = found.events, {Kind.OUTPUT: "SetDO", Kind.ANALOG: "SetAO", Kind.WAIT: "WaitDI"}
    texts = [files[path].decode().split("\r\n") for path in found.run.files]
    for row in range(len(e)):
        line = texts[e.file[row]][e.line[row] - 1]
        assert words.get(Kind(e.kind[row]), "") in line
        own = texts[e.call_file[row]][e.call_line[row] - 1]
        inside = (e.file[row], e.line[row]) != (e.call_file[row], e.call_line[row])
        if inside and not own.lstrip().startswith("IF "):
            hole = found.run.name_of(int(e.call_file[row]), int(e.call_line[row]))
            assert hole is not None
            assert f" {hole}," in own or f" {hole};" in own


@pytest.mark.parametrize("name", PROGRAMS)
def test_in_bulk_and_line_by_line(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    program, emit = PROGRAMS[name]()
    files = emitted(program, emit)
    bulk = done(files)
    assert any(m.bulk for m in bulk.run.program.modules) or len(program.holes) < 13
    monkeypatch.setattr("drillc.verification.alike.LEAST", 10**9)
    single = done(files)
    assert not any(m.bulk for m in single.run.program.modules)
    for column, value in vars(bulk.events).items():
        assert np.array_equal(value, getattr(single.events, column), equal_nan=True), column
    assert bulk.run.signals == single.run.signals
    assert bulk.run.findings() == single.run.findings() == []
    assert sum(len(o.events) for o in bulk.others) == sum(len(o.events) for o in single.others)
    if len(program.holes) > 8:
        assert len(bulk.others) <= len(single.others)


def test_speaks_of_signals_as_the_program_does() -> None:
    program = pose_drill()
    reader = RapidReader()
    assert reader.signal_name(program.signals["clamp"], {}) == "do_clamp"
    assert reader.analog_value(program.signals["spindle_speed"], 50.0) == 3000.0
    assert reader.analog_value(program.signals["clamp_force"], 800.0) == 800.0


@pytest.mark.parametrize("sample", ["panel", "skin_portal"])
def test_samples(sample: str, tmp_path: Path) -> None:
    from drillc.cli import main

    spec = Path(__file__).parents[3] / "samples" / f"{sample}.drill"
    assert main(["compile", str(spec), "--post", "rapid", "-o", str(tmp_path / "out")]) == 0
    files = {p.name: p.read_bytes() for p in (tmp_path / "out" / "rapid").iterdir()}
    found = done(files)
    joints = dict.fromkeys(AXES, -FAR_OUT if sample == "skin_portal" else 0.0)
    joints["rax_3"] = FAR_OUT if sample == "skin_portal" else 0.0
    expected = mini.run(mini.load(files), World({}, joints), list(found.run.signals)).events
    check(found, found.events, expected)
    assert found.run.findings() == []

"""RAPID: what is emitted is read back by a separate reader, run, and compared with the Program."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np
import pytest
from drillc.language.diagnostics import Report
from drillc.language.job import Emit, Pose, WorkFrame
from drillc.output.emission import PostError, emit_files
from drillc.planning.program import Cycle, Program, WaitInput
from drillc.postprocessors.rapid import RapidPost, rounded_quaternions, signed_text
from judges import rapidchecker
from output.programs import (
    drill_cycle,
    emit_of,
    joint_drill,
    joint_program,
    joint_rivet,
    mixed,
    named,
    pose_drill,
    pose_program,
    rivet_cycle,
    span,
    visit_cycle,
    with_ids,
    without_signal,
)
from readers import rapid
from readers.events import (
    Analog,
    Await,
    Event,
    Move,
    Output,
    ReadError,
    Stop,
    World,
    compare,
    expected,
    joints_at,
)
from scipy.spatial.transform import Rotation

#: The portal's joints, all on external axes; q3 turns.
AXES = {f"q{i + 1}": axis for i, axis in enumerate(rapid.EXTERNAL)}
#: The same with some of them on an arm.
MIXED_AXES = {**AXES, "q1": "rax_1", "q3": "rax_3", "q6": "eax_a"}

MM, DEG = 0.0009, 5e-6


def loaded(program: Program) -> Program:
    """With a tool that has a load, and a frame that stands somewhere."""
    if program.tool is None:
        return program
    centre = np.array([-120.0, 0.5, 130.25])
    tool = replace(program.tool, mass_kg=31.25, centre_of_gravity_mm=centre)
    turn = Rotation.from_euler("ZYX", [30.0, -12.5, 171.0], degrees=True).as_matrix()
    frame = WorkFrame(7, Pose(turn, np.array([1500.5, -20.25, 900.0])), span(6))
    return replace(program, tool=tool, frame=frame)


def files(program: Program, emit: Emit | None = None) -> dict[str, bytes]:
    report = Report()
    made = emit_files(RapidPost(), program, emit or emit_of("rapid"), report)
    assert not report.failed, [d.message for d in report.diagnostics]
    return {file.path: file.read() for file in made if not file.path.endswith(".csv")}


def errors(program: Program, emit: Emit | None = None) -> dict[str, str]:
    report = Report()
    assert not emit_files(RapidPost(), program, emit or emit_of("rapid"), report)
    return {d.code: f"{d.message} | {d.hint}" for d in report.diagnostics}


def signals(program: Program) -> dict[str, str]:
    """Role by the controller's name."""
    return {(s.alias or s.role).lower(): role for role, s in program.signals.items()}


def by_role(program: Program, events: list[Event]) -> list[Event]:
    roles = signals(program)
    said: list[Event] = []
    for event in events:
        match event:
            case Output(signal, on):
                said.append(Output(roles[signal], on))
            case Analog(signal, value):
                turns = roles[signal] == "spindle_speed"
                said.append(Analog(roles[signal], value / 60.0 if turns else value))
            case Await(signal, timeout_s, came):
                said.append(Await(roles[signal], timeout_s, came))
            case _:
                said.append(event)
    return said


def named_by(program: Program, dead: Mapping[str, int] | None) -> dict[str, int]:
    names = {role: name for name, role in signals(program).items()}
    return {names[role]: times for role, times in (dead or {}).items()}


def run(
    program: Program, emit: Emit | None = None, dead: Mapping[str, int] | None = None
) -> rapid.Run:
    known = ("tool0", "wobj0", "tCell", "wCell")
    world = World(named_by(program, dead))
    return rapid.run(rapid.load(files(program, emit)), world, list(signals(program)), known)


def parts(program: Program, size: int) -> list[range]:
    n = len(program.holes)
    return [range(i, min(i + size, n)) for i in range(0, n, size)]


# ── programs in poses ────────────────────────────────────────────────────────────────────────────

POSE_PROGRAMS: dict[str, Callable[[], Program]] = {
    "drill": lambda: pose_drill(4),
    "peck": lambda: pose_drill(6, peck_mm=3.0),
    "peck_whole": lambda: pose_drill(4, peck_mm=3.5),
    "peck_once": lambda: pose_drill(2, peck_mm=40.0),
    "clamp": lambda: pose_drill(2, clamp=True),
    "rivet": lambda: pose_program([("rim", 0, 3)], [rivet_cycle()]),
    "visit": lambda: pose_program([("rim", 0, 3)], [visit_cycle()]),
    "mixed": mixed,
    "one_hole": lambda: pose_drill(1),
    "no_speed_signal": lambda: without_signal(pose_drill(2), "spindle_speed"),
    "no_running_signal": lambda: without_signal(pose_drill(2), "spindle_running"),
    "unused_cycle": lambda: pose_program([("a", 1, 2)], [visit_cycle(), drill_cycle()]),
}


@pytest.mark.parametrize("name", POSE_PROGRAMS)
@pytest.mark.parametrize("size", [1000, 2])
def test_the_text_does_what_the_program_says(name: str, size: int) -> None:
    program = loaded(POSE_PROGRAMS[name]())
    found = run(program, emit_of("rapid", holes_per_module=float(size)))
    wanted = expected(program, parts=parts(program, size), home=False)
    compare(by_role(program, found.events), wanted, mm=MM, deg=DEG)
    moves = [event for event in found.events if isinstance(event, Move)]
    assert {(move.tool, move.frame) for move in moves} == {("ee90", "part_frame")}


@pytest.mark.parametrize(
    ("name", "role", "after"),
    [
        ("drill", "spindle_running", 0),
        ("drill", "spindle_running", 2),
        ("clamp", "clamped", 1),
        ("clamp", "released", 0),
        ("rivet", "clamped", 0),
        ("rivet", "set_done", 2),
        ("rivet", "released", 1),
    ],
)
def test_an_answer_that_fails_to_come_ends_the_program(name: str, role: str, after: int) -> None:
    """Everything off, out, a message, and EXIT."""
    program = loaded(POSE_PROGRAMS[name]())
    found = run(program, dead={role: after})
    wanted = expected(program, home=False, dead={role: after})
    compare(by_role(program, found.events), wanted, mm=MM, deg=DEG)
    assert isinstance(found.events[-1], Stop)


def some_rotations() -> np.ndarray:
    edges = [[a, b, c] for a in (0, 90, 180, -90) for b in (-90, 0, 90, 180) for c in (0, 30, 180)]
    turns = [
        Rotation.from_euler("ZYX", np.array(edges, dtype=float), degrees=True).as_matrix(),
        Rotation.random(1000, np.random.default_rng(1)).as_matrix(),
    ]
    return np.concatenate(turns)


def test_every_orientation_is_read_back() -> None:
    matrices = some_rotations()
    program = loaded(pose_program([("all", 0, len(matrices))], [visit_cycle()]))
    program = replace(program, part_from_tool=matrices)
    found = run(program, emit_of("rapid", holes_per_module=5000.0))
    compare(found.events, expected(program, home=False), mm=MM, deg=DEG)


def test_quaternions_have_length_1_as_printed() -> None:
    q = rounded_quaternions(some_rotations())
    assert np.array_equal(q, np.round(q, 8))
    assert np.abs(np.linalg.norm(q, axis=1) - 1.0).max() < 1e-8
    assert not np.signbit(q[q == 0.0]).any()
    # Plain rounding is worse: the choice of the largest component is not for nothing.
    w = Rotation.from_matrix(some_rotations()).as_quat()
    plain = np.abs(np.linalg.norm(np.round(w, 8), axis=1) - 1.0).max()
    assert np.abs(np.linalg.norm(q, axis=1) - 1.0).max() < plain


def test_slow_feeds_keep_their_digits() -> None:
    cycle = drill_cycle()
    for feed in (0.0123456, 0.4, 1.0 / 3.0, 5.0, 12.34567, 250.0):
        steps = tuple(
            replace(step, feed_mm_s=feed) if step.kind == "plunge" else step for step in cycle.steps
        )
        program = loaded(pose_program([("a", 0, 1)], [replace(cycle, steps=steps)]))
        wanted = expected(program, home=False)
        compare(by_role(program, run(program).events), wanted, mm=MM, deg=DEG)


def test_tool_and_work_object_are_those_of_the_spec() -> None:
    program = loaded(pose_drill(2))
    assert program.tool is not None
    assert program.frame is not None
    assert program.frame.world_from_part is not None
    module = rapid.load(files(program)).modules["panel_7l"]
    for data, pose in (
        (module.data["ee90"], program.tool.flange_from_tool),
        (module.data["part_frame"], program.frame.world_from_part),
    ):
        assert np.abs(data["matrix"][:3, 3] - pose.translation_mm).max() < 0.0006
        assert np.abs(data["matrix"][:3, :3] - pose.rotation).max() < 1e-7
    assert module.data["ee90"]["mass"] == 31.25
    assert module.data["ee90"]["centre"] == [-120.0, 0.5, 130.25]


def test_the_cells_own_tool_and_work_object() -> None:
    emit = emit_of("rapid", tooldata="tCell", wobjdata="wCell")
    found = run(pose_drill(2), emit)
    assert {(e.tool, e.frame) for e in found.events if isinstance(e, Move)} == {("tcell", "wcell")}
    assert b"PERS" not in files(pose_drill(2), emit)["rapid/PANEL_7L.mod"]
    plain = run(pose_drill(2), emit_of("rapid", tooldata="tool0", wobjdata="wobj0"))
    assert {(e.tool, e.frame) for e in plain.events if isinstance(e, Move)} == {("tool0", "wobj0")}


def test_without_a_frame_the_world_is_meant_and_said() -> None:
    program = replace(loaded(pose_drill(2)), frame=None)
    report = Report()
    assert emit_files(RapidPost(), program, emit_of("rapid"), report)
    assert [d.code for d in report.diagnostics] == ["W643"]
    assert {e.frame for e in run(program).events if isinstance(e, Move)} == {"wobj0"}


# ── programs in joints ───────────────────────────────────────────────────────────────────────────


def joint_run(
    program: Program,
    axes: Mapping[str, str],
    start: Mapping[str, float],
    dead: Mapping[str, int] | None = None,
    others: float | None = None,
) -> rapid.Run:
    """`others`: where axes stand that the program does not map; they have to stay there."""
    world = World(named_by(program, dead), joints=dict(start))
    unmapped = {*rapid.ROBOT, *rapid.EXTERNAL} - set(start)
    if others is not None:
        world.joints.update(dict.fromkeys(unmapped, others))
    controller = rapid.load(files(program, emit_of("rapid", axes)))
    found = rapid.run(controller, world, list(signals(program)))
    for i, event in enumerate(found.events):
        if isinstance(event, Move) and event.joints is not None:
            assert all(event.joints.get(axis, others) == others for axis in unmapped)
            found.events[i] = replace(event, joints={a: event.joints[a] for a in start})
    return found


def joint_wanted(
    program: Program,
    axes: Mapping[str, str],
    start: Mapping[str, float],
    dead: Mapping[str, int] | None = None,
) -> list[Event]:
    motion = program.motion
    assert motion is not None
    names, feed, sign = list(axes.values()), axes["q6"], motion.feed_sign
    ends: list[float] = []
    for section in program.sections:
        moves = [s for s in program.cycles[section.cycle].steps if s.kind == "move"]
        rows = slice(section.start, section.stop)
        ends += (motion.joints[rows, motion.feed_axis] + sign * moves[-1].depth_mm).tolist()
    clear = sign * min(sign * float(v) for v in [*ends, *motion.withdraw_mm])
    events: list[Event] = []
    now = {axis: start[axis] for axis in names}
    travel = program.cycles[program.sections[0].cycle].process.travel_mm_s

    def get_clear() -> None:
        if sign * now[feed] > sign * clear:
            now[feed] = clear
            events.append(Move(True, joints=dict(now), speed=travel))

    get_clear()
    now = {**joints_at(program, 0, 0.0, names), feed: now[feed]}
    events.append(Move(True, joints=dict(now), speed=travel))
    holes = expected(program, axes=names, home=False, dead=dead)
    events += holes
    if not isinstance(holes[-1], Stop):
        last = [e for e in holes if isinstance(e, Move)][-1].joints
        assert last is not None
        now = dict(last)
        get_clear()
    return events


@pytest.mark.parametrize("axes", [AXES, MIXED_AXES], ids=["external", "mixed"])
@pytest.mark.parametrize("feed_sign", [1, -1])
@pytest.mark.parametrize("start_feed", [0.0, 2400.0, 5000.0])
def test_joints_do_what_the_program_says(
    axes: Mapping[str, str], feed_sign: int, start_feed: float
) -> None:
    """From a start that is further out than the holes, among them, or on their other side."""
    start = dict.fromkeys(axes.values(), 10.0) | {axes["q6"]: start_feed}
    cycles = [rivet_cycle(), visit_cycle(), drill_cycle(peck_mm=3.0)]
    sections = [("a", 0, 3), ("b", 1, 2), ("c", 2, 3)]
    program = joint_program(sections, cycles, feed_sign=feed_sign)
    found = joint_run(program, axes, start, others=1.0)
    wanted = joint_wanted(program, axes, start)
    compare(by_role(program, found.events), wanted, mm=MM, deg=DEG)


def test_an_arm_that_the_program_does_not_map_stays_where_it_is() -> None:
    """Targets of a task without an arm: 9E+09 in all robot axes, and no axis but the mapped."""
    program = joint_rivet(2)
    start = dict.fromkeys(AXES.values(), 10.0)
    text = files(program, emit_of("rapid", AXES))["rapid/PORTAL_A.mod"].decode()
    assert ":=[[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09],[46.300," in text
    for others in (None, 33.0):
        found = joint_run(program, AXES, start, others=others)
        assert len(found.events) > 20
    arm = files(program, emit_of("rapid", MIXED_AXES))["rapid/PORTAL_A.mod"].decode()
    assert ":=[[46.300,0,110.00000,0,0,0],[2611.400,4953.700,9E+09,5619.900," in arm


def test_an_answer_that_fails_to_come_ends_a_program_in_joints() -> None:
    program = joint_drill(3, clamp=True)
    start = dict.fromkeys(AXES.values(), 10.0)
    found = joint_run(program, AXES, start, {"clamped": 1})
    wanted = joint_wanted(program, AXES, start, {"clamped": 1})
    compare(by_role(program, found.events), wanted, mm=MM, deg=DEG)


def test_rotary_external_axes_need_a_speed() -> None:
    program = joint_rivet(2)
    motion = program.motion
    assert motion is not None
    start = dict.fromkeys(AXES.values(), 10.0)
    assert {s[3] for s in joint_run(program, AXES, start).speeds} == {28.648}  # 0.5 rad/s
    slow = replace(program, motion=replace(motion, speeds=(None,) * 6))
    assert "rotary_speed" in errors(slow, emit_of("rapid", AXES))["E649"]
    emit = emit_of("rapid", AXES, rotary_speed=(np.radians(12.0), "deg/s"))
    assert b",500,300.000,12.000]" in files(slow, emit)["rapid/PORTAL_A.mod"]
    assert files(slow, emit_of("rapid", {**AXES, "q3": "rax_3"})), "an arm's own axis needs none"


def test_a_drill_is_fed_by_an_external_axis_only() -> None:
    axes = {**AXES, "q6": "rax_6"}
    assert "rax_6" in errors(joint_drill(2), emit_of("rapid", axes))["E648"]
    assert files(joint_rivet(2), emit_of("rapid", axes))


def test_depths_are_added_with_the_sense_of_the_joint() -> None:
    assert [signed_text(d, s) for d in (-60.0, 0.0, 2.5) for s in (1, -1)] == [
        "-60.000",
        "+60.000",
        "+0.000",
        "+0.000",
        "+2.500",
        "-2.500",
    ]


# ── layout ───────────────────────────────────────────────────────────────────────────────────────


def test_one_module_or_a_main_module_with_parts() -> None:
    program = loaded(mixed(counts=(3, 2, 2)))
    assert sorted(files(program)) == ["rapid/PANEL_7L.mod", "rapid/PANEL_7L.pgf"]
    split = files(program, emit_of("rapid", holes_per_module=3.0))
    assert sorted(split) == sorted(
        ["rapid/PANEL_7L.pgf", *(f"rapid/PANEL_7L{part}.mod" for part in ("", "_1", "_2", "_3"))]
    )
    assert b"  LOCAL CONST robtarget P1:=" in split["rapid/PANEL_7L_1.mod"]
    assert b"robtarget P" not in split["rapid/PANEL_7L.mod"]


def test_each_part_runs_by_itself() -> None:
    program = loaded(mixed(counts=(3, 2, 2)))
    controller = rapid.load(files(program, emit_of("rapid", holes_per_module=3.0)))
    for i, rows in enumerate(parts(program, 3)):
        found = rapid.run(controller, signals=list(signals(program)), main=f"holes_{i + 1}")
        wanted = expected(program, parts=[rows], home=False)
        compare(by_role(program, found.events), wanted, mm=MM, deg=DEG)


def test_calls_bear_the_holes_names_in_order() -> None:
    text = files(loaded(mixed(counts=(2, 1, 2))))["rapid/PANEL_7L.mod"].decode()
    calls = re.findall(r"^    (\w+) (P\w+)(?:,[\d.]+)?; ! (\S+)\r$", text, re.MULTILINE)
    assert calls == [
        ("drill6", "P1", "P1"),
        ("drill6", "P2", "P2"),
        ("rivet", "P3", "P3"),
        ("drill6", "P4", "P4"),
        ("drill6", "P5", "P5"),
    ]
    assert "    ! Region upper, process drill6: P1 .. P2, 2 holes\r\n" in text
    assert "    ! Region lower, process rivet: P3, 1 hole\r\n" in text


def test_the_message_fits_and_names_process_and_signal() -> None:
    cycle = rivet_cycle("rivet_of_a_name_with_32_letters_")
    program = loaded(pose_program([("a", 0, 1)], [cycle]))
    clamped = replace(program.signals["clamped"], alias="di_that_says_the_stack_is_closed")
    program = replace(program, signals={**program.signals, "clamped": clamped})
    said = re.findall(r'TPWrite "([^"]*)"', files(program)["rapid/PANEL_7L.mod"].decode())
    assert len(said) == 3
    assert all(len(message) <= 80 for message in said)
    assert said[0].startswith(
        "rivet_of_a_name_with_32_letters_: no signal di_that_says_the_stack_is"
    )


def test_a_program_without_holes_is_still_a_program() -> None:
    assert run(loaded(pose_program([], []))).events == []


# ── refusals ─────────────────────────────────────────────────────────────────────────────────────


def test_a_tool_without_its_load_is_refused() -> None:
    program = loaded(pose_drill(2))
    tool = program.tool
    assert tool is not None
    for change, word in (
        ({"mass_kg": None}, "no mass"),
        ({"centre_of_gravity_mm": None}, "no centre of gravity"),
        ({"mass_kg": 0.0}, "0 kg"),
        ({"centre_of_gravity_mm": np.zeros(3)}, "in the flange"),
    ):
        found = errors(replace(program, tool=replace(tool, **change)))
        assert word in found["E643"]
        assert "tooldata" in found["E643"]
    assert "E644" in errors(replace(program, tool=None))


def test_a_frame_that_is_only_a_number_is_refused() -> None:
    program = replace(loaded(pose_drill(2)), frame=WorkFrame(7, None, span(6)))
    assert "frame 7" in errors(program)["E645"]


def test_a_value_beyond_full_scale() -> None:
    program = loaded(pose_drill(2, clamp=True))
    force = replace(program.signals["clamp_force"], full_scale=799.0)
    found = errors(replace(program, signals={**program.signals, "clamp_force": force}))
    assert "800 N" in found["E646"]
    unscaled = replace(program.signals["clamp_force"], full_scale=None)
    assert files(replace(program, signals={**program.signals, "clamp_force": unscaled}))


@pytest.mark.parametrize(
    "alias", ["1st", "do-1", "MoveJ", "while", "x" * 33, "p2", "drill6", "ee90", "do_clamp", "HOLE"]
)
def test_a_signal_must_bear_a_name_of_its_own(alias: str) -> None:
    program = loaded(pose_drill(2, clamp=True))
    on = replace(program.signals["spindle_on"], alias=alias)
    found = errors(replace(program, signals={**program.signals, "spindle_on": on}))
    assert alias.lower() in found["E647"].lower()


def test_names_of_tools_and_parts_are_their_own() -> None:
    program = loaded(pose_drill(2))
    assert program.tool is not None
    assert "P1" in errors(program, emit_of("rapid", tooldata="P1"))["E647"]
    assert "p2" in errors(program, emit_of("rapid", wobjdata="p2"))["E647"]
    tool = replace(program.tool, name=named("Drill6", 5))
    assert "drill6" in errors(replace(program, tool=tool))["E647"]
    ids = with_ids(program, ["holes_2", "P2"])
    assert "holes_2" in errors(ids, emit_of("rapid", holes_per_module=1.0))["E647"]
    assert files(ids)


@pytest.mark.parametrize("word", ["main", "FINE", "v100", "RelTool", "endproc", "panel_7l"])
def test_names_that_rapid_or_the_text_uses_are_refused(word: str) -> None:
    assert set(errors(with_ids(loaded(pose_drill(2)), ["P1", word]))) & {"E641", "E642"}


def test_a_fault_that_waits_is_a_bug_of_the_planner() -> None:
    cycle = drill_cycle()
    fault = (*cycle.fault, WaitInput("released", 1.0))
    program = loaded(pose_program([("a", 0, 1)], [Cycle(cycle.process, cycle.steps, fault)]))
    with pytest.raises((PostError, ValueError), match="a fault cannot do wait"):
        emit_files(RapidPost(), program, emit_of("rapid"), Report())


# ── the reader can fail, and so can the judge ────────────────────────────────────────────────────


def judge(program: Program, text: Mapping[str, bytes]) -> None:
    """Everything that this file asks of a text, at once."""
    for dead in ({"spindle_running": 2}, {}):
        world = World(named_by(program, dead))
        found = rapid.run(rapid.load(text), world, list(signals(program)))
        wanted = expected(program, home=False, dead=dead)
        compare(by_role(program, found.events), wanted, mm=MM, deg=DEG)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("\r\n", "\n"),
        ("RelTool(P1,", "RelTool(P99,"),
        ("    VAR num bottom;\r\n", ""),
        ("-2.000", "-2.500"),
        ("drill6 P2,12.250", "drill6 P2,12.255"),
        ("drill6 P2,12.250", "drill6 P2"),
        ("RelTool(hole,0,0,depth)", "RelTool(hole,0,depth,0)"),
        ("v100\\V:=5.000", "v100\\V:=6.000"),
        (",fine,", ",z10,"),
        ("WaitTime 0.500", "WaitTime 0.050"),
        ("bottom+3.000<depth", "bottom+3.000<depth+9"),
        ("      EXIT; ! for good: the program pointer is gone, and start does nothing\r\n", ""),
        ("IF timeout THEN", "IF 1>2 THEN"),
        ("\\MaxTime:=4.000\\TimeFlag:=timeout", ""),
        ("[0.91671881,", "[0.91671781,"),
        ("0.13982054,-0.32132065", "-0.32132065,0.13982054"),
        ("-542.000]", "-542.002]"),
        ("SetDO do_spindle_on,1", "SetDO do_spindle_on,0"),
        ("SetAO ao_spindle_speed,3000.000", "SetAO ao_spindle_speed,300.000"),
        ("standoff{2}:=[-60.000", "standoff{2}:=[60.000"),
        ("ConfL\\Off", "ConfL\\On"),
        ("\\WObj:=part_frame", ""),
        ("PANEL_7L.mod</Module>", "PANEL_7.mod</Module>"),
        ("[0,0,0,0],[9E+09,", "[0,0,0,0],[9E+09,9E+09,"),
    ],
)
def test_a_changed_text_is_noticed(old: str, new: str) -> None:
    """Each change of the emitted text is one that could hurt; the oracle must see every one."""
    program = loaded(mixed(counts=(2, 1, 2)))
    judge(program, files(program))
    made = {path: raw.decode() for path, raw in files(program).items()}
    changed = {path: text.replace(old, new).encode() for path, text in made.items()}
    assert changed != {path: text.encode() for path, text in made.items()}
    with pytest.raises((ReadError, AssertionError)):
        judge(program, changed)


def test_an_outside_judge_reads_every_kind_of_program() -> None:
    """rapidchecker parses all of RAPID: what it accepts is at least well-formed."""
    rapidchecker.require()
    split = emit_of("rapid", holes_per_module=2.0)
    for program, emit in (
        (loaded(mixed(counts=(2, 1, 2))), None),
        (loaded(pose_drill(3, clamp=True, peck_mm=3.0)), split),
        (pose_drill(1), emit_of("rapid", tooldata="tCell", wobjdata="wCell")),
        (joint_drill(2, peck_mm=3.0, feed_sign=-1), emit_of("rapid", AXES)),
        (joint_rivet(3), emit_of("rapid", MIXED_AXES, holes_per_module=2.0)),
    ):
        for path, raw in files(program, emit).items():
            if path.endswith(".mod"):
                assert rapidchecker.complaints(raw) == []
    assert rapidchecker.complaints(b"MODULE a\r\n  PROC main()\r\n    MoveL p v5;\r\n")

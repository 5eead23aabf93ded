"""KRL: what is emitted is read back by a separate reader, run, and compared with the Program."""

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
from drillc.postprocessors._robot import speed_text, wait_message
from drillc.postprocessors.krl import KrlPost, signed_text
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
from readers import krl
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

#: The portal's joints; q3 turns.
AXES = {"q1": "A1", "q2": "A2", "q3": "A4", "q4": "E1", "q5": "E2", "q6": "A3"}

#: Reading back: half a last digit of a millimetre; and of three angles that turn one after another.
MM, DEG = 0.0009, 1e-3


def files(program: Program, emit: Emit | None = None) -> dict[str, bytes]:
    report = Report()
    made = emit_files(KrlPost(), program, emit or emit_of("krl"), report)
    assert not report.failed, [d.message for d in report.diagnostics]
    return {file.path: file.read() for file in made}


def errors(program: Program, emit: Emit | None = None) -> dict[str, str]:
    report = Report()
    assert not emit_files(KrlPost(), program, emit or emit_of("krl"), report)
    return {d.code: f"{d.message} | {d.hint}" for d in report.diagnostics}


def by_role(program: Program, events: list[Event]) -> list[Event]:
    """Signals by their roles, analog values in mm-rad-s-N units again."""
    numbers = {f"{s.kind} {s.number}": s.role for s in program.signals.values()}

    def role(kind: str, shown: str) -> str:
        return numbers[f"{kind} {shown[shown.index('[') + 1 : -1]}"]

    said: list[Event] = []
    for event in events:
        match event:
            case Output(signal, on):
                said.append(Output(role("output", signal), on))
            case Analog(signal, value):
                name = role("analog", signal)
                said.append(Analog(name, value * (program.signals[name].full_scale or 0.0)))
            case Await(signal, timeout_s, came):
                said.append(Await(role("input", signal), timeout_s, came))
            case _:
                said.append(event)
    return said


def numbered(program: Program, dead: Mapping[str, int]) -> dict[str, int]:
    return {f"$IN[{program.signals[role].number}]": times for role, times in dead.items()}


def run(
    program: Program, emit: Emit | None = None, dead: Mapping[str, int] | None = None
) -> krl.Run:
    world = World(numbered(program, dead or {}))
    return krl.run(krl.load(files(program, emit)), program.name, world)


def parts(program: Program, size: int) -> list[range]:
    n = len(program.holes)
    return [range(i, min(i + size, n)) for i in range(0, n, size)]


# ── programs in poses ────────────────────────────────────────────────────────────────────────────

POSE_PROGRAMS: dict[str, Callable[[], Program]] = {
    "drill": lambda: pose_drill(4),
    "peck": lambda: pose_drill(6, peck_mm=3.0),
    "peck_whole": lambda: pose_drill(4, peck_mm=3.5),  # a hole of 12 mm takes four equal pecks
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
@pytest.mark.parametrize("size", [800, 2])
def test_the_text_does_what_the_program_says(name: str, size: int) -> None:
    program = POSE_PROGRAMS[name]()
    found = run(program, emit_of("krl", holes_per_module=float(size)))
    wanted = expected(program, parts=parts(program, size), home=True)
    compare(by_role(program, found.events), wanted, mm=MM, deg=DEG)
    assert {event.tool for event in found.events if isinstance(event, Move) and event.tool} == {"3"}
    assert {e.frame for e in found.events if isinstance(e, Move) and e.frame} == {"2"}


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
    """Everything off, out, a message, and no press of start makes it go on."""
    program = POSE_PROGRAMS[name]()
    found = run(program, dead={role: after})
    wanted = expected(program, home=True, dead={role: after})
    compare(by_role(program, found.events), wanted, mm=MM, deg=DEG)
    assert isinstance(found.events[-1], Stop)


def test_every_orientation_is_read_back() -> None:
    """Gimbal lock on every side, half turns, and a thousand random ones: within 1e-3 deg."""
    edges = [[a, b, c] for a in (0, 90, 180, -90) for b in (-90, 0, 90, 180) for c in (0, 30, 180)]
    near = [[17.0, 90.0 + d, 5.0] for d in (1e-3, -1e-3, 1e-6, -1e-6, 1e-9)]
    turns = [
        Rotation.from_euler("ZYX", np.array(edges + near, dtype=float), degrees=True).as_matrix(),
        Rotation.random(1000, np.random.default_rng(1)).as_matrix(),
    ]
    matrices = np.concatenate(turns)
    program = pose_program([("all", 0, len(matrices))], [visit_cycle()])
    program = replace(program, part_from_tool=matrices)
    found = run(program, emit_of("krl", holes_per_module=5000.0))
    compare(found.events, expected(program, home=True), mm=MM, deg=DEG)


def test_slow_feeds_keep_their_digits() -> None:
    """$VEL.CP is in m/s: three decimals would turn 0.4 mm/s into nothing."""
    cycle = drill_cycle()
    for feed in (0.0123456, 0.4, 1.0 / 3.0, 5.0, 12.34567, 250.0):
        steps = tuple(
            replace(step, feed_mm_s=feed) if step.kind == "plunge" else step for step in cycle.steps
        )
        program = pose_program([("a", 0, 1)], [replace(cycle, steps=steps)])
        compare(by_role(program, run(program).events), expected(program, home=True), mm=MM, deg=DEG)


def test_tool_and_base_are_written_where_the_spec_states_them() -> None:
    turn = Rotation.from_euler("ZYX", [30.0, -12.5, 171.0], degrees=True).as_matrix()
    program = pose_drill(2)
    assert program.tool is not None
    tool = replace(
        program.tool, mass_kg=31.25, centre_of_gravity_mm=np.array([-120.0, 0.5, 130.25])
    )
    frame = WorkFrame(7, Pose(turn, np.array([1500.5, -20.25, 900.0])), span(6))
    found = run(replace(program, tool=tool, frame=frame))
    assert set(found.tool_data) == {3}
    assert set(found.base_data) == {7}
    for data, pose in (
        (found.tool_data[3], tool.flange_from_tool),
        (found.base_data[7], frame.world_from_part),
    ):
        assert pose is not None
        read = krl.matrix(data)
        assert np.abs(read[:3, 3] - pose.translation_mm).max() < 0.0006
        assert np.abs(read[:3, :3] - pose.rotation).max() < 1e-6
    assert found.load_data[3].startswith("{ M 31.250 , CM { X - 120.000 , Y 0.500 , Z 130.250 ,")
    assert run(pose_drill(2)).base_data == {}, "base 2 is the cell's own"
    assert run(pose_drill(2)).load_data == {}, "no load is stated"


def test_without_a_frame_the_world_is_meant_and_said() -> None:
    program = replace(pose_drill(2), frame=None)
    report = Report()
    assert emit_files(KrlPost(), program, emit_of("krl"), report)
    assert [d.code for d in report.diagnostics] == ["W623"]
    found = run(program)
    assert {e.frame for e in found.events if isinstance(e, Move) and e.frame} == {"0"}


def test_settings() -> None:
    emit = emit_of("krl", velocity=(0.255, "%"), timer=3.0)
    text = files(pose_drill(2), emit)["krl/PANEL_7L.src"].decode()
    assert "BAS(#VEL_PTP,25.5)" in text
    assert set(re.findall(r"\$TIMER\w*\[(\d+)\]", text)) == {"3"}
    assert run(pose_drill(2)).velocities == {10.0}
    assert "E633" in errors(pose_drill(2), emit_of("krl", velocity=(1.5, "%")))


# ── programs in joints ───────────────────────────────────────────────────────────────────────────


def joint_run(
    program: Program, home: Mapping[str, float], dead: Mapping[str, int] | None = None
) -> tuple[krl.Run, World]:
    world = World(numbered(program, dead or {}), joints=dict.fromkeys(krl.AXES, 1.0) | dict(home))
    loaded = krl.load(files(program, emit_of("krl", AXES)))
    return krl.run(loaded, program.name, world, home=home), world


def with_mapped_joints_only(events: list[Event]) -> list[Event]:
    """Joints that the program maps. The others have to stay where they were: at 1."""
    kept: list[Event] = []
    for event in events:
        if isinstance(event, Move) and event.joints is not None:
            others = set(event.joints) - set(AXES.values())
            assert all(event.joints[axis] == 1.0 for axis in others)
            event = replace(event, joints={a: event.joints[a] for a in AXES.values()})
        kept.append(event)
    return kept


def joint_wanted(
    program: Program, home: Mapping[str, float], dead: Mapping[str, int] | None = None
) -> list[Event]:
    """The expected holes, with what leads from home to the first one and back."""
    motion = program.motion
    assert motion is not None
    axes, feed, sign = list(AXES.values()), AXES["q6"], motion.feed_sign
    ends = [
        motion.joints[row, motion.feed_axis]
        + sign * program.cycles[section.cycle].steps[-1].depth_mm  # type: ignore[union-attr]
        for section in program.sections
        for row in range(section.start, section.stop)
    ]
    clear = sign * min(sign * float(v) for v in [*ends, *motion.withdraw_mm])
    events: list[Event] = []
    now = {axis: home[axis] for axis in axes}

    def get_clear() -> None:
        if sign * now[feed] > sign * clear:
            now[feed] = clear
            events.append(Move(True, joints=dict(now)))

    get_clear()
    events.append(Move(False))
    now = {axis: home[axis] for axis in axes}
    get_clear()
    now = {**joints_at(program, 0, 0.0, axes), feed: now[feed]}
    events.append(Move(True, joints=dict(now)))
    holes = expected(program, axes=axes, home=False, dead=dead)
    events += holes
    if not isinstance(holes[-1], Stop):
        last = [e for e in holes if isinstance(e, Move)][-1].joints
        assert last is not None
        now = dict(last)
        get_clear()
        events.append(Move(False))
    return events


@pytest.mark.parametrize("feed_sign", [1, -1])
@pytest.mark.parametrize("home_feed", [0.0, 2400.0, 5000.0])
def test_joints_do_what_the_program_says(feed_sign: int, home_feed: float) -> None:
    """From a home that is further out than the holes, among them, or on the wrong side of them."""
    home = dict.fromkeys(AXES.values(), 10.0) | {AXES["q6"]: home_feed}
    cycles = [rivet_cycle(), visit_cycle()]
    program = joint_program([("a", 0, 3), ("b", 1, 2)], cycles, feed_sign=feed_sign)
    found, _ = joint_run(program, home)
    events = with_mapped_joints_only(by_role(program, found.events))
    compare(events, joint_wanted(program, home), mm=MM, deg=DEG)


def test_the_feed_joint_moves_alone_wherever_the_tool_is_near_a_hole() -> None:
    program = joint_rivet(5)
    motion = program.motion
    assert motion is not None
    home = dict.fromkeys(AXES.values(), 10.0) | {AXES["q6"]: 0.0}
    found, _ = joint_run(program, home)
    feed = AXES["q6"]
    before = dict(home)
    for event in with_mapped_joints_only(found.events):
        if not isinstance(event, Move) or event.joints is None:
            continue
        moved = {a for a in event.joints if abs(event.joints[a] - before[a]) > 1e-9}
        assert moved <= {feed} or feed not in moved, moved
        if moved - {feed}:
            assert event.joints[feed] <= motion.withdraw_mm.max() + 1e-3
        before = dict(event.joints)


def test_a_rivet_that_is_not_set_ends_a_program_in_joints() -> None:
    program = joint_rivet(3)
    home = dict.fromkeys(AXES.values(), 10.0)
    found, _ = joint_run(program, home, {"set_done": 1})
    events = with_mapped_joints_only(by_role(program, found.events))
    compare(events, joint_wanted(program, home, {"set_done": 1}), mm=MM, deg=DEG)


def test_speeds_that_axes_cannot_keep_are_said() -> None:
    report = Report()
    assert emit_files(KrlPost(), joint_rivet(2), emit_of("krl", AXES), report)
    [warning] = report.diagnostics
    assert warning.code == "W624"
    assert "approach 80 mm/s, retract 120 mm/s, travel 300 mm/s" in warning.message


def test_a_drill_cannot_be_fed_by_a_joint() -> None:
    assert "E618" in errors(joint_drill(2), emit_of("krl", AXES))


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


def test_one_file_pair_or_a_main_module_with_parts() -> None:
    program = mixed(counts=(3, 2, 2))
    assert sorted(files(program)) == ["krl/PANEL_7L.dat", "krl/PANEL_7L.src"]
    split = files(program, emit_of("krl", holes_per_module=3.0))
    assert sorted(split) == sorted(
        f"krl/PANEL_7L{part}.{kind}" for part in ("", "_1", "_2", "_3") for kind in ("src", "dat")
    )
    main = split["krl/PANEL_7L.src"].decode()
    assert "GLOBAL DEF drill6(" in main
    assert "DEF drill6(" not in split["krl/PANEL_7L_1.src"].decode()
    assert "GLOBAL" not in files(program)["krl/PANEL_7L.src"].decode().replace("GLOBAL INT", "")


def test_each_part_runs_by_itself() -> None:
    program = mixed(counts=(3, 2, 2))
    loaded = krl.load(files(program, emit_of("krl", holes_per_module=3.0)))
    for i, rows in enumerate(parts(program, 3)):
        found = krl.run(loaded, f"PANEL_7L_{i + 1}")
        wanted = expected(program, parts=[rows], home=True)
        compare(by_role(program, found.events), wanted, mm=MM, deg=DEG)


def test_calls_bear_the_holes_names_in_order() -> None:
    program = mixed(counts=(2, 1, 2))
    text = files(program)["krl/PANEL_7L.src"].decode()
    calls = re.findall(r"^  (\w+)\((\w+)(?:,[\d.]+)?\) ; (\S+)\r$", text, re.MULTILINE)
    assert calls == [
        ("drill6", "P1", "P1"),
        ("drill6", "P2", "P2"),
        ("rivet", "P3", "P3"),
        ("drill6", "P4", "P4"),
        ("drill6", "P5", "P5"),
    ]
    assert ";FOLD region upper, process drill6: P1 .. P2, 2 holes\r\n" in text
    assert ";FOLD region lower, process rivet: P3, 1 hole\r\n" in text


def test_ids_that_are_no_names_are_mapped_and_kept_in_comments() -> None:
    program = with_ids(pose_drill(3), ["7-a", "RIVET_ROW_0001_LEFT_WING_0042", "a;%b"])
    made = files(program)
    text = made["krl/PANEL_7L.src"].decode()
    assert "drill6(H7_a,12.000) ; 7-a\r\n" in text
    assert "; a__b\r\n" in text
    assert krl.run(krl.load(made), "PANEL_7L").events
    assert b"hole,7-a,H7_a\n" in made["krl/names.csv"]


@pytest.mark.parametrize("word", ["Frame", "PTP", "standoff", "BAS", "tool_data", "panel_7l", "AT"])
def test_names_that_the_controller_or_the_text_uses_are_refused(word: str) -> None:
    program = with_ids(pose_drill(2), ["P1", word])
    assert set(errors(program)) & {"E641", "E642"}


def test_the_message_fits_and_names_process_and_signal() -> None:
    cycle = rivet_cycle("rivet_with_a_name_of_24_")
    text = files(pose_program([("a", 0, 1)], [cycle]))["krl/PANEL_7L.src"].decode()
    said = re.findall(r'MsgNotify\("([^"]*)","([^"]*)"\)', text)
    assert len(said) == 3
    assert all(len(message) <= 80 and len(module) <= 24 for message, module in said)
    assert said[0][0] == ("rivet_with_a_name_of_24_: no signal $IN[14] (clamped) within 3.000 s")


def test_texts_of_both_robot_languages() -> None:
    assert wait_message("drill6", "clamped", "clamped", 3.0) == (
        "drill6: no signal clamped within 3.000 s"
    )
    long = wait_message("r" * 32, "s" * 40, "clamped", 3.0)
    assert long == f"{'r' * 32}: no signal {'s' * 36}"
    values = (0.25, 0.005, 0.0041666666, 250.0, 1e-7)
    assert [speed_text(v) for v in values] == ["0.250", "0.005", "0.004167", "250.000", "0.0000001"]


def test_a_program_without_holes_is_still_a_program() -> None:
    found = run(pose_program([], []))
    assert [type(e) for e in found.events] == [Move, Move]


# ── refusals ─────────────────────────────────────────────────────────────────────────────────────


def test_poses_need_a_tool() -> None:
    assert "E626" in errors(replace(pose_drill(2), tool=None))


@pytest.mark.parametrize("number", [0, 129])
def test_numbers_of_tools_and_bases(number: int) -> None:
    program = pose_drill(2)
    assert program.tool is not None
    tool = replace(program.tool, number=number)
    assert f"tool {number}" in errors(replace(program, tool=tool))["E625"]
    frame = WorkFrame(number, None, span(6))
    assert f"base {number}" in errors(replace(program, frame=frame))["E625"]


def test_an_analog_output_needs_its_full_scale() -> None:
    program = pose_drill(2, clamp=True)
    speed = replace(program.signals["spindle_speed"], full_scale=None)
    found = errors(replace(program, signals={**program.signals, "spindle_speed": speed}))
    assert "spindle_speed" in found["E624"]


@pytest.mark.parametrize(
    ("role", "full", "shown"),
    [("spindle_speed", 49.0, "3000 rpm"), ("clamp_force", 799.0, "800 N")],
)
def test_a_value_beyond_full_scale(role: str, full: float, shown: str) -> None:
    program = pose_drill(2, clamp=True)
    signal = replace(program.signals[role], full_scale=full)
    found = errors(replace(program, signals={**program.signals, role: signal}))
    assert shown in found["E623"]


def test_a_fault_that_waits_is_a_bug_of_the_planner() -> None:
    cycle = drill_cycle()
    fault = (*cycle.fault, WaitInput("released", 1.0))
    program = pose_program([("a", 0, 1)], [Cycle(cycle.process, cycle.steps, fault)])
    with pytest.raises((PostError, ValueError), match="a fault cannot do wait"):
        emit_files(KrlPost(), program, emit_of("krl"), Report())


# ── the reader can fail ──────────────────────────────────────────────────────────────────────────


def judge(program: Program, text: Mapping[str, bytes]) -> None:
    """Everything that this file asks of a text, at once."""
    for dead in ({"spindle_running": 2}, {}):
        found = krl.run(krl.load(text), program.name, World(numbered(program, dead)))
        assert {e.frame for e in found.events if isinstance(e, Move) and e.frame} == {"2"}
        wanted = expected(program, home=True, dead=dead)
        compare(by_role(program, found.events), wanted, mm=MM, deg=DEG)


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("\r\n", "\n"),
        ("PTP P1:", "PTP P99:"),
        ("  ;ENDFOLD\r\n", ""),
        ("DECL REAL DEPTH,BOTTOM", "DECL REAL BOTTOM"),
        ("  DECL FRAME AT\r\n\r\n  AT=$NULLFRAME\r\n", "  AT=$NULLFRAME\r\n  DECL FRAME AT\r\n"),
        ("  AT=$NULLFRAME\r\n", ""),
        ("LIN HOLE:AT", "LIN AT:HOLE"),
        ("-2.000", "-2.500"),
        ("drill6(P2,12.250)", "drill6(P2,12.255)"),
        ("drill6(P2,12.250)", "drill6(P2)"),
        ("$VEL.CP=0.005", "$VEL.CP=0.006"),
        ("WAIT SEC 0.500", "WAIT SEC 0.050"),
        ("WAIT SEC 0\r\n", ""),
        ("BOTTOM+3.000<DEPTH", "BOTTOM+3.000<=DEPTH+9"),
        (
            "    LOOP\r\n      HALT ; for good: Start only halts again, so reset the program\r\n"
            "    ENDLOOP\r\n",
            "    HALT\r\n",
        ),
        ("OR $TIMER_FLAG[16]", ""),
        ("A 20.0000", "A 20.0020"),
        ("Z -542.000", "Z -542.002"),
        ("=TRUE ; spindle_on", "=FALSE ; spindle_on"),
        ("STANDOFF[1]={X 0.0,Y 0.0,Z -60.000", "STANDOFF[1]={X 0.0,Y 0.0,Z 60.000"),
        ("BAS(#BASE,2)", "BAS(#BASE,3)"),
    ],
)
def test_a_changed_text_is_noticed(old: str, new: str) -> None:
    """Each change of the emitted text is one that could hurt; the oracle must see every one."""
    program = mixed(counts=(2, 1, 2))
    judge(program, files(program))
    made = {path: raw.decode() for path, raw in files(program).items()}
    changed = {path: text.replace(old, new).encode() for path, text in made.items()}
    assert changed != {path: text.encode() for path, text in made.items()}
    with pytest.raises((ReadError, AssertionError)):
        judge(program, changed)


def test_names_of_the_post_are_no_words_of_the_language() -> None:
    rules = KrlPost.names
    for word in (*krl.TYPES, *krl.PREDEFINED, "HALT", "LOOP", "WAIT", "DEF", "ENDDAT", "IF"):
        assert word in rules.keywords | rules.reserved
    assert named("x").text == "x"

"""The G-code post, judged by LinuxCNC itself against what the Program asks for.

`expected` walks a Program's steps with a few lines of its own; LinuxCNC interprets the emitted
text. Neither knows the post.
"""

import math
import re
from collections.abc import Iterator
from dataclasses import replace
from itertools import zip_longest
from pathlib import Path

import numpy as np
import pytest
from drillc.language.diagnostics import Diagnostic, Report, render
from drillc.output.emission import emit_files
from drillc.planning.program import (
    Cycle,
    Dwell,
    MoveTo,
    Plunge,
    Program,
    SetAnalog,
    StopSpindle,
    WaitInput,
)
from drillc.postprocessors.gcode import GcodePost, place_at
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from judges.linuxcnc import Judged, Move, run_gcode, run_rs274
from output.programs import (
    PORTAL_AXES,
    drill_cycle,
    emit_of,
    joint_drill,
    joint_program,
    joint_rivet,
    mixed,
    pose_drill,
    rivet_cycle,
    span,
    visit_cycle,
    with_ids,
    without_signal,
)

LETTERS = "XYZABCUVW"


def emitted(
    program: Program, axes: dict[str, str] | None = None, **options: float
) -> dict[str, str]:
    report = Report()
    files = emit_files(
        GcodePost(), program, emit_of("gcode", axes or PORTAL_AXES, **options), report
    )
    assert not report.failed, [render(d) for d in report.diagnostics]
    return {file.path: file.read().decode("ascii") for file in files}


def judged(folder: Path, files: dict[str, str], main: str = "gcode/portal_a.ngc") -> Judged:
    for path, text in files.items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text)
    result = run_gcode(folder / main)
    assert result.error is None
    assert result.others == ("set_plane",)  # no arcs, no offsets, no tools
    return result


def refused(program: Program, axes: dict[str, str] | None = PORTAL_AXES) -> list[Diagnostic]:
    report = Report()
    emit_files(GcodePost(), program, emit_of("gcode", axes), report)
    return report.diagnostics


# ── what the Program asks for, in a few lines that share nothing with the post ───────────────────


def pecks(step: Plunge, depth: float) -> Iterator[tuple[float, float]]:
    """(depth, mm/s) of each stroke."""
    bottom = step.from_mm
    while step.peck_mm is not None and bottom + step.peck_mm < depth - 1e-3:
        bottom += step.peck_mm
        yield bottom, step.feed_mm_s
        yield step.from_mm, step.return_mm_s
        yield bottom - step.peck_gap_mm, step.return_mm_s
    yield depth, step.feed_mm_s


def expected(program: Program, axes: dict[str, str]) -> Iterator[dict[str, object]]:
    """Every move and dwell, hole by hole: letters in mm and degrees, feeds in mm/min."""
    motion = program.motion
    assert motion is not None
    feed = axes[motion.axes[motion.feed_axis].name]
    place = dict.fromkeys(LETTERS, 0.0)

    def move(kind: str, feed_rate: float | None, **letters: float) -> dict[str, object]:
        place.update(letters)
        return {"kind": kind, "place": dict(place), "feed": feed_rate}

    out: list[float] = []  # how far out each hole asks the feed axis to be, before and after
    for section in program.sections:
        cycle = program.cycles[section.cycle]
        for row in range(section.start, section.stop):
            values = {
                axes[axis.name]: math.degrees(q) if axis.rotary else q
                for axis, q in zip(motion.axes, motion.joints[row].tolist(), strict=True)
            }
            at_hole = values.pop(feed)
            yield move("traverse", None, **{feed: float(motion.withdraw_mm[row])}) | {
                "hole": str(program.holes.ids[row])
            }
            yield move("traverse", None, **values)
            start = at_hole - motion.feed_sign * cycle.process.approach_mm
            yield move("traverse", None, **{feed: start})
            to = start
            for step in cycle.steps:
                if isinstance(step, MoveTo):
                    strokes = [(step.depth_mm, step.speed_mm_s)]
                elif isinstance(step, Plunge):
                    strokes = list(pecks(step, float(program.depth_mm[row])))
                else:
                    strokes = []
                for depth, speed in strokes:
                    to = at_hole + motion.feed_sign * depth
                    yield move("feed", speed * 60.0, **{feed: to})
                if isinstance(step, Dwell):
                    yield {"kind": "dwell", "seconds": step.seconds}
            out += [float(motion.withdraw_mm[row]), to]
    if out:
        clear = min(out) if motion.feed_sign > 0 else max(out)
        yield move("traverse", None, **{feed: clear})


def assert_does(moves: tuple[Move, ...], program: Program, axes: dict[str, str]) -> None:
    for got, want in zip_longest(moves, expected(program, axes)):
        assert got is not None, f"missing: {want}"
        assert want is not None, f"too much: {got}"
        assert got.kind == want["kind"], (got, want)
        if got.kind == "dwell":
            assert got.seconds == pytest.approx(want["seconds"], abs=1e-3)
            continue
        # The tolerance of the requirement: 1e-3 mm and 1e-3 degrees.
        assert got.place == pytest.approx(want["place"], abs=1e-3)
        if "hole" in want:
            assert f"hole {want['hole']}" in got.comments
        if want["feed"] is not None:
            assert got.feed == pytest.approx(want["feed"], rel=1e-6)


PROGRAMS = {
    "rivet": joint_rivet(5),
    "rivet, feed the other way": joint_rivet(3, feed_sign=-1),
    "drill": joint_drill(6, clamp=True),
    "peck": joint_drill(4, peck_mm=5.0),
    "peck, depth a multiple of it": joint_drill(4, peck_mm=3.5),
    "peck, the other way": joint_drill(4, peck_mm=2.75, feed_sign=-1),
    "one stroke though pecking is asked for": joint_drill(2, peck_mm=50.0),
    "only visits": joint_program([("plate", 0, 2)], [visit_cycle()]),
    "sections": mixed(joint_program),
    "no hole": joint_rivet(0),
}


@pytest.mark.parametrize("program", PROGRAMS.values(), ids=PROGRAMS.keys())
def test_linuxcnc_does_what_the_program_asks_for(tmp_path: Path, program: Program) -> None:
    result = judged(tmp_path, emitted(program))
    assert_does(result.moves, program, PORTAL_AXES)
    assert result.messages == ()


@pytest.mark.parametrize("size", [1, 4, 5, 11])
def test_modules_are_called_from_the_main_file(tmp_path: Path, size: int) -> None:
    program = mixed(joint_program, (4, 3, 5))
    files = emitted(program, holes_per_module=float(size))
    parts = math.ceil(12 / size)
    names = [f"gcode/portal_a_{i + 1}.ngc" for i in range(parts)]
    assert list(files) == ["gcode/portal_a.ngc", *names, "gcode/names.csv"]
    result = judged(tmp_path, files)
    assert_does(result.moves, program, PORTAL_AXES)


@settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(letters=st.permutations(LETTERS), sign=st.sampled_from([1, -1]), seed=st.integers(0, 99))
def test_any_joint_on_any_letter(tmp_path: Path, letters: list[str], sign: int, seed: int) -> None:
    axes = {f"q{i + 1}": letters[i] for i in range(6)}
    program = joint_drill(4, peck_mm=4.0, feed_sign=sign)
    assert program.motion is not None
    rng = np.random.default_rng(seed)
    program.motion.joints[:] = rng.uniform(-6000.0, 6000.0, program.motion.joints.shape)
    program.motion.joints[:, 2] = rng.uniform(-np.pi, np.pi, 4)
    program.motion.withdraw_mm[:] = program.motion.joints[:, 5] - sign * 500.0
    assert_does(judged(tmp_path, emitted(program, axes)).moves, program, axes)


def test_the_stand_alone_interpreter_takes_it_too(tmp_path: Path) -> None:
    axes = dict(zip(PORTAL_AXES, "XYABCZ", strict=True))
    files = emitted(mixed(joint_program), axes, holes_per_module=4.0)
    judged(tmp_path, files)
    done = run_rs274(tmp_path / "gcode" / "portal_a.ngc")
    assert done.returncode == 0, done.stderr
    assert done.stdout.count('COMMENT("hole ') == 12
    assert "PROGRAM_END" in done.stdout
    # The gcode module is silent about outputs and spindle; the stand-alone interpreter is not.
    spindle = [line.split()[-1] for line in done.stdout.splitlines() if "SPINDLE" in line]
    assert any("3000" in line for line in spindle)


def test_the_judge_itself_can_say_no(tmp_path: Path) -> None:
    files = emitted(joint_rivet(2))
    text = files["gcode/portal_a.ngc"]
    (tmp_path / "bad.ngc").write_text(text.replace("G0 Z2211.4000", "G0 Z2211.4e3"))
    assert run_gcode(tmp_path / "bad.ngc").error is not None
    (tmp_path / "lost.ngc").write_text(text.replace("o<rivet> call", "o<rivets> call"))
    assert run_gcode(tmp_path / "lost.ngc").error is not None
    assert run_rs274(tmp_path / "bad.ngc").returncode != 0


@pytest.mark.parametrize("wait", range(3))
def test_a_time_out_ends_the_program(tmp_path: Path, wait: int) -> None:
    """LinuxCNC's preview never times out, so the test turns the condition of one wait around."""
    program = joint_rivet(2)
    text = emitted(program)["gcode/portal_a.ngc"]
    waits = list(re.finditer(re.escape("[#5399 EQ -1]"), text))
    assert len(waits) == 3
    at = waits[wait].start()
    text = text[:at] + text[at:].replace("EQ", "NE", 1)
    (tmp_path / "fault.ngc").write_text(text)
    result = run_gcode(tmp_path / "fault.ngc")
    assert result.error is None
    place = [move.place["Z"] for move in result.moves]
    assert place == pytest.approx([2211.4, 2211.4, 2571.4, 2611.4, 2561.4])  # and no second hole
    role = ("clamped", "set_done", "released")[wait]
    assert result.messages + result.trailing_comments
    said = " ".join((*result.messages, *result.trailing_comments))
    assert f"rivet: no {role} within" in said


# ── the text ─────────────────────────────────────────────────────────────────────────────────────


def test_the_file_as_a_whole() -> None:
    program = joint_program([("plate", 0, 2)], [drill_cycle()], name="SKIN_1", ids=["R1", "R-2"])
    files = emitted(program)
    assert files["gcode/names.csv"] == "kind,spec,emitted\nprogram,SKIN_1,skin_1\n"
    assert (
        files["gcode/skin_1.ngc"]
        == """\
(program SKIN_1, 2 holes)
(axes q1=U q2=V q3=A q4=X q5=Y q6=Z)
G21 G90 G94 G17 G40 G49 G80 G54 G61

o<drill6> sub (#1 Z at the hole, #2 depth)
  G0 Z[#1 - 60.0000]
  S3000.000 M3
  M66 P12 L3 Q4.000 (wait for spindle_running)
  o20 if [#5399 EQ -1]
    M5
    G1 Z[#1 - 60.0000] F9000.000
    (MSG,drill6: no spindle_running within 4.000 s, program stopped)
    M2
  o20 endif
  G1 Z[#1 - 2.0000] F6000.000
  G1 Z[#1 + #2] F300.000
  G4 P0.500
  G1 Z[#1 - 2.0000] F9000.000
  G1 Z[#1 - 60.0000] F9000.000
  M5
o<drill6> endsub

(region plate)
(hole R1)
G0 Z2211.4000
G0 X5619.9000 Y290.5000 A110.00000 U46.3000 V4953.7000
o<drill6> call [2611.4000] [12.0000]
(hole R-2)
G0 Z2211.2000
G0 X5653.2000 Y268.8000 A108.75000 U57.5500 V4946.2000
o<drill6> call [2612.2000] [12.2500]

(out of reach of every hole)
G0 Z2211.2000

M2
"""
    )


def test_a_spindle_that_says_nothing_is_not_waited_for() -> None:
    program = without_signal(joint_drill(1), "spindle_running")
    assert "M66" not in emitted(program)["gcode/portal_a.ngc"]


def test_labels_are_unique() -> None:
    cycles = [drill_cycle(f"d{i}", peck_mm=2.0, clamp=True) for i in range(5)] + [rivet_cycle()]
    program = joint_program([(f"r{i}", i, 1) for i in range(6)], cycles)
    text = emitted(program)["gcode/portal_a.ngc"]
    opened = re.findall(r"^ *o([0-9]+) (?:if|while)", text, re.MULTILINE)
    assert len(opened) == len(set(opened)) > 20


def test_ids_cannot_leave_their_comment(tmp_path: Path) -> None:
    ids = ["a) G0 Z0 (b", "M2;", "%", "((", "x" * 64, "MSG,hello", "o<r> call"]
    program = with_ids(joint_rivet(7), ids)
    files = emitted(program)
    result = judged(tmp_path, files)
    shown = [re.sub("[();]", "_", i) for i in ids]
    assert_does(result.moves, with_ids(program, shown), PORTAL_AXES)
    assert max(map(len, files["gcode/portal_a.ngc"].splitlines())) <= 252


def test_names_in_one_case_and_without_odd_characters(tmp_path: Path) -> None:
    program = joint_program([("R", 0, 1)], [rivet_cycle("Set_Rivet_" + "9" * 80)], name="7_Ab")
    files = emitted(program, holes_per_module=1.0)
    name = next(iter(files))
    assert name == "gcode/p7_ab.ngc"
    assert_does(judged(tmp_path, files, name).moves, program, PORTAL_AXES)


def test_two_processes_that_differ_in_case_only() -> None:
    program = joint_program(
        [("a", 0, 1), ("b", 1, 1)], [rivet_cycle("set", line=60), rivet_cycle("Set", line=65)]
    )
    [error] = refused(program)
    assert (error.code, error.span, error.labels[0].span) == ("E641", span(65), span(60))


@pytest.mark.parametrize(
    ("depth_mm", "sign", "text"),
    [
        (-60.0, 1, "[#1 - 60.0000]"),
        (-60.0, -1, "[#1 + 60.0000]"),
        (2.5, 1, "[#1 + 2.5000]"),
        (2.5, -1, "[#1 - 2.5000]"),
        (0.0, 1, "#1"),
        (-0.00001, -1, "#1"),
    ],
)
def test_depths_become_places_of_the_feed_axis(depth_mm: float, sign: int, text: str) -> None:
    assert place_at(depth_mm, sign) == text


# ── what is refused ──────────────────────────────────────────────────────────────────────────────


def test_a_program_in_poses_is_refused_at_the_emit() -> None:
    [error] = refused(pose_drill(), None)
    assert (error.code, error.span) == ("E610", emit_of("gcode").post.span)


@pytest.mark.parametrize("number", [64, 4096])
def test_signals_beyond_linuxcncs(number: int) -> None:
    program = joint_rivet()
    program.signals["clamp"] = replace(program.signals["clamp"], number=number)
    [error] = refused(program)
    assert (error.code, error.span) == ("E620", program.signals["clamp"].span)


def test_axes_of_another_kind_are_pointed_out() -> None:
    found = refused(joint_rivet(), {**PORTAL_AXES, "q3": "W", "q5": "B"})
    assert [d.code for d in found] == ["W650", "W650"]
    assert "joint q3 turns, but W is a length" in found[0].message
    assert "joint q5 slides, but B is an angle" in found[1].message


def with_step(step: MoveTo | Plunge | WaitInput | SetAnalog) -> Program:
    cycle = rivet_cycle()
    return joint_program([("r", 0, 1)], [Cycle(cycle.process, (step, *cycle.steps), cycle.fault)])


@pytest.mark.parametrize(
    "step",
    [
        MoveTo(0.0, 1e-6),
        Plunge(0.0, 1e-6, 10.0, None, 0.0),
        Plunge(0.0, 1.0, 1e-6, 3.0, 0.0),
        Plunge(0.0, 1.0, 1.0, 1e-6, 0.0),
        WaitInput("clamped", 1e-4),
    ],
)
def test_numbers_that_vanish_when_written(step: MoveTo | Plunge | WaitInput) -> None:
    [error] = refused(with_step(step))
    assert (error.code, error.span) == ("E651", span(60))


def test_analog_values_beyond_their_scale() -> None:
    [error] = refused(with_step(SetAnalog("clamp_force", 2001.0)))
    assert error.code == "E623"
    program = joint_rivet()
    program.signals["clamp_force"] = replace(program.signals["clamp_force"], full_scale=None)
    [error] = refused(program)
    assert (error.code, error.span) == ("E624", program.signals["clamp_force"].span)


def test_a_wait_inside_a_fault_does_not_fault_again(tmp_path: Path) -> None:
    cycle = rivet_cycle()
    fault = (StopSpindle(), WaitInput("released", 1.0))
    program = joint_program([("r", 0, 1)], [Cycle(cycle.process, cycle.steps, fault)])
    assert_does(judged(tmp_path, emitted(program)).moves, program, PORTAL_AXES)

"""G-code for arms: LinuxCNC interprets it, and `arm_followed` follows the tool block by block."""

from __future__ import annotations

import itertools
import math
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from drillc.driver import plan_spec
from drillc.language.diagnostics import Diagnostic, Report, render
from drillc.output.emission import emit_files
from drillc.planning.program import Program
from drillc.postprocessors._gcode_arm import ON_AXIS_MM, ON_TRAVEL_MM
from drillc.postprocessors.gcode import GcodePost
from judges.linuxcnc import Judged, run_gcode, run_rs274
from output.arm_followed import Followed, Machine, canonical, follow
from output.arm_programs import DIMENSIONS, HOME_DEG, STANDING, TOOL, Way, arm_program, shifted
from output.programs import drill_cycle, emit_of, rivet_cycle, visit_cycle
from readers import arms

ROOT = Path(__file__).parents[2]
LETTERS = "XYZABC"
#: Joints are written with five digits; the longest arm is 5 m.
WRITTEN_MM = 0.002
#: A travel is within its tolerance for every point of arm and tool: so is the tool's direction.
TURNED_RAD = 0.002


def axes_of(letters: str) -> dict[str, str]:
    return {f"A{i + 1}": letter for i, letter in enumerate(letters)}


def emitted(program: Program, letters: str = LETTERS, **options: float) -> dict[str, str]:
    report = Report()
    emit = emit_of("gcode", axes_of(letters), **options)
    files = emit_files(GcodePost(), program, emit, report)
    assert not report.failed, [render(d) for d in report.diagnostics]
    return {file.path: file.read().decode("ascii") for file in files}


def judged(folder: Path, files: Mapping[str, str]) -> Judged:
    for path, text in files.items():
        (folder / path).parent.mkdir(exist_ok=True)
        (folder / path).write_text(text)
        assert max(map(len, text.splitlines())) <= 252
    result = run_gcode(folder / next(iter(files)))
    assert result.error is None
    assert result.others == ("set_plane",)
    return result


def machine_of(maker: str, letters: str = LETTERS) -> Machine:
    return Machine(DIMENSIONS[maker], STANDING, TOOL, letters, np.full(6, math.degrees(1.0)))


def assert_within(found: Followed) -> None:
    assert found.into_mm < ON_AXIS_MM + WRITTEN_MM
    assert found.travel_mm < ON_TRAVEL_MM + WRITTEN_MM
    assert found.turned_rad < TURNED_RAD


def calm_joints(n: int, maker: str = "kuka", seed: int = 0) -> list[list[float]]:
    """Joints (deg) of holes near each other, so that the arm goes straight between any two."""
    middle = [25.0, -70.0, 95.0, 35.0, 50.0, 20.0]
    if maker == "abb":
        middle = [25.0, 20.0, 5.0, 35.0, 50.0, 20.0]
    rng = np.random.default_rng(seed)
    rows: list[list[float]] = (np.array(middle) + rng.uniform(-9.0, 9.0, (n, 6))).tolist()
    return rows


def a_program(maker: str = "kuka", seed: int = 0, home: bool = True) -> Program:
    """Three sections, vias of both kinds before, between and after their holes."""
    rows = calm_joints(9, maker, seed)
    back = [Way(False, tuple(shifted(maker, row, -170.0))) for row in rows]
    aside = Way(True, tuple(np.add(rows[5], (3.0, -4.0, 5.0, 20.0, -10.0, 30.0))))
    return arm_program(
        [("upper", 0, 4), ("lower", 1, 3), ("rim", 2, 2)],
        [drill_cycle(peck_mm=3.0, clamp=True), rivet_cycle(), visit_cycle()],
        maker=maker,
        joints_deg=rows,
        home_deg=HOME_DEG if home else None,
        ways={1: [back[0], back[1]], 3: [back[2]], 6: [aside, back[6]], 9: [back[8]]},
    )


# ── the tool goes where the Program says ─────────────────────────────────────────────────────────


@pytest.mark.parametrize("maker", ["kuka", "abb", "other"])
@pytest.mark.parametrize("seed", range(3))
def test_the_tool_follows_its_axis_and_its_ways(tmp_path: Path, maker: str, seed: int) -> None:
    program = a_program(maker, seed, home=seed != 1)
    moves = judged(tmp_path, emitted(program)).moves
    found = follow(moves, program, machine_of(maker))
    assert_within(found)
    assert found.into_mm > 0.2 * ON_AXIS_MM  # no more places than needed, by far
    assert found.travel_mm > 0.02 * ON_TRAVEL_MM


@pytest.mark.parametrize("letters", ["CBAWVU", "UVWXYZ", "AUXBVY", "ZCWYBV"])
def test_any_joint_on_any_letter(tmp_path: Path, letters: str) -> None:
    program = a_program(seed=7)
    moves = judged(tmp_path, emitted(program, letters)).moves
    assert_within(follow(moves, program, machine_of("kuka", letters)))


@pytest.mark.parametrize("size", [1, 3, 4, 100])
def test_modules_are_called_from_the_main_file(tmp_path: Path, size: int) -> None:
    program = a_program()
    files = emitted(program, holes_per_module=float(size))
    assert len([path for path in files if path.endswith(".ngc")]) == 1 + (9 + size - 1) // size * (
        size < 9
    )
    assert "gcode/names.csv" in files
    assert_within(follow(judged(tmp_path, files).moves, program, machine_of("kuka")))


@pytest.mark.parametrize("letters", ["XABYCZ", "XABUCV", "UABVCW"])
@pytest.mark.parametrize("tilt_deg", [0.0, 0.0004, 0.02])
def test_letters_that_hardly_move(tmp_path: Path, letters: str, tilt_deg: float) -> None:
    """In the arm's own plane joints 1, 4 and 6 stand still, or nearly so, while the others move:
    those along whose letters F is counted first."""
    rows = [[10.0, -70.0, 95.0, tilt_deg, 50.0, 0.0], [10.0, -72.0, 99.0, tilt_deg, 48.0, 0.0]]
    program = arm_program([("a", 0, 2)], [drill_cycle(peck_mm=2.5)], joints_deg=rows)
    moves = judged(tmp_path, emitted(program, letters)).moves
    assert_within(follow(moves, program, machine_of("kuka", letters)))


def test_outputs_come_in_order_and_nothing_stops_in_a_hole(tmp_path: Path) -> None:
    program = a_program()
    files = emitted(program, holes_per_module=4.0)
    moves = judged(tmp_path, files).moves
    found = follow(moves, program, machine_of("kuka"))
    done = run_rs274(tmp_path / next(iter(files)))
    assert done.returncode == 0, done.stderr
    tokens, exact = canonical(done.stdout)
    assert len(exact) == len(moves)
    assert tuple(tokens[:-1]) == found.tokens  # at last M2 stops the spindle once more
    assert len(found.tokens) > 30
    for i, move in enumerate(moves):
        assert exact[i] == (move.kind != "feed" or i in found.stops)


@pytest.mark.parametrize("wait", range(3))
def test_a_time_out_withdraws_and_ends_the_program(tmp_path: Path, wait: int) -> None:
    program = arm_program([("a", 0, 2)], [rivet_cycle()], joints_deg=calm_joints(2))
    [(path, text)] = [(p, t) for p, t in emitted(program).items() if p.endswith(".ngc")]
    waits = list(re.finditer(re.escape("[#5399 EQ -1]"), text))
    assert len(waits) == 3
    at = waits[wait].start()
    result = judged(tmp_path, {path: text[:at] + text[at:].replace("EQ", "NE", 1)})
    said = " ".join((*result.messages, *result.trailing_comments))
    assert f"rivet: no {('clamped', 'set_done', 'released')[wait]} within" in said
    machine = machine_of("kuka")
    _, point = machine.tool(machine.joints(result.moves[-1].place)[None])
    wanted = program.holes.position_mm[0] - 50.0 * program.part_from_tool[0][:, 2]
    assert np.abs(point[0] - wanted).max() < ON_AXIS_MM + WRITTEN_MM
    assert not any("hole P2" in move.comments for move in result.moves)


def test_the_arm_itself_keeps_to_its_way(tmp_path: Path) -> None:
    """Elbow, wrist and flange, too, are where they would be on the straight way."""
    program = a_program(seed=4)
    machine = machine_of("kuka")
    moves = judged(tmp_path, emitted(program)).moves
    arm = DIMENSIONS["kuka"]
    worst, looked_at = 0.0, 0
    for one, two in itertools.pairwise(move for move in moves if move.place):
        if two.kind != "feed":
            continue
        ends = machine.joints(one.place), machine.joints(two.place)
        (first, last), places = machine.tool(np.array(ends))
        if np.linalg.norm(places[1] - places[0]) < 15.0:
            continue
        middle = np.eye(4)
        turning = (first.inv() * last).as_rotvec()
        middle[:3, :3] = (first * type(first).from_rotvec(0.5 * turning)).as_matrix()
        middle[:3, 3] = places.mean(axis=0)
        flange = np.linalg.inv(STANDING) @ middle @ np.linalg.inv(TOOL)
        between = 0.5 * (ends[0] + ends[1])
        exact = arms.points(arm, arms.joints_near(arm, flange, between.tolist()))
        made = arms.points(arm, between.tolist())
        for name in ("elbow", "wrist", "flange"):
            worst = max(worst, float(np.linalg.norm(exact[name] - made[name])))
        looked_at += 1
    assert looked_at > 20
    # The tool goes on evenly up to its tolerance, so that the middles differ a little along it.
    assert 0.01 < worst < 2 * ON_TRAVEL_MM


# ── a job as it is planned ───────────────────────────────────────────────────────────────────────

#: The nacelle's base and tool, from its spec, and the arm's speeds from its data sheet.
NACELLE = np.array([[1.0, 0, 0, 1500], [0, -1, 0, 3000], [0, 0, -1, 1500], [0, 0, 0, 1]])
KR210_DEG_S = np.array([105.0, 94.0, 100.0, 136.0, 129.0, 206.0])


def test_the_nacelle(tmp_path: Path) -> None:
    report = Report()
    planned = plan_spec(ROOT / "samples" / "nacelle.drill", ROOT / "samples", report)
    [program] = planned.programs
    machine = Machine(arms.KR210, NACELLE, TOOL, LETTERS, KR210_DEG_S)
    found = follow(judged(tmp_path, emitted(program)).moves, program, machine)
    assert_within(found)


# ── the follower can say no ──────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (r"(#10[3]=\d+\.)\d", r"\g<1>9"),  # a node
        (r"#100=\d+", "#100=2"),
        (r"\[300\.000\]", "[310.000]"),  # the feed
        (r"\[9000\.000\]", "[8000.000]"),
        (r"F\[60 ", "F[61 "),
        (r"(o<_go> call .*) \[[0-9.]+\]\n", r"\1 [0.1]\n"),
        (r"(o<_go> call) \[(\d+)", r"\1 [1\2"),
        (r"o<_go> call .*\no<_go>", "o<_go>"),
        (r"G0 X-?\d", "G0 X9"),
    ],
)
def test_a_changed_text_is_noticed(tmp_path: Path, old: str, new: str) -> None:
    program = a_program()
    files = emitted(program)
    path = next(iter(files))
    changed = {path: re.sub(old, new, files[path])}
    assert changed[path] != files[path]
    with pytest.raises((AssertionError, IndexError)):
        assert_within(follow(judged(tmp_path, changed).moves, program, machine_of("kuka")))


# ── what is said ─────────────────────────────────────────────────────────────────────────────────


def said(program: Program, axes: dict[str, str] | None) -> list[Diagnostic]:
    report = Report()
    emit_files(GcodePost(), program, emit_of("gcode", axes), report)
    return report.diagnostics


def test_an_arm_needs_all_its_axes() -> None:
    program = a_program()
    [error] = said(program, None)
    assert error.code == "E612"
    assert "A1 X  A2 Y  A3 Z  A4 A  A5 B  A6 C" in str(error.hint)
    [error] = said(program, axes_of("XYZAB"))
    assert (error.code, "A6" in error.message) == ("E616", True)


def test_three_joints_must_be_on_lengths_but_no_more() -> None:
    program = a_program()
    assert said(program, axes_of("XYZABC")) == []
    [warning] = said(program, axes_of("XYZUVC"))
    assert warning.code == "W650"
    assert "A1, A2, A3, A4, A5 turn" in warning.message
    assert "A, B are free" in warning.message


def test_without_a_home_the_program_says_so() -> None:
    text = next(iter(emitted(a_program(home=False)).values()))
    assert "(no home is known" in text
    assert "(home)" not in text

"""Programs for machines that are known: an arm's ways and postures, a portal's joints."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drillc.driver import plan_spec
from drillc.language.diagnostics import Report
from drillc.language.job import Job
from drillc.planning.program import Program
from drillc.verification.events import Kind
from drillc.verification.postures import cell_of, told_posture
from drillc.verification.proof import verify_program
from drillc.verification.verdict import Verdict
from output import arm_programs as arms
from output import programs
from readers.arms import IRB6640, KR210
from verification.proof.made import HandReader, HandRun, emit_of, job_of, run_of

OUT = tuple(arms.shifted("kuka", arms.some_joints(7)[1], -200.0))
ARM = arms.arm_program(
    [("a", 0, 4), ("b", 1, 3)],
    [programs.drill_cycle(peck_mm=3.0), programs.rivet_cycle()],
    ways={2: [arms.Way(False, OUT)]},
)
SPEC = """drill 1
program PORTAL_A
part skin { normals outward }
robot riveter portal {
  D 10 m   H 5 m   d 0.75 m   height centre   side below
  limits { q3 -180 deg .. 180 deg   q5 -3 m .. 3 m }
}
io { clamp output 1  clamped input 1  released input 2  set output 2  set_done input 3 }
process rivet5 { approach 120 mm  clamp timeout 3 s  rivet timeout 5 s  retract 120 mm }
region plate {
  process rivet5
  points m {
    R1 (5.5, -0.3, -0.2) normal (0.5, 0.8138, -0.2962)
    R2 (5.4, -0.2, -0.25) normal (0.45, 0.84113, -0.3)
    R3 (5.3, -0.1, -0.3) normal (0.4, 0.86603, -0.3)
    R4 (5.2, 0.0, -0.35) normal (0.35, 0.88741, -0.3)
  }
}
emit gcode { axes { q1 U  q2 V  q3 A  q4 X  q5 Y  q6 Z } }
"""


def failing(verdict: Verdict) -> dict[str, list[str]]:
    return {
        check.name: [failure.message for failure in check.failures]
        for check in verdict.checks
        if check.failed
    }


def prove_arm(run: HandRun, program: Program = ARM, chunk: int = 60) -> Verdict:
    return verify_program(run, HandReader(), job_of(program), program, {}, emit_of(), chunk)


# ── an arm ───────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("maker", ["kuka", "abb", "other"])
@pytest.mark.parametrize("chunk", [5, 1000])
def test_an_arms_program_is_proven(maker: str, chunk: int) -> None:
    program = arms.arm_program([("a", 0, 5)], [programs.drill_cycle(clamp=True)], maker=maker)
    verdict = prove_arm(run_of(program), program, chunk)
    assert not failing(verdict)
    joints = verdict.check("joints")
    assert joints.worst is not None
    assert joints.worst < 1.0


def test_a_program_with_a_straight_via_is_proven() -> None:
    assert not failing(prove_arm(run_of(ARM)))


def body(run: HandRun, kind: Kind, nth: int) -> dict[str, Any]:
    rows = [row for row in run.rows if row["file"] == 0 and row["kind"] == kind]
    found: dict[str, Any] = rows[nth]
    return found


def test_a_via_left_out_is_found() -> None:
    run = run_of(ARM)
    run.rows.remove(body(run, Kind.STRAIGHT, 0))
    said = failing(prove_arm(run))
    assert set(said) == {"ways"}
    assert "the way to P3 does not pass" in said["ways"][0]


def test_a_via_moved_is_found() -> None:
    run = run_of(ARM)
    row = body(run, Kind.STRAIGHT, 0)
    row["position_mm"] = row["position_mm"] + np.array([0.0, 0.01, 0.0])
    assert "ways" in failing(prove_arm(run))


def test_a_vias_joints_moved_are_found() -> None:
    run = run_of(ARM)
    row = body(run, Kind.JOINTS, 1)
    add(row, 2, 0.001)
    assert "ways" in failing(prove_arm(run))


def test_the_speed_on_a_straight_way_is_compared() -> None:
    run = run_of(ARM)
    body(run, Kind.STRAIGHT, 0)["speed_mm_s"] = 2000.0
    assert set(failing(prove_arm(run))) == {"speed"}


def test_a_program_that_does_not_begin_at_home_is_found() -> None:
    run = run_of(ARM)
    run.rows.remove(body(run, Kind.JOINTS, 0))
    assert "ways" in failing(prove_arm(run))


def test_a_straight_way_made_by_the_joints_is_found() -> None:
    run = run_of(ARM)
    body(run, Kind.STRAIGHT, 0)["kind"] = Kind.JOINTS
    assert "made by the joints" in failing(prove_arm(run))["ways"][0]


def test_joints_beyond_their_limits_are_found() -> None:
    run = run_of(ARM)
    row = body(run, Kind.JOINTS, 1)
    row["joints"] = [360.0, *row["joints"][1:]]
    said = failing(prove_arm(run))
    assert any("A1 goes to 360.000 deg; its limits are -350.000" in one for one in said["joints"])


# S and T, and cf1, cf4, cf6, cfx, by the oracle's own arm: behind axis 1, the elbow's side, A5 < 0.


def as_pose(run: HandRun, nth: int, said: Any) -> None:
    """The nth move of the body by the joints, told by its pose and its posture."""
    row = body(run, Kind.JOINTS, nth)
    pose = arms.tool_at("kuka", row["joints"])
    del row["joints"]
    row.update(position_mm=pose[:3, 3], rotation=pose[:3, :3], tool=0, base=1)
    row["configuration"] = said


def status_and_turn(joints_deg: Any) -> list[float]:
    turn = sum(1 << k for k in range(6) if joints_deg[k] < 0.0)
    return [2.0 + 4.0 * (joints_deg[4] < 0.0), float(turn), np.nan, np.nan]


@pytest.mark.parametrize(
    ("bit", "names"), [(None, ""), (0, "S is"), (2, "S is"), (8, "T is"), (13, "T is")]
)
def test_status_and_turn_are_those_of_the_planned_joints(bit: int | None, names: str) -> None:
    run = run_of(ARM)
    said = status_and_turn(body(run, Kind.JOINTS, 1)["joints"])
    if bit is not None:
        k, mask = divmod(bit, 8)
        said[k] = float(int(said[k]) ^ (1 << mask))
    as_pose(run, 1, said)
    found = failing(prove_arm(run))
    if bit is None:
        assert not found
    else:
        assert set(found) == {"configuration"}
        assert names in found["configuration"][0]


def test_a_pose_by_the_joints_that_says_no_posture_is_found() -> None:
    run = run_of(ARM)
    as_pose(run, 1, np.full(4, np.nan))
    assert set(failing(prove_arm(run))) == {"configuration"}


def test_postures_of_known_joints() -> None:
    """KUKA: an arm bent forward has S 2, a wrist that is turned over S 6; an ABB's quadrants."""
    for maker, size in (("kuka", KR210), ("abb", IRB6640)):
        program = arms.arm_program([("a", 0, 1)], [programs.drill_cycle()], maker=maker)
        case: Any = type("Case", (), {"program": program})
        cell = cell_of(case)
        assert cell is not None
        straight = np.radians(np.array(size.straight, dtype=np.float64))
        bent = straight + np.radians([100.0, 30.0, 40.0, -100.0, 30.0, 200.0])
        both = np.stack([bent, bent * [1, 1, 1, 1, -1, 1]])
        told = told_posture(cell, both, maker)
        if maker == "kuka":
            assert told[:, 1].astype(int).tolist() == [
                sum(1 << k for k in range(6) if q[k] < 0)
                for q in (bent, bent * [1, 1, 1, 1, -1, 1])
            ]
            assert (told[1, 0] - told[0, 0]) in (4.0, -4.0)
        else:
            assert told[0, :3].tolist() == [1.0, -2.0, 2.0]
            assert told[1, 3] - told[0, 3] == 1.0


# ── a portal ─────────────────────────────────────────────────────────────────────────────────────


@pytest.fixture(scope="module")
def portal(tmp_path_factory: pytest.TempPathFactory) -> tuple[Job, Program]:
    spec: Path = tmp_path_factory.mktemp("portal") / "portal.drill"
    spec.write_text(SPEC)
    planned = plan_spec(spec, None, Report())
    return planned.job, planned.programs[0]


Portal = tuple[Job, Program]
AXES = list(programs.PORTAL_AXES.values())


def prove_portal(portal: Portal, run: HandRun, chunk: int = 30) -> Verdict:
    job, program = portal
    return verify_program(run, HandReader(), job, program, {}, emit_of(programs.PORTAL_AXES), chunk)


def inner(run: HandRun, hole: int, nth: int) -> dict[str, Any]:
    moves = [row for row in run.rows if row["hole"] == hole and "joints" in row]
    found: dict[str, Any] = moves[nth]
    return found


def add(row: dict[str, Any], axis: int, by: float) -> None:
    joints = list(row["joints"])
    joints[axis] += by
    row["joints"] = joints


@pytest.mark.parametrize("chunk", [4, 1000])
def test_a_portals_program_is_proven(portal: Portal, chunk: int) -> None:
    run = run_of(portal[1], AXES)
    assert not failing(prove_portal(portal, run, chunk))


@pytest.mark.parametrize("axis", range(6))
def test_each_joint_of_a_hole_is_compared(portal: Portal, axis: int) -> None:
    run = run_of(portal[1], AXES)
    for row in run.rows:
        if row["hole"] == 1 and "joints" in row and row["line"] != 10:
            add(row, axis, 0.002)
    said = failing(prove_portal(portal, run))
    assert any("R2" in one for check in said.values() for one in check)


def test_a_height_that_is_not_planned_is_found(portal: Portal) -> None:
    """q1, q2 and q6 together: the tool is where it should be, the machine is not."""
    run = run_of(portal[1], AXES)
    for row in run.rows:
        if row["hole"] == 1 and "joints" in row and row["line"] != 10:
            for axis in (0, 1, 5):
                add(row, axis, 3.0)
    said = failing(prove_portal(portal, run))
    assert "joints" in said
    assert "position" not in said


def test_other_joints_that_move_before_the_tool_is_withdrawn_are_found(portal: Portal) -> None:
    run = run_of(portal[1], AXES)
    withdraw, over = inner(run, 2, 0), inner(run, 2, 1)
    for row in (withdraw, over):
        add(row, 5, 60.0)
    said = failing(prove_portal(portal, run))
    words = "on the way to R3 other joints move while q6 is at"
    assert any(words in one for one in said["ways"])


def test_other_joints_that_move_in_a_hole_are_found(portal: Portal) -> None:
    run = run_of(portal[1], AXES)
    add(inner(run, 2, 3), 4, 0.0001)
    assert "straight" in failing(prove_portal(portal, run))


def test_a_hole_that_is_too_deep_is_found(portal: Portal) -> None:
    run = run_of(portal[1], AXES)
    add(inner(run, 2, 3), 5, 0.02)
    assert "depth" in failing(prove_portal(portal, run))


def test_a_joint_beyond_its_limit_is_found(portal: Portal) -> None:
    run = run_of(portal[1], AXES)
    add(inner(run, 2, 0), 5, -4000.0)
    said = failing(prove_portal(portal, run))
    assert "q6 goes to" in said["joints"][0]

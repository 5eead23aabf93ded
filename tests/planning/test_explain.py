"""What is said to be in a hole's way, against plain geometry; and mends, put into the spec."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from drillc.explaining import explain_hole
from drillc.kernels.posture import heading_jump_rad
from drillc.language.diagnostics import Report
from planning.arm_specs import (
    BASE,
    HOLE,
    OUTRIGGER,
    arm_spec,
    cycle_joints,
    hint,
    plan,
    region,
)
from scipy.spatial.transform import Rotation


def explained(folder, text, hole="P1"):
    (folder / "spec.drill").write_text(text, encoding="utf-8")
    return explain_hole(folder / "spec.drill", None, hole, Report())


def by_degrees(found):
    return {round(math.degrees(line.heading_rad), 6) + 0.0: line for line in found.lines}


# ── what is in the way ───────────────────────────────────────────────────────────────────────────

#: 255 mm from the hole to the tool's y at heading 0, where the outrigger ends at 240 mm.
WALL = "fixture jig { box (60, 255, 800) (200, 350, 1600) mm }"


def test_how_near_the_tool_comes(tmp_path):
    """The outrigger's end is a ball of 40 mm, 200 mm from the axis, that turns with the heading."""
    more = "avoid jig clearance 20 mm  turning within 30 deg"
    found = explained(tmp_path, arm_spec(region("r", HOLE, more), body=OUTRIGGER, more=WALL))
    lines = by_degrees(found)
    assert set(lines) >= set(range(-30, 31, 5))
    for degrees, line in lines.items():
        gap_mm = 255 - 40 - 200 * math.cos(math.radians(degrees))
        if gap_mm > 20.1:
            assert line.tool is None or abs(degrees) > 90  # then its other parts are near
        elif gap_mm < 19.9:
            assert float(line.tool.brief.split()[0]) == pytest.approx(gap_mm, abs=0.06)
            assert line.tool.brief.endswith("mm from fixture jig")
            assert line.tool.clause.endswith("(20 mm are kept)")


def test_by_how_much_it_is_out_of_reach(tmp_path):
    """The wrist centre is farthest at the surface: 250 mm of tool and 240 mm of wrist before it."""
    far = BASE.replace("1500", "3800")
    found = explained(tmp_path, arm_spec(base=far))
    span = math.hypot(3800 - 330 - 250 - 240, 1200 - 645)
    lacking = span - 1350 - math.hypot(115, 1420)
    assert found.summary == f"at the rule's heading, the hole is out of reach by {lacking:.0f} mm"
    assert all(line.arm.kind == "reach" for line in found.lines)


def test_which_joint_by_how_much(tmp_path):
    """Of the branches, the one that comes nearest; of its joints, the one that fits worst."""
    limits = [(-185, 185), (-140, -5), (-120, 168), (-90, 90), (40, 100), (-350, 350)]
    over_deg = {}
    for branch in np.degrees(cycle_joints((1500, 0, 0), (0, 0, 1200))).transpose(1, 2, 0):
        worst = {}
        for joint, (angles, (low, high)) in enumerate(zip(branch, limits, strict=True)):
            turned = [angles + turn for turn in (-360, 0, 360)]
            worst[joint] = min(max(low - t.min(), t.max() - high) for t in turned)
        joint = max(worst, key=lambda j: worst[j])
        if not np.isnan(worst[joint]):
            over_deg[worst[joint]] = f"A{joint + 1}"
    least = min(over_deg)
    assert least > 1
    text = arm_spec(arm="limits { A4 -90 deg .. 90 deg  A5 40 deg .. 100 deg }", home="")
    said = f"at the rule's heading, {over_deg[least]} oversteps its limits by {least:.1f} deg"
    assert explained(tmp_path, text).summary == said


def test_a_straight_wrist(tmp_path):
    found = explained(
        tmp_path,
        arm_spec(
            region("r", "P1 (-50, 0, 2110) normal (-1, 0, 0)"),
            base=BASE.replace("1500", "2200"),
            arm="limits { A1 -90 deg .. 90 deg  A3 0 deg .. 144 deg }",
        ),
    )
    assert by_degrees(found)[0].arm.kind == "singularity"
    bent = re.search(r"the wrist is bent by ([\d.]+) deg only \(singular 2 deg\)", found.summary)
    assert float(bent[1]) < 2


def test_which_link(tmp_path):
    """A beam through the forearm, where no tool is."""
    beam = "fixture beam { box (900, -700, 1500) (950, 700, 1550) mm }"
    found = explained(tmp_path, arm_spec(more=beam, home=""))
    own = by_degrees(found)[0]
    assert own.tool is None
    assert re.fullmatch(r"link [2-6]: (in|[\d.]+ mm from) fixture beam", own.arm.brief)


def test_inside_at_every_heading(tmp_path):
    wall = "fixture block { box (-300, -300, 900) (350, 300, 1500) mm }"
    text = arm_spec(region("r", HOLE, "avoid block clearance 20 mm"), more=wall)
    found = explained(tmp_path, text)
    assert found.summary == "at every heading within 180 deg, the tool is in fixture block"
    assert found.solution is None
    assert hint(plan(tmp_path, text)[1], "E410").startswith("none of these helps by itself")


# ── what is chosen ───────────────────────────────────────────────────────────────────────────────

TWO = "P1 (0, 0, 1200) normal (-0.8, 0, -0.6)  P2 (0, 50, 1200) normal (-0.8, 0.6, 0)"


def jump_deg(found, other, heading_rad):
    """The turn about the tool's axis to another hole's chosen heading, from the poses."""
    poses, rows = found.solution.part_from_tool, [found.row, other]
    turned = Rotation.from_rotvec([0, 0, heading_rad - found.chosen_rad]).as_matrix()
    pair = [poses[rows[0]] @ turned, poses[rows[1]]]
    return math.degrees(heading_jump_rad(np.stack(pair if other > found.row else pair[::-1]))[0])


@pytest.mark.parametrize(("hole", "other"), [("P1", 1), ("P2", 0)])
def test_what_jumps_to_its_neighbour_is_blocked(tmp_path, hole, other):
    more = "sequence { order given  heading_jump max 10 deg }"
    text = arm_spec(region("r", TWO, "turning within 40 deg"), more=more)
    found = explained(tmp_path, text, hole)
    verdicts = {found.verdict(line) for line in found.lines}
    assert verdicts == {"chosen", "works", "blocked", "not allowed"}
    for line in found.lines:
        jump = jump_deg(found, other, line.heading_rad)
        [neighbour] = found.neighbours
        assert math.degrees(neighbour.jump_rad(line.heading_rad)) == pytest.approx(jump, abs=1e-6)
        if found.verdict(line) == "works":
            assert jump <= 10 + 1e-6
        if found.verdict(line) == "blocked" and line.works:
            assert jump > 10


def test_only_the_rules_heading_is_allowed(tmp_path):
    found = explained(tmp_path, arm_spec())
    assert [found.verdict(line) for line in found.lines if line.heading_rad == 0] == ["chosen"]
    others = [line for line in found.lines if line.heading_rad != 0]
    assert {found.verdict(line) for line in others} == {"not allowed"}
    assert any(line.works for line in others)


def test_a_hole_of_a_spec_that_does_not_compile(tmp_path):
    holes = f"{HOLE}  P2 (-3000, 0, 1200) normal (-1, 0, 0)"
    found = explained(tmp_path, arm_spec(region("r", holes)))
    assert found.solution is None
    assert [d.code for d in found.refused] == ["E410"]
    assert found.summary == "the rule's heading works"
    assert "chosen" not in {found.verdict(line) for line in found.lines}


def test_a_hole_without_a_parking_place_given(tmp_path):
    auto = "base auto within (1300, -400, 0) (2100, 400, 0) mm rotate z 180 deg step 400 mm"
    assert explained(tmp_path, arm_spec(base=auto)).solution is not None


# ── mends ────────────────────────────────────────────────────────────────────────────────────────


def test_the_turning_offered(tmp_path):
    """The outrigger is 20 mm from a wall at 200 mm where 200 cos(heading) + 40 + 20 = 200."""
    wall = WALL.replace("255", "200")
    avoid = "avoid jig clearance 20 mm  turning within 5 deg"
    text = arm_spec(region("r", HOLE, avoid), body=OUTRIGGER, more=wall)
    said = re.search(r"turning within ([\d.]+) deg would do", hint(plan(tmp_path, text)[1], "E410"))
    least = math.degrees(math.acos((200 - 60) / 200))
    assert least <= float(said[1]) < least + 1.1
    mended = text.replace("within 5 deg", f"within {said[1]} deg")
    assert plan(tmp_path, mended)[0] is not None


def test_the_clearance_offered(tmp_path):
    """At 10 deg the outrigger is 255 - 40 - 200 cos(10 deg) from the wall, and nowhere farther."""
    avoid = "avoid jig clearance 20 mm  turning within 10 deg"
    text = arm_spec(region("r", HOLE, avoid), body=OUTRIGGER, more=WALL)
    said = re.search(r"avoid jig clearance ([\d.]+) mm", hint(plan(tmp_path, text)[1], "E410"))
    greatest = 215 - 200 * math.cos(math.radians(10))
    assert greatest - 2 <= float(said[1]) <= greatest
    mended = text.replace("clearance 20 mm", f"clearance {said[1]} mm")
    assert plan(tmp_path, mended)[0] is not None


@pytest.mark.parametrize(
    "changes",
    [
        {"base": BASE.replace("1500", "3800")},
        {"arm": "limits { A4 -90 deg .. 90 deg  A5 40 deg .. 100 deg }", "home": ""},
        {"base": BASE.replace("1500, 0", "1500, 3500")},
    ],
)
def test_the_move_of_the_base_that_is_offered(tmp_path, changes):
    text = arm_spec(**changes)
    said = re.search(
        r"with the base moved by \((.*)\) mm, the arm would reach it and all others",
        hint(plan(tmp_path, text)[1], "E410"),
    )
    move = np.array([float(value) for value in said[1].split(",")])
    place = re.search(r"base at \((.*)\) mm", text)
    there = np.array([float(value) for value in place[1].split(",")]) + move
    written = ", ".join(f"{value:g}" for value in there)
    planned, report = plan(tmp_path, text.replace(place[1], written))
    assert planned is not None, report.diagnostics


def test_a_move_that_serves_one_hole_only_is_said_to(tmp_path):
    holes = f"{HOLE}  P2 (0, 6000, 1200) normal (-1, 0, 0)"
    said = hint(plan(tmp_path, arm_spec(region("r", holes)))[1], "E410")
    assert "though not all others: give it a station of its own" in said


def test_the_jump_offered(tmp_path):
    text = arm_spec(region("r", TWO), more="sequence { order given  heading_jump max 5 deg }")
    said = re.search(r"heading_jump max ([\d.]+) deg", hint(plan(tmp_path, text)[1], "E411"))
    assert plan(tmp_path, text.replace("max 5 deg", f"max {said[1]} deg"))[0] is not None
    less = f"max {float(said[1]) - 0.2:g} deg"
    assert plan(tmp_path, text.replace("max 5 deg", less))[0] is None

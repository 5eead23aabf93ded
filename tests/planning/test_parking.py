"""`base auto`: against every place of the grid, tried one by one."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from drillc.cli import main
from drillc.language.job import Arm
from planning.arm_specs import arm_spec, cycle_joints, hint, plan, region

AUTO = "base auto within ({}) ({}) mm rotate z 180 deg step {} mm"
NACELLE = """drill 1
program NACELLE_A
part nacelle { up -Z  normals into  frame 1 }
tool ee90 {
  number 1  tcp (-350, 0, 250) mm rotate y -90 deg
  body { cylinder (0, 0, 0) (0, 0, 300) mm radius 90 mm
         capsule (0, 0, 250) (-300, 0, 250) mm radius 50 mm }
}
robot arm1 arm {
  model kuka_kr210_r3100_2
  base auto within (1000, 2500, 1500) (2000, 3500, 1500) mm rotate x 180 deg step 250 mm
  home { A1 0 deg  A2 -90 deg  A3 90 deg  A4 0 deg  A5 30 deg  A6 0 deg }
}
fixture jig { box (400, 1500, 700) (700, 1900, 850) mm }
process look { approach 60 mm  retract 60 mm }
region upper {
  posture y horizontal toward -Y
  process look
  points mm { P1 (240, 2379, -542) normal (-0.233, -0.012, 0.972)
              P2 (240, 2336, -542) normal (-0.236, -0.011, 0.972) }
}
region mid_upper {
  posture x horizontal toward -Y
  process look
  points mm { P4 (490, 1723, -407) normal (-0.693, 0.035, 0.721)
              P5 (524, 1728, -372) normal (-0.754, 0.037, 0.655) }
}
region lower {
  posture y horizontal toward +Y
  avoid jig clearance 20 mm turning within 30 deg
  process look
  points mm { P7 (588, 1730, 340) normal (-0.970, 0.110, -0.217)
              P8 (571, 1730, 392) normal (-0.922, 0.120, -0.369) }
}
emit krl
"""


def stations(folder, text):
    """Where the arm is parked, (s, 3), and from which station each region is made."""
    planned, report = plan(folder, text)
    assert planned is not None, report.diagnostics
    arm = planned.job.robot
    assert isinstance(arm, Arm)
    assert arm.auto is None
    places = np.array([station.part_from_root.translation_mm for station in arm.stations])
    return places, [region.station for region in planned.job.regions], planned


# ── all places, one by one, with the Rust port of the kinematics ─────────────────────────────────

LOW, HIGH = np.radians([[-185, -140, -120, -350, -122.5, -350], [185, -5, 168, 350, 122.5, 350]])


def margin_from(place, hole):
    """The best margin of a hole over its cycle; -inf where it cannot be visited."""
    best = -np.inf
    for branch in cycle_joints(place, hole).transpose(1, 0, 2):
        if np.isnan(branch).any() or np.abs(np.sin(branch[:, 4])).min() < np.sin(np.radians(2)):
            continue
        worst = np.inf
        for joint, (low, high) in enumerate(zip(LOW, HIGH, strict=True)):
            turned = branch[:, joint, None] + 2 * np.pi * np.arange(-2, 3)
            room = np.minimum(turned - low, high - turned).min(axis=0)
            worst = min(worst, room.max() / (high - low))
        if worst >= 0:
            best = max(best, worst)
    return best


HOLES = [(0, -400, 1200), (0, 500, 900), (0, 300, 1500)]
POINTS = "  ".join(f"P{i} ({x}, {y}, {z}) normal (-1, 0, 0)" for i, (x, y, z) in enumerate(HOLES))
GRID = [(x, y, 0.0) for x in (1300.0, 1700.0, 2100.0) for y in (-400.0, 0.0, 400.0)]
OVER_GRID = AUTO.format("1300, -400, 0", "2100, 400, 0", 400)


@cache
def worths():
    """Of each place of the grid the worst margin over the holes."""
    worth = np.array([min(margin_from(place, hole) for hole in HOLES) for place in GRID])
    assert len(np.unique(worth[np.isfinite(worth)].round(9))) > 3
    return worth


def test_no_other_place_leaves_more_room(tmp_path):
    [place], _, planned = stations(tmp_path, arm_spec(region("r", POINTS), base=OVER_GRID))
    assert GRID.index(tuple(place)) == int(np.argmax(worths()))
    assert planned.solution.margin.min() <= worths().max() + 1e-9


def test_the_room_that_is_told(tmp_path):
    _, report = plan(tmp_path, arm_spec(region("r", POINTS), base=OVER_GRID))
    [note] = report.notes
    told = re.fullmatch(r"the base is parked at \((.*)\) mm: at least ([\d.]+) % .* are left", note)
    assert tuple(map(float, told[1].split(","))) == GRID[int(np.argmax(worths()))]
    assert float(told[2]) == pytest.approx(100 * worths().max(), abs=0.05)


def test_with_fixtures_the_best_that_compiles(tmp_path):
    """A post where the arm would stand at the best place, and one in its way at the second best."""
    order = np.argsort(-worths(), kind="stable")
    x, y, _ = GRID[order[0]]
    more = f"fixture post {{ box ({x - 50}, {y - 50}, -300) ({x + 50}, {y + 50}, 20) mm }}"
    works = []
    for x, y, z in GRID:
        base = f"base at ({x}, {y}, {z}) mm rotate z 180 deg"
        planned, _ = plan(tmp_path, arm_spec(region("r", POINTS), base=base, more=more))
        works.append(planned is not None)
    best = next(int(i) for i in order if works[i])
    assert best != order[0]
    text = arm_spec(region("r", POINTS), base=OVER_GRID, more=more)
    [place], _, _ = stations(tmp_path, text)
    assert GRID.index(tuple(place)) == best


def test_holes_that_must_turn_and_may(tmp_path):
    """With A6 within 30 deg of zero the rule's heading, which needs a half turn, cannot be held."""
    narrow = "limits { A4 -90 deg .. 90 deg  A6 -30 deg .. 30 deg }"
    rule = arm_spec(
        region("r", POINTS).replace("toward +Y", "toward -Y"), base=OVER_GRID, arm=narrow
    )
    flipped = arm_spec(region("r", POINTS), base=OVER_GRID, arm=narrow)
    assert [plan(tmp_path, text)[0] is None for text in (rule, flipped)].count(True) == 1
    for text in (rule, flipped):
        _, _, planned = stations(tmp_path, text.replace("points", "turning within 180 deg  points"))
        assert planned.solution.margin.min() > 0


# ── stations ─────────────────────────────────────────────────────────────────────────────────────

APART = region("a", "P1 (0, -4000, 1200) normal (-1, 0, 0)") + region(
    "b", "P2 (0, 4000, 1200) normal (-1, 0, 0)"
)
LONG = AUTO.format("1500, -3000, 0", "2000, 3000, 0", 1000)


def test_two_stations_where_one_is_not_enough(tmp_path):
    places, served, planned = stations(tmp_path, arm_spec(APART, base=f"{LONG} stations 4"))
    grid = [(1500, y, 0) for y in range(-3000, 3001, 1000)]
    holes = [(0, -4000, 1200), (0, 4000, 1200)]
    best = [max(margin_from(place, hole) for place in grid) for hole in holes]
    found = [margin_from(*one) for one in zip(places, holes, strict=True)]
    assert min(found) == pytest.approx(min(best), abs=1e-9)
    assert all(margin_from(place, holes[0]) + margin_from(place, holes[1]) < 0 for place in grid)
    assert served == [0, 1]
    arm = planned.job.robot
    assert [station.name.text for station in arm.stations] == ["S1", "S2"]
    assert [station.frame for station in arm.stations] == [1, 2]
    assert [program.name for program in planned.programs] == ["P_S1", "P_S2"]


def test_one_station_where_one_is_enough(tmp_path):
    near = APART.replace("4000", "400")
    places, served, planned = stations(tmp_path, arm_spec(near, base=f"{LONG} stations 4"))
    assert len(places) == 1
    assert served == [0, 0]
    assert planned.job.robot.stations[0].name is None
    assert [program.name for program in planned.programs] == ["P"]


def test_the_frames_number_is_needed(tmp_path):
    text = arm_spec(base=LONG, part="part p { up +Z  normals into }")
    assert hint(plan(tmp_path, text)[1], "E415") == "part p { … frame 1 }"


# ── none ─────────────────────────────────────────────────────────────────────────────────────────


def test_the_hints_of_a_search_in_vain_are_tried(tmp_path):
    """Each of the offers, put into the spec, compiles."""
    base = AUTO.format("1500, -2000, 0", "1500, 2000, 0", 1600)
    text = arm_spec(APART.replace("4000", "3100"), base=base)
    said = hint(plan(tmp_path, text)[1], "E416")
    offers = [offer.removesuffix(" would do") for offer in said.split("; or ")]
    assert len(offers) >= 1
    for offer in offers:
        if offer.startswith("stations"):
            mended = text.replace("step 1600 mm", f"step 1600 mm {offer}")
        elif offer.startswith("within"):
            mended = re.sub(r"within .* mm(?= rotate)", offer, text)
        else:
            mended = re.sub(r"step \d+ mm", offer, text)
        assert mended != text
        planned, report = plan(tmp_path, mended)
        assert planned is not None, (offer, report.diagnostics)


def test_where_the_arm_cannot_even_stand(tmp_path):
    text = arm_spec(
        base=OVER_GRID, more="fixture floor { box (0, -3000, -300) (4000, 3000, 10) mm }"
    )
    [error] = plan(tmp_path, text)[1].diagnostics
    assert error.code == "E416"
    assert "cannot stand" in error.message


# ── the nacelle ──────────────────────────────────────────────────────────────────────────────────


def test_the_nacelle(tmp_path):
    places, served, planned = stations(tmp_path, NACELLE)
    assert len(places) == 1
    assert served == [0, 0, 0]
    assert np.all((places[0] - [1000, 2500, 1500]) % 250 == 0)
    assert np.all((places[0] >= [1000, 2500, 1500]) & (places[0] <= [2000, 3500, 1500]))
    x, y, z = places[0]
    fixed = re.sub(r"base auto .*", f"base at ({x}, {y}, {z}) mm rotate x 180 deg", NACELLE)
    assert fixed != NACELLE
    again, _ = plan(tmp_path, fixed)
    assert np.array_equal(again.solution.joints, planned.solution.joints)


@pytest.mark.parametrize("text", [NACELLE, arm_spec(APART, base=f"{LONG} stations 2")])
def test_equal_bytes(tmp_path, monkeypatch, text):
    monkeypatch.chdir(tmp_path)
    Path("spec.drill").write_text(text, encoding="utf-8")
    found = []
    for out in ("one", "two"):
        assert main(["compile", "spec.drill", "-o", out]) == 0
        files = sorted(path for path in Path(out).rglob("*") if path.is_file())
        found.append([(str(path.relative_to(out)), path.read_bytes()) for path in files])
    assert found[0] == found[1]
    assert len(found[0]) > 1


def test_where_it_is_parked_is_told(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("spec.drill").write_text(arm_spec(APART, base=f"{LONG} stations 2"), encoding="utf-8")
    assert main(["compile", "spec.drill", "-o", "out"]) == 0
    told = capsys.readouterr().err.splitlines()[:2]
    assert [line.partition(" is parked")[0] for line in told] == ["station S1", "station S2"]
    assert "for region a" in told[0]
    assert main(["check", "spec.drill"]) == 0
    assert capsys.readouterr().out.splitlines()[:2] == told
    assert main(["inspect", "spec.drill"]) == 0
    assert capsys.readouterr().err.splitlines() == told

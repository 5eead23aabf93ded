"""`robot NAME arm` and what goes with it: the job says what the spec says, in mm and radians.

Mistakes have their own folders in tests/diagnostics/cases; here are those that stand together."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from drillc.catalogue.arms import models
from drillc.catalogue.model import JOINT_NAMES
from drillc.language.job import (
    Arm,
    ExpectJoints,
    Job,
)
from language.texts import codes, resolved, spots

PLACE = "base at (1500, 3000, 1500) mm rotate x 180 deg"
TOOL = """tool ee {
  number 1  tcp (-350, 0, 250) mm rotate y -90 deg
  body { cylinder (0, 0, 0) (0, 0, 200) mm radius 90 mm }
}
"""
REGION = "region r { posture x toward +X  points mm { P1 (1, 2, 3) normal (0, 0, -1) } }\n"
#: The dimensions and conventions of the catalogue's KR 210 R3100-2, as an arm of one's own.
OWN = """dimensions { a1 330 mm  a2 -115 mm  b 0 mm  c1 645 mm  c2 1350 mm  c3 1420 mm  c4 240 mm }
  zero { A2 -90 deg }   reversed { A1 A4 A6 }   maker kuka
  limits {
    A1 -185 deg .. 185 deg   A2 -140 deg .. -5 deg       A3 -120 deg .. 168 deg
    A4 -350 deg .. 350 deg   A5 -122.5 deg .. 122.5 deg  A6 -350 deg .. 350 deg
  }
  speeds { A1 105 deg/s  A2 94 deg/s  A3 100 deg/s  A4 136 deg/s  A5 129 deg/s  A6 206 deg/s }
"""


def spec(
    arm: str = f"model kuka_kr210_r3100_2  {PLACE}",
    region: str = REGION,
    part: str = "up +Z  normals into",
    more: str = "",
) -> str:
    return (
        f"drill 1\nprogram P\npart p {{ {part} }}\n{TOOL}robot kr arm {{\n{arm}\n}}\n{region}{more}"
    )


def job_of(folder: Path, text: str) -> Job:
    job, report = resolved(folder, text)
    assert job is not None, [d.message for d in report.diagnostics]
    assert codes(report) == []
    return job


def arm_of(folder: Path, arm: str, **more: str) -> Arm:
    robot = job_of(folder, spec(arm, **more)).robot
    assert isinstance(robot, Arm)
    return robot


# ── which arm ────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize("name", sorted(models()))
def test_every_model_of_the_catalogue_can_be_named(tmp_path: Path, name: str) -> None:
    arm = arm_of(tmp_path, f"model {name}  {PLACE}")
    model = models()[name]
    assert arm.model is model
    assert [limit.low for limit in arm.limits] == model.low_rad.tolist()
    assert [limit.high for limit in arm.limits] == model.high_rad.tolist()
    assert all(limit.span is None for limit in arm.limits)
    assert arm.speeds.tolist() == model.speed_rad_s.tolist()
    assert arm.home_rad is None
    assert arm.singular_rad == math.radians(2)
    assert arm.links == (None,) * 7


def test_an_arm_of_its_own_is_the_one_it_describes(tmp_path: Path) -> None:
    arm, known = arm_of(tmp_path, f"{OWN}  {PLACE}"), models()["kuka_kr210_r3100_2"]
    assert (arm.model.name, arm.model.maker) == ("kr", "kuka")
    for name in ("a1_mm", "a2_mm", "b_mm", "c1_mm", "c2_mm", "c3_mm", "c4_mm"):
        assert getattr(arm.model.geometry, name) == getattr(known.geometry, name)
    assert arm.model.geometry.sign.tolist() == known.geometry.sign.tolist()
    assert arm.model.geometry.offset_rad == pytest.approx(known.geometry.offset_rad)
    assert arm.model.low_rad == pytest.approx(known.low_rad)
    assert arm.model.high_rad == pytest.approx(known.high_rad)
    assert [limit.high for limit in arm.limits] == arm.model.high_rad.tolist()
    assert all(limit.span is not None for limit in arm.limits)


def test_zero_is_what_the_controller_shows_upright(tmp_path: Path) -> None:
    """Also of a joint that counts backwards: there the paper's angle is 0."""
    own = OWN.replace("A2 -90 deg", "A1 30 deg  A2 -90 deg  A6 -20 deg")
    geometry = arm_of(tmp_path, f"{own}  {PLACE}").model.geometry
    shown = np.radians([30.0, -90.0, 0.0, 0.0, 0.0, -20.0])
    assert geometry.sign * shown - geometry.offset_rad == pytest.approx(np.zeros(6))


def test_limits_speeds_and_home_are_the_specs(tmp_path: Path) -> None:
    arm = arm_of(
        tmp_path,
        f"model kuka_kr210_r3100_2  {PLACE}\n"
        "limits { A6 -1 rad .. 90 deg  A1 -185 deg .. 185 deg }\n"
        "speeds { A3 0.5 rad/s }  singular 0.1 rad\n"
        "home { A6 0 deg  A5 -30 deg  A4 0 deg  A3 90 deg  A2 -90 deg  A1 10 deg }",
    )
    model = models()["kuka_kr210_r3100_2"]
    assert (arm.limits[5].low, arm.limits[5].high) == (-1.0, math.radians(90))
    assert arm.limits[1].span is None
    assert arm.speeds.tolist() == [*model.speed_rad_s[:2], 0.5, *model.speed_rad_s[3:]]
    assert arm.home_rad is not None
    assert np.degrees(arm.home_rad) == pytest.approx([10, -90, 90, 0, -30, 0])
    assert arm.singular_rad == 0.1
    assert not model.speed_rad_s.flags.writeable or arm.speeds is not model.speed_rad_s


# ── where it stands ──────────────────────────────────────────────────────────────────────────────


def test_a_base_is_a_station_without_a_name(tmp_path: Path) -> None:
    [station] = arm_of(tmp_path, f"model abb_irb120_3_58  {PLACE}").stations
    assert station.name is None
    assert station.frame is None
    assert station.part_from_root.translation_mm.tolist() == [1500, 3000, 1500]
    assert station.part_from_root.rotation == pytest.approx(np.diag([1.0, -1.0, -1.0]))


def test_regions_know_their_stations(tmp_path: Path) -> None:
    places = "\n".join(
        f"station {name} frame {frame} at ({frame}, 0, 0) m"
        for name, frame in (("left", 7), ("right", 8))
    )
    regions = "".join(
        REGION.replace("region r {", f"region {name} {{ station {station} ").replace(
            "P1 (1", f"{name} ({i}"
        )
        for i, (name, station) in enumerate((("a", "right"), ("b", "left"), ("c", "right")))
    )
    job = job_of(tmp_path, spec(f"model abb_irb120_3_58\n{places}", regions))
    assert isinstance(job.robot, Arm)
    assert [(s.name.text, s.frame) for s in job.robot.stations if s.name] == [
        ("left", 7),
        ("right", 8),
    ]
    assert [region.station for region in job.regions] == [1, 0, 1]


def test_a_single_station_need_not_be_named_by_a_region(tmp_path: Path) -> None:
    job = job_of(tmp_path, spec("model abb_irb120_3_58  station here at (0, 0, 0) mm"))
    assert [region.station for region in job.regions] == [0]


def test_base_auto(tmp_path: Path) -> None:
    arm = arm_of(
        tmp_path,
        "model abb_irb120_3_58\n"
        "base auto within (3, 0, 0.5) (1, 2, 0.5) m axes (0, 1, 0) (-1, 0, 0) (0, 0, 1)"
        " rotate z 90 deg step 25 cm stations 3",
    )
    assert arm.stations == ()
    assert arm.auto is not None
    assert arm.auto.low_mm.tolist() == [1000, 0, 500]
    assert arm.auto.high_mm.tolist() == [3000, 2000, 500]
    assert (arm.auto.step_mm, arm.auto.most) == (250, 3)
    assert arm.auto.rotation == pytest.approx(np.diag([-1.0, -1.0, 1.0]))


def test_the_number_of_places_counts_both_ends(tmp_path: Path) -> None:
    """100 x 100 places are as many as are tried; another row is too many."""
    base = "model abb_irb120_3_58  base auto within (0, 0, 0) ({}, 9.9, 0) m step 100 mm"
    arm_of(tmp_path, base.format(9.9))
    job, report = resolved(tmp_path, spec(base.format(10.0)))
    assert job is None
    assert codes(report) == ["E270"]
    assert "101 x 100 x 1 = 10,100 places" in report.diagnostics[0].message


@pytest.mark.parametrize(
    ("at", "fits"),
    [
        ("at (-1500, 3000, 1500) mm rotate x 180 deg", True),
        ("at (-1500.0009, 3000, 1500) mm rotate x 180 deg", True),
        ("at (-1500.002, 3000, 1500) mm rotate x 180 deg", False),
        ("at (-1500, 3000, 1500) mm rotate x 179.9999 deg", False),
        ("at (-1500, 3000, 1500) mm rotate x -180 deg", True),
        ("at (1500, 3000, 1500) mm", False),
    ],
)
def test_the_parts_place_is_the_bases_inverse(tmp_path: Path, at: str, fits: bool) -> None:
    part = f"up +Z  normals into  frame 2 {at}"
    _, report = resolved(tmp_path, spec(part=part))
    assert codes(report) == ([] if fits else ["E264"])


# ── bodies ───────────────────────────────────────────────────────────────────────────────────────


def test_links_have_bodies_of_their_own(tmp_path: Path) -> None:
    arm = arm_of(
        tmp_path,
        f"model abb_irb120_3_58  {PLACE}  links {{ link 0 {{ }}\n"
        "link 6 { sphere (0, 0, 10) mm radius 2 cm  box (0, 0, 0) (1, 2, 3) mm } }",
    )
    assert arm.links[0] == ()
    assert [link is None for link in arm.links] == [False, *[True] * 5, False]
    assert arm.links[6] is not None
    ball, box = arm.links[6]
    assert (ball.points_mm.tolist(), ball.radius_mm) == ([[0, 0, 10]], 20)
    assert (box.points_mm.max(axis=0).tolist(), box.radius_mm) == ([1, 2, 3], 0)


def test_the_axes_of_a_placement_are_its_columns(tmp_path: Path) -> None:
    """Rounded to three digits they are made exact."""
    arm = arm_of(
        tmp_path,
        "model abb_irb120_3_58  base at (0, 0, 0) mm axes (0.707, 0.707, 0) (0, 0, 1) "
        "(0.707, -0.707, 0)",
    )
    rotation = arm.stations[0].part_from_root.rotation
    half = math.sqrt(0.5)
    assert rotation == pytest.approx(np.array([[half, 0, half], [half, 0, -half], [0, 1, 0]]))
    assert rotation.T @ rotation == pytest.approx(np.eye(3), abs=1e-15)


@pytest.mark.parametrize(
    ("axes", "said"),
    [
        ("(1, 0, 0) (0, 0, 1) (0, 1, 0)", "left-handed: their determinant is -1"),
        ("(1.002, 0, 0) (0, 1, 0) (0, 0, 1)", "lengths are 1.002, 1, 1"),
        ("(1, 0, 0) (0.01, 1, 0) (0, 0, 1)", "x·y = 0.01"),
        ("(0, 0, 0) (0, 1, 0) (0, 0, 1)", "lengths are 0, 1, 1"),
        ("(1e308, 1e308, 0) (0, 1e308, 0) (0, 0, 1)", "lengths are inf, inf, 1"),
        ("(1e999, 0, 0) (0, 1, 0) (0, 0, 1)", "their determinant is nan"),
    ],
)
def test_axes_that_are_no_frame(tmp_path: Path, axes: str, said: str) -> None:
    text = spec(f"model abb_irb120_3_58  base at (0, 0, 0) mm axes {axes}")
    _, report = resolved(tmp_path, text)
    assert codes(report) == ["E255"]
    assert said in report.diagnostics[0].message


# ── regions and the sequence ─────────────────────────────────────────────────────────────────────

FIXTURES = (
    "fixture jig { box (0, 0, 0) (1, 1, 1) mm }\nfixture rib { sphere (9, 9, 9) m radius 1 mm }\n"
)


@pytest.mark.parametrize(
    ("items", "avoided", "turning"),
    [
        ("", [], 0.0),
        ("turning within 30 deg", [], math.radians(30)),
        ("avoid rib clearance 1 cm", [(1, 10)], math.pi),
        ("avoid rib clearance 0 mm  turning within 180 deg  avoid jig clearance 5 mm",
         [(1, 0), (0, 5)], math.pi),
        ("avoid jig clearance 20 mm turning within 0.5 rad", [(0, 20)], 0.5),
    ],
)  # fmt: skip
def test_what_is_avoided(
    tmp_path: Path, items: str, avoided: list[tuple[int, float]], turning: float
) -> None:
    region = REGION.replace("region r {", f"region r {{ {items} ")
    job = job_of(tmp_path, spec(region=region, more=FIXTURES))
    [found] = job.regions
    assert [(avoid.fixture, avoid.clearance_mm) for avoid in found.avoid] == avoided
    assert found.turning_rad == pytest.approx(turning)


def test_the_order_and_the_weights(tmp_path: Path) -> None:
    job = job_of(tmp_path, spec())
    assert not job.order_shortest
    assert (job.weights.deviation, job.weights.travel, job.weights.margin) == (10, 1, 1)
    for order in ("order shortest", "order shortest within region"):
        more = f"sequence {{ {order}  weights {{ margin 0  travel 2.5 }} }}\n"
        job = job_of(tmp_path, spec(more=more))
        assert job.order_shortest
        assert (job.weights.deviation, job.weights.travel, job.weights.margin) == (10, 2.5, 0)
    assert not job_of(tmp_path, spec(more="sequence { order given }\n")).order_shortest


def test_expected_joints_are_angles(tmp_path: Path) -> None:
    more = "expect P1 joints (0 deg, -90 deg, 1 rad, 0 deg, 0 deg, 350 deg) within 0.1 deg\n"
    [expect] = job_of(tmp_path, spec(more=more)).expects
    assert isinstance(expect, ExpectJoints)
    assert expect.joints == pytest.approx([0, -math.pi / 2, 1, 0, 0, math.radians(350)])
    assert expect.within_rad == math.radians(0.1)
    assert expect.within_mm == math.inf


# ── many mistakes at once ────────────────────────────────────────────────────────────────────────


def test_all_mistakes_of_an_arm_are_told_at_once(tmp_path: Path) -> None:
    text = """drill 1
program P
part p { normals into  frame 1 at (0, 0, 0) mm }
tool ee { number 1  tcp (0, 0, 1) mm axes (1, 0, 0) (1, 0, 0) (0, 0, 1) }
robot kr arm {
  model kuka_kr211
  zero { A2 -90 deg }
  limits { A1 9 deg .. 1 deg  B1 1 deg .. 2 deg }
  speeds { A1 5 mm/s }
  home { A1 0 deg }
  singular 0 deg
  links { link 9 { }  link 1 { box (0, 0, 0) (0, 1, 1) mm } }
}
fixture jig { mesh "none.stl" mm  capsule (0, 0, 0) (1, 1, 1) mm radius 0 mm }
region r { avoid jog clearance 1 mm  points mm { P1 (1, 2, 3) normal (0, 0, -1) } }
"""
    job, report = resolved(tmp_path, text)
    assert job is None
    assert sorted(spots(report)) == sorted(
        [
            ("E255", 4, 38),
            ("E210", 6, 9),
            ("E256", 7, 3),
            ("E224", 8, 15),
            ("E210", 8, 31),
            ("E204", 9, 15),
            ("E257", 10, 3),
            ("E206", 11, 12),
            ("E207", 12, 16),
            ("E222", 12, 32),
            ("E261", 5, 7),
            ("E120", 14, 20),
            ("E206", 14, 73),
            ("E210", 15, 18),
            ("E247", 15, 8),
        ]
    )


def test_joint_names_are_the_ones_that_errors_tell(tmp_path: Path) -> None:
    _, report = resolved(tmp_path, spec(f"model abb_irb120_3_58  {PLACE}  home {{ q1 0 deg }}"))
    assert "E210" in codes(report)
    assert all(name in (report.diagnostics[0].hint or "") for name in JOINT_NAMES)

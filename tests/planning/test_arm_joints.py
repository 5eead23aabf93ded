"""Whole specs of an arm, from text to joints: what must not change them, and what must."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass, field
from pathlib import Path

import fcl
import numpy as np
import pytest
import trimesh
from drillc.planning.arm_joints import ArmSolution
from planning.arm_scenes import HIGH, LOW, Scene, matrix, turn
from planning.arm_specs import HOME, OUTRIGGER, arm_spec, plan, region
from scipy.spatial.transform import Rotation

EYE = np.eye(3)


@dataclass(frozen=True)
class Text:
    """A spec in which everything may be moved and turned together, and written in mm or m."""

    rotation: np.ndarray = field(default_factory=lambda: EYE)
    shift: np.ndarray = field(default_factory=lambda: np.zeros(3))
    unit: str = "mm"
    holes: tuple[tuple[tuple, tuple], ...] = ()
    balls: tuple[tuple[tuple, float], ...] = ()
    more: str = ""
    jump: str = ""

    def at(self, point) -> str:
        scale = {"mm": 1.0, "m": 1000.0}[self.unit]
        return triple((self.rotation @ np.array(point, float) + self.shift) / scale)

    def way(self, direction) -> str:
        return triple(self.rotation @ np.array(direction, float))

    def long(self, length_mm) -> str:
        return f"{length_mm / {'mm': 1.0, 'm': 1000.0}[self.unit]:.17g} {self.unit}"

    def __str__(self) -> str:
        unit = self.unit
        root = self.rotation @ turn("z", 180)
        axes = " ".join(triple(root[:, i]) for i in range(3))
        fixtures = "  ".join(
            f"sphere {self.at(centre)} {unit} radius {self.long(radius)}"
            for centre, radius in self.balls
        )
        jig = f"fixture jig {{ {fixtures} }}\n" if self.balls else ""
        points = "  ".join(
            f"P{i} {self.at(place)} normal {self.way(normal)}"
            for i, (place, normal) in enumerate(self.holes)
        )
        return (
            f"drill 1\nprogram P\npart p {{ up {self.way((0, 0, 1))}  normals into  frame 1 }}\n"
            f"tool spindle {{ number 1  tcp (0, 0, 250) mm  {OUTRIGGER} }}\n"
            "robot arm1 arm {\n  model kuka_kr210_r3100_2\n"
            f"  base at {self.at((1500, 0, 0))} {unit} axes {axes}\n  {HOME}\n}}\n{jig}"
            f"region r {{ posture y horizontal toward {self.way((0, 1, 0))}  {self.more}  "
            f"points {unit} {{ {points} }} }}\nsequence {{ order given  {self.jump} }}\nemit krl\n"
        )


def triple(values) -> str:
    return "(" + ", ".join(f"{v:.17g}" for v in np.asarray(values, float)) + ")"


def solved(folder: Path, text: str) -> ArmSolution:
    planned, report = plan(folder, text)
    assert planned is not None, [d.message for d in report.diagnostics]
    assert isinstance(planned.solution, ArmSolution)
    return planned.solution


def lean(degrees_y: float, degrees_z: float) -> tuple:
    return tuple(turn("yz", degrees_y, degrees_z) @ [-1.0, 0, 0])


#: Holes on a bulging plate, and balls beside some of them that the outrigger has to avoid.
HOLES = tuple(
    ((0.0, y, z), lean(0.02 * (z - 1200), 0.03 * y))
    for y, z in [(-300, 1100), (-180, 1150), (-60, 1200), (60, 1200), (200, 1250), (330, 1300)]
)
BALLS = (((40.0, 150.0, 1170.0), 25.0), ((50.0, -200.0, 1060.0), 25.0))
AVOID = "avoid jig clearance 15 mm  turning within 120 deg"
PLAIN = Text(holes=HOLES, balls=BALLS, more=AVOID)


def assert_same(one: ArmSolution, other: ArmSolution, atol: float = 1e-6) -> None:
    for name in ("heading_rad", "joints", "standoff_joints", "margin"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), atol=atol)
    np.testing.assert_array_equal(one.branch, other.branch)
    assert len(one.stations) == len(other.stations)
    for a, b in zip(one.stations, other.stations, strict=True):
        np.testing.assert_array_equal(a.vias.before, b.vias.before)
        np.testing.assert_array_equal(a.vias.by_joints, b.vias.by_joints)
        np.testing.assert_allclose(a.vias.joints, b.vias.joints, atol=atol)


def test_the_scene_turns_some_holes_and_not_others(tmp_path: Path) -> None:
    """Or the properties below would hold for nothing."""
    solution = solved(tmp_path, str(PLAIN))
    turned = np.abs(solution.heading_rad) > 0.1
    assert turned.any()
    assert not turned.all()


@pytest.mark.parametrize("seed", range(3))
def test_the_whole_scene_moved_and_turned(tmp_path: Path, seed: int) -> None:
    """Part, fixtures, up, the rule and the base together: the joints are the same. Headings end
    where bodies touch the margin; there the distances' rounding shows."""
    rng = np.random.default_rng(seed)
    moved = Text(
        rotation=Rotation.random(random_state=seed).as_matrix(),
        shift=rng.uniform(-2000, 2000, 3),
        holes=HOLES,
        balls=BALLS,
        more=AVOID,
    )
    plain, other = solved(tmp_path, str(PLAIN)), solved(tmp_path, str(moved))
    assert_same(plain, other, atol=np.radians(0.05))
    # Poses turn with the part.
    np.testing.assert_allclose(
        other.part_from_tool, moved.rotation @ plain.part_from_tool, atol=np.radians(0.05)
    )


def test_without_fixtures_the_moved_scene_has_the_same_joints_to_rounding(tmp_path: Path) -> None:
    plain = Text(holes=HOLES)
    moved = Text(
        rotation=Rotation.random(random_state=9).as_matrix(),
        shift=np.array([900.0, -50, 3000]),
        holes=HOLES,
    )
    assert_same(solved(tmp_path, str(plain)), solved(tmp_path, str(moved)), atol=1e-9)


def test_metres_and_millimetres(tmp_path: Path) -> None:
    metres = Text(unit="m", holes=HOLES, balls=BALLS, more=AVOID)
    assert_same(solved(tmp_path, str(PLAIN)), solved(tmp_path, str(metres)), atol=1e-9)


def test_the_holes_in_the_opposite_order(tmp_path: Path) -> None:
    """Where the tool leaves a hole as it comes, the way back costs what the way there does."""
    back = Text(holes=HOLES[::-1], balls=BALLS, more=AVOID)
    one, other = solved(tmp_path, str(PLAIN)), solved(tmp_path, str(back))
    np.testing.assert_allclose(one.heading_rad, other.heading_rad[::-1], atol=1e-9)
    np.testing.assert_allclose(one.joints, other.joints[::-1], atol=1e-9)


def test_the_same_twice(tmp_path: Path) -> None:
    assert_same(solved(tmp_path, str(PLAIN)), solved(tmp_path, str(PLAIN)), atol=0.0)


def test_joints_headings_and_poses_agree(tmp_path: Path) -> None:
    """Against scipy and py-opw-kinematics: the joints hold the tool at the holes, turned away from
    the rule by the heading, inside the limits."""
    solution = solved(tmp_path, str(PLAIN))
    scene = Scene(part_from_root=(turn("z", 180), np.array([1500.0, 0, 0])))
    feed = np.array([normal for _, normal in HOLES])
    place = np.array([p for p, _ in HOLES])
    for joints, away in ((solution.joints, 0.0), (solution.standoff_joints, 50.0)):
        tool = scene.tool(joints)
        np.testing.assert_allclose(tool[:, :3, 3], place - away * feed, atol=1e-6)
        np.testing.assert_allclose(tool[:, :3, :3], solution.part_from_tool, atol=1e-9)
    assert (solution.joints > LOW).all()
    assert (solution.joints < HIGH).all()
    for i, heading in enumerate(solution.heading_rad):
        rule = solution.part_from_tool[i] @ turn("z", -np.degrees(heading))
        np.testing.assert_allclose(rule[:, 2], feed[i], atol=1e-9)
        assert rule[2, 1] == pytest.approx(0, abs=1e-9)  # y horizontal
        assert rule[1, 1] > 0  # toward +Y


def test_where_nothing_stands_around_the_rule_is_kept(tmp_path: Path) -> None:
    solution = solved(tmp_path, str(Text(holes=HOLES)))
    assert not solution.heading_rad.any()


def test_heading_jumps_are_kept_by_turning_neighbours(tmp_path: Path) -> None:
    free = solved(tmp_path, str(PLAIN))
    jumps = np.abs(np.diff(free.heading_rad))
    assert np.degrees(jumps.max()) > 30
    limited = Text(holes=HOLES, balls=BALLS, more=AVOID, jump="heading_jump max 30 deg")
    solution = solved(tmp_path, str(limited))
    for i in range(len(HOLES) - 1):
        one, other = solution.part_from_tool[i : i + 2]
        axis = np.cross(one[:, 2], other[:, 2])
        angle = np.arctan2(np.linalg.norm(axis), one[:, 2] @ other[:, 2])
        carried = Rotation.from_rotvec(axis / np.linalg.norm(axis) * angle).apply(one[:, 0])
        assert np.degrees(np.arccos(np.clip(carried @ other[:, 0], -1, 1))) <= 30 + 1e-6


def test_no_fixture_and_no_collision_library(tmp_path: Path) -> None:
    """Nothing to keep clear of: fcl is not even loaded."""
    for more, loaded in (("", False), ("fixture jig { box (0, 0, 0) (9, 9, 9) mm }", True)):
        (tmp_path / "spec.drill").write_text(arm_spec(more=more), encoding="utf-8")
        code = (
            "import sys; from pathlib import Path; from drillc.driver import plan_spec; "
            "from drillc.language.diagnostics import Report; "
            "plan_spec(Path(sys.argv[1]), None, Report()); print('fcl' in sys.modules)"
        )
        done = subprocess.run(
            [sys.executable, "-c", code, str(tmp_path / "spec.drill")],
            capture_output=True,
            text=True,
            check=True,
        )
        assert done.stdout.strip() == str(loaded)


def test_the_parts_own_surface_is_kept_clear_of(tmp_path: Path) -> None:
    """A rib on the plate, where the rule would put the outrigger."""
    plate = trimesh.creation.box(bounds=[[0, -600, 700], [20, 600, 1700]])
    rib = trimesh.creation.box(bounds=[[-120, 150, 1000], [0, 250, 1400]])
    mesh = trimesh.util.concatenate([plate, rib])
    mesh.export(tmp_path / "panel.stl")
    # The spindle ends 40 mm behind its point.
    body = OUTRIGGER.replace("(0, 0, 250)", "(0, 0, 210)")
    part = 'part p { up +Z  normals outward  frame 1  surface "panel.stl" mm }'
    hole = "P1 (0, 0, 1200) normal (-1, 0, 0)"

    def solution(more: str) -> ArmSolution:
        text = arm_spec(region("r", hole, more), part=part, body=body, base=AWAY, home=BACK)
        return solved(tmp_path, text)

    scene = Scene(part_from_root=(EYE, np.array([-1900.0, 0, 0])))
    careless = solution("")
    careful = solution("avoid p clearance 6 mm  turning within 120 deg")
    assert careless.heading_rad.tolist() == [0.0]
    assert np.abs(careful.heading_rad) > 0.1
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices), len(mesh.faces))
    model.addSubModel(np.array(mesh.vertices), np.array(mesh.faces))
    model.endModel()
    panel = fcl.CollisionObject(model, fcl.Transform())
    outrigger = fcl.Capsule(40.0, 200.0)
    own = matrix(turn("x", -90), [0, 100, 200])
    gaps = []
    for found in (careless, careful):
        pose = scene.flange(found.joints)[0] @ own
        mover = fcl.CollisionObject(outrigger, fcl.Transform(pose[:3, :3], pose[:3, 3]))
        request, result = fcl.DistanceRequest(), fcl.DistanceResult()
        gaps.append(fcl.distance(mover, panel, request, result))
    assert gaps[0] < 0.1
    assert gaps[1] > 6 - 0.05


AWAY = "base at (-1900, 0, 0) mm"
#: Nearer to the arm than the plate.
BACK = "home { A1 0 deg  A2 -120 deg  A3 120 deg  A4 0 deg  A5 60 deg  A6 0 deg }"

"""A program for each station: together they make every hole once, each from where it stands."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from drillc.driver import Planned
from planning.arm_scenes import Scene, matrix, turn
from planning.arm_specs import BASE, arm_spec, plan, region

STATIONS = """station left frame 2 at (1500, -900, 0) mm rotate z 180 deg
  station right frame 5 at (1500, 900, 100) mm rotate z 170 deg"""
ROOTS = {
    "P_left": matrix(turn("z", 180), [1500, -900, 0]),
    "P_right": matrix(turn("z", 170), [1500, 900, 100]),
}
#: Regions of both stations in turn, so that neither's holes stand together in the table.
REGIONS = [
    ("a", "left", [-1100, -1000], 1100),
    ("b", "right", [700, 850, 1000], 1200),
    ("c", "left", [-900], 1300),
    ("d", "right", [800], 1000),
]
PROCESSES = {
    "a": "process a { approach 30 mm  retract 30 mm }\n",
    "b": "process b { approach 70 mm  retract 70 mm }\n",
}
USED = {"a": "a", "b": "b", "c": "b", "d": "b"}


def spec(name: str, y_mm: list[int], z_mm: int, more: str) -> str:
    points = "  ".join(f"{name}{i} (0, {y}, {z_mm}) normal (-1, 0, 0)" for i, y in enumerate(y_mm))
    return region(name, points, more)


@pytest.fixture(scope="module")
def two(tmp_path_factory: pytest.TempPathFactory) -> Planned:
    regions = "".join(PROCESSES.values())
    regions += "".join(
        spec(name, y, z, f"station {station}  process {USED[name]}")
        for name, station, y, z in REGIONS
    )
    planned, report = plan(tmp_path_factory.mktemp("two"), arm_spec(regions, base=STATIONS))
    assert planned is not None, [d.message for d in report.diagnostics]
    return planned


def test_each_hole_is_made_once_from_the_station_of_its_region(two: Planned) -> None:
    assert [program.name for program in two.programs] == ["P_left", "P_right"]
    left, right = (program.holes.ids.tolist() for program in two.programs)
    assert left == ["a0", "a1", "c0"]
    assert right == ["b0", "b1", "b2", "d0"]
    assert sorted(left + right) == sorted(two.job.holes.ids.tolist())


def test_sections_and_cycles_are_those_of_the_station(two: Planned) -> None:
    found = [
        [(s.region, s.start, s.stop, p.cycles[s.cycle].process.name) for s in p.sections]
        for p in two.programs
    ]
    assert found == [
        [("a", 0, 2, "a"), ("c", 2, 3, "b")],
        [("b", 0, 3, "b"), ("d", 3, 4, "b")],
    ]
    assert [len(program.cycles) for program in two.programs] == [2, 1]
    for program in two.programs:
        for section in program.sections:
            ids = program.holes.ids[section.start : section.stop].tolist()
            assert all(name.startswith(section.region) for name in ids)


def test_the_frame_is_the_part_as_seen_from_the_root(two: Planned) -> None:
    assert [program.frame.number for program in two.programs if program.frame] == [2, 5]
    for program in two.programs:
        assert program.frame is not None
        pose = program.frame.world_from_part
        assert pose is not None
        np.testing.assert_allclose(
            matrix(pose.rotation, pose.translation_mm),
            np.linalg.inv(ROOTS[program.name]),
            atol=1e-9,
        )


def test_columns_belong_together(two: Planned) -> None:
    """Joints, poses, depths and vias: against scipy and py-opw-kinematics, at each one's root."""
    for program in two.programs:
        root = ROOTS[program.name]
        scene = Scene(part_from_root=(root[:3, :3], root[:3, 3]))
        assert program.arm is not None
        arm = program.arm
        count = len(program.holes)
        assert len(arm.joints) == len(arm.standoff_joints) == len(program.depth_mm) == count
        tool = scene.tool(arm.joints)
        np.testing.assert_allclose(tool[:, :3, 3], program.holes.position_mm, atol=1e-6)
        np.testing.assert_allclose(tool[:, :3, :3], program.part_from_tool, atol=1e-9)
        away = np.concatenate(
            [
                np.full(s.stop - s.start, program.cycles[s.cycle].process.approach_mm)
                for s in program.sections
            ]
        )
        standoff = program.holes.position_mm - away[:, None] * program.holes.feed
        np.testing.assert_allclose(scene.tool(arm.standoff_joints)[:, :3, 3], standoff, atol=1e-6)
        vias = scene.tool(arm.vias.joints)
        np.testing.assert_allclose(vias[:, :3, 3], arm.vias.position_mm, atol=1e-6)
        np.testing.assert_allclose(vias[:, :3, :3], arm.vias.part_from_tool, atol=1e-9)
        begins = [section.start for section in program.sections]
        assert arm.vias.before[arm.vias.by_joints].tolist() == [*begins, count]


def test_each_station_alone_comes_to_the_same(two: Planned, tmp_path: Path) -> None:
    """The programs do not know of each other."""
    for program, station, place in zip(
        two.programs, ("left", "right"), STATIONS.splitlines(), strict=True
    ):
        used = dict.fromkeys(USED[name] for name, s, _, _ in REGIONS if s == station)
        regions = "".join(PROCESSES[process] for process in used)
        regions += "".join(
            spec(name, y, z, f"process {USED[name]}") for name, s, y, z in REGIONS if s == station
        )
        base = "base at" + place.split(" at")[1]
        planned, report = plan(tmp_path, arm_spec(regions, base=base))
        assert planned is not None, [d.message for d in report.diagnostics]
        [alone] = planned.programs
        assert alone.name == "P"
        assert alone.arm is not None
        assert program.arm is not None
        assert alone.holes.ids.tolist() == program.holes.ids.tolist()
        np.testing.assert_array_equal(alone.arm.joints, program.arm.joints)
        np.testing.assert_array_equal(alone.arm.vias.joints, program.arm.vias.joints)


def test_the_only_place_gives_the_parts_frame_and_the_plain_name(tmp_path: Path) -> None:
    planned, _ = plan(tmp_path, arm_spec(base=BASE))
    assert planned is not None
    [program] = planned.programs
    assert program.name == "P"
    assert program.frame is not None
    assert program.frame.number == 1

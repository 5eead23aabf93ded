"""The cell against an arm that is not drillc's: where its bodies are, and what they keep."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from drillc.driver import read_job
from drillc.geometry.shapes import RoundedHull, box
from drillc.language.diagnostics import Report
from drillc.language.job import Arm, Job, Named, Pose, Tool
from drillc.planning.cell import (
    BETWEEN,
    LEAST_GAP_MM,
    TOOL,
    make_cell,
    make_cells,
    make_guards,
    pick,
)
from planning.arm_scenes import HIGH, LOW, SPAN, Box, Capsule, Scene, matrix, turn
from planning.arm_specs import arm_spec, region
from walk.arm import KR210
from walk.scene import LINKS

SCENE = Scene(
    part_from_root=(turn("zx", 40, -25), np.array([300.0, -200, 100])),
    flange_from_tool=(turn("yx", -90, 20), np.array([-350.0, 10, 250])),
    body=(Capsule((0, 0, 20), (0, 0, 200), 40.0), Box((-90, -30, 20), (-50, 60, 120))),
)
CELL = SCENE.cell()


def random_joints(n: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(LOW, HIGH, (n, 6))


def test_the_tool_is_where_scipy_puts_it() -> None:
    joints = random_joints(50)
    rotation, position = CELL.tool_pose(joints)
    np.testing.assert_allclose(matrix(rotation, position), SCENE.tool(joints), atol=1e-8)


def test_branches_are_all_that_py_opw_finds() -> None:
    joints = random_joints(50)
    tool = SCENE.tool(joints)
    found = CELL.branches(tool[:, :3, :3], tool[:, :3, 3])
    expected = SCENE.branches(tool)
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
    off = np.angle(np.exp(1j * (found - expected)))
    np.testing.assert_allclose(np.nan_to_num(off), 0.0, atol=1e-6)
    some = np.random.default_rng(1).integers(0, 8, 50)
    np.testing.assert_array_equal(pick(found, some), [found[i, b] for i, b in enumerate(some)])


def test_derived_links_are_the_capsules_that_the_reference_describes() -> None:
    """Each one's ends and radius, at random joints, against the arm's landmarks."""
    joints = random_joints(20)
    at = KR210.points(np.degrees(joints))
    rotation, origin = CELL.link_poses(joints)
    movers = {mover.name.removeprefix("the arm's "): mover for mover in CELL.movers}
    assert set(movers) == {"root", "the tool", *(name for name, *_ in LINKS)}
    root = movers["root"].hulls[0]
    np.testing.assert_allclose(root.points_mm, [[0, 0, 0], [0, 0, 0.5 * KR210.c1]])
    for name, first, second, share in LINKS:
        [hull] = movers[name].hulls
        link = movers[name].link
        assert name == f"link {link}"
        assert hull.radius_mm == pytest.approx(share * (KR210.c2 + KR210.c3))
        for point, landmark in zip(hull.points_mm, (first, second), strict=True):
            placed = rotation[:, link] @ point + origin[:, link]
            expected = SCENE.root @ np.column_stack([at[landmark], np.ones(20)])[..., None]
            np.testing.assert_allclose(placed, expected[:, :3, 0], atol=1e-8)


def test_the_tools_body_follows_the_flange() -> None:
    joints = random_joints(5)
    flange = SCENE.flange(joints)
    rotation, position = CELL.tool_pose(joints)
    tool = CELL.movers[-1]
    assert tool.link == TOOL
    given = [part.drillc for part in SCENE.body]
    for hull, own in zip(tool.hulls, given, strict=True):
        assert hull.radius_mm == own.radius_mm
        placed = np.einsum("nij,kj->nki", rotation, hull.points_mm) + position[:, None]
        points = np.column_stack([own.points_mm, np.ones(len(own.points_mm))])
        expected = np.einsum("nij,kj->nki", flange, points)[..., :3]
        np.testing.assert_allclose(placed, expected, atol=1e-8)


def test_a_tool_without_a_body_is_the_line_to_its_point() -> None:
    tool = replace(SCENE, body=()).cell().movers[-1]
    [hull] = tool.hulls
    # In tool coordinates: the point itself, and where the flange is from there.
    flange = np.linalg.inv(SCENE.flange_tool)[:3, 3]
    order = np.argsort(np.linalg.norm(hull.points_mm, axis=1))
    np.testing.assert_allclose(hull.points_mm[order], [[0, 0, 0], flange], atol=1e-9)
    assert hull.radius_mm == 0.0


def test_corners_enclose_the_body_and_grown_probes_are_kept() -> None:
    for mover in CELL.movers:
        points = np.concatenate([hull.points_mm for hull in mover.hulls])
        np.testing.assert_array_equal(mover.corners_mm.min(axis=0), points.min(axis=0))
        np.testing.assert_array_equal(mover.corners_mm.max(axis=0), points.max(axis=0))
        assert len(mover.corners_mm) == 8
        assert mover.probe(3.0) is mover.probe(3.0)
        assert mover.probe(3.0) is not mover.probe(4.0)
        radii = [hull.radius_mm + 3.0 for hull in mover.hulls]
        assert [hull.radius_mm for hull in mover.probe(3.0).hulls] == radii


def test_links_of_ones_own_replace_the_derived() -> None:
    arm = CELL.arm
    own = box((-10, -10, -10), (10, 10, 10))
    none: tuple[RoundedHull, ...] = ()
    links = (None, (own,), none, None, None, None, (own, own))
    tool = Tool(Named("t", SPAN), 1, Pose(*SCENE.flange_from_tool), None, None)
    cell = make_cell(replace(arm, links=links), CELL.station, tool, ())
    found = {mover.link: mover.hulls for mover in cell.movers}
    assert sorted(found) == [0, 1, 3, 4, 6, TOOL]
    assert found[1] == (own,)
    assert found[6] == (own, own)


GUARDED = arm_spec(
    region("a", "A1 (0, 0, 1200) normal (-1, 0, 0)", "avoid jig clearance 20 mm")
    + region(
        "b",
        "B1 (0, 50, 1200) normal (-1, 0, 0)",
        "avoid jig clearance 1 mm  avoid p clearance 9 mm",
    )
    + region("c", "C1 (0, 90, 1200) normal (-1, 0, 0)"),
    part='part p { up +Z  normals into  frame 1  surface "panel.stl" mm within 9 mm, 9 deg }',
    more="fixture jig { box (0, 0, 0) (9, 9, 9) mm }\nfixture bench { box (0, 0, 0) (9, 9, 9) mm }",
)


def read(folder: Path, text: str) -> Job:
    trimesh.creation.box(bounds=[[-20, -600, 700], [0, 600, 1700]]).export(folder / "panel.stl")
    (folder / "spec.drill").write_text(text, encoding="utf-8")
    return read_job(folder / "spec.drill", None, Report())


def test_what_each_region_keeps_from_what(tmp_path: Path) -> None:
    """Fixtures at least 2 mm always; the part where it is avoided, and between regions."""
    guards = {guard.name: guard.clearance_mm for guard in make_guards(read(tmp_path, GUARDED))}
    assert set(guards) == {"fixture jig", "fixture bench", "part p"}
    assert guards["fixture jig"].tolist() == [20, LEAST_GAP_MM, LEAST_GAP_MM, LEAST_GAP_MM]
    assert guards["fixture bench"].tolist() == [LEAST_GAP_MM] * 4
    assert guards["part p"].tolist() == [-np.inf, 9, -np.inf, LEAST_GAP_MM]
    assert guards["part p"][BETWEEN] == LEAST_GAP_MM


def test_a_part_that_nobody_avoids_is_no_guard(tmp_path: Path) -> None:
    text = GUARDED.replace("avoid p clearance 9 mm", "")
    assert [g.name for g in make_guards(read(tmp_path, text))] == ["fixture jig", "fixture bench"]


def test_a_cell_for_each_station(tmp_path: Path) -> None:
    base = "\n  ".join(
        f"station {name} frame {frame} at (1500, {y}, 0) mm rotate z 180 deg"
        for name, frame, y in (("l", 2, 0), ("r", 3, 99))
    )
    regions = region("a", "A1 (0, 0, 1200) normal (-1, 0, 0)", "station r") + region(
        "b", "B1 (0, 50, 1200) normal (-1, 0, 0)", "station l"
    )
    job = read(tmp_path, arm_spec(regions, base=base))
    assert isinstance(job.robot, Arm)
    cells = make_cells(job, job.robot)
    assert [cell.station.frame for cell in cells] == [2, 3]
    assert cells[1].station.part_from_root.translation_mm.tolist() == [1500, 99, 0]
    np.testing.assert_allclose(cells[0].low_rad, LOW)
    np.testing.assert_allclose(cells[0].high_rad, HIGH)

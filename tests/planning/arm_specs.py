"""Specs of an arm that drills along -x into holes before it, for the tests of its planning."""

from __future__ import annotations

from contextlib import suppress
from functools import cache
from pathlib import Path

import numpy as np
from drillc.driver import Planned, plan_spec
from drillc.language.diagnostics import Refused, Report
from py_opw_kinematics import KinematicModel, Robot
from scipy.spatial.transform import RigidTransform, Rotation

HOME = "home { A1 0 deg  A2 -90 deg  A3 90 deg  A4 0 deg  A5 30 deg  A6 0 deg }"
BASE = "base at (1500, 0, 0) mm rotate z 180 deg"
HOLE = "P1 (0, 0, 1200) normal (-1, 0, 0)"
#: A spindle with an arm of its own, 200 mm to the tool's y and 50 mm behind its point.
OUTRIGGER = (
    "body { cylinder (0, 0, 0) (0, 0, 250) mm radius 30 mm  "
    "capsule (0, 0, 200) (0, 200, 200) mm radius 40 mm }"
)


def region(name: str, points: str, more: str = "") -> str:
    return f"region {name} {{ posture y horizontal toward +Y  {more}  points mm {{ {points} }} }}\n"


def arm_spec(
    regions: str = "",
    *,
    base: str = BASE,
    home: str = HOME,
    part: str = "part p { up +Z  normals into  frame 1 }",
    body: str = "body { cylinder (0, 0, 0) (0, 0, 250) mm radius 60 mm }",
    arm: str = "",
    more: str = "",
) -> str:
    """One hole, if no regions are given. `arm`: more of the arm; `more`: more statements."""
    return (
        f"drill 1\nprogram P\n{part}\ntool spindle {{ number 1  tcp (0, 0, 250) mm  {body} }}\n"
        f"robot arm1 arm {{\n  model kuka_kr210_r3100_2\n  {base}\n  {arm}\n  {home}\n}}\n"
        f"{more}\n{regions or region('r', HOLE)}emit krl\n"
    )


def plan(folder: Path, text: str) -> tuple[Planned | None, Report]:
    """Plan a spec; None where it is refused."""
    (folder / "spec.drill").write_text(text, encoding="utf-8")
    report = Report()
    with suppress(Refused):
        return plan_spec(folder / "spec.drill", None, report), report
    return None, report


def hint(report: Report, code: str) -> str:
    """The hint of the only error, which has this code."""
    [error] = [d for d in report.diagnostics if d.severity == "error"]
    assert error.code == code
    assert error.hint is not None
    return error.hint


@cache
def _oracle() -> Robot:
    """The KR 210 R3100-2 as its maker describes it, with the Rust port of the kinematics."""
    offset = tuple(np.radians([0, -90, 0, 0, 0, 0]))
    sign = (True, False, False, True, False, True)
    model = KinematicModel(330, -115, 0, 645, 1350, 1420, 240, offset, sign)
    return Robot(model, degrees=False)


def cycle_joints(place: tuple[float, float, float], hole: tuple[float, float, float]) -> np.ndarray:
    """Joints (26, 8, 6) of all branches while a hole is visited along -x from 50 mm before it, by a
    spindle of 250 mm with its y axis along Y; the root stands at `place`, turned by 180 deg."""
    depth_mm = np.linspace(-50.0, 0.0, 26)
    tool = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]], dtype=float)  # columns: x, y, z in the part
    flange_mm = np.asarray(hole) + (depth_mm[:, None] - 250.0) * tool[:, 2]
    turn = np.diag([-1.0, -1.0, 1.0])
    rotation = np.broadcast_to(turn @ tool, (26, 3, 3))
    poses = RigidTransform.from_components(
        (flange_mm - np.asarray(place)) @ turn, Rotation.from_matrix(rotation)
    )
    return np.unwrap(np.asarray(_oracle().reach(poses).joints), axis=0)

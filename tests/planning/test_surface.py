"""Holes against the part's surface: the side of a cylinder, where all is known."""

from __future__ import annotations

import math

import numpy as np
import pytest
from planning.arm_specs import plan
from trimesh.creation import cylinder

#: Facets of a tenth of a degree: a chord is 1e-3 mm off the circle.
RADIUS_MM, SECTIONS = 2000.0, 3600
SPEC = """drill 1
program P
part skin {{ up +Z  {normals}  frame 1  surface "skin.stl" mm{within} }}
tool t {{ number 1  tcp (0, 0, 100) mm }}
region r {{ posture x horizontal toward +Y  points mm {{ {points} }} }}
emit krl
"""


def point(name, angle_deg, *, off_mm=0.0, tilted_deg=0.0, outward=True, normal=True):
    """A hole in the wall; its normal is turned about z by `tilted_deg`."""
    a, b = math.radians(angle_deg), math.radians(angle_deg + tilted_deg)
    r = RADIUS_MM + off_mm
    at = f"{name} ({r * math.cos(a):.6f}, {r * math.sin(a):.6f}, 100)"
    sign = 1 if outward else -1
    n = (sign * math.cos(b), sign * math.sin(b))
    return f"{at} normal ({n[0]:.9f}, {n[1]:.9f}, 0)" if normal else at


@pytest.fixture
def skin(tmp_path):
    cylinder(RADIUS_MM, 1000.0, sections=SECTIONS).export(tmp_path / "skin.stl")
    return tmp_path


def said(folder, points, normals="normals outward", within=""):
    text = SPEC.format(points=points, normals=normals, within=within)
    return plan(folder, text)


def errors(report):
    return [(d.code, d.message) for d in report.diagnostics]


def test_holes_on_it(skin):
    points = " ".join(point(f"P{i}", 7.3 * i) for i in range(1, 20))
    planned, report = said(skin, points)
    assert planned is not None, report.diagnostics
    points = " ".join(point(f"P{i}", 7.3 * i, outward=False) for i in range(1, 20))
    assert said(skin, points, "normals into")[0] is not None


@pytest.mark.parametrize("off_mm", [-0.6, 0.6, 0.45])
def test_how_far_off_it_a_hole_may_be(skin, off_mm):
    found = errors(said(skin, point("P1", 33, off_mm=off_mm))[1])
    if abs(off_mm) < 0.5:
        assert found == []
        return
    assert found == [("E345", "hole P1 is 0.600 mm from the part's surface (within 0.5 mm)")]
    assert said(skin, point("P1", 33, off_mm=off_mm), within=" within 0.7 mm, 1 deg")[0] is not None


@pytest.mark.parametrize("tilted_deg", [1.9, -2.2, 2.2])
def test_how_far_off_its_normal_a_holes_may_be(skin, tilted_deg):
    found = errors(said(skin, point("P1", 33, tilted_deg=tilted_deg))[1])
    if abs(tilted_deg) < 2:
        assert found == []
        return
    assert found == [
        ("E346", "the normal of hole P1 is 2.20 deg from the surface's (within 2 deg)")
    ]
    wider = " within 0.5 mm, 2.3 deg"
    assert said(skin, point("P1", 33, tilted_deg=tilted_deg), within=wider)[0] is not None


def test_normals_that_point_the_other_way(skin):
    [error] = said(skin, point("P1", 33, outward=False))[1].diagnostics
    assert error.code == "E346"
    assert error.message.endswith("it points the other way")
    assert error.hint.endswith("normals into")


def test_one_mistake_is_not_said_twice(skin):
    """The surface's normal where a hole is far off says nothing about the hole's."""
    found = errors(said(skin, point("P1", 33, off_mm=30, tilted_deg=20))[1])
    assert [code for code, _ in found] == ["E345"]


def test_normals_are_filled_in(skin):
    angles = np.arange(1, 20) * 7.3
    points = " ".join(point(f"P{i}", a, normal=False) for i, a in enumerate(angles))
    planned, report = said(skin, points, "normals from surface")
    assert planned is not None, report.diagnostics
    a = np.radians(angles)
    outward = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    off = np.degrees(np.arccos(np.clip((-planned.job.holes.feed * outward).sum(axis=1), -1, 1)))
    assert off.max() < 0.06

"""Travel between holes: the part between them is not known, but must not be driven through."""

import numpy as np
import pytest
from drillc.kernels.portal import PortalGeometry, joints, offsets, pointing
from drillc.planning.bulge import arc_rise_mm, greatest_rise_mm, rises, turned_rad
from drillc.planning.travel import travel_height_mm


def on_a_cylinder(angles_deg: list[float], radius: float) -> tuple[np.ndarray, np.ndarray]:
    """Holes around a cylinder, and outward normals."""
    angle = np.radians(angles_deg)
    normal = np.stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)], axis=1)
    return radius * normal, normal


@pytest.mark.parametrize("angle", [0.01, 5.0, 40.0, 90.0, 170.0])
def test_on_a_circle_the_arc_rise_is_the_sagitta(angle: float) -> None:
    position, normal = on_a_cylinder([0.0, angle], 1500.0)
    half = np.radians(angle) / 2
    assert turned_rad(-normal) == pytest.approx([2 * half])
    assert rises(position, -normal).all()
    assert arc_rise_mm(position, -normal) == pytest.approx([1500.0 * (1 - np.cos(half))], rel=1e-6)
    # The tangents at both ends meet at distance R / cos(θ/2) from the axis.
    meet = 1500.0 / np.cos(half) - 1500.0 * np.cos(half)
    assert greatest_rise_mm(position, -normal) == pytest.approx([meet], rel=1e-6)


def test_from_inside_nothing_rises() -> None:
    position, normal = on_a_cylinder([0.0, 40.0], 1500.0)
    assert not rises(position, normal).any()
    assert (greatest_rise_mm(position, normal) == 0).all()


def test_flat_parts_do_not_rise() -> None:
    position = np.array([[0.0, 0.0, 0.0], [5000.0, 0.0, 0.0]])
    axis = np.array([[0.0, 0.0, -1.0]] * 2)
    assert (greatest_rise_mm(position, axis) == 0).all()


def height_on_the_portal(angles_deg: list[float], x_mm: list[float], standoff_mm: float) -> float:
    """Least height over a skin of 2 m radius, worked from inside (side below), at h = H/2."""
    geometry = PortalGeometry(10000.0, 5000.0, 750.0)
    position, normal = on_a_cylinder(angles_deg, 2000.0)
    position[:, 0] = x_mm
    alpha, beta = pointing(normal)
    q = joints(offsets(geometry, position, alpha[:, 0], beta[:, 0]), beta[:, 0], np.full(2, 2500.0))
    withdraw = q[:, 5] - standoff_mm
    withdraw[1] = min(withdraw)
    height = travel_height_mm(geometry, q, withdraw, 5, position, normal)
    return float(height[0])


def test_near_holes_keep_the_standoff() -> None:
    assert height_on_the_portal([0.0, 0.5], [4000.0, 4000.0], 100.0) == pytest.approx(100, abs=1)


def test_a_long_turn_of_the_part_eats_it() -> None:
    """By hand: the part turns about the bar at the height of its own axis, so a skin around that
    axis keeps its distance; a skin that is walked along *and* turned under a straight-moving tool
    does not: at mid-way the line between the holes sags by R (1 - cos 30 deg)."""
    height = height_on_the_portal([-30.0, 30.0], [2000.0, 6000.0], 100.0)
    sag = 2000.0 * (1 - np.cos(np.radians(30.0)))
    assert height == pytest.approx(100.0 - sag, abs=1.0)

"""Sweeps hold every point of the true sweep: dense samples, a linear program as the judge."""

import numpy as np
import pytest
from drillc.geometry.shapes import RoundedHull, box
from drillc.geometry.sweeps import swept_along_z, turned_about_z
from geometry.oracles import in_hull
from hypothesis import given, settings
from hypothesis import strategies as st

COORDINATE = st.floats(-500, 500).map(lambda v: round(v, 3))
HULLS = st.lists(st.tuples(*[COORDINATE] * 3), min_size=1, max_size=8).map(
    lambda points: RoundedHull(np.array(points), 10.0)
)


@settings(max_examples=60, deadline=None)
@given(HULLS, st.floats(-300, 0), st.floats(0, 300), st.randoms(use_true_random=False))
def test_along_z(hull, low, high, random):
    made = swept_along_z(hull, low, high)
    assert made.radius_mm == hull.radius_mm
    for point in hull.points_mm:
        for share in (0.0, random.random(), 1.0):
            at = point + np.array([0, 0, low + share * (high - low)])
            assert in_hull(made.points_mm, at)
    assert made.points_mm[:, 2].min() == pytest.approx(hull.points_mm[:, 2].min() + low)
    assert made.points_mm[:, 2].max() == pytest.approx(hull.points_mm[:, 2].max() + high)


@settings(max_examples=60, deadline=None)
@given(HULLS, st.floats(0, 3.5), st.randoms(use_true_random=False))
def test_about_z(hull, half, random):
    made = turned_about_z(hull, half)
    for point in hull.points_mm:
        for turn in (-half, half, random.uniform(-half, half), random.uniform(-half, half)):
            x, y, z = point
            at = np.array(
                [x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), z]
            )
            assert in_hull(made.points_mm, at)
    # It stands out by no more than the documented share of the distance from the axis.
    out = np.hypot(*hull.points_mm[:, :2].T).max()
    assert np.hypot(*made.points_mm[:, :2].T).max() <= out / np.cos(np.pi / 12) + 1e-9


def test_a_small_turn_costs_little_and_a_full_turn_is_round():
    made = turned_about_z(box((0, -10, 0), (200, 10, 50)), 0.01)
    assert np.hypot(*made.points_mm[:, :2].T).max() <= np.hypot(200, 10) * (1 + 0.01**2)
    made = turned_about_z(box((190, -10, 0), (200, 10, 50)), 10.0)
    angle = np.linspace(0, 2 * np.pi, 50)
    rim = np.hypot(200, 10) * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    assert all(in_hull(made.points_mm, point) for point in rim)
    assert len(made.points_mm) < 200

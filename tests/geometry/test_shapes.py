"""Shapes and their polyhedra against points that belong to them."""

import numpy as np
import pytest
from drillc.geometry.polyhedra import inner, outer
from drillc.geometry.shapes import bounds_mm, box, capsule, cylinder, grown, placed, sphere
from geometry.oracles import hull_distance_mm, spread, winding
from scipy.spatial.transform import Rotation

RNG = np.random.default_rng(11)
SHAPES = {
    "box": box((-1, 2, 3), (40, 50, 3.5)),
    "rounded box": grown(box((0, 0, 0), (300, 20, 100)), 25.0),
    "sphere": sphere((5, 6, 7), 80.0),
    "point": sphere((5, 6, 7), 0.0),
    "capsule": capsule((0, 0, 0), (100, 50, -400), 30.0),
    "segment": capsule((0, 0, 0), (100, 50, -400), 0.0),
    "cylinder": cylinder((1, 2, 3), (100, -50, 60), 35.0),
    "thin": grown(box((0, 0, 0), (10, 10, 10)), 0.004),
}


def test_a_box_has_its_corners():
    low, high = bounds_mm(box((1, 2, 3), (4, 5, 6)))
    assert (low.tolist(), high.tolist()) == ([1, 2, 3], [4, 5, 6])
    assert len(np.unique(box((1, 2, 3), (4, 5, 6)).points_mm, axis=0)) == 8


def test_a_cylinders_prism_holds_the_cylinder():
    prism = cylinder((0, 0, 0), (0, 0, 100), 50.0)
    angle = np.linspace(0, 2 * np.pi, 400)
    rim = np.stack([50 * np.cos(angle), 50 * np.sin(angle), 100 + 0 * angle], axis=1)
    planes = outer(prism).planes
    assert (rim @ planes[:, :3].T <= planes[:, 3]).all()
    assert np.linalg.norm(prism.points_mm[:, :2], axis=1).max() <= 50 * 1.005


def test_placed_turns_and_moves():
    turn = Rotation.from_euler("z", 90, degrees=True).as_matrix()
    moved = placed(capsule((1, 0, 0), (2, 0, 0), 3.0), turn, (0, 0, 5))
    np.testing.assert_allclose(moved.points_mm, [[0, 1, 5], [0, 2, 5]], atol=1e-12)
    assert moved.radius_mm == 3.0


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("extra", [1e-3, 12.0])
def test_the_outer_polyhedron_holds_the_hull_and_little_more(name, extra):
    hull = SHAPES[name]
    made = outer(hull, extra)
    points = spread(grown(hull, extra), RNG, 2000)
    assert (points @ made.planes[:, :3].T <= made.planes[:, 3] + 1e-9).all()
    assert np.allclose(winding(made.mesh, spread(hull, RNG, 20)), 1.0, atol=1e-6)
    radius = hull.radius_mm + extra
    for corner in made.mesh.vertices_mm:
        assert hull_distance_mm(hull, corner) <= extra + 0.0182 * radius + 0.0074


@pytest.mark.parametrize("name", SHAPES)
def test_the_inner_polyhedron_is_inside(name):
    hull, made = SHAPES[name], inner(SHAPES[name])
    assert (made is None) == (name in {"point", "segment"})
    if made is not None:
        for corner in made.mesh.vertices_mm:
            assert hull_distance_mm(hull, corner) <= 1e-6
        # Nor is it much too small: the outer one's planes are not far from its own.
        reach = (made.mesh.vertices_mm @ outer(hull).planes[:, :3].T).max(axis=0)
        assert (outer(hull).planes[:, 3] - reach).max() <= 0.0375 * hull.radius_mm + 0.015

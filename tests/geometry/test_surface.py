"""The nearest points of meshes by trying every triangle, and normals of a known surface."""

import numpy as np
import pytest
import trimesh
from drillc.geometry.shapes import Mesh
from drillc.geometry.surface import closest
from geometry.oracles import mesh_of

BALL = trimesh.creation.icosphere(subdivisions=2, radius=100)
MESHES = {
    "ball": BALL,
    "slivers": trimesh.creation.cylinder(50, 1000, sections=300),
    "fine and coarse": trimesh.util.concatenate(
        [trimesh.creation.icosphere(subdivisions=3, radius=10), trimesh.creation.box((300,) * 3)]
    ),
}


def panel(count):
    """A sheet of a cylinder of radius 1500 about y, and points near it with their normals."""
    angle, y = np.meshgrid(np.linspace(-1, 1, count), np.linspace(-500, 500, count), indexing="ij")
    points = np.stack([1500 * np.sin(angle), y, 1500 * np.cos(angle)], axis=-1).reshape(-1, 3)
    at = np.arange((count - 1) * count).reshape(-1, count)[:, :-1].ravel()
    faces = np.concatenate(
        [
            np.stack([at, at + count, at + 1], axis=1),
            np.stack([at + count, at + count + 1, at + 1], axis=1),
        ]
    )
    return Mesh(points, faces)


@pytest.mark.parametrize("name", MESHES)
def test_the_nearest_point_is_the_nearest(name):
    made, rng = MESHES[name], np.random.default_rng(2)
    corner = made.triangles[rng.integers(len(made.faces), size=100)]
    near = corner.mean(axis=1) + rng.normal(size=(100, 3)) * 2
    points = np.concatenate([near, rng.uniform(-300, 300, (60, 3)), made.vertices[:20]])
    found = closest(mesh_of(made), points)
    for i, point in enumerate(points):
        on = trimesh.triangles.closest_point(made.triangles, np.tile(point, (len(made.faces), 1)))
        least = np.linalg.norm(on - point, axis=1).min()
        assert found.distance_mm[i] == pytest.approx(least, abs=1e-9)
        gap = np.linalg.norm(found.point_mm[i] - point)
        assert gap == pytest.approx(least, abs=1e-9)
        on = trimesh.triangles.closest_point(made.triangles[found.face[i]][None], point[None])
        assert np.linalg.norm(on - found.point_mm[i]) < 1e-6


def test_normals_are_smoother_than_facets():
    rng, mesh = np.random.default_rng(4), panel(60)
    angle, radius = rng.uniform(-0.9, 0.9, 2000), 1500 + rng.normal(size=2000)
    y = rng.uniform(-450, 450, 2000)
    points = np.stack([radius * np.sin(angle), y, radius * np.cos(angle)], axis=1)
    true = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=1)
    found = closest(mesh, points)
    outward = -np.sign(true[0] @ found.normal[0]) * -1
    off = np.degrees(np.linalg.norm(outward * found.normal - true, axis=1))
    facet_angle = np.degrees(2 / 59)
    assert off.max() < 0.01 * facet_angle
    np.testing.assert_allclose(np.linalg.norm(found.normal, axis=1), 1.0, atol=1e-12)


def test_normals_do_not_round_an_edge():
    box = mesh_of(trimesh.creation.box((100, 100, 100)))
    found = closest(box, np.array([[49.9, 10, 60], [60, 49.9, 49.8], [10, -70, 3]]))
    np.testing.assert_allclose(found.normal, [[0, 0, 1], [1, 0, 0], [0, -1, 0]], atol=1e-12)


def test_points_that_are_none_and_triangles_without_area():
    corner = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]])
    mesh = Mesh(corner, np.array([[0, 1, 3], [0, 1, 2]]))
    found = closest(mesh, np.array([[np.nan, 0, 0], [0.2, 0.2, 5], [1.5, -1, 0]]))
    assert np.isnan(found.distance_mm).tolist() == [True, False, False]
    assert found.face[0] == -1
    np.testing.assert_allclose(found.distance_mm[1:], [5, 1])
    np.testing.assert_allclose(found.normal[1], [0, 0, 1])
    assert closest(mesh, np.empty((0, 3))).distance_mm.shape == (0,)

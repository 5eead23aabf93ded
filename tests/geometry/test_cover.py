"""Convex pieces of a mesh hold all of it, inside and all, and not much more."""

import numpy as np
import pytest
import trimesh
from drillc.geometry.cover import convex_cover
from drillc.geometry.polyhedra import outer
from drillc.geometry.shapes import Mesh
from geometry.oracles import mesh_of, winding
from scipy.spatial import ConvexHull


def two():
    other = trimesh.creation.box((10, 20, 30))
    other.apply_translation((50, 5, 0))
    return trimesh.util.concatenate([trimesh.creation.box((10, 20, 30)), other])


def many():
    balls = [trimesh.creation.icosphere(subdivisions=0, radius=5) for _ in range(40)]
    for i, ball in enumerate(balls):
        ball.apply_translation((20 * i, 0, 0))
    return trimesh.util.concatenate(balls)


# The mesh, the most pieces it may take, and how much greater than it they may be together.
SOLIDS = {
    "box": (trimesh.creation.box((100, 200, 300)), 1, 1.001),
    "ball": (trimesh.creation.icosphere(subdivisions=3, radius=100), 1, 1.09),
    "ring": (trimesh.creation.torus(500, 100, major_sections=60, minor_sections=20), 48, 1.25),
    "tube": (trimesh.creation.annulus(80, 100, 300), 48, 1.15),
    "two": (two(), 2, 1.001),
    "many": (many(), 48, 3.0),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_pieces_hold_surface_and_inside(name):
    made, most, factor = SOLIDS[name]
    mesh, rng = mesh_of(made), np.random.default_rng(1)
    pieces = convex_cover(mesh)
    assert len(pieces) <= most
    assert all(len(piece.points_mm) <= 128 and piece.radius_mm == 0 for piece in pieces)
    corner = made.triangles[rng.integers(len(made.faces), size=1500)]
    surface = np.einsum("nk,nkx->nx", rng.dirichlet([0.5] * 3, 1500), corner)
    inside = rng.uniform(*made.bounds, (1500, 3))
    inside = inside[winding(mesh, inside) > 0.5]
    points = np.concatenate([surface, inside, made.vertices])
    planes = [outer(piece).planes for piece in pieces]
    held = [(points @ p[:, :3].T <= p[:, 3]).all(axis=1) for p in planes]
    assert np.any(held, axis=0).all()
    assert sum(ConvexHull(piece.points_mm).volume for piece in pieces) <= factor * made.volume


def test_an_open_sheet_and_a_flat_one():
    x, y = (each.ravel() for each in np.meshgrid(np.arange(20.0), np.arange(15.0), indexing="ij"))
    corner = np.array([i * 15 + j for i in range(19) for j in range(14)])
    faces = np.concatenate(
        [
            np.stack([corner, corner + 15, corner + 1], axis=1),
            np.stack([corner + 15, corner + 16, corner + 1], axis=1),
        ]
    )
    for height in (0 * x, 0.1 * (x - 10) ** 2):
        points = np.stack([x, y, height], axis=1)
        pieces = convex_cover(Mesh(points, faces))
        planes = [outer(piece).planes for piece in pieces]
        held = [(points @ p[:, :3].T <= p[:, 3]).all(axis=1) for p in planes]
        assert np.any(held, axis=0).all()


def test_the_same_mesh_gives_the_same_pieces():
    mesh = mesh_of(SOLIDS["tube"][0])
    first, second = convex_cover(mesh), convex_cover(mesh)
    assert all(np.array_equal(a.points_mm, b.points_mm) for a, b in zip(first, second, strict=True))

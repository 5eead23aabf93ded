"""Obstacles against distances by brute force, dense samples and python-fcl called directly."""

import fcl
import numpy as np
import pytest
import trimesh
from drillc.geometry import obstacles as room
from drillc.geometry.obstacles import Obstacles
from drillc.geometry.probe import Probe
from drillc.geometry.shapes import Mesh, RoundedHull, box, capsule, cylinder, grown, sphere
from geometry.oracles import hull_distance_mm, mesh_of, spread, winding
from scipy.spatial.transform import Rotation

TORUS = mesh_of(trimesh.creation.torus(500, 100, major_sections=48, minor_sections=24))
SOLIDS = [
    TORUS,
    box((600, -100, -200), (800, 100, 300)),
    sphere((0, 0, 350), 90.0),
    capsule((-700, -400, 100), (-300, -600, 300), 40.0),
    cylinder((0, 700, -100), (0, 900, 200), 60.0),
]
TOOL = Probe(
    [
        cylinder((0, 0, 0), (0, 0, -200), 45.0),
        grown(box((-350, -60, -260), (50, 60, -200)), 20.0),
        sphere((0, 0, -200), 80.0),
    ]
)
WITH_FIELD = pytest.mark.parametrize("field", [True, False], ids=["field", "no field"])


def scene(monkeypatch, field, solids=SOLIDS):
    monkeypatch.setattr(room, "WORTH_A_FIELD", 1 if field else 10**9)
    return Obstacles(solids)


def poses(count, reach, seed):
    rng = np.random.default_rng(seed)
    return Rotation.random(count, rng).as_matrix(), rng.uniform(-reach, reach, (count, 3))


def surface_points(solid, rng, count):
    """Points of a solid: of a mesh, on its surface."""
    if isinstance(solid, RoundedHull):
        return spread(solid, rng, count)
    corner = solid.vertices_mm[solid.faces[rng.integers(len(solid.faces), size=count)]]
    return np.einsum("nk,nkx->nx", rng.dirichlet([1.0] * 3, count), corner)


def holds(solid, points, slack=0.0):
    """Which points are in a solid, by its definition."""
    if isinstance(solid, Mesh):
        return winding(solid, points) > 0.5
    return np.array([hull_distance_mm(solid, point) <= slack for point in points])


@WITH_FIELD
def test_no_point_of_the_body_is_in_a_solid_nor_the_reverse(monkeypatch, field):
    """Never wrongly clear: random points of either side, tested against the other."""
    rng = np.random.default_rng(5)
    world, (rotation, position) = scene(monkeypatch, field), poses(40, 500, 1)
    clear = world.clear(TOOL, rotation, position)
    assert 5 < clear.sum() < 35
    body = np.concatenate([spread(hull, rng, 12) for hull in TOOL.hulls])
    for turn, at in zip(rotation[clear], position[clear], strict=True):
        moved = body @ turn.T + at
        for solid in SOLIDS:
            assert not holds(solid, moved).any()
            back = (surface_points(solid, rng, 12) - at) @ turn
            assert not any(holds(hull, back).any() for hull in TOOL.hulls)


@WITH_FIELD
def test_blocked_poses_are_blocked(monkeypatch, field):
    """Never wrongly blocked either, down to 0.01 mm: what is not clear has a gap of nothing."""
    world, (rotation, position) = scene(monkeypatch, field), poses(150, 700, 2)
    clear = world.clear(TOOL, rotation, position)
    gaps = [world.gap_mm(TOOL, r, p)[0] for r, p in zip(rotation, position, strict=True)]
    np.testing.assert_array_equal(clear, np.array(gaps) > room.TOUCHING_MM)


def test_the_field_changes_no_answer(monkeypatch):
    rotation, position = poses(1500, 700, 3)
    with_field = scene(monkeypatch, True).clear(TOOL, rotation, position)
    without = scene(monkeypatch, False).clear(TOOL, rotation, position)
    np.testing.assert_array_equal(with_field, without)


def test_agrees_with_fcl_on_polyhedra(monkeypatch):
    """Sharp bodies against a mesh, python-fcl called directly, and single points for nesting."""
    world = scene(monkeypatch, True, [TORUS])
    block = trimesh.creation.box((120, 80, 300))
    probe = Probe([RoundedHull(np.array(block.vertices), 0.0)])

    def tree(mesh):
        model = fcl.BVHModel()
        model.beginModel(len(mesh.vertices_mm), len(mesh.faces))
        model.addSubModel(mesh.vertices_mm, mesh.faces)
        model.endModel()
        return fcl.CollisionObject(model)

    moving, standing = tree(mesh_of(block)), tree(TORUS)
    rotation, position = poses(1500, 600, 4)
    expected = []
    for turn, at in zip(rotation, position, strict=True):
        moving.setTransform(fcl.Transform(turn, at))
        hit = fcl.collide(moving, standing, fcl.CollisionRequest(), fcl.CollisionResult())
        expected.append(not hit and winding(TORUS, at[None])[0] < 0.5)
    clear = world.clear(probe, rotation, position)
    assert 300 < sum(expected) < 1400
    np.testing.assert_array_equal(clear, expected)


@WITH_FIELD
def test_one_inside_the_other_collides(monkeypatch, field):
    shell = mesh_of(trimesh.creation.icosphere(subdivisions=4, radius=300))
    hollow = mesh_of(trimesh.creation.icosphere(subdivisions=3, radius=200))
    cavity = Mesh(
        np.concatenate([shell.vertices_mm, hollow.vertices_mm]),
        np.concatenate([shell.faces, hollow.faces[:, ::-1] + len(shell.vertices_mm)]),
    )
    small, eye = Probe([sphere((0, 0, 0), 20.0)]), np.eye(3)[None]
    at = np.array([[0.0, 0, 0], [250, 0, 0], [0, 0, 350], [0, 195, 0], [0, 0, 279], [0, 0, 281]])
    eyes = np.repeat(eye, len(at), axis=0)
    full = [False, False, True, False, False, False]
    assert scene(monkeypatch, field, [shell]).clear(small, eyes, at).tolist() == full
    hollowed = [True, False, True, False, False, False]
    assert scene(monkeypatch, field, [cavity]).clear(small, eyes, at).tolist() == hollowed
    ball = scene(monkeypatch, field, [sphere((0, 0, 0), 300.0)])
    assert ball.clear(small, eyes, at).tolist() == full
    # The reverse: a body around a small solid, be it closed or open.
    great = Probe([box((-100, -100, -100), (100, 100, 100))])
    sheet = Mesh(np.array([[0.0, 0, 0], [10, 0, 0], [0, 10, 0]]), np.array([[0, 1, 2]]))
    for solid in (sphere((0, 0, 0), 20.0), sheet):
        world = scene(monkeypatch, field, [sphere((900, 0, 0), 1.0), solid])
        assert world.clear(great, eyes[:2], at[:2]).tolist() == [False, True]
        assert world.gap_mm(great, np.eye(3), np.zeros(3))[0] < 0


@WITH_FIELD
def test_touching_is_not_clear(monkeypatch, field):
    world = scene(monkeypatch, field, [box((0, 0, 0), (100, 100, 100))])
    cube = Probe([box((0, 0, 0), (100, 100, 100))])
    at = np.array([[100.0, 0, 0], [100.01, 0, 0], [0, 0, -100], [100, 100, 100], [0, -100.01, 0]])
    clear = world.clear(cube, np.repeat(np.eye(3)[None], len(at), axis=0), at)
    assert clear.tolist() == [False, True, False, False, True]


def test_balls_and_capsules_are_exact(monkeypatch):
    """Closed form: two round bodies are clear to the micrometre, not to their polyhedra."""
    world = scene(monkeypatch, False, [sphere((0, 0, 0), 100.0)])
    rng = np.random.default_rng(8)
    way = rng.normal(size=(200, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    gap = rng.choice([-0.1, -0.02, 0.02, 0.1, 1.0], 200)
    at = way * (150.0 + gap)[:, None]
    eyes = np.repeat(np.eye(3)[None], 200, axis=0)
    ball = Probe([sphere((0, 0, 0), 50.0)])
    np.testing.assert_array_equal(world.clear(ball, eyes, at), gap > 0)
    found = np.array([world.gap_mm(ball, np.eye(3), each)[0] for each in at])
    assert ((found <= gap + 1e-9) & (found >= gap - 0.006)).all()
    across = np.cross(way, [[0.3, 0.4, 0.5]])
    at = at + 0.9 * way  # a radius that is no whole number of millimetres
    start, end = (at - across)[:, None], (at + 2 * across)[:, None]
    clear = world.capsules_clear(start, end, np.array([50.9]))
    np.testing.assert_array_equal(clear, gap > 0)


@WITH_FIELD
def test_capsules_against_dense_points(monkeypatch, field):
    rng = np.random.default_rng(9)
    world = scene(monkeypatch, field)
    start = rng.uniform(-700, 700, (60, 2, 3))
    end = start + rng.normal(size=(60, 2, 3)) * 150
    end[:20, 0] = start[:20, 0]
    radius = np.array([0.0, 45.0])
    clear = world.capsules_clear(start, end, radius)
    assert 8 < clear.sum() < 52
    share = np.linspace(0, 1, 9)[:, None]
    for i in range(60):
        probes = [Probe([capsule(start[i, k], end[i, k], radius[k])]) for k in range(2)]
        gaps = [world.gap_mm(probe, np.eye(3), np.zeros(3))[0] for probe in probes]
        assert clear[i] == (min(gaps) > room.TOUCHING_MM)
        if clear[i]:
            points = np.concatenate([start[i, k] + share * (end - start)[i, k] for k in range(2)])
            assert not any(holds(solid, points).any() for solid in SOLIDS)


def test_capsules_inside_and_around(monkeypatch):
    for field in (True, False):
        world = scene(monkeypatch, field, [TORUS, sphere((0, 0, 0), 30.0)])
        start = np.array([[[500.0, 0, 0]], [[-10, 0, 0]], [[0, 0, 500]], [[0, 0, 200]]])
        end = np.array([[[500.0, 10, 0]], [[10, 0, 0]], [[0, 0, 600]], [[0, 0, 300]]])
        radius = np.array([[1.0], [5.0], [50.0], [100.0]])
        assert world.capsules_clear(start, end, radius).tolist() == [False, False, True, True]
        # The ball wholly inside a capsule.
        assert not world.capsules_clear(end[1:2], start[1:2], np.array([200.0]))[0]


@pytest.mark.parametrize("solids", [SOLIDS, SOLIDS[1:2], SOLIDS[3:4]])
def test_the_field_is_a_lower_bound(solids):
    field = Obstacles(solids).field
    rng = np.random.default_rng(10)
    near = np.concatenate([surface_points(solid, rng, 60) for solid in solids])
    near = near + rng.normal(size=near.shape) * 20
    points = np.concatenate([near, rng.uniform(-1500, 1500, (200, 3))])
    bound, side = field.distance_mm(points), field.side_of(points)
    corners = TORUS.vertices_mm[TORUS.faces]
    for point, least, where in zip(points, bound, side, strict=True):
        inside = any(holds(solid, point[None])[0] for solid in solids)
        truth = np.inf
        for solid in solids:
            if isinstance(solid, RoundedHull):
                truth = min(truth, hull_distance_mm(solid, point))
            else:
                every = np.tile(point, (len(corners), 1))
                on = trimesh.triangles.closest_point(corners, every)
                truth = min(truth, np.linalg.norm(on - point, axis=1).min())
        assert least <= (0.0 if inside else truth) + 1e-6
        # And not much lower: the documented voxels, and what the outer polyhedra stand out.
        high_mm = field.origin_mm + field.voxel_mm * np.array(field.away_mm.shape)
        if not inside and ((point > field.origin_mm) & (point < high_mm)).all():
            assert least >= truth - 3.5 * field.voxel_mm - 0.02 * 100
        assert where != room.INSIDE or inside or truth < 0.02 * 100
        assert where != 0 or not inside


def test_nothing_around_and_poses_that_are_none():
    rotation, position = poses(4, 100, 6)
    position[1, 2] = np.nan
    rotation[2, 0, 0] = np.inf
    expected = [True, False, False, True]
    assert Obstacles([]).clear(TOOL, rotation, position).tolist() == expected
    assert Obstacles([]).gap_mm(TOOL, rotation[0], position[0]) == (np.inf, -1)
    assert (
        Obstacles([sphere((9e3, 0, 0), 1.0)]).clear(TOOL, rotation, position).tolist() == expected
    )
    assert Obstacles(SOLIDS).clear(TOOL, rotation[:0], position[:0]).shape == (0,)
    ends = np.zeros((2, 3, 3))
    ends[1, 1, 1] = np.nan
    assert Obstacles([]).capsules_clear(ends, ends, np.ones(3)).tolist() == [True, False]
    with pytest.raises(ValueError, match="at least one"):
        Probe([])


def test_the_nearest_solid_is_named(monkeypatch):
    world = scene(monkeypatch, False)
    small = Probe([sphere((0, 0, 0), 5.0)])
    # The third is 152.54 mm from the cylinder's axis, whose prism stands out by up to 0.29 mm.
    for at, solid, gap in [((820, 0, 0), 1, 15.0), ((0, 0, 470), 2, 25.0), ((0, 950, 0), 4, 87.54)]:
        found = world.gap_mm(small, np.eye(3), np.array(at, dtype=float))
        assert found[1] == solid
        assert gap - 0.3 <= found[0] <= gap + 1e-2
    assert world.gap_mm(small, np.eye(3), np.array([0, 0, 350.0]))[0] <= -95


def test_the_balls_of_a_probe_cover_it():
    rng = np.random.default_rng(12)
    body = np.concatenate([spread(hull, rng, 400) for hull in TOOL.hulls])
    for level in TOOL.levels:
        far = np.linalg.norm(body[:, None] - level.centre_mm, axis=2) - level.radius_mm
        assert (far.min(axis=1) <= 1e-9).all()


@pytest.mark.parametrize("size_mm", [0.1, 0.5, 0.99, 1.0, 3.0, 50.0])
def test_a_segment_through_a_solid_of_any_size_meets_it(size_mm):
    """The polyhedron around a segment is a millimetre wide: it may hold the whole solid."""
    world = Obstacles([box((0.0, 0.0, 0.0), (size_mm,) * 3)])
    middle = 0.5 * size_mm
    start = np.array([[[-1.0, middle, middle]], [[-1.0, middle, size_mm + 0.1]]])
    end = np.array([[[2.0 + size_mm, middle, middle]], [[2.0 + size_mm, middle, size_mm + 0.1]]])
    assert world.capsules_clear(start, end, np.zeros(1)).tolist() == [False, True]

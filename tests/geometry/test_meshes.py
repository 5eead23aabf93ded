"""Mesh files written by trimesh and read back; broken ones, each refused as a MeshError."""

import io
import json
import struct
import zipfile

import numpy as np
import pytest
import trimesh
from drillc.geometry import mesh_error
from drillc.geometry.mesh_error import MeshError
from drillc.geometry.meshes import KINDS, inspect_mesh, read_mesh, scaled
from drillc.geometry.shapes import Mesh
from geometry.oracles import winding

BALL = trimesh.creation.icosphere(subdivisions=2, radius=10)
MODEL = (
    '<model unit="millimeter" xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02">'
)
TETRA = (
    "<mesh><vertices>"
    '<vertex x="0" y="0" z="0"/><vertex x="1" y="0" z="0"/>'
    '<vertex x="0" y="1" z="0"/><vertex x="0" y="0" z="1"/></vertices><triangles>'
    '<triangle v1="0" v2="2" v3="1"/><triangle v1="0" v2="1" v3="3"/>'
    '<triangle v1="1" v2="2" v3="3"/><triangle v1="0" v2="3" v3="2"/></triangles></mesh>'
)


def written(made, kind):
    data = made.export(file_type=kind)
    return data.encode() if isinstance(data, str) else bytes(data)


def archive(model, name="3D/3dmodel.model"):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as made:
        # A time of its own: the bytes stand in tests' names, which may not change with the clock.
        entry = zipfile.ZipInfo(name, (2000, 1, 1, 0, 0, 0))
        made.writestr(entry, model, zipfile.ZIP_DEFLATED)
    return file.getvalue()


def glb(header, binary=b""):
    text = json.dumps(header).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    chunks += struct.pack("<II", len(binary), 0x004E4942) + binary
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def triangle_glb(**changes):
    """A GLB of one triangle, with some of its header replaced."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype="<f4").tobytes()
    header = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36}],
    }
    return glb({**header, **changes}, points)


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_comes_back(kind):
    mesh = read_mesh(written(BALL, kind), kind)
    facts = inspect_mesh(mesh)
    assert (facts.triangles, facts.pieces, facts.watertight) == (len(BALL.faces), 1, True)
    assert facts.volume_mm3 == pytest.approx(BALL.volume, rel=1e-5)
    assert facts.area_mm2 == pytest.approx(BALL.area, rel=1e-5)
    np.testing.assert_allclose(facts.extent_mm, 20.0, rtol=1e-5)
    corners = np.sort(np.round(mesh.vertices_mm[mesh.faces].mean(axis=1), 3), axis=0)
    expected = np.sort(np.round(BALL.triangles.mean(axis=1), 3), axis=0)
    np.testing.assert_allclose(corners, expected, atol=2e-3)


def test_a_text_stl_comes_back():
    facts = inspect_mesh(read_mesh(written(BALL, "stl_ascii"), "stl"))
    assert facts.triangles == len(BALL.faces)
    assert facts.watertight


@pytest.mark.parametrize("kind", ["glb", "3mf"])
def test_a_scene_is_flattened(kind):
    scene = trimesh.Scene()
    mirrored = trimesh.transformations.translation_matrix((5, 0, 0)) @ np.diag([1, 1, -1, 1])
    turned = trimesh.transformations.rotation_matrix(1.0, (0, 0, 1), (40, 0, 0))
    scene.add_geometry(BALL, transform=mirrored)
    scene.add_geometry(trimesh.creation.box((1, 2, 3)), transform=turned)
    facts = inspect_mesh(read_mesh(written(scene, kind), kind))
    np.testing.assert_allclose([facts.low_mm, facts.high_mm], scene.bounds, atol=1e-5)
    assert facts.volume_mm3 == pytest.approx(BALL.volume + 6.0, rel=1e-5)
    assert facts.watertight


def test_parts_of_parts_of_a_3mf():
    """A component in a component: the outer transform is applied after the inner."""
    model = (
        f'{MODEL}<resources><object id="1">{TETRA}</object><object id="2"><components>'
        '<component objectid="1" transform="2 0 0 0 2 0 0 0 2 10 0 0"/></components></object>'
        '</resources><build><item objectid="2" transform="0 1 0 -1 0 0 0 0 1 0 0 5"/></build>'
        "</model>"
    )
    facts = inspect_mesh(read_mesh(archive(model), "3mf"))
    np.testing.assert_allclose(facts.low_mm, [-2, 10, 5])
    np.testing.assert_allclose(facts.high_mm, [0, 12, 7])
    assert facts.volume_mm3 == pytest.approx(8 / 6)


def test_strips_and_fans_of_a_glb():
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype="<f4")
    for mode, order in ((5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])):
        data = triangle_glb(
            meshes=[{"primitives": [{"attributes": {"POSITION": 0}, "mode": mode}]}],
            accessors=[{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}],
        )
        length = len(data) - 36
        data = data[:length] + points[order].tobytes()
        data = data[:8] + struct.pack("<I", len(data)) + data[12:]
        at = data.index(struct.pack("<II", 36, 0x004E4942))
        data = data[:at] + struct.pack("<I", 48) + data[at + 4 :]
        mesh = read_mesh(data, "glb")
        a, b, c = mesh.vertices_mm[mesh.faces].swapaxes(0, 1)
        assert (np.cross(b - a, c - a)[:, 2] == 1.0).all()
        assert inspect_mesh(mesh).area_mm2 == pytest.approx(1.0)


def test_winding_is_mended_and_cavities_stay():
    rng = np.random.default_rng(3)
    inner = trimesh.creation.icosphere(subdivisions=2, radius=5)
    inner.invert()
    both = trimesh.util.concatenate([BALL, inner])
    for turned in (np.zeros(len(both.faces), bool), np.ones(len(both.faces), bool)):
        faces = np.where(turned[:, None], both.faces[:, ::-1], both.faces)
        mesh = read_mesh(
            written(trimesh.Trimesh(both.vertices, faces, process=False), "stl"), "stl"
        )
        at = np.array([[0.1, 0.2, 0.3], [0, 7.3, 0.1], [12, 0, 0]])
        np.testing.assert_allclose(winding(mesh, at), [0, 1, 0], atol=1e-6)
    faces = BALL.faces.copy()
    turned = rng.random(len(faces)) < 0.3
    faces[turned] = faces[turned][:, ::-1]
    mesh = read_mesh(written(trimesh.Trimesh(BALL.vertices, faces, process=False), "ply"), "ply")
    assert inspect_mesh(mesh).volume_mm3 == pytest.approx(BALL.volume, rel=1e-5)


def test_useless_triangles_are_dropped_and_order_kept():
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype=float)
    faces = [[0, 1, 2], [1, 1, 2], [1, 3, 2], [2, 0, 1]]
    text = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    text += "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in faces)
    mesh = read_mesh(text.encode(), "obj")
    np.testing.assert_array_equal(mesh.vertices_mm[mesh.faces], corners[[[0, 1, 2], [1, 3, 2]]])
    facts = inspect_mesh(mesh)
    assert (facts.pieces, facts.open_pieces, facts.volume_mm3) == (1, 1, 0.0)
    assert inspect_mesh(scaled(mesh, 1000.0)).area_mm2 == pytest.approx(1e6)


def test_nothing_outside_the_file_is_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "m.mtl").write_text("newmtl a\nmap_Kd picture.png\n")
    opened = []
    monkeypatch.setattr(
        "builtins.open", lambda *a, **k: opened.append(a) or (_ for _ in ()).throw(OSError())
    )
    text = b"mtllib m.mtl\nusemtl a\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    assert len(read_mesh(text, "obj").faces) == 1
    with pytest.raises(MeshError, match="outside"):
        read_mesh(triangle_glb(buffers=[{"byteLength": 36, "uri": "a.bin"}]), "glb")
    assert not opened


@pytest.mark.parametrize(
    ("kind", "data", "said"),
    [
        ("stl", b"", "no text STL"),
        ("stl", b"solid empty\nendsolid empty\n", ""),
        ("stl", b"\0" * 80 + struct.pack("<I", 1000) + b"\0" * 50, "length"),
        ("ply", b"hello", "header"),
        ("ply", b"ply\nformat ascii 1.0\nelement face 9999\nend_header\n", "than it has bytes"),
        ("obj", b"v 0 0 0\n", "no triangles"),
        ("obj", b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n", "not a number"),
        ("obj", b"v 0 0 0\nv 1 0 0\nv 1e30 1 0\nf 1 2 3\n", "1e9"),
        ("obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n", ""),
        ("obj", b"v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n", "without area"),
        ("glb", b"glTF", ""),
        ("glb", triangle_glb()[:-4], "bytes"),
        ("glb", triangle_glb(nodes=[{"mesh": 0, "children": [0]}]), "tree"),
        ("glb", triangle_glb(extensionsRequired=["KHR_draco_mesh_compression"]), "draco"),
        ("glb", triangle_glb(scenes=[{"nodes": []}]), "no triangles"),
        ("glb", triangle_glb(bufferViews=[{"buffer": 0, "byteOffset": -36}]), "bounds"),
        ("3mf", b"PK\3\4", ""),
        ("3mf", archive(MODEL, "other"), "3dmodel"),
        ("3mf", archive(f"<!DOCTYPE a [<!ENTITY b 'c'>]>{MODEL}</model>"), "document type"),
        ("3mf", archive(f'{MODEL}<build><item objectid="7"/></build></model>'), "'7'"),
    ],
)
def test_what_is_wrong_is_said(kind, data, said):
    with pytest.raises(MeshError) as caught:
        read_mesh(data, kind)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_bombs_are_refused_before_they_burst(monkeypatch):
    # Objects that each name the one before twice: 2^40 placed pieces.
    objects = f'<object id="0">{TETRA}</object>' + "".join(
        f'<object id="{i}"><components><component objectid="{i - 1}"/>'
        f'<component objectid="{i - 1}"/></components></object>'
        for i in range(1, 41)
    )
    build = '<build><item objectid="40"/></build>'
    with pytest.raises(MeshError):
        read_mesh(archive(f"{MODEL}<resources>{objects}</resources>{build}</model>"), "3mf")
    # A member that unpacks to far more than it is.
    monkeypatch.setattr("drillc.geometry.threemf.MOST_XML_BYTES", 10_000_000)
    with pytest.raises(MeshError, match="unpacked"):
        read_mesh(archive(MODEL + " " * 20_000_000), "3mf")
    huge = {"bufferView": 0, "componentType": 5126, "count": 10**12, "type": "VEC3"}
    with pytest.raises(MeshError, match="triangles"):
        read_mesh(triangle_glb(accessors=[huge]), "glb")
    monkeypatch.setattr(mesh_error, "MOST_TRIANGLES", 100)
    for kind in KINDS:
        with pytest.raises(MeshError, match="at most 100"):
            read_mesh(written(BALL, kind), kind)


@pytest.mark.parametrize("kind", KINDS)
def test_any_damage_is_a_mesh_error_or_a_mesh(kind):
    """A few hundred damaged files of each kind; warnings are errors here."""
    rng = np.random.default_rng(KINDS.index(kind))
    good = written(trimesh.creation.box((1, 2, 3)), kind)
    said = []
    for _ in range(400):
        data = bytearray(good)
        match rng.integers(4):
            case 0:
                del data[rng.integers(len(data)) :]
            case 1:
                at = rng.integers(len(data))
                del data[at : at + rng.integers(1, 40)]
            case 2:
                at = rng.integers(len(data))
                data[at:at] = data[: rng.integers(1, 60)]
        for at in rng.integers(len(data), size=rng.integers(0, 6)) if data else ():
            data[at] = rng.integers(256)
        try:
            mesh = read_mesh(bytes(data), kind)
        except MeshError as error:
            said.append(str(error))
        else:
            assert isinstance(mesh, Mesh)
            assert np.isfinite(mesh.vertices_mm).all()
            inspect_mesh(mesh)
    assert len(said) > 40
    assert all(words.isprintable() for words in said)

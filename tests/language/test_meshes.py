"""Mesh files of a spec: unit, place and what they are for; and the solids beside them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from drillc.cli import main
from drillc.geometry import mesh_error, meshes
from drillc.geometry.shapes import Mesh, RoundedHull, bounds_mm
from drillc.language import loading, mesh_files
from drillc.language.diagnostics import Report
from drillc.language.job import Job
from drillc.language.loading import Limit
from language.solids import obj, stl, threemf
from language.texts import codes, only, resolved

HEAD = "drill 1\nprogram P\n"
PART = "part p { up +Z  normals into }\n"
REGION = "region r { posture x toward +X  points mm { P1 (1, 2, 3) normal (0, 0, -1) } }\n"
LOW, HIGH = (100.0, 200.0, 300.0), (150.0, 260.0, 370.0)
#: A sheet of 1 m by 1 m at z 0, facing up.
SHEET = "v 0 0 0\nv 1000 0 0\nv 1000 1000 0\nv 0 1000 0\nf 1 2 3\nf 1 3 4\n"


def attempt(
    folder: Path, statement: str, content: str | bytes = b"", name: str = "body.obj"
) -> tuple[Job | None, Report]:
    raw = content.encode() if isinstance(content, str) else content
    (folder / name).write_bytes(raw)
    return resolved(folder, HEAD + (PART if "part p" not in statement else "") + statement + REGION)


def fine(folder: Path, statement: str, content: str | bytes, name: str = "body.obj") -> Job:
    job, report = attempt(folder, statement, content, name)
    assert job is not None, [d.message for d in report.diagnostics]
    assert codes(report) == []
    return job


def shape_of(job: Job) -> RoundedHull | Mesh:
    [fixture] = job.fixtures
    [solid] = fixture.solids
    return solid.shape


# ── fixtures ─────────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("unit", "factor"), [("mm", 1.0), ("cm", 10.0), ("inch", 25.4), ("m", 1000.0)]
)
def test_the_unit_is_the_one_that_is_said(tmp_path: Path, unit: str, factor: float) -> None:
    job = fine(tmp_path, f'fixture f {{ mesh "body.obj" {unit} }}\n', obj((1, 2, 3), (4, 6, 8)))
    shape = shape_of(job)
    assert isinstance(shape, Mesh)
    low, high = bounds_mm(shape)
    assert low == pytest.approx(np.array([1, 2, 3]) * factor)
    assert high == pytest.approx(np.array([4, 6, 8]) * factor)


@pytest.mark.parametrize("name", ["body.obj", "body.stl", "BODY.STL"])
def test_the_kind_is_told_by_the_ending(tmp_path: Path, name: str) -> None:
    content = obj(LOW, HIGH) if name.endswith("obj") else stl(LOW, HIGH)
    job = fine(tmp_path, f'fixture f {{ mesh "{name}" mm }}\n', content, name)
    assert np.array(bounds_mm(shape_of(job))) == pytest.approx(np.array([LOW, HIGH]))


def test_a_mesh_is_placed_behind_its_unit(tmp_path: Path) -> None:
    """100 … 150 along x, turned about z, come to lie along y; then moved."""
    job = fine(
        tmp_path,
        'fixture f { mesh "body.obj" cm at (1, 2, 3) m rotate z 90 deg }\n',
        obj(LOW, HIGH),
    )
    low, high = bounds_mm(shape_of(job))
    assert low == pytest.approx([1000 - 2600, 2000 + 1000, 3000 + 3000])
    assert high == pytest.approx([1000 - 2000, 2000 + 1500, 3000 + 3700])


def test_solids_are_what_they_say(tmp_path: Path) -> None:
    job = fine(
        tmp_path,
        "fixture f {\n"
        "  box (9, 0, 0) (0, 8, 7) mm\n"
        "  box (0, 0, 0) (10, 20, 30) mm at (100, 0, 0) mm rotate z 90 deg\n"
        "  sphere (1, 2, 3) cm radius 4 mm\n"
        "  capsule (0, 0, 0) (0, 0, 50) mm radius 6 mm\n"
        "  cylinder (0, 0, 0) (0, 0, 5) cm radius 1 cm\n}\n",
        b"",
    )
    [fixture] = job.fixtures
    bounds = [np.array(bounds_mm(solid.shape)).tolist() for solid in fixture.solids]
    assert bounds[0] == [[0, 0, 0], [9, 8, 7]]
    assert np.array(bounds[1]) == pytest.approx(np.array([[80, 0, 0], [100, 10, 30]]))
    assert bounds[2] == [[6, 16, 26], [14, 24, 34]]
    assert bounds[3] == [[-6, -6, -6], [6, 6, 56]]
    # Around the true cylinder, and not far.
    assert np.array(bounds[4]) == pytest.approx(np.array([[-10, -10, 0], [10, 10, 50]]), abs=0.06)
    assert [solid.span.line for solid in fixture.solids] == [5, 6, 7, 8, 9]


def test_a_fixture_must_be_closed_and_a_surface_need_not(tmp_path: Path) -> None:
    open_box = obj(LOW, HIGH, lack=2)
    _, report = attempt(tmp_path, 'fixture f { mesh "body.obj" mm }\n', open_box)
    assert only(report).code == "E134"
    assert "(1 of 1 pieces are open)" in only(report).message
    statement = 'part p { up +Z  normals into  surface "body.obj" mm }\n'
    part = fine(tmp_path, statement, obj((0, 0, 0), (9, 9, 9), lack=2)).part
    assert part.surface is not None
    assert len(part.surface.mesh.faces) == 10


def test_a_tools_body_is_covered_by_convex_pieces(tmp_path: Path) -> None:
    statement = (
        'tool t { number 1  tcp (0, 0, 9) mm  body { mesh "body.obj" mm at (0, 0, 1) m'
        "  sphere (0, 0, 0) mm radius 1 mm } }\n"
    )
    tool = fine(tmp_path, statement, obj(LOW, HIGH)).tool
    assert tool is not None
    assert all(isinstance(piece, RoundedHull) for piece in tool.body)
    ends = np.array([bounds_mm(piece) for piece in tool.body[:-1]])
    lift = np.array([0.0, 0.0, 1000.0])
    # Contained, and not much more than that.
    assert (ends[:, 0].min(axis=0) <= np.array(LOW) + lift + 1e-9).all()
    assert (ends[:, 1].max(axis=0) >= np.array(HIGH) + lift - 1e-9).all()
    assert np.ptp(ends, axis=(0, 1)).max() < 75
    assert tool.body[-1].radius_mm == 1
    _, report = attempt(tmp_path, statement, obj(LOW, HIGH, lack=1))
    assert only(report).code == "E134"


# ── the part's surface ───────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("within", "mm", "deg"),
    [
        ("", 0.5, 2.0),
        ("within 1 cm", 10.0, 2.0),
        ("within 1 deg", 0.5, 1.0),
        ("within 2 mm, 3 deg", 2.0, 3.0),
        ("within 3 deg, 2 mm", 2.0, 3.0),
    ],
)
def test_what_a_hole_may_be_off(tmp_path: Path, within: str, mm: float, deg: float) -> None:
    statement = f'part p {{ up +Z  normals into  surface "body.obj" mm {within} }}\n'
    surface = fine(tmp_path, statement, SHEET).part.surface
    assert surface is not None
    assert surface.within_mm == mm
    assert np.degrees(surface.within_rad) == pytest.approx(deg)


BARE = 'drill 1\nprogram P\npart p { up +Z  normals from surface  surface "body.obj" mm }\n'


def test_holes_without_normals(tmp_path: Path) -> None:
    """From a points block and from a table; planning fills their normals in."""
    (tmp_path / "body.obj").write_text(SHEET)
    (tmp_path / "holes.csv").write_text("ID,X,Y,Z\nF1,1,2,0\nF2,3,4,0\n")
    text = (
        BARE + 'holes t from "holes.csv" { units mm  columns { id ID  x X  y Y  z Z } }\n'
        "region r { posture x toward +X  select t  points cm { P1 (1, 2, 3) # normal (1, 2, 3)\n"
        "  normal_2 (2,3,4)P3(3, 4, 5) } }\n"
    )
    job, report = resolved(tmp_path, text)
    assert job is not None, [d.message for d in report.diagnostics]
    assert job.part.normals_from_surface
    assert job.holes.ids.tolist() == ["P1", "normal_2", "P3", "F1", "F2"]
    assert job.holes.position_mm[:3].tolist() == [[10, 20, 30], [20, 30, 40], [30, 40, 50]]
    assert np.isnan(job.holes.feed).all()
    assert job.holes.feed.shape == (5, 3)


@pytest.mark.parametrize(
    ("points", "said"),
    [
        ("P1 (1, 2, 3) normal (0, 0, 1)", 'expected a hole id, found "normal"'),
        ("normal (1, 2, 3)", 'expected a hole id, found "normal"'),
        ("P1 (1, 2) P2 (3, 4, 5)", 'expected "," after y'),
    ],
)
def test_a_normal_is_no_hole(tmp_path: Path, points: str, said: str) -> None:
    (tmp_path / "body.obj").write_text(SHEET)
    region = f"region r {{ posture x toward +X  points mm {{ {points} }} }}\n"
    job, report = resolved(tmp_path, BARE + region)
    assert job is None
    found = report.diagnostics[0]
    assert found.code == "E301"
    assert said in found.message
    assert "its normal is taken from the part's surface" in (found.hint or "")


# ── a thousand times off ─────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("size", "unit", "hint"),
    [
        (0.4, "mm", "is it measured in m?"),
        (0.9, "mm", "is it measured in m?"),
        (0.02, "m", None),
        (400_000, "mm", "is it measured in um?"),
        (4000, "m", "E205"),
        (300, "m", "is it measured in mm?"),
        (500, "um", "is it measured in mm?"),
        (0.00001, "um", "check its unit"),
        (1.0, "mm", None),
        (100.0, "m", None),
    ],
)
def test_a_mesh_of_an_unlikely_size(
    tmp_path: Path, size: float, unit: str, hint: str | None
) -> None:
    box = obj((0, 0, 0), (size, size / 2, size / 3))
    _, report = attempt(tmp_path, f'fixture f {{ mesh "body.obj" {unit} }}\n', box)
    if hint is None:
        assert codes(report) == []
    elif hint.startswith("E"):
        assert codes(report) == [hint]
    else:
        assert (only(report).code, only(report).hint) == ("W135", hint)


@pytest.mark.parametrize(
    ("factor", "hint"),
    [
        (1.0, None),
        (1e-3, "is it measured in m?"),
        (1 / 25.4, "is it measured in inch?"),
        (0.1, "is it measured in cm?"),
    ],
)
def test_a_surface_that_is_not_where_the_holes_are(
    tmp_path: Path, factor: float, hint: str | None
) -> None:
    """A panel of 4 m by 2 m that begins 40 m from the origin, and a hole in it."""
    low, high = np.array([40_000.0, 1000, 0]) * factor, np.array([44_000.0, 3000, 50]) * factor
    text = """drill 1
program P
part p { up +Z  normals into  surface "body.obj" mm }
region r { posture x toward +X  points m { P1 (42, 2, 0) normal (0, 0, -1) } }
"""
    (tmp_path / "body.obj").write_text(obj(tuple(low), tuple(high)))
    _, report = resolved(tmp_path, text)
    assert [(d.code, d.hint) for d in report.diagnostics] == ([("W135", hint)] if hint else [])


# ── files that are refused ───────────────────────────────────────────────────────────────────────

FIXTURE = 'fixture f {{ mesh "{}" mm }}\n'


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("b.stl", b"", "its length is not that of a binary STL file, and it is no text STL"),
        ("b.stl", stl(LOW, HIGH)[:-1], "its length is not that of a binary STL file"),
        ("b.obj", b"v 0 0 0\n", "it has no triangles"),
        ("b.obj", b"v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n", "a coordinate is not a number"),
        ("b.ply", b"ply\nend_header\n", "PLY"),
        ("b.glb", b"glTF", "GLB"),
        ("b.3mf", b"PK", "3MF"),
        ("b.3mf", threemf(b"<model"), "3MF"),
        ("b.3mf", threemf(b'<!DOCTYPE m [<!ENTITY a "b">]><model>&a;</model>'), ""),
    ],
)
def test_broken_files(tmp_path: Path, name: str, content: bytes, reason: str) -> None:
    _, report = attempt(tmp_path, FIXTURE.format(name), content, name)
    found = only(report)
    assert found.code == "E131"
    assert found.message.startswith(f'"{name}" cannot be used: ')
    assert reason in found.message


def test_an_archive_that_would_unpack_to_too_much(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from drillc.geometry import threemf as reader

    monkeypatch.setattr(reader, "MOST_XML_BYTES", 1_000_000)
    bomb = threemf(b" " * 1_000_001)
    assert len(bomb) < 10_000
    _, report = attempt(tmp_path, FIXTURE.format("b.3mf"), bomb, "b.3mf")
    assert only(report).code == "E131"
    assert "1,000,0" in only(report).message


def test_too_many_triangles(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_files, "MAX_MESH_TRIANGLES", 11)
    _, report = attempt(tmp_path, FIXTURE.format("body.obj"), obj(LOW, HIGH))
    assert only(report).code == "E133"
    assert "has 12 triangles; the limit (MAX_MESH_TRIANGLES) is 11" in only(report).message
    assert mesh_files.MAX_MESH_TRIANGLES <= mesh_error.MOST_TRIANGLES
    assert loading.MESH_LIMIT.size <= mesh_error.MOST_BYTES


def test_too_many_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Refused before it is read."""
    monkeypatch.setattr(mesh_files, "MESH_LIMIT", Limit("MAX_MESH_BYTES", 100))
    monkeypatch.setattr(Path, "read_bytes", lambda path: pytest.fail("it was read"))
    (tmp_path / "body.obj").write_text(obj(LOW, HIGH))
    report = Report()
    loader = loading.Loader(tmp_path, report)
    span = only_span()
    assert loader.read_binary(tmp_path / "body.obj", mesh_files.MESH_LIMIT, span) is None
    assert only(report).code == "E122"
    assert "the limit (MAX_MESH_BYTES) is 100" in only(report).message


def only_span() -> loading.Span:
    from language.texts import in_memory

    return in_memory("x").span(0, 1)


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("../body.stl", "E125"),
        ("/etc/body.stl", "E124"),
        ("C:\\body.stl", "E124"),
        ("folder.stl", "E121"),
        ("none.stl", "E120"),
        ("out.stl", "E125"),
    ],
)
def test_paths_stay_inside(tmp_path: Path, name: str, code: str) -> None:
    (tmp_path / "body.stl").write_bytes(stl(LOW, HIGH))
    inner = tmp_path / "inner"
    (inner / "folder.stl").mkdir(parents=True)
    (inner / "out.stl").symlink_to("../body.stl")
    job, report = attempt(inner, FIXTURE.format(name))
    assert job is None
    assert codes(report) == [code]


def test_a_mesh_with_a_companion_does_not_read_it(tmp_path: Path) -> None:
    """An OBJ may name a file of materials; a spec's root is no matter of a mesh."""
    (tmp_path / "b.mtl").write_text("newmtl m\nmap_Kd /etc/passwd\n")
    content = "mtllib b.mtl\nmtllib /etc/passwd\nusemtl m\n" + obj(LOW, HIGH)
    job = fine(tmp_path, FIXTURE.format("body.obj"), content)
    assert [source.key for source in job.inputs] == ["spec.drill", "body.obj"]


# ── the manifest, and the same bytes ─────────────────────────────────────────────────────────────


def test_meshes_are_in_the_manifest(tmp_path: Path) -> None:
    import hashlib

    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "jig.stl").write_bytes(stl(LOW, HIGH))
    tool = "tool t { number 1  tcp (0, 0, 9) mm }\n"
    spec = HEAD + PART + tool + 'fixture f { mesh "meshes/jig.stl" mm }\n' + REGION + "emit krl\n"
    (tmp_path / "spec.drill").write_text(spec)
    assert main(["compile", str(tmp_path / "spec.drill"), "-o", str(tmp_path / "out")]) == 0
    inputs = json.loads((tmp_path / "out" / "manifest.json").read_text())["inputs"]
    assert inputs == {
        "meshes/jig.stl": hashlib.sha256(stl(LOW, HIGH)).hexdigest(),
        "spec.drill": hashlib.sha256(spec.encode()).hexdigest(),
    }


def test_every_kind_that_is_read_is_named(tmp_path: Path) -> None:
    _, report = attempt(tmp_path, FIXTURE.format("b.step"), b"", "b.step")
    assert only(report).code == "E130"
    assert all(f".{kind}" in only(report).message for kind in meshes.KINDS)

"""Mesh files: read from memory, within bounds, made tidy; and what there is to say about a mesh."""

from __future__ import annotations

import io
import re
import struct
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from .glb import read_glb
from .mesh_error import MOST_BYTES, MOST_TRIANGLES, MeshError, check_triangles
from .shapes import Floats, Mesh
from .threemf import read_3mf
from .topology import closed, components, volume_mm3, wound
from .winding import Windings

Ints = NDArray[np.int64]
Piece = tuple[Floats, Ints]  # vertices (v, 3), faces (f, 3)
Kind = Literal["stl", "obj", "ply", "glb", "3mf"]
KINDS: tuple[Kind, ...] = get_args(Kind)

MOST_VERTICES = 4 * MOST_TRIANGLES
FARTHEST = 1e9  # coordinates beyond this, in any unit, are no part of a machine
MERGED = 1e-8  # vertices nearer than about this share of the extent are one


@dataclass(frozen=True, eq=False)
class MeshFacts:
    """A mesh in figures. `watertight`: all of its pieces are closed."""

    triangles: int
    pieces: int
    open_pieces: int
    low_mm: Floats  # (3,)
    high_mm: Floats  # (3,)
    volume_mm3: float  # of the closed pieces, less their cavities
    area_mm2: float

    @property
    def watertight(self) -> bool:
        return self.open_pieces == 0

    @property
    def extent_mm(self) -> Floats:
        """The sizes (3,) of the box around it."""
        return self.high_mm - self.low_mm


def read_mesh(data: bytes, kind: Kind) -> Mesh:
    """The mesh in a file, in the file's unit and axes. Raises MeshError, and nothing else.

    Scenes are flattened. Vertices at one place are merged, triangles without three corners or
    that are there twice are left out, the others keep the file's order. Neighbours are wound alike;
    a closed piece that is in no other has its faces outward.
    """
    if len(data) > MOST_BYTES:
        raise MeshError(f"it has {len(data):,} bytes; at most {MOST_BYTES:,} are read")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return _outward(_tidy(_pieces(data, kind)))
    except MeshError:
        raise
    except MemoryError:
        raise MeshError("it takes more memory than there is") from None
    except Exception as reason:
        raise MeshError(f"it is no valid {kind.upper()} file ({_said(reason)})") from reason


def scaled(mesh: Mesh, factor: float) -> Mesh:
    """The mesh with all lengths multiplied, as from a file's unit to mm."""
    return Mesh(mesh.vertices_mm * factor, mesh.faces)


def inspect_mesh(mesh: Mesh) -> MeshFacts:
    """What there is to say about a mesh that has at least one triangle."""
    piece = components(mesh.faces)
    shut = closed(mesh.faces, piece)
    a, b, c = mesh.vertices_mm[mesh.faces].swapaxes(0, 1)
    return MeshFacts(
        triangles=len(mesh.faces),
        pieces=len(shut),
        open_pieces=int(np.count_nonzero(~shut)),
        low_mm=mesh.vertices_mm.min(axis=0),
        high_mm=mesh.vertices_mm.max(axis=0),
        volume_mm3=float(volume_mm3(mesh, piece)[shut].sum()),
        area_mm2=float(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()),
    )


def _pieces(data: bytes, kind: Kind) -> Iterable[Piece]:
    match kind:
        case "glb":
            return read_glb(data)
        case "3mf":
            return read_3mf(data)
        case "stl":
            _check_stl(data)
        case "obj":
            check_triangles(len(re.findall(rb"^[ \t]*f[ \t]", data, re.MULTILINE)))
        case "ply":
            _check_ply(data)
    return _by_trimesh(data, kind)


def _by_trimesh(data: bytes, kind: Kind) -> Iterator[Piece]:
    from trimesh.exchange.obj import load_obj  # slow to import, and most specs have no mesh
    from trimesh.exchange.ply import load_ply
    from trimesh.exchange.stl import load_stl

    # Without a resolver, no material or texture can be followed.
    file = io.BytesIO(data)
    match kind:
        case "stl":
            made = load_stl(file)
        case "ply":
            made = load_ply(file, resolver=None)
        case _:
            made = load_obj(file, resolver=None, skip_materials=True)
    for each in made.get("geometry", {"": made}).values():
        if each.get("faces") is not None and len(each["faces"]):
            yield np.asarray(each["vertices"], dtype=np.float64), np.asarray(each["faces"])


def _check_stl(data: bytes) -> None:
    if len(data) >= 84:
        (count,) = struct.unpack_from("<I", data, 80)
        if len(data) == 84 + 50 * count:
            check_triangles(count)
            return
    if not data.lstrip()[:5].lower() == b"solid":
        raise MeshError("its length is not that of a binary STL file, and it is no text STL")
    check_triangles(data.count(b"endfacet"))


def _check_ply(data: bytes) -> None:
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise MeshError("it has no PLY header")
    counts = dict(re.findall(rb"element\s+(\w+)\s+(\d{1,18})", data[:end]))
    check_triangles(int(counts.get(b"face", b"0")))
    if sum(map(int, counts.values())) > len(data):
        raise MeshError("its header names more elements than it has bytes")


def _said(reason: Exception) -> str:
    """A reader's complaint in a few words, on one line."""
    words = " ".join(str(reason).split())
    words = "".join(c if c.isprintable() else "?" for c in words)
    return f"{type(reason).__name__}: {words[:80]}" if words else type(reason).__name__


def _tidy(pieces: Iterable[Piece]) -> Mesh:
    """All pieces as one mesh: vertices merged in order of use, useless faces left out."""
    vertices, faces, start = [], [], 0
    for points, corners in pieces:
        if corners.min() < 0 or corners.max() >= len(points):
            raise MeshError("a triangle names a vertex that is not there")
        vertices.append(points)
        faces.append(corners.astype(np.int64) + start)
        start += len(points)
        if start > MOST_VERTICES:
            raise MeshError(f"it has more than {MOST_VERTICES:,} vertices, placed ones counted")
    if not faces:
        raise MeshError("it has no triangles")
    points, corners = np.concatenate(vertices), np.concatenate(faces)
    check_triangles(len(corners))
    if not (np.abs(points) <= FARTHEST).all():
        raise MeshError("a coordinate is not a number, or beyond 1e9")
    grid = np.rint(points / max(float(np.ptp(points, axis=0).max()) * MERGED, 1e-300))
    corners = _numbers(grid)[corners]
    # The corners in one of their three orders, the lowest first, tell a face from another.
    first = np.argmin(corners, axis=1)[:, None]
    corners = np.take_along_axis(corners, (first + np.arange(3)) % 3, axis=1)
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    same = _numbers(corners)
    corners = corners[same == np.arange(len(same))]
    if not len(corners):
        raise MeshError("all its triangles are without area")
    used, renumbered = np.unique(corners, return_inverse=True)
    return Mesh(points[used], renumbered.reshape(-1, 3).astype(np.int64))


def _numbers(rows: Floats | Ints) -> Ints:
    """For each row (n, 3), the number of the first row that is equal to it."""
    order = np.lexsort(rows.T)
    ranked = rows[order]
    new = np.ones(len(rows), dtype=np.bool_)
    new[1:] = (ranked[1:] != ranked[:-1]).any(axis=1)
    numbers = np.empty(len(rows), dtype=np.int64)
    numbers[order] = order[new][np.cumsum(new) - 1]  # lexsort is stable: first means lowest
    return numbers


def _outward(mesh: Mesh) -> Mesh:
    """The mesh wound consistently; closed pieces outward unless they are cavities of others."""
    faces = wound(mesh.faces)
    piece = components(faces)
    shut = closed(faces, piece)
    volume = volume_mm3(Mesh(mesh.vertices_mm, faces), piece)
    if volume[shut].sum() < 0.0:  # all of the file is inside out
        faces = np.where(shut[piece][:, None], faces[:, ::-1], faces)
        volume = np.where(shut, -volume, volume)
    solid = Windings(Mesh(mesh.vertices_mm, faces[(shut & (volume > 0.0))[piece]]))
    for number in np.flatnonzero(shut & (volume < 0.0)):
        own = piece == number
        if solid.number(mesh.vertices_mm[faces[own][:1, 0]])[0] <= 0:
            faces[own] = faces[own][:, ::-1]
    return Mesh(mesh.vertices_mm, faces)

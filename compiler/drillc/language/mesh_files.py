"""Mesh files that a spec names: read inside bounds, scaled to mm, placed, and questioned.

The bytes are parsed by `geometry.meshes`; here their faults become located diagnostics.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePosixPath

import numpy as np

from drillc.geometry.mesh_error import MeshError
from drillc.geometry.meshes import KINDS, Kind, inspect_mesh, read_mesh, scaled
from drillc.geometry.shapes import Mesh
from drillc.language.ast import Placement, Text, Value, Word
from drillc.language.columns import MAX_LENGTH_MM
from drillc.language.diagnostics import Report
from drillc.language.fields import of_type, pose
from drillc.language.job import Floats, Surface
from drillc.language.loading import MESH_LIMIT, Loader
from drillc.language.units import UNITS, said

#: Triangles of one mesh.
MAX_MESH_TRIANGLES = 2_000_000
#: A mesh whose greatest extent is outside this range is questioned: its unit may be another.
LIKELY_MM = (1.0, 100_000.0)
#: Units that a mesh may have been meant in, the usual ones first.
_LIKELY_UNITS = ("mm", "m", "inch", "cm", "um")


@dataclass(frozen=True)
class MeshFile:
    """What a spec says of a mesh: its file, its unit and where it stands (both may be missing)."""

    path: Text
    unit: Value
    at: Value


def read_solid(file: MeshFile, loader: Loader, report: Report) -> Mesh | None:
    """A closed mesh, in mm and placed; None after an error."""
    mesh = read_surface(file, loader, report)
    if mesh is None:
        return None
    facts = inspect_mesh(mesh)
    if not facts.watertight:
        report.error(
            "E134",
            f'"{file.path.text}" is not closed ({facts.open_pieces:,} of {facts.pieces:,} pieces '
            "are open), so that what lies inside it cannot be told from what lies outside",
            file.path.span,
            hint="close its holes in the CAD system, or describe it by boxes and cylinders",
        )
        return None
    return mesh


def read_surface(file: MeshFile, loader: Loader, report: Report) -> Mesh | None:
    """A mesh, open or closed, in mm and placed; None after an error."""
    unit = _unit(file, report)
    where = None if file.at is None else pose(of_type(file.at, Placement), "the mesh", report)
    kind = _kind(file.path, report)
    path = loader.resolve(file.path, file.path.span.source)
    if path is None or kind is None:
        return None
    data = loader.read_binary(path, MESH_LIMIT, file.path.span)
    if data is None or unit is None:
        return None
    try:
        mesh = read_mesh(data, kind)
    except MeshError as error:
        report.error(
            "E131",
            f'"{file.path.text}" cannot be used: {error}',
            file.path.span,
            hint="export it anew; binary STL is the plainest",
        )
        return None
    mesh = scaled(mesh, float(UNITS[unit].factor))
    if not _within_bounds(mesh, unit, file.path, report):
        return None
    _question_extent(mesh, unit, file.path, report)
    if where is None:
        return mesh
    if np.isnan(where.translation_mm).any():
        return None  # said already
    return Mesh(mesh.vertices_mm @ where.rotation.T + where.translation_mm, mesh.faces)


def _unit(file: MeshFile, report: Report) -> str | None:
    if not isinstance(file.unit, Word):
        report.error(
            "E203",
            f'"{file.path.text}" has no unit; what a mesh is measured in is {said("length")}, and '
            "no file says it reliably",
            file.path.span,
            hint=f'write the unit: "{file.path.text}" mm',
        )
        return None
    dimension = UNITS[file.unit.text].dimension
    if dimension == "length":
        return file.unit.text
    report.error(
        "E204",
        f"what a mesh is measured in is {said('length')}, not {file.unit.text}, {said(dimension)}",
        file.unit.span,
        hint=f'"{file.path.text}" mm',
    )
    return None


def _kind(path: Text, report: Report) -> Kind | None:
    """What a file's name says that it is, such as "stl"."""
    ending = PurePosixPath(path.text).suffix.lower().removeprefix(".")
    kind = next((known for known in KINDS if known == ending), None)
    if kind is not None:
        return kind
    report.error(
        "E130",
        f'"{path.text}" does not end like a mesh file: {", ".join(f".{k}" for k in KINDS)}',
        path.span,
        hint="export it as one of these; binary STL is the plainest",
    )
    return None


def _within_bounds(mesh: Mesh, unit: str, path: Text, report: Report) -> bool:
    """Whether a mesh is not so huge that nothing could come of it."""
    triangles, farthest = len(mesh.faces), float(np.abs(mesh.vertices_mm).max())
    if triangles > MAX_MESH_TRIANGLES:
        report.error(
            "E133",
            f'"{path.text}" has {triangles:,} triangles; the limit (MAX_MESH_TRIANGLES) is '
            f"{MAX_MESH_TRIANGLES:,}",
            path.span,
            hint="export it more coarsely; 0.1 mm of deviation is plenty",
        )
    if farthest > MAX_LENGTH_MM:
        report.error(
            "E205",
            f'"{path.text}", measured in {unit}, reaches to {_mm(farthest)}, beyond anything a '
            f"machine reaches; the limit is {_mm(MAX_LENGTH_MM)}",
            path.span,
            hint="check its unit",
        )
    return triangles <= MAX_MESH_TRIANGLES and farthest <= MAX_LENGTH_MM


# ── a mesh that looks a thousand times off ───────────────────────────────────────────────────────


def _question_extent(mesh: Mesh, unit: str, path: Text, report: Report) -> None:
    extent = float(np.ptp(mesh.vertices_mm, axis=0).max())
    if LIKELY_MM[0] <= extent <= LIKELY_MM[1]:
        return
    likely = next((u for u in _others(unit) if _likely(extent * _ratio(u, unit))), None)
    report.warn(
        "W135",
        f'"{path.text}" is {_mm(extent)} in size when it is measured in {unit}',
        path.span,
        hint=f"is it measured in {likely}?" if likely else "check its unit",
    )


def question_place(surface: Surface, path: Text, unit: str, holes: Floats, report: Report) -> None:
    """Warn where the surface is farther from every hole (n, 3) in mm than it is large: its unit, or
    the holes', may be another."""
    low, high = surface.mesh.vertices_mm.min(axis=0), surface.mesh.vertices_mm.max(axis=0)
    nearest, size = _nearest(low, high, holes)
    if not nearest > size:
        return
    factors = ((u, _ratio(u, unit)) for u in _others(unit))
    scaled = ((u, _nearest(low * f, high * f, holes)) for u, f in factors)
    likely = next((u for u, (gap, extent) in scaled if gap < extent / 10), None)
    report.warn(
        "W135",
        f'"{path.text}", measured in {unit}, is {_mm(size)} in size and at least {_mm(nearest)} '
        "from every hole",
        path.span,
        hint=f"is it measured in {likely}?" if likely else "check its unit, and where it stands",
    )


def _nearest(low: Floats, high: Floats, holes: Floats) -> tuple[float, float]:
    """How far the hole nearest to a box is from it, and the box's diagonal."""
    gaps = np.linalg.norm(np.maximum(np.maximum(low - holes, holes - high), 0.0), axis=1)
    return float(gaps.min(initial=np.inf)), float(np.linalg.norm(high - low))


def _likely(extent_mm: float) -> bool:
    return LIKELY_MM[0] <= extent_mm <= LIKELY_MM[1]


def _others(unit: str) -> list[str]:
    return [other for other in _LIKELY_UNITS if other != unit]


def _mm(length: float) -> str:
    return f"{length:,.0f} mm" if length >= 1000 else f"{length:.4g} mm"


def _ratio(unit: str, per: str) -> float:
    return float(UNITS[unit].factor / UNITS[per].factor)

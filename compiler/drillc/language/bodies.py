"""Resolving solids of fixtures, tools and links: box, sphere, capsule, cylinder and mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drillc.geometry.cover import convex_cover
from drillc.geometry.shapes import Mesh, RoundedHull, box, capsule, cylinder, placed, sphere
from drillc.language.ast import Item, Numbers, Placement, Statement, Text, Value, Word
from drillc.language.diagnostics import Report
from drillc.language.fields import in_unit, lengths, measure, named, of_type, pose
from drillc.language.job import Fixture, Floats, Solid
from drillc.language.loading import Loader
from drillc.language.mesh_files import MeshFile, read_solid
from drillc.language.units import UNITS, said


def resolve_fixture(statement: Statement, loader: Loader, report: Report) -> Fixture:
    """`fixture NAME { box (…) (…) mm … }`."""
    solids = []
    for item in statement.items:
        shape = _shape(item, loader, report)
        if shape is not None:
            solids.append(Solid(shape, item.span))
    if not statement.items:
        report.error(
            "E202",
            f"fixture {statement.name.text} has no solid",
            statement.name.span,
            hint="box (400, 1500, 500) (700, 1900, 650) mm",
        )
    return Fixture(named(statement.name), tuple(solids))


def convex_pieces(items: Sequence[Item], loader: Loader, report: Report) -> tuple[RoundedHull, ...]:
    """The solids of a tool's body or an arm's link; a mesh is covered by convex pieces."""
    pieces: list[RoundedHull] = []
    for item in items:
        shape = _shape(item, loader, report)
        if isinstance(shape, Mesh):
            pieces += convex_cover(shape)
        elif shape is not None:
            pieces.append(shape)
    return tuple(pieces)


def _shape(item: Item, loader: Loader, report: Report) -> RoundedHull | Mesh | None:
    """One solid; None after an error."""
    before = len(report.diagnostics)
    match item.key.text:
        case "box":
            shape = _box(item, report)
        case "sphere":
            shape = _sphere(item, report)
        case "mesh":
            path, unit, at = item.values
            return read_solid(MeshFile(of_type(path, Text), unit, at), loader, report)
        case _:
            shape = _along_a_line(item, report)
    return shape if len(report.diagnostics) == before else None


def _box(item: Item, report: Report) -> RoundedHull | None:
    first, second, unit, at = item.values
    corners = _two_points(item, "corner", (first, second), unit, report)
    where = None if at is None else pose(of_type(at, Placement), "the box", report)
    if corners is None:
        return None
    low, high = np.minimum(*corners), np.maximum(*corners)
    if np.any(high - low <= 0):
        axes = " and ".join(a for a, w in zip("xyz", high - low, strict=True) if w <= 0)
        report.error(
            "E222",
            f"this box has no volume: its corners share {axes}",
            item.span,
            hint="give two opposite corners",
        )
        return None
    solid = box(low, high)
    return solid if where is None else placed(solid, where.rotation, where.translation_mm)


def _sphere(item: Item, report: Report) -> RoundedHull:
    centre, radius = item.values
    at = lengths(of_type(centre, Numbers), "the sphere's centre", report)
    return sphere(at, measure(radius, "length", "the sphere's radius", report, above=0))


def _along_a_line(item: Item, report: Report) -> RoundedHull | None:
    """A capsule (round ends) or a cylinder (flat ends) between two points."""
    first, second, unit, radius = item.values
    ends = _two_points(item, "end", (first, second), unit, report)
    what = item.key.text
    radius_mm = measure(radius, "length", f"the {what}'s radius", report, above=0)
    if ends is None or np.isnan(radius_mm):
        return None
    if what == "capsule":
        return capsule(*ends, radius_mm)
    if np.array_equal(*ends):
        report.error(
            "E222",
            "this cylinder has no volume: its ends are one point",
            item.span,
            hint="give the centres of its two ends",
        )
        return None
    return cylinder(*ends, radius_mm)


def _two_points(
    item: Item, part: str, points: tuple[Value, Value], unit: Value, report: Report
) -> tuple[Floats, Floats] | None:
    """Two points with one unit behind them, in mm; None after an error."""
    what = item.key.text
    if not isinstance(unit, Word):
        report.error(
            "E203",
            f"the {what}'s {part}s have no unit; they are {said('length')}",
            item.span,
            hint=f"write the unit behind both: {what} (…) (…) mm",
        )
        return None
    first = lengths(in_unit(points[0], unit), f"the {what}'s {part}", report)
    # The unit belongs to both; that it is wrong is said once.
    if UNITS[unit.text].dimension != "length":
        return None
    second = lengths(in_unit(points[1], unit), f"the {what}'s {part}", report)
    return None if np.isnan(first).any() or np.isnan(second).any() else (first, second)

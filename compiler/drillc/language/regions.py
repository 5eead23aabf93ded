"""Resolving regions: their holes (inline, or selected from tables), posture rule and process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from drillc.language.ast import PointBlock, Select, Statement, Word
from drillc.language.cover import Selection, check_cover, rows_by_region
from drillc.language.diagnostics import Report
from drillc.language.fields import Fields, lookup, named, of_type
from drillc.language.headings import resolve_avoids, resolve_posture, resolve_turning
from drillc.language.holes import check_normals, check_raw, check_table, gather
from drillc.language.job import Arm, Fixture, HoleTable, Part, Process, Region
from drillc.language.operations import VISIT
from drillc.language.points import RawHoles, read_points
from drillc.language.selection import Mask
from drillc.language.source import Source
from drillc.language.tables import Table
from drillc.language.units import UNITS, said


@dataclass(frozen=True, eq=False)
class Around:
    """What regions refer to, beside their holes. `processes`: by name, with their index."""

    part: Part
    fixtures: Sequence[Fixture]
    arm: Arm | None
    processes: Mapping[str, tuple[int, Process]]


@dataclass(frozen=True, eq=False)
class Resolved:
    """The regions in order of the spec, and their holes as one table.

    `used` names the processes and tables that they use. `complete` is False when some holes could
    not be read or selected, which has been reported.
    """

    regions: tuple[Region, ...]
    holes: HoleTable
    used: frozenset[str]
    complete: bool


def resolve_regions(
    statements: Sequence[Statement],
    skips: Sequence[Statement],
    tables: Mapping[str, Table | None],
    around: Around,
    report: Report,
) -> Resolved:
    """Resolve the regions and check their holes. Every hole of a table belongs to exactly one
    region, unless a `skip` leaves it out. `tables`: None stands for one that could not be read."""
    used: set[str] = set()
    part = around.part
    all_fields = [Fields(s, report, repeated=("points", "avoid")) for s in statements]
    selects = {
        fields.statement.name.text: of_type(item.values[0], Select)
        for fields in all_fields
        if (item := fields.get("select"))
    }
    skipping = [of_type(statement.values[0], Select) for statement in skips]
    used.update(chosen.table.text for chosen in (*selects.values(), *skipping))
    selection = Selection(selects, tables, {s.name.text: True for s in statements})
    masks = rows_by_region(selection, report)
    check_cover(selection, masks, skips, report)
    for name, table in tables.items():
        takers = [masks[region] for region, _ in selection.from_table(name) if region in masks]
        if table is not None:
            _check_rows(table, takers, part, report)
    parts: list[tuple[int, Source, RawHoles]] = []
    regions: list[Region] = []
    start, complete = 0, True
    for index, (statement, fields) in enumerate(zip(statements, all_fields, strict=True)):
        name, before = statement.name.text, len(report.diagnostics)
        pieces = _inline(fields, part, report)
        unread = len(report.diagnostics) > before or (name in selects and name not in masks)
        complete = complete and not unread
        for source, raw in pieces:
            _check(raw, source, part, report)
        selected = tables.get(selects[name].table.text) if name in masks else None
        if selected is not None:
            pieces.append((selected.source, _rows(selected.holes, masks[name])))
        count = sum(len(raw.ids) for _, raw in pieces)
        if count == 0 and not unread:
            report.error(
                "E330",
                f"region {name} has no holes",
                statement.name.span,
                hint="give it points, or widen its select",
            )
        parts += [(index, source, raw) for source, raw in pieces]
        avoids = resolve_avoids(fields.every("avoid"), part, around.fixtures, report)
        regions.append(
            Region(
                named(statement.name),
                start,
                start + count,
                _process(fields, around.processes, used, report),
                resolve_posture(fields.get("posture"), report),
                avoids,
                resolve_turning(fields.get("turning"), bool(fields.every("avoid")), report),
                _station(fields, around.arm, report),
            )
        )
        start += count
    holes = gather(parts, part.normals_into)
    check_table(holes, regions, report)
    return Resolved(tuple(regions), holes, frozenset(used), complete)


def _inline(fields: Fields, part: Part, report: Report) -> list[tuple[Source, RawHoles]]:
    pieces = []
    for item in fields.every("points"):
        block = of_type(item.values[0], PointBlock)
        if block.unit is None:
            report.error(
                "E203",
                "these points have no unit; positions are a length (mm, m)",
                block.span,
                hint="write the unit before the brace: points mm { … }",
            )
        elif UNITS[block.unit.text].dimension != "length":
            report.error(
                "E204",
                f"positions are a length (mm, m), but {block.unit.text} is "
                f"{said(UNITS[block.unit.text].dimension)}",
                block.unit.span,
                hint="points mm { … }",
            )
        else:
            normals = not part.normals_from_surface
            raw = read_points(block, UNITS[block.unit.text], report, normals=normals)
            pieces.append((block.source, raw))
    return pieces


def _process(
    fields: Fields, processes: Mapping[str, tuple[int, Process]], used: set[str], report: Report
) -> int:
    item = fields.get("process")
    if item is None:
        return processes[VISIT.name][0]
    word = of_type(item.values[0], Word)
    used.add(word.text)
    declared = {name: entry for name, entry in processes.items() if entry[1].span is not None}
    found = lookup(word, declared, "process", report)
    return processes[VISIT.name][0] if found is None else found[0]


def _station(fields: Fields, arm: Arm | None, report: Report) -> int:
    """The index of the region's station among the arm's."""
    item = fields.get("station")
    stations = () if arm is None else arm.stations
    names = [station.name.text for station in stations if station.name is not None]
    if item is not None:
        word = of_type(item.values[0], Word)
        # Without an arm that is another mistake.
        found = arm is None or lookup(word, dict.fromkeys(names, True), "station", report)
        return names.index(word.text) if found and word.text in names else 0
    if len(names) > 1:
        report.error(
            "E262",
            f"region {fields.statement.name.text} does not say from which station it is made",
            fields.statement.name.span,
            hint=f"station {names[0]}; there are {', '.join(names)}",
        )
    return 0


def _rows(raw: RawHoles, mask: Mask) -> RawHoles:
    return RawHoles(
        raw.ids[mask],
        raw.position_mm[mask],
        raw.normal[mask],
        raw.diameter_mm[mask],
        raw.stack_mm[mask],
        raw.line[mask],
        raw.column[mask],
    )


def _check_rows(table: Table, takers: Sequence[Mask], part: Part, report: Report) -> None:
    """Check the rows that regions take; what is left out on purpose may be anything."""
    holes = _rows(table.holes, reduce(np.logical_or, takers)) if takers else table.holes
    _check(holes, table.source, part, report)


def _check(raw: RawHoles, source: Source, part: Part, report: Report) -> None:
    check_raw(raw, source, report)
    if not part.normals_from_surface:
        check_normals(raw, source, part.unit_tolerance, report)

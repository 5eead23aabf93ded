"""Resolving regions: their holes (inline, or selected from tables), posture rule and process."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce

import numpy as np

from drillc.language.ast import Item, PointBlock, Rule, Select, Statement, Text, Value, Word
from drillc.language.cover import Selection, check_cover, rows_by_region
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import Fields, lookup, measure, of_type, unit_vector
from drillc.language.holes import check_normals, check_raw, check_table, gather
from drillc.language.job import HoleTable, Part, PostureRule, Process, Region
from drillc.language.loading import TABLE_LIMIT, Loader
from drillc.language.machine import named
from drillc.language.operations import VISIT
from drillc.language.points import RawHoles, read_points
from drillc.language.selection import Mask
from drillc.language.source import Source
from drillc.language.tables import KEYS, LENGTHS, REQUIRED, Table, TableSpec, read_table
from drillc.language.units import UNITS, Unit, said

#: A normal nearer than this to the singular direction leaves the rule undecided, unless a rule says
#: otherwise (`cone`): below it, a normal's own tolerance turns the heading by degrees.
DEFAULT_CONE_RAD = math.radians(0.5)


def resolve_table(statement: Statement, loader: Loader, report: Report) -> Table | None:
    """`holes NAME from "FILE" { delimiter …  units …  columns { … } }`, read and checked."""
    fields = Fields(statement, report)
    path_text = of_type(statement.values[0], Text)
    columns = _columns(fields, report)
    delimiter = _delimiter(fields.get("delimiter"), report)
    unit = _unit(fields, report)
    own_units = _own_units(fields.get("columns"), report)
    path = loader.resolve(path_text, statement.span.source)
    source = None if path is None else loader.read(path, TABLE_LIMIT, path_text.span)
    if source is None or columns is None or delimiter is None or unit is None:
        return None
    spec = TableSpec(statement.name, delimiter, unit, own_units, columns, path_text)
    raw = read_table(spec, source, report)
    return None if raw is None else Table(statement.name, source, raw)


def _delimiter(item: Item | None, report: Report) -> str | None:
    if item is None:
        return ","
    text = of_type(item.values[0], Text).text
    delimiter = "\t" if text == "\\t" else text
    if len(delimiter) == 1 and not delimiter.isalnum() and delimiter not in ".+-\"'":
        return delimiter
    report.error(
        "E243",
        f'the delimiter is "{text}"; it must be one character that no number contains',
        item.span,
        hint='delimiter ";", "," or "\\t"',
    )
    return None


def _own_units(item: Item | None, report: Report) -> dict[str, Unit]:
    """Units of the columns that state one themselves: `diameter DIA mm` in a table in metres."""
    units: dict[str, Unit] = {}
    for entry in item.items if item else ():
        key, word = entry.key.text, entry.values[1]
        if not isinstance(word, Word):
            continue
        unit = UNITS[word.text]
        if key in LENGTHS and unit.dimension == "length":
            units[key] = unit
            continue
        what = said("length") if key in LENGTHS else "a column without a unit"
        report.error(
            "E204",
            f"{key} is {what}, but {word.text} is {said(unit.dimension)}",
            word.span,
            hint=f"{key} {_shown(entry.values[0])} mm" if key in LENGTHS else "leave the unit out",
        )
    return units


def _shown(title: Value) -> str:
    return f'"{title.text}"' if isinstance(title, Text) else of_type(title, Word).text


def _unit(fields: Fields, report: Report) -> Unit | None:
    item = fields.need("units", "units mm: what the table's positions are measured in")
    if item is None:
        return None
    word = of_type(item.values[0], Word)
    unit = UNITS[word.text]
    if unit.dimension == "length":
        return unit
    report.error(
        "E204",
        f"a table's units are {said('length')}, not {word.text}, {said(unit.dimension)}",
        word.span,
        hint="units mm",
    )
    return None


def _columns(fields: Fields, report: Report) -> dict[str, Word | Text] | None:
    item = fields.need("columns", "columns { id ID  x X  y Y  z Z  i NX  j NY  k NZ }")
    if item is None:
        return None
    columns: dict[str, Word | Text] = {}
    for entry in item.items:
        key = entry.key.text
        if key not in KEYS:
            lookup(entry.key, dict.fromkeys(KEYS, True), "column", report)
        elif key in columns:
            report.error(
                "E201",
                f'the column "{key}" is given twice',
                entry.key.span,
                labels=[Label(columns[key].span, "first given here")],
                hint="remove one of them",
            )
        else:
            value = entry.values[0]
            title = value if isinstance(value, Text) else of_type(value, Word)
            other = next((k for k, v in columns.items() if v.text == title.text), None)
            if other is not None:
                report.error(
                    "E249",
                    f'{other} and {key} are both read from the column "{title.text}"',
                    title.span,
                    labels=[Label(columns[other].span, f"{other} is read from it")],
                    hint="give each its own column",
                )
            columns[key] = title
    missing = [key for key in REQUIRED if key not in columns]
    if missing:
        report.error(
            "E244",
            f"the columns do not say where to find {', '.join(missing)}",
            item.key.span,
            hint=f"columns {{ … {' '.join(f'{key} TITLE' for key in missing)} }}",
        )
        return None
    return columns


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
    processes: Mapping[str, tuple[int, Process]],
    part: Part,
    report: Report,
) -> Resolved:
    """Resolve the regions and check their holes. Every hole of a table belongs to exactly one
    region, unless a `skip` leaves it out. `tables`: None stands for one that could not be read."""
    used: set[str] = set()
    all_fields = [Fields(_once_per_key(s), report) for s in statements]
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
        pieces = _inline(statement, report)
        unread = len(report.diagnostics) > before or (name in selects and name not in masks)
        complete = complete and not unread
        for source, raw in pieces:
            check_raw(raw, source, report)
            check_normals(raw, source, part.unit_tolerance, report)
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
        regions.append(
            Region(
                named(statement.name),
                start,
                start + count,
                _process(fields, processes, used, report),
                _posture(fields.get("posture"), report),
            )
        )
        start += count
    holes = gather(parts, part.normals_into)
    check_table(holes, regions, report)
    return Resolved(tuple(regions), holes, frozenset(used), complete)


def _once_per_key(statement: Statement) -> Statement:
    """A region may have several points blocks; every other item it gives once."""
    items = tuple(item for item in statement.items if item.key.text != "points")
    return Statement(statement.kind, statement.name, statement.values, items, statement.span)


def _inline(statement: Statement, report: Report) -> list[tuple[Source, RawHoles]]:
    pieces = []
    for item in statement.items:
        if item.key.text != "points":
            continue
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
            raw = read_points(block, UNITS[block.unit.text], report)
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


def _posture(item: Item | None, report: Report) -> PostureRule | None:
    if item is None:
        return None
    rule, fallback = item.values
    second = None if fallback is None else _rule(of_type(fallback, Rule), None, report)
    return _rule(of_type(rule, Rule), second, report)


def _rule(rule: Rule, fallback: PostureRule | None, report: Report) -> PostureRule:
    toward = None if rule.toward is None else unit_vector(rule.toward, "toward", report)
    cone = DEFAULT_CONE_RAD
    if rule.cone is not None:
        cone = measure(rule.cone, "angle", "cone", report, above=0)
        if cone >= math.pi / 2:
            report.error(
                "E206",
                f"cone is {rule.cone.number} {rule.cone.unit}; it must be less than 90 deg, else "
                "the rule decides nothing",
                rule.cone.span,
            )
    return PostureRule(
        "xyz".index(rule.axis.text) if rule.axis.text != "z" else _no_z(rule.axis, report),
        rule.horizontal,
        toward,
        cone,
        fallback,
        rule.span,
    )


def _no_z(axis: Word, report: Report) -> int:
    report.error(
        "E245",
        "the tool's z axis is the feed direction; a rule holds x or y",
        axis.span,
        hint="posture x horizontal toward +X",
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
    check_raw(holes, table.source, report)
    check_normals(holes, table.source, part.unit_tolerance, report)

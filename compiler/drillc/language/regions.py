"""Resolving regions: their holes (inline, or selected from tables), posture rule and process."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from graphlib import CycleError, TopologicalSorter

import numpy as np

from drillc.language.ast import Item, PointBlock, Rule, Select, Statement, Text, Word
from drillc.language.diagnostics import NAMED_ROWS, Label, Report
from drillc.language.fields import Fields, lookup, measure, of_type, unit_vector
from drillc.language.holes import check_normals, check_raw, check_table, gather
from drillc.language.job import HoleTable, Part, PostureRule, Process, Region
from drillc.language.loading import TABLE_LIMIT, Loader
from drillc.language.machine import named
from drillc.language.operations import VISIT
from drillc.language.points import RawHoles, read_points
from drillc.language.selection import Mask, regions_named, select
from drillc.language.source import Source, Span
from drillc.language.tables import KEYS, REQUIRED, TableSpec, read_table
from drillc.language.units import UNITS

#: A normal nearer than this to the singular direction leaves the rule undecided, unless a rule says
#: otherwise (`cone`): below it, a normal's own tolerance turns the heading by degrees.
DEFAULT_CONE_RAD = math.radians(0.5)


@dataclass(frozen=True, eq=False)
class Table:
    """A hole table that was read, and where it was declared."""

    name: Word
    source: Source
    holes: RawHoles


def resolve_table(statement: Statement, loader: Loader, report: Report) -> Table | None:
    """`holes NAME from "FILE" { delimiter …  units …  columns { … } }`, read and checked."""
    fields = Fields(statement, report)
    path_text = of_type(statement.values[0], Text)
    columns = _columns(fields, report)
    unit_item = fields.need("units", "units mm: what the table's positions are measured in")
    delimiter_item = fields.get("delimiter")
    delimiter = "," if delimiter_item is None else of_type(delimiter_item.values[0], Text).text
    delimiter = "\t" if delimiter == "\\t" else delimiter
    if len(delimiter) != 1 or delimiter.isalnum() or delimiter in ".+-\"'":
        report.error(
            "E243",
            f'the delimiter is "{delimiter}"; it must be one character that no number contains',
            delimiter_item.span if delimiter_item else statement.span,
            hint='delimiter ";", "," or "\\t"',
        )
        return None
    path = loader.resolve(path_text, statement.span.source)
    if path is None or unit_item is None or columns is None:
        return None
    unit_word = of_type(unit_item.values[0], Word)
    unit = UNITS[unit_word.text]
    if unit.dimension != "length":
        report.error(
            "E204", f"a table's units are a length (mm, m), not {unit_word.text}", unit_word.span
        )
        return None
    source = loader.read(path, TABLE_LIMIT, path_text.span)
    if source is None:
        return None
    spec = TableSpec(statement.name, delimiter, unit, columns, path_text)
    raw = read_table(spec, source, report)
    return None if raw is None else Table(statement.name, source, raw)


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
            report.error("E201", f'the column "{key}" is given twice', entry.key.span)
        else:
            value = entry.values[0]
            columns[key] = value if isinstance(value, Text) else of_type(value, Word)
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


def resolve_regions(
    statements: Sequence[Statement],
    skips: Sequence[Statement],
    tables: Mapping[str, Table],
    processes: Mapping[str, tuple[int, Process]],
    part: Part,
    report: Report,
) -> tuple[tuple[Region, ...], HoleTable | None, set[str]]:
    """Regions in order of the spec, and their holes as one table.

    Also returns the names of processes and tables that were used. Every hole of a table belongs to
    exactly one region, unless a `skip` leaves it out.
    """
    used: set[str] = set()
    all_fields = [Fields(_once_per_key(s), report) for s in statements]
    selects = _selects(all_fields)
    used.update(chosen.table.text for chosen in selects.values())
    masks = _masks(selects, statements, tables, report)
    skipped = _skipped(skips, selects, masks, statements, tables, used, report)
    _check_cover(selects, masks, skipped, tables, report)
    for table in tables.values():
        _check_rows(table, selects, masks, part, report)
    parts: list[tuple[int, Source, RawHoles]] = []
    regions: list[Region] = []
    start = 0
    for index, (statement, fields) in enumerate(zip(statements, all_fields, strict=True)):
        name, before = statement.name.text, len(report.diagnostics)
        pieces = _inline(statement, report)
        for source, raw in pieces:
            check_raw(raw, source, report)
            check_normals(raw, source, part.unit_tolerance, report)
        if name in masks:
            table = tables[selects[name].table.text]
            pieces.append((table.source, _rows(table.holes, masks[name])))
        count = sum(len(raw.ids) for _, raw in pieces)
        unread = len(report.diagnostics) > before or (name in selects and name not in masks)
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
    if not parts:
        return tuple(regions), None, used
    holes = gather(parts, part.normals_into)
    check_table(holes, regions, report)
    return tuple(regions), holes, used


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
                "these points have no unit",
                block.span,
                hint="write the unit before the brace: points mm { … }",
            )
        elif UNITS[block.unit.text].dimension != "length":
            report.error(
                "E204",
                f"points are measured in a length (mm, m), not {block.unit.text}",
                block.unit.span,
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
    )
    return 0


# ── which rows ───────────────────────────────────────────────────────────────────────────────────


def _selects(all_fields: Sequence[Fields]) -> dict[str, Select]:
    """What each region selects, of those that select."""
    items = {fields.statement.name.text: fields.get("select") for fields in all_fields}
    return {name: of_type(item.values[0], Select) for name, item in items.items() if item}


def _masks(
    selects: Mapping[str, Select],
    statements: Sequence[Statement],
    tables: Mapping[str, Table],
    report: Report,
) -> dict[str, Mask]:
    """The rows of its table that each selecting region takes; regions named in a condition come
    first. A region whose rows cannot be known is left out, after reporting why."""
    masks: dict[str, Mask] = {}
    for chosen in selects.values():
        lookup(chosen.table, tables, "hole table", report)
    needs = {
        name: [word.text for word in regions_named(chosen.condition) if word.text in selects]
        for name, chosen in selects.items()
    }
    try:
        order = list(TopologicalSorter(needs).static_order())
    except CycleError as error:
        _report_circle(error.args[1], selects, report)
        return masks
    names = {s.name.text: True for s in statements}
    for name in order:
        chosen = selects[name]
        table = tables.get(chosen.table.text)
        if table is not None:
            before = len(report.diagnostics)
            members = _members(chosen, selects, masks, names, report)
            rows = select(chosen.condition, table.holes, members, report)
            if len(report.diagnostics) == before:
                masks[name] = rows
    return masks


def _members(
    chosen: Select,
    selects: Mapping[str, Select],
    masks: Mapping[str, Mask],
    names: Mapping[str, bool],
    report: Report,
) -> dict[str, Mask]:
    """The rows of the regions that a condition names, which must select from the same table."""
    members: dict[str, Mask] = {}
    for word in regions_named(chosen.condition):
        if lookup(word, names, "region", report) is None:
            continue
        other = selects.get(word.text)
        if other is None or other.table.text != chosen.table.text:
            report.error(
                "E332",
                f"region {word.text} takes no holes of table {chosen.table.text}",
                word.span,
                hint="name a region that selects from the same table",
            )
        elif word.text in masks:
            members[word.text] = masks[word.text]
    return members


def _report_circle(circle: Sequence[str], selects: Mapping[str, Select], report: Report) -> None:
    """`circle` names regions, each selected by way of the one before it; the first one twice."""
    # Told from the region that is written first, so that the message does not depend on the walk.
    ring = list(circle[:-1])
    first = ring.index(min(ring, key=list(selects).index))
    ring = ring[first:] + ring[:first]
    places = []
    for needed, name in zip(ring, ring[1:] + ring[:1], strict=True):
        words = regions_named(selects[name].condition)
        places.append(next(word for word in words if word.text == needed))
    report.error(
        "E331",
        f"region {ring[0]} is selected by way of itself",
        places[0].span,
        labels=[Label(word.span, "by way of this") for word in places[1:]],
        hint="decide one of these regions without the other",
    )


def _skipped(
    skips: Sequence[Statement],
    selects: Mapping[str, Select],
    masks: Mapping[str, Mask],
    statements: Sequence[Statement],
    tables: Mapping[str, Table],
    used: set[str],
    report: Report,
) -> list[tuple[Statement, Select, Mask | None]]:
    """The rows that each `skip` leaves out; None where its condition is wrong."""
    names = {s.name.text: True for s in statements}
    skipped = []
    for statement in skips:
        chosen = of_type(statement.values[0], Select)
        table = lookup(chosen.table, tables, "hole table", report)
        if table is None:
            continue
        used.add(chosen.table.text)
        before = len(report.diagnostics)
        members = _members(chosen, selects, masks, names, report)
        rows = select(chosen.condition, table.holes, members, report)
        known = len(report.diagnostics) == before
        skipped.append((statement, chosen, rows if known else None))
    return skipped


def _check_rows(
    table: Table,
    selects: Mapping[str, Select],
    masks: Mapping[str, Mask],
    part: Part,
    report: Report,
) -> None:
    """Check the rows that regions take; what is left out on purpose may be anything."""
    takers = [masks[name] for name in masks if selects[name].table.text == table.name.text]
    holes = _rows(table.holes, reduce(np.logical_or, takers)) if takers else table.holes
    check_raw(holes, table.source, report)
    check_normals(holes, table.source, part.unit_tolerance, report)


def _check_cover(
    selects: Mapping[str, Select],
    masks: Mapping[str, Mask],
    skipped: Sequence[tuple[Statement, Select, Mask | None]],
    tables: Mapping[str, Table],
    report: Report,
) -> None:
    """Every hole of a table in one region, or left out on purpose; none in two.

    Says nothing about a table while the rows of one of its regions are not known.
    """
    for name, table in tables.items():
        takers = [
            (f"region {region}", chosen.span, masks.get(region))
            for region, chosen in selects.items()
            if chosen.table.text == name
        ]
        takers += [
            ("a skip", statement.span, rows)
            for statement, chosen, rows in skipped
            if chosen.table.text == name
        ]
        taken = [(who, span, rows) for who, span, rows in takers if rows is not None]
        if takers and len(taken) == len(takers):
            _check_table_cover(table, taken, report)


def _check_table_cover(
    table: Table, taken: Sequence[tuple[str, Span, Mask]], report: Report
) -> None:
    count = np.zeros(len(table.holes.ids), dtype=np.int32)
    for _, _, mask in taken:
        count += mask
    twice = np.flatnonzero(count > 1)
    for row in twice[:NAMED_ROWS].tolist():
        holders = [(name, span) for name, span, mask in taken if mask[row]]
        report.error(
            "E333",
            f"hole {table.holes.ids[row]} is in {' and in '.join(name for name, _ in holders)}",
            _row_span(table, row),
            labels=[Label(span, f"taken by {name}") for name, span in holders],
            hint=f"exclude one from the other: select {table.name.text} not in REGION",
        )
    if len(twice) > NAMED_ROWS:
        report.error(
            "E333",
            f"and {len(twice) - NAMED_ROWS:,} more like this",
            _row_span(table, int(twice[NAMED_ROWS])),
        )
    never = np.flatnonzero(count == 0)
    if len(never):
        some = ", ".join(table.holes.ids[never[:5]].tolist())
        report.error(
            "E334",
            f"{len(never):,} of {len(count):,} holes of table {table.name.text} are in no region: "
            f"{some}{', …' if len(never) > 5 else ''}",
            _row_span(table, int(never[0])),
            labels=[Label(table.name.span, "the table")],
            hint=f"take them into a region, or leave them out: skip {table.name.text} where …",
        )


def _row_span(table: Table, row: int) -> Span:
    return Span(
        table.source,
        int(table.holes.line[row]),
        int(table.holes.column[row]),
        max(1, len(str(table.holes.ids[row]))),
    )


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

"""Which rows of the hole tables the regions take: every row once, or left out on purpose.

The conditions themselves are evaluated by `selection`; here they are put in order, since a region
may be defined by what another one leaves.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

import numpy as np

from drillc.language.ast import Select, Statement
from drillc.language.diagnostics import NAMED_ROWS, Label, Report
from drillc.language.fields import lookup, of_type
from drillc.language.selection import Mask, regions_named, select
from drillc.language.source import Span
from drillc.language.tables import Table


@dataclass(frozen=True)
class Selection:
    """What a spec's regions select, by region, from `tables` (None: declared, but not readable).
    `regions` are all regions' names."""

    selects: Mapping[str, Select]
    tables: Mapping[str, Table | None]
    regions: Mapping[str, bool]

    def from_table(self, table: str) -> list[tuple[str, Select]]:
        """The regions that select from one table, and what."""
        found = self.selects.items()
        return [(name, chosen) for name, chosen in found if chosen.table.text == table]


def rows_by_region(selection: Selection, report: Report) -> dict[str, Mask]:
    """The rows of its table that each selecting region takes.

    A region whose rows cannot be known is left out, after reporting why.
    """
    masks: dict[str, Mask] = {}
    selects = selection.selects
    for chosen in selects.values():
        _check_declared(chosen, selection, report)
    needs = {
        name: [word.text for word in regions_named(chosen.condition) if word.text in selects]
        for name, chosen in selects.items()
    }
    try:
        order = list(TopologicalSorter(needs).static_order())
    except CycleError as error:
        _report_circle(error.args[1], selects, report)
        return masks
    for name in order:
        rows = _rows(selects[name], selection, masks, report)
        if rows is not None:
            masks[name] = rows
    return masks


def check_cover(
    selection: Selection, masks: Mapping[str, Mask], skips: Sequence[Statement], report: Report
) -> None:
    """Report rows that are in two regions, or in none and in no `skip` either.

    Says nothing about a table while the rows of one of its regions are not known.
    """
    skipped = [(statement, of_type(statement.values[0], Select)) for statement in skips]
    for _, chosen in skipped:
        _check_declared(chosen, selection, report)
    for name, table in selection.tables.items():
        takers = [
            (f"region {region}", chosen.span, masks.get(region))
            for region, chosen in selection.from_table(name)
        ]
        takers += [
            ("a skip", statement.span, _rows(chosen, selection, masks, report))
            for statement, chosen in skipped
            if chosen.table.text == name
        ]
        taken = [(who, span, rows) for who, span, rows in takers if rows is not None]
        if table is not None and takers and len(taken) == len(takers):
            _check_table_cover(table, taken, report)


def _check_declared(chosen: Select, selection: Selection, report: Report) -> None:
    lookup(chosen.table, dict.fromkeys(selection.tables, True), "hole table", report)


def _rows(
    chosen: Select, selection: Selection, masks: Mapping[str, Mask], report: Report
) -> Mask | None:
    """The rows of its table that one `select` or `skip` means, given those of the regions that it
    names; None after an error."""
    table = selection.tables.get(chosen.table.text)
    if table is None:
        return None
    before = len(report.diagnostics)
    members: dict[str, Mask] = {}
    for word in regions_named(chosen.condition):
        if lookup(word, selection.regions, "region", report) is None:
            continue
        other = selection.selects.get(word.text)
        if other is None or other.table.text != chosen.table.text:
            report.error(
                "E332",
                f"region {word.text} takes no holes of table {chosen.table.text}",
                word.span,
                hint="name a region that selects from the same table",
            )
        elif word.text in masks:
            members[word.text] = masks[word.text]
        else:
            return None  # that region's own mistake has been reported
    rows = select(chosen.condition, table.holes, members, report)
    return rows if len(report.diagnostics) == before else None


def _report_circle(circle: Sequence[str], selects: Mapping[str, Select], report: Report) -> None:
    """`circle`: regions, each named in the condition of the one behind it; the first twice."""
    # Told from the region that is written first, so that the message does not depend on the walk.
    ring = list(circle[:-1])
    first = ring.index(min(ring, key=list(selects).index))
    ring = ring[first:] + ring[:first]
    places = []
    for needed, name in zip(ring, ring[1:] + ring[:1], strict=True):
        words = regions_named(selects[name].condition)
        places.append(next(word.span for word in words if word.text == needed))
    report.error(
        "E331",
        f"region {ring[0]} is selected by way of itself",
        places[0],
        labels=[Label(span, "by way of this") for span in places[1:]],
        hint="decide one of these regions without the other",
    )


def _check_table_cover(
    table: Table, taken: Sequence[tuple[str, Span, Mask]], report: Report
) -> None:
    count = np.zeros(len(table.holes.ids), dtype=np.int32)
    for _, _, mask in taken:
        count += mask
    twice = np.flatnonzero(count > 1)
    for row in twice[:NAMED_ROWS].tolist():
        holders = [(name, span) for name, span, mask in taken if mask[row]]
        first = holders[0][0].removeprefix("region ")
        report.error(
            "E333",
            f"hole {table.holes.ids[row]} is in {' and in '.join(name for name, _ in holders)}",
            table.span(row),
            labels=[Label(span, f"taken by {name}") for name, span in holders],
            hint=f"exclude one from the other: select {table.name.text} not in {first}",
        )
    if len(twice) > NAMED_ROWS:
        report.error(
            "E333",
            f"and {len(twice) - NAMED_ROWS:,} more like this",
            table.span(int(twice[NAMED_ROWS])),
        )
    never = np.flatnonzero(count == 0)
    if len(never):
        some = ", ".join(table.holes.ids[never[:5]].tolist())
        report.error(
            "E334",
            f"{len(never):,} of {len(count):,} holes of table {table.name.text} are in no region: "
            f"{some}{', …' if len(never) > 5 else ''}",
            table.span(int(never[0])),
            labels=[Label(table.name.span, "the table")],
            hint=f"take them into a region, or leave them out: skip {table.name.text} where …",
        )

"""Resolving `holes NAME from "FILE" { … }`: where a hole table's columns stand, and reading it."""

from __future__ import annotations

from drillc.language.ast import Item, Statement, Text, Value, Word
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import Fields, lookup, of_type
from drillc.language.loading import TABLE_LIMIT, Loader
from drillc.language.tables import KEYS, LENGTHS, NORMAL, REQUIRED, Table, TableSpec, read_table
from drillc.language.units import UNITS, Unit, said


def resolve_table(
    statement: Statement, normals: bool, loader: Loader, report: Report
) -> Table | None:
    """`holes NAME from "FILE" { delimiter …  units …  columns { … } }`, read and checked.

    `normals`: whether the table holds them; else they are taken from the part's surface.
    """
    fields = Fields(statement, report)
    path_text = of_type(statement.values[0], Text)
    columns = _columns(fields, normals, report)
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


def _columns(fields: Fields, normals: bool, report: Report) -> dict[str, Word | Text] | None:
    required = REQUIRED if normals else [key for key in REQUIRED if key not in NORMAL]
    example = " ".join(f"{key} {title}" for key, title in zip(required, _TITLES, strict=False))
    item = fields.need("columns", f"columns {{ {example} }}")
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
    stated = [columns[key] for key in NORMAL if key in columns]
    if stated and not normals:
        report.error(
            "E269",
            f"table {fields.statement.name.text} gives normals, and the part takes them from its "
            "surface",
            stated[0].span,
            hint="do not map i, j and k; or say what the normals are: normals into, or outward",
        )
        return None
    missing = [key for key in required if key not in columns]
    if missing:
        report.error(
            "E244",
            f"the columns do not say where to find {', '.join(missing)}",
            item.key.span,
            hint=f"columns {{ … {' '.join(f'{key} TITLE' for key in missing)} }}",
        )
        return None
    return columns


#: Titles that a table may have, for hints.
_TITLES = ("ID", "X", "Y", "Z", "NX", "NY", "NZ")

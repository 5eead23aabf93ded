"""From a text to what a pass makes of it: what the tests of the language and of planning share."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from drillc.driver import Planned, plan_spec
from drillc.language.ast import PointBlock, SpecFile, Word
from drillc.language.diagnostics import Diagnostic, Refused, Report
from drillc.language.hole_tables import resolve_table
from drillc.language.job import Job
from drillc.language.loading import Loader, load
from drillc.language.parser import parse
from drillc.language.points import RawHoles, read_points
from drillc.language.resolve import resolve
from drillc.language.source import Source
from drillc.language.tables import Table
from drillc.language.units import UNITS

#: One hole and all it needs, to put something before or behind.
PART = "program P\npart skin { up +Z  normals into }\n"
ONE_HOLE = "region r { posture x toward +X  points mm { P1 (1, 2, 3) normal (0, 0, -1) } }\n"


def in_memory(text: str) -> Source:
    return Source(Path("spec.drill"), "spec.drill", text)


def parsed(text: str) -> tuple[SpecFile | None, Report]:
    """The syntax tree of a text, and what was reported."""
    report = Report()
    return parse(in_memory(text), report), report


def spots(report: Report) -> list[tuple[str, int, int]]:
    """Code, line and column of every diagnostic, in their order."""
    found = []
    for diagnostic in report.diagnostics:
        assert diagnostic.span is not None
        found.append((diagnostic.code, diagnostic.span.line, diagnostic.span.column))
    return found


def codes(report: Report) -> list[str]:
    return [diagnostic.code for diagnostic in report.diagnostics]


def only(report: Report) -> Diagnostic:
    """The one diagnostic there is."""
    [diagnostic] = report.diagnostics
    return diagnostic


def points(inside: str, unit: str = "mm", before: str = "points mm {") -> tuple[RawHoles, Report]:
    """Read a points block: `inside` stands between its braces, behind `before`."""
    source, report = in_memory(before + inside + "}\n"), Report()
    start = len(before)
    word = Word(unit, source.span(0, 6))
    block = PointBlock(source, start, start + len(inside), word, source.span(0, 6))
    return read_points(block, UNITS[unit], report), report


ALL_COLUMNS = "id ID  x X  y Y  z Z  i I  j J  k K"


def table(
    folder: Path,
    content: str | bytes,
    *,
    delimiter: str = ",",
    units: str = "mm",
    columns: str = ALL_COLUMNS,
) -> tuple[Table | None, Report]:
    """Read holes.csv with this content as a spec would."""
    raw = content.encode() if isinstance(content, str) else content
    (folder / "holes.csv").write_bytes(raw)
    text = f'drill 1\nholes t from "holes.csv" {{ delimiter "{delimiter}" units {units}'
    text += f" columns {{ {columns} }} }}\n"
    report = Report()
    spec = parse(Source(folder / "spec.drill", "spec.drill", text), report)
    assert spec is not None, codes(report)
    [statement] = [s for s in spec.statements if s.kind == "holes"]
    return resolve_table(statement, True, Loader(folder.resolve(), report), report), report


def rows(*cells: Sequence[object], header: str = "ID,X,Y,Z,I,J,K") -> str:
    """A table's text from rows of cells."""
    return "\n".join([header, *(",".join(map(str, row)) for row in cells)]) + "\n"


def planned(folder: Path, text: str) -> Planned:
    """Every pass up to the program. Warnings are fine, errors are not."""
    result, report = attempted(folder, text)
    assert result is not None, [d.message for d in report.diagnostics]
    return result


def refused(folder: Path, text: str) -> Report:
    """What is said to a spec that must be refused."""
    result, report = attempted(folder, text)
    assert result is None, "this should have been refused"
    return report


def attempted(folder: Path, text: str) -> tuple[Planned | None, Report]:
    (folder / "spec.drill").write_text(text, encoding="utf-8")
    report = Report()
    try:
        return plan_spec(folder / "spec.drill", None, report), report
    except Refused:
        return None, report


def interval(message: str, behind: str = "h in ") -> tuple[float, float]:
    """The interval `[low, high] m` that a message gives behind some words."""
    match = re.search(re.escape(behind) + r"\[([-0-9.e]+), ([-0-9.e]+)\] m", message)
    assert match, message
    return float(match[1]), float(match[2])


def resolved(folder: Path, text: str) -> tuple[Job | None, Report]:
    """What the language makes of a spec, and what was reported."""
    (folder / "spec.drill").write_text(text, encoding="utf-8")
    report = Report()
    try:
        loader, loaded = load(folder / "spec.drill", None, report)
        report.stop_if_failed()
        assert loaded is not None
        return resolve(loaded, loader, report), report
    except Refused:
        return None, report

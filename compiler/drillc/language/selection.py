"""Which rows of a hole table a region takes: `select … where`, evaluated on whole columns."""

from __future__ import annotations

import fnmatch
import re
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from drillc.language import ast
from drillc.language.diagnostics import Report
from drillc.language.fields import did_you_mean, measure
from drillc.language.job import Floats
from drillc.language.points import RawHoles

Mask = NDArray[np.bool_]

_LENGTHS = ("x", "y", "z", "diameter", "stack")
_COLUMNS = ("id", *_LENGTHS)


def select(
    condition: ast.Condition | None,
    table: RawHoles,
    members: dict[str, Mask],
    report: Report,
) -> Mask:
    """The rows (n,) for which `condition` holds; `members` gives the rows of other regions.

    A hole whose diameter or stack is not given fails every comparison of it except `!=`.
    """
    everything = np.ones(len(table.ids), dtype=np.bool_)
    match condition:
        case None:
            return everything
        case ast.Not(inner):
            return ~select(inner, table, members, report)
        case ast.Both(parts):
            return reduce(np.logical_and, (select(p, table, members, report) for p in parts))
        case ast.Either(parts):
            return reduce(np.logical_or, (select(p, table, members, report) for p in parts))
        case ast.Member(region):
            return members.get(region.text, ~everything)
        case ast.Like(column, pattern):
            return _like(column, pattern, table, report)
        case ast.Compare(column, operator, value):
            return _compare(column, operator, value, table, report)
        case ast.Between(column, bounds):
            values = _lengths(column, table, report)
            low = measure(bounds.low, "length", column.text, report)
            high = measure(bounds.high, "length", column.text, report)
            if low > high:
                report.error(
                    "E224",
                    f"this range of {column.text} is reversed: no {column.text} lies in it",
                    bounds.span,
                    hint="write the lower end first",
                )
            if values is None:
                return everything
            return np.asarray((values >= low) & (values <= high))


def regions_named(condition: ast.Condition | None) -> list[ast.Word]:
    """The regions that a condition refers to."""
    match condition:
        case ast.Member(region):
            return [region]
        case ast.Not(inner):
            return regions_named(inner)
        case ast.Both(parts) | ast.Either(parts):
            return [region for part in parts for region in regions_named(part)]
        case _:
            return []


def _like(column: ast.Word, pattern: ast.Text, table: RawHoles, report: Report) -> Mask:
    if column.text in _LENGTHS:
        report.error(
            "E241",
            f"{column.text} is a length; `like` compares names",
            column.span,
            hint=f'{column.text} in 1 mm .. 2 mm; or id like "{pattern.text}"',
        )
    elif _known(column, report):
        matches = re.compile(fnmatch.translate(pattern.text)).match
        return np.fromiter(
            (matches(name) is not None for name in table.ids.tolist()), np.bool_, len(table.ids)
        )
    return np.ones(len(table.ids), dtype=np.bool_)


def _compare(
    column: ast.Word, operator: str, value: ast.Quantity | ast.Text, table: RawHoles, report: Report
) -> Mask:
    if isinstance(value, ast.Text):
        return _compare_text(column, operator, value, table, report)
    values = _lengths(column, table, report)
    bound = measure(value, "length", column.text, report)
    if values is None:
        return np.ones(len(table.ids), dtype=np.bool_)
    match operator:
        case "<":
            return np.asarray(values < bound)
        case "<=":
            return np.asarray(values <= bound)
        case ">":
            return np.asarray(values > bound)
        case ">=":
            return np.asarray(values >= bound)
        case "==":
            return np.asarray(values == bound)
        case _:
            return np.asarray(values != bound)


def _compare_text(
    column: ast.Word, operator: str, value: ast.Text, table: RawHoles, report: Report
) -> Mask:
    if column.text in _LENGTHS or (column.text == "id" and operator not in {"==", "!="}):
        what = "is a length" if column.text in _LENGTHS else f"has no order for {operator}"
        report.error(
            "E241",
            f'{column.text} {what}; it cannot be compared with "{value.text}"',
            column.span,
            hint='names are compared by: id == "F12", id != "F12", id like "F*"',
        )
    elif _known(column, report):
        equal = table.ids == value.text
        return np.asarray(equal if operator == "==" else ~equal)
    return np.ones(len(table.ids), dtype=np.bool_)


def _known(column: ast.Word, report: Report) -> bool:
    if column.text in _COLUMNS:
        return True
    report.error(
        "E210",
        f'a hole table has no column called "{column.text}"',
        column.span,
        hint=did_you_mean(column.text, _COLUMNS),
    )
    return False


def _lengths(column: ast.Word, table: RawHoles, report: Report) -> Floats | None:
    if not _known(column, report):
        return None
    match column.text:
        case "x" | "y" | "z":
            return table.position_mm[:, "xyz".index(column.text)]
        case "diameter" | "stack":
            values = table.diameter_mm if column.text == "diameter" else table.stack_mm
            if len(values) and np.isnan(values).all():
                report.error(
                    "E242",
                    f"the table gives no {column.text}",
                    column.span,
                    hint=f"map it: columns {{ {column.text} TITLE … }}",
                )
                return None
            return values
        case _:
            report.error(
                "E241",
                "id is a name; it is compared with a text",
                column.span,
                hint='id == "F12", or id like "F*"',
            )
            return None

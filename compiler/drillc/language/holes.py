"""The hole table: regions' rows put in order, normals turned into the part, every hole checked."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from drillc.language.columns import MAX_LENGTH_MM
from drillc.language.diagnostics import NAMED_ROWS, Label, Report
from drillc.language.job import Floats, HoleTable, Region
from drillc.language.points import MAX_ID_LENGTH, RawHoles
from drillc.language.source import Source

#: Two holes nearer than this are one hole written twice.
SAME_POSITION_MM = 1e-3
#: A hole this many times nearer to (or farther from) the origin than its region's median may be
#: metres among millimetres: the factor would be 1000, but the region itself has some extent.
SCALE_RATIO = 100.0

Rows = NDArray[np.int64]


def gather(parts: Sequence[tuple[int, Source, RawHoles]], normals_into: bool) -> HoleTable:
    """Concatenate (region, source, holes) into one table, in the order given.

    Feed directions are the normals made unit, or their opposites where normals point outward; a
    normal without a direction gives NaN.
    """
    if not parts:
        none, rows = np.empty(0), np.empty(0, dtype=np.int32)
        ids, triples = np.empty(0, dtype="<U1"), np.empty((0, 3))
        return HoleTable(ids, triples, triples, none, none, rows, rows, rows, rows, ())
    sources = list(dict.fromkeys(source for _, source, _ in parts))
    counts = [len(raw.ids) for _, _, raw in parts]

    def column(pick: Callable[[RawHoles], NDArray[np.generic]]) -> NDArray[np.generic]:
        return np.concatenate([pick(raw) for _, _, raw in parts])

    normal = np.asarray(column(lambda raw: raw.normal), dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        feed = normal / np.sqrt(np.einsum("ij,ij->i", normal, normal))[:, None]
    return HoleTable(
        ids=np.asarray(column(lambda raw: raw.ids), dtype=np.str_),
        position_mm=np.asarray(column(lambda raw: raw.position_mm), dtype=np.float64),
        feed=feed if normals_into else -feed,
        diameter_mm=np.asarray(column(lambda raw: raw.diameter_mm), dtype=np.float64),
        stack_mm=np.asarray(column(lambda raw: raw.stack_mm), dtype=np.float64),
        region=np.repeat([region for region, _, _ in parts], counts).astype(np.int32),
        source=np.repeat([sources.index(s) for _, s, _ in parts], counts).astype(np.int32),
        line=np.asarray(column(lambda raw: raw.line), dtype=np.int32),
        column=np.asarray(column(lambda raw: raw.column), dtype=np.int32),
        sources=tuple(sources),
    )


def check_normals(raw: RawHoles, source: Source, tolerance: float, report: Report) -> None:
    """Zero, not finite, and not unit normals, each with its own code."""
    with np.errstate(invalid="ignore", over="ignore"):
        length = np.sqrt(np.einsum("ij,ij->i", raw.normal, raw.normal))
    finite = np.asarray(np.isfinite(raw.normal).all(axis=1))
    zero = np.asarray((raw.normal == 0).all(axis=1))
    off = finite & ~zero & ~(np.abs(length - 1) <= tolerance)
    where = _Where(raw, source, report)
    where.each(
        ~finite,
        "E318",
        lambda i: f"the normal of hole {raw.ids[i]} is not finite: {_triple(raw.normal[i])}",
        lambda i: "a normal is three numbers",
    )
    where.each(
        zero,
        "E320",
        lambda i: f"the normal of hole {raw.ids[i]} is zero, which is no direction",
        lambda i: "take it from the part's surface",
    )
    where.each(
        off,
        "E321",
        lambda i: (
            f"the normal of hole {raw.ids[i]} has length {length[i]:.6g}; it must be 1 within "
            f"{tolerance:g}"
        ),
        lambda i: _mended(raw.normal[i], length[i]),
    )


def _mended(normal: Floats, length: float) -> str:
    """How to write a normal so that it is a unit vector."""
    if not 0 < length < math.inf:
        return "a normal is a unit vector"
    unit = f"write it as a unit vector: {_triple(np.round(normal / length, 7))}"
    off = abs(length - 1)
    if off > 0.05:
        return unit
    return f"{unit}; or widen the part's tolerance: unit_tolerance {_rounded_up(off):g}"


def _rounded_up(value: float) -> float:
    """To one digit: 0.0013 → 0.002."""
    step = 10.0 ** math.floor(math.log10(value))
    return math.ceil(value / step * (1 + 1e-9)) * step


def check_raw(raw: RawHoles, source: Source, report: Report) -> None:
    """Ids that can be used, and positions, diameters and stacks that a machine could know."""
    where = _Where(raw, source, report)
    unset = np.asarray(np.isnan(raw.position_mm).any(axis=1))
    where.each(
        unset,
        "E318",
        lambda i: (
            f"the position of hole {raw.ids[i]} is not finite: {_triple(raw.position_mm[i])} mm"
        ),
        lambda i: "a position is three numbers",
    )
    far = ~unset & (np.abs(raw.position_mm) > MAX_LENGTH_MM).any(axis=1)
    where.each(
        far,
        "E205",
        lambda i: (
            f"hole {raw.ids[i]} lies beyond anything a machine reaches: "
            f"({', '.join(f'{v:g}' for v in raw.position_mm[i])}) mm; the limit is "
            f"{MAX_LENGTH_MM:g} mm"
        ),
        lambda i: "check the unit and the decimal point",
    )
    for name, values in (("diameter", raw.diameter_mm), ("stack", raw.stack_mm)):
        where.each(
            values > MAX_LENGTH_MM,
            "E205",
            lambda i, name=name, values=values: (  # type: ignore[misc]
                f"the {name} of hole {raw.ids[i]} is {values[i]:g} mm, beyond anything a machine "
                f"can do (the limit is {MAX_LENGTH_MM:g} mm)"
            ),
            lambda i: "check the unit and the decimal point",
        )
        where.each(
            values <= 0,
            "E206",
            lambda i, name=name, values=values: (  # type: ignore[misc]
                f"the {name} of hole {raw.ids[i]} is {values[i]:g} mm; it must be more than 0 mm"
            ),
            lambda i: "leave the cell empty where it is not known",
        )
    _check_ids(raw, where)


def _check_ids(raw: RawHoles, where: _Where) -> None:
    ids = raw.ids
    if ids.dtype.itemsize == 0 or not len(ids):
        return
    empty = np.char.str_len(ids) == 0
    where.each(empty, "E322", lambda i: "this hole has no id", lambda i: "give it one")
    long = np.char.str_len(ids) > MAX_ID_LENGTH
    where.each(
        long,
        "E323",
        lambda i: (
            f"this hole's id is too long; the limit (MAX_ID_LENGTH) is {MAX_ID_LENGTH} characters"
        ),
        lambda i: "shorten it",
    )
    codes = np.ascontiguousarray(ids).view(np.uint32).reshape(len(ids), -1)
    allowed = np.zeros(128, dtype=np.bool_)
    for character in "_.:/-":
        allowed[ord(character)] = True
    for first, last in ("09", "AZ", "az"):
        allowed[ord(first) : ord(last) + 1] = True
    allowed[0] = True  # padding behind shorter ids
    odd = (codes > 127) | ~allowed[np.minimum(codes, 127)]
    bad_start = np.isin(codes[:, 0], [ord(c) for c in ".:/-"])
    where.each(
        (odd.any(axis=1) | bad_start) & ~empty & ~long,
        "E324",
        lambda i: f"{str(ids[i])!a} cannot be a hole's id",
        lambda i: "ids are ASCII letters, digits and _ . : / -, beginning with none of . : / -",
    )


def _triple(values: Floats) -> str:
    return f"({', '.join(f'{v:.9g}' for v in values + 0.0)})"


class _Where:
    """Reports rows of a raw table, the first few by name and the rest by number."""

    def __init__(self, raw: RawHoles, source: Source, report: Report) -> None:
        self.raw, self.source, self.report = raw, source, report

    def each(
        self,
        bad: NDArray[np.bool_],
        code: str,
        message: Callable[[int], str],
        hint: Callable[[int], str],
    ) -> None:
        rows = np.flatnonzero(bad)
        for row in rows[:NAMED_ROWS].tolist():
            span = self.raw.span(row, self.source)
            self.report.error(code, message(row), span, hint=hint(row))
        if len(rows) > NAMED_ROWS:
            span = self.raw.span(int(rows[NAMED_ROWS]), self.source)
            self.report.error(code, f"and {len(rows) - NAMED_ROWS:,} more like this", span)


def report_holes(
    holes: HoleTable,
    bad: NDArray[np.bool_] | Rows,
    code: str,
    message: Callable[[int], str],
    report: Report,
    *,
    hint: Callable[[int], str | None] = lambda row: None,
    label: Callable[[int], Label | None] = lambda row: None,
) -> None:
    """Report rows of the hole table, the first few one by one and the rest by their number."""
    rows = np.flatnonzero(bad) if bad.dtype == np.bool_ else bad
    for row in rows[:NAMED_ROWS].tolist():
        extra = label(row)
        report.error(
            code,
            message(row),
            holes.span(row),
            labels=[extra] if extra else [],
            hint=hint(row),
        )
    if len(rows) > NAMED_ROWS:
        more = f"and {len(rows) - NAMED_ROWS:,} more like this"
        report.error(code, more, holes.span(int(rows[NAMED_ROWS])))


def check_table(holes: HoleTable, regions: Sequence[Region], report: Report) -> None:
    """Duplicate ids, duplicate positions, and holes that look a thousand times off.

    A row that two regions take is one hole, and has been reported as such.
    """
    if not len(holes):
        return
    _check_duplicate_ids(holes, report)
    with np.errstate(over="ignore"):  # what is too far away has been reported
        _check_duplicate_positions(holes, report)
        _check_scale(holes, regions, report)


def _check_duplicate_ids(holes: HoleTable, report: Report) -> None:
    order = np.argsort(holes.ids, kind="stable")
    ids = holes.ids[order]
    again = (ids[1:] == ids[:-1]) & (ids[1:] != "")  # a hole without an id has been reported
    again = np.flatnonzero(again & ~_same_row(holes, order[1:], order[:-1])) + 1
    first = np.maximum.accumulate(
        np.where(np.concatenate([[True], ids[1:] != ids[:-1]]), np.arange(len(ids)), 0)
    )
    earlier = dict(zip(order[again].tolist(), order[first[again]].tolist(), strict=True))
    report_holes(
        holes,
        np.sort(order[again]),
        "E325",
        lambda row: f"there are two holes called {holes.ids[row]}",
        report,
        hint=lambda row: "rename or remove one of them",
        label=lambda row: Label(holes.span(earlier[row]), "the first one"),
    )


def _same_row(holes: HoleTable, some: Rows, others: Rows) -> NDArray[np.bool_]:
    """Whether the holes `some` and `others`, both (k,), are written at the same place."""
    same = holes.line[some] == holes.line[others]
    same &= holes.column[some] == holes.column[others]
    return np.asarray(same & (holes.source[some] == holes.source[others]))


def _check_duplicate_positions(holes: HoleTable, report: Report) -> None:
    cell = np.rint(holes.position_mm / SAME_POSITION_MM)
    order = np.lexsort(cell.T)
    same = (cell[order[1:]] == cell[order[:-1]]).all(axis=1)
    same &= ~_same_row(holes, order[1:], order[:-1])
    later, before = order[1:][same], order[:-1][same]  # a stable sort: before is the earlier row
    earlier = dict(zip(later.tolist(), before.tolist(), strict=True))
    report_holes(
        holes,
        np.sort(later),
        "E326",
        lambda row: (
            f"holes {holes.ids[earlier[row]]} and {holes.ids[row]} are at the same position "
            f"(within {SAME_POSITION_MM:g} mm)"
        ),
        report,
        hint=lambda row: "remove one of them, or correct its position",
        label=lambda row: Label(holes.span(earlier[row]), "the other one"),
    )


def _check_scale(holes: HoleTable, regions: Sequence[Region], report: Report) -> None:
    distance = np.sqrt(np.einsum("ij,ij->i", holes.position_mm, holes.position_mm))
    for region in regions:
        rows = slice(region.start, region.stop)
        median = float(np.median(distance[rows])) if region.stop - region.start >= 3 else 0.0
        if not 0 < median < math.inf:  # too few to tell, all at the origin, or refused already
            continue
        centre = np.median(holes.position_mm[rows], axis=0)
        far = distance[rows] > SCALE_RATIO * median
        near = distance[rows] * SCALE_RATIO < median
        # Scaled back by 1000, a mistaken hole comes to lie among the others.
        factor = np.where(far, 1e-3, 1e3)[:, None]
        mended = np.linalg.norm(holes.position_mm[rows] * factor - centre, axis=1)
        suspect = (far | near) & (mended < np.linalg.norm(holes.position_mm[rows] - centre, axis=1))
        report_holes(
            holes,
            np.flatnonzero(suspect) + region.start,
            "W327",
            lambda row, median=median, name=region.name.text: (  # type: ignore[misc]
                f"hole {holes.ids[row]} is {distance[row]:g} mm from the origin, and the median of "
                f"region {name} is {median:g} mm"
            ),
            report,
            hint=lambda row, median=median: (  # type: ignore[misc]
                "metres among millimetres? 1000 times as far it would lie among the others"
                if distance[row] < median
                else "millimetres among metres? 1000 times nearer it would lie among the others"
            ),
        )

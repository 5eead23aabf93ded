"""Reading the fields of a block: each given once, with the right dimension, inside its bounds."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np

from drillc.language.ast import (
    FrameAxes,
    Item,
    Numbers,
    Orientation,
    Placement,
    Quantity,
    Range,
    Statement,
    Value,
    Word,
)
from drillc.language.columns import MAX_LENGTH_MM
from drillc.language.diagnostics import Label, Report
from drillc.language.job import Floats, Limit, Named, Pose
from drillc.language.units import UNITS, Dimension, convert, said

T = TypeVar("T")
V = TypeVar("V", bound=Value)

#: Scalars beyond this are refused: no feed, force or time of a cell is near it.
MAX_SCALAR = 1e9

#: How far the dot products of written axes may be from those of exact ones: what four digits leave.
AXES_TOLERANCE = 1e-3

_AXES = "xyz"


def did_you_mean(name: str, known: Iterable[str]) -> str | None:
    """A hint that names the nearest known name, or lists what there is."""
    names = sorted(known)
    near = [n for n in names if n.lower() == name.lower()]
    longer = [n for n in names if len(name) >= 4 and n.startswith(name)]
    near = near or longer[:1] or difflib.get_close_matches(name, names, 1, 0.6)
    if near:
        return f'did you mean "{near[0]}"?'
    more = ", …" if len(names) > 12 else ""
    return f"known: {', '.join(names[:12])}{more}" if names else None


class Fields:
    """The items of one block, by key. Reports an item that is given twice, unless its key is one
    of `repeated`."""

    def __init__(self, statement: Statement, report: Report, repeated: Iterable[str] = ()) -> None:
        self.statement = statement
        self.report = report
        self._items: dict[str, Item] = {}
        many = set(repeated)
        for item in statement.items:
            key = item.key.text
            first = self._items.setdefault(key, item)
            if first is not item and key not in many:
                report.error(
                    "E201",
                    f'"{key}" is given twice in {statement.kind} {statement.name.text}',
                    item.key.span,
                    labels=[Label(first.key.span, "first given here")],
                    hint="remove one of them",
                )

    def get(self, key: str) -> Item | None:
        """The item, or None."""
        return self._items.get(key)

    def every(self, key: str) -> list[Item]:
        """All items of that key, in their order."""
        return [item for item in self.statement.items if item.key.text == key]

    def need(self, key: str, hint: str) -> Item | None:
        """The item; its absence is an error at the block's name."""
        item = self._items.get(key)
        if item is None:
            statement = self.statement
            self.report.error(
                "E202",
                f'{statement.kind} {statement.name.text} does not say "{key}"',
                statement.name.span,
                hint=hint,
            )
        return item

    def measure(
        self,
        key: str,
        dimension: Dimension,
        *,
        default: float = math.nan,
        hint: str | None = None,
        above: float | None = None,
        least: float | None = None,
    ) -> float:
        """The first value of `key` in its base unit; NaN after an error. Without `default`, the
        item must be there."""
        needed = math.isnan(default)
        item = self.need(key, hint or f"add: {key} …") if needed else self.get(key)
        if item is None:
            return default
        return measure(item.values[0], dimension, key, self.report, above=above, least=least)


def measure(
    value: Value,
    dimension: Dimension,
    what: str,
    report: Report,
    *,
    above: float | None = None,
    least: float | None = None,
) -> float:
    """A quantity of the given dimension in its base unit; NaN after reporting what is wrong.

    `above` is an exclusive lower bound, `least` an inclusive one, both in the base unit.
    """
    quantity = of_type(value, Quantity)
    if quantity.unit is None:
        report.error(
            "E203",
            f"{what} is {quantity.number} without a unit; it is {said(dimension)}",
            quantity.span,
            hint=f"write the unit: {quantity.number} {example(dimension)}",
        )
        return math.nan
    unit = UNITS[quantity.unit]
    if unit.dimension != dimension:
        report.error(
            "E204",
            f"{what} is {said(dimension)}, but {quantity.number} {quantity.unit} is "
            f"{said(unit.dimension)}",
            quantity.span,
            hint=f"write {what} in {example(dimension)}",
        )
        return math.nan
    number = convert(quantity.number, unit)
    bound = MAX_LENGTH_MM if dimension == "length" else MAX_SCALAR
    if not abs(number) <= bound:
        report.error(
            "E205",
            f"{what} is {_cut(quantity.number)} {quantity.unit}, beyond anything a machine can do "
            f"(the limit is {_said_bound(bound, dimension)})",
            quantity.span,
            hint="check the unit and the decimal point",
        )
        return math.nan
    if (above is not None and number <= above) or (least is not None and number < least):
        need, bound = ("at least", least or 0.0) if above is None else ("more than", above)
        limit = _said_bound(bound, dimension) if bound else f"0 {quantity.unit}"
        report.error(
            "E206",
            f"{what} is {_cut(quantity.number)} {quantity.unit}; it must be {need} {limit}",
            quantity.span,
        )
        return math.nan
    return number


def whole(value: Value, what: str, low: int, high: int, report: Report) -> int:
    """A whole number without a unit, inside `low` … `high`; `low` after an error."""
    quantity = of_type(value, Quantity)
    digits = quantity.number.removeprefix("+").lstrip("0") or "0"
    if quantity.unit is None and digits.isdigit() and len(digits) <= 12:
        number = int(digits)
        if low <= number <= high:
            return number
    unit = f" {quantity.unit}" if quantity.unit else ""
    report.error(
        "E207",
        f"{what} is {_cut(quantity.number)}{unit}; it must be a whole number from {low} to {high}",
        quantity.span,
    )
    return low


def lengths(numbers: Numbers, what: str, report: Report) -> Floats:
    """Numbers with a unit of length, in mm (k,); NaN after an error."""
    shown = f"({', '.join(numbers.numbers)})"
    if numbers.unit is None:
        report.error(
            "E203",
            f"{what} is {shown} without a unit; it is {said('length')}",
            numbers.span,
            hint=f"write the unit: {shown} mm",
        )
    elif UNITS[numbers.unit].dimension != "length":
        report.error(
            "E204",
            f"{what} is {said('length')}, but {shown} {numbers.unit} is "
            f"{said(UNITS[numbers.unit].dimension)}",
            numbers.span,
            hint=f"write {what} in mm",
        )
    else:
        each = zip(_AXES, numbers.numbers, numbers.spans, strict=True)
        return np.array(
            [
                measure(Quantity(n, numbers.unit, span), "length", f"{what}'s {axis}", report)
                for axis, n, span in each
            ]
        )
    return np.full(len(numbers.numbers), math.nan)


def in_unit(numbers: Value, unit: Value) -> Numbers:
    """Numbers and a unit that the grammar keeps apart, because it stands behind several."""
    bare = of_type(numbers, Numbers)
    return replace(bare, unit=unit.text if isinstance(unit, Word) else None)


def unit_vector(value: Word | Numbers, what: str, report: Report) -> Floats | None:
    """A direction: `-Y`, or three numbers of any length but zero. None after an error."""
    if isinstance(value, Word):
        vector = np.zeros(3)
        vector["XYZ".index(value.text[1])] = 1.0 if value.text[0] == "+" else -1.0
        return vector
    vector = np.array([float(n) for n in value.numbers])
    scale = np.abs(vector).max()
    if not 1e-9 < scale < 1e9:
        report.error(
            "E208",
            f"{what} is ({', '.join(map(_cut, value.numbers))}), which gives no direction",
            value.span,
            hint="write a signed axis such as -Y, or three numbers that are not all zero",
        )
        return None
    vector = vector / scale
    return np.asarray(vector / np.linalg.norm(vector))


def pose(placement: Placement, what: str, report: Report) -> Pose:
    """A placement as a transform: translate, then turn about the moved frame's own axes."""
    return Pose(
        orientation(placement.orientation, what, report), lengths(placement.at, what, report)
    )


def orientation(written: Orientation, what: str, report: Report) -> Floats:
    """An orientation as a rotation (3, 3): the axes are its columns, each turn follows the last."""
    from drillc.kernels.rotations import rotation_about

    rotation = np.eye(3) if written.axes is None else _from_axes(written.axes, what, report)
    for turn in written.rotations:
        angle = measure(turn.angle, "angle", f"{what}'s rotation", report)
        if not math.isnan(angle):
            rotation = rotation @ rotation_about(_AXES.index(turn.axis.text), angle)
    return rotation


def _from_axes(written: FrameAxes, what: str, report: Report) -> Floats:
    """The rotation nearest to the written axes; the identity after reporting that it is far."""
    matrix = np.array([[float(n) for n in axis.numbers] for axis in written.axes]).T
    with np.errstate(all="ignore"):
        dots = matrix.T @ matrix
        near = bool((np.abs(dots - np.eye(3)) <= AXES_TOLERANCE).all())
        determinant = float(np.linalg.det(matrix)) if np.isfinite(matrix).all() else math.nan
    if near and determinant > 0:
        left, _, right = np.linalg.svd(matrix)
        return np.asarray(left @ right)
    if near:
        fault, hint = f"left-handed: their determinant is {determinant:.6g}", "reverse one of them"
    else:
        length = ", ".join(f"{math.sqrt(d):.6g}" for d in np.diag(dots))
        fault = (
            f"no unit vectors at right angles: their lengths are {length}; x·y = "
            f"{dots[0, 1]:.6g}, x·z = {dots[0, 2]:.6g}, y·z = {dots[1, 2]:.6g}; their determinant "
            f"is {determinant:.6g}"
        )
        hint = f"lengths must be 1 and the products 0, within {AXES_TOLERANCE:g}"
    report.error("E255", f"the axes of {what} are {fault}", written.span, hint=hint)
    return np.eye(3)


def entries(item: Item | None, known: Sequence[str], kind: str, report: Report) -> dict[str, Item]:
    """The entries `NAME value` of a block, by name; unknown names and repeated ones are errors."""
    found: dict[str, Item] = {}
    for entry in item.items if item else ():
        name = entry.key.text
        if lookup(entry.key, dict.fromkeys(known, True), kind, report) is None:
            continue
        first = found.setdefault(name, entry)
        if first is not entry and item is not None:
            report.error(
                "E201",
                f'"{name}" is given twice in {item.key.text}',
                entry.key.span,
                labels=[Label(first.key.span, "first given here")],
                hint="remove one of them",
            )
    return found


def limit(entry: Item, dimension: Dimension, report: Report) -> Limit:
    """`NAME low .. high` in its base unit; its ends may be NaN after an error."""
    name, bounds = entry.key.text, of_type(entry.values[0], Range)
    low = measure(bounds.low, dimension, f"{name}'s lower limit", report)
    high = measure(bounds.high, dimension, f"{name}'s upper limit", report)
    if low >= high:
        report.error(
            "E224",
            f"the limits of {name} are reversed or equal: {written(bounds.low)} .. "
            f"{written(bounds.high)}",
            bounds.span,
            hint="write the lower end first",
        )
    return Limit(low, high, entry.span)


def written(quantity: Quantity) -> str:
    """A quantity as it stands in the spec."""
    return f"{_cut(quantity.number)} {quantity.unit or ''}".strip()


def named(word: Word) -> Named:
    """A declared name."""
    return Named(word.text, word.span)


def lookup(word: Word, table: Mapping[str, T], kind: str, report: Report) -> T | None:
    """What `word` names; an unknown name is an error with the nearest known one."""
    found = table.get(word.text)
    if found is None:
        report.error(
            "E210",
            f'there is no {kind} called "{word.text}"',
            word.span,
            hint=did_you_mean(word.text, table) or f"declare {kind} {word.text}",
        )
    return found


def of_type(value: Value, kind: type[V]) -> V:
    """`value`, which the grammar promises to be of that kind."""
    assert isinstance(value, kind), f"{value!r} is no {kind.__name__}"
    return value


def example(dimension: Dimension) -> str:
    """The unit in which one would write a dimension: its first, but degrees for angles."""
    names = [name for name, unit in UNITS.items() if unit.dimension == dimension]
    return next((name for name in names if name.startswith("deg")), names[0])


def _said_bound(bound: float, dimension: Dimension) -> str:
    """A bound in the base unit, in the first unit in which one would write it."""
    unit = example(dimension)
    return f"{bound / float(UNITS[unit].factor):g} {unit}"


def _cut(number: str) -> str:
    """A number as it was written, unless it fills the screen."""
    return number if len(number) <= 24 else f"{number[:20]}…"

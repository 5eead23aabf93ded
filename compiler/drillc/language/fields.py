"""Reading the fields of a block: each given once, with the right dimension, inside its bounds."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import TypeVar

import numpy as np

from drillc.language.ast import Item, Numbers, Placement, Quantity, Statement, Value, Word
from drillc.language.columns import MAX_LENGTH_MM
from drillc.language.diagnostics import Label, Report
from drillc.language.job import Floats, Pose
from drillc.language.units import UNITS, Dimension, convert, said

T = TypeVar("T")
V = TypeVar("V", bound=Value)

#: Scalars beyond this are refused: no feed, force or time of a cell is near it.
MAX_SCALAR = 1e9

_AXES = "xyz"


def did_you_mean(name: str, known: Iterable[str]) -> str | None:
    """A hint that names the nearest known name, or lists what there is."""
    names = sorted(known)
    near = [n for n in names if n.lower() == name.lower()]
    near = near or difflib.get_close_matches(name, names, 1, 0.6)
    if near:
        return f'did you mean "{near[0]}"?'
    more = ", …" if len(names) > 12 else ""
    return f"known: {', '.join(names[:12])}{more}" if names else None


class Fields:
    """The items of one block, by key. Reports an item that is given twice."""

    def __init__(self, statement: Statement, report: Report) -> None:
        self.statement = statement
        self.report = report
        self._items: dict[str, Item] = {}
        for item in statement.items:
            key = item.key.text
            first = self._items.setdefault(key, item)
            if first is not item:
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
    """A placement as a transform: translate, then rotate about the moved frame's own axes."""
    from drillc.kernels.rotations import rotation_about

    rotation = np.eye(3)
    for turn in placement.rotations:
        angle = measure(turn.angle, "angle", f"{what}'s rotation", report)
        if not math.isnan(angle):
            rotation = rotation @ rotation_about(_AXES.index(turn.axis.text), angle)
    return Pose(rotation, lengths(placement.at, what, report))


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

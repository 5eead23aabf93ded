"""Units are exact: the same length in other words is the same float, bit for bit."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from fractions import Fraction
from pathlib import Path

import pytest
from drillc.language.ast import Quantity
from drillc.language.columns import numbers
from drillc.language.diagnostics import Report
from drillc.language.fields import measure
from drillc.language.source import Span
from drillc.language.units import UNITS, convert
from hypothesis import example, given
from hypothesis import strategies as st
from language.texts import codes, in_memory, parsed

GRAMMAR = Path(__file__).parents[2] / "grammars" / "drill.lark"

DECIMALS = st.decimals(
    Decimal("-1e9"), Decimal("1e9"), allow_nan=False, allow_infinity=False, places=None
).filter(lambda d: len(d.as_tuple().digits) <= 40)

#: What each unit is, as a person would look it up; angles in degrees go through math.radians.
EXACT = {
    "mm": Fraction(1),
    "um": Fraction(1, 1000),
    "cm": Fraction(10),
    "m": Fraction(1000),
    "inch": Fraction(254, 10),
    "rad": Fraction(1),
    "s": Fraction(1),
    "ms": Fraction(1, 1000),
    "min": Fraction(60),
    "mm/s": Fraction(1),
    "m/s": Fraction(1000),
    "mm/min": Fraction(1, 60),
    "m/min": Fraction(1000, 60),
    "rpm": Fraction(1, 60),
    "mm/rev": Fraction(1),
    "rad/s": Fraction(1),
    "N": Fraction(1),
    "kN": Fraction(1000),
    "kg": Fraction(1),
    "%": Fraction(1, 100),
}


@given(DECIMALS)
@example(Decimal("0.29"))
@example(Decimal("1.1"))
@example(Decimal("-0.0"))
def test_metres_are_millimetres_bit_for_bit(metres: Decimal) -> None:
    in_mm = metres.scaleb(3)
    for shown in ("f", "E"):
        m, mm = format(metres, shown), format(in_mm, shown)
        # hex, since -0.0 == 0.0
        assert convert(m, UNITS["m"]).hex() == convert(mm, UNITS["mm"]).hex() == float(mm).hex()


@given(st.lists(DECIMALS, min_size=1, max_size=8), st.sampled_from(["m", "cm", "um", "inch"]))
def test_a_column_is_converted_as_each_number_is(values: list[Decimal], unit: str) -> None:
    """Columns shift exponents in the text instead of calculating in decimals."""
    texts = [format(value, "f") for value in values]
    read = numbers(texts, UNITS[unit])
    assert read.bad == []
    assert [v.hex() for v in read.values.tolist()] == [convert(t, UNITS[unit]).hex() for t in texts]
    padded = numbers([f" {text}\t" for text in texts], UNITS[unit])
    assert padded.values.tolist() == read.values.tolist()


@given(st.sampled_from(sorted(EXACT)), st.integers(-(10**15), 10**15), st.integers(-12, 12))
def test_a_conversion_rounds_once(unit: str, digits: int, exponent: int) -> None:
    exact = Fraction(digits) * Fraction(10) ** exponent * EXACT[unit]
    assert convert(f"{digits}e{exponent}", UNITS[unit]) == float(exact)


def test_all_units_but_degrees_are_looked_at_above() -> None:
    assert set(UNITS) - set(EXACT) == {"deg", "deg/s"}


@given(st.floats(-1e6, 1e6))
def test_degrees_go_through_radians(angle: float) -> None:
    assert convert(repr(angle), UNITS["deg"]) == math.radians(angle)


def test_what_a_cell_writes_comes_out_round() -> None:
    assert convert("0.29", UNITS["m"]) == 290.0
    assert convert("6000", UNITS["rpm"]) == 100.0
    assert convert("300", UNITS["mm/min"]) == 5.0
    assert convert("180", UNITS["deg/s"]) == pytest.approx(math.pi, rel=1e-15)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize(
    "number", ["1e400", "-1e400", "1e999999999999999999999", "1e-999999999999999999999", "1e-400"]
)
def test_absurd_exponents_do_not_raise(unit: str, number: str) -> None:
    value = convert(number, UNITS[unit])
    assert value == 0.0 or math.isinf(value)


def test_an_exponent_is_judged_after_the_unit() -> None:
    assert convert("1e309", UNITS["um"]) == 1e306
    assert convert("1e-322", UNITS["m"]) == float("1e-319")


@pytest.mark.parametrize("number", ["1e400", "1e999999999999999999999", "-1e300"])
def test_a_length_beyond_everything_is_refused(number: str) -> None:
    report = Report()
    span = Span(in_memory("x"), 1, 1)
    assert math.isnan(measure(Quantity(number, "mm", span), "length", "it", report))
    assert codes(report) == ["E205"]


def test_the_grammar_lists_exactly_the_table() -> None:
    [pattern] = re.findall(r"^UNIT\S*: /\(\?:(.*?)\)\(\?!", GRAMMAR.read_text(), re.MULTILINE)
    listed = pattern.replace("\\/", "/").split("|")
    assert sorted(listed) == sorted(UNITS)


@pytest.mark.parametrize("unit", UNITS)
def test_every_unit_is_read_whole(unit: str) -> None:
    """mm/min is not mm and a rest, m not the beginning of mm; also without a blank before it."""
    for text in (f"1 {unit}", f"1{unit}", f"1.5e-3{unit}"):
        spec, report = parsed(f"drill 1\nemit krl {{ rate {text} }}\n")
        assert spec is not None, codes(report)
        [value] = spec.statements[-1].items[0].values
        assert isinstance(value, Quantity)
        assert value.unit == unit

import math
import re
from decimal import ROUND_HALF_EVEN, Decimal

import numpy as np
import pytest
from drillc.output.numbers import LARGEST, Fixed, NumberError, Text, Whole, fixed
from hypothesis import example, given
from hypothesis import strategies as st

finite = st.floats(-1e9, 1e9) | st.floats(-1e-3, 1e-3)


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [
        (0.0, 3, "0.000"),
        (-0.0, 3, "0.000"),
        (-0.0004999, 3, "0.000"),
        (-0.0006, 3, "-0.001"),
        (1e-7, 4, "0.0000"),
        (2379, 1, "2379.0"),
        (-10.0, 0, "-10"),
        (-0.4, 0, "0"),
        (123456789.123, 2, "123456789.12"),
        (np.float64(-542.0), 3, "-542.000"),
        (np.int32(7), 2, "7.00"),
    ],
)
def test_known_numbers(value: float, decimals: int, text: str) -> None:
    assert fixed(value, decimals) == text


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, LARGEST, True, None, "1"])
def test_what_is_no_number_is_refused(value: object) -> None:
    with pytest.raises(NumberError):
        fixed(value, 3)  # type: ignore[arg-type]


@given(finite, st.integers(0, 8))
@example(-0.0005, 3)
@example(-0.00005, 4)
@example(-5e-06, 5)
@example(-0.5, 0)
def test_text_is_the_value_rounded_and_plain(value: float, decimals: int) -> None:
    text = fixed(value, decimals)
    assert re.fullmatch(r"-?[0-9]+(\.[0-9]+)?", text)
    # Decimal arithmetic on the exact binary value is an oracle that shares nothing with `%`.
    exact = Decimal(value).quantize(Decimal(1).scaleb(-decimals), ROUND_HALF_EVEN)
    assert Decimal(text) == exact
    assert not (text.startswith("-") and float(text) == 0.0)


@given(st.lists(finite, max_size=20), st.integers(0, 8))
@example([-0.0005, 0.0005, -0.00049999999999999999, -5e-324], 3)
@example([-0.00005, -4.9999999999999996e-05], 4)
def test_a_column_prints_what_the_formatter_prints(values: list[float], decimals: int) -> None:
    column = Fixed(np.array(values, dtype=np.float64), decimals)
    printed = [column.conversion % cell for cell in column.cells(0, len(values))]
    assert printed == [fixed(value, decimals) for value in values]


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf, 1e13])
def test_a_column_names_the_row_that_cannot_be_written(bad: float) -> None:
    with pytest.raises(NumberError, match="row 1"):
        Fixed(np.array([0.0, bad, 2.0]), 3)


def test_a_column_is_one_dimensional() -> None:
    with pytest.raises(NumberError, match=r"\(2, 3\)"):
        Fixed(np.zeros((2, 3)), 3)


def test_whole_and_text_cells() -> None:
    whole = Whole(np.array([-1, 0, 42], dtype=np.int32))
    assert [whole.conversion % cell for cell in whole.cells(0, 2)] == ["-1", "0"]
    text = Text(np.array(["P1", "100 %"]))
    assert [text.conversion % cell for cell in text.cells(1, 2)] == ["100 %"]

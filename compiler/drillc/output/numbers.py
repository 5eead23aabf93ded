"""The one number formatter of all emitted text, for single numbers and for whole columns.

Nothing here prints an exponent, a comma, `-0.000`, NaN or an infinity. A number that rounds to zero
is printed without a sign; one that is not finite is a bug upstream and raises `NumberError`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats, Texts

#: Beyond this a double no longer holds three decimals, and no machine is that large.
LARGEST = 1e12


class NumberError(ValueError):
    """A number that cannot be written, not finite or absurdly large: a bug, no user's mistake."""


def fixed(value: float, decimals: int) -> str:
    """`value` with exactly `decimals` digits after the point.

    >>> fixed(-0.0004, 3), fixed(2379, 1), fixed(1e-7, 4)
    ('0.000', '2379.0', '0.0000')
    """
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise NumberError(f"a number was expected, not {type(value).__name__}")
    number = float(value)
    if not (math.isfinite(number) and abs(number) < LARGEST):
        raise NumberError(f"{number!r} cannot be written as a number")
    text = f"{number:.{decimals}f}"
    return text[1:] if text.startswith("-") and not text.strip("-0.") else text


def _largest_zero(decimals: int) -> float:
    """The largest double that prints as zero, so that a column and `fixed` agree on every bit.

    The double nearest to the half way may lie on either side of it; its neighbours never do.
    """
    half = float(f"5e-{decimals + 1}")
    return half if not f"{half:.{decimals}f}".strip("0.") else math.nextafter(half, 0.0)


class Column(Protocol):
    """Per-hole values that are poured into a template: a %-conversion and the cells it prints."""

    @property
    def conversion(self) -> str:
        """The conversion of one cell, such as `%.3f`."""

    def __len__(self) -> int: ...

    def cells(self, start: int, stop: int) -> list[float] | list[int] | list[str]:
        """The cells of rows `start` … `stop`, ready for the conversion."""


@dataclass(frozen=True, eq=False)
class Fixed:
    """A column of numbers (n,) with a fixed count of decimals. Raises `NumberError` on creation."""

    values: Floats
    decimals: int

    def __post_init__(self) -> None:
        if self.values.ndim != 1:
            raise NumberError(f"a column is (n,), not {self.values.shape}")
        # NaN compares false, so one comparison finds NaN, infinities and absurd sizes.
        fine = np.abs(self.values) < LARGEST
        if not fine.all():
            row = int(np.argmin(fine))
            raise NumberError(f"row {row}: {self.values[row]!r} cannot be written as a number")

    @property
    def conversion(self) -> str:
        return f"%.{self.decimals}f"

    def __len__(self) -> int:
        return len(self.values)

    def cells(self, start: int, stop: int) -> list[float]:
        block = self.values[start:stop]
        zero = np.abs(block) <= _largest_zero(self.decimals)
        cells: list[float] = np.where(zero, 0.0, block).tolist()
        return cells


@dataclass(frozen=True, eq=False)
class Whole:
    """A column of whole numbers (n,): configuration data, status bits."""

    values: NDArray[np.integer]

    @property
    def conversion(self) -> str:
        return "%d"

    def __len__(self) -> int:
        return len(self.values)

    def cells(self, start: int, stop: int) -> list[int]:
        cells: list[int] = self.values[start:stop].tolist()
        return cells


@dataclass(frozen=True, eq=False)
class Text:
    """A column of texts (n,), already safe for where the template prints them."""

    values: Texts

    @property
    def conversion(self) -> str:
        return "%s"

    def __len__(self) -> int:
        return len(self.values)

    def cells(self, start: int, stop: int) -> list[str]:
        cells: list[str] = self.values[start:stop].tolist()
        return cells

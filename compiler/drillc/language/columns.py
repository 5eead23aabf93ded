"""Columns of number texts → floats in mm, in bulk, with every bad cell found.

A length in metres is converted by shifting its decimal exponent in the text, so that `0.29` m and
`290` mm become the same float.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from drillc.language.job import Floats
from drillc.language.units import Unit, convert

#: Beyond this no machine reaches; it is where 1e308 and forgotten decimal points are caught.
MAX_LENGTH_MM = 1e6

_PLAIN = re.compile(r"[+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?", re.ASCII)
_ODD = re.compile(r"[^0-9.+-]")
_COMMA = re.compile(r"[+-]?\d+,\d+")
_SHEET_ERROR = re.compile(r"#\w[\w/]*[!?]?")
_NOT_FINITE = re.compile(r"[+-]?(?:nan|inf(?:inity)?)", re.IGNORECASE)


@dataclass
class Cells:
    """One raw column: texts, and the rows whose text is bad with the reason in words."""

    values: Floats
    bad: list[tuple[int, str, str]] = field(default_factory=list)  # row, code, what is wrong


def numbers(texts: Sequence[str], unit: Unit | None, *, optional: bool = False) -> Cells:
    """Convert number texts (surrounding blanks allowed) in `unit` to floats in its base unit.

    Bad cells become NaN and are listed; with `optional`, an empty cell is NaN and fine.
    """
    plain = unit is None or unit.power == 0
    if _ODD.search("".join(texts)):
        return _one_by_one(texts, unit, optional)
    try:
        if plain:
            values = np.array(texts, dtype=np.float64)
        elif unit is not None and unit.power is not None:
            values = np.array([f"{t}e{unit.power}" for t in texts], dtype=np.float64)
        else:
            return _one_by_one(texts, unit, optional)
    except ValueError:
        return _one_by_one(texts, unit, optional)
    return Cells(values)


def _one_by_one(texts: Sequence[str], unit: Unit | None, optional: bool) -> Cells:
    cells = Cells(np.full(len(texts), np.nan))
    for row, raw in enumerate(texts):
        text = raw.strip(" \t")
        if _PLAIN.fullmatch(text):
            cells.values[row] = float(text) if unit is None else convert(text, unit)
        elif text or not optional:
            cells.bad.append((row, *_fault(text)))
    return cells


def _fault(text: str) -> tuple[str, str]:
    if not text:
        return "E315", "is empty"
    if _COMMA.fullmatch(text):
        return "E316", f'is "{text}", with a decimal comma; numbers are written with a point'
    if _SHEET_ERROR.fullmatch(text):
        return "E317", f"is {text[:40]}, a spreadsheet's error value"
    if _NOT_FINITE.fullmatch(text):
        return "E318", f"is {text}, not a finite number"
    return "E315", f'is "{text[:40]}", not a number'

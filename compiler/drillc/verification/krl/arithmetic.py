"""Operators of KRL on values in lanes: numbers, truths, texts, and what is not known."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from drillc.verification.machine import UNDECIDED, Machine

_COMPARE: Mapping[str, Callable[[Any, Any], Any]] = {
    "==": operator.eq,
    "<>": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
    "<=": operator.le,
    ">=": operator.ge,
}


def is_truth(value: Any) -> bool:
    """TRUE or FALSE, in all lanes or one a lane, or one of them, unknown which."""
    if isinstance(value, np.ndarray):
        return bool(value.dtype == np.bool_)
    return value is UNDECIDED or isinstance(value, bool | np.bool_)


def is_number(value: Any) -> bool:
    """A number, or one a lane."""
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "if"
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def is_whole(value: Any) -> bool:
    """A value of type INT."""
    if isinstance(value, np.ndarray):
        return bool(value.dtype.kind == "i")
    return isinstance(value, int | np.integer) and not isinstance(value, bool)


def number(m: Machine, value: Any) -> Any:
    """The value, if it is a number. Raises ReadError."""
    if not is_number(value):
        raise m.fail(f"{shown(value)} is no number")
    return value


def truth(m: Machine, value: Any) -> Any:
    """The value, if it is a truth. Raises ReadError."""
    if not is_truth(value):
        raise m.fail(f"{shown(value)} is neither TRUE nor FALSE")
    return value


def one(m: Machine, value: Any, what: str) -> int:
    """A whole number that is the same in all lanes. Raises ReadError."""
    if isinstance(value, np.ndarray):
        if value.size and (value != value[0]).any():
            raise m.fail(f"{what} differs from hole to hole")
        value = value[0].item()
    if not is_whole(value):
        raise m.fail(f"{what} is {shown(value)}, no whole number")
    return int(value)


def shown(value: Any) -> str:
    """A value in a message."""
    if isinstance(value, dict):
        return "a structure"
    if isinstance(value, list):
        return "an array"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, np.ndarray):
        return shown(value[0].item()) if value.ndim == 1 and len(value) else "a value"
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    return f"{value:g}" if isinstance(value, int | float) else "a value that is not known"


def calculate(m: Machine, sign: str, left: Any, right: Any) -> Any:
    """+ - * /; of whole numbers, / leaves no rest. Raises ReadError."""
    a, b = number(m, left), number(m, right)
    if sign == "+":
        return a + b
    if sign == "-":
        return a - b
    if sign == "*":
        return a * b
    if np.any(np.asarray(b) == 0):
        raise m.fail("division by zero")
    if is_whole(a) and is_whole(b):
        quotient = np.trunc(np.asarray(a) / np.asarray(b)).astype(np.int64)
        return quotient if quotient.ndim else int(quotient)
    return a / b


def compare(m: Machine, sign: str, left: Any, right: Any) -> Any:
    """A comparison. With what is not known it is UNDECIDED; lanes that know part from those that
    do not. Raises ReadError."""
    if left is UNDECIDED or right is UNDECIDED:
        return UNDECIDED
    if is_number(left) and is_number(right):
        unknown = np.isnan(left) | np.isnan(right)
        if np.any(unknown):
            if isinstance(unknown, np.ndarray) and unknown.ndim and not unknown.all():
                m.part(unknown)
            return UNDECIDED
    elif not (is_truth(left) and is_truth(right)) and not (
        isinstance(left, str) and isinstance(right, str)
    ):
        raise m.fail(f"{shown(left)} and {shown(right)} cannot be compared")
    if not is_number(left) and sign not in ("==", "<>"):
        raise m.fail(f"{shown(left)} has no order")
    found = _COMPARE[sign](left, right)
    return found if isinstance(found, np.ndarray) and found.ndim else bool(found)


def combine(m: Machine, word: str, left: Any, right: Any) -> Any:
    """AND, OR and EXOR; of whole numbers too, as B_AND and so on. Raises ReadError."""
    if word.startswith("B_"):
        if not (is_whole(left) and is_whole(right)):
            raise m.fail(f"{word} takes whole numbers")
        calculated = {"B_AND": operator.and_, "B_OR": operator.or_, "B_EXOR": operator.xor}
        return calculated[word](left, right)
    a, b = truth(m, left), truth(m, right)
    if a is UNDECIDED or b is UNDECIDED:
        known = b if a is UNDECIDED else a
        if known is not UNDECIDED and word != "EXOR":
            decides = np.asarray(known) == (word == "OR")
            if decides.all():
                return word == "OR"
            if decides.any():
                m.part(decides)
        return UNDECIDED
    return {"AND": operator.and_, "OR": operator.or_, "EXOR": operator.xor}[word](a, b)


def opposite(m: Machine, value: Any) -> Any:
    """NOT. Raises ReadError."""
    if truth(m, value) is UNDECIDED:
        return UNDECIDED
    return ~value if isinstance(value, np.ndarray) else not value


def converted(m: Machine, value: Any, type_: str) -> Any:
    """A plain value as a variable of the type keeps it. Raises ReadError."""
    if type_ == "BOOL":
        return truth(m, value)
    if type_ == "REAL":
        value = number(m, value)
        return value.astype(np.float64) if isinstance(value, np.ndarray) else float(value)
    if type_ == "INT":
        value = number(m, value)
        if is_whole(value):
            return value
        rounded = np.floor(np.asarray(value) + 0.5)
        if not np.isfinite(rounded).all():
            raise m.fail("a value that is not known becomes no whole number")
        return rounded.astype(np.int64) if rounded.ndim else int(rounded)
    if type_ == "CHAR" and not isinstance(value, str):
        raise m.fail(f"{shown(value)} is no text")
    return value

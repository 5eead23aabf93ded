"""Arithmetic, comparisons and truths over values that may be one a lane, or not known."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..machine import UNDECIDED, Undecided
from ..values import NotUniform
from .types import Value


def compared(operator: str, one: Value, two: Value) -> Value:
    """The truth of a comparison; UNDECIDED where a value is not known."""
    if isinstance(one, Undecided) or isinstance(two, Undecided):
        return UNDECIDED
    if isinstance(one, str | list):
        equal = _equal(one, two)
        return equal if operator == "=" else denied(equal)
    if (unknown := _unknown(one) | _unknown(two)) is not False:
        if not isinstance(unknown, np.ndarray) or unknown.all():
            return UNDECIDED
        if unknown.any():
            raise NotUniform
    match operator:
        case "=":
            return one == two
        case "<>":
            return one != two
        case "<":
            return one < two
        case ">":
            return one > two
        case "<=":
            return one <= two
        case _:
            return one >= two


def _unknown(value: Value) -> Any:
    return value != value if isinstance(value, float | np.ndarray) else False


def _equal(one: Value, two: Value) -> Value:
    if isinstance(one, str):
        return one == two
    if isinstance(one, list):
        truth: Value = True
        for a, b in zip(one, two, strict=True):
            truth = both(truth, _equal(a, b))
        return truth
    return compared("=", one, two)


def denied(truth: Value) -> Value:
    if isinstance(truth, Undecided):
        return truth
    return ~truth if isinstance(truth, np.ndarray) else not truth


def both(one: Value, two: Value) -> Value:
    """AND: what is not known does not matter beside FALSE."""
    for a, b in ((one, two), (two, one)):
        if isinstance(a, Undecided):
            if isinstance(b, np.ndarray) and not b.all():
                if b.any():
                    raise NotUniform
                return False
            return a if isinstance(b, np.ndarray | Undecided) or b else False
    if isinstance(one, np.ndarray) or isinstance(two, np.ndarray):
        return np.logical_and(one, two)
    return one and two


def either(one: Value, two: Value) -> Value:
    return denied(both(denied(one), denied(two)))


def one_of(one: Value, two: Value) -> Value:
    """XOR."""
    if isinstance(one, Undecided) or isinstance(two, Undecided):
        return UNDECIDED
    different = np.asarray(one) != np.asarray(two)
    return different if different.ndim else bool(different)


def whole(value: Value) -> int | None:
    """A whole number that is the same in all lanes; None where it is none."""
    if isinstance(value, np.ndarray):
        if (value != value[0]).any():
            raise NotUniform
        value = float(value[0])
    return int(value) if value == value and float(value).is_integer() else None


def part_of(value: Value, path: Sequence[int]) -> Value:
    for place in path:
        value = value[place]
    return value


def with_part(value: Value, path: Sequence[int], new: Value) -> Value:
    """A copy of the value with another part in place."""
    if not path:
        return new
    copy = list(value)
    copy[path[0]] = with_part(copy[path[0]], path[1:], new)
    return copy


def divided(operator: str, one: Value, two: Value) -> Value:
    """`/`, DIV or MOD; the divisor is not 0."""
    if operator == "/":
        return one / two
    quotient = np.trunc(np.asarray(one) / np.asarray(two))
    result = quotient if operator == "DIV" else np.asarray(one) - quotient * np.asarray(two)
    return result if result.ndim else float(result)

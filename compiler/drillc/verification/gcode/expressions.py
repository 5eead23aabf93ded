"""Values as LinuxCNC computes them: numbers that are the same in all lanes, or one a lane.

What hangs on where the axes stand before they are first moved is NaN: LinuxCNC's own arithmetic has
none, so NaN always means that nobody knows.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..machine import UNDECIDED, Machine
from ..statements import Evaluate
from ..values import NotUniform
from .parameters import exists, get_named, get_numbered
from .syntax import Constant, Exists, Named, Numbered, Operation, Slot, Value

#: Numbers closer than this are EQ (LinuxCNC 2.9; from 2.10 on 0.000001).
TOLERANCE_EQUAL = 0.0001

Number = Any  # float, or an array (lanes,)
#: Gives the value of a line's own number.
Slots = Callable[[int], Evaluate]


def compiled(value: Value, slots: Slots) -> Evaluate:
    """A function of the machine that gives a value."""
    match value:
        case Slot():
            return slots(value.index)
        case Constant():
            constant = value.value
            return lambda machine: constant
        case Named():
            name = value.name
            return lambda machine: get_named(machine, name)
        case Numbered():
            index = compiled(value.index, slots)
            return lambda machine: get_numbered(machine, index(machine))
        case Exists():
            where = value.parameter
            return lambda machine: 1.0 if exists(machine, where) else 0.0
        case Operation():
            operate = _OPERATIONS[value.name]
            operands = [compiled(operand, slots) for operand in value.operands]
            return lambda machine: operate(machine, *[part(machine) for part in operands])


def truth(machine: Machine, value: Number) -> Any:
    """Whether a number counts as true: anything but 0; UNDECIDED where nobody knows."""
    unknown = np.isnan(value)
    if isinstance(value, np.ndarray) and unknown.any() and not unknown.all():
        raise NotUniform
    if unknown.any() if isinstance(value, np.ndarray) else unknown:
        return UNDECIDED
    return value != 0.0


def never(machine: Machine, wrong: Any, message: str) -> None:
    """Refuse what is wrong in any lane."""
    if np.any(wrong):
        raise machine.fail(message)


def plain(value: Any) -> Number:
    """A number, or an array of them; not numpy's own single numbers."""
    return value if isinstance(value, np.ndarray) else float(value)


def whole_number(machine: Machine, value: Number, what: str) -> int:
    """A value that must be the same whole number in all lanes."""
    if isinstance(value, np.ndarray):
        if (value != value[0]).any():
            raise NotUniform
        value = value[0]
    never(machine, not math.isfinite(value), f"{what} is not known")
    number = round(float(value))
    never(machine, abs(value - number) > 0.0001, f"{what} is {value:g}, which is no whole number")
    return number


# ── functions and operators ──────────────────────────────────────────────────────────────────────


def _function(of: Callable[[Any], Any]) -> Callable[..., Number]:
    return lambda machine, value: plain(of(value))


def _checked(
    of: Callable[[Any], Any], wrong: Callable[[Any], Any], message: str
) -> Callable[..., Number]:
    def operate(machine: Machine, value: Number) -> Number:
        never(machine, wrong(value), message)
        return plain(of(value))

    return operate


def _ratio(machine: Machine, left: Number, right: Number) -> Number:
    never(machine, right == 0.0, "a division by zero")
    return left / right


def _modulo(machine: Machine, left: Number, right: Number) -> Number:
    """Never negative."""
    never(machine, right == 0.0, "a division by zero")
    rest = np.fmod(left, right)
    return plain(np.where(rest < 0.0, rest + np.abs(right), rest)[()])


def _power(machine: Machine, left: Number, right: Number) -> Number:
    wrong = (left < 0.0) & (np.floor(right) != right)
    never(machine, wrong, "a negative number to a power that is not whole")
    never(machine, (left == 0.0) & (right < 0.0), "a division by zero")
    return plain(np.power(left, right))


def _atan(machine: Machine, above: Number, below: Number) -> Number:
    return plain(np.degrees(np.arctan2(above, below)))


def _round(value: Any) -> Any:
    """Halves away from zero."""
    return np.trunc(value + np.where(np.less(value, 0.0), -0.5, 0.5))


def _relation(of: Callable[[Any, Any], Any]) -> Callable[..., Number]:
    def operate(machine: Machine, left: Number, right: Number) -> Number:
        unknown = np.isnan(left) | np.isnan(right)
        return plain(np.where(unknown, np.nan, of(left, right))[()])

    return operate


def _logic(of: Callable[[Any, Any], Any], decides: float | None) -> Callable[..., Number]:
    """`decides`: a truth of either side that settles the matter, whatever the other is."""

    def operate(machine: Machine, left: Number, right: Number) -> Number:
        one, two = np.not_equal(left, 0.0), np.not_equal(right, 0.0)
        unknown = np.isnan(left) | np.isnan(right)
        if decides is not None:
            settled = (~np.isnan(left) & (one == decides)) | (~np.isnan(right) & (two == decides))
            unknown = unknown & ~settled
        return plain(np.where(unknown, np.nan, of(one, two))[()])

    return operate


def _close(left: Any, right: Any) -> Any:
    return np.abs(np.subtract(left, right)) < TOLERANCE_EQUAL


_OPERATIONS: dict[str, Callable[..., Number]] = {
    "negative": lambda machine, value: -value,
    "+": lambda machine, left, right: left + right,
    "-": lambda machine, left, right: left - right,
    "*": lambda machine, left, right: left * right,
    "/": _ratio,
    "mod": _modulo,
    "**": _power,
    "eq": _relation(_close),
    "ne": _relation(lambda left, right: ~np.bool_(_close(left, right))),
    "lt": _relation(np.less),
    "le": _relation(np.less_equal),
    "gt": _relation(np.greater),
    "ge": _relation(np.greater_equal),
    "and": _logic(np.logical_and, 0.0),
    "or": _logic(np.logical_or, 1.0),
    "xor": _logic(np.logical_xor, None),
    "abs": _function(np.abs),
    "acos": _checked(
        lambda v: np.degrees(np.arccos(v)), lambda v: np.abs(v) > 1.0, "ACOS of more than 1"
    ),
    "asin": _checked(
        lambda v: np.degrees(np.arcsin(v)), lambda v: np.abs(v) > 1.0, "ASIN of more than 1"
    ),
    "atan": _atan,
    "cos": _function(lambda v: np.cos(np.radians(v))),
    "exp": _function(np.exp),
    "fix": _function(np.floor),
    "fup": _function(np.ceil),
    "ln": _checked(np.log, lambda v: v <= 0.0, "LN of a number that is not positive"),
    "round": _function(_round),
    "sin": _function(lambda v: np.sin(np.radians(v))),
    "sqrt": _checked(np.sqrt, lambda v: v < 0.0, "SQRT of a negative number"),
    "tan": _function(lambda v: np.tan(np.radians(v))),
}

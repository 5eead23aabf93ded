"""What the controller keeps from statement to statement, beside the program's data."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..machine import Machine
from .types import Value

AXES = tuple(f"rax_{i}" for i in range(1, 7)) + tuple(f"eax_{letter}" for letter in "abcdef")
_UNKNOWN = math.nan
#: What is known of a position of which nothing is known.
NO_TARGET = [[_UNKNOWN] * 3, [_UNKNOWN] * 4, [_UNKNOWN] * 4, [_UNKNOWN] * 6]


def first_state(data: Mapping[str, Value]) -> dict[str, Any]:
    """As a program begins: nobody knows where the axes stand, and configurations are watched.

    `passed`: file, line and name of the zone of a move that was not carried through to its end,
    from where to where it went, and its speed; an empty list where the axes stand.
    """
    return {
        "locals": [{}],
        "data": dict(data),
        "joints": [_UNKNOWN] * len(AXES),
        "target": NO_TARGET,
        "tool": -1,
        "base": -1,
        "confj": True,
        "confl": True,
        "passed": [],
    }


def joints_now(m: Machine) -> Value:
    """The jointtarget where the axes stand; NaN where they do not follow from the program."""
    joints = m.state["joints"]
    return [list(joints[:6]), list(joints[6:])]


def target_now(m: Machine, tool: int, base: int) -> Value:
    """The robtarget where the tool stands; NaN where it does not follow from the program. Tool and
    base are those of the last move, or -1: whichever is active."""
    known = tool in (-1, m.state["tool"]) and base in (-1, m.state["base"])
    target: Value = m.state["target"] if known else NO_TARGET
    return target


def per_lane(m: Machine, values: Value) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Values, each a number or one a lane, as rows (lanes, k)."""
    rows = np.empty((m.lanes, len(values)))
    for i, value in enumerate(values):
        rows[:, i] = value
    return rows

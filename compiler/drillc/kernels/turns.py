"""Whole turns of rotary joints: which of the angles that differ by 2 pi lie inside the limits.

An inverse kinematics gives each joint in (-pi, pi]; a joint that runs farther (KUKA's axes 4 and 6
reach ±350 degrees) stands the same at up to two or more values, and each is a solution of its own.
Along one axis and a whole sequence, `windings.py` chooses; here all joints of single poses are
meant. An angle up to 1e-12 rad outside the limits is let pass, as it is.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_TURN_RAD = 2.0 * np.pi
_SLACK_RAD = 1e-12


def all_turns(
    joints_rad: Floats, low_rad: Floats, high_rad: Floats
) -> tuple[NDArray[np.intp], Floats]:
    """Every way to add whole turns to the joints (m, 6) that leaves all inside low, high, (6,) or
    (m, 6).

    Returns (index (k,), joints (k, 6)): the row that each alternative is of, and its angles. Rows
    come in their order, a row's alternatives ascending as numbers of six digits would (the last
    joint changes fastest). A row with a joint that is NaN or never inside has none. The number of
    alternatives is the product over the joints, so endless axes should be given limits that are
    worth having. Raises ValueError unless the limits are finite and low <= high.
    """
    first, last = _turns_inside(joints_rad, low_rad, high_rad)
    choices = np.nan_to_num(np.maximum(last - first + 1.0, 0.0)).astype(np.intp)
    alternatives = choices.prod(axis=1)
    index = np.repeat(np.arange(len(choices)), alternatives)
    begins = np.cumsum(alternatives) - alternatives
    rank = np.arange(len(index)) - begins[index]  # within its row, then digit by digit
    turns = first[index]
    for joint in reversed(range(choices.shape[1])):
        rank, digit = np.divmod(rank, choices[index, joint])
        turns[:, joint] += digit
    return index, joints_rad[index] + turns * _TURN_RAD


def _turns_inside(joints_rad: Floats, low_rad: Floats, high_rad: Floats) -> tuple[Floats, Floats]:
    """The fewest and the most turns to add (m, 6), whole numbers; fewest > most: none, NaN: NaN."""
    if (
        not (np.isfinite(low_rad).all() and np.isfinite(high_rad).all())
        or (low_rad > high_rad).any()
    ):
        raise ValueError(f"limits {low_rad} .. {high_rad} rad are not finite and in order")
    first = np.ceil((low_rad - _SLACK_RAD - joints_rad) / _TURN_RAD)
    last = np.floor((high_rad + _SLACK_RAD - joints_rad) / _TURN_RAD)
    return first, last

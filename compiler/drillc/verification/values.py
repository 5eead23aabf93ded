"""Values that are the same in all lanes, or one a lane.

Statements that are repeated with other numbers are run once, for all of them: a *lane* each. A
value is a number, truth or text; or an array (lanes,) of numbers or truths; or a list or a
dictionary of values. Arrays are never changed in place.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Value = Any
Lanes = NDArray[np.intp]


class NotUniform(Exception):  # noqa: N818 (a finding about lanes, handled by the machine)
    """Lanes differ in something that is neither a number nor a truth."""


def select(value: Value, lanes: Lanes) -> Value:
    """The same value with only some of its lanes."""
    if isinstance(value, dict):
        return {key: select(part, lanes) for key, part in value.items()}
    if isinstance(value, list):
        return [select(part, lanes) for part in value]
    return value[lanes] if isinstance(value, np.ndarray) else value


def copied(value: Value) -> Value:
    """A copy whose lists and dictionaries can be changed."""
    if isinstance(value, dict):
        return {key: copied(part) for key, part in value.items()}
    return [copied(part) for part in value] if isinstance(value, list) else value


def same(one: Value, two: Value) -> bool:
    """Whether two values agree in every lane; NaN agrees with NaN."""
    if isinstance(one, dict) and isinstance(two, dict):
        return one.keys() == two.keys() and all(same(one[key], two[key]) for key in one)
    if isinstance(one, list) and isinstance(two, list):
        return len(one) == len(two) and all(map(same, one, two))
    if isinstance(one, np.ndarray) or isinstance(two, np.ndarray):
        a, b = np.asarray(one), np.asarray(two)
        if a.dtype.kind not in "bfiu" or b.dtype.kind not in "bfiu":
            return False
        return bool(((a == b) | ((a != a) & (b != b))).all())
    return type(one) is type(two) and (one == two or (one != one and two != two))


def gathered(parts: list[tuple[Lanes, Value]], count: int) -> Value:
    """One value over all `count` lanes from values over some lanes each. Raises NotUniform."""
    values = [value for _, value in parts]
    first = values[0]
    if len(parts) == 1 or all(
        not isinstance(value, np.ndarray | dict | list) and same(value, first) for value in values
    ):
        return first
    if all(isinstance(value, dict) for value in values):
        if any(value.keys() != first.keys() for value in values):
            raise NotUniform
        return {key: gathered([(lanes, v[key]) for lanes, v in parts], count) for key in first}
    if all(isinstance(value, list) for value in values):
        if any(len(value) != len(first) for value in values):
            raise NotUniform
        return [gathered([(ln, v[i]) for ln, v in parts], count) for i in range(len(first))]
    if any(np.asarray(value).dtype.kind not in "bfiu" for value in values):
        raise NotUniform
    whole = np.empty(count, dtype=np.result_type(*(np.asarray(value).dtype for value in values)))
    for lanes, value in parts:
        whole[lanes] = value
    return whole


def passed_on(first: Value, ends: Value, count: int) -> Value:
    """What each lane begins with when each goes on where the lane before it ended: `first`, then
    all of `ends` but the last. Raises NotUniform."""
    if isinstance(first, dict) and isinstance(ends, dict) and first.keys() == ends.keys():
        return {key: passed_on(first[key], ends[key], count) for key in first}
    if isinstance(first, list) and isinstance(ends, list) and len(first) == len(ends):
        return [passed_on(a, b, count) for a, b in zip(first, ends, strict=True)]
    if not isinstance(ends, np.ndarray) and same(first, ends):
        return first
    if isinstance(first, list | dict) or isinstance(ends, list | dict):
        raise NotUniform
    a, b = np.asarray(first), np.asarray(ends)
    if a.dtype.kind not in "bfiu" or b.dtype.kind not in "bfiu":
        raise NotUniform
    whole = np.empty(count, dtype=np.result_type(a.dtype, b.dtype))
    whole[0] = first
    whole[1:] = b[:-1] if b.ndim else ends
    return whole


def carried(
    first: Value, begin: Value, ends: Value, wrote: Value, count: int
) -> tuple[Value, Value]:
    """A guess at what each lane begins with, better than `passed_on` gives: a lane that was never
    seen to end with another value than it began with hands on what comes to it. Also which lanes
    were seen to, for the next guess (`wrote`; None for the first). Raises NotUniform."""
    if isinstance(first, dict) and isinstance(ends, dict) and first.keys() == ends.keys():
        parts = {
            key: carried(first[key], begin[key], ends[key], wrote and wrote.get(key), count)
            for key in first
        }
        return {key: p[0] for key, p in parts.items()}, {key: p[1] for key, p in parts.items()}
    if not isinstance(ends, np.ndarray) or isinstance(first, list | dict):
        return passed_on(first, ends, count), None
    changed = ~((ends == begin) | ((ends != ends) & (begin != begin)))
    if wrote is not None:
        changed = changed | wrote
    latest = np.maximum.accumulate(np.where(changed, np.arange(count), -1))[:-1]
    whole = np.empty(count, dtype=np.result_type(np.asarray(first).dtype, ends.dtype))
    whole[0] = first
    whole[1:] = np.where(latest < 0, first, ends[latest])
    return whole, changed


def last_lane(value: Value) -> Value:
    """The value in the last lane, as plain numbers."""
    if isinstance(value, dict):
        return {key: last_lane(part) for key, part in value.items()}
    if isinstance(value, list):
        return [last_lane(part) for part in value]
    return value[-1].item() if isinstance(value, np.ndarray) else value

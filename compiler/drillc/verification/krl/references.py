"""Variables: where they are kept, how they are read and written."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from drillc.verification.machine import Machine

from .arithmetic import converted, is_whole, shown
from .frames import Pose, components
from .words import PLAIN, POSITIONS, STRUCTURES

Evaluate = Callable[[Machine], Any]


@dataclass(frozen=True)
class Reference:
    """A variable or a part of it. `type`: empty if not known; `write`: None for constants."""

    name: str  # for messages
    type: str
    read: Evaluate
    write: Callable[[Machine, Any], None] | None = None


@dataclass(frozen=True)
class Part:
    """.NAME"""

    name: str


@dataclass(frozen=True)
class Index:
    """[i] or [i,j]"""

    places: tuple[Evaluate, ...]


Suffix = Part | Index


def kept(
    name: str,
    type_: str,
    final: str,
    read: Evaluate,
    write: Callable[[Machine, Any], None] | None,
    suffixes: Sequence[Suffix],
) -> Reference:
    """A reference to `name` with its suffixes: `read` and `write` are those of the whole variable
    of type `type_`, `final` the type of the part."""
    label = name + "".join(f".{s.name}" for s in suffixes if isinstance(s, Part))

    def read_part(m: Machine) -> Any:
        value = read(m)
        for suffix in suffixes:
            value = _part(m, value, suffix, label)
        if value is None or (isinstance(value, dict) and not value):
            raise m.fail(f"{label} has no value")
        return value

    def write_part(m: Machine, value: Any) -> None:
        assert write is not None
        fitting = fitted(m, value, final, label)
        write(m, _replaced(m, read(m) if suffixes else None, suffixes, fitting, label))

    return Reference(label, final, read_part, write_part if write is not None else None)


def fitted(m: Machine, value: Any, type_: str, label: str) -> Any:
    """A value as a variable of the type keeps it: positions have the components of their type.
    Raises ReadError."""
    if type_ in POSITIONS:
        if isinstance(value, Pose):
            value = components(value)
        if not isinstance(value, dict):
            raise m.fail(f"{shown(value)} is no {type_}")
        kept_parts = {name: value[name] for name in STRUCTURES[type_] if name in value}
        if value and not kept_parts:
            raise m.fail(f"what {label} is to be is no {type_}")
        return kept_parts
    if type_ in PLAIN:
        if isinstance(value, list) and type_ != "CHAR":
            return list(value)
        return converted(m, value, type_)
    if isinstance(value, Pose):
        return components(value)
    return dict(value) if isinstance(value, dict) else value


def unset(type_: str, dims: Sequence[int]) -> Any:
    """A variable before it has a value."""
    if dims and type_ != "CHAR":
        return [unset(type_, dims[1:]) for _ in range(dims[0])]
    return None if type_ in PLAIN else {}


def listed(elements: Mapping[int, Any], type_: str, dims: Sequence[int]) -> Any:
    """An array of a data list, from the values of its elements by their place."""
    if len(dims) == 1:
        nothing = unset(type_, ())
        return [elements.get(place + 1, nothing) for place in range(dims[0])]
    size = int(np.prod(dims[1:]))
    rows: list[Any] = []
    for row in range(dims[0]):
        part = {
            p - row * size: v for p, v in elements.items() if row * size < p <= (row + 1) * size
        }
        rows.append(listed(part, type_, dims[1:]))
    return rows


def _part(m: Machine, value: Any, suffix: Suffix, label: str) -> Any:
    if isinstance(suffix, Part):
        if not isinstance(value, dict):
            raise m.fail(f"{label}: there are no components")
        if suffix.name not in value:
            raise m.fail(f"{label} has no value")
        return value[suffix.name]
    for place in suffix.places:
        if not isinstance(value, list):
            raise m.fail(f"{label} is no array")
        value = _element(m, value, place(m), label)
    return value


def _element(m: Machine, values: list[Any], place: Any, label: str) -> Any:
    if not is_whole(place):
        raise m.fail(f"{label}[{shown(place)}]: the place of an element is a whole number")
    low, high = int(np.min(place)), int(np.max(place))
    if low < 1 or high > len(values):
        wrong = low if low < 1 else high
        raise m.fail(f"{label} has elements 1 to {len(values)}, not {wrong}")
    if not isinstance(place, np.ndarray):
        return values[place - 1]
    if low == high:
        return values[low - 1]
    gathered = by_lane([values[i - 1] for i in place.tolist()])
    if gathered is None:
        raise m.fail(f"an element of {label} has no value, or other components than the rest")
    return gathered


def by_lane(values: Sequence[Any]) -> Any:
    """One value a lane as one value; None if they are not of one kind."""
    first = values[0]
    if isinstance(first, dict):
        if not first or any(not isinstance(v, dict) or v.keys() != first.keys() for v in values):
            return None
        parts = {name: by_lane([value[name] for value in values]) for name in first}
        return None if any(part is None for part in parts.values()) else parts
    if any(value is None or isinstance(value, str | dict | list) for value in values):
        return None
    if any(isinstance(value, np.ndarray) for value in values):
        return None
    return np.array(values)


def _replaced(m: Machine, whole: Any, suffixes: Sequence[Suffix], value: Any, label: str) -> Any:
    """The whole variable with one part of it changed."""
    if not suffixes:
        return value
    first, rest = suffixes[0], suffixes[1:]
    if isinstance(first, Part):
        if whole is None:
            whole = {}
        if not isinstance(whole, dict):
            raise m.fail(f"{label}: there are no components")
        return {**whole, first.name: _replaced(m, whole.get(first.name), rest, value, label)}
    return _in_list(m, whole, first.places, rest, value, label)


def _in_list(
    m: Machine,
    whole: Any,
    places: Sequence[Evaluate],
    rest: Sequence[Suffix],
    value: Any,
    label: str,
) -> Any:
    if not places:
        return _replaced(m, whole, rest, value, label)
    if not isinstance(whole, list):
        raise m.fail(f"{label} is no array")
    place = places[0](m)
    if isinstance(place, np.ndarray):
        raise m.fail(f"{label}: which element is written differs from hole to hole")
    old = _element(m, whole, place, label)
    changed = list(whole)
    changed[place - 1] = _in_list(m, old, places[1:], rest, value, label)
    return changed

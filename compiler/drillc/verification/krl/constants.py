"""Values that are written down: numbers, texts, and aggregates of a type."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from lark import Tree

from .tree import Node, column_of, number_of, upper, written
from .words import FRAME, MOST_STATUS, MOST_TURN, POSES, POSITIONS, STATUS, STRUCTURES

#: Says what is wrong, in which column.
Fail = Callable[[int, str], Exception]

#: Types of components whose own components are checked.
_INNER = {("LOAD", "CM"): "FRAME", ("LOAD", "J"): "INERTIA"}


def constant(tree: Any, type_: str, types: Mapping[str, Mapping[str, str]], fail: Fail) -> Any:
    """The value of a constant of a type. `types`: structures of the program. Raises what `fail`
    makes."""
    if (number := number_of(tree)) is not None:
        if type_ == "BOOL" or type_ in STRUCTURES or type_ in types:
            raise fail(column_of(tree), f"a number is no {type_}")
        return float(number) if type_ == "REAL" else number
    if isinstance(tree, Tree):
        token = tree.children[0] if tree.children else None
        if tree.data == "truth":
            return str(token).upper() == "TRUE"
        if tree.data == "text":
            return str(token)[1:-1]
        if tree.data == "constant":
            return str(token).upper()
        if tree.data == "bits":
            return bits(str(token))
        if tree.data == "aggregate":
            return aggregate(tree, type_, types, fail)
    raise fail(column_of(tree), "a data list holds constants only")


def bits(text: str) -> int:
    """'B0101', 'HFF' or '12' as a number."""
    digits = text.strip("'").upper()
    base = {"B": 2, "H": 16}.get(digits[0], 10)
    return int(digits[1:] if base != 10 else digits, base)


def components_of(type_: str, types: Mapping[str, Mapping[str, str]]) -> tuple[str, ...] | None:
    """The components that a type has; None if they are not known."""
    if type_ in types:
        return tuple(types[type_])
    return STRUCTURES.get(type_)


def aggregate(
    tree: Node, type_: str, types: Mapping[str, Mapping[str, str]], fail: Fail
) -> dict[str, Any]:
    """{X 1.0,Y -2.0,…}: each component once, all of the type's."""
    named, *components = tree.children
    if named is not None:
        type_ = upper(named)
    known = components_of(type_, types)
    value: dict[str, Any] = {}
    for component in components:
        assert isinstance(component, Tree)
        name, _, part = component.children
        key = upper(name)
        if known is not None and key not in known:
            shown = written(name)
            raise fail(column_of(component), f"{type_} has no component {shown}")
        if key in value:
            raise fail(column_of(component), f"{key} is given twice")
        inner = types[type_].get(key, "") if type_ in types else _INNER.get((type_, key), "")
        value[key] = constant(part, inner, types, fail)
        if type_ in POSITIONS:
            if isinstance(value[key], bool) or not isinstance(value[key], int | float):
                raise fail(column_of(component), f"{key} is no number")
            value[key] = float(value[key])
    return value


def whole(type_: str, names: Iterable[str]) -> str:
    """What a position lacks, or has and should not; empty: nothing. `names`: its components."""
    has = set(names)
    if type_ in POSES and not has >= set(FRAME):
        missing = [name for name in FRAME if name not in has]
        return f"{', '.join(missing)} {'has' if len(missing) == 1 else 'have'} no value"
    if len(has & set(STATUS)) == 1:
        return "S and T belong together"
    return ""


def status_fault(name: str, value: float) -> str:
    """What is wrong with the value of S or T; empty: nothing."""
    most = MOST_STATUS if name == "S" else MOST_TURN
    if value == int(value) and 0 <= value <= most:
        return ""
    return f"{name} is {value:g}, and goes from 0 to {most}"

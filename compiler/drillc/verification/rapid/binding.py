"""How the parameters of a routine get their values, and give them back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..machine import Machine
from .arguments import Arguments
from .data import Head, Parameter
from .expressions import Scope
from .types import TOOLDATA, WOBJDATA, Value
from .variables import NAME_OF

Gets = dict[str, Callable[[Machine], Value]]
Puts = dict[str, Callable[[Machine, Value], None]]


def bound(head: Head, arguments: Arguments) -> tuple[Gets, Puts]:
    """How each parameter gets its value, and how those by reference give it back. Raises
    ReadError."""
    needed = [p for p in head.parameters if not p.optional]
    arguments.count(len(needed))
    arguments.only(*(p.name.lower() for p in head.parameters if p.optional))
    gets: Gets = {}
    backs: Puts = {}
    given = {p.name: tree for p, tree in zip(needed, arguments.given, strict=True)}
    for parameter in head.parameters:
        name = parameter.name
        if parameter.optional and name.lower() not in arguments.options:
            gets[name] = _absent
            continue
        tree = given.get(name, arguments.options.get(name.lower()))
        if parameter.switch:
            gets[name] = lambda m: True
            continue
        if tree is None:
            raise arguments.error(f"\\{name} of {head.name} needs a value")
        _bind(parameter, tree, arguments.scope, gets, backs)
    return gets, backs


def _absent(m: Machine) -> Value:
    return None


def _bind(parameter: Parameter, tree: Any, scope: Scope, gets: Gets, backs: Puts) -> None:
    name = parameter.name
    if parameter.kind in (TOOLDATA, WOBJDATA):
        typed, named = scope.named(tree, parameter.kind)
        gets[name], gets[NAME_OF + name] = typed.get, named
        return
    if parameter.by_reference:
        if tree.data != "variable":
            raise scope.error(tree, f"{name} is given back: a variable is wanted here")
        variable = scope.variable(tree)
        if variable.set is None:
            raise scope.error(tree, f"{name} is given back: a constant cannot be changed")
        backs[name] = variable.set
    gets[name] = scope.of_type(tree, parameter.kind).get

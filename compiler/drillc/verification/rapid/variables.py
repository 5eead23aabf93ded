"""What an expression is to the machine: a value to be had and, of a variable, to be set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..machine import Machine
from .types import Type, Value
from .values import part_of, with_part

Get = Callable[[Machine], Value]

#: What stands for the name of a tool or work object beside its value, in a routine's variables.
NAME_OF = "name of "


@dataclass(frozen=True)
class Typed:
    """An expression. `fixed`: it hangs on nothing that can change."""

    kind: Type
    get: Get
    fixed: bool = False


@dataclass(frozen=True)
class Local:
    """A variable of a routine; `key`: where it stands among the variables."""

    kind: Type
    key: str
    constant: bool = False


@dataclass(frozen=True)
class Variable:
    """A name with a path of parts: what it holds, and how it is given a value."""

    typed: Typed
    set: Callable[[Machine, Value], None] | None  # None: a constant


def part(root: Variable, kind: Type, places: Sequence[int | Typed]) -> Variable:
    def path(m: Machine) -> list[int]:
        return [place if isinstance(place, int) else place.get(m) for place in places]

    def put(m: Machine, value: Value) -> None:
        assert root.set is not None
        root.set(m, with_part(root.typed.get(m), path(m), value))

    fixed = root.typed.fixed and all(isinstance(p, int) or p.fixed for p in places)
    if all(isinstance(place, int) for place in places):
        steps = [place for place in places if isinstance(place, int)]
        typed = Typed(kind, lambda m: part_of(root.typed.get(m), steps), fixed)
    else:
        typed = Typed(kind, lambda m: part_of(root.typed.get(m), path(m)), fixed)
    return Variable(typed, None if root.set is None else put)


def set_local(name: str) -> Callable[[Machine, Value], None]:
    def put(m: Machine, value: Value) -> None:
        m.locals[name] = value

    return put


def set_data(name: str) -> Callable[[Machine, Value], None]:
    def put(m: Machine, value: Value) -> None:
        m.state["data"][name] = value

    return put


def in_state(kind: Type, name: str) -> Variable:
    return Variable(Typed(kind, lambda m: m.state["data"][name]), set_data(name))

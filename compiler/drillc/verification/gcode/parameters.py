"""Parameters: `#1` to `#30` belong to the routine that runs, named ones too unless they begin with
an underscore; the others to the whole program."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..machine import Machine
from ..values import NotUniform
from .state import INPUT, LETTERS, unit_of
from .syntax import Named, Numbered

#: Those of the routine, those a program may use, and those that say where the axes stand.
LAST_LOCAL, LAST_FREE = 30, 5000
_FIRST_PLACE = 5420


def get_numbered(machine: Machine, index: Any) -> Any:
    """The value of a parameter; lanes may ask for different ones."""
    if isinstance(index, np.ndarray):
        if np.isnan(index).any():
            raise machine.fail("the number of a parameter is not known")
        found = np.unique(index)
        if len(found) > 1:
            whole = np.empty(len(index))
            for number in found.tolist():
                value = get_numbered(machine, number)
                those = index == number
                whole[those] = value[those] if isinstance(value, np.ndarray) else value
            return whole
        index = float(found[0])
    number = _number(machine, index)
    if number <= LAST_FREE:
        holder = _holder(machine, number)
        if number not in holder:
            raise machine.fail(f"parameter #{number} is read before it has a value")
        return holder[number]
    if number == INPUT:
        return machine.state["input"]
    if _FIRST_PLACE <= number < _FIRST_PLACE + len(LETTERS):
        return _place(machine, LETTERS[number - _FIRST_PLACE])
    raise machine.fail(f"parameter #{number} is the machine's: its value is not known")


def set_numbered(machine: Machine, index: Any, value: Any) -> None:
    """Give a parameter a value; all lanes the same one."""
    if isinstance(index, np.ndarray):
        if (index != index[0]).any():
            raise NotUniform
        index = index[0]
    number = _number(machine, index)
    if number <= LAST_FREE:
        _holder(machine, number)[number] = value
    elif number == INPUT:
        machine.state["input"] = value
    else:
        raise machine.fail(f"parameter #{number} is the machine's: a program cannot set it")


def get_named(machine: Machine, name: str) -> Any:
    """The value of a named parameter, or of one of the few that LinuxCNC itself knows."""
    if name.startswith("_"):
        named = machine.state["named"]
        if name in named:
            return named[name]
        if name[1:].upper() in LETTERS:
            return _place(machine, name[1:].upper())
    else:
        named = machine.locals
        if name in named:
            return named[name]
    raise machine.fail(f"parameter #<{name}> is read before it has a value")


def set_named(machine: Machine, name: str, value: Any) -> None:
    if name.startswith("_"):
        if name[1:].upper() in LETTERS:
            raise machine.fail(f"parameter #<{name}> is the machine's: a program cannot set it")
        machine.state["named"][name] = value
    else:
        machine.locals[name] = value


def exists(machine: Machine, parameter: Named | Numbered) -> bool:
    """EXISTS[#<name>]."""
    if isinstance(parameter, Numbered):
        return True  # so LinuxCNC, whether it has a value or not
    name = parameter.name
    if name.startswith("_"):
        return name in machine.state["named"] or name[1:].upper() in LETTERS
    return name in machine.locals


def _holder(machine: Machine, number: int) -> dict[Any, Any]:
    """Where a parameter is kept."""
    return machine.locals if number <= LAST_LOCAL else machine.state["parameters"]


def _number(machine: Machine, index: float) -> int:
    if index != index:
        raise machine.fail("the number of a parameter is not known")
    number = round(index)
    if abs(index - number) > 0.0001 or not 1 <= number <= 5601:
        raise machine.fail(f"there is no parameter #{index:g}")
    return number


def _place(machine: Machine, letter: str) -> Any:
    """Where an axis stands, in the units of the program."""
    return machine.state["place"][letter] / unit_of(machine, letter)

"""Statements as the machine runs them: the control flow that all languages share.

A reader lowers its syntax tree to these. What is particular to a language is in the functions: an
`act` changes the machine's state or makes it move, a `condition` and an `argument` give a value.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from .machine import Machine

Act = Callable[["Machine"], None]
Evaluate = Callable[["Machine"], Any]


@dataclass(frozen=True)
class At:
    """Where a statement stands: index of the file, and its line from 1."""

    file: int
    line: int


@dataclass(frozen=True)
class Do:
    """One act, such as an assignment or a move."""

    at: At
    act: Act


@dataclass(frozen=True)
class If:
    at: At
    condition: Evaluate
    then: tuple[Statement, ...]
    otherwise: tuple[Statement, ...] = ()


@dataclass(frozen=True)
class While:
    at: At
    condition: Evaluate
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class Forever:
    """A loop without an end of its own: it ends with the program, a return or an `Exit`."""

    at: At
    body: tuple[Statement, ...]


@dataclass(frozen=True)
class Exit:
    """Leaves the innermost loop."""

    at: At


@dataclass(frozen=True)
class Return:
    """Leaves the routine."""

    at: At


@dataclass(frozen=True)
class Call:
    """Runs a routine: `enter` evaluates the arguments in the caller and returns the callee's local
    variables, `leave` (if any) is handed them when it is done, to hand results back."""

    at: At
    routine: Callable[[], Routine]  # looked up when it runs: routines may stand in any order
    enter: Evaluate
    leave: Callable[[Machine, dict[str, Any]], None] | None = None


@dataclass(frozen=True, eq=False)
class Repeated:
    """A few statements repeated with other numbers, one lane each time.

    `lines` (lanes, len(body)) are their lines in `file`; `columns` the numbers (or whatever a
    reader keeps by lane), which `Machine.column` gives, one (lanes,) array or list of values each.
    """

    file: int
    lines: NDArray[np.int32]
    body: tuple[Statement, ...]
    columns: tuple[Any, ...]


Statement = Do | If | While | Forever | Exit | Return | Call | Repeated


@dataclass(frozen=True, eq=False)
class Routine:
    """`steps`: whether it belongs to the program's frame, so that its statements are run one after
    another, each call in it as a unit; else it is a routine that is run as a whole."""

    name: str
    body: tuple[Statement, ...]
    steps: bool = False

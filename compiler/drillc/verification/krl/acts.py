"""Acts of statements that need no more than a few lines: pauses, settings for one move, cases."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from drillc.verification.events import Kind
from drillc.verification.machine import Machine

from . import arithmetic as ar
from .state import arrive, pass_time

#: What WITH sets for one move only.
_FOR_ONE_MOVE = ("tool", "base", "speed_m_s", "axis_percent", "turning")


def for_one_move(
    settings: Sequence[Callable[[Machine], None]], act: Callable[[Machine], None]
) -> Callable[[Machine], None]:
    """A move with what WITH sets for it."""

    def run(m: Machine) -> None:
        before = {name: m.state[name] for name in _FOR_ONE_MOVE}
        for setting in settings:
            setting(m)
        act(m)
        m.state.update(before)

    return run


def halt(m: Machine) -> None:
    """HALT: somebody has to press start."""
    arrive(m)
    m.emit(Kind.PAUSE, value=math.inf)
    pass_time(m, math.nan)


def pause(m: Machine, seconds: Any) -> None:
    """WAIT SEC. Raises ReadError."""
    ar.number(m, seconds)
    arrive(m)
    if not np.any(np.asarray(seconds) != 0.0):
        return  # only the advance run waits
    if np.any(np.asarray(seconds) < 0.0):
        raise m.fail(f"WAIT SEC {ar.shown(seconds)}: there is no such time")
    m.emit(Kind.PAUSE, value=seconds)
    pass_time(m, seconds * 1000.0 if not isinstance(seconds, np.ndarray) else math.nan)


def is_one_of(selector: Any, wanted: Sequence[Any]) -> Callable[[Machine], Any]:
    """Whether CASE has the value that SWITCH asks for."""

    def condition(m: Machine) -> Any:
        value = selector(m)
        found: Any = False
        for one in wanted:
            found = ar.combine(m, "OR", found, ar.compare(m, "==", value, one(m)))
        return found

    return condition

"""What the controller keeps between statements, and what is noticed while a program runs.

The machine's state is a tree of plain values: `locals` (of the routines that run), `data`
(variables of data lists that statements write), `system` (system variables that mean nothing here
but may be read again) and what is below. NaN and -1 stand for what the program has not said.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from drillc.verification.machine import Machine
from drillc.verification.reading import Finding

from .frames import Poses
from .words import ARM_AXES, AXES


class Notes:
    """Findings of a run, each once; and poses, made once."""

    def __init__(self) -> None:
        self._found: dict[Finding, None] = {}
        self.poses = Poses()
        self.follows_place = False  # whether a statement asks where the tool is

    def find(self, m: Machine, check: str, message: str) -> None:
        """A finding at the statement that is being run."""
        self._found[Finding(check, m.at.file, m.at.line, 1, message)] = None

    def findings(self) -> list[Finding]:
        """All of them, in the order in which they were found."""
        return list(self._found)


def at_the_start(data: Mapping[str, Any]) -> dict[str, Any]:
    """The state before the first statement; `data`: the variables that statements write."""
    return {
        "locals": [],
        "data": dict(data),
        "system": {},
        "initialised": False,
        "tool": -1,
        "base": -1,
        "tool_data": {},
        "base_data": {},
        "load_data": {},
        "speed_m_s": math.nan,
        "axis_percent": [math.nan] * len(ARM_AXES),  # of full speed
        "override_percent": 100.0,
        "advance": 3,
        "ahead": False,  # whether statements are interpreted while the tool still moves
        "moved": False,
        "axes": dict.fromkeys(AXES, math.nan),
        "home": {},
        "place": {},  # where the last move led, if a statement asks for it
        "turning": "#VAR",
        "timers": {},
        "outputs": {},
    }


# ── the advance run ──────────────────────────────────────────────────────────────────────────────


def arrive(m: Machine) -> None:
    """The advance run stops: what follows happens when the tool has arrived."""
    m.state["ahead"] = False


def must_have_arrived(m: Machine, notes: Notes, what: str) -> None:
    """What is done to the process after a move needs a stop of the advance run of its own: whether
    the statement itself brings one hangs on the variable, and on CONTINUE."""
    if m.state["ahead"]:
        message = f"{what} while the tool may still be moving: no WAIT SEC 0 stands before it"
        notes.find(m, "process", message)


def pass_time(m: Machine, milliseconds: float) -> None:
    """Running timers go on; NaN if it is not known how far."""
    timers = m.state["timers"]
    for key, timer in timers.items():
        if timer["runs"]:
            ms = timer["ms"] + milliseconds
            timers[key] = {"ms": ms, "runs": True, "flag": flag_of(ms)}


def flag_of(milliseconds: float) -> float:
    """$TIMER_FLAG: 1 once the timer is above zero, 0 before, NaN if that is not known."""
    return math.nan if math.isnan(milliseconds) else float(milliseconds > 0.0)

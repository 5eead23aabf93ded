"""What lasts from block to block while a program runs."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..machine import Machine

#: The axes, in the order in which LinuxCNC counts them.
LETTERS = ("X", "Y", "Z", "A", "B", "C", "U", "V", "W")
TURNING = ("A", "B", "C")
#: Ways to move; the first is none (G80). Modes that change from block to block are numbers, so that
#: they may differ from lane to lane.
MOTIONS = ("G80", "G0", "G1", "G73", "G81", "G82", "G83")
#: The parameter that says what came of the last wait.
INPUT = 5399
MM_PER_INCH = 25.4


def at_the_start() -> dict[str, Any]:
    """The machine's state before the first block.

    Nothing is known of what another program left: the modes are those that LinuxCNC begins with
    (`unit` mm: that is the machine's own), and the axes stand anywhere.
    """
    return {
        "locals": [{}],
        "parameters": {},
        "named": {"_value": 0.0, "_value_returned": 0.0},
        "input": float("nan"),
        "place": dict.fromkeys(LETTERS, float("nan")),  # in mm and degrees
        "modes": {
            "motion": 0,  # index into MOTIONS: what an axis word without a code does
            "plane": "Z",  # the axis across it, along which cycles drill
            "absolute": True,
            "unit": 1.0,  # mm per unit of length
            "feed": "G94",
            "blends": True,  # G64
            "back_to_r": True,  # G99, which LinuxCNC begins with
        },
        # A program that was broken off may have left another mode: which are stated by this one.
        "stated": {"units": False, "distance": False},
        "tolerance_mm": float("inf"),  # by how much G64 may leave the path
        "feed": float("nan"),  # F as written; NaN: none yet
        "feed_mm": float("nan"),  # the same in mm
        "speed": 0.0,  # S, turns per minute
        "spindle": 0.0,  # 1 clockwise, -1 counter-clockwise, 0 off
        "ended": False,  # by M2 or M30
        "pending": [],  # M62, M63, M67: set when the next move begins
        "corner": [0.0] * len(LETTERS),  # the way of a move that may be left before its end
        "cycle": {"initial": float("nan")},  # words of the last cycle, which the next may leave out
    }


def uniform(machine: Machine, value: Any) -> Any:
    """A value that is the same in all lanes that are run together: where it is not, they part."""
    if not isinstance(value, np.ndarray):
        return value
    alike = value == value[0]
    if not alike.all():
        machine.part(alike)
    return value[0].item()


def unit_of(machine: Machine, letter: str) -> float:
    """mm or degrees per unit of an axis word."""
    unit: float = machine.state["modes"]["unit"]
    return 1.0 if letter in TURNING else unit

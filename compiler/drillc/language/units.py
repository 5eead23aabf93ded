"""Units: which dimension a unit measures, and the exact factor to drillc's own mm, rad, s, N, kg.

A number with a unit is converted in decimal arithmetic and rounded once, so `0.29 m` and `290 mm`
are the same float and give the same bytes.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import Context, Decimal, DecimalException
from typing import Literal

Dimension = Literal[
    "length",
    "angle",
    "time",
    "speed",
    "spindle speed",
    "turning speed",
    "feed per turn",
    "force",
    "mass",
    "share",
]


@dataclass(frozen=True)
class Unit:
    """`factor` converts to the base unit; `power` is set where that factor is 10**power."""

    dimension: Dimension
    factor: Decimal
    power: int | None = None


def _ten(dimension: Dimension, power: int) -> Unit:
    return Unit(dimension, Decimal(10) ** power, power)


_DEG = Decimal(repr(math.pi)) / 180

#: Base units: mm, rad, s, mm/s, rev/s (a spindle's speed), rad/s (a joint's), mm/rev, N, kg, and a
#: share of one.
UNITS: dict[str, Unit] = {
    "mm": _ten("length", 0),
    "um": _ten("length", -3),
    "cm": _ten("length", 1),
    "m": _ten("length", 3),
    "inch": Unit("length", Decimal("25.4")),
    "rad": _ten("angle", 0),
    "deg": Unit("angle", _DEG),
    "s": _ten("time", 0),
    "ms": _ten("time", -3),
    "min": Unit("time", Decimal(60)),
    "mm/s": _ten("speed", 0),
    "m/s": _ten("speed", 3),
    "mm/min": Unit("speed", Decimal(1) / 60),
    "m/min": Unit("speed", Decimal(1000) / 60),
    "rpm": Unit("spindle speed", Decimal(1) / 60),
    "mm/rev": _ten("feed per turn", 0),
    "deg/s": Unit("turning speed", _DEG),
    "rad/s": _ten("turning speed", 0),
    "N": _ten("force", 0),
    "kN": _ten("force", 3),
    "kg": _ten("mass", 0),
    "%": _ten("share", -2),
}

_SAID: dict[Dimension, str] = {
    "length": "a length (mm, m)",
    "angle": "an angle (deg, rad)",
    "time": "a time (s, ms)",
    "speed": "a speed (mm/s, m/min)",
    "spindle speed": "a spindle speed (rpm)",
    "turning speed": "a turning speed (deg/s, rad/s)",
    "feed per turn": "a feed per turn (mm/rev)",
    "force": "a force (N, kN)",
    "mass": "a mass (kg)",
    "share": "a share (%)",
}


def said(dimension: Dimension) -> str:
    """A dimension in words, with the units one would write: "a length (mm, m)"."""
    return _SAID[dimension]


def convert(number: str, unit: Unit) -> float:
    """The decimal text `number` in `unit`, as a float in the base unit, rounded once.

    Angles in degrees go through `math.radians`, which is what every reader of the result undoes.
    """
    if unit is UNITS["deg"]:
        return math.radians(float(number))
    if unit.power == 0:
        return float(number)
    try:
        # Precise enough that the product is exact (or the quotient behind a factor is far beyond a
        # float), so that the float is the only rounding.
        context = Context(prec=len(number) + 40)
        return float(context.multiply(Decimal(number), unit.factor))
    except DecimalException:  # an exponent beyond what even decimals hold: zero or infinite
        return float(number)

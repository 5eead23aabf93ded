"""RAPID's types of data, and the data that every controller has.

A value of a record or an array is a list of the values of its parts, so the machine can keep one
part in lanes and the others not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

Value = Any

#: What stands in a target for an axis that is not there, or not used.
NO_AXIS = 9e9


@dataclass(frozen=True)
class Type:
    """A type of data. A record has `components`; an array has `size` elements."""

    name: str
    components: tuple[tuple[str, Type], ...] = ()
    element: Type | None = None
    size: int = 0

    @property
    def parts(self) -> tuple[Type, ...]:
        """The types of the parts of a value, in order; none for a single value."""
        if self.element is not None:
            return (self.element,) * self.size
        return tuple(part for _, part in self.components)

    def where(self, component: str) -> int | None:
        """The place of a component, in any case of letters."""
        names = [name for name, _ in self.components]
        return names.index(component.lower()) if component.lower() in names else None


def array_of(element: Type, sizes: tuple[int, ...]) -> Type:
    """An array of one to three dimensions: arrays of arrays."""
    for size in reversed(sizes):
        element = Type(f"{element.name} array", element=element, size=size)
    return element


def initial(kind: Type) -> Value:
    """What data holds that is given no value."""
    if kind.parts:
        return [initial(part) for part in kind.parts]
    return {"bool": False, "string": ""}.get(kind.name, 0.0)


def leaves(kind: Type) -> int:
    """How many single values a value has."""
    return sum(map(leaves, kind.parts)) if kind.parts else 1


def flat(value: Value) -> Iterator[Value]:
    """The single values of a value, in order."""
    if isinstance(value, list):
        for part in value:
            yield from flat(part)
    else:
        yield value


def shaped(kind: Type, singles: Iterator[Value]) -> Value:
    """A value from its single values."""
    if kind.parts:
        return [shaped(part, singles) for part in kind.parts]
    return next(singles)


# ── the types of the controller ──────────────────────────────────────────────────────────────────

NUM, BOOL, STRING = Type("num"), Type("bool"), Type("string")

#: Name, and each component with its type.
_RECORDS = """
pos: x num, y num, z num
orient: q1 num, q2 num, q3 num, q4 num
pose: trans pos, rot orient
confdata: cf1 num, cf4 num, cf6 num, cfx num
robjoint: rax_1 num, rax_2 num, rax_3 num, rax_4 num, rax_5 num, rax_6 num
extjoint: eax_a num, eax_b num, eax_c num, eax_d num, eax_e num, eax_f num
robtarget: trans pos, rot orient, robconf confdata, extax extjoint
jointtarget: robax robjoint, extax extjoint
speeddata: v_tcp num, v_ori num, v_leax num, v_reax num
zonedata: finep bool, pzone_tcp num, pzone_ori num, pzone_eax num, zone_ori num, zone_leax num, \
zone_reax num
loaddata: mass num, cog pos, aom orient, ix num, iy num, iz num
tooldata: robhold bool, tframe pose, tload loaddata
wobjdata: robhold bool, ufprog bool, ufmec string, uframe pose, oframe pose
tasks: taskname string
"""
#: Types of which only the name is needed, so that data of them may be declared.
_OPAQUE = """
    btnres clock errnum errtype icondata intnum iodev listitem shapedata signalai signalao signaldi
    signaldo signalgi signalgo socketdev stoppointdata syncident taskid triggdata wzstationary
    wztemporary
""".split()  # noqa: SIM905 (a table of words)


def _types() -> Mapping[str, Type]:
    types = {"num": NUM, "dnum": NUM, "byte": NUM, "bool": BOOL, "string": STRING}
    types.update({name: Type(name) for name in _OPAQUE})
    for line in _RECORDS.strip().split("\n"):
        name, parts = line.split(": ")
        pairs = [part.split(" ") for part in parts.split(", ")]
        types[name] = Type(name, tuple((part, types[kind]) for part, kind in pairs))
    return types


TYPES = _types()
POS, ORIENT, POSE = TYPES["pos"], TYPES["orient"], TYPES["pose"]
ROBTARGET, JOINTTARGET = TYPES["robtarget"], TYPES["jointtarget"]
SPEEDDATA, ZONEDATA = TYPES["speeddata"], TYPES["zonedata"]
TOOLDATA, WOBJDATA = TYPES["tooldata"], TYPES["wobjdata"]

# ── the data of the controller ───────────────────────────────────────────────────────────────────

_SPEEDS = (
    *(5, 10, 20, 30, 40, 50, 60, 80, 100, 150, 200, 300, 400, 500, 600, 800, 1000),
    *(1500, 2000, 2500, 3000, 4000, 5000, 6000, 7000),
)
_ZONES = (5, 10, 15, 20, 30, 40, 50, 60, 80, 100, 150, 200)
_NOWHERE = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0]]
_LOAD = [0.001, [0.0, 0.0, 0.001], [1.0, 0.0, 0.0, 0.0], 0.0, 0.0, 0.0]


def _zone(fine: bool, mm: float, turned: float) -> Value:
    return [fine, mm, turned, turned, turned / 10.0, turned, turned / 10.0]


def _installed() -> Mapping[str, tuple[Type, Value]]:
    """Technical reference manual RAPID: `speeddata`, `zonedata`, `tool0`, `wobj0`, `load0`. How
    fast `vmax` is hangs on the robot."""
    data: dict[str, tuple[Type, Value]] = {
        f"v{v}": (SPEEDDATA, [float(v), 500.0, 5000.0, 1000.0]) for v in _SPEEDS
    }
    data["vmax"] = (SPEEDDATA, [math.nan, 500.0, 5000.0, 1000.0])
    data["fine"] = (ZONEDATA, _zone(True, 0.0, 0.0))
    data["z0"] = (ZONEDATA, _zone(False, 0.3, 0.3))
    data["z1"] = (ZONEDATA, _zone(False, 1.0, 1.0))
    data.update({f"z{mm}": (ZONEDATA, _zone(False, mm * 1.0, mm * 1.5)) for mm in _ZONES})
    data["tool0"] = (TOOLDATA, [True, _NOWHERE, _LOAD])
    data["wobj0"] = (WOBJDATA, [False, True, "", _NOWHERE, _NOWHERE])
    data["load0"] = (TYPES["loaddata"], _LOAD)
    data["pi"] = (NUM, math.pi)
    # where outputs and edges are named by words
    data["low"], data["high"] = (NUM, 0.0), (NUM, 1.0)
    return {name.upper(): item for name, item in data.items()}


INSTALLED = _installed()

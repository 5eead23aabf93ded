"""Resolving the statements about the part and the machine: part, tool, robot, fixture, io."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from drillc.language.ast import (
    Item,
    Numbers,
    Placement,
    Quantity,
    Range,
    Statement,
    Text,
    Word,
)
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import (
    Fields,
    did_you_mean,
    in_unit,
    lengths,
    measure,
    of_type,
    pose,
    unit_vector,
    whole,
)
from drillc.language.job import (
    Box,
    Fixture,
    HeightRule,
    Limit,
    Named,
    Part,
    Portal,
    Pose,
    Signal,
    Tool,
    WorkFrame,
)
from drillc.language.source import Span
from drillc.language.units import UNITS, Dimension, said

#: How far a normal's length may be from 1 unless the part says otherwise. The posture article's own
#: printed normals are off by up to 0.00066.
DEFAULT_UNIT_TOLERANCE = 1e-3

#: The signals that processes use, and of which kind each must be.
SIGNAL_ROLES: dict[str, str] = {
    "spindle_on": "output",
    "spindle_speed": "analog",
    "spindle_running": "input",
    "clamp": "output",
    "clamped": "input",
    "released": "input",
    "clamp_force": "analog",
    "set": "output",
    "set_done": "input",
}
_SAID_KIND = {"output": "output", "input": "input", "analog": "analog output"}
#: What an analog signal's full scale is measured in.
_FULL_SCALE: dict[str, Dimension] = {"spindle_speed": "spindle speed", "clamp_force": "force"}

PORTAL_JOINTS = ("q1", "q2", "q3", "q4", "q5", "q6")
#: The portal's one turning joint (q3 = β, the bar about its own axis).
ROTARY_JOINT = 2
#: A bar shorter than this is a mistake; and beside columns of metres its tilt would be rounding.
LEAST_BAR_MM = 1.0


def resolve_part(statement: Statement, report: Report) -> Part:
    """`part NAME { up V  normals into|outward  … }`."""
    fields = Fields(statement, report)
    up = fields.get("up")
    up_value = None if up is None else up.values[0]
    vector = unit_vector(up_value, "up", report) if isinstance(up_value, Word | Numbers) else None
    normals = fields.need(
        "normals",
        "normals into: they are feed directions; normals outward: they leave the material",
    )
    into = normals is not None and of_type(normals.values[0], Word).text == "into"
    tolerance = fields.get("unit_tolerance")
    return Part(
        named(statement.name),
        vector,
        into,
        _tolerance(tolerance, report),
        _frame(fields.get("frame"), report),
    )


def _tolerance(item: Item | None, report: Report) -> float:
    if item is None:
        return DEFAULT_UNIT_TOLERANCE
    quantity = of_type(item.values[0], Quantity)
    value = float(quantity.number)
    if not 0 < value <= 0.1:
        report.error(
            "E207",
            f"unit_tolerance is {quantity.number}; it must be more than 0 and at most 0.1",
            quantity.span,
        )
        return DEFAULT_UNIT_TOLERANCE
    return value


def _frame(item: Item | None, report: Report) -> WorkFrame | None:
    if item is None:
        return None
    number, placement = item.values
    stands = None
    if isinstance(placement, Placement):
        stands = pose(placement, "the part's frame", report)
    return WorkFrame(whole(number, "the frame's number", 1, 999, report), stands, item.span)


def resolve_tool(statement: Statement, report: Report) -> Tool:
    """`tool NAME { number N  tcp (x, y, z) mm rotate … }`."""
    fields = Fields(statement, report)
    number = fields.need("number", "number 1: the tool's number on the controller")
    tcp = fields.need("tcp", "tcp (x, y, z) mm: the tool centre point in flange coordinates")
    nowhere = Pose(np.eye(3), np.full(3, np.nan))
    mass, cog = fields.get("mass"), fields.get("cog")
    return Tool(
        named(statement.name),
        1 if number is None else whole(number.values[0], "the tool's number", 1, 999, report),
        nowhere if tcp is None else pose(of_type(tcp.values[0], Placement), "tcp", report),
        None if mass is None else measure(mass.values[0], "mass", "mass", report, above=0),
        None if cog is None else lengths(of_type(cog.values[0], Numbers), "cog", report),
    )


def resolve_fixture(statement: Statement, report: Report) -> Fixture:
    """`fixture NAME { box (…) (…) mm … }`."""
    boxes = []
    for item in statement.items:
        first, second, unit = item.values
        if not isinstance(unit, Word):
            report.error(
                "E203",
                f"the box's corners have no unit; they are {said('length')}",
                item.span,
                hint="write the unit behind both: box (…) (…) mm",
            )
            continue
        corner = lengths(in_unit(first, unit), "the box's corner", report)
        # The unit belongs to both corners; that it is wrong is said once.
        known = UNITS[unit.text].dimension == "length"
        other = lengths(in_unit(second, unit), "the box's corner", report) if known else corner
        low, high = np.minimum(corner, other), np.maximum(corner, other)
        if np.any(high - low <= 0):
            axes = " and ".join(a for a, w in zip("xyz", high - low, strict=True) if w <= 0)
            report.error(
                "E222",
                f"this box has no volume: its corners share {axes}",
                item.span,
                hint="give two opposite corners",
            )
        boxes.append(Box(low, high, item.span))
    if not statement.items:
        report.error(
            "E202",
            f'fixture {statement.name.text} does not say "box"',
            statement.name.span,
            hint="box (400, 1500, 500) (700, 1900, 650) mm",
        )
    return Fixture(named(statement.name), tuple(boxes))


def resolve_signals(statement: Statement, report: Report) -> dict[str, Signal]:
    """`io { ROLE output|input|analog NUMBER [full Q] [as "ALIAS"] … }`."""
    signals: dict[str, Signal] = {}
    for item in statement.items:
        role = item.key.text
        if role not in SIGNAL_ROLES:
            report.error(
                "E211",
                f'"{role}" is not a signal that a process uses',
                item.key.span,
                hint=did_you_mean(role, SIGNAL_ROLES),
            )
            continue
        if role in signals:
            report.error(
                "E201",
                f'"{role}" is given twice in io',
                item.key.span,
                labels=[Label(signals[role].span, "first given here")],
                hint="remove one of them",
            )
            continue
        signals[role] = _signal(item, report)
    return signals


def _signal(item: Item, report: Report) -> Signal:
    role = item.key.text
    kind, number, full, alias = item.values
    kind_word = of_type(kind, Word)
    if kind_word.text != SIGNAL_ROLES[role]:
        report.error(
            "E212",
            f"{role} is an {_SAID_KIND[SIGNAL_ROLES[role]]}, not an {_SAID_KIND[kind_word.text]}",
            kind_word.span,
            hint=f"{role} {SIGNAL_ROLES[role]} {of_type(number, Quantity).number}"
            + (" full …" if role in _FULL_SCALE else ""),
        )
    scale = None
    if role in _FULL_SCALE and kind_word.text == "analog":
        if full is None:
            report.error(
                "E213",
                f"{role} does not say what its full value stands for",
                item.key.span,
                hint="add: full 6000 rpm" if role == "spindle_speed" else "add: full 2000 N",
            )
        else:
            scale = measure(full, _FULL_SCALE[role], f"{role}'s full scale", report, above=0)
    elif full is not None:
        report.error(
            "E213",
            f"{role} is on or off; it has no full value",
            of_type(full, Quantity).span,
            hint="remove it",
        )
    name = alias.text if isinstance(alias, Text) else None
    if name is not None and not (name.isascii() and name.isidentifier() and len(name) <= 32):
        report.error(
            "E214",
            f'"{name[:40]}" cannot be a signal\'s name on a controller',
            of_type(alias, Text).span,
            hint="letters, digits and _, not beginning with a digit, at most 32 characters",
        )
        name = None
    signal_kind: Literal["input", "output", "analog"] = (
        "input"
        if kind_word.text == "input"
        else "output"
        if kind_word.text == "output"
        else "analog"
    )
    return Signal(
        role,
        signal_kind,
        whole(number, f"{role}'s number", 0, 4096, report),
        scale,
        name,
        item.span,
    )


def resolve_portal(statement: Statement, report: Report) -> Portal:
    """`robot NAME portal { D …  H …  d …  height …  side …  limits { … } }`."""
    fields = Fields(statement, report)
    distance = fields.measure("D", "length", above=0, hint="D 10 m: the columns' distance")
    height = fields.measure("H", "length", above=0, hint="H 5 m: the columns' height")
    inset = fields.measure("d", "length", least=0, hint="d 0.75 m: the hinges' inset")
    if distance - inset * 2 < LEAST_BAR_MM:
        item = fields.get("d")
        left = max(0.0, distance - inset * 2)
        report.error(
            "E223",
            f"D is {distance:.10g} mm and d {inset:.10g} mm, which leaves "
            f"{f'a bar of only {left:g} mm' if left else 'no bar'} between the hinges",
            item.span if item else statement.span,
            hint="d is the small distance from a column to the hinge beside it",
        )
    rule, height_mm = _height(fields, report)
    side_item = fields.need("side", "side below: the tool rises to the plate; or side above")
    below = side_item is not None and of_type(side_item.values[0], Word).text == "below"
    limits, tilt = _limits(fields, distance, height, report)
    height_item = fields.get("height")
    return Portal(
        named(statement.name),
        distance,
        height,
        inset,
        rule,
        height_mm,
        height_item.span if height_item else statement.name.span,
        "below" if below else "above",
        limits,
        tilt,
        _speeds(fields, report),
    )


def _height(fields: Fields, report: Report) -> tuple[HeightRule, float | None]:
    item = fields.need("height", "height centre; or widest_margin, least_travel, or a length")
    if item is None:
        return "centre", None
    value = item.values[0]
    if isinstance(value, Quantity):
        return "fixed", measure(value, "length", "height", report)
    match of_type(value, Word).text:
        case "widest_margin":
            return "widest_margin", None
        case "least_travel":
            return "least_travel", None
        case _:
            return "centre", None


def _limits(
    fields: Fields, distance: float, height: float, report: Report
) -> tuple[tuple[Limit, ...], Limit | None]:
    """Limits of q1…q6, and of α if given. q1, q2, q6 lie in 0…H and q4 in 0…D unless narrowed."""
    given: dict[str, Limit] = {}
    item = fields.get("limits")
    for entry in item.items if item else ():
        name = entry.key.text
        if name not in PORTAL_JOINTS and name != "alpha":
            report.error(
                "E210",
                f'there is no joint called "{name}"',
                entry.key.span,
                hint=did_you_mean(name, (*PORTAL_JOINTS, "alpha")),
            )
            continue
        if name in given:
            first = given[name].span
            report.error(
                "E201",
                f'the limits of "{name}" are given twice',
                entry.key.span,
                labels=[Label(first, "first given here")] if first else [],
                hint="remove one of them",
            )
            continue
        dimension: Dimension = "angle" if name in {"q3", "alpha"} else "length"
        bounds = of_type(entry.values[0], Range)
        low = measure(bounds.low, dimension, f"{name}'s lower limit", report)
        high = measure(bounds.high, dimension, f"{name}'s upper limit", report)
        if low >= high:
            report.error(
                "E224",
                f"the limits of {name} are reversed or equal: {_written(bounds.low)} .. "
                f"{_written(bounds.high)}",
                bounds.span,
                hint="write the lower end first",
            )
        given[name] = Limit(low, high, entry.span)
    for name, example in (("q3", "q3 -180 deg .. 180 deg"), ("q5", "q5 -3 m .. 3 m")):
        if name not in given:
            report.error(
                "E202",
                f'robot {fields.statement.name.text} does not say "limits" of {name}, '
                "which its geometry leaves open",
                fields.statement.name.span,
                hint=f"limits {{ {example} }}",
            )
    geometric = {"q1": height, "q2": height, "q4": distance, "q6": height}
    for name, top in geometric.items():
        limit = given.get(name)
        if limit is not None and (limit.low < 0 or limit.high > top):
            report.error(
                "E225",
                f"the limits of {name} leave the machine, where it slides in 0 .. {top:g} mm",
                limit.span,
                hint="narrow the limits, or correct " + ("D" if name == "q4" else "H"),
            )
    nothing = Limit(-math.inf, math.inf, None)
    joints = tuple(
        given.get(name, Limit(0.0, geometric[name], None) if name in geometric else nothing)
        for name in PORTAL_JOINTS
    )
    return joints, given.get("alpha")


def _speeds(fields: Fields, report: Report) -> tuple[float | None, ...]:
    speeds: dict[str, float] = {}
    first: dict[str, Span] = {}
    item = fields.get("speeds")
    for entry in item.items if item else ():
        name = entry.key.text
        if name not in PORTAL_JOINTS:
            report.error(
                "E210",
                f'there is no joint called "{name}"',
                entry.key.span,
                hint=did_you_mean(name, PORTAL_JOINTS),
            )
        elif name in speeds:
            report.error(
                "E201",
                f'the speed of "{name}" is given twice',
                entry.key.span,
                labels=[Label(first[name], "first given here")],
                hint="remove one of them",
            )
        else:
            dimension: Dimension = "turning speed" if name == "q3" else "speed"
            first[name] = entry.key.span
            speeds[name] = measure(entry.values[0], dimension, f"{name}'s speed", report, above=0)
    travelling = ("q1", "q2", "q6")
    missing = [name for name in travelling if name not in speeds]
    if item is not None and 0 < len(missing) < len(travelling):
        report.error(
            "E226",
            f"the speeds of {' and '.join(n for n in travelling if n in speeds)} are given, but "
            f"not of {' and '.join(missing)}; height least_travel weighs the three against each "
            "other",
            item.span,
            hint="give all three, or none: then they are taken as equal",
        )
    return tuple(speeds.get(name) for name in PORTAL_JOINTS)


def named(word: Word) -> Named:
    """A declared name."""
    return Named(word.text, word.span)


def _written(quantity: Quantity) -> str:
    return f"{quantity.number} {quantity.unit or ''}".strip()

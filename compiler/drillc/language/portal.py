"""Resolving `robot NAME portal { … }`: the riveting portal, its limits and speeds."""

from __future__ import annotations

import math

from drillc.language.ast import Quantity, Statement, Word
from drillc.language.diagnostics import Report
from drillc.language.fields import Fields, entries, limit, measure, named, of_type
from drillc.language.job import PORTAL_JOINTS, ROTARY_JOINT, HeightRule, Limit, Portal

#: A bar shorter than this is a mistake; and beside columns of metres its tilt would be rounding.
LEAST_BAR_MM = 1.0


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
    found = entries(fields.get("limits"), (*PORTAL_JOINTS, "alpha"), "joint", report)
    turning = (PORTAL_JOINTS[ROTARY_JOINT], "alpha")
    given = {
        name: limit(entry, "angle" if name in turning else "length", report)
        for name, entry in found.items()
    }
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
        narrowed = given.get(name)
        if narrowed is not None and (narrowed.low < 0 or narrowed.high > top):
            report.error(
                "E225",
                f"the limits of {name} leave the machine, where it slides in 0 .. {top:g} mm",
                narrowed.span,
                hint="narrow the limits, or correct " + ("D" if name == "q4" else "H"),
            )
    nothing = Limit(-math.inf, math.inf, None)
    joints = tuple(
        given.get(name, Limit(0.0, geometric[name], None) if name in geometric else nothing)
        for name in PORTAL_JOINTS
    )
    return joints, given.get("alpha")


def _speeds(fields: Fields, report: Report) -> tuple[float | None, ...]:
    item = fields.get("speeds")
    speeds = {
        name: measure(
            entry.values[0],
            "turning speed" if name == PORTAL_JOINTS[ROTARY_JOINT] else "speed",
            f"{name}'s speed",
            report,
            above=0,
        )
        for name, entry in entries(item, PORTAL_JOINTS, "joint", report).items()
    }
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

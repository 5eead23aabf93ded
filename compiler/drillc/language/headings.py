"""Resolving how a region's tool is turned about its axis: rules, and what it may turn aside for."""

from __future__ import annotations

import math
from collections.abc import Sequence

from drillc.language.ast import Item, Quantity, Rule, Word
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import did_you_mean, measure, of_type, unit_vector
from drillc.language.job import Avoid, Fixture, Part, PostureRule

#: A normal nearer than this to the singular direction leaves the rule undecided, unless a rule says
#: otherwise (`cone`): below it, a normal's own tolerance turns the heading by degrees.
DEFAULT_CONE_RAD = math.radians(0.5)


def resolve_posture(item: Item | None, report: Report) -> PostureRule | None:
    """`posture RULE [fallback RULE]`."""
    if item is None:
        return None
    rule, fallback = item.values
    second = None if fallback is None else _rule(of_type(fallback, Rule), None, report)
    return _rule(of_type(rule, Rule), second, report)


def _rule(rule: Rule, fallback: PostureRule | None, report: Report) -> PostureRule:
    toward = None if rule.toward is None else unit_vector(rule.toward, "toward", report)
    cone = DEFAULT_CONE_RAD
    if rule.cone is not None:
        cone = measure(rule.cone, "angle", "cone", report, above=0)
        if cone >= math.pi / 2:
            report.error(
                "E206",
                f"cone is {rule.cone.number} {rule.cone.unit}; it must be less than 90 deg, else "
                "the rule decides nothing",
                rule.cone.span,
            )
    return PostureRule(
        "xyz".index(rule.axis.text) if rule.axis.text != "z" else _no_z(rule.axis, report),
        rule.horizontal,
        toward,
        cone,
        fallback,
        rule.span,
    )


def _no_z(axis: Word, report: Report) -> int:
    report.error(
        "E245",
        "the tool's z axis is the feed direction; a rule holds x or y",
        axis.span,
        hint="posture x horizontal toward +X",
    )
    return 0


def resolve_avoids(
    items: Sequence[Item], part: Part, fixtures: Sequence[Fixture], report: Report
) -> tuple[Avoid, ...]:
    """`avoid FIXTURE clearance C`; the part's own name means its surface."""
    names = [fixture.name.text for fixture in fixtures]
    first: dict[str, Item] = {}
    avoids = []
    for item in items:
        word, written = of_type(item.values[0], Word), item.values[1]
        name = word.text
        clearance = measure(written, "length", "clearance", report, least=0)
        if name in first:
            report.error(
                "E201",
                f'"avoid {name}" is given twice',
                word.span,
                labels=[Label(first[name].span, "first given here")],
                hint="remove one of them",
            )
            continue
        first[name] = item
        if name in names and name == part.name.text:
            report.error(
                "E271",
                f'"{name}" is a fixture and the part; it is not clear which is to be avoided',
                word.span,
                labels=[Label(part.name.span, "the part")],
                hint="rename one of them",
            )
        elif name in names:
            avoids.append(Avoid(names.index(name), clearance, item.span))
        elif name != part.name.text:
            report.error(
                "E210",
                f'there is no fixture called "{name}"',
                word.span,
                hint=did_you_mean(name, [*names, part.name.text]),
            )
        elif part.surface is None:
            report.error(
                "E268",
                f"part {name} has no surface to be avoided",
                word.span,
                labels=[Label(part.name.span, "the part")],
                hint='give it one: surface "part.stl" mm',
            )
        else:
            avoids.append(Avoid(None, clearance, item.span))
    return tuple(avoids)


def resolve_turning(item: Item | None, avoids: bool, report: Report) -> float:
    """How far the heading may leave the rule's: as far as it must where something is avoided, and
    not at all where nothing is, unless `turning within A` says otherwise."""
    if item is None:
        return math.pi if avoids else 0.0
    quantity = of_type(item.values[0], Quantity)
    turning = measure(quantity, "angle", "turning", report, above=0)
    if turning > math.pi:
        report.error(
            "E206",
            f"turning is {quantity.number} {quantity.unit}; it must be at most 180 deg, as far as "
            "any heading turns either way",
            quantity.span,
        )
    return turning

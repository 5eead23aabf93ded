"""Syntax tree → Job: names resolved, numbers in mm, rad and s, hole tables read, all of it checked.

All mistakes are collected; the stage ends with `Report.stop_if_failed`. Not done here: whether the
holes can be reached or posed (planning), and whether a controller can express the result (output).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TypeVar

from drillc.language.arm import resolve_arm
from drillc.language.ast import Item, Quantity, Statement, Text, Value, Word
from drillc.language.bodies import resolve_fixture
from drillc.language.consistency import (
    check_body,
    check_machine,
    check_needs_arm,
    check_place,
    check_reserved,
    check_rules,
    check_stations,
    check_surface,
    check_unused,
    check_up,
)
from drillc.language.diagnostics import Label, Report
from drillc.language.expectations import resolve_expects
from drillc.language.fields import named, of_type
from drillc.language.hole_tables import resolve_table
from drillc.language.job import Arm, Emit, Job, Named, Part, Portal, Setting, Signal, Tool
from drillc.language.loading import Loaded, Loader
from drillc.language.machine import (
    DEFAULT_UNIT_TOLERANCE,
    resolve_part,
    resolve_signals,
    resolve_tool,
)
from drillc.language.operations import VISIT, resolve_process
from drillc.language.portal import resolve_portal
from drillc.language.regions import Around, resolve_regions
from drillc.language.sequence import resolve_sequence
from drillc.language.source import Source
from drillc.language.units import UNITS, convert

T = TypeVar("T", Tool, Portal | Arm)


def resolve(loaded: Loaded, loader: Loader, report: Report) -> Job:
    """Resolve a loaded spec. Raises `Refused` with every mistake found."""
    of_kind: dict[str, list[Statement]] = {}
    for statement in loaded.statements:
        of_kind.setdefault(statement.kind, []).append(statement)
    spec = loaded.spec.source

    def statements(kind: str) -> list[Statement]:
        return of_kind.get(kind, [])

    program = _single(statements("program"), "program", "program NAME", loaded, report)
    part_statement = _single(statements("part"), "part", "part NAME { … }", loaded, report)
    part = resolve_part(part_statement, loader, report) if part_statement else _no_part(spec)
    tools = [resolve_tool(s, loader, report) for s in _distinct(statements("tool"), report)]
    robot_statements = _distinct(statements("robot"), report)
    robots = [_robot(s, loader, report) for s in robot_statements]
    fixtures = [
        resolve_fixture(s, loader, report) for s in _distinct(statements("fixture"), report)
    ]
    signals = _signals(statements("io"), report)
    processes = [resolve_process(s, report) for s in _distinct(statements("process"), report)]
    check_reserved(processes, report)
    tables = {
        s.name.text: resolve_table(s, not part.normals_from_surface, loader, report)
        for s in _distinct(statements("holes"), report)
    }
    tool = _only(tools, "tool", report)
    robot = _only(robots, "robot", report)
    region_statements = _distinct(statements("region"), report)
    if not region_statements:
        report.error(
            "E209",
            "the spec has no region, so there is nothing to make",
            spec.span(0, 1),
            hint="add: region NAME { posture …  process …  points mm { … } }",
        )
    arm = robot if isinstance(robot, Arm) else None
    visit = {VISIT.name: (len(processes), VISIT)}
    around = Around(part, fixtures, arm, visit | {p.name: (i, p) for i, p in enumerate(processes)})
    resolved = resolve_regions(region_statements, statements("skip"), tables, around, report)
    regions, holes = resolved.regions, resolved.holes
    check_unused(spec.shown, processes, tables, resolved.used, report)
    check_machine(spec.shown, robot, tool, report)
    check_rules(robot, regions, region_statements, report)
    has_arm = any(isinstance(robot, Arm) for robot in robots)
    check_needs_arm(has_arm, region_statements, statements("sequence"), report)
    check_body(tool, regions, report)
    if arm is not None:
        check_stations(spec.shown, arm, part, regions, report)
        check_place(arm, part, report)
    if part_statement is not None:
        check_surface(part, part_statement, holes, report)
        if not isinstance(robot, Portal):
            check_up(part_statement, regions, report)
    order = resolve_sequence(statements("sequence"), report)
    emits = _emits(statements("emit"), report)
    expects = resolve_expects(statements("expect"), resolved, robot, report)
    report.stop_if_failed()
    assert program is not None
    return Job(
        program=named(program.name),
        part=part,
        tool=tool,
        robot=robot,
        fixtures=tuple(fixtures),
        signals=signals,
        processes=(*processes, VISIT),
        regions=regions,
        holes=holes,
        heading_jump_max_rad=order.heading_jump_max_rad,
        order_shortest=order.shortest,
        weights=order.weights,
        expects=expects,
        emits=emits,
        inputs=tuple(loader.inputs),
    )


def _robot(statement: Statement, loader: Loader, report: Report) -> Portal | Arm:
    if of_type(statement.values[0], Word).text == "arm":
        return resolve_arm(statement, loader, report)
    return resolve_portal(statement, report)


def _no_part(spec: Source) -> Part:
    """Stands in for a missing part, which is an error, so that the rest can be checked."""
    return Part(Named("", spec.span(0, 1)), None, True, DEFAULT_UNIT_TOLERANCE, None)


#: Statements whose keyword is not what they declare.
_SAID = {"holes": "hole table"}


def _single(
    found: Sequence[Statement], kind: str, hint: str, loaded: Loaded, report: Report
) -> Statement | None:
    if not found:
        report.error(
            "E209", f"the spec has no {kind}", loaded.spec.source.span(0, 1), hint=f"add: {hint}"
        )
        return None
    for again in found[1:]:
        report.error(
            "E215",
            f"a spec has one {kind}; this is another",
            again.name.span,
            labels=[Label(found[0].name.span, "the first one")],
            hint="remove one of them",
        )
    return found[0]


def _distinct(found: Iterable[Statement], report: Report) -> list[Statement]:
    """The statements without those whose name is already taken (each an error)."""
    first: dict[str, Statement] = {}
    for statement in found:
        name = statement.name.text
        if name in first:
            report.error(
                "E215",
                f"{_SAID.get(statement.kind, statement.kind)} {name} is declared twice",
                statement.name.span,
                labels=[Label(first[name].name.span, "the first one")],
                hint="rename or remove one of them",
            )
        first.setdefault(name, statement)
    return list(first.values())


def _only(things: Sequence[T], kind: str, report: Report) -> T | None:
    if len(things) > 1:
        names = [thing.name for thing in things]
        report.error(
            "E216",
            f"there are {len(things)} {kind}s ({', '.join(n.text for n in names)}); "
            "a program has one",
            names[1].span,
            labels=[Label(names[0].span, "the first one")],
            hint="remove the others",
        )
    return things[0] if things else None


def _signals(found: Sequence[Statement], report: Report) -> dict[str, Signal]:
    signals: dict[str, Signal] = {}
    for statement in found:
        for role, signal in resolve_signals(statement, report).items():
            if role in signals:
                report.error(
                    "E215",
                    f"there are two signals for {role}",
                    signal.span,
                    labels=[Label(signals[role].span, "the first one")],
                    hint="remove one of them",
                )
            signals.setdefault(role, signal)
    return signals


def _emits(found: Sequence[Statement], report: Report) -> tuple[Emit, ...]:
    emits = []
    for statement in _distinct(found, report):
        axes: list[tuple[Named, Named]] = []
        settings = []
        seen: dict[str, Item] = {}
        for item in statement.items:
            key = item.key.text
            if key in seen:
                report.error(
                    "E201",
                    f'"{key}" is given twice in emit {statement.name.text}',
                    item.key.span,
                    labels=[Label(seen[key].key.span, "first given here")],
                    hint="remove one of them",
                )
                continue
            seen[key] = item
            if key == "axes":
                axes = [(named(a.key), named(of_type(a.values[0], Word))) for a in item.items]
            else:
                settings.append(_setting(item, report))
        emits.append(Emit(named(statement.name), tuple(settings), tuple(axes)))
    return tuple(emits)


def _setting(item: Item, report: Report) -> Setting:
    value: Value = item.values[0]
    if isinstance(value, Quantity):
        unit = UNITS[value.unit] if value.unit else None
        number = float(value.number) if unit is None else convert(value.number, unit)
        if not math.isfinite(number):
            report.error(
                "E205",
                f"{item.key.text} is {value.number}, beyond anything a controller can take",
                value.span,
                hint="check the decimal point and the exponent",
            )
        return Setting(named(item.key), number, value.unit or "", value.span)
    text = value if isinstance(value, Text) else of_type(value, Word)
    return Setting(named(item.key), text.text, "", text.span)

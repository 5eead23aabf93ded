"""Syntax tree → Job: names resolved, numbers in mm, rad and s, hole tables read, all of it checked.

All mistakes are collected; the stage ends with `Report.stop_if_failed`. Not done here: whether the
holes can be reached or posed (planning), and whether a controller can express the result (output).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TypeVar

from drillc.language.ast import Item, Quantity, Statement, Text, Value, Word
from drillc.language.diagnostics import Label, Report
from drillc.language.expectations import resolve_expects
from drillc.language.fields import Fields, measure, of_type
from drillc.language.job import (
    Emit,
    Job,
    Named,
    Part,
    Portal,
    Process,
    Region,
    Setting,
    Signal,
    Tool,
)
from drillc.language.loading import Loaded, Loader
from drillc.language.machine import (
    DEFAULT_UNIT_TOLERANCE,
    named,
    resolve_fixture,
    resolve_part,
    resolve_portal,
    resolve_signals,
    resolve_tool,
)
from drillc.language.operations import VISIT, resolve_process
from drillc.language.regions import resolve_regions, resolve_table
from drillc.language.source import Source
from drillc.language.tables import Table
from drillc.language.units import UNITS, convert

T = TypeVar("T", Tool, Portal)


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
    part = resolve_part(part_statement, report) if part_statement else _no_part(spec)
    tools = [resolve_tool(s, report) for s in _distinct(statements("tool"), report)]
    robots = [resolve_portal(s, report) for s in _distinct(statements("robot"), report)]
    fixtures = [resolve_fixture(s, report) for s in _distinct(statements("fixture"), report)]
    signals = _signals(statements("io"), report)
    processes = [resolve_process(s, report) for s in _distinct(statements("process"), report)]
    _check_reserved(processes, report)
    tables = {
        s.name.text: resolve_table(s, loader, report)
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
    resolved = resolve_regions(
        region_statements,
        statements("skip"),
        tables,
        {VISIT.name: (len(processes), VISIT)} | {p.name: (i, p) for i, p in enumerate(processes)},
        part,
        report,
    )
    regions, holes = resolved.regions, resolved.holes
    _check_unused(spec.shown, processes, tables, resolved.used, report)
    _check_machine(spec.shown, robot, tool, report)
    _check_rules(robot, regions, region_statements, report)
    if robot is None and part_statement is not None:
        _check_up(part_statement, regions, report)
    jump = _sequence(statements("sequence"), report)
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
        heading_jump_max_rad=jump,
        expects=expects,
        emits=emits,
        inputs=tuple(loader.inputs),
    )


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


def _check_reserved(processes: Sequence[Process], report: Report) -> None:
    for process in processes:
        if process.name == VISIT.name:
            report.error(
                "E218",
                f'"{VISIT.name}" is what drillc calls the process of a region that names none',
                process.span,
                hint="give the process another name",
            )


def _check_unused(
    spec_shown: str,
    processes: Sequence[Process],
    tables: dict[str, Table | None],
    used: frozenset[str],
    report: Report,
) -> None:
    """What the spec itself declares and nothing uses; a cell file may hold more than needed."""
    unused: list[tuple[str, Named | Word]] = [
        ("process", Named(p.name, p.span)) for p in processes if p.span and p.name not in used
    ]
    unused += [("hole table", t.name) for name, t in tables.items() if t and name not in used]
    for kind, name in unused:
        if name.span.source.shown == spec_shown:
            report.error(
                "E217",
                f"{kind} {name.text} is not used",
                name.span,
                hint="use it in a region, or remove it",
            )


def _check_machine(
    spec_shown: str, robot: Portal | None, tool: Tool | None, report: Report
) -> None:
    if robot is not None and tool is not None and tool.name.span.source.shown == spec_shown:
        report.error(
            "E217",
            f"tool {tool.name.text} is not used: the portal carries its own",
            tool.name.span,
            hint="remove it",
        )


def _check_rules(
    robot: Portal | None,
    regions: Sequence[Region],
    statements: Sequence[Statement],
    report: Report,
) -> None:
    """Whether each region has what decides its posture, and only that."""
    for region, statement in zip(regions, statements, strict=True):
        rule = region.posture
        if rule is None and robot is None:
            report.error(
                "E247",
                f"region {region.name.text} does not say how the tool is held about its axis",
                statement.name.span,
                hint="posture x horizontal toward +X; or posture y toward -Z",
            )
        elif rule is not None and robot is not None:
            report.error(
                "E246",
                f"region {region.name.text} has a posture rule, but robot {robot.name.text} "
                "brings every normal upright by itself",
                rule.span,
                hint="remove the rule",
            )


def _check_up(part: Statement, regions: Sequence[Region], report: Report) -> None:
    """One missing `up` is one mistake, however many rules ask for it."""
    rules = [region.posture for region in regions if region.posture is not None]
    rules += [rule.fallback for rule in rules if rule.fallback is not None]
    asking = [rule for rule in rules if rule.horizontal]
    if asking and all(item.key.text != "up" for item in part.items):
        report.error(
            "E248",
            f'"horizontal" needs to know what is up, and part {part.name.text} does not say it',
            asking[0].span,
            labels=[Label(part.name.span, "this part")],
            hint=f"part {part.name.text} {{ up +Z  … }}",
        )


def _sequence(found: Sequence[Statement], report: Report) -> float | None:
    for statement in found[1:]:
        report.error(
            "E215",
            "a spec has one sequence; this is another",
            statement.name.span,
            labels=[Label(found[0].name.span, "the first one")],
            hint="put everything into one of them",
        )
    item = Fields(found[0], report).get("heading_jump") if found else None
    if item is None:
        return None
    most = of_type(item.values[0], Quantity)
    jump = measure(most, "angle", "heading_jump", report, above=0)
    if jump > math.pi:
        report.error(
            "E206",
            f"heading_jump is {most.number} {most.unit}; it must be at most 180 deg, as far as any "
            "heading jumps",
            most.span,
        )
    return jump


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

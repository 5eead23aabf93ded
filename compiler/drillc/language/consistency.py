"""Checks that take several statements: what fits together, and what is declared but not used."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from drillc.kernels.rotations import angle_between
from drillc.language.ast import Statement, Text, Word
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import of_type
from drillc.language.job import Arm, HoleTable, Named, Part, Portal, Process, Region, Tool
from drillc.language.mesh_files import question_place
from drillc.language.operations import VISIT
from drillc.language.tables import Table

#: What a part's stated place may differ by from the one that follows from the arm's.
SAME_PLACE_MM = 1e-3
SAME_PLACE_RAD = 1e-6


def check_reserved(processes: Sequence[Process], report: Report) -> None:
    for process in processes:
        if process.name == VISIT.name:
            report.error(
                "E218",
                f'"{VISIT.name}" is what drillc calls the process of a region that names none',
                process.span,
                hint="give the process another name",
            )


def check_unused(
    spec_shown: str,
    processes: Sequence[Process],
    tables: Mapping[str, Table | None],
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


def check_machine(
    spec_shown: str, robot: Portal | Arm | None, tool: Tool | None, report: Report
) -> None:
    """A portal carries its own tool, and an arm needs one."""
    if isinstance(robot, Arm) and tool is None:
        report.error(
            "E265",
            f"robot {robot.name.text} is an arm, and the spec has no tool for it",
            robot.name.span,
            hint="tool NAME { number 1  tcp (x, y, z) mm }: the tool centre point on its flange",
        )
    elif (
        isinstance(robot, Portal) and tool is not None and tool.name.span.source.shown == spec_shown
    ):
        report.error(
            "E217",
            f"tool {tool.name.text} is not used: the portal carries its own",
            tool.name.span,
            hint="remove it",
        )


def check_rules(
    robot: Portal | Arm | None,
    regions: Sequence[Region],
    statements: Sequence[Statement],
    report: Report,
) -> None:
    """Whether each region has what decides its posture, and only that."""
    for region, statement in zip(regions, statements, strict=True):
        rule = region.posture
        if rule is None and not isinstance(robot, Portal):
            report.error(
                "E247",
                f"region {region.name.text} does not say how the tool is held about its axis",
                statement.name.span,
                hint="posture x horizontal toward +X; or posture y toward -Z",
            )
        elif rule is not None and isinstance(robot, Portal):
            report.error(
                "E246",
                f"region {region.name.text} has a posture rule, but robot {robot.name.text} "
                "brings every normal upright by itself",
                rule.span,
                hint="remove the rule",
            )


def check_up(part: Statement, regions: Sequence[Region], report: Report) -> None:
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


# ── arms ─────────────────────────────────────────────────────────────────────────────────────────


def check_needs_arm(
    has_arm: bool, regions: Sequence[Statement], sequences: Sequence[Statement], report: Report
) -> None:
    """What only an arm can follow: the rest of the machines have no choice of heading."""
    if has_arm:
        return
    for item in (item for statement in (*regions, *sequences) for item in statement.items):
        if item.key.text in _FOR_ARMS:
            report.error(
                "E266",
                f'"{item.key.text}" is for arms, and the spec has none',
                item.key.span,
                hint="declare one: robot NAME arm { … }; or remove this",
            )


_FOR_ARMS = ("avoid", "turning", "station", "weights")


def check_body(tool: Tool | None, regions: Sequence[Region], report: Report) -> None:
    """One missing body is one mistake, however many regions avoid something."""
    avoids = [avoid for region in regions for avoid in region.avoid]
    if avoids and tool is not None and not tool.body:
        report.error(
            "E267",
            f"tool {tool.name.text} has no body that could keep clear of anything",
            avoids[0].span,
            labels=[Label(tool.name.span, "this tool")],
            hint="body { cylinder (0, 0, 0) (0, 0, 300) mm radius 90 mm }: in flange coordinates",
        )


def check_stations(
    spec_shown: str, arm: Arm, part: Part, regions: Sequence[Region], report: Report
) -> None:
    """Every station has its regions, and a frame's number of its own."""
    used = {region.station for region in regions}
    frames: dict[int, Named] = {}
    for index, station in enumerate(arm.stations):
        name = station.name
        if name is None:
            continue
        # A single station need not be named by the regions.
        if index not in used and name.span.source.shown == spec_shown:
            report.error(
                "E217",
                f"station {name.text} is not used",
                name.span,
                hint="use it in a region, or remove it",
            )
        number = station.frame
        if number is None and part.frame is not None:
            number = part.frame.number
        if number is None:
            continue
        if number in frames:
            report.error(
                "E263",
                f"stations {frames[number].text} and {name.text} both have frame {number}; the "
                "part's place differs between them",
                name.span,
                labels=[Label(frames[number].span, "the other one")],
                hint=f"give each a frame of its own: station {name.text} frame {number + 1} at …",
            )
        frames.setdefault(number, name)


def check_place(arm: Arm, part: Part, report: Report) -> None:
    """Beside an arm the part's place is known: the world is the arm's root, and where that stands
    on the part is said by the base. A part that says otherwise contradicts it."""
    stated = None if part.frame is None else part.frame.world_from_part
    if stated is None or part.frame is None:
        return
    if arm.auto is not None:
        report.error(
            "E264",
            "the part's place cannot be stated while that of the arm is to be found",
            part.frame.span,
            labels=[Label(arm.auto.span, "the base")],
            hint=f"leave it out: frame {part.frame.number}",
        )
        return
    for station in arm.stations:
        rotation = station.part_from_root.rotation.T
        off = stated.translation_mm + rotation @ station.part_from_root.translation_mm
        apart_mm = float(np.linalg.norm(off))
        apart_rad = float(angle_between(rotation, stated.rotation))
        if apart_mm > SAME_PLACE_MM or apart_rad > SAME_PLACE_RAD:
            report.error(
                "E264",
                f"the part's place is {apart_mm:.6g} mm and {np.degrees(apart_rad):.6g} deg from "
                "where it is when the arm stands as stated",
                part.frame.span,
                labels=[Label(station.span, "where the arm stands, in part coordinates")],
                hint=f"leave it out, it follows: frame {part.frame.number}",
            )
            return


def check_surface(part: Part, statement: Statement, holes: HoleTable, report: Report) -> None:
    """Whether the surface lies where the holes are, or seems to be measured in another unit."""
    if part.surface is None or not len(holes):
        return
    item = next(item for item in statement.items if item.key.text == "surface")
    path, unit = of_type(item.values[0], Text), of_type(item.values[1], Word)
    question_place(part.surface, path, unit.text, holes.position_mm, report)

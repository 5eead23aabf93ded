"""Job → joints of an arm: a heading, a branch and a way to every hole, station by station.

The rule gives each hole's preferred heading (`postures.py`). Here the candidates are found
(`headings.py`), the sequence that costs the least is chosen among them (`sequence.py`), and the
ways between the holes are planned (`arm_travel.py`). What cannot be done is reported with its
reasons (`explain.py`).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drillc.language.diagnostics import NAMED_ROWS, Label, Report
from drillc.language.job import Arm, Floats, Ints, Job
from drillc.planning.arm_travel import LIFTS_MM, Blocked, Legs, make_legs, plan_travel
from drillc.planning.cell import Cell, make_cells
from drillc.planning.cycle_check import Candidates, Cycles, join, make_cycles
from drillc.planning.explain import explain, least_turn_rad, said_verdict
from drillc.planning.headings import preferred, turned
from drillc.planning.program import Vias
from drillc.planning.sequence import choose
from drillc.planning.standing import check_standing
from drillc.planning.tool_sweeps import ToolSweeps, make_tool_sweeps

Rows = NDArray[np.int64]
Progress = Callable[[str], None]

#: Holes whose candidates are sought together: bounds the memory, and paces the progress.
_BLOCK = 4096


@dataclass(frozen=True, eq=False)
class StationPlan:
    """What is made from one station: its holes' rows, in order, and the moves beside the cycles."""

    cell: Cell
    rows: Rows
    vias: Vias


@dataclass(frozen=True, eq=False)
class ArmSolution:
    """Joints (n, 6) of every hole with what led to them. `heading_rad` (n,): away from the rule's;
    `branch` (n,): the kernel's number of it; `margin` (n,): the least share of a joint's range that
    is left over the cycle."""

    part_from_tool: Floats  # (n, 3, 3)
    heading_rad: Floats
    branch: Ints
    joints: Floats
    standoff_joints: Floats
    margin: Floats
    stations: tuple[StationPlan, ...]


def solve_arm(
    job: Job,
    arm: Arm,
    part_from_tool: Floats,
    depth_mm: Floats,
    report: Report,
    progress: Progress,
) -> ArmSolution | None:
    """Solve every hole from its station, or report why not and return None. `part_from_tool`
    (n, 3, 3) is what the rules say."""
    count = len(job.holes)
    station_of = np.array([region.station for region in job.regions])[job.holes.region]
    cells = make_cells(job, arm)
    check_frames(job, arm, report)
    _check_standoffs(job, arm, report)
    report.stop_if_failed()
    if arm.home_rad is None:
        report.warn(
            "W417",
            f"robot {arm.name.text} has no home, so nobody checks its way to the first hole, nor "
            "from the last one",
            arm.name.span,
            hint="home { A1 0 deg  A2 -90 deg  A3 90 deg  A4 0 deg  A5 30 deg  A6 0 deg }",
        )
    standing = [check_standing(cell, report) for cell in cells]
    found: list[tuple[Rows, Candidates]] = []
    plans: list[StationPlan] = []
    for index, cell in enumerate(cells):
        if not standing[index]:
            continue
        rows = np.flatnonzero(station_of == index)
        solved = _solve_station(job, cell, rows, part_from_tool, depth_mm, report, progress)
        if solved is not None:
            found.append((rows, solved[0]))
            plans.append(StationPlan(cell, rows, solved[1]))
    if report.failed:
        return None
    out = ArmSolution(
        part_from_tool.copy(),
        np.empty(count),
        np.empty(count, dtype=np.int32),
        np.empty((count, 6)),
        np.empty((count, 6)),
        np.empty(count),
        tuple(plans),
    )
    for rows, chosen in found:
        cycles = make_cycles(job, rows, part_from_tool, depth_mm)
        out.part_from_tool[rows] = cycles.turned(np.arange(len(rows)), chosen.heading_rad)
        out.heading_rad[rows] = chosen.heading_rad
        out.branch[rows] = chosen.branch
        out.joints[rows] = chosen.joints
        out.standoff_joints[rows] = chosen.standoff
        out.margin[rows] = chosen.margin
    return out


def _solve_station(
    job: Job,
    cell: Cell,
    rows: Rows,
    part_from_tool: Floats,
    depth_mm: Floats,
    report: Report,
    progress: Progress,
) -> tuple[Candidates, Vias] | None:
    cycles = make_cycles(job, rows, part_from_tool, depth_mm)
    sweeps = make_tool_sweeps(cell, cycles)
    turning_rad = np.array([region.turning_rad for region in job.regions])[cycles.region]
    candidates = find_candidates(cell, cycles, sweeps, turning_rad, progress)
    missing = np.setdiff1d(np.arange(len(rows)), candidates.row)
    if len(missing):
        _report_missing(job, cell, cycles, sweeps, turning_rad, rows, missing, report)
        return None
    progress(f"choosing among {len(candidates):,} headings and branches")
    limit_rad = jump_limits(job, cycles)
    sequence = choose(cell, cycles, sweeps, candidates, turning_rad, limit_rad, job.weights)
    if sequence.blocked is not None:
        least_rad = least_turn_rad(cycles, sweeps, sequence.blocked, turning_rad)
        _report_jump(job, rows, sequence.blocked, least_rad, report)
        return None
    progress(f"planning the ways between {len(rows):,} holes")
    legs = make_legs(cell, cycles.region)
    vias, blocked = plan_travel(cell, cycles, sequence.chosen, legs)
    if blocked:
        _report_ways(job, cell, rows, legs, blocked, report)
        return None
    return sequence.chosen, vias


def jump_limits(job: Job, cycles: Cycles) -> Floats:
    """How far the heading may jump from each hole to the next (n - 1,): freely between regions."""
    limit_rad = np.full(max(0, len(cycles) - 1), np.inf)
    if job.heading_jump_max_rad is not None:
        limit_rad[cycles.region[1:] == cycles.region[:-1]] = job.heading_jump_max_rad
    return limit_rad


def find_candidates(
    cell: Cell,
    cycles: Cycles,
    sweeps: ToolSweeps,
    turning_rad: Floats,
    progress: Progress,
) -> Candidates:
    """Candidates of every hole that has any: the rule's own heading where that works, else others
    within `turning_rad` (n,)."""
    parts = []
    for start in range(0, len(cycles), _BLOCK):
        progress(f"finding headings, {start:,} of {len(cycles):,} holes")
        rows = np.arange(start, min(start + _BLOCK, len(cycles)))
        first = preferred(cell, cycles, sweeps, rows)
        parts.append(first)
        rest = np.setdiff1d(rows, first.row)
        rest = rest[turning_rad[rest] > 0]
        if len(rest):
            parts.append(turned(cell, cycles, sweeps, rest, turning_rad[rest]))
    return join(parts)


def check_frames(job: Job, arm: Arm, report: Report) -> None:
    """An arm's program says where the part stands, and so needs a number for that frame."""
    for station in arm.stations:
        if station.frame is None and job.part.frame is None:
            report.error(
                "E415",
                "the part's frame on the controller has no number: its place follows from where "
                "the arm is parked, and is written to that frame",
                station.span,
                labels=[Label(job.part.name.span, "the part")],
                hint=f"part {job.part.name.text} {{ … frame 1 }}"
                + ("" if station.name is None else "; or station … frame 1"),
            )


def _check_standoffs(job: Job, arm: Arm, report: Report) -> None:
    """A standoff beyond the arm's whole stretch is a slip of the unit, not a hole out of reach."""
    geometry, tool = arm.model.geometry, job.tool
    assert tool is not None
    stretch_mm = (
        geometry.a1_mm
        + geometry.c2_mm
        + geometry.forearm_mm
        + geometry.c4_mm
        + float(np.linalg.norm(tool.flange_from_tool.translation_mm))
    )
    for index in dict.fromkeys(region.process for region in job.regions):
        process = job.processes[index]
        away_mm = max(process.approach_mm, process.retract_mm)
        if away_mm > stretch_mm:
            report.error(
                "E418",
                f"process {process.name} withdraws {away_mm:g} mm from the surface, farther than "
                f"{arm.model.title} with tool {tool.name.text} is long ({stretch_mm:.0f} mm)",
                process.span,
                labels=[Label(arm.name.span, "the arm")],
                hint="check the units of approach and retract",
            )


# ── what cannot be done ──────────────────────────────────────────────────────────────────────────


def _report_missing(
    job: Job,
    cell: Cell,
    cycles: Cycles,
    sweeps: ToolSweeps,
    turning_rad: Floats,
    rows: Rows,
    missing: Rows,
    report: Report,
) -> None:
    """Each hole that cannot be made: what is in the way, and what would mend it."""
    holes = job.holes
    for row in missing[:NAMED_ROWS].tolist():
        why = explain(cell, cycles, sweeps, row, turning_rad)
        region = job.regions[cycles.region[row]]
        asked = [Label(a.span, "kept clear of here") for a in region.avoid]
        report.error(
            "E410",
            f"hole {holes.ids[rows[row]]} cannot be made: {why.summary}",
            holes.span(int(rows[row])),
            labels=asked[:1],
            hint=why.mend
            or "none of these helps by itself: turning farther, less clearance, moving the base",
        )
    if len(missing) > NAMED_ROWS:
        more = int(rows[missing[NAMED_ROWS]])
        report.error(
            "E410",
            f"and {len(missing) - NAMED_ROWS:,} more holes that cannot be made",
            holes.span(more),
        )


def _report_jump(job: Job, rows: Rows, blocked: int, least_rad: float, report: Report) -> None:
    """`least_rad`: what the two holes' headings ask for, whatever those before them are."""
    assert job.heading_jump_max_rad is not None
    allowed, least = math.degrees(job.heading_jump_max_rad), math.degrees(least_rad)
    asked, more = "", "…"
    if least > allowed:
        asked = f" ({least:.1f} deg is the least found)"
        more = f"{math.ceil(10 * least) / 10:g} deg"
    holes, row = job.holes, int(rows[blocked])
    before = int(rows[blocked - 1])
    report.error(
        "E411",
        f"hole {holes.ids[row]} cannot be reached from hole {holes.ids[before]} without turning "
        f"the tool about its axis by more than {allowed:g} deg{asked}, whichever headings are "
        "taken",
        holes.span(row),
        labels=[Label(holes.span(before), "from here")],
        hint=f"allow more: heading_jump max {more}; or give the holes more freedom: turning within "
        "…; or put them into separate regions",
    )


def _report_ways(
    job: Job, cell: Cell, rows: Rows, legs: Legs, blocked: list[Blocked], report: Report
) -> None:
    holes = job.holes

    def said(hole: int) -> str:
        return "home" if hole < 0 else f"hole {holes.ids[rows[hole]]}"

    by_home, or_home = " nor going by way of home", "choose another home"
    if cell.arm.home_rad is None:
        by_home, or_home = "", "give the arm a home to go by"
    for lost in blocked[:NAMED_ROWS]:
        leaves, reaches = int(legs.leaves[lost.leg]), int(legs.reaches[lost.leg])
        at = int(rows[reaches if reaches >= 0 else leaves])
        report.error(
            "E412",
            f"there is no clear way from {said(leaves)} to {said(reaches)}: on the plain one, "
            f"{said_verdict(cell, lost.verdict)}; neither withdrawing up to {LIFTS_MM[-1]:g} mm "
            f"farther nor going by joints{by_home} helps",
            holes.span(at),
            hint=f"order the holes otherwise, move the fixture, or {or_home}",
        )
    if len(blocked) > NAMED_ROWS:
        report.error("E412", f"and {len(blocked) - NAMED_ROWS:,} more ways that are not clear")

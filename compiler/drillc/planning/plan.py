"""Poses and joints → Programs: cycles per process, sections per region, columns per hole."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drillc.language.job import Floats, Job, Pose, Region, Station, WorkFrame
from drillc.planning.arm_joints import ArmSolution, StationPlan
from drillc.planning.cycles import cycle_of
from drillc.planning.ordering import take
from drillc.planning.program import ArmMotion, Cycle, JointMotion, Program, Section


def plan(job: Job, part_from_tool: Floats, depth_mm: Floats, motion: JointMotion | None) -> Program:
    """The program in the order of the hole table; its cycles in the order in which regions first
    use them, without those that none uses."""
    return Program(
        name=job.program.text,
        frame=job.part.frame,
        tool=None if motion is not None else job.tool,
        signals=job.signals,
        cycles=_cycles(job, job.regions),
        sections=_sections(job.regions),
        holes=job.holes,
        part_from_tool=part_from_tool,
        depth_mm=depth_mm,
        motion=motion,
    )


def plan_stations(job: Job, solution: ArmSolution, depth_mm: Floats) -> tuple[Program, ...]:
    """A program for each of the arm's stations: between two the arm is moved by others."""
    return tuple(_station_program(job, solution, one, depth_mm) for one in solution.stations)


def _station_program(
    job: Job, solution: ArmSolution, plan: StationPlan, depth_mm: Floats
) -> Program:
    rows, station = plan.rows, plan.cell.station
    regions = [job.regions[i] for i in dict.fromkeys(job.holes.region[rows].tolist())]
    name = job.program.text if station.name is None else f"{job.program.text}_{station.name.text}"
    return Program(
        name=name,
        frame=_frame(job, station),
        tool=job.tool,
        signals=job.signals,
        cycles=_cycles(job, regions),
        sections=_sections(regions),
        holes=take(job.holes, rows),
        part_from_tool=solution.part_from_tool[rows],
        depth_mm=depth_mm[rows],
        motion=None,
        arm=ArmMotion(
            plan.cell.arm,
            station,
            solution.joints[rows],
            solution.standoff_joints[rows],
            plan.vias,
        ),
    )


def _cycles(job: Job, regions: Sequence[Region]) -> tuple[Cycle, ...]:
    used = dict.fromkeys(region.process for region in regions)
    return tuple(cycle_of(job.processes[index], job.signals) for index in used)


def _sections(regions: Sequence[Region]) -> tuple[Section, ...]:
    used = list(dict.fromkeys(region.process for region in regions))
    sections, start = [], 0
    for region in regions:
        stop = start + region.stop - region.start
        cycle = used.index(region.process)
        sections.append(Section(region.name.text, cycle, start, stop, region.name.span))
        start = stop
    return tuple(sections)


def _frame(job: Job, station: Station) -> WorkFrame | None:
    """The part's frame when the arm stands there: the controller's world is the arm's root."""
    number = station.frame
    if number is None and job.part.frame is not None:
        number = job.part.frame.number
    if number is None:
        return None
    root = station.part_from_root
    rotation = np.asarray(root.rotation.T)
    return WorkFrame(number, Pose(rotation, -(rotation @ root.translation_mm)), station.span)

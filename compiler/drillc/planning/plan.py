"""Poses and joints → Program: cycles per process, sections per region, columns per hole."""

from __future__ import annotations

from drillc.language.job import Floats, Job
from drillc.planning.cycles import cycle_of
from drillc.planning.program import JointMotion, Program, Section


def plan(job: Job, part_from_tool: Floats, depth_mm: Floats, motion: JointMotion | None) -> Program:
    """The program in the order of the hole table; its cycles in the order in which regions first
    use them, without those that none uses."""
    used = list(dict.fromkeys(region.process for region in job.regions))
    return Program(
        name=job.program.text,
        frame=job.part.frame,
        tool=None if motion is not None else job.tool,
        signals=job.signals,
        cycles=tuple(cycle_of(job.processes[index], job.signals) for index in used),
        sections=tuple(
            Section(
                region.name.text,
                used.index(region.process),
                region.start,
                region.stop,
                region.name.span,
            )
            for region in job.regions
        ),
        holes=job.holes,
        part_from_tool=part_from_tool,
        depth_mm=depth_mm,
        motion=motion,
    )

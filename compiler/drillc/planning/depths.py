"""How deep each hole is made: the process's depth, the hole's own stack, and the countersink."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drillc.language.diagnostics import Report
from drillc.language.holes import report_holes
from drillc.language.job import Countersink, Floats, Job, Region


def plunge_depths(job: Job, report: Report) -> Floats:
    """Depth (n,) in mm from the hole's position along the feed; 0 where nothing is drilled.

    Reports holes that lack the stack or diameter their process asks for.
    """
    depth_mm = np.zeros(len(job.holes))
    for region in job.regions:
        drill = job.processes[region.process].drill
        if drill is None:
            continue
        rows = slice(region.start, region.stop)
        depth_mm[rows] = drill.depth_mm
        if drill.depth_from_stack:
            depth_mm[rows] += job.holes.stack_mm[rows]
            _report(
                job,
                region,
                np.isnan(job.holes.stack_mm[rows]),
                "E340",
                lambda row: f"the depth asks for the stack, which hole {job.holes.ids[row]} lacks",
                report,
                "map it: columns { stack TITLE … }, or state the depth as a length",
            )
            _report(
                job,
                region,
                depth_mm[rows] <= 0,
                "E341",
                lambda row: (
                    f"hole {job.holes.ids[row]} would be {depth_mm[row]:g} mm deep "
                    f"(its stack is {job.holes.stack_mm[row]:g} mm)"
                ),
                report,
                "the depth must be more than 0 mm",
            )
        sink = job.processes[region.process].countersink
        if sink is not None:
            depth_mm[rows] += _sink_depths(job, region, sink, report)
    return depth_mm


def _sink_depths(job: Job, region: Region, sink: Countersink, report: Report) -> Floats:
    """How much farther the cone goes: half the rim's excess over the hole, by the half-angle."""
    rows = slice(region.start, region.stop)
    if sink.by_mm is not None:
        return np.full(region.stop - region.start, sink.by_mm)
    assert sink.diameter_mm is not None
    rim_mm, diameter_mm = sink.diameter_mm, job.holes.diameter_mm[rows]
    _report(
        job,
        region,
        np.isnan(diameter_mm),
        "E342",
        lambda row: (
            f"the countersink's depth follows from the diameter, which hole "
            f"{job.holes.ids[row]} lacks"
        ),
        report,
        "map it: columns { diameter TITLE … }, or write: countersink … by 1.5 mm",
    )
    _report(
        job,
        region,
        diameter_mm >= rim_mm,
        "E343",
        lambda row: (
            f"the countersink's rim, {rim_mm:g} mm, is not wider than hole "
            f"{job.holes.ids[row]}, {job.holes.diameter_mm[row]:g} mm"
        ),
        report,
        "give the rim's diameter, which is the larger; or: countersink … by 1.5 mm",
    )
    return (rim_mm - diameter_mm) / (2.0 * math.tan(sink.angle_rad / 2.0))


def _report(
    job: Job,
    region: Region,
    bad: NDArray[np.bool_],
    code: str,
    message: Callable[[int], str],
    report: Report,
    hint: str,
) -> None:
    rows = np.flatnonzero(bad) + region.start
    report_holes(job.holes, rows, code, message, report, hint=lambda row: hint)

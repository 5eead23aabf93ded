"""How deep each hole is made: the process's depth, the hole's own stack, and the countersink."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drillc.language.diagnostics import Label, Report
from drillc.language.holes import report_holes
from drillc.language.job import Countersink, Floats, Job, Region
from drillc.language.operations import SMALLEST


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
                "stacks are given by hole tables: columns { stack TITLE … }; or state the depth as "
                "a length",
            )
            _report(
                job,
                region,
                depth_mm[rows] < SMALLEST,
                "E341",
                lambda row: (
                    f"hole {job.holes.ids[row]} would be {depth_mm[row]:g} mm deep "
                    f"(its stack is {job.holes.stack_mm[row]:g} mm)"
                ),
                report,
                f"the depth must be at least {SMALLEST:g} mm",
            )
        sink = job.processes[region.process].countersink
        if sink is not None:
            depth_mm[rows] += _sink_depths(job, region, sink, report)
    _check_one_diameter(job, report)
    return depth_mm


def _check_one_diameter(job: Job, report: Report) -> None:
    """Warn where holes of several diameters are drilled: a program has one tool."""
    drilled = np.concatenate(
        [
            np.arange(region.start, region.stop)
            for region in job.regions
            if job.processes[region.process].drill is not None
        ]
        or [np.empty(0, dtype=np.int64)]
    )
    drilled = drilled[np.isfinite(job.holes.diameter_mm[drilled])]
    if not len(drilled):
        return
    diameter_mm = job.holes.diameter_mm[drilled]
    other = drilled[np.flatnonzero(diameter_mm != diameter_mm[0])[:1]]
    if not len(other):
        return
    first, row, holes = int(drilled[0]), int(other[0]), job.holes
    different = np.unique(diameter_mm)
    some = ", ".join(f"{value:g}" for value in different[:5]) + ", …" * (len(different) > 5)
    report.warn(
        "W344",
        f"holes of {len(different)} diameters are drilled ({some} mm) in a program that has one "
        f"tool",
        holes.span(row),
        labels=[Label(holes.span(first), f"this one has {holes.diameter_mm[first]:g} mm")],
        hint="make a spec for each tool, and skip the other holes there",
    )


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
        "diameters are given by hole tables: columns { diameter TITLE … }; or: "
        "countersink … by 1.5 mm",
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

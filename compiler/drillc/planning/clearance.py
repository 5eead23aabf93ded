"""Whether the tool's point keeps out of the fixtures, and clear of the part on its travels.

Only the tool centre point's path is checked: against fixtures between its standoff and its depth,
and from standoff to standoff within a region; against the part from standoff to standoff (judged
from the holes' normals, so a warning). The tool's body is not: that takes its shape.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from drillc.geometry.obstacles import Obstacles
from drillc.geometry.shapes import Mesh, RoundedHull, bounds_mm, box
from drillc.language.diagnostics import Label, Report
from drillc.language.holes import report_holes
from drillc.language.job import Floats, Job
from drillc.planning.bulge import arc_rise_mm, turned_rad


def check_fixtures(
    job: Job,
    part_from_tool: Floats,
    depth_mm: Floats,
    between: Sequence[Floats],
    report: Report,
) -> None:
    """Report each hole whose plunge, or whose travel from its neighbour, enters a fixture.

    `between` are the points (n - 1, 3), in part coordinates, that the tool passes in straight lines
    after it has left one hole's standoff and before it reaches the next one's.
    """
    if not job.fixtures:
        return
    axis, position = part_from_tool[:, :, 2], job.holes.position_mm
    arrive_mm, leave_mm = standoffs_mm(job)
    outmost = position - axis * np.maximum(arrive_mm, leave_mm)[:, None]
    bottom = position + axis * depth_mm[:, None]
    ends = position - axis * leave_mm[:, None], position - axis * arrive_mm[:, None]
    way = [ends[0][:-1], *between, ends[1][1:]]
    neighbours = job.holes.region[1:] == job.holes.region[:-1]
    holes = job.holes
    for fixture in job.fixtures:
        for solid in fixture.solids:
            label = Label(solid.span, f"fixture {fixture.name.text}")
            report_holes(
                holes,
                enters(outmost, bottom, solid.shape),
                "E360",
                lambda row, name=fixture.name.text: (  # type: ignore[misc]
                    f"the tool's path into hole {holes.ids[row]} enters fixture {name}"
                ),
                report,
                hint=lambda row: "move the fixture; or approach and retract less far",
                label=lambda row, label=label: label,  # type: ignore[misc]
            )
            hit = np.zeros(len(neighbours), dtype=np.bool_)
            for start, end in pairwise(way):
                hit |= enters(start, end, solid.shape)
            report_holes(
                holes,
                np.flatnonzero(hit & neighbours) + 1,
                "E361",
                lambda row, name=fixture.name.text: (  # type: ignore[misc]
                    f"the travel from hole {holes.ids[row - 1]} to hole {holes.ids[row]} enters "
                    f"fixture {name}"
                ),
                report,
                hint=lambda row: "retract farther, or put the holes into separate regions",
                label=lambda row, label=label: label,  # type: ignore[misc]
            )


def standoffs_mm(job: Job) -> tuple[Floats, Floats]:
    """How far before each hole (n,) the tool arrives, and how far it leaves."""
    arrive, leave = np.empty(len(job.holes)), np.empty(len(job.holes))
    for region in job.regions:
        process = job.processes[region.process]
        arrive[region.start : region.stop] = process.approach_mm
        leave[region.start : region.stop] = process.retract_mm
    return arrive, leave


def check_travel(job: Job, part_from_tool: Floats, report: Report) -> None:
    """Warn where the straight way from a hole's standoff to the next one's may cut the part."""
    axis, position = part_from_tool[:, :, 2], job.holes.position_mm
    if len(axis) < 2:
        return
    arrive, leave = standoffs_mm(job)
    turned = turned_rad(axis)
    rise = arc_rise_mm(position, axis)
    # Both ends of the way stand off along their own normals, so their height over the chord is
    # the standoff's share along the normal between the two.
    height = np.minimum(leave[:-1], arrive[1:]) * np.cos(0.5 * turned)
    holes = job.holes
    station = np.array([region.station for region in job.regions])[holes.region]
    driven = station[1:] == station[:-1]  # between two stations of an arm the tool does not go
    report_holes(
        holes,
        np.flatnonzero((rise > height) & driven) + 1,
        "W362",
        lambda row: (
            f"between holes {holes.ids[row - 1]} and {holes.ids[row]} the part may rise "
            f"{rise[row - 1]:.0f} mm over the line from one to the other (its normals turn by "
            f"{np.degrees(turned[row - 1]):.0f} deg); the tool travels {height[row - 1]:.0f} mm "
            f"over that line"
        ),
        report,
        hint=lambda row: "retract and approach farther, or order the holes along the part",
        label=lambda row: Label(holes.span(row - 1), "from here"),
    )


def enters(start_mm: Floats, end_mm: Floats, solid: RoundedHull | Mesh) -> NDArray[np.bool_]:
    """Whether each segment (n, 3) → (n, 3) meets the closed solid.

    Exact for a box parallel to the axes; at others, what passes within 0.002 mm counts as meeting.
    """
    low_mm, high_mm = bounds_mm(solid)
    met = _crosses(start_mm, end_mm, low_mm, high_mm)
    near = np.flatnonzero(met)
    if not len(near) or _fills(solid, low_mm, high_mm):
        return met
    obstacle, line_mm = Obstacles([solid]), np.zeros(1)
    met[near] = ~obstacle.capsules_clear(start_mm[near, None], end_mm[near, None], line_mm)
    return met


def _fills(solid: RoundedHull | Mesh, low_mm: Floats, high_mm: Floats) -> bool:
    """Whether a solid is the box around it."""
    if isinstance(solid, Mesh) or solid.radius_mm > 0:
        return False
    corners = {tuple(point) for point in solid.points_mm.tolist()}
    return corners == {tuple(point) for point in box(low_mm, high_mm).points_mm.tolist()}


def _crosses(
    start_mm: Floats, end_mm: Floats, low_mm: Floats, high_mm: Floats
) -> NDArray[np.bool_]:
    """Whether each segment (n, 3) → (n, 3) meets a closed box: the slab test."""
    along = end_mm - start_mm
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        first = (low_mm - start_mm) / along
        second = (high_mm - start_mm) / along
    near, far = np.minimum(first, second), np.maximum(first, second)
    # A segment parallel to a slab is inside it for its whole length, or never.
    inside = (start_mm >= low_mm) & (start_mm <= high_mm)
    flat = along == 0
    near = np.where(flat, np.where(inside, -np.inf, np.inf), near)
    far = np.where(flat, np.where(inside, np.inf, -np.inf), far)
    enter = np.maximum(near.max(axis=1), 0.0)
    leave = np.minimum(far.min(axis=1), 1.0)
    return np.asarray(enter <= leave)

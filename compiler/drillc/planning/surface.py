"""Job → Job: the holes against the part's surface, from which their normals may come."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from drillc.language.diagnostics import Label, Report
from drillc.language.holes import report_holes
from drillc.language.job import Job


def fit_to_surface(job: Job, report: Report) -> Job:
    """The same job, its feeds all known. Reports holes off the surface, and normals off its own.

    A surface's normals point outward, so a hole's feed is the opposite of the one nearest to it.
    """
    surface = job.part.surface
    if surface is None:
        return job
    from drillc.geometry.surface import closest

    holes = job.holes
    found = closest(surface.mesh, holes.position_mm)
    off_mm = found.distance_mm
    label = Label(surface.span, "the surface")
    report_holes(
        holes,
        np.asarray(~(off_mm <= surface.within_mm)),
        "E345",
        lambda row: (
            f"hole {holes.ids[row]} is {off_mm[row]:.3f} mm from the part's surface (within "
            f"{surface.within_mm:g} mm)"
        ),
        report,
        hint=lambda row: (
            "correct the position, the surface or its unit; or allow more: "
            'surface "…" mm within … mm, … deg'
        ),
        label=lambda row: label,
    )
    if job.part.normals_from_surface:
        return replace(job, holes=replace(holes, feed=-found.normal))
    off_rad = 2.0 * np.arctan2(
        np.linalg.norm(holes.feed + found.normal, axis=1),
        np.linalg.norm(holes.feed - found.normal, axis=1),
    )
    report_holes(
        holes,
        np.asarray(~(off_rad <= surface.within_rad) & (off_mm <= surface.within_mm)),
        "E346",
        lambda row: (
            f"the normal of hole {holes.ids[row]} is {np.degrees(off_rad[row]):.2f} deg from the "
            f"surface's (within {np.degrees(surface.within_rad):g} deg)"
            + (": it points the other way" if off_rad[row] > np.radians(170.0) else "")
        ),
        report,
        hint=lambda row: (
            f"if all of them do, say so: normals {'outward' if job.part.normals_into else 'into'}"
            if off_rad[row] > np.radians(170.0)
            else 'correct the normal; or allow more: surface "…" mm within … mm, … deg'
        ),
        label=lambda row: label,
    )
    return job

"""Job → postures: each hole's tool orientation, by its region's rule and that rule's fallback.

Not done here: choosing among headings (there is no body to avoid yet), or anything about a machine.
"""

from __future__ import annotations

import math

import numpy as np

from drillc.kernels.posture import Posture, heading_jump_rad, horizontal, toward
from drillc.language.diagnostics import Label, Report
from drillc.language.holes import report_holes
from drillc.language.job import Floats, Job, PostureRule, Region

_AXIS = "xy"


def resolve_postures(job: Job, report: Report) -> Floats:
    """`part_from_tool` (n, 3, 3): columns are the tool's x, y, z axes, z along the feed.

    Source: posture article, Steps 1–3, in the checked form. Reports each hole that no rule decides.
    """
    part_from_tool = np.full((len(job.holes), 3, 3), np.nan)
    for region in job.regions:
        if region.posture is not None:
            rows = slice(region.start, region.stop)
            part_from_tool[rows] = _by_rule(job, region, region.posture, report)
    return part_from_tool


def check_heading_jumps(job: Job, part_from_tool: Floats, report: Report) -> None:
    """Warn where the tool turns about its own axis between neighbours by more than the limit."""
    limit_rad = job.heading_jump_max_rad
    if limit_rad is None:
        return
    holes = job.holes
    for region in job.regions:
        jump_rad = heading_jump_rad(part_from_tool[region.start : region.stop])
        report_holes(
            holes,
            np.flatnonzero(jump_rad > limit_rad) + region.start + 1,
            "W350",
            lambda row, jump=jump_rad, first=region.start: (  # type: ignore[misc]
                f"the tool turns by {math.degrees(jump[row - first - 1]):.1f} deg about its axis "
                f"between holes {holes.ids[row - 1]} and {holes.ids[row]}; the limit is "
                f"{math.degrees(limit_rad):g} deg"
            ),
            report,
            hint=lambda row: "order the holes so that the tool turns less; or change the rule",
            label=lambda row: Label(holes.span(row - 1), "from here"),
        )


def _by_rule(job: Job, region: Region, rule: PostureRule, report: Report) -> Floats:
    feed = job.holes.feed[region.start : region.stop]
    posture = _apply(rule, feed, job)
    chosen = posture.part_from_tool
    open_ = posture.undefined | posture.ambiguous
    last, last_posture = rule, posture
    while last.fallback is not None and open_.any():
        last = last.fallback
        rows = np.flatnonzero(open_)
        partial = _apply(last, feed[rows], job)
        decided = ~(partial.undefined | partial.ambiguous)
        chosen[rows[decided]] = partial.part_from_tool[decided]
        last_posture = _spread(partial, rows, len(feed))
        open_[rows[decided]] = False
    _report_open(job, region, last, last_posture, open_, report)
    return chosen


def _apply(rule: PostureRule, feed: Floats, job: Job) -> Posture:
    if not rule.horizontal:
        assert rule.toward is not None
        return toward(feed, rule.toward, rule.axis, rule.cone_rad)
    assert job.part.up is not None
    return horizontal(feed, job.part.up, rule.axis, rule.toward, rule.cone_rad)


def _spread(partial: Posture, rows: np.ndarray, count: int) -> Posture:
    """The result for some rows as one over all rows, so that messages can index it by row."""
    tilt, undefined, ambiguous = np.zeros(count), np.zeros(count, bool), np.zeros(count, bool)
    tilt[rows], undefined[rows], ambiguous[rows] = (
        partial.tilt_rad,
        partial.undefined,
        partial.ambiguous,
    )
    return Posture(np.empty((0, 3, 3)), tilt, undefined, ambiguous)


def _report_open(
    job: Job,
    region: Region,
    rule: PostureRule,
    posture: Posture,
    open_: np.ndarray,
    report: Report,
) -> None:
    holes, start = job.holes, region.start
    axis = _AXIS[rule.axis]

    def tilt(row: int) -> str:
        return f"{math.degrees(posture.tilt_rad[row - start]):.3g} deg"

    label = Label(rule.span, "this rule")
    fallen_back = rule is not region.posture
    if rule.horizontal:
        code, what = "E351", "vertical, where every heading is horizontal"
    else:
        code, what = "E352", "the direction of `toward`, along which it gives no heading"
    report_holes(
        holes,
        np.flatnonzero(open_ & posture.undefined) + start,
        code,
        lambda row: (
            f"the normal of hole {holes.ids[row]} is {tilt(row)} from {what} "
            f"(the rule decides from {math.degrees(rule.cone_rad):g} deg on)"
        ),
        report,
        hint=lambda row: (
            f"the fallback too must decide there: {axis} toward {_suggest(holes.feed[row])}"
            if fallen_back
            else f"give the rule a fallback: posture {axis} … fallback {axis} toward "
            f"{_suggest(holes.feed[row])}"
        ),
        label=lambda row: label,
    )
    report_holes(
        holes,
        np.flatnonzero(open_ & posture.ambiguous) + start,
        "E353",
        lambda row: (
            f"`toward` cannot choose the sense of {axis} at hole {holes.ids[row]}: it is "
            f"perpendicular to the horizontal direction there"
        ),
        report,
        hint=lambda row: (
            f"choose another direction: posture {axis} horizontal toward "
            f"{_suggest_sense(job, holes.feed[row])}"
        ),
        label=lambda row: label,
    )


def _suggest(feed: Floats) -> str:
    """The signed axis that is most nearly perpendicular to a feed direction."""
    return "+" + "XYZ"[int(np.argmin(np.abs(feed)))]


def _suggest_sense(job: Job, feed: Floats) -> str:
    """The signed axis that is most nearly along the horizontal at a feed direction."""
    assert job.part.up is not None
    return "+" + "XYZ"[int(np.argmax(np.abs(np.cross(job.part.up, feed))))]

"""Job → joints of the riveting portal: the second seed's closed form, limits and height rules.

The plate's outward normal is brought to vertical (upward); the tool works along q6 from the side
the spec states. Feasible means the whole cycle: standoffs and depth as well as the hole itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drillc.kernels.least_travel import least_travel
from drillc.kernels.portal import (
    Offsets,
    PortalGeometry,
    forward,
    height_interval,
    joints,
    offsets,
    pointing,
    widest_margin_mm,
)
from drillc.kernels.windings import unwrap
from drillc.language.diagnostics import Label, Report
from drillc.language.holes import report_holes
from drillc.language.job import PORTAL_JOINTS, ROTARY_JOINT, Floats, Ints, Job, Limit, Portal
from drillc.planning.clearance import standoffs_mm
from drillc.planning.program import JointAxis, JointMotion
from drillc.planning.travel import travel_height_mm, travel_points_mm

#: Slack for comparing with a limit, so that a hole exactly on it passes.
SLACK_MM = 1e-6
#: What forward kinematics of a solution may differ by, beside rounding; more is a bug in drillc.
CLOSURE_MM, CLOSURE_RAD = 1e-6, 1e-9

#: The share of its standoff that the tool keeps over the plate while the part moves; where less is
#: sure, the tool withdraws all the way.
LEAST_HEIGHT = 0.5

AXES = tuple(JointAxis(name, i == ROTARY_JOINT) for i, name in enumerate(PORTAL_JOINTS))
_FEED_AXIS = 5

#: base_from_tool: the tool's z axis is the direction in which it feeds.
_BASE_FROM_TOOL = {"below": np.eye(3), "above": np.diag([1.0, -1.0, -1.0])}


@dataclass(frozen=True, eq=False)
class Solution:
    """Joints (n, 6) with what led to them. `margin` (n,) is the distance to the nearest limit as a
    share of that joint's range; `branch` (n,) is 1, the only one a portal can hold."""

    motion: JointMotion
    part_from_tool: Floats  # (n, 3, 3)
    branch: Ints
    margin: Floats


@dataclass(frozen=True, eq=False)
class _Reach:
    """How far the cycle goes beyond the hole along q6 (n,), downwards and upwards."""

    below_mm: Floats
    above_mm: Floats


def solve_portal(job: Job, robot: Portal, depth_mm: Floats, report: Report) -> Solution | None:
    """Solve every hole, or report why not and return None."""
    geometry = _geometry(robot)
    before = len(report.diagnostics)
    alpha, beta = pointing(-job.holes.feed)
    _check_tilt(job, robot, geometry, alpha, report)
    q3 = unwrap(beta[:, 0], robot.limits[2].low, robot.limits[2].high)
    offs = offsets(geometry, job.holes.position_mm, alpha[:, 0], beta[:, 0])
    _check_fixed_joints(job, robot, beta[:, 0], q3, offs, report)
    reach = _reach(job, robot, depth_mm)
    low, high = height_interval(
        offs,
        (robot.limits[0].low, robot.limits[0].high),
        (robot.limits[1].low, robot.limits[1].high),
        (robot.limits[5].low, robot.limits[5].high),
        reach.below_mm,
        reach.above_mm,
    )
    reachable = np.abs(alpha[:, 0]) <= geometry.alpha_max_rad
    _check_interval(job, robot, offs, reach, low, high, reachable, report)
    if len(report.diagnostics) > before:
        return None
    height_mm = _heights(job, robot, geometry, offs, reach, low, high, report)
    if len(report.diagnostics) > before:
        return None
    q = joints(offs, q3, height_mm)
    base_from_part = _confirm(job, geometry, q)
    part_from_tool = np.swapaxes(base_from_part, 1, 2) @ _BASE_FROM_TOOL[robot.side]
    return Solution(
        _motion(job, robot, geometry, part_from_tool, q),
        part_from_tool,
        np.ones(len(q), dtype=np.int32),
        _margins(robot, q, reach),
    )


def travel_points(robot: Portal, solution: Solution) -> list[Floats]:
    """The points (n - 1, 3), in part coordinates, that the tool passes between neighbours."""
    motion = solution.motion
    return travel_points_mm(_geometry(robot), motion.joints, motion.withdraw_mm, motion.feed_axis)


def _geometry(robot: Portal) -> PortalGeometry:
    return PortalGeometry(robot.column_distance_mm, robot.column_height_mm, robot.hinge_inset_mm)


# ── what cannot be chosen: tilt, q3, q4, q5 ──────────────────────────────────────────────────────


def _check_tilt(
    job: Job, robot: Portal, geometry: PortalGeometry, alpha: Floats, report: Report
) -> None:
    holes, most = job.holes, geometry.alpha_max_rad
    tilt = alpha[:, 0]
    steep = ~(np.abs(tilt) <= most)

    def message(row: int) -> str:
        nx = -holes.feed[row, 0]
        other = alpha[row, 1]
        return (
            f"hole {holes.ids[row]} cannot be brought upright: its normal's x is {nx:.4f}, so the "
            f"bar would tilt by α = {_deg(math.copysign(math.asin(min(1.0, abs(nx))), -nx))}; the "
            f"columns allow ±{_deg(most)} (|nx| ≤ {math.sin(most):.4f}){turned_over(other)}"
        )

    def turned_over(other: float) -> str:
        if math.isnan(other):
            return ""
        return f"; the other solution, α = {_deg(other)}, would turn the plate over"

    report_holes(
        holes,
        steep,
        "E401",
        message,
        report,
        hint=lambda row: "mount the plate otherwise on the bar: its normals must lean less along x",
    )
    limit = robot.tilt_limit
    if limit is not None:
        outside = ~steep & ~((tilt >= limit.low) & (tilt <= limit.high))
        report_holes(
            holes,
            outside,
            "E402",
            lambda row: (
                f"hole {holes.ids[row]} needs the bar tilted by α = {_deg(tilt[row])}; the limits "
                f"are {_deg(limit.low)} .. {_deg(limit.high)}"
            ),
            report,
            hint=lambda row: _OTHERWISE,
            label=lambda row: _limit_label(limit),
        )


def _check_fixed_joints(
    job: Job, robot: Portal, beta: Floats, q3: Floats, offs: Offsets, report: Report
) -> None:
    holes = job.holes
    limit = robot.limits[2]
    report_holes(
        holes,
        np.isnan(q3) & ~np.isnan(beta),
        "E403",
        lambda row: (
            f"hole {holes.ids[row]} needs q3 = {_deg(beta[row])} (or a full turn more or less); "
            f"its limits are {_deg(limit.low)} .. {_deg(limit.high)}"
        ),
        report,
        hint=lambda row: _OTHERWISE,
        label=lambda row: _limit_label(limit),
    )
    for index, values in ((3, offs.q4_mm), (4, offs.q5_mm)):
        bounds = robot.limits[index]
        outside = np.asarray((values < bounds.low - SLACK_MM) | (values > bounds.high + SLACK_MM))
        report_holes(
            holes,
            outside,
            "E404",
            lambda row, name=PORTAL_JOINTS[index], values=values, bounds=bounds: (  # type: ignore[misc]
                f"hole {holes.ids[row]} needs {name} = {values[row]:.1f} mm; its limits are "
                f"{bounds.low:g} .. {bounds.high:g} mm"
            ),
            report,
            hint=lambda row: _OTHERWISE,
            label=lambda row, bounds=bounds: _limit_label(bounds),  # type: ignore[misc]
        )


# ── the height ───────────────────────────────────────────────────────────────────────────────────


def _reach(job: Job, robot: Portal, depth_mm: Floats) -> _Reach:
    away = np.zeros(len(job.holes))
    for region in job.regions:
        process = job.processes[region.process]
        away[region.start : region.stop] = max(process.approach_mm, process.retract_mm)
    return _Reach(away, depth_mm) if robot.side == "below" else _Reach(depth_mm, away)


def _check_interval(
    job: Job,
    robot: Portal,
    offs: Offsets,
    reach: _Reach,
    low: Floats,
    high: Floats,
    reachable: NDArray[np.bool_],
    report: Report,
) -> None:
    """Holes for which no height works, with what each joint asks of it."""
    holes, limits = job.holes, robot.limits

    def message(row: int) -> str:
        delta, lift = offs.delta_mm[row], offs.lift_mm[row]
        bar = (
            max(limits[0].low - delta, limits[1].low + delta),
            min(limits[0].high - delta, limits[1].high + delta),
        )
        tool = (
            limits[5].low + reach.below_mm[row] - lift,
            limits[5].high - reach.above_mm[row] - lift,
        )
        return (
            f"no height h serves hole {holes.ids[row]}: q1 and q2 need h in {_interval(*bar)}, "
            f"q6 (with {reach.below_mm[row]:g} mm below and {reach.above_mm[row]:g} mm above the "
            f"hole) needs h in {_interval(*tool)}"
        )

    empty = np.asarray(reachable & (low > high + SLACK_MM))
    report_holes(
        holes,
        empty,
        "E405",
        message,
        report,
        hint=lambda row: "mount the plate otherwise; or approach and retract less far",
    )


def _heights(
    job: Job,
    robot: Portal,
    geometry: PortalGeometry,
    offs: Offsets,
    reach: _Reach,
    low: Floats,
    high: Floats,
    report: Report,
) -> Floats:
    widest = widest_margin_mm(low, high)
    match robot.height:
        case "widest_margin":
            return widest
        case "least_travel":
            v1, v2, v6 = (robot.speeds[i] or 1.0 for i in (0, 1, 5))
            high = np.maximum(low, high)
            return least_travel(
                low, high, offs.delta_mm, offs.lift_mm, (1 / v1, 1 / v2, 1 / v6), widest
            )
        case "centre":
            height, said = geometry.column_height_mm / 2, "height centre"
        case "fixed":
            assert robot.height_mm is not None
            height, said = robot.height_mm, "this height"
    holes = job.holes
    hint = "height widest_margin or height least_travel choose h for each hole"
    if low.max() <= high.min():
        hint += f"; any h in {_interval(low.max(), high.min())} serves all holes"

    def message(row: int) -> str:
        q6 = height + offs.lift_mm[row]
        moves = {
            "q1": (height + offs.delta_mm[row],) * 2,
            "q2": (height - offs.delta_mm[row],) * 2,
            "q6": (q6 - reach.below_mm[row], q6 + reach.above_mm[row]),
        }
        limits = dict(zip(PORTAL_JOINTS, robot.limits, strict=True))
        outside = [
            f"{name} at {_said_move(*moves[name])}, outside {_m(limits[name].low)} .. "
            f"{_m(limits[name].high)}"
            for name in moves
            if moves[name][0] < limits[name].low - SLACK_MM
            or moves[name][1] > limits[name].high + SLACK_MM
        ]
        return (
            f"{said} (h = {_m(height)}) does not serve hole {holes.ids[row]}: it puts "
            f"{' and '.join(outside)}; any h in {_interval(low[row], high[row])} would do"
        )

    report_holes(
        holes,
        np.asarray((height < low - SLACK_MM) | (height > high + SLACK_MM)),
        "E406",
        message,
        report,
        hint=lambda row: hint,
        label=lambda row: Label(robot.height_span, "the rule"),
    )
    return np.full(len(holes), height)


# ── results ──────────────────────────────────────────────────────────────────────────────────────


def _confirm(job: Job, geometry: PortalGeometry, q: Floats) -> Floats:
    """Forward kinematics of the solution: the normal stands upright, the hole is at the tool."""
    base_from_part, origin_mm, tool_mm = forward(geometry, q)
    normal = np.einsum("nij,nj->ni", base_from_part, -job.holes.feed)
    position_mm = job.holes.position_mm
    hole_mm = np.einsum("nij,nj->ni", base_from_part, position_mm) + origin_mm
    # The tilt follows from q1 - q2 over the bar: the shorter the bar, the more of it is rounding.
    rounding_rad = 8.0 * np.finfo(np.float64).eps * geometry.column_height_mm / geometry.span_mm
    lever_mm = np.abs(position_mm).max(initial=0.0)
    if (
        np.abs(hole_mm - tool_mm).max(initial=0) > CLOSURE_MM + rounding_rad * lever_mm
        or np.abs(normal - [0.0, 0.0, 1.0]).max(initial=0) > CLOSURE_RAD + rounding_rad
    ):
        raise AssertionError("the portal's forward kinematics contradict its inverse")
    return base_from_part


def _motion(
    job: Job, robot: Portal, geometry: PortalGeometry, part_from_tool: Floats, q: Floats
) -> JointMotion:
    """The tool withdraws before the part moves: to the lower (working from above: the higher) of
    the standoff it leaves and the one it goes to, so it is clear of both while the plate turns.
    Where that may not keep it clear of the plate in between, and before the first hole of a region,
    when the way is long or nobody knows how the part stands, it withdraws as far as it can."""
    sign: int = 1 if robot.side == "below" else -1
    approach, retract = standoffs_mm(job)
    first = np.ones(len(q), dtype=np.bool_)
    first[1:] = job.holes.region[1:] != job.holes.region[:-1]
    arrive = q[:, _FEED_AXIS] - sign * approach
    leave = q[:, _FEED_AXIS] - sign * retract
    withdraw = arrive.copy()
    clear = np.minimum if sign > 0 else np.maximum
    withdraw[1:] = clear(arrive[1:], leave[:-1])
    standoff = np.minimum(retract[:-1], approach[1:])
    height = travel_height_mm(
        geometry, q, withdraw, _FEED_AXIS, job.holes.position_mm, part_from_tool[:, :, 2]
    )
    first[1:] |= ~(height >= LEAST_HEIGHT * standoff)
    limit = robot.limits[_FEED_AXIS]
    withdraw[first] = limit.low if sign > 0 else limit.high
    return JointMotion(AXES, q, _FEED_AXIS, 1 if sign > 0 else -1, withdraw, robot.speeds)


def _margins(robot: Portal, q: Floats, reach: _Reach) -> Floats:
    margin = np.full(len(q), np.inf)
    for index, limit in enumerate(robot.limits):
        below = reach.below_mm if index == _FEED_AXIS else 0.0
        above = reach.above_mm if index == _FEED_AXIS else 0.0
        room = np.minimum(q[:, index] - below - limit.low, limit.high - q[:, index] - above)
        margin = np.minimum(margin, room / (limit.high - limit.low))
    return np.asarray(np.maximum(margin, 0.0))


_OTHERWISE = "widen the limits if the machine can; else mount the part otherwise"


def _limit_label(limit: Limit) -> Label | None:
    return None if limit.span is None else Label(limit.span, "the limit")


def _deg(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.2f} deg"


def _m(length_mm: float) -> str:
    return f"{round(length_mm / 1000, 4) + 0.0:.10g} m"


def _said_move(low_mm: float, high_mm: float) -> str:
    """Where a joint stands, or between what it moves in the course of the cycle."""
    return _m(low_mm) if low_mm == high_mm else f"{_m(low_mm)} .. {_m(high_mm)}"


def _interval(low_mm: float, high_mm: float) -> str:
    """In metres to 0.01 mm, rounded inwards: whatever is read from it does serve."""
    if low_mm > high_mm + SLACK_MM:
        return "no interval"
    low, high = math.ceil((low_mm - SLACK_MM) * 100), math.floor((high_mm + SLACK_MM) * 100)
    if low > high:
        return f"[{low_mm / 1000:.9g}, {high_mm / 1000:.9g}] m"
    return f"[{low / 1e5:.10g}, {high / 1e5:.10g}] m"

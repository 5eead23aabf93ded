"""Checking what a spec expects against what came out; a miss says by how much."""

from __future__ import annotations

import math

import numpy as np

from drillc.catalogue.model import JOINT_NAMES
from drillc.kernels.rotations import angle_between, quaternion_from_matrix
from drillc.language.diagnostics import Report
from drillc.language.job import (
    PORTAL_JOINTS,
    ROTARY_JOINT,
    Arm,
    ExpectCount,
    ExpectJoints,
    ExpectPosition,
    ExpectRotation,
    Floats,
    Job,
)
from drillc.language.source import Span


def check_expectations(
    job: Job, part_from_tool: Floats, joints: Floats | None, report: Report
) -> None:
    """Report every expectation that does not hold."""
    ids = job.holes.ids
    for expect in job.expects:
        match expect:
            case ExpectRotation(row, wanted, within_rad, span):
                off = float(angle_between(wanted, part_from_tool[row]))
                if not off <= within_rad:
                    got = ", ".join(f"{v:.6f}" for v in quaternion_from_matrix(part_from_tool[row]))
                    report.error(
                        "E501",
                        f"hole {ids[row]} is turned by {math.degrees(off):.4f} deg from what is "
                        f"expected (within {math.degrees(within_rad):g} deg); it comes out as "
                        f"quaternion ({got})",
                        span,
                    )
            case ExpectPosition(row, wanted, within_mm, span):
                off = float(np.linalg.norm(job.holes.position_mm[row] - wanted))
                if not off <= within_mm:
                    report.error(
                        "E502",
                        f"hole {ids[row]} is {off:.4f} mm from where it is expected (within "
                        f"{within_mm:g} mm); it is at {_said_position(job, row)} mm",
                        span,
                    )
            case ExpectJoints(row, wanted, within_mm, within_rad, span):
                assert joints is not None
                off = joints[row] - wanted
                _check_joints(job, str(ids[row]), off, within_mm, within_rad, span, report)
            case ExpectCount(region, count, span):
                there = job.regions[region].stop - job.regions[region].start
                if there != count:
                    report.error(
                        "E504",
                        f"region {job.regions[region].name.text} has {there:,} "
                        f"hole{'s' * (there != 1)}, "
                        f"{abs(there - count):,} {'more' if there > count else 'fewer'} than the "
                        f"{count:,} that are expected",
                        span,
                    )


def _said_position(job: Job, row: int) -> str:
    return f"({', '.join(f'{v:.10g}' for v in job.holes.position_mm[row])})"


def _check_joints(
    job: Job,
    name: str,
    off: Floats,
    within_mm: float,
    within_rad: float,
    span: Span,
    report: Report,
) -> None:
    arm = isinstance(job.robot, Arm)
    names = JOINT_NAMES if arm else PORTAL_JOINTS
    misses = []
    for index, (joint, error) in enumerate(zip(names, off.tolist(), strict=True)):
        turns = arm or index == ROTARY_JOINT
        if turns and not abs(error) <= within_rad:
            misses.append(f"{joint} by {math.degrees(error):+.4f} deg")
        elif not turns and not abs(error) <= within_mm:
            misses.append(f"{joint} by {error:+.4f} mm")
    if misses:
        tolerance = f"{math.degrees(within_rad):g} deg"
        if not arm:
            tolerance = f"{within_mm:g} mm, {tolerance}"
        report.error(
            "E503",
            f"joints of hole {name} differ from what is expected: {', '.join(misses)} "
            f"(within {tolerance})",
            span,
        )

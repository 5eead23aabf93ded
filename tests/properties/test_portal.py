"""The portal end to end: joints come out that put each hole under the tool, whatever way it is
asked. The forward kinematics here follow from the mechanics, not from drillc's closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from drillc.kernels.windings import unwrap
from hypothesis import given
from hypothesis import strategies as st
from properties.specs import (
    COLUMN_HEIGHT_MM,
    PortalCase,
    Spec,
    part_from_base,
    planned,
    portal_cases,
)


@given(portal_cases())
def test_the_joints_put_each_hole_at_the_tool(case: PortalCase) -> None:
    result = planned(case.spec)
    solution = result.solution
    assert solution is not None
    holes = [hole for found in case.spec.holes.values() for hole in found]
    assert result.job.holes.ids.tolist() == [hole.id for hole in holes]
    for hole, q, turned in zip(holes, solution.motion.joints, result.part_from_tool, strict=True):
        rotation, origin = part_from_base(q)
        place = rotation @ np.array([float(v) for v in hole.position_mm]) + origin
        np.testing.assert_allclose(place, q[3:], atol=1e-6)
        np.testing.assert_allclose(rotation @ np.array(hole.normal), [0, 0, 1], atol=1e-9)
        # The tool feeds upwards from below, downwards from above: against the normal or along it.
        feed = rotation @ turned[:, 2]
        np.testing.assert_allclose(feed, [0, 0, 1 if case.side == "below" else -1], atol=1e-9)
        np.testing.assert_allclose(turned @ turned.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(turned) > 0


@given(portal_cases())
def test_the_whole_cycle_stays_inside_the_limits(case: PortalCase) -> None:
    result = planned(case.spec)
    solution = result.solution
    assert solution is not None
    program = result.programs[0]
    motion = solution.motion
    for section in program.sections:
        process = program.cycles[section.cycle].process
        rows = slice(section.start, section.stop)
        away = -motion.feed_sign * max(process.approach_mm, process.retract_mm)
        deep = motion.feed_sign * program.depth_mm[rows]
        for q6 in (motion.joints[rows, 5] + away, motion.joints[rows, 5] + deep):
            assert (q6 >= -1e-6).all()
            assert (q6 <= COLUMN_HEIGHT_MM + 1e-6).all()
    assert (motion.joints[:, :2] >= -1e-6).all()
    assert (motion.joints[:, :2] <= COLUMN_HEIGHT_MM + 1e-6).all()
    assert (np.abs(motion.joints[:, 2]) <= np.pi + 1e-12).all()
    assert (solution.margin >= 0).all()


@given(portal_cases(heights=("least_travel",)))
def test_least_travel_never_travels_farther_than_the_widest_margin(case: PortalCase) -> None:
    def travel(spec) -> float:
        solution = planned(spec).solution
        assert solution is not None
        return float(np.abs(np.diff(solution.motion.joints[:, [0, 1, 5]], axis=0)).sum())

    wide = replace(
        case.spec, texts=tuple(t.replace("least_travel", "widest_margin") for t in case.spec.texts)
    )
    assert travel(case.spec) <= travel(wide) + 1e-6


@given(st.lists(st.floats(-np.pi, np.pi), min_size=1, max_size=60), st.floats(0, 5e3))
def test_an_endless_axis_never_turns_farther_than_it_must(
    angles: list[float], limit_turns: float
) -> None:
    """Where the limits leave room, each step is at most half a turn, and the whole stays near the
    middle of the limits; where they do not, the result is inside them all the same."""
    half_rad = np.pi + limit_turns * 2 * np.pi
    free = np.unwrap(angles)
    result = unwrap(np.array(angles), -half_rad, half_rad)
    assert np.abs(result).max() <= half_rad + 1e-9
    turns = (result - angles) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)
    if np.ptp(free) < 2 * half_rad - 2 * np.pi:
        travel = np.abs(np.diff(result)).sum()
        assert travel == pytest.approx(np.abs(np.diff(free)).sum(), abs=1e-9)
        assert result.min() <= 2 * np.pi + 1e-9
        assert result.max() >= -2 * np.pi - 1e-9


@given(portal_cases(), st.sampled_from(("180 deg", "181 deg", "36000 deg", "1e7 deg", "9e8 rad")))
def test_wide_limits_of_q3_change_nothing_but_the_turns(case: PortalCase, limit: str) -> None:
    def joints(spec: Spec) -> np.ndarray:
        solution = planned(spec).solution
        assert solution is not None
        return solution.motion.joints

    old = "q3 -180 deg .. 180 deg"
    assert any(old in text for text in case.spec.texts)
    texts = tuple(text.replace(old, f"q3 -{limit} .. {limit}") for text in case.spec.texts)
    before, after = joints(case.spec), joints(replace(case.spec, texts=texts))
    np.testing.assert_array_equal(np.delete(after, 2, axis=1), np.delete(before, 2, axis=1))
    turns = (after[:, 2] - before[:, 2]) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-6)
    assert np.abs(np.diff(after[:, 2])).sum() <= np.abs(np.diff(before[:, 2])).sum() + 1e-6

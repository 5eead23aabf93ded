"""The chosen sequence against all there are, with the costs added up anew here."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from drillc.language.job import Weights
from drillc.planning.cycle_check import Candidates, assess
from drillc.planning.sequence import BRANCH_CHANGE_S, choose
from drillc.planning.tool_sweeps import make_tool_sweeps
from planning.arm_scenes import HIGH, HOME, LOW, Capsule, Scene, cycles_of, turn
from planning.test_headings import AHEAD, FREE, HOLE, post
from scipy.spatial.transform import Rotation

SPEEDS = np.radians([105, 94, 100, 136, 129, 206])


def random_candidates(rng, widths):
    row = np.repeat(np.arange(len(widths)), widths)
    m = len(row)
    joints = rng.uniform(-1.5, 1.5, (m, 6))
    return Candidates(
        row=row,
        heading_rad=np.radians(rng.integers(-9, 10, m) * 10.0),
        branch=rng.integers(0, 3, m).astype(np.int32),
        joints=joints,
        standoff=joints + rng.uniform(-0.2, 0.2, (m, 6)),
        leave=joints + rng.uniform(-0.2, 0.2, (m, 6)),
        margin=rng.uniform(0, 0.2, m),
        bend_rad=np.radians(rng.uniform(2, 40, m)),
    )


def heading_after(one, other):
    """The tool's turn about its axis from one pose to another, carried along the shortest way."""
    axis = np.cross(one[:, 2], other[:, 2])
    sine = np.linalg.norm(axis)
    angle = np.arctan2(sine, one[:, 2] @ other[:, 2])
    carried = Rotation.from_rotvec(axis * (angle / sine if sine > 0 else 0)).apply(one[:, 0])
    return np.arctan2(np.cross(carried, other[:, 0]) @ other[:, 2], carried @ other[:, 0])


def cost_of(choice, candidates, cycles, limit_rad, weights, home):
    """Seconds of a choice; infinite where a heading jumps too far."""
    c = candidates.take(np.asarray(choice))
    total = weights.deviation * np.abs(c.heading_rad).sum()
    for margin, bend in zip(c.margin, np.degrees(c.bend_rad), strict=True):
        total += weights.margin * max(0.0, 1 - margin / 0.1) ** 2
        total += weights.margin * max(0.0, 1 - bend / 20.0) ** 2
    for i in range(len(choice) - 1):
        total += weights.travel * (np.abs(c.standoff[i + 1] - c.standoff[i]) / SPEEDS).sum()
        total += BRANCH_CHANGE_S * (c.branch[i] != c.branch[i + 1])
        one, other = (
            cycles.rotation[k] @ turn("z", np.degrees(c.heading_rad[k])) for k in (i, i + 1)
        )
        if abs(heading_after(one, other)) > limit_rad[i] + 1e-9:
            return np.inf
    if home is not None:
        total += weights.travel * (np.abs(c.standoff[0] - home) / SPEEDS).sum()
        total += weights.travel * (np.abs(c.leave[-1] - home) / SPEEDS).sum()
    return total


def best_of_all(candidates, cycles, limit_rad, weights, home):
    rungs = [np.flatnonzero(candidates.row == i) for i in range(len(cycles))]
    choices = list(product(*rungs))
    costs = [cost_of(c, candidates, cycles, limit_rad, weights, home) for c in choices]
    at = int(np.argmin(costs))
    return costs[at], list(choices[at])


def picked(sequence, candidates):
    """Which candidates were chosen, by their joints."""
    return [
        int(np.flatnonzero((candidates.joints == j).all(axis=1))[0]) for j in sequence.chosen.joints
    ]


@pytest.mark.parametrize("seed", range(12))
def test_the_best_of_all_choices(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 6))
    candidates = random_candidates(rng, rng.integers(1, 6, n))
    rotation = np.array([turn("xyz", *rng.uniform(-60, 60, 3)) for _ in range(n)])
    cycles = cycles_of(rng.uniform(-100, 100, (n, 3)), rotation)
    weights = Weights(*[(10.0, 1.0, 1.0), (0.3, 2.0, 8.0), (0.0, 1.0, 0.0)][seed % 3])
    limit = np.radians(rng.choice([60.0, 100.0, np.inf], n - 1))
    home = HOME if seed % 2 else None
    cell = Scene(home=home).cell()
    sequence = choose(
        cell, cycles, make_tool_sweeps(cell, cycles), candidates, np.zeros(n), limit, weights
    )
    total, choice = best_of_all(candidates, cycles, limit, weights, home)
    if np.isinf(total):
        assert sequence.blocked is not None
        return
    assert sequence.blocked is None
    assert sequence.total_s == pytest.approx(total, abs=1e-6)
    assert picked(sequence, candidates) == choice


def in_windings(rng, candidates):
    """Each candidate, and about every other one once more with its last joint a turn back, at a
    margin of its own."""
    of = np.repeat(np.arange(len(candidates)), rng.integers(1, 3, len(candidates)))
    again = np.append(False, of[1:] == of[:-1])
    wound = candidates.take(of)
    turn_rad = np.where(again, 2 * np.pi, 0.0)[:, None] * np.array([0, 0, 0, 0, 0, -1])
    return replace(
        wound,
        joints=wound.joints + turn_rad,
        standoff=wound.standoff + turn_rad,
        leave=wound.leave + turn_rad,
        margin=rng.uniform(0, 0.2, len(wound)),
    )


@pytest.mark.parametrize("seed", range(20))
def test_the_best_of_all_windings(seed):
    rng = np.random.default_rng(100 + seed)
    n = int(rng.integers(2, 5))
    candidates = in_windings(rng, random_candidates(rng, rng.integers(1, 5, n)))
    rotation = np.array([turn("xyz", *rng.uniform(-60, 60, 3)) for _ in range(n)])
    cycles = cycles_of(rng.uniform(-100, 100, (n, 3)), rotation)
    weights = Weights(*[(1.0, 1.0, 8.0), (0.3, 2.0, 8.0), (0.0, 1.0, 0.0)][seed % 3])
    limit = np.radians(rng.choice([100.0, np.inf], n - 1))
    cell = Scene(home=HOME).cell()
    sequence = choose(
        cell, cycles, make_tool_sweeps(cell, cycles), candidates, np.zeros(n), limit, weights
    )
    total, _ = best_of_all(candidates, cycles, limit, weights, HOME)
    assert (sequence.blocked is None) == (total < np.inf)
    if total < np.inf:
        assert sequence.total_s == pytest.approx(total, abs=1e-6)
        taken = picked(sequence, candidates)
        assert cost_of(taken, candidates, cycles, limit, weights, HOME) == pytest.approx(total)


def test_each_part_of_the_cost_decides_somewhere():
    """The random problems above would not notice a part that is left out; here each one matters."""
    n = 3
    cycles = cycles_of(np.zeros((n, 3)), np.eye(3))
    rng = np.random.default_rng(0)
    changed = set()
    for _ in range(12):
        candidates = random_candidates(rng, [4] * n)
        whole = best_of_all(candidates, cycles, np.full(2, np.inf), Weights(2, 1, 5), HOME)[1]
        for part, weights, home in (
            ("deviation", Weights(0, 1, 5), HOME),
            ("travel", Weights(2, 0, 5), HOME),
            ("margin", Weights(2, 1, 0), HOME),
            ("home", Weights(2, 1, 5), None),
        ):
            if best_of_all(candidates, cycles, np.full(2, np.inf), weights, home)[1] != whole:
                changed.add(part)
    assert changed == {"deviation", "travel", "margin", "home"}


def blocked_problem(limits_deg, headings_deg):
    n = len(headings_deg)
    row = np.repeat(np.arange(n), [len(h) for h in headings_deg])
    rng = np.random.default_rng(1)
    candidates = replace(
        random_candidates(rng, [len(h) for h in headings_deg]),
        row=row,
        heading_rad=np.radians(np.concatenate(headings_deg)),
    )
    cycles = cycles_of(np.zeros((n, 3)), np.eye(3))
    cell = Scene().cell()
    return choose(
        cell,
        cycles,
        make_tool_sweeps(cell, cycles),
        candidates,
        np.zeros(n),
        np.radians(np.array(limits_deg, float)),
        Weights(),
    )


def test_the_first_hole_that_cannot_be_reached_is_named():
    assert blocked_problem([10, 10, 10], [[0], [5, 50], [20], [25]]).blocked == 2
    # From 50 it could be, but 50 cannot be reached itself.
    assert blocked_problem([10, 10, 10], [[0], [5, 50], [45], [25]]).blocked == 2
    assert blocked_problem([10, 10, 10], [[0, 45], [5, 50], [45], [40]]).blocked is None
    assert blocked_problem([10, np.inf, 10], [[0], [5], [45], [25]]).blocked == 3
    # Across half a turn it is not far.
    assert blocked_problem([10, 10, 10], [[178], [-178], [-170], [175]]).blocked == 3
    assert blocked_problem([15, 15, 15], [[178], [-178], [-170], [175]]).blocked is None


# ── headings that are sought when they are needed ────────────────────────────────────────────────


def row_of_holes(n, guards, clearance, pitch_mm=6.0):
    """Holes along y before the free arm; each starts with the rule's heading where that works."""
    position = HOLE + np.arange(n)[:, None] * [0, pitch_mm, 0] - [0, pitch_mm * n / 2, 0]
    cycles = cycles_of(position, AHEAD, approach=30.0, retract=20.0)
    scene = FREE.with_(low=LOW, high=HIGH, guards=guards, clearance=clearance)
    return scene, cycles


def solved(scene, cycles, candidates, turning_deg, jump_deg, weights=None):
    cell = scene.cell()
    n = len(cycles)
    limit = np.radians(np.broadcast_to(np.asarray(jump_deg, float), n - 1))
    return choose(
        cell,
        cycles,
        make_tool_sweeps(cell, cycles),
        candidates,
        np.radians(np.broadcast_to(np.asarray(turning_deg, float), n)),
        limit,
        weights or Weights(),
    )


def at_headings(scene, cycles, heading_deg):
    """One candidate set for each hole, at the given headings."""
    n = len(cycles)
    heading = np.radians(np.broadcast_to(np.asarray(heading_deg, float), n))
    return assess(scene.cell(), cycles, np.arange(n), heading).candidates


@pytest.mark.parametrize("n", [6, 30, 50])
def test_holes_around_and_far_before_are_turned_too_where_the_jump_asks_for_it(n):
    """The last hole is only possible at 90 degrees, all others at any; with at most 10 degrees from
    hole to hole, the nine before it have to begin turning."""
    scene, cycles = row_of_holes(n, (), ())
    heading = np.zeros(n)
    heading[-1] = 90.0
    candidates = at_headings(scene, cycles, heading)
    turning = np.full(n, 120.0)
    turning[-1] = 0.0
    result = solved(scene, cycles, candidates, turning, 10.0)
    if n == 6:
        # Five steps of 10 degrees do not lead from 0 to 90; but all may turn from the first on.
        assert result.blocked is None
        assert np.degrees(result.chosen.heading_rad[0]) >= 40 - 1e-6
        return
    assert result.blocked is None
    steps = np.degrees(np.diff(result.chosen.heading_rad))
    assert np.abs(steps).max() <= 10 + 1e-6
    assert np.degrees(result.chosen.heading_rad[-1]) == pytest.approx(90)
    assert np.abs(np.degrees(result.chosen.heading_rad[: n - 20])).max(initial=0) < 1e-6


def test_slow_turning_takes_more_holes_than_those_nearby():
    """Five degrees from hole to hole: the search has to go far back for 90 degrees."""
    n = 40
    scene, cycles = row_of_holes(n, (), ())
    heading = np.zeros(n)
    heading[-1] = 90.0
    turning = np.full(n, 120.0)
    turning[-1] = 0.0
    result = solved(scene, cycles, at_headings(scene, cycles, heading), turning, 5.0)
    assert result.blocked is None
    assert np.abs(np.degrees(np.diff(result.chosen.heading_rad))).max() <= 5 + 1e-6


def test_what_no_turning_can_mend_is_blocked():
    """Ten holes of five degrees do not make 90; and a region before it gives nothing."""
    n = 30
    scene, cycles = row_of_holes(n, (), ())
    heading = np.zeros(n)
    heading[-1] = 90.0
    turning = np.full(n, 120.0)
    turning[: n - 11] = 0.0
    turning[-1] = 0.0
    candidates = at_headings(scene, cycles, heading)
    assert solved(scene, cycles, candidates, turning, 5.0).blocked == n - 1
    jump = np.full(n - 1, 5.0)
    jump[n - 12] = np.inf  # from one region to the next
    assert solved(scene, cycles, candidates, turning, jump).blocked is None


def test_cheap_deviation_has_every_hole_searched():
    """With deviation at no cost, the arm takes the heading that spares it travel."""
    scene, cycles = row_of_holes(5, (), (), pitch_mm=40.0)
    candidates = at_headings(scene, cycles, 0.0)
    kept = solved(scene, cycles, candidates, 90.0, 180.0)
    assert not kept.chosen.heading_rad.any()
    loose = solved(scene, cycles, candidates, 90.0, 180.0, Weights(0.0, 1.0, 0.0))
    cost = cost_of(range(5), kept.chosen, cycles, np.full(4, np.pi), Weights(0.0, 1.0, 0.0), HOME)
    assert loose.total_s < cost - 0.03
    assert loose.chosen.heading_rad.any()
    assert np.abs(loose.chosen.heading_rad).max() <= np.pi / 2 + 1e-9


def test_the_tool_keeps_clear_at_headings_that_were_sought_later():
    """Each heading that the widening adds is one at which the tool is free."""
    guards = ((post(45.0),),)
    n = 12
    scene, cycles = row_of_holes(n, guards, ((2.0, 2.0),), pitch_mm=1.0)
    scene = scene.with_(
        body=(Capsule((0, 0, 40), (0, 0, 210), 30.0), Capsule((0, 0, 130), (200, 0, 130), 20.0))
    )
    heading = np.zeros(n)
    heading[-1] = 90.0
    turning = np.full(n, 180.0)
    turning[-1] = 0.0
    candidates = at_headings(scene, cycles, heading)
    result = solved(scene, cycles, candidates, turning, 20.0)
    sweeps = make_tool_sweeps(scene.cell(), cycles)
    chosen = result.chosen
    turned_ = np.flatnonzero(chosen.heading_rad != 0)
    assert len(turned_) > 1
    assert sweeps.clear(chosen.row[turned_], chosen.heading_rad[turned_]).all()

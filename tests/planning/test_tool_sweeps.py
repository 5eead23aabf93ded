"""Sweeps of the tool over a cycle and over headings, against python-fcl at every place of both."""

from __future__ import annotations

import numpy as np
import pytest
from drillc.planning.tool_sweeps import DEPTH_STEP_MM, MANY_DEPTHS, make_tool_sweeps
from planning.arm_scenes import (
    Box,
    Capsule,
    Scene,
    Sphere,
    cycles_of,
    tool_gap_mm,
    turn,
)

#: A spindle with an outrigger, and a box that is no rounded shape, in flange coordinates.
BODY = (
    Capsule((0, 0, 40), (0, 0, 210), 40.0),
    Capsule((0, 0, 150), (180, 40, 150), 25.0),
    Box((-90, -30, 20), (-50, 60, 120)),
)
EXACT_MM = 0.02


def scene_and_cycles(rng, bodies=3, holes=3):
    position = rng.uniform(-30, 30, (holes, 3))
    rotation = np.array([turn("xyz", *rng.uniform(-180, 180, 3)) for _ in range(holes)])
    guard = []
    for _ in range(bodies):
        centre = rng.normal(size=3)
        centre *= rng.uniform(150, 330) / np.linalg.norm(centre)
        size = rng.uniform(15, 60, 3)
        guard.append(
            Box(tuple(centre - size), tuple(centre + size))
            if rng.random() < 0.6
            else Sphere(tuple(centre), float(size[0]))
        )
    scene = Scene(
        body=BODY,
        guards=(tuple(guard[:-1]), tuple(guard[-1:])),
        clearance=((float(rng.choice([2, 10, 30])),) * 2, (float(rng.choice([2, 5])),) * 2),
    )
    cycles = cycles_of(
        position,
        rotation,
        approach=rng.uniform(20, 100, holes),
        retract=rng.uniform(20, 100, holes),
        depth=float(rng.uniform(2, 20)),
    )
    return scene, cycles


def test_what_is_said_of_an_interval_holds_for_every_heading_in_it():
    """Clear: every heading has its clearance over the whole cycle. Blocked: none has."""
    rng = np.random.default_rng(2)
    clear = blocked = 0
    for _ in range(25):
        scene, cycles = scene_and_cycles(rng)
        sweeps = make_tool_sweeps(scene.cell(), cycles)
        row = int(rng.integers(3))
        middle = float(rng.uniform(-np.pi, np.pi))
        half = np.radians(float(rng.choice([0.05, 1, 4, 15])))
        rows = np.array([row])
        is_clear = bool(sweeps.clear(rows, np.array([middle]), half)[0])
        is_blocked = bool(sweeps.blocked(rows, np.array([middle]), half)[0])
        assert not (is_clear and is_blocked)
        gaps = [
            tool_gap_mm(scene, cycles, row, middle + share * half, 1.0)
            for share in np.linspace(-1, 1, 7 if half > 0.01 else 3)
        ]
        if is_clear:
            clear += 1
            assert min(gaps) > -EXACT_MM
        if is_blocked:
            blocked += 1
            assert max(gaps) < EXACT_MM
    assert clear >= 5
    assert blocked >= 3


def test_at_a_single_heading_the_answer_is_exact():
    """Whether clear, and by how much: fcl's, to the step of its walk."""
    rng = np.random.default_rng(4)
    both = set()
    for _ in range(12):
        scene, cycles = scene_and_cycles(rng)
        sweeps = make_tool_sweeps(scene.cell(), cycles)
        heading = float(rng.uniform(-np.pi, np.pi))
        gap = tool_gap_mm(scene, cycles, 1, heading)
        mine, guard = sweeps.gap_mm(1, heading)
        rows, headings = np.array([1]), np.array([heading])
        hit = int(sweeps.hit(rows, headings)[0])
        if gap > -min(c[0] for c in scene.clearance):
            assert mine == pytest.approx(gap, abs=0.1)
        else:
            assert mine < 0
        assert 0 <= guard < 2
        if abs(gap) > 0.1:
            assert bool(sweeps.clear(rows, headings)[0]) == (gap > 0)
            assert (hit < 0) == (gap > 0)
            both.add(gap > 0)
    assert both == {True, False}


def test_a_gap_told_from_the_wrong_side_of_either_bound():
    """A ball before an outrigger: half a millimetre decides, at both ends of the cycle."""
    scene = Scene(body=(Capsule((100, 0, 100), (180, 0, 100), 25.0),))
    cycles = cycles_of([[0, 0, 0]], np.eye(3), approach=[60.0], retract=[80.0], depth=12.0)
    # In part coordinates, the outrigger is at z = -150; the cycle takes it from -230 to -138.
    for z, away in ((-230.0, -1), (-138.0, 1)):
        for gap, free in ((-0.5, False), (0.5, True)):
            ball = Sphere((140.0, 0.0, z + away * (25 + 10 + 8 + gap)), 8.0)
            guarded = scene.with_(guards=((ball,),), clearance=((10.0, 2.0),))
            sweeps = make_tool_sweeps(guarded.cell(), cycles)
            assert sweeps.clear(np.array([0]), np.zeros(1)).tolist() == [free]
            assert sweeps.gap_mm(0, 0.0)[0] == pytest.approx(gap, abs=0.01)


def test_many_depths_are_rounded_up_and_few_are_not():
    for count, step in ((MANY_DEPTHS, 0.0), (MANY_DEPTHS + 1, DEPTH_STEP_MM)):
        depth = 10.3 + np.arange(count)
        cycles = cycles_of(np.zeros((count, 3)), np.eye(3), depth=depth)
        swept = make_tool_sweeps(Scene(body=BODY).cell(), cycles).depth_mm
        assert (swept >= depth).all()
        assert (swept < depth + max(step, 1e-9)).all()
        assert (len(np.unique(swept)) < count) == (step > 0)


def test_regions_without_a_clearance_and_cells_without_guards():
    ball = Sphere((0.0, 0.0, -100.0), 30.0)
    scene = Scene(body=BODY, guards=((ball,),), clearance=((2.0, -np.inf, 2.0),))
    cycles = cycles_of(np.zeros((2, 3)), np.eye(3), region=[0, 1])
    rows = np.array([0, 1])
    sweeps = make_tool_sweeps(scene.cell(), cycles)
    assert sweeps.clear(rows, np.zeros(2)).tolist() == [False, True]
    assert sweeps.hit(rows, np.zeros(2)).tolist() == [0, -1]
    assert sweeps.gap_mm(1, 0.0) == (np.inf, -1)
    free = make_tool_sweeps(Scene(body=BODY).cell(), cycles)
    assert free.clear(rows, np.zeros(2), 3.2).all()
    assert not free.blocked(rows, np.zeros(2), 0.1).any()


def test_many_are_judged_as_each_alone():
    rng = np.random.default_rng(6)
    scene, cycles = scene_and_cycles(rng, 4, 6)
    cycles.region[:] = [0, 0, 0, 1, 1, 1]
    guards = [(c[0], 15.0, 2.0) for c in scene.clearance]
    sweeps = make_tool_sweeps(scene.with_(clearance=tuple(guards)).cell(), cycles)
    rows, heading = rng.integers(0, 6, 200), rng.uniform(-3, 3, 200)
    for half in (0.0, 0.1):
        together = sweeps.clear(rows, heading, half)
        alone = [sweeps.clear(rows[i : i + 1], heading[i : i + 1], half)[0] for i in range(200)]
        assert together.tolist() == alone
        assert 0 < together.sum() < 200

"""The straight ways of a program for an arm, and how densely joints are placed along them.

That the ways are those which the Program means is proven by following the G-code that is made of
them (`tests/output/test_gcode_arms.py`); here: blocks, failures, and the number of places.
"""

from __future__ import annotations

import itertools
from dataclasses import fields, replace

import numpy as np
import pytest
from drillc.planning.arm_nodes import Kept, place_nodes, steps_needed
from drillc.planning.arm_ways import ArmWays, Travels, arm_ways
from drillc.planning.moves import Moves
from drillc.planning.program import Program
from output.arm_programs import DIMENSIONS, STANDING, TOOL, Way, arm_program, shifted, some_joints
from output.programs import drill_cycle, pose_drill, rivet_cycle
from readers import arms


def a_program(ways: dict[int, list[Way]] | None = None, home: bool = True) -> Program:
    home_deg = (20.0, -80.0, 100.0, 30.0, 45.0, 20.0) if home else None
    return arm_program(
        [("a", 0, 3), ("b", 1, 2)],
        [drill_cycle(), rivet_cycle()],
        joints_deg=some_joints(5),
        home_deg=home_deg,
        home_first=False,
        ways=ways,
    )


def columns(moves: Moves) -> list[np.ndarray]:
    return [getattr(moves, f.name) for f in fields(moves)]


def out(row: int) -> Way:
    """Straight out of a hole."""
    return Way(False, tuple(shifted("kuka", some_joints(5)[row], -150.0)))


@pytest.mark.parametrize("size", [1, 2, 3])
def test_ways_do_not_depend_on_the_block_in_which_they_are_asked_for(size: int) -> None:
    ways = arm_ways(a_program({1: [out(0), out(1)], 4: [out(3)], 5: [out(4)]}))
    for ask, count, expected in ((ways.to_holes, 5, [1, 2, 4]), (ways.to_vias, 7, [1, 2, 4, 5])):
        whole = ask(0, count)
        assert whole.rows.tolist() == expected
        parts = [ask(at, min(at + size, count)) for at in range(0, count, size)]
        assert np.concatenate([part.rows for part in parts]).tolist() == expected
        assert np.concatenate([part.holes for part in parts]).tolist() == whole.holes.tolist()
        for one, many in zip(
            columns(whole.moves), zip(*(columns(p.moves) for p in parts), strict=True), strict=True
        ):
            assert np.allclose(one, np.concatenate(many), rtol=0, atol=1e-9, equal_nan=True)


def test_a_way_from_home_and_one_from_nowhere() -> None:
    ways = {0: [Way(False, (21.0, -79.0, 99.0, 31.0, 44.0, 21.0))]}
    travels = arm_ways(a_program(ways)).to_vias(0, 3)
    assert travels.rows.tolist() == [0]
    home = STANDING @ arms.root_from_flange(DIMENSIONS["kuka"], (20, -80, 100, 30, 45, 20)) @ TOOL
    assert np.allclose(travels.moves.start_mm[0], home[:3, 3], rtol=0, atol=1e-6)
    with pytest.raises(ValueError, match="nobody knows"):
        arm_ways(a_program(ways, home=False)).to_vias(0, 3)
    with pytest.raises(ValueError, match="only a program for an arm"):
        arm_ways(pose_drill(2))


def test_a_way_that_ends_elsewhere_is_a_bug_of_the_planner() -> None:
    program = a_program({1: [out(0)]})
    arm = program.arm
    assert arm is not None
    joints = arm.vias.joints.copy()
    joints[1, 5] += 2 * np.pi
    ways = arm_ways(replace(program, arm=replace(arm, vias=replace(arm.vias, joints=joints))))
    travels = ways.to_vias(0, 4)
    with pytest.raises(ValueError, match="fails: cause"):
        steps_needed(ways.cell, travels.moves, 0.1, "bodies")


def left_mm(moves: Moves, joints: np.ndarray, steps: int) -> float:
    """How far the tool's point leaves its line, between joints of one move."""
    points = []
    for one, two in itertools.pairwise(joints):
        for share in (0.25, 0.5, 0.75):
            q = np.degrees(one + share * (two - one)).tolist()
            points.append((STANDING @ arms.root_from_flange(DIMENSIONS["kuka"], q) @ TOOL)[:3, 3])
    way = moves.stop_mm[0] - moves.start_mm[0]
    away = np.array(points) - moves.start_mm[0]
    across = away - (away @ way / (way @ way))[:, None] * way
    assert len(joints) == steps + 1
    return float(np.linalg.norm(across, axis=1).max())


@pytest.mark.parametrize("within_mm", [1.0, 0.1, 0.01, 0.001])
@pytest.mark.parametrize("row", range(5))
def test_there_are_as_many_places_as_needed_and_hardly_more(row: int, within_mm: float) -> None:
    ways = arm_ways(a_program())
    moves = ways.into_holes(row, row + 1)
    steps = int(steps_needed(ways.cell, moves, within_mm, "point")[0])
    nodes = place_nodes(ways.cell, moves, np.array([steps]))
    assert nodes.first.tolist() == [0, steps + 1]
    assert left_mm(moves, nodes.joints, steps) <= within_mm
    fewer = (3 * steps) // 5
    if fewer > 3:  # at least one place in 40 mm
        nodes = place_nodes(ways.cell, moves, np.array([fewer]))
        assert left_mm(moves, nodes.joints, fewer) > 0.5 * within_mm


def test_bodies_ask_for_more_than_the_point() -> None:
    ways = arm_ways(a_program())
    moves = ways.into_holes(0, 5)
    kinds: tuple[Kept, Kept] = ("point", "bodies")
    point, bodies = (steps_needed(ways.cell, moves, 0.01, kept) for kept in kinds)
    assert (bodies >= point).all()
    assert (bodies > point).any()


def seconds(ways: ArmWays, travels: Travels) -> np.ndarray:
    steps = np.full(len(travels.rows), 3)
    return ways.seconds(travels, place_nodes(ways.cell, travels.moves, steps)).reshape(-1, 3)


def test_travels_last_as_long_as_their_speed_says_or_a_joint_needs() -> None:
    ways = arm_ways(a_program({1: [out(0)]}))
    straight = ways.to_vias(0, 3)
    drill, rivet = (cycle.process.travel_mm_s for cycle in ways.program.cycles)
    assert seconds(ways, straight)[0] == pytest.approx(90.0 / 3 / drill)  # from -60 to -150 mm
    fast = replace(ways, travel_mm_s=np.full(5, 1e6))
    nodes = place_nodes(ways.cell, straight.moves, np.array([3]))
    turned = np.abs(np.diff(nodes.joints, axis=0)).max(axis=1)  # 1 rad/s is each joint's most
    assert seconds(fast, straight)[0] == pytest.approx(turned)
    last = ways.to_holes(4, 5)
    assert (
        seconds(ways, last)[0]
        >= np.linalg.norm(last.moves.stop_mm - last.moves.start_mm) / 3 / rivet
    ).all()

"""The optimum along a sequence, as ratios to the inverse kinematics that feeds it, in one run.

python benchmarks/ladder.py [holes]

Holes on a curved panel in rows, a KR150 R3100-2 with its spindle perpendicular to the flange; 72
headings, all 8 branches. Then rungs of a few candidates, as they are where nothing is in the way.
"""

from __future__ import annotations

import sys
import time
import tracemalloc
from collections.abc import Callable

import numpy as np
from drillc.kernels.arm import ArmGeometry
from drillc.kernels.arm_inverse import inverse
from drillc.kernels.ladder import Ladder, best_ladder
from drillc.kernels.rotations import rotation_about
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

Floats = NDArray[np.float64]

KR150 = ArmGeometry(
    330.0,
    -115.0,
    0.0,
    645.0,
    1350.0,
    1420.0,
    215.0,
    offset_rad=np.radians([0.0, -90.0, 0.0, 0.0, 0.0, 0.0]),
    sign=np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0]),
)
SPEED = np.radians([105.0, 107.0, 114.0, 179.0, 172.0, 219.0])  # rad/s
HEADINGS = 72
PANEL_RADIUS_MM, PITCH_MM, HOLES_A_ROW = 2000.0, 25.0, 25
PART_FROM_ROOT_R = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
PART_FROM_ROOT_T = np.array([0.0, 2900.0, 500.0])
FLANGE_FROM_TOOL_R = rotation_about(1, -np.pi / 2)
FLANGE_FROM_TOOL_T = np.array([-350.0, 0.0, 250.0])


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    """Of the processor, so that what else runs on the machine counts less."""
    times = []
    for _ in range(repeats):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def poses(holes: int) -> tuple[Floats, Floats, Floats]:
    """root_from_flange of every heading of every hole, rotation and position, and the headings."""
    row, column = np.divmod(np.arange(holes), HOLES_A_ROW)
    column = np.where(row % 2, HOLES_A_ROW - 1 - column, column)
    around = np.radians(60.0) + row * PITCH_MM / PANEL_RADIUS_MM % np.radians(40.0)
    outward = np.stack([0.0 * around, np.cos(around), np.sin(around)], axis=-1)
    position = PANEL_RADIUS_MM * outward
    position[:, 0] = (column - HOLES_A_ROW / 2) * PITCH_MM
    x = np.cross([0.0, 0.0, 1.0], -outward)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(-outward, x)
    heading = (np.arange(HEADINGS) - HEADINGS // 2) * (2.0 * np.pi / HEADINGS)
    cos, sin = np.cos(heading)[:, None], np.sin(heading)[:, None]
    axes = (x[:, None] * cos + y[:, None] * sin, y[:, None] * cos - x[:, None] * sin)
    part_from_tool_R = np.stack([*axes, np.broadcast_to(-outward[:, None], axes[0].shape)], axis=-1)
    part_from_flange_R = part_from_tool_R @ FLANGE_FROM_TOOL_R.T
    part_from_flange_t = position[:, None] - part_from_flange_R @ FLANGE_FROM_TOOL_T
    rotation = PART_FROM_ROOT_R.T @ part_from_flange_R
    place = (part_from_flange_t - PART_FROM_ROOT_T) @ PART_FROM_ROOT_R
    return rotation.reshape(-1, 3, 3), place.reshape(-1, 3), heading


def arm_ladder(holes: int, deviation_s_rad: float, limit_rad: float) -> Ladder:
    rotation, position, heading = poses(holes)
    joints = inverse(KR150, rotation, position).reshape(-1, 6)
    every = np.tile(np.repeat(heading, 8), holes)
    cost = deviation_s_rad * np.abs(every)
    cost[np.isnan(joints).any(axis=1)] = np.inf
    # A quarter of the panel has a fixture over it, which leaves other headings only.
    hole = np.repeat(np.arange(holes), HEADINGS * 8)
    cost[(hole // 40 % 4 == 1) & (np.abs(every - 0.2) < np.radians(50.0))] = np.inf
    return Ladder(
        joints=joints,
        start=np.arange(holes + 1) * HEADINGS * 8,
        cost=cost,
        heading_rad=every,
        jump_rad=np.zeros(holes - 1),
        jump_limit_rad=np.full(holes - 1, limit_rad),
        weight=1.0 / SPEED,
        group=np.tile(np.arange(8), holes * HEADINGS),
        group_cost=0.0,
    )


def plain(ladder: Ladder) -> None:
    """The recurrence as anybody would write it with scipy's distances, without jump limits."""
    travel = np.nan_to_num(ladder.joints * ladder.weight)
    reach = ladder.cost[: ladder.start[1]]
    for k in range(len(ladder.start) - 2):
        before = travel[ladder.start[k] : ladder.start[k + 1]]
        after = travel[ladder.start[k + 1] : ladder.start[k + 2]]
        total = reach[:, None] + cdist(before, after, "cityblock")
        total.argmin(axis=0)
        reach = total.min(axis=0) + ladder.cost[ladder.start[k + 1] : ladder.start[k + 2]]


def arm_table(holes: int) -> None:
    rotation, position, _ = poses(holes)
    feeding = seconds(lambda: inverse(KR150, rotation, position))
    print(f"{holes} holes x {HEADINGS} headings x 8 branches      seconds   of the IK   blocked")
    print(f"  {'inverse kinematics':44}{feeding:8.3f} {1.0:10.2f}")
    free = arm_ladder(holes, 10.0, np.inf)
    took = seconds(lambda: plain(free), 1)
    print(f"  {'plain recurrence over all, no jump limit':44}{took:8.3f} {took / feeding:10.2f}")
    for deviation_s_rad in (10.0, 1.0, 0.1, 0.0):
        for limit_rad in (np.inf, np.radians(45.0)):
            ladder = arm_ladder(holes, deviation_s_rad, limit_rad)
            took = seconds(lambda ladder=ladder: best_ladder(ladder), 2)
            name = f"deviation {deviation_s_rad:4.1f} s/rad, limit {np.degrees(limit_rad):3.0f} deg"
            blocked = best_ladder(ladder).blocked
            print(f"  {name:44}{took:8.3f} {took / feeding:10.2f}   {blocked}")


def memory_table(holes: int) -> None:
    print("peak memory beside the ladder itself        MB   bytes a candidate")
    for n in (holes // 4, holes // 2, holes):
        ladder = arm_ladder(n, 10.0, np.radians(45.0))
        tracemalloc.start()
        best_ladder(ladder)
        peak = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        print(f"  {n:8} holes {peak / 1e6:29.1f} {peak / len(ladder.cost):10.0f}")


def narrow_table() -> None:
    print("rungs of a few candidates, jump limit      seconds   µs a rung")
    for n, low, high in ((100_000, 8, 8), (3_000_000, 1, 4), (20_000, 16, 16), (5_000, 64, 64)):
        rng = np.random.default_rng(n)
        start = np.concatenate([[0], np.cumsum(rng.integers(low, high + 1, n))])
        m = int(start[-1])
        ladder = Ladder(
            joints=rng.normal(size=(m, 6)),
            start=start,
            cost=rng.random(m),
            heading_rad=rng.uniform(-0.5, 0.5, m),
            jump_rad=np.zeros(n - 1),
            jump_limit_rad=np.full(n - 1, 1.0),
            weight=1.0 / SPEED,
            group=rng.integers(0, 8, m),
            group_cost=0.1,
        )
        took = seconds(lambda ladder=ladder: best_ladder(ladder), 1)
        print(f"  {n:8} rungs of {low} to {high:3} {took:24.2f} {took / n * 1e6:10.2f}")


if __name__ == "__main__":
    holes = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    arm_table(holes)
    memory_table(holes)
    narrow_table()

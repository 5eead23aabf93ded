"""Inverse kinematics of an arm, all eight branches, beside two compiled libraries.

    pip install EAIK==1.2.2 py-opw-kinematics==1.3.0
    python benchmarks/arm.py [POSES]

EAIK (C++, its `IK_batched`) serves only here, py-opw-kinematics (Rust, its `reach`) also the tests.
All three work on one thread: EAIK has a pool of its own, which is given one worker (its default is
4); `reach` runs in the calling thread by default; numpy's arithmetic has no threads, and neither
library uses OpenMP or a BLAS. The processor time of the whole process is what counts, so that other
work on the machine matters less.

The poses are reachable ones of a KUKA KR 150 R3100-2 from random joints, seeded. Every slice of
them goes through all three in turn, so that the machine's drift meets all alike; the solutions of
the first slice are compared. EAIK is given its list of matrices ready-made, which is its best case.
Prints figures of one run on one machine; only their ratio means something elsewhere. Measured on
2 cores with Python 3.11, numpy 2.4 (AVX-512), beside other work:

    drillc                     2,400,000 poses/s
    py-opw-kinematics reach       95,000           25 times slower
    EAIK IK_batched              255,000            9 times slower
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from drillc.kernels.arm import ArmGeometry, forward
from drillc.kernels.arm_inverse import inverse
from numpy.typing import NDArray
from scipy.spatial.transform import RigidTransform

Floats = NDArray[np.float64]

ARM = ArmGeometry(
    a1_mm=330.0,
    a2_mm=-115.0,
    b_mm=0.0,
    c1_mm=645.0,
    c2_mm=1350.0,
    c3_mm=1420.0,
    c4_mm=215.0,
    offset_rad=np.radians([0.0, -90.0, 0.0, 0.0, 0.0, 0.0]),
    sign=np.array([-1.0, 1.0, 1.0, -1.0, 1.0, -1.0]),
)
SLICE = 50_000


class Solver(NamedTuple):
    """`solve` is timed, on what `prepare` makes of root_from_flange (n, 4, 4)."""

    name: str
    prepare: Callable[[Floats], Any]
    solve: Callable[[Any], Any]


def drillc() -> Solver:
    return Solver(
        "drillc",
        lambda poses: (poses[:, :3, :3], poses[:, :3, 3]),
        lambda pose: inverse(ARM, *pose),
    )


def opw() -> Solver:
    from py_opw_kinematics import KinematicModel, Robot

    model = KinematicModel(
        ARM.a1_mm, ARM.a2_mm, ARM.b_mm, ARM.c1_mm, ARM.c2_mm, ARM.c3_mm, ARM.c4_mm,
        tuple(ARM.offset_rad), tuple(bool(sign < 0) for sign in ARM.sign),
    )  # fmt: skip
    robot = Robot(model, degrees=False)
    return Solver(
        "py-opw-kinematics reach",
        RigidTransform.from_matrix,
        lambda poses: robot.reach(poses, threads=1).joints,
    )


def eaik() -> Solver:
    from eaik.IK_HP import HPRobot

    z, y = (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)
    steps = [
        (0.0, 0.0, ARM.c1_mm),
        (ARM.a1_mm, ARM.b_mm, 0.0),
        (0.0, 0.0, ARM.c2_mm),
        (ARM.a2_mm, 0.0, ARM.c3_mm),
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (0.0, 0.0, ARM.c4_mm),
    ]
    robot = HPRobot(np.array([z, y, y, z, y, z]), np.array(steps))
    return Solver(
        "EAIK IK_batched", list, lambda poses: robot.IK_batched(poses, num_worker_threads=1)
    )


def apart(first: Floats, second: Floats) -> Floats:
    """The angle between values of a joint, rad."""
    return np.abs(np.angle(np.exp(1j * (first - second))))


def compare(ours: Floats, opw_joints: Floats, eaik_answers: list[Any]) -> None:
    """Stop unless `reach` found the same branches, and ours hold all that EAIK calls exact. It
    gives paper angles, approximations among them, and counts a few exact solutions as such."""
    same = np.array_equal(np.isnan(ours), np.isnan(opw_joints))
    same = same and np.nanmax(apart(ours, opw_joints)) < 1e-7
    for solutions, answer in zip(ours[:1000], eaik_answers[:1000], strict=True):
        there = ARM.paper_angles(solutions[~np.isnan(solutions[:, 0])])
        exact = np.array(answer.Q)[~np.array(answer.is_LS)]
        off = apart(exact[:, None], there[None]).max(axis=2).min(axis=1)
        same = same and off.max(initial=0.0) < 1e-6
    if not same:
        raise SystemExit("the solutions differ")


def main(count: int) -> tuple[float, float]:
    """Print the figures; how many times as fast as `reach` and as EAIK the kernel is."""
    solvers = drillc(), opw(), eaik()
    seconds = [0.0 for _ in solvers]
    rng = np.random.default_rng(0)
    for first in range(0, count, SLICE):
        n = min(SLICE, count - first)
        poses = np.tile(np.eye(4), (n, 1, 1))
        poses[:, :3, :3], poses[:, :3, 3] = forward(ARM, rng.uniform(-np.pi, np.pi, (n, 6)))
        answers = []
        for i, solver in enumerate(solvers):
            prepared = solver.prepare(poses)
            start = time.process_time()
            answers.append(solver.solve(prepared))
            seconds[i] += time.process_time() - start
        if first == 0:
            compare(*answers)
    print(f"{count:,} poses, all branches, one thread      poses/s   drillc is faster by")
    for solver, took in zip(solvers, seconds, strict=True):
        print(f"  {solver.name:32}{count / took:20,.0f} {took / seconds[0]:12.1f}")
    return seconds[1] / seconds[0], seconds[2] / seconds[0]


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000)

"""Kernel speed as ratios measured in one run, since the machine's clock drifts.

python benchmarks/kernels.py [holes]
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable

import numpy as np
from drillc.kernels.least_travel import least_travel
from drillc.kernels.posture import heading_jump_rad, horizontal
from drillc.kernels.rotations import kuka_abc_from_matrix
from drillc.kernels.windings import unwrap
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

UP = (0.0, 0.0, 1.0)


def seconds(work: Callable[[], object], repeats: int = 3) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def naive_horizontal(feed: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same rule as anybody would write it first."""
    a = feed / np.linalg.norm(feed, axis=1, keepdims=True)
    x = np.cross(UP, a)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, np.cross(a, x), a], axis=-1)


def posture_table(n: int) -> None:
    feed = np.random.default_rng(0).normal(size=(n, 3))
    feed[np.abs(feed[:, 2]) > 20.0 * np.abs(feed[:, 0]), 2] = 0.0  # none along up
    R = horizontal(feed, UP, 0, None, 1e-3).part_from_tool
    ours = seconds(lambda: horizontal(feed, UP, 0, None, 1e-3))
    rows = [("posture, R with tilt and checks", ours)]
    rows.append(("  naive np.cross, R only", seconds(lambda: naive_horizontal(feed), 1)))
    rows.append(("Z-Y-X angles", seconds(lambda: kuka_abc_from_matrix(R))))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # gimbal lock
        scipy = seconds(lambda: Rotation.from_matrix(R).as_euler("ZYX"), 1)
        rows.append(("  scipy from_matrix, as_euler", scipy))
    rows.append(("heading jumps", seconds(lambda: heading_jump_rad(R))))
    print(f"{n} normals                        seconds   of posture")
    for name, took in rows:
        print(f"  {name:34}{took:8.3f} {took / ours:8.2f}")


def sequence_table() -> None:
    print("per hole                                 µs   of 1e4")
    for weights in ((1.0, 1.0, 1.0), (1.0, 1.3, 2.1)):
        base = 0.0
        for n in (10_000, 100_000, 1_000_000):
            rng = np.random.default_rng(n)
            walk = np.cumsum(rng.normal(0.0, 5.0, (2, n)), axis=1)
            delta, lift = 400.0 * np.sin(walk[0] / 300.0), 500.0 * np.sin(walk[1] / 400.0)
            low, high = np.maximum(np.abs(delta), -lift), 5000.0 - np.maximum(np.abs(delta), lift)
            columns = (low, high, delta, lift, weights, 0.5 * (low + high))
            took = seconds(lambda columns=columns: least_travel(*columns), 2) / n * 1e6
            base = base or took
            print(f"  least_travel {weights!s:16} {n:8} {took:7.2f} {took / base:8.2f}")
    base = 0.0
    for n in (10_000, 100_000):
        turning = np.cumsum(np.random.default_rng(n).normal(0.0, 0.3, n))
        angle = np.angle(np.exp(1j * turning))
        took = seconds(lambda angle=angle: unwrap(angle, -6.1, 6.1), 2) / n * 1e6
        base = base or took
        print(f"  unwrap in ±350 deg            {n:8} {took:7.2f} {took / base:8.2f}")


if __name__ == "__main__":
    posture_table(int(sys.argv[1]) if len(sys.argv) > 1 else 3_000_000)
    sequence_table()

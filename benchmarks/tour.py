"""A short open tour through holes in rivet rows, beside the nearest neighbour's and fast-tsp's.

    pip install fast-tsp==0.2.2
    python benchmarks/tour.py

Holes 25 mm apart in rows 30 mm apart, each off by about 3 mm (seeded), in random order.
fast-tsp (C++) stops by the clock and is given two seconds; its table of distances in whole numbers
bounds it to a few thousand holes. Lengths are shares of the nearest neighbour's.
"""

from __future__ import annotations

import time

import fast_tsp
import numpy as np
from drillc.kernels.tour import short_tour, tour_mm
from numpy.typing import NDArray
from scipy.spatial import KDTree

Floats = NDArray[np.float64]

COUNTS = (2_000, 10_000, 100_000)
MOST_FOR_FAST_TSP = 2_000
#: Its distances are whole numbers below 65,536.
UNITS_A_MM = 20


def holes(count: int) -> Floats:
    rng = np.random.default_rng(0)
    row, place = np.divmod(np.arange(count), int(np.sqrt(count)))
    points = np.stack([25.0 * place, 30.0 * row, np.zeros(count)], axis=1)
    points[:, :2] += 3.0 * rng.normal(size=(count, 2))
    return points[rng.permutation(count)]


def nearest_neighbour(points: Floats) -> NDArray[np.intp]:
    """From the point of least x."""
    tree, left = KDTree(points), np.ones(len(points), dtype=np.bool_)
    tour = [int(points[:, 0].argmin())]
    left[tour[0]] = False
    while len(tour) < len(points):
        asked, near = 8, np.empty(0, dtype=np.intp)
        while not len(near):
            _, found = tree.query(points[tour[-1]], min(asked, len(points)))
            near, asked = found[left[found]], 4 * asked
        tour.append(int(near[0]))
        left[tour[-1]] = False
    return np.array(tour)


def by_fast_tsp(points: Floats) -> NDArray[np.intp]:
    """An open tour is a round one with a place that is at no distance from all others."""
    count = len(points)
    apart = np.zeros((count + 1, count + 1), dtype=np.int64)
    apart[:count, :count] = UNITS_A_MM * np.linalg.norm(points[:, None] - points, axis=2)
    tour = fast_tsp.find_tour(apart.tolist(), duration_seconds=2.0)
    start = tour.index(count)
    return np.array(tour[start + 1 :] + tour[:start])


def main() -> None:
    print("   holes   seconds   drillc   fast-tsp")
    for count in COUNTS:
        points = holes(count)
        start = time.process_time()
        tour = short_tour(points)
        took = time.process_time() - start
        plain = tour_mm(points, nearest_neighbour(points))
        other = "-"
        if count <= MOST_FOR_FAST_TSP:
            other = f"{tour_mm(points, by_fast_tsp(points)) / plain:.3f}"
        print(f"{count:8,}{took:10.2f}{tour_mm(points, tour) / plain:9.3f}{other:>11}")


if __name__ == "__main__":
    main()

"""A tour through millions of points in linear time: along a space-filling curve, then improved."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Places = NDArray[np.intp]

_BITS = 20  # a coordinate; three fit into an int64
_LONGEST_RUN = 25
_SWEEPS = 2
_NOTHING = 1e-12  # a gain below this share is rounding


def curve_tour(points: Floats) -> Places:
    """An order (n,) of points (n, 3): Hilbert's curve, with runs of up to 25 points reversed where
    that shortens it. Typically a fifth longer than the shortest; time and memory are linear."""
    along = np.argsort(_hilbert(_lattice(points)), kind="stable")
    # Neighbours on the curve are neighbours in memory too.
    points, order = points[along], np.arange(len(points))
    for _ in range(_SWEEPS):
        for run in range(2, _LONGEST_RUN + 1):
            for phase in range(run + 1):
                _reverse_runs(points, order, phase, run)
    tour: Places = along[order]
    return tour


def _lattice(points: Floats) -> NDArray[np.int64]:
    """The points in a cube of 2**_BITS steps along its edge; (3, n)."""
    low = points.min(axis=0)
    extent = float(np.ptp(points, axis=0).max())
    scale = (2**_BITS - 1) / extent if extent > 0.0 else 0.0
    return np.ascontiguousarray(((points - low) * scale).T).astype(np.int64)


def _hilbert(axes: NDArray[np.int64]) -> NDArray[np.int64]:
    """Each point's distance along Hilbert's curve (n,); axes (3, n) are used up.

    Skilling, "Programming the Hilbert curve", AIP Conference Proceedings 707 (2004).
    """
    dimensions = len(axes)
    bit = 1 << (_BITS - 1)
    while bit > 1:
        below = bit - 1
        for i in range(dimensions):
            is_set = (axes[i] & bit) != 0
            swap = np.where(is_set, 0, (axes[0] ^ axes[i]) & below)
            axes[0] ^= np.where(is_set, below, swap)
            axes[i] ^= swap
        bit >>= 1
    for i in range(1, dimensions):
        axes[i] ^= axes[i - 1]
    turned = np.zeros_like(axes[0])
    bit = 1 << (_BITS - 1)
    while bit > 1:
        turned ^= np.where((axes[-1] & bit) != 0, bit - 1, 0)
        bit >>= 1
    axes ^= turned
    along: NDArray[np.int64] = np.zeros_like(axes[0])
    for level in reversed(range(_BITS)):
        for axis in axes:
            along = (along << 1) | ((axis >> level) & 1)
    return along


def _reverse_runs(points: Floats, order: Places, phase: int, run: int) -> None:
    """Reverse, where it shortens the tour, the runs at the places first .. first + run - 1 for
    first = phase, phase + run + 1, …: one point between two runs stays, so that none is in the
    other's way."""
    first = np.arange(phase, len(order) - run + 1, run + 1)
    last = first + run - 1
    head, tail = points[order[first]], points[order[last]]
    # Beyond an end of the tour there is no leg: the end is free.
    before = points[order[np.maximum(first - 1, 0)]]
    after = points[order[np.minimum(last + 1, len(order) - 1)]]
    has_before, has_after = first > 0, last < len(order) - 1
    now = _legs(before, head) * has_before + _legs(tail, after) * has_after
    then = _legs(before, tail) * has_before + _legs(head, after) * has_after
    shorter = first[then < now * (1.0 - _NOTHING)]
    places = shorter[:, None] + np.arange(run)
    order[places] = order[places[:, ::-1]]


def _legs(start: Floats, end: Floats) -> Floats:
    legs: Floats = np.linalg.norm(end - start, axis=1)
    return legs

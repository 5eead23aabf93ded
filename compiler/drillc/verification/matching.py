"""Which of two lists of holes are the same ones, by where they are and in what order.

It knows places only, so it serves a program against its spec, and one program against another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from .events import Floats
from .vectors import aside, dot, length

Rows = NDArray[np.intp]

#: A hole is found again where its axis is no farther away, in mm and radians, and its bottom along
#: the axis no farther: whatever is beyond rounding but within this is the same hole, made badly.
NEAR_MM, NEAR_RAD, NEAR_DEEP_MM = 0.5, 0.02, 30.0
#: So many of the holes around a place are looked at.
_NEIGHBOURS = 6


@dataclass(frozen=True, eq=False)
class Marks:
    """n holes: the bottom (n, 3) in mm, and the unit direction (n, 3) into the part."""

    bottom_mm: Floats
    axis: Floats

    def __len__(self) -> int:
        return len(self.bottom_mm)

    def take(self, rows: Rows | slice) -> Marks:
        """Some of them."""
        return Marks(self.bottom_mm[rows], self.axis[rows])


@dataclass(eq=False)
class Matcher:
    """Finds holes again among `wanted`, some of them after others."""

    wanted: Marks
    _tree: cKDTree | None = field(default=None, repr=False)

    def match(self, found: Marks, first: int) -> Rows:
        """For each of the `found` (m,) the row of `wanted`, or -1. `first` is the row that is
        expected for the first of them.

        Exact ones are matched wherever they stand in the order. Others are paired with what is left
        between their matched neighbours: all in order where there are as many, else the nearest.
        """
        rows = self._in_order(found, first)
        left = np.flatnonzero(rows < 0)
        if len(left):
            rows[left] = self._anywhere(found.take(left), rows[left - 1] + 1)
            self._pair(found, rows, first)
        return rows

    def _in_order(self, found: Marks, first: int) -> Rows:
        """Rows from `first` on, one after another, as far as they fit; resumed after a gap."""
        rows = np.full(len(found), -1, dtype=np.intp)
        start, row = 0, first
        for _ in range(64):
            count = min(len(found) - start, len(self.wanted) - row)
            if count <= 0:
                break
            fits = near(
                found.take(slice(start, start + count)), self.wanted.take(slice(row, row + count))
            )
            good = count if fits.all() else int(np.argmin(fits))
            rows[start : start + good] = np.arange(row, row + good)
            start, row = start + good, row + good
            if start >= len(found):
                break
            # One that is not where it is expected: another, moved, left out, or too many.
            odd = found.take(slice(start, start + 2))
            there = self._anywhere(odd, row + np.arange(len(odd)))
            rows[start : start + 2] = there
            known = there[there >= 0]
            row = int(known[-1]) + 1 if len(known) else row + len(there)
            start += len(there)
        return rows

    def _anywhere(self, found: Marks, likely: Rows) -> Rows:
        """The hole at each place, or -1; of several, the one that is `likely`, else the nearest."""
        if not len(self.wanted) or not len(found):
            return np.full(len(found), -1, dtype=np.intp)
        if self._tree is None:
            self._tree = cKDTree(self.wanted.bottom_mm)
        count = min(_NEIGHBOURS, len(self.wanted))
        _, around = self._tree.query(
            np.nan_to_num(found.bottom_mm), k=count, distance_upper_bound=NEAR_DEEP_MM + 1.0
        )
        around = around.reshape(len(found), count)
        rows = np.full(len(found), -1, dtype=np.intp)
        for k in reversed(range(count)):
            there = np.minimum(around[:, k], len(self.wanted) - 1)
            fits = near(found, self.wanted.take(there)) & (around[:, k] < len(self.wanted))
            rows = np.where(fits, there, rows)
        likely = np.clip(likely, 0, len(self.wanted) - 1)
        return np.where(near(found, self.wanted.take(likely)), likely, rows)

    def _pair(self, found: Marks, rows: Rows, first: int) -> None:
        """Fill in what is left of `rows`."""
        taken = set(rows[rows >= 0].tolist())
        for start, stop in _runs(rows < 0):
            before = int(rows[start - 1]) if start else first - 1
            after = int(rows[stop]) if stop < len(rows) else before + stop - start + 1
            after = min(after, len(self.wanted))
            free = [row for row in range(before + 1, after) if row not in taken]
            if len(free) == stop - start:
                rows[start:stop] = free
            elif free:
                self._nearest(found, rows, range(start, stop), free)

    def _nearest(self, found: Marks, rows: Rows, run: Sequence[int], free: Sequence[int]) -> None:
        apart = np.linalg.norm(
            found.bottom_mm[list(run), None] - self.wanted.bottom_mm[None, list(free)], axis=2
        )
        for _ in range(min(apart.shape)):
            i, k = np.unravel_index(int(np.nanargmin(apart)), apart.shape)
            rows[run[int(i)]] = free[int(k)]
            apart[i, :], apart[:, k] = np.inf, np.inf


def near(found: Marks, wanted: Marks) -> NDArray[np.bool_]:
    """Which are the same holes (n,), row by row."""
    apart = found.bottom_mm - wanted.bottom_mm
    along = dot(apart, wanted.axis)
    turned = length(found.axis - wanted.axis)
    fits = (
        (aside(apart, wanted.axis) <= NEAR_MM)
        & (turned <= NEAR_RAD)
        & (np.abs(along) <= NEAR_DEEP_MM)
    )
    return np.asarray(fits)


def _runs(mask: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Where stretches of True begin and end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]

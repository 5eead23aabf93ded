"""What is made, a row a hole: the form in which two programs, or a spec and a program, compare."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .events import Floats, Ints

#: What a step is called that is a move.
MOVE_STEP = "go"


@dataclass(frozen=True)
class Step:
    """One step at a hole. `what` is `MOVE_STEP` or names a signal; `depth_mm` of a move counts from
    the bottom, so outwards is negative. NaN where a number says nothing."""

    what: str
    depth_mm: float = np.nan
    speed_mm_s: float = np.nan
    value: float = np.nan
    timeout_s: float = np.nan


@dataclass(frozen=True, eq=False)
class Made:
    """n holes in the order in which they are made.

    `names` as the spec or the program calls them. `bottom_mm` (n, 3) is the deepest place of the
    tool, `rotation` (n, 3, 3) its orientation there (part_from_tool). `steps` (n,) indexes
    `step_lists`. `configuration` (n, 4): as the program states it, NaN where it states none.
    `place(row)` says where a hole is made, for people.
    """

    names: tuple[str, ...]
    bottom_mm: Floats
    rotation: Floats
    configuration: Floats
    steps: Ints
    step_lists: tuple[tuple[Step, ...], ...]
    place: Callable[[int], str]

    def __len__(self) -> int:
        return len(self.names)

    @property
    def axis(self) -> Floats:
        """The unit direction into the part, (n, 3)."""
        return self.rotation[:, :, 2]


def distinct(rows: NDArray[np.float64]) -> tuple[NDArray[np.float64], Ints]:
    """The distinct rows of a table (n, k), and which of them each row is; NaN equals NaN."""
    held = np.where(np.isnan(rows), np.inf, rows)
    kinds, index = np.unique(held, axis=0, return_inverse=True)
    return np.where(np.isinf(kinds), np.nan, kinds), index.reshape(len(rows)).astype(np.int32)

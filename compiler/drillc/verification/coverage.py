"""Each hole once, in the order of the spec, and nothing done anywhere else."""

from __future__ import annotations

import re
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .case import Case
from .checks import Made
from .events import Kind
from .steps import described
from .verdict import Rows
from .visits import Path, Visits


@dataclass(eq=False)
class Coverage:
    """Of `holes` holes: how often each was made (n,), and the statement of the body (n, 2: file and
    line) that made it last; the row that is due next, and the last of all that were made."""

    holes: int
    made: NDArray[np.int32] = field(init=False)
    where: NDArray[np.int32] = field(init=False)
    next_hole: int = 0
    farthest: int = -1

    def __post_init__(self) -> None:
        self.made = np.zeros(self.holes, dtype=np.int32)
        self.where = np.full((self.holes, 2), -1, dtype=np.int32)

    def count(self, case: Case, path: Path, made: Made) -> None:
        """The holes that visits make, in their order: each once, and none before its turn."""
        events = path.events
        at = made.cores.first
        case.tally.compared("order", len(made))
        before = np.maximum.accumulate(np.concatenate([[self.farthest], made.hole]))[:-1]
        late = made.hole < before
        again = (self.made[made.hole] > 0) | _seen(made.hole)
        for k in np.flatnonzero(late & ~again).tolist():
            hole = int(made.hole[k])
            case.fail(
                "order",
                f"{case.hole(hole)} is made after {case.hole(int(before[k]))}, the spec asks for"
                " it before",
                path,
                int(at[k]),
                hole,
                body=True,
            )
        for k in np.flatnonzero(again).tolist():
            hole = int(made.hole[k])
            first = self.where[hole]
            earlier = np.flatnonzero(made.hole[:k] == hole)
            if first[0] < 0 and len(earlier):
                e = int(at[earlier[0]])
                first = np.array([events.call_file[e], events.call_line[e]])
            case.fail(
                "coverage",
                f"{case.hole(hole)} is made again; it is made before in"
                f" {case.run.files[int(first[0])]}:{int(first[1])}",
                path,
                int(at[k]),
                hole,
                body=True,
            )
        np.add.at(self.made, made.hole, 1)
        self.where[made.hole, 0] = events.call_file[at]
        self.where[made.hole, 1] = events.call_line[at]
        self.farthest = max(self.farthest, int(made.hole.max()))
        self.next_hole = int(made.hole[-1]) + 1

    def finish(self, case: Case) -> None:
        """What was never made."""
        n = len(case.wanted)
        case.tally.compared("coverage", n)
        missing = np.flatnonzero(self.made == 0)
        for k, hole in enumerate(missing.tolist()):
            if k >= 100:
                case.tally.fail("coverage", "more holes are never made", alike=len(missing) - 101)
                break
            name = case.hole(hole)
            unused = _unused(case, name)
            case.tally.fail(
                "coverage",
                f"{name} is never made{unused}",
                hole=name,
                span=case.span(hole),
            )


def check_extra(case: Case, path: Path, extra: Visits, made: Made, *, known: bool) -> None:
    """What is switched anywhere but at a hole. `known`: the first event was looked at before."""
    for k in range(len(extra)):
        if extra.start[k] >= len(path):
            continue
        at = path.places.position_mm[extra.deepest[k]]
        case.fail(
            "coverage",
            f"something is done at ({at[0]:.3f}, {at[1]:.3f}, {at[2]:.3f}) mm, where the spec"
            " has no hole",
            path,
            int(extra.deepest[k]),
            body=True,
        )
    # Events outside of all visits are moves.
    loose = ~path.moves
    for visits in (made.visits, extra):
        edges = np.zeros(len(path) + 1, dtype=np.int64)
        np.add.at(edges, np.minimum(visits.start, len(path)), 1)
        np.add.at(edges, np.minimum(visits.stop, len(path)), -1)
        loose &= np.cumsum(edges[:-1]) == 0
    if known and len(loose):
        loose[0] = False
    harmless = (path.events.kind == Kind.PAUSE) & (path.events.value == 0.0)
    for event in np.flatnonzero(loose & ~harmless)[:100].tolist():
        what = described(case, path, None, event)
        case.fail("process", f"{what}, between the holes, is not in the spec", path, event)


def _unused(case: Case, name: str) -> str:
    """Where the program declares a hole that it does not make."""
    for finding in case.run.findings():
        if finding.check == "used" and re.search(
            rf"(?<!\w){re.escape(name)}(?!\w)", finding.message
        ):
            return (
                f"; {case.run.files[finding.file]}:{finding.line} declares it and nothing uses it"
            )
    return ""


def _seen(rows: Rows) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which of `rows` (m,) stand there a second time."""
    again = np.ones(len(rows), dtype=np.bool_)
    again[np.unique(rows, return_index=True)[1]] = False
    return again

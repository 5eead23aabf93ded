"""The ways between holes, from home and to it: vias where the straight way cannot be taken.

From one standoff the tool goes straight to the next. Where that is not possible or not proven
clear, it withdraws farther on both sides; where that does not help either, or where the branch or a
joint's winding changes, it goes by joints; at last by way of home. The first hole of a section is
always reached by joints, which fixes the arm's branch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats, Ints
from drillc.planning.cell import BETWEEN, Cell
from drillc.planning.cycle_check import Candidates, Cycles
from drillc.planning.moves import (
    FINE,
    Moves,
    Verdict,
    joint_moves,
    straight_moves,
)
from drillc.planning.program import Vias
from drillc.planning.proofs import check_moves

Rows = NDArray[np.int64]
Bools = NDArray[np.bool_]

#: Turned by nearly half a turn, the tool might turn the other way round: what is written is
#: rounded, and controllers take the shorter way. It does not go straight then.
MOST_TURN_RAD = np.radians(175.0)
#: How much farther than its standoff the tool withdraws, in the order in which it is tried.
LIFTS_MM = (25.0, 50.0, 100.0, 200.0, 400.0)


@dataclass(frozen=True, eq=False)
class Legs:
    """Ways of a program, l of them, in order: from where a cycle leaves the tool to where the next
    begins. `leaves` and `reaches` (l,) are holes; -1 is home. `section` (l,): begins a section."""

    leaves: Rows
    reaches: Rows
    section: Bools

    def __len__(self) -> int:
        return len(self.leaves)


@dataclass(frozen=True, eq=False)
class Blocked:
    """A leg for which no way was found, and why the plainest way failed."""

    leg: int
    verdict: Verdict  # of that one move


@dataclass(frozen=True, eq=False)
class _Routes:
    """For each leg: where the tool withdraws to (NaN: not needed), whether it then goes by joints,
    and whether by way of home."""

    lift_mm: Floats
    by_joints: Bools
    by_home: Bools
    raised_from: Floats  # (l, 6) joints after the lift
    raised_to: Floats  # (l, 6) joints before the descent


def make_legs(cell: Cell, section: Ints) -> Legs:
    """The legs of holes in sections (n,): numbers that change where a section begins. Without a
    home, the way to the first hole is nobody's and has no leg."""
    count = len(section)
    begins = np.flatnonzero(section[1:] != section[:-1]) + 1
    first = np.zeros(count, dtype=np.bool_)
    first[begins] = True
    leaves, reaches = np.arange(count - 1), np.arange(1, count)
    if cell.arm.home_rad is None:
        return Legs(leaves, reaches, first[1:])
    return Legs(
        np.concatenate([[-1], leaves, [count - 1]]),
        np.concatenate([[0], reaches, [-1]]),
        np.concatenate([[True], first[1:], [True]]),
    )


def plan_travel(
    cell: Cell, cycles: Cycles, chosen: Candidates, legs: Legs
) -> tuple[Vias, list[Blocked]]:
    """A way for every leg, as vias; and the legs for which there is none."""
    routes, blocked = _find_routes(cell, cycles, chosen, legs)
    return _vias(cell, chosen, legs, routes), blocked


# ── finding ──────────────────────────────────────────────────────────────────────────────────────


def _find_routes(
    cell: Cell, cycles: Cycles, chosen: Candidates, legs: Legs
) -> tuple[_Routes, list[Blocked]]:
    count = len(legs)
    routes = _Routes(
        np.full(count, np.nan),
        legs.section.copy(),
        np.zeros(count, dtype=np.bool_),
        np.full((count, 6), np.nan),
        np.full((count, 6), np.nan),
    )
    ends = _Ends(cell, cycles, chosen, legs)
    straight = ~legs.section & (chosen.branch[legs.leaves] == chosen.branch[legs.reaches])
    straight[straight] = ends.turn_rad(np.flatnonzero(straight)) < MOST_TURN_RAD
    open_ = np.ones(count, dtype=np.bool_)
    why: dict[int, Verdict] = {}

    def settle(rows: Rows, good: Bools) -> None:
        open_[rows[good]] = False

    rows = np.flatnonzero(straight)
    verdict = check_moves(cell, ends.across(rows, 0.0, None, None))
    settle(rows, verdict.fine)
    _remember(why, rows, verdict)

    raised: dict[float, tuple[Rows, Floats, Floats]] = {}
    for lift in LIFTS_MM:
        rows = np.flatnonzero(open_ & straight)
        if len(rows):
            raised[lift] = ends.raised(rows, lift)
            rows, start, stop = raised[lift]
            good = check_moves(cell, ends.across(rows, lift, start, stop)).fine
            _take(routes, rows[good], lift, start[good], stop[good])
            settle(rows, good)

    rows = np.flatnonzero(open_)
    verdict = check_moves(cell, ends.by_joints(rows, None, None))
    routes.by_joints[rows[verdict.fine]] = True
    settle(rows, verdict.fine)
    _remember(why, rows, verdict)
    for lift in LIFTS_MM:
        rows = np.flatnonzero(open_)
        if len(rows):
            rows, start, stop = ends.raised(rows, lift)
            good = check_moves(cell, ends.by_joints(rows, start, stop)).fine
            _take(routes, rows[good], lift, start[good], stop[good])
            routes.by_joints[rows[good]] = True
            settle(rows, good)
    if cell.arm.home_rad is not None:
        inner = (legs.leaves >= 0) & (legs.reaches >= 0)
        for lift in (0.0, *LIFTS_MM):
            rows = np.flatnonzero(open_ & inner)
            if len(rows):
                rows, start, stop = ends.raised(rows, lift)
                home = np.broadcast_to(cell.arm.home_rad, start.shape)
                there = check_moves(cell, ends.by_joints(rows, start, home))
                good = there.fine & check_moves(cell, ends.by_joints(rows, home, stop)).fine
                _take(routes, rows[good], lift, start[good], stop[good])
                routes.by_joints[rows[good]] = routes.by_home[rows[good]] = True
                settle(rows, good)
    lost = [Blocked(int(leg), why[int(leg)]) for leg in np.flatnonzero(open_)]
    return routes, lost


def _take(routes: _Routes, rows: Rows, lift_mm: float, start: Floats, stop: Floats) -> None:
    routes.lift_mm[rows] = lift_mm if lift_mm > 0 else np.nan
    routes.raised_from[rows] = start
    routes.raised_to[rows] = stop


def _remember(why: dict[int, Verdict], rows: Rows, verdict: Verdict) -> None:
    """Keep the first failure of each leg: that of its plainest way."""
    for i in np.flatnonzero(verdict.cause != FINE).tolist():
        one = slice(i, i + 1)
        why.setdefault(
            int(rows[i]),
            Verdict(
                verdict.cause[one],
                verdict.share[one],
                verdict.mover[one],
                verdict.detail[one],
                verdict.end_joints[one],
            ),
        )


@dataclass(frozen=True, eq=False)
class _Ends:
    """Both ends of every leg, and the moves between them."""

    cell: Cell
    cycles: Cycles
    chosen: Candidates
    legs: Legs

    def _region(self, rows: Rows) -> Ints:
        """Whose clearances hold on a leg: the region's, or where it leads out of one, none's."""
        leaves, reaches = self.legs.leaves[rows], self.legs.reaches[rows]
        region = self.cycles.region[reaches]
        within = (leaves >= 0) & (reaches >= 0) & (self.cycles.region[leaves] == region)
        return np.where(within, region, BETWEEN).astype(np.int32)

    def _pose(self, hole: Rows, away_mm: Floats) -> tuple[Floats, Floats]:
        rotation = self.cycles.turned(hole, self.chosen.heading_rad[hole])
        return rotation, self.cycles.at_depth(hole, -away_mm)

    def _joints(self, rows: Rows) -> tuple[Floats, Floats]:
        """Where the legs begin and end, (k, 6) each."""
        leaves, reaches = self.legs.leaves[rows], self.legs.reaches[rows]
        start, stop = self.chosen.leave[leaves].copy(), self.chosen.standoff[reaches].copy()
        if (leaves < 0).any() or (reaches < 0).any():
            assert self.cell.arm.home_rad is not None
            start[leaves < 0] = stop[reaches < 0] = self.cell.arm.home_rad
        return start, stop

    def turn_rad(self, rows: Rows) -> Floats:
        """By how much the tool turns from one end to the other (k,)."""
        away_mm = np.zeros(len(rows))
        begin, _ = self._pose(self.legs.leaves[rows], away_mm)
        end, _ = self._pose(self.legs.reaches[rows], away_mm)
        # |B - A|² = 8 sin²(turn / 2), by the Frobenius norm.
        chord = np.linalg.norm(end - begin, axis=(1, 2)) / np.sqrt(8.0)
        return np.asarray(2.0 * np.arcsin(np.minimum(1.0, chord)))

    def across(
        self, rows: Rows, lift_mm: float, start: Floats | None, stop: Floats | None
    ) -> Moves:
        """Straight from one hole's standoff, raised by `lift_mm`, to the next one's."""
        leaves, reaches = self.legs.leaves[rows], self.legs.reaches[rows]
        begin, end = self._joints(rows)
        return straight_moves(
            self._region(rows),
            self._pose(leaves, self.cycles.retract_mm[leaves] + lift_mm),
            self._pose(reaches, self.cycles.approach_mm[reaches] + lift_mm),
            self.chosen.branch[leaves],
            begin if start is None else start,
            end if stop is None else stop,
        )

    def by_joints(self, rows: Rows, start: Floats | None, stop: Floats | None) -> Moves:
        begin, end = self._joints(rows)
        return joint_moves(
            self._region(rows), begin if start is None else start, end if stop is None else stop
        )

    def raised(self, rows: Rows, lift_mm: float) -> tuple[Rows, Floats, Floats]:
        """The legs whose ends can both be raised by `lift_mm`, and the joints there. Home stays."""
        begin, end = self._joints(rows)
        good = np.ones(len(rows), dtype=np.bool_)
        if lift_mm > 0:
            for hole, joints, away in (
                (self.legs.leaves[rows], begin, self.cycles.retract_mm),
                (self.legs.reaches[rows], end, self.cycles.approach_mm),
            ):
                some = np.flatnonzero(hole >= 0)
                which = hole[some]
                moves = straight_moves(
                    self.cycles.region[which],
                    self._pose(which, away[which]),
                    self._pose(which, away[which] + lift_mm),
                    self.chosen.branch[which],
                    joints[some],
                )
                verdict = check_moves(self.cell, moves)
                good[some] &= verdict.fine
                joints[some] = verdict.end_joints
        return rows[good], begin[good], end[good]


# ── the vias ─────────────────────────────────────────────────────────────────────────────────────


def _vias(cell: Cell, chosen: Candidates, legs: Legs, routes: _Routes) -> Vias:
    """The moves that are not the cycles' own, in order."""
    count = len(chosen)
    standoff = _extended(cell, chosen.standoff, legs.reaches)
    lifted = ~np.isnan(routes.lift_mm)
    before = np.where(legs.reaches < 0, count, legs.reaches)
    home = np.broadcast_to(
        np.zeros(6) if cell.arm.home_rad is None else cell.arm.home_rad, standoff.shape
    )
    target = np.where(lifted[:, None], routes.raised_to, standoff)
    # In the order in which they are driven: out, home, across.
    parts = [
        (lifted & (legs.leaves >= 0), False, routes.raised_from),
        (routes.by_home, True, home),
        (routes.by_joints, True, target),
        (lifted & ~routes.by_joints, False, target),
    ]
    columns: list[tuple[Rows, Rows, Bools, Floats]] = []
    for step, (wanted, by_joints, joints) in enumerate(parts):
        rows = np.flatnonzero(wanted)
        columns.append(
            (
                before[rows],
                np.full(len(rows), step),
                np.full(len(rows), by_joints),
                joints[rows],
            )
        )
    if cell.arm.home_rad is None and count:
        # Nobody knows where the arm comes from: by joints, so that at least its end is known.
        columns.append(
            (
                np.zeros(1, dtype=np.int64),
                np.zeros(1, dtype=np.int64),
                np.ones(1, dtype=np.bool_),
                chosen.standoff[:1],
            )
        )
    where, step_of, by, joints = (np.concatenate([c[i] for c in columns]) for i in range(4))
    order = np.lexsort((step_of, where))
    rotation, position_mm = cell.tool_pose(joints[order])
    return Vias(where[order].astype(np.int32), by[order], joints[order], position_mm, rotation)


def _extended(cell: Cell, joints: Floats, hole: Rows) -> Floats:
    """Joints of holes (l,), home's where there is none."""
    found = joints[hole].copy()
    if (hole < 0).any():
        found[hole < 0] = cell.arm.home_rad
    return found

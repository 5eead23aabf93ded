"""Which joints make a hole's whole cycle: approach, full depth and retract, in one branch.

The tool moves along its own axis, from the farther of the two standoffs to the depth. It is
sampled for reach, limits and singularity at `moves.STEP_MM`; that the arm's links stay clear is
proven for the whole way. The tool's own body is not looked at here (`headings.py` does).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from drillc.kernels.arm import singularity
from drillc.kernels.turns import all_turns
from drillc.language.job import Floats, Ints, Job
from drillc.planning.cell import TOOL, Cell
from drillc.planning.moves import (
    BULGE,
    FINE,
    HIT,
    JUMP,
    JUMP_RAD,
    LIMIT,
    REACH,
    SINGULAR,
    SLACK_RAD,
    STEP_MM,
    Sampled,
    straight_moves,
)
from drillc.planning.proofs import find_hits

#: Headings assessed together: bounds the memory of their poses and branches.
_BLOCK = 2048
#: A margin is a share of a joint's range, and 1 where the wrist is bent this far: from `ENOUGH` of
#: either on, more is worth nothing.
ENOUGH_LIMIT, ENOUGH_BEND_RAD = 0.1, np.radians(20.0)


@dataclass(frozen=True, eq=False)
class Cycles:
    """What the cycles of n holes ask: where they are, how the rule holds the tool (`rotation`,
    part_from_tool at heading 0), and how far the tool goes along its axis, outwards and inwards."""

    region: Ints
    position_mm: Floats  # (n, 3)
    rotation: Floats  # (n, 3, 3)
    approach_mm: Floats  # (n,)
    retract_mm: Floats  # (n,)
    depth_mm: Floats  # (n,)

    def __len__(self) -> int:
        return len(self.region)

    @property
    def out_mm(self) -> Floats:
        """The farther of the two standoffs."""
        return np.maximum(self.approach_mm, self.retract_mm)

    def turned(self, row: NDArray[np.int64], heading_rad: Floats) -> Floats:
        """part_from_tool (k, 3, 3) of holes `row` (k,) at headings (k,) about the tool's axis."""
        cos, sin = np.cos(heading_rad), np.sin(heading_rad)
        turned = self.rotation[row].copy()
        x, y = self.rotation[row, :, 0], self.rotation[row, :, 1]
        turned[:, :, 0] = x * cos[:, None] + y * sin[:, None]
        turned[:, :, 1] = y * cos[:, None] - x * sin[:, None]
        return turned

    def at_depth(self, row: NDArray[np.int64], depth_mm: Floats) -> Floats:
        """Where the tool's point is (k, 3), `depth_mm` (k,) along the feed from the surface."""
        return np.asarray(self.position_mm[row] + self.rotation[row, :, 2] * depth_mm[:, None])


def make_cycles(
    job: Job, rows: NDArray[np.int64], part_from_tool: Floats, depth_mm: Floats
) -> Cycles:
    """The cycles of some holes of a job."""
    region = job.holes.region[rows]
    processes = [job.processes[r.process] for r in job.regions]
    approach = np.array([p.approach_mm for p in processes])
    retract = np.array([p.retract_mm for p in processes])
    return Cycles(
        region,
        job.holes.position_mm[rows],
        part_from_tool[rows],
        approach[region],
        retract[region],
        depth_mm[rows],
    )


@dataclass(frozen=True, eq=False)
class Candidates:
    """Ways to make holes, m of them: sorted by hole, then in the order in which they were found.

    joints (m, 6) are those at the surface, `standoff` and `leave` those where the cycle begins and
    ends. `margin` (m,): the least share of a joint's range that is left over the cycle; `bend_rad`
    (m,): the least bend of the wrist.
    """

    row: NDArray[np.int64]
    heading_rad: Floats
    branch: Ints
    joints: Floats
    standoff: Floats
    leave: Floats
    margin: Floats
    bend_rad: Floats

    def __len__(self) -> int:
        return len(self.row)

    def take(self, some: NDArray[np.int64] | NDArray[np.bool_]) -> Candidates:
        """Some of them."""
        return Candidates(**{f.name: getattr(self, f.name)[some] for f in fields(self)})


def join(parts: Sequence[Candidates]) -> Candidates:
    """Several lists as one, sorted by hole."""
    names = [f.name for f in fields(Candidates)]
    whole = Candidates(**{n: np.concatenate([getattr(p, n) for p in parts]) for n in names})
    return _sorted(whole)


def _sorted(candidates: Candidates) -> Candidates:
    """Sorted by hole; not copied where they are."""
    if (candidates.row[1:] >= candidates.row[:-1]).all():
        return candidates
    return candidates.take(np.argsort(candidates.row, kind="stable"))


@dataclass(frozen=True, eq=False)
class Assessment:
    """What came of k headings × 8 branches: `cause` (k, 8) as in `moves`, `over_rad` and `joint`
    (k, 8): by how much which joint oversteps its limits at the least, `bend_rad` (k, 8), `mover`
    (k, 8) what hits. `candidates`: the ones that are fine, `row` being the hole's."""

    cause: Ints
    over_rad: Floats
    joint: Ints
    bend_rad: Floats
    mover: Ints
    candidates: Candidates


def assess(
    cell: Cell,
    cycles: Cycles,
    row: NDArray[np.int64],
    heading_rad: Floats,
    wanted: NDArray[np.bool_] | None = None,
) -> Assessment:
    """Judge holes `row` (k,) at `heading_rad` (k,): every branch, or those `wanted` (k, 8), and
    every winding of each. A branch that is not wanted counts as out of reach."""
    if wanted is None:
        wanted = np.ones((len(row), 8), dtype=np.bool_)
    blocks = [slice(i, i + _BLOCK) for i in range(0, max(1, len(row)), _BLOCK)]
    parts = [_assess(cell, cycles, row[b], heading_rad[b], wanted[b]) for b in blocks]
    if len(parts) == 1:
        return parts[0]
    return Assessment(
        cause=np.concatenate([p.cause for p in parts]),
        over_rad=np.concatenate([p.over_rad for p in parts]),
        joint=np.concatenate([p.joint for p in parts]),
        bend_rad=np.concatenate([p.bend_rad for p in parts]),
        mover=np.concatenate([p.mover for p in parts]),
        candidates=join([p.candidates for p in parts]),
    )


def _assess(
    cell: Cell,
    cycles: Cycles,
    row: NDArray[np.int64],
    heading_rad: Floats,
    wanted: NDArray[np.bool_],
) -> Assessment:
    everywhere, steps = _everywhere(cell, cycles, row, heading_rad)  # (K + 3, k, 8, 6)
    path, places = everywhere[:steps], everywhere[steps:]
    low, high = everywhere.min(axis=0), everywhere.max(axis=0)  # (k, 8, 6), NaN where one is
    lost = np.isnan(low).any(axis=2) | ~wanted
    jump = np.abs(np.diff(path, axis=0)).max(axis=0, initial=0.0).max(axis=2) > JUMP_RAD
    bend = np.where(lost, np.inf, singularity(cell.geometry, path).wrist_rad.min(axis=0))
    bulge = np.abs(np.diff(path, n=2, axis=0)).max(axis=0, initial=0.0) * BULGE
    low, high = low - bulge, high + bulge
    over, joint = _overstep(cell, low, high)
    outside = over > SLACK_RAD
    cause = np.zeros((len(row), 8), dtype=np.int32)
    for bad, why in ((jump, JUMP), (bend < cell.singular_rad, SINGULAR), (outside, LIMIT)):
        cause[bad] = why
    cause[lost] = REACH
    mover = np.full(cause.shape, -1, dtype=np.int32)
    at, branch = np.nonzero(cause == FINE)
    if len(at):
        once, again = _looking_different(cell, at, branch)
        some, which = at[once], branch[once]
        along = path[:, some, which].transpose(1, 0, 2)
        guard, link = _link_hits(cell, cycles, row[some], heading_rad[some], which, along)
        guard, link = guard[again], link[again]
        hit = guard >= 0
        cause[at[hit], branch[hit]] = HIT + guard[hit]
        mover[at[hit], branch[hit]] = link[hit]
        at, branch = at[~hit], branch[~hit]
    which, turn, margin = _windings(cell, low[at, branch], high[at, branch])
    surface, standoff, leave = (places[i, at[which], branch[which]] + turn for i in range(3))
    candidates = Candidates(
        row[at[which]],
        heading_rad[at[which]],
        branch[which].astype(np.int32),
        surface,
        standoff,
        leave,
        margin,
        bend[at[which], branch[which]],
    )
    return Assessment(cause, over, joint, bend, mover, _sorted(candidates))


def _everywhere(
    cell: Cell, cycles: Cycles, row: NDArray[np.int64], heading_rad: Floats
) -> tuple[Floats, int]:
    """All branches (K + 3, k, 8, 6) along the way, from the outmost standoff to the depth, then at
    the surface, at the standoff and where the tool leaves; each continued from the surface's. And
    K, the places along the way. They come first: what is asked of them is the same for all holes.
    """
    out, depth = cycles.out_mm[row], cycles.depth_mm[row]
    steps = 1 + max(1, int(np.ceil((out + depth).max(initial=0.0) / STEP_MM)))
    share = np.linspace(0.0, 1.0, steps)[:, None]
    special = [np.zeros(len(row)), -cycles.approach_mm[row], -cycles.retract_mm[row]]
    depths = np.concatenate([-out + (out + depth) * share, special])  # (K + 3, k)
    rotation = np.tile(cycles.turned(row, heading_rad), (len(depths), 1, 1))
    rows = np.tile(row, len(depths))
    joints = cell.branches(rotation, cycles.at_depth(rows, depths.ravel()))
    joints = joints.reshape(*depths.shape, 8, 6)
    return joints - 2 * np.pi * np.round((joints - joints[steps]) / (2 * np.pi)), steps


def _overstep(cell: Cell, low: Floats, high: Floats) -> tuple[Floats, Ints]:
    """By how much the joint that fits worst oversteps its limits, in its best winding."""
    # The range that a joint goes through oversteps the least where its middle is nearest to the
    # middle of the limits; how far apart these are decides which turn that is.
    apart = 0.5 * (low + high) - 0.5 * (cell.low_rad + cell.high_rad)
    apart -= 2 * np.pi * np.round(apart / (2 * np.pi))
    spare = 0.5 * (cell.high_rad - cell.low_rad) - 0.5 * (high - low)
    best = np.nan_to_num(np.abs(apart) - spare, nan=np.inf)
    joint = np.argmax(best, axis=2)
    return np.take_along_axis(best, joint[..., None], axis=2)[..., 0], joint.astype(np.int32)


def _looking_different(
    cell: Cell, at: NDArray[np.int64], branch: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Which of the pairs to look at, and which of these stands for each: turning the wrist over
    turns capsules about their own axes only."""
    turned = branch % 4 if all(link is None for link in cell.arm.links) else branch
    _, once, again = np.unique(at * 8 + turned, return_index=True, return_inverse=True)
    return once, again


def _link_hits(
    cell: Cell,
    cycles: Cycles,
    row: NDArray[np.int64],
    heading_rad: Floats,
    branch: NDArray[np.int64],
    path: Floats,
) -> tuple[Ints, Ints]:
    """Which guard the links are not proven clear of, (j,), and which link; -1: none."""
    rotation = cycles.turned(row, heading_rad)
    start = rotation, cycles.at_depth(row, -cycles.out_mm[row])
    stop = rotation, cycles.at_depth(row, cycles.depth_mm[row])
    moves = straight_moves(
        cycles.region[row], start, stop, branch.astype(np.int32), path[:, 0], path[:, -1]
    )
    first = np.arange(len(row) + 1, dtype=np.int64) * path.shape[1]
    sampled = Sampled(moves, first, path.reshape(-1, 6))
    links = tuple(mover for mover in cell.movers if mover.link != TOOL)
    hits = find_hits(cell, sampled, np.arange(len(row)), links, stretches=1)
    return hits.guard, hits.mover


def _windings(cell: Cell, low: Floats, high: Floats) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Every choice of whole turns that keeps joints which go from `low` to `high` (j, 6) over the
    cycle inside the limits: which row it is of (w,), the turns (w, 6) in radians, and the margin
    (w,) that is left."""
    which, lowest = all_turns(low, cell.low_rad, cell.high_rad - (high - low))
    turn = lowest - low[which]
    room = np.minimum(lowest - cell.low_rad, cell.high_rad - high[which] - turn)
    margin = (room / (cell.high_rad - cell.low_rad)).min(axis=1, initial=np.inf)
    return which, turn, np.maximum(0.0, margin)

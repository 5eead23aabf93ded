"""Job → Job: parking places for `base auto`: the fewest, and of those the ones with most room.

A place's worth is the worst margin over its holes (the least share of a joint's range that is left
over a hole's cycle, in the branch that leaves the most). It is computed for all places at once from
kinematics alone, at the rule's heading and, where that fails and the hole may turn, at headings
`COARSE_RAD` apart that keep the tool clear. The places that come out best are then proven with the
full solver, fixtures and ways between the holes included; regions that fail there are struck off,
and the search for the best places goes on without them. Nothing depends on time or chance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from drillc.kernels.covering import best_cover
from drillc.language.arm import MAX_AUTO_STATIONS, MAX_BASE_PLACES
from drillc.language.diagnostics import NAMED_ROWS, Label, Report
from drillc.language.job import Arm, AutoBase, Floats, Ints, Job, Named, Pose, Station
from drillc.planning.arm_joints import check_frames, find_candidates, jump_limits
from drillc.planning.arm_travel import make_legs, plan_travel
from drillc.planning.cell import Cell, make_cell, make_guards
from drillc.planning.cycle_check import Cycles, assess, make_cycles
from drillc.planning.explain import explain
from drillc.planning.reach import as_if_moved, lacking_mm, moved, wrist_centres
from drillc.planning.sequence import choose
from drillc.planning.standing import stands_clear
from drillc.planning.tool_sweeps import ToolSweeps, make_tool_sweeps

Rows = NDArray[np.int64]
Progress = Callable[[str], None]

#: Headings away from the rule's that are tried stand so far apart; where the tool is clear at none
#: of them, so far.
COARSE_RAD, FINE_RAD = np.radians(15.0), np.radians(1.0)
#: Stations that are proven before the search is given up.
MOST_PROOFS = 64
#: Pairs of a place and a heading that are worked on at once.
_BLOCK = 1 << 14
#: Larger searches are not made only to find out whether they would help.
_MOST_TRIED = 500_000


@dataclass(frozen=True, eq=False)
class _Ways:
    """Headings (m,) of holes `row` (m,) at which the tool keeps clear, sorted by hole; those that
    are the rule's own come into question first."""

    row: Rows
    heading_rad: Floats

    @property
    def own(self) -> NDArray[np.bool_]:
        return np.asarray(self.heading_rad == 0.0)


@dataclass(frozen=True, eq=False)
class _Search:
    """What stays the same wherever the arm is parked. `cell` stands at the origin of the part,
    `ways` is all there is to be tried; `proofs`: what came of proving a place for some regions."""

    job: Job
    cell: Cell
    cycles: Cycles
    sweeps: ToolSweeps
    turning_rad: Floats
    ways: _Ways
    progress: Progress
    proofs: dict[tuple[tuple[float, ...], tuple[int, ...]], frozenset[int]] = field(
        default_factory=dict
    )


@dataclass(frozen=True, eq=False)
class _Places:
    """Places (p, 3) with the margin they leave each region, (p, r), -inf where a hole of it cannot
    be made, and how many holes cannot, (p,)."""

    at_mm: Floats
    score: Floats
    failing: Ints


def park(
    job: Job, arm: Arm, part_from_tool: Floats, depth_mm: Floats, report: Report, progress: Progress
) -> tuple[Job, Arm]:
    """The job with parking places found, where they are to be. Raises `Refused` where there are
    none. `part_from_tool` (n, 3, 3) is what the rules say."""
    auto = arm.auto
    if auto is None:
        return job, arm
    assert job.tool is not None
    start = Station(None, Pose(auto.rotation, np.zeros(3)), None, auto.span)
    check_frames(job, replace(arm, stations=(start,)), report)
    report.stop_if_failed()
    cell = make_cell(arm, start, job.tool, make_guards(job))
    cycles = make_cycles(job, np.arange(len(job.holes)), part_from_tool, depth_mm)
    sweeps = make_tool_sweeps(cell, cycles)
    turning_rad = np.array([region.turning_rad for region in job.regions])[cycles.region]
    ways = _find_ways(sweeps, turning_rad)
    search = _Search(job, cell, cycles, sweeps, turning_rad, ways, progress)
    blocked = np.setdiff1d(np.arange(len(cycles)), ways.row)
    if len(blocked):
        _report_blocked(search, auto, blocked, report)
        report.stop_if_failed()
    places = _judge(search, auto)
    found = _choose(search, places, auto.most)
    if found is None:
        _report(search, auto, places, report)
        report.stop_if_failed()
    assert found is not None
    return _parked(search, arm, auto, places, found, report)


def grid(auto: AutoBase) -> Floats:
    """The places (p, 3) in part coordinates, x slowest."""
    axes = [
        low + auto.step_mm * np.arange(int((high - low) / auto.step_mm + 1e-9) + 1)
        for low, high in zip(auto.low_mm, auto.high_mm, strict=True)
    ]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


# ── how much room a place leaves ─────────────────────────────────────────────────────────────────


def _find_ways(sweeps: ToolSweeps, turning_rad: Floats) -> _Ways:
    """The tool's free headings: they are the same wherever the arm stands."""
    ways = _free(sweeps, turning_rad, COARSE_RAD)
    none = np.setdiff1d(np.arange(len(turning_rad)), ways.row)
    if len(none):
        fine = _free(sweeps, turning_rad, FINE_RAD, none)
        row = np.concatenate([ways.row, fine.row])
        order = np.argsort(row, kind="stable")
        heading_rad = np.concatenate([ways.heading_rad, fine.heading_rad])
        ways = _Ways(row[order], heading_rad[order])
    return ways


def _free(
    sweeps: ToolSweeps, turning_rad: Floats, step_rad: float, rows: Rows | None = None
) -> _Ways:
    """Headings within each hole's turning, at most `step_rad` apart, that keep the tool clear."""
    rows = np.arange(len(turning_rad)) if rows is None else rows
    row, heading = [], []
    for turning in np.unique(turning_rad[rows]).tolist():
        some = rows[turning_rad[rows] == turning]
        steps = int(np.ceil(turning / step_rad))
        headings = turning * np.arange(-steps, steps + 1) / max(1, steps)
        row.append(np.repeat(some, len(headings)))
        heading.append(np.tile(headings, len(some)))
    all_rows, all_headings = np.concatenate(row), np.concatenate(heading)
    clear = sweeps.clear(all_rows, all_headings)
    order = np.lexsort((all_headings, all_rows))
    order = order[clear[order]]
    return _Ways(all_rows[order], all_headings[order])


def _judge(search: _Search, auto: AutoBase) -> _Places:
    """The margins that every place of the grid leaves the regions."""
    at_mm = grid(auto)
    starts = np.array([region.start for region in search.job.regions])
    score = np.full((len(at_mm), len(starts)), -np.inf)
    failing = np.full(len(at_mm), len(search.cycles) + 1)
    standing = np.flatnonzero(stands_clear(search.cell, at_mm))
    block = max(1, _BLOCK // max(1, len(search.ways.row)))
    for first in range(0, len(standing), block):
        search.progress(f"trying {len(at_mm):,} parking places, {100 * first // len(standing)} %")
        some = standing[first : first + block]
        margin = margins(search.cell, search.cycles, search.ways, at_mm[some])
        score[some] = np.minimum.reduceat(margin, starts, axis=1)
        failing[some] = np.isneginf(margin).sum(axis=1)
    return _Places(at_mm, score, failing)


def margins(cell: Cell, cycles: Cycles, ways: _Ways, at_mm: Floats) -> Floats:
    """The best margin of every hole from every place: (p, n), -inf where there is none. Fixtures in
    the arm's way are not looked at."""
    bare = replace(cell, guards=())
    best = np.full((len(at_mm), len(cycles)), -np.inf)
    within = _within_reach(bare, cycles, ways, at_mm)
    for own in (True, False):
        place, way = np.nonzero(within & (ways.own == own))
        open_ = np.isneginf(best[place, ways.row[way]])
        place, way = place[open_], way[open_]
        seen = as_if_moved(cycles, ways.row[way], at_mm[place])
        found = assess(bare, seen, np.arange(len(way)), ways.heading_rad[way]).candidates
        np.maximum.at(best, (place[found.row], ways.row[way[found.row]]), found.margin)
    return best


def _within_reach(cell: Cell, cycles: Cycles, ways: _Ways, at_mm: Floats) -> NDArray[np.bool_]:
    """Which ways (m,) bring the wrist centre within reach from which places, (p, m)."""
    turned = cycles.turned(ways.row, ways.heading_rad)
    root = cell.station.part_from_root.rotation
    within = np.ones((len(at_mm), len(ways.row)), dtype=np.bool_)
    for depth_mm in (-cycles.out_mm, cycles.depth_mm):
        tool_mm = cycles.at_depth(ways.row, depth_mm[ways.row])
        wrist_mm = wrist_centres(cell.geometry, cell.flange_from_tool, turned, tool_mm)
        within &= lacking_mm(cell.geometry, (wrist_mm - at_mm[:, None]) @ root) <= 0
    return within


# ── which places ─────────────────────────────────────────────────────────────────────────────────


def _choose(search: _Search, places: _Places, most: int) -> Ints | None:
    """The place of each region (r,), proven; None where none could be found."""
    score = places.score.copy()
    for _ in range(MOST_PROOFS):
        cover = best_cover(score, most)
        if cover is None:
            return None
        struck = False
        for place in np.unique(cover).tolist():
            failed = _failed(search, places.at_mm[place], np.flatnonzero(cover == place))
            score[place, sorted(failed)] = -np.inf
            struck = struck or bool(failed)
        if not struck:
            return cover.astype(np.int32)
    return None


def _failed(search: _Search, at_mm: Floats, regions: Rows) -> frozenset[int]:
    """Which of the regions cannot be made from a place: of a way that is not clear, the one to
    which it leads."""
    key = tuple(at_mm.tolist()), tuple(regions.tolist())
    if key not in search.proofs:
        search.progress(f"proving the parking place ({_plain(at_mm)}) mm")
        search.proofs[key] = _prove(search, at_mm, regions)
    return search.proofs[key]


def _prove(search: _Search, at_mm: Floats, regions: Rows) -> frozenset[int]:
    rows = np.flatnonzero(np.isin(search.cycles.region, regions))
    cell = moved(search.cell, at_mm)
    cycles = as_if_moved(search.cycles, rows, np.zeros(3))
    sweeps = make_tool_sweeps(cell, cycles)
    turning_rad = search.turning_rad[rows]
    candidates = find_candidates(cell, cycles, sweeps, turning_rad, lambda doing: None)
    missing = np.setdiff1d(np.arange(len(rows)), candidates.row)
    if len(missing):
        return frozenset(cycles.region[missing].tolist())
    limit = jump_limits(search.job, cycles)
    weights = search.job.weights
    sequence = choose(cell, cycles, sweeps, candidates, turning_rad, limit, weights)
    if sequence.blocked is not None:
        return frozenset({int(cycles.region[sequence.blocked])})
    legs = make_legs(cell, cycles.region)
    _, blocked = plan_travel(cell, cycles, sequence.chosen, legs)
    holes = (max(int(legs.reaches[one.leg]), int(legs.leaves[one.leg])) for one in blocked)
    return frozenset(int(cycles.region[hole]) for hole in holes)


def _parked(
    search: _Search, arm: Arm, auto: AutoBase, places: _Places, cover: Ints, report: Report
) -> tuple[Job, Arm]:
    """The job with its stations, in the order in which the regions first use them."""
    job = search.job
    assert job.part.frame is not None
    order = list(dict.fromkeys(cover.tolist()))
    stations = []
    for k, place in enumerate(order):
        pose = Pose(auto.rotation, places.at_mm[place])
        name = None if len(order) == 1 else Named(f"S{k + 1}", auto.span)
        stations.append(Station(name, pose, job.part.frame.number + k, auto.span))
        served = [r.name.text for r, at in zip(job.regions, cover, strict=True) if at == place]
        margin = places.score[place, cover == place].min()
        where = "the base" if name is None else f"station {name.text}"
        at = "" if name is None else f" for region{'s' * (len(served) > 1)} {', '.join(served)}"
        report.note(
            f"{where} is parked at ({_plain(places.at_mm[place])}) mm{at}: at least "
            f"{100 * margin:.1f} % of each joint's range are left"
        )
    regions = tuple(
        replace(region, station=order.index(place))
        for region, place in zip(job.regions, cover.tolist(), strict=True)
    )
    there = replace(arm, stations=tuple(stations), auto=None)
    return replace(job, robot=there, regions=regions), there


def _plain(at_mm: Floats) -> str:
    return ", ".join(f"{value + 0.0:g}" for value in at_mm.tolist())


# ── where there is none ──────────────────────────────────────────────────────────────────────────


def _report(search: _Search, auto: AutoBase, places: _Places, report: Report) -> None:
    """No place serves: what is in the way at the best of them, and what would be enough."""
    count = len(search.cycles)
    holes = f"all {count:,} holes" if count > 1 else "the hole"
    stations = "one station" if auto.most == 1 else f"{auto.most} stations"
    tried = f"the {len(places.at_mm):,} places" if len(places.at_mm) > 1 else "the one place"
    helps = _what_helps(search, auto)
    report.error(
        "E416",
        f"the arm cannot make {holes} from {stations} at {tried} tried; {_why(search, places)}",
        auto.span,
        hint="; or ".join(helps)
        or "give more: a larger area, a smaller step, more stations, or holes that may turn",
    )


def _why(search: _Search, places: _Places) -> str:
    """What is in the way at the place with the fewest holes that fail."""
    best = int(np.argmin(places.failing))
    at_mm = places.at_mm[best]
    if places.failing[best] > len(search.cycles):
        return "it cannot stand, or wait at its home, at any of them: fixtures are in the way"
    cell = moved(search.cell, at_mm)
    sweeps = replace(search.sweeps, cell=cell)
    search.progress(f"looking for what is in the way at ({_plain(at_mm)}) mm")
    found = find_candidates(cell, search.cycles, sweeps, search.turning_rad, lambda doing: None)
    rows = np.setdiff1d(np.arange(len(search.cycles)), found.row)
    if not len(rows):
        return f"from ({_plain(at_mm)}) mm it could make each, but not go from one to the next"
    names = _names(search.job, rows)
    why = explain(cell, search.cycles, sweeps, int(rows[0]), search.turning_rad)
    return (
        f"from the best of them, ({_plain(at_mm)}) mm, it cannot make {len(rows):,} ({names}); for "
        f"{search.job.holes.ids[rows[0]]}, {why.summary}"
    )


def _report_blocked(search: _Search, auto: AutoBase, rows: Rows, report: Report) -> None:
    """Holes at which the tool meets something, however it is turned and wherever the arm stands."""
    cell = moved(search.cell, auto.low_mm)
    sweeps = replace(search.sweeps, cell=cell)
    why = explain(cell, search.cycles, sweeps, int(rows[0]), search.turning_rad)
    ids = search.job.holes.ids
    report.error(
        "E416",
        f"wherever the arm is parked, it cannot make {len(rows):,} hole{'s' * (len(rows) > 1)} "
        f"({_names(search.job, rows)}); for {ids[rows[0]]}, {why.summary}",
        search.job.holes.span(int(rows[0])),
        labels=[Label(auto.span, "a parking place is sought here")],
        hint="let the holes turn farther, keep a smaller clearance, or move the fixture",
    )


def _names(job: Job, rows: Rows) -> str:
    """The first of some holes."""
    return ", ".join(map(str, job.holes.ids[rows[:NAMED_ROWS]])) + ", …" * (len(rows) > NAMED_ROWS)


def _what_helps(search: _Search, auto: AutoBase) -> list[str]:
    """More stations, a larger area, a smaller step: what was tried and found to be enough."""
    found = []
    more = _choose(search, _judge(search, auto), MAX_AUTO_STATIONS)
    if more is not None:
        found.append(f"stations {len(np.unique(more))} would do")
    extent = auto.high_mm - auto.low_mm
    wide = np.where(extent > 0, np.maximum(2, np.rint(0.5 * extent / auto.step_mm)), 0)
    larger = replace(
        auto, low_mm=auto.low_mm - wide * auto.step_mm, high_mm=auto.high_mm + wide * auto.step_mm
    )
    if _enough(search, larger):
        corners = f"({_plain(larger.low_mm)}) ({_plain(larger.high_mm)}) mm"
        found.append(f"within {corners} would do")
    finer = replace(auto, step_mm=0.5 * auto.step_mm)
    if _enough(search, finer):
        found.append(f"step {finer.step_mm:g} mm would do")
    return found


def _enough(search: _Search, auto: AutoBase) -> bool:
    counts = np.floor((auto.high_mm - auto.low_mm) / auto.step_mm + 1e-9) + 1
    if np.prod(counts) > min(MAX_BASE_PLACES, _MOST_TRIED / len(search.ways.row)):
        return False
    return _choose(search, _judge(search, auto), auto.most) is not None

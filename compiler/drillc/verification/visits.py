"""A program's motion in visits: stretches in which the tool stays on one line along its axis."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .events import Events, Floats, Kind
from .expected import MOVE, SAME_MM, SAME_SPEED
from .places import Places
from .vectors import dot

Rows = NDArray[np.intp]
Bools = NDArray[np.bool_]

#: A tool axis that shifts or turns by no more stays on its line; what it may differ by in earnest
#: is for the checks.
LINE_MM, LINE_RAD = 0.5, 0.01
#: How near to a standoff the tool counts as there.
THERE_MM = 0.01


@dataclass(frozen=True, eq=False)
class Path:
    """n events with what is known of each: where the tool is, its code (`expected.codes_of`), its
    speed in mm/s (NaN: not stated) and by what share of it rounding may change that, and the middle
    of its way (n, 3) where that is not straight by itself, else NaN."""

    events: Events
    places: Places
    codes: NDArray[np.int32]
    speed_mm_s: Floats
    speed_slack: Floats
    middle_mm: Floats

    def __len__(self) -> int:
        return len(self.events)

    @property
    def moves(self) -> Bools:
        """Which events move the tool."""
        return np.asarray(self.codes == MOVE)

    @cached_property
    def before(self) -> Rows:
        """For each event the last move before it, or -1."""
        moves = np.where(self.moves, np.arange(len(self)), -1)
        last = np.maximum.accumulate(moves) if len(moves) else moves
        return np.asarray(np.concatenate([[-1], last[:-1]])[: len(self)])

    def take(self, rows: Rows | Bools | slice) -> Path:
        """Some of the events."""
        return Path(
            self.events.take(rows),
            self.places.take(rows),
            self.codes[rows],
            self.speed_mm_s[rows],
            self.speed_slack[rows],
            self.middle_mm[rows],
        )


@dataclass(frozen=True, eq=False)
class Visits:
    """m visits of a path: the events `start` … `stop` (m,) of each, and its deepest move."""

    start: Rows
    stop: Rows
    deepest: Rows

    def __len__(self) -> int:
        return len(self.start)

    def take(self, rows: Rows | Bools | slice) -> Visits:
        """Some of them."""
        return Visits(self.start[rows], self.stop[rows], self.deepest[rows])


def visits_of(path: Path, fresh: int) -> Visits:
    """All stretches of a path in which something is done on one line: the tool moves along it, or
    something is switched there. Single moves are not among them. What is before event `fresh` was
    looked at before, and belongs to none."""
    moves = np.flatnonzero(path.moves)
    if not len(moves):
        return Visits(moves, moves, moves)
    position, axis = path.places.position_mm[moves], path.places.axis[moves]
    first = np.flatnonzero(~_same_line(position[:-1], axis[:-1], position[1:], axis[1:])) + 1
    first = np.concatenate([[0], first])
    first = _without_slips(first, len(moves), position, axis)
    along = dot(position, _held(axis, first, len(moves)))
    first = _apart(first, moves, path, along)
    if fresh:
        here = int(np.searchsorted(moves, fresh))
        at = int(np.searchsorted(first, here))
        if here < len(moves) and (at == len(first) or first[at] != here):
            first = np.insert(first, at, here)
    starts = moves[first]
    stops = np.append(starts[1:], len(path))
    along = dot(position, _held(axis, first, len(moves)))
    low, high = np.minimum.reduceat(along, first), np.maximum.reduceat(along, first)
    counts = np.diff(first, append=len(moves))
    switched = (stops - starts) > counts
    works = switched | (high - low > THERE_MM)
    works &= np.isfinite(position[first, 0]) & (starts >= fresh)
    deep = np.flatnonzero(along >= np.repeat(high, counts))
    deep = np.append(deep, len(moves) - 1)  # a place that nobody knows has no deepest
    deepest = moves[deep[np.minimum(np.searchsorted(deep, first), len(deep) - 1)]]
    return Visits(starts, stops, deepest).take(works)


def _same_line(one_mm: Floats, one_axis: Floats, two_mm: Floats, two_axis: Floats) -> Bools:
    """Whether two poses each stand on one line; false where one is not known."""
    step = two_mm - one_mm
    along = dot(step, one_axis)
    aside = step - along[:, None] * one_axis
    turned = two_axis - one_axis
    with np.errstate(invalid="ignore"):
        near = dot(aside, aside) <= LINE_MM**2
        alike = dot(turned, turned) <= LINE_RAD**2
    return np.asarray(near & alike)


def _without_slips(first: Rows, count: int, position: Floats, axis: Floats) -> Rows:
    """A stretch of one move between two of one line is a slip of theirs: they stay one visit, whose
    checks will tell of it."""
    if len(first) < 3:
        return first
    counts = np.diff(first, append=count)
    lone = counts[1:-1] == 1
    before, after = first[1:-1] - 1, first[2:]
    back = _same_line(position[before], axis[before], position[after], axis[after])
    # Out at a standoff, away and back again is a visit that is made twice, not a slip.
    longer = (counts[:-2] > 1) & (counts[2:] > 1)
    slips = np.flatnonzero(lone & back & longer) + 1
    return np.delete(first, np.concatenate([slips, slips + 1])) if len(slips) else first


def _held(axis: Floats, first: Rows, count: int) -> Floats:
    """For each move the axis at which its stretch begins."""
    return np.repeat(axis[first], np.diff(first, append=count), axis=0)


def _apart(first: Rows, moves: Rows, path: Path, along: Floats) -> Rows:
    """Two calls of routines that each do something on one line, with the tool out of the hole
    between them, are two visits: of holes on one line, or of one hole that is made twice."""
    events = path.events
    inner = (events.line[moves] != events.call_line[moves]) | (
        events.file[moves] != events.call_file[moves]
    )
    called = np.flatnonzero(inner)
    if not len(called):
        return first
    call = events.call_file[moves].astype(np.int64) * (1 << 32) + events.call_line[moves]
    stretch = np.searchsorted(first, np.arange(len(moves)), side="right") - 1
    changes = (stretch[called[1:]] == stretch[called[:-1]]) & (
        call[called[1:]] != call[called[:-1]]
    )
    more = []
    for k in np.flatnonzero(changes).tolist():
        before, after = called[k], called[k + 1]
        mine = called[(call[called] == call[before]) & (stretch[called] == stretch[before])]
        other = called[(call[called] == call[after]) & (stretch[called] == stretch[after])]
        low, high = along[mine].min(), along[mine].max()
        works = high - low > THERE_MM and np.ptp(along[other]) > THERE_MM
        if works and along[before] < 0.5 * (low + high):
            more.append(before + 1)
    return np.union1d(first, np.array(more, dtype=np.intp)) if more else first


# ── the core of a visit: from the standoff to the standoff ───────────────────────────────────────


@dataclass(frozen=True, eq=False)
class Cores:
    """Of m visits: the first and last event (m,) of what is done there: it begins with the last
    move that is not nearer than the standoff, and ends where the tool is out again and nothing more
    is switched."""

    first: Rows
    last: Rows


def cores_of(path: Path, visits: Visits, depth_mm: Floats, begin: Floats, end: Floats) -> Cores:
    """`depth_mm` (n,) of the tool after each event, on its visit's axis; `begin` and `end` (m,) are
    the depths of the standoffs."""
    m = len(visits)
    if not m:
        return Cores(visits.start, visits.stop)
    counts = visits.stop - visits.start
    events = spread(visits.start, counts)
    visit = np.repeat(np.arange(m), counts)
    offsets = np.concatenate([[0], np.cumsum(counts)[:-1]])
    depth, moves = depth_mm[events], path.moves[events]
    index = np.arange(len(events))
    inside = moves & ~(depth <= begin[visit] + THERE_MM)
    first_busy = np.minimum.reduceat(np.where(~moves | inside, index, len(events)), offsets)
    begins = np.maximum(np.minimum(first_busy, offsets + counts) - 1, offsets)
    inside = moves & ~(depth <= end[visit] + THERE_MM)
    last_busy = np.maximum.reduceat(np.where(~moves | inside, index, -1), offsets)
    last_busy = np.maximum(last_busy, begins)
    out = depth[last_busy] <= end + THERE_MM
    ends = np.where(out, last_busy, np.minimum(last_busy + 1, offsets + counts - 1))
    return Cores(events[begins], events[ends])


@dataclass(frozen=True, eq=False)
class Items:
    """What is done in m cores: `event` (k,) indexes the path, `first` (m + 1,) says where each core
    begins among them; `item_of` (j,) says to which item each of the core's `events` (j,) belongs.
    """

    event: Rows
    first: Rows
    events: Rows
    item_of: Rows


def items_of(path: Path, cores: Cores, depth_mm: Floats, *, together: bool) -> Items:
    """Without moves that lead nowhere; `together`: with moves that go on in one direction at one
    speed as one."""
    counts = cores.last - cores.first + 1
    events = spread(cores.first, counts)
    offsets = np.concatenate([[0], np.cumsum(counts)]).astype(np.intp)
    head = np.zeros(len(events), dtype=np.bool_)
    head[offsets[:-1]] = True
    depth, moves = depth_mm[events], path.moves[events]
    step = np.diff(depth, prepend=np.nan)
    speed, slack = path.speed_mm_s[events], path.speed_slack[events]
    pause = (path.events.kind[events] == Kind.PAUSE) & (path.events.value[events] == 0.0)
    real = head | ~(moves & (np.abs(step) < SAME_MM)) & ~pause
    kept = np.flatnonzero(real)
    item = kept
    if together and len(kept):
        here, onward = kept[:-1], kept[1:]
        with np.errstate(invalid="ignore"):
            alike = SAME_SPEED + slack[onward] + slack[here]
            apart = np.abs(speed[onward] - speed[here])
            same = apart <= alike * np.maximum(speed[here], speed[onward])
        same |= np.isnan(speed[onward]) & np.isnan(speed[here])
        goes_on = moves[here] & moves[onward] & ~head[here] & ~head[onward]
        goes_on &= (step[here] * step[onward] > 0.0) & same
        item = kept[np.append(~goes_on, True)]
    ends = np.zeros(len(events), dtype=np.intp)
    ends[item] = 1
    item_of = np.minimum(np.cumsum(ends) - ends, max(len(item) - 1, 0))
    return Items(events[item], np.searchsorted(item, offsets), events, item_of)


def spread(start: Rows, counts: Rows) -> Rows:
    """All of start[i] … start[i] + counts[i], one after another."""
    total = int(counts.sum())
    before = np.cumsum(counts) - counts
    return np.asarray(np.arange(total) + np.repeat(start - before, counts))

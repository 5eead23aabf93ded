"""What a program does where an answer does not come in time, and where it does not know where the
machine stands."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from .case import NOISE_MM, Case, roles_of
from .checks import Made
from .events import Alternative, Events, Floats, Ints, Kind, placed_of
from .expected import MOVE, SAME_SPEED, Item, codes_of
from .frames import check_frames
from .places import Places
from .travels import travel_speeds_fit
from .vectors import length
from .verdict import Rows
from .visits import Path
from .withdrawals import clear_reach_mm

_LINE = 1 << 32
#: A wait stands at the depth that a fault asks for if it is within this: rounding.
_STAYS_MM = 2e-3


@dataclass(frozen=True, eq=False)
class Waits:
    """Waits (k,) that the main run came by: their statement and that of the body, as one number
    each; the hole, how deep the tool was and where; and what is waited for."""

    own: Rows
    body: Rows
    hole: Rows
    depth_mm: Floats
    position_mm: Floats
    signal: Ints

    def take(self, rows: Rows) -> Waits:
        """Some of them."""
        return Waits(*(getattr(self, field.name)[rows] for field in fields(self)))


@dataclass(eq=False)
class Faults:
    """Waits that have not been told yet what happens without their answer, and alternatives that
    have not found their wait."""

    waits: list[Waits] = field(default_factory=list)
    alternatives: list[Alternative] = field(default_factory=list)

    def add(self, path: Path, made: Made) -> None:
        """The waits of some visits."""
        visit = np.repeat(np.arange(len(made)), made.cores.last - made.cores.first + 1)
        events = made.items.events
        waits = path.events.kind[events] == Kind.WAIT
        at, hole = events[waits], made.hole[visit[waits]]
        last = np.maximum.accumulate(np.where(path.moves, np.arange(len(path)), 0))
        told = path.events
        self.waits.append(
            Waits(
                _number(told.file[at], told.line[at]),
                _number(told.call_file[at], told.call_line[at]),
                hole,
                made.depth_mm[at],
                path.places.position_mm[last[at]],
                told.signal[at],
            )
        )

    def check(self, case: Case, *, last: bool) -> None:
        """Compare all alternatives whose waits are known; at the `last` call, all others fail."""
        waits = _joined(self.waits)
        left = []
        told = np.zeros(len(waits.own), dtype=np.bool_)
        for one in self.alternatives:
            if not one.timeout:
                _unknown_start(case, one)
                continue
            rows = _waits_of(waits, one)
            if (rows < 0).any() and not last:
                left.append(one)
                continue
            lanes = np.flatnonzero(rows >= 0)
            told[rows[lanes]] = True
            if len(lanes):
                _compare(case, one, lanes, waits, rows[lanes])
        self.alternatives = left
        if last:
            self._untold(case, waits, np.flatnonzero(~told))
            self.waits = []
        else:
            kept = np.flatnonzero(~told)
            self.waits = [waits.take(kept)]

    def _untold(self, case: Case, waits: Waits, rows: Rows) -> None:
        """A wait for ever has no other way out."""
        if len(rows):
            where = int(waits.own[rows[0]])
            hole = int(waits.hole[rows[0]])
            case.tally.fail(
                "handshake",
                f"nothing says what happens if {case.signal(int(waits.signal[rows[0]]))} does not"
                f" come at {case.hole(hole)}",
                hole=case.hole(hole),
                file=where // _LINE,
                line=where % _LINE,
                span=case.wanted.process(hole).span,
                alike=len(rows) - 1,
            )


def _number(file: Ints, line: Ints) -> Rows:
    return np.asarray(file.astype(np.int64) * _LINE + line)


def _joined(parts: list[Waits]) -> Waits:
    if not parts:
        rows = np.empty(0, dtype=np.intp)
        return Waits(rows, rows, rows, np.empty(0), np.empty((0, 3)), rows.astype(np.int32))
    return Waits(
        *(np.concatenate([getattr(part, one.name) for part in parts]) for one in fields(Waits))
    )


def _waits_of(waits: Waits, one: Alternative) -> Rows:
    """The wait of each lane, or -1. A statement that is run again has several: in their order."""
    mine = np.flatnonzero(waits.own == one.file * _LINE + one.line)
    if one.line == 0 or not len(mine):
        return np.full(len(one.call_line), -1, dtype=np.intp)
    order = mine[np.argsort(waits.body[mine], kind="stable")]
    keys = waits.body[order]
    lanes = _number(one.call_file, one.call_line)
    # the k-th lane with the same statement is the k-th wait of it
    sort = np.argsort(lanes, kind="stable")
    ranked = lanes[sort]
    nth = np.empty(len(lanes), dtype=np.intp)
    nth[sort] = np.arange(len(lanes)) - np.searchsorted(ranked, ranked)
    at = np.searchsorted(keys, lanes) + nth
    inside = at < len(keys)
    at = np.minimum(at, len(keys) - 1)
    return np.where(inside & (keys[at] == lanes), order[at], -1)


# ── what happens ─────────────────────────────────────────────────────────────────────────────────


def _compare(case: Case, one: Alternative, lanes: Rows, waits: Waits, rows: Rows) -> None:
    """The lanes of one alternative, those of each cycle together."""
    case.tally.compared("handshake", len(lanes))
    cycles = case.wanted.cycle[waits.hole[rows]]
    sizes = np.diff(one.starts)
    for cycle in np.unique(cycles):
        for size in np.unique(sizes[lanes]):
            chosen = (cycles == cycle) & (sizes[lanes] == size)
            if not chosen.any():
                continue
            events = one.events
            if not chosen.all() or len(lanes) * size < len(events):
                table = one.starts[lanes[chosen]][:, None] + np.arange(size)
                events = events.take(table.ravel())
            _judge(case, one, events, int(size), waits, rows[chosen], lanes[chosen], int(cycle))


@dataclass(eq=False)
class _Lane:
    """What is left to compare: codes, and numbers by lane (v,)."""

    code: int
    depth_mm: Floats
    speed_mm_s: Floats
    value: Floats
    shared: bool  # whether its speed is a share of full speed


def _judge(
    case: Case,
    one: Alternative,
    events: Events,
    size: int,
    waits: Waits,
    rows: Rows,
    lanes: Rows,
    cycle: int,
) -> None:
    count = len(rows)
    hole, start = waits.hole[rows], waits.depth_mm[rows]
    place = case.machine.places(events)
    codes = codes_of(events.kind, roles_of(case, events), events.value).reshape(count, size)
    untold = np.full(len(events), np.nan)
    middle = np.full((len(events), 3), np.nan)
    check_frames(case, Path(events, place, codes.ravel(), untold, untold, middle))
    depth, aside = _along(case, place, events, hole, size)
    turned = _turned(case, place, hole, size)
    wrong = np.zeros(count, dtype=np.bool_)
    why = ""
    wrong |= ~(codes == codes[0]).all(axis=1)
    moves = codes[0] == MOVE
    beside = case.limits.straight_mm[hole] + case.limits.position_mm[hole]
    wrong |= ~((aside <= beside[:, None]) | ~moves).all(axis=1)
    most = 2.0 * case.limits.angle_rad[hole]
    wrong |= ~((turned <= most[:, None]) | ~moves).all(axis=1)
    if wrong.any():
        why = "the tool does not go straight out along its axis"
    speed = _speeds(case, events, place, waits.position_mm[rows], count, size)
    kinds = events.kind.reshape(count, size)
    if case.program.motion is None and moves.any():
        by_joints = (kinds[:, moves] != Kind.STRAIGHT).any(axis=1)
        if by_joints.any() and not why:
            why = "the tool goes out by the joints, not straight"
        wrong |= by_joints
    found = _lanes(case, events, codes[0], depth, speed, start)
    asked = _asked(case, cycle, start)
    ends = [int(Kind.MESSAGE) * 2, int(Kind.STOP) * 2]
    told = [lane.code for lane in found]
    if told != [item.code for item in asked] + ends and not why:
        why = _difference(asked, told)
        wrong[:] = True
    elif told != [item.code for item in asked] + ends:
        wrong[:] = True
    else:
        for item, lane in zip(asked, found, strict=False):
            bad, words = _numbers(case, item, lane, hole)
            wrong |= bad
            why = words if bad.any() and not why else why
    if not one.ends:
        wrong[:] = True
        why = why or "the program goes on"
    if not wrong.any():
        return
    k = int(np.argmax(wrong))
    case.tally.fail(
        "handshake",
        f"if {case.signal(int(waits.signal[rows[k]]))} does not come in time at"
        f" {case.hole(int(hole[k]))}: {why}",
        hole=case.hole(int(hole[k])),
        file=one.file,
        line=one.line,
        span=case.wanted.process(int(hole[k])).span,
        alike=int(wrong.sum()) - 1,
    )


def _lanes(
    case: Case,
    events: Events,
    codes: Ints,
    depth_mm: Floats,
    speed_mm_s: Floats,
    start_mm: Floats,
) -> list[_Lane]:
    """What lanes (v) do in turn, without moves to where the tool is, and with moves that go on at
    the same speed put together. `codes` (size,) are the same in all lanes."""
    count, size = depth_mm.shape
    values, kinds = events.value.reshape(count, size), events.kind.reshape(count, size)
    found: list[_Lane] = []
    at = start_mm
    for k in range(size):
        if codes[k] == MOVE:
            step = depth_mm[:, k] - at
            if (np.abs(step) < _STAYS_MM).all():
                continue
            if found and found[-1].code == MOVE:
                before = found[-1]
                onward = (before.depth_mm - _last_depth(found[:-1], start_mm)) * step > 0.0
                apart = np.abs(before.speed_mm_s - speed_mm_s[:, k])
                if (onward & (apart <= SAME_SPEED * speed_mm_s[:, k])).all():
                    found.pop()
            at = depth_mm[:, k]
        elif kinds[0, k] == Kind.PAUSE and (values[:, k] == 0.0).all():
            continue
        shared = bool(kinds[0, k] == Kind.JOINTS and np.isfinite(values[0, k]))
        lane = _Lane(int(codes[k]), depth_mm[:, k], speed_mm_s[:, k], values[:, k], shared)
        found.append(lane)
    return found


def _asked(case: Case, cycle: int, start: Floats) -> list[Item]:
    """A fault's items, without moves to where the tool is."""
    kept = []
    for item in case.wanted.faults[cycle]:
        if item.code == MOVE and bool((np.abs(start - item.depth_mm) < _STAYS_MM).all()):
            continue
        kept.append(item)
    return kept


def _numbers(
    case: Case, item: Item, lane: _Lane, hole: Rows
) -> tuple[np.ndarray[tuple[int], np.dtype[np.bool_]], str]:
    if item.code == MOVE:
        deep = np.abs(lane.depth_mm - item.depth_mm)
        bad = ~(deep <= case.limits.depth_mm[hole])
        if bad.any():
            k = int(np.argmax(bad))
            return bad, (
                f"the tool goes to depth {lane.depth_mm[k]:.3f} mm, the spec asks for"
                f" {item.depth_mm:.3f} mm"
            )
        share = np.abs(lane.speed_mm_s - item.speed_mm_s) / item.speed_mm_s
        most = case.limits.speeds(np.array(item.speed_mm_s))
        bad = ~(share <= most) & (not lane.shared)
        return bad, "the tool goes out at another speed than the spec's"
    if not np.isnan(item.value):
        bad = ~(np.abs(lane.value - item.value) <= case.limits.analogs(item.value))
        return bad, f"{item.what} is asked for"
    return np.zeros(len(hole), dtype=np.bool_), ""


def _difference(asked: list[Item], found: list[int]) -> str:
    """The first thing that is not as it should be."""
    names = [item.what for item in asked] + ["a message to the operator", "the end of the program"]
    codes = [item.code for item in asked] + [int(Kind.MESSAGE) * 2, int(Kind.STOP) * 2]
    missing = [name for name, code in zip(names, codes, strict=True) if code not in found]
    if missing:
        return f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
    if [code for code in found if code in codes] == codes:
        return "something is done that the spec does not ask for"
    return f"the steps are done in another order than {', '.join(names)}"


def _along(
    case: Case, place: Places, events: Events, hole: Rows, size: int
) -> tuple[Floats, Floats]:
    """Depth, distance from the hole's axis, both (v, size)."""
    wanted = case.wanted
    there = place.position_mm.reshape(len(hole), size, 3) - wanted.position_mm[hole][:, None]
    feed = wanted.axis[hole]
    depth = np.einsum("vsj,vj->vs", there, feed)
    rest = there - depth[:, :, None] * feed[:, None]
    return depth, np.sqrt(np.einsum("vsj,vsj->vs", rest, rest))


def _turned(case: Case, place: Places, hole: Rows, size: int) -> Floats:
    """How far the tool is turned away from the plan (v, size)."""
    planned = case.program.part_from_tool[hole]
    apart = place.rotation.reshape(len(hole), size, 3, 3) - planned[:, None]
    return np.asarray(np.sqrt(0.5 * np.einsum("vsij,vsij->vs", apart, apart)))


def _speeds(
    case: Case, events: Events, place: Places, start_mm: Floats, count: int, size: int
) -> Floats:
    speed = events.speed_mm_s.reshape(count, size)
    if not case.by_joints:
        return speed
    position = place.position_mm.reshape(count, size, 3).copy()
    seconds = events.value.reshape(count, size)
    moved = np.full((count, size), np.nan)
    at = start_mm
    for k in range(size):
        if events.kind[k] in (Kind.STRAIGHT, Kind.JOINTS):
            moved[:, k] = length(position[:, k] - at)
            at = position[:, k]
    straight = events.kind.reshape(count, size) == Kind.STRAIGHT
    with np.errstate(divide="ignore", invalid="ignore"):
        told = np.where(straight, moved / seconds, np.nan)
    return np.where(np.isnan(told), speed, told)


def _last_depth(lanes: list[_Lane], start: Floats) -> Floats:
    return next((lane.depth_mm for lane in reversed(lanes) if lane.code == MOVE), start)


def _unknown_start(case: Case, one: Alternative) -> None:
    """Where the program asks where the machine stands: what happens then is that the feed's joint
    alone goes out of reach of every hole, and no more."""
    motion = case.program.motion
    case.tally.compared("ways", 1)
    joints = case.machine.joints(one.events)
    moves = placed_of(one.events.kind)
    good = motion is not None and len(moves) > 0 and bool(moves.all())
    if motion is not None and good:
        others = np.arange(joints.shape[1]) != motion.feed_axis
        apart = np.abs(np.diff(joints[:, others], axis=0)) if len(joints) > 1 else np.zeros(0)
        good = not bool((apart > 1e-7).any())
        away = motion.feed_sign * joints[:, motion.feed_axis] - clear_reach_mm(case)
        good &= bool((np.abs(away) <= case.precision.joint_mm + NOISE_MM).all())
        good &= bool(travel_speeds_fit(case, one.events.speed_mm_s).all())
    if not good:
        case.tally.fail(
            "ways",
            "what is done here depends on where the machine stands, and is not to withdraw"
            " the tool as far as for any hole",
            file=one.file,
            line=one.line,
        )

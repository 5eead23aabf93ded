"""What the tool does between the holes: nothing but the ways that were planned.

A program in poses goes straight from standoff to standoff; an arm by its vias; a portal moves its
other joints only where the feed is withdrawn as far as the plan says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drillc.kernels.rotations import angle_between
from drillc.language.source import Span

from .case import NOISE_MM, NOISE_RAD, TRAVEL_CHORD_MM, Case, half_digit
from .events import Floats, Kind
from .expected import SAME_MM
from .steps import described
from .verdict import Rows
from .visits import Path

#: Joints that are printed alike may differ by what doubles make of them, in degrees or mm.
_SAME_JOINT = 1e-7


@dataclass(frozen=True, eq=False)
class Legs:
    """What is between m cores, and after the last: leg i is the events `start[i]` … `stop[i]`, of
    which the last is the arrival at the core of visit i (at the end there is none). `hole` (m,) is
    that visit's, n at the end. Event `start[i] - 1` is where the tool was before, if `known`."""

    start: Rows
    stop: Rows
    hole: Rows
    known: bool

    def __len__(self) -> int:
        return len(self.start)


def check_ways(case: Case, path: Path, legs: Legs) -> bool:
    """All legs of a stretch of path. Returns whether joints move before it is known where the
    feed's joint is: then the program has to see to that."""
    if not len(legs):
        return False
    case.tally.compared("ways", len(legs))
    if case.program.motion is not None:
        return _portal(case, path, legs)
    plain = _plain(case, path, legs)
    for leg in np.flatnonzero(~plain).tolist():
        if case.program.arm is not None:
            _by_vias(case, path, legs, leg)
        else:
            _by_poses(case, path, legs, leg)
    return False


def _plain(case: Case, path: Path, legs: Legs) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """Which legs are one straight move from standoff to standoff, where that is what is planned."""
    n = len(case.wanted)
    inner = legs.hole < n
    last = np.maximum(legs.stop - 1, 0)
    one = (legs.stop - legs.start == 1) & (path.events.kind[last] == Kind.STRAIGHT)
    begins = np.zeros(len(legs), dtype=np.bool_)
    begins[0] = not legs.known
    plain = inner & one & ~begins
    arm = case.program.arm
    if arm is None:
        file = path.events.call_file
        same = file[np.maximum(path.before[last], 0)] == file[last]
        starts = np.append(case.wanted.section_start, True)[legs.hole]
        return np.asarray(plain & same & ~starts)
    count = np.bincount(arm.vias.before, minlength=n + 1)[legs.hole]
    if not case.arm_by_joints:
        return np.asarray(plain & (count == 0))
    # Chords: every one ends near the straight way, and its middle too.
    plain = inner & (count == 0) & ~begins & (legs.stop > legs.start)
    which = np.flatnonzero(plain)
    if not len(which):
        return np.asarray(plain)
    sizes = (legs.stop - legs.start)[which]
    event = np.concatenate([np.arange(legs.start[i], legs.stop[i]) for i in which])
    leg = np.repeat(which, sizes)
    begin = path.places.position_mm[path.before[legs.start[leg]]]
    end = path.places.position_mm[legs.stop[leg] - 1]
    off = np.fmax(
        _off_way(path.places.position_mm[event], begin, end),
        _off_way(path.middle_mm[event], begin, end),
    )
    good = (off <= TRAVEL_CHORD_MM) & (path.events.kind[event] == Kind.STRAIGHT)
    good &= np.isfinite(path.speed_mm_s[event])
    _travel_speeds(case, path, event, legs.hole[leg])
    plain[np.unique(leg[~good])] = False
    return np.asarray(plain)


def _off_way(point: Floats, begin: Floats, end: Floats) -> Floats:
    """How far points (k, 3) are from the ways between two others."""
    way = end - begin
    length = np.maximum(np.einsum("ij,ij->i", way, way), 1e-12)
    share = np.clip(np.einsum("ij,ij->i", point - begin, way) / length, 0.0, 1.0)
    return np.asarray(np.linalg.norm(point - begin - share[:, None] * way, axis=1))


# ── a program in poses, of which no arm is known ─────────────────────────────────────────────────


def _by_poses(case: Case, path: Path, legs: Legs, leg: int) -> None:
    start, stop, hole = int(legs.start[leg]), int(legs.stop[leg]), int(legs.hole[leg])
    n, kind, place = len(case.wanted), path.events.kind, path.places.position_mm
    events = list(range(start, stop))
    first = leg == 0 and not legs.known
    end = hole == n
    file = path.events.call_file
    parts = first or end or (start > 0 and file[start - 1] != file[stop - 1])
    begins = parts or (not end and bool(case.wanted.section_start[hole]))
    home = 0
    while events and begins and kind[events[0]] == Kind.HOME:
        events.pop(0)
        home += 1
    if first or end or (parts and home):
        case.homes.append((home > 0, path, start))
    if end:
        _nothing_left(case, path, events, hole)
        return None
    if not events:
        return None
    arrival = events.pop()
    if events and begins and kind[events[-1]] == Kind.JOINTS:
        there = float(np.linalg.norm(place[events[-1]] - place[arrival]))
        turned = angle_between(path.places.rotation[events[-1]], path.places.rotation[arrival])
        if there <= 2.0 * case.limits.position_mm[hole] + NOISE_MM and float(turned) <= (
            2.0 * case.limits.angle_rad[hole]
        ):
            events.pop()
            return _nothing_left(case, path, events, hole)
    if not events and begins and kind[arrival] == Kind.STRAIGHT:
        case.fail(
            "ways",
            f"the way to {case.hole(hole)} is made straight, one by the joints is planned",
            path,
            arrival,
            hole,
        )
    if not events and kind[arrival] == Kind.JOINTS and not begins:
        case.fail(
            "ways",
            f"the way to {case.hole(hole)} is made by the joints, a straight one is planned",
            path,
            arrival,
            hole,
        )
    return _nothing_left(case, path, events, hole)


def _nothing_left(case: Case, path: Path, events: list[int], hole: int) -> None:
    """Whatever is on the way and was not planned is a failure, told once a leg."""
    place = path.places.position_mm
    for event in events:
        if np.linalg.norm(place[event] - place[path.before[event]]) < SAME_MM:
            continue
        to = "after the last hole" if hole == len(case.wanted) else f"before {case.hole(hole)}"
        at = place[event]
        where = "" if np.isnan(at).any() else f" to ({at[0]:.3f}, {at[1]:.3f}, {at[2]:.3f}) mm"
        case.fail(
            "ways",
            f"{described(case, path, None, event)}{where} {to} is not planned",
            path,
            event,
            None if hole == len(case.wanted) else hole,
            alike=len(events) - 1 - events.index(event),
        )
        return


# ── an arm's vias ────────────────────────────────────────────────────────────────────────────────


def _by_vias(case: Case, path: Path, legs: Legs, leg: int) -> None:
    """Each via is reached in turn, as it is planned; on straight ways there may be more places,
    between them."""
    arm = case.program.arm
    assert arm is not None
    start, stop, hole = int(legs.start[leg]), int(legs.stop[leg]), int(legs.hole[leg])
    vias, n = arm.vias, len(case.wanted)
    due = list(range(*np.searchsorted(vias.before, [hole, hole + 1]).tolist()))
    events = [e for e in range(start, stop) if path.moves[e]]
    kind, place = path.events.kind, path.places
    home = arm.arm.home_rad
    first = leg == 0 and not legs.known
    if first and events:
        events = _from_home(case, path, events, due)
    at = int(path.before[start]) if start < len(path) else -1
    for via in due:
        target = vias.position_mm[via]
        by_joints = bool(vias.by_joints[via])
        where = _reached(case, path, events, via)
        if where is None:
            name = "the end" if hole == n else case.hole(hole)
            case.fail(
                "ways",
                f"the way to {name} does not pass ({target[0]:.3f}, {target[1]:.3f},"
                f" {target[2]:.3f}) mm, as is planned",
                path,
                min(max(start, stop - 1), len(path) - 1),
                None if hole == n else hole,
            )
            return
        fed = bool(np.isfinite(path.events.value[events[0]]))
        otherwise = fed if case.arm_by_joints else kind[events[0]] == Kind.STRAIGHT
        if by_joints and (where != 0 or otherwise):
            case.fail(
                "ways",
                "a move that is planned by the joints is made otherwise",
                path,
                events[0],
                None if hole == n else hole,
            )
        said = path.events.configuration[events[where]]
        by_pose = np.isnan(path.places.joints[events[where]]).any()
        if by_joints and by_pose and np.isnan(said).all():
            case.fail(
                "configuration",
                "a pose that is reached by the joints does not say how they stand",
                path,
                events[where],
            )
        if not by_joints:
            _on_way(case, path, events[: where + 1], at, target, hole)
            straight_ones = np.array(events[: where + 1])
            _travel_speeds(case, path, straight_ones, np.full(where + 1, min(hole, n - 1)))
        at = events[where]
        events = events[where + 1 :]
    if hole == n:
        ends = events and home is None and kind[events[-1]] == Kind.HOME
        _nothing_left(case, path, events[:-1] if ends else events, hole)
        return
    if events:
        _on_way(case, path, events, at, place.position_mm[events[-1]], hole)


def _from_home(case: Case, path: Path, events: list[int], due: list[int]) -> list[int]:
    """A program begins at home: by its own joints, or the controller's."""
    arm = case.program.arm
    assert arm is not None
    home, vias = arm.arm.home_rad, arm.vias
    if home is None:
        begins = path.events.kind[events[0]] == Kind.HOME
        return events[1:] if begins else events
    joints = path.places.joints[events[0]]
    at_home = np.abs(joints - home).max() <= 2.0 * case.precision.joint_rad + 1e-8
    if not at_home:
        case.fail("ways", "the program does not begin by going home", path, events[0])
        return events
    leads = due and bool(np.abs(vias.joints[due[0]] - home).max() <= 1e-9)
    return events if leads else events[1:]


def _reached(case: Case, path: Path, events: list[int], via: int) -> int | None:
    """Which of the events ends at a via."""
    arm = case.program.arm
    assert arm is not None
    vias = arm.vias
    limit = np.sqrt(3.0) * case.precision.length_mm + NOISE_MM
    angle = 3.0 * case.precision.angle_rad + 1e-8
    half = case.precision.joint_rad + 1e-8
    for k, event in enumerate(events):
        joints = path.places.joints[event]
        if np.isfinite(joints).all():
            if np.abs(joints - vias.joints[via]).max() <= half:
                return k
            if not case.arm_by_joints:
                continue
        apart = float(np.linalg.norm(path.places.position_mm[event] - vias.position_mm[via]))
        if not apart <= limit:
            continue
        turned = float(angle_between(path.places.rotation[event], vias.part_from_tool[via]))
        if turned <= angle and not (case.arm_by_joints and vias.by_joints[via]):
            return k
    return None


def _on_way(case: Case, path: Path, events: list[int], before: int, end: Floats, hole: int) -> None:
    """All places lie on the straight way from where event `before` ended to `end`."""
    place, kind = path.places.position_mm, path.events.kind
    if before < 0 or np.isnan(place[before]).any():
        return
    n = len(case.wanted)
    rows = np.array(events)
    begin, ends = np.tile(place[before], (len(rows), 1)), np.tile(end, (len(rows), 1))
    off = np.fmax(_off_way(place[rows], begin, ends), _off_way(path.middle_mm[rows], begin, ends))
    limit = TRAVEL_CHORD_MM if case.arm_by_joints else 2.0 * NOISE_MM + case.precision.length_mm * 2
    straight = (kind[rows] == Kind.STRAIGHT) & np.isfinite(path.speed_mm_s[rows])
    bad = np.flatnonzero(~((off <= limit) & straight))
    short = np.linalg.norm(end - place[before]) < SAME_MM
    if len(bad) and not (short and straight.all()):
        event = int(rows[bad[0]])
        how = f"{off[bad[0]]:.3f} mm beside it" if straight[bad[0]] else "by the joints"
        case.fail(
            "ways",
            f"the straight way to {'the end' if hole == n else case.hole(hole)} is made {how}",
            path,
            event,
            None if hole == n else hole,
            alike=len(bad) - 1,
        )


# ── a portal ─────────────────────────────────────────────────────────────────────────────────────


def _portal(case: Case, path: Path, legs: Legs) -> bool:
    """Other joints move only while the feed is out as far as planned; the feed alone moves only
    where it is out of the hole, which the cores see to."""
    motion = case.program.motion
    assert motion is not None
    n = len(case.wanted)
    sizes = legs.stop - legs.start
    event = np.concatenate([np.arange(a, b) for a, b in zip(legs.start, legs.stop, strict=True)])
    hole = np.repeat(legs.hole, sizes)
    keep = path.moves[event]
    event, hole = event[keep], hole[keep]
    joints = path.places.joints
    home = path.events.kind[event] == Kind.HOME
    others = np.arange(joints.shape[1]) != motion.feed_axis
    before = np.maximum(path.before[event], 0)
    fresh = path.before[event] < 0
    at, was = joints[event], joints[before]
    shift = np.abs(at - was)[:, others]
    moved = fresh | ~(shift <= _SAME_JOINT).all(axis=1)
    withdraw = np.append(motion.withdraw_mm, np.nan)[hole] * motion.feed_sign
    slack = case.precision.joint_mm + NOISE_MM
    feed = motion.feed_sign * joints[:, motion.feed_axis]
    starts = fresh | np.isnan(feed[before])
    far = (feed[event] <= withdraw + slack) & (starts | (feed[before] <= withdraw + slack))
    # Nobody knows where the feed is before it first moves: then the program has to ask.
    unknown = np.isnan(feed[event]) & starts & ~home
    alone = fresh & ~np.isfinite(at[:, others]).any(axis=1)
    last = np.minimum(hole, n - 1)
    planned = motion.joints[last][:, others]
    there = (np.abs(at[:, others] - planned) <= half_digit(case)[others] + NOISE_RAD).all(axis=1)
    astray = moved & ~home & ~alone & ~((hole < n) & there)
    for k in np.flatnonzero(astray).tolist():
        name = "the end" if hole[k] == n else case.hole(int(hole[k]))
        row = None if hole[k] == n else int(hole[k])
        message = f"on the way to {name} joints go where they are not planned to"
        case.fail("ways", message, path, int(event[k]), row)
    # Where several joints move, only what the program states itself is a speed of the tool.
    alone_or_told = ~home & (~moved | np.isfinite(path.events.speed_mm_s[event]) & ~fresh)
    _travel_speeds(case, path, event[alone_or_told], last[alone_or_told])
    bad = np.flatnonzero(moved & ~far & ~unknown & ~home & ~alone)
    for k in bad.tolist():
        row = int(hole[k])
        name = "the end" if row == n else case.hole(row)
        reach = motion.feed_sign * (withdraw[k] if row < n else np.nan)
        case.fail(
            "ways",
            f"on the way to {name} other joints move while"
            f" {motion.axes[motion.feed_axis].name} is at"
            f" {np.nanmax([feed[event[k]], feed[before[k]]]) * motion.feed_sign:.3f} mm; it is to"
            f" withdraw to {reach:.3f} mm first",
            path,
            int(event[k]),
            None if row == n else row,
        )
    return bool(unknown.any())


def _travel_speeds(case: Case, path: Path, event: Rows, hole: Rows) -> None:
    """On straight ways the tool is as fast as some process of the program travels; an arm that goes
    by its joints may be slower. Speeds that are not stated are not judged here."""
    found = path.speed_mm_s[event]
    asked = np.array([cycle.process.travel_mm_s for cycle in case.program.cycles])
    before = np.maximum(path.before[event], 0)
    way = path.places.position_mm[event] - path.places.position_mm[before]
    told = np.isfinite(found) & ~(np.linalg.norm(way, axis=1) < SAME_MM)
    event, hole, found = event[told], hole[told], found[told]
    if not len(event):
        return
    apart = found[:, None] / asked - 1.0
    if case.arm_by_joints:
        apart = np.maximum(apart, 0.0)
    error = np.abs(apart).min(axis=1)
    limit = case.limits.speed_share + path.speed_slack[event]

    def say(k: int) -> tuple[str, Span | None]:
        process = case.wanted.process(int(hole[k]))
        return (
            f"the way to or from {case.hole(int(hole[k]))} is made with {found[k]:g} mm/s, the spec"
            f" asks for {process.travel_mm_s:g} mm/s",
            process.span,
        )

    case.figures("speed", error, limit, path, event, hole, say)


def check_homes(case: Case) -> None:
    """A program in poses whose parts go home does so before each part and after it."""
    if any(home for home, _, _ in case.homes):
        for home, path, event in case.homes:
            if not home:
                message = "the program goes home elsewhere, but not here"
                case.fail("ways", message, path, min(event, len(path) - 1))

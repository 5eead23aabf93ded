"""What the tool does between the holes: nothing but the ways that were planned.

A program in poses goes straight from standoff to standoff; an arm by its vias; a portal moves its
other joints only where the feed is withdrawn as far as the plan says.
"""

from __future__ import annotations

import numpy as np

from drillc.kernels.rotations import angle_between

from .case import CHORD_MM, NOISE_MM, NOISE_RAD, TRAVEL_CHORD_MM, Case
from .events import Floats, Kind
from .expected import SAME_MM
from .steps import described
from .travels import Legs, check_travel_speeds
from .vectors import dot, length
from .verdict import Rows
from .visits import Bools, Path
from .withdrawals import check_withdrawals


def check_ways(case: Case, path: Path, legs: Legs, questions: Rows) -> None:
    """All legs of a stretch of path. `questions`: how many of its moves came before the program
    asked, each time, where the machine stands."""
    if not len(legs):
        return
    case.tally.compared("ways", len(legs))
    if case.program.motion is not None:
        check_withdrawals(case, path, legs, questions)
        return
    plain = _plain(case, path, legs)
    for leg in np.flatnonzero(~plain).tolist():
        if case.program.arm is not None:
            _by_vias(case, path, legs, leg)
        else:
            _by_poses(case, path, legs, leg)


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
    _, fits = _on_line(case, path, event, begin, end, legs.hole[leg])
    good = fits & (path.events.kind[event] == Kind.STRAIGHT) & np.isfinite(path.speed_mm_s[event])
    check_travel_speeds(case, path, event, legs.hole[leg])
    plain[np.unique(leg[~good])] = False
    return np.asarray(plain)


def _off_way(point: Floats, begin: Floats, end: Floats) -> Floats:
    """How far points (k, 3) are from the ways between two others."""
    way = end - begin
    share = np.clip(dot(point - begin, way) / np.maximum(dot(way, way), 1e-12), 0.0, 1.0)
    return length(point - begin - share[:, None] * way)


def _on_line(
    case: Case, path: Path, event: Rows, begin: Floats, end: Floats, hole: Rows
) -> tuple[Floats, Bools]:
    """How far events end (k,), or are on their way, from the straight ways between two places
    (k, 3) each, and which of them are no farther than they may be."""
    off = _off_way(path.places.position_mm[event], begin, end)
    if not case.arm_by_joints:
        return off, off <= 2.0 * (NOISE_MM + case.precision.length_mm)
    bulge = _off_way(path.middle_mm[event], begin, end)
    rounded = 2.0 * (case.limits.position_mm[np.minimum(hole, len(case.wanted) - 1)] - CHORD_MM)
    return np.fmax(off, bulge), (off <= rounded) & ~(bulge > TRAVEL_CHORD_MM)


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
        here = np.array([min(start, len(path) - 1)])
        case.homes.append((home > 0, path.take(here)))
    if end:
        _nothing_left(case, path, events, hole)
        return None
    if not events:
        return None
    arrival = events.pop()
    check_travel_speeds(case, path, np.array(events, dtype=np.intp), np.full(len(events), hole))
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
        rows = np.array(events[: where + 1])
        check_travel_speeds(case, path, rows, np.full(where + 1, min(hole, n - 1)))
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
    at_home = np.abs(joints - home).max() <= case.precision.joint_rad + NOISE_RAD
    if not at_home:
        case.fail("ways", "the program does not begin by going home", path, events[0])
        return events
    check_travel_speeds(case, path, np.array(events[:1]), np.array([0]))
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
    off, fits = _on_line(case, path, rows, begin, ends, np.full(len(rows), hole))
    straight = (kind[rows] == Kind.STRAIGHT) & np.isfinite(path.speed_mm_s[rows])
    bad = np.flatnonzero(~(fits & straight))
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


def check_homes(case: Case) -> None:
    """A program in poses whose parts go home does so before each part and after it."""
    if any(home for home, _ in case.homes):
        for home, path in case.homes:
            if not home:
                case.fail("ways", "the program goes home elsewhere, but not here", path, 0)

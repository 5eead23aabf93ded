"""A portal between the holes: the feed is withdrawn, and then the other joints move."""

from __future__ import annotations

import numpy as np

from .case import NOISE_MM, NOISE_RAD, Case, half_digit
from .events import Floats, Kind
from .travels import Legs, check_travel_speeds
from .verdict import Rows
from .visits import Bools, Path

#: Joints that are printed alike may differ by what doubles make of them, in degrees or mm.
_SAME_JOINT = 1e-7


def clear_reach_mm(case: Case) -> float:
    """Where the feed's joint, counted into the part, is clear of every hole: as far out as any
    withdrawal, and as any hole is left."""
    motion = case.program.motion
    assert motion is not None
    feed = motion.joints[:, motion.feed_axis]
    ends = motion.feed_sign * feed + case.wanted.exit_mm
    out = motion.feed_sign * motion.withdraw_mm
    return float(min(out.min(initial=np.inf), ends.min(initial=np.inf)))


def check_withdrawals(case: Case, path: Path, legs: Legs, questions: Rows) -> None:
    """Other joints move only while the feed is withdrawn as planned; the feed alone moves only
    where it is out of the hole, which the cores see to, and to no other place."""
    motion = case.program.motion
    assert motion is not None
    n = len(case.wanted)
    sizes = legs.stop - legs.start
    event = np.concatenate([np.arange(a, b) for a, b in zip(legs.start, legs.stop, strict=True)])
    leg = np.repeat(np.arange(len(legs)), sizes)
    keep = path.moves[event]
    event, leg = event[keep], leg[keep]
    hole = legs.hole[leg]
    joints = path.places.joints
    home = path.events.kind[event] == Kind.HOME
    others = np.arange(joints.shape[1]) != motion.feed_axis
    before = np.maximum(path.before[event], 0)
    fresh = path.before[event] < 0
    at, was = joints[event], np.where(fresh[:, None], np.nan, joints[before])
    alone = ~home & ~np.isfinite(at[:, others]).any(axis=1)
    moved = ~home & ~alone & ~(np.abs(at - was)[:, others] <= _SAME_JOINT).all(axis=1)
    last = np.minimum(hole, n - 1)
    planned = motion.joints[last][:, others]
    there = (np.abs(at[:, others] - planned) <= half_digit(case)[others] + NOISE_RAD).all(axis=1)
    astray = moved & ~((hole < n) & there)
    for k in np.flatnonzero(astray).tolist():
        what = "joints go where they are not planned to"
        _tell(case, path, int(event[k]), int(hole[k]), what)

    slack = case.precision.joint_mm + NOISE_MM
    withdraw = np.append(motion.feed_sign * motion.withdraw_mm, np.nan)[hole]
    clear = np.where(_between_parts(case, path, legs)[leg], clear_reach_mm(case), np.nan)
    reach, from_mm = (motion.feed_sign * q[:, motion.feed_axis] for q in (at, was))

    def out(where: Floats) -> Bools:
        away = np.fmin(np.abs(where - withdraw), np.abs(where - clear))
        return np.asarray(away <= slack)

    # Nobody knows where the feed is before it first moves: then the program has to ask.
    unknown = np.isnan(from_mm) & (home | (moved & np.isnan(reach)))
    asked = _asked(path, event, questions)
    free = np.where(home, from_mm <= clear + slack, out(reach) & out(from_mm))
    bad = (home | moved) & ~free & ~(unknown & asked)
    _tell_moved(case, path, event, hole, bad, from_mm, reach)
    arrives = (event == legs.stop[leg] - 1) & (hole < n)
    stays = np.abs(reach - from_mm) <= _SAME_JOINT
    odd = ~bad & ~arrives & ~home & ~np.isnan(reach) & ~stays & ~out(reach)
    for k in np.flatnonzero(odd).tolist():
        where = f"{motion.axes[motion.feed_axis].name} goes to {motion.feed_sign * reach[k]:.3f} mm"
        first = f"it is to withdraw to {_withdrawal_mm(case, int(hole[k])):.3f} mm"
        _tell(case, path, int(event[k]), int(hole[k]), f"{where}; {first}")
    # Where several joints move, only what the program states itself is a speed of the tool.
    told = ~home & (~moved | np.isfinite(path.events.speed_mm_s[event]))
    check_travel_speeds(case, path, event[told], last[told])


def _tell(case: Case, path: Path, event: int, hole: int, what: str) -> None:
    """A failure of `ways`, on the way to a hole or, if there is none, to the end."""
    row = hole if hole < len(case.wanted) else None
    name = "the end" if row is None else case.hole(row)
    case.fail("ways", f"on the way to {name} {what}", path, event, row)


def _tell_moved(
    case: Case, path: Path, event: Rows, hole: Rows, bad: Bools, from_mm: Floats, reach: Floats
) -> None:
    """Where other joints move and the feed is not withdrawn as it should be."""
    motion = case.program.motion
    assert motion is not None
    axis = motion.axes[motion.feed_axis].name
    for k in np.flatnonzero(bad).tolist():
        places = [place for place in (from_mm[k], reach[k]) if not np.isnan(place)]
        where = f"at {motion.feed_sign * max(places):.3f} mm" if places else "anywhere"
        first = f"it is to withdraw to {_withdrawal_mm(case, int(hole[k])):.3f} mm first"
        what = f"other joints move while {axis} is {where}; {first}"
        _tell(case, path, int(event[k]), int(hole[k]), what)


def _withdrawal_mm(case: Case, hole: int) -> float:
    """Where the feed's joint is to be on the way to a hole, or to the end."""
    motion = case.program.motion
    assert motion is not None
    if hole < len(case.wanted):
        return float(motion.withdraw_mm[hole])
    return motion.feed_sign * clear_reach_mm(case)


def _between_parts(case: Case, path: Path, legs: Legs) -> Bools:
    """Which legs begin or end a program, or lead from one of its files to the next: there it may
    withdraw as far as for any hole."""
    file = path.events.call_file
    if not len(file):
        return np.zeros(len(legs), dtype=np.bool_)
    first = file[np.clip(legs.start - 1, 0, len(file) - 1)]
    last = file[np.clip(legs.stop - 1, 0, len(file) - 1)]
    begins = (np.arange(len(legs)) == 0) & (not legs.known)
    return np.asarray(begins | (first != last) | (legs.hole == len(case.wanted)))


def _asked(path: Path, event: Rows, questions: Rows) -> Bools:
    """Before which events the program has asked where the machine stands, since it was last at a
    home that it does not know."""
    moves = np.cumsum(path.moves)
    home = np.where(path.events.kind == Kind.HOME, moves, 0)
    before = np.maximum(event - 1, 0)
    so_far = np.where(event > 0, moves[before], 0)
    since = np.where(event > 0, np.maximum.accumulate(home)[before], 0)
    asked = np.sort(questions)
    latest = np.searchsorted(asked, so_far, side="right") - 1
    found = np.append(asked, -1)[latest]  # of none before: the last, -1
    return np.asarray((latest >= 0) & (found >= since))

"""Whether two texts do the same when they run: decided on events, not on letters."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise

import numpy as np

from drillc.verification.events import (
    Alternative,
    Events,
    Floats,
    Kind,
    ToolFrame,
    joined,
    no_events,
)
from drillc.verification.reading import Precision, Reader, ReadError, Run

from .emitting import Case, Files

#: Numbers that differ by no more than this many half digits are one: a proof cannot tell.
_HALF_DIGITS = 8.0
#: What a proof allows times (s), and floating point a speed or a value (a share).
_TIME_S, _NOISE_SHARE = 2e-3, 1e-7
#: How long a straight move in joints takes is its speed, and how its ends are printed.
_TIME_SHARE = 1e-3
#: Moves in one direction whose speeds differ by no larger share are one move.
_SAME_SPEED = 0.01
#: An arm that is told its joints goes straight in small steps, which are that exact (deg), and some
#: of them slower than asked for.
_CHORD_DEG = 0.1
_MOVES = (Kind.STRAIGHT, Kind.JOINTS)


@dataclass(frozen=True, eq=False)
class _Event:
    """One event, without where it stands: what it is, by name, and its numbers. `free`: a free move
    and a straight one to the same place, of which either may be left out."""

    kind: Kind
    names: tuple[str | None, ...]  # signal, tool, base
    place: Floats  # position and joints; NaN where not given
    turn: Floats  # rotation and configuration
    frames_mm: Floats  # where tool and base are, as far as the program says
    frames: Floats  # and their rotations
    speed_mm_s: float
    value: float
    timeout_s: float
    free: bool = False


def does_the_same(case: Case, one: Files, two: Files) -> bool:
    """Whether all programs in two sets of files do the same, as far as their numbers are printed
    and the spec has a say in it; not, if one cannot be read."""
    arm = any(program.arm is not None for program in case.plan.programs)
    try:
        mine, other = _programs(case.reader, one, arm), _programs(case.reader, two, arm)
    except ReadError:
        return False
    precision = case.reader.precision
    return len(mine) == len(other) and all(
        _alike(a, b, precision, arm) for a, b in zip(mine, other, strict=True)
    )


def _programs(reader: Reader, files: Files, arm: bool) -> list[list[_Event]]:
    """Of each program the main run, and all that may happen instead, one after another."""
    told = []
    for run in reader.read(files):
        steps = list(run.steps())
        main = [step for step in steps if isinstance(step, Events)]
        whole = joined(main) if main else no_events(len(run.axes))
        events = _events(run, whole, arm)
        waits = _waits(whole, events)
        instead: list[tuple[int, list[_Event]]] = []
        for step in steps:
            if isinstance(step, Alternative):
                other = _events(run, step.events, arm)
                for lane, (a, b) in enumerate(pairwise(step.starts.tolist())):
                    body = int(step.call_file[lane]), int(step.call_line[lane])
                    at, begun = waits.get((step.file, step.line, *body), (-1, []))
                    instead.append((at, _normal([*begun, *other[a:b]])))
        told.append(_normal(events))
        told += [one for _, one in sorted(instead, key=lambda pair: pair[0])]
    return told


def _waits(
    events: Events, told: Sequence[_Event]
) -> dict[tuple[int, ...], tuple[int, list[_Event]]]:
    """Each wait by where it and its statement of the body stand: which one it is, and the last move
    before it."""
    last: list[_Event] = []
    found: dict[tuple[int, ...], tuple[int, list[_Event]]] = {}
    places = zip(events.file, events.line, events.call_file, events.call_line, strict=True)
    for event, place in zip(told, places, strict=True):
        if event.kind in _MOVES:
            last = [replace(event, kind=Kind.STRAIGHT, speed_mm_s=np.nan, value=np.nan)]
        elif event.kind == Kind.WAIT:
            found.setdefault(tuple(map(int, place)), (len(found), last))
    return found


def _events(run: Run, events: Events, arm: bool) -> list[_Event]:
    """Where no `arm` is known, its posture is the controller's own business."""
    signals = {number: name for name, number in run.signals.items()}
    place = np.concatenate([events.position_mm, events.joints], axis=1)
    turn = events.rotation.reshape(-1, 9)
    if arm:
        turn = np.concatenate([turn, events.configuration], axis=1)
    told = []
    for i in range(len(events)):
        tool, base = (_frame(run, int(number)) for number in (events.tool[i], events.base[i]))
        told.append(
            _Event(
                Kind(int(events.kind[i])),
                (signals.get(int(events.signal[i])), tool.name, base.name),
                place[i],
                turn[i],
                np.concatenate([_numbers(f.position_mm, 3) for f in (tool, base)]),
                np.concatenate([_numbers(f.rotation, 9) for f in (tool, base)]),
                float(events.speed_mm_s[i]),
                float(events.value[i]),
                float(events.timeout_s[i]),
            )
        )
    return told


def _frame(run: Run, number: int) -> ToolFrame:
    return run.frames[number] if number >= 0 else ToolFrame("")


def _numbers(values: Floats | None, count: int) -> Floats:
    return np.full(count, np.nan) if values is None else values.ravel()


def _normal(events: Sequence[_Event]) -> list[_Event]:
    """Without moves to where the tool is, pauses of no length, stops on the way of a straight line
    that goes on at the same speed, and ways to a home of which the spec knows nothing."""
    kept: list[_Event] = []
    for event in events:
        moves = [*islice((e for e in reversed(kept) if e.kind in _MOVES), 2)][::-1]
        if event.kind == Kind.HOME or (event.kind == Kind.PAUSE and event.value == 0.0):
            continue
        if event.kind in _MOVES and moves and _same_place(moves[-1], event):
            if kept[-1].kind == Kind.JOINTS and event.kind == Kind.STRAIGHT:
                kept[-1] = replace(event, free=True)
            continue
        if len(moves) > 1 and kept[-1] is moves[-1] and _goes_on(moves[0], moves[1], event):
            kept.pop()
        kept.append(event)
    return kept


def _same_place(one: _Event, two: _Event) -> bool:
    return _near(one.place, two.place, 1e-4) and _near(one.turn, two.turn, 1e-7)


def _goes_on(first: _Event, second: _Event, third: _Event) -> bool:
    if not (first.kind in _MOVES and second.kind == third.kind == Kind.STRAIGHT):
        return False
    one, two = second.place - first.place, third.place - second.place
    known = np.isfinite(one) & np.isfinite(two)
    one, two = one[known], two[known]
    lengths = float(np.linalg.norm(one)), float(np.linalg.norm(two))
    if not known.any() or 0.0 in lengths or not _near(second.turn, third.turn, 1e-7):
        return False
    straight = np.linalg.norm(one / lengths[0] - two / lengths[1]) < 1e-4
    return bool(straight) and (
        _close(second.speed_mm_s, third.speed_mm_s, _SAME_SPEED, 0.0)
        and _close(second.value / lengths[0], third.value / lengths[1], _SAME_SPEED, 0.0)
    )


def _alike(one: Sequence[_Event], two: Sequence[_Event], precision: Precision, arm: bool) -> bool:
    return len(one) == len(two) and all(
        _same(a, b, precision, arm) for a, b in zip(one, two, strict=True)
    )


def _same(one: _Event, two: _Event, precision: Precision, arm: bool) -> bool:
    either = (one.free or two.free) and one.kind in _MOVES and two.kind in _MOVES
    if one.names != two.names or (one.kind != two.kind and not either):
        return False
    joints = max(precision.joint_mm, float(np.degrees(precision.joint_rad)))
    length = _HALF_DIGITS * precision.length_mm
    angle = _HALF_DIGITS * precision.angle_rad + 1e-7
    share = _HALF_DIGITS * precision.speed_share + _NOISE_SHARE
    speed, analog = _HALF_DIGITS * precision.speed_mm_s, _HALF_DIGITS * precision.analog
    if arm and one.kind == Kind.STRAIGHT and np.isnan(one.place[0]):
        joints, share = _CHORD_DEG, np.inf
    else:
        joints *= _HALF_DIGITS
    values: dict[Kind, Callable[[], bool]] = {
        Kind.JOINTS: lambda: True,  # how fast a free move is, no spec says
        Kind.ANALOG: lambda: _close(one.value, two.value, _NOISE_SHARE, analog),
        Kind.PAUSE: lambda: _close(one.value, two.value, 0.0, _TIME_S),
        Kind.STRAIGHT: lambda: _close(one.value, two.value, share + _TIME_SHARE, 0.0),
    }
    return (
        _near(one.place[:3], two.place[:3], length)
        and _near(one.frames_mm, two.frames_mm, length)
        and _near(one.frames, two.frames, angle)
        and _near(one.place[3:], two.place[3:], joints)
        and _near(one.turn, two.turn, angle)
        and (one.kind != two.kind or _close(one.speed_mm_s, two.speed_mm_s, share, speed))
        and _close(one.timeout_s, two.timeout_s, 0.0, _TIME_S)
        and values.get(one.kind, lambda: _close(one.value, two.value, 1e-3, 0.0))()
    )


def _near(one: Floats, two: Floats, within: float) -> bool:
    return bool(np.allclose(one, two, rtol=0.0, atol=within, equal_nan=True))


def _close(one: float, two: float, share: float, least: float) -> bool:
    both_nan = one != one and two != two
    return both_nan or one == two or abs(one - two) <= share * abs(one) + least

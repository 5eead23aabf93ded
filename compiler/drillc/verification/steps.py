"""What is done at each hole, step by step: the order, and the depths, speeds, values and times."""

from __future__ import annotations

from difflib import SequenceMatcher

import numpy as np

from drillc.language.source import Span

from .case import NOISE_MM, TIME_S, Case
from .checks import Made
from .events import Floats, Kind
from .expected import MOVE, SAME_MM, Item, Template
from .vectors import largest
from .verdict import Rows
from .visits import Items, Path, items_of

#: Pecks that differ by less are alike.
PECK_MM = 5e-3
#: The speed of a spindle that the language has a word for.
SPINDLE_SHARE = 1e-6


def check_steps(case: Case, path: Path, made: Made) -> None:
    """Compare every visit with its hole's template. One that has other steps is explained, unless
    all that it does otherwise is to make one move in several, or several in one."""
    case.tally.compared("process", len(made))
    of_template = case.wanted.template[made.hole]
    for number in np.unique(of_template):
        template = case.wanted.templates[int(number)]
        left = np.flatnonzero(of_template == number)
        if not case.arm_by_joints:
            left = _compare(case, path, made, made.items, template, left)
        if not len(left):
            continue
        assert template.together is not None
        together = items_of(path, made.cores, made.depth_mm, together=True)
        left = _compare(case, path, made, together, template.together, left)
        if len(left) and case.arm_by_joints:
            _explain_all(case, path, made, together, template.together, left)
        elif len(left):
            _explain_all(case, path, made, made.items, template, left)


def _compare(
    case: Case, path: Path, made: Made, items: Items, template: Template, visits: Rows
) -> Rows:
    """Those visits that have the right steps: their numbers. Returns the others."""
    fits = np.diff(items.first)[visits] == len(template.items)
    table = items.first[visits[fits]][:, None] + np.arange(len(template.items))
    good = (path.codes[items.event[table]] == template.codes).all(axis=1)
    same = np.flatnonzero(fits)[good]
    if len(same):
        _numbers(case, path, made, items, template, visits[same], items.event[table[good]])
    return np.delete(visits, same)


def _numbers(
    case: Case,
    path: Path,
    made: Made,
    items: Items,
    template: Template,
    visits: Rows,
    event: Rows,
) -> None:
    """`event` (v, t): the events of the visits' items."""
    hole = made.hole[visits]
    wanted_mm = template.column("depth_mm") + np.where(
        template.column("from_bottom") > 0, case.wanted.bottom_mm[hole, None], 0.0
    )
    for column, item in enumerate(template.items):
        at = event[:, column]
        kind = int(path.events.kind[at[0]])
        if item.code == MOVE:
            asked = wanted_mm[:, column]
            found = made.depth_mm[at]
            check = "standoffs" if item.part == "standoffs" else "depth"
            _depths(case, path, at, hole, item, found, asked, check)
            _digits(case, path, at, hole, found, asked)
        elif kind == Kind.WAIT:
            _waits(case, path, at, hole, item)
        elif kind in (Kind.ANALOG, Kind.PAUSE, Kind.SPINDLE):
            _values(case, path, at, hole, item, kind)
        if item.code != MOVE and kind != Kind.WAIT:
            case.tally.compared("signals", len(at))
    _speeds(case, path, made, items, template, visits)


def _digits(case: Case, path: Path, at: Rows, hole: Rows, found: Floats, asked: Floats) -> None:
    """No coordinate, and no feed's joint, is off by more than half of its last digit. What is off
    by much more is told as position or depth."""
    motion, precision = case.program.motion, case.precision
    if case.arm_by_joints:
        return
    if motion is None:
        there = case.wanted.position_mm[hole] + asked[:, None] * path.places.axis[at]
        error = largest(path.places.position_mm[at] - there)
        half = precision.length_mm
    else:
        feed = motion.feed_axis
        there = motion.joints[hole, feed] + motion.feed_sign * asked
        error = np.abs(path.places.joints[at, feed] - there)
        half = precision.joint_mm
    decimals = round(-np.log10(2.0 * half))
    limit = half + np.abs(asked - np.round(asked, decimals)) + NOISE_MM
    wide = case.limits.depth_mm[hole] + case.limits.position_mm[hole]
    bad = np.flatnonzero((error > limit) & (error <= wide))
    if len(bad):
        case.figures(
            "position",
            np.full(len(bad), np.inf),
            1.0,
            path,
            at[bad],
            hole[bad],
            lambda k: (
                f"{case.hole(int(hole[bad[k]]))} is off by {error[bad[k]]:.4f} mm in one"
                " coordinate, more than rounding makes",
                None,
            ),
            body=True,
        )


def _depths(
    case: Case,
    path: Path,
    at: Rows,
    hole: Rows,
    item: Item,
    found: Floats,
    asked: Floats,
    check: str,
) -> None:
    def say(k: int) -> tuple[str, Span | None]:
        process = case.wanted.process(int(hole[k]))
        name = case.hole(int(hole[k]))
        span = process.span
        match item.what:
            case "the bottom":
                text = f"{name} is made {found[k]:.3f} mm deep, the spec asks for {asked[k]:.3f} mm"
            case "a peck":
                text = (
                    f"a peck at {name} goes to {found[k]:.3f} mm, the spec asks for"
                    f" {asked[k]:.3f} mm"
                )
            case _:
                text = (
                    f"{item.what} at {name} ends at depth {found[k]:.3f} mm, the spec asks for"
                    f" {asked[k]:.3f} mm"
                )
        return text, span

    error = np.abs(found - asked)
    case.figures(check, error, case.limits.depth_mm[hole], path, at, hole, say)


def _waits(case: Case, path: Path, at: Rows, hole: Rows, item: Item) -> None:
    found = path.events.timeout_s[at]

    def say(k: int) -> tuple[str, Span | None]:
        time = "for ever" if not np.isfinite(found[k]) else f"for {found[k]:g} s"
        process = case.wanted.process(int(hole[k]))
        return (
            f"{item.what} at {case.hole(int(hole[k]))} lasts {time}, the spec asks for"
            f" {item.timeout_s:g} s",
            process.span,
        )

    case.figures("handshake", np.abs(found - item.timeout_s), TIME_S, path, at, hole, say)


def _values(case: Case, path: Path, at: Rows, hole: Rows, item: Item, kind: int) -> None:
    found = path.events.value[at]
    error = np.abs(found - item.value)
    if kind == Kind.PAUSE:
        check, limit = "process", TIME_S
    elif kind == Kind.SPINDLE:
        check, limit = "process", SPINDLE_SHARE * item.value + 1e-5
    else:
        check, limit = "signals", case.limits.analogs(item.value)
    bad = np.flatnonzero(~(error <= limit))
    if len(bad):

        def say(k: int) -> tuple[str, Span | None]:
            row = int(hole[bad[k]])
            return (
                f"{item.what} at {case.hole(row)}: the program says {found[bad[k]]:g}, the spec"
                f" asks for {item.value:g}",
                case.wanted.process(row).span,
            )

        many = np.full(len(bad), np.inf)
        case.figures(check, many, 1.0, path, at[bad], hole[bad], say)


def _speeds(
    case: Case, path: Path, made: Made, items: Items, template: Template, visits: Rows
) -> None:
    """The speed of every move of these visits, also of those that are put together with others."""
    counts = made.cores.last - made.cores.first + 1
    starts = np.concatenate([[0], np.cumsum(counts)])[:-1]
    total = int(counts[visits].sum())
    rows = np.repeat(starts[visits] - np.cumsum(counts[visits]) + counts[visits], counts[visits])
    rows = rows + np.arange(total)
    visit = np.repeat(visits, counts[visits])
    event = items.events[rows]
    item = items.item_of[rows] - items.first[visit]
    moves = path.moves[event]
    event, item, visit = event[moves], item[moves], visit[moves]
    before = np.maximum(event - 1, 0)
    arrives = event == made.cores.first[visit]
    still = ~arrives & (np.abs(made.depth_mm[event] - made.depth_mm[before]) < SAME_MM)
    event, item, visit, arrives = event[~still], item[~still], visit[~still], arrives[~still]
    asked = template.column("speed_mm_s")[item]
    found = path.speed_mm_s[event]
    kind, value = path.events.kind[event], path.events.value[event]
    # A share of full speed is no speed in mm/s; a program in joints arrives as fast as it can.
    share = (kind == Kind.JOINTS) & np.isfinite(value)
    untold = np.isnan(found) & (share | arrives & case.by_joints)
    # On its ways an arm is no faster than its joints let it be.
    slow = arrives & (found < asked) & case.arm_by_joints
    told = ~untold & ~slow
    event, item, visit = event[told], item[told], visit[told]
    asked, found = asked[told], found[told]
    hole = made.hole[visit]

    def say(k: int) -> tuple[str, Span | None]:
        fast = "at full speed" if np.isnan(found[k]) else f"with {found[k]:g} mm/s"
        what = template.items[int(item[k])].what
        return (
            f"{what} at {case.hole(int(hole[k]))} is made {fast}, the spec asks for"
            f" {asked[k]:g} mm/s",
            case.wanted.process(int(hole[k])).span,
        )

    error = np.abs(found - asked) / asked
    limits = case.limits.speeds(asked) + path.speed_slack[event]
    case.figures("speed", error, limits, path, event, hole, say)


# ── other steps than the spec's ──────────────────────────────────────────────────────────────────


def _explain_all(
    case: Case, path: Path, made: Made, items: Items, template: Template, visits: Rows
) -> None:
    """Each way of failing is explained once, at the first hole that fails so."""
    groups: dict[bytes, list[int]] = {}
    for visit in visits.tolist():
        events = items.event[items.first[visit] : items.first[visit + 1]]
        key = path.codes[events].tobytes() + path.events.line[events].tobytes()
        groups.setdefault(key, []).append(visit)
    for group in groups.values():
        _explain(case, path, made, items, template, group[0], len(group) - 1)


def _explain(
    case: Case, path: Path, made: Made, items: Items, template: Template, visit: int, alike: int
) -> None:
    hole = int(made.hole[visit])
    events = items.event[items.first[visit] : items.first[visit + 1]].tolist()
    span = case.wanted.process(hole).span
    name = case.hole(hole)
    if _explain_pecks(case, path, made, items, template, visit, alike):
        return
    bottom = float(case.wanted.bottom_mm[hole])
    asked = [
        (item.code, round(item.depth_mm + bottom * item.from_bottom, 1))
        if item.code == MOVE
        else (item.code, 0.0)
        for item in template.items
    ]
    found = [
        (MOVE, round(float(made.depth_mm[e]), 1))
        if path.codes[e] == MOVE
        else (int(path.codes[e]), 0.0)
        for e in events
    ]
    matcher = SequenceMatcher(None, found, asked, autojunk=False)
    told: set[str] = set()
    for what, a, b, c, d in matcher.get_opcodes():
        if what == "equal":
            continue
        at = events[min(a, len(events) - 1)]
        missing = [template.items[k] for k in range(c, d)]
        extra = [events[k] for k in range(a, b)]
        if missing:
            check = _check_of(missing)
            words = " and ".join(item.what for item in missing[:3])
            more = f" (and {len(missing) - 3} steps more)" if len(missing) > 3 else ""
            instead = f"; instead there is {described(case, path, made, extra[0])}" if extra else ""
            case.fail(
                check,
                f"{words}{more} {'is' if len(missing) == 1 else 'are'} missing at {name}{instead}",
                path,
                at,
                hole,
                span=span,
                alike=alike,
            )
        for event in [] if missing else extra:
            text = f"{described(case, path, made, event)} at {name} is not in the spec"
            check = "signals" if path.codes[event] >= 32 * 1000 else "process"
            if text not in told:
                told.add(text)
                case.fail(check, text, path, event, hole, span=span, alike=alike)


def _explain_pecks(
    case: Case, path: Path, made: Made, items: Items, template: Template, visit: int, alike: int
) -> bool:
    """Whether all that differs is how far the pecks go; then it is told."""
    asked = next((s.peck_mm for s in template.cycle.steps if s.kind == "plunge"), None)
    start = next((s.from_mm for s in template.cycle.steps if s.kind == "plunge"), None)
    if start is None:
        return False
    hole = int(made.hole[visit])
    events = items.event[items.first[visit] : items.first[visit + 1]]
    own = [int(code) for code in path.codes[events] if code != MOVE]
    if own != [item.code for item in template.items if item.code != MOVE]:
        return False
    depth = made.depth_mm[events[path.codes[events] == MOVE]]
    turns = np.flatnonzero((depth[1:-1] > depth[:-2]) & (depth[1:-1] > depth[2:])) + 1
    bottoms = depth[turns]
    if not len(bottoms) or abs(bottoms[-1] - case.wanted.bottom_mm[hole]) > 0.1:
        return False
    first = float(bottoms[0] - start)
    strokes = sum(item.part == "depth" for item in template.items)
    if asked is not None and len(bottoms) == strokes and abs(first - asked) < PECK_MM:
        return False
    said = f"{asked:.3f} mm" if asked is not None else "none"
    case.fail(
        "process",
        f"pecks at {case.hole(hole)} are {first:.3f} mm, the spec asks for {said}"
        if len(bottoms) > 1 or asked is None
        else f"{case.hole(hole)} is made without pecks, the spec asks for {said}",
        path,
        int(events[np.flatnonzero(path.codes[events] == MOVE)[turns[0]]]),
        hole,
        span=template.cycle.process.span,
        alike=alike,
    )
    return True


def _check_of(missing: list[Item]) -> str:
    parts = [item.part for item in missing if item.part in ("handshake", "standoffs")]
    return parts[0] if parts else "process"


def described(case: Case, path: Path, made: Made | None, event: int) -> str:
    """An event in words."""
    events = path.events
    kind, value = Kind(int(events.kind[event])), float(events.value[event])
    signal = case.signal(int(events.signal[event]))
    if kind in (Kind.STRAIGHT, Kind.JOINTS):
        depth = np.nan if made is None else made.depth_mm[event]
        return "a move" if np.isnan(depth) else f"a move to depth {depth:.3f} mm"
    return {
        Kind.OUTPUT: f"{signal} {'on' if value else 'off'}",
        Kind.ANALOG: f"{signal} set to {value:g}",
        Kind.SPINDLE: f"the spindle at {60.0 * value:g} rpm" if value else "the spindle off",
        Kind.PAUSE: f"a pause of {value:g} s" if np.isfinite(value) else "a halt",
        Kind.WAIT: f"a wait for {signal} to be {value:g}",
        Kind.MESSAGE: "a message to the operator",
        Kind.STOP: "the end of the program",
        Kind.HOME: "a move home",
    }[kind]

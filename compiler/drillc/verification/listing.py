"""Lists what is made: by a plan, or by a program that was read and run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from drillc.planning.program import Program

from .events import Events, Floats, Ints, Kind, joined, no_events
from .expected import MOVE, SAME_SPEED, Item, Template, Wanted, Words, codes_of, wanted_of, words_of
from .made import MOVE_STEP, Made, Step, distinct
from .places import Machine, Places
from .reading import Reader, Run
from .vectors import dot, length
from .visits import THERE_MM, Cores, Path, Visits, items_of, visits_of

#: Depths are told apart to so many mm.
_GRID_MM = 1e-6


def planned_words(program: Program, reader: Reader | None, renamed: Mapping[str, str]) -> Words:
    """How the plan's signals are called: as the reader does, or by their roles alone."""
    if reader is not None:
        return words_of(program, reader, renamed, reader.native_spindle)
    roles = tuple(program.signals)
    signals = {role: number for number, role in enumerate(roles)}
    return Words(roles, signals, lambda role, value: value, "spindle_on" not in roles)


def made_of_plan(program: Program, words: Words, from_below: bool) -> Made:
    """The holes of a plan, by their ids, in order. The controller's own numbers for how an arm
    stands are not among them. `from_below`: see `wanted_of`."""
    wanted = wanted_of(program, words, from_below)
    holes = program.holes
    steps, lists = _planned_steps(wanted, words)

    def place(row: int) -> str:
        span = holes.span(row)
        return f"{span.source.shown}:{span.line}"

    return Made(
        tuple(holes.ids.tolist()),
        holes.position_mm + wanted.bottom_mm[:, None] * wanted.axis,
        program.part_from_tool,
        np.full((len(holes), 4), np.nan),
        steps,
        lists,
        place,
    )


def _planned_steps(wanted: Wanted, words: Words) -> tuple[Ints, tuple[tuple[Step, ...], ...]]:
    key = np.column_stack([wanted.template, np.rint(wanted.bottom_mm / _GRID_MM)])
    kinds, index = distinct(key.astype(np.float64))
    lists = tuple(
        _template_steps(wanted.templates[int(template)], float(bottom) * _GRID_MM, words)
        for template, bottom in kinds.tolist()
    )
    return index, lists


def _template_steps(template: Template, bottom_mm: float, words: Words) -> tuple[Step, ...]:
    return _together([_planned_step(item, bottom_mm, words) for item in template.items])


def _together(steps: Sequence[Step]) -> tuple[Step, ...]:
    """With moves that go on in one direction at one speed as one, as programs are listed."""
    kept: list[Step] = []
    for step in steps:
        if len(kept) > 2 and step.what == kept[-1].what == kept[-2].what == MOVE_STEP:
            one, two = kept[-1].depth_mm - kept[-2].depth_mm, step.depth_mm - kept[-1].depth_mm
            slower = SAME_SPEED * step.speed_mm_s
            if one * two > 0.0 and abs(step.speed_mm_s - kept[-1].speed_mm_s) <= slower:
                kept.pop()
        kept.append(step)
    return tuple(kept)


def _planned_step(item: Item, bottom_mm: float, words: Words) -> Step:
    if item.code == MOVE:
        depth = 0.0 if item.from_bottom else item.depth_mm - bottom_mm
        return Step(MOVE_STEP, round(depth, 6), item.speed_mm_s)
    kind, role, on = item.code % 32 // 2, item.code // 32 - 1, item.code % 2
    name = words.roles[role] if role >= 0 else ""
    return Step(_said(kind, name, bool(on)), value=item.value, timeout_s=item.timeout_s)


def _said(kind: int, name: str, on: bool) -> str:
    state = "on" if on else "off"
    return {
        Kind.OUTPUT: f"{name} {state}",
        Kind.WAIT: f"wait for {name} {state}",
        Kind.ANALOG: f"{name}",
        Kind.SPINDLE: f"spindle {state}",
        Kind.PAUSE: "dwell",
        Kind.MESSAGE: "message",
        Kind.STOP: "stop",
    }[Kind(kind)].strip()


# ── programs ─────────────────────────────────────────────────────────────────────────────────────


def made_of_run(
    run: Run, machine: Machine | None, words: Words | None, standoffs: Sequence[float] = ()
) -> Made:
    """Run a program and list its holes: the visits at which it does something. `machine` says where
    joints bring the tool, `words` which signal is which role; `standoffs` are depths from the
    bottom at which a visit may begin and end, where they are known. Raises ReadError."""
    parts = [step for step in run.steps() if isinstance(step, Events)]
    events = joined(parts) if parts else no_events(len(run.axes))
    path = _path(events, machine, run, words)
    visits = visits_of(path, 0)
    depth = _depth(path, visits)
    busy = np.array(
        [not path.moves[a:b].all() for a, b in zip(visits.start, visits.stop, strict=True)],
        dtype=np.bool_,
    )
    if busy.any():
        visits = visits.take(busy)
    cores = Cores(visits.start, visits.stop - 1)
    if standoffs:
        cores = _between_standoffs(path, visits, depth, standoffs)
    items = items_of(path, cores, depth, together=True)
    names = _names(run, words)
    steps, lists = _found_steps(path, depth, items.event, items.first, names)
    first = visits.deepest
    called = [
        run.name_of(int(events.call_file[e]), int(events.call_line[e])) or ""
        for e in first.tolist()
    ]

    def place(row: int) -> str:
        e = int(first[row])
        return f"{run.files[int(events.call_file[e])]}:{int(events.call_line[e])}"

    return Made(
        tuple(called),
        path.places.position_mm[visits.deepest],
        path.places.rotation[visits.deepest],
        _configuration(events, visits),
        steps,
        lists,
        place,
    )


def _path(events: Events, machine: Machine | None, run: Run, words: Words | None) -> Path:
    role = events.signal
    if words is not None:
        table = np.arange(max(run.signals.values(), default=-1) + 2, dtype=np.int32) + 1000
        for name, number in run.signals.items():
            table[number] = words.signals.get(name, 1000 + number)
        table[-1] = -1
        role = table[np.where(events.signal < 0, len(table) - 1, events.signal)]
    codes = codes_of(events.kind, role, events.value)
    places = Places(events.position_mm, events.rotation, events.joints)
    if machine is not None:
        places = machine.places(events)
    nothing = np.full((len(events), 3), np.nan)
    speed = events.speed_mm_s
    moves = np.flatnonzero(codes == MOVE)
    if machine is not None and len(moves) > 1:
        way = length(np.diff(places.position_mm[moves], axis=0))
        speed = speed.copy()
        timed = events.value[moves[1:]]
        by_joints = np.isfinite(events.joints[moves[1:]]).any(axis=1) & (timed > 0.0)
        speed[moves[1:][by_joints]] = (way / np.where(by_joints, timed, 1.0))[by_joints]
    slack = np.full(len(events), SAME_SPEED)
    return Path(events, places, codes, speed, slack, nothing)


def _depth(path: Path, visits: Visits) -> Floats:
    """Of the tool after each event, from its visit's bottom, along the axis that it has there."""
    depth = np.full(len(path), np.nan)
    last = np.maximum.accumulate(np.where(path.moves, np.arange(len(path)), 0))
    position, axis = path.places.position_mm, path.places.axis
    counts = visits.stop - visits.start
    rows = np.concatenate(
        [np.arange(a, b) for a, b in zip(visits.start, visits.stop, strict=True)] or [last[:0]]
    )
    deepest = np.repeat(visits.deepest, counts)
    there = position[last[rows]] - position[deepest]
    depth[rows] = dot(there, axis[deepest])
    return depth


def _between_standoffs(
    path: Path, visits: Visits, depth: Floats, standoffs: Sequence[float]
) -> Cores:
    """From the first standoff to the first one after the bottom, with what is switched there: a
    portal, or an arm on its way, may come from farther out on the same line and go on there."""
    first, last = visits.start.copy(), visits.stop - 1
    places = np.asarray(standoffs)
    for k, (start, stop, deepest) in enumerate(
        zip(visits.start, visits.stop, visits.deepest, strict=True)
    ):
        away = np.abs(depth[start:stop, None] - places[None, :]).min(axis=1)
        there = start + np.flatnonzero(path.moves[start:stop] & (away <= THERE_MM))
        before, after = there[there < deepest], there[there > deepest]
        if len(before):
            first[k] = before[0]
        if len(after):
            moves = after[0] + 1 + np.flatnonzero(path.moves[after[0] + 1 : stop])
            last[k] = (moves[0] if len(moves) else stop) - 1
    return Cores(first, last)


def _found_steps(
    path: Path,
    depth: Floats,
    event: NDArray[np.intp],
    first: NDArray[np.intp],
    names: Mapping[int, str],
) -> tuple[Ints, tuple[tuple[Step, ...], ...]]:
    """The steps of each visit, visits of as many steps together."""
    events, moves = path.events, path.moves[event]
    rows = np.column_stack(
        [
            path.codes[event],
            np.where(moves, np.round(depth[event], 4), np.nan),
            np.where(moves, path.speed_mm_s[event], np.nan),
            np.where(moves, np.nan, events.value[event]),
            events.timeout_s[event],
        ]
    )
    counts = np.diff(first)
    index = np.zeros(len(counts), dtype=np.int32)
    lists: list[tuple[Step, ...]] = []
    for count in np.unique(counts).tolist():
        of_count = np.flatnonzero(counts == count)
        table = rows[first[of_count][:, None] + np.arange(count)].reshape(len(of_count), -1)
        kinds, which = distinct(table)
        index[of_count] = which + len(lists)
        lists += [
            tuple(_found_step(row, names) for row in kind.reshape(count, 5).tolist())
            for kind in kinds
        ]
    return index, tuple(lists)


def _found_step(row: list[float], names: Mapping[int, str]) -> Step:
    code = int(row[0])
    if code == MOVE:
        return Step(MOVE_STEP, row[1], row[2])
    kind, role, on = code % 32 // 2, code // 32 - 1, code % 2
    plain = kind in (Kind.OUTPUT, Kind.WAIT)  # on or off is in the name
    value = np.nan if plain else row[3]
    return Step(_said(kind, names.get(role, ""), bool(on)), value=value, timeout_s=row[4])


def _names(run: Run, words: Words | None) -> dict[int, str]:
    if words is None:
        return {number: name for name, number in run.signals.items()}
    roles = dict(enumerate(words.roles))
    return roles | {1000 + number: name for name, number in run.signals.items()}


def _configuration(events: Events, visits: Visits) -> Floats:
    """The configuration stated last before each visit, or in it."""
    stated = np.isfinite(events.configuration).any(axis=1)
    last = np.maximum.accumulate(np.where(stated, np.arange(len(events)), -1))
    row = last[visits.stop - 1] if len(visits) else np.empty(0, dtype=np.intp)
    found = events.configuration[np.maximum(row, 0)]
    found[row < 0] = np.nan
    return np.asarray(found)

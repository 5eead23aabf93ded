"""What a Program asks for at each hole, as templates: the same steps for many holes at once.

A template belongs to a cycle and a number of pecks. Its items are moves along the tool's axis, by
depth, and what is switched and waited for between. Everything a hole needs beside it is in columns.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Floats, Ints, Process
from drillc.planning.program import (
    Cycle,
    Dwell,
    MoveTo,
    Plunge,
    Program,
    SetAnalog,
    StartSpindle,
    Step,
    StopSpindle,
    SwitchOutput,
    WaitInput,
)

from .events import Kind, moves_of
from .reading import Reader

#: A peck that would leave less than this to the bottom goes there at once (planning/program.py).
_LAST_PECK_MM = 1e-3
#: Moves that end so near to where they began are none.
SAME_MM = 6e-4
#: Speeds that differ by less are one speed: a move in pieces is one move.
SAME_SPEED = 0.01
#: The code of a move; other codes say kind, role, and whether something is switched on.
MOVE = 0
_UNKNOWN_ROLE = 1000


@dataclass(frozen=True)
class Item:
    """One thing to be done. `what` is for people. `depth_mm` of a move; `from_bottom`: counted from
    the hole's own depth. `part` is the check that it belongs to: how deep, or how far out."""

    code: int
    what: str
    depth_mm: float = np.nan
    from_bottom: bool = False
    speed_mm_s: float = np.nan
    value: float = np.nan
    timeout_s: float = np.nan
    part: str = "process"


@dataclass(frozen=True, eq=False)
class Template:
    """What is done at each hole of a cycle in so many pecks; `items` begin with the arrival.

    `together`: the same, with moves that go on in one direction at one speed as one."""

    cycle: Cycle
    pecks: int
    items: tuple[Item, ...]
    together: Template | None

    @property
    def codes(self) -> NDArray[np.int32]:
        """The items' codes."""
        return np.array([item.code for item in self.items], dtype=np.int32)

    def column(self, name: str) -> Floats:
        """One number of each item."""
        return np.array([getattr(item, name) for item in self.items], dtype=np.float64)


@dataclass(frozen=True, eq=False)
class Wanted:
    """A program's holes in columns (n,), and what is done at them.

    `exit_mm` is the depth at which a cycle ends, `approach_mm` that (below 0) at which it begins.
    `template` indexes `templates`; `faults` are the items after a wait that timed out, by cycle.
    """

    program: Program
    position_mm: Floats
    axis: Floats  # where the tool points, (n, 3)
    bottom_mm: Floats  # the deepest depth of the cycle
    approach_mm: Floats
    exit_mm: Floats
    cycle: Ints
    section_start: NDArray[np.bool_]
    template: Ints
    templates: tuple[Template, ...]
    faults: tuple[tuple[Item, ...], ...]

    def __len__(self) -> int:
        return len(self.position_mm)

    def process(self, hole: int) -> Process:
        """The process of one hole."""
        return self.program.cycles[int(self.cycle[hole])].process


@dataclass(frozen=True, eq=False)
class Words:
    """How a language says things: roles in the order of their codes, signals by name."""

    roles: tuple[str, ...]
    signals: dict[str, int]  # what the reader calls it → role
    analog: Callable[[str, float], float]  # a role's value as the controller counts it
    native_spindle: bool

    def code(self, kind: Kind, role: str | None, on: bool) -> int:
        """The code of something that is switched, or waited for."""
        number = -1 if role is None else self.roles.index(role)
        return code_of(kind, number, on)


def code_of(kind: int, role: int, on: bool) -> int:
    """Kind, role (-1: none) and whether it is switched on, in one number."""
    return int(kind) * 2 + int(on) + 32 * (role + 1)


def codes_of(kind: NDArray[np.uint8], role: NDArray[np.int32], value: Floats) -> NDArray[np.int32]:
    """Codes (n,) of events; all moves are `MOVE`."""
    switched = (kind == Kind.OUTPUT) | (kind == Kind.WAIT) | (kind == Kind.SPINDLE)
    on = switched & (value > 0.0)
    codes = kind.astype(np.int32) * 2 + on + 32 * (role + 1)
    return np.where(moves_of(kind), MOVE, codes).astype(np.int32)


def unknown_role(signal: Ints) -> Ints:
    """The role that stands for a signal which the spec does not name."""
    return _UNKNOWN_ROLE + signal


# ── templates ────────────────────────────────────────────────────────────────────────────────────


def words_of(
    program: Program, reader: Reader, renamed: Mapping[str, str], native_spindle: bool
) -> Words:
    """How the reader's language calls what the program switches."""
    roles = tuple(program.signals)
    signals = {
        reader.signal_name(signal, renamed): roles.index(role)
        for role, signal in program.signals.items()
    }

    def analog(role: str, value: float) -> float:
        return reader.analog_value(program.signals[role], value)

    return Words(roles, signals, analog, native_spindle)


def wanted_of(program: Program, words: Words, from_below: bool) -> Wanted:
    """Templates and columns of a program. `from_below`: a portal's tool comes from under the part,
    against the direction that the hole's normal gives."""
    n = len(program.holes)
    cycle = np.zeros(n, dtype=np.int32)
    begins = np.zeros(n, dtype=np.bool_)
    for section in program.sections:
        cycle[section.start : section.stop] = section.cycle
        if section.stop > section.start:
            begins[section.start] = True
    approach = np.array([-one.process.approach_mm for one in program.cycles])
    exits = np.array([_exit_mm(one) for one in program.cycles])
    bottom = np.array([_bottom_mm(one) for one in program.cycles])
    own = np.array([_plunge(one) is not None for one in program.cycles], dtype=np.bool_)
    pecks = np.ones(n, dtype=np.int64)
    for index, one in enumerate(program.cycles):
        plunge = _plunge(one)
        if plunge is not None and plunge.peck_mm is not None:
            rows = cycle == index
            pecks[rows] = peck_count(plunge, program.depth_mm[rows])
    kinds, template = np.unique(cycle * np.int64(1 << 32) + pecks, return_inverse=True)
    examples = [int(np.flatnonzero(template == k)[0]) for k in range(len(kinds))]
    return Wanted(
        program=program,
        position_mm=program.holes.position_mm,
        axis=-program.holes.feed if from_below else program.holes.feed,
        bottom_mm=np.where(own[cycle], program.depth_mm, bottom[cycle]) if n else np.empty(0),
        approach_mm=approach[cycle] if n else np.empty(0),
        exit_mm=exits[cycle] if n else np.empty(0),
        cycle=cycle,
        section_start=begins,
        template=template.astype(np.int32).reshape(n),
        templates=tuple(
            template_of(
                program.cycles[int(cycle[i])], int(pecks[i]), float(program.depth_mm[i]), words
            )
            for i in examples
        ),
        faults=tuple(tuple(_items(one.fault, one, 1, 0.0, words)) for one in program.cycles),
    )


def peck_count(plunge: Plunge, depth_mm: Floats) -> NDArray[np.int64]:
    """How many strokes a plunge takes."""
    assert plunge.peck_mm is not None
    strokes = np.ceil((depth_mm - plunge.from_mm - _LAST_PECK_MM) / plunge.peck_mm - 1e-9)
    return np.maximum(strokes, 1).astype(np.int64)


def template_of(cycle: Cycle, pecks: int, depth_mm: float, words: Words) -> Template:
    """The items of a cycle; `depth_mm` of one of its holes says which moves go which way."""
    process = cycle.process
    arrival = Item(
        MOVE,
        "the standoff",
        -process.approach_mm,
        speed_mm_s=process.travel_mm_s,
        part="standoffs",
    )
    rest = _items(cycle.steps, cycle, pecks, depth_mm, words)
    every = [arrival, *rest]
    together = Template(cycle, pecks, _normal(every, depth_mm, together=True), None)
    return Template(cycle, pecks, _normal(every, depth_mm, together=False), together)


def _items(
    steps: Sequence[Step], cycle: Cycle, pecks: int, depth_mm: float, words: Words
) -> Iterator[Item]:
    def move(depth: float, speed: float, what: str, bottom: bool = False) -> Item:
        part = "depth" if what == "the bottom" or what == "a peck" else "process"
        return Item(MOVE, what, depth, bottom, speed, part=part)

    def switched(role: str, on: bool) -> Item:
        return Item(words.code(Kind.OUTPUT, role, on), f"{role} {'on' if on else 'off'}")

    def waited(role: str, timeout_s: float) -> Item:
        what = f"the wait for {role}"
        code = words.code(Kind.WAIT, role, True)
        return Item(code, what, timeout_s=timeout_s, part="handshake")

    def analog(role: str, value: float) -> Item:
        told = words.analog(role, value)
        code = words.code(Kind.ANALOG, role, False)
        return Item(code, f"{role} set to {told:g}", value=told, part="signals")

    for step in steps:
        match step:
            case MoveTo():
                yield move(step.depth_mm, step.speed_mm_s, f"the move to {step.depth_mm:.3f} mm")
            case Plunge():
                for k in range(1, pecks):
                    assert step.peck_mm is not None
                    bottom = step.from_mm + k * step.peck_mm
                    yield move(bottom, step.feed_mm_s, "a peck")
                    yield move(step.from_mm, step.return_mm_s, "a peck's withdrawal")
                    yield move(bottom - step.peck_gap_mm, step.return_mm_s, "a peck's return")
                yield move(0.0, step.feed_mm_s, "the bottom", bottom=True)
            case StartSpindle():
                if words.native_spindle:
                    code = words.code(Kind.SPINDLE, None, True)
                    yield Item(code, "spindle on", value=step.rev_s)
                else:
                    if "spindle_speed" in words.roles:
                        yield analog("spindle_speed", step.rev_s)
                    if "spindle_on" in words.roles:
                        yield switched("spindle_on", True)
                if "spindle_running" in words.roles:
                    yield waited("spindle_running", step.timeout_s)
            case StopSpindle():
                if words.native_spindle:
                    code = words.code(Kind.SPINDLE, None, False)
                    yield Item(code, "spindle off", value=0.0)
                    continue
                if "spindle_on" in words.roles:
                    yield switched("spindle_on", False)
                if "spindle_speed" in words.roles:
                    yield analog("spindle_speed", 0.0)
            case Dwell():
                code = words.code(Kind.PAUSE, None, False)
                yield Item(code, f"the dwell of {step.seconds:g} s", value=step.seconds)
            case SwitchOutput():
                yield switched(step.role, step.on)
            case SetAnalog():
                yield analog(step.role, step.value)
            case WaitInput():
                yield waited(step.role, step.timeout_s)


def _normal(items: Sequence[Item], depth_mm: float, *, together: bool) -> tuple[Item, ...]:
    """Without moves to where the tool is, and, if asked for, with moves that go on at the same
    speed put together: as `visits.py` does with what was found."""
    kept: list[Item] = []
    place = _at(items[0], depth_mm)
    for i, item in enumerate(items):
        at = _at(item, depth_mm)
        if i and item.code == MOVE and abs(at - place) < SAME_MM:
            continue
        before = kept[-1] if len(kept) > 1 else None
        if together and item.code == MOVE and before is not None and before.code == MOVE:
            way = _at(before, depth_mm) - _place(kept[:-1], depth_mm)
            alike = abs(item.speed_mm_s - before.speed_mm_s) <= SAME_SPEED * before.speed_mm_s
            if (at - _at(before, depth_mm)) * way > 0.0 and alike:
                kept.pop()
        kept.append(item)
        place = at if item.code == MOVE else place
    last = max(i for i, item in enumerate(kept) if item.code == MOVE)
    if last and kept[last].part != "depth":
        kept[last] = replace(kept[last], part="standoffs", what="the retract")
    return tuple(kept)


def _at(item: Item, depth_mm: float) -> float:
    return item.depth_mm + depth_mm * item.from_bottom


def _place(items: Sequence[Item], depth_mm: float) -> float:
    """Where the last move of `items` ends."""
    return _at(next(item for item in reversed(items) if item.code == MOVE), depth_mm)


def _plunge(cycle: Cycle) -> Plunge | None:
    return next((step for step in cycle.steps if isinstance(step, Plunge)), None)


def _exit_mm(cycle: Cycle) -> float:
    moves = [step.depth_mm for step in cycle.steps if isinstance(step, MoveTo)]
    return moves[-1] if moves else -cycle.process.approach_mm


def _bottom_mm(cycle: Cycle) -> float:
    """The deepest place of a cycle that does not drill."""
    moves = [step.depth_mm for step in cycle.steps if isinstance(step, MoveTo)]
    return max(moves, default=-cycle.process.approach_mm)

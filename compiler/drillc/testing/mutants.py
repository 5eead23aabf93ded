"""Faults: in the text of a program, and in what the program is to do.

A reader that is blind to something lets one of them pass.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields, replace
from random import Random
from typing import Any

import numpy as np

from drillc.planning.program import Cycle, Program, Step

from .emitting import Files

#: A number that stands by itself, not as part of a name.
_NUMBER = re.compile(r"(?<![\w.])[0-9]+(\.[0-9]+)?(?![\w.])")
#: What no controller understands.
NONSENSE = "zq 7 ) qz"


@dataclass(frozen=True, eq=False)
class Mutant:
    """Files with one fault, and in words what it is."""

    files: Files
    what: str


# ── in the text ──────────────────────────────────────────────────────────────────────────────────

Lines = list[str]
Edit = Callable[[Lines, Random], tuple[int, Lines] | None]


def _digit(lines: Lines, rng: Random) -> tuple[int, Lines] | None:
    """One digit of a number is another one."""
    places = [(i, found) for i, line in enumerate(lines) for found in _NUMBER.finditer(line)]
    if not places:
        return None
    i, found = rng.choice(places)
    at = rng.choice([k for k in range(*found.span()) if lines[i][k].isdigit()])
    digit = rng.choice([d for d in "0123456789" if d != lines[i][at]])
    return i, [lines[i][:at] + digit + lines[i][at + 1 :]]


def _dropped(lines: Lines, rng: Random) -> tuple[int, Lines] | None:
    return rng.choice(_filled(lines)), []


def _doubled(lines: Lines, rng: Random) -> tuple[int, Lines] | None:
    i = rng.choice(_filled(lines))
    return i, [lines[i], lines[i]]


def _swapped(lines: Lines, rng: Random) -> tuple[int, Lines] | None:
    """A line and the next stand the other way round; the second is dropped by the caller."""
    places = [i for i in range(len(lines) - 1) if lines[i].strip() != lines[i + 1].strip()]
    if not places:
        return None
    i = rng.choice(places)
    return i, [lines[i + 1], lines[i]]


def _nonsense(lines: Lines, rng: Random) -> tuple[int, Lines] | None:
    i = rng.choice(_filled(lines))
    return i, [NONSENSE, lines[i]]


def _filled(lines: Lines) -> list[int]:
    return [i for i, line in enumerate(lines) if line.strip()]


EDITS: dict[str, Edit] = {
    "a digit changed": _digit,
    "a line dropped": _dropped,
    "a line doubled": _doubled,
    "two lines swapped": _swapped,
    "a line of nonsense": _nonsense,
}


def edited(files: Files, newline: str, kind: str, rng: Random) -> Mutant | None:
    """`files` with one edit of the kind at a place taken at random, if they have such a place."""
    path = rng.choice(sorted(files))
    lines = files[path].decode("ascii").split(newline)
    edit = EDITS[kind](lines, rng)
    if edit is None:
        return None
    at, new = edit
    size = 2 if kind == "two lines swapped" else 1
    text = newline.join([*lines[:at], *new, *lines[at + size :]])
    before, after = " / ".join(lines[at : at + size]), " / ".join(new)
    what = f"{kind} at {path}:{at + 1}: {before!r} became {after!r}"
    return Mutant({**files, path: text.encode("ascii")}, what)


# ── in the program ───────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True, eq=False)
class Other:
    """A program that differs from another in one figure: which one, and whether a text that states
    it does something else in any case. A step may be one that leads nowhere."""

    what: str
    program: Program
    always_felt: bool


def other_programs(program: Program) -> Iterator[Other]:
    """Programs that differ from `program` in one figure."""
    for c, cycle in enumerate(program.cycles):
        for what, changed in _other_cycles(cycle):
            cycles = (*program.cycles[:c], changed, *program.cycles[c + 1 :])
            yield Other(what, replace(program, cycles=cycles), False)
    for role, signal in program.signals.items():
        signals = {**program.signals, role: replace(signal, number=signal.number + 1)}
        yield Other(f"the number of {role}", replace(program, signals=signals), False)
    for what, other in _other_holes(program):
        yield Other(f"{what} of {program.holes.ids[-1]}", other, True)


def _other_cycles(cycle: Cycle) -> Iterator[tuple[str, Cycle]]:
    name = cycle.process.name
    for what, steps in _other_steps(cycle.steps):
        yield f"{what} of {name}", replace(cycle, steps=steps)
    for what, steps in _other_steps(cycle.fault):
        yield f"{what} in the fault of {name}", replace(cycle, fault=steps)


def _other_steps(steps: tuple[Step, ...]) -> Iterator[tuple[str, tuple[Step, ...]]]:
    for s, step in enumerate(steps):
        for field in fields(step):
            if (value := _other(getattr(step, field.name))) is not None:
                other = replace(step, **{field.name: value})
                yield f"{field.name} of {step.kind}", (*steps[:s], other, *steps[s + 1 :])


def _other(value: Any) -> Any:
    """Another value of a step's figure; None for words."""
    if isinstance(value, bool):
        return not value
    return 1.5 * value + 0.1 * (value == 0.0) if isinstance(value, float) else None


def _other_holes(program: Program) -> Iterator[tuple[str, Program]]:
    """The last hole deeper, elsewhere, or turned."""
    holes, motion = program.holes, program.motion
    if program.cycles[program.sections[-1].cycle].process.drill is not None:
        depth_mm = program.depth_mm.copy()
        depth_mm[-1] += 0.05
        yield "the depth", replace(program, depth_mm=depth_mm)
    if program.arm is not None:
        return  # whose joints and vias would have to follow
    if motion is not None:
        for axis, joint in enumerate(motion.axes):
            joints = motion.joints.copy()
            joints[-1, axis] += 0.01
            yield joint.name, replace(program, motion=replace(motion, joints=joints))
        return
    for i, letter in enumerate("xyz"):
        position_mm = holes.position_mm.copy()
        position_mm[-1, i] += 0.05
        yield letter, replace(program, holes=replace(holes, position_mm=position_mm))
    turned = program.part_from_tool.copy()
    turned[-1] = turned[-1] @ _turn(1e-4)
    yield "the heading", replace(program, part_from_tool=turned)


def _turn(angle_rad: float) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    sine, cosine = np.sin(angle_rad), np.cos(angle_rad)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])

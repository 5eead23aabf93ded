"""The vias of a program for an arm as templates see them: numbered, and in stretches between holes.

A section is a sequence of stretches: holes without vias between them, and vias of one kind. Each
stretch is poured at once, so the work grows with the holes and with the vias, not with both.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import Ints, Texts
from drillc.output.pouring import Rows
from drillc.planning.program import ArmMotion, Program

#: The kind of a stretch of holes.
HOLES = "holes"
#: Joints that differ by less are the same place: rounding.
_SAME_RAD = 1e-9


@dataclass(frozen=True)
class Stretch:
    """What is done in a row: `kind` is "holes", or that of the vias; `rows` are of either table."""

    kind: str
    rows: Rows


def plain_kinds(arm: ArmMotion) -> Texts:
    """What each via (m,) is: "home" where all joints move to the arm's home, "joints" where they
    move elsewhere, else "straight"."""
    by_joints = np.where(at_home(arm), "home", "joints")
    return np.where(arm.vias.by_joints, by_joints, "straight")


def check_vias(program: Program) -> None:
    """Raises ValueError for what no text could carry out faithfully: a bug in the planner."""
    arm, count = program.arm, len(program.holes)
    if arm is None:
        return
    if program.frame is None or program.frame.world_from_part is None:
        raise ValueError("it is not said where the part lies from the arm")
    before, by_joints = arm.vias.before, arm.vias.by_joints
    if (np.diff(before, prepend=0, append=count) < 0).any():
        raise ValueError("the vias are not in the order of the holes")
    if len(before) and not count:
        raise ValueError("there are vias, but no hole")
    for section in program.sections:
        last = int(np.searchsorted(before, section.start, side="right")) - 1
        reached = last >= 0 and before[last] == section.start and by_joints[last]
        if section.stop > section.start and not reached:
            raise ValueError(f"section {section.region} is not begun by a move of the joints")


def vias_before(rows: Rows, before: Ints, holes: int) -> Rows:
    """The vias made before the holes `rows`; with the last of all `holes`, those after it too."""
    start, stop = np.searchsorted(before, [rows.start, rows.stop]).tolist()
    return Rows(start, len(before) if rows.stop == holes else stop, "via")


def stretches(rows: Rows, vias: Rows, before: Ints, kinds: Texts) -> Iterator[Stretch]:
    """The holes `rows` with `vias` between them, as runs of one kind."""
    at = rows.start
    own, words = before[vias.start : vias.stop], kinds[vias.start : vias.stop]
    changes = np.flatnonzero((own[1:] != own[:-1]) | (words[1:] != words[:-1])) + 1
    edges = [0, *changes.tolist(), len(own)] if len(own) else []
    for start, stop in pairwise(edges):
        hole = int(own[start])
        if hole > at:
            yield Stretch(HOLES, Rows(at, hole))
            at = hole
        yield Stretch(str(words[start]), Rows(vias.start + start, vias.start + stop, "via"))
    if rows.stop > at:
        yield Stretch(HOLES, Rows(at, rows.stop))


def via_numbers(modules: Sequence[Rows], kinds: Texts) -> NDArray[np.int64]:
    """Each via's number (m,) among those of its kind in its module, from 1. `modules` are the vias
    of each."""
    numbers = np.zeros(len(kinds), dtype=np.int64)
    for vias in modules:
        own = kinds[vias.start : vias.stop]
        for kind in np.unique(own):
            places = vias.start + np.flatnonzero(own == kind)
            numbers[places] = np.arange(1, len(places) + 1)
    return numbers


def at_home(arm: ArmMotion) -> NDArray[np.bool_]:
    """Which vias (m,) end at the arm's home."""
    home = arm.arm.home_rad
    if home is None:
        return np.zeros(len(arm.vias.before), dtype=np.bool_)
    same: NDArray[np.bool_] = np.all(np.abs(arm.vias.joints - home) <= _SAME_RAD, axis=1)
    return same


def destinations(arm: ArmMotion, ids: Texts) -> Texts:
    """Where each via (m,) leads, for a comment: to the hole of which `ids` (n,), or home."""
    to: Texts = np.append(ids, "the end")[arm.vias.before]
    return np.where(at_home(arm), "home", to)

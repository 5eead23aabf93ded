"""Why a hole can be made at a heading, or cannot: heading by heading, and in one sentence."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

import numpy as np

from drillc.catalogue.model import JOINT_NAMES
from drillc.kernels.posture import heading_turn_rad
from drillc.language.job import (
    Floats,
)
from drillc.planning.cell import Cell, pick
from drillc.planning.cycle_check import Assessment, Cycles, assess
from drillc.planning.mending import find_mends, headings_of
from drillc.planning.moves import FINE, HIT, JUMP, LIMIT, MISSED, REACH, SINGULAR, Verdict
from drillc.planning.reach import lacking_mm, wrist_centres
from drillc.planning.tool_sweeps import ToolSweeps

#: Headings that are looked at stand this far apart.
STEP_RAD = math.radians(5.0)
#: Places along a cycle at which the gap between a link and what it meets is measured.
_PLACES = 9
_OF_THE_ARM = "the arm's "


@dataclass(frozen=True)
class Blockage:
    """What is in the way at one heading: `kind` ("body", "limit", "singularity", "leap", "reach");
    `brief` for a table, `clause` for a sentence, `counted` where it is one of many."""

    kind: str
    brief: str
    clause: str
    counted: str


@dataclass(frozen=True)
class HeadingLine:
    """One heading, in radians away from the rule's: what blocks the tool there, what blocks the
    arm, and the branches in which the arm follows."""

    heading_rad: float
    tool: Blockage | None
    arm: Blockage | None
    branches: tuple[int, ...]

    @property
    def works(self) -> bool:
        return self.tool is None and self.arm is None


@dataclass(frozen=True)
class Explanation:
    """`lines`: the headings, from the rule's own outwards. `summary`: what is in the way, in one
    sentence. `mend`: the nearest things that would work, if any is known."""

    lines: tuple[HeadingLine, ...]
    summary: str
    mend: str | None


def explain(
    cell: Cell, cycles: Cycles, sweeps: ToolSweeps, row: int, turning_rad: Floats
) -> Explanation:
    """Look at hole `row` of the cycles, at headings within its turning (n,)."""
    within = float(turning_rad[row])
    lines = judge(cell, cycles, sweeps, row, headings_within(within))
    solved = any(line.works for line in lines)
    return Explanation(
        lines,
        _summary(lines, within),
        None if solved else find_mends(cell, cycles, sweeps, row, turning_rad),
    )


def headings_within(turning_rad: float, step_rad: float = STEP_RAD) -> Floats:
    """The rule's heading (0), then others to either side in steps, up to the turning itself; of the
    two that are half a turn away, one."""
    steps = np.arange(1, math.ceil(turning_rad / step_rad - 1e-9) + 1)
    away = np.minimum(steps * step_rad, turning_rad)
    both = np.stack([away, -away], axis=1).ravel()
    return np.concatenate([[0.0], both[both > -math.pi + 1e-9]])


def judge(
    cell: Cell, cycles: Cycles, sweeps: ToolSweeps, row: int, heading_rad: Floats
) -> tuple[HeadingLine, ...]:
    """What is in the way of hole `row` at each of the headings (k,)."""
    rows = np.full(len(heading_rad), row)
    hit = sweeps.hit(rows, heading_rad)
    found = assess(cell, cycles, rows, heading_rad)
    lines = []
    for i, heading in enumerate(heading_rad.tolist()):
        fine = np.flatnonzero(found.cause[i] == FINE)
        tool = None if hit[i] < 0 else _tool(cell, cycles, sweeps, row, heading, int(hit[i]))
        arm = None if len(fine) else _arm(cell, cycles, row, heading, found, i)
        lines.append(HeadingLine(heading, tool, arm, tuple(fine.tolist())))
    return tuple(lines)


def least_turn_rad(cycles: Cycles, sweeps: ToolSweeps, row: int, turning_rad: Floats) -> float:
    """The least turn of the tool about its axis from the hole before `row` to it, over the headings
    at which both can be made."""
    before, after = (
        headings_of(cycles, sweeps, at, float(turning_rad[at])) for at in (row - 1, row)
    )
    turn = heading_turn_rad(cycles.rotation[row - 1 : row + 1]) + after - before[:, None]
    return float(np.abs((turn + np.pi) % (2 * np.pi) - np.pi).min())


def said_verdict(cell: Cell, verdict: Verdict) -> str:
    """Why one move cannot be made, in words."""
    cause, joint = int(verdict.cause[0]), JOINT_NAMES[int(verdict.detail[0])]
    share = round(100 * float(verdict.share[0]))
    where = f"after {share} % of the way" if share else "where it begins"
    if cause >= HIT:
        mover = cell.movers[int(verdict.mover[0])].name
        return f"{mover} comes too near to {cell.guards[cause - HIT].name} {where}"
    return {
        REACH: f"the tool is out of reach {where}",
        LIMIT: f"{joint} leaves its limits {where}",
        SINGULAR: f"the wrist comes within {math.degrees(cell.singular_rad):g} deg of straight "
        f"{where}",
        JUMP: f"{joint} leaps {where}",
        MISSED: "the joints arrive a whole turn off",
    }[cause]


# ── one heading ──────────────────────────────────────────────────────────────────────────────────


def _tool(
    cell: Cell, cycles: Cycles, sweeps: ToolSweeps, row: int, heading_rad: float, hit: int
) -> Blockage:
    """What the tool's body comes too near to, and how near."""
    spare_mm, which = sweeps.gap_mm(row, heading_rad)
    guard = cell.guards[which if which >= 0 else hit]
    kept_mm = float(guard.clearance_mm[cycles.region[row]])
    near, kept = _near(spare_mm + kept_mm, guard.name, kept_mm)
    return Blockage(
        "body", near, f"the tool is {near}{kept}", f"bring the tool too near to {guard.name}"
    )


def _near(gap_mm: float, name: str, kept_mm: float) -> tuple[str, str]:
    """How near, and what is to be kept."""
    if gap_mm <= 0:
        return f"in {name}", ""
    return f"{gap_mm:.1f} mm from {name}", f" ({kept_mm:g} mm are kept)"


def _arm(
    cell: Cell, cycles: Cycles, row: int, heading_rad: float, found: Assessment, at: int
) -> Blockage:
    """The branch that comes nearest to working speaks for the heading."""
    cause = found.cause[at]
    if (cause >= HIT).any():
        branch = int(np.argmax(cause >= HIT))
        return _link(cell, cycles, row, heading_rad, branch, int(found.mover[at, branch]))
    lacking_rad = np.full(len(cause), np.inf)
    limit, singular = cause == LIMIT, cause == SINGULAR
    lacking_rad[limit] = found.over_rad[at][limit]
    lacking_rad[singular] = cell.singular_rad - found.bend_rad[at][singular]
    branch = int(np.argmin(lacking_rad))
    if limit[branch]:
        joint = JOINT_NAMES[int(found.joint[at, branch])]
        said = f"{joint} oversteps its limits by {math.degrees(lacking_rad[branch]):.1f} deg"
        return Blockage("limit", said, said, f"overstep {joint}'s limits")
    if singular[branch]:
        bent = f"{math.degrees(found.bend_rad[at, branch]):.1f} deg only"
        return Blockage(
            "singularity",
            f"the wrist is bent by {bent}",
            f"the wrist is bent by {bent} (singular {math.degrees(cell.singular_rad):g} deg)",
            "straighten the wrist",
        )
    if (cause == JUMP).any():
        said = "the joints leap on the way in"
        return Blockage("leap", said, said, "make the joints leap")
    said = f"out of reach by {_lacking_mm(cell, cycles, row, heading_rad):.0f} mm"
    return Blockage("reach", said, f"the hole is {said}", "are out of reach")


def _link(
    cell: Cell, cycles: Cycles, row: int, heading_rad: float, branch: int, mover: int
) -> Blockage:
    """A link that is not proven clear of something, and how near it comes at places along the
    cycle. (The proof keeps up to a millimetre more than is asked.)"""
    body = cell.movers[mover]
    joints = pick(cell.branches(*_along(cycles, row, heading_rad)), np.full(_PLACES, branch))
    rotation, origin_mm = cell.link_poses(joints)
    least: tuple[float, str, float] | None = None
    for guard in cell.guards:
        kept_mm = float(guard.clearance_mm[cycles.region[row]])
        if not math.isfinite(kept_mm):
            continue
        for turned, at in zip(rotation[:, body.link], origin_mm[:, body.link], strict=True):
            gap_mm, _ = guard.obstacles.gap_mm(body.probe(0.0), turned, at)
            if least is None or gap_mm - kept_mm < least[0] - least[2]:
                least = gap_mm, guard.name, kept_mm
    assert least is not None
    near, kept = _near(*least)
    return Blockage(
        "body",
        f"{body.name.removeprefix(_OF_THE_ARM)}: {near}",
        f"{body.name} is {near}{kept}",
        f"bring the arm too near to {least[1]}",
    )


def _along(cycles: Cycles, row: int, heading_rad: float) -> tuple[Floats, Floats]:
    """The tool at places along the cycle: rotation (p, 3, 3), position (p, 3)."""
    depth_mm = np.linspace(-cycles.out_mm[row], cycles.depth_mm[row], _PLACES)
    rows = np.full(_PLACES, row)
    rotation = cycles.turned(rows, np.full(_PLACES, heading_rad))
    return rotation, cycles.at_depth(rows, depth_mm)


def _lacking_mm(cell: Cell, cycles: Cycles, row: int, heading_rad: float) -> float:
    """By how much the wrist centre is out of reach where it is farthest from it."""
    place = _along(cycles, row, heading_rad)
    wrist_mm = wrist_centres(cell.geometry, cell.flange_from_tool, *place)
    root = cell.station.part_from_root
    in_root = (wrist_mm - root.translation_mm) @ root.rotation
    return float(lacking_mm(cell.geometry, in_root).max())


# ── all of them ──────────────────────────────────────────────────────────────────────────────────


def _summary(lines: tuple[HeadingLine, ...], turning_rad: float) -> str:
    """The rule's own heading in full; the others counted by what is in their way."""
    own = lines[0].tool or lines[0].arm
    first = "the rule's heading works" if own is None else f"at the rule's heading, {own.clause}"
    if len(lines) == 1:
        return first
    clauses = {blocked.clause for line in lines if (blocked := line.tool or line.arm)}
    if len(clauses) == 1 and not any(line.works for line in lines):
        return f"at every heading within {math.degrees(turning_rad):g} deg, {clauses.pop()}"
    why: Counter[str] = Counter()
    for line in lines[1:]:
        blocked = line.tool or line.arm
        why["work" if blocked is None else blocked.counted] += 1
    counted = ", ".join(f"{number} {what}" for what, number in why.most_common())
    return (
        f"{first}; of {len(lines) - 1} other headings within {math.degrees(turning_rad):g} deg, "
        f"{counted}"
    )

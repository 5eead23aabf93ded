"""An arm's G-code, followed block by block: where its tool goes, how fast, and what is switched.

LinuxCNC's interpreter says which joints every block ends at and with which F; between, the joints
move in proportion. Where joints take the tool is computed here, from the makers' drawings; nothing
of drillc's kinematics is used. What is wanted are the steps of the Program.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from drillc.planning.program import (
    Dwell,
    MoveTo,
    Plunge,
    Program,
    SetAnalog,
    StartSpindle,
    StopSpindle,
    SwitchOutput,
)
from judges.linuxcnc import Move
from readers.arms import Dimensions
from scipy.spatial.transform import Rotation

Array = np.ndarray[Any, np.dtype[np.float64]]

#: Places in each block at which the tool is looked at.
_SHARES = np.linspace(0.0, 1.0, 9)
#: The first of these that moves is what F is counted along.
_COUNTED = ("XYZ", "UVW", "ABC")


@dataclass(frozen=True)
class Machine:
    """An arm, where it stands, its tool, and each joint's letter."""

    dimensions: Dimensions
    part_from_root: Array  # (4, 4)
    flange_from_tool: Array  # (4, 4)
    letters: str
    speeds_deg_s: Array  # (6,)

    def joints(self, place: Mapping[str, float]) -> Array:
        return np.array([place[letter] for letter in self.letters])

    def tool(self, joints_deg: Array) -> tuple[Rotation, Array]:
        """The tool's orientation and its point, in part coordinates, of joints (k, 6)."""
        arm = self.dimensions
        sign = np.array([-1.0 if i + 1 in arm.turned else 1.0 for i in range(6)])
        q = sign * (joints_deg - np.array(arm.straight))
        column = Rotation.from_euler("Z", q[:, :1], degrees=True)
        upper = column * Rotation.from_euler("Y", q[:, 1:2], degrees=True)
        fore = upper * Rotation.from_euler("Y", q[:, 2:3], degrees=True)
        hand = fore * Rotation.from_euler("ZYZ", q[:, 3:], degrees=True)
        flange = (
            column.apply([arm.a1, 0.0, arm.c1])
            + upper.apply([0.0, 0.0, arm.c2])
            + fore.apply([arm.a2, 0.0, arm.c3])
            + hand.apply([0.0, 0.0, arm.c4])
        )
        root = Rotation.from_matrix(self.part_from_root[:3, :3])
        tool = self.flange_from_tool
        point = root.apply(flange + hand.apply(tool[:3, 3])) + self.part_from_root[:3, 3]
        return root * hand * Rotation.from_matrix(tool[:3, :3]), point


# ── what is wanted ───────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Joints:
    """All joints in proportion, to there (deg)."""

    to: Array


@dataclass(frozen=True)
class Line:
    """The tool straight from pose to pose, (3, 3) and (3,) each, at `speed_mm_s`."""

    start: tuple[Array, Array]
    stop: tuple[Array, Array]
    speed_mm_s: float
    travel: bool


@dataclass(frozen=True)
class Token:
    """Something that is switched, in the words of LinuxCNC's canonical functions."""

    text: str


Wanted = Joints | Line | Token | Dwell


def wanted(program: Program) -> Iterator[Wanted]:
    """Every move and what is switched, in order; the first one is to the home, if there is one."""
    arm = program.arm
    assert arm is not None
    holes, vias, count = program.holes, arm.vias, len(program.holes)
    cycle_of = [program.cycles[s.cycle] for s in program.sections for _ in range(s.start, s.stop)]

    def on_axis(row: int, depth: float) -> tuple[Array, Array]:
        turn = program.part_from_tool[row]
        return turn, holes.position_mm[row] + depth * turn[:, 2]

    def depths(row: int) -> Iterator[tuple[float, float] | Token | Dwell]:
        for step in cycle_of[row].steps:
            if isinstance(step, MoveTo):
                yield step.depth_mm, step.speed_mm_s
            elif isinstance(step, Plunge):
                yield from pecks(step, float(program.depth_mm[row]))
            elif isinstance(step, Dwell):
                yield step
            elif isinstance(step, StartSpindle):
                yield Token("START_SPINDLE_CLOCKWISE")
            elif isinstance(step, StopSpindle):
                yield Token("STOP_SPINDLE_TURNING")
            elif isinstance(step, SwitchOutput):
                name = "SET" if step.on else "CLEAR"
                yield Token(f"{name}_AUX_OUTPUT_BIT({program.signals[step.role].number})")
            elif isinstance(step, SetAnalog):
                yield Token(f"SET_AUX_OUTPUT_VALUE({program.signals[step.role].number}")

    if arm.arm.home_rad is not None:
        yield Joints(np.degrees(arm.arm.home_rad))
    at: tuple[Array, Array] | None = None
    via = 0
    for row in range(count + 1):
        process = cycle_of[min(row, count - 1)].process
        while via < len(vias.before) and vias.before[via] == row:
            there = vias.part_from_tool[via], vias.position_mm[via]
            if vias.by_joints[via]:
                yield Joints(np.degrees(vias.joints[via]))
            else:
                assert at is not None
                yield Line(at, there, process.travel_mm_s, travel=True)
            at, via = there, via + 1
        if row == count:
            return
        assert at is not None
        depth = -process.approach_mm
        yield Line(at, on_axis(row, depth), process.travel_mm_s, travel=True)
        for done in depths(row):
            if isinstance(done, tuple):
                yield Line(on_axis(row, depth), on_axis(row, done[0]), done[1], travel=False)
                depth = done[0]
            else:
                yield done
        at = on_axis(row, depth)


def pecks(step: Plunge, depth: float) -> Iterator[tuple[float, float]]:
    """(depth, mm/s) of each stroke."""
    bottom = step.from_mm
    while step.peck_mm is not None and bottom + step.peck_mm < depth - 1e-3:
        bottom += step.peck_mm
        yield bottom, step.feed_mm_s
        yield step.from_mm, step.return_mm_s
        yield bottom - step.peck_gap_mm, step.return_mm_s
    yield depth, step.feed_mm_s


# ── following ────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Followed:
    """How far the tool's point left its line, mm, into holes and on travels; how far it was turned
    away, rad; after how many moves each token was due; and after which moves, from 0, the arm is to
    stand: all of a travel, and the last one of each line."""

    into_mm: float
    travel_mm: float
    turned_rad: float
    tokens: tuple[tuple[int, str], ...]
    stops: frozenset[int]


def follow(moves: Sequence[Move], program: Program, machine: Machine) -> Followed:
    """Asserts that the moves do what the Program wants, and nothing else."""
    place, done = moves[0].place, 0
    into, travel, turned = [0.0], [0.0], [0.0]
    tokens: list[tuple[int, str]] = []
    stops: set[int] = set()
    for want in wanted(program):
        if isinstance(want, Token):
            tokens.append((done, want.text))
        elif isinstance(want, Dwell):
            assert moves[done].kind == "dwell"
            assert abs((moves[done].seconds or 0.0) - want.seconds) < 1e-3
            done += 1
        elif isinstance(want, Joints):
            assert moves[done].kind == "traverse", (moves[done], want)
            place = moves[done].place
            assert np.abs(machine.joints(place) - want.to).max() < 1e-5
            done += 1
        else:
            while not _arrived(machine, place, want):
                move = moves[done]
                assert move.kind == "feed", (move, want)
                apart_mm, turned_rad = _block(machine, want, place, move)
                (travel if want.travel else into).append(apart_mm)
                turned.append(turned_rad)
                place = move.place
                if want.travel or _arrived(machine, place, want):
                    stops.add(done)
                done += 1
    assert done == len(moves), f"too much: {moves[done]}"
    return Followed(max(into), max(travel), max(turned), tuple(tokens), frozenset(stops))


def _arrived(machine: Machine, place: Mapping[str, float], line: Line) -> bool:
    turn, point = machine.tool(machine.joints(place)[None])
    away_rad = (turn * Rotation.from_matrix(line.stop[0]).inv()).magnitude()[0]
    return bool(np.linalg.norm(point[0] - line.stop[1]) < 0.015 and away_rad < 1e-4)


def _block(
    machine: Machine, line: Line, place: Mapping[str, float], move: Move
) -> tuple[float, float]:
    """How far the tool is from its line in one block, mm and rad. Asserts that it goes on along it,
    and how fast."""
    before, after = machine.joints(place), machine.joints(move.place)
    turn, point = machine.tool(before + _SHARES[:, None] * (after - before))
    way = line.stop[1] - line.start[1]
    length = float(np.linalg.norm(way))
    first = Rotation.from_matrix(line.start[0])
    turning = (first.inv() * Rotation.from_matrix(line.stop[0])).as_rotvec()
    if length > 1e-3:
        share = (point - line.start[1]) @ way / length**2
    else:
        share = (first.inv() * turn).as_rotvec() @ turning / (turning @ turning)
    apart = np.linalg.norm(point - line.start[1] - share[:, None] * way, axis=1)
    exact = first * Rotation.from_rotvec(share[:, None] * turning)
    assert (np.diff(share) > 0).all(), share
    assert -0.02 < share[0] < share[-1] < 1.02, share
    seconds = _seconds(move, place)
    mm_s = float(share[-1] - share[0]) * length / seconds
    deg_s = np.abs(after - before) / seconds / machine.speeds_deg_s
    if line.travel:  # no joint faster than it can
        assert max(mm_s / line.speed_mm_s, deg_s.max()) < 1.01
        assert mm_s > 0.99 * line.speed_mm_s or deg_s.max() > 0.99 or seconds < 0.0011
    else:
        assert abs(mm_s - line.speed_mm_s) < 0.01 * line.speed_mm_s, (mm_s, line.speed_mm_s)
    return float(apart.max()), float((exact.inv() * turn).magnitude().max())


def _seconds(move: Move, before: Mapping[str, float]) -> float:
    """How long a block takes, as LinuxCNC counts its F."""
    assert move.feed is not None
    for letters in _COUNTED:
        length = np.linalg.norm([move.place[x] - before[x] for x in letters])
        if length > 1e-7:
            return float(60.0 * length / move.feed)
    raise AssertionError("a block that does not move")


def canonical(stdout: str) -> tuple[list[tuple[int, str]], list[bool]]:
    """What `rs274 -g` prints: after how many moves and dwells each token comes, and of each whether
    LinuxCNC stops exactly at its end."""
    tokens: list[tuple[int, str]] = []
    exact: list[bool] = []
    stopping = True
    for line in stdout.splitlines():
        found = re.search(r"N\S* +(\w+)(\(.*)?$", line)
        name, rest = (found[1], found[2] or "") if found else ("", "")
        if name == "SET_MOTION_CONTROL_MODE":
            stopping = "EXACT" in rest
        elif name in ("STRAIGHT_FEED", "STRAIGHT_TRAVERSE", "DWELL"):
            exact.append(stopping)
        elif name in ("START_SPINDLE_CLOCKWISE", "STOP_SPINDLE_TURNING"):
            tokens.append((len(exact), name))
        elif "AUX_OUTPUT" in name:
            number = re.match(r"\(([0-9]+)", rest)
            assert number
            value = name == "SET_AUX_OUTPUT_VALUE"
            tokens.append((len(exact), f"{name}({number[1]}" + ("" if value else ")")))
    return tokens, exact

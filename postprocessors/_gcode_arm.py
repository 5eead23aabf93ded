"""What a G-code program for an arm pours in for each hole and via: joints along straight ways.

LinuxCNC moves letters in proportion, and with the arm's joints on them no such move is straight.
So each hole brings the joints at evenly spaced depths, in numbered parameters, between which the
program's own routine goes to any depth; and each straight travel is a row of short moves. Both are
computed while they are written, for some rows at a time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from drillc.catalogue.model import JOINT_NAMES
from drillc.language.diagnostics import Report
from drillc.language.job import Floats
from drillc.output.numbers import Column, Fixed, fixed
from drillc.output.post import Task
from drillc.planning.arm_nodes import Nodes, place_nodes, steps_needed
from drillc.planning.arm_ways import ArmWays, Travels, arm_ways, outmost_mm
from numpy.typing import NDArray

Rows = NDArray[np.int64]

#: In the order in which one writes them.
LETTERS = ("X", "Y", "Z", "A", "B", "C", "U", "V", "W")
TURNING = ("A", "B", "C")
#: A feed is counted along the first of these whose letters move.
_COUNTED = (("X", "Y", "Z"), ("U", "V", "W"), TURNING)
#: The parameters that hold where the letters are.
_HERE = dict(zip("XYZABCUVW", range(5420, 5429), strict=True))
#: A letter that moves by less, in mm or degrees, does not move: that is how it is written.
_LEAST_MOVE = "0.00001"

#: How far the tool's point may leave its axis, and any point of arm and tool a straight travel,
#: between two places at which the joints are exact.
ON_AXIS_MM, ON_TRAVEL_MM = 0.01, 0.25

#: The number of steps is in the first parameter, the joints at their ends in those after it.
FIRST_PARAMETER = 100
#: The last of the parameters that LinuxCNC leaves to programs.
_LAST_PARAMETER = 5000

ANGLE_DECIMALS = 5
TIME_DECIMALS = 6
#: A step is given at least this time, which is LinuxCNC's own beat.
_LEAST_S = 0.001


@dataclass(frozen=True)
class _Axis:
    """A letter: which argument of the routine `o<_go>` it is, and which parameter says where."""

    letter: str
    place: int
    here: int


#: Rows whose steps are found together: bounds the memory.
_BLOCK = 2048


@dataclass(frozen=True, eq=False)
class NodeLines:
    """Per hole: the lines that load its joints, in degrees."""

    ways: ArmWays
    order: tuple[int, ...]  # the joints' indices, in the order of their letters
    steps: Rows  # (n,)

    @property
    def conversion(self) -> str:
        return "%s"

    def __len__(self) -> int:
        return len(self.steps)

    def cells(self, start: int, stop: int) -> list[str]:
        moves = self.ways.into_holes(start, stop)
        nodes = place_nodes(self.ways.cell, moves, self.steps[start:stop])
        return [_loaded(joints) for joints in _printed(nodes, self.order)]


@dataclass(frozen=True, eq=False)
class WayLines:
    """Per hole, or per via: the lines of the straight travel to it, none where there is none."""

    ways: ArmWays
    order: tuple[int, ...]
    travels: Callable[[int, int], Travels]  # ways.to_holes or ways.to_vias
    steps: Rows  # (n,) or (m,); 0: no travel

    @property
    def conversion(self) -> str:
        return "%s"

    def __len__(self) -> int:
        return len(self.steps)

    def cells(self, start: int, stop: int) -> list[str]:
        travels = self.travels(start, stop)
        nodes = place_nodes(self.ways.cell, travels.moves, self.steps[travels.rows])
        seconds = iter(self.ways.seconds(travels, nodes).tolist())
        cells = [""] * (stop - start)
        for row, joints in zip(travels.rows.tolist(), _printed(nodes, self.order), strict=True):
            cells[row - start] = _driven(joints[1:], seconds)
        return cells


def hole_columns(task: Task) -> dict[str, Column]:
    """`way`, the lines that travel straight to each hole, and `nodes`, those that load the joints
    along the tool's axis there."""
    ways, order = arm_ways(task.program), _order(task)
    into = np.empty(len(ways.program.holes), dtype=np.int64)
    for start, stop in _blocks(len(into)):
        moves = ways.into_holes(start, stop)
        into[start:stop] = steps_needed(ways.cell, moves, ON_AXIS_MM, "point")
    most = (_LAST_PARAMETER - FIRST_PARAMETER) // len(order) - 1
    if into.max(initial=0) > most:
        raise ValueError(f"hole {ways.program.holes.ids[into.argmax()]} needs {into.max()} steps")
    steps = _travel_steps(ways, ways.to_holes, len(into))
    return {
        "way": WayLines(ways, order, ways.to_holes, steps),
        "nodes": NodeLines(ways, order, into),
    }


def via_columns(task: Task) -> dict[str, Column]:
    """A column per letter, and `way`, the lines that travel straight to each via."""
    ways, order = arm_ways(task.program), _order(task)
    joints_deg = np.degrees(ways.arm.vias.joints)
    columns: dict[str, Column] = {
        task.axes[joint]: Fixed(joints_deg[:, joint], ANGLE_DECIMALS) for joint in order
    }
    steps = _travel_steps(ways, ways.to_vias, len(joints_deg))
    columns["way"] = WayLines(ways, order, ways.to_vias, steps)
    return columns


def arm_context(task: Task) -> dict[str, object]:
    """`joints` (joint, letter), `letters` in order, `home` as a block has it (empty: none), `first`
    parameter, `outmost` depth of a cycle, and for feeds `groups` of letters and the `least` move.
    """
    arm, order = task.program.arm, _order(task)
    assert arm is not None
    letters = tuple(task.axes[joint] for joint in order)
    axes = {x: _Axis(x, i + 1, _HERE[x]) for i, x in enumerate(letters)}
    groups = [[axes[x] for x in group if x in axes] for group in _COUNTED]
    return {
        "joints": tuple(zip(JOINT_NAMES, task.axes, strict=True)),
        "letters": letters,
        "home": "" if arm.arm.home_rad is None else _block(arm.arm.home_rad, task.axes, order),
        "first": FIRST_PARAMETER,
        "outmost": outmost_mm,
        "groups": [group for group in groups if group],
        "least": _LEAST_MOVE,
    }


def _block(joints: Floats, axes: Sequence[str], order: Sequence[int]) -> str:
    """Joints (6,) as words of a block: X0.00000 Y-90.00000 …"""
    joints_deg = np.degrees(joints).tolist()
    return " ".join(axes[i] + fixed(joints_deg[i], ANGLE_DECIMALS) for i in order)


def warn_of_lengths(task: Task, report: Report) -> None:
    """Six joints turn and three letters are angles, so three must be on lengths; warn if more."""
    left = [letter for letter in TURNING if letter not in task.axes]
    mapped = {target.text.upper(): (joint, target) for joint, target in task.emit.axes}
    lengths = [letter for letter in LETTERS if letter in mapped and letter not in TURNING]
    if not (task.axes and left):
        return
    joints = [mapped[letter][0].text for letter in lengths]
    report.warn(
        "W650",
        f"joints {', '.join(joints)} turn, but {', '.join(lengths)} are lengths: their degrees are"
        f" written as plain numbers, while {', '.join(left)} {'is' if len(left) == 1 else 'are'}"
        " free",
        mapped[lengths[0]][1].span,
        hint="X Y Z U V W are lengths and A B C angles, unless the machine's configuration says"
        " otherwise",
    )


def _order(task: Task) -> tuple[int, ...]:
    """The joints' indices, in the order of their letters."""
    return tuple(task.axes.index(letter) for letter in LETTERS if letter in task.axes)


def _travel_steps(ways: ArmWays, travels: Callable[[int, int], Travels], count: int) -> Rows:
    steps = np.zeros(count, dtype=np.int64)
    for start, stop in _blocks(count):
        some = travels(start, stop)
        steps[some.rows] = steps_needed(ways.cell, some.moves, ON_TRAVEL_MM, "bodies")
    return steps


def _blocks(count: int) -> Iterator[tuple[int, int]]:
    for start in range(0, count, _BLOCK):
        yield start, min(start + _BLOCK, count)


def _printed(nodes: Nodes, order: Sequence[int]) -> Iterator[list[list[str]]]:
    """Way by way, node by node: the joints in degrees, in the order of their letters."""
    joints_deg = np.degrees(nodes.joints[:, order]).tolist()
    for start, stop in pairwise(nodes.first.tolist()):
        yield [[fixed(q, ANGLE_DECIMALS) for q in row] for row in joints_deg[start:stop]]


def _loaded(joints: Sequence[Sequence[str]]) -> str:
    """The parameters: how many steps there are, then the joints at the end of each.

    >>> print(_loaded([["1.0", "2.0"], ["1.5", "2.5"]]))
    #100=1
    #101=1.0 #102=2.0
    #103=1.5 #104=2.5
    """
    lines, at = [f"#{FIRST_PARAMETER}={len(joints) - 1}"], FIRST_PARAMETER + 1
    for row in joints:
        lines.append(" ".join(f"#{at + i}={q}" for i, q in enumerate(row)))
        at += len(row)
    return "\n".join(lines)


def _driven(joints: Sequence[Sequence[str]], seconds: Iterator[float]) -> str:
    """A call for each step. The arm stops after each (G61): where LinuxCNC goes round the corner
    between two such steps (G64), it is up to half as fast again as it is told.

    >>> print(_driven([["1.0", "2.0"], ["1.5", "2.5"]], iter([0.5, 0.25])), end="")
    o<_go> call [1.0] [2.0] [0.500000]
    o<_go> call [1.5] [2.5] [0.250000]
    """
    calls = []
    for row in joints:
        places = " ".join(f"[{q}]" for q in row)
        time = fixed(max(next(seconds), _LEAST_S), TIME_DECIMALS)
        calls.append(f"o<_go> call {places} [{time}]\n")
    return "".join(calls)

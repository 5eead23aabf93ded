"""The Program: what the machine will do, still free of any controller's syntax.

A program is poses or joints in columns, a handful of cycles (the steps done at each hole of a
process), and sections: runs of holes that share a region and so a cycle. Posts read this and
nothing else. Along the tool axis, a step's place is a depth in mm: 0 at the hole's position,
positive into the part, so the standoff is at -approach_mm.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from drillc.language.job import (
    Arm,
    Floats,
    HoleTable,
    Ints,
    Process,
    Signal,
    Station,
    Tool,
    WorkFrame,
)
from drillc.language.source import Span

# ── steps of a cycle ─────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class MoveTo:
    """Straight along the tool axis to `depth_mm`."""

    depth_mm: float
    speed_mm_s: float
    kind: Literal["move"] = "move"


@dataclass(frozen=True)
class StartSpindle:
    """Spindle on, and wait until it runs where the cell says how to know (`spindle_running`)."""

    rev_s: float
    timeout_s: float
    kind: Literal["start_spindle"] = "start_spindle"


@dataclass(frozen=True)
class StopSpindle:
    """Spindle off."""

    kind: Literal["stop_spindle"] = "stop_spindle"


@dataclass(frozen=True)
class Plunge:
    """Feed from `from_mm` to the hole's own depth; with `peck_mm`, in pecks of at most that much,
    each followed by a withdrawal to `from_mm` and a return to `peck_gap_mm` before the last
    bottom."""

    from_mm: float
    feed_mm_s: float
    return_mm_s: float
    peck_mm: float | None
    peck_gap_mm: float
    kind: Literal["plunge"] = "plunge"


@dataclass(frozen=True)
class Dwell:
    """Stand still."""

    seconds: float
    kind: Literal["dwell"] = "dwell"


@dataclass(frozen=True)
class SwitchOutput:
    """Set the digital output `role`."""

    role: str
    on: bool
    kind: Literal["output"] = "output"


@dataclass(frozen=True)
class SetAnalog:
    """Set the analog output `role` to `value` (N, rev/s)."""

    role: str
    value: float
    kind: Literal["analog"] = "analog"


@dataclass(frozen=True)
class WaitInput:
    """Wait until the input `role` is on, at most `timeout_s`; on time-out run the cycle's fault
    steps, tell the operator, and stop the program."""

    role: str
    timeout_s: float
    kind: Literal["wait"] = "wait"


Step = MoveTo | StartSpindle | StopSpindle | Plunge | Dwell | SwitchOutput | SetAnalog | WaitInput


@dataclass(frozen=True)
class Cycle:
    """The routine of one process: begins and ends with the tool at or beyond its standoff.

    The travel before it brings the tool to depth -approach_mm. `fault` is what is done when a wait
    times out: everything off, and out.
    """

    process: Process
    steps: tuple[Step, ...]
    fault: tuple[Step, ...]


# ── the program ──────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Section:
    """Holes `start` … `stop` of one region, made by `cycles[cycle]`."""

    region: str
    cycle: int
    start: int
    stop: int
    span: Span


@dataclass(frozen=True)
class JointAxis:
    """A joint of the machine: its name in the spec; whether it turns (radians) or slides (mm)."""

    name: str
    rotary: bool


@dataclass(frozen=True, eq=False)
class JointMotion:
    """What a program in joints needs beside the joints (n, k).

    The tool moves along joint `feed_axis`; a depth of d mm is that joint plus `feed_sign` · d.
    `withdraw_mm` (n,) is where that joint goes before any other joint moves towards hole i.
    `speeds` are the joints' full speeds (mm/s or rad/s) where the spec gives them.
    """

    axes: tuple[JointAxis, ...]
    joints: Floats
    feed_axis: int
    feed_sign: Literal[1, -1]
    withdraw_mm: Floats
    speeds: tuple[float | None, ...]


@dataclass(frozen=True, eq=False)
class Vias:
    """Moves (m,) made beside the holes' cycles, in order: where an arm goes by joints (to begin a
    section, to change its branch, from and to home), and by which points it passes where the
    straight way is not clear.

    Via i is made just before the cycle of hole `before[i]` (n: after the last cycle), and ends with
    the tool (where the flange's tool centre point is) at `position_mm`, turned as `part_from_tool`,
    the joints at `joints`. `by_joints`: all joints move in proportion; else the tool moves in a
    straight line at the travel speed of that hole's process (of the last one's, at the end).
    """

    before: Ints  # (m,), not decreasing
    by_joints: NDArray[np.bool_]  # (m,)
    joints: Floats  # (m, 6)
    position_mm: Floats  # (m, 3), part coordinates
    part_from_tool: Floats  # (m, 3, 3)


@dataclass(frozen=True, eq=False)
class ArmMotion:
    """What a program in poses knows of the arm that runs it.

    `joints` (n, 6) with the tool at the hole's surface, `standoff_joints` (n, 6) where its cycle
    begins (depth -approach). With the vias, they say which of the arm's branches is meant. The
    first hole of every section is reached by a via with `by_joints` that ends at its standoff, or
    farther out on the hole's axis, from where the cycle's own first move leads straight in.
    """

    arm: Arm
    station: Station
    joints: Floats
    standoff_joints: Floats
    vias: Vias


@dataclass(frozen=True, eq=False)
class Program:
    """`part_from_tool` (n, 3, 3) orients the tool at each hole; `depth_mm` (n,) is how deep each is
    made. With `motion`, the program is written in joints, else in poses; `arm` is what a program in
    poses knows of its arm, where the spec describes one."""

    name: str
    frame: WorkFrame | None
    tool: Tool | None
    signals: dict[str, Signal]
    cycles: tuple[Cycle, ...]
    sections: tuple[Section, ...]
    holes: HoleTable
    part_from_tool: Floats
    depth_mm: Floats
    motion: JointMotion | None
    arm: ArmMotion | None = None

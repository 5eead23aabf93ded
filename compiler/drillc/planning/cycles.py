"""Process → cycle: the steps done at each hole, in an order that keeps tool, part and people whole.

Clamped before cut, spindle on before it nears the part, out before the spindle stops, everything
off and out when an answer fails to come.
"""

from __future__ import annotations

from collections.abc import Mapping

from drillc.language.job import Process, Signal
from drillc.planning.program import (
    Cycle,
    Dwell,
    MoveTo,
    Plunge,
    SetAnalog,
    StartSpindle,
    Step,
    StopSpindle,
    SwitchOutput,
    WaitInput,
)

#: How long a spindle may take to report that it runs.
SPINDLE_TIMEOUT_S = 5.0
#: After a peck's withdrawal the tool returns quickly to this far before the last bottom.
PECK_GAP_MM = 0.5


def cycle_of(process: Process, signals: Mapping[str, Signal]) -> Cycle:
    """The steps of one process, and what is done when one of its waits times out.

    The clamp's release is awaited where the cell has an input that tells of it.
    """
    steps: list[Step] = []
    drill, clamp, rivet = process.drill, process.clamp, process.rivet
    if drill is not None:
        steps.append(StartSpindle(drill.spindle_rev_s, SPINDLE_TIMEOUT_S))
    steps.append(MoveTo(0.0 - process.clearance_mm, process.approach_mm_s))
    if clamp is not None:
        if clamp.force_n is not None:
            steps.append(SetAnalog("clamp_force", clamp.force_n))
        steps.append(SwitchOutput("clamp", True))
        steps.append(WaitInput("clamped", clamp.handshake.timeout_s))
    if drill is not None:
        steps.append(
            Plunge(
                from_mm=0.0 - process.clearance_mm,
                feed_mm_s=drill.feed_mm_s,
                return_mm_s=process.retract_mm_s,
                peck_mm=drill.peck_mm,
                peck_gap_mm=PECK_GAP_MM,
            )
        )
        if drill.dwell_s > 0:
            steps.append(Dwell(drill.dwell_s))
        steps.append(MoveTo(0.0 - process.clearance_mm, process.retract_mm_s))
    if rivet is not None:
        steps.append(SwitchOutput("set", True))
        steps.append(WaitInput("set_done", rivet.handshake.timeout_s))
        steps.append(SwitchOutput("set", False))
    if clamp is not None:
        steps.append(SwitchOutput("clamp", False))
        if "released" in signals:
            steps.append(WaitInput("released", clamp.handshake.timeout_s))
    steps.append(MoveTo(0.0 - process.retract_mm, process.retract_mm_s))
    if drill is not None:
        steps.append(StopSpindle())
    return Cycle(process, tuple(steps), _fault(process))


def _fault(process: Process) -> tuple[Step, ...]:
    """Everything off, and out: to the farther standoff, since a wait may stand at either and the
    tool must not come nearer. No wait can time out while the drill is in the material."""
    steps: list[Step] = []
    if process.rivet is not None:
        steps.append(SwitchOutput("set", False))
    if process.clamp is not None:
        steps.append(SwitchOutput("clamp", False))
    out_mm = max(process.approach_mm, process.retract_mm)
    steps.append(MoveTo(0.0 - out_mm, process.retract_mm_s))
    if process.drill is not None:
        steps.append(StopSpindle())
    return tuple(steps)

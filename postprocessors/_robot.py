"""What the two robot languages, KRL and RAPID, have in common beside the base of all posts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from drillc.language.diagnostics import Label, Report
from drillc.language.job import Process, Signal
from drillc.output.acceptance import SPINDLE_SPEED
from drillc.output.numbers import fixed
from drillc.output.pouring import Rows
from drillc.planning.program import (
    Cycle,
    Dwell,
    JointMotion,
    MoveTo,
    Program,
    SetAnalog,
    StartSpindle,
    StopSpindle,
    SwitchOutput,
)

#: What an operator's message may hold, on either controller.
MESSAGE_LENGTH = 80

#: A speed is printed with as few decimals as keep it within this share of itself.
_SPEED_SHARE = 1e-4

#: What a fault may do. A wait in it could time out in turn, and a feed would go on cutting.
_FAULT_STEPS = (MoveTo, SwitchOutput, SetAnalog, StopSpindle, Dwell)


def speed_text(value: float, decimals: int = 3) -> str:
    """A speed with `decimals` digits, or more where it is so small that they would be felt.

    >>> speed_text(0.25), speed_text(0.005), speed_text(0.00416666)
    ('0.250', '0.005', '0.004167')
    """
    while decimals < 9 and abs(round(value, decimals) - value) > _SPEED_SHARE * abs(value):
        decimals += 1
    return fixed(value, decimals)


def rpm(rev_s: float) -> float:
    """A spindle's speed in turns a minute."""
    return rev_s * 60.0


def last_row(rows: Rows) -> Rows:
    """The last of `rows` alone, as `section.first` is the first."""
    return Rows(max(rows.start, rows.stop - 1), rows.stop)


def wait_message(routine: str, signal: str, role: str, timeout_s: float) -> str:
    """What the operator reads when `signal` (the controller's word for it) did not come.

    >>> wait_message("drill6", "$IN[14]", "clamped", 3.0)
    'drill6: no signal $IN[14] (clamped) within 3.000 s'
    """
    short = f"{routine}: no signal {signal}"
    known_as = "" if signal == role else f" ({role})"
    full = f"{short}{known_as} within {fixed(timeout_s, 3)} s"
    return full if len(full) <= MESSAGE_LENGTH else short[:MESSAGE_LENGTH]


def check_fault(cycle: Cycle) -> None:
    """Raises ValueError for a fault that no template could carry out: a bug in the planner."""
    for step in cycle.fault:
        if not isinstance(step, _FAULT_STEPS):
            raise ValueError(f"process {cycle.process.name}: a fault cannot do {step.kind}")


def analog_uses(program: Program) -> Iterator[tuple[Process, Signal, float]]:
    """Every value that an analog output is given: process, signal, value in base units."""
    for cycle in program.cycles:
        for step in (*cycle.steps, *cycle.fault):
            match step:
                case StartSpindle(rev_s=value):
                    signal = program.signals.get(SPINDLE_SPEED)
                case SetAnalog(role=role, value=value):
                    signal = program.signals.get(role)
                case _:
                    continue
            if signal is not None and signal.kind == "analog":
                yield cycle.process, signal, value


def analog_shown(signal: Signal, value: float) -> str:
    """An analog value in the unit in which people state it."""
    return f"{rpm(value):g} rpm" if signal.role == SPINDLE_SPEED else f"{value:g} N"


def check_full_scale(program: Program, code: str, report: Report) -> None:
    """An analog output cannot be given more than its full scale stands for, nor less than 0."""
    for process, signal, value in analog_uses(program):
        full = signal.full_scale
        if full is None or 0.0 <= value <= full:
            continue
        report.error(
            code,
            f"process {process.name} sets {signal.role} to {analog_shown(signal, value)}; the"
            f" signal reaches from 0 to {analog_shown(signal, full)}",
            process.span or signal.span,
            labels=[Label(signal.span, "its full scale")],
            hint="correct the value, or the signal's full scale",
        )


def clear_of_all_mm(program: Program, motion: JointMotion) -> float:
    """Where the feed joint is clear of every hole: as far out as any withdrawal and any retract."""
    sign = motion.feed_sign
    out = sign * motion.withdraw_mm
    hole = sign * motion.joints[:, motion.feed_axis]
    clear = float(out.min(initial=np.inf))
    for section in program.sections:
        moves = [s for s in program.cycles[section.cycle].steps if isinstance(s, MoveTo)]
        end = moves[-1].depth_mm if moves else -program.cycles[section.cycle].process.approach_mm
        rows = slice(section.start, section.stop)
        clear = min(clear, float(hole[rows].min(initial=np.inf)) + end)
    return sign * clear if np.isfinite(clear) else 0.0

"""Cycles: what is done at a hole, in an order that keeps tool, part and people whole.

The order is checked by walking through the steps with a small model of the machine, for every
process there can be.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field

import pytest
from drillc.language.job import Clamp, Countersink, Drill, Handshake, Process, Rivet, Signal
from drillc.language.source import Span
from drillc.planning.cycles import PECK_GAP_MM, SPINDLE_TIMEOUT_S, cycle_of
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
from hypothesis import given
from hypothesis import strategies as st
from language.texts import in_memory

SPAN = Span(in_memory("x"), 1, 1)
SIGNALS = {"released": Signal("released", "input", 3, None, None, SPAN)}
#: The input that answers an output, and the state of that output which it answers.
ANSWERS = {"clamped": ("clamp", True), "released": ("clamp", False), "set_done": ("set", True)}

LENGTHS = st.floats(0.001, 1e3)
DRILLS = st.builds(
    Drill,
    spindle_rev_s=st.floats(0.1, 500),
    feed_mm_s=st.floats(0.1, 50),
    depth_mm=LENGTHS,
    depth_from_stack=st.booleans(),
    peck_mm=st.none() | LENGTHS,
    dwell_s=st.just(0.0) | st.floats(0.001, 5),
)
CLAMPS = st.builds(
    Clamp, st.none() | st.floats(1, 1e4), st.builds(Handshake, st.floats(0.1, 9), st.just(SPAN))
)
RIVETS = st.builds(Rivet, st.builds(Handshake, st.floats(0.1, 9), st.just(SPAN)))


@st.composite
def processes(draw: st.DrawFn) -> Process:
    kind = draw(st.sampled_from(["drill", "rivet", "visit"]))
    clearance = draw(st.floats(0, 50)) if kind == "drill" else draw(st.just(0.0) | st.floats(0, 50))
    sink = Countersink(1.7, 1.0, None) if kind == "drill" and draw(st.booleans()) else None
    return Process(
        name="p",
        span=SPAN,
        approach_mm=clearance + draw(LENGTHS),
        clearance_mm=clearance,
        retract_mm=clearance + draw(LENGTHS),
        travel_mm_s=draw(st.floats(1, 1000)),
        approach_mm_s=draw(st.floats(1, 1000)),
        retract_mm_s=draw(st.floats(1, 1000)),
        clamp=draw(st.none() | CLAMPS),
        drill=draw(DRILLS) if kind == "drill" else None,
        countersink=sink,
        rivet=draw(RIVETS) if kind == "rivet" else None,
    )


@dataclass
class Machine:
    """The tool's depth, and what is on. Asserts what must hold at every step."""

    process: Process
    depth_mm: float
    turning: bool = False
    on: dict[str, bool] = field(default_factory=lambda: {"clamp": False, "set": False})
    force_set: bool = False

    def run(self, steps: Sequence[Step]) -> None:
        for step in steps:
            self.step(step)

    def step(self, step: Step) -> None:
        process = self.process
        match step:
            case StartSpindle():
                assert self.depth_mm <= -process.approach_mm, "on before it nears the part"
                self.turning = True
            case StopSpindle():
                assert self.depth_mm <= -process.retract_mm, "out before it stops"
                self.turning = False
            case MoveTo(depth_mm, speed_mm_s):
                assert speed_mm_s > 0
                assert depth_mm <= 0, "only a plunge goes into the part"
                if process.drill is not None and depth_mm > self.depth_mm:
                    assert self.turning
                self.depth_mm = depth_mm
            case Plunge(from_mm):
                assert self.turning
                assert self.depth_mm == from_mm, "the feed begins where the tool is"
                assert self.on["clamp"] == (process.clamp is not None), "clamped before the feed"
                self.depth_mm = 1.0
            case Dwell():
                assert self.depth_mm > 0, "a dwell is at the bottom"
            case SetAnalog():
                assert not self.on["clamp"], "the force is set before the clamp closes"
                self.force_set = True
            case SwitchOutput(role, on):
                assert self.depth_mm == -process.clearance_mm, "nothing closes or opens in the hole"
                self.on[role] = on
                if role == "clamp" and on and process.clamp and process.clamp.force_n is not None:
                    assert self.force_set
                if role == "set" and on:
                    assert self.on["clamp"] == (process.clamp is not None)
            case WaitInput(role):
                output, state = ANSWERS[role]
                assert self.on[output] == state, "an answer is awaited to what was switched"


def fault_from(cycle: Cycle, machine: Machine) -> None:
    """Everything off, and out: whatever was on, and never towards the part."""
    process = machine.process
    out_mm = max(process.approach_mm, process.retract_mm)
    for step in cycle.fault:
        if isinstance(step, SwitchOutput):
            assert not step.on
            machine.on[step.role] = False
        elif isinstance(step, MoveTo):
            assert not any(machine.on.values()), "off before out"
            assert step.depth_mm <= machine.depth_mm, "never nearer"
            machine.depth_mm = step.depth_mm
        else:
            assert isinstance(step, StopSpindle)
            assert machine.depth_mm == -out_mm
            machine.turning = False
    assert machine.depth_mm == -out_mm
    assert not machine.turning
    assert not any(machine.on.values())


@given(processes(), st.booleans())
def test_every_cycle_is_in_order(process: Process, tells_released: bool) -> None:
    cycle = cycle_of(process, SIGNALS if tells_released else {})
    machine = Machine(process, -process.approach_mm)
    machine.run(cycle.steps)
    assert machine.depth_mm == -process.retract_mm
    assert not machine.turning
    assert not any(machine.on.values())
    plunges = [step for step in cycle.steps if isinstance(step, Plunge)]
    assert len(plunges) == (process.drill is not None)
    waits = [step for step in cycle.steps if isinstance(step, WaitInput)]
    wanted = {"set_done"} if process.rivet else set()
    if process.clamp:
        wanted |= {"clamped", "released"} if tells_released else {"clamped"}
    assert {wait.role for wait in waits} == wanted
    assert len(waits) == len(wanted)


@given(processes(), st.booleans())
def test_whatever_answer_fails_to_come(process: Process, tells_released: bool) -> None:
    """At every wait the cycle may end instead: with everything off, the tool out and no turning."""
    cycle = cycle_of(process, SIGNALS if tells_released else {})
    for i, step in enumerate(cycle.steps):
        if isinstance(step, WaitInput):
            machine = Machine(process, -process.approach_mm)
            machine.run(cycle.steps[:i])
            assert machine.depth_mm <= 0, "no wait while the drill is in the material"
            assert step.timeout_s > 0
            fault_from(cycle, machine)


@given(processes())
def test_every_wait_answers_the_step_before_it(process: Process) -> None:
    """So that no answer of an earlier hole is taken for this one's."""
    steps = cycle_of(process, SIGNALS).steps
    for before, step in itertools.pairwise(steps):
        if isinstance(step, WaitInput):
            assert isinstance(before, SwitchOutput)
            assert (before.role, before.on) == ANSWERS[step.role]


def process_of(**given: object) -> Process:
    base = {"name": "p", "span": SPAN, "approach_mm": 60.0, "clearance_mm": 2.0}
    base |= {"retract_mm": 80.0, "travel_mm_s": 250.0, "approach_mm_s": 40.0, "retract_mm_s": 90.0}
    return Process(**(base | given))  # type: ignore[arg-type]


DRILL = Drill(50.0, 5.0, 12.0, False, 3.0, 0.2)
CLAMP = Clamp(600.0, Handshake(3.0, SPAN))


def test_a_whole_drilling_cycle() -> None:
    cycle = cycle_of(process_of(drill=DRILL, clamp=CLAMP), SIGNALS)
    assert cycle.steps == (
        StartSpindle(50.0, SPINDLE_TIMEOUT_S),
        MoveTo(-2.0, 40.0),
        SetAnalog("clamp_force", 600.0),
        SwitchOutput("clamp", True),
        WaitInput("clamped", 3.0),
        Plunge(-2.0, 5.0, 90.0, 3.0, PECK_GAP_MM),
        Dwell(0.2),
        MoveTo(-2.0, 90.0),
        SwitchOutput("clamp", False),
        WaitInput("released", 3.0),
        MoveTo(-80.0, 90.0),
        StopSpindle(),
    )
    assert cycle.fault == (SwitchOutput("clamp", False), MoveTo(-80.0, 90.0), StopSpindle())


def test_a_whole_riveting_cycle() -> None:
    rivet = Rivet(Handshake(5.0, SPAN))
    clamp = Clamp(None, Handshake(3.0, SPAN))
    cycle = cycle_of(process_of(rivet=rivet, clamp=clamp, clearance_mm=0.0), {})
    assert cycle.steps == (
        MoveTo(0.0, 40.0),
        SwitchOutput("clamp", True),
        WaitInput("clamped", 3.0),
        SwitchOutput("set", True),
        WaitInput("set_done", 5.0),
        SwitchOutput("set", False),
        SwitchOutput("clamp", False),
        MoveTo(-80.0, 90.0),
    )
    assert cycle.fault == (
        SwitchOutput("set", False),
        SwitchOutput("clamp", False),
        MoveTo(-80.0, 90.0),
    )


def test_a_mere_visit() -> None:
    cycle = cycle_of(process_of(clearance_mm=0.0), SIGNALS)
    assert cycle.steps == (MoveTo(0.0, 40.0), MoveTo(-80.0, 90.0))
    assert cycle.fault == (MoveTo(-80.0, 90.0),)
    depth = cycle.steps[0]
    assert isinstance(depth, MoveTo)
    assert str(depth.depth_mm) == "0.0"  # not -0.0


@pytest.mark.parametrize("dwell", [0.0, 0.001])
def test_a_dwell_of_nothing_is_none(dwell: float) -> None:
    drill = Drill(50.0, 5.0, 12.0, False, None, dwell)
    steps = cycle_of(process_of(drill=drill), {}).steps
    assert [s for s in steps if isinstance(s, Dwell)] == ([Dwell(dwell)] if dwell else [])

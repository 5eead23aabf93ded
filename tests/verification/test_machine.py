"""The machine in lanes against the plainest possible way: one lane after another."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from drillc.verification.events import Alternative, Events, Kind, joined
from drillc.verification.machine import UNDECIDED, Machine
from drillc.verification.reading import ReadError
from drillc.verification.statements import (
    At,
    Call,
    Do,
    Exit,
    Forever,
    If,
    Repeated,
    Return,
    Routine,
    Statement,
    While,
)
from hypothesis import given
from hypothesis import strategies as st

FILE = 0


def at(line: int) -> At:
    return At(FILE, line)


def assign(line: int, name: str, value: object) -> Do:
    """`value` is a number, or a function of the machine."""

    def act(m: Machine) -> None:
        m.locals[name] = value(m) if callable(value) else value

    return Do(at(line), act)


def move_to(line: int, name: str) -> Do:
    """The axis goes to the variable; the event tells where it came from, too."""

    def act(m: Machine) -> None:
        came, goes = np.broadcast_arrays(m.state["x"], m.locals[name], np.zeros(m.lanes))[:2]
        m.emit(Kind.STRAIGHT, joints=np.stack([came, goes], axis=-1))
        m.state["x"] = m.locals[name]

    return Do(at(line), act)


def pecking() -> Routine:
    """Goes down in steps of 3 until `depth` and waits; without an answer it goes to -1 for good."""

    def not_answered(m: Machine) -> bool:
        return not m.wait("in", 1.0, 2.5)

    return Routine(
        "peck",
        (
            assign(10, "z", 0.0),
            While(
                at(11),
                lambda m: m.locals["z"] + 3.0 < m.locals["depth"],
                (assign(12, "z", lambda m: m.locals["z"] + 3.0), move_to(13, "z")),
            ),
            move_to(14, "depth"),
            If(
                at(15),
                not_answered,
                (
                    assign(16, "z", -1.0),
                    move_to(17, "z"),
                    Forever(at(18), (assign(19, "z", -1.0),)),
                ),
            ),
        ),
    )


def calls(depths: list[float], routine: Routine) -> Repeated:
    def enter(m: Machine) -> dict[str, object]:
        return {"depth": m.column(0), "z": 0.0}

    lines = np.arange(len(depths), dtype=np.int32)[:, None] + 1
    call = Call(at(1), lambda: routine, enter)
    return Repeated(FILE, lines, (call,), (np.array(depths),))


def one_by_one(depths: list[float], routine: Routine) -> tuple[Statement, ...]:
    def call(i: int, depth: float) -> Call:
        return Call(at(i + 1), lambda: routine, lambda m: {"depth": depth, "z": 0.0})

    return tuple(call(i, depth) for i, depth in enumerate(depths))


def machine() -> Machine:
    return Machine(("from", "to"), {"locals": [{}], "x": 100.0})


def run(*body: Statement) -> tuple[list[list[float]], list[Alternative]]:
    """Rows (kind, line, call line, from, to) of the main run, and the alternatives."""
    steps = list(machine().run(Routine("main", body, steps=True)))
    events = [step for step in steps if isinstance(step, Events)]
    return rows(joined(events)), [step for step in steps if isinstance(step, Alternative)]


def rows(e: Events) -> list[list[float]]:
    table = np.column_stack([e.kind, e.line, e.call_line, np.nan_to_num(e.joints, nan=-99.0)])
    return [list(row) for row in table.tolist()]


def by_hand(depths: list[float]) -> Iterator[list[float]]:
    x = 100.0
    for i, depth in enumerate(depths):
        z = 0.0
        while z + 3.0 < depth:
            z += 3.0
            yield [Kind.STRAIGHT, 13, i + 1, x, z]
            x = z
        yield [Kind.STRAIGHT, 14, i + 1, x, depth]
        x = depth
        yield [Kind.WAIT, 15, i + 1, -99.0, -99.0]


@given(st.lists(st.sampled_from([0.5, 2.0, 3.0, 4.5, 7.0, 10.0]), min_size=1, max_size=12))
def test_lanes_do_what_one_after_another_does(depths: list[float]) -> None:
    together, others = run(calls(depths, pecking()))
    apart, others_apart = run(*one_by_one(depths, pecking()))
    assert together == apart == list(by_hand(depths))
    assert sum(len(other.call_line) for other in others) == len(depths) == len(others_apart)
    stopped = sorted(
        [float(other.call_line[lane]), *rows(other.events.take(slice(begin, end)))]
        for other in others
        for lane, (begin, end) in enumerate(
            zip(other.starts[:-1].tolist(), other.starts[1:].tolist(), strict=True)
        )
    )
    assert stopped == [
        [
            float(i + 1),
            [Kind.STRAIGHT, 17, i + 1, depth, -1.0],
            [Kind.STOP, 18, i + 1, -99.0, -99.0],
        ]
        for i, depth in enumerate(depths)
    ]
    assert all(other.ends and other.timeout and other.line == 15 for other in others)


def test_a_variable_with_its_first_value_in_a_lane_is_run_one_by_one() -> None:
    def act(m: Machine) -> None:
        m.state.setdefault("seen", 0.0)
        m.emit(Kind.PAUSE, value=m.state["seen"])
        m.state["seen"] = m.state["seen"] + m.column(0)

    lines = np.arange(5, dtype=np.int32)[:, None] + 1
    body = (Repeated(FILE, lines, (Do(at(1), act),), (np.array([1.0, 2, 3, 4, 5]),)),)
    steps = machine().run(Routine("main", body, steps=True))
    values = np.concatenate([step.value for step in steps if isinstance(step, Events)])
    # each lane adds to what the lane before left, so no guess is ever consistent but the true one
    assert values.tolist() == [0.0, 1.0, 3.0, 6.0, 10.0]


def test_a_statement_of_the_body_has_its_own_line_in_each_lane() -> None:
    lines = np.array([[4, 5], [7, 8], [10, 11]], dtype=np.int32)
    pause = [Do(at(line), lambda m: m.emit(Kind.PAUSE, value=1.0)) for line in (4, 5)]
    found, _ = run(Repeated(FILE, lines, tuple(pause), ()))
    assert [row[1] for row in found] == [4, 5, 7, 8, 10, 11]
    assert [row[2] for row in found] == [4, 5, 7, 8, 10, 11]


def test_the_program_ends_where_a_lane_stops() -> None:
    stop = If(at(2), lambda m: m.column(0) > 2.0, (Do(at(3), Machine.stop),))
    pause = Do(at(1), lambda m: m.emit(Kind.PAUSE, value=m.column(0)))
    lines = np.array([[1, 2]] * 4, dtype=np.int32)
    found, _ = run(Repeated(FILE, lines, (pause, stop), (np.array([1.0, 2, 3, 4]),)), pause)
    assert [row[0] for row in found] == [Kind.PAUSE, Kind.PAUSE, Kind.PAUSE, Kind.STOP]


def test_what_nobody_knows_is_looked_at_both_ways() -> None:
    out = Do(at(2), lambda m: m.emit(Kind.PAUSE, value=1.0))
    on = Do(at(3), lambda m: m.emit(Kind.PAUSE, value=2.0))
    ask = If(at(1), lambda m: UNDECIDED, (out,))
    found, others = run(ask, on)
    assert [row[1] for row in found] == [3]
    assert [(o.timeout, o.ends, o.events.line.tolist()) for o in others] == [(False, False, [2])]


def test_loops_end_by_exit_and_routines_by_return() -> None:
    pause = Do(at(2), lambda m: m.emit(Kind.PAUSE, value=1.0))
    inner = Routine("inner", (Forever(at(1), (pause, Exit(at(3)))), pause, Return(at(4)), pause))
    found, _ = run(Call(at(9), lambda: inner, lambda m: {}), pause)
    assert [row[2] for row in found] == [9, 9, 2]


def test_what_is_done_before_a_return_is_told() -> None:
    pause = Do(at(2), lambda m: m.emit(Kind.PAUSE, value=1.0))
    found, _ = run(If(at(1), lambda m: True, (pause, Return(at(3)))), pause)
    assert [row[1] for row in found] == [2]


def test_an_exit_outside_of_a_loop_is_refused() -> None:
    inner = Routine("inner", (If(at(1), lambda m: True, (Exit(at(2)),)),))
    with pytest.raises(ReadError, match="there is no loop to be left"):
        run(Forever(at(4), (Call(at(5), lambda: inner, lambda m: {}),)))


def test_what_never_ends_is_refused() -> None:
    count = assign(1, "n", lambda m: m.locals.get("n", 0.0) + 1.0)
    with pytest.raises(ReadError, match="has not ended after 100,000 turns"):
        run(Forever(at(1), (count,)))
    endless = Routine("endless", ())
    again = Call(at(2), lambda: endless, lambda m: {})
    object.__setattr__(endless, "body", (again,))
    with pytest.raises(ReadError, match="call one another without an end"):
        run(again)

"""Programs in poses: good ones are proven with figures that rounding explains, and every fault of
one event is found by its check, in words that name hole and line."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from drillc.planning.program import Program
from drillc.verification.events import Kind, ToolFrame
from drillc.verification.proof import verify_program
from drillc.verification.reading import ReadError
from drillc.verification.verdict import Verdict
from output import programs
from scipy.spatial.transform import Rotation
from verification.proof.made import HandReader, HandRun, emit_of, job_of, run_of

Row = dict[str, Any]


def prove(program: Program, run: HandRun, chunk: int = 50) -> Verdict:
    return verify_program(run, HandReader(), job_of(program), program, {}, emit_of(), chunk)


def failing(verdict: Verdict) -> set[str]:
    return {check.name for check in verdict.checks if check.failed}


def message(verdict: Verdict, check: str) -> str:
    failure = verdict.check(check).failures[0]
    return f"{failure.file}:{failure.line}: {failure.message}"


# ── good programs ────────────────────────────────────────────────────────────────────────────────

GOOD = {
    "drill": lambda: programs.pose_drill(7),
    "pecks": lambda: programs.pose_drill(7, peck_mm=3.0, clamp=True),
    "rivets": lambda: programs.pose_program([("a", 0, 6)], [programs.rivet_cycle()]),
    "visits": lambda: programs.pose_program([("a", 0, 6)], [programs.visit_cycle()]),
    "mixed": programs.mixed,
    "no speed": lambda: programs.without_signal(programs.pose_drill(4), "spindle_speed"),
    "no answer": lambda: programs.without_signal(programs.pose_drill(4), "spindle_running"),
    "one": lambda: programs.pose_drill(1),
}


@pytest.mark.parametrize("name", GOOD)
@pytest.mark.parametrize("chunk", [3, 40, 10_000])
def test_good_programs_are_proven(name: str, chunk: int) -> None:
    program = GOOD[name]()
    verdict = prove(program, run_of(program), chunk)
    assert verdict.passed, [f for c in verdict.checks for f in c.failures]
    assert verdict.check("coverage").compared == len(program.holes)
    assert verdict.check("process").compared == len(program.holes)
    position, axis = verdict.check("position"), verdict.check("axis")
    assert position.worst is not None
    assert position.worst <= np.sqrt(3.0) * 0.0005
    assert axis.worst is not None
    assert axis.worst <= 1.5e-4


def test_a_program_without_holes_is_proven() -> None:
    program = programs.pose_program([], [])
    run = HandRun([{"kind": Kind.HOME, "file": 0, "line": 3, "call_file": 0, "call_line": 3}], [])
    assert prove(program, run).passed


def test_figures_do_not_hang_on_how_the_run_is_cut() -> None:
    program = programs.mixed()
    one, two = (prove(program, run_of(program), chunk) for chunk in (3, 10_000))
    assert one == two


# ── faults of one event ──────────────────────────────────────────────────────────────────────────

PECKED = programs.pose_program(
    [("upper", 0, 4), ("lower", 1, 4)],
    [programs.drill_cycle(peck_mm=3.0, clamp=True), programs.rivet_cycle()],
)


def of(run: HandRun, hole: int, kind: Kind, nth: int = 0, role: str | None = None) -> int:
    """The index of a row."""
    found = [
        i
        for i, row in enumerate(run.rows)
        if row["hole"] == hole
        and row["kind"] == kind
        and row["file"] == 1
        and (role is None or row.get("role") == role)
    ]
    return found[nth]


def shift(run: HandRun, hole: int, by: Any, nth: int | None = None) -> None:
    """All moves of a hole, or one, along the part's axes."""
    moves = [i for i, row in enumerate(run.rows) if row["hole"] == hole and "position_mm" in row]
    for i in moves if nth is None else [of(run, hole, Kind.STRAIGHT, nth)]:
        run.rows[i]["position_mm"] = run.rows[i]["position_mm"] + np.array(by)


def along(run: HandRun, hole: int, nth: int, by: float) -> None:
    row = run.rows[of(run, hole, Kind.STRAIGHT, nth)]
    row["position_mm"] = row["position_mm"] + by * row["rotation"][:, 2]


def turn(run: HandRun, hole: int, axis: str, deg: float) -> None:
    """All moves of a hole, about the hole in the tool's own frame."""
    for row in run.rows:
        if row["hole"] == hole and "position_mm" in row:
            old, new = row["rotation"], None
            new = old @ Rotation.from_euler(axis, deg, degrees=True).as_matrix()
            centre = PECKED.holes.position_mm[hole]
            depth = (row["position_mm"] - centre) @ old[:, 2]
            row["position_mm"] = np.round(centre, 3) + depth * new[:, 2]
            row["rotation"] = new


def change(run: HandRun, hole: int, kind: Kind, role: str | None = None, **values: Any) -> None:
    run.rows[of(run, hole, kind, 0, role)].update(values)


def drop(run: HandRun, index: int) -> None:
    if run.rows[index]["kind"] == Kind.WAIT:
        waits = [i for i, row in enumerate(run.rows) if row["kind"] == Kind.WAIT]
        run.faults.pop(waits.index(index))
    run.rows.pop(index)


def insert(run: HandRun, index: int, **row: Any) -> None:
    like = {k: run.rows[index - 1][k] for k in ("file", "line", "call_file", "call_line", "hole")}
    run.rows.insert(index, {**like, **row})


def drop_hole(run: HandRun, hole: int) -> None:
    for i in [i for i, row in enumerate(run.rows) if row["hole"] == hole and row["file"] == 1][
        ::-1
    ]:
        drop(run, i)


def rows_of(run: HandRun, hole: int) -> list[Row]:
    return [row for row in run.rows if row["hole"] == hole and row["file"] == 1]


def swap(run: HandRun, one: int, two: int) -> None:
    a, b = rows_of(run, one), rows_of(run, two)
    start = run.rows.index(a[0])
    assert run.rows[start : start + len(a) + len(b)] == a + b
    run.rows[start : start + len(a) + len(b)] = b + a


def double(run: HandRun, hole: int) -> None:
    own = rows_of(run, hole)
    start = run.rows.index(own[-1]) + 1
    copies = [{**row, "call_line": row["call_line"] + 50} for row in own]
    run.rows[start:start] = copies
    waits = [row for row in run.rows[:start] if row["kind"] == Kind.WAIT]
    count = sum(row["kind"] == Kind.WAIT for row in own)
    run.faults[len(waits) : len(waits)] = run.faults[len(waits) - count : len(waits)]


def swap_rows(run: HandRun, one: int, two: int) -> None:
    run.rows[one], run.rows[two] = run.rows[two], run.rows[one]


def move_tool(run: HandRun, by: Any) -> None:
    frame = run.frames[0]
    assert frame.position_mm is not None
    run.frames[0] = ToolFrame(frame.name, frame.rotation, frame.position_mm + by)


Fault = Callable[[HandRun], object]
#: P1 … P4 are drilled (0 … 3), P5 … P8 riveted (4 … 7).
FAULTS: dict[str, tuple[Fault, str, str]] = {
    "a hole moved by 3.2 mm": (
        lambda r: shift(r, 1, (0, 3.2, 0)),
        "position",
        "hand/body.src:101: P2 is made",
    ),
    "a hole moved by 0.01 mm": (
        lambda r: shift(r, 1, (0.01, 0.01, 0)),
        "position",
        "P2 is made 0.0",
    ),
    "a hole moved far": (
        lambda r: shift(r, 5, (500.0, 40.0, -90.0)),
        "position",
        "P6 is made",
    ),
    "tilted by 0.001 deg": (lambda r: turn(r, 2, "y", 0.001), "axis", "at P3 is 0.0010 deg off"),
    "tilted by 5 deg": (lambda r: turn(r, 2, "x", 5.0), "axis", "at P3 is 5.0000 deg"),
    "upside down": (lambda r: turn(r, 2, "x", 180.0), "axis", "at P3 is 180.0000 deg"),
    "turned by 0.001 deg": (
        lambda r: turn(r, 6, "z", 0.001),
        "heading",
        "the tool at P7 is turned 0.0010 deg",
    ),
    "turned by 90 deg": (
        lambda r: turn(r, 6, "z", 90.0),
        "heading",
        "the tool at P7 is turned 90.0000 deg",
    ),
    "too deep": (
        lambda r: along(r, 0, 14, 0.01),
        "depth",
        "P1 is made 12.010 mm deep, the spec asks for 12.000 mm",
    ),
    "far too deep": (
        lambda r: along(r, 0, 14, 25.0),
        "depth",
        "P1 is made 37.000 mm deep",
    ),
    "a peck too deep": (
        lambda r: along(r, 0, 2, 0.01),
        "depth",
        "a peck at P1 goes to 1.010 mm, the spec asks for 1.000 mm",
    ),
    "comes too near": (
        lambda r: along(r, 1, 0, 1.0),
        "standoffs",
        "the standoff at P2 ends at depth -59.000 mm",
    ),
    "leaves too near": (
        lambda r: along(r, 7, 2, 0.1),
        "standoffs",
        "the retract at P8 ends at depth -49.900 mm",
    ),
    "no retract": (
        lambda r: drop(r, of(r, 1, Kind.STRAIGHT, -1)),
        "standoffs",
        "the retract at P2 ends at depth -2.000 mm, the spec asks for -60.000 mm",
    ),
    "slips aside": (
        lambda r: shift(r, 2, (1.0, 0.0, 0.0), 14),
        "straight",
        "the tool leaves its axis at P3",
    ),
    "slips aside by little": (
        lambda r: shift(r, 2, (0.01, 0.01, 0.0), 14),
        "straight",
        "the tool leaves its axis at P3 by 0.01",
    ),
    "by the joints": (
        lambda r: r.rows[of(r, 4, Kind.STRAIGHT, 1)].update(kind=Kind.JOINTS),
        "straight",
        "at P5 the move is made by the joints, not straight",
    ),
    "feed": (
        lambda r: r.rows[of(r, 3, Kind.STRAIGHT, 2)].update(speed_mm_s=50.0),
        "speed",
        "a peck at P4 is made with 50 mm/s, the spec asks for 5 mm/s",
    ),
    "feed by little": (
        lambda r: r.rows[of(r, 3, Kind.STRAIGHT, 2)].update(speed_mm_s=5.002),
        "speed",
        "a peck at P4",
    ),
    "travel": (
        lambda r: r.rows[of(r, 3, Kind.STRAIGHT, 0)].update(speed_mm_s=2500.0),
        "speed",
        "the standoff at P4 is made with 2500 mm/s",
    ),
    "no clamp": (
        lambda r: drop(r, of(r, 1, Kind.OUTPUT, 0, "clamp")),
        "process",
        "clamp on is missing at P2",
    ),
    "no wait": (
        lambda r: drop(r, of(r, 1, Kind.WAIT, 0, "clamped")),
        "handshake",
        "the wait for clamped is missing at P2",
    ),
    "no spindle": (
        lambda r: drop(r, of(r, 1, Kind.OUTPUT, 0, "spindle_on")),
        "process",
        "spindle_on on is missing at P2",
    ),
    "clamp off in place of on": (
        lambda r: change(r, 1, Kind.OUTPUT, "clamp", value=0.0),
        "process",
        "clamp on is missing at P2; instead there is",
    ),
    "clamp after the wait": (
        lambda r: swap_rows(r, of(r, 5, Kind.OUTPUT, 0), of(r, 5, Kind.WAIT, 0)),
        "process",
        "P6",
    ),
    "spindle speed": (
        lambda r: change(r, 0, Kind.ANALOG, "spindle_speed", value=0.3),
        "signals",
        "the program says 0.3",
    ),
    "dwell": (
        lambda r: change(r, 0, Kind.PAUSE, value=5.0),
        "process",
        "the dwell of 0.5 s at P1: the program says 5, the spec asks for 0.5",
    ),
    "no dwell": (lambda r: drop(r, of(r, 0, Kind.PAUSE)), "process", "the dwell of 0.5 s is miss"),
    "wait for ever": (
        lambda r: change(r, 5, Kind.WAIT, timeout_s=np.inf),
        "handshake",
        "the wait for clamped at P6 lasts for ever, the spec asks for 3 s",
    ),
    "another time-out": (
        lambda r: change(r, 5, Kind.WAIT, timeout_s=3.002),
        "handshake",
        "the wait for clamped at P6 lasts for 3.002 s",
    ),
    "an unknown output": (
        lambda r: insert(
            r,
            of(r, 2, Kind.PAUSE),
            kind=Kind.OUTPUT,
            value=1.0,
            signal=r.signals.setdefault("output 99", len(r.signals)),
        ),
        "signals",
        "output 99 on at P3 is not in the spec",
    ),
    "a pause too many": (
        lambda r: insert(r, of(r, 2, Kind.STRAIGHT, 3), kind=Kind.PAUSE, value=1.0),
        "process",
        "a pause of 1 s at P3 is not in the spec",
    ),
    "a halt": (
        lambda r: insert(r, of(r, 2, Kind.STRAIGHT, 3), kind=Kind.PAUSE, value=np.inf),
        "process",
        "a halt at P3 is not in the spec",
    ),
    "a message": (
        lambda r: insert(r, of(r, 2, Kind.STRAIGHT, 3), kind=Kind.MESSAGE),
        "process",
        "a message to the operator at P3 is not in the spec",
    ),
    "clamp on the way": (
        lambda r: insert(
            r,
            of(r, 3, Kind.STRAIGHT, 0),
            kind=Kind.OUTPUT,
            value=1.0,
            signal=r.signals.get("output 18", 0),
        ),
        "process",
        "",
    ),
    "a hole left out": (lambda r: drop_hole(r, 2), "coverage", "P3 is never made"),
    "the last left out": (lambda r: drop_hole(r, 7), "coverage", "P8 is never made"),
    "holes swapped": (lambda r: swap(r, 5, 6), "order", "P6 is made after P7"),
    "a hole doubled": (
        lambda r: double(r, 2),
        "coverage",
        "hand/body.src:152: P3 is made again; it is made before in hand/body.src:102",
    ),
    "a riveted hole doubled": (lambda r: double(r, 5), "coverage", "P6 is made again"),
    "a place too many": (
        lambda r: insert(
            r,
            of(r, 6, Kind.STRAIGHT, 0),
            kind=Kind.STRAIGHT,
            position_mm=np.array([1.0, 2.0, 3.0]),
            rotation=np.eye(3),
            speed_mm_s=300.0,
            tool=0,
            base=1,
        ),
        "ways",
        "a move to (1.000, 2.000, 3.000) mm before P7 is not planned",
    ),
    "by the joints to a hole": (
        lambda r: r.rows[of(r, 2, Kind.STRAIGHT, 0)].update(kind=Kind.JOINTS),
        "ways",
        "the way to P3 is made by the joints, a straight one is planned",
    ),
    "another tool": (
        lambda r: (
            r.frames.append(ToolFrame("4", r.frames[0].rotation, r.frames[0].position_mm))
            or r.rows[of(r, 2, Kind.STRAIGHT, 2)].update(tool=2)
        ),
        "frames",
        "tool 4 is active, the spec asks for tool 3",
    ),
    "the tool's data": (
        lambda r: move_tool(r, np.array([0.0, 0.0, 0.1])),
        "frames",
        "tool 3 is 0.100 mm away from where the spec has it",
    ),
    "another base": (
        lambda r: r.frames.__setitem__(1, ToolFrame("1")),
        "frames",
        "base 1 is active, the spec asks for base 2",
    ),
    "no base": (
        lambda r: r.rows[of(r, 2, Kind.STRAIGHT, 2)].update(base=-1),
        "frames",
        "no base is active",
    ),
}


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("chunk", [30, 10_000])
def test_each_fault_is_found_by_its_check(name: str, chunk: int) -> None:
    do, check, words = FAULTS[name]
    run = run_of(PECKED)
    do(run)
    verdict = prove(PECKED, run, chunk)
    assert check in failing(verdict), [
        f"{c.name}: {f.message}" for c in verdict.checks for f in c.failures
    ]
    said = [f"{f.file}:{f.line}: {f.message}" for f in verdict.check(check).failures]
    assert any(words in one for one in said), said


@pytest.mark.parametrize(
    ("fault", "check"),
    [
        (lambda r: shift(r, 1, (0, 0.0003, 0.0003)), "position"),
        (lambda r: turn(r, 2, "y", 0.0001), "axis"),
        (lambda r: turn(r, 2, "z", 0.0001), "heading"),
        (lambda r: along(r, 0, 14, 0.0005), "depth"),
        (lambda r: along(r, 0, 0, 0.0005), "standoffs"),
        (lambda r: r.rows[of(r, 3, Kind.STRAIGHT, 2)].update(speed_mm_s=5.0004), "speed"),
        (lambda r: change(r, 5, Kind.WAIT, timeout_s=3.0005), "handshake"),
    ],
)
def test_what_rounding_explains_is_no_fault(fault: Fault, check: str) -> None:
    run = run_of(PECKED)
    fault(run)
    verdict = prove(PECKED, run)
    assert verdict.passed, [f for c in verdict.checks for f in c.failures]
    figure = verdict.check(check)
    assert figure.worst is not None
    assert figure.limit is not None
    assert 0.3 * figure.limit < figure.worst <= figure.limit


# ── what is done where an answer does not come ───────────────────────────────────────────────────


#: The first wait at P5, for the clamp, with the tool at the surface; P1 … P4 wait three times each.
RIVET = 12

FAULTY: dict[str, tuple[Fault, str]] = {
    "goes on": (lambda r: setattr(r, "ends", False), "the program goes on"),
    "no stop": (lambda r: r.faults[RIVET].pop(), "the end of the program is missing"),
    "no message": (lambda r: r.faults[RIVET].pop(-2), "a message to the operator is missing"),
    "no retract": (
        lambda r: r.faults[RIVET].pop(
            next(i for i, row in enumerate(r.faults[RIVET]) if row["kind"] == Kind.STRAIGHT)
        ),
        "the move to -50.000 mm is missing",
    ),
    "nothing": (lambda r: r.faults[RIVET].clear(), "missing"),
    "clamp stays": (
        lambda r: r.faults[RIVET].pop(
            next(i for i, row in enumerate(r.faults[RIVET]) if row.get("role") == "clamp")
        ),
        "clamp off is missing",
    ),
    "not far enough": (
        lambda r: _out(r, RIVET, 20.0),
        "the tool goes to depth -30.000 mm, the spec asks for -50.000 mm",
    ),
    "by the joints": (
        lambda r: [row.update(kind=Kind.JOINTS) for row in r.faults[RIVET] if "tool" in row],
        "by the joints, not straight",
    ),
}


def _out(run: HandRun, nth: int, by: float) -> None:
    for row in run.faults[nth]:
        if "position_mm" in row:
            row["position_mm"] = row["position_mm"] + by * row["rotation"][:, 2]


@pytest.mark.parametrize("name", FAULTY)
def test_what_follows_a_time_out_is_proven(name: str) -> None:
    do, words = FAULTY[name]
    run = run_of(PECKED)
    do(run)
    verdict = prove(PECKED, run)
    assert failing(verdict) == {"handshake"}
    assert words in message(verdict, "handshake")


# ── the rest ─────────────────────────────────────────────────────────────────────────────────────


def test_other_pecks_are_told_once_for_all_holes_of_a_routine() -> None:
    program = programs.pose_drill(6, peck_mm=3.0)
    run = run_of(programs.pose_drill(6, peck_mm=4.0))
    verdict = prove(program, run)
    check = verdict.check("process")
    assert check.failed == 6
    assert "pecks at P1 are 4.000 mm, the spec asks for 3.000 mm" in check.failures[0].message
    assert check.failures[0].span is not None
    assert check.failures[0].span.line == 40
    assert check.failures[0].file == "hand/routines.src"


def test_only_ten_failures_are_named_and_all_are_counted() -> None:
    program = programs.pose_drill(40)
    run = run_of(program)
    for hole in range(30):
        shift(run, hole, (0.0, 0.1, 0.0))
    check = prove(program, run).check("position")
    assert check.failed == 30
    assert len(check.failures) == 10


def test_a_read_error_is_a_failure_and_nothing_is_missing_for_it() -> None:
    program = programs.pose_drill(5)
    run = run_of(program)
    run.rows = run.rows[: len(run.rows) // 2]
    run.error = ReadError(0, 77, 3, "what is FOO?")
    verdict = prove(program, run)
    assert failing(verdict) == {"reads"}
    assert message(verdict, "reads") == "hand/body.src:77: what is FOO?"


def test_a_wait_of_which_nothing_is_known_fails() -> None:
    program = programs.pose_drill(3)
    run = run_of(program)
    quiet = HandRun(
        [{**row, "kind": row["kind"]} for row in run.rows],
        run.faults,
        run.axes,
        run.signals,
        run.frames,
    )
    quiet.steps = lambda: (step for step in run.steps() if not hasattr(step, "timeout"))  # type: ignore[method-assign]
    verdict = prove(program, quiet)
    assert failing(verdict) == {"handshake"}
    assert verdict.check("handshake").failed == 3

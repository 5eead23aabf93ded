"""What the reader makes of G-code: events, alternatives, findings, and errors in their place."""

from __future__ import annotations

import math
from dataclasses import fields
from functools import partial

import numpy as np
import pytest
from drillc.language.job import Signal
from drillc.verification.events import Alternative, Events, Kind, joined
from drillc.verification.gcode import sources, structure
from drillc.verification.gcode.reader import GcodeReader
from drillc.verification.reading import ReadError
from output.programs import PORTAL_AXES, drill_cycle, joint_program, rivet_cycle, span
from verification.gcode.running import Ran, run, text_of
from verification.gcode.test_judged import ARM_AXES, CORPUS, arm_of_many_holes, emitted

# ── events ───────────────────────────────────────────────────────────────────────────────────────


def moves(ran: Ran) -> Events:
    return ran.events.take(ran.events.kind == Kind.STRAIGHT)


def test_a_rapid_has_no_speed_and_axes_begin_anywhere() -> None:
    events = run(text_of("G0 X1 B-2")).events
    assert events.joints[0, [0, 4]].tolist() == [1.0, -2.0]
    assert np.isnan(events.joints[0, [1, 2, 3, 5, 6, 7, 8]]).all()
    assert math.isnan(events.speed_mm_s[0])
    assert math.isnan(events.value[0])
    assert events.line.tolist() == events.call_line.tolist() == [2]


@pytest.mark.parametrize(
    ("lines", "seconds", "speed"),
    [
        (["G1 X3 Y4 A90 F60"], 5.0, 1.0),  # along X Y Z
        (["G1 U3 V4 A90 F120"], 2.5, 2.0),  # else along U V W
        (["G1 A3 B4 F30"], 10.0, 0.5),  # else in degrees
        (["G20", "G1 X1 F1"], 60.0, 25.4 / 60.0),
        (["G20", "G1 A90 F90"], 60.0, 1.5),
        (["G20 F1", "G21", "G1 X25.4"], 1524.0, 1 / 60.0),  # F20 mm: before units change
        (["G93 G1 X10 F2"], 30.0, 1.0 / 3.0),
        (["S600 M3", "G95 G1 X10 F0.5"], 2.0, 5.0),
        (["G91 G1 X3 F60", "G90"], 3.0, 1.0),
        (["F60 G81 Z-5 R0"], None, None),
    ],
)
def test_the_time_of_a_feed(lines: list[str], seconds: float | None, speed: float | None) -> None:
    ran = run(text_of("G0 X0 Y0 Z0 A0 B0 U0 V0", *lines))
    made = moves(ran)
    fed = made.take(~np.isnan(made.value))
    if seconds is None:
        assert (fed.value.tolist(), fed.speed_mm_s.tolist()) == ([5.0], [1.0])
    else:
        assert fed.value.tolist() == pytest.approx([seconds])
        assert fed.speed_mm_s.tolist() == pytest.approx([speed])


def test_signals_spindle_and_pauses_in_order() -> None:
    ran = run(
        text_of(
            "S3000 M3",
            "M64 P1 (clamp)",
            "M68 E2 Q0.25",
            "M66 P3 L3 Q5",
            "G4 P0.5",
            "M4",
            "S600",
            "M65 P1",
            "M62 P7",
            "M67 E1 Q1",
            "G0 X1",
            "M5",
            "M8",
            "(MSG, done)",
            "M0",
        )
    )
    assert ran.said() == [
        "SPINDLE 50",
        "OUTPUT out 1 1",
        "ANALOG analog 2 0.25",
        "WAIT in 3 1",
        "PAUSE 0.5",
        "SPINDLE -50",
        "SPINDLE -10",
        "OUTPUT out 1 0",
        "OUTPUT out 7 1",
        "ANALOG analog 1 1",
        "SPINDLE 0",
        "OUTPUT flood 1",
        "MESSAGE nan",
        "PAUSE inf",
    ]
    assert ran.kinds().index("STRAIGHT") == 10  # M62 and M67 come with the move
    assert ran.events.timeout_s[3] == 5.0


def test_an_answer_that_does_not_come() -> None:
    ran = run(
        text_of(
            "o<a> sub",
            "M66 P1 L3 Q2.5",
            "o1 if [#5399 EQ -1]",
            "G0 Z9",
            "(MSG,no)",
            "M2",
            "o1 endif",
            "G0 Z#1",
            "o<a> endsub",
            "o<a> call [5]",
        )
    )
    assert ran.kinds() == ["WAIT", "STRAIGHT"]
    (other,) = ran.others
    assert other.timeout
    assert other.ends
    assert (other.line, other.call_line.tolist()) == (3, [11])
    assert other.events.kind.tolist() == [Kind.STRAIGHT, Kind.MESSAGE, Kind.STOP]
    assert other.events.joints[0, 2] == 9.0


def test_where_the_machine_stands_at_first_is_looked_at_both_ways() -> None:
    ran = run(text_of("o1 if [#5422 LT 5]", "G0 Z5", "o1 endif", "G0 X1"))
    assert ran.kinds() == ["STRAIGHT"]
    (other,) = ran.others
    assert (other.timeout, other.ends, other.events.joints[0, 2]) == (False, False, 5.0)


def test_a_line_that_may_be_deleted_is_looked_at_both_ways() -> None:
    ran = run(text_of("/G0 X1", "G0 X2"))
    assert ran.events.joints[:, 0].tolist() == [1.0, 2.0]
    (other,) = ran.others
    assert (len(other.events), other.ends, other.timeout) == (0, False, False)


def test_the_normal_end_is_no_event_and_others_are() -> None:
    assert run("G21 G90 G0 X1\nM30\n").kinds() == ["STRAIGHT"]
    assert run("G21 G90 G0 X1\nM2\nG0 X2\nM2\n").kinds() == ["STRAIGHT", "STOP"]
    assert run("%\nG21 G90 G0 X1\n%\n").kinds() == ["STRAIGHT"]


@pytest.mark.parametrize(
    ("text", "codes"),
    [
        ("G90 G0 X1\nM2\n", "G20 or G21"),
        ("G21 G0 X1\nM2\n", "G90 or G91"),
        ("o<a> sub\nG1 X1 F100\no<a> endsub\nG21\no<a> call\nM2\n", "G90 or G91"),
    ],
)
def test_nothing_moves_before_units_and_distances_are_stated(text: str, codes: str) -> None:
    with pytest.raises(ReadError, match=f"a move before {codes}: what was active before is not"):
        run(text)


def test_names_of_places_are_comments() -> None:
    ran = run(text_of("(hole P7)", "G0 X1", "G0 X2", "(to home)", "G0 X3"))
    assert [ran.run.name_of(0, line) for line in (3, 4, 6, 1)] == ["P7", "P7", "to home", None]


def test_signals_and_values_are_named_as_in_the_events() -> None:
    reader = GcodeReader()
    analog = Signal("clamp_force", "analog", 2, 2000.0, "ao_force", span(1))
    assert reader.signal_name(analog, {}) == "analog 2"
    assert reader.analog_value(analog, 500.0) == 0.25
    assert reader.signal_name(Signal("a", "input", 3, None, None, span(1)), {}) == "in 3"
    assert reader.signal_name(Signal("a", "output", 4, None, None, span(1)), {}) == "out 4"


# ── in bulk and line by line ─────────────────────────────────────────────────────────────────────


def both_ways(files: dict[str, bytes], monkeypatch: pytest.MonkeyPatch) -> tuple[Ran, Ran]:
    bulk = run(files)
    with monkeypatch.context() as patched:
        patched.setattr(structure, "groups", lambda *_: iter(()))
        return bulk, run(files)


def assert_same(one: Events, two: Events) -> None:
    assert len(one) == len(two)
    for column in fields(Events):
        ours, theirs = getattr(one, column.name), getattr(two, column.name)
        np.testing.assert_allclose(ours, theirs, atol=1e-9, err_msg=column.name)


def assert_same_runs(bulk: Ran, single: Ran) -> None:
    assert_same(bulk.events, single.events)
    assert bulk.run.signals.keys() == single.run.signals.keys()
    one, two = _by_lane(bulk.others), _by_lane(single.others)
    assert one.keys() == two.keys()
    for key in one:
        assert_same(one[key], two[key])
    assert bulk.findings == single.findings


def _by_lane(others: list[Alternative]) -> dict[tuple[int, ...], Events]:
    found = {}
    for other in others:
        for lane, (file, line) in enumerate(
            zip(other.call_file.tolist(), other.call_line.tolist(), strict=True)
        ):
            rows = slice(int(other.starts[lane]), int(other.starts[lane + 1]))
            key = (file, line, other.file, other.line, int(other.timeout), int(other.ends))
            assert key not in found
            found[key] = other.events.take(rows)
    return found


def test_a_portal_in_bulk(monkeypatch: pytest.MonkeyPatch) -> None:
    program = joint_program(
        [("upper", 0, 40), ("lower", 1, 30), ("rim", 0, 25)],
        [drill_cycle(peck_mm=3.0, clamp=True), rivet_cycle()],
    )
    for holes_per_module in (10_000, 20):
        files = emitted(program, PORTAL_AXES, holes_per_module=holes_per_module)
        bulk, single = both_ways(files, monkeypatch)
        assert_same_runs(bulk, single)
        assert len(_by_lane(bulk.others)) == 40 * 3 + 30 * 3 + 25 * 3


@pytest.mark.parametrize("letters", ["XYZABC", "UVWABC"])
def test_an_arm_in_bulk(monkeypatch: pytest.MonkeyPatch, letters: str) -> None:
    axes = {f"A{i + 1}": letter for i, letter in enumerate(letters)}
    for holes_per_module in (10_000, 11):
        files = emitted(arm_of_many_holes(), axes, holes_per_module=holes_per_module)
        assert_same_runs(*both_ways(files, monkeypatch))


#: What may stand in a routine: routines do not nest, and N stands first.
INNER = [name for name, text in CORPUS.items() if not any(w in text for w in (" sub", "M2", "N10"))]


@pytest.mark.parametrize("name", INNER)
def test_every_construct_twelve_times(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a routine that is called with other numbers, so that it runs in lanes."""
    lines = ["o<it> sub", *CORPUS[name].split("\n"), "G90 G21 G94 G17", "o<it> endsub", "G0 Z20"]
    lines += [f"G0 X{i} Y{i * i}\no<it> call [{i}]" for i in range(12)]
    files = {"p.ngc": text_of("#41=1", "#1=2", "G0 X0 Y0 Z20", *lines).encode()}
    assert_same_runs(*both_ways(files, monkeypatch))


def test_lines_that_follow_from_one_another(monkeypatch: pytest.MonkeyPatch) -> None:
    """Each lane begins where the one before ended, and no guess but the true one agrees."""
    files = {"p.ngc": text_of("G0 X0", "G91", *[f"G0 X{i}" for i in range(20)]).encode()}
    bulk, single = both_ways(files, monkeypatch)
    assert_same_runs(bulk, single)
    assert bulk.events.joints[-1, 0] == 190.0


def test_shapes_are_parsed_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many holes there are."""
    parsed, counts = sources.parsed, []

    def told(shape: str, seen: list[str]) -> object:
        seen.append(shape)
        return parsed(shape)

    for holes in (30, 300):
        seen: list[str] = []
        with monkeypatch.context() as patched:
            patched.setattr(sources, "parsed", partial(told, seen=seen))
            run(emitted(joint_program([("a", 0, holes)], [rivet_cycle()]), PORTAL_AXES))
        counts.append(len(seen))
    assert counts[0] == counts[1]


@pytest.mark.parametrize("arm", [False, True], ids=["portal", "arm"])
def test_many_holes_are_run_in_few_batches(arm: bool) -> None:
    """Else each would take its own time, and a large program for ever."""

    def batches(holes: int) -> int:
        if arm:
            files = emitted(arm_of_many_holes(holes), ARM_AXES)
        else:
            program = joint_program([("a", 0, holes)], [drill_cycle(peck_mm=3.0)])
            files = emitted(program, PORTAL_AXES)
        (program_run,) = GcodeReader().read(files)
        return sum(isinstance(step, Events) for step in program_run.steps())

    assert batches(48) <= batches(24) + 2


# ── findings ─────────────────────────────────────────────────────────────────────────────────────


def found(ran: Ran) -> list[tuple[str, int, str]]:
    return [(f.check, f.line, f.message) for f in ran.findings]


CUT = "the move before this one ends in a corner that G64 rounds off: G61 stops there"


@pytest.mark.parametrize(
    ("lines", "cut"),
    [
        (["G64", "G0 Z0", "G1 Z5 F100", "G1 Z0"], [4, 5]),
        (["G64 P0.1", "G0 Z0", "G1 Z5 F100", "G1 Z0"], [4, 5]),
        (["G64", "G0 Z0", "M64 P1", "G1 Z5 F100", "G1 Z0"], [6]),
        (["G64 P0.0005", "G0 Z0", "G1 Z5 F100", "G1 Z0"], []),
        (["G61", "G0 Z0", "G1 Z5 F100", "G1 Z0"], []),
        (["G61", "G0 Z0", "G64", "G1 Z5 F100", "G4 P0", "G1 Z0"], []),
        (["G61", "G0 Z0", "G64", "G1 Z5 F100", "M64 P1", "G1 Z0"], []),
        (["G61", "G0 Z0", "G64", "G1 Z5 F100", "M66 P1 L3 Q1", "G1 Z0"], []),
        (["G61", "G0 Z0", "G64", "G1 Z5 F100", "M62 P1", "G1 Z0"], [7]),
        (["G61", "G0 Z0 Y0", "G64", "G1 Z5 F100", "G1 Z6", "G1 Z7 Y0.01"], []),
        (["G61", "G0 Z0", "G64", "G1 Z5 F100", "G1 Z7 Y0.01"], [6]),  # from where in Y?
        (["G61", "G0 Z0 Y0", "G64", "G1 Z5 F100", "G61", "G1 Y5", "G1 Y0"], [7]),
    ],
)
def test_a_corner_that_is_cut(lines: list[str], cut: list[int]) -> None:
    first = "G21 G90 G94 G54"
    ran = run("\n".join([first, *lines, "M2", ""]))
    assert found(ran) == [("process", line, CUT) for line in cut]
    assert "MESSAGE" not in ran.kinds()


def test_without_a_word_linuxcnc_rounds_corners() -> None:
    assert found(run("G21 G90\nG0 X0\nG0 X5\nG0 X0\nM2\n")) == [
        ("process", line, CUT) for line in (3, 4)
    ]


def test_a_corner_in_every_lane_has_its_line() -> None:
    lines = ["o<a> sub", "G1 Z#1 F100", "G1 Z0", "o<a> endsub", "G0 Z0", "G64"]
    holes = [f"G0 X{i}\no<a> call [5]" for i in range(9)]
    assert {line for _, line, _ in found(run(text_of(*lines, *holes)))} == {3, 4, *range(10, 25, 2)}


def test_routines_that_nothing_calls() -> None:
    files = {
        "p.ngc": b"o<a> sub\no<a> endsub\nG21 G90 G0 X1\nM2\n",
        "b.ngc": b"o<b> sub\no<b> endsub\n",
    }
    assert found(run(files)) == [
        ("used", 1, "nothing calls o<a>"),
        ("used", 1, "nothing calls o<b>"),
    ]


def test_lines_that_are_never_run() -> None:
    files = {
        "p.ngc": b"G21 G90\no<b> call\nM2\n",
        "b.ngc": b"o<b> sub\nG0 X1\no<b> endsub\nG0 X2\n",
    }
    assert found(run(files)) == [("rules", 4, "this stands outside of o<b>: never run")]
    assert found(run("%\nG21 G90 G0 X1\n%\nG0 X2\n")) == [
        ("rules", 4, "after the second % nothing is read")
    ]


def test_characters_beyond_ascii() -> None:
    (finding,) = run("G21 G90 G0 X1 (Loch \u00e4)\nM2\n").findings
    assert (finding.line, finding.column, finding.message) == (
        1,
        21,
        "a character that is not ASCII",
    )


# ── errors ───────────────────────────────────────────────────────────────────────────────────────

#: A line after `G21 G90`, and the column and the words of what is wrong with it.
ERRORS = [
    ("G1 X1,5", 6, "',' is not understood here: a number has a decimal point, no comma"),
    ("G0 X1.2.3", 8, "'.' is not understood here: a number has one decimal point"),
    ("G0 X1e3", 6, "E without a code that uses it: numbers have no exponent"),
    ("G0 X", 5, "the line ends where more is expected"),
    ("G0 X[1+2", 9, "the line ends where more is expected"),
    ("G0 X1 (a) 5", 11, "'5' is not understood here"),
    ("G0 X(a) 5", 5, "a comment where none is expected"),
    ("G0 X1 X2", 7, "X is given twice in one block"),
    ("G0 G1 X1", 4, "G0 and G1 in one block: they exclude each other"),
    ("G90 G91", 5, "G90 and G91 in one block: they exclude each other"),
    ("M3 M5", 4, "M3 and M5 in one block: they exclude each other"),
    ("M3 M8 M48 M64 P1 M0", 1, "more than 4 M codes in one block"),
    ("G2 X1 I1", 1, "G2 is not taken: an arc, while a hole is drilled and left straight"),
    ("G28", 1, "G28 is not taken: it goes to a place that only the machine knows"),
    ("G55", 1, "G55 is not taken: where another coordinate system is in G54 is not known"),
    ("G92 X0", 1, "G92 is not taken: an offset moves the holes"),
    ("G43 H1", 1, "G43 is not taken: the tool's length is the machine's"),
    ("G53 G0 X1", 1, "G53 is not taken: where the machine's own coordinates are in G54"),
    ("T1 M6", 1, "T: a tool is selected; the spec was planned for one"),
    ("M6", 1, "M6 is not taken: another tool is not what the spec was planned for"),
    ("G12", 1, "G12 is not understood"),
    ("M199", 1, "M199 is not understood"),
    ("G[1]", 1, "G with a computed number is not understood"),
    ("G0 X1 P1", 7, "P without a code that uses it"),
    ("G0 X1 R1", 7, "R without a code that uses it"),
    ("G0 X1 I1", 7, "I: it belongs to arcs"),
    ("G4", 1, "G4 without P"),
    ("M64", 1, "M64 without P"),
    ("M66 L3 Q1", 1, "M66 without P: an analog input is not waited for"),
    ("M68 Q1", 1, "M68 without E"),
    ("G80 X1", 5, "X beside G80, which moves nothing"),
    ("G81 R1", 1, "G81 without an axis"),
    ("N10 G0 N20", 8, "'n' is not understood here: a line's number N stands first"),
    ("G0 o1 if [1]", 4, "'o' is not understood here: an O-word stands first"),
    ("%", 1, "'%' is not understood here: % stands alone in the first line"),
    ("G0 X1 (a", 7, "a comment is not closed, or none is open"),
    ("G0 X1 )", 7, "a comment is closed, but none is open"),
    ("(a (b) c)", 4, "a comment within a comment"),
    ("G0 X\u00e4", 5, "'\u00e4' is not understood here"),
    ("G0 X1 \x01", 7, "a control character (1)"),
    ("G0 X1 (" + "a" * 246 + ")", 253, "the line has 254 characters; LinuxCNC takes 252"),
    ("o<a> call", 1, "o<a> is called, but there is neither such a sub nor a file a.ngc"),
    ("o<a> call" + " [1]" * 31, 1, "o<a> is called"),
    ("o1 endif", 1, "o1 endif belongs to nothing before it"),
    ("o1 if [1]", 1, "o1 if is never closed"),
    ("o1 while [1]", 1, "o1 while is never closed"),
    ("o1 repeat [1]\no2 endrepeat", 1, "o1 repeat is never closed"),
    ("o1 break", 1, "o1 break is not in a loop o1 of its own"),
    ("o<a> sub", 1, "o<a> sub has no endsub"),
    ("o<a> endsub", 1, "o<a> endsub ends no routine"),
    ("o<a> sub\no<b> endsub", 1, "o<b> endsub ends o<a> sub"),
    ("o<a> sub\no<b> sub", 1, "o<b> sub within o<a>"),
    ("o<a> sub\no<a> endsub\no<a> sub\no<a> endsub", 1, "o<a> is defined twice"),
    ("o<a> call\no<a> sub\no<a> endsub", 1, "o<a> stands after its call"),
    ("o1 if [1]\no1 endif\no1 if [1]\no1 endif", 1, "o1 stands for line 2 already"),
    ("o1 if [1]\no1 else\no1 elseif [1]\no1 endif", 1, "o1 elseif after else"),
    ("/o1 if [1]\no1 endif", 1, "an O-word that / may delete is not understood"),
    ("o1", 3, "the line ends where more is expected"),
    ("o1 if 1", 7, "a number where none is expected"),
    # while it runs
    ("X1", 1, "X, but no code says how to move"),
    ("G1 X1", 1, "a feed before any F"),
    ("F0\nG1 X1", 1, "a feed with F0: the machine would stand still"),
    ("F-1", 1, "F is negative"),
    ("S-1", 1, "S is negative"),
    ("G4 P-1", 1, "a dwell of less than no time"),
    ("G93 G1 X1 F1\nX2", 1, "G1 without F, while G93 counts F anew in each block"),
    ("G95 G1 X1 F1", 1, "a feed per turn of a spindle without speed"),
    ("M66 P1 L3", 1, "M66 without a time to wait for (Q)"),
    ("M66 P1", 1, "M66 L0 only looks at the input: what it sees is not known"),
    ("M64 P1.5", 1, "P is 1.5, which is no whole number"),
    ("G0 X#1", 1, "parameter #1 is read before it has a value"),
    ("G0 X#100", 1, "parameter #100 is read before it has a value"),
    ("G0 X#<a>", 1, "parameter #<a> is read before it has a value"),
    ("G0 X#5221", 1, "parameter #5221 is the machine's: its value is not known"),
    ("#5420 = 1", 1, "parameter #5420 is the machine's: a program cannot set it"),
    ("#<_x> = 1", 1, "parameter #<_x> is the machine's: a program cannot set it"),
    ("#0 = 1", 1, "there is no parameter #0"),
    ("G0 X[1/0]", 1, "a division by zero"),
    ("G0 X[1 MOD 0]", 1, "a division by zero"),
    ("G0 XSQRT[-1]", 1, "SQRT of a negative number"),
    ("G0 XLN[0]", 1, "LN of a number that is not positive"),
    ("G0 XACOS[2]", 1, "ACOS of more than 1"),
    ("G0 X[-2 ** 0.5]", 1, "a negative number to a power that is not whole"),
    ("G0 Z5 F9\nG81 X1 Z1", 1, "G81 without R"),
    ("G0 Z5 F9\nG81 X1 R1", 1, "G81 without Z"),
    ("G0 Z5 F9\nG82 X1 R1 Z0", 1, "G82 without P"),
    ("G0 Z5 F9\nG83 X1 R1 Z0", 1, "G83 without Q"),
    ("G0 Z5 F9\nG83 X1 R1 Z0 Q0", 1, "G83 with a Q that is not positive"),
    ("G0 Z5 F9\nG81 X1 Z2 R1", 1, "G81 with R below Z"),
    ("G0 Z5 F9\nG81 X1 A2 Z0 R1", 1, "A within G81, which drills along Z only"),
    ("G0 Z5\nG93 G81 X1 Z0 R1 F1", 1, "G81 with G93: a cycle takes no time of its own"),
    ("F9 G81 X1 Z0 R1", 1, "G81 begins where Z is not known"),
    ("G0 Z5\nX1 R1", 1, "R, Q or L without a cycle that uses it"),
    ("o1 while [1]\nG4 P0\no1 endwhile", 1, "the loop has not ended after 100,000 turns"),
    ("o<a> sub\no<a> call\no<a> endsub\no<a> call", 1, "routines call one another without an end"),
]


@pytest.mark.parametrize(("lines", "column", "message"), ERRORS, ids=[e[0][:24] for e in ERRORS])
def test_what_is_refused(lines: str, column: int, message: str) -> None:
    text = f"G21 G90\n{lines}\nM2\n"
    with pytest.raises(ReadError) as raised:
        run({"p.ngc": text.encode("latin-1")})
    assert raised.value.message.startswith(message)
    assert (raised.value.file, raised.value.column) == (0, column)
    assert 2 <= raised.value.line <= 2 + lines.count("\n")


def test_a_program_ends() -> None:
    with pytest.raises(ReadError, match="the program ends without M2, M30 or %") as raised:
        run("G21 G90\nG0 X1\n\n")
    assert raised.value.line == 2


def test_an_error_in_a_routines_file_says_so() -> None:
    files = {
        "p.ngc": b"G21 G90\no<b> call\nM2\n",
        "b.ngc": b"o<b> sub\n  G1 X1,5\no<b> endsub\n",
    }
    with pytest.raises(ReadError) as raised:
        run(files)
    assert (raised.value.file, raised.value.line, raised.value.column) == (1, 2, 8)


def test_an_error_in_one_of_many_lines_has_its_line() -> None:
    lines = [f"G0 X{i}" for i in range(30)]
    lines[17] = "G0 X1,7"
    with pytest.raises(ReadError) as raised:
        run(text_of(*lines))
    assert (raised.value.line, raised.value.column) == (19, 6)
    lines = [f"G0 X[1/{i}]" for i in range(-17, 13)]
    with pytest.raises(ReadError, match="division") as raised:
        run(text_of(*lines))
    assert raised.value.line == 19


def test_a_folder_without_a_program() -> None:
    with pytest.raises(ReadError, match="but no program"):
        GcodeReader().read({"b.ngc": b"o<b> sub\no<b> endsub\n"})
    assert GcodeReader().read({"names.csv": b"a,b\n"}) == []


def test_programs_come_by_name_with_their_own_routines() -> None:
    files = {
        "b.ngc": b"o<r10> call\no<r2> call\nM2\n",
        "a.ngc": b"G0 X1\nM2\n",
        "r2.ngc": b"o<r2> sub\no<r2> endsub\n",
        "r10.ngc": b"o<r10> sub\no<r10> endsub\n",
    }
    runs = GcodeReader().read(files)
    assert [run.name for run in runs] == ["a", "b"]
    assert list(runs[1].files) == ["b.ngc", "r2.ngc", "r10.ngc"]


def test_events_of_many_holes_come_in_parts() -> None:
    files = emitted(
        joint_program([("a", 0, 60)], [rivet_cycle()]), PORTAL_AXES, holes_per_module=20
    )
    (program,) = GcodeReader().read(files)
    parts = [step for step in program.steps() if isinstance(step, Events) and len(step)]
    assert len(parts) >= 3
    assert sorted(set(joined(parts).call_file.tolist())) == [0, 1, 2, 3]

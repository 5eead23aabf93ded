"""What the reader finds fault with, and what it refuses: each with its text and its place."""

from __future__ import annotations

import pytest
from drillc.verification.krl.reader import KrlReader
from drillc.verification.reading import ReadError
from verification.krl.running import crlf, finding, program, ran, read, run

F = "{X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}"
P = f"DECL E6POS P={F}\n"
#: Line numbers: the body of `program` begins in line 8, its data in line 4.
BODY, DATA = 8, 4


def found(body: str, data: str = "", **more: str) -> list[str]:
    return run(body, data, **more).findings()


def refused(body: str = "", data: str = "", **more: str) -> tuple[int, int, int, str]:
    with pytest.raises(ReadError) as caught:
        run(body, data, **more)
    error = caught.value
    return error.file, error.line, error.column, error.message


def test_a_program_without_fault() -> None:
    assert found("  PTP P\n  WAIT SEC 0\n  $OUT[1]=TRUE\n", P) == []


# ── plain text ───────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        (b"WAIT SEC 1\r\n", b"WAIT SEC 1\n", 9, "the line does not end in CR and LF"),
        (b"END\r\n", b"END", 10, "the last line has no end"),
        (b"  WAIT", b"  ; \xe9\r\n  WAIT", 9, "the character '\\xe9' is not plain ASCII"),
        (b"  WAIT", b"  ;FOLD a\r\n  WAIT", 9, "the fold is not closed"),
        (b"  WAIT", b"  ;ENDFOLD\r\n  WAIT", 9, "ENDFOLD closes no fold"),
        (b"  WAIT", b'  MsgNotify("' + 81 * b"x" + b'")\r\n  WAIT', 9, "81 characters, of 80"),
        (b"WAIT SEC 1", b"WAIT SEC 1" + 480 * b" " + b"+1", 9, "more than 470 characters"),
        (b"CELL(", b"OTHER(", 3, "the module is called OTHER, its file CELL"),
        (b"END\r\n", b"; " + 2_000_000 * b"x" + b"\r\nEND\r\n", 1, "more than 2 MB"),
    ],
)
def test_rules_for_text(old: bytes, new: bytes, line: int, message: str) -> None:
    files = program("  PTP $H_POS\n  WAIT SEC 1\n")
    source = files["krl/CELL.src"]
    assert ran(read(files)).findings() == []
    (run_,) = KrlReader().read({**files, "krl/CELL.src": source.replace(old, new)})
    ((check, at, said),) = [finding(f) for f in run_.findings()]
    assert (check, at) == ("rules", line)
    assert message in said


def test_what_the_editor_hides_is_no_code() -> None:
    body = '  ;FOLD PTP P;%{PE}%R 8.3\n  PTP P ; to "P"\n  ;ENDFOLD\n'
    assert found(body, P) == []


# ── names and declarations ───────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (f"DECL E6POS A_NAME_OF_25_LETTERS_EXAC={F}\n", "has 25 characters, of 24"),
        (f"DECL E6POS FRAME={F}\n", "FRAME is a word of the language"),
        (f"DECL E6POS halt={F}\n", "halt is a word of the language"),
        (f"DECL E6POS tool_data={F}\n", "tool_data is a name of the controller's"),
        (f"DECL E6POS $MINE={F}\n", "$MINE begins with $, as only names of the controller do"),
        (f"DECL E6POS cell={F}\n", "cell is the name of its module"),
        (f"DECL GLOBAL E6POS Q={F}\n", "GLOBAL in a data list that is not PUBLIC"),
        ("DECL E6POS Q={X 1.0,Y 2.0,Z 3.0,A 0.0}\n", "Q: B, C have no value"),
        (f"DECL E6POS Q={F[:-1]},S 2}}\n", "Q: S and T belong together"),
        (f"DECL E6POS Q={F[:-1]},S 32,T 0}}\n", "Q: S is 32, and goes from 0 to 31"),
        (f"DECL E6POS Q={F[:-1]},S 2,T 64}}\n", "Q: T is 64, and goes from 0 to 63"),
    ],
)
def test_rules_for_data_lists(data: str, message: str) -> None:
    made = ran(read(program("  PTP $H_POS\n", data)))
    rules = [finding(f) for f in made.run.findings() if f.check == "rules"]
    assert [line for _, line, _ in rules] == [DATA]
    assert message in rules[0][2]


def test_rules_hold_in_long_lists_too() -> None:
    rows = "".join(f"DECL E6POS P{i}={F[:-1]},S 2,T {60 + i}}}\n" for i in range(20))
    rules = [f for f in ran(read(program("", rows))).run.findings() if f.check == "rules"]
    assert [f.line for f in rules] == [DATA + i for i in range(4, 20)]
    assert rules[0].message == "P4: T is 64, and goes from 0 to 63"


def test_positions_that_nobody_uses() -> None:
    data = P + f"DECL E6POS Q={F}\nDECL FRAME V[3]\nV[1]={F}\nV[2]={F}\nDECL REAL R=1.0\n"
    made = ran(read(program("  PTP P\n  PTP V[1]\n", data)))
    assert [finding(f) for f in made.run.findings()] == [
        ("used", DATA + 1, "Q is never used"),
        ("used", DATA + 2, "V[2] is never used"),
    ]
    rows = "".join(f"DECL E6POS P{i}={F}\n" for i in range(20))
    calls = "".join(f"  go(P{i})\n" for i in range(20) if i != 13)
    go = "DEF go(HOLE :IN)\n  DECL E6POS HOLE\n  PTP HOLE\nEND\n"
    made = ran(read(program(calls, rows, routines=go)))
    assert [finding(f) for f in made.run.findings()] == [("used", DATA + 13, "P13 is never used")]


def test_a_declaration_after_a_statement() -> None:
    wanted = [f"{BODY}: a declaration stands after a statement"]
    assert found("  INT I\n  I=1\n") == wanted


@pytest.mark.parametrize(
    ("data", "column", "message"),
    [
        (f"{P}DECL REAL P=1.0\n", 11, "P is declared twice"),
        ("DECL E6POS P={X 1,5,Y 2.0}\n", 18, "a number has a decimal point, not a comma"),
        ("DECL E6POS P={X 1.0,Q 2.0}\n", 21, "E6POS has no component Q"),
        ("DECL E6POS P={X 1.0,X 2.0}\n", 21, "X is given twice"),
        ("DECL E6POS P={X R,Y 2.0}\n", 17, "a data list holds constants only"),
        ("DECL E6POS P={X 1.0,Y TRUE}\n", 21, "Y is no number"),
        ("DECL ROBTARGET P={X 1.0}\n", 6, "ROBTARGET is no type"),
        (f"DECL FRAME V[2]\nV[3]={F}\n", 1, "V has elements 1 to 2, not 3"),
        (f"DECL FRAME V[2]\nV[1]={F}\nV[1]={F}\n", 1, "V[1] has its value already"),
        (f"V[1]={F}\n", 1, "V is not declared"),
        ("PTP P\n", 1, "this does not belong in a data list"),
        ("DECL E6POS P={X 1.0,Y 2.0\n", 26, "the line ends before the statement does"),
        ('DECL CHAR T[8]="abc\n', 16, "the text is not closed, or does not belong here"),
        ("IMPORT REAL X IS /R1/OTHER..X\n", 1, "IMPORT is not read: declare the data as GLOBAL"),
        ("SIGNAL A $FLAG[1]\n", 10, "a signal is a name for such as $OUT[1]"),
    ],
)
def test_data_lists_that_are_refused(data: str, column: int, message: str) -> None:
    line = DATA - 1 + data.count("\n")
    assert refused(data=data) == (1, line, column, message)


def test_data_lists_begin_and_end() -> None:
    files = program("")
    for old, new, message in [
        (b"DEFDAT CELL", b"", "the data list does not begin with DEFDAT"),
        (b"ENDDAT", b"DECL INT I", "the data list does not end with ENDDAT"),
    ]:
        changed = files["krl/CELL.dat"].replace(old, new)
        with pytest.raises(ReadError, match=message):
            KrlReader().read({**files, "krl/CELL.dat": changed})
    with pytest.raises(ReadError, match="the data list is empty"):
        KrlReader().read({**files, "krl/CELL.dat": b""})
    changed = files["krl/CELL.dat"].replace(b"CELL", b"OTHER")
    (made,) = KrlReader().read({**files, "krl/CELL.dat": changed})
    assert [f.message for f in made.findings()] == ["the data list is called OTHER, its file CELL"]


# ── statements ───────────────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("line", "column", "message"),
    [
        ("PTP Q", 7, "Q is not declared"),
        ("drill(P)", 3, "drill is not declared"),
        ("go(P,1)", 3, "go takes 1 value, not 2"),
        ("WAIT SEC 0,5", 13, "a number has a decimal point, not a comma"),
        ("$VEL.CP=0,25", 12, "a number has a decimal point, not a comma"),
        ("PTP P C_DIS Q", 15, "Q is not understood here"),
        ("CIRC P,P", 3, "CIRC is not read"),
        ("TRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE", 3, "TRIGGER is not read"),
        ("GOTO A", 3, "GOTO is not read"),
        (
            "INTERRUPT DECL 5 WHEN $IN[1]==TRUE DO go(P)",
            13,
            "INTERRUPT of the program's own is not read",
        ),
        ("BAS(#FRAMES,0)", 7, "BAS(#FRAMES) is not read"),
        ("$SINGULAR=1", 3, "$SINGULAR is not declared"),
        ("P.X=1,5", 8, "a number has a decimal point, not a comma"),
        ("PTP P.Q", 9, "E6POS has no component Q"),
        ("PTP P #TOOL", 9, "#TOOL is for relative moves"),
        ("LIN $H_POS", 7, "home is reached by PTP: it is given by axes"),
        ("$IN[1]=TRUE", 3, "$IN[1] is an input: it cannot be set"),
        ("$OUT=TRUE", 3, "$OUT needs a number in brackets"),
        ("WAIT FOR $IN[1] AND $IN[2]", 12, "WAIT FOR such a combination of inputs is not read"),
        ("WAIT FOR $IN[1] OR $IN[2]", 12, "WAIT FOR more than one input or timer is not read"),
        ("RETURN 1", 10, "CELL returns no value"),
        ("$IPO_MODE=#TCP", 3, "$IPO_MODE other than #BASE is not read"),
        ("ENDIF", 1, "ENDIF belongs to no block here"),
        ("IF 1<2 AND TRUE THEN", 8, "a comparison beside AND needs brackets: KRL compares last"),
        ("IF 1<2 AND 2<3 THEN", 15, "< compares once more: put each comparison in brackets"),
        ("DECL E6POS HERE={X 1.0}", 20, "a declaration with a value is for data lists"),
        ("ENDDAT", 1, "this belongs in a data list"),
        ("SIGNAL A $OUT[1]", 1, "SIGNAL belongs in the data list"),
        ("§", 3, "§ is not understood here"),
    ],
)
def test_lines_that_are_refused(line: str, column: int, message: str) -> None:
    go = "DEF go(HOLE :IN)\n  DECL E6POS HOLE\n  PTP HOLE\nEND\n"
    assert refused(f"  {line}\n", P, routines=go) == (0, BODY, column, message)


@pytest.mark.parametrize(
    ("body", "line", "message"),
    [
        ("  LIN {A1 5.0}\n", 0, "LIN goes to a pose, not to axes"),
        ("  PTP F\n", 0, "F has no value"),
        ("  F.X=1\n  PTP F\n", 1, "F: Y, Z, A, B, C have no value"),
        ("  WAIT SEC I\n", 0, "I has no value"),
        ("  I=1/0\n", 0, "division by zero"),
        ("  I=TRUE\n", 0, "TRUE is no number"),
        ("  IF 1 THEN\n  ENDIF\n", 0, "a condition is no truth"),
        ("  PTP V[I]\n", 0, "I has no value"),
        ("  I=4\n  PTP V[I]\n", 1, "V has elements 1 to 3, not 4"),
        ("  PTP V[3]\n", 0, "V has no value"),
        ("  $VEL.CP=0\n", 0, "$VEL.CP is 0: no speed"),
        ("  BAS(#VEL_PTP,120)\n", 0, "the speed of the axes is 120 %: it goes from 1 to 100"),
        ("  BAS(#TOOL,129)\n", 0, "there is no TOOL_DATA[129]"),
        ("  WAIT SEC -1\n", 0, "WAIT SEC -1: there is no such time"),
        ("  WAIT FOR FALSE\n", 0, "what is waited for never comes"),
        ("  F=TOOL_DATA[5]\n", 0, "what TOOL_DATA[5] is, only the controller knows"),
        ("  WHILE TRUE\n    I=1\n  ENDWHILE\n", 0, "the loop has not ended after 100,000 turns"),
        ("  IF TRUE THEN\n", 0, "IF has no ENDIF"),
        ("  FOR I=1 TO 2\n    IF TRUE THEN\n  ENDFOR\n", 2, "ENDFOR belongs to no block here"),
    ],
)
def test_programs_that_cannot_go_on(body: str, line: int, message: str) -> None:
    declare = "  INT I\n  DECL FRAME F\n"
    data = f"DECL FRAME V[3]\nV[1]={F}\n"
    made = refused(body, data, declare=declare)
    assert (made[1], made[3]) == (BODY + 2 + line, message)


@pytest.mark.parametrize(
    ("source", "line", "message"),
    [
        ("DEF CELL( )\n  WAIT SEC 0\n", 2, "CELL does not end with END"),
        ("  WAIT SEC 0\nDEF CELL( )\nEND\n", 1, "a statement outside of DEF and END"),
        ("DEF CELL( )\nDEF B( )\nEND\n", 2, "CELL has not ended"),
        ("END\n", 1, "END without DEF"),
        ("DEF CELL( )\nEND\nDEF B( )\nEND\nDEF b( )\nEND\n", 5, "b is defined twice"),
        ("DEF CELL( )\nEND\nDEF B(X :IN)\nEND\n", 3, "B: the type of X is not declared"),
        ("DEF CELL( )\nEND\nDEFFCT REAL B( )\nEND\n", 4, "B ends with the wrong word"),
        ("; nothing\n", 1, "the file has no DEF"),
    ],
)
def test_files_that_are_refused(source: str, line: int, message: str) -> None:
    with pytest.raises(ReadError) as caught:
        KrlReader().read({"krl/CELL.src": crlf(source)})
    assert (caught.value.line, caught.value.message) == (line, message)


def test_a_global_routine_is_defined_once() -> None:
    one = "DEF A( )\nEND\nGLOBAL DEF help( )\nEND\n"
    files = {"krl/A.src": crlf(one), "krl/B.src": crlf(one.replace("A( )", "B( )"))}
    with pytest.raises(ReadError, match="help is defined in A too"):
        KrlReader().read(files)


# ── what happens while the tool still moves ──────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("after", "message"),
    [
        ("$OUT[1]=TRUE", "$OUT[1] is switched"),
        ("$ANOUT[1]=0.5", "$ANOUT[1] is set"),
        ("CONTINUE\n  $OUT[1]=TRUE", "$OUT[1] is switched"),
        ("$TIMER_STOP[1]=FALSE", "$TIMER[1] is started"),
        ('MsgNotify("x","CELL")', "the operator is told"),
        ("WAIT SEC 0\n  PTP P\n  $OUT[1]=TRUE", "$OUT[1] is switched"),
        ("CONTINUE\n  WAIT FOR $IN[1]\n  $OUT[1]=TRUE", "$OUT[1] is switched"),
    ],
)
def test_signals_that_come_before_the_tool_arrives(after: str, message: str) -> None:
    made = run(f"  PTP P\n  {after}\n", P)
    found_ = [finding(f) for f in made.run.findings()]
    line = BODY + after.count("\n") + 1
    why = "while the tool may still be moving: no WAIT SEC 0 stands before it"
    assert found_ == [("process", line, f"{message} {why}")]


@pytest.mark.parametrize(
    "stop", ["WAIT SEC 0", "WAIT FOR $IN[1]", "WAIT FOR TRUE", "HALT", "NOW=$AXIS_ACT"]
)
def test_what_stops_the_advance_run(stop: str) -> None:
    declare = "  DECL E6AXIS NOW\n"
    assert found(f"  PTP P\n  {stop}\n  $OUT[1]=TRUE\n", P, declare=declare) == []


def test_without_advance_nothing_comes_too_early() -> None:
    assert found("  $ADVANCE=0\n  PTP P\n  $OUT[1]=TRUE\n", P) == []


def test_other_findings_of_a_run() -> None:
    made = run("  LIN P C_DIS\n", P)
    assert [(f.check, f.message) for f in made.run.findings()] == [
        ("position", "C_DIS: the tool passes P by instead of going there"),
        ("speed", "a straight move before $VEL.CP is set: its speed is the controller's own"),
        ("configuration", "the first move is no PTP: the controller refuses it"),
    ]
    made = run("  $VEL.CP=1\n  PTP P\n  $ORI_TYPE=#CONSTANT\n  LIN P\n", P)
    assert [finding(f) for f in made.run.findings()] == [
        ("axis", BODY + 3, "with $ORI_TYPE=#CONSTANT the tool does not turn as it is told")
    ]
    made = run("  $ANOUT[1]=1.5\n")
    assert made.findings() == [f"{BODY}: $ANOUT[1] is 1.5, and goes from -1 to 1"]
    files = program("  PTP P\n", P)
    source = files["krl/CELL.src"].replace(b"  BAS(#INITMOV,0)\r\n", b"")
    made = ran(read({**files, "krl/CELL.src": source}))
    assert made.findings()[0] == "4: BAS(#TOOL) before BAS(#INITMOV,0)"

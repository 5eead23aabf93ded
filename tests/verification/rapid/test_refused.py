"""What the reader refuses, and what it finds: each kind with its words and its place."""

from __future__ import annotations

import pytest
from drillc.verification.rapid.reader import RapidReader
from drillc.verification.reading import Finding, ReadError
from verification.rapid.running import done, module

P = "CONST robtarget p:=[[1,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
GO = "MoveL p,v100,fine,tool0;"
PGF = '<?xml version="1.0" encoding="ISO-8859-1" ?>\r\n<Program>\r\n%s</Program>\r\n'


def refused(files: dict[str, bytes] | bytes) -> tuple[int, int, int, str]:
    with pytest.raises(ReadError) as caught:
        done(files)
    error = caught.value
    return error.file, error.line, error.column, error.message


def found(files: dict[str, bytes] | bytes) -> list[tuple[str, int, str]]:
    return [(f.check, f.line, f.message) for f in done(files).run.findings()]


def listed(*names: str) -> bytes:
    return (PGF % "".join(f"  <Module>{name}</Module>\r\n" for name in names)).encode()


# ── statements and expressions that are refused ──────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("body", "place", "message"),
    [
        # syntax
        ("WaitTime 1", (5, 1), "ENDPROC stands where the statement should end with ;"),
        ("IF TRUE THEN\nWaitTime 1;", (6, 1), "ENDPROC stands where ENDIF was expected"),
        ("WHILE TRUE DO", (5, 1), "ENDPROC stands where ENDWHILE was expected"),
        ("ENDIF", (4, 1), "ENDIF stands where ENDPROC was expected"),
        ("WaitTime 1 # 2;", (4, 12), "'#' is no character of RAPID here"),
        ('TPWrite "open;', (4, 9), "the text does not end in its line"),
        ("then:=1;", (4, 1), "then is a word of the language and is not expected here"),
        # what is not read
        ('%"r"+"1"%;', (4, 1), "a routine whose name is computed (%…%) is not read"),
        ("GOTO x;", (4, 1), "GOTO is not read"),
        ("x:", (4, 1), "GOTO and its labels are not read"),
        ("RAISE;", (4, 1), "error handlers (RAISE, RETRY, TRYNEXT) are not read"),
        ("CONNECT i WITH t;", (4, 1), "interrupts (CONNECT) are not read"),
        ("WaitTime 1;\nERROR\nTRYNEXT;", (5, 1), "error handlers are not read"),
        ("MoveC p,p,v100,fine,tool0;",
         (4, 1), "MoveC is not read: a tool that goes in an arc drills nothing"),
        ("SetGO g,3;",
         (4, 1), "SetGO is not read: a group of signals has no name for each of them"),
        ("TriggL p,v100,x,fine,tool0;",
         (4, 1), "TriggL is not read: the signal would be set while the axes move"),
        ("PDispSet x;", (4, 1), "PDispSet is not read: positions would mean something else"),
        ("Grind p;", (4, 1), "Grind is no procedure that is declared or read"),
        ("WaitTime Grind(1);", (4, 10), "Grind is no function that is declared or read"),
        ("MoveL p,v100\\T:=5,fine,tool0;", (4, 1), "\\t of MoveL is not read"),
        ("MoveL\\Conc,p,v100,fine,tool0;", (4, 1), "\\conc of MoveL is not read"),
        ("WaitUntil di=1 AND dj=1;",
         (4, 1), "WaitUntil is read for one signal only: WaitUntil signal=1"),
        ("VelSet 50,5000;",
         (4, 1), "VelSet is read only where it slows nothing: VelSet 100,5000 or faster"),
        # names
        ("MoveL q,v100,fine,tool0;", (4, 7), "q is not declared"),
        ("MoveL p,v101,fine,tool0;", (4, 9), "v101 is not declared"),
        ("MoveL p,v100,z7,tool0;", (4, 14), "z7 is not declared"),
        ("main;\np;", (5, 1), "p is data, not a procedure"),
        ("WaitTime main;", (4, 10), "main is a routine, not data"),
        ("SetDO p,1;", (4, 7), "a signal is wanted here: a name that the program declares not"),
        ("SetDO 1,1;", (4, 7), "a signal is wanted here: a name that the program declares not"),
        # types and counts
        ("p:=p;", (4, 1), "a constant is given another value"),
        ("n:=TRUE;", (4, 4), "a num is wanted here, not a bool"),
        ("IF n THEN\nENDIF", (4, 4), "a bool is wanted here, not a num"),
        ("MoveL j,v100,fine,tool0;", (4, 7), "a robtarget is wanted here, not a jointtarget"),
        ("MoveL p,fine,v100,tool0;", (4, 9), "a speeddata is wanted here, not a zonedata"),
        ("MoveL p,v100,fine;", (4, 1), "MoveL takes 4 arguments, not 3"),
        ("WaitTime 1,5;", (4, 1), "WaitTime takes 1 argument, not 2"),
        ("SetDO dq;", (4, 1), "SetDO takes 2 arguments, not 1"),
        ("MoveL RelTool(p,0,0),v100,fine,tool0;", (4, 7), "RelTool takes 4 arguments, not 3"),
        ("r 1;", (4, 1), "r takes 2 arguments, not 1"),
        ("r 1,2\\z:=3;", (4, 1), "\\z of r is not read"),
        ("r p,2;", (4, 3), "a num is wanted here, not a robtarget"),
        ("up 1;", (4, 4), "N is given back: a variable is wanted here"),
        ("up c;", (4, 4), "N is given back: a constant cannot be changed"),
        ("n:=p.trans.w;", (4, 12), "a pos has no component w"),
        ("n:=n{1};", (4, 5), "a num has no elements"),
        ("n:=a{4};", (4, 6), "there are elements 1 to 3 only"),
        ("n:=1/0;", (4, 4), "a division by 0"),
        ('n:=1+"a";', (4, 4), "num + string has no meaning that is read"),
        ('IF n="a" THEN\nENDIF', (4, 4), "a num is compared with a string"),
        ("IF p<p THEN\nENDIF", (4, 4), "a robtarget is neither less nor more than another"),
        ("f 1;", (4, 1), "f is a function, and its value is not used"),
        ("n:=up(1);", (4, 4), "up is a procedure and has no value"),
        ("RETURN 1;", (4, 1), "main has no value to return"),
        ("SetDO dq,2;", (4, 1), "dq is set to something else than 0 and 1"),
        ("WaitDI di,1\\MaxTime:=1\\TimeFlag:=n;", (4, 1), "\\TimeFlag needs a bool variable"),
        ("MoveL [[1,2,3],[1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;", (4, 16),
         "3 values are given where orient has 4 (decimals are written with a point)"),
        ("MoveL [[1,5,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;", (4, 8),
         "4 values are given where pos has 3 (decimals are written with a point)"),
        ("EXIT;\nmain 1;", (5, 1), "main takes 0 arguments, not 1"),
    ],
)  # fmt: skip
def test_refused_in_a_routine(body: str, place: tuple[int, int], message: str) -> None:
    data = (
        f"{P} CONST num c:=1; VAR num n; CONST num a{{3}}:=[1,2,3];"
        "CONST jointtarget j:=[[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];"
    )
    more = (
        "PROC r(num x,num y)\nENDPROC\nFUNC num f(num x)\nRETURN x;\nENDFUNC\n"
        "PROC up(INOUT num n)\nENDPROC"
    )
    assert refused(module(body, data, more=more)) == (0, *place, message)


@pytest.mark.parametrize(
    ("data", "place", "message"),
    [
        ("CONST num if:=1;", (2, 11), "if is a word of the language and is not expected here"),
        ("CONST num c;", (2, 11), "constant c has no value"),
        ("CONST jointtarget c:=CJointT();", (2, 22), "c needs a value that is constant"),
        ("VAR num c:=n;", (2, 12), "n is not declared"),
        ("VAR widget c;", (2, 5), "widget is no type of data that is read"),
        ("VAR num a{n};", (2, 11), "the size of an array is no whole number"),
        ("CONST num a{3}:=[1,2];", (2, 17),
         "2 values are given where num array has 3 (decimals are written with a point)"),
        ("CONST robtarget q:=[[1,2,3],[1,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", (2, 29),
         "3 values are given where orient has 4 (decimals are written with a point)"),
        ("CONST robtarget q:=[[1,5,2,3],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", (2, 21),
         "4 values are given where pos has 3 (decimals are written with a point)"),
        ("TRAP t\nENDTRAP", (2, 1), "interrupts (TRAP) are not read"),
        ("PROC q(num a{*})\nENDPROC", (2, 12), "a: arrays as parameters are not read"),
    ],
)  # fmt: skip
def test_refused_in_data(data: str, place: tuple[int, int], message: str) -> None:
    assert refused(module("", data)) == (0, *place, message)


def test_components_missing_in_one_line_of_a_stretch() -> None:
    lines = [P.replace(" p:", f" p{i}:") for i in range(20)]
    lines[13] = lines[13].replace("[1,0,0,0]", "[1,0,0]")
    wanted = "3 values are given where orient has 4 (decimals are written with a point)"
    assert refused(module("", "\n".join(lines))) == (0, 15, 31, wanted)


def test_error_in_one_call_of_a_stretch() -> None:
    calls = [f"MoveL p{i},v100,fine,tool0;" for i in range(20)]
    data = "\n".join(P.replace(" p:", f" p{i}:") for i in range(20) if i != 13)
    assert refused(module("\n".join(calls), data)) == (0, 35, 7, "p13 is not declared")


@pytest.mark.parametrize(
    ("text", "place", "message"),
    [
        ("MODULE T\nPROC main()\nENDPROC\n", (3, 1), "the file ends before ENDMODULE"),
        ("MODULE T\nPROC main()\nENDMODULE\n",
         (3, 1), "ENDMODULE stands where ENDPROC was expected"),
        ("MODULE T\nPROC main()\n", (2, 1), "the file ends before ENDPROC"),
        ("MODULE T\nENDMODULE\n", (1, 1), "no PROC main"),
        ("MODULE T(FAST)\nENDMODULE\n", (1, 10), "FAST is no attribute of a module"),
        ("MODULE T\nENDMODULE\nx:=1;\n", (3, 1), "x is not expected here"),
    ],
)  # fmt: skip
def test_refused_modules(text: str, place: tuple[int, int], message: str) -> None:
    assert refused(text.replace("\n", "\r\n").encode()) == (0, *place, message)


def test_main_twice() -> None:
    files = {"T.mod": module(""), "U.mod": module("", name="U")}
    assert refused(files) == (1, 3, 6, "main is declared twice")


@pytest.mark.parametrize(
    ("raw", "place", "message"),
    [
        (listed("T.mod", "U.mod"), (4, 1), "module U.mod is listed, but there is no such file"),
        (listed("T.mod", "t.MOD"), (3, 1), "module T.mod is listed twice"),
        (listed(), (1, 1), "the list of modules is empty"),
        (b"<Program>\r\n",
         (2, 1), "the list of modules is no XML: no element found: line 2, column 0"),
        (b"<Job></Job>\r\n", (1, 1), "the list of modules begins with Job, not Program"),
        (b"<Program><Tool>x</Tool></Program>\r\n", (1, 1), "Tool x is no module"),
        (b'<!DOCTYPE x [<!ENTITY a "b">]>\r\n<Program></Program>\r\n', (1, 1),
         "a list of modules has no document type, and is short"),
    ],
)  # fmt: skip
def test_refused_listings(raw: bytes, place: tuple[int, int], message: str) -> None:
    assert refused({"T.pgf": raw, "T.mod": module("")}) == (0, *place, message)


def test_no_module_at_all() -> None:
    assert refused({"names.csv": b""}) == (-1, 1, 1, "no module of RAPID (.mod) is there")


# ── findings ─────────────────────────────────────────────────────────────────────────────────────


def test_a_sound_program_has_none() -> None:
    files = {"T.mod": module(f"{GO}\nSetDO dq,1;", P), "T.pgf": listed("T.mod")}
    assert found(files) == []


@pytest.mark.parametrize(
    ("body", "data", "more", "wanted"),
    [
        ("", P, "", ("used", 2, "robtarget p is declared and never used")),
        ("", "CONST jointtarget Home:=[[0,0,0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];", "",
         ("used", 2, "jointtarget Home is declared and never used")),
        (f"{GO}", f"{P}\nCONST num a{'n' * 32}:=1;", "",
         ("rules", 3, f"name a{'n' * 32} has 33 characters; 32 are taken")),
        (GO, f"{P}\nCONST num p:=1;", "",
         ("rules", 3, "p is declared a second time; the first is in line 2")),
        (GO, P, "PROC p()\nENDPROC",
         ("rules", 6, "p is declared a second time; the first is in line 2")),
        (GO, f"{P}\nCONST num T:=1;", "",
         ("rules", 1, "module T bears the name of something that it declares")),
        (GO, P, "PROC t()\nENDPROC",
         ("rules", 1, "module T bears the name of something that it declares")),
        (GO, f"{P}\nCONST num v100x:=1;\nPERS speeddata v100:=[1,1,1,1];", "",
         ("rules", 4, "v100 is a name that the controller has taken")),
        ("VAR num a;\nVAR bool A;", "", "", ("rules", 5, "A is declared a second time in main")),
        (f'TPWrite "{"x" * 81}";', "", "",
         ("rules", 4, "the text has 81 characters; 80 are taken")),
        (GO, P.replace("[1,0,0,0]", "[0.75,0.7,0,0]"), "",
         ("quaternions", 2, "the quaternion [0.75,0.7,0,0] has length 1.02591423, not 1")),
        (GO.replace("p,", "[[1,2,3],[0.707,0,-0.709,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],"),
         "", "",
         ("quaternions", 4, "the quaternion [0.707,0,-0.709,0] has length 1.00126420, not 1")),
        (GO.replace("fine", "z10") + "\nSetDO dq,1;", P, "",
         ("process", 4, "the move ends in z10, not fine, before SetDO")),
        (GO.replace("fine", "z0") + "\nWaitTime 1;", P, "",
         ("process", 4, "the move ends in z0, not fine, before WaitTime")),
        (GO.replace("fine", "fine\\Z:=1") + "\nWaitDI di,1;", P, "",
         ("process", 4, "the move ends in fine, not fine, before WaitDI")),
    ],
)  # fmt: skip
def test_found(body: str, data: str, more: str, wanted: tuple[str, int, str]) -> None:
    assert wanted in found(module(body, data, more=more))
    assert len(found(module(body, data, more=more))) <= 2


@pytest.mark.parametrize(
    ("quaternion", "sound"),
    [
        ("0.70710678,0,0.70710678,0", True),
        ("0.7071,0,0.7071,0", True),
        ("0.7,0,0.7,0", True),
        ("0.70710678,0,0.70710658,0", False),
        ("0.70710678,0.70710678,0.00000000,0.0001", True),
        ("0.70710678,0.70710678,0.00000000,0.0004", False),
        ("2,0,0,0", False),
        ("1,1,0,0", False),
        ("9.184E-17,1,0,0", True),
    ],
)
def test_length_of_quaternions_as_printed(quaternion: str, sound: bool) -> None:
    """Alike in single declarations and in stretches."""
    one = P.replace("1,0,0,0", quaternion, 1)
    findings = found(module(GO, one))
    assert [check for check, _, _ in findings] == [] if sound else ["quaternions"]
    many = [P.replace(" p:", f" p{i}:") for i in range(20)]
    many[17] = many[17].replace("1,0,0,0", quaternion, 1)
    calls = "\n".join(GO.replace("p,", f"p{i},") for i in range(20))
    findings = found(module(calls, "\n".join(many)))
    assert [(check, line) for check, line, _ in findings] == (
        [] if sound else [("quaternions", 19)]
    )


def test_tool_and_work_object_that_have_changed_places() -> None:
    data = (
        "PERS tooldata held:=[FALSE,[[0,0,9],[1,0,0,0]],[1,[0,0,1],[1,0,0,0],0,0,0]];\n"
        'PERS wobjdata carried:=[TRUE,TRUE,"",[[0,0,9],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];\n'
    )
    files = module("MoveL p,v100,fine,held\\WObj:=carried;", data + P)
    assert found(files) == [
        ("frames", 6, "tooldata held stands still in the room"),
        ("frames", 6, "wobjdata carried is held by the robot"),
    ]
    assert [frame.position_mm for frame in done(files).run.frames] == [None, None]


TURNS = "the tool turns, or is faster or slower"


@pytest.mark.parametrize(
    ("zones", "wanted"),
    [
        ("fine fine fine fine", {}),
        ("z5 fine fine fine", {4: TURNS}),  # a standoff, from where nobody knows
        ("fine z5 fine fine", {5: TURNS}),  # straight on, but slower
        ("fine fine z1 fine", {6: TURNS}),  # the bottom
        ("fine fine fine z5", {7: "the program ends"}),
    ],
)
def test_a_place_that_is_passed_by(zones: str, wanted: dict[int, str]) -> None:
    a, b, c, d = zones.split()
    body = f"""MoveL RelTool(p,0,0,-50),v100,{a},tool0;
    MoveL RelTool(p,0,0,-2),v100,{b},tool0;
    MoveL RelTool(p,0,0,10),v5,{c},tool0;
    MoveL RelTool(p,0,0,-50),v100,{d},tool0;"""
    zone = {4: a, 5: b, 6: c, 7: d}
    assert found(module(body, P)) == [
        ("process", line, f"the move ends in {zone[line]}, not fine, before {what}")
        for line, what in wanted.items()
    ]


@pytest.mark.parametrize("end", ["EXIT", "Stop", "MoveJ p,v5,fine,tool0", "MoveL p,v5,z1,tool0"])
def test_a_zone_before_the_end_or_another_move(end: str) -> None:
    said = found(module(f"MoveL RelTool(p,0,0,9),v5,z10,tool0;\n{end};", P))
    assert {(check, line) for check, line, _ in said} >= {("process", 4)}


def test_zones_that_do_no_harm() -> None:
    body = f"""
    MoveL RelTool(p,0,0,-50),v100,fine,tool0;
    MoveL RelTool(p,0,0,-20),v100,z5,tool0;
    {GO}
    SetDO dq,1;
    MoveL RelTool(p,0,0,-50),v100,z5,tool0;
    WaitTime\\InPos,0;
    MoveL RelTool(p,30,0,-50),v100,z5,tool0;
    WaitRob\\InPos;
    SetDO dq,0;
    """
    assert found(module(body, P)) == []


def test_zone_before_a_signal_in_a_stretch() -> None:
    data = "\n".join(P.replace(" p:", f" p{i}:") for i in range(10))
    calls = "\n".join(f"r p{i};" for i in range(10))
    more = "PROC r(robtarget p)\nMoveL p,v100,z1,tool0;\nSet dq;\nMoveL p,v100,fine,tool0;\nENDPROC"
    wanted = [("process", 25, "the move ends in z1, not fine, before Set")]
    assert found(module(calls, data, more=more)) == wanted


def test_unused_positions_are_named_with_their_lines() -> None:
    """One hole commented out among many: its position is left over."""
    data = "\n".join(f"LOCAL {P.replace(' p:', f' Hole_{i}:')}" for i in range(30))
    calls = [f"MoveL hole_{i},v100,fine,tool0;" for i in range(30)]
    calls[11] = "! " + calls[11]
    [finding] = done(module("\n".join(calls), data)).run.findings()
    assert finding == Finding("used", 0, 13, 23, "robtarget Hole_11 is declared and never used")


def test_names_of_modules() -> None:
    raw = module("")
    assert found({"X.mod": raw}) == [
        ("rules", 1, "module T stands in a file of another name, X.mod")
    ]
    digit = module("", name="1T")
    assert found({"1T.mod": digit}) == [("rules", 1, "name 1T does not begin with a letter")]


def test_names_across_modules() -> None:
    """Global names are one space; LOCAL ones hide them."""

    def both(first: str, second: str) -> list[tuple[str, int, str]]:
        other = f"MODULE U\n{second}\nPROC go()\nMoveL p,v100,fine,tool0;\nENDPROC\nENDMODULE\n"
        raw = other.replace("\n", "\r\n").encode()
        return found({"T.mod": module(f"{GO}\ngo;", first), "U.mod": raw})

    twice = ("rules", 2, "p is declared a second time; the first is in line 2 of another module")
    assert twice in both(P, P)
    assert both(P, f"LOCAL {P}") == []
    assert both(f"LOCAL {P}", f"LOCAL {P}") == []
    assert both(P, "") == []
    clash = ("rules", 2, "U is declared a second time; the first is in line 1 of another module")
    assert clash in both(f"{P} CONST num U:=1;", "")


def test_line_ends_and_letters() -> None:
    sound = module('TPWrite "größer"; ! größer')
    assert found(sound) == []
    line = [("rules", 3, "the line does not end in CRLF")]
    assert found(sound.replace(b"main()\r\n", b"main()\n")) == line
    assert found(sound.decode("latin-1").encode()) == [
        ("rules", 4, "the file is in UTF-8; the controller reads ISO-8859-1")
    ]
    marked = b"\xef\xbb\xbf" + module("")
    [first] = found(marked)
    assert first[2] == "the file begins with a byte order mark, which the controller does not read"
    strange = found(module("! a\x07b"))
    assert strange == [("rules", 4, "character 7 is none that the controller reads")]


def test_head_of_saved_modules() -> None:
    head = b"%%%\r\n  VERSION:1\r\n  LANGUAGE:ENGLISH\r\n%%%\r\n\r\n"
    assert refused(head + module("x:=1;"))[:3] == (0, 9, 1)
    assert found(head + module("")) == []


def test_listing() -> None:
    files = {"T.mod": module(""), "U.mod": b"MODULE U\r\nENDMODULE\r\n"}
    assert found({**files, "T.pgf": listed("T.mod")}) == [
        ("rules", 1, "U.mod is there, but the program does not list it")
    ]
    assert found({**files, "T.pgf": listed("T.mod", "U.mod")}) == []
    bare = listed("T.mod", "U.mod").replace(b"\r\n", b"\n")
    assert found({**files, "T.pgf": bare}) == [("rules", 1, "the line does not end in CRLF")]


def test_two_programs_in_one_folder() -> None:
    files = {
        "out/A.pgf": listed("A.mod"),
        "out/A.mod": module("WaitTime 1;", name="A"),
        "out/B.pgf": listed("B.mod", "C.mod"),
        "out/B.mod": module("c;", name="B"),
        "out/C.mod": b"MODULE Cs\r\nPROC c()\r\nENDPROC\r\nENDMODULE\r\n",
        "out/names.csv": b"",
    }
    one, two = RapidReader().read(files)
    assert (one.name, one.files) == ("A", ["out/A.pgf", "out/A.mod"])
    assert (two.name, two.files) == ("B", ["out/B.pgf", "out/B.mod", "out/C.mod"])
    assert next(iter(one.steps())).value.tolist() == [1.0]

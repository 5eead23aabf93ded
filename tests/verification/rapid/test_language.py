"""What statements and expressions dq, in programs written by hand; rotations are scipy's."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drillc.verification.events import Kind
from scipy.spatial.transform import Rotation
from verification.rapid.running import done, module, pose

P = (
    "CONST robtarget p:=[[100,20,-5.5],[0.70710678,0,0.70710678,0],[0,-1,2,1],"
    "[9E+09,9E+09,9E+09,9E+09,9E+09,9E+09]];"
)
J = "CONST jointtarget j:=[[10,20,30,40,50,60],[1.5,9E9,9E9,9E9,9E9,9E9]];"


def values(body: str, data: str = "", more: str = "") -> list[float]:
    """What `WaitTime` is given, as a way to see numbers."""
    return list(done(module(body, data, more=more)).events.value)


def turn(w: float, x: float, y: float, z: float) -> np.ndarray:
    return Rotation.from_quat([x, y, z, w]).as_matrix()


# ── numbers and truths ───────────────────────────────────────────────────────────────────────────


@pytest.mark.parametrize(
    ("expression", "value"),
    [
        ("1+2*3", 7.0),
        ("-2+5", 3.0),
        ("(1+2)*3-4/8", 8.5),
        ("17 DIV 5", 3.0),
        ("17 MOD 5", 2.0),
        ("-17 DIV 5", -3.0),
        ("1E-2+.5", 0.51),
        ("0x1F", 31.0),
        ("0b101", 5.0),
        ("Abs(-3.5)", 3.5),
        ("Sqrt(16)", 4.0),
        ("Pow(2,10)", 1024.0),
        ("Sin(30)", 0.5),
        ("ATan2(1,1)", 45.0),
        ("ACos(0)", 90.0),
        ("Round(2.345\\Dec:=1)", 2.3),
        ("Round(-2.5)", -3.0),
        ("Trunc(-2.75)", -2.0),
        ("p.trans.x", 100.0),
        ("P.ROBCONF.CF6", 2.0),
        ("a{2}", 7.0),
        ("b{2,3}", 6.0),
        ("pi", math.pi),
        ("Distance(p.trans,[100,23,-1.5])", 5.0),
        ("VectMagn([3,0,4])", 5.0),
        ("DotProd([1,2,3],[4,5,6])", 32.0),
    ],
)
def test_numbers(expression: str, value: float) -> None:
    data = f"{P}\nCONST num a{{3}}:=[5,7,9];\nVAR num b{{2,3}}:=[[1,2,3],[4,5,6]];"
    assert values(f"WaitTime {expression};", data) == pytest.approx([value], abs=1e-12)


@pytest.mark.parametrize(
    ("condition", "truth"),
    [
        ("1<2", True),
        ("1>=2 OR 3<>3", False),
        ("TRUE AND NOT FALSE", None),  # no RAPID: NOT stands at the head
        ("NOT FALSE AND FALSE", True),  # NOT takes all that AND joins
        ("TRUE XOR TRUE", False),
        ('"a"+"b"="ab"', True),
        ("p.trans=[100,20,-5.5]", True),
        ("p.rot<>[1,0,0,0]", True),
    ],
)
def test_truths(condition: str, truth: bool | None) -> None:
    body = f"IF {condition} THEN WaitTime 1; ELSE WaitTime 0; ENDIF"
    if truth is None:
        with pytest.raises(Exception, match="NOT is a word of the language and is not expected"):
            values(body, P)
        return
    assert values(body, P) == [float(truth)]


@pytest.mark.parametrize(
    ("body", "expected"),
    [
        ("VAR num n;\nn:=2;\nIF n=1 WaitTime 1;\nIF n=2 WaitTime 2;", [2.0]),
        ("VAR num n:=3;\nIF n<2 THEN\nWaitTime 1;\nELSEIF n<4 THEN\nWaitTime 2;\nELSE\n"
         "WaitTime 3;\nENDIF", [2.0]),
        ("FOR i FROM 1 TO 3 DO\nWaitTime i;\nENDFOR", [1.0, 2.0, 3.0]),
        ("FOR i FROM 3 TO 1 DO\nWaitTime i;\nENDFOR", [3.0, 2.0, 1.0]),
        ("FOR i FROM 1 TO 6 STEP 2.5 DO\nWaitTime i;\nENDFOR", [1.0, 3.5, 6.0]),
        ("FOR i FROM 1 TO 2 DO\nFOR k FROM i TO 2 STEP 1 DO\nWaitTime 10*i+k;\nENDFOR\nENDFOR",
         [11.0, 12.0, 22.0]),
        ("VAR num n;\nWHILE n<2 DO\nn:=n+1;\nWaitTime n;\nENDWHILE", [1.0, 2.0]),
        ("VAR num n:=5;\nTEST n\nCASE 1,2:\nWaitTime 1;\nCASE 3,5:\nWaitTime 2;\nDEFAULT:\n"
         "WaitTime 3;\nENDTEST", [2.0]),
        ("VAR num n:=9;\nTEST n\nCASE 1:\nWaitTime 1;\nDEFAULT:\nWaitTime 3;\nENDTEST", [3.0]),
        ("VAR num n;\nIncr n;\nAdd n,4;\nDecr n;\nWaitTime n;\nClear n;\nWaitTime n;", [4.0, 0.0]),
        ("WaitTime 1;\nRETURN;\nWaitTime 2;", [1.0]),
        ("waittime\n  1\n  ; ! over three lines\nWAITTIME 2; WaitTime 3;", [1.0, 2.0, 3.0]),
        ("VAR num a{3}:=[1,2,3];\na{2}:=7;\nFOR i FROM 1 TO 3 DO\nWaitTime a{i};\nENDFOR",
         [1.0, 7.0, 3.0]),
        ("VAR pos v:=[1,2,3];\nv:=2*v+[1,1,1];\nv.y:=-v.y;\nWaitTime v.x;\n"
         "WaitTime v.y;", [3.0, -5.0]),
    ],
)  # fmt: skip
def test_control_flow(body: str, expected: list[float]) -> None:
    assert values(body) == expected


def test_routines_take_and_give_back() -> None:
    more = """
    PROC wait(num base\\num more\\switch twice)
      VAR num sum;
      sum:=base;
      IF Present(more) sum:=sum+more;
      IF Present(twice) THEN sum:=2*sum; ENDIF
      WaitTime sum;
    ENDPROC
    PROC up(INOUT num n,VAR num m)
      n:=n+1;
      m:=10*m;
    ENDPROC
    FUNC num half(num n)
      IF n<0 RETURN 0;
      RETURN n/2;
    ENDFUNC
    """
    body = """
    VAR num a:=1;
    wait 3;
    wait 3\\more:=4;
    wait 3,\\more:=4,\\twice;
    up a,b;
    WaitTime a;
    WaitTime b;
    WaitTime half(half(12)+2)+half(-1);
    WHILE half(a)<2 DO
      a:=a+1;
      WaitTime a;
    ENDWHILE
    """
    expected = [3.0, 7.0, 14.0, 2.0, 50.0, 4.0, 3.0, 4.0]
    assert values(body, "VAR num b:=5;", more) == expected


def test_variables_of_a_routine_begin_anew_and_data_of_a_module_last() -> None:
    more = "PROC r()\nVAR num own:=1;\nown:=own+1;\ns:=s+1;\nWaitTime own;\nWaitTime s;\nENDPROC"
    assert values("r;\nr;", "PERS num s:=0;", more) == [2.0, 1.0, 2.0, 2.0]


def test_endless_loop_without_an_effect_ends_the_program() -> None:
    found = done(module("WaitTime 1;\nWHILE TRUE DO\nENDWHILE\nWaitTime 2;"))
    assert found.kinds() == ["pause 1", "stop"]


# ── moves ────────────────────────────────────────────────────────────────────────────────────────


def test_poses_of_moves() -> None:
    body = """
    MoveJ p,v100,fine,tool0;
    MoveL RelTool(p,1,2,3),v50,fine,tool0;
    MoveL Offs(p,1,2,3),v1000\\V:=12.5,fine,tool0\\WObj:=wobj0;
    MoveL RelTool(p,0,0,-7\\Rx:=10\\Ry:=20\\Rz:=30),vmax,fine,tool0;
    MoveL [[1,2,3],[2,0,0,2],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],[33,1,1,1],fine,tool0;
    """
    e = done(module(body, P)).events
    r, at = turn(0.70710678, 0.0, 0.70710678, 0.0), np.array([100.0, 20.0, -5.5])
    assert e.kind.tolist() == [Kind.JOINTS] + [Kind.STRAIGHT] * 4
    assert e.speed_mm_s[[0, 1, 2, 4]].tolist() == [100.0, 50.0, 12.5, 33.0]
    assert np.isnan(e.speed_mm_s[3])  # how fast vmax is hangs on the robot
    places = [
        at,
        at + r @ [1, 2, 3],
        at + np.array([1, 2, 3]),
        at + r @ [0, 0, -7],
        np.array([1.0, 2, 3]),
    ]
    turned = r @ Rotation.from_euler("XYZ", [10, 20, 30], degrees=True).as_matrix()
    turns = [r, r, r, turned, Rotation.from_euler("Z", 90, degrees=True).as_matrix()]
    for row in range(5):
        wanted = np.eye(4)
        wanted[:3, :3], wanted[:3, 3] = turns[row], places[row]
        assert np.abs(pose(e, row) - wanted).max() < 1e-12
    assert np.isnan(e.joints).all()


def test_geometry_of_frames() -> None:
    """PoseMult, PoseInv, PoseVect, OrientZYX, EulerZYX and ORobT against matrices."""
    body = """
    VAR pose a:=[[1,2,3],[1,0,0,0]];
    VAR pose b:=[[-4,5,6],[1,0,0,0]];
    VAR robtarget t;
    t:=ORobT(p);
    a.rot:=OrientZYX(30,-40,50);
    b.rot:=OrientZYX(-100,20,5);
    a:=PoseMult(PoseInv(a),b);
    t.trans:=a.trans;
    t.rot:=a.rot;
    MoveL t,v100,fine,tool0;
    t.trans:=PoseVect(b,[7,8,9]);
    MoveL t,v100,fine,tool0;
    WaitTime EulerZYX(\\Z,b.rot);
    WaitTime EulerZYX(\\Y,b.rot);
    WaitTime EulerZYX(\\X,b.rot);
    """
    e = done(module(body, P)).events
    a, b = np.eye(4), np.eye(4)
    a[:3, :3] = Rotation.from_euler("ZYX", [30, -40, 50], degrees=True).as_matrix()
    b[:3, :3] = Rotation.from_euler("ZYX", [-100, 20, 5], degrees=True).as_matrix()
    a[:3, 3], b[:3, 3] = [1, 2, 3], [-4, 5, 6]
    assert np.abs(pose(e, 0) - np.linalg.inv(a) @ b).max() < 1e-12
    assert np.abs(e.position_mm[1] - (b @ [7, 8, 9, 1])[:3]).max() < 1e-12
    assert e.value[2:] == pytest.approx([-100.0, 20.0, 5.0])


def test_joints_and_where_the_axes_are() -> None:
    body = """
    VAR jointtarget now;
    now:=CJointT();
    MoveAbsJ now,v50,fine,tool0;
    MoveAbsJ j\\NoEOffs,v100,fine,tool0;
    now:=CJointT();
    now.robax.rax_2:=now.robax.rax_2-5;
    now.extax.eax_b:=3;
    MoveAbsJ now\\NoEOffs,[20,1,2,3],fine,tool0;
    MoveL p,v10,fine,tool0;
    MoveAbsJ CJointT(),v5,fine,tool0;
    """
    e = done(module(body, f"{P}\n{J}")).events
    assert [Kind(kind) for kind in e.kind] == [Kind.JOINTS] * 3 + [Kind.STRAIGHT, Kind.JOINTS]
    nan = math.nan
    rows = [
        [nan] * 12,
        [10, 20, 30, 40, 50, 60, 1.5] + [nan] * 5,
        [10, 15, 30, 40, 50, 60, 1.5, 3] + [nan] * 4,
        [nan] * 12,
        [nan] * 6 + [1.5, 3] + [nan] * 4,  # a pose says nothing of the arm's axes
    ]
    assert np.array_equal(e.joints, rows, equal_nan=True)
    assert e.speed_mm_s.tolist() == [50.0, 100.0, 20.0, 10.0, 5.0]
    assert np.isnan(e.position_mm[[0, 1, 2, 4]]).all()


def test_external_axes_of_a_pose() -> None:
    target = "[[1,2,3],[1,0,0,0],[0,0,0,0],[250.5,9E9,9E9,9E9,9E9,-3]]"
    e = done(module(f"MoveL {target},v100,fine,tool0;")).events
    assert np.flatnonzero(~np.isnan(e.joints[0])).tolist() == [6, 11]
    assert e.joints[0, [6, 11]].tolist() == [250.5, -3.0]


def test_places_that_only_the_controller_can_compute() -> None:
    body = """
    VAR jointtarget at;
    at:=CalcJointT(p,tool0\\WObj:=wobj0);
    MoveAbsJ at,v100,fine,tool0;
    MoveL CalcRobT(j,tool0),v100,fine,tool0;
    """
    e = done(module(body, f"{P}\n{J}")).events
    assert np.isnan(e.joints).all()
    assert np.isnan(e.position_mm).all()


def test_where_the_tool_is() -> None:
    body = """
    MoveL Offs(CRobT(),0,0,5),v100,fine,tool0;
    MoveL p,v100,fine,tool0\\WObj:=w;
    MoveL Offs(CRobT(\\Tool:=tool0\\WObj:=w),0,0,5),v100,fine,tool0\\WObj:=w;
    MoveL Offs(CRobT(\\WObj:=wobj0),0,0,5),v100,fine,tool0;
    MoveL RelTool(p,0,0,1),v100,fine,tool0;
    MoveAbsJ j,v100,fine,tool0;
    WaitTime CRobT().trans.x;
    """
    body = body.replace("WaitTime CRobT().trans.x;", "now:=CPos();\nWaitTime now.x;")
    e = done(module(f"VAR pos now;{body}", f"{P}\n{J}")).events
    assert np.isnan(e.position_mm[0]).all()
    assert e.position_mm[2].tolist() == [100.0, 20.0, -0.5]
    assert np.isnan(e.position_mm[3]).all()  # nobody says where w is
    assert np.isnan(e.value[-1])


def test_configurations_where_the_move_goes_by_them() -> None:
    body = "\n".join(
        [
            "MoveJ p,v100,fine,tool0;",
            "MoveL p,v100,fine,tool0;",
            "ConfJ\\Off;",
            "ConfL\\Off;",
            "MoveJ p,v100,fine,tool0;",
            "MoveL p,v100,fine,tool0;",
            "ConfJ\\On;",
            "ConfL;",
            "MoveJ RelTool(p,0,0,1),v100,fine,tool0;",
            "MoveL Offs(p,0,0,1),v100,fine,tool0;",
        ]
    )
    e = done(module(body, P)).events
    told = ~np.isnan(e.configuration).any(axis=1)
    assert told.tolist() == [True, True, False, False, True, True]
    assert (e.configuration[told] == [0.0, -1.0, 2.0, 1.0]).all()


# ── tools and bases ──────────────────────────────────────────────────────────────────────────────

FRAMES = """
PERS tooldata drill:=[TRUE,[[1,2,3],[0.70710678,0,0,0.70710678]],[5,[0,0,9],[1,0,0,0],0,0,0]];
PERS wobjdata part:=[FALSE,TRUE,"",[[10,0,0],[0.5,0.5,0.5,0.5]],[[0,1,0],[0,1,0,0]]];
PERS wobjdata table:=[FALSE,FALSE,"STN1",[[0,0,0],[1,0,0,0]],[[0,0,0],[1,0,0,0]]];
"""


def test_tools_and_bases_with_their_values() -> None:
    body = """
    MoveL p,v100,fine,drill\\WObj:=part;
    MoveL p,v100,fine,tool0;
    MoveL p,v100,fine,tCell\\WObj:=wCell;
    go p,drill,part;
    go p,tCell,wCell;
    MoveL p,v100,fine,drill\\WObj:=table;
    drill.tframe.trans.z:=4;
    MoveL p,v100,fine,drill\\WObj:=part;
    """
    more = (
        "PROC go(robtarget t,PERS tooldata t1,PERS wobjdata in)\n"
        "MoveL t,v100,fine,t1\\WObj:=in;\nENDPROC"
    )
    found = done(module(body, FRAMES + P, more=more))
    frames, e = found.run.frames, found.events
    names = [(frames[t].name, frames[b].name) for t, b in zip(e.tool, e.base, strict=True)]
    own = ("drill", "part")
    cell = ("tCell", "wCell")
    assert names == [own, ("tool0", "wobj0"), cell, own, cell, ("drill", "table"), own]
    assert [e.tool[3], e.base[3]] == [e.tool[0], e.base[0]]
    assert e.tool[4] == e.tool[2]
    tool, part = frames[e.tool[0]], frames[e.base[0]]
    assert tool.position_mm.tolist() == [1.0, 2.0, 3.0]
    assert np.abs(tool.rotation - turn(1, 0, 0, 1)).max() < 1e-8
    user = turn(0.5, 0.5, 0.5, 0.5)
    assert np.abs(part.rotation - user @ turn(0, 1, 0, 0)).max() < 1e-12
    assert np.abs(part.position_mm - (user @ [0, 1, 0] + [10, 0, 0])).max() < 1e-12
    assert frames[e.tool[1]].rotation.tolist() == np.eye(3).tolist()
    assert frames[e.base[5]].rotation is None  # the cell moves it
    assert frames[e.tool[2]].position_mm is None
    assert frames[e.tool[6]].position_mm.tolist() == [1.0, 2.0, 4.0]


# ── signals and waits ────────────────────────────────────────────────────────────────────────────


def test_signals() -> None:
    body = """
    Set do_a;
    Reset DO_a;
    SetDO do_b,1;
    SetAO ao,3000.5;
    PulseDO do_c;
    PulseDO\\High,do_c;
    PulseDO\\High\\PLength:=0.2,do_c;
    """
    assert done(module(body)).kinds() == [
        "output do_a 1",
        "output do_a 0",
        "output do_b 1",
        "analog ao 3000.5",
        "output do_c 1",
        "output do_c 0",
        "output do_c 1",
        "output do_c 1",
    ]


@pytest.mark.parametrize(
    "wait",
    [
        "WaitDI di,1\\MaxTime:=2.5\\TimeFlag:=late;",
        "WaitDI di,high\\MaxTime:=2.5\\TimeFlag:=late;",
        "WaitUntil di=1\\MaxTime:=2.5\\TimeFlag:=late;",
        "WaitUntil DInput(di)=1\\MaxTime:=2.5\\TimeFlag:=late;",
        "WaitUntil TestDI(di)\\MaxTime:=2.5\\TimeFlag:=late;",
    ],
)
def test_waits_with_a_limit(wait: str) -> None:
    body = f"VAR bool late;\n{wait}\nIF late THEN\nReset dq;\nEXIT;\nENDIF\nSet dq;"
    found = done(module(body))
    assert found.kinds() == ["wait di 1", "output dq 1"]
    assert found.events.timeout_s[0] == 2.5
    [other] = found.others
    assert found.kinds(other.events) == ["output dq 0", "stop"]
    assert (other.timeout, other.line, other.ends) == (True, 5, True)


def test_a_wait_that_runs_out_goes_another_way() -> None:
    more = (
        "PROC r()\nVAR bool late;\nWaitDI di,1\\MaxTime:=2\\TimeFlag:=late;\n"
        "IF late THEN\nReset dq;\nEXIT;\nENDIF\nSet dq;\nENDPROC"
    )
    found = done(module("r;", more=more))
    assert found.kinds() == ["wait di 1", "output dq 1"]
    [other] = found.others
    assert found.kinds(other.events) == ["output dq 0", "stop"]
    assert (other.ends, other.call_line.tolist()) == (True, [4])


def test_waits_without_a_limit_and_without_a_flag() -> None:
    found = done(module("r;", more="PROC r()\nWaitDI di,0;\nWaitDO dq,1\\MaxTime:=3;\nENDPROC"))
    assert found.kinds() == ["wait di 0", "wait dq 1"]
    assert found.events.timeout_s.tolist() == [math.inf, 3.0]
    ends = {other.line: found.kinds(other.events) for other in found.others}
    assert ends[8] == ["pause inf"]  # an error that nobody handles: the program stands


def test_inputs_are_looked_at_both_ways() -> None:
    found = done(module("IF di=1 THEN\nWaitTime 1;\nELSE\nWaitTime 2;\nENDIF"))
    assert found.kinds() == ["pause 2"]
    [other] = found.others
    assert (found.kinds(other.events), other.timeout) == (["pause 1"], False)
    kept = "VAR bool b;\nb:=DOutput(dq)=1 OR FALSE;\nIF b WaitTime 1;"
    assert len(done(module(kept)).others) == 1
    known = "IF FALSE AND di=1 WaitTime 1;\nIF TRUE OR di=1 WaitTime 2;"
    assert (done(module(known)).kinds(), done(module(known)).others) == (["pause 2"], [])


def test_messages_stops_and_settings() -> None:
    body = """
    TPErase;
    TPWrite "depth "\\Num:=3;
    ErrWrite\\W,"title","text ""quoted"" ! no comment";
    AccSet 50,50;
    SingArea\\Wrist;
    VelSet 100,5000;
    Stop\\NoRegain;
    Break;
    EXIT;
    WaitTime 1;
    """
    assert done(module(body)).kinds() == ["message", "message", "pause inf", "pause inf", "stop"]


def test_other_robots_are_waited_for() -> None:
    data = 'PERS tasks all{2}:=[["T_ROB1"],["T_ROB2"]];\nVAR syncident s;'
    found = done(module("SyncMoveOn s,all;\nMoveL p\\ID:=10,v100,fine,tool0;", f"{data}\n{P}"))
    assert found.kinds() == ["wait SyncMoveOn s 1", "straight"]


# ── stretches ────────────────────────────────────────────────────────────────────────────────────


def targets(count: int, kind: str = "CONST", name: str = "q") -> str:
    return "\n".join(
        f"{kind} robtarget {name}{i}:=[[{i},{2 * i - 9}.25,-{i}E-1],[1,0,0,0],[0,0,0,0],"
        "[9E9,9E9,9E9,9E9,9E9,9E9]];"
        for i in range(count)
    )


def same_in_bulk(files: bytes, monkeypatch: pytest.MonkeyPatch, bulk: bool = True) -> np.ndarray:
    """Positions of the moves, which are the same read in bulk and line by line."""
    one = done(files)
    assert bulk == any(step for m in one.run.program.modules for step in m.bulk if not step.data)
    monkeypatch.setattr("drillc.verification.alike.LEAST", 10**9)
    two = done(files)
    assert not any(m.bulk for m in two.run.program.modules)
    for column, value in vars(one.events).items():
        assert np.array_equal(value, getattr(two.events, column), equal_nan=True), column
    assert one.run.findings() == two.run.findings()
    assert [one.run.name_of(0, line) for line in one.events.call_line] == [
        two.run.name_of(0, line) for line in two.events.call_line
    ]
    return one.events.position_mm


ROUTINE = """
PROC r(robtarget t,num depth)
  VAR num z;
  WHILE z<depth DO
    z:=z+3;
    MoveL RelTool(t,0,0,z),v100,fine,tool0;
  ENDWHILE
  n:=n+1;
  MoveL Offs(t,0,0,n),v100,fine,tool0;
ENDPROC
"""


def test_calls_in_bulk(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = "\n".join(f"  r q{i},{i % 5}; ! hole {i}" for i in range(20))
    files = module(calls, targets(20) + "\nVAR num n;", more=ROUTINE)
    place = same_in_bulk(files, monkeypatch)
    assert len(place) == 20 + sum(math.ceil((i % 5) / 3) for i in range(20))
    assert place[-1, 2] == pytest.approx(-1.9 + 20)  # the count went from hole to hole


@pytest.mark.parametrize(
    "call",
    [
        "MoveL q{i},v100,fine,tool0;",
        "MoveL Offs(q{i},0,0,-{i}.5),v100\\V:={i},fine,tool0;",
        "MoveL RelTool ( Q{i} , 0,0, - {i} ),v100,fine,tool0; SetDO dq,1;",
        "r q{i},a{{1}};",
        "IF {i}>4 THEN\nMoveL q{i},v100,fine,tool0;\nENDIF",
        "MoveL [[{i},0,0],[1,0,0,0],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]],v100,fine,tool0;",
        "q{i}.trans.z:=7;\nMoveL q{i},v100,fine,tool0;",
    ],
)
def test_statements_in_bulk(call: str, monkeypatch: pytest.MonkeyPatch) -> None:
    body = "\n".join(call.format(i=i) for i in range(12))
    bulk = not any(word in call for word in ("trans", "ENDIF"))
    data = targets(12, "VAR") + "\nVAR num n;\nCONST num a{2}:=[4,2];"
    place = same_in_bulk(module(body, data, more=ROUTINE), monkeypatch, bulk)
    assert len(place) >= 7


def test_one_line_otherwise_in_a_stretch(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hand edits: a hole commented out, a robtarget written otherwise, one that is assigned to."""
    lines = targets(30).split("\n")
    lines[3] = lines[3].replace("[[3,", "[[3.75 + 0,").replace("CONST", "const")
    lines[20] = lines[20].replace("CONST", "PERS")
    calls = [f"r q{i},1;" for i in range(30)]
    calls[7] = "! " + calls[7]
    calls[12] = "q20.trans.x := 99;\n" + calls[12]
    data = "\n".join(lines) + "\nVAR num n;"
    place = same_in_bulk(module("\n".join(calls), data, more=ROUTINE), monkeypatch)
    assert 3.75 in place[:, 0]
    assert 7.0 not in place[:, 0]
    assert (99.0 in place[:, 0], 20.0 in place[:, 0]) == (True, False)


def test_stretch_inside_a_loop(monkeypatch: pytest.MonkeyPatch) -> None:
    calls = "\n".join(f"r q{i},1;" for i in range(10))
    body = f"FOR k FROM 1 TO 2 DO\n{calls}\nENDFOR"
    place = same_in_bulk(module(body, targets(10) + "\nVAR num n;", more=ROUTINE), monkeypatch)
    assert len(place) == 40


def test_positions_of_another_module() -> None:
    calls = "\n".join(f"MoveL q{i},v100,fine,tool0;" for i in range(20))
    files = {
        "T.mod": module(calls),
        "D.mod": f"MODULE D\n{targets(20)}\nENDMODULE\n".replace("\n", "\r\n").encode(),
    }
    found = done(files)
    assert found.events.position_mm[:, 0].tolist() == list(map(float, range(20)))
    assert found.run.findings() == []
    assert found.run.name_of(0, 5) == "q1"

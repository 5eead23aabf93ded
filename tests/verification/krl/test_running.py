"""Hand-written programs, and what they do, worked out by hand or with scipy's rotations."""

from __future__ import annotations

import math

import numpy as np
import pytest
from drillc.verification.events import Kind
from drillc.verification.krl.reader import KrlReader
from drillc.verification.reading import ReadError
from scipy.spatial.transform import Rotation
from verification.krl.running import Ran, crlf, program, ran, run

P = "DECL E6POS P={X 100.0,Y 20.0,Z 300.0,A 30.0,B -40.0,C 170.0,S 2,T 35}\n"


def values(made: Ran) -> list[float]:
    """The pauses of a run: what a program counted, one after another."""
    pauses = made.events.kind == Kind.PAUSE
    return [round(value, 9) for value in made.events.value[pauses].tolist()]


def counted(body: str, declare: str = "", data: str = "", routines: str = "") -> list[float]:
    return values(run(body, data, declare=declare, routines=routines))


def turned(a: float, b: float, c: float) -> np.ndarray:
    return Rotation.from_euler("ZYX", [a, b, c], degrees=True).as_matrix()


# ── frames and moves ─────────────────────────────────────────────────────────────────────────────


def test_a_ptp_goes_by_what_its_target_says_of_the_arm() -> None:
    made = run("  PTP P\n  $VEL.CP=0.25\n  LIN P\n  PTP P:$NULLFRAME\n", P)
    assert made.kinds() == ["JOINTS", "STRAIGHT", "JOINTS"]
    assert made.events.configuration[0, :2].tolist() == [2.0, 35.0]
    assert np.isnan(made.events.configuration[0, 2:]).all()
    assert np.isnan(made.events.configuration[1:]).all(), "LIN ignores it; a product has none"
    assert made.events.speed_mm_s[1] == 250.0
    assert np.isnan(made.events.speed_mm_s[0])
    assert made.events.value[0] == 0.1
    assert [made.run.frames[i].name for i in made.events.tool] == ["TOOL_DATA[3]"] * 3
    assert [made.run.frames[i].name for i in made.events.base] == ["BASE_DATA[2]"] * 3
    for row in range(3):
        assert made.events.position_mm[row].tolist() == [100.0, 20.0, 300.0]
        assert np.allclose(made.events.rotation[row], turned(30, -40, 170), atol=1e-14)
    assert made.findings() == []


def test_the_geometric_operator_gives_its_right_operand_in_the_left() -> None:
    data = P + "DECL FRAME F={X 1.0,Y 2.0,Z -30.0,A 10.0,B 20.0,C -5.0}\n"
    made = run("  PTP P:F\n  PTP F:P\n  PTP P:F:F\n", data)
    p, f = turned(30, -40, 170), turned(10, 20, -5)
    at, shift = np.array([100.0, 20, 300]), np.array([1.0, 2, -30])
    assert np.allclose(made.events.rotation, [p @ f, f @ p, p @ f @ f], atol=1e-14)
    wanted = [at + p @ shift, shift + f @ at, at + p @ (shift + f @ shift)]
    assert np.allclose(made.events.position_mm, wanted, atol=1e-10)
    assert np.isnan(made.events.configuration[[0, 2]]).all()
    assert made.events.configuration[1, :2].tolist() == [2.0, 35.0], "the right operand is an E6POS"


def test_a_frame_that_is_kept_has_angles_again() -> None:
    declare = "  DECL FRAME F\n"
    body = "  F=P:{X 0.0,Y 0.0,Z 5.0,A 0.0,B 90.0,C 0.0}\n  F.Z=F.Z+1\n  PTP F\n"
    made = run(body, P, declare=declare)
    turn = turned(30, -40, 170)
    wanted = np.array([100.0, 20, 301]) + turn @ [0, 0, 5.0]
    assert np.allclose(made.events.position_mm[0], wanted, atol=1e-10)
    assert np.allclose(made.events.rotation[0], turn @ turned(0, 90, 0), atol=1e-12)


def test_a_frame_of_which_a_part_changes_is_another_frame() -> None:
    made = run("  F=P\n  PTP F\n  F.X=F.X+1\n  PTP F\n", P, declare="  DECL FRAME F\n")
    assert made.events.position_mm[:, 0].tolist() == [100.0, 101.0]


@pytest.mark.parametrize("angles", [(30.0, 90.0, 0.0), (0.0, -90.0, 45.0), (180.0, 0.0, 180.0)])
def test_angles_in_gimbal_lock_turn_the_same(angles: tuple[float, float, float]) -> None:
    a, b, c = angles
    data = f"DECL FRAME Q={{X 1.0,Y 0.0,Z 0.0,A {a},B {b},C {c}}}\n"
    made = run("  F=Q:Q\n  PTP F\n", data, declare="  DECL FRAME F\n")
    assert np.allclose(made.events.rotation[0], turned(a, b, c) @ turned(a, b, c), atol=1e-12)


def test_axes_that_are_not_given_stay() -> None:
    body = "  PTP {A1 10.0,A2 -80.0,E1 5.0}\n  PTP {A1 20.0}\n  AT=$AXIS_ACT\n  AT.A2=AT.A1+1.5\n"
    made = run(body + "  PTP AT\n  PTP P\n  PTP {A1 1.0}\n", P, declare="  DECL E6AXIS AT\n")
    joints = made.events.joints
    assert joints[0, [0, 1, 6]].tolist() == [10.0, -80.0, 5.0]
    assert np.isnan(joints[0, 2])
    assert joints[1, [0, 1, 6]].tolist() == [20.0, -80.0, 5.0]
    assert joints[2, [0, 1, 6]].tolist() == [20.0, 21.5, 5.0]
    assert np.isnan(joints[3]).all()
    assert joints[4, [0, 6]].tolist() == [1.0, 5.0]
    assert np.isnan(joints[4, 1]), "where a pose leaves the axes, only the controller knows"


def test_home_is_where_the_controller_says() -> None:
    made = run("  PTP $H_POS\n  PTP XHOME\n")
    assert made.kinds() == ["HOME", "HOME"]
    assert made.events.value.tolist() == [0.1, 0.1]
    made = run("  $H_POS=VIA\n  PTP $H_POS\n", "DECL E6AXIS VIA={A1 5.0,A2 -90.0}\n")
    assert made.kinds() == ["JOINTS"]
    assert made.events.joints[0, :2].tolist() == [5.0, -90.0]


def test_relative_moves() -> None:
    body = (
        "  PTP P\n  $VEL.CP=1\n  LIN_REL {Z 30.0}\n  LIN_REL {Z 30.0} #TOOL\n"
        "  PTP_REL {X -1.0,A 5.0}\n"
    )
    made = run(body, P)
    turn = turned(30, -40, 170)
    third = np.array([100.0, 20, 330]) + 30.0 * turn[:, 2]
    assert np.allclose(made.events.position_mm[1], [100, 20, 330])
    assert np.allclose(made.events.position_mm[2], third)
    assert np.allclose(made.events.position_mm[3], third + np.array([-1, 0, 0]))
    assert np.allclose(made.events.rotation[3], turned(35, -40, 170), atol=1e-12)
    with pytest.raises(ReadError, match="where the tool is cannot be known here"):
        run("  PTP $H_POS\n  LIN_REL {Z 1.0}\n")
    made = run("  PTP {A1 5.0}\n  PTP_REL {A1 2.5}\n")
    assert made.events.joints[1, 0] == 7.5


def test_a_spline_move_sets_what_it_needs_for_itself_only() -> None:
    body = (
        "  PTP P\n  $VEL.CP=0.1\n"
        "  SLIN P WITH $VEL.CP=SVEL_CP(0.5,,LP), $TOOL=STOOL2(FP), $BASE=SBASE(FP.BASE_NO)\n"
        "  SPTP P WITH $VEL_AXIS[1]=SVEL_JOINT(50.0), $ACC_AXIS[1]=SACC_JOINT(PP)\n  LIN P\n"
    )
    data = P + (
        'DECL FDAT FP={TOOL_NO 7,BASE_NO 1,IPO_FRAME #BASE,POINT2[] " "}\n'
        "DECL LDAT LP={VEL 2.0,ACC 100.0}\nDECL PDAT PP={VEL 100.0,ACC 100.0}\n"
    )
    made = run(body, data)
    assert made.events.speed_mm_s[[1, 3]].tolist() == [500.0, 100.0]
    assert [made.run.frames[i].name[-3:] for i in made.events.tool] == ["[3]", "[7]", "[3]", "[3]"]


def test_inline_forms_of_ptp_and_lin() -> None:
    body = """  ;FOLD PTP P Vel=50 % PP Tool[7] Base[0];%{PE}
  $BWDSTART=FALSE
  PDAT_ACT=PP
  FDAT_ACT=FP
  BAS(#PTP_PARAMS,50)
  PTP XP
  ;ENDFOLD
  ;FOLD LIN P Vel=0.5 m/s LP Tool[7] Base[0];%{PE}
  $BWDSTART=FALSE
  LDAT_ACT=LP
  FDAT_ACT=FP
  BAS(#CP_PARAMS,0.5)
  LIN XP
  ;ENDFOLD
"""
    data = P.replace(" P=", " XP=") + (
        'DECL FDAT FP={TOOL_NO 7,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " "}\n'
        "DECL LDAT LP={VEL 2.0,ACC 100.0}\nDECL PDAT PP={VEL 100.0,ACC 100.0}\n"
    )
    made = run(body, data)
    assert made.kinds() == ["JOINTS", "STRAIGHT"]
    assert made.events.value[0] == 0.5
    assert made.events.speed_mm_s[1] == 500.0
    assert [made.run.frames[i].name for i in made.events.tool] == ["TOOL_DATA[7]"] * 2
    assert [made.run.frames[i].name for i in made.events.base] == ["BASE_DATA[0]"] * 2
    assert made.findings() == []


def test_tools_and_bases_have_values_where_the_program_states_them() -> None:
    frame = "{X 1.0,Y 2.0,Z 3.0,A 90.0,B 0.0,C 0.0}"
    body = (
        f"  TOOL_DATA[3]={frame}\n  PTP P\n  BAS(#TOOL,3)\n  PTP P\n  $BASE={frame}\n  PTP P\n"
        "  $BASE=$WORLD\n  $TOOL=TOOL_DATA[3]\n  PTP P\n"
    )
    made = run(body, P)
    tools = [made.run.frames[i] for i in made.events.tool]
    bases = [made.run.frames[i] for i in made.events.base]
    assert [tool.name for tool in tools] == ["TOOL_DATA[3]"] * 4
    assert [tool.rotation is not None for tool in tools] == [False, True, True, True]
    assert np.allclose(tools[1].rotation, turned(90, 0, 0))  # type: ignore[arg-type]
    assert tools[1].position_mm.tolist() == [1.0, 2.0, 3.0]  # type: ignore[union-attr]
    assert [b.name for b in bases] == ["BASE_DATA[2]", "BASE_DATA[2]", "$BASE", "BASE_DATA[0]"]
    assert bases[2].position_mm.tolist() == [1.0, 2.0, 3.0]  # type: ignore[union-attr]


def test_initmov_leaves_tool_and_base_to_the_controller() -> None:
    made = run("  BAS(#INITMOV,0)\n  PTP P\n", P)
    assert (made.events.tool.tolist(), made.events.base.tolist()) == ([-1], [-1])
    assert made.events.value.tolist() == [1.0]


def test_speeds() -> None:
    body = (
        "  PTP P\n  BAS(#VEL_CP,0.3)\n  LIN P\n  $OV_PRO=50\n  LIN P\n  PTP P\n"
        "  FOR I=1 TO 6\n    $VEL_AXIS[I]=80\n  ENDFOR\n  PTP P\n  $VEL_AXIS[2]=10\n  PTP P\n"
    )
    made = run(body, P, declare="  INT I\n")
    assert made.events.speed_mm_s[[1, 2]].tolist() == [300.0, 150.0]
    assert made.events.value[[0, 3, 4]].tolist() == [0.1, 0.05, 0.4]
    assert np.isnan(made.events.value[5]), "axes with different shares"


# ── control ──────────────────────────────────────────────────────────────────────────────────────


def test_loops() -> None:
    declare = "  INT I\n  REAL R\n"
    assert counted("  FOR I=1 TO 3\n    WAIT SEC I\n  ENDFOR\n", declare) == [1, 2, 3]
    assert counted("  FOR I=5 TO 1 STEP -2\n    WAIT SEC I\n  ENDFOR\n", declare) == [5, 3, 1]
    assert counted("  FOR I=2 TO 1\n    WAIT SEC I\n  ENDFOR\n", declare) == []
    assert counted("  R=0.5\n  WHILE R<2\n    R=R+0.5\n    WAIT SEC R\n  ENDWHILE\n", declare) == [
        1,
        1.5,
        2,
    ]
    body = "  I=0\n  REPEAT\n    I=I+1\n    WAIT SEC I\n  UNTIL I==3\n"
    assert counted(body, declare) == [1, 2, 3]
    body = "  I=0\n  LOOP\n    I=I+1\n    IF I>2 THEN\n      EXIT\n    ENDIF\n"
    body += "    WAIT SEC I\n  ENDLOOP\n"
    assert counted(body + "  WAIT SEC 9\n", declare) == [1, 2, 9]


@pytest.mark.parametrize(("value", "wanted"), [(1, 10), (2, 20), (3, 20), (7, 30)])
def test_switch(value: int, wanted: float) -> None:
    body = (
        f"  I={value}\n  SWITCH I\n  CASE 1\n    WAIT SEC 10\n  CASE 2,3\n    WAIT SEC 20\n"
        "  DEFAULT\n    WAIT SEC 30\n  ENDSWITCH\n"
    )
    assert counted(body, "  INT I\n") == [wanted]


def test_if_and_its_other_way() -> None:
    body = "  IF (I>1) AND NOT (I==3) THEN\n    WAIT SEC 1\n  ELSE\n    WAIT SEC 2\n  ENDIF\n"
    assert [counted(f"  I={i}\n{body}", "  INT I\n")[0] for i in (1, 2, 3)] == [2, 1, 2]


def test_arithmetic_is_that_of_krl() -> None:
    declare = "  INT I\n  REAL R\n"
    assert counted("  WAIT SEC 7/2\n  WAIT SEC 7.0/2\n  WAIT SEC 2+3*4\n  WAIT SEC (2+3)*4\n") == [
        3,
        3.5,
        14,
        20,
    ]
    assert counted(
        "  I=2.5\n  WAIT SEC I\n  I=2.4\n  WAIT SEC I\n  R=3\n  WAIT SEC R/2\n", declare
    ) == [
        3,
        2,
        1.5,
    ]
    assert counted("  WAIT SEC ABS(-2.5)\n  WAIT SEC COS(60)\n  WAIT SEC ATAN2(1.0,1.0)\n") == [
        2.5,
        0.5,
        45,
    ]
    assert counted("  WAIT SEC 'B101'\n  WAIT SEC 'H1F'\n  WAIT SEC 6 B_AND 3\n") == [5, 31, 2]


def test_routines_take_and_hand_back() -> None:
    routines = """DEF twice(X :IN,Y)
  REAL X,Y
  Y=X*2
END
DEFFCT REAL plus(X :IN,Y :IN)
  REAL X,Y
  IF X>100 THEN
    RETURN 0.0
  ENDIF
  RETURN X+Y
ENDFCT
"""
    body = (
        "  twice(1.5,R)\n  WAIT SEC R\n  R=plus(R,1)*10\n  WAIT SEC R\n  WAIT SEC plus(200,1)+1\n"
    )
    assert counted(body, "  REAL R\n", routines=routines) == [3, 40, 1]
    body = "  R=1\n  WHILE plus(R,0)<3\n    WAIT SEC R\n    R=R+1\n  ENDWHILE\n"
    assert counted(body, "  REAL R\n", routines=routines) == [1, 2]


def test_data_lists_hold_variables_arrays_structures_and_enums() -> None:
    data = """STRUC PART REAL DEEP,WIDE,INT NUMBER
ENUM MODES FAST,SLOW
DECL INT COUNT=2
DECL REAL TABLE[3]
TABLE[1]=0.5
TABLE[2]=1.5
TABLE[3]=-2.5E-1
DECL PART ONE={DEEP 4.0,WIDE 2.0,NUMBER 3}
DECL MODES MODE=#SLOW
DECL CHAR TITLE[20]
TITLE[]="a text"
DECL E6POS FAR[2,2]
FAR[2,1]={X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}
"""
    body = (
        "  WAIT SEC TABLE[COUNT]\n  COUNT=COUNT+1\n  WAIT SEC -TABLE[COUNT]\n"
        "  WAIT SEC ONE.DEEP/ONE.NUMBER\n  ONE.NUMBER=4\n  WAIT SEC ONE.DEEP/ONE.NUMBER\n"
        "  IF MODE==#SLOW THEN\n    WAIT SEC 8\n  ENDIF\n  PTP FAR[2,1]\n"
    )
    made = run(body, data)
    assert values(made) == [1.5, 0.25, pytest.approx(4 / 3), 1, 8]
    assert made.events.position_mm[-1].tolist() == [1.0, 2.0, 3.0]


def test_what_nobody_knows_is_tried_both_ways() -> None:
    made = run("  IF $IN[7] THEN\n    WAIT SEC 1\n  ENDIF\n  WAIT SEC 2\n")
    assert values(made) == [2]
    (other,) = made.others
    assert (other.timeout, other.events.value.tolist()) == (False, [1.0])
    made = run("  REPEAT\n    WAIT SEC 1\n  UNTIL $IN[7]\n")
    assert values(made) == [1]


# ── signals, timers, ends ────────────────────────────────────────────────────────────────────────


def test_signals_by_number_and_by_name() -> None:
    data = "SIGNAL CLAMP $OUT[5]\nSIGNAL CLAMPED $IN[6]\nDECL INT N=9\n"
    body = (
        "  CLAMP=TRUE\n  $OUT[N]=NOT CLAMP\n  $ANOUT[2]=0.25\n  WAIT FOR CLAMPED\n"
        "  WAIT FOR NOT $IN[N]\n  WAIT FOR ($IN[1]==FALSE)\n  PULSE($OUT[3],TRUE,0.2)\n"
    )
    made = run(body, data)
    wanted = ["$OUT[5]", "$OUT[9]", "$ANOUT[2]", "$IN[6]", "$IN[9]", "$IN[1]", "$OUT[3]", "$OUT[3]"]
    assert made.signals() == wanted
    assert made.events.value.tolist() == [1, 0, 0.25, 1, 0, 0, 1, 0]
    assert made.events.timeout_s[3:6].tolist() == [math.inf] * 3
    assert made.others == []


WAITING = """  $TIMER_STOP[4]=TRUE
  $TIMER[4]=-2500
  $TIMER_STOP[4]=FALSE
  WAIT FOR $IN[6] OR $TIMER_FLAG[4]
  $TIMER_STOP[4]=TRUE
  IF $TIMER_FLAG[4] THEN
    $OUT[1]=FALSE
    LOOP
      HALT
    ENDLOOP
  ENDIF
  $OUT[1]=TRUE
"""


def test_a_wait_with_a_timer_and_both_its_ends() -> None:
    made = run(WAITING)
    assert made.kinds() == ["WAIT", "OUTPUT"]
    assert made.events.timeout_s[0] == 2.5
    assert made.events.value.tolist() == [1.0, 1.0]
    (other,) = made.others
    assert other.timeout
    assert other.ends
    assert [Kind(k).name for k in other.events.kind.tolist()] == ["OUTPUT", "STOP"]
    assert (other.line, other.events.line.tolist()) == (11, [14, 15])


def test_a_timer_counts_pauses_and_does_not_know_how_long_a_move_takes() -> None:
    start = "  $TIMER[1]=-3000\n  $TIMER_STOP[1]=FALSE\n"
    wait = "  WAIT FOR $IN[6] OR $TIMER_FLAG[1]\n"
    made = run(f"{start}  WAIT SEC 1\n{wait}")
    assert made.events.timeout_s[-1] == 2.0
    with pytest.raises(ReadError, match="how long it waits is not known"):
        run(f"{start}  PTP P\n{wait}", P)
    made = run(f"  $TIMER[1]=-3000\n{wait}")
    assert made.events.timeout_s.tolist() == [math.inf], "a timer that stands never ends a wait"


def test_a_timer_that_is_stopped_stands_and_its_flag_is_set_above_zero() -> None:
    start = "  $TIMER[1]=-3000\n  $TIMER_STOP[1]=FALSE\n  $TIMER_STOP[1]=TRUE\n  PTP P\n"
    made = run(f"{start}  WAIT FOR $IN[6] OR $TIMER_FLAG[1]\n", P)
    assert made.events.timeout_s[-1] == math.inf
    asks = "  IF $TIMER_FLAG[1] THEN\n    WAIT SEC 1\n  ELSE\n    WAIT SEC 2\n  ENDIF\n"
    assert [counted(f"  $TIMER[1]={ms}\n{asks}") for ms in (-1, 0, 1)] == [[2], [2], [1]]


def test_halt_waits_for_a_person() -> None:
    made = run("  HALT\n  WAIT SEC 1\n")
    assert values(made) == [math.inf, 1]
    made = run("  LOOP\n    HALT\n  ENDLOOP\n  WAIT SEC 1\n")
    assert made.kinds() == ["STOP"]


def test_a_message_is_told() -> None:
    made = run('  MsgNotify("no signal","P")\n')
    assert made.kinds() == ["MESSAGE"]


# ── modules ──────────────────────────────────────────────────────────────────────────────────────


def test_modules_that_no_other_calls_are_the_programs() -> None:
    help_ = "GLOBAL DEF help(X :IN)\n  REAL X\n  WAIT SEC X\nEND\n"
    one = {
        "krl/A.src": crlf("DEF A( )\n  PART( )\n  PART( )\nEND\n"),
        "krl/B.src": crlf("DEF B( )\n  help(2)\nEND\n"),
        "krl/PART.src": crlf("DEF PART( )\n  WAIT SEC 1\nEND\n" + help_),
        "krl/names.csv": b"what,spec,controller\r\n",
    }
    runs = KrlReader().read(one)
    assert [made.name for made in runs] == ["A", "B"]
    assert [values(ran(made)) for made in runs] == [[1, 1], [2]]
    assert ran(runs[0]).events.file.tolist() == [2, 2]
    assert ran(runs[0]).events.call_file.tolist() == [2, 2]
    assert list(runs[0].files) == list(one)


def test_modules_that_call_themselves_and_one_another() -> None:
    itself = crlf("DEF A( )\n  IF FALSE THEN\n    A( )\n  ENDIF\n  WAIT SEC 1\nEND\n")
    (made,) = KrlReader().read({"krl/A.src": itself})
    assert values(ran(made)) == [1]
    files = {f"krl/{a}.src": crlf(f"DEF {a}( )\n  {b}( )\nEND\n") for a, b in ("AB", "BA")}
    with pytest.raises(ReadError, match="no program: every module is called by another"):
        KrlReader().read(files)


def test_a_part_that_is_called_in_a_loop_runs_its_alike_lines() -> None:
    calls = "".join(f"  pause({i}.5)\n" for i in range(12))
    pause = "GLOBAL DEF pause(X :IN)\n  REAL X\n  WAIT SEC X\nEND\n"
    files = {
        "krl/A.src": crlf(
            "DEF A( )\n  INT I\n  FOR I=1 TO 2\n    PART( )\n  ENDFOR\nEND\n" + pause
        ),
        "krl/PART.src": crlf(f"DEF PART( )\n{calls}END\n"),
    }
    (made,) = KrlReader().read(files)
    assert values(ran(made)) == [i + 0.5 for i in range(12)] * 2


def test_names_of_positions_for_messages() -> None:
    body = "  PTP P1:STANDOFF[1]\n  drill(P2)\n  PTP VIA[2]\n  WAIT SEC 0\n"
    frame = "{X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}"
    data = (
        f"DECL E6POS P1={frame}\nDECL E6POS P2={frame}\n"
        f"DECL FRAME STANDOFF[1]\nSTANDOFF[1]={frame}\nDECL E6POS VIA[2]\nVIA[2]={frame}\n"
    )
    routines = "DEF drill(HOLE :IN)\n  DECL E6POS HOLE\n  PTP HOLE\nEND\n"
    made = run(body, data, routines=routines)
    names = [made.run.name_of(0, line) for line in (8, 9, 10, 11, 99)]
    assert names == ["P1", "P2", "VIA[2]", None, None]


def test_signals_of_the_spec_have_numbers() -> None:
    from drillc.language.job import Signal
    from output.programs import span

    reader = KrlReader()
    analog = Signal("clamp_force", "analog", 2, 2000.0, "x", span(1))
    names = [
        reader.signal_name(Signal("a", kind, 7, None, "x", span(1)), {})  # type: ignore[arg-type]
        for kind in ("input", "output", "analog")
    ]
    assert names == ["$IN[7]", "$OUT[7]", "$ANOUT[7]"]
    assert reader.analog_value(analog, 500.0) == 0.25


def test_the_program_helper_makes_both_files() -> None:
    assert sorted(program("")) == ["krl/CELL.dat", "krl/CELL.src"]

"""Alike lines that are read as one do what the same lines do one by one."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import pytest
from drillc.verification import alike
from drillc.verification.krl.reader import KrlReader
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from verification.krl.running import Ran, program, ran, same_events

ROUTINES = """DEF drill(HOLE :IN,DEPTH :IN)
  DECL E6POS HOLE
  DECL REAL DEPTH,BOTTOM
  DECL FRAME AT
  AT=$NULLFRAME
  $VEL.CP=0.25
  LIN HOLE:STANDOFF[1]
  WAIT SEC 0
  $OUT[1]=TRUE
  $TIMER_STOP[16]=TRUE
  $TIMER[16]=-2000
  $TIMER_STOP[16]=FALSE
  WAIT FOR $IN[1] OR $TIMER_FLAG[16]
  $TIMER_STOP[16]=TRUE
  IF $TIMER_FLAG[16] THEN
    $OUT[1]=FALSE
    LOOP
      HALT
    ENDLOOP
  ENDIF
  BOTTOM=0
  WHILE BOTTOM+3<DEPTH
    BOTTOM=BOTTOM+3
    AT.Z=BOTTOM
    LIN HOLE:AT
  ENDWHILE
  $VEL.CP=0.005
  AT.Z=DEPTH
  LIN HOLE:AT
  COUNT=COUNT+1
  WAIT SEC COUNT
END
DEF visit(HOLE :IN)
  DECL E6POS HOLE
  PTP HOLE
END
"""
DATA = """DECL FRAME STANDOFF[1]
STANDOFF[1]={X 0.0,Y 0.0,Z -50.0,A 0.0,B 0.0,C 0.0}
DECL INT COUNT=0
"""


def position(i: int) -> str:
    x, a = 3.25 * i - 7.0, 5.5 * i - 90.0
    return f"{{X {x:.3f},Y {-x:.3f},Z {x / 3:.3f},A {a:.4f},B {a / 2:.4f},C {-a:.4f}}}"


def positions(count: int) -> str:
    return "".join(f"DECL E6POS P{i}={position(i)}\n" for i in range(count))


def one_by_one(files: Mapping[str, bytes]) -> Ran:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(alike, "LEAST", 1 << 30)
        return both_halves(files)


def both_halves(files: Mapping[str, bytes]) -> Ran:
    (run,) = KrlReader().read(files)
    return ran(run)


def lanes_of(made: Ran) -> list[tuple[object, ...]]:
    """The alternatives, a lane each."""
    return sorted(
        (int(other.call_line[lane]), other.line, other.ends, other.timeout, end - begin)
        for other in made.others
        for lane, (begin, end) in enumerate(
            zip(other.starts[:-1].tolist(), other.starts[1:].tolist(), strict=True)
        )
    )


def agree(files: Mapping[str, bytes]) -> Ran:
    together, apart = both_halves(files), one_by_one(files)
    assert same_events(together.events, apart.events)
    assert lanes_of(together) == lanes_of(apart)
    assert together.run.findings() == apart.run.findings()
    assert [f.name for f in together.run.frames] == [f.name for f in apart.run.frames]
    return together


CALLS = st.lists(
    st.tuples(
        st.sampled_from(["drill", "visit", "ptp", "pause", "part"]),
        st.integers(0, 11),
        st.sampled_from([1.0, 3.0, 4.5, 8.25]),
        st.integers(1, 14),
    ),
    max_size=5,
)


def lines(groups: list[tuple[str, int, float, int]]) -> str:
    shapes = {
        "drill": "  drill(P{0},{1})\n",
        "visit": "  visit(P{0})\n",
        "ptp": "  PTP P{0}:STANDOFF[1]\n",
        "pause": "  WAIT SEC {1}\n",
        "part": "  WAIT SEC P{0}.Z+20.5\n",
    }
    return "".join(
        shapes[kind].format((first + k) % 12, depth + k % 3 * 2.5)
        for kind, first, depth, times in groups
        for k in range(times)
    )


@settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(CALLS)
def test_calls(groups: list[tuple[str, int, float, int]]) -> None:
    agree(program("  PTP P0\n" + lines(groups), DATA + positions(12), routines=ROUTINES))


def test_many_calls_are_really_read_as_one() -> None:
    body = "".join(f"  drill(P{i},{3 + i % 9}.5)\n" for i in range(60))
    files = program("  PTP P0\n" + body, DATA + positions(60), routines=ROUTINES)
    made = agree(files)
    counts = made.events.value[made.events.kind == 5]
    assert counts.tolist() == list(range(1, 61)), "each lane goes on from the one before it"
    assert made.events.call_line.max() == 8 + 60


def spaced(text: str) -> str:
    """The same program as somebody would write it who likes spaces and small letters."""
    text = re.sub(r"[=,+<]", lambda m: f" {m.group()} ", text)
    return re.sub(r"(?m)^(\s*)(PTP|LIN|DECL E6POS|WAIT SEC)\b", lambda m: m.group().lower(), text)


def test_spaces_case_comments_and_folds_change_nothing() -> None:
    body = "".join(f"  drill(P{i},{3 + i % 9}.5)\n" for i in range(20))
    plain = program("  PTP P0\n" + body, DATA + positions(20), routines=ROUTINES)
    made = agree(plain)
    other = {path: spaced(raw.decode()).encode() for path, raw in plain.items()}
    assert same_events(agree(other).events, made.events)
    uneven = {
        path: re.sub(r"\(P(\d*[02468]),", r"( P\1, ", raw.decode()).encode()
        for path, raw in plain.items()
    }
    assert uneven != plain
    assert same_events(agree(uneven).events, made.events)
    commented = {
        path: raw.replace(b"  drill(P7,", b"  ;FOLD seven\r\n  ;ENDFOLD\r\n  drill(P7,")
        for path, raw in plain.items()
    }
    assert same_events(agree(commented).events, made.events, but=("line", "call_line"))


def test_elements_of_arrays() -> None:
    data = "DECL E6POS VIA[30]\n" + "".join(f"VIA[{i + 1}]={position(i)}\n" for i in range(30))
    made = agree(program("".join(f"  PTP VIA[{i + 1}]\n" for i in range(30)), data))
    assert np.allclose(made.events.position_mm[:, 0], 3.25 * np.arange(30) - 7.0)


def test_positions_that_statements_write() -> None:
    body = "  P3.X=P3.X+100\n" + "".join(f"  visit(P{i})\n" for i in range(12))
    made = agree(program(body, DATA + positions(12), routines=ROUTINES))
    assert made.events.position_mm[3, 0] == pytest.approx(3.25 * 3 - 7.0 + 100)
    assert made.events.position_mm[4, 0] == pytest.approx(3.25 * 4 - 7.0)


def test_positions_with_other_components_among_them() -> None:
    rows = positions(20).replace(",C -", ",S 2,T 10,C -")
    data = DATA + positions(20).split("DECL E6POS P10=")[0] + "DECL E6POS P10="
    data += rows.split("DECL E6POS P10=")[1]
    made = agree(program("".join(f"  visit(P{i})\n" for i in range(20)), data, routines=ROUTINES))
    has_status = ~np.isnan(made.events.configuration[:, 0])
    assert has_status.any()
    assert not has_status.all()


@pytest.mark.parametrize(
    ("old", "new", "line", "message"),
    [
        ("drill(P7,", "drill(P99,", 16, "P99 is not declared"),
        ("drill(P7,", "drill(P7,1,", 16, "drill takes 2 values, not 3"),
        ("drill(P7,3.5)", "drill(P7,3,5)", 16, "drill takes 2 values, not 3"),
        ("DECL E6POS P9={X", "DECL E6POS P8={X", 16, "P8 is declared twice"),
        ("P9={X 22.250", "P9={X 22,250", 16, "a number has a decimal point, not a comma"),
    ],
)
def test_errors_in_alike_lines_have_their_place(
    old: str, new: str, line: int, message: str
) -> None:
    body = "".join(f"  drill(P{i},3.5)\n" for i in range(20))
    files = program("  PTP P0\n" + body, DATA + positions(20), routines=ROUTINES)
    changed = {path: raw.decode().replace(old, new).encode() for path, raw in files.items()}
    assert changed != files
    for reads in (both_halves, one_by_one):
        with pytest.raises(Exception) as caught:  # noqa: PT011
            reads(changed)
        assert (caught.value.line, caught.value.message) == (line, message)  # type: ignore[attr-defined]

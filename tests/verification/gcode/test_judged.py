"""LinuxCNC's interpreter and drillc's reader come to the same place in every block."""

from __future__ import annotations

from pathlib import Path

import pytest
from drillc.cli import main
from drillc.driver import plan_spec
from drillc.language.diagnostics import Report
from drillc.output.emission import emit_files
from drillc.planning.program import Program
from drillc.postprocessors.gcode import GcodePost
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from output.arm_programs import Way, arm_program, shifted, some_joints
from output.programs import (
    PORTAL_AXES,
    drill_cycle,
    emit_of,
    joint_drill,
    joint_program,
    joint_rivet,
    mixed,
    rivet_cycle,
    visit_cycle,
)
from verification.gcode.running import assert_agrees, text_of

ROOT = Path(__file__).parents[3]
ARM_AXES = {f"A{i + 1}": letter for i, letter in enumerate("XYZABC")}


def emitted(program: Program, axes: dict[str, str], **options: float) -> dict[str, bytes]:
    report = Report()
    files = emit_files(GcodePost(), program, emit_of("gcode", axes, **options), report)
    assert not report.failed
    return {file.path: file.read() for file in files}


@pytest.mark.parametrize("sample", ["portal", "skin_portal"])
def test_samples(sample: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(ROOT)
    out = tmp_path / "out"
    assert main(["compile", f"samples/{sample}.drill", "-o", str(out), "--no-verify"]) == 0
    files = {path.name: path.read_bytes() for path in (out / "gcode").iterdir()}
    ran = assert_agrees(tmp_path / "judged", files, feeds=True)
    assert ran.findings == []


def test_a_sample_of_an_arm(tmp_path: Path) -> None:
    planned = plan_spec(ROOT / "samples" / "nacelle.drill", ROOT / "samples", Report())
    [program] = planned.programs
    ran = assert_agrees(tmp_path, emitted(program, ARM_AXES), feeds=True)
    assert ran.findings == []


@pytest.mark.parametrize(
    "program",
    [
        joint_rivet(5),
        joint_rivet(20, feed_sign=-1),
        joint_drill(12, peck_mm=3.0, clamp=True),
        joint_drill(9, feed_sign=-1),
        mixed(joint_program, (4, 3, 15)),
        joint_program([("a", 0, 30), ("b", 1, 9)], [visit_cycle(), drill_cycle(peck_mm=2.5)]),
    ],
    ids=["rivet", "rivet up", "pecks", "drill up", "mixed", "visits"],
)
@pytest.mark.parametrize("holes_per_module", [10_000, 7])
def test_programs_of_a_portal(tmp_path: Path, program: Program, holes_per_module: int) -> None:
    files = emitted(program, PORTAL_AXES, holes_per_module=holes_per_module)
    assert assert_agrees(tmp_path, files, feeds=True).findings == []


def arm_of_many_holes(holes: int = 24) -> Program:
    """Two processes, straight travels between most holes, two regions."""
    first = some_joints(1)[0]
    rows = [[a + 0.1 * (i % 5) for a in first] for i in range(holes)]
    back = {i: [Way(False, tuple(shifted("kuka", rows[i], -170.0)))] for i in (3, 10)}
    return arm_program(
        [("upper", 0, holes // 2), ("lower", 1, holes - holes // 2)],
        [drill_cycle(peck_mm=3.0, clamp=True), rivet_cycle()],
        joints_deg=rows,
        ways=back,
    )


@pytest.mark.parametrize("letters", ["XYZABC", "UVWABC", "AXBYCZ"])
@pytest.mark.parametrize("holes_per_module", [10_000, 9])
def test_programs_of_an_arm(tmp_path: Path, letters: str, holes_per_module: int) -> None:
    axes = {f"A{i + 1}": letter for i, letter in enumerate(letters)}
    files = emitted(arm_of_many_holes(), axes, holes_per_module=holes_per_module)
    assert assert_agrees(tmp_path, files, feeds=True).findings == []


CORPUS = {
    "words": "g0x1 y 2Z3\nG 0 X 1 0 . 5\ng1 x-.5 y+2. f100\nN10 G1 X[1]\nx5 (a) y6 (b) ; c ( d",
    "sets": "#1=2 #2=3\n#3=[#1+#2] G0 X#1\n#1=5 G0 X#1 #2=7\nG0 Y#1 Z#2",
    "names": "#<a b> = 3\n#<_cc> = [#<ab>*2]\nG0 X#<a b> Y#<_CC>\no<s 1> sub\n#<ab>=9\nG0 Z#<ab>\n"
    "o<S1> endsub\no<s1> call\nG0 W#<ab>",
    "indirect": "#40=41 #41=7\n#42=40\nG0 X##40 Y###42 Z#[#40+0] A#[#42]\n##40=8\nG0 B#41",
    "inches": "G20\nG0 X1 A90 U-2\nG1 Y1 F10\nG21\nG1 Y1\nG0 Z#5420\nG20 G0 Z#5420 C#5423",
    "incremental": "G0 X1 Y1 Z1\nG91 G1 X2 F50\nX2 Y-1\nG0 Z-3\nG90 X0",
    "planes": "G0 X10 Y10 Z10 F100\nG18 G81 X1 Y2 R5 Z3\nG19 G82 X1 R3 Y5 Z6 P0.5\nG17 G80",
    "cycles": "F200 G0 X0 Y0 Z20\nG81 X5 Y6 Z-3 R2\nX7\nY8 Z-4\nG99 X9\nG98 X1 R1\nG80 G0 X3",
    "low cycle": "F200 G0 X0 Y0 Z1\nG98 G81 X5 Y6 Z-3 R2\nX7\nG99 X9\nG80\nG0 Z9\nG81 Z-1 X2 R3",
    "repeats": "F200 G0 X0 Y0 Z20\nG91 G81 X5 Y1 Z-3 R-12 L3\nG90 G0 X0\n"
    "G99 G91 G82 X1 Z-2 R-1 P.1 L2",
    "pecks": "F200 G0 X0 Y0 Z20\nG83 X5 Y6 Z-10 R2 Q3\nX7\nQ5 X8\nG73 X1 Y1 Z-4 R1 Q1.5\nY2\n"
    "G20 G0 Z2\nG83 X1 Z-1 R.5 Q.6",
    "modes": "G93 G1 X1 F2\nX2 F4\nG94 F100 X3\nG95 S600 M3 F0.1 X4\nG94\nF50 G1 X5",
    "if": "#1=3\no1 if [#1 LT 2]\nG0 X1\no1 elseif [#1 EQ 3]\nG0 X2\no1 else\nG0 X3\no1 endif\n"
    "o2 if [0]\nG0 X4\no2 else\nG0 X5\no2 endif\no3 if [1]\no4 if [0]\nG0 Y1\no4 endif\n"
    "G0 Y2\no3 endif",
    "while": "#1=0\no1 while [#1 LT 5]\n#1=[#1+1]\no2 if [#1 EQ 3]\no1 continue\no2 endif\n"
    "G0 X#1\n"
    "o3 if [#1 EQ 4]\no1 break\no3 endif\nG0 Y#1\no1 endwhile\nG0 Z#1",
    "do": "#1=0\no1 do\n#1=[#1+1]\nG0 X#1\no1 while [#1 LT 3]\n#2=0\no5 do\n#2=[#2+1]\n"
    "o6 if [#2 EQ 2]\no5 break\no6 endif\nG0 Y#2\no5 while [#2 LT 5]",
    "repeat": "G0 Y0\n#1=0\no1 repeat [3]\n#1=[#1+1]\nG0 X#1\no2 repeat [2]\nG91 G0 Y1\nG90\n"
    "o2 endrepeat\n"
    "o1 endrepeat\no3 repeat [0]\nG0 X99\no3 endrepeat",
    "subs": "o100 sub\nG0 X#1 Y#2 Z#3\no100 return [#1+1]\nG0 X99\no100 endsub\n#1=4\n"
    "o100 call [1] [2]\nG0 A#<_value> B#<_value_returned> C#1\no<b> sub\no100 call [#1] [5] [6]\n"
    "G0 U#<_value>\no<b> endsub [7]\no<b> call [3]\nG0 V#<_value>\no<c> call\nM2\no<c> sub\nG0 W2\n"
    "o<c> endsub",
    "delete": "/G0 X1\n/ G0 Y[2]",
    "dwell": "G0 X1\nG4 P0.5\nX2\nG4 P1 X3",
    "spindle": "S1000 M3\nG0 X1\nM5 M9\nM4 S5\nM7\nM48\nM49\n"
    "M62 P1\nM63 P2\nG0 X2\nM67 E1 Q.5\nM68 E0",
    "signals": "M64 P1\nM66 P2 L3 Q5\no1 if [#5399 EQ -1]\nG0 X1\no1 endif\nM65 P1\nG0 X3 M64 P0",
    "exists": "#<a>=1\nG0 X[EXISTS[#<a>]] Y[EXISTS[#<b>]+5] Z[EXISTS[#<_b>]]",
    "signs": "#31=6\nG0 X--1 Y-[2] Z+-3 A-#[30+1]\nG0 B[-2**2] C[2--3] U[2*-3] V-SIN[30] W[+4]",
    "stop": "G0 X1\nM0\nM1\nG0 X2",
    "g80": "G0 X1\nG80\nG80 G0 X2",
}


@pytest.mark.parametrize("name", CORPUS)
def test_every_construct(tmp_path: Path, name: str) -> None:
    assert_agrees(tmp_path, text_of(*CORPUS[name].split("\n")))


def test_between_percents(tmp_path: Path) -> None:
    assert_agrees(tmp_path, "\n%\nG21 G90 G0 X1\nG0 X2\n%\n")


def test_routines_in_files_of_their_own(tmp_path: Path) -> None:
    files = {
        "main.ngc": b"G21 G90\no<part_1> call\no<drill> call [3]\nM30\n",
        "part_1.ngc": b"(a)\no<part_1> sub\nG0 X1\no<drill> call [2]\no<part_1> endsub\n",
        "drill.ngc": b"o<drill> sub\nG0 Z#1\nG0 Z0\no<drill> endsub\nM2\n",
        "names.csv": b"x",
    }
    assert_agrees(tmp_path, files)


# ── expressions, at random ───────────────────────────────────────────────────────────────────────

NUMBERS = st.integers(-999, 999).map(lambda n: f"{n / 8:g}")
BINARY = st.sampled_from(["+", "-", "*", "EQ", "NE", "GT", "GE", "LT", "LE", "AND", "OR", "XOR"])


def expressions() -> st.SearchStrategy[str]:
    """Without what may fail (division, powers, roots), which is bounded where it is used."""
    return st.recursive(
        NUMBERS | st.just("#40") | st.just("#<_ab>"),
        lambda inner: st.one_of(
            st.lists(inner, min_size=2, max_size=5).flatmap(
                lambda parts: st.lists(
                    BINARY, min_size=len(parts) - 1, max_size=len(parts) - 1
                ).map(lambda ops: "[" + _alternate(parts, ops) + "]")
            ),
            st.tuples(st.sampled_from(["ABS", "FIX", "FUP", "ROUND", "SIN", "COS"]), inner).map(
                lambda p: f"{p[0]}[{p[1]}]"
            ),
            inner.map(lambda v: f"-[{v}]"),
            inner.map(lambda v: f"SQRT[ABS[{v}]]"),
            st.tuples(inner, inner).map(lambda p: f"ATAN[{p[0]}]/[{p[1]}]"),
            st.tuples(inner, inner).map(lambda p: f"[{p[0]} MOD [ABS[{p[1]}] + 2]]"),
            st.tuples(inner, inner).map(lambda p: f"[{p[0]} / [ABS[{p[1]}] + 2]]"),
            inner.map(lambda v: f"[[{v} MOD 10] ** 2 ** 1.5]"),
        ),
        max_leaves=12,
    )


def _alternate(parts: list[str], operators: list[str]) -> str:
    text = parts[0]
    for operator, part in zip(operators, parts[1:], strict=True):
        text += f" {operator} {part}"
    return text


@settings(
    max_examples=15,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow],
)
@given(values=st.lists(expressions(), min_size=30, max_size=60))
def test_expressions(tmp_path: Path, values: list[str]) -> None:
    short = [value for value in values if len(value) < 200]
    # MOD keeps the place small, so that 0.000001 means something
    lines = [f"#1 = {value}\nG0 X[#1 MOD 1000] Y[{i}]" for i, value in enumerate(short, 1)]
    assert_agrees(tmp_path, text_of("#40 = 2.5", "#<_ab> = -3", *lines))

"""What holds for all messages and all targets: nothing of a spec's prose reaches a program, and the
portal's refusals give numbers that are true."""

from __future__ import annotations

import csv
import io
import math
import re

import numpy as np
import pytest
from diagnostics.running import FINE, TOOL, Bench, files_of

NASTY = [
    r"\n",
    ";",
    "!",
    ")",
    chr(34),
    "'",
    "{{ 7*7 }}",
    "{% raw %}",
    "%",
    "(",
    "&",
    "$",
    "\\",
    "\t",
]
#: A line break for KRL, RAPID and G-code each, and a template's expression.
INJECTED = 'P1\nHALT ; STOP ! EXIT ) " M30 {{ 7 * 7 }} {% set x = 1 %} %'
PORTAL = """drill 1
program PORTAL_A
part skin { normals outward }
robot riveter portal {
  D 10 m  H 5 m  d 0.75 m
  height HEIGHT
  side below
  limits { q3 -180 deg .. 180 deg  q5 -3 m .. 3 m }
}
"""
EXAMPLE = "R1 (8, -0.6, 1.9) normal (0.25, -0.3, 0.9205976)"
TABLE = """holes skin from "holes.csv" { units mm  columns { id ID x X y Y z Z i I j J k K } }
region s { posture x toward +X  select skin }
"""


# ── nothing is injected ──────────────────────────────────────────────────────────────────────────


#: The folders of programs.
POSTS = ("krl/", "rapid/", "gcode/")


def programs(bench: Bench, files: dict[str, str], out: str) -> dict[str, bytes]:
    bench.write(files)
    ran = bench.run("compile", "spec.drill", "-o", out)
    assert ran.code == 0
    assert "warning" not in ran.err
    written = files_of(bench.folder / out)
    # the manifest and the map tell of the spec's text
    return {path: data for path, data in written.items() if path.startswith(POSTS)}


@pytest.mark.parametrize("machine", ["robot", "portal"])
def test_comments_reach_no_program(bench: Bench, machine: str) -> None:
    spec = FINE
    if machine == "portal":
        axes = "axes { q1 U  q2 V  q3 A  q4 X  q5 Y  q6 Z }"
        spec = PORTAL.replace("HEIGHT", "centre") + (
            "region plate { points m { R1 (5.5, -0.3, -0.2) normal (0.5, 0.8138, -0.2962) } }\n"
            f"emit gcode {{ {axes} }}\n"
        )
    comment = " # " + INJECTED.replace("\n", " ")
    plain = programs(bench, {"spec.drill": spec, "tool.cell": TOOL}, "plain")
    files = {"spec.drill": spec, "tool.cell": TOOL}
    commented = {name: text.replace("\n", f"{comment}\n") for name, text in files.items()}
    assert programs(bench, commented, "commented") == plain
    assert len(plain) >= (1 if machine == "portal" else 3)


def test_columns_that_are_not_mapped_reach_no_program(bench: Bench) -> None:
    spec = FINE.replace("emit krl", TABLE + "emit krl")
    rows = [["ID", "X", "Y", "Z", "I", "J", "K"], ["F1", "5", "6", "7", "0", "0", "-1"]]

    def table(*more: str) -> str:
        text = io.StringIO()
        csv.writer(text).writerows([[*row, *more] for row in rows])
        return text.getvalue()

    files = {"spec.drill": spec, "tool.cell": TOOL}
    plain = programs(bench, files | {"holes.csv": table()}, "plain")
    noted = programs(bench, files | {"holes.csv": table(INJECTED, *NASTY)}, "noted")
    assert noted == plain


@pytest.mark.parametrize("nasty", [*NASTY, "\n", "é", "\N{CYRILLIC SMALL LETTER A}", "\x7f"])
@pytest.mark.parametrize("place", ["P{}1", "P1{}2"])
def test_ids_in_a_table_hold_nothing_but_plain_characters(
    bench: Bench, nasty: str, place: str
) -> None:
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow(["ID", "X", "Y", "Z", "I", "J", "K"])
    writer.writerow([place.format(nasty), 5, 6, 7, 0, 0, -1])
    spec = FINE.replace("emit krl", TABLE + "emit krl")
    bench.write({"spec.drill": spec, "tool.cell": TOOL, "holes.csv": text.getvalue()})
    said = bench.refused()
    assert re.findall(r"(?:error|warning) (\w+):", said) == ["E324"]


@pytest.mark.parametrize("nasty", [*NASTY, "é", "\N{CYRILLIC SMALL LETTER A}", "\x7f"])
def test_ids_in_a_points_block_hold_nothing_but_plain_characters(bench: Bench, nasty: str) -> None:
    bench.write({"spec.drill": FINE.replace("P1 (", f"P{nasty}1 ("), "tool.cell": TOOL})
    said = bench.refused()
    assert set(re.findall(r"(?:error|warning) (\w+):", said)) <= {"E101", "E105", "E110", "E301"}


@pytest.mark.parametrize("nasty", [*NASTY, "é"])
@pytest.mark.parametrize("name", ["program BEFORE", "region r", "tool t", "part p"])
def test_names_hold_nothing_but_plain_characters(bench: Bench, name: str, nasty: str) -> None:
    assert name in FINE + TOOL
    changed = f"{name}{nasty}x"
    files = {"spec.drill": FINE.replace(name, changed), "tool.cell": TOOL.replace(name, changed)}
    bench.write(files)
    bench.refused()


@pytest.mark.parametrize("nasty", [text for text in NASTY if text != '"'])
def test_quoted_texts_reach_no_program_unless_they_are_names(bench: Bench, nasty: str) -> None:
    alias = f'io {{ clamp output 1 as "a{nasty}b" }}\n'
    bench.write({"spec.drill": FINE, "tool.cell": TOOL + alias})
    assert "error E214: " in bench.refused()
    spec = FINE.replace("emit rapid", f'emit rapid {{ tooldata "a{nasty}b" }}')
    bench.write({"spec.drill": spec, "tool.cell": TOOL})
    assert "error E633: " in bench.refused()


# ── the portal's numbers ─────────────────────────────────────────────────────────────────────────


def feasible(above_mm: float, below_mm: float) -> tuple[float, float]:
    """The heights for the example, by the checked facts: [A, H - B] with A = max(δ, -c) and
    B = max(δ, c), c and δ without trigonometry; here widened by the tool's way along q6."""
    n = np.array([0.25, -0.3, 0.9205976])
    p = np.array([8000.0, -600.0, 1900.0])
    n = n / math.sqrt(n @ n)
    delta = 8500 * n[0] / math.hypot(n[1], n[2]) / 2
    c = -delta + n @ p
    return max(delta, below_mm - c), 5000 - max(delta, c + above_mm)


#: name → (how it is written, how far it reaches below and above the hole along q6, in mm)
PROCESSES = {
    "": ("", 50, 0),
    "rivet5": ("approach 120 mm  clamp timeout 3 s  rivet timeout 5 s  retract 120 mm", 120, 0),
    "drill6": (
        "approach 60 mm  spindle 3000 rpm  feed 90 mm/min  depth 12 mm  retract 60 mm",
        60,
        12,
    ),
}


@pytest.mark.parametrize("process", PROCESSES)
def test_the_height_that_does_not_serve(bench: Bench, process: str) -> None:
    text, below_mm, above_mm = PROCESSES[process]
    declared, use = f"process {process} {{ {text} }}\n", f"process {process}"
    plate = f"region plate {{ {use if text else ''}  points m {{ {EXAMPLE} }} }}\n"
    spec = PORTAL + (declared if text else "") + plate

    bench.write({"spec.drill": spec.replace("HEIGHT", "centre")})
    said = bench.refused()
    found = re.search(
        r"error E406: height centre \(h = 2.5 m\) does not serve hole R1: it puts q6 at "
        r"([\d.]+) m \.\. ([\d.]+) m, outside 0 m \.\. 5 m; any h in \[([\d.]+), ([\d.]+)\] m "
        r"would do\n",
        said,
    )
    assert found is not None, said
    assert float(found[1]) == pytest.approx(5.3318 - below_mm / 1000, abs=1e-9)
    assert float(found[2]) == pytest.approx(5.3318 + above_mm / 1000, abs=1e-9)

    low, high = float(found[3]) * 1000, float(found[4]) * 1000
    true_low, true_high = feasible(above_mm, below_mm)
    assert (round(true_low), round(true_high)) == (1097, 2168 - above_mm)
    assert true_low <= low < true_low + 0.011
    assert true_high - 0.011 < high <= true_high
    # Both ends, as the message prints them, do serve; a little beyond, neither does.
    ends = {found[3]: 0, found[4]: 0, f"{low / 1000 - 2e-5}": 1, f"{high / 1000 + 2e-5}": 1}
    for height, code in ends.items():
        bench.write({"spec.drill": spec.replace("HEIGHT", f"{height} m")})
        assert bench.run("check", "spec.drill").code == code


def test_widest_margin_serves_the_example(bench: Bench) -> None:
    spec = PORTAL.replace("HEIGHT", "widest_margin")
    bench.write({"spec.drill": f"{spec}region plate {{ points m {{ {EXAMPLE} }} }}\n"})
    ran = bench.run("inspect", "spec.drill", "--format", "csv")
    [row] = csv.DictReader(io.StringIO(ran.out))
    height = (float(row["q1_mm"]) + float(row["q2_mm"])) / 2
    assert round(height / 1000, 4) == 1.6328
    assert 0 <= float(row["q6_mm"]) <= 5000

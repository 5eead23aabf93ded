"""What reading back and proving a program costs, against planning, emitting and writing it.

    python benchmarks/verification.py [HOLES] [--repeats N]

For each language one job: KRL and RAPID drill a barrel with clamp, spindle and pecks, G-code rivets
the skin of a portal. Times are those of the process (`time.process_time`) around the library's
calls, without Python's start and its imports; of the repeats, which go by turns, the least counts.
Per language the last figure is the ratio, verifying over compiling: it is to stay at 3 or below.
"""

from __future__ import annotations

import argparse
import gc
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from drillc.driver import compile_spec, plan_spec, prove, wanted_emits
from drillc.language.diagnostics import Refused, Report, render

DRILLED = """\
drill 1
program BENCH
part p {{ up +Z  normals outward  frame 1 at (1500, 200, 300) mm rotate z 30 deg }}
tool t {{ number 1  tcp (0, 0, 250) mm  mass 20 kg  cog (0, 0, 100) mm }}
io {{
  spindle_on output 1  spindle_running input 1
  clamp output 2  clamped input 2  released input 3
}}
holes t from "holes.csv" {{ units mm  columns {{ id ID x X y Y z Z i I j J k K }} }}
process d {{
  approach 100 mm  clearance 3 mm  clamp timeout 3 s  spindle 3000 rpm  feed 0.1 mm/rev
  depth 8 mm  peck 3 mm  retract 100 mm
}}
region all {{ select t  process d  posture x toward +X }}
emit {post}
"""
RIVETED = """\
drill 1
program BENCH
part skin {{ normals outward }}
robot riveter portal {{
  D 10 m  H 5 m  d 0.75 m  height least_travel  side below
  limits {{
    q1 0.05 m .. 4.95 m  q2 0.05 m .. 4.95 m  q3 -60 deg .. 60 deg
    q4 0.2 m .. 9.8 m    q5 -1.5 m .. 1.5 m   q6 0.1 m .. 4.92 m
  }}
  speeds {{ q1 50 mm/s  q2 50 mm/s  q3 3 deg/s  q4 400 mm/s  q5 400 mm/s  q6 200 mm/s }}
}}
io {{ clamp output 1  clamped input 1  released input 2  set output 2  set_done input 3 }}
holes t from "holes.csv" {{ units mm  columns {{ id ID x X y Y z Z i I j J k K }} }}
process r {{
  approach 120 mm at 100 mm/s  clamp timeout 3 s  rivet timeout 5 s  retract 120 mm at 100 mm/s
}}
region all {{ select t  process r }}
emit {post} {{ axes {{ q1 U  q2 V  q3 A  q4 X  q5 Y  q6 Z }}  holes_per_module 1000 }}
"""
JOBS = {"krl": DRILLED, "rapid": DRILLED, "gcode": RIVETED}


def barrel(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Places (n, 3) in mm and outward unit normals (n, 3) of a skin that a portal reaches, row
    after row, there and back."""
    columns = max(int(np.sqrt(count)), 1)
    row, column = np.divmod(np.arange(count), columns)
    column = np.where(row % 2, columns - 1 - column, column)
    u = np.radians(20.0) * (2.0 * row / max(row[-1], 1) - 1.0)
    theta = np.radians(35.0) * (2.0 * column / max(columns - 1, 1) - 1.0)
    radius = 3000.0 - 9000.0 * (1.0 - np.cos(u))
    place = [4250.0 + 9000.0 * np.sin(u), radius * np.sin(theta), radius * np.cos(theta) - 1300.0]
    normal = [np.sin(u), np.cos(u) * np.sin(theta), np.cos(u) * np.cos(theta)]
    return np.stack(place, axis=1), np.stack(normal, axis=1)


def write_specs(folder: Path, count: int) -> dict[str, Path]:
    """A spec for each language, and the table of holes that all of them read."""
    place, normal = barrel(count)
    with (folder / "holes.csv").open("w") as table:
        table.write("ID,X,Y,Z,I,J,K\n")
        for i, (p, n) in enumerate(zip(place.tolist(), normal.tolist(), strict=True)):
            cells = [*(f"{x:.3f}" for x in p), *(f"{x:.7f}" for x in n)]
            table.write(f"F{i:07d},{','.join(cells)}\n")
    specs = {}
    for post, text in JOBS.items():
        specs[post] = folder / f"{post}.drill"
        specs[post].write_text(text.format(post=post))
    return specs


def measured(spec: Path, out: Path) -> tuple[float, float]:
    """Seconds of compiling without proof, and of the proof."""
    report = Report()
    began = time.process_time()
    compile_spec(spec, out, report, verify=False)
    compiled = time.process_time() - began
    planned = plan_spec(spec, None, report)
    emits = wanted_emits(planned.job, (), report)
    gc.collect()
    began = time.process_time()
    verdicts = prove(planned, emits, out, report)
    proven = time.process_time() - began
    if not all(verdict.passed for verdict in verdicts):
        raise SystemExit(f"{spec.name} is not proven")
    return compiled, proven


def compare(count: int, repeats: int) -> dict[str, float]:
    """Print what both cost, by language; the ratios."""
    best: dict[str, tuple[float, float]] = {}
    with tempfile.TemporaryDirectory() as name:
        specs = write_specs(Path(name), count)
        for _ in range(repeats):  # in turns, so that the machine's drift meets all
            for post, spec in specs.items():
                now = measured(spec, Path(name) / f"out-{post}")
                before = best.get(post, now)
                best[post] = (min(before[0], now[0]), min(before[1], now[1]))
    print(f"{count:,} holes   compile   verify   ratio")
    for post, (compiled, proven) in best.items():
        print(f"{post:14} {compiled:6.2f} s {proven:6.2f} s {proven / compiled:7.2f}")
    return {post: proven / compiled for post, (compiled, proven) in best.items()}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", nargs="?", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    gc.set_threshold(50_000, 20, 100)  # as the command line has it
    try:
        compare(options.count, options.repeats)
    except Refused as refused:
        sys.exit("\n".join(map(render, refused.report.diagnostics)))

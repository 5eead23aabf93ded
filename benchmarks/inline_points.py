"""Inline points against the same points from a CSV, from the spec's text to the written program.

    python benchmarks/inline_points.py [HOLES] [--repeats N]

Each run is a process of its own, so that its peak memory is its own; the times are those of the
commands, without Python's start. The last line is the ratio, inline over CSV, in this one run: it
is to stay at 3 or below. The points lie on a cylinder; both specs give the same bytes, which is
checked. Measured on 2 cores with Python 3.11 and numpy 2.4, beside other work:

    holes        inline              CSV                 ratio
    100,000      1.0 s,   110 MB     1.0 s,   113 MB     1.05
    3,000,000    27 s,  1,880 MB     29 s,  1,710 MB     0.91    (a KRL program of 3,750 parts)
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

SPEC = """\
drill 1
program BENCH
part p {{ up +Z normals outward frame 1 }}
tool t {{ number 1 tcp (0, 0, 200) mm }}
process touch {{ approach 50 mm retract 50 mm }}
{table}
region all {{ process touch posture x toward +X {holes} }}
emit krl
"""
TABLE = (
    'holes t from "holes.csv" { units mm columns { id ID x X y Y z Z i I j J k K } }',
    "select t",
)
#: Run in a process of its own: the time without Python's start, and the process's peak memory.
WORKER = """\
import contextlib, io, json, resource, sys, time
from drillc.cli import main
began = time.perf_counter()
with contextlib.redirect_stdout(io.StringIO()):
    code = main(sys.argv[1:])
took = time.perf_counter() - began
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({"seconds": took, "peak_mb": peak}))
sys.exit(code)
"""


def holes(count: int) -> Iterable[tuple[str, ...]]:
    """Ids, positions and unit normals on a lying cylinder, seven cells each."""
    rng = np.random.default_rng(0)
    angle = rng.uniform(0.2, np.pi - 0.2, count)
    x = np.arange(count) * 0.05 - count * 0.025
    for i in range(0, count, 65_536):
        rows = slice(i, i + 65_536)
        sine, cosine = np.sin(angle[rows]), np.cos(angle[rows])
        for k, cells in enumerate(zip(x[rows], sine, cosine, strict=True)):
            place, s, c = cells
            yield (
                f"F{i + k:07d}", f"{place:.3f}", f"{2000 * c:.3f}", f"{2000 * s:.3f}",
                "0", f"{c:.6f}", f"{s:.6f}",
            )  # fmt: skip


def write_specs(folder: Path, count: int) -> dict[str, Path]:
    """The same job twice: `inline/a.drill`, and `csv/a.drill` beside its table."""
    paths = {name: folder / name / "a.drill" for name in ("inline", "csv")}
    for path in paths.values():
        path.parent.mkdir()
    paths["csv"].write_text(SPEC.format(table=TABLE[0], holes=TABLE[1]))
    before, after = SPEC.format(table="", holes="\0").split("\0")
    with paths["inline"].open("w") as inline, (folder / "csv" / "holes.csv").open("w") as table:
        inline.write(before + "points mm {\n")
        table.write("ID,X,Y,Z,I,J,K\n")
        for name, x, y, z, i, j, k in holes(count):
            inline.write(f"  {name} ({x}, {y}, {z}) normal ({i}, {j}, {k})\n")
            table.write(f"{name},{x},{y},{z},{i},{j},{k}\n")
        inline.write("}" + after)
    return paths


def measured(arguments: list[str]) -> dict[str, float]:
    """What `drillc ARGUMENTS` costs."""
    done = subprocess.run(
        [sys.executable, "-c", WORKER, *arguments], capture_output=True, text=True
    )
    if done.returncode:
        raise SystemExit(done.stderr)
    return dict(json.loads(done.stdout))


def digest(folder: Path) -> str:
    """One hash of all programs below a folder."""
    total = hashlib.sha256()
    for path in sorted(folder.rglob("*")):
        if path.is_file() and path.name != "manifest.json":
            total.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    return total.hexdigest()


def compare(count: int, repeats: int) -> float:
    """Print what both ways cost; the ratio of whole compiles."""
    with tempfile.TemporaryDirectory() as name:
        specs = write_specs(Path(name), count)
        best: dict[tuple[str, str], float] = {}
        for _ in range(repeats):  # in turns, so that the machine's drift meets both
            for way, spec in specs.items():
                out = str(spec.parent / "out")
                for what, more in (("check", []), ("compile", ["-o", out])):
                    cost = measured([what, str(spec), *more])
                    best[way, what] = min(best.get((way, what), np.inf), cost["seconds"])
                    best[way, "peak_mb"] = cost["peak_mb"]
        if digest(specs["inline"].parent / "out") != digest(specs["csv"].parent / "out"):
            raise SystemExit("the two programs differ")
    print(f"{count:,} holes        check      compile    peak memory")
    for way in specs:
        print(
            f"{way:8} {best[way, 'check']:15.2f} s {best[way, 'compile']:10.2f} s"
            f" {best[way, 'peak_mb']:11.0f} MB"
        )
    ratio = best["inline", "compile"] / best["csv", "compile"]
    print(
        f"inline / csv: {ratio:.2f} (check: {best['inline', 'check'] / best['csv', 'check']:.2f})"
    )
    return ratio


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("count", nargs="?", type=int, default=100_000)
    parser.add_argument("--repeats", type=int, default=3)
    options = parser.parse_args()
    compare(options.count, options.repeats)

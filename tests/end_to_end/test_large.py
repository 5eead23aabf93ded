"""Three million holes, the rivets of a whole airplane: they must flow through columns."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

HOLES = 3_000_000
#: Bytes of memory a hole may take at the peak, with everything that drillc itself needs.
BYTES_PER_HOLE = 3000
SPEC = """drill 1
program AIRPLANE
part skin { up +Z   normals outward   frame 1 }
tool drill { number 1   tcp (0, 0, 200) mm }
io { spindle_on output 1   spindle_speed analog 1 full 6000 rpm }
holes all from "holes.csv" { units mm  columns { id ID  x X  y Y  z Z  i I  j J  k K } }
process rivet { approach 60 mm  depth 8 mm  spindle 3000 rpm  feed 0.1 mm/rev  retract 60 mm }
region barrel { select all   posture x toward +X   process rivet }
emit krl { holes_per_module 10000 }
"""
RUN = """
import json, resource, sys
from drillc.cli import main
code = main(["compile", "spec.drill", "-o", "out"])
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
print(json.dumps({"code": code, "peak": peak}), file=sys.stderr)
"""


def write_table(path: Path) -> None:
    """Rivet rows around a barrel of 2 m radius, serpentine along its length."""
    row = np.arange(HOLES)
    ring, place = row // 500, row % 500
    angle = np.radians(np.where(ring % 2 == 0, place, 499 - place) * 0.7)
    normal = np.stack([np.zeros(HOLES), np.sin(angle), np.cos(angle)], axis=1)
    position = 2000.0 * normal
    position[:, 0] = ring * 10.0
    with path.open("w", encoding="ascii") as file:
        file.write("ID,X,Y,Z,I,J,K\n")
        for start in range(0, HOLES, 100_000):
            rows = slice(start, start + 100_000)
            table = np.hstack([row[rows, None], position[rows], normal[rows]])
            np.savetxt(file, table, fmt="R%d,%.3f,%.4f,%.4f,%.1f,%.8f,%.8f")


@pytest.mark.slow
def test_three_million_holes(tmp_path: Path) -> None:
    write_table(tmp_path / "holes.csv")
    (tmp_path / "spec.drill").write_text(SPEC)
    done = subprocess.run([sys.executable, "-c", RUN], cwd=tmp_path, capture_output=True, text=True)
    said = json.loads(done.stderr.splitlines()[-1])
    assert said["code"] == 0, done.stderr
    assert said["peak"] < BYTES_PER_HOLE * HOLES, f"{said['peak'] / HOLES:.0f} bytes a hole"
    calls = positions = 0
    for path in (tmp_path / "out" / "krl").iterdir():
        content = path.read_bytes()
        calls += content.count(b"\n  rivet(R")
        positions += content.count(b"DECL E6POS R")
    assert (calls, positions) == (HOLES, HOLES)

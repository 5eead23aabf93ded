"""With the jig in the lower region's way, the tool turns by no more than it must.

The dense judge tries headings 0.1 degrees apart; the compiler's heading, read from the program that
it writes, must lie between the last one that the judge rejects and the first one that it accepts.
"""

import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from drillc.cli import main
from scipy.spatial.transform import Rotation
from walk.dense import Cycle, Dense, smallest_turns
from walk.emitted import Spec, check_walk, compiled, read

SAMPLES = Path(__file__).parents[2] / "samples"
STEP_DEG = 0.1
#: The printed holes of the region: position and feed. The rule: y level, toward +Y.
LOWER = {
    "P7": ((588, 1730, 340), (-0.970, 0.110, -0.217)),
    "P8": ((571, 1730, 392), (-0.922, 0.120, -0.369)),
}
PROCESS = {"out_mm": 100.0, "depth_mm": 12.0, "clearance_mm": {"jig": 20.0}}
SINGULAR_DEG = 2.0


def by_the_rule(position, feed):
    """part_from_tool (4, 4) with y level and toward +Y."""
    z = np.array(feed) / np.linalg.norm(feed)
    y = np.array([-z[1], z[0], 0.0])
    y *= np.sign(y[1]) / np.linalg.norm(y)
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.stack([np.cross(y, z), y, z], axis=1), position
    return pose


def moved_jig(folder, box, within_deg):
    """The nacelle with its jig elsewhere; the seed's headings are no longer expected."""
    shutil.copytree(SAMPLES / "cells", folder / "cells")
    text = (SAMPLES / "nacelle.drill").read_text("utf-8")
    for old, new in (
        ("box (400, 1500, 500) (700, 1900, 650) mm", f"box {box} mm"),
        ("turning within 30 deg", f"turning within {within_deg} deg"),
    ):
        assert text.count(old) == 1
        text = text.replace(old, new)
    path = folder / "nacelle.drill"
    path.write_text(re.sub(r"(?m)^expect P[78] .*\n", "", text), "utf-8")
    return path


@pytest.mark.parametrize(
    ("box", "side"),
    [
        ("(850, 1850, 230) (1150, 2250, 380)", 1),
        ("(850, 1860, 230) (1150, 2260, 380)", 1),
        ("(900, 1100, 260) (1050, 1510, 330)", -1),
    ],
)
def test_the_turn_is_the_smallest_that_keeps_the_clearance(tmp_path, box, side):
    path = moved_jig(tmp_path, box, 90)
    spec = Spec(path)
    emitted = read(compiled(path, tmp_path / "out"), "NACELLE_A")
    judge = Dense(spec.scene(), spec.flange_from_tool, SINGULAR_DEG)
    for (position, feed), hole in zip(LOWER.values(), emitted.holes[4:], strict=True):
        cycle = Cycle(by_the_rule(position, feed), **PROCESS)
        between = Rotation.from_matrix(cycle.part_from_tool[:3, :3].T @ hole.pose[:3, :3])
        turn_deg = np.degrees(between.as_rotvec())
        assert np.abs(turn_deg[:2]).max() < 0.001
        assert np.sign(turn_deg[2]) == side
        # The emitted angles have four decimals: a micrometre at the tool's far end.
        almost = Cycle(cycle.part_from_tool, **{**PROCESS, "clearance_mm": {"jig": 19.999}})
        assert judge.works(almost, float(turn_deg[2]))
        first = min(smallest_turns(judge, cycle, 90.0, STEP_DEG), key=abs)
        assert np.sign(first) == side
        assert abs(first) - STEP_DEG < abs(turn_deg[2]) <= abs(first) + 0.0001
        assert 5.0 < abs(first) < 25.0
    check_walk(spec.scene(), emitted, spec.home)


def test_a_range_that_ends_before_it_is_refused(tmp_path, capsys):
    path = moved_jig(tmp_path, "(850, 1860, 230) (1150, 2260, 380)", 10)
    assert main(["check", str(path)]) == 1
    said = capsys.readouterr().err
    assert re.findall(r"error (E\d+): hole (\w+) cannot be made", said) == [("E410", "P7")]

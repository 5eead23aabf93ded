"""Job → Program: order of holes, sections, and one cycle for each process that is used."""

from __future__ import annotations

from pathlib import Path

from language.texts import planned

SPEC = """drill 1
program P
part p { up +Z  normals into  frame 3 }
tool t { number 2  tcp (0, 0, 100) mm }
process a { approach 50 mm  retract 50 mm }
process b { approach 60 mm  retract 60 mm }
region r1 { posture x toward +X  process b  points mm { H1 (0, 0, 0) normal (0, 0, -1) } }
region r2 { posture x toward +X  points mm { H2 (9, 0, 0) normal (0, 0, -1) } }
region r3 { posture x toward +X  process a  points mm { H3 (18, 0, 0) normal (0, 0, -1) } }
region r4 { posture x toward +X  process b
  points mm { H4 (27, 0, 0) normal (0, 0, -1) }
  points m { H5 (0.036, 0, 0) normal (0, 0, -1) }
}
"""


def test_cycles_in_the_order_in_which_regions_use_them(tmp_path: Path) -> None:
    program = planned(tmp_path, SPEC).programs[0]
    assert [cycle.process.name for cycle in program.cycles] == ["b", "visit", "a"]
    found = [(s.region, s.cycle, s.start, s.stop) for s in program.sections]
    assert found == [("r1", 0, 0, 1), ("r2", 1, 1, 2), ("r3", 2, 2, 3), ("r4", 0, 3, 5)]
    assert program.holes.ids.tolist() == ["H1", "H2", "H3", "H4", "H5"]
    assert [section.span.line for section in program.sections] == [7, 8, 9, 10]


def test_processes_of_a_cell_that_nobody_uses_are_left_out(tmp_path: Path) -> None:
    cell = "drill 1\nprocess c { approach 1 m  retract 1 m }\n"
    (tmp_path / "c.cell").write_text(cell)
    text = SPEC.replace("program P", 'program P\nuse "c.cell"')
    program = planned(tmp_path, text).programs[0]
    assert [cycle.process.name for cycle in program.cycles] == ["b", "visit", "a"]


def test_what_a_program_of_poses_has(tmp_path: Path) -> None:
    program = planned(tmp_path, SPEC).programs[0]
    assert program.name == "P"
    assert program.motion is None
    assert program.tool is not None
    assert program.tool.number == 2
    assert program.frame is not None
    assert program.frame.number == 3
    assert program.part_from_tool.shape == (5, 3, 3)
    assert program.depth_mm.tolist() == [0] * 5


def test_sections_cover_all_holes_once(tmp_path: Path) -> None:
    program = planned(tmp_path, SPEC).programs[0]
    edges = [(section.start, section.stop) for section in program.sections]
    assert [start for start, _ in edges] == [0, *(stop for _, stop in edges[:-1])]
    assert edges[-1][1] == len(program.holes)
    regions = [program.sections[i].region for i in program.holes.region.tolist()]
    assert regions == ["r1", "r2", "r3", "r4", "r4"]


def test_a_portal_carries_its_own_tool(tmp_path: Path) -> None:
    (tmp_path / "c.cell").write_text("drill 1\ntool t { number 1  tcp (0, 0, 1) mm }\n")
    text = """drill 1
use "c.cell"
program P
part p { normals outward }
robot r portal { D 10 m  H 5 m  d 0.75 m  height centre  side below
  limits { q3 -180 deg .. 180 deg  q5 -3 m .. 3 m } }
region s { points m { A (5, 0.1, 0.2) normal (0, 0, 1) } }
"""
    program = planned(tmp_path, text).programs[0]
    assert program.tool is None
    assert program.motion is not None
    assert [axis.name for axis in program.motion.axes] == ["q1", "q2", "q3", "q4", "q5", "q6"]
    assert [axis.rotary for axis in program.motion.axes] == [i == 2 for i in range(6)]

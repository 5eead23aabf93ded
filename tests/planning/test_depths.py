"""How deep holes are made: process, stack, countersink. By hand: the cone of angle φ that opens a
hole of diameter d to a rim D goes (D - d) / 2 / tan(φ/2) deeper."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from language.texts import attempted, codes, planned, refused, spots

HEAD = """drill 1
program P
part p { up +Z  normals into }
"""
TABLE = """ID,X,Y,Z,I,J,K,DIA,GRIP
A,0,0,0,0,0,-1,4.8,6.5
B,50,0,0,0,0,-1,,2
C,100,0,0,0,0,-1,6.4,
D,150,0,0,0,0,-1,,
"""


def spec(depth: str, where: str, sink: str = "") -> str:
    return f"""{HEAD}holes t from "holes.csv" {{
  units mm  columns {{ id ID  x X  y Y  z Z  i I  j J  k K  diameter DIA  stack GRIP }}
}}
process d {{
  approach 50 mm  retract 50 mm  spindle 3000 rpm  feed 0.1 mm/rev  depth {depth} {sink}
}}
region r {{ posture x toward +X  process d  select t where {where} }}
region rest {{ posture x toward +X  select t not in r }}
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "holes.csv").write_text(TABLE)
    return tmp_path


def depths(folder: Path, text: str) -> list[float]:
    return planned(folder, text).programs[0].depth_mm.tolist()


@pytest.mark.parametrize(
    ("depth", "where", "wanted"),
    [
        ("12 mm", 'id != "D"', [12, 12, 12, 0]),
        ("stack", 'id like "[AB]"', [6.5, 2, 0, 0]),
        ("stack + 2 mm", 'id like "[AB]"', [8.5, 4, 0, 0]),
        ("stack +2 mm", 'id like "[AB]"', [8.5, 4, 0, 0]),
        ("stack -0.5 mm", 'id like "[AB]"', [6.0, 1.5, 0, 0]),
        ("stack + -0.5 mm", 'id like "[AB]"', [6.0, 1.5, 0, 0]),
        ("stack + 0.002 m", 'id == "A"', [8.5, 0, 0, 0]),
    ],
)
def test_depths_and_stacks(folder: Path, depth: str, where: str, wanted: list[float]) -> None:
    assert depths(folder, spec(depth, where)) == wanted


@pytest.mark.parametrize(
    ("sink", "more"),
    [
        ("countersink 100 deg by 1.5 mm", 1.5),
        ("countersink 30 deg by 0.15 cm", 1.5),
        ("countersink 90 deg diameter 7.8 mm", 1.5),  # tan 45° = 1
        ("countersink 60 deg diameter 8.8 mm", 2 * math.sqrt(3)),  # tan 30° = 1/√3
        ("countersink 120 deg diameter 8.8 mm", 2 / math.sqrt(3)),
        ("countersink 100 deg diameter 9.5 mm", 4.7 / 2 / 1.19175359259421),  # tan 50°
    ],
)
def test_countersinks(folder: Path, sink: str, more: float) -> None:
    found = depths(folder, spec("stack + 2 mm", 'id == "A"', sink))
    assert found == pytest.approx([8.5 + more, 0, 0, 0], rel=1e-14)


def test_each_hole_has_its_own_cone(folder: Path) -> None:
    found = depths(folder, spec("10 mm", 'id like "[AC]"', "countersink 90 deg diameter 8.4 mm"))
    assert found == pytest.approx([10 + (8.4 - 4.8) / 2, 10 + (8.4 - 6.4) / 2, 0, 0])


def test_regions_do_not_mix(folder: Path) -> None:
    """Each region's own process; visited holes have no depth at all."""
    text = spec("stack", 'id == "B"').replace(
        "region rest {",
        "process e { approach 50 mm  retract 50 mm  spindle 1 rpm  feed 1 mm/s  depth 3 mm }\n"
        'region c { posture x toward +X  process e  select t where id == "C" }\n'
        "region rest {",
    )
    text = text.replace("select t not in r }", "select t not in r where not in c }")
    result = planned(folder, text)
    assert result.job.holes.ids.tolist() == ["B", "C", "A", "D"]
    assert result.programs[0].depth_mm.tolist() == [2, 3, 0, 0]


@pytest.mark.parametrize(
    ("depth", "where", "sink", "found"),
    [
        ("stack", 'id != "D"', "", [("E340", 4, 1)]),  # C has no stack
        ("stack -3 mm", 'id like "[AB]"', "", [("E341", 3, 1)]),
        ("stack -2 mm", 'id like "[AB]"', "", [("E341", 3, 1)]),  # nothing is not deep
        ("stack -7 mm", 'id like "[AB]"', "", [("E341", 2, 1), ("E341", 3, 1)]),
        ("5 mm", 'id != "D"', "countersink 90 deg diameter 9 mm", [("E342", 3, 1)]),
        (
            "5 mm",
            'id like "[AC]"',
            "countersink 90 deg diameter 4.8 mm",
            [("E343", 2, 1), ("E343", 4, 1)],
        ),
        ("5 mm", 'id like "[AC]"', "countersink 90 deg diameter 6 mm", [("E343", 4, 1)]),
        (
            "stack",
            'id != "D"',
            "countersink 90 deg diameter 9 mm",
            [("E340", 4, 1), ("E342", 3, 1)],
        ),
    ],
)
def test_what_a_hole_lacks(
    folder: Path, depth: str, where: str, sink: str, found: list[tuple[str, int, int]]
) -> None:
    said = spots(refused(folder, spec(depth, where, sink)))
    assert [spot for spot in said if spot[0].startswith("E")] == found


def test_a_cone_of_a_given_depth_needs_no_diameter(folder: Path) -> None:
    _, report = attempted(folder, spec("5 mm", 'id == "B"', "countersink 90 deg by 1 mm"))
    assert codes(report) == []

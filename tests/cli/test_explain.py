"""`drillc explain`: what is printed, and the exit codes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from drillc.cli import main
from planning.arm_specs import HOLE, OUTRIGGER, arm_spec, region

WALL = "fixture jig { box (60, 230, 800) (200, 350, 1600) mm }"
AVOIDS = "avoid jig clearance 20 mm  turning within 40 deg"


@pytest.fixture
def explain(tmp_path, monkeypatch, capsys):
    """Run it on a text; exit code, output, error output."""
    monkeypatch.chdir(tmp_path)

    def run(text, *arguments):
        Path("spec.drill").write_text(text, encoding="utf-8")
        code = main(["explain", "spec.drill", *arguments])
        return code, *capsys.readouterr()

    return run


def test_a_hole_that_turns(explain):
    code, out, err = explain(arm_spec(region("r", HOLE, AVOIDS), body=OUTRIGGER, more=WALL), "P1")
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[:4] == [
        "hole P1 of region r",
        "  spec.drill:12",
        "  at (0, 0, 1200) mm, turning within 40 deg",
        "  keeps away from fixture jig by 20 mm",
    ]
    assert max(map(len, lines)) <= 100
    [chosen] = [line for line in lines if line.startswith("chosen: ")]
    table = lines[lines.index(next(line for line in lines if line.startswith("heading"))) :]
    [marked] = [line for line in table if "  chosen " in line]
    assert chosen.split()[2].rstrip("0") == marked.split()[0].rstrip("0")
    assert lines[lines.index(chosen) + 1].split()[::2] == [
        "A1",
        "A2",
        "A3",
        "A4",
        "A5",
        "A6",
        "deg",
    ]
    headings = [float(line.split()[0]) for line in table[1:]]
    assert headings == sorted(headings)
    assert {line[9:20].strip() for line in table[1:]} == {
        "blocked", "works", "chosen", "not allowed",
    }  # fmt: skip


def test_a_hole_that_cannot_be_made(explain):
    text = arm_spec(region("r", HOLE, AVOIDS.replace("40", "5")), body=OUTRIGGER, more=WALL)
    code, out, _ = explain(text, "P1")
    assert code == 0
    assert "nothing is chosen: no heading that is allowed works" in out.splitlines()
    assert out.splitlines()[-1].startswith("hint: turning within ")


def test_a_spec_that_another_hole_spoils(explain):
    holes = f"{HOLE}  P2 (-3000, 0, 1200) normal (-1, 0, 0)"
    code, out, _ = explain(arm_spec(region("r", holes)), "P1")
    assert code == 0
    assert "nothing is chosen, because the spec does not compile:" in out.splitlines()
    assert "  E410: hole P2 cannot be made: " in out
    assert "  the rule's heading works" in out.splitlines()


def test_as_json(explain):
    text = arm_spec(region("r", HOLE, AVOIDS), body=OUTRIGGER, more=WALL)
    code, out, err = explain(text, "P1", "--json")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert (found["hole"], found["region"], found["station"]) == ("P1", "r", None)
    assert found["clearance_mm"] == {"fixture jig": 20.0}
    [chosen] = [line for line in found["headings"] if line["verdict"] == "chosen"]
    assert chosen["heading_deg"] == found["chosen"]["heading_deg"]
    assert found["chosen"]["branch"] in chosen["branches"]
    assert len(found["chosen"]["joints_deg"]) == 6
    [own] = [line for line in found["headings"] if line["heading_deg"] == 0]
    assert own["tool"].startswith("the tool is ")
    assert found["refused"] == []


def test_no_such_hole(explain):
    code, out, err = explain(arm_spec(), "P11")
    assert (code, out) == (2, "")
    assert err == 'drillc explain: there is no hole "P11"; did you mean "P1"?\n'


def test_no_arm(explain):
    spec = (
        "drill 1\nprogram P\npart p { up +Z  normals into  frame 1 }\n"
        "tool t { number 1  tcp (0, 0, 1) mm }\n" + region("r", HOLE) + "emit krl\n"
    )
    code, out, err = explain(spec, "P1")
    assert (code, out) == (2, "")
    assert err.startswith("drillc explain: only an arm chooses headings, and the spec has none")


def test_a_spec_that_cannot_be_read(explain):
    code, out, err = explain(arm_spec().replace("posture", "postur"), "P1")
    assert (code, out) == (1, "")
    assert "error E101: " in err

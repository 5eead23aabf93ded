"""Holes that the compiler refuses cannot be made; those that it makes can. Judged by brute force.

Thirty holes of the fuselage panel, from its aft parking place, each time with something that is in
some holes' way.
"""

import csv
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from drillc.cli import main
from walk.dense import Cycle, Dense
from walk.emitted import Spec

SAMPLES = Path(__file__).parents[2] / "samples"
#: Every so many of the aft holes are taken.
EVERY = 27
WITHIN_DEG, SINGULAR_DEG = 120, 5.0
CLEARANCE_MM = {"boards": 10.0, "bars": 10.0, "clamp": 10.0}
#: A fixture beyond everyone's way.
NOWHERE = "box (0, 9000, 0) (10, 9010, 10) mm"
PARKED = "station aft     frame 3 at (-1400, 4200, -1400) mm rotate z -90 deg"


@dataclass(frozen=True)
class Trouble:
    """What is changed in the cell: the clamp's place, and pairs of texts."""

    clamp: str = NOWHERE
    changes: tuple[tuple[str, str], ...] = ()


TROUBLES = {
    "a clamp over three holes": Trouble("box (-1130, 2000, 400) (-960, 2300, 800) mm"),
    "parked too far away": Trouble(changes=((PARKED, PARKED.replace("4200", "5300")),)),
    "a forearm that hardly turns": Trouble(
        changes=(("  singular 5 deg", "  singular 5 deg  limits { A4 -110 deg .. -80 deg }"),)
    ),
}


def aft_holes():
    with (SAMPLES / "fuselage" / "holes.csv").open(encoding="ascii", newline="") as file:
        rows = list(csv.DictReader(file))
    return [row for row in rows if float(row["X"]) < -1.0][::EVERY]


def cycle(row):
    """x toward +X, from 60 mm out to 1.5 mm beyond the stack."""
    z = -np.array([float(row[f"N{axis}"]) for axis in "XYZ"])
    z /= np.linalg.norm(z)
    x = np.array([1.0, 0.0, 0.0]) - z[0] * z
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    pose[:3, 3] = [float(row[axis]) for axis in "XYZ"]
    return Cycle(pose, 60.0, float(row["STACK"]) + 1.5, CLEARANCE_MM)


def variant(folder, trouble, rows):
    """The sample with the trouble and only the holes `rows`, without a limit of heading jumps."""
    shutil.copytree(SAMPLES / "cells", folder / "cells")
    shutil.copytree(SAMPLES / "fuselage", folder / "fuselage")
    table = [",".join(rows[0])] + [",".join(row.values()) for row in rows]
    (folder / "fuselage" / "holes.csv").write_text("\n".join([*table, ""]), "ascii")
    cell = folder / "cells" / "fuselage.cell"
    text = cell.read_text("utf-8")
    for old, new in trouble.changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    text = re.sub(r"(?m)^  station forward .*\n", "", text)
    cell.write_text(f"{text}\nfixture clamp {{ {trouble.clamp} }}\n", "utf-8")
    text = (SAMPLES / "fuselage_arm.drill").read_text("utf-8")
    text = re.sub(r"region forward_\w+ \{[^}]*\}", "", text)
    text = re.sub(r"(?m)^(sequence|expect) .*\n", "", text)
    text = text.replace("avoid boards", "avoid clamp clearance 10 mm   avoid boards")
    path = folder / "fuselage_arm.drill"
    path.write_text(text, "utf-8")
    return path


def headings(step_deg):
    """From 0 outwards."""
    away = np.arange(step_deg, WITHIN_DEG + 1e-9, step_deg)
    return [0.0, *np.stack([away, -away], axis=1).ravel().tolist()]


#: More than a minute each: every heading of many holes is out of the arm's reach.
LONG_TROUBLES = ("parked too far away", "a forearm that hardly turns")


def test_all_troubles_are_tried():
    assert set(TROUBLES) == {"a clamp over three holes", *LONG_TROUBLES}


@pytest.mark.parametrize(
    "name",
    ["a clamp over three holes", *(pytest.param(n, marks=pytest.mark.slow) for n in LONG_TROUBLES)],
)
def test_the_refused_holes_are_those_that_cannot_be_made(tmp_path, capsys, name):
    trouble, rows = TROUBLES[name], aft_holes()
    path = variant(tmp_path, trouble, rows)
    main(["check", str(path)])
    said = capsys.readouterr().err
    assert "more holes that cannot be made" not in said
    refused = set(re.findall(r"error E410: hole (\w+) cannot be made", said))
    assert 2 <= len(refused) <= 10

    spec = Spec(path)
    judge = Dense(spec.scene("aft"), spec.flange_from_tool, SINGULAR_DEG)
    for row in rows:
        asked = cycle(row)
        step_deg = 1.0 if row["ID"] in refused else 5.0
        works = any(judge.works(asked, heading) for heading in headings(step_deg))
        assert works == (row["ID"] not in refused), row["ID"]

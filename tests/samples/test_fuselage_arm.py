"""The fuselage panel against its own formulas: numpy and trimesh, nothing of drillc's."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

SAMPLES = Path(__file__).parents[2] / "samples"
FOLDER = SAMPLES / "fuselage"
RADIUS_MM, MERIDIAN_MM = 2200.0, 16_000.0


def beyond(position: np.ndarray) -> np.ndarray:
    """How far points (n, 3) lie outside the barrel."""
    x, y, z = position.T
    return np.hypot(x, np.hypot(y, z) - (RADIUS_MM - MERIDIAN_MM)) - MERIDIAN_MM


def outward(position: np.ndarray) -> np.ndarray:
    """The barrel's unit normals (n, 3) at points of it: from its meridian's centre."""
    x, y, z = position.T
    across = np.hypot(y, z)
    inwards = across - (RADIUS_MM - MERIDIAN_MM)
    normal = np.stack([x, inwards * y / across, inwards * z / across], axis=1)
    return normal / np.linalg.norm(normal, axis=1)[:, None]


@pytest.fixture(scope="module")
def rows() -> list[dict[str, str]]:
    with (FOLDER / "holes.csv").open(encoding="ascii", newline="") as file:
        return list(csv.DictReader(file))


def triples(rows: list[dict[str, str]], *titles: str) -> np.ndarray:
    return np.array([[float(row[title]) for title in titles] for row in rows])


def test_the_generator_makes_the_very_files_that_are_kept(tmp_path):
    subprocess.run([sys.executable, SAMPLES / "make_fuselage.py", tmp_path], check=True)
    made = sorted(path.name for path in tmp_path.iterdir())
    assert made == sorted(path.name for path in FOLDER.iterdir())
    for name in made:
        assert (tmp_path / name).read_bytes() == (FOLDER / name).read_bytes()
        assert (FOLDER / name).stat().st_size < 200_000


def test_the_holes_lie_on_the_barrel_where_their_ids_say(rows):
    assert len({row["ID"] for row in rows}) == len(rows) >= 1500
    position, normal = triples(rows, "X", "Y", "Z"), triples(rows, "NX", "NY", "NZ")
    assert np.abs(beyond(position)).max() < 1e-3
    assert np.abs(normal - outward(position)).max() < 2e-6
    u = np.degrees(np.arcsin(position[:, 0] / MERIDIAN_MM))
    phi = np.degrees(np.arctan2(position[:, 2], position[:, 1]))
    for row, along, around in zip(rows, u, phi, strict=True):
        line, place = int(row["ID"][1:3]), int(row["ID"][3:])
        if row["ID"][0] == "S":
            said = 0.1 * (place - 64), 3.0 * (line - 9), "3.4"
        else:
            said = 2.0 * (line - 4), 0.5 * (place - 49), "4.0"
        assert abs(along - said[0]) < 1e-4
        assert abs(around - said[1]) < 1e-4
        assert row["STACK"] == said[2]


def test_every_row_begins_about_where_the_last_one_ended(rows):
    """But for the two ends of the frames and the change of the parking place."""
    position = triples(rows, "X", "Y", "Z")
    step = np.linalg.norm(np.diff(position, axis=0), axis=1)
    far = [(rows[i]["ID"], rows[i + 1]["ID"]) for i in np.flatnonzero(step > 600.0)]
    assert [(a[:3], b[:3]) for a, b in far] == [("F01", "S01")]


def test_the_skin_is_near_the_barrel_and_faces_outwards():
    skin = trimesh.load(FOLDER / "skin.ply")
    assert not skin.is_watertight
    points, face = trimesh.sample.sample_surface(skin, 20_000, seed=1)
    off = beyond(np.asarray(points))
    assert off.min() > -0.45
    assert off.max() < 0.01
    assert (skin.face_normals[face] * outward(np.asarray(points))).sum(axis=1).min() > 0.999


def test_the_boards_are_closed_and_stand_off_the_skin():
    boards = trimesh.load(FOLDER / "boards.stl")
    assert boards.is_watertight
    assert boards.volume > 0
    assert len(boards.split()) == 4
    points, _ = trimesh.sample.sample_surface(boards, 20_000, seed=1)
    gap = beyond(np.asarray(points))
    assert gap.min() > 8.0
    assert gap.max() < 145.0

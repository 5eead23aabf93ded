"""An arm's posture: the joints behind a pose, and what targets say of them."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from drillc.kernels.arm import landmarks
from drillc.language.job import Floats
from drillc.planning.cell import Cell, make_cell

from .case import Case
from .vectors import dot
from .visits import Path

#: A joint so near to where its sign or quadrant changes may be told either way.
_EITHER_RAD = 2e-5


def cell_of(case: Case) -> Cell | None:
    """The arm where it stands, with its tool."""
    arm, tool = case.program.arm, case.program.tool
    return None if arm is None or tool is None else make_cell(arm.arm, arm.station, tool, ())


def nearest(cell: Cell, rotation: Floats, position_mm: Floats, planned: Floats) -> Floats:
    """Of all joints (m, 6) that bring the tool to poses, those nearest to the planned ones."""
    branches = cell.branches(rotation, position_mm)
    near = branches + 2.0 * np.pi * np.rint((planned[:, None] - branches) / (2.0 * np.pi))
    apart = np.nan_to_num(np.abs(near - planned[:, None]).max(axis=2), nan=np.inf)
    return np.asarray(near[np.arange(len(near)), apart.argmin(axis=1)])


def check_configuration(case: Case, path: Path) -> None:
    """Every posture that a target states is that of the joints planned there. KUKA: S, T. ABB: cf1,
    cf4, cf6, cfx."""
    cell = cell_of(case)
    said = path.events.configuration
    stated = np.flatnonzero(np.isfinite(said).any(axis=1) & path.moves)
    stated = stated[np.isfinite(path.places.position_mm[stated, 0])]
    if cell is None or not len(stated):
        return
    maker = cell.arm.model.maker
    if maker not in ("kuka", "abb"):
        return
    case.tally.compared("configuration", len(stated))
    place = path.places
    planned = _planned(case, place.position_mm[stated])
    joints = nearest(cell, place.rotation[stated], place.position_mm[stated], planned)
    asked = told_posture(cell, joints, maker)
    said = said[stated]
    good = ((asked == said) | np.isnan(said)).all(axis=1)
    for k in range(6):
        for off in (-_EITHER_RAD, _EITHER_RAD):
            shifted = joints.copy()
            shifted[:, k] += off
            told = told_posture(cell, shifted, maker)
            good |= ((told == said) | np.isnan(said)).all(axis=1)
    names = ("S", "T") if maker == "kuka" else ("cf1", "cf4", "cf6", "cfx")
    for k in np.flatnonzero(~good).tolist():
        words = [
            f"{name} is {said[k, i]:g}, the joints that are planned ask for {asked[k, i]:g}"
            for i, name in enumerate(names)
            if np.isfinite(said[k, i]) and said[k, i] != asked[k, i]
        ]
        case.fail("configuration", "; ".join(words), path, int(stated[k]), body=True)


def _planned(case: Case, position_mm: Floats) -> Floats:
    """The planned joints (k, 6) that are nearest to places: of a via, a standoff, or a surface."""
    arm, wanted = case.program.arm, case.wanted
    assert arm is not None
    standoff = wanted.position_mm + wanted.approach_mm[:, None] * wanted.axis
    places = np.concatenate([arm.vias.position_mm, standoff, wanted.position_mm])
    joints = np.concatenate([arm.vias.joints, arm.standoff_joints, arm.joints])
    _, rows = cKDTree(places).query(position_mm)
    return np.asarray(joints[rows])


def told_posture(cell: Cell, joints: Floats, maker: str) -> Floats:
    """What a maker's target says of joints (m, 6), NaN in what is left of four.

    The sides of axis 1 and of the elbow are read from where the arm's points are.
    """
    points = landmarks(cell.geometry, joints)
    turn = cell.geometry.paper_angles(joints)[:, 0]
    ahead = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    aside = np.stack([-np.sin(turn), np.cos(turn), np.zeros_like(turn)], axis=1)
    _, column, shoulder, elbow, _, wrist, _ = np.moveaxis(points, 1, 0)
    behind = dot(wrist - column, ahead) < 0.0
    bend = dot(np.cross(elbow - shoulder, wrist - elbow), aside)
    told = np.full((len(joints), 4), np.nan)
    if maker == "kuka":
        told[:, 0] = behind * 1 + (bend >= 0.0) * 2 + (joints[:, 4] < 0.0) * 4
        told[:, 1] = (joints < 0.0) @ (1 << np.arange(6))
    else:
        told[:, :3] = np.floor(joints[:, [0, 3, 5]] / (np.pi / 2.0))
        told[:, 3] = behind * 4 + (bend < 0.0) * 2 + (joints[:, 4] < 0.0) * 1
    return told

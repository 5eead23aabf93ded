"""The catalogue against the joint chains of the packages that it names, and makers' stated reach.

The chains are walked here with scipy, by axis and origin, which is not how drillc computes."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drillc.catalogue import models, reach_mm
from drillc.catalogue.arms import read_models
from drillc.catalogue.model import ArmModel
from drillc.kernels.arm import forward
from drillc.language.job import (
    Floats,
)
from scipy.spatial.transform import Rotation

CHAINS: Mapping[str, Any] = tomllib.loads(
    (Path(__file__).parent / "urdf_chains.toml").read_text(encoding="utf-8")
)
NAMES = sorted(CHAINS)
FILE = resources.files("drillc.catalogue").joinpath("arms.toml").read_text(encoding="utf-8")


def walked(name: str, joints_rad: Floats) -> tuple[Floats, Floats]:
    """root_from_flange (3, 3), (3,) in mm of joints (6,), along the published chain."""
    turn, place = Rotation.identity(), np.zeros(3)
    for (origin, rpy, axis, *_), angle in zip(CHAINS[name]["joints"], joints_rad, strict=True):
        place = place + turn.apply(origin)
        turn = turn * Rotation.from_euler("xyz", rpy, degrees=True)
        turn = turn * Rotation.from_rotvec(angle * np.array(axis, dtype=float))
    for origin, rpy in CHAINS[name]["flange"]:
        place = place + turn.apply(origin)
        turn = turn * Rotation.from_euler("xyz", rpy, degrees=True)
    return turn.as_matrix(), place


def test_every_arm_has_a_chain() -> None:
    assert sorted(models()) == NAMES
    assert sum(name.startswith("kuka_") for name in NAMES) >= 10
    assert sum(name.startswith("abb_") for name in NAMES) >= 10


@pytest.mark.parametrize("name", NAMES)
def test_the_dimensions_are_the_chains(name: str) -> None:
    model = models()[name]
    random = np.random.default_rng(20)
    joints = np.concatenate([np.zeros((1, 6)), random.uniform(-3.0, 3.0, (40, 6))])
    rotation, position_mm = forward(model.geometry, joints)
    expected = [walked(name, row) for row in joints]
    np.testing.assert_allclose(rotation, [turn for turn, _ in expected], atol=1e-13)
    np.testing.assert_allclose(position_mm, [place for _, place in expected], atol=1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_limits_and_speeds_are_the_chains(name: str) -> None:
    """The packages' figures, which the catalogue rounds as its file's head says."""
    model = models()[name]
    joints = CHAINS[name]["joints"]
    low, high, speed = np.array([joint[3:] for joint in joints], dtype=float).T
    np.testing.assert_allclose(np.rad2deg(model.low_rad), low, atol=0.12)
    np.testing.assert_allclose(np.rad2deg(model.high_rad), high, atol=0.12)
    np.testing.assert_allclose(np.rad2deg(model.speed_rad_s), speed, atol=0.051)
    halves = 2.0 * np.rad2deg([model.low_rad, model.high_rad])
    np.testing.assert_allclose(halves, np.rint(halves), atol=1e-9)


def test_what_a_model_is_called() -> None:
    for name, model in models().items():
        assert model.name == name
        assert re.fullmatch(r"(kuka|abb)_[a-z0-9]+(_[a-z0-9]+)*", name)
        assert name.startswith(model.maker)
        assert model.title.split()[0].lower() == model.maker
        assert re.fullmatch(r"[\w-]+/[\w-]+: [\w/]+\.xacro", model.source)


def test_the_models_cannot_be_altered() -> None:
    model = models()["kuka_kr210_r3100_2"]
    arrays = [model.low_rad, model.high_rad, model.speed_rad_s]
    arrays += [model.geometry.offset_rad, model.geometry.sign]
    for array in arrays:
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0
    with pytest.raises(TypeError):
        models()["mine"] = model  # type: ignore[index]


# ── reach ────────────────────────────────────────────────────────────────────────────────────────

#: Reach as the name itself states it (R3100; 2.8 m), with what the name rounds away, and where the
#: name does not, the makers' data sheets.
NAMED = {model.name: model.title for model in models().values()}
SHEETS = {"kuka_kr5_arc": 1412.0, "kuka_kr16_2": 1611.0, "kuka_kr150_2": 2700.0}


def stated_mm(name: str) -> float:
    metres = re.search(r"/(\d\.\d+)$", NAMED[name])
    if metres:
        return 1000.0 * float(metres[1])
    millimetres = re.search(r"R(\d+)", NAMED[name])
    return float(millimetres[1]) if millimetres else SHEETS[name]


@pytest.mark.parametrize("name", NAMES)
def test_reach_is_what_the_maker_states(name: str) -> None:
    assert reach_mm(models()[name]) == pytest.approx(stated_mm(name), abs=26.0, rel=0.0)


def swept_reach_mm(model: ArmModel, steps: int) -> float:
    """By trying A2 and A3 on a grid: the wrist centre is c4 behind the flange."""
    tried = [np.linspace(model.low_rad[i], model.high_rad[i], steps) for i in (1, 2)]
    joints = np.zeros((steps * steps, 6))
    joints[:, 1], joints[:, 2] = (grid.ravel() for grid in np.meshgrid(*tried))
    rotation, flange_mm = forward(model.geometry, joints)
    wrist_mm = flange_mm - model.geometry.c4_mm * rotation[:, :, 2]
    return float(np.hypot(wrist_mm[:, 0], wrist_mm[:, 1]).max())


LIMITS = "limits_deg = [[-185, 185], [-140, -5], [-120, 168]"
NARROW = [
    LIMITS,
    LIMITS.replace("-140, -5", "-140, -100"),  # the arm leans back
    LIMITS.replace("-140, -5", "-20, 0").replace("-120, 168", "60, 90"),  # a folded elbow
    LIMITS.replace("-140, -5", "-90, 0").replace("-120, 168", "-90, -60"),
    LIMITS.replace("-120, 168", "100, 168"),
    LIMITS.replace("-140, -5", "-300, -170").replace("-120, 168", "-10, 10"),  # over its back
    LIMITS.replace("-140, -5", "300, 380").replace("-120, 168", "-380, -330"),  # a turn further
]


@pytest.mark.parametrize("limits", NARROW)
@pytest.mark.parametrize("b_mm", [0, 250])
def test_reach_is_the_best_inside_the_limits(limits: str, b_mm: int) -> None:
    start = FILE.index("[arm.kuka_kr210_r3100_2]")
    table = FILE[start : FILE.index("[arm.", start + 1)]
    assert LIMITS in table
    text = FILE[: FILE.index("[arm.")] + table.replace(LIMITS, limits)
    (model,) = read_models(text.replace("b = 0", f"b = {b_mm}")).values()
    swept = swept_reach_mm(model, 201)
    assert swept <= reach_mm(model) + 1e-9
    assert swept == pytest.approx(reach_mm(model), abs=0.2)


# ── what cannot be right ─────────────────────────────────────────────────────────────────────────

GOOD = """
[convention.kuka]
zero_deg = [0, -90, 0, 0, 0, 0]
sign = [-1, 1, 1, -1, 1, -1]
[arm.mine]
title = "Mine"
maker = "kuka"
mm = { a1 = 0, a2 = -20, b = 0, c1 = 330, c2 = 290, c3 = 310, c4 = 75 }
limits_deg = [[-170, 170], [-195, 40], [-115, 150], [-185, 185], [-120, 120], [-350, 350]]
speeds_deg_s = [336, 336, 487.5, 600, 529.1, 800]
source = "a tape measure"
"""


def test_a_catalogue_file_is_read() -> None:
    (model,) = read_models(GOOD).values()
    np.testing.assert_allclose(np.rad2deg(model.geometry.offset_rad), [0, -90, 0, 0, 0, 0])
    assert model.geometry.c3_mm == 310.0


@pytest.mark.parametrize(
    ("right", "wrong", "said"),
    [
        ("c2 = 290", "c2 = 0", "c2 and c3"),
        ("c3 = 310", "c3 = -310", "c2 and c3"),
        ("c4 = 75", "c4 = -75", "c4"),
        ("c4 = 75", "c4 = 75, c5 = 1", "dimensions"),
        ("b = 0, ", "", "dimensions"),
        ("[-195, 40]", "[40, -195]", "lower limit"),
        ("[-195, 40]", "[40, 40]", "lower limit"),
        ("[-170, 170], ", "", "limits_deg of 6 joints"),
        ("487.5", "0", "speeds"),
        ("336, 336, ", "336, ", "of 6 joints"),
        ("[-1, 1, 1,", "[-2, 1, 1,", "sign"),
        ("[-1, 1, 1,", "[1, 1,", "of 6 joints"),
    ],
)
def test_figures_that_cannot_be_right(right: str, wrong: str, said: str) -> None:
    assert GOOD.count(right) == 1
    with pytest.raises(ValueError, match=f"mine.*{said}"):
        read_models(GOOD.replace(right, wrong))

"""The catalogue's arms, read from `arms.toml` and checked, and how far an arm reaches."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib import resources
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from drillc.catalogue.model import JOINT_NAMES, ArmModel
from drillc.kernels.arm import ArmGeometry, Floats

DIMENSIONS = ("a1", "a2", "b", "c1", "c2", "c3", "c4")


@cache
def models() -> Mapping[str, ArmModel]:
    """Every arm of the catalogue by name, in the file's order. Read-only, arrays included."""
    text = resources.files("drillc.catalogue").joinpath("arms.toml").read_text(encoding="utf-8")
    return read_models(text)


def read_models(text: str) -> Mapping[str, ArmModel]:
    """The arms of a catalogue file's text. Raises ValueError where a figure is missing or cannot be
    right, KeyError for a maker without a convention."""
    tables = tomllib.loads(text)
    conventions = tables["convention"]
    read = {
        name: _model(name, table, conventions[table["maker"]])
        for name, table in tables["arm"].items()
    }
    return MappingProxyType(read)


def _model(name: str, table: Mapping[str, Any], convention: Mapping[str, Any]) -> ArmModel:
    lengths = table["mm"]
    if set(lengths) != set(DIMENSIONS):
        raise ValueError(f"{name}: dimensions {', '.join(DIMENSIONS)} expected")
    figures = {**convention, **table}
    for key in ("zero_deg", "sign", "limits_deg", "speeds_deg_s"):
        if len(figures[key]) != len(JOINT_NAMES):
            raise ValueError(f"{name}: {key} of {len(JOINT_NAMES)} joints expected")
    sign, limits_rad = _constant(figures["sign"]), np.deg2rad(figures["limits_deg"])
    geometry = ArmGeometry(
        **{f"{dimension}_mm": float(lengths[dimension]) for dimension in DIMENSIONS},
        # Where the controller is at zero_deg, the paper is at 0 = sign * zero - offset.
        offset_rad=_constant(sign * np.deg2rad(figures["zero_deg"])),
        sign=sign,
    )
    model = ArmModel(
        name=name,
        title=table["title"],
        maker=table["maker"],
        geometry=geometry,
        low_rad=_constant(limits_rad[:, 0]),
        high_rad=_constant(limits_rad[:, 1]),
        speed_rad_s=_constant(np.deg2rad(figures["speeds_deg_s"])),
        source=table["source"],
    )
    _check(model)
    return model


def _constant(values: ArrayLike) -> Floats:
    """A copy that cannot be written to: models are shared by everybody who asks for one."""
    array = np.array(values, dtype=float)
    array.setflags(write=False)
    return array


def _check(model: ArmModel) -> None:
    geometry = model.geometry
    if not (geometry.c2_mm > 0.0 and geometry.c3_mm > 0.0 and geometry.c4_mm >= 0.0):
        raise ValueError(f"{model.name}: c2 and c3 must be positive, c4 not negative")
    if not np.all(np.abs(geometry.sign) == 1.0):
        raise ValueError(f"{model.name}: sign holds 1 and -1")
    if not np.all(model.low_rad < model.high_rad):
        raise ValueError(f"{model.name}: a lower limit is not below the upper one")
    if not np.all(model.speed_rad_s > 0.0):
        raise ValueError(f"{model.name}: speeds must be positive")


def reach_mm(model: ArmModel) -> float:
    """The greatest horizontal distance of the wrist centre from axis 1, inside the limits of A2 and
    A3. This is the reach that makers state: 3100 mm of a KR 210 R3100-2.

    In the plane that turns with axis 1 the wrist centre is at a1 + c2 sin(t2) + k sin(t2 + t3 + p),
    with k and p the forearm's length and slant, `forearm_mm` and `forearm_rad`. The greatest value
    over the rectangle of t2 and t3 is at one of a few points: both sines at an end of their range,
    or a limit of t2 or t3 and what is best along that side.
    """
    geometry = model.geometry
    forearm_mm, slant_rad = geometry.forearm_mm, geometry.forearm_rad
    ends = geometry.paper_angles(np.stack([model.low_rad, model.high_rad]))
    shoulder_ends, elbow_ends = np.sort(ends[:, 1]), np.sort(ends[:, 2])

    upright_or_level = 0.5 * np.pi * np.arange(-9, 10)  # ± 810°: beyond what any axis turns
    stretched = geometry.c2_mm + forearm_mm * np.exp(1j * (elbow_ends + slant_rad))  # t3 at a limit
    shoulder = [shoulder_ends, upright_or_level, *(upright_or_level - np.angle(stretched)[:, None])]
    shoulder_rad = _inside(np.concatenate(shoulder), shoulder_ends)[:, None]
    elbow = [np.broadcast_to(elbow_ends, (len(shoulder_rad), 2))]
    elbow.append(upright_or_level - shoulder_rad - slant_rad)
    elbow_rad = np.clip(np.concatenate(elbow, axis=1), *elbow_ends)

    ahead_mm = (
        geometry.a1_mm
        + geometry.c2_mm * np.sin(shoulder_rad)
        + forearm_mm * np.sin(shoulder_rad + elbow_rad + slant_rad)
    )
    return float(np.hypot(np.abs(ahead_mm).max(), geometry.b_mm))


def _inside(angles_rad: Floats, ends_rad: Floats) -> Floats:
    inside: Floats = angles_rad[(angles_rad >= ends_rad[0]) & (angles_rad <= ends_rad[1])]
    return inside

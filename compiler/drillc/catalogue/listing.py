"""`drillc robots`: the catalogue as a table for people, or as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator

import numpy as np

from drillc.catalogue.model import JOINT_NAMES, ArmModel
from drillc.kernels.arm import Floats

from .arms import DIMENSIONS, reach_mm

_LEFT = 2  # columns of text, set to the left


def as_table(models: Iterable[ArmModel]) -> str:
    """One line an arm: name, title, reach in mm and the range of each axis in degrees."""
    header = ("name", "title", "reach_mm", *(f"{joint}_deg" for joint in JOINT_NAMES))
    rows = [header, *(_cells(model) for model in models)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return "".join(_line(row, widths) for row in rows)


def as_json(models: Iterable[ArmModel]) -> str:
    """A list of objects with every figure, lengths in mm, angles in degrees, speeds in deg/s."""
    return json.dumps([_figures(model) for model in models], indent=2) + "\n"


def _cells(model: ArmModel) -> tuple[str, ...]:
    ranges = (f"{low:g}..{high:g}" for low, high in _limits_deg(model))
    return (model.name, model.title, f"{reach_mm(model):.0f}", *ranges)


def _line(row: Iterable[str], widths: Iterable[int]) -> str:
    cells = (
        cell.ljust(width) if i < _LEFT else cell.rjust(width)
        for i, (cell, width) in enumerate(zip(row, widths, strict=True))
    )
    return "  ".join(cells) + "\n"


def _figures(model: ArmModel) -> dict[str, object]:
    return {
        "name": model.name,
        "title": model.title,
        "maker": model.maker,
        "reach_mm": round(reach_mm(model), 1),
        "limits_deg": dict(zip(JOINT_NAMES, _limits_deg(model), strict=True)),
        "speeds_deg_s": dict(zip(JOINT_NAMES, _degrees(model.speed_rad_s), strict=True)),
        "dimensions_mm": {name: getattr(model.geometry, f"{name}_mm") for name in DIMENSIONS},
        "source": model.source,
    }


def _limits_deg(model: ArmModel) -> Iterator[tuple[float, float]]:
    return zip(_degrees(model.low_rad), _degrees(model.high_rad), strict=True)


def _degrees(angles_rad: Floats) -> list[float]:
    """As written in the catalogue: the way to radians and back leaves crumbs behind."""
    degrees: list[float] = np.round(np.rad2deg(angles_rad), 6).tolist()
    return degrees

"""Which arm it is: a model of the catalogue by name, or one of the spec's own by its dimensions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from drillc.catalogue.model import JOINT_NAMES, ArmModel
from drillc.kernels.arm import ArmGeometry
from drillc.language.ast import Item, Word
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import Fields, entries, lookup, measure, of_type
from drillc.language.job import (
    Floats,
    Limit,
)

#: The arm's dimensions, as in the drawing of docs/language.md.
DIMENSIONS = ("a1", "a2", "b", "c1", "c2", "c3", "c4")
#: What only an arm that states its own dimensions says.
_OWN = ("zero", "reversed", "maker")
_EXAMPLE = "a1 330 mm  a2 -115 mm  b 0 mm  c1 645 mm  c2 1350 mm  c3 1420 mm  c4 240 mm"


def resolve_model(
    fields: Fields, limits: Mapping[str, Limit], speeds: Mapping[str, float], report: Report
) -> ArmModel | None:
    """The arm's model; None after an error. `limits` and `speeds` are what the spec says of them:
    an arm of its own must say all."""
    model, dimensions = fields.get("model"), fields.get("dimensions")
    name = fields.statement.name
    if model is None and dimensions is None:
        report.error(
            "E256",
            f"robot {name.text} does not say which arm it is",
            name.span,
            hint="model kuka_kr210_r3100_2 (drillc robots lists them); or dimensions { … }",
        )
        return None
    if model is None:
        return _own(fields, limits, speeds, report)
    for key in ("dimensions", *_OWN):
        item = fields.get(key)
        if item is not None:
            report.error(
                "E256",
                f'"{key}" belongs to an arm with dimensions of its own; robot {name.text} is a '
                "model of the catalogue",
                item.key.span,
                labels=[Label(model.span, "the model")],
                hint="remove one of them",
            )
    return _catalogued(of_type(model.values[0], Word), report)


def complete(
    item: Item, found: Iterable[str], names: Sequence[str], example: str, report: Report
) -> bool:
    """Whether a block says all of `names`; else that is an error."""
    there = set(found)
    missing = [name for name in names if name not in there]
    # What stands there under another name has been reported, and is what is missing.
    if missing and len(item.items) < len(names):
        report.error(
            "E257",
            f'"{item.key.text}" does not say {", ".join(missing)}',
            item.key.span,
            hint=f"{item.key.text} {{ {example} }}",
        )
    return not missing


def _catalogued(word: Word, report: Report) -> ArmModel | None:
    from drillc.catalogue.arms import models

    return lookup(word, models(), "arm model", report)


def _own(
    fields: Fields, limits: Mapping[str, Limit], speeds: Mapping[str, float], report: Report
) -> ArmModel | None:
    name = fields.statement.name.text
    geometry = _geometry(fields, report)
    for key, found, example in (
        ("limits", limits, "A1 -185 deg .. 185 deg  …"),
        ("speeds", speeds, "A1 105 deg/s  …"),
    ):
        item = fields.need(key, f"{key} {{ {example} }}: an arm of its own says them of all joints")
        if item is None or not complete(item, found, JOINT_NAMES, example, report):
            geometry = None
    maker = fields.get("maker")
    if geometry is None:
        return None
    return ArmModel(
        name=name,
        title=name,
        maker="other" if maker is None else of_type(maker.values[0], Word).text,
        geometry=geometry,
        low_rad=np.array([limits[joint].low for joint in JOINT_NAMES]),
        high_rad=np.array([limits[joint].high for joint in JOINT_NAMES]),
        speed_rad_s=np.array([speeds[joint] for joint in JOINT_NAMES]),
        source=fields.statement.span.source.key,
    )


def _geometry(fields: Fields, report: Report) -> ArmGeometry | None:
    """Dimensions, the joints' angles in the drawing's posture, and those that count backwards."""
    sign, angle = _signs(fields.get("reversed"), report), _zero(fields.get("zero"), report)
    item = fields.get("dimensions")
    assert item is not None
    found = entries(item, DIMENSIONS, "dimension", report)
    size = {k: measure(entry.values[0], "length", k, report) for k, entry in found.items()}
    for key, value in size.items():
        # Without an upper arm or a forearm there is nothing to bend; a negative flange would lie
        # before the wrist.
        if value < 0 or (key in ("c2", "c3") and value == 0):
            if key not in ("c2", "c3", "c4"):
                continue
            need = "at least" if key == "c4" else "more than"
            report.error(
                "E258",
                f"{key} is {value:g} mm; {_SAID[key]} is {need} 0 mm long",
                found[key].span,
                hint="check its sign; the drawing is in docs/language.md, under robot",
            )
    if not complete(item, found, DIMENSIONS, _EXAMPLE, report):
        return None
    # The paper's angle is sign * q - offset, and 0 in the drawing's posture.
    return ArmGeometry(
        a1_mm=size["a1"],
        a2_mm=size["a2"],
        b_mm=size["b"],
        c1_mm=size["c1"],
        c2_mm=size["c2"],
        c3_mm=size["c3"],
        c4_mm=size["c4"],
        offset_rad=sign * angle,
        sign=sign,
    )


_SAID = {"c2": "the upper arm", "c3": "the forearm", "c4": "the flange's distance from the wrist"}


def _signs(item: Item | None, report: Report) -> Floats:
    sign = np.ones(len(JOINT_NAMES))
    seen: dict[str, Word] = {}
    for value in item.values if item else ():
        word = of_type(value, Word)
        if lookup(word, dict.fromkeys(JOINT_NAMES, True), "joint", report) is None:
            continue
        first = seen.setdefault(word.text, word)
        if first is not word:
            report.error(
                "E201",
                f'"{word.text}" is given twice in reversed',
                word.span,
                labels=[Label(first.span, "first given here")],
                hint="remove one of them",
            )
        sign[JOINT_NAMES.index(word.text)] = -1.0
    return sign


def _zero(item: Item | None, report: Report) -> Floats:
    angle = np.zeros(len(JOINT_NAMES))
    for name, entry in entries(item, JOINT_NAMES, "joint", report).items():
        value = measure(entry.values[0], "angle", f"{name}'s zero", report)
        if abs(value) > 2 * math.pi:
            report.error(
                "E206",
                f"{name}'s zero is {math.degrees(value):g} deg; it must be within a turn",
                entry.span,
            )
        angle[JOINT_NAMES.index(name)] = value
    return angle

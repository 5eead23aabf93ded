"""Resolving the statements about the part, the tool and the cell's signals: part, tool, io."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np

from drillc.language.ast import Item, Numbers, Placement, Quantity, Statement, Text, Word
from drillc.language.bodies import convex_pieces
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import (
    Fields,
    did_you_mean,
    lengths,
    measure,
    named,
    of_type,
    pose,
    unit_vector,
    whole,
)
from drillc.language.job import (
    Part,
    Pose,
    Signal,
    Surface,
    Tool,
    WorkFrame,
)
from drillc.language.loading import Loader
from drillc.language.mesh_files import MeshFile, read_surface
from drillc.language.units import UNITS, Dimension

#: How far a normal's length may be from 1 unless the part says otherwise. The posture article's own
#: printed normals are off by up to 0.00066.
DEFAULT_UNIT_TOLERANCE = 1e-3
#: How far a hole may be from the part's surface, and its normal from the surface's, unless the part
#: says otherwise: what a good panel and its fasteners' table agree within.
SURFACE_WITHIN_MM = 0.5
SURFACE_WITHIN_RAD = math.radians(2.0)

#: The signals that processes use, and of which kind each must be.
SIGNAL_ROLES: dict[str, str] = {
    "spindle_on": "output",
    "spindle_speed": "analog",
    "spindle_running": "input",
    "clamp": "output",
    "clamped": "input",
    "released": "input",
    "clamp_force": "analog",
    "set": "output",
    "set_done": "input",
}
_SAID_KIND = {"output": "output", "input": "input", "analog": "analog output"}
#: What an analog signal's full scale is measured in.
_FULL_SCALE: dict[str, Dimension] = {"spindle_speed": "spindle speed", "clamp_force": "force"}


def resolve_part(statement: Statement, loader: Loader, report: Report) -> Part:
    """`part NAME { up V  normals into|outward|from surface  … }`."""
    fields = Fields(statement, report)
    up = fields.get("up")
    up_value = None if up is None else up.values[0]
    vector = unit_vector(up_value, "up", report) if isinstance(up_value, Word | Numbers) else None
    normals = fields.need(
        "normals",
        "normals into: they are feed directions; normals outward: they leave the material",
    )
    said = None if normals is None else of_type(normals.values[0], Word).text
    surface = fields.get("surface")
    if normals is not None and said == "surface" and surface is None:
        report.error(
            "E268",
            f"the normals are taken from the surface, and part {statement.name.text} has none",
            normals.span,
            hint='surface "part.stl" mm',
        )
    return Part(
        named(statement.name),
        vector,
        said == "into",
        _tolerance(fields.get("unit_tolerance"), report),
        _frame(fields.get("frame"), report),
        None if surface is None else _surface(surface, loader, report),
        said == "surface",
    )


def _surface(item: Item, loader: Loader, report: Report) -> Surface | None:
    path, unit, at, *limits = item.values
    within: dict[Dimension, float] = {"length": SURFACE_WITHIN_MM, "angle": SURFACE_WITHIN_RAD}
    stated: dict[Dimension, Quantity] = {}
    for quantity in limits:
        if not isinstance(quantity, Quantity):
            continue
        known = UNITS.get(quantity.unit or "")
        dimension: Dimension = "angle" if known and known.dimension == "angle" else "length"
        first = stated.setdefault(dimension, quantity)
        if first is not quantity:
            report.error(
                "E201",
                f"within has two {dimension}s: how far a hole may be from the surface is a length, "
                "and how far its normal may be from the surface's an angle",
                quantity.span,
                labels=[Label(first.span, "first given here")],
                hint="within 0.5 mm, 2 deg",
            )
        within[dimension] = measure(quantity, dimension, "within", report, above=0)
    mesh = read_surface(MeshFile(of_type(path, Text), unit, at), loader, report)
    return None if mesh is None else Surface(mesh, within["length"], within["angle"], item.span)


def _tolerance(item: Item | None, report: Report) -> float:
    if item is None:
        return DEFAULT_UNIT_TOLERANCE
    quantity = of_type(item.values[0], Quantity)
    value = float(quantity.number)
    if not 0 < value <= 0.1:
        report.error(
            "E207",
            f"unit_tolerance is {quantity.number}; it must be more than 0 and at most 0.1",
            quantity.span,
        )
        return DEFAULT_UNIT_TOLERANCE
    return value


def _frame(item: Item | None, report: Report) -> WorkFrame | None:
    if item is None:
        return None
    number, placement = item.values
    stands = None
    if isinstance(placement, Placement):
        stands = pose(placement, "the part's frame", report)
    return WorkFrame(whole(number, "the frame's number", 1, 999, report), stands, item.span)


def resolve_tool(statement: Statement, loader: Loader, report: Report) -> Tool:
    """`tool NAME { number N  tcp (x, y, z) mm rotate …  body { … } }`."""
    fields = Fields(statement, report)
    number = fields.need("number", "number 1: the tool's number on the controller")
    tcp = fields.need("tcp", "tcp (x, y, z) mm: the tool centre point in flange coordinates")
    nowhere = Pose(np.eye(3), np.full(3, np.nan))
    mass, cog, body = fields.get("mass"), fields.get("cog"), fields.get("body")
    if body is not None and not body.items:
        report.error("E202", "this body has no solid", body.span, hint="leave it out, or fill it")
    return Tool(
        named(statement.name),
        1 if number is None else whole(number.values[0], "the tool's number", 1, 999, report),
        nowhere if tcp is None else pose(of_type(tcp.values[0], Placement), "tcp", report),
        None if mass is None else measure(mass.values[0], "mass", "mass", report, above=0),
        None if cog is None else lengths(of_type(cog.values[0], Numbers), "cog", report),
        () if body is None else convex_pieces(body.items, loader, report),
    )


def resolve_signals(statement: Statement, report: Report) -> dict[str, Signal]:
    """`io { ROLE output|input|analog NUMBER [full Q] [as "ALIAS"] … }`."""
    signals: dict[str, Signal] = {}
    for item in statement.items:
        role = item.key.text
        if role not in SIGNAL_ROLES:
            report.error(
                "E211",
                f'"{role}" is not a signal that a process uses',
                item.key.span,
                hint=did_you_mean(role, SIGNAL_ROLES),
            )
            continue
        if role in signals:
            report.error(
                "E201",
                f'"{role}" is given twice in io',
                item.key.span,
                labels=[Label(signals[role].span, "first given here")],
                hint="remove one of them",
            )
            continue
        signals[role] = _signal(item, report)
    return signals


def _signal(item: Item, report: Report) -> Signal:
    role = item.key.text
    kind, number, full, alias = item.values
    kind_word = of_type(kind, Word)
    if kind_word.text != SIGNAL_ROLES[role]:
        report.error(
            "E212",
            f"{role} is an {_SAID_KIND[SIGNAL_ROLES[role]]}, not an {_SAID_KIND[kind_word.text]}",
            kind_word.span,
            hint=f"{role} {SIGNAL_ROLES[role]} {of_type(number, Quantity).number}"
            + (" full …" if role in _FULL_SCALE else ""),
        )
    scale = None
    if role in _FULL_SCALE and kind_word.text == "analog":
        if full is None:
            report.error(
                "E213",
                f"{role} does not say what its full value stands for",
                item.key.span,
                hint="add: full 6000 rpm" if role == "spindle_speed" else "add: full 2000 N",
            )
        else:
            scale = measure(full, _FULL_SCALE[role], f"{role}'s full scale", report, above=0)
    elif full is not None:
        report.error(
            "E213",
            f"{role} is on or off; it has no full value",
            of_type(full, Quantity).span,
            hint="remove it",
        )
    name = alias.text if isinstance(alias, Text) else None
    if name is not None and not (name.isascii() and name.isidentifier() and len(name) <= 32):
        report.error(
            "E214",
            f'"{name[:40]}" cannot be a signal\'s name on a controller',
            of_type(alias, Text).span,
            hint="letters, digits and _, not beginning with a digit, at most 32 characters",
        )
        name = None
    signal_kind: Literal["input", "output", "analog"] = (
        "input"
        if kind_word.text == "input"
        else "output"
        if kind_word.text == "output"
        else "analog"
    )
    return Signal(
        role,
        signal_kind,
        whole(number, f"{role}'s number", 0, 4096, report),
        scale,
        name,
        item.span,
    )

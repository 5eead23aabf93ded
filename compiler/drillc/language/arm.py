"""Resolving `robot NAME arm { … }`: its model, where it stands, and what narrows its motion."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from drillc.catalogue.model import JOINT_NAMES, ArmModel
from drillc.geometry.shapes import RoundedHull
from drillc.kernels.arm import ArmGeometry
from drillc.language.arm_model import complete, resolve_model
from drillc.language.ast import Item, Numbers, Orientation, Placement, Quantity, Statement, Word
from drillc.language.bodies import convex_pieces
from drillc.language.diagnostics import Label, Report
from drillc.language.fields import (
    Fields,
    entries,
    in_unit,
    lengths,
    limit,
    measure,
    named,
    of_type,
    orientation,
    pose,
    whole,
)
from drillc.language.job import (
    Arm,
    AutoBase,
    Floats,
    Limit,
    Named,
    Station,
)
from drillc.language.loading import Loader
from drillc.language.units import UNITS, said

#: How far the wrist keeps from straight unless the arm says otherwise.
DEFAULT_SINGULAR_RAD = math.radians(2.0)
#: Parking places that `base auto` may try, and may end with.
MAX_BASE_PLACES = 10_000
MAX_AUTO_STATIONS = 16
#: The least step between the places that `base auto` tries.
LEAST_STEP_MM = 1.0
#: A joint's limits lie within this of zero, either way: ten turns.
MOST_TURNED_RAD = math.radians(3600.0)
#: Bodies of an arm: link 0 is its root, link i moves with joint i.
LINKS = len(JOINT_NAMES) + 1
#: Slack for comparing with a model's limits and speeds, and with home: the rounding of degrees.
_SLACK = 1e-9


def resolve_arm(statement: Statement, loader: Loader, report: Report) -> Arm:
    """`robot NAME arm { model M  base at …  … }`."""
    fields = Fields(statement, report, repeated=("station",))
    stated = _stated_limits(fields.get("limits"), report)
    speeds = _stated_speeds(fields.get("speeds"), report)
    model = resolve_model(fields, stated, speeds, report)
    if model is None:
        model = _any_model(statement.name.text)
    stations, auto = _places(fields, report)
    limits = _limits(model, stated, report)
    return Arm(
        name=named(statement.name),
        model=model,
        stations=stations,
        auto=auto,
        limits=limits,
        speeds=_speeds(model, fields.get("speeds"), speeds, report),
        home_rad=_home(fields.get("home"), limits, report),
        home_span=None if (home := fields.get("home")) is None else home.span,
        singular_rad=_singular(fields.get("singular"), report),
        links=_links(fields.get("links"), loader, report),
    )


def _any_model(name: str) -> ArmModel:
    """Stands in for a model that is an error, so that the rest can be checked."""
    none, turning = np.zeros(len(JOINT_NAMES)), np.full(len(JOINT_NAMES), math.inf)
    size = math.nan
    geometry = ArmGeometry(size, size, size, size, size, size, size, none, none + 1)
    return ArmModel(name, name, "other", geometry, -turning, turning, turning, "")


# ── joints ───────────────────────────────────────────────────────────────────────────────────────


def _stated_limits(item: Item | None, report: Report) -> dict[str, Limit]:
    limits = {}
    for name, entry in entries(item, JOINT_NAMES, "joint", report).items():
        found = limit(entry, "angle", report)
        if max(abs(found.low), abs(found.high)) > MOST_TURNED_RAD:
            report.error(
                "E206",
                f"the limits of {name} reach {_deg(max(-found.low, found.high))}; they must lie "
                f"within {_deg(MOST_TURNED_RAD)}, either way",
                entry.span,
            )
        limits[name] = found
    return limits


def _stated_speeds(item: Item | None, report: Report) -> dict[str, float]:
    found = entries(item, JOINT_NAMES, "joint", report)
    return {
        name: measure(entry.values[0], "turning speed", f"{name}'s speed", report, above=0)
        for name, entry in found.items()
    }


def _limits(model: ArmModel, stated: Mapping[str, Limit], report: Report) -> tuple[Limit, ...]:
    """The model's limits, narrowed by the spec's."""
    limits = []
    for name, low, high in zip(JOINT_NAMES, model.low_rad, model.high_rad, strict=True):
        narrowed = stated.get(name)
        if narrowed is None:
            limits.append(Limit(float(low), float(high), None))
            continue
        if narrowed.low < low - _SLACK or narrowed.high > high + _SLACK:
            report.error(
                "E259",
                f"{name} turns from {_deg(low)} to {_deg(high)}; {_deg(narrowed.low)} .. "
                f"{_deg(narrowed.high)} is more than a {model.name} can",
                narrowed.span,
                hint="limits may only be narrower than the model's",
            )
        limits.append(narrowed)
    return tuple(limits)


def _speeds(
    model: ArmModel, item: Item | None, stated: Mapping[str, float], report: Report
) -> Floats:
    """The model's full speeds, lowered by the spec's."""
    speeds = model.speed_rad_s.copy()
    for entry in item.items if item else ():
        name = entry.key.text
        if name not in stated:
            continue
        joint = JOINT_NAMES.index(name)
        if stated[name] > speeds[joint] * (1 + _SLACK):
            report.error(
                "E259",
                f"{name}'s speed is {_deg(stated[name])}/s; a {model.name} turns it with "
                f"{_deg(speeds[joint])}/s at most",
                entry.span,
                hint="speeds may only be lower than the model's",
            )
        speeds[joint] = min(speeds[joint], stated[name])
    return speeds


def _home(item: Item | None, limits: tuple[Limit, ...], report: Report) -> Floats | None:
    if item is None:
        return None
    found = entries(item, JOINT_NAMES, "joint", report)
    if not complete(item, found, JOINT_NAMES, "A1 0 deg  A2 -90 deg  …", report):
        return None
    home = np.array(
        [measure(found[n].values[0], "angle", f"home's {n}", report) for n in JOINT_NAMES]
    )
    for name, angle, within in zip(JOINT_NAMES, home, limits, strict=True):
        outside = angle < within.low - _SLACK or angle > within.high + _SLACK
        if outside and within.low < within.high:
            report.error(
                "E260",
                f"home's {name} is {_deg(angle)}, outside its limits {_deg(within.low)} .. "
                f"{_deg(within.high)}",
                found[name].span,
                labels=[Label(within.span, "its limits")] if within.span else [],
                hint="the programs begin and end there",
            )
    return home


def _singular(item: Item | None, report: Report) -> float:
    if item is None:
        return DEFAULT_SINGULAR_RAD
    quantity = of_type(item.values[0], Quantity)
    angle = measure(quantity, "angle", "singular", report, above=0)
    if angle >= math.pi / 2:
        report.error(
            "E206",
            f"singular is {quantity.number} {quantity.unit}; it must be less than 90 deg, else the "
            "wrist cannot bend",
            quantity.span,
        )
    return angle


def _deg(angle_rad: float) -> str:
    return f"{math.degrees(angle_rad):.6g} deg"


# ── where it stands ──────────────────────────────────────────────────────────────────────────────


def _places(fields: Fields, report: Report) -> tuple[tuple[Station, ...], AutoBase | None]:
    """Stations, or what is needed to find them."""
    base, named_places = fields.get("base"), fields.every("station")
    name = fields.statement.name
    if base is None and not named_places:
        report.error(
            "E261",
            f"robot {name.text} does not say where it stands",
            name.span,
            hint="base at (1500, 3000, 1500) mm rotate x 180 deg: its root in part coordinates",
        )
    elif base is not None and named_places:
        report.error(
            "E261",
            f"robot {name.text} has a base and stations",
            named_places[0].key.span,
            labels=[Label(base.span, "the base")],
            hint="name every parking place: station NAME at …; or leave the stations out",
        )
    stations = _stations(named_places, report)
    if base is None:
        return stations, None
    if len(base.values) > 1:
        return stations, _auto(base, report)
    where = pose(of_type(base.values[0], Placement), "the base", report)
    return stations or (Station(None, where, None, base.span),), None


def _stations(items: list[Item], report: Report) -> tuple[Station, ...]:
    stations: dict[str, Station] = {}
    first: dict[str, Named] = {}
    for item in items:
        word, number, placement = item.values
        name = named(of_type(word, Word))
        where = pose(of_type(placement, Placement), f"station {name.text}", report)
        frame = None
        if number is not None:
            frame = whole(number, f"the frame's number of station {name.text}", 1, 999, report)
        if name.text in stations:
            report.error(
                "E215",
                f"station {name.text} is declared twice",
                name.span,
                labels=[Label(first[name.text].span, "the first one")],
                hint="rename or remove one of them",
            )
        first.setdefault(name.text, name)
        stations.setdefault(name.text, Station(name, where, frame, item.span))
    return tuple(stations.values())


def _auto(item: Item, report: Report) -> AutoBase | None:
    first, second, unit, turned, step, most = item.values
    rotation = orientation(of_type(turned, Orientation), "the base", report)
    step_mm = measure(step, "length", "step", report, above=0)
    if step_mm < LEAST_STEP_MM:
        report.error(
            "E206",
            f"step is {step_mm:g} mm; it must be at least {LEAST_STEP_MM:g} mm",
            of_type(step, Quantity).span,
        )
    count = 1
    if most is not None:
        count = whole(most, "the number of stations", 1, MAX_AUTO_STATIONS, report)
    if not isinstance(unit, Word):
        report.error(
            "E203",
            f"the corners of base auto have no unit; they are {said('length')}",
            item.span,
            hint="write the unit behind both: within (…) (…) mm",
        )
        return None
    corner = lengths(in_unit(first, unit), "the base's corner", report)
    if UNITS[unit.text].dimension != "length":
        return None  # said once for both
    other = lengths(in_unit(second, unit), "the base's corner", report)
    low, high = np.minimum(corner, other), np.maximum(corner, other)
    auto = AutoBase(low, high, rotation, step_mm, count, item.span)
    _check_places(auto, of_type(first, Numbers), report)
    return auto


def _check_places(auto: AutoBase, corner: Numbers, report: Report) -> None:
    steps = np.floor((auto.high_mm - auto.low_mm) / max(auto.step_mm, LEAST_STEP_MM) + _SLACK) + 1
    places = float(np.prod(steps))
    if places > MAX_BASE_PLACES:
        report.error(
            "E270",
            f"{' x '.join(f'{n:.0f}' for n in steps)} = {places:,.0f} places are to be tried; the "
            f"limit (MAX_BASE_PLACES) is {MAX_BASE_PLACES:,}",
            auto.span,
            hint="widen the step, or narrow the box",
        )


# ── bodies ───────────────────────────────────────────────────────────────────────────────────────


def _links(
    item: Item | None, loader: Loader, report: Report
) -> tuple[tuple[RoundedHull, ...] | None, ...]:
    links: list[tuple[RoundedHull, ...] | None] = [None] * LINKS
    first: dict[int, Item] = {}
    for entry in item.items if item else ():
        before = len(report.diagnostics)
        number = whole(entry.values[0], "the link's number", 0, LINKS - 1, report)
        if len(report.diagnostics) > before:
            continue
        if number in first:
            report.error(
                "E201",
                f"link {number} is given twice in links",
                entry.span,
                labels=[Label(first[number].span, "first given here")],
                hint="put all its solids into one of them",
            )
        first.setdefault(number, entry)
        links[number] = convex_pieces(entry.items, loader, report)
    return tuple(links)

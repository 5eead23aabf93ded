"""Resolving `process` statements: what is done at a hole, and whether it makes sense."""

from __future__ import annotations

import math

from drillc.language.ast import Item, Quantity, Statement
from drillc.language.diagnostics import Report
from drillc.language.fields import Fields, measure, of_type
from drillc.language.job import Clamp, Countersink, Drill, Handshake, Process, Rivet
from drillc.language.units import UNITS, said

#: Speeds where a process states none: slow enough for a first run beside the machine (ISO 10218
#: allows 250 mm/s in reduced-speed mode).
TRAVEL_MM_S = 250.0
APPROACH_MM_S = 50.0
#: The feed begins this far before the surface unless the process says otherwise.
CLEARANCE_MM = 2.0
#: The least length (mm), speed (mm/s), spindle speed (rev/s) or time (s) of a process: what a
#: controller's three decimals can still tell from zero. A peck of 0.000 mm would never end.
SMALLEST = 1e-3
#: A region without a process: its holes are only visited, from this standoff.
VISIT_STANDOFF_MM = 50.0

VISIT = Process(
    name="visit",
    span=None,
    approach_mm=VISIT_STANDOFF_MM,
    clearance_mm=0.0,
    retract_mm=VISIT_STANDOFF_MM,
    travel_mm_s=TRAVEL_MM_S,
    approach_mm_s=APPROACH_MM_S,
    retract_mm_s=APPROACH_MM_S,
)


def resolve_process(statement: Statement, report: Report) -> Process:
    """`process NAME { approach …  retract …  … }`: drilling, riveting, or a mere visit."""
    fields = Fields(statement, report)
    approach = fields.measure("approach", "length", least=SMALLEST, hint="approach 60 mm")
    retract = fields.measure("retract", "length", least=SMALLEST, hint="retract 60 mm")
    drilling = [
        k for k in ("depth", "spindle", "feed", "peck", "dwell", "countersink") if fields.get(k)
    ]
    rivet = fields.get("rivet")
    if rivet and drilling:
        item = fields.get(drilling[0])
        report.error(
            "E231",
            f'process {statement.name.text} both drills ("{drilling[0]}") and rivets; it does one',
            item.span if item else statement.span,
            hint="make two processes and two regions",
        )
    drill = _drill(fields, report) if drilling and not rivet else None
    clearance = fields.measure(
        "clearance", "length", default=CLEARANCE_MM if drill else 0.0, least=0
    )
    for what, away in (("approach", approach), ("retract", retract)):
        if clearance >= away:
            item = fields.get("clearance") or fields.get(what)
            report.error(
                "E232",
                f"the clearance, {clearance:g} mm, is not less than the {what}, {away:g} mm",
                item.span if item else statement.span,
                hint="the feed begins at the clearance, between the standoff and the surface",
            )
    return Process(
        name=statement.name.text,
        span=statement.name.span,
        approach_mm=approach,
        clearance_mm=clearance,
        retract_mm=retract,
        travel_mm_s=fields.measure("travel", "speed", default=TRAVEL_MM_S, least=SMALLEST),
        approach_mm_s=_at(fields.get("approach"), APPROACH_MM_S, report),
        retract_mm_s=_at(fields.get("retract"), APPROACH_MM_S, report),
        clamp=_clamp(fields.get("clamp"), report),
        drill=drill,
        countersink=_countersink(fields.get("countersink"), drill is not None, report),
        rivet=None if rivet is None else Rivet(_handshake(rivet, 0, "rivet", report)),
    )


def _at(item: Item | None, default: float, report: Report) -> float:
    """The speed behind `approach 60 mm at …`."""
    if item is None or item.values[1] is None:
        return default
    return measure(item.values[1], "speed", f"{item.key.text}'s speed", report, least=SMALLEST)


def _drill(fields: Fields, report: Report) -> Drill:
    depth_item = fields.need("depth", "depth 12 mm; or depth stack + 2 mm")
    depth, from_stack = _depth(depth_item, report)
    spindle = fields.measure("spindle", "spindle speed", least=SMALLEST, hint="spindle 3000 rpm")
    feed = _feed(fields, spindle, report)
    peck = fields.measure("peck", "length", default=math.inf, least=SMALLEST)
    peck_item = fields.get("peck")
    if not from_stack and peck_item and peck > depth:
        report.error(
            "E233",
            f"a peck of {peck:g} mm is more than the depth, {depth:g} mm",
            peck_item.span,
            hint="leave the peck out, or make it smaller",
        )
    return Drill(
        spindle_rev_s=spindle,
        feed_mm_s=feed,
        depth_mm=depth,
        depth_from_stack=from_stack,
        peck_mm=None if math.isinf(peck) else peck,
        dwell_s=fields.measure("dwell", "time", default=0.0, least=SMALLEST),
    )


def _depth(item: Item | None, report: Report) -> tuple[float, bool]:
    if item is None:
        return math.nan, False
    if not item.items:
        return measure(item.values[0], "length", "depth", report, least=SMALLEST), False
    # The grammar gives `stack`, `stack PLUS quantity` or `stack quantity`.
    parts = [value for value in item.items[0].values if isinstance(value, Quantity)]
    if not parts:
        return 0.0, True
    extra = parts[0]
    if len([v for v in item.items[0].values if v is not None]) == 1 and extra.number[0] not in "+-":
        report.error(
            "E234",
            f"depth is the stack and {extra.number} {extra.unit or ''}".rstrip()
            + "; say whether that is added",
            extra.span,
            hint=f"depth stack + {extra.number} {extra.unit or 'mm'}",
        )
        return math.nan, True
    return measure(extra, "length", "depth beyond the stack", report), True


def _feed(fields: Fields, spindle_rev_s: float, report: Report) -> float:
    """Feed in mm/s, from mm/rev and the spindle or as a speed."""
    item = fields.need("feed", "feed 0.1 mm/rev; or feed 300 mm/min")
    if item is None:
        return math.nan
    quantity = of_type(item.values[0], Quantity)
    unit = UNITS.get(quantity.unit or "")
    if unit is not None and unit.dimension == "speed":
        return measure(quantity, "speed", "feed", report, least=SMALLEST)
    if unit is not None and unit.dimension == "feed per turn":
        feed = measure(quantity, "feed per turn", "feed", report, above=0) * spindle_rev_s
        if feed < SMALLEST:
            report.error(
                "E206",
                f"feed is {quantity.number} mm/rev, which at this spindle speed is {feed:g} mm/s; "
                f"it must be at least {SMALLEST:g} mm/s",
                quantity.span,
            )
        return feed
    wanted = f"{said('feed per turn')} or {said('speed')}"
    if unit is None:
        code, wrong = "E203", f"feed is {quantity.number} without a unit; it is {wanted}"
    else:
        what = f"{quantity.number} {quantity.unit} is {said(unit.dimension)}"
        code, wrong = "E204", f"feed is {wanted}, but {what}"
    report.error(code, wrong, quantity.span, hint="feed 0.1 mm/rev; or feed 300 mm/min")
    return math.nan


def _clamp(item: Item | None, report: Report) -> Clamp | None:
    if item is None:
        return None
    force = None
    if item.values[0] is not None:
        force = measure(item.values[0], "force", "clamp's force", report, least=SMALLEST)
    return Clamp(force, _handshake(item, 1, "clamp", report))


def _handshake(item: Item, at: int, what: str, report: Report) -> Handshake:
    timeout = measure(item.values[at], "time", f"{what}'s timeout", report, least=SMALLEST)
    return Handshake(timeout, item.span)


def _countersink(item: Item | None, drilling: bool, report: Report) -> Countersink | None:
    if item is None or not drilling:
        return None
    angle = measure(item.values[0], "angle", "countersink", report, above=0)
    if angle >= math.pi:
        report.error(
            "E235",
            f"a cone of {math.degrees(angle):g} deg is none; it must be less than 180 deg",
            item.span,
            hint="countersink 100 deg by 1.5 mm",
        )
    how = item.items[0] if item.items else None
    if how is None:
        report.error(
            "E236",
            "the countersink does not say how deep",
            item.span,
            hint="countersink 100 deg by 1.5 mm; or countersink 100 deg diameter 9.5 mm",
        )
        return None
    length = measure(how.values[0], "length", f"countersink {how.key.text}", report, least=SMALLEST)
    if how.key.text == "by":
        return Countersink(angle, length, None)
    return Countersink(angle, None, length)

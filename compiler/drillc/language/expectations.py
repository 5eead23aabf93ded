"""Resolving `expect`: what a spec says must come out, to be compared once it has."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from drillc.catalogue.model import JOINT_NAMES
from drillc.kernels.rotations import matrix_from_euler, matrix_from_quaternion
from drillc.language.ast import Item, Numbers, Quantity, Statement, Value, Word
from drillc.language.diagnostics import Report
from drillc.language.fields import did_you_mean, in_unit, lengths, measure, of_type, whole
from drillc.language.job import (
    PORTAL_JOINTS,
    ROTARY_JOINT,
    Arm,
    Expect,
    ExpectCount,
    ExpectJoints,
    ExpectPosition,
    ExpectRotation,
    Portal,
    Region,
)
from drillc.language.regions import Resolved
from drillc.language.units import UNITS, Dimension, convert, said


def resolve_expects(
    statements: Sequence[Statement],
    resolved: Resolved,
    robot: Portal | Arm | None,
    report: Report,
) -> tuple[Expect, ...]:
    """Each expectation with its hole's row and its values in mm and radians.

    While not all holes are known, one that is not found is no mistake of the expectation.
    """
    if not statements:
        return ()
    holes = resolved.holes
    wanted = {s.name.text for s in statements}
    found = np.flatnonzero(np.isin(holes.ids, sorted(wanted)))
    rows = {str(holes.ids[row]): row for row in found.tolist()}
    expects = []
    for statement in statements:
        item = statement.items[0]
        if item.key.text == "expect_holes":
            expect = _count(statement, item, resolved.regions, report)
        else:
            row = rows.get(statement.name.text)
            if row is None and not resolved.complete:
                continue
            if row is None:
                report.error(
                    "E210",
                    f'there is no hole called "{statement.name.text}"',
                    statement.name.span,
                    hint=did_you_mean(statement.name.text, holes.ids[:2000].tolist()),
                )
                continue
            expect = _of_hole(row, statement, item, robot, report)
        if expect is not None:
            expects.append(expect)
    return tuple(expects)


def _count(
    statement: Statement, item: Item, regions: Sequence[Region], report: Report
) -> Expect | None:
    names = [region.name.text for region in regions]
    if statement.name.text not in names:
        report.error(
            "E210",
            f'there is no region called "{statement.name.text}"',
            statement.name.span,
            hint=did_you_mean(statement.name.text, names),
        )
        return None
    count = whole(item.values[0], "the number of holes", 0, 1_000_000_000, report)
    return ExpectCount(names.index(statement.name.text), count, statement.span)


def _of_hole(
    row: int, statement: Statement, item: Item, robot: Portal | Arm | None, report: Report
) -> Expect | None:
    span = statement.span
    match item.key.text:
        case "expect_euler":
            sequence, triple, unit, within = item.values
            rotation = _euler(of_type(sequence, Word), of_type(triple, Numbers), unit, report)
            tolerance = measure(within, "angle", "within", report, above=0)
            return None if rotation is None else ExpectRotation(row, rotation, tolerance, span)
        case "expect_quaternion":
            *numbers, within = item.values
            quaternion = np.array([float(of_type(n, Quantity).number) for n in numbers])
            tolerance = measure(within, "angle", "within", report, above=0)
            length = math.hypot(*quaternion)
            if not abs(length - 1) < 1e-3:
                report.error(
                    "E251",
                    f"this quaternion (w, x, y, z) has length {length:.6g}, not 1",
                    item.span,
                    hint="divide each number by the length",
                )
                return None
            return ExpectRotation(row, matrix_from_quaternion(quaternion), tolerance, span)
        case "expect_at":
            triple, unit, within = item.values
            position = lengths(in_unit(triple, unit), "the position", report)
            tolerance = measure(within, "length", "within", report, above=0)
            return ExpectPosition(row, position, tolerance, span)
        case _:
            return _joints(row, statement, item, robot, report)


def _euler(sequence: Word, triple: Numbers, unit: object, report: Report) -> np.ndarray | None:
    letters = sequence.text
    if (
        len(letters) != 3
        or set(letters) - set("xyz")
        or letters[0] == letters[1]
        or (letters[1] == letters[2])
    ):
        report.error(
            "E250",
            f'"{letters}" is not a sequence of rotation axes',
            sequence.span,
            hint="zyx means R = Rz(first) Ry(second) Rx(third)",
        )
        return None
    name = unit.text if isinstance(unit, Word) else None
    if name is None or UNITS[name].dimension != "angle":
        wrong = "no unit" if name is None else f"{said(UNITS[name].dimension)}, {name}"
        report.error(
            "E203" if name is None else "E204",
            f"Euler angles need {said('angle')} behind the parenthesis; there is {wrong}",
            triple.span,
            hint=f"({', '.join(triple.numbers)}) deg",
        )
        return None
    angles = np.array([convert(n, UNITS[name]) for n in triple.numbers])
    if not np.isfinite(angles).all() or float(np.abs(angles).max()) > 1e6:
        report.error(
            "E205",
            "these angles are beyond any turn (the limit is 1e+06 rad)",
            triple.span,
            hint="check the decimal point and the exponent",
        )
        return None
    return matrix_from_euler(angles, letters)


def _joints(
    row: int, statement: Statement, item: Item, robot: Portal | Arm | None, report: Report
) -> Expect | None:
    if robot is None:
        report.error(
            "E252",
            "joints are expected, but the spec has no robot",
            statement.span,
            hint="declare one: robot NAME arm { … }; or robot NAME portal { … }",
        )
        return None
    *values, first, second = item.values
    names = JOINT_NAMES if isinstance(robot, Arm) else PORTAL_JOINTS
    if len(values) != len(names):
        report.error(
            "E253",
            f"{len(values)} joints are given; robot {robot.name.text} has {len(names)}",
            item.span,
            hint=f"({', '.join(names)}), each with its unit",
        )
        return None
    turning = [isinstance(robot, Arm) or name == PORTAL_JOINTS[ROTARY_JOINT] for name in names]
    joints = np.array(
        [
            measure(value, "angle" if turns else "length", name, report)
            for value, name, turns in zip(values, names, turning, strict=True)
        ]
    )
    within = _joint_tolerances(item, first, second, all(turning), report)
    return None if within is None else ExpectJoints(row, joints, *within, statement.span)


def _joint_tolerances(
    item: Item, first: Value, second: Value, angles_only: bool, report: Report
) -> tuple[float, float] | None:
    """A tolerance for lengths (infinite where no joint slides) and one for angles."""
    within = {"length": math.inf, "angle": math.inf}
    for tolerance in (first, second):
        if tolerance is None:
            continue
        quantity = of_type(tolerance, Quantity)
        unit = UNITS.get(quantity.unit or "")
        turns = angles_only or (unit is not None and unit.dimension == "angle")
        kind: Dimension = "angle" if turns else "length"
        within[kind] = measure(quantity, kind, "within", report, above=0)
    if within["angle"] == math.inf or (within["length"] == math.inf and not angles_only):
        report.error(
            "E254",
            "joints need a tolerance for lengths and one for angles",
            item.span,
            hint="within 0.1 mm, 0.01 deg",
        )
        return None
    return within["length"], within["angle"]

"""Whether the arm may stand where it is parked, and wait at its home."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from drillc.language.diagnostics import Label, Report
from drillc.language.job import Floats
from drillc.planning.cell import LEAST_GAP_MM, TOOL, Cell, Guard, Mover


def check_standing(cell: Cell, report: Report) -> bool:
    """Report a root that stands in a fixture, or a home whose links or tool do. True: neither."""
    resting = list(_resting(cell))
    bad = {guard.name: _meeting(guard, resting) for guard in cell.guards}
    for name, met in bad.items():
        roots = [gap_mm for mover, gap_mm in met if mover.link == 0]
        others = [(mover.name, gap_mm) for mover, gap_mm in met if mover.link > 0]
        if roots:
            report.error(
                "E413",
                f"where the arm is parked, its root {_how(roots[0])} {name} (it keeps "
                f"{LEAST_GAP_MM:g} mm)",
                cell.station.span,
                hint="park the arm elsewhere, or move the fixture",
            )
        elif others:
            first, gap_mm = min(others, key=lambda other: other[1])
            more = [other for other, _ in others if other != first]
            report.error(
                "E414",
                f"at home, {first} {_how(gap_mm)} {name} (it keeps {LEAST_GAP_MM:g} mm)"
                + (f"; likewise {', '.join(more)}" if more else ""),
                cell.arm.home_span,
                labels=[Label(cell.station.span, "parked here")],
                hint="choose another home, or park the arm elsewhere",
            )
    return not any(bad.values())


def _meeting(
    guard: Guard, resting: list[tuple[Mover, Floats, Floats]]
) -> list[tuple[Mover, float]]:
    """What does not keep the least gap from a guard, and how near it is."""
    return [
        (mover, guard.obstacles.gap_mm(mover.probe(0.0), rotation, origin_mm)[0])
        for mover, rotation, origin_mm in resting
        if not _clear(mover, guard, rotation, origin_mm[None])[0]
    ]


def _how(gap_mm: float) -> str:
    return "stands in" if gap_mm <= 0 else f"is only {gap_mm:.1f} mm from"


def stands_clear(cell: Cell, move_mm: Floats) -> NDArray[np.bool_]:
    """Whether the arm could stand `move_mm` (p, 3) away and wait at its home there: (p,)."""
    clear = np.ones(len(move_mm), dtype=np.bool_)
    for mover, rotation, origin_mm in _resting(cell):
        for guard in cell.guards:
            some = np.flatnonzero(clear)
            clear[some] = _clear(mover, guard, rotation, origin_mm + move_mm[some])
    return clear


def _resting(cell: Cell) -> Iterator[tuple[Mover, Floats, Floats]]:
    """What stands still between programs, with rotation (3, 3) and origin (3,): the root, and where
    the arm has a home all else."""
    home = cell.arm.home_rad
    joints = np.zeros((1, 6)) if home is None else home[None]
    rotation, origin_mm = cell.link_poses(joints)
    tool_rotation, tool_mm = cell.tool_pose(joints)
    for mover in cell.movers:
        if home is None and mover.link > 0:
            continue
        if mover.link == TOOL:
            yield mover, tool_rotation[0], tool_mm[0]
        else:
            yield mover, rotation[0, mover.link], origin_mm[0, mover.link]


def _clear(mover: Mover, guard: Guard, rotation: Floats, origin_mm: Floats) -> NDArray[np.bool_]:
    """Whether the body keeps the least gap from the guard with its origin at each of (p, 3)."""
    turned = np.broadcast_to(rotation, (len(origin_mm), 3, 3))
    return guard.obstacles.clear(mover.probe(LEAST_GAP_MM), turned, origin_mm)

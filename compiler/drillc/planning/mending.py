"""The nearest things that would let a hole be made: each is tried before it is offered."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np

from drillc.language.job import Floats
from drillc.planning.cell import LEAST_GAP_MM, Cell
from drillc.planning.cycle_check import Candidates, Cycles, assess
from drillc.planning.headings import preferred, turned
from drillc.planning.moves import FINE
from drillc.planning.reach import as_if_moved, moved
from drillc.planning.standing import stands_clear
from drillc.planning.tool_sweeps import ToolSweeps, make_tool_sweeps

#: How far the base is moved, at the most, and the ways: along the part's axes and between them.
_BASE_MOVES_MM = (50.0, 100.0, 200.0, 400.0, 800.0, 1600.0, 3200.0)
_WAYS = [np.array(way, dtype=float) for way in product((-1, 0, 1), repeat=3) if any(way)]
#: What the search for headings may take beyond the figures found at single headings.
_MORE_DEG = (0.0, 0.5, 1.0, 2.0, 5.0)
_LESS_MM = (0.0, 1.0, 2.0)
#: More headings than a hole has.
_ALL = 1000
#: Moves of the base that are tried on every hole made from there.
_TRIALS = 3
#: Headings at which a smaller clearance, or another place, is tried first.
_HEADINGS_RAD = math.radians(15.0)


def find_mends(
    cell: Cell, cycles: Cycles, sweeps: ToolSweeps, row: int, turning_rad: Floats
) -> str | None:
    """For hole `row`, which cannot be made within its turning (n,): a wider turning, a smaller
    clearance, another place of the base; None if none of them serves."""
    within = float(turning_rad[row])
    offers = [
        _wider(cell, cycles, sweeps, row, within),
        _nearer(cell, cycles, sweeps, row, within),
        _moved(cell, cycles, sweeps, row, turning_rad),
    ]
    return "; or ".join(offer for offer in offers if offer) or None


def ways_of(
    cell: Cell, cycles: Cycles, sweeps: ToolSweeps, row: int, turning_rad: float
) -> Candidates:
    """The candidates of one hole, as the solver seeks them."""
    rows = np.array([row])
    first = preferred(cell, cycles, sweeps, rows)
    if len(first) or turning_rad == 0:
        return first
    return turned(cell, cycles, sweeps, rows, np.array([turning_rad]))


def headings_of(cycles: Cycles, sweeps: ToolSweeps, row: int, turning_rad: float) -> Floats:
    """All headings (k,) of one hole that a sequence can choose among."""
    rows, cell = np.array([row]), sweeps.cell
    found = [preferred(cell, cycles, sweeps, rows)]
    if turning_rad > 0:
        turning = np.array([turning_rad])
        found.append(turned(cell, cycles, sweeps, rows, turning, enough=_ALL))
    return np.unique(np.concatenate([each.heading_rad for each in found]))


def _wider(
    cell: Cell, cycles: Cycles, sweeps: ToolSweeps, row: int, turning_rad: float
) -> str | None:
    """The least turning that serves, to a degree."""
    if turning_rad >= math.pi:
        return None
    found = ways_of(cell, cycles, sweeps, row, math.pi)
    if not len(found):
        return None
    # A little more than the exact figure: the search needs room to prove that a heading is free.
    least = math.ceil(2 * math.degrees(np.abs(found.heading_rad).min()) + 0.5) / 2
    for more in _MORE_DEG:
        wider = min(least + more, 180.0)
        if len(ways_of(cell, cycles, sweeps, row, math.radians(wider))):
            return f"turning within {wider:g} deg would do"
    return None


def _nearer(
    cell: Cell, cycles: Cycles, sweeps: ToolSweeps, row: int, turning_rad: float
) -> str | None:
    """The greatest clearance, to a millimetre, with which one body that is avoided is no longer in
    the way; of several bodies, the one that gives up least."""
    region = int(cycles.region[row])
    offers: list[tuple[float, str]] = []
    for which, guard in enumerate(cell.guards):
        asked_mm = float(guard.clearance_mm[region])
        if not math.isfinite(asked_mm) or asked_mm <= LEAST_GAP_MM:
            continue
        kept_mm = _greatest_kept(cell, cycles, which, row, turning_rad)
        if kept_mm is not None:
            name = guard.name.partition(" ")[2]
            offers.append((asked_mm - kept_mm, f"avoid {name} clearance {kept_mm:g} mm would do"))
    return min(offers, default=(0.0, None))[1]


def _greatest_kept(
    cell: Cell, cycles: Cycles, which: int, row: int, turning_rad: float
) -> float | None:
    """The greatest clearance from one guard that lets the hole be made, by halving."""
    region = int(cycles.region[row])
    headings_rad = _headings(turning_rad)
    rows = np.full(len(headings_rad), row)

    def works(kept_mm: float) -> bool:
        smaller = _keeping(cell, which, region, kept_mm)
        clear = make_tool_sweeps(smaller, cycles).clear(rows, headings_rad)
        found = assess(smaller, cycles, rows[clear], headings_rad[clear])
        return bool((found.cause == FINE).any())

    low, high = LEAST_GAP_MM, float(cell.guards[which].clearance_mm[region])
    if not works(low):
        return None
    while high - low > 1.0:
        middle = float(math.floor(0.5 * (low + high))) if high - low > 2.0 else low + 1.0
        low, high = (middle, high) if works(middle) else (low, middle)
    for kept_mm in np.unique([max(LEAST_GAP_MM, low - less) for less in _LESS_MM])[::-1].tolist():
        smaller = _keeping(cell, which, region, kept_mm)
        if len(ways_of(smaller, cycles, make_tool_sweeps(smaller, cycles), row, turning_rad)):
            return float(kept_mm)
    return None


def _headings(turning_rad: float) -> Floats:
    """Some headings within the turning, its ends among them."""
    away = np.minimum(np.arange(0.0, turning_rad + _HEADINGS_RAD, _HEADINGS_RAD), turning_rad)
    return np.unique([*away, *-away])


def _keeping(cell: Cell, which: int, region: int, kept_mm: float) -> Cell:
    """The same cell, with another clearance of one guard in one region."""
    guards = list(cell.guards)
    clearance_mm = guards[which].clearance_mm.copy()
    clearance_mm[region] = kept_mm
    guards[which] = replace(guards[which], clearance_mm=clearance_mm)
    return replace(cell, guards=tuple(guards))


def _moved(
    cell: Cell, cycles: Cycles, sweeps: ToolSweeps, row: int, turning_rad: Floats
) -> str | None:
    """The nearest move of the base with which the arm makes this hole, and, if one is found soon,
    all that are made from there."""
    bare = replace(cell, guards=())
    if len(ways_of(bare, cycles, make_tool_sweeps(bare, cycles), row, float(turning_rad[row]))):
        return None  # it is not the arm's reach that fails
    alone: str | None = None
    trials = 0
    for move_mm in _moves(bare, cycles, sweeps, row, float(turning_rad[row])):
        there = moved(cell, move_mm)
        swept = replace(sweeps, cell=there)
        if not stands_clear(there, np.zeros((1, 3)))[0] or not len(
            ways_of(there, cycles, swept, row, float(turning_rad[row]))
        ):
            continue
        plain = ", ".join(f"{value + 0.0:g}" for value in move_mm.tolist())
        if _all_solve(there, cycles, swept, turning_rad):
            return f"with the base moved by ({plain}) mm, the arm would reach it and all others"
        alone = alone or (
            f"with the base moved by ({plain}) mm, the arm would reach it, though not all others: "
            "give it a station of its own"
        )
        trials += 1
        if trials == _TRIALS:
            break
    return alone


def _moves(
    bare: Cell, cycles: Cycles, sweeps: ToolSweeps, row: int, turning_rad: float
) -> list[Floats]:
    """Moves of the base (3,), shortest first, from which the arm reaches the hole at some heading
    that keeps the tool clear; what is in the arm's own way is not looked at."""
    headings = _headings(turning_rad)
    headings = headings[sweeps.clear(np.full(len(headings), row), headings)]
    moves_mm = np.array(
        [np.round(way / np.linalg.norm(way) * far) for far in _BASE_MOVES_MM for way in _WAYS]
    )
    move, heading = np.divmod(np.arange(len(moves_mm) * len(headings)), max(1, len(headings)))
    seen = as_if_moved(cycles, np.full(len(move), row), moves_mm[move])
    fine = assess(bare, seen, np.arange(len(move)), headings[heading]).cause == FINE
    return [moves_mm[i] for i in np.unique(move[fine.any(axis=1)])]


def _all_solve(cell: Cell, cycles: Cycles, sweeps: ToolSweeps, turning_rad: Floats) -> bool:
    """Whether every hole has some way to be made; a few are tried first, since one settles it."""
    start, size = 0, 32
    while start < len(cycles):
        rows = np.arange(start, min(start + size, len(cycles)))
        rest = np.setdiff1d(rows, preferred(cell, cycles, sweeps, rows).row)
        if not (turning_rad[rest] > 0).all():
            return False
        if len(rest):
            found = turned(cell, cycles, sweeps, rest, turning_rad[rest])
            if len(np.unique(found.row)) < len(rest):
                return False
        start, size = start + size, 4 * size
    return True

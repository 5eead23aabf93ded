"""What is between the holes, and how fast the tool travels there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drillc.language.source import Span

from .case import NOISE_SHARE, Case
from .events import Floats
from .expected import SAME_MM
from .vectors import length
from .verdict import Rows
from .visits import Bools, Path

#: An arm's step on a straight way lasts at least so long, and its time is printed so exactly.
LEAST_STEP_S, STEP_TIME_S = 1e-3, 0.5e-6


@dataclass(frozen=True, eq=False)
class Legs:
    """What is between m cores, and after the last: leg i is the events `start[i]` … `stop[i]`, of
    which the last is the arrival at the core of visit i (at the end there is none). `hole` (m,) is
    that visit's, n at the end. Event `start[i] - 1` is where the tool was before, if `known`."""

    start: Rows
    stop: Rows
    hole: Rows
    known: bool

    def __len__(self) -> int:
        return len(self.start)


def travel_speeds_fit(case: Case, found_mm_s: Floats) -> Bools:
    """Which speeds are those at which some process of the program travels; NaN is not stated."""
    asked = np.array([cycle.process.travel_mm_s for cycle in case.program.cycles])
    fits = np.abs(found_mm_s[:, None] / asked - 1.0) <= case.limits.speeds(asked)
    return np.asarray(fits.any(axis=1) | np.isnan(found_mm_s), dtype=np.bool_)


def check_travel_speeds(case: Case, path: Path, event: Rows, hole: Rows) -> None:
    """On straight ways the tool is as fast as some process of the program travels; an arm that goes
    by its joints is slower where they are no faster. Speeds that are not stated are not judged."""
    found = path.speed_mm_s[event]
    asked = np.array([cycle.process.travel_mm_s for cycle in case.program.cycles])
    before = np.maximum(path.before[event], 0)
    way = length(path.places.position_mm[event] - path.places.position_mm[before])
    told = np.isfinite(found) & ~((way < SAME_MM) & (path.before[event] >= 0))
    event, hole, before = event[told], hole[told], before[told]
    found, way = found[told], way[told]
    if not len(event):
        return
    ideal = np.repeat(asked[None], len(event), axis=0)
    if case.arm_by_joints:
        turned = np.abs(path.places.joints[event] - path.places.joints[before])
        seconds = np.maximum((turned / case.program.arm.arm.speeds).max(axis=1), LEAST_STEP_S)  # type: ignore[union-attr]
        ideal = np.minimum(ideal, (way / seconds)[:, None])
    apart = np.abs(found[:, None] / ideal - 1.0)
    least = apart.argmin(axis=1)
    rows = np.arange(len(event))
    limit = case.limits.speeds(asked)[least] + path.speed_slack[event]
    if case.arm_by_joints:
        limit = path.speed_slack[event] + STEP_TIME_S * found / way + NOISE_SHARE

    def say(k: int) -> tuple[str, Span | None]:
        process = case.wanted.process(int(hole[k]))
        return (
            f"the way to or from {case.hole(int(hole[k]))} is made with {found[k]:g} mm/s, the spec"
            f" asks for {process.travel_mm_s:g} mm/s",
            process.span,
        )

    case.figures("speed", apart[rows, least], limit, path, event, hole, say)

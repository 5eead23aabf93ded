"""`drillc explain`: one hole, heading by heading: what is in the way, and what was chosen."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

import numpy as np

from drillc.catalogue.model import JOINT_NAMES
from drillc.driver import Progress, quiet, read_job
from drillc.kernels.posture import heading_turn_rad
from drillc.language.diagnostics import Diagnostic, Report, as_json, printable
from drillc.language.fields import did_you_mean
from drillc.language.job import (
    Arm,
    Floats,
    Job,
)
from drillc.planning.arm_joints import ArmSolution, solve_arm
from drillc.planning.cell import Cell, make_cells
from drillc.planning.cycle_check import Cycles, make_cycles
from drillc.planning.depths import plunge_depths
from drillc.planning.explain import HeadingLine, explain, headings_within, judge
from drillc.planning.mending import headings_of
from drillc.planning.parking import park
from drillc.planning.postures import resolve_postures
from drillc.planning.tool_sweeps import ToolSweeps, make_tool_sweeps

#: Lines are cut at this length.
WIDTH = 100
#: Headings beyond the turning stand this far apart.
BEYOND_RAD = math.radians(15.0)
#: Reasons why nothing is chosen that are shown.
_REASONS = 3


class NotExplained(Exception):  # noqa: N818  (a wrong question, no error of the program)
    """There is no such hole, or no arm to make it."""


@dataclass(frozen=True)
class Neighbour:
    """The hole before or after in the same region: the turn about the tool's axis to it (from it)
    is the least |turn_rad ± (heading - one of headings_rad)|."""

    name: str
    turn_rad: float
    sign: int
    headings_rad: tuple[float, ...]

    def jump_rad(self, heading_rad: float) -> float:
        """The least turn between this hole at a heading and that one."""
        turns = self.turn_rad + self.sign * (heading_rad - np.array(self.headings_rad))
        return float(np.abs((turns + math.pi) % (2 * math.pi) - math.pi).min())


@dataclass(frozen=True, eq=False)
class Explained:
    """What there is to say about hole `row`. `solution` is None where the spec does not compile;
    `refused` then says why. `lines` go from the least heading to the greatest."""

    job: Job
    cell: Cell
    row: int
    lines: tuple[HeadingLine, ...]
    neighbours: tuple[Neighbour, ...]
    summary: str
    mend: str | None
    solution: ArmSolution | None
    refused: tuple[Diagnostic, ...]

    @property
    def turning_rad(self) -> float:
        return self.job.regions[int(self.job.holes.region[self.row])].turning_rad

    @property
    def chosen_rad(self) -> float | None:
        return None if self.solution is None else float(self.solution.heading_rad[self.row])

    def verdict(self, line: HeadingLine) -> str:
        """What becomes of a heading, in a word or two."""
        if line.heading_rad == self.chosen_rad:
            return "chosen"
        if abs(line.heading_rad) > self.turning_rad + 1e-9:
            return "not allowed"
        return "blocked" if not line.works or self.leap(line) else "works"

    def leap(self, line: HeadingLine) -> tuple[Neighbour, float] | None:
        """The neighbour to which the heading would jump by more than it may, and by how much."""
        most = self.job.heading_jump_max_rad
        jumps = [(each, each.jump_rad(line.heading_rad)) for each in self.neighbours]
        over = [one for one in jumps if most is not None and one[1] > most + 1e-9]
        return max(over, key=lambda one: one[1], default=None)


def explain_hole(
    path: Path, root: Path | None, hole: str, report: Report, progress: Progress = quiet
) -> Explained:
    """Look at one hole of a spec, which need not compile. Raises `Refused` where it cannot be read,
    or its rules decide nothing, and `NotExplained` where there is nothing to explain."""
    job = read_job(path, root, report, progress)
    row, arm = _find(job, hole)
    depth_mm = plunge_depths(job, report)
    preferred = resolve_postures(job, report)
    report.stop_if_failed()
    job, arm = park(job, arm, preferred, depth_mm, report, progress)
    trial = Report()
    solution = solve_arm(job, arm, preferred, depth_mm, trial, progress)
    station = job.regions[int(job.holes.region[row])].station
    station_of = np.array([region.station for region in job.regions])[job.holes.region]
    rows = np.flatnonzero(station_of == station)
    cell = make_cells(job, arm)[station]
    cycles = make_cycles(job, rows, preferred, depth_mm)
    sweeps = make_tool_sweeps(cell, cycles)
    turning_rad = np.array([region.turning_rad for region in job.regions])[cycles.region]
    at = int(np.searchsorted(rows, row))
    said = explain(cell, cycles, sweeps, at, turning_rad)
    chosen = None if solution is None else float(solution.heading_rad[row])
    return Explained(
        job,
        cell,
        row,
        judge(cell, cycles, sweeps, at, _headings(float(turning_rad[at]), chosen)),
        _neighbours(job, cycles, sweeps, at, rows, turning_rad, solution),
        said.summary,
        said.mend,
        solution,
        tuple(d for d in trial.diagnostics if d.severity == "error"),
    )


def _find(job: Job, hole: str) -> tuple[int, Arm]:
    if not isinstance(job.robot, Arm):
        raise NotExplained(
            "only an arm chooses headings, and the spec has none: robot NAME arm { … }"
        )
    found = np.flatnonzero(job.holes.ids == hole)
    if not len(found):
        near = did_you_mean(hole, map(str, job.holes.ids.tolist()))
        raise NotExplained(f'there is no hole "{hole}"' + (f"; {near}" if near else ""))
    return int(found[0]), job.robot


def _headings(turning_rad: float, chosen_rad: float | None) -> Floats:
    """Those within the turning, the chosen one, and a coarse picture of those that are not allowed,
    from the least to the greatest."""
    beyond = headings_within(math.pi, BEYOND_RAD)
    beyond = beyond[np.abs(beyond) > turning_rad + 1e-9]
    chosen = [] if chosen_rad is None else [chosen_rad]
    return np.unique(np.concatenate([headings_within(turning_rad), beyond, chosen]))


def _neighbours(
    job: Job,
    cycles: Cycles,
    sweeps: ToolSweeps,
    at: int,
    rows: np.ndarray,
    turning_rad: Floats,
    solution: ArmSolution | None,
) -> tuple[Neighbour, ...]:
    """The holes before and after, at their chosen headings or, where none is chosen, at all that
    they could have. None where jumps are not limited."""
    if job.heading_jump_max_rad is None:
        return ()
    found = []
    for other, first, sign in ((at - 1, at - 1, 1), (at + 1, at, -1)):
        if not 0 <= other < len(rows) or cycles.region[other] != cycles.region[at]:
            continue
        if solution is None:
            headings = headings_of(cycles, sweeps, other, float(turning_rad[other]))
        else:
            headings = solution.heading_rad[rows[other : other + 1]]
        if len(headings):
            turn = float(heading_turn_rad(cycles.rotation[first : first + 2])[0])
            name = str(job.holes.ids[rows[other]])
            found.append(Neighbour(name, turn, sign, tuple(headings.tolist())))
    return tuple(found)


# ── saying ───────────────────────────────────────────────────────────────────────────────────────


def write_explanation(explained: Explained, form: str, out: TextIO) -> None:
    """Write it in the form `text` or `json`."""
    if form == "json":
        out.write(json.dumps(_as_json(explained), indent=2) + "\n")
        return
    for line in _as_text(explained):
        out.write(printable(line if len(line) <= WIDTH else line[: WIDTH - 1] + "…") + "\n")


def _as_text(explained: Explained) -> list[str]:
    job, row = explained.job, explained.row
    holes, region = job.holes, job.regions[int(job.holes.region[row])]
    span = holes.span(row)
    x, y, z = holes.position_mm[row].tolist()
    name = explained.cell.station.name
    place = "" if name is None else f", made from station {name.text}"
    rule = f"turning within {math.degrees(explained.turning_rad):g} deg"
    if job.heading_jump_max_rad is not None:
        rule += f", heading_jump max {math.degrees(job.heading_jump_max_rad):g} deg"
    kept = [
        f"{guard.name} by {guard.clearance_mm[holes.region[row]]:g} mm"
        for guard in explained.cell.guards
        if np.isfinite(guard.clearance_mm[holes.region[row]])
    ]
    lines = [
        f"hole {holes.ids[row]} of region {region.name.text}{place}",
        f"  {span.source.shown}:{span.line}",
        f"  at ({x:g}, {y:g}, {z:g}) mm, {rule}",
        *([f"  keeps away from {', '.join(kept)}"] if kept else []),
        *_wrapped(explained.summary, "  "),
        *_chosen(explained),
        "",
        *_table(explained),
    ]
    if explained.mend:
        lines += ["", *_wrapped(f"hint: {explained.mend}", "")]
    return lines


def _chosen(explained: Explained) -> list[str]:
    solution, row = explained.solution, explained.row
    if solution is None:
        here = explained.job.holes.span(row)
        reasons = [d for d in explained.refused if d.code != "E410" or d.span != here]
        if not reasons:
            return ["", "nothing is chosen: no heading that is allowed works"]
        lines = ["", "nothing is chosen, because the spec does not compile:"]
        for diagnostic in reasons[:_REASONS]:
            lines += _wrapped(f"{diagnostic.code}: {diagnostic.message}", "  ")
        more = len(reasons) - _REASONS
        return lines + ([f"  … and {more} more"] if more > 0 else [])
    joints = np.degrees(solution.joints[row]).tolist()
    said = "  ".join(f"{n} {q:.3f}" for n, q in zip(JOINT_NAMES, joints, strict=True))
    return [
        "",
        f"chosen: heading {math.degrees(solution.heading_rad[row]):.2f} deg, branch "
        f"{solution.branch[row]}, margin {solution.margin[row]:.3f}",
        f"  {said} deg",
    ]


def _table(explained: Explained) -> list[str]:
    """One row for each heading."""
    titles = ("heading", "verdict", "tool", "arm")
    jumps = bool(explained.neighbours)
    rows = [(*titles, "jump") if jumps else titles]
    for line in explained.lines:
        degrees = math.degrees(line.heading_rad)
        cells = (
            f"{degrees + 0.0:.2f}".rstrip("0").rstrip("."),
            explained.verdict(line),
            "clear" if line.tool is None else line.tool.brief,
            f"branch {_listed(line.branches)}" if line.arm is None else line.arm.brief,
        )
        rows.append((*cells, _jump(explained, line)) if jumps else cells)
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        f"{cells[0].rjust(widths[0])}  "
        + "  ".join(c.ljust(w) for c, w in zip(cells[1:], widths[1:], strict=True)).rstrip()
        for cells in rows
    ]


def _jump(explained: Explained, line: HeadingLine) -> str:
    """The greatest turn to a neighbour; to which, where it is too great."""
    leap = explained.leap(line)
    if leap is not None:
        return f"{math.degrees(leap[1]):.1f} deg to {leap[0].name}"
    most = max(each.jump_rad(line.heading_rad) for each in explained.neighbours)
    return f"{math.degrees(most):.1f} deg"


def _listed(branches: tuple[int, ...]) -> str:
    return ", ".join(map(str, branches))


def _wrapped(text: str, indent: str) -> list[str]:
    """A sentence over several lines."""
    import textwrap

    return textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=indent + "  ")


def _as_json(explained: Explained) -> dict[str, object]:
    job, row, solution = explained.job, explained.row, explained.solution
    station, jump = explained.cell.station.name, job.heading_jump_max_rad
    region = int(job.holes.region[row])
    chosen = None
    if solution is not None:
        chosen = {
            "heading_deg": _degrees(float(solution.heading_rad[row])),
            "branch": int(solution.branch[row]),
            "joints_deg": [_degrees(q) for q in solution.joints[row].tolist()],
            "margin": float(solution.margin[row]),
        }
    return {
        "hole": str(job.holes.ids[row]),
        "region": job.regions[region].name.text,
        "station": None if station is None else station.text,
        "position_mm": job.holes.position_mm[row].tolist(),
        "turning_deg": _degrees(explained.turning_rad),
        "heading_jump_max_deg": None if jump is None else _degrees(jump),
        "clearance_mm": {
            guard.name: float(guard.clearance_mm[region])
            for guard in explained.cell.guards
            if np.isfinite(guard.clearance_mm[region])
        },
        "summary": explained.summary,
        "mend": explained.mend,
        "chosen": chosen,
        "refused": [as_json(diagnostic) for diagnostic in explained.refused],
        "headings": [_json_line(explained, line) for line in explained.lines],
    }


def _json_line(explained: Explained, line: HeadingLine) -> dict[str, object]:
    return {
        "heading_deg": _degrees(line.heading_rad),
        "verdict": explained.verdict(line),
        "tool": None if line.tool is None else line.tool.clause,
        "arm": None if line.arm is None else {"kind": line.arm.kind, "says": line.arm.clause},
        "branches": list(line.branches),
        "jumps_deg": {
            each.name: _degrees(each.jump_rad(line.heading_rad)) for each in explained.neighbours
        },
    }


def _degrees(angle_rad: float) -> float:
    """As written: without the noise of the conversion."""
    return round(math.degrees(angle_rad), 9) + 0.0

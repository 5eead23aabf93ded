"""The sequence along a panel's holes beside that of botrail, and beside greedy choice.

    python -m venv botrail-venv && botrail-venv/bin/pip install --only-binary :all: botrail==0.12.1
    python benchmarks/against_botrail.py botrail-venv/bin/python [HOLES]

botrail (Rust; its licence allows noncommercial use and small businesses) plans with
spin="optimize", a global pass over a grid of headings. It runs in an interpreter of its own. Both
get the same KUKA KR 210, the same tool without a body, the same standoffs over a curved panel, in
rows to and fro, nothing around, every heading allowed. drillc's cost is joint travel alone, then
its default, which holds the rule's heading where that works.

Compared are, from standoff to standoff: the sum of |dq| over all joints, the same with each joint
in seconds at its full speed (what drillc minimises), the largest turn of the tool about its own
axis from hole to hole, and the processor time of planning (on the panel, the least of three).
drillc's covers candidates for the whole cycle into the hole, the choice, and the proof of the ways
between; botrail's is `plan_toolpath`.

Greedy choice takes, hole by hole, the candidate nearest in joint space (in seconds), beginning with
the one nearest to the rule; it is shown for the panel and for samples/fuselage_arm.drill.
"""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
from drillc.driver import read_job
from drillc.kernels.arm import link_frames
from drillc.kernels.posture import heading_turn_rad
from drillc.language.diagnostics import Report
from drillc.language.job import Floats, Job, Pose, Weights
from drillc.planning.arm_joints import find_candidates, jump_limits
from drillc.planning.arm_travel import make_legs, plan_travel
from drillc.planning.cell import Cell, make_cells
from drillc.planning.cycle_check import Candidates, Cycles, join, make_cycles
from drillc.planning.depths import plunge_depths
from drillc.planning.headings import turned
from drillc.planning.postures import resolve_postures
from drillc.planning.sequence import SEARCH_ALL_BELOW, choose
from drillc.planning.tool_sweeps import make_tool_sweeps
from scipy.spatial.transform import Rotation

SAMPLE = Path(__file__).parents[1] / "samples" / "fuselage_arm.drill"
SIDE = Path(__file__).with_name("botrail_side.py")
STANDOFF_MM = 60.0
SPEC = """drill 1
program PANEL
part panel { up +Z  normals outward  frame 1 }
tool ee { number 1  tcp (-300, 0, 250) mm rotate y -90 deg }
robot kr210 arm {
  model kuka_kr210_r3100_2
  base at (0, 4200, -1400) mm rotate z -90 deg
}
holes all from "holes.csv" { units mm  columns { id ID  x X  y Y  z Z  i NX  j NY  k NZ } }
process drill { approach 60 mm  depth 10 mm  spindle 3000 rpm  feed 0.1 mm/rev  retract 60 mm }
region panel {
  select all
  process drill
  posture x toward +X
  turning within 180 deg
}
sequence { order given  weights { deviation 0  travel 1  margin 0 } }
emit krl
"""
#: The panel: a cylinder's side, rows along its axis.
RADIUS_MM, PITCH_MM, A_ROW = 2200.0, 25.0, 25


def panel_csv(holes: int) -> str:
    lines = ["ID,X,Y,Z,NX,NY,NZ"]
    for i in range(holes):
        row, place = divmod(i, A_ROW)
        along = (place if row % 2 == 0 else A_ROW - 1 - place) - (A_ROW - 1) / 2
        around = (row - (holes // A_ROW - 1) / 2) * PITCH_MM / RADIUS_MM
        normal = 0.0, np.cos(around), np.sin(around)
        cells = [along * PITCH_MM, RADIUS_MM * normal[1], RADIUS_MM * normal[2], *normal]
        lines.append(f"P{i}," + ",".join(f"{cell:.9f}" for cell in cells))
    return "\n".join(lines) + "\n"


# ── drillc ───────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True, eq=False)
class Place:
    """One station's holes."""

    job: Job
    cell: Cell
    cycles: Cycles
    turning_rad: Floats


def places(spec: Path) -> Iterator[Place]:
    report = Report()
    job = read_job(spec, None, report)
    depth_mm, part_from_tool = plunge_depths(job, report), resolve_postures(job, report)
    report.stop_if_failed()
    station = np.array([region.station for region in job.regions])[job.holes.region]
    turning_rad = np.array([region.turning_rad for region in job.regions])
    for index, cell in enumerate(make_cells(job, job.robot)):
        cycles = make_cycles(job, np.flatnonzero(station == index), part_from_tool, depth_mm)
        yield Place(job, cell, cycles, turning_rad[cycles.region])


@dataclass(frozen=True, eq=False)
class Way:
    """Standoffs of holes, one after another, and what finding them took."""

    before: Floats  # (n, 6) joints at the standoff, on the way to the hole
    after: Floats  # (n, 6) and when it is drilled
    part_from_tool: Floats  # (n, 3, 3)
    cpu_s: float


def few(place: Place, holes: int) -> Place:
    """The first holes only."""
    columns = {f.name: getattr(place.cycles, f.name)[:holes] for f in fields(Cycles)}
    return replace(place, cycles=Cycles(**columns), turning_rad=place.turning_rad[:holes])


def weighing(place: Place, weights: Weights) -> Place:
    return replace(place, job=replace(place.job, weights=weights))


def solved(place: Place) -> Way:
    """drillc's sequence."""
    start = time.process_time()
    sweeps = make_tool_sweeps(place.cell, place.cycles)
    found = find_candidates(place.cell, place.cycles, sweeps, place.turning_rad, lambda doing: None)
    limit_rad = jump_limits(place.job, place.cycles)
    sequence = choose(
        place.cell, place.cycles, sweeps, found, place.turning_rad, limit_rad, place.job.weights
    )
    if sequence.blocked is not None:
        raise SystemExit(f"hole {sequence.blocked} cannot be reached")
    chosen = sequence.chosen
    _, blocked = plan_travel(
        place.cell, place.cycles, chosen, make_legs(place.cell, place.cycles.region)
    )
    if blocked:
        raise SystemExit(f"{len(blocked)} ways are not clear")
    return way(place, chosen, time.process_time() - start)


def at_best(place: Place) -> Way:
    """The same three times, timed by the fastest."""
    return min((solved(place) for _ in range(3)), key=lambda found: found.cpu_s)


def way(place: Place, chosen: Candidates, cpu_s: float) -> Way:
    rotation = place.cycles.turned(chosen.row, chosen.heading_rad)
    return Way(chosen.standoff, chosen.leave, rotation, cpu_s)


def greedy(place: Place) -> Way:
    """The nearest candidate of each hole, of the same ones that the optimum is chosen from."""
    start = time.process_time()
    sweeps = make_tool_sweeps(place.cell, place.cycles)
    found = find_candidates(place.cell, place.cycles, sweeps, place.turning_rad, lambda doing: None)
    weights = place.job.weights
    if weights.deviation < SEARCH_ALL_BELOW * weights.travel:
        rows = np.arange(len(place.cycles))
        more = turned(place.cell, place.cycles, sweeps, rows, place.turning_rad, enough=1000)
        found = join([found, more])
    first = np.searchsorted(found.row, np.arange(len(place.cycles) + 1))
    taken = [int(np.abs(found.heading_rad[: first[1]]).argmin())]
    for low, high in itertools.pairwise(first[1:]):
        apart = np.abs(found.standoff[low:high] - found.leave[taken[-1]])
        taken.append(int(low + (apart / place.cell.speed_rad_s).sum(axis=1).argmin()))
    return way(place, found.take(np.array(taken)), time.process_time() - start)


# ── botrail ──────────────────────────────────────────────────────────────────────────────────────


def urdf(cell: Cell) -> str:
    """The arm from its joints' places and axes where all are 0, in metres, the tool's point last;
    botrail's tool axis points from there to the tool's body."""
    zero = np.zeros((1, 6))
    origin = np.concatenate([link_frames(cell.geometry, zero)[1][0], np.zeros((1, 3))])
    links = "".join(f'<link name="l{i}"/>' for i in range(8))
    joints = ""
    for i in range(6):
        little = 0.1 * np.eye(6)[i : i + 1]
        turn = link_frames(cell.geometry, little)[0][0, i + 1]
        axis = Rotation.from_matrix(turn).as_rotvec() / 0.1
        low, high = cell.low_rad[i], cell.high_rad[i]
        joints += (
            f'<joint name="A{i + 1}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
            f'<origin xyz="{_said((origin[i + 1] - origin[i]) / 1000)}"/>'
            f'<axis xyz="{_said(axis)}"/>'
            f'<limit lower="{low}" upper="{high}" velocity="{cell.speed_rad_s[i]}" effort="1"/>'
            "</joint>"
        )
    pose = backwards(cell)
    angles = Rotation.from_matrix(pose.rotation).as_euler("xyz")
    joints += (
        '<joint name="tool" type="fixed"><parent link="l6"/><child link="l7"/>'
        f'<origin xyz="{_said(pose.translation_mm / 1000)}" rpy="{_said(angles)}"/></joint>'
    )
    return f'<robot name="arm">{links}{joints}</robot>'


def backwards(cell: Cell) -> Pose:
    """The tool's point in the frame of link 6, its z axis toward the body."""
    zero = np.zeros((1, 6))
    rotation, origin_mm = cell.tool_pose(zero)
    links, places_mm = cell.link_poses(zero)
    turn = links[0, 6].T @ rotation[0] @ np.diag([1.0, -1.0, -1.0])
    return Pose(turn, links[0, 6].T @ (origin_mm[0] - places_mm[0, 6]))


def _said(numbers: Floats) -> str:
    return " ".join(f"{number:.12g}" for number in numbers)


def botrail(place: Place, python: str, spin: str) -> Way:
    root = place.cell.station.part_from_root
    rows = np.arange(len(place.cycles))
    standoff_mm = place.cycles.at_depth(rows, np.full(len(rows), -STANDOFF_MM))
    points = (standoff_mm - root.translation_mm) @ root.rotation / 1000.0
    axes = -place.cycles.rotation[:, :, 2] @ root.rotation
    bottom_mm = place.cycles.at_depth(rows, place.cycles.depth_mm)
    bottoms = (bottom_mm - root.translation_mm) @ root.rotation / 1000.0
    holes = list(zip(points.tolist(), bottoms.tolist(), axes.tolist(), strict=True))
    asked = json.dumps({"urdf": urdf(place.cell), "holes": holes, "spin": spin})
    done = subprocess.run([python, str(SIDE)], input=asked, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"botrail: {done.stderr[-2000:]}")
    answer = json.loads(done.stdout)
    before, after = np.array(answer.pop("before")), np.array(answer.pop("after"))
    rotation, position_mm = place.cell.tool_pose(before)
    off_mm = np.linalg.norm(position_mm - standoff_mm, axis=1).max()
    off_deg = np.degrees(
        np.arccos((rotation[:, :, 2] * place.cycles.rotation[:, :, 2]).sum(1).min())
    )
    print(
        f"  (botrail {answer['version']} meets its targets to {off_mm:.2g} mm, {off_deg:.2g} deg)"
    )
    return Way(before, after, rotation, answer["cpu_s"])


# ── figures ──────────────────────────────────────────────────────────────────────────────────────


def show(name: str, cell: Cell, found: Way) -> tuple[float, float]:
    step = np.abs(found.before[1:] - found.after[:-1])
    plain, timed = np.degrees(step.sum()), (step / cell.speed_rad_s).sum()
    jump = np.degrees(np.abs(heading_turn_rad(found.part_from_tool)).max())
    print(f"  {name:34}{plain:14,.0f} {timed:14.2f} {jump:14.2f} {found.cpu_s:12.3f}")
    return timed, found.cpu_s


def heading(title: str) -> None:
    print(f"{title:36}{'sum |dq|, deg':>14} {'in seconds':>14} {'turn, deg':>14} {'cpu s':>12}")


def main(python: str, holes: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        spec = Path(folder) / "panel.drill"
        spec.write_text(SPEC, "utf-8")
        spec.with_name("holes.csv").write_text(panel_csv(holes), "utf-8")
        (place,) = places(spec)
    heading(f"{holes} holes of a curved panel")
    solved(few(place, 10))  # imports what is needed
    mine = {}
    for name, weights in (("travel alone", place.job.weights), ("by default", Weights())):
        mine[name] = show(f"drillc, {name}", place.cell, at_best(weighing(place, weights)))
    for spin in ("optimize", "greedy"):
        travel, cpu_s = show(f"botrail, {spin}", place.cell, botrail(place, python, spin))
        for name, (own_travel, own_cpu_s) in mine.items():
            print(
                f"    drillc, {name}: {own_travel / travel:.2f} of its travel, "
                f"{cpu_s / own_cpu_s:.1f} times faster"
            )
    for place in places(SAMPLE):
        heading(f"fuselage, {len(place.cycles)} holes")
        travel = replace(place.job.weights, deviation=0.0, travel=1.0, margin=0.0)
        for name, weights in (("as the sample says", place.job.weights), ("travel alone", travel)):
            asked = weighing(place, weights)
            show(f"drillc, {name}", place.cell, solved(asked))
            show(f"greedy, {name}", place.cell, greedy(asked))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 300)

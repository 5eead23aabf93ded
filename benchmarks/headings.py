"""Headings of many holes among fixtures, beside the collision library asked about every one.

    python benchmarks/headings.py [holes that the library is asked about]

The geometry is that of samples/fuselage_arm.drill, with six holes for each of its own, and every
heading allowed. drillc finds for each hole the rule's own heading or else the nearest that works on
either side, with branches and joints: proven over the whole cycle and between.

The library's way, for a random part of the holes (seeded): 72 headings; the tool's body swept along
the cycle and grown by the clearance, exact but for 1.8 % of it, as one yes/no question a part; then
for every branch in reach, in limits and not singular the arm's capsules, grown by the clearance, at
places along the cycle `step` apart. It is spared what it can be: branches and links' poses come
from drillc's own vectorised kernels, bodies are built once, the fixtures stand in the library's
broad phase, the first hit ends a heading or a branch. It proves nothing between its places.

Then the answers are compared, outside the measured time:

- each of drillc's candidates is walked in steps of 1 mm: the tool's true distance, the links'
  capsules, against what drillc promises (of links: the clearance less what travels may use up);
- where the library finds a heading, drillc must find one that is no farther from the rule's.

Processor time of one process, so that other work on the machine matters less.
"""

from __future__ import annotations

import re
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fcl
import numpy as np
from drillc.driver import read_job
from drillc.geometry.polyhedra import outer
from drillc.geometry.shapes import Mesh, RoundedHull, grown
from drillc.geometry.sweeps import swept_along_z
from drillc.kernels.arm import singularity
from drillc.kernels.turns import all_turns
from drillc.language.diagnostics import Report
from drillc.language.job import Floats
from drillc.planning.arm_joints import find_candidates
from drillc.planning.cell import LEAST_GAP_MM, TOOL, Cell, make_cells
from drillc.planning.cycle_check import Candidates, Cycles, make_cycles
from drillc.planning.depths import plunge_depths
from drillc.planning.moves import JUMP_RAD
from drillc.planning.postures import resolve_postures
from drillc.planning.tool_sweeps import make_tool_sweeps

SAMPLES = Path(__file__).parents[1] / "samples"
#: As many holes as the sample has, times this.
FINE = 6
#: From a row of stringer (S) or frame (F) holes to the next, degrees of φ.
ROWS_DEG = {"S": 3.0, "F": 0.5}
HEADINGS = np.arange(72) * 2.0 * np.pi / 72
CLEARANCE_MM = 10.0
STEPS_MM = (5.0, 20.0)
WALK_MM = 1.0
#: Rounding, and the 0.005 mm to which distances are exact.
SLACK_MM = 0.02

Rows = np.ndarray


# ── the holes ────────────────────────────────────────────────────────────────────────────────────


def dense_csv() -> str:
    """The sample's holes.csv with FINE times as many."""
    sys.path.insert(0, str(SAMPLES))
    import make_fuselage

    lines = ["ID,X,Y,Z,NX,NY,NZ,STACK"]
    for hole in make_fuselage.holes():
        phi = hole.phi_deg + ROWS_DEG[hole.id[0]] * (np.arange(FINE) / FINE - 0.5)
        u = np.full(FINE, hole.u_deg)
        columns = make_fuselage.points(u, phi), make_fuselage.normals(u, phi)
        for i, (point, normal) in enumerate(zip(*columns, strict=True)):
            cells = ",".join(f"{value:.9f}" for value in (*point, *normal))
            lines.append(f"{hole.id}{'abcdef'[i]},{cells},{hole.stack_mm}")
    return "\n".join(lines) + "\n"


@dataclass(frozen=True, eq=False)
class Place:
    """What one station is to resolve."""

    cell: Cell
    cycles: Cycles
    turning_rad: Floats


def places(folder: Path) -> Iterator[Place]:
    """The sample with more holes, any heading allowed, station by station."""
    shutil.copytree(SAMPLES, folder / "samples")
    spec = folder / "samples" / "fuselage_arm.drill"
    text = re.sub(r"turning within \S+ deg", "turning within 180 deg", spec.read_text("utf-8"))
    spec.write_text(re.sub(r"(?m)^expect .*\n", "", text), "utf-8")
    (folder / "samples" / "fuselage" / "holes.csv").write_text(dense_csv(), "utf-8")
    report = Report()
    job = read_job(spec, None, report)
    depth_mm, part_from_tool = plunge_depths(job, report), resolve_postures(job, report)
    report.stop_if_failed()
    station = np.array([region.station for region in job.regions])[job.holes.region]
    for index, cell in enumerate(make_cells(job, job.robot)):
        cycles = make_cycles(job, np.flatnonzero(station == index), part_from_tool, depth_mm)
        yield Place(cell, cycles, np.full(len(cycles), np.pi))


# ── the collision library, asked about everything ────────────────────────────────────────────────


def fcl_mesh(mesh: Mesh) -> Any:
    model = fcl.BVHModel()
    model.beginModel(len(mesh.vertices_mm), len(mesh.faces))
    model.addSubModel(mesh.vertices_mm, mesh.faces)
    model.endModel()
    return model


def fixtures(cell: Cell) -> list[Any]:
    """Boxes as boxes, meshes as meshes."""
    found = []
    for solid in (solid for guard in cell.guards for solid in guard.obstacles.solids):
        if isinstance(solid, Mesh):
            found.append(fcl.CollisionObject(fcl_mesh(solid)))
        else:
            low, high = solid.points_mm.min(axis=0), solid.points_mm.max(axis=0)
            place = fcl.Transform(0.5 * (low + high))
            found.append(fcl.CollisionObject(fcl.Box(*(high - low)), place))
    return found


@dataclass(frozen=True, eq=False)
class Link:
    """A capsule: which link it is of, and where the capsule's own frame is in the link's."""

    number: int
    rotation: Floats
    middle_mm: Floats
    body: Any


def links(cell: Cell, growth_mm: float) -> list[Link]:
    """The arm's moving links, the hand first: it is hit most often."""
    found = []
    for mover in cell.movers:
        for hull in mover.hulls if 0 < mover.link < TOOL else ():
            start, end = hull.points_mm
            z = (end - start) / np.linalg.norm(end - start)
            x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
            x /= np.linalg.norm(x)
            shape = fcl.Capsule(hull.radius_mm + growth_mm, float(np.linalg.norm(end - start)))
            frame = np.stack([x, np.cross(z, x), z], axis=1)
            found.append(Link(mover.link, frame, 0.5 * (start + end), fcl.CollisionObject(shape)))
    return found[::-1]


def tool_hulls(cell: Cell) -> tuple[RoundedHull, ...]:
    return next(mover.hulls for mover in cell.movers if mover.link == TOOL)


class Library:
    """Answers for one hole after another, which headings and branches work."""

    def __init__(self, place: Place, step_mm: float) -> None:
        self.cell, self.cycles, self.step_mm = place.cell, place.cycles, step_mm
        self.fixtures = fixtures(self.cell)
        self.around = fcl.DynamicAABBTreeCollisionManager()
        self.around.registerObjects(self.fixtures)
        self.around.setup()
        self.links = links(self.cell, CLEARANCE_MM)
        self.tools: dict[tuple[float, float], list[Any]] = {}
        self.request = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
        self.calls = 0

    def works(self, row: int) -> np.ndarray:
        """(72, 8)."""
        headings = self._free_for_the_tool(row)
        result = np.zeros((len(HEADINGS), 8), dtype=np.bool_)
        at, branch, joints = branches(self.cell, self.cycles, row, HEADINGS[headings], self.step_mm)
        for i in range(len(at)):
            result[headings[at[i]], branch[i]] = self._links_clear(joints[i])
        return result

    def _hits(self, body: Any, rotation: Floats, position_mm: Floats) -> bool:
        self.calls += 1
        body.setTransform(fcl.Transform(rotation, position_mm))
        data = fcl.CollisionData(request=self.request)
        self.around.collide(body, data, fcl.defaultCollisionCallback)
        return bool(data.result.is_collision)

    def _free_for_the_tool(self, row: int) -> Rows:
        out, depth = float(self.cycles.out_mm[row]), float(self.cycles.depth_mm[row])
        if (out, depth) not in self.tools:
            swept = [swept_along_z(hull, -out, depth) for hull in tool_hulls(self.cell)]
            meshes = [outer(grown(hull, CLEARANCE_MM)).mesh for hull in swept]
            self.tools[out, depth] = [fcl.CollisionObject(fcl_mesh(mesh)) for mesh in meshes]
        bodies, position_mm = self.tools[out, depth], self.cycles.position_mm[row]
        turned = self.cycles.turned(np.full(len(HEADINGS), row), HEADINGS)
        hit = [any(self._hits(body, turn, position_mm) for body in bodies) for turn in turned]
        return np.flatnonzero(~np.array(hit))

    def _links_clear(self, joints: Floats) -> bool:
        rotation, origin_mm = self.cell.link_poses(joints)
        for link in self.links:
            turn, origin = rotation[:, link.number], origin_mm[:, link.number]
            middle = turn @ link.middle_mm + origin
            for pose in zip(turn @ link.rotation, middle, strict=True):
                if self._hits(link.body, *pose):
                    return False
        return True


def branches(
    cell: Cell, cycles: Cycles, row: int, headings: Floats, step_mm: float
) -> tuple[Rows, Rows, Floats]:
    """The branches that reach all along the cycle, continuously, within limits and away from the
    singularity: of which heading (k,), which (k,), and their joints (k, places, 6)."""
    out, depth = cycles.out_mm[row], cycles.depth_mm[row]
    count = 1 + int(np.ceil((out + depth) / step_mm))
    along = np.tile(np.linspace(-out, depth, count), len(headings))
    rows = np.full(len(along), row)
    rotation = cycles.turned(rows, np.repeat(headings, count))
    joints = cell.branches(rotation, cycles.at_depth(rows, along)).reshape(-1, count, 8, 6)
    joints -= 2 * np.pi * np.round((joints - joints[:, :1]) / (2 * np.pi))
    bad = np.isnan(joints).any(axis=(1, 3))
    bad |= np.abs(np.diff(joints, axis=1)).max(axis=(1, 3), initial=0.0) > JUMP_RAD
    bad |= singularity(cell.geometry, joints).wrist_rad.min(axis=1) < cell.singular_rad
    low, high = joints.min(axis=1), joints.max(axis=1)
    at, branch = np.nonzero(~bad)
    fits, _ = all_turns(low[at, branch], cell.low_rad, cell.high_rad - (high - low)[at, branch])
    some = np.unique(fits)
    return at[some], branch[some], joints[at[some], :, branch[some]]


# ── the answers ──────────────────────────────────────────────────────────────────────────────────


class Judge:
    """Walks single candidates densely."""

    def __init__(self, place: Place) -> None:
        self.cell, self.cycles = place.cell, place.cycles
        self.fixtures = fixtures(self.cell)
        self.links = links(self.cell, CLEARANCE_MM - LEAST_GAP_MM - SLACK_MM)
        cores = [outer(RoundedHull(hull.points_mm, 0.0)).mesh for hull in tool_hulls(self.cell)]
        self.tool = [
            (fcl.CollisionObject(fcl_mesh(core)), hull.radius_mm)
            for core, hull in zip(cores, tool_hulls(self.cell), strict=True)
        ]

    def objects(self, row: int, heading_rad: float, branch: int) -> str | None:
        """What is wrong with a candidate, if anything."""
        _, found, joints = branches(self.cell, self.cycles, row, np.array([heading_rad]), WALK_MM)
        if branch not in found:
            return "no such branch"
        for link in self.links:
            rotation, origin_mm = self.cell.link_poses(joints[list(found).index(branch)])
            turn, origin = rotation[:, link.number], origin_mm[:, link.number]
            for i in range(len(turn)):
                where = turn[i] @ link.rotation, turn[i] @ link.middle_mm + origin[i]
                link.body.setTransform(fcl.Transform(*where))
                if any(fcl.collide(link.body, other) for other in self.fixtures):
                    return f"link {link.number} is too near"
        out, depth = float(self.cycles.out_mm[row]), float(self.cycles.depth_mm[row])
        rows = np.array([row])
        turned = self.cycles.turned(rows, np.array([heading_rad]))[0]
        for along in np.arange(-out, depth + WALK_MM, WALK_MM):
            place = self.cycles.at_depth(rows, np.array([min(along, depth)]))[0]
            for body, radius_mm in self.tool:
                body.setTransform(fcl.Transform(turned, place))
                gap = min(fcl.distance(body, other) for other in self.fixtures) - radius_mm
                if gap < CLEARANCE_MM - SLACK_MM:
                    return f"the tool is {gap:.3f} mm away"
        return None


def compare(place: Place, rows: Rows, found: Candidates, works: list[np.ndarray]) -> list[str]:
    """Each disagreement, with the hole, the heading and the branch."""
    judge, wrong = Judge(place), []
    turn_deg = np.degrees(np.abs((HEADINGS + np.pi) % (2 * np.pi) - np.pi))
    for row, grid in zip(rows.tolist(), works, strict=True):
        mine = found.take(found.row == row)
        for heading, branch in dict.fromkeys(zip(mine.heading_rad, mine.branch, strict=True)):
            why = judge.objects(row, float(heading), int(branch))
            if why is not None:
                wrong.append(f"hole {row}, {np.degrees(heading):.3f} deg, branch {branch}: {why}")
        nearest = turn_deg[grid.any(axis=1)].min(initial=np.inf)
        own = np.degrees(np.abs(mine.heading_rad)).min(initial=np.inf)
        if own > nearest + 1e-6:
            wrong.append(f"hole {row}: drillc turns {own:.3f} deg, the library {nearest:g} deg")
    return wrong


def main(asked: int) -> None:
    """Print the figures, and every disagreement."""
    total = turned = candidates = 0
    ours_s, spent_s = 0.0, dict.fromkeys(STEPS_MM, 0.0)
    calls = dict.fromkeys(STEPS_MM, 0)
    compared, wrong, lost = 0, [], 0
    with tempfile.TemporaryDirectory() as folder:
        for number, place in enumerate(places(Path(folder))):
            count = len(place.cycles)
            start = time.process_time()
            sweeps = make_tool_sweeps(place.cell, place.cycles)
            found = find_candidates(
                place.cell, place.cycles, sweeps, place.turning_rad, lambda doing: None
            )
            ours_s += time.process_time() - start
            total, candidates = total + count, candidates + len(found)
            turned += count - len(np.unique(found.row[found.heading_rad == 0.0]))
            lost += count - len(np.unique(found.row))
            rows = np.sort(np.random.default_rng(number).permutation(count)[: asked // 2])
            for step_mm in STEPS_MM:
                library = Library(place, step_mm)
                start = time.process_time()
                works = [library.works(row) for row in rows.tolist()]
                spent_s[step_mm] += time.process_time() - start
                calls[step_mm] += library.calls
                wrong += compare(place, rows, found, works) if step_mm == STEPS_MM[0] else []
            compared += len(rows)
    print(f"{total:,} holes; {turned:,} of them turned, {lost} impossible     holes/s")
    print(f"  {'drillc':44}{total / ours_s:12.1f}")
    for step_mm in STEPS_MM:
        name = (
            f"the library, links every {step_mm:g} mm ({calls[step_mm] / compared:,.0f} questions)"
        )
        ratio = total / ours_s * spent_s[step_mm] / compared
        print(
            f"  {name:44}{compared / spent_s[step_mm]:12.1f}   drillc is {ratio:.1f} times faster"
        )
    print(f"answers for {compared} holes: {len(wrong)} disagreements")
    print("\n".join(wrong))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)

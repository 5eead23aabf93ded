"""Cells before simple bodies, and the same scenes once more for python-fcl, for the planning tests.

drillc's side is made by `make_cell`; the other side knows the arm from `walk.arm` (scipy and
py-opw-kinematics) and holds its bodies as fcl's own shapes. Radians and mm, as in drillc.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import fcl
import numpy as np
from drillc.catalogue.arms import models
from drillc.geometry.obstacles import Obstacles
from drillc.geometry.shapes import box, capsule, sphere
from drillc.language.job import Arm, Limit, Named, Pose, Station, Tool
from drillc.language.source import Source, Span
from drillc.planning.cell import Cell, Guard, make_cell
from drillc.planning.cycle_check import Cycles
from scipy.spatial.transform import Rotation
from walk.arm import KR210
from walk.scene import LINKS, along

SPAN = Span(Source(Path("spec.drill"), "spec.drill", ""), 1, 1, 1)
LOW, HIGH = np.radians(KR210.low), np.radians(KR210.high)
HOME = np.radians([0, -90, 90, 0, 30, 0])


def turn(sequence, *degrees):
    # Before scipy 1.17 one angle in a list makes a list of one rotation.
    return Rotation.from_euler(sequence, degrees, degrees=True).as_matrix().reshape(3, 3)


# ── bodies, on both sides ────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Box:
    low: tuple
    high: tuple

    @property
    def drillc(self):
        return box(self.low, self.high)

    @property
    def fcl(self):
        low, high = np.array(self.low, float), np.array(self.high, float)
        return fcl.Box(*(high - low)), matrix(np.eye(3), (low + high) / 2)


@dataclass(frozen=True)
class Sphere:
    centre: tuple
    radius: float

    @property
    def drillc(self):
        return sphere(self.centre, self.radius)

    @property
    def fcl(self):
        return fcl.Sphere(self.radius), matrix(np.eye(3), np.array(self.centre, float))


@dataclass(frozen=True)
class Capsule:
    start: tuple
    end: tuple
    radius: float

    @property
    def drillc(self):
        return capsule(self.start, self.end, self.radius)

    @property
    def fcl(self):
        start, end = (np.array([p], dtype=float) for p in (self.start, self.end))
        length = float(np.linalg.norm(end - start))
        return fcl.Capsule(self.radius, length), along(start, end)[0]


def matrix(rotation, position):
    """(..., 4, 4) from rotations and positions."""
    rotation, position = np.asarray(rotation, float), np.asarray(position, float)
    whole = np.zeros((*position.shape[:-1], 4, 4))
    whole[..., :3, :3], whole[..., :3, 3], whole[..., 3, 3] = rotation, position, 1.0
    return whole


def distance_mm(one, one_pose, other, other_pose):
    """fcl's distance of two shapes; 0 or less where they meet."""
    first, second = (
        fcl.CollisionObject(shape, fcl.Transform(pose[:3, :3], pose[:3, 3]))
        for shape, pose in ((one, one_pose), (other, other_pose))
    )
    return float(fcl.distance(first, second, fcl.DistanceRequest(), fcl.DistanceResult()))


# ── the scene ────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Scene:
    """A KR 210 with a tool before bodies. `clearance` is what each region keeps from each guard,
    the last: between the regions. `body` is in flange coordinates."""

    guards: tuple = ()  # each a sequence of bodies
    clearance: tuple = ()  # of each guard: per region, and between
    part_from_root: tuple = field(default_factory=lambda: (np.eye(3), np.zeros(3)))
    flange_from_tool: tuple = field(default_factory=lambda: (np.eye(3), np.array([0.0, 0, 250])))
    body: tuple = (Capsule((0, 0, 40), (0, 0, 210), 40.0),)
    low: np.ndarray = field(default_factory=lambda: LOW)
    high: np.ndarray = field(default_factory=lambda: HIGH)
    home: np.ndarray | None = field(default_factory=lambda: HOME)
    singular_deg: float = 2.0
    links: bool = True

    def cell(self) -> Cell:
        model = models()["kuka_kr210_r3100_2"]
        station = Station(None, Pose(*self.part_from_root), 1, SPAN)
        arm = Arm(
            name=Named("arm1", SPAN),
            model=model,
            stations=(station,),
            auto=None,
            limits=tuple(Limit(*bounds, None) for bounds in zip(self.low, self.high, strict=True)),
            speeds=model.speed_rad_s,
            home_rad=self.home,
            home_span=None,
            singular_rad=np.radians(self.singular_deg),
            links=((None,) if self.links else ((),)) * 7,
        )
        tool = Tool(
            Named("drill", SPAN),
            1,
            Pose(*self.flange_from_tool),
            None,
            None,
            tuple(part.drillc for part in self.body),
        )
        guards = tuple(
            Guard(
                f"fixture f{i}", Obstacles([b.drillc for b in bodies]), np.array(clearance, float)
            )
            for i, (bodies, clearance) in enumerate(zip(self.guards, self.clearance, strict=True))
        )
        return make_cell(arm, station, tool, guards)

    def with_(self, **changes):
        return replace(self, **changes)

    # the independent side

    @property
    def root(self):
        return matrix(*self.part_from_root)

    @property
    def flange_tool(self):
        return matrix(*self.flange_from_tool)

    def flange(self, joints):
        """part_from_flange (n, 4, 4) of joints (n, 6)."""
        at = KR210.points(np.degrees(joints))
        return self.root @ matrix(at["turn"], at["flange"])

    def tool(self, joints):
        """part_from_tool (n, 4, 4)."""
        return self.flange(joints) @ self.flange_tool

    def branches(self, part_from_tool):
        """All joints (n, 8, 6) for tool poses (n, 4, 4)."""
        root_from_flange = (
            np.linalg.inv(self.root) @ part_from_tool @ np.linalg.inv(self.flange_tool)
        )
        return np.radians(KR210.branches(root_from_flange))

    def follow(self, start, part_from_tool):
        """Joints (n, 6) along tool poses, always the nearest to those before; NaN once lost."""
        way, now = [], np.array(start, float)
        for choices in self.branches(part_from_tool):
            step = (choices - now + np.pi) % (2 * np.pi) - np.pi
            far = np.abs(step).max(axis=1)
            now = now + step[int(np.nanargmin(far))] if not np.isnan(far).all() else now * np.nan
            way.append(now)
        return np.array(way)

    def moving(self, joints, *, tool=True, links=True):
        """Shapes with their poses (n, 4, 4) along joints."""
        at = KR210.points(np.degrees(joints))
        found = []
        if links and self.links:
            for name, first, second, share in LINKS:
                length = float(np.linalg.norm(at[second][0] - at[first][0]))
                poses = self.root @ along(at[first], at[second])
                found.append((name, fcl.Capsule(share * (KR210.c2 + KR210.c3), length), poses))
        if tool:
            for part in self.body:
                shape, pose = part.fcl
                found.append(("tool", shape, self.flange(joints) @ pose))
        return found

    def gaps_mm(self, joints, *, tool=True, links=True):
        """(guards, n): how near anything that moves comes to each guard at each row."""
        gaps = np.full((len(self.guards), len(joints)), np.inf)
        for _, shape, poses in self.moving(joints, tool=tool, links=links):
            for g, bodies in enumerate(self.guards):
                for part in bodies:
                    other, pose = part.fcl
                    for i, here in enumerate(poses):
                        gaps[g, i] = min(gaps[g, i], distance_mm(shape, here, other, pose))
        return gaps


def line(start, stop, step_mm=0.5):
    """Tool poses (n, 4, 4) from one to another, evenly, about one axis."""
    turned = Rotation.from_matrix(start[:3, :3].T @ stop[:3, :3]).as_rotvec()
    length = float(np.linalg.norm(stop[:3, 3] - start[:3, 3]))
    steps = max(1, int(np.ceil(max(length / step_mm, np.linalg.norm(turned) / 0.005))))
    share = np.linspace(0.0, 1.0, steps + 1)[:, None]
    rotation = start[:3, :3] @ Rotation.from_rotvec(turned * share).as_matrix()
    return matrix(rotation, start[:3, 3] + (stop[:3, 3] - start[:3, 3]) * share)


def cycles_of(
    position,
    rotation,
    *,
    region=None,
    approach: float | Sequence[float] = 50.0,
    retract: float | Sequence[float] = 50.0,
    depth: float | Sequence[float] = 10.0,
) -> Cycles:
    position = np.atleast_2d(np.asarray(position, float))
    n = len(position)
    return Cycles(
        np.zeros(n, np.int32) if region is None else np.asarray(region, np.int32),
        position,
        np.broadcast_to(np.asarray(rotation, float), (n, 3, 3)).copy(),
        np.broadcast_to(np.asarray(approach, float), n).copy(),
        np.broadcast_to(np.asarray(retract, float), n).copy(),
        np.broadcast_to(np.asarray(depth, float), n).copy(),
    )


def about_z(part_from_tool, angle_rad):
    return part_from_tool @ matrix(turn("z", np.degrees(angle_rad)), np.zeros(3))


def cycle_poses(cycles, row, heading_rad, step_mm=0.5):
    """The tool's poses (n, 4, 4) along a whole cycle, from the farther standoff to the depth."""
    out = max(cycles.approach_mm[row], cycles.retract_mm[row])
    depth = cycles.depth_mm[row]
    steps = int(np.ceil((out + depth) / step_mm))
    along_mm = np.linspace(-out, depth, steps + 1)
    rotation = cycles.rotation[row] @ turn("z", np.degrees(heading_rad))
    position = cycles.position_mm[row] + along_mm[:, None] * cycles.rotation[row][:, 2]
    return matrix(np.broadcast_to(rotation, (len(position), 3, 3)), position)


def tool_gap_mm(scene, cycles, row, heading_rad, step_mm=0.5):
    """Over the whole cycle, how much more than its clearance the tool keeps: every half millimetre
    where it may matter, of each guard, by fcl."""
    poses = cycle_poses(cycles, row, heading_rad, step_mm)
    region = cycles.region[row]
    flange = poses @ np.linalg.inv(scene.flange_tool)
    least = np.inf
    for bodies, clearance in zip(scene.guards, scene.clearance, strict=True):
        if not np.isfinite(clearance[region]):
            continue
        for part in scene.body:
            shape, own = part.fcl
            for body in bodies:
                other, pose = body.fcl
                coarse = [distance_mm(shape, f @ own, other, pose) for f in flange[::20]]
                # Distance changes by at most as much as the tool moves.
                for i in np.flatnonzero(np.array(coarse) < min(coarse) + 20 * step_mm + 0.1):
                    for f in flange[max(0, 20 * i - 20) : 20 * i + 21]:
                        gap = distance_mm(shape, f @ own, other, pose) - clearance[region]
                        least = min(least, gap)
    return least


def tool_is_free(scene, cycles, row, heading_rad, step_mm=2.0):
    """Whether the tool keeps every clearance over the whole cycle: fcl where spheres around the
    bodies come near."""
    flange = cycle_poses(cycles, row, heading_rad, step_mm) @ np.linalg.inv(scene.flange_tool)
    region = cycles.region[row]
    for bodies, clearance in zip(scene.guards, scene.clearance, strict=True):
        kept = clearance[region]
        for body in bodies if np.isfinite(kept) else ():
            other, pose = body.fcl
            far = ball_mm(other) + kept
            for part in scene.body:
                shape, own = part.fcl
                here = flange @ own
                away = np.linalg.norm(here[:, :3, 3] - pose[:3, 3], axis=1)
                for i in np.flatnonzero(away < far + ball_mm(shape)):
                    if distance_mm(shape, here[i], other, pose) < kept:
                        return False
    return True


def ball_mm(shape):
    """The radius of a ball around an fcl shape's middle."""
    if isinstance(shape, fcl.Box):
        return 0.5 * float(np.linalg.norm(shape.side))
    return float(shape.radius) + 0.5 * float(getattr(shape, "lz", 0.0))

"""An arm at one parking place, with its tool and what stands around it, as numbers for planning.

Poses are pairs (rotation (n, 3, 3), position_mm (n, 3)) in part coordinates; joints are (n, 6) in
radians. Links are capsules derived from the arm's dimensions unless the spec gives their shapes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import product

import numpy as np

from drillc.geometry.obstacles import Obstacles
from drillc.geometry.probe import Probe
from drillc.geometry.shapes import RoundedHull, capsule, grown
from drillc.kernels.arm import ArmGeometry, forward, landmarks, link_frames
from drillc.kernels.arm_inverse import inverse
from drillc.language.job import Arm, Floats, Ints, Job, Pose, Station, Tool

#: What the tool keeps from a fixture over a hole's cycle where its region asks for no more; and how
#: much of a clearance the arm's links, and both on the ways between holes, may use up.
LEAST_GAP_MM = 2.0
#: The tool among the bodies: it follows the seven links (0: the root).
TOOL = 7
#: The region of a move that belongs to none: the last entry of `Guard.clearance_mm`.
BETWEEN = -1
#: Radii of the derived capsules as shares of upper arm plus forearm: column, upper arm, forearm,
#: hand. A little more than real arms measure (KR 6 to KR 420).
_RADII = {"column": 0.12, "upper": 0.07, "fore": 0.055, "hand": 0.045}


@dataclass(frozen=True, eq=False)
class Mover:
    """A rigid body that moves with link `link` (1 … 6), stands with it (0), or is the tool (7).

    `hulls` are in that link's frame (the tool's: in the tool's). `corners_mm` (8, 3): those of a
    box around them; no point of the body is displaced farther than the farthest corner.
    """

    name: str
    link: int
    hulls: tuple[RoundedHull, ...]
    corners_mm: Floats
    _probes: dict[float, Probe] = field(default_factory=dict, repr=False)

    def probe(self, growth_mm: float) -> Probe:
        """The body grown by that much, ready for collision tests; made once for each growth."""
        if growth_mm not in self._probes:
            hulls = [grown(hull, growth_mm) for hull in self.hulls]
            self._probes[growth_mm] = Probe(hulls)
        return self._probes[growth_mm]


@dataclass(frozen=True, eq=False)
class Guard:
    """One thing to keep clear of. `clearance_mm` (r + 1,) says by how much, for each region and,
    last, on the way from one region to another; -inf: not at all."""

    name: str
    obstacles: Obstacles
    clearance_mm: Floats


@dataclass(frozen=True, eq=False)
class Cell:
    """An arm standing at `station`. `low_rad`, `high_rad`, `speed_rad_s` are (6,)."""

    arm: Arm
    station: Station
    flange_from_tool: Pose
    low_rad: Floats
    high_rad: Floats
    speed_rad_s: Floats
    singular_rad: float
    movers: tuple[Mover, ...]
    guards: tuple[Guard, ...]

    @property
    def geometry(self) -> ArmGeometry:
        return self.arm.model.geometry

    def branches(self, rotation: Floats, position_mm: Floats) -> Floats:
        """All joints (n, 8, 6) that bring the tool to these poses; NaN where a branch is absent."""
        root = self.station.part_from_root
        flange = self.flange_from_tool
        part_from_flange = rotation @ flange.rotation.T
        flange_mm = position_mm - part_from_flange @ flange.translation_mm
        return inverse(
            self.geometry,
            root.rotation.T @ part_from_flange,
            (flange_mm - root.translation_mm) @ root.rotation,
        )

    def tool_pose(self, joints: Floats) -> tuple[Floats, Floats]:
        """Where the tool is: rotation (n, 3, 3), position (n, 3)."""
        rotation, position_mm = forward(self.geometry, joints)
        root, flange = self.station.part_from_root, self.flange_from_tool
        part_from_flange = root.rotation @ rotation
        flange_mm = position_mm @ root.rotation.T + root.translation_mm
        return (
            part_from_flange @ flange.rotation,
            flange_mm + part_from_flange @ flange.translation_mm,
        )

    def link_poses(self, joints: Floats) -> tuple[Floats, Floats]:
        """Where the links are: rotation (n, 7, 3, 3), origin (n, 7, 3)."""
        rotation, origin_mm = link_frames(self.geometry, joints)
        root = self.station.part_from_root
        return root.rotation @ rotation, origin_mm @ root.rotation.T + root.translation_mm


def make_cells(job: Job, arm: Arm) -> tuple[Cell, ...]:
    """A cell for each station, in their order."""
    assert job.tool is not None
    guards = make_guards(job)
    return tuple(make_cell(arm, station, job.tool, guards) for station in arm.stations)


def make_cell(arm: Arm, station: Station, tool: Tool, guards: tuple[Guard, ...]) -> Cell:
    """The arm at one station."""
    return Cell(
        arm,
        station,
        tool.flange_from_tool,
        np.array([limit.low for limit in arm.limits]),
        np.array([limit.high for limit in arm.limits]),
        arm.speeds,
        arm.singular_rad,
        (*_link_movers(arm), _tool_mover(tool)),
        guards,
    )


def make_guards(job: Job) -> tuple[Guard, ...]:
    """Every fixture, kept `LEAST_GAP_MM` from at least; the part's surface where it is avoided."""
    guards = []
    for index, fixture in enumerate(job.fixtures):
        clearance = np.full(len(job.regions) + 1, LEAST_GAP_MM)
        for i, region in enumerate(job.regions):
            asked = [a.clearance_mm for a in region.avoid if a.fixture == index]
            clearance[i] = max([LEAST_GAP_MM, *asked])
        obstacles = Obstacles([solid.shape for solid in fixture.solids])
        guards.append(Guard(f"fixture {fixture.name.text}", obstacles, clearance))
    surface = job.part.surface
    if surface is not None and any(a.fixture is None for r in job.regions for a in r.avoid):
        clearance = np.full(len(job.regions) + 1, LEAST_GAP_MM)
        for i, region in enumerate(job.regions):
            asked = [a.clearance_mm for a in region.avoid if a.fixture is None]
            clearance[i] = max([LEAST_GAP_MM, *asked]) if asked else -np.inf
        guards.append(Guard(f"part {job.part.name.text}", Obstacles([surface.mesh]), clearance))
    return tuple(guards)


def pick(joints: Floats, branch: Ints) -> Floats:
    """One branch (n,) of all of them (n, 8, 6)."""
    return np.asarray(joints[np.arange(len(joints)), branch])


# ── bodies ───────────────────────────────────────────────────────────────────────────────────────


def _tool_mover(tool: Tool) -> Mover:
    """The tool's body in tool coordinates; without one, the line from the flange to its point."""
    pose = tool.flange_from_tool
    hulls = tool.body or (RoundedHull(np.stack([np.zeros(3), pose.translation_mm]), 0.0),)
    moved = tuple(
        RoundedHull((hull.points_mm - pose.translation_mm) @ pose.rotation, hull.radius_mm)
        for hull in hulls
    )
    return Mover("the tool", TOOL, moved, _corners(moved))


def _link_movers(arm: Arm) -> list[Mover]:
    derived = _capsules(arm.model.geometry)
    movers = []
    for link, given in enumerate(arm.links):
        hulls = given if given is not None else derived[link]
        if hulls:
            name = "the arm's root" if link == 0 else f"the arm's link {link}"
            movers.append(Mover(name, link, tuple(hulls), _corners(hulls)))
    return movers


def _capsules(geometry: ArmGeometry) -> list[tuple[RoundedHull, ...]]:
    """Capsules along the arm's dimensions, each in the frame of the link that it moves with."""
    zero = np.zeros((1, 6))
    _, origin_mm = link_frames(geometry, zero)
    origin = origin_mm[0]
    at = landmarks(geometry, zero)[0]
    reach_mm = geometry.c2_mm + geometry.c3_mm
    radius = {name: share * reach_mm for name, share in _RADII.items()}

    def along(link: int, first: int, last: int, kind: str) -> tuple[RoundedHull, ...]:
        return (capsule(at[first] - origin[link], at[last] - origin[link], radius[kind]),)

    column, shoulder, elbow, forearm, wrist, flange = range(1, 7)
    return [
        (capsule(np.zeros(3), np.array([0.0, 0.0, 0.5 * geometry.c1_mm]), radius["column"]),),
        along(1, column, shoulder, "column"),
        along(2, shoulder, elbow, "upper"),
        along(3, elbow, forearm, "upper"),
        along(4, forearm, wrist, "fore"),
        (),
        along(6, wrist, flange, "hand"),
    ]


def _corners(hulls: tuple[RoundedHull, ...]) -> Floats:
    points = np.concatenate([hull.points_mm for hull in hulls])
    low, high = points.min(axis=0), points.max(axis=0)
    sides = np.stack([low, high], axis=1)
    return np.array(list(product(*sides)))

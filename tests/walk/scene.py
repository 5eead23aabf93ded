"""What stands around an arm, and what the arm is made of, as bodies for python-fcl.

The solids are read from the specs' text by a few regular expressions of this file, so that a test
that moves a fixture in the text moves it here too. The arm's links are the capsules that the
language's reference describes: their radii are shares of upper arm plus forearm.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import fcl
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation
from walk.arm import Arm

Array = np.ndarray
Pair = tuple[int, fcl.CollisionObject, fcl.CollisionObject]

#: Each link's capsule: which link, from which point to which, and its radius as a share.
LINKS = (
    ("link 1", "column", "shoulder", 0.12),
    ("link 2", "shoulder", "elbow", 0.07),
    ("link 3", "elbow", "forearm", 0.07),
    ("link 4", "forearm", "wrist", 0.055),
    ("link 6", "wrist", "flange", 0.045),
)

_POINT = r"\(([^)]*)\)"
_SOLID = re.compile(
    rf"(box)\s*{_POINT}\s*{_POINT}\s*mm"
    rf"|(cylinder|capsule)\s*{_POINT}\s*{_POINT}\s*mm\s+radius\s+(\S+)\s+mm"
    r'|(mesh)\s+"([^"]+)"\s+mm'
)


@dataclass(frozen=True)
class Solid:
    """A body for fcl that stands at `pose` (4, 4) in its owner's frame, inside the box `low` …
    `high` (3,) of that frame, and inside a ball around the origin of `pose`."""

    shape: fcl.CollisionGeometry
    pose: Array
    low: Array
    high: Array
    ball_mm: float


# ── reading a spec's text ────────────────────────────────────────────────────────────────────────


def without_comments(text: str) -> str:
    return re.sub(r"#.*", "", text)


def block(text: str, head: str) -> str:
    """What stands in the braces behind `head`."""
    start = re.search(rf"\b{head}\s*\{{", text)
    assert start is not None, head
    depth, at = 1, start.end()
    while depth:
        depth += {"{": 1, "}": -1}.get(text[at], 0)
        at += 1
    return text[start.end() : at - 1]


def numbers(text: str) -> Array:
    return np.array([float(part) for part in text.split(",")])


def placement(text: str) -> Array:
    """`(x, y, z) mm rotate x 90 deg …` as a (4, 4)."""
    where = re.match(rf"\s*{_POINT}\s*mm((?:\s+rotate\s+[xyz]\s+\S+\s+deg)*)", text)
    assert where is not None, text
    pose = np.eye(4)
    pose[:3, 3] = numbers(where[1])
    for axis, angle in re.findall(r"rotate\s+([xyz])\s+(\S+)\s+deg", where[2]):
        turn = Rotation.from_euler(axis, float(angle), degrees=True)
        pose[:3, :3] = pose[:3, :3] @ turn.as_matrix()
    return pose


def solids(text: str, folder: Path) -> list[Solid]:
    """The solids in a block of a spec."""
    found: list[Solid] = []
    for match in _SOLID.finditer(text):
        if match[1]:
            found.append(_box(numbers(match[2]), numbers(match[3])))
        elif match[4]:
            found.append(_round(match[4], numbers(match[5]), numbers(match[6]), float(match[7])))
        else:
            found += _pieces(folder / match[9])
    assert len(found) >= len(re.findall(r"\bmm\b", text)) // 2, "a solid was overlooked"
    return found


def _box(first: Array, second: Array) -> Solid:
    low, high = np.minimum(first, second), np.maximum(first, second)
    pose = np.eye(4)
    pose[:3, 3] = (low + high) / 2
    return Solid(fcl.Box(*(high - low)), pose, low, high, float(np.linalg.norm(high - low)) / 2)


def _round(kind: str, first: Array, second: Array, radius: float) -> Solid:
    length = float(np.linalg.norm(second - first))
    shape = (fcl.Capsule if kind == "capsule" else fcl.Cylinder)(radius, length)
    low, high = np.minimum(first, second) - radius, np.maximum(first, second) + radius
    return Solid(shape, along(first[None], second[None])[0], low, high, length / 2 + radius)


def _pieces(path: Path) -> list[Solid]:
    """A mesh, cut into the pieces that do not touch. Of each only the skin is a body for fcl: who
    walks in steps smaller than its own size meets it before being inside."""
    found = []
    for piece in trimesh.load(path, file_type=path.suffix[1:]).split(only_watertight=True):
        model = fcl.BVHModel()
        model.beginModel(len(piece.vertices), len(piece.faces))
        model.addSubModel(np.array(piece.vertices), np.array(piece.faces))
        model.endModel()
        low, high = piece.bounds
        ball = float(np.linalg.norm(piece.vertices, axis=1).max())
        found.append(Solid(model, np.eye(4), low, high, ball))
    assert found, path
    return found


def along(first: Array, second: Array) -> Array:
    """Poses (n, 4, 4) in the middle between points (n, 3), z from the first to the second."""
    axis = second - first
    axis = axis / np.maximum(np.linalg.norm(axis, axis=1), 1e-12)[:, None]
    other = np.where(np.abs(axis[:, :1]) < 0.7, np.array([1.0, 0, 0]), np.array([0, 1.0, 0]))
    x = np.cross(other, axis)
    x /= np.linalg.norm(x, axis=1)[:, None]
    pose = np.tile(np.eye(4), (len(first), 1, 1))
    pose[:, :3, 0], pose[:, :3, 1], pose[:, :3, 2] = x, np.cross(axis, x), axis
    pose[:, :3, 3] = (first + second) / 2
    return pose


# ── meeting ──────────────────────────────────────────────────────────────────────────────────────


@dataclass(frozen=True)
class Mover:
    """A body of the arm or of its tool, at poses (n, 4, 4) in part coordinates."""

    name: str
    shape: fcl.CollisionGeometry
    ball_mm: float
    poses: Array


@dataclass(frozen=True)
class Scene:
    """An arm with its tool before some fixtures. Fixtures are in part coordinates, `tool` (parts of
    its body) in the flange's; part_from_root (4, 4) is where the arm stands."""

    arm: Arm
    part_from_root: Array
    fixtures: dict[str, list[Solid]]
    tool: list[Solid]

    def links(self, joints: Array) -> list[Mover]:
        """The arm's moving links at joints (n, 6)."""
        at = self.arm.points(joints)
        reach = self.arm.c2 + self.arm.c3
        found = []
        for name, first, second, share in LINKS:
            length = float(np.linalg.norm(at[second][0] - at[first][0]))
            capsule = fcl.Capsule(share * reach, length)
            poses = self.part_from_root @ along(at[first], at[second])
            found.append(Mover(name, capsule, length / 2 + share * reach, poses))
        return found

    def tool_parts(self, part_from_flange: Array) -> list[Mover]:
        """The tool's parts with the flange at poses (n, 4, 4)."""
        return [
            Mover(f"tool {i}", part.shape, part.ball_mm, part_from_flange @ part.pose)
            for i, part in enumerate(self.tool)
        ]

    def meetings(self, joints: Array) -> list[tuple[int, str, str]]:
        """Which rows of joints (n, 6) have what meeting what."""
        at = self.arm.points(joints)
        flange = np.tile(np.eye(4), (len(joints), 1, 1))
        flange[:, :3, :3], flange[:, :3, 3] = at["turn"], at["flange"]
        movers = self.links(joints) + self.tool_parts(self.part_from_root @ flange)
        return [
            (row, mover.name, fixture)
            for mover in movers
            for fixture in self.fixtures
            for row, one, other in self.near(mover, fixture, 0.0)
            if fcl.collide(one, other, fcl.CollisionRequest(), fcl.CollisionResult())
        ]

    def near(self, mover: Mover, fixture: str, reach_mm: float) -> Iterator[Pair]:
        """The rows where the mover's ball, grown by `reach_mm`, reaches the box around a solid of
        the fixture: only there can the two be so near. With both bodies, placed."""
        one = fcl.CollisionObject(mover.shape, fcl.Transform())
        centre = mover.poses[:, :3, 3]
        for part in self.fixtures[fixture]:
            other = fcl.CollisionObject(part.shape, transform(part.pose))
            gap = np.maximum(np.maximum(part.low - centre, centre - part.high), 0.0)
            close = np.linalg.norm(gap, axis=1) <= mover.ball_mm + reach_mm
            for row in np.flatnonzero(close).tolist():
                one.setTransform(transform(mover.poses[row]))
                yield row, one, other

    def keeps(self, mover: Mover, clearance_mm: dict[str, float]) -> bool:
        """Whether a body keeps away from every fixture by that much, at all of its poses."""
        return all(
            fcl.distance(one, other, fcl.DistanceRequest(), fcl.DistanceResult()) >= least
            for fixture, least in clearance_mm.items()
            for _, one, other in self.near(mover, fixture, least)
        )

    def root_meets(self) -> bool:
        """Whether the arm's standing column, half as high as its shoulder, meets a fixture."""
        foot = np.zeros((1, 3))
        top = np.array([[0.0, 0.0, 0.5 * self.arm.c1]])
        radius = 0.12 * (self.arm.c2 + self.arm.c3)
        shape = fcl.Capsule(radius, 0.5 * self.arm.c1)
        poses = self.part_from_root @ along(foot, top)
        column = Mover("root", shape, radius + 0.25 * self.arm.c1, poses)
        return not self.keeps(column, dict.fromkeys(self.fixtures, 0.0))


def transform(pose: Array) -> fcl.Transform:
    return fcl.Transform(pose[:3, :3], pose[:3, 3])

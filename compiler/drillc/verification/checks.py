"""What is compared in numbers at each hole: where the tool is, how it is turned, how straight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .case import Case
from .events import Floats, Kind
from .matching import NEAR_DEEP_MM, Marks, near
from .verdict import Rows
from .visits import Cores, Items, Path, Visits


@dataclass(frozen=True, eq=False)
class Made:
    """The visits of a path that make holes: `hole` (m,) is the row each makes. `depth_mm` (n,) of
    the tool after each event of the path, on the axis of its visit's hole; NaN outside of visits.
    """

    visits: Visits
    hole: Rows
    depth_mm: Floats
    cores: Cores
    items: Items

    def __len__(self) -> int:
        return len(self.hole)


def depths_of(case: Case, path: Path, visits: Visits, hole: Rows) -> Floats:
    """How deep the tool is after each event (n,). Where a hole is not made near its place, along
    the tool's own axis, from the bottom that it then has."""
    wanted, place = case.wanted, path.places
    bottom = place.position_mm[visits.deepest]
    axis = place.axis[visits.deepest]
    origin = wanted.position_mm[hole]
    feed = wanted.axis[hole]
    ends = origin + wanted.bottom_mm[hole, None] * feed
    off = ~near(Marks(bottom, axis), Marks(ends, feed))
    origin[off] = bottom[off] - wanted.bottom_mm[hole[off], None] * axis[off]
    feed[off] = axis[off]
    counts = visits.stop - visits.start
    depth = np.full(len(path), np.nan)
    inside = np.zeros(len(path), dtype=np.bool_)
    edges = np.zeros(len(path) + 1, dtype=np.int64)
    edges[visits.start] += 1
    edges[visits.stop] -= 1
    inside = np.cumsum(edges[:-1]) > 0
    which = np.repeat(np.arange(len(visits)), counts)
    there = place.position_mm[inside] - origin[which]
    depth[inside] = np.einsum("ij,ij->i", there, feed[which])
    # Between moves the tool stays where it is; each visit begins with a move.
    last = np.maximum.accumulate(np.where(path.moves, np.arange(len(path)), 0))
    return np.where(inside, depth[last], np.nan)


def check_places(case: Case, path: Path, made: Made) -> None:
    """Position, axis, heading and straightness of every move between the standoffs."""
    events = made.items.events
    visit = np.repeat(np.arange(len(made)), made.cores.last - made.cores.first + 1)
    moves = path.moves[events]
    at, hole = events[moves], made.hole[visit[moves]]
    first = made.cores.first[visit[moves]]
    wanted, program = case.wanted, case.program
    axis, across = path.places.rotation[at, :, 2], path.places.rotation[at, :, 0]
    there = path.places.position_mm[at]

    ids = case.hole

    def away_mm(k: int) -> float:
        """How far the hole as a whole is from its place."""
        depth = made.depth_mm[at[k]] * wanted.axis[hole[k]]
        return float(np.linalg.norm(there[k] - wanted.position_mm[hole[k]] - depth))

    # The line through the tool's point along the tool's own axis, seen from the hole.
    aside = _aside(wanted.position_mm[hole] - there, axis)
    # One that is far from it along the axis too has its depths from its own bottom.
    along = np.einsum("ij,ij->i", there - wanted.position_mm[hole], wanted.axis[hole])
    astray = np.abs(along - made.depth_mm[at])
    aside = np.where(astray > NEAR_DEEP_MM, np.hypot(aside, astray), aside)
    case.figures(
        "position",
        aside,
        case.limits.position_mm[hole],
        path,
        at,
        hole,
        lambda k: (
            f"{ids(int(hole[k]))} is made {away_mm(k):.3f} mm away from where the spec has it",
            None,
        ),
        body=True,
    )
    turned = _angle(axis, wanted.axis[hole])
    case.figures(
        "axis",
        turned,
        case.limits.angle_rad[hole],
        path,
        at,
        hole,
        lambda k: (
            f"the tool's axis at {ids(int(hole[k]))} is {np.degrees(turned[k]):.4f} deg off the"
            " hole's",
            None,
        ),
        body=True,
    )
    heading = np.abs(
        np.arctan2(
            np.einsum("ij,ij->i", across, program.part_from_tool[hole, :, 1]),
            np.einsum("ij,ij->i", across, program.part_from_tool[hole, :, 0]),
        )
    )
    case.figures(
        "heading",
        heading,
        case.limits.angle_rad[hole],
        path,
        at,
        hole,
        lambda k: (
            f"the tool at {ids(int(hole[k]))} is turned {np.degrees(heading[k]):.4f} deg about its"
            f" axis from the planned heading",
            None,
        ),
        body=True,
    )
    _check_straight(case, path, at, hole, first)


def _check_straight(case: Case, path: Path, at: Rows, hole: Rows, first: Rows) -> None:
    """Each move after the arrival lies on the line on which the tool arrived, and is a straight
    one."""
    inner = at != first
    at, hole, first = at[inner], hole[inner], first[inner]
    place, ids = path.places, case.hole
    axis = place.axis[first]
    limit = case.limits.straight_mm[hole]
    aside = _aside(place.position_mm[at] - place.position_mm[first], axis)
    if case.arm_by_joints:
        bent = _aside(path.middle_mm[at] - place.position_mm[first], axis)
        aside = np.fmax(aside, bent)
    case.figures(
        "straight",
        aside,
        limit,
        path,
        at,
        hole,
        lambda k: (f"the tool leaves its axis at {ids(int(hole[k]))} by {aside[k]:.3f} mm", None),
    )
    if case.program.motion is not None:
        others = np.arange(place.joints.shape[1]) != case.program.motion.feed_axis
        shift = np.abs(place.joints[at] - place.joints[first])[:, others]
        wrong = ~(shift <= 1e-7).all(axis=1)
        what = "other joints than the feed's move"
    else:
        wrong = path.events.kind[at] != Kind.STRAIGHT
        what = "the move is made by the joints, not straight"
    bad = np.flatnonzero(wrong)
    if len(bad):
        case.figures(
            "straight",
            np.full(len(bad), np.inf),
            1.0,
            path,
            at[bad],
            hole[bad],
            lambda k: (f"at {ids(int(hole[bad[k]]))} {what}", None),
        )


def _aside(vector: Floats, axis: Floats) -> Floats:
    """The length (k,) of what vectors (k, 3) have across unit axes."""
    along = np.einsum("ij,ij->i", vector, axis)
    rest = vector - along[:, None] * axis
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", rest, rest)))


def _angle(one: Floats, two: Floats) -> Floats:
    """Between unit vectors (k, 3), exact where it is small."""
    apart = np.linalg.norm(one - two, axis=1)
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * apart, 1.0)))

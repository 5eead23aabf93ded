"""What is compared in numbers at each hole: where the tool is, how it is turned, how straight."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .case import Case
from .events import Floats, Kind
from .matching import NEAR_DEEP_MM, Marks, near
from .vectors import angle, aside, dot
from .verdict import Rows
from .visits import Cores, Items, Path, Visits, spread


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
    inside = spread(visits.start, counts)
    # Between moves the tool stays where it is; each visit begins with a move.
    last = np.maximum.accumulate(np.where(path.moves, np.arange(len(path)), 0))[inside]
    there = place.position_mm[last] - np.repeat(origin, counts, axis=0)
    depth[inside] = dot(there, np.repeat(feed, counts, axis=0))
    return depth


def check_places(case: Case, path: Path, made: Made) -> None:
    """Position, axis, heading and straightness of every move between the standoffs."""
    events = made.items.events
    visit = np.repeat(np.arange(len(made)), made.cores.last - made.cores.first + 1)
    moves = path.moves[events]
    at, hole = events[moves], made.hole[visit[moves]]
    first = made.cores.first[visit[moves]]
    wanted, program = case.wanted, case.program
    axis, across = path.places.axis[at], path.places.rotation[at, :, 0]
    there = path.places.position_mm[at]
    place, feed = wanted.position_mm[hole], wanted.axis[hole]

    ids = case.hole

    def away_mm(k: int) -> float:
        """How far the hole as a whole is from its place."""
        depth = made.depth_mm[at[k]] * feed[k]
        return float(np.linalg.norm(there[k] - place[k] - depth))

    # The line through the tool's point along the tool's own axis, seen from the hole.
    off = aside(place - there, axis)
    # One that is far from it along the axis too has its depths from its own bottom.
    astray = np.abs(dot(there - place, feed) - made.depth_mm[at])
    if (astray > NEAR_DEEP_MM).any():
        off = np.where(astray > NEAR_DEEP_MM, np.hypot(off, astray), off)
    case.figures(
        "position",
        off,
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
    turned = angle(axis, feed)
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
            dot(across, program.part_from_tool[hole, :, 1]),
            dot(across, program.part_from_tool[hole, :, 0]),
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
    begin = place.position_mm[first]
    off = aside(place.position_mm[at] - begin, axis)
    if case.arm_by_joints:
        off = np.fmax(off, aside(path.middle_mm[at] - begin, axis))
    case.figures(
        "straight",
        off,
        limit,
        path,
        at,
        hole,
        lambda k: (f"the tool leaves its axis at {ids(int(hole[k]))} by {off[k]:.3f} mm", None),
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

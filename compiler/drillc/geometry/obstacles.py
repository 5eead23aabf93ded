"""Which poses of a moving body are certainly clear of standing solids.

Cheap and certain first: balls that cover the body against a field of distances settle most free
poses; what they leave open goes to the collision library; what lies wholly inside a solid, or
holds one, is found from single points.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from .bvh import Body
from .capsules import STEP_MM, Capsules, near_capsules
from .field import INSIDE, OUTSIDE, UNSURE, DistanceField, distance_field
from .polyhedra import EXCESS
from .probe import Probe
from .shapes import Floats, Mesh, RoundedHull, joined
from .solids import standing

Bools = NDArray[np.bool_]
Ints = NDArray[np.int64]

POSES = 1 << 13  # that are worked on at once, each with hundreds of balls at most
BLOCK = 1 << 17  # pairs of a pose and a point that are worked on at once
WORTH_A_FIELD = 3000  # poses: as long as it takes to test them, it takes to build one
TOUCHING_MM = 2e-3  # what is nearer than this may count as touching


class Obstacles:
    """Standing solids, in part coordinates. Build once, ask often.

    A mesh's closed pieces are solid, faces outward (a cavity's inward); an open piece is its
    surface alone.
    """

    def __init__(self, solids: Sequence[RoundedHull | Mesh]) -> None:
        self.solids = tuple(solids)
        self._standing = [standing(solid) for solid in solids]
        self._low_mm = np.array([each.low_mm for each in self._standing]).reshape(-1, 3)
        self._high_mm = np.array([each.high_mm for each in self._standing]).reshape(-1, 3)
        self._marks_mm = np.concatenate(
            [np.empty((0, 3)), *(each.marks_mm for each in self._standing)]
        )
        self._capsules = Capsules()
        self._asked = 0

    @cached_property
    def field(self) -> DistanceField:
        """How far any point certainly is from all solids."""
        return distance_field([each.outside for each in self._standing], self._hold)

    def _field_for(self, poses: int) -> DistanceField | None:
        """The field, once enough has been asked to pay for it; the answers are the same without."""
        self._asked += poses
        return self.field if self._asked >= WORTH_A_FIELD else None

    def _side(self, points_mm: Floats) -> NDArray[np.int8]:
        if "field" in self.__dict__:
            return self.field.side_of(points_mm)
        return np.full(len(points_mm), UNSURE, dtype=np.int8)

    def clear(
        self, probe: Probe, rotation: Floats, position_mm: Floats, *, exact: bool = True
    ) -> Bools:
        """In which poses (n,) the probe and the solids certainly have no point in common.

        `rotation` (n, 3, 3) and `position_mm` (n, 3) are part_from_body. Never wrongly True.
        False where they are nearer than 0.002 mm; and in a pose that is not a number. Without
        `exact` also where only the polyhedra around them meet: quicker.
        """
        finite = np.isfinite(rotation).all(axis=2) & np.isfinite(position_mm)
        result = np.asarray(finite.all(axis=1))
        if not self.solids:
            return result
        rows = np.flatnonzero(result)
        if field := self._field_for(len(rows)):
            rows = rows[_near(field, probe, rotation[rows], position_mm[rows])]
        apart = np.zeros(len(rows), dtype=np.bool_)
        decided = np.zeros(len(rows), dtype=np.bool_)
        for i, row in enumerate(rows):
            apart[i], decided[i] = self._apart(probe, rotation[row], position_mm[row], exact)
        result[rows] = apart
        rows = rows[apart & ~decided]
        result[rows] = ~self._nested(probe, rotation[rows], position_mm[rows])
        return result

    def meets(self, probe: Probe, rotation: Floats, position_mm: Floats) -> Bools:
        """In which poses (n,) the probe and a solid certainly have a point in common.

        Poses as in `clear`, but finite. Never wrongly True; False also where they only overlap by
        less than what the polyhedra inside them lack.
        """
        result = np.zeros(len(rotation), dtype=np.bool_)
        if probe.inner_body is not None and self._inner_body is not None:
            for i in range(len(rotation)):
                probe.inner_body.move(rotation[i], position_mm[i])
                result[i] = probe.inner_body.meets(self._inner_body)
        for hull in probe.hulls:
            rows = np.flatnonzero(~result)
            points = rotation[rows] @ hull.points_mm[0] + position_mm[rows]
            held = self._side(points) != OUTSIDE
            rows, points = rows[held], points[held]
            for each in self._standing:
                near = ((points >= each.low_mm) & (points <= each.high_mm)).all(axis=1)
                result[rows[near]] |= each.core_contains(points[near])
        return result

    def capsules_clear(self, start_mm: Floats, end_mm: Floats, radius_mm: Floats) -> Bools:
        """In which poses (n,) all of m capsules are certainly clear of the solids.

        Ends (n, m, 3) in part coordinates; radii (m,) or (n, m). A capsule of no radius is a
        segment, one of no length a ball. Never wrongly True.
        """
        n, m = start_mm.shape[:2]
        result = np.asarray((np.isfinite(start_mm) & np.isfinite(end_mm)).all(axis=(1, 2)))
        if not self.solids:
            return result
        radius = np.broadcast_to(radius_mm, (n, m))
        rows, links = np.divmod(np.flatnonzero(np.repeat(result, m)), m)
        if field := self._field_for(n):
            ends_mm = start_mm[rows, links], end_mm[rows, links]
            near = near_capsules(field, *ends_mm, radius[rows, links])
            rows, links = rows[near], links[near]
        for row, link in zip(rows, links, strict=True):
            if result[row]:
                ends = start_mm[row, link], end_mm[row, link]
                result[row] = self._capsule_apart(*ends, float(radius[row, link]))
        return result

    def gap_mm(
        self,
        probe: Probe,
        rotation: Floats,
        position_mm: Floats,
        *,
        beyond_mm: float = np.inf,
    ) -> tuple[float, int]:
        """The distance to the nearest solid in one pose, and which solid that is; `beyond_mm` and
        -1 where none is nearer than that.

        Exact to 0.005 mm, and never too great. Negative where the two overlap: the sum of their
        radii if their cores do too, how deep they are if only their rounding does.
        """
        best, index = beyond_mm, -1
        first = probe.points_mm[probe.first_point] @ rotation.T + position_mm
        free = self._side(first) == OUTSIDE
        bounds = self._apart_at_least(probe, rotation, position_mm)
        for flat in np.argsort(bounds, axis=None, kind="stable"):
            hull, solid = np.unravel_index(flat, bounds.shape)
            if bounds[hull, solid] >= best:
                break
            gap = self._pair_gap_mm(
                probe, int(hull), int(solid), rotation, position_mm, free=bool(free[hull])
            )
            if gap < best:
                best, index = gap, int(solid)
        return best, index

    # ── surfaces ─────────────────────────────────────────────────────────────────────────────────

    @cached_property
    def _outer_body(self) -> Body:
        return Body(joined([each.outside for each in self._standing]))

    @cached_property
    def _inner_body(self) -> Body | None:
        inside = [each.inside for each in self._standing if each.inside is not None]
        return Body(joined(inside)) if inside else None

    def _apart(
        self, probe: Probe, rotation: Floats, position_mm: Floats, exact: bool
    ) -> tuple[bool, bool]:
        """Whether surfaces are apart in one pose, and whether that is all there is to say."""
        probe.outer_body.move(rotation, position_mm)
        if not probe.outer_body.meets(self._outer_body):
            return True, False
        if not exact:
            return False, True
        if probe.inner_body is not None and self._inner_body is not None:
            probe.inner_body.move(rotation, position_mm)
            if probe.inner_body.meets(self._inner_body):
                return False, True
        # Only the polyhedra around them meet: true distances tell.
        bounds = self._apart_at_least(probe, rotation, position_mm)
        for hull, solid in np.argwhere(bounds <= TOUCHING_MM):
            gap_mm = self._pair_gap_mm(probe, hull, solid, rotation, position_mm)
            if gap_mm <= TOUCHING_MM:
                return False, True
        return True, True

    def _apart_at_least(self, probe: Probe, rotation: Floats, position_mm: Floats) -> Floats:
        """A lower bound (hulls, solids) of their distances, from boxes around them."""
        points = probe.points_mm @ rotation.T + position_mm
        radius_mm = probe.radius_mm[:, None]
        low = np.minimum.reduceat(points, probe.first_point) - radius_mm
        high = np.maximum.reduceat(points, probe.first_point) + radius_mm
        below, above = self._low_mm - high[:, None], low[:, None] - self._high_mm
        beside = np.maximum(np.maximum(below, above), 0.0)
        return np.asarray(np.sqrt(np.einsum("hsi,hsi->hs", beside, beside)))

    def _pair_gap_mm(
        self,
        probe: Probe,
        hull: int,
        solid: int,
        rotation: Floats,
        position_mm: Floats,
        *,
        free: bool = False,
    ) -> float:
        """The distance of one hull and one solid; not positive where they overlap. `free`: the
        hull's first point is known to be in no solid."""
        body, other = probe.core_bodies[hull], self._standing[solid]
        body.move(rotation, position_mm)
        gap_mm = body.distance_mm(other.core_body)
        radii_mm = probe.hulls[hull].radius_mm + other.radius_mm
        if gap_mm > radii_mm:
            point = rotation @ probe.hulls[hull].points_mm[0] + position_mm
            if not free and other.core_contains(point[None])[0]:
                return -gap_mm
            marks = (other.marks_mm - position_mm) @ rotation
            planes = probe.cores[hull].planes
            if (marks @ planes[:, :3].T <= planes[:, 3]).all(axis=1).any():
                return -gap_mm
        return gap_mm - radii_mm

    # ── one wholly inside the other ──────────────────────────────────────────────────────────────

    def _hold(self, points_mm: Floats) -> Bools:
        """Which points (n, 3) are inside a solid."""
        held = np.zeros(len(points_mm), dtype=np.bool_)
        for each in self._standing:
            held |= each.contains(points_mm)
        return held

    def _nested(self, probe: Probe, rotation: Floats, position_mm: Floats) -> Bools:
        """In which poses (n,), surfaces being apart, a hull is in a solid or holds one."""
        nested = np.zeros(len(rotation), dtype=np.bool_)
        for points in probe.witnesses:
            turned = np.einsum("nij,kj->nki", rotation, points) + position_mm[:, None]
            side = self._side(turned.reshape(-1, 3)).reshape(turned.shape[:2])
            # The surfaces are apart, so one point speaks for the whole hull.
            nested |= (side == INSIDE).any(axis=1)
            for row in np.flatnonzero((side == UNSURE).all(axis=1)):
                nested[row] |= self._hold(turned[row, :1])[0]
        return nested | self._holding(probe, rotation, position_mm)

    def _holding(self, probe: Probe, rotation: Floats, position_mm: Floats) -> Bools:
        """In which poses (n,) a hull holds the first point of a solid's piece."""
        holding = np.zeros(len(rotation), dtype=np.bool_)
        whole = probe.levels[0]
        block = max(1, BLOCK // len(self._marks_mm))
        for start in range(0, len(rotation), block):
            turn, middle = rotation[start : start + block], position_mm[start : start + block]
            middle = middle + turn @ whole.centre_mm[0]
            far_mm = np.linalg.norm(self._marks_mm - middle[:, None], axis=2)
            pose, mark = np.nonzero(far_mm <= whole.radius_mm[0])
            pose += start
            offset = self._marks_mm[mark] - position_mm[pose]
            at = np.einsum("nji,nj->ni", rotation[pose], offset)
            for each in probe.outer:
                inside = (at @ each.planes[:, :3].T <= each.planes[:, 3]).all(axis=1)
                holding[pose[inside]] = True
        return holding

    # ── capsules ─────────────────────────────────────────────────────────────────────────────────

    def _capsule_apart(self, start_mm: Floats, end_mm: Floats, radius_mm: float) -> bool:
        """Whether one capsule is clear of all solids."""
        along = end_mm - start_mm
        share = (self._marks_mm - start_mm) @ along / max(float(along @ along), 1e-300)
        foot = start_mm + np.clip(share, 0.0, 1.0)[:, None] * along
        marks_away_mm = np.linalg.norm(self._marks_mm - foot, axis=1).min(initial=np.inf)
        if marks_away_mm <= radius_mm:
            return False
        ends = np.array([start_mm, end_mm])
        side = self._side(ends)
        if (side == INSIDE).any() or ((side == UNSURE).all() and self._hold(ends[:1])[0]):
            # In a polyhedron around a rounded solid, perhaps not in the solid itself.
            return self._capsule_gap_mm(start_mm, end_mm, radius_mm) > TOUCHING_MM
        outside, inside = self._capsules.bodies(start_mm, end_mm, radius_mm)
        if not outside.meets(self._outer_body):
            # A small solid may be wholly inside the polyhedron around the capsule.
            held = marks_away_mm <= (radius_mm + STEP_MM) * (1.0 + EXCESS) + STEP_MM
            return not held or self._capsule_gap_mm(start_mm, end_mm, radius_mm) > TOUCHING_MM
        if inside is not None and self._inner_body is not None and inside.meets(self._inner_body):
            return False
        return self._capsule_gap_mm(start_mm, end_mm, radius_mm) > TOUCHING_MM

    def _capsule_gap_mm(self, start_mm: Floats, end_mm: Floats, radius_mm: float) -> float:
        probe = Probe([RoundedHull(np.array([start_mm, end_mm]), radius_mm)])
        return self.gap_mm(probe, np.eye(3), np.zeros(3))[0]


def _near(field: DistanceField, probe: Probe, rotation: Floats, position_mm: Floats) -> Ints:
    """The poses that the field of distances leaves open, in order."""
    open_ = np.zeros(len(rotation), dtype=np.bool_)
    for start in range(0, len(rotation), POSES):
        block = slice(start, start + POSES)
        open_[block] = _near_block(field, probe, rotation[block], position_mm[block])
    return np.flatnonzero(open_)


def _near_block(field: DistanceField, probe: Probe, rotation: Floats, position_mm: Floats) -> Bools:
    """Which poses (n,) the field leaves open."""
    open_ = np.zeros(len(rotation), dtype=np.bool_)
    pose = np.arange(len(rotation))
    ball = np.zeros(len(rotation), dtype=np.int64)
    for number, balls in enumerate(probe.levels):
        away = np.empty(len(pose))
        for start in range(0, len(pose), BLOCK):
            block = slice(start, start + BLOCK)
            at, centre_mm = pose[block], balls.centre_mm[ball[block]]
            turned = np.einsum("nij,nj->ni", rotation[at], centre_mm)
            away[block] = field.distance_mm(turned + position_mm[at])
        # A point of the body where the field knows no distance: no finer ball will settle it.
        open_[pose[(away == 0.0) & balls.solid[ball]]] = True
        rest = (away <= balls.radius_mm[ball]) & ~open_[pose]
        pose, ball = pose[rest], ball[rest]
        if number == len(probe.levels) - 1:
            open_[pose] = True
        elif len(pose):
            pose, ball = _children(balls.first_child, pose, ball)
    return open_


def _children(first_child: Ints, pose: Ints, ball: Ints) -> tuple[Ints, Ints]:
    """Each pair of a pose and a ball, replaced by the pairs with that ball's children."""
    first, count = first_child[ball], first_child[ball + 1] - first_child[ball]
    before = np.cumsum(count) - count
    number = np.arange(count.sum()) - np.repeat(before - first, count)
    return np.repeat(pose, count), number

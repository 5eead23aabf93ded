"""The posture article: from drilling directions to full tool orientations.

The tool's z axis is the feed direction a (Step 1). With u the up direction, c = (u x a)/|u x a| is
the horizontal direction in the tangent plane and a x c points up the slope, along u's projection:
(c, a x c, a) is a right-handed frame, and every posture rule here is that frame turned about a by
quarter turns:

    rule                x axis    y axis
    x horizontal          c       a x c        the article's Steps 2 and 3
    y horizontal       -a x c       c
    x toward u          a x c      -c
    y toward u            c       a x c

The article prints the second axis with det R = -1 (its Step 3 has o = a x n with the signs
reversed); here R is right-handed. The article also leaves out that "horizontal" has two answers
(the sign of c), and that there is none where a is parallel to u.

A job may have millions of holes, so the work is done column by column on blocks that fit the
cache; general cross products on (n, 3) arrays take five times as long.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Vector = Sequence[float] | NDArray[np.float64]

# A tilt below this is parallel whatever cone the caller asks for: the heading would be noise.
_LEAST_TILT_RAD = 1e-9

# A `toward` within this (as the cosine of its angle to the horizontal axis) of being perpendicular
# to the axis that it should orient does not choose a sense.
_PERPENDICULAR = 1e-6

# Tool axes are taken as antiparallel when (1 + cos of their angle) / 2 is below this.
_ANTIPARALLEL = 1e-12

_BLOCK = 8192


@dataclass(frozen=True)
class Posture:
    """Tool orientations in the part frame, a row a hole, with what the rule could not decide.

    part_from_tool (n, 3, 3): columns are the tool's x, y, z axes; NaN rows where the rule decides
        nothing (undefined or ambiguous, or a feed direction that is zero or NaN).
    tilt_rad (n,): the angle, 0 to pi/2, between the feed direction and the line along which the
        rule is singular. The heading's noise grows as 1/sin(tilt).
    undefined (n,): the tilt is below the cone asked for, or the feed direction is no direction.
    ambiguous (n,): defined, but `toward` is perpendicular to the horizontal axis, so that it
        picks neither sense. Always False without `toward`.
    """

    part_from_tool: NDArray[np.float64]
    tilt_rad: NDArray[np.float64]
    undefined: NDArray[np.bool_]
    ambiguous: NDArray[np.bool_]


def horizontal(
    feed: NDArray[np.float64], up: Vector, axis: int, toward: Vector | None, cone_rad: float
) -> Posture:
    """Hold the tool's x (axis 0) or y (axis 1) axis horizontal: perpendicular to up.

    feed (n, 3): feed directions in the part frame, normalised here. up (3,): any length.
    toward (3,): the sense with a positive component along it is taken; None takes u x a, the
    article's. cone_rad: a feed direction closer than this to ±up is reported as undefined.
    Source: posture article, Steps 1 to 3. Raises ValueError for a zero up or toward, or an axis
    other than 0 or 1.
    """
    pick = None if toward is None else _unit(toward, "toward")
    return _frames(feed, _unit(up, "up"), pick, cone_rad, _X_IS_C if axis == 0 else _Y_IS_C, axis)


def toward(feed: NDArray[np.float64], direction: Vector, axis: int, cone_rad: float) -> Posture:
    """Point the tool's x (axis 0) or y (axis 1) axis along direction, as far as the feed allows.

    The axis is direction (3,) projected on the plane perpendicular to the feed (n, 3), both in
    the part frame and of any length. cone_rad: a feed closer than this to ±direction is reported
    as undefined. Raises ValueError for a zero direction, or an axis other than 0 or 1.
    """
    turn = _X_IS_SLOPE if axis == 0 else _X_IS_C
    return _frames(feed, _unit(direction, "direction"), None, cone_rad, turn, axis)


# Which of (c, a x c) the x and y axes are, each with its sign.
_X_IS_C = ((0, 1.0), (1, 1.0))
_Y_IS_C = ((1, -1.0), (0, 1.0))
_X_IS_SLOPE = ((1, 1.0), (0, -1.0))

_Turn = tuple[tuple[int, float], tuple[int, float]]


def _unit(vector: Vector, name: str) -> tuple[float, float, float]:
    x, y, z = (float(component) for component in vector)
    largest = max(abs(x), abs(y), abs(z))
    if not 0.0 < largest < np.inf:
        raise ValueError(f"{name} ({x}, {y}, {z}) has no direction")
    x, y, z = x / largest, y / largest, z / largest
    length = float(np.sqrt(x * x + y * y + z * z))
    return x / length, y / length, z / length


def _frames(
    feed: NDArray[np.float64],
    reference: tuple[float, float, float],
    pick: tuple[float, float, float] | None,
    cone_rad: float,
    turn: _Turn,
    axis: int,
) -> Posture:
    if axis not in (0, 1):
        raise ValueError(f"axis {axis} is not 0 (x) or 1 (y)")
    n = len(feed)
    out = Posture(
        np.empty((n, 3, 3)), np.empty(n), np.empty(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    )
    least_tilt_rad = max(cone_rad, _LEAST_TILT_RAD)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore", under="ignore"):
        for start in range(0, n, _BLOCK):
            rows = slice(start, start + _BLOCK)
            _block(
                feed[rows],
                reference,
                pick,
                least_tilt_rad,
                turn,
                Posture(
                    out.part_from_tool[rows],
                    out.tilt_rad[rows],
                    out.undefined[rows],
                    out.ambiguous[rows],
                ),
            )
    return out


def _block(
    feed: NDArray[np.float64],
    reference: tuple[float, float, float],
    pick: tuple[float, float, float] | None,
    least_tilt_rad: float,
    turn: _Turn,
    out: Posture,
) -> None:
    """Fill the views in `out` for one block of holes."""
    ux, uy, uz = reference
    ax, ay, az = np.ascontiguousarray(feed.T)
    length = np.sqrt(ax * ax + ay * ay + az * az)
    ax, ay, az = ax / length, ay / length, az / length

    cx, cy, cz = uy * az - uz * ay, uz * ax - ux * az, ux * ay - uy * ax
    sine = np.sqrt(cx * cx + cy * cy + cz * cz)
    np.arctan2(sine, np.abs(ux * ax + uy * ay + uz * az), out=out.tilt_rad)
    np.logical_not(out.tilt_rad >= least_tilt_rad, out=out.undefined)

    # Close to the singular line c's rounding is no longer small beside c: take out what is left
    # along a, so that the matrix is a rotation to rounding at every tilt.
    along = cx * ax + cy * ay + cz * az
    cx, cy, cz = cx - along * ax, cy - along * ay, cz - along * az
    scale = np.sqrt(cx * cx + cy * cy + cz * cz)
    if pick is not None:
        cosine = (pick[0] * cx + pick[1] * cy + pick[2] * cz) / scale
        np.copyto(out.ambiguous, (np.abs(cosine) < _PERPENDICULAR) & ~out.undefined)
        scale = np.copysign(scale, cosine)
    cx, cy, cz = cx / scale, cy / scale, cz / scale

    slope = (ay * cz - az * cy, az * cx - ax * cz, ax * cy - ay * cx)
    candidates = ((cx, cy, cz), slope)
    for column, (which, sign) in enumerate(turn):
        for row in range(3):
            np.multiply(candidates[which][row], sign, out=out.part_from_tool[:, row, column])
    for row, component in enumerate((ax, ay, az)):
        out.part_from_tool[:, row, 2] = component
    nothing = out.undefined | out.ambiguous
    if nothing.any():
        out.part_from_tool[nothing] = np.nan


def heading_jump_rad(part_from_tool: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far the tool turns about its own axis between neighbours: (n, 3, 3) to (n - 1,), 0 to pi;
    see `heading_turn_rad`."""
    return np.abs(heading_turn_rad(part_from_tool))


def heading_turn_rad(part_from_tool: NDArray[np.float64]) -> NDArray[np.float64]:
    """The turn of the tool about its own axis between neighbours: (n, 3, 3) to (n - 1,), signed.

    Tool k's frame is carried to hole k + 1 by the smallest rotation that takes z_k to z_{k+1}
    (parallel transport); the turn, -pi to pi, is the angle about z_{k+1} from the carried x axis to
    x_{k+1}. That is the twist of D = R_k^T R_{k+1} about z: atan2(D10 - D01, D00 + D11).

    Where z_{k+1} = -z_k every half turn about a perpendicular axis is smallest, and one of them
    carries x_k onto x_{k+1}: the turn is 0. NaN where either neighbour is NaN; (0,) for n < 2.
    """
    n = max(len(part_from_tool) - 1, 0)
    turn_rad = np.empty(n)
    with np.errstate(invalid="ignore", over="ignore"):
        for start in range(0, n, _BLOCK):
            stop = min(start + _BLOCK, n)
            # Six contiguous columns: the x and y axes of holes start .. stop, one overlapping.
            xy = np.ascontiguousarray(
                part_from_tool[start : stop + 1, :, :2].transpose(2, 1, 0), dtype=np.float64
            )
            (x0, y0), (x1, y1) = xy[:, :, :-1], xy[:, :, 1:]
            sine = (y0 * x1).sum(axis=0) - (x0 * y1).sum(axis=0)
            cosine = (x0 * x1).sum(axis=0) + (y0 * y1).sum(axis=0)
            turn = np.arctan2(sine, cosine)
            # hypot(sine, cosine) = 1 + cos of the angle between the tool axes
            turn[np.hypot(sine, cosine) < 2.0 * _ANTIPARALLEL] = 0.0
            turn_rad[start:stop] = turn
    return turn_rad

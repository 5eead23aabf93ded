"""How near a portal's tool comes to the plate while the part moves from one hole to the next."""

from __future__ import annotations

import numpy as np

from drillc.kernels.portal import PortalGeometry, forward
from drillc.language.job import Floats
from drillc.planning.bulge import greatest_rise_mm

#: Where along a travel the tool's place is looked at.
SHARES = (0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875)
#: Travels looked at together: bounds the memory of their matrices.
_BLOCK = 16384


def travel_height_mm(
    geometry: PortalGeometry,
    joints: Floats,
    withdraw_mm: Floats,
    feed_axis: int,
    position_mm: Floats,
    tool_axis: Floats,
) -> Floats:
    """The least height (n - 1,) of the tool over the plate on each travel between neighbours.

    joints (n, 6); the feed joint stays at `withdraw_mm` (n,) of the hole travelled to while the
    others move, all in proportion. position (n, 3) and tool_axis (n, 3), the direction in which the
    tool works, in part coordinates. The plate between two holes is the line from one to the other,
    raised by as much as their normals allow.
    """
    least = np.full(max(0, len(joints) - 1), np.inf)
    for start in range(0, len(least), _BLOCK):
        rows = slice(start, min(start + _BLOCK, len(least)))
        after = slice(rows.start + 1, rows.stop + 1)
        both = slice(rows.start, rows.stop + 1)
        rise = greatest_rise_mm(position_mm[both], tool_axis[both])
        for share in SHARES:
            tool = tool_in_part_mm(geometry, joints[both], withdraw_mm[both], feed_axis, share)
            plate = (1.0 - share) * position_mm[rows] + share * position_mm[after]
            axis = (1.0 - share) * tool_axis[rows] + share * tool_axis[after]
            axis /= np.maximum(np.linalg.norm(axis, axis=1), 1e-9)[:, None]
            height = np.einsum("ij,ij->i", plate - tool, axis) - rise
            least[rows] = np.minimum(least[rows], height)
    return least


def tool_in_part_mm(
    geometry: PortalGeometry, joints: Floats, withdraw_mm: Floats, feed_axis: int, share: float
) -> Floats:
    """Where the tool is (n - 1, 3), in part coordinates, when `share` of each travel between
    neighbours is done: the feed joint rests at the next hole's `withdraw_mm` (n,) while the others,
    of joints (n, 6), move in proportion."""
    q = (1.0 - share) * joints[:-1] + share * joints[1:]
    q[:, feed_axis] = withdraw_mm[1:]
    base_from_part, origin_mm, tool_mm = forward(geometry, q)
    return np.asarray(np.einsum("nji,nj->ni", base_from_part, tool_mm - origin_mm))


def travel_points_mm(
    geometry: PortalGeometry, joints: Floats, withdraw_mm: Floats, feed_axis: int
) -> list[Floats]:
    """The points (n - 1, 3) that the tool passes between neighbours, from where it has withdrawn
    from one hole to where it stands under the next."""
    return [
        tool_in_part_mm(geometry, joints, withdraw_mm, feed_axis, share)
        for share in (0.0, *SHARES, 1.0)
    ]

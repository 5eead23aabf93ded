"""Kinematics of the riveting portal (Robotics I, 5 July 2012; equations cited by number).

The part hangs on a bar between two columns: q1 and q2 raise its ends, which tilts it by alpha, and
q3 = beta rolls it about the bar. The tool below moves along q4, q5 (horizontal) and q6 (vertical),
and works along the vertical only, so that the outward normal must be turned to +z0. The height h of
the bar's middle is free; every other joint is h plus an offset that depends on the hole alone:

    q1 = h + delta     q2 = h - delta     q6 = h + lift     delta = span tan(alpha) / 2

Lengths are in mm. Frames: part is the seed's frame b, base its frame 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .rotations import canonical_angle

Limits = tuple[float, float]


@dataclass(frozen=True)
class PortalGeometry:
    """The seed's D, H and d. Raises ValueError unless H > 0, d >= 0 and D > 2 d."""

    column_distance_mm: float
    column_height_mm: float
    hinge_inset_mm: float

    def __post_init__(self) -> None:
        if not (self.column_height_mm > 0 and self.hinge_inset_mm >= 0 and self.span_mm > 0):
            raise ValueError(
                f"a portal needs H > 0, d >= 0 and D > 2 d: D {self.column_distance_mm} mm, "
                f"H {self.column_height_mm} mm, d {self.hinge_inset_mm} mm"
            )

    @property
    def span_mm(self) -> float:
        """The distance D - 2d between the hinges, horizontally."""
        return self.column_distance_mm - 2.0 * self.hinge_inset_mm

    @property
    def alpha_max_rad(self) -> float:
        """The steepest tilt of the bar, eq. (3)."""
        return float(np.arctan(self.column_height_mm / self.span_mm))


@dataclass(frozen=True)
class Offsets:
    """What a hole asks of the joints, apart from the free height h. Columns (n,), mm.

    delta_mm: q1 - h = h - q2, signed. lift_mm: q6 - h. q4_mm, q5_mm: those joints themselves.
    """

    delta_mm: NDArray[np.float64]
    lift_mm: NDArray[np.float64]
    q4_mm: NDArray[np.float64]
    q5_mm: NDArray[np.float64]


def pointing(
    outward_normal: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The pairs (alpha, beta) that turn a normal to +z0: (n, 3) to two (n, 2), rad, (-pi, pi].

    Column 0 is the upper sign of eqs. (8) and (11), column 1 the lower. With r = hypot(ny, nz)
    the seed's sqrt(1 - nx^2) is r, which needs no unit length. Column 0 always has
    |alpha| < pi/2 and is the only one that the machine can take; column 1 never is.
    NaN where ny = nz = 0, the seed's singularity, or where the normal is NaN.
    """
    nx, ny, nz = np.moveaxis(np.asarray(outward_normal, dtype=np.float64), -1, 0)
    r = np.hypot(ny, nz)
    r = np.where(r > 0.0, r, np.nan)
    alpha_rad = np.stack([np.arctan2(-nx, r), np.arctan2(-nx, -r)], axis=-1)
    beta_rad = np.stack([np.arctan2(ny, nz), np.arctan2(-ny, -nz)], axis=-1)
    beta_rad[np.isnan(alpha_rad)] = np.nan
    return canonical_angle(alpha_rad), canonical_angle(beta_rad)


def offsets(
    geometry: PortalGeometry,
    position_mm: NDArray[np.float64],
    alpha_rad: NDArray[np.float64],
    beta_rad: NDArray[np.float64],
) -> Offsets:
    """Eqs. (12) and (15) with h taken out: position (n, 3) in the part frame, alpha, beta (n,).

    NaN where |alpha| >= pi/2. There tan(alpha) would still give q1 and q2 inside their ranges,
    but by eq. (2) the machine would stand at alpha - pi and hold the normal downwards.
    """
    px, py, pz = np.moveaxis(np.asarray(position_mm, dtype=np.float64), -1, 0)
    sin_a, cos_a = np.sin(alpha_rad), np.cos(alpha_rad)
    sin_b, cos_b = np.sin(beta_rad), np.cos(beta_rad)
    upright = np.where(np.abs(alpha_rad) < np.pi / 2, 1.0, np.nan)
    delta_mm = 0.5 * geometry.span_mm * np.tan(alpha_rad) * upright
    across = (py * sin_b + pz * cos_b) * upright
    return Offsets(
        delta_mm=delta_mm,
        lift_mm=delta_mm - px * sin_a + cos_a * across,
        q4_mm=geometry.hinge_inset_mm + px * cos_a + sin_a * across,
        q5_mm=(py * cos_b - pz * sin_b) * upright,
    )


def height_interval(
    offsets: Offsets,
    q1_limits: Limits,
    q2_limits: Limits,
    q6_limits: Limits,
    below_mm: NDArray[np.float64],
    above_mm: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The heights h (low, high), each (n,) mm, that keep q1, q2 and q6 inside their limits.

    Limits are (lowest, highest) in mm. below_mm and above_mm (n,) say how far the cycle reaches
    under and over the hole along q6, so that q6 - below .. q6 + above stays inside its limits.
    Empty intervals come back as low > high, NaN offsets as NaN.
    """
    delta, lift = offsets.delta_mm, offsets.lift_mm
    low = np.maximum(q1_limits[0] - delta, q2_limits[0] + delta)
    high = np.minimum(q1_limits[1] - delta, q2_limits[1] + delta)
    return (
        np.maximum(low, q6_limits[0] + below_mm - lift),
        np.minimum(high, q6_limits[1] - above_mm - lift),
    )


def widest_margin_mm(
    low_mm: NDArray[np.float64], high_mm: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The height (n,) that keeps q1, q2 and q6 farthest from their limits: the middle.

    Each joint is h plus an offset, so each distance to a limit is h - low_i or high_i - h. The
    smallest of the former is h - low, of the latter high - h, whatever the limits are; the
    lesser of the two is largest at h = (low + high) / 2, where it is (high - low) / 2.
    With all limits [0, H] that is (H + A - B)/2, A = max(|delta|, -lift), B = max(|delta|, lift),
    and the seed's H/2 when |lift| <= |delta|.
    """
    return 0.5 * (low_mm + high_mm)


def joints(
    offsets: Offsets, beta_rad: NDArray[np.float64], height_mm: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Joint values (n, 6): q1, q2 mm, q3 rad, q4, q5, q6 mm. Eqs. (12), (13), (15)."""
    return np.stack(
        [
            height_mm + offsets.delta_mm,
            height_mm - offsets.delta_mm,
            beta_rad,
            offsets.q4_mm,
            offsets.q5_mm,
            height_mm + offsets.lift_mm,
        ],
        axis=-1,
    )


def forward(
    geometry: PortalGeometry, q: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Where the machine stands, from its joints (n, 6) alone: mm and, for q3, rad.

    Returns base_from_part_R (n, 3, 3), base_from_part_t (n, 3) mm, eq. (14), and the tool's
    position (n, 3) mm in the base frame. alpha comes from q1 and q2 by eq. (2), so this is the
    check on a solution: R @ normal must be +z0, and R @ position + t must be the tool.
    """
    q1, q2, q3, q4, q5, q6 = np.moveaxis(np.asarray(q, dtype=np.float64), -1, 0)
    alpha_rad = np.arctan((q1 - q2) / geometry.span_mm)
    sin_a, cos_a = np.sin(alpha_rad), np.cos(alpha_rad)
    sin_b, cos_b = np.sin(q3), np.cos(q3)
    zero = np.zeros_like(q1)
    base_from_part_R = np.stack(
        [
            np.stack([cos_a, sin_a * sin_b, sin_a * cos_b], axis=-1),
            np.stack([zero, cos_b, -sin_b], axis=-1),
            np.stack([-sin_a, cos_a * sin_b, cos_a * cos_b], axis=-1),
        ],
        axis=-2,
    )
    base_from_part_t = np.stack([zero + geometry.hinge_inset_mm, zero, q1], axis=-1)
    return base_from_part_R, base_from_part_t, np.stack([q4, q5, q6], axis=-1)

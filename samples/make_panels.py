"""Makes the samples' hole tables: panel.csv and skin_portal.csv.

    python samples/make_panels.py [FOLDER]

Both skins are patches of a barrel: a circle of radius `meridian_mm`, turned about an axis along x.
A point of it has two angles, u along the fuselage and θ around it:

    point   = (x0 + M sin u,  ρ sin θ,  ρ cos θ - z0)      ρ = R - M (1 - cos u)
    outward = (sin u,  cos u sin θ,  cos u cos θ)          unit as it stands

where M is the meridian's radius, R the crown's, x0 the widest frame's station and z0 how far the
axis lies below the part's origin. Every fastener's angles follow from its id, so that whatever is
expected of a hole can be worked out by hand; the formulas stand beside the rows below.

There is nothing random here and the order is the order of work, so the same bytes come out each
time. A test compares them with the tables in the repository.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Barrel:
    """The surface, in mm."""

    crown_mm: float
    meridian_mm: float
    station_mm: float
    axis_below_mm: float

    def points(
        self, u_deg: NDArray[np.float64], theta_deg: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Positions (n, 3) in mm."""
        u, theta = np.radians(u_deg), np.radians(theta_deg)
        radius = self.crown_mm - self.meridian_mm * (1.0 - np.cos(u))
        return np.stack(
            [
                self.station_mm + self.meridian_mm * np.sin(u),
                radius * np.sin(theta),
                radius * np.cos(theta) - self.axis_below_mm,
            ],
            axis=1,
        )

    def normals(
        self, u_deg: NDArray[np.float64], theta_deg: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Outward unit normals (n, 3)."""
        u, theta = np.radians(u_deg), np.radians(theta_deg)
        return np.stack([np.sin(u), np.cos(u) * np.sin(theta), np.cos(u) * np.cos(theta)], axis=1)


@dataclass(frozen=True)
class Fastener:
    """One hole: its angles on the barrel, its diameter, and the thickness that it joins."""

    id: str
    u_deg: float
    theta_deg: float
    diameter_mm: float = 0.0
    grip_mm: float = 0.0


# ── panel.csv: a crown panel of 2.9 m × 3.5 m, drilled by an arm ─────────────────────────────────

PANEL = Barrel(crown_mm=2000.0, meridian_mm=20_000.0, station_mm=0.0, axis_below_mm=0.0)

#: What lies on the skin, and the skin's land at the lap joint, where two skins meet.
SKIN_MM, STRINGER_MM, TIE_MM, LAND_MM = 1.6, 1.8, 2.2, 2.5
#: All is drilled with one tool; the tooling holes were drilled before, with another.
HOLE_MM, TOOLING_MM = 4.8, 8.0
#: The doubler under an antenna: where it is, and how thick.
DOUBLER_U, DOUBLER_THETA, DOUBLER_MM = (-1.0, 0.6), (-8.0, 8.0), 1.2


def panel() -> Iterator[Fastener]:
    """Stringers, lap joint, frames and tooling holes, each row begun where the last one ended.

    Ssspp  stringer ss = 1 … 19  θ = 5 (ss - 10)°   place pp = 1 … 85  u = 0.1 (pp - 43)°
    Lrrpp  lap row rr = 1, 2     θ = 48 + rr °      place pp = 1 … 85  u = 0.1 (pp - 43)°
    Fffpp  frame ff = 1 … 7      u = 1.4 (4 - ff)°  place pp = 1 … 95  θ = pp - 48 °
    Tnn    tooling holes 01 … 08 along the edges

    Stringers leave out the places under the frames, frames those under the stringers.
    """
    along, around = range(1, 86), range(1, 96)
    for s in range(1, 20):
        for p in _turned(along, s % 2 == 0):
            if (p - 43) % 14:
                u, theta = (p - 43) / 10, 5.0 * (s - 10)
                yield Fastener(f"S{s:02d}{p:02d}", u, theta, HOLE_MM, _grip(STRINGER_MM, u, theta))
    for r in (1, 2):
        for p in _turned(along, r == 1):
            yield Fastener(f"L{r:02d}{p:02d}", (p - 43) / 10, 48.0 + r, HOLE_MM, 2 * LAND_MM)
    for f in range(1, 8):
        for p in _turned(around, f % 2 == 1):
            if (p - 48) % 5:
                u, theta = 14 * (4 - f) / 10, p - 48.0
                yield Fastener(f"F{f:02d}{p:02d}", u, theta, HOLE_MM, _grip(TIE_MM, u, theta))
    corners = [(u, theta) for theta in (-51.5, 51.5) for u in (-4.0, -1.4, 1.4, 4.0)]
    for t, (u, theta) in enumerate(corners, 1):
        yield Fastener(f"T{t:02d}", u, theta, TOOLING_MM, 2 * LAND_MM)


def _grip(under_mm: float, u_deg: float, theta_deg: float) -> float:
    """The skin, what is under it, and the doubler where there is one."""
    doubled = (
        DOUBLER_U[0] <= u_deg <= DOUBLER_U[1] and DOUBLER_THETA[0] <= theta_deg <= DOUBLER_THETA[1]
    )
    return SKIN_MM + under_mm + (DOUBLER_MM if doubled else 0.0)


# ── skin_portal.csv: a skin of 7.7 m × 4.1 m on the bar of the riveting portal ───────────────────

SKIN = Barrel(crown_mm=3000.0, meridian_mm=9000.0, station_mm=4250.0, axis_below_mm=1300.0)


def skin() -> Iterator[Fastener]:
    """Frames, between two longitudinal joints; a path that never jumps across the skin.

    Fffppp  frame ff = 1 … 15  u = 3.6 (ff - 8) + 0.6 °    place ppp = 1 … 141  θ = 0.6 (ppp - 71)°
    Jrppp   joint r = 1, 2     u = 0.45 (ppp - 57) + 0.6 ° place ppp = 1 … 113  θ = -43.2°, +43.2°

    Joint 1 leads from the last frame to the first, the frames lead back, joint 2 ends at the first
    frame again. Joints leave out the places at the frames' ends.
    """
    yield from _joint(1, -43.2)
    for f in range(1, 16):
        for p in _turned(range(1, 142), f % 2 == 0):
            yield Fastener(f"F{f:02d}{p:03d}", (36 * (f - 8) + 6) / 10, 6 * (p - 71) / 10)
    yield from _joint(2, 43.2)


def _joint(r: int, theta_deg: float) -> Iterator[Fastener]:
    for p in range(113, 0, -1):
        if (p - 57) % 8:
            yield Fastener(f"J{r}{p:03d}", (45 * (p - 57) + 60) / 100, theta_deg)


def _turned(places: Sequence[int], backwards: bool) -> Iterable[int]:
    return reversed(places) if backwards else places


# ── writing ──────────────────────────────────────────────────────────────────────────────────────


def panel_csv() -> str:
    """In mm, with diameters and grips; separated by semicolons, as spreadsheets in Europe do."""
    rows = list(panel())
    position, normal = _surface(PANEL, rows)
    lines = ["FAST_ID;X;Y;Z;NX;NY;NZ;DIA;GRIP"]
    for row, p, n in zip(rows, position, normal, strict=True):
        cells = [*_fixed(p, 4), *_fixed(n, 8), *_fixed([row.diameter_mm, row.grip_mm], 1)]
        lines.append(";".join([row.id, *cells]))
    return "\n".join([*lines, ""])


def skin_csv() -> str:
    """In metres, the exam's unit; separated by commas."""
    rows = list(skin())
    position, normal = _surface(SKIN, rows)
    lines = ["FAST_ID,X,Y,Z,NX,NY,NZ"]
    for row, p, n in zip(rows, position / 1000.0, normal, strict=True):
        lines.append(",".join([row.id, *_fixed(p, 7), *_fixed(n, 8)]))
    return "\n".join([*lines, ""])


def _surface(
    barrel: Barrel, rows: Sequence[Fastener]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    u = np.array([row.u_deg for row in rows])
    theta = np.array([row.theta_deg for row in rows])
    return barrel.points(u, theta), barrel.normals(u, theta)


def _fixed(values: Iterable[float], decimals: int) -> list[str]:
    """Numbers with so many decimals; what rounds to zero has no sign."""
    return [f"{round(float(value), decimals) + 0.0:.{decimals}f}" for value in values]


def main(arguments: Sequence[str]) -> None:
    """Write both tables into a folder: the one given, or this file's own."""
    folder = Path(arguments[0]) if arguments else Path(__file__).parent
    for name, text in (("panel.csv", panel_csv()), ("skin_portal.csv", skin_csv())):
        (folder / name).write_bytes(text.encode("ascii"))


if __name__ == "__main__":
    main(sys.argv[1:])

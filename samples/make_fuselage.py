"""Makes what fuselage_arm.drill reads: fuselage/holes.csv, fuselage/skin.ply, fuselage/boards.stl.

    python samples/make_fuselage.py [FOLDER]

The panel is the port side of a barrel: a circle of radius `MERIDIAN_MM` turned about the fuselage's
axis, which is x. A point of it has two angles, u along the fuselage and φ above the horizon:

    point   = (M sin u,  ρ cos φ,  ρ sin φ)       ρ = R - M (1 - cos u)
    outward = (sin u,  cos u cos φ,  cos u sin φ)  unit as it stands

Holes lie along stringers (φ constant) and around frames (u constant); their angles follow from
their ids. Four contour boards, cut to the skin, hold the panel from outside; two straight bars
stand between them (the spec has those as boxes). Where boards and bars hide the skin there is no
hole: those are drilled when the panel hangs in its other holders.

There is nothing random here and coordinates are rounded before they are written, so the same bytes
come out each time. A test compares them with the files in the repository.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

#: The barrel's radius at u = 0, and the radius of its meridian.
RADIUS_MM, MERIDIAN_MM = 2200.0, 16_000.0


def radius_mm(u_rad: Floats) -> Floats:
    """How far the skin is from the fuselage's axis."""
    return RADIUS_MM - MERIDIAN_MM * (1.0 - np.cos(u_rad))


def points(u_deg: Floats, phi_deg: Floats) -> Floats:
    """Points of the skin (n, 3) in mm."""
    u, phi = np.radians(u_deg), np.radians(phi_deg)
    rho = radius_mm(u)
    return np.stack([MERIDIAN_MM * np.sin(u), rho * np.cos(phi), rho * np.sin(phi)], axis=1)


def normals(u_deg: Floats, phi_deg: Floats) -> Floats:
    """Outward unit normals (n, 3)."""
    u, phi = np.radians(u_deg), np.radians(phi_deg)
    return np.stack([np.sin(u), np.cos(u) * np.cos(phi), np.cos(u) * np.sin(phi)], axis=1)


# ── holes.csv ────────────────────────────────────────────────────────────────────────────────────

#: What is joined: the skin with a stringer, or with a frame's flange.
STRINGER_MM, FRAME_MM = 3.4, 4.0
#: Boards and bars stand at these places along the fuselage, u in tenths of a degree; they hide
#: the skin this far to either side.
HELD, HIDDEN = (-50, -30, -10, 10, 30, 50), 5


@dataclass(frozen=True)
class Hole:
    """One hole: its angles on the barrel, and the thickness that it goes through."""

    id: str
    u_deg: float
    phi_deg: float
    stack_mm: float


def holes() -> Iterator[Hole]:
    """In the order of work: the aft half, then the forward half; in each, the stringers from the
    lowest up and then the frames from the middle of the fuselage or its end inwards, so that every
    row begins about where the last one ended.

    Sssppp  stringer ss = 01 … 17  φ = 3 (ss - 9)°  place ppp = 001 … 127  u = 0.1 (ppp - 64)°
    Fffppp  frame ff = 01 … 07     u = 2 (ff - 4)°  place ppp = 001 … 097  φ = 0.5 (ppp - 49)°

    Stringers leave out the places under the frames, frames those under the stringers. The frame in
    the middle, 04, belongs to the forward half.
    """
    for along, frames in ((range(1, 64), (3, 2, 1)), (range(65, 128), (7, 6, 5, 4))):
        for s in range(1, 18):
            for p in along if s % 2 else reversed(along):
                tenths = p - 64
                if tenths % 20 and not any(abs(tenths - at) < HIDDEN for at in HELD):
                    yield Hole(f"S{s:02d}{p:03d}", tenths / 10, 3.0 * (s - 9), STRINGER_MM)
        for f in frames:
            for p in range(97, 0, -1) if f % 2 else range(1, 98):
                if (p - 49) % 6:
                    yield Hole(f"F{f:02d}{p:03d}", 2.0 * (f - 4), 0.5 * (p - 49), FRAME_MM)


def holes_csv() -> bytes:
    """In mm, with outward normals and stacks."""
    rows = list(holes())
    u, phi = np.array([row.u_deg for row in rows]), np.array([row.phi_deg for row in rows])
    lines = ["ID,X,Y,Z,NX,NY,NZ,STACK"]
    for row, p, n in zip(rows, points(u, phi), normals(u, phi), strict=True):
        cells = [*_fixed(p, 3), *_fixed(n, 6), f"{row.stack_mm:.1f}"]
        lines.append(",".join([row.id, *cells]))
    return "\n".join([*lines, ""]).encode("ascii")


def _fixed(values: Floats, decimals: int) -> list[str]:
    """Numbers with so many decimals; what rounds to zero has no sign."""
    return [f"{round(float(value), decimals) + 0.0:.{decimals}f}" for value in values]


# ── skin.ply ─────────────────────────────────────────────────────────────────────────────────────

#: The panel's edges, and the grid's steps: flat triangles are at most 0.45 mm from the true skin.
SKIN_U_DEG, SKIN_PHI_DEG = (-6.6, 6.6), (-26.0, 26.0)
STEPS_U, STEPS_PHI = 22, 32


def skin_ply() -> bytes:
    """The skin as an open mesh, its triangles counter-clockwise seen from outside."""
    u = np.linspace(*SKIN_U_DEG, STEPS_U + 1)
    phi = np.linspace(*SKIN_PHI_DEG, STEPS_PHI + 1)
    vertices = points(*(grid.ravel() for grid in np.meshgrid(u, phi, indexing="ij")))
    number = np.arange(len(vertices)).reshape(len(u), len(phi))
    aft, fore = number[:-1], number[1:]
    return _ply(vertices, _quads(aft[:, :-1], aft[:, 1:], fore[:, 1:], fore[:, :-1]))


def _ply(vertices: Floats, faces: Ints) -> bytes:
    """Binary PLY: coordinates as float32, three indices a face."""
    header = (
        "ply\nformat binary_little_endian 1.0\ncomment mm; part coordinates\n"
        f"element vertex {len(vertices)}\n"
        "property float x\nproperty float y\nproperty float z\n"
        f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    record = np.empty(len(faces), dtype=[("count", "u1"), ("index", "<i4", 3)])
    record["count"], record["index"] = 3, faces
    return header.encode("ascii") + _float32(vertices).tobytes() + record.tobytes()


# ── boards.stl ───────────────────────────────────────────────────────────────────────────────────

#: Contour boards: where they stand along the fuselage, how thick they are, how far from the skin
#: their edges are, and the steps of their arcs.
BOARDS_U_DEG = (-5.0, -3.0, 3.0, 5.0)
BOARD_MM, BOARD_OFF_MM = 40.0, (12.0, 140.0)
BOARD_PHI_DEG, BOARD_STEPS = (-28.0, 28.0), 14


def boards_stl() -> bytes:
    """All boards as closed meshes in one file."""
    return _stl(np.concatenate([_board(u) for u in BOARDS_U_DEG]))


def _board(u_deg: float) -> Floats:
    """Triangles (k, 3, 3): a flat ring's sector, its corners aft/forward and inner/outer."""
    u = np.radians(u_deg)
    phi = np.radians(np.linspace(*BOARD_PHI_DEG, BOARD_STEPS + 1))
    corners = []
    for x in (-0.5 * BOARD_MM, 0.5 * BOARD_MM):
        for off in BOARD_OFF_MM:
            rho = float(radius_mm(u)) + off
            along = np.full(len(phi), MERIDIAN_MM * np.sin(u) + x)
            corners.append(np.stack([along, rho * np.cos(phi), rho * np.sin(phi)], axis=1))
    number = np.arange(4 * len(phi)).reshape(4, len(phi))
    aft_in, aft_out, fore_in, fore_out = number
    faces = [_quads(aft_in[:1], aft_out[:1], fore_out[:1], fore_in[:1])]
    for one, other in (
        (aft_out, aft_in),
        (fore_in, fore_out),
        (fore_out, aft_out),
        (aft_in, fore_in),
    ):
        faces.append(_quads(one[:-1], other[:-1], other[1:], one[1:]))
    faces.append(_quads(aft_in[-1:], fore_in[-1:], fore_out[-1:], aft_out[-1:]))
    return np.concatenate(corners)[np.concatenate(faces)]


def _stl(triangles: Floats) -> bytes:
    """Binary STL; the normals are left to the reader."""
    layout = [("normal", "<f4", 3), ("at", "<f4", (3, 3)), ("attribute", "<u2")]
    record = np.zeros(len(triangles), dtype=layout)
    record["at"] = _float32(triangles)
    title = b"contour boards; mm; part coordinates".ljust(80)
    return title + np.array(len(triangles), dtype="<u4").tobytes() + record.tobytes()


def _quads(a: Ints, b: Ints, c: Ints, d: Ints) -> Ints:
    """Two triangles for each quadrilateral a b c d."""
    corners = (np.asarray(side).ravel() for side in (a, b, c, d))
    first, second, third, fourth = corners
    return np.concatenate(
        [np.stack([first, second, third], axis=1), np.stack([first, third, fourth], axis=1)]
    )


def _float32(coordinates: Floats) -> NDArray[np.float32]:
    """Rounded to a micrometre first; what rounds to zero has no sign."""
    return (np.round(coordinates, 3) + 0.0).astype("<f4")


def main(arguments: Sequence[str]) -> None:
    """Write the files into a folder: the one given, or `fuselage` beside this file."""
    folder = Path(arguments[0]) if arguments else Path(__file__).parent / "fuselage"
    made = {"holes.csv": holes_csv(), "skin.ply": skin_ply(), "boards.stl": boards_stl()}
    for name, content in made.items():
        (folder / name).write_bytes(content)


if __name__ == "__main__":
    main(sys.argv[1:])

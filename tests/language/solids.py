"""Meshes of boxes as files, for the tests that read them."""

from __future__ import annotations

import io
import struct
import zipfile

import numpy as np

#: Corners by the bits of their number (x, y, z), and twelve triangles that face outward.
_FACES = (
    *((0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)),
    *((2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)),
)
Corner = tuple[float, float, float]


def corners(low: Corner, high: Corner) -> list[Corner]:
    ends = (low, high)
    return [(ends[x][0], ends[y][1], ends[z][2]) for x in (0, 1) for y in (0, 1) for z in (0, 1)]


def obj(low: Corner, high: Corner, lack: int = 0) -> str:
    """A box as OBJ, without its last `lack` triangles."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners(low, high)]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in _FACES[: len(_FACES) - lack]]
    return "\n".join(lines) + "\n"


def stl(low: Corner, high: Corner) -> bytes:
    """A box as binary STL."""
    points = np.array(corners(low, high), dtype="<f4")
    triangles = b"".join(bytes(12) + points[list(face)].tobytes() + bytes(2) for face in _FACES)
    return bytes(80) + struct.pack("<I", len(_FACES)) + triangles


def threemf(model: bytes) -> bytes:
    """A 3MF archive that holds this model, well packed."""
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        # A time of its own: the bytes stand in tests' names, which may not change with the clock.
        entry = zipfile.ZipInfo("3D/3dmodel.model", (2000, 1, 1, 0, 0, 0))
        archive.writestr(entry, model, zipfile.ZIP_DEFLATED)
    return file.getvalue()

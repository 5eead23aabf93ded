"""What is wrong with a mesh file, and how much of one is read."""

from __future__ import annotations

MOST_TRIANGLES = 4_000_000
MOST_BYTES = 1 << 30


class MeshError(Exception):
    """Why a mesh file cannot be used, as half a sentence without the file's name."""


def check_triangles(count: int) -> None:
    """Refuse more triangles than are read."""
    if count > MOST_TRIANGLES:
        raise MeshError(f"it has {count:,} triangles; at most {MOST_TRIANGLES:,} are read")

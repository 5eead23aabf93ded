"""Many vectors at a time, (n, 3): the few operations that checks need, with no slow short axis."""

from __future__ import annotations

import numpy as np

from .events import Floats


def dot(one: Floats, two: Floats) -> Floats:
    """Products (n,)."""
    return np.asarray(np.einsum("ij,ij->i", one, two))


def length(vector: Floats) -> Floats:
    """Lengths (n,)."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", vector, vector)))


def aside(vector: Floats, axis: Floats) -> Floats:
    """The length (n,) of what vectors have across unit axes (n, 3)."""
    return length(vector - dot(vector, axis)[:, None] * axis)


def largest(vector: Floats) -> Floats:
    """The largest (n,) of the three parts, sign aside; NaN if one is."""
    part = np.abs(vector)
    return np.asarray(np.maximum(np.maximum(part[:, 0], part[:, 1]), part[:, 2]))


def angle(one: Floats, two: Floats) -> Floats:
    """Between unit vectors, (n,) in rad; exact where it is small."""
    return np.asarray(2.0 * np.arcsin(np.minimum(0.5 * length(one - two), 1.0)))

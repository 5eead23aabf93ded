"""What is connected, closed and wound one way in a triangle mesh: faces (f, 3) of vertex indices.

Only indices count: vertices at one place must have been merged.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .shapes import Mesh

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def components(faces: Ints) -> Ints:
    """The number (f,) of the piece that each face belongs to, from 0, in the faces' order.

    Faces are of one piece where they share an edge.
    """
    from scipy.sparse.csgraph import connected_components  # slow to import

    first, second, _ = _pairs(faces)
    _, label = connected_components(_graph(first, second, len(faces)), directed=False)
    _, start, number = np.unique(label, return_index=True, return_inverse=True)
    return np.argsort(np.argsort(start))[number].astype(np.int64)


def closed(faces: Ints, piece: Ints) -> Bools:
    """Which pieces (p,) bound a solid: every edge is run through as often one way as the other."""
    if len(faces) == 0:
        return np.zeros(0, dtype=np.bool_)
    key, forward = _edge_keys(faces)
    _, edge = np.unique(key, return_inverse=True)
    # An edge belongs to one piece alone, because faces that share one are of one piece.
    balance = np.bincount(edge, weights=np.where(forward, 1.0, -1.0))
    result = np.ones(piece.max() + 1, dtype=np.bool_)
    result[np.repeat(piece, 3)[balance[edge] != 0.0]] = False
    return result


def wound(faces: Ints) -> Ints:
    """The faces, some turned over so that neighbours agree on which side is outside.

    Each piece keeps the side of the greater number of its faces; a piece that has but one side
    (a Möbius strip) is returned as it was.
    """
    from scipy.sparse.csgraph import connected_components  # slow to import

    count = len(faces)
    first, second, agree = _pairs(faces)
    # Face i as it is is node i, turned over node i + count. Two neighbours that agree are joined
    # as they are, and turned both; else one as it is with the other turned.
    other = np.where(agree, 0, count)
    starts = np.concatenate([first, first + count])
    ends = np.concatenate([second + other, second + count - other])
    _, label = connected_components(_graph(starts, ends, 2 * count), directed=False)
    as_is, turned = label[:count], label[count:]
    votes = np.bincount(as_is, minlength=label.max() + 1)
    # The two labels of a piece are mirror images; of two equal votes the lower label counts.
    turn = (votes[turned] > votes[as_is]) | ((votes[turned] == votes[as_is]) & (turned < as_is))
    return np.where(turn[:, None], faces[:, ::-1], faces)


def volume_mm3(mesh: Mesh, piece: Ints) -> NDArray[np.float64]:
    """The volume (p,) that each piece encloses; negative where its faces look inward."""
    corner = mesh.vertices_mm[mesh.faces]
    corner = corner - mesh.vertices_mm.mean(axis=0)
    six = np.einsum("ij,ij->i", corner[:, 0], np.cross(corner[:, 1], corner[:, 2]))
    return np.bincount(piece, weights=six / 6.0).astype(np.float64)


def _edge_keys(faces: Ints) -> tuple[Ints, Bools]:
    """For the three edges of each face (3 f,): one number per undirected edge, its direction."""
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    key = np.minimum(start, end) * (faces.max(initial=0) + 1) + np.maximum(start, end)
    return key, start < end


def _pairs(faces: Ints) -> tuple[Ints, Ints, Bools]:
    """Pairs of faces that share an edge, and whether they run through it in opposite directions.

    An edge of more than two faces gives a chain of pairs; these count as agreeing, since what
    meets there may be several solids.
    """
    key, forward = _edge_keys(faces)
    order = np.argsort(key, kind="stable")
    key, forward, face = key[order], forward[order], order // 3
    same = key[1:] == key[:-1]
    inner = same.copy()
    inner[1:] &= ~same[:-1]
    inner[:-1] &= ~same[1:]
    agree = (forward[1:] != forward[:-1]) | ~inner
    return face[:-1][same], face[1:][same], agree[same]


def _graph(first: Ints, second: Ints, count: int) -> Any:
    from scipy.sparse import coo_array

    ones = np.ones(len(first), dtype=np.int8)
    return coo_array((ones, (first, second)), shape=(count, count)).tocsr()

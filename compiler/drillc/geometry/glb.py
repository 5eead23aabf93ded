"""Binary glTF 2.0 (GLB): the triangles of its scene, flattened. Nothing outside the file is read,
and no materials, images, skins or animations.

Khronos, glTF 2.0 specification, sections 3.5 to 3.7 and 4.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .mesh_error import MeshError, check_triangles
from .shapes import Floats

Ints = NDArray[np.int64]
Piece = tuple[Floats, Ints]  # vertices (v, 3), faces (f, 3)

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC3": 3}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6
_DEEPEST = 100


def read_glb(data: bytes) -> Iterator[Piece]:
    """The pieces of the default scene, in its coordinates, in the order of its nodes."""
    header, binary = _chunks(data)
    file = _File(header, binary)
    count = 0
    for mesh, matrix in file.placed():
        for primitive in header["meshes"][mesh]["primitives"]:
            count += file.triangles(primitive)
            check_triangles(count)
            if file.triangles(primitive) > 0:
                vertices, faces = file.primitive(primitive)
                if np.linalg.det(matrix[:3, :3]) < 0.0:
                    faces = faces[:, ::-1]
                yield vertices @ matrix[:3, :3].T + matrix[:3, 3], faces


def _chunks(data: bytes) -> tuple[dict[str, Any], bytes]:
    if data[:4] != b"glTF":
        raise MeshError("it does not begin like a GLB file")
    version, length = struct.unpack_from("<II", data, 4)
    if version != 2:
        raise MeshError(f"it is glTF version {version}; version 2 is read")
    if length != len(data):
        raise MeshError(f"it says that it has {length} bytes, and has {len(data)}")
    found: dict[int, bytes] = {}
    at = 12
    while at + 8 <= len(data):
        size, kind = struct.unpack_from("<II", data, at)
        if at + 8 + size > len(data):
            raise MeshError("a chunk reaches past its end")
        found.setdefault(kind, data[at + 8 : at + 8 + size])
        at += 8 + size
    header = json.loads(found[0x4E4F534A])
    return header, found.get(0x004E4942, b"")


class _File:
    def __init__(self, header: dict[str, Any], binary: bytes) -> None:
        self._header = header
        self._binary = binary
        if any("uri" in buffer for buffer in header.get("buffers", [])):
            raise MeshError("it refers to data outside itself")
        if needed := header.get("extensionsRequired"):
            raise MeshError(f"it needs the extension {needed[0]}")

    def placed(self) -> Iterator[tuple[int, Floats]]:
        """The meshes' numbers, and where each stands (4, 4)."""
        nodes = self._header.get("nodes", [])
        scenes = self._header.get("scenes", [])
        roots = scenes[self._header.get("scene", 0)].get("nodes", []) if scenes else []
        seen: set[int] = set()
        stack = [(node, np.eye(4), 0) for node in reversed(roots)]
        while stack:
            number, matrix, depth = stack.pop()
            if number in seen or depth > _DEEPEST:
                raise MeshError("its nodes are no tree")
            seen.add(number)
            node = nodes[number]
            matrix = matrix @ _matrix(node)
            if "mesh" in node:
                yield node["mesh"], matrix
            stack += [(child, matrix, depth + 1) for child in reversed(node.get("children", []))]

    def triangles(self, primitive: dict[str, Any]) -> int:
        """How many triangles a primitive makes; 0 for points and lines."""
        source = primitive.get("indices", primitive["attributes"]["POSITION"])
        count = int(self._header["accessors"][source]["count"])
        mode = primitive.get("mode", _TRIANGLES)
        if mode == _TRIANGLES:
            return count // 3
        return max(count - 2, 0) if mode in (_STRIP, _FAN) else 0

    def primitive(self, primitive: dict[str, Any]) -> Piece:
        vertices = self._accessor(primitive["attributes"]["POSITION"], "VEC3").astype(np.float64)
        if "indices" in primitive:
            index = self._accessor(primitive["indices"], "SCALAR")[:, 0].astype(np.int64)
        else:
            index = np.arange(len(vertices))
        mode = primitive.get("mode", _TRIANGLES)
        if mode == _TRIANGLES:
            return vertices, index[: len(index) // 3 * 3].reshape(-1, 3)
        if mode == _FAN:
            first = np.full(len(index) - 2, index[0])
            return vertices, np.stack([first, index[1:-1], index[2:]], axis=1)
        faces = np.stack([index[:-2], index[1:-1], index[2:]], axis=1)
        faces[1::2] = faces[1::2, ::-1]
        return vertices, faces

    def _accessor(self, number: int, shape: str) -> NDArray[Any]:
        accessor = self._header["accessors"][number]
        if accessor["type"] != shape or "sparse" in accessor or accessor.get("normalized"):
            raise MeshError("it keeps positions or indices in a form that is not read")
        kind, width = np.dtype(_TYPES[accessor["componentType"]]), _WIDTHS[shape]
        view = self._header["bufferViews"][accessor["bufferView"]]
        stride = view.get("byteStride", kind.itemsize * width)
        start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        count = accessor["count"]
        if min(start, count) < 0 or stride < kind.itemsize * width or view.get("buffer") != 0:
            raise MeshError("an accessor is out of bounds")
        rows: NDArray[Any] = np.ndarray(
            (count, width), kind, self._binary, start, (stride, kind.itemsize)
        )
        return rows


def _matrix(node: dict[str, Any]) -> Floats:
    """A node's own placement (4, 4): a matrix by columns, or translation, rotation and scale."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    x, y, z, w = node.get("rotation", [0.0, 0.0, 0.0, 1.0])
    matrix = np.eye(4)
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= np.array(node.get("scale", [1.0, 1.0, 1.0]), dtype=np.float64)
    matrix[:3, 3] = node.get("translation", [0.0, 0.0, 0.0])
    return matrix

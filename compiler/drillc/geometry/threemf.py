"""3MF: the triangles of what it asks to be built. Of the archive, only its model parts are read.

3MF Consortium, Core Specification 1.3, sections 2 to 4; `path`: Production Extension 1.1.
"""

from __future__ import annotations

import io
import zipfile
from array import array
from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

import numpy as np
from numpy.typing import NDArray

from .mesh_error import MOST_TRIANGLES, MeshError, check_triangles
from .shapes import Floats

Ints = NDArray[np.int64]
Piece = tuple[Floats, Ints]  # vertices (v, 3), faces (f, 3)

MOST_XML_BYTES = 160 * MOST_TRIANGLES
_MOST_PLACED = 100_000
_DEEPEST = 50
_ROOT = "3d/3dmodel.model"


@dataclass
class _Object:
    vertices: array[float] = field(default_factory=lambda: array("d"))  # x y z x y z …
    faces: array[int] = field(default_factory=lambda: array("q"))  # three indices each
    parts: list[_Placed] = field(default_factory=list)


@dataclass(frozen=True, eq=False)
class _Placed:
    path: str
    name: str
    matrix: Floats  # (4, 3): a row p becomes (p, 1) @ matrix


def read_3mf(data: bytes) -> Iterator[Piece]:
    """The pieces to be built, in the build's coordinates, in its order."""
    archive = _Archive(data)
    count = placed = 0
    stack = [(each, 0) for each in reversed(archive.build())]
    while stack:
        each, depth = stack.pop()
        thing = archive.thing(each.path, each.name)
        placed += 1
        count += len(thing.faces) // 3
        check_triangles(count)
        if placed > _MOST_PLACED or depth > _DEEPEST:
            raise MeshError("its objects are built of one another too often or too deeply")
        if thing.faces:
            faces = np.array(thing.faces, dtype=np.int64).reshape(-1, 3)
            if np.linalg.det(each.matrix[:3]) < 0.0:
                faces = faces[:, ::-1]
            vertices = np.array(thing.vertices, dtype=np.float64).reshape(-1, 3)
            yield vertices @ each.matrix[:3] + each.matrix[3], faces
        for part in reversed(thing.parts):
            matrix = part.matrix @ each.matrix[:3]
            matrix[3] += each.matrix[3]
            stack.append((_Placed(part.path, part.name, matrix), depth + 1))


class _Archive:
    def __init__(self, data: bytes) -> None:
        self._zip = zipfile.ZipFile(io.BytesIO(data))
        self._members = {m.filename.lstrip("/").lower(): m for m in self._zip.infolist()}
        self._models: dict[str, _Model] = {}
        self._left = MOST_XML_BYTES

    def build(self) -> list[_Placed]:
        if _ROOT not in self._members:
            raise MeshError("it holds no 3D/3dmodel.model")
        return self._model(_ROOT).build

    def thing(self, path: str, name: str) -> _Object:
        objects = self._model(path).objects
        if name not in objects:
            raise MeshError(f"it names an object {name[:40]!r} that it does not hold")
        return objects[name]

    def _model(self, path: str) -> _Model:
        if path not in self._models:
            member = self._members[path]
            self._left -= member.file_size
            if self._left < 0:
                raise MeshError(f"its models have more than {MOST_XML_BYTES:,} bytes when unpacked")
            with self._zip.open(member) as stream:
                self._models[path] = _Model(path, stream.read())
        return self._models[path]


class _Model:
    """One model part, read by a stream of tags: no tree is built, and no entity is followed."""

    def __init__(self, path: str, text: bytes) -> None:
        self.objects: dict[str, _Object] = {}
        self.build: list[_Placed] = []
        self._path = path
        self._object = _Object()
        self._triangles = 0
        parser = expat.ParserCreate(namespace_separator=" ")
        parser.StartElementHandler = self._start
        parser.StartDoctypeDeclHandler = self._doctype
        parser.Parse(text, True)

    def _doctype(self, *_: object) -> None:
        raise MeshError("its XML has a document type, which 3MF forbids")

    def _start(self, name: str, attributes: dict[str, str]) -> None:
        match name.rpartition(" ")[2]:
            case "vertex":
                x, y, z = attributes["x"], attributes["y"], attributes["z"]
                self._object.vertices.extend((float(x), float(y), float(z)))
            case "triangle":
                self._triangles += 1
                check_triangles(self._triangles)
                a, b, c = attributes["v1"], attributes["v2"], attributes["v3"]
                self._object.faces.extend((int(a), int(b), int(c)))
            case "object":
                self._object = self.objects[attributes["id"]] = _Object()
            case "component":
                self._object.parts.append(self._placed(attributes))
            case "item":
                self.build.append(self._placed(attributes))

    def _placed(self, attributes: dict[str, str]) -> _Placed:
        named = [value for key, value in attributes.items() if key.rpartition(" ")[2] == "path"]
        path = named[0].lstrip("/").lower() if named else self._path
        text = attributes.get("transform", "1 0 0 0 1 0 0 0 1 0 0 0")
        matrix = np.array(text.split(), dtype=np.float64).reshape(4, 3)
        return _Placed(path, attributes["objectid"], matrix)

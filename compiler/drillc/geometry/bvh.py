"""Collision and distance of triangle meshes, by python-fcl.

Its tests of a mesh against a mesh are exact to rounding; those of a mesh against a shape iterate
and are not used. A mesh is its surface alone.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .shapes import Floats, Mesh


class Body:
    """A mesh with its tree, that can be moved."""

    def __init__(self, mesh: Mesh) -> None:
        import fcl  # slow to import, and most specs need no collisions

        self._fcl: Any = fcl
        model = fcl.BVHModel()
        model.beginModel(len(mesh.vertices_mm), len(mesh.faces))
        model.addSubModel(np.ascontiguousarray(mesh.vertices_mm), mesh.faces)
        model.endModel()
        self._object = fcl.CollisionObject(model, fcl.Transform())
        self._yes_or_no = fcl.CollisionRequest(num_max_contacts=1, enable_contact=False)
        self._how_far = fcl.DistanceRequest()

    def move(self, rotation: Floats, position_mm: Floats) -> None:
        """Put the body where its points are rotation @ p + position."""
        self._object.setTransform(self._fcl.Transform(rotation, position_mm))

    def meets(self, other: Body) -> bool:
        """Whether the two surfaces have a point in common."""
        result = self._fcl.CollisionResult()
        return bool(self._fcl.collide(self._object, other._object, self._yes_or_no, result))

    def distance_mm(self, other: Body) -> float:
        """The distance of the two surfaces; 0 where they meet."""
        result = self._fcl.DistanceResult()
        far = self._fcl.distance(self._object, other._object, self._how_far, result)
        return max(float(far), 0.0)

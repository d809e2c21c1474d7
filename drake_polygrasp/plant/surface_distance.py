"""Measures signed distances from points to a body's collision geometry, by Drake if it can.

Drake measures to the true surface of every shape, not to its convex hull. But it rejects a mesh in
which two triangles meet at a very sharp edge (a thin wedge, a needle, a burr): it takes the sign
from the sum of their normals, which is almost zero. For such a shape, we measure to the triangles
that Drake has of it and take the sign from their winding number. Drake's distances to an ellipsoid
are off by a thousandth of its size, so we find its nearest point ourselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import (
    Ellipsoid,
    GeometryInstance,
    ProximityProperties,
    QueryObject,
    SceneGraph,
    Shape,
)
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import nearest_on_triangles
from drake_polygrasp.loading.shapes import part_of
from drake_polygrasp.plant.drake_calls import refusal_reason


@dataclass(frozen=True, eq=False)
class Nearest:
    """The point N of a surface that is nearest to a point Q.

    Attributes:
        distance: distance of Q from N [m], negative if Q is inside the body.
        p_BN: position of N [m], shape (3,).
    """

    distance: float
    p_BN: Array


class SurfaceDistance:
    """Signed distances from points to the union of a body's shapes."""

    def __init__(self, parts: Sequence[tuple[Shape, RigidTransform]]) -> None:
        """Registers the shapes.

        Args:
            parts: shapes with their poses X_BG.

        Raises:
            RuntimeError: when Drake rejects a shape; SystemExit when one of its assertions fails.
        """
        self._parts = [
            _EllipsoidPart(shape, X_BG) if isinstance(shape, Ellipsoid) else _Part(shape, X_BG)
            for shape, X_BG in parts
        ]

    def nearest(self, p_BQ: Array) -> Nearest:
        """Returns the nearest point of the surface.

        Args:
            p_BQ: position of the point Q to measure from [m], shape (3,).

        Raises:
            RuntimeError: when Drake cannot measure to a shape, and has no triangles of it.
        """
        return min((part.nearest(p_BQ) for part in self._parts), key=lambda n: n.distance)

    @property
    def refusal(self) -> str:
        """Why Drake could not measure a distance so far; empty if it measured all."""
        return next((part.refusal for part in self._parts if part.refusal), "")


class _EllipsoidPart:
    """An ellipsoid. From inside only the sign is exact, and the point found is not the nearest."""

    refusal = ""

    def __init__(self, shape: Ellipsoid, X_BG: RigidTransform) -> None:
        part = part_of(shape, X_BG, mu=1.0)
        assert part is not None and part.primitive is not None
        self._solid = part.primitive

    def nearest(self, p_BQ: Array) -> Nearest:
        distance = float(self._solid.distance(p_BQ[None])[0])
        if distance > 0:
            return Nearest(distance, self._solid.nearest_outside(p_BQ[None])[0])
        return Nearest(distance, self._solid.project(p_BQ[None])[0][0])


@dataclass
class _Part:
    """A shape in a SceneGraph of its own, so that Drake's rejection concerns only this shape."""

    shape: Shape
    X_BG: RigidTransform
    refusal: str = ""
    _context: Context = field(init=False)
    _scene_graph: SceneGraph = field(init=False)
    _soup: TriangleSoup | None = None

    def __post_init__(self) -> None:
        self._scene_graph = SceneGraph()
        instance = GeometryInstance(self.X_BG, self.shape, "surface")
        instance.set_proximity_properties(ProximityProperties())
        source = self._scene_graph.RegisterSource("source")
        self._scene_graph.RegisterAnchoredGeometry(source, instance)
        self._context = self._scene_graph.CreateDefaultContext()

    def nearest(self, p_BQ: Array) -> Nearest:
        if self._soup is None:
            query: QueryObject = self._scene_graph.get_query_output_port().Eval(self._context)
            try:
                (found,) = query.ComputeSignedDistanceToPoint(p_BQ)
                p_BN = self.X_BG.multiply(found.p_GN)
                return Nearest(float(found.distance), np.asarray(p_BN))
            except (RuntimeError, SystemExit) as error:
                self.refusal = refusal_reason(error)
        return self._nearest_triangle(p_BQ)

    def _nearest_triangle(self, p_BQ: Array) -> Nearest:
        if self._soup is None:
            part = part_of(self.shape, self.X_BG, mu=1.0)
            if part is None or part.primitive is not None:
                raise RuntimeError(self.refusal)  # It has no triangles to measure to.
            self._soup = TriangleSoup(part.triangles_B)
        points = nearest_on_triangles(p_BQ, self._soup.triangles)
        distances = np.linalg.norm(points - p_BQ, axis=1)
        k = int(distances.argmin())
        # A winding number of -1 is inside too: the triangles may be oriented inward.
        inside = self._soup.winding_numbers(p_BQ[None])[0] != 0
        return Nearest(float(-distances[k] if inside else distances[k]), points[k])

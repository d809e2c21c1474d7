"""Signed distances from points to a body's own collision geometry, measured by Drake where it does.

Drake measures to the true surface of every shape, not to its convex hull, but refuses a mesh in
which two triangles meet at a very sharp edge (a knife-thin wedge, a needle, a burr): the sum of
their normals, from which it takes the sign, is almost zero. To such a shape, distances are measured
on the triangles that Drake has of it, and the sign is that of their winding number.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import GeometryInstance, ProximityProperties, QueryObject, SceneGraph, Shape
from pydrake.math import RigidTransform
from pydrake.systems.framework import Context

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import nearest_on_triangles
from drake_polygrasp.loading.shapes import part_of
from drake_polygrasp.plant.drake_calls import refusal_reason


@dataclass(frozen=True, eq=False)
class Nearest:
    """The point of a surface that is nearest to another point.

    Attributes:
        distance: between the two [m], negative inside the body.
        p_BN: the surface's point [m], shape (3,).
    """

    distance: float
    p_BN: Array


class SurfaceDistance:
    """Signed distances to the union of a body's shapes, each with its pose X_BG.

    Raises RuntimeError, or SystemExit, when Drake cannot register a shape.
    """

    def __init__(self, parts: Sequence[tuple[Shape, RigidTransform]]) -> None:
        self._parts = [_Part(shape, X_BG) for shape, X_BG in parts]

    def nearest(self, p_BQ: Array) -> Nearest:
        """The nearest point of the surface to p_BQ [m], shape (3,).

        Raises:
            RuntimeError: when a shape can be measured in neither way.
        """
        return min((part.nearest(p_BQ) for part in self._parts), key=lambda n: n.distance)

    @property
    def refusal(self) -> str:
        """Why Drake did not measure some distance asked for so far; empty where it measured all."""
        return next((part.refusal for part in self._parts if part.refusal), "")


@dataclass
class _Part:
    """One shape, alone in a SceneGraph of its own, so that it alone can be refused."""

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
                raise RuntimeError(self.refusal)  # It has no triangles to measure on.
            self._soup = TriangleSoup(part.triangles_B)
        points = nearest_on_triangles(p_BQ, self._soup.triangles)
        distances = np.linalg.norm(points - p_BQ, axis=1)
        k = int(distances.argmin())
        # Wound inward too, triangles that go around a point once have it inside.
        inside = self._soup.winding_numbers(p_BQ[None])[0] != 0
        return Nearest(float(-distances[k] if inside else distances[k]), points[k])

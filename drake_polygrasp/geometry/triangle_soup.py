"""Triangles that points ask of again and again: which are near, and how often they wind around."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.geometry.triangles import point_triangle_distance

_POINTS_AT_ONCE = 1 << 12
"""Ours: temporaries of some ten megabytes."""
_RAY = np.array([[0.6, -0.48, 0.64], [0.8, 0.36, -0.48], [0.0, 0.8, 0.6]])
"""A rotation, ours, whose third column no usual face is parallel to."""


class _Boxes(NamedTuple):
    """The bounding boxes of triangles."""

    low: Array
    """Shape (T, 3)."""
    high: Array
    """Shape (T, 3)."""
    tree: shapely.STRtree
    """Of their sides across z."""


@dataclass(frozen=True, eq=False)
class TriangleSoup:
    """Triangles in no order, with the trees that finding them takes, each built once."""

    triangles: Array
    """Shape (T, 3, 3)."""

    @cached_property
    def _boxes(self) -> _Boxes:
        low, high = self.triangles.min(axis=1), self.triangles.max(axis=1)
        sides = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
        return _Boxes(low, high, shapely.STRtree(sides))

    @cached_property
    def _along_ray(self) -> TriangleSoup:
        return TriangleSoup(self.triangles @ _RAY)

    def __reduce__(self) -> tuple[type[TriangleSoup], tuple[Array]]:
        """Trees are not pickled."""
        return TriangleSoup, (self.triangles,)

    def winding_numbers(self, points: Array) -> Ints:
        """How often closed, outward-oriented triangles wind around points (M, 3); (M,).

        Counts signed crossings of a ray from each point. Sides belong to one of the two triangles
        that share them, so that none is counted twice.
        """
        if not len(self.triangles) or not len(points):
            return np.zeros(len(points), dtype=np.int64)
        # Along no axis, where the walls of made things would hold the whole ray.
        points, triangles = points @ _RAY, self._along_ray.triangles
        _, high, tree = self._along_ray._boxes
        i, t = tree.query(shapely.points(points[:, :2]))
        i, t = (x[points[i, 2] <= high[t, 2]] for x in (i, t))
        corner = triangles[t] - points[i][:, None]
        head = np.roll(corner, -1, axis=1)
        left = corner[..., 0] * head[..., 1] - head[..., 0] * corner[..., 1]
        upward = (corner[..., 1] <= 0) & (head[..., 1] > 0) & (left > 0)
        downward = (head[..., 1] <= 0) & (corner[..., 1] > 0) & (left < 0)
        turns = upward.sum(axis=1) - downward.sum(axis=1)
        normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        above = np.einsum("ni,ni->n", corner[:, 0], normal) * np.sign(normal[:, 2]) > 0
        winding = np.bincount(i, weights=turns * above, minlength=len(points))
        return winding.astype(np.int64)

    def near(self, points: Array, reach: float) -> tuple[Ints, Ints]:
        """Pairs (point, triangle) of which the bounding box is within `reach` along each axis.

        Shapes (N,) and (N,).
        """
        none = np.empty(0, np.int64)
        pairs = [(none, none), *self._near(points, reach)]
        point, triangle = (np.concatenate(x) for x in zip(*pairs, strict=True))
        return point, triangle

    def closer_than(self, points: Array, reach: float) -> tuple[Ints, Ints, Array]:
        """Pairs (point, triangle) within `reach`, and their distances; shapes (N,), (N,), (N,).

        Only triangles whose bounding box is within reach are measured.
        """
        none = np.empty(0, np.int64)
        found: list[tuple[Ints, Ints, Array]] = [(none, none, np.empty(0))]
        for i, j in self._near(points, reach):
            distance = point_triangle_distance(points[i], self.triangles[j])
            close = distance <= reach
            found.append((i[close], j[close], distance[close]))
        point, triangle, distance = (np.concatenate(x) for x in zip(*found, strict=True))
        return point, triangle, distance

    def _near(self, points: Array, reach: float) -> Iterator[tuple[Ints, Ints]]:
        """What `near` says, of some of the points at a time."""
        low, high, tree = self._boxes
        for k in range(0, len(points), _POINTS_AT_ONCE):
            x, y, z = points[k : k + _POINTS_AT_ONCE].T
            i, j = tree.query(shapely.box(x - reach, y - reach, x + reach, y + reach))
            level = (z[i] >= low[j, 2] - reach) & (z[i] <= high[j, 2] + reach)
            yield k + i[level], j[level]

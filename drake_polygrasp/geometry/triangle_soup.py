"""Finds the triangles of a mesh near points, and winding numbers of the mesh around points.

Points are compared with triangles in batches, so that memory does not grow with their product.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, batches
from drake_polygrasp.geometry.needles import along_needles, bounding_boxes
from drake_polygrasp.geometry.triangles import point_triangle_distance
from drake_polygrasp.vectors import times

_POINTS_AT_ONCE = 1 << 12
"""Number of points in a query, our choice: enough that the overhead of a call does not matter."""
_HITS_AT_ONCE = 1 << 24
"""Number of pairs in a query if every box is near every point, our choice: 256 MB. GEOS aborts the
process when it runs out of memory."""
_PAIRS_AT_ONCE = 1 << 17
"""Number of point-triangle pairs compared at once, our choice: about 50 MB of temporaries."""
_FEW = 256
"""Our choice: needles in meshes of no more triangles are not cut."""
_RAY = np.array([[0.6, -0.48, 0.64], [0.8, 0.36, -0.48], [0.0, 0.8, 0.6]])
"""A rotation, our choice, whose third column is parallel to no face or edge that models commonly
have."""


class _Boxes(NamedTuple):
    """Bounding boxes of triangles, and of pieces of needles.

    Attributes:
        turn: rotation about z; row vectors times it are in the frame of the boxes, shape (3, 3).
        low: corners with the least coordinates, shape (N, 3).
        high: corners with the greatest coordinates, shape (N, 3).
        triangle: the triangle of each box, shape (N,).
        tree: tree of the boxes seen along z.
    """

    turn: Array
    low: Array
    high: Array
    triangle: Ints
    tree: shapely.STRtree


@dataclass(frozen=True, eq=False)
class TriangleSoup:
    """Triangles in no particular order, with search trees that are built on first use.

    Attributes:
        triangles: [m], shape (T, 3, 3).
    """

    triangles: Array

    @cached_property
    def _boxes(self) -> _Boxes:
        if len(self.triangles) <= _FEW:
            turn, triangle = np.eye(3), np.arange(len(self.triangles))
            low, high = self.triangles.min(axis=1), self.triangles.max(axis=1)
        else:
            turn = along_needles(self.triangles)
            low, high, triangle = bounding_boxes(times(self.triangles, turn))
        sides = shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1])
        return _Boxes(turn, low, high, triangle, shapely.STRtree(sides))

    @cached_property
    def _along_ray(self) -> TriangleSoup:
        return TriangleSoup(times(self.triangles, _RAY))

    def __reduce__(self) -> tuple[type[TriangleSoup], tuple[Array]]:
        """Pickles the triangles without the trees."""
        return TriangleSoup, (self.triangles,)

    def winding_numbers(self, points: Array) -> Ints:
        """Returns how often closed, outward-oriented shells wind around points.

        It counts signed crossings of a ray from each point. A side belongs to one of the two
        triangles that share it, so that no crossing counts twice.

        Args:
            points: [m], shape (M, 3).

        Returns:
            Shape (M,): 0 outside all shells, 1 inside one, more where shells overlap.
        """
        winding = np.zeros(len(points))
        if not len(self.triangles) or not len(points):
            return winding.astype(np.int64)
        # The ray is oblique, because walls of manufactured objects are often parallel to axes.
        along, points = self._along_ray, times(points, _RAY)
        for i, t in along._pairs(points, 0.0, above=np.inf):
            turns = _turns(points[i, :2], along.triangles[t, :, :2])
            around = along._distinct(i, t, turns != 0)
            i, t, turns = i[around], t[around], turns[around]
            corner = along.triangles[t] - points[i][:, None]
            normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
            height = np.einsum("ni,ni->n", corner[:, 0], normal) * np.sign(normal[:, 2])
            winding += np.bincount(i, weights=turns * (height > 0), minlength=len(points))
        return winding.astype(np.int64)

    def near(self, points: Array, reach: float) -> Iterator[tuple[Ints, Ints]]:
        """Yields pairs of points and triangles whose bounding boxes are near the points.

        The pairs include all triangles within reach of a point, some of them more than once. All
        pairs of one point come together.

        Args:
            points: [m], shape (M, 3).
            reach: greatest distance between point and box along each axis of the boxes [m].

        Yields:
            Indices of points, ascending, shape (N,), and of triangles, shape (N,).
        """
        yield from self._pairs(points, reach)

    def closer_than(self, points: Array, reach: float) -> tuple[Ints, Ints, Array]:
        """Returns all pairs of points and triangles within a distance of each other.

        Args:
            points: [m], shape (M, 3).
            reach: the greatest distance [m].

        Returns:
            Indices of points, indices of triangles, and their distances [m], shape (N,) each.
        """
        none = np.empty(0, np.int64)
        found = [(none, none, np.empty(0)), *self._closer_than(points, reach)]
        point, triangle, distance = (np.concatenate(x) for x in zip(*found, strict=True))
        return point, triangle, distance

    def within(self, points: Array, reach: float) -> Bools:
        """Returns whether some triangle is within a distance of each point.

        Args:
            points: [m], shape (M, 3).
            reach: the distance [m].

        Returns:
            Shape (M,).
        """
        found = np.zeros(len(points), dtype=bool)
        for i, _, _ in self._closer_than(points, reach):
            found[i] = True
        return found

    def _closer_than(self, points: Array, reach: float) -> Iterator[tuple[Ints, Ints, Array]]:
        """Yields what `closer_than` returns, for some points at a time."""
        for i, j in self._pairs(points, reach):
            distance = point_triangle_distance(points[i], self.triangles[j])
            close = self._distinct(i, j, distance <= reach)
            yield i[close], j[close], distance[close]

    def _distinct(self, i: Ints, t: Ints, wanted: Bools) -> Ints:
        """Returns the indices of wanted pairs without the repetitions that cut needles cause."""
        rows = np.flatnonzero(wanted)
        if len(self._boxes.triangle) == len(self.triangles):
            return rows
        rows = rows[np.lexsort((t[rows], i[rows]))]
        new = (np.diff(i[rows], prepend=-1) != 0) | (np.diff(t[rows], prepend=-1) != 0)
        return np.asarray(rows[new])

    def _pairs(
        self, points: Array, reach: float, above: float | None = None
    ) -> Iterator[tuple[Ints, Ints]]:
        """Yields what `near` yields, with a reach of its own for triangles above a point."""
        turn, low, high, owner, tree = self._boxes
        points = times(points, turn)
        size = int(np.clip(_HITS_AT_ONCE // max(1, len(owner)), 1, _POINTS_AT_ONCE))
        for rows in batches(len(points), size):
            x, y, z = points[rows].T
            i, j = tree.query(shapely.box(x - reach, y - reach, x + reach, y + reach))
            most = reach if above is None else above
            level = (low[j, 2] - most <= z[i]) & (z[i] <= high[j, 2] + reach)
            i, t = i[level], owner[j[level]]
            if len(i) <= _PAIRS_AT_ONCE:
                yield rows.start + i, t
                continue
            # Cut between points, so that all pairs of a point stay together.
            cut = np.searchsorted(i, i[_PAIRS_AT_ONCE - 1 :: _PAIRS_AT_ONCE], "right")
            for some_i, some_t in zip(np.split(i, cut), np.split(t, cut), strict=True):
                yield rows.start + some_i, some_t


def _turns(points: Array, triangles: Array) -> Array:
    """Returns winding numbers, -1, 0 or 1, of triangles (N, 3, 2) around points (N, 2), (N,)."""
    corner = triangles - points[:, None]
    head = np.roll(corner, -1, axis=1)
    left = corner[..., 0] * head[..., 1] - head[..., 0] * corner[..., 1]
    upward = (corner[..., 1] <= 0) & (head[..., 1] > 0) & (left > 0)
    downward = (head[..., 1] <= 0) & (corner[..., 1] > 0) & (left < 0)
    return np.asarray(upward.sum(axis=1) - downward.sum(axis=1), dtype=np.float64)

"""Triangles that points ask of again and again: which are near, and how often they wind around.

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
"""Ours: so few calls that what each costs does not count."""
_HITS_AT_ONCE = 1 << 24
"""Pairs that a tree finds at once if every box is near every point, ours: 256 MB. GEOS ends the
process when it finds no room for them."""
_PAIRS_AT_ONCE = 1 << 17
"""Of points and triangles that are compared at once, ours: temporaries of some 50 MB."""
_FEW = 256
"""Ours: so few triangles may all be near a point, and none is worth cutting."""
_RAY = np.array([[0.6, -0.48, 0.64], [0.8, 0.36, -0.48], [0.0, 0.8, 0.6]])
"""A rotation, ours, whose third column no usual face is parallel to."""


class _Boxes(NamedTuple):
    """Bounding boxes of triangles, of needles those of their pieces."""

    turn: Array
    """What rotates points about z into the frame of the boxes, shape (3, 3)."""
    low: Array
    """Shape (N, 3)."""
    high: Array
    """Shape (N, 3)."""
    triangle: Ints
    """Whose each is, shape (N,)."""
    tree: shapely.STRtree
    """Of their sides across z."""


@dataclass(frozen=True, eq=False)
class TriangleSoup:
    """Triangles in no order, with the trees that finding them takes, each built once.

    Attributes:
        triangles: shape (T, 3, 3).
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
        """Trees are not pickled."""
        return TriangleSoup, (self.triangles,)

    def winding_numbers(self, points: Array) -> Ints:
        """How often closed, outward-oriented triangles wind around points (M, 3); (M,).

        Counts signed crossings of a ray from each point. Sides belong to one of the two triangles
        that share them, so that none is counted twice.
        """
        winding = np.zeros(len(points))
        if not len(self.triangles) or not len(points):
            return winding.astype(np.int64)
        # Along no axis, where the walls of made things would hold the whole ray.
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
        """Pairs (point, triangle) of which a bounding box is within `reach`, shapes (N,) and (N,).

        Of some points at a time, with all of their pairs. All triangles within reach of a point
        are among them, some more than once.
        """
        yield from self._pairs(points, reach)

    def closer_than(self, points: Array, reach: float) -> tuple[Ints, Ints, Array]:
        """Pairs (point, triangle) within `reach`, and their distances; shapes (N,), (N,), (N,).

        Only triangles with a bounding box within reach are measured.
        """
        none = np.empty(0, np.int64)
        found = [(none, none, np.empty(0)), *self._closer_than(points, reach)]
        point, triangle, distance = (np.concatenate(x) for x in zip(*found, strict=True))
        return point, triangle, distance

    def within(self, points: Array, reach: float) -> Bools:
        """Whether a triangle is within `reach` of each point (M, 3); (M,)."""
        found = np.zeros(len(points), dtype=bool)
        for i, _, _ in self._closer_than(points, reach):
            found[i] = True
        return found

    def _closer_than(self, points: Array, reach: float) -> Iterator[tuple[Ints, Ints, Array]]:
        for i, j in self._pairs(points, reach):
            distance = point_triangle_distance(points[i], self.triangles[j])
            close = self._distinct(i, j, distance <= reach)
            yield i[close], j[close], distance[close]

    def _distinct(self, i: Ints, t: Ints, wanted: Bools) -> Ints:
        """Where wanted pairs (point, triangle) are, each once: near needles there are copies."""
        rows = np.flatnonzero(wanted)
        if len(self._boxes.triangle) == len(self.triangles):
            return rows
        rows = rows[np.lexsort((t[rows], i[rows]))]
        new = (np.diff(i[rows], prepend=-1) != 0) | (np.diff(t[rows], prepend=-1) != 0)
        return np.asarray(rows[new])

    def _pairs(
        self, points: Array, reach: float, above: float | None = None
    ) -> Iterator[tuple[Ints, Ints]]:
        """What `near` says, within another reach along z for what is above a point."""
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
            # All of a point's pairs stay together.
            cut = np.searchsorted(i, i[_PAIRS_AT_ONCE - 1 :: _PAIRS_AT_ONCE], "right")
            for some_i, some_t in zip(np.split(i, cut), np.split(t, cut), strict=True):
                yield rows.start + some_i, some_t


def _turns(points: Array, triangles: Array) -> Array:
    """The turn, -1, 0 or 1, that each triangle (N, 3, 2) makes around its point (N, 2), (N,)."""
    corner = triangles - points[:, None]
    head = np.roll(corner, -1, axis=1)
    left = corner[..., 0] * head[..., 1] - head[..., 0] * corner[..., 1]
    upward = (corner[..., 1] <= 0) & (head[..., 1] > 0) & (left > 0)
    downward = (head[..., 1] <= 0) & (corner[..., 1] > 0) & (left < 0)
    return np.asarray(upward.sum(axis=1) - downward.sum(axis=1), dtype=np.float64)

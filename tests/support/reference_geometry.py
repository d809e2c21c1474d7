"""Planar geometry of the reference planner, on scalars and single shapely polygons.

Lengths are in units of the object's diameter L and measured from its centre of mass.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import atan2, pi

import numpy as np
import shapely
from shapely import LineString, Point, Polygon
from shapely.affinity import affine_transform

from drake_polygrasp.arrays import Array

TOL = 1e-9
TIE = 1e-6
"""For choices that only add rows: model files round coordinates."""
FAR = 1e3
"""Half the size of the rectangles that stand for half-planes and strips."""

Interval = tuple[float, float]


class Doubts(set[str]):
    """The names of the comparisons that rounding may turn."""

    def exceeds(self, name: str, value: float, tol: float = TOL) -> bool:
        if tol / 10 < value < 100 * tol:
            self.add(name)
        return value > tol

    def ties(self, name: str, costs: Sequence[float], tol: float = TOL) -> list[int]:
        """The indices of the least costs, in order."""
        least = min(costs)
        return [i for i, cost in enumerate(costs) if not self.exceeds(name, cost - least, tol)]

    def contains(self, name: str, geometry: shapely.Geometry, point: Array) -> bool:
        return not self.exceeds(name, geometry.distance(Point(point)))


@dataclass(frozen=True, eq=False)
class Face:
    """One region A_i."""

    index: int
    polygon: Polygon
    R: Array
    p: Array
    n: Array

    def project(self, *axes: Array) -> Polygon:
        """Its shadow A_i^s on the plane of two axes."""
        M, o = np.array(axes) @ self.R[:, :2], np.array(axes) @ self.p
        shadow = affine_transform(self.polygon, [*M.ravel(), *o])
        # Of shadows that differ by the last bit GEOS may say that they share no area.
        return shapely.transform(shadow, lambda points: np.round(points, 12))

    def extent(self, axis: Array, part: shapely.Geometry | None = None) -> Interval:
        xi = shapely.get_coordinates(self.polygon if part is None else part)
        along = xi @ (self.R[:, :2].T @ axis) + axis @ self.p
        return along.min(), along.max()

    def clip(self, axis: Array, offset: float) -> Polygon:
        """The half-plane axis.x >= offset, in the coordinates of the polygon."""
        return half_plane(self.R[:, :2].T @ axis, offset - axis @ self.p)


@dataclass(frozen=True, eq=False)
class Section:
    """The segments a_i = Pi_p cut with A_i, as intervals of a coordinate x along them."""

    face: Face
    intervals: list[Interval]
    at: Callable[[float], Array]

    @property
    def lo(self) -> float:
        return self.intervals[0][0]

    @property
    def hi(self) -> float:
        return self.intervals[-1][1]

    @property
    def length(self) -> float:
        return sum(b - a for a, b in self.intervals)

    def ends(self) -> list[Array]:
        return [self.at(x) for interval in self.intervals for x in interval]


def section(face: Face, N: Array, height: float, e: Array, doubts: Doubts) -> Section:
    """The plane N.x = height cut with a face, as intervals of x = e.x."""
    slope, rest = face.R[:, :2].T @ N, height - N @ face.p
    along = unit(np.array([-slope[1], slope[0]]))
    foot = slope * rest / (slope @ slope)
    for edge in all_edges(face.polygon):
        if np.abs(shapely.get_coordinates(edge) @ slope - rest).max() < 100 * TOL:
            doubts.add("edge in plane")
    origin, direction = face.p + face.R[:, :2] @ foot, face.R[:, :2] @ along
    ends = []
    for piece in shapely.get_parts(long_line(foot, along) & face.polygon):
        xi = shapely.get_coordinates(piece)
        x = [e @ (face.p + face.R[:, :2] @ point) for point in xi]
        ends.append((min(x), max(x)))
    intervals: list[Interval] = []
    for lo, hi in sorted(ends):
        if intervals and not doubts.exceeds("gap", lo - intervals[-1][1]):
            intervals[-1] = (intervals[-1][0], hi)
        else:
            intervals.append((lo, hi))
    intervals = [(lo, hi) for lo, hi in intervals if doubts.exceeds("interval", hi - lo)]
    return Section(
        face, intervals, lambda x: origin + direction * (x - e @ origin) / (e @ direction)
    )


def tips_plane(n: list[Array]) -> tuple[Array, float]:
    """N and sin phi >= 0 of the plane through the tips of three unit normals."""
    N = unit(np.cross(n[1] - n[0], n[2] - n[0]))
    sin_phi = float(N @ n[0])
    return (N, sin_phi) if sin_phi >= 0 else (-N, -sin_phi)


def plane_axes(n: Array) -> Array:
    """Two unit vectors orthogonal to n and to each other."""
    return np.linalg.svd(n[None])[2][1:]


def unit(v: Array) -> Array:
    return v / np.linalg.norm(v)


def angle(a: Array, b: Array) -> float:
    return atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))


def centroid(geometry: shapely.Geometry) -> Array:
    return shapely.get_coordinates(geometry.centroid)[0]


def hull(*geometries: shapely.Geometry) -> Polygon:
    return shapely.GeometryCollection(geometries).convex_hull


def half_plane(normal: Array, offset: float) -> Polygon:
    """{x: normal.x >= offset}."""
    length = np.linalg.norm(normal)
    n, foot = normal / length, normal * offset / length**2
    t = np.array([-n[1], n[0]])
    return Polygon([foot - FAR * t, foot + FAR * t, foot + FAR * (t + n), foot + FAR * (n - t)])


def band(lo: float, hi: float) -> Polygon:
    return shapely.box(-FAR, lo, FAR, hi)


def strips(bounds: Sequence[tuple[Array, float, float]]) -> Polygon:
    """The intersection of strips lo <= t.x <= hi."""
    both = [[half_plane(t, lo), half_plane(-t, -hi)] for t, lo, hi in bounds]
    return shapely.intersection_all([one for two in both for one in two])


def thickness(region: shapely.Geometry) -> float:
    """The inradius of a triangle, and of that order for any convex region."""
    return 2 * region.area / region.length if region.area else 0.0


def long_line(point: Array, direction: Array) -> LineString:
    return LineString([point - FAR * direction, point + FAR * direction])


def chord(point: Array, direction: Array, polygon: Polygon, doubts: Doubts) -> float:
    """Length of a line inside a polygon."""
    line = long_line(point, direction)
    across = np.array([-direction[1], direction[0]])
    for edge in all_edges(polygon):
        if np.abs((shapely.get_coordinates(edge) - point) @ across).max() < 100 * TOL:
            doubts.add("edge on line")
    return (line & polygon).length


def fan(polygon: Polygon, doubts: Doubts) -> list[Array]:
    """Eight directions, 22.5 degrees apart, from the longest edge; from each of them when tied."""
    edges = ring_edges(polygon)
    longest = doubts.ties("fan", [-edge.length for edge in edges], TIE)
    starts = [atan2(*edge_vector(edges[i])[::-1]) for i in longest]
    turns = [start + k * pi / 8 for start in starts for k in range(8)]
    return distinct_lines([np.array([np.cos(turn), np.sin(turn)]) for turn in turns])


def distinct_lines(directions: list[Array]) -> list[Array]:
    kept: list[Array] = []
    for d in directions:
        if all(abs(d[0] * other[1] - d[1] * other[0]) > 1e-6 for other in kept):
            kept.append(d)
    return kept


def both_ways(directions: list[Array]) -> list[Array]:
    """Nothing tells the ends of a line apart: what is said of left and right holds either way."""
    return [sign * d for d in distinct_lines(directions) for sign in (1, -1)]


def solid_parts(region: shapely.Geometry) -> list[Polygon]:
    """Its connected parts, without slivers and the bridges that slivers make."""
    sliver = TOL / 100
    opened = region.buffer(-sliver, join_style="mitre").buffer(sliver, join_style="mitre")
    return [part for part in shapely.get_parts(opened) if part.area > TOL**2]


def all_edges(polygon: Polygon) -> list[LineString]:
    rings = [polygon.exterior, *polygon.interiors]
    return [
        LineString(two) for ring in rings for two in zip(ring.coords, ring.coords[1:], strict=False)
    ]


def ring_edges(polygon: Polygon) -> list[LineString]:
    """Edges of all rings, with vertices that bend them by less than the tolerance left out."""
    edges = []
    for ring in (polygon.exterior, *polygon.interiors):
        corners = list(map(np.array, ring.coords[:-1]))
        k = 0
        while k < len(corners) and len(corners) > 3:
            before, here, after = corners[k - 1], corners[k], corners[(k + 1) % len(corners)]
            if LineString([before, after]).distance(Point(here)) <= TOL:
                del corners[k]
                k = max(k - 1, 0)
            else:
                k += 1
        edges += [
            LineString([p, q]) for p, q in zip(corners, corners[1:] + corners[:1], strict=True)
        ]
    return edges


def edge_vector(edge: LineString) -> Array:
    start, end = shapely.get_coordinates(edge)
    return unit(end - start)


def on_boundary(edge: LineString, polygon: Polygon) -> bool:
    points = [edge.interpolate(s, normalized=True) for s in (0.0, 0.5, 1.0)]
    return all(polygon.exterior.distance(point) <= TOL for point in points)

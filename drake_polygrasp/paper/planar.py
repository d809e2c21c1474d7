"""Plane geometry that several stages share: projections, sections, intervals on lines.

Functions work on many rows at once. A row refers to a region of a face; regions have different
numbers of edges, so the edges of all rows are gathered in one flat array and reduced row by row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Batch, Bools, Ints, Shapes, gather
from drake_polygrasp.digits import on_grid
from drake_polygrasp.geometry.regions import Boundary, Regions
from drake_polygrasp.geometry.tolerances import LENGTH_TOLERANCE
from drake_polygrasp.vectors import cross, dot, unit


@dataclass(frozen=True, eq=False)
class Scale:
    """The object's size, which tolerances are relative to, and its centre of mass.

    Attributes:
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        diameter: L, greatest distance between two vertices [m].
    """

    p_BBcm: Array
    rho: float
    diameter: float

    @property
    def length_slack(self) -> float:
        """Lengths below this are rounding errors [m]."""
        return LENGTH_TOLERANCE * self.diameter

    @property
    def area_slack(self) -> float:
        """Areas below this are rounding errors [m^2]."""
        return LENGTH_TOLERANCE * self.diameter**2


def orthonormal_pair(nhat: Array) -> tuple[Array, Array]:
    """Completes unit vectors to right-handed orthonormal bases.

    Args:
        nhat: unit vectors, shape (K, 3).

    Returns:
        Unit vectors u and v with u x v = nhat, shape (K, 3) each.
    """
    least = np.eye(3)[np.argmin(np.round(np.abs(nhat), 9), axis=-1)]
    u = unit(cross(least, nhat))
    return u, cross(nhat, u)


def _starts(owner: Ints, num_rows: int) -> Ints:
    return np.searchsorted(owner, np.arange(num_rows))


def extents(edges: Boundary, region: Ints, direction: Array) -> tuple[Array, Array]:
    """Computes the extent of each row's region along a direction.

    Args:
        edges: boundary of all regions.
        region: index of each row's region, shape (K,).
        direction: direction of each row, expressed in B, shape (K, 3).

    Returns:
        Least and greatest direction . p_BV over the vertices, shape (K,) each.
    """
    index, owner = gather(edges.offsets, region)
    along = dot(edges.tail[index], direction[owner])
    return row_extremes(along, along, owner, len(region))


def row_extremes(low: Array, high: Array, owner: Ints, num_rows: int) -> tuple[Array, Array]:
    """Reduces items to the least and the greatest of each row.

    Args:
        low: values to take the least of, shape (E,).
        high: values to take the greatest of, shape (E,).
        owner: row of each item, ascending, at least one item a row, shape (E,).
        num_rows: number of rows K.

    Returns:
        Least `low` and greatest `high` of each row, shape (K,) each.
    """
    if not num_rows:
        return np.empty(0), np.empty(0)
    starts = _starts(owner, num_rows)
    return np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)


def project(regions: Regions, region: Ints, u: Array, v: Array) -> Shapes:
    """Projects whole regions, holes included, orthogonally on planes spanned by u and v.

    Coordinates are rounded, so that faces which cover each other have equal projections: of
    polygons that differ in the last bit, GEOS may report an intersection without area.

    Args:
        regions: all regions.
        region: index of each row's region, shape (K,).
        u: first unit axis of each row's plane, shape (K, 3).
        v: second unit axis, shape (K, 3).

    Returns:
        Polygons in the coordinates (u . p, v . p) [m], shape (K,).
    """
    ring, ring_owner = gather(regions.region_offsets, region)
    vertex, vertex_ring = gather(regions.ring_offsets, ring)
    owner = ring_owner[vertex_ring]
    p_BV = regions.p_BV[vertex]
    size = float(np.ptp(regions.p_BV, axis=0).max()) if len(regions.p_BV) else 0.0
    coordinates = np.column_stack([dot(p_BV, u[owner]), dot(p_BV, v[owner])])
    if size > 0:
        coordinates = on_grid(coordinates, size)
    ring_starts = np.append(_starts(vertex_ring, len(ring)), len(vertex))
    region_starts = np.append(_starts(ring_owner, len(region)), len(ring))
    polygons: Shapes = shapely.from_ragged_array(
        shapely.GeometryType.POLYGON, coordinates, (ring_starts, region_starts)
    )
    return polygons


@dataclass(frozen=True, eq=False)
class Section(Batch):
    """Segments a_i = Pi_p cut with A_i (Section 4), several where a face is not convex.

    The point of the cut at coordinate s, measured along an axis in Pi_p, is `p_BS + s * slope_B`.

    Attributes:
        p_BS: point of the cut's line at s = 0 [m], shape (K, 3).
        slope_B: change of the point with s, shape (K, 3).
        intervals: ends of the S segments as values of s, ascending, padded with NaN [m], shape
            (K, S, 2).
    """

    p_BS: Array
    slope_B: Array
    intervals: Array

    def points(self, s: Array) -> Array:
        """Computes points of the cut.

        Args:
            s: coordinates along the axis [m], shape (K,) or (K, J).

        Returns:
            Points expressed in B [m], shape (K, 3) or (K, J, 3).
        """
        if s.ndim == 1:
            return self.p_BS + s[:, None] * self.slope_B
        return self.p_BS[:, None] + s[..., None] * self.slope_B[:, None]


def section(
    regions: Regions,
    edges: Boundary,
    region: Ints,
    nhat: Array,
    height: Array,
    axis: Array,
    slack: float,
) -> Section:
    """Cuts each row's region with the plane nhat . p = height.

    Args:
        regions: all regions.
        edges: their boundary.
        region: index of each row's region, shape (K,).
        nhat: unit normal of each row's plane, shape (K, 3).
        height: offset of each row's plane [m], shape (K,).
        axis: unit direction in the plane along which coordinates are measured, shape (K, 3).
        slack: gaps up to this length are closed, and segments up to it dropped [m].

    Returns:
        The segments, without any where the plane misses the region or is parallel to it.
    """
    index, owner = gather(edges.offsets, region)
    tail, head = edges.tail[index], edges.head[index]
    above_tail = dot(tail, nhat[owner]) - height[owner]
    above_head = dot(head, nhat[owner]) - height[owner]
    # Half-open, so that a vertex on the plane counts once and the ends form pairs.
    crosses = (above_tail <= 0) != (above_head <= 0)
    index, owner = index[crosses], owner[crosses]
    fraction = above_tail[crosses] / (above_tail[crosses] - above_head[crosses])
    s = dot(edges.tail[index], axis[owner]) * (1 - fraction)
    s += dot(edges.head[index], axis[owner]) * fraction

    order = np.lexsort((s, owner))
    low, high, owner = _segments(s[order], owner[order], slack)
    counts = np.bincount(owner, minlength=len(region))
    slot = np.arange(len(owner)) - (np.cumsum(counts) - counts)[owner]
    intervals = np.full((len(region), max(1, int(counts.max(initial=0))), 2), np.nan)
    intervals[owner, slot, 0], intervals[owner, slot, 1] = low, high

    # Where this is singular the cut runs across `axis`, or plane and face are parallel.
    nhat_TB = regions.nhat_TB_B[region]
    across = cross(axis, nhat)
    steep = dot(nhat_TB, across)
    singular = np.abs(steep) < 1e-12
    intervals[singular] = np.nan
    down = across / np.where(singular, 1.0, steep)[:, None]
    p_BN = height[:, None] * nhat
    rise = dot(nhat_TB, regions.p_BF[region] - p_BN)
    return Section(
        p_BN + rise[:, None] * down, axis - dot(nhat_TB, axis)[:, None] * down, intervals
    )


def _segments(ends: Array, owner: Ints, slack: float) -> tuple[Array, Array, Ints]:
    """Joins sorted ends, an even number for each owner, to segments: low, high and owners."""
    low, high, owner = ends[::2], ends[1::2], owner[::2]
    is_gap = (owner[1:] != owner[:-1]) | (low[1:] - high[:-1] > slack)
    begins, stops = np.ones((2, len(low)), dtype=bool)
    begins[1:], stops[:-1] = is_gap, is_gap
    low, high, owner = low[begins], high[stops], owner[begins]
    long = high - low > slack
    return low[long], high[long], owner[long]


def within(intervals: Array, s: Array, slack: float) -> Bools:
    """Tests whether coordinates lie in one of their intervals.

    Args:
        intervals: ends of S intervals, padded with NaN [m], shape (..., S, 2).
        s: coordinates [m], shape (...).
        slack: how far outside still counts as inside [m].

    Returns:
        Whether each coordinate is inside, shape (...).
    """
    low, high = intervals[..., 0], intervals[..., 1]
    between = (s[..., None] >= low - slack) & (s[..., None] <= high + slack)
    inside: Bools = np.logical_or.reduce(between, axis=-1)
    return inside


def clip_intervals(intervals: Array, low: Array, high: Array, slack: float) -> Array:
    """Clips intervals to bounds.

    Args:
        intervals: ends of S intervals, padded with NaN [m], shape (..., S, 2).
        low: lower bound [m], shape (...).
        high: upper bound [m], shape (...).
        slack: parts up to this length are dropped [m].

    Returns:
        The clipped intervals [m], NaN where one is dropped, shape (..., S, 2).
    """
    clipped = np.empty_like(intervals)
    np.maximum(intervals[..., 0], low[..., None], out=clipped[..., 0])
    np.minimum(intervals[..., 1], high[..., None], out=clipped[..., 1])
    clipped[~(clipped[..., 1] - clipped[..., 0] > slack)] = np.nan
    return clipped


def nearest(intervals: Array, s: Array, slack: float) -> Array:
    """Finds the point of the intervals nearest to s, the greater of two equally near ones.

    Args:
        intervals: ends of S intervals, padded with NaN [m], shape (..., S, 2).
        s: coordinates [m], shape (...).
        slack: distances that differ by no more are equal [m].

    Returns:
        The nearest coordinates [m], NaN where there is no interval, shape (...).
    """
    candidates = np.minimum(np.maximum(s[..., None], intervals[..., 0]), intervals[..., 1])
    distance = np.abs(candidates - s[..., None])
    least = np.fmin.reduce(distance, axis=-1, keepdims=True)
    best = np.where(distance <= least + slack, candidates, np.nan)
    found: Array = np.fmax.reduce(best, axis=-1)
    return found


def outer_ends(intervals: Array) -> Array:
    """Finds the least and the greatest end of all intervals of each row.

    Args:
        intervals: ends of S intervals, padded with NaN [m], shape (..., S, 2).

    Returns:
        The two ends [m], NaN where there is no interval, shape (..., 2).
    """
    ends = np.empty((*intervals.shape[:-2], 2))
    np.fmin.reduce(intervals[..., 0], axis=-1, out=ends[..., 0])
    np.fmax.reduce(intervals[..., 1], axis=-1, out=ends[..., 1])
    return ends


def centroids(shapes: Shapes) -> Array:
    """Computes the centroids of plane shapes.

    Args:
        shapes: shapes, shape (...).

    Returns:
        Centroids, NaN for empty shapes, shape (..., 2).
    """
    found = np.full((*np.shape(shapes), 2), np.nan)
    # shapely gives no coordinates for empty points.
    found[~shapely.is_empty(shapes)] = shapely.get_coordinates(shapely.centroid(shapes))
    return found


def line_through(point: Array, direction: Array, scale: Scale) -> Shapes:
    """Draws lines through points, long enough to cross the object.

    Args:
        point: a point of each line [m], shape (..., 2).
        direction: direction of each line, of any length, shape (..., 2).
        scale: the object's size.

    Returns:
        LineStrings, shape (...).
    """
    reach = 4 * scale.diameter * unit(direction)
    lines: Shapes = shapely.linestrings(np.stack([point - reach, point + reach], axis=-2))
    return lines

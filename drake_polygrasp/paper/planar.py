"""Batched geometry that several stages of the paper share: ragged faces, cuts, strips, projections.

Every function works on K rows at once. A row names a region of a face; regions have different
numbers of edges, so their edges are gathered into one flat array and reduced row by row.
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
    """The object's size, which lengths are compared with, and its centre of mass.

    Attributes:
        p_BBcm: [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        diameter: L [m].
    """

    p_BBcm: Array
    rho: float
    diameter: float

    @property
    def length_slack(self) -> float:
        """What is shorter is a rounding error [m]."""
        return LENGTH_TOLERANCE * self.diameter

    @property
    def area_slack(self) -> float:
        """What is smaller is a rounding error [m^2]."""
        return LENGTH_TOLERANCE * self.diameter**2


def orthonormal_pair(nhat: Array) -> tuple[Array, Array]:
    """Unit vectors u, v with u x v = nhat, each of shape (K, 3)."""
    least = np.eye(3)[np.argmin(np.round(np.abs(nhat), 9), axis=-1)]
    u = unit(cross(least, nhat))
    return u, cross(nhat, u)


def _starts(owner: Ints, num_rows: int) -> Ints:
    return np.searchsorted(owner, np.arange(num_rows))


def extents(edges: Boundary, region: Ints, direction: Array) -> tuple[Array, Array]:
    """Least and greatest direction . p_BV of each row's region, each of shape (K,)."""
    index, owner = gather(edges.offsets, region)
    along = dot(edges.tail[index], direction[owner])
    return row_extremes(along, along, owner, len(region))


def row_extremes(low: Array, high: Array, owner: Ints, num_rows: int) -> tuple[Array, Array]:
    """Least `low` and greatest `high` of the items of each row, which are in the rows' order."""
    if not num_rows:
        return np.empty(0), np.empty(0)
    starts = _starts(owner, num_rows)
    return np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)


def project(regions: Regions, region: Ints, u: Array, v: Array) -> Shapes:
    """Orthogonal projections of whole regions, holes included, on planes spanned by u and v.

    Coordinates are rounded, so that those of faces that cover each other are equal: of polygons
    that differ by the last bit, GEOS may say that they share two points and no area.

    Args:
        regions: all regions.
        region: index of each row's region, shape (K,).
        u: first unit axis of each row's plane, shape (K, 3).
        v: second unit axis, shape (K, 3).

    Returns:
        shapely Polygons in the coordinates (u . p, v . p) [m], shape (K,).
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
    """The segments a_i = Pi_p cut with A_i (Section 4), several where a face is not convex.

    The point of the cut at coordinate s along the row's axis is `p_BS + s * slope_B`.

    Attributes:
        p_BS: point of the cut's line at s = 0 [m], shape (K, 3).
        slope_B: change of the point with s, shape (K, 3).
        intervals: ends of the segments as values of s, ascending, padded with NaN [m], shape (K, S,
            2).
    """

    p_BS: Array
    slope_B: Array
    intervals: Array

    def points(self, s: Array) -> Array:
        """Points at coordinates s of shape (K,) or (K, J); shape (K, 3) or (K, J, 3)."""
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
        axis: direction within the plane that coordinates are measured along, shape (K, 3).
        slack: gaps no longer than this are closed, and segments dropped [m].
    """
    index, owner = gather(edges.offsets, region)
    tail, head = edges.tail[index], edges.head[index]
    above_tail = dot(tail, nhat[owner]) - height[owner]
    above_head = dot(head, nhat[owner]) - height[owner]
    # Half-open, so that a vertex on the plane is counted once and ends always pair up.
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

    # Parallel to the face, the plane's direction across `axis` leads to no point of the cut.
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
    """Segments between sorted ends, an even number for each owner: low, high, and whose."""
    low, high, owner = ends[::2], ends[1::2], owner[::2]
    is_gap = (owner[1:] != owner[:-1]) | (low[1:] - high[:-1] > slack)
    begins, stops = np.ones((2, len(low)), dtype=bool)
    begins[1:], stops[:-1] = is_gap, is_gap
    low, high, owner = low[begins], high[stops], owner[begins]
    long = high - low > slack
    return low[long], high[long], owner[long]


def within(intervals: Array, s: Array, slack: float) -> Bools:
    """Whether s of shape (...) lies in one of the intervals of shape (..., S, 2)."""
    low, high = intervals[..., 0], intervals[..., 1]
    between = (s[..., None] >= low - slack) & (s[..., None] <= high + slack)
    inside: Bools = np.logical_or.reduce(between, axis=-1)
    return inside


def clip_intervals(intervals: Array, low: Array, high: Array, slack: float) -> Array:
    """The parts of the intervals between low and high; NaN where no more than slack is left."""
    clipped = np.empty_like(intervals)
    np.maximum(intervals[..., 0], low[..., None], out=clipped[..., 0])
    np.minimum(intervals[..., 1], high[..., None], out=clipped[..., 1])
    clipped[~(clipped[..., 1] - clipped[..., 0] > slack)] = np.nan
    return clipped


def nearest(intervals: Array, s: Array, slack: float) -> Array:
    """The point of the intervals nearest to s, the greater among equals; NaN where all are empty.

    Args:
        intervals: shape (..., S, 2), padded with NaN.
        s: shape (...).
        slack: distances that differ by less than this are equal.
    """
    candidates = np.minimum(np.maximum(s[..., None], intervals[..., 0]), intervals[..., 1])
    distance = np.abs(candidates - s[..., None])
    least = np.fmin.reduce(distance, axis=-1, keepdims=True)
    best = np.where(distance <= least + slack, candidates, np.nan)
    found: Array = np.fmax.reduce(best, axis=-1)
    return found


def outer_ends(intervals: Array) -> Array:
    """Least and greatest end over all intervals, shape (..., 2); NaN where all are empty."""
    ends = np.empty((*intervals.shape[:-2], 2))
    np.fmin.reduce(intervals[..., 0], axis=-1, out=ends[..., 0])
    np.fmax.reduce(intervals[..., 1], axis=-1, out=ends[..., 1])
    return ends


def centroids(shapes: Shapes) -> Array:
    """Centroids of shapes, shape (..., 2); NaN for empty ones."""
    found = np.full((*np.shape(shapes), 2), np.nan)
    # Empty points have no coordinates.
    found[~shapely.is_empty(shapes)] = shapely.get_coordinates(shapely.centroid(shapes))
    return found

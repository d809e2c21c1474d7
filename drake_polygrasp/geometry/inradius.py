"""The radius of the largest disc inside a polygon, exact and the same in every frame."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, batches
from drake_polygrasp.vectors import circle

_SEARCH = 1e-2
"""Times area / perimeter, which is less than the inradius, ours: how near a search on a grid comes
to the greatest of several local maxima."""
_ROUGH = 5e-2
"""The same, ours, where a rough answer will do."""
_FINEST_SEARCH = 1e-3
"""Times the polygon's extent, ours: keeps that search short on slivers."""
_SIDES_AT_ONCE = 1 << 18
"""Of polygons' sides, each with a point, ours: temporaries of some 50 MB."""
_ROUNDS = 100
"""Ours, several times what is needed: ends loops that rounding errors might keep alive."""


def inradius(polygons: npt.NDArray[np.object_]) -> Array:
    """The inradius of each polygon, to a part in 1e12, shape (n,).

    Around a point of the polygon, each side has a half-plane that excludes it: through its nearest
    point, square to the line between the two. Together they bound a convex cell of the polygon
    with a disc no smaller than that of the point itself, so taking the centre of the cell's
    largest disc for the next point never loses. Sides met in their interior give their own lines,
    hence few rounds suffice; those of a convex polygon always do, and it takes one. Others have
    several local maxima, hence several starts.
    """
    inradii = np.zeros(len(polygons))
    # Polygons of about as many sides together, for arrays are as wide as the one of most.
    size = np.log2(np.maximum(shapely.get_num_coordinates(polygons), 1)).astype(np.int64)
    for value in np.unique(size):
        rows = np.flatnonzero(size == value)
        for some in batches(len(rows), _SIDES_AT_ONCE >> value):
            inradii[rows[some]] = _inradius(polygons[rows[some]])
    return inradii


def _inradius(polygons: npt.NDArray[np.object_]) -> Array:
    hull_area, area = shapely.area(shapely.convex_hull(polygons)), shapely.area(polygons)
    convex = hull_area <= area * (1 + 1e-9)
    center, polygon = _starts(polygons, convex)
    start, end, real = _sides(polygons)
    inradii = np.zeros(len(polygons))
    for some in batches(len(center), _SIDES_AT_ONCE // start.shape[1]):
        k = polygon[some]
        radius = _climb(center[some], start, end, real, convex, k)
        np.maximum.at(inradii, k, radius)
    return inradii


def _climb(
    center: Array, start: Array, end: Array, real: Bools, convex: Bools, polygon: Ints
) -> Array:
    """The radii to which discs around starting points (s, 2) of polygons (s,) grow, shape (s,)."""
    radius = np.zeros(len(center))
    rows = np.arange(len(center))
    for _ in range(_ROUNDS):
        k = polygon[rows]
        nearest, distance = _nearest(center, start[k], end[k], convex[k])
        distance = np.where(real[k], distance, np.inf)
        reached = distance.min(axis=1)
        better = reached > radius[rows] * (1 + 1e-12)
        radius[rows] = np.maximum(reached, radius[rows])
        rows, center = rows[better], center[better]
        nearest, distance = nearest[better], distance[better]
        if not len(rows):
            break
        inward = (center[:, None] - nearest) / distance[..., None]
        level = np.einsum("nmi,nmi->nm", inward, nearest - center[:, None])
        level = np.where(real[polygon[rows]], level, -np.inf)
        center = center + _largest_disc(inward, level, radius[rows])
    return radius


def rough_inradius(
    polygons: npt.NDArray[np.object_], tolerance: float | Array | None = None
) -> Array:
    """The inradius of each polygon to `tolerance` (default: a few percent), never more, shape (n,).

    Enough for outlines that are themselves approximate, and quick when they have many corners.
    """
    if tolerance is None:
        tolerance = _ROUGH * shapely.area(polygons) / np.maximum(shapely.length(polygons), 1e-300)
    found = shapely.maximum_inscribed_circle(polygons, tolerance=tolerance)
    return np.asarray(shapely.length(found))


def _starts(polygons: npt.NDArray[np.object_], convex: Bools) -> tuple[Array, Ints]:
    """Points (s, 2), and the polygon of each, shape (s,): of convex ones, the centroid.

    Of others, the best point of a grid and the middles of a triangulation; the first misses no
    much greater disc, the latter do not depend on the frame.
    """
    others = polygons[~convex]
    low, high = np.split(shapely.bounds(others), 2, axis=1)
    tolerance = np.maximum(
        _SEARCH * shapely.area(others) / shapely.length(others),
        _FINEST_SEARCH * (high - low).max(axis=1, initial=0),
    )
    found = shapely.get_point(shapely.maximum_inscribed_circle(others, tolerance=tolerance), 0)
    triangles = shapely.constrained_delaunay_triangles(others)
    triangles, owner = shapely.get_parts(triangles, return_index=True)
    points = np.concatenate([polygons[convex], found, triangles])
    k, several = np.flatnonzero(convex), np.flatnonzero(~convex)
    polygon = np.concatenate([k, several, several[owner]])
    return shapely.get_coordinates(shapely.centroid(points)), polygon


def _sides(polygons: npt.NDArray[np.object_]) -> tuple[Array, Array, Bools]:
    """Start and end of the sides of each polygon, shape (n, m, 2), and which rows are real."""
    _, xy, (ring_offsets, polygon_offsets) = shapely.to_ragged_array(polygons)
    last = np.zeros(len(xy), dtype=bool)
    last[ring_offsets[1:] - 1] = True
    owner = np.repeat(np.arange(len(polygons)), np.diff(ring_offsets[polygon_offsets]))
    tail = np.flatnonzero(~last)
    owner = owner[tail]
    column = np.arange(len(tail)) - np.searchsorted(owner, owner)
    shape = (len(polygons), int(column.max()) + 1)
    start, end = np.zeros((*shape, 2)), np.ones((*shape, 2))
    real = np.zeros(shape, dtype=bool)
    start[owner, column], end[owner, column] = xy[tail], xy[tail + 1]
    real[owner, column] = True
    return start, end, real


def _nearest(center: Array, start: Array, end: Array, convex: Bools) -> tuple[Array, Array]:
    """The points of the sides, or of the lines of a convex polygon, nearest to the centre."""
    side = end - start
    along = np.einsum("nmi,nmi->nm", center[:, None] - start, side)
    along /= np.einsum("nmi,nmi->nm", side, side)
    along = np.where(convex[:, None], along, np.clip(along, 0, 1))
    nearest = start + along[..., None] * side
    return nearest, np.linalg.norm(center[:, None] - nearest, axis=2)


def _largest_disc(inward: Array, level: Array, radius: Array) -> Array:
    """Centres of the largest discs within half-planes inward @ x >= level, shape (n, 2).

    The linear program max t, inward @ x - t >= level, by the dual simplex method for all at once:
    from three half-planes far around the origin on, the most violated constraint enters.
    """
    n = len(level)
    farthest = np.where(np.isfinite(level), -level, 0).max(axis=1, keepdims=True)
    angle = np.arange(3) * 2 * np.pi / 3
    far = np.broadcast_to(circle(angle), (n, 3, 2))
    u = np.concatenate([far, inward], axis=1)
    level = np.concatenate([np.repeat(-100 * farthest, 3, axis=1), level], axis=1)
    rounding = 1e-15 * farthest[:, 0] + 1e-14 * radius
    basis = np.tile(np.arange(3), (n, 1))
    rows = np.arange(n)
    solution = np.zeros((n, 3))
    for _ in range(_ROUNDS):
        active = (rows[:, None], basis[rows])
        corners = u[active]
        x = _where_equal(corners, level[active])
        solution[rows] = x
        slack = np.einsum("nmi,ni->nm", u[rows], x[:, :2]) - level[rows] - x[:, 2:]
        entering = np.argmin(slack, axis=1)
        violated = slack.min(axis=1) < -rounding[rows]
        rows, entering, corners = rows[violated], entering[violated], corners[violated]
        if not len(rows):
            break
        multiplier = _shares(corners, np.zeros((len(rows), 2)))
        change = _shares(corners, u[rows, entering])
        ratio = np.where(change > 1e-12, multiplier / np.where(change > 0, change, 1), np.inf)
        basis[rows, np.argmin(ratio, axis=1)] = entering
    return solution[:, :2]


def _where_equal(u: Array, level: Array) -> Array:
    """The (x, y, t) at which u @ (x, y) - t = level, for three vectors each: (n, 3, 2), (n, 3)."""
    (ax, ay), (bx, by) = u[:, 1].T - u[:, 0].T, u[:, 2].T - u[:, 0].T
    a, b = level[:, 1] - level[:, 0], level[:, 2] - level[:, 0]
    twice = ax * by - ay * bx
    x, y = (a * by - ay * b) / twice, (ax * b - a * bx) / twice
    return np.stack([x, y, u[:, 0, 0] * x + u[:, 0, 1] * y - level[:, 0]], axis=1)


def _shares(u: Array, point: Array) -> Array:
    """Barycentric coordinates of points (n, 2) in triangles (n, 3, 2), shape (n, 3)."""
    to_corner = u - point[:, None]
    x, y = to_corner[..., 0], to_corner[..., 1]
    area = x[:, [1, 2, 0]] * y[:, [2, 0, 1]] - x[:, [2, 0, 1]] * y[:, [1, 2, 0]]
    shares: Array = area / area.sum(axis=1, keepdims=True)
    return shares

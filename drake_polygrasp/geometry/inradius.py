"""The radius of the largest disc in a polygon, exact to rounding and the same in every frame."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, batches, distinct_values
from drake_polygrasp.geometry.polygons import polygon_corners
from drake_polygrasp.vectors import circle

_SEARCH = 1e-2
"""Times area / perimeter, which is less than the inradius, our choice: tolerance of the grid search
that looks for the greatest of several local maxima."""
_ROUGH = 5e-2
"""Times area / perimeter, our choice: tolerance of `rough_inradius`."""
_FINEST_SEARCH = 1e-3
"""Times the polygon's extent, our choice: least tolerance of the grid search, which keeps it short
on slivers."""
_SIDES_AT_ONCE = 1 << 18
"""Number of sides processed together, our choice: about 50 MB of temporaries."""
_ROUNDS = 100
"""Our choice, several times what is needed: ends loops that rounding errors could keep going."""


def inradius(polygons: npt.NDArray[np.object_]) -> Array:
    """Returns the inradius of each polygon, to a relative error of 1e-12.

    The method climbs. For a point in the polygon, each side is cut off by the line through its
    nearest point perpendicular to the connection. These half-planes bound a convex cell inside
    the polygon, which contains the largest disc about the point, so the centre of the cell's
    largest disc is no worse and becomes the next point. Where the nearest point is inside a side
    the line is that of the side, hence few rounds suffice. A convex polygon needs one round and
    one start; others have several local maxima and get several starts.

    Args:
        polygons: shapely Polygons, shape (n,).

    Returns:
        In the unit of the coordinates, shape (n,).
    """
    inradii = np.zeros(len(polygons))
    # Group polygons by their number of sides, because arrays are padded to the largest number.
    size = np.log2(np.maximum(shapely.get_num_coordinates(polygons), 1)).astype(np.int64)
    for value in distinct_values(size):
        rows = np.flatnonzero(size == value)
        for some in batches(len(rows), _SIDES_AT_ONCE >> value):
            inradii[rows[some]] = _inradius(polygons[rows[some]])
    return inradii


def _inradius(polygons: npt.NDArray[np.object_]) -> Array:
    """Returns the inradii of polygons with similar numbers of sides, shape (n,)."""
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
    """Returns the radii that climbs from points (s, 2) in polygons (s,) reach, shape (s,)."""
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
    """Returns a lower bound of the inradius of each polygon, within a tolerance of it.

    It suits outlines that are approximate themselves, and is fast on many corners.

    Args:
        polygons: shapely Polygons, shape (n,).
        tolerance: greatest error, in the unit of the coordinates; by default `_ROUGH` times area /
            perimeter, at most a few percent of the inradius.

    Returns:
        In the unit of the coordinates, shape (n,).
    """
    if tolerance is None:
        tolerance = _ROUGH * shapely.area(polygons) / np.maximum(shapely.length(polygons), 1e-300)
    found = shapely.maximum_inscribed_circle(polygons, tolerance=tolerance)
    return np.asarray(shapely.length(found))


def _starts(polygons: npt.NDArray[np.object_], convex: Bools) -> tuple[Array, Ints]:
    """Returns starting points (s, 2) for the climb and the polygon of each, shape (s,).

    A convex polygon has its centroid. Others have the best point of a grid, near to the greatest
    maximum, and the centroids of a triangulation, which do not depend on the frame.
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
    """Returns start and end of each polygon's sides, shape (n, m, 2), and which are not padding."""
    xy, ring_offsets, polygon_offsets = polygon_corners(polygons)
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
    """Returns the points of sides nearest to the centre, and their distances.

    The sides of convex polygons are extended to lines.
    """
    side = end - start
    along = np.einsum("nmi,nmi->nm", center[:, None] - start, side)
    along /= np.einsum("nmi,nmi->nm", side, side)
    along = np.where(convex[:, None], along, np.clip(along, 0, 1))
    nearest = start + along[..., None] * side
    return nearest, np.linalg.norm(center[:, None] - nearest, axis=2)


def _largest_disc(inward: Array, level: Array, radius: Array) -> Array:
    """Returns the centres of the largest discs within half-planes inward @ x >= level, (n, 2).

    Solves the linear programs max t, inward @ x - t >= level, all at once by the dual simplex
    method: it starts from three half-planes far around the origin, and the most violated
    constraint enters.
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
    """Returns (x, y, t) with u @ (x, y) - t = level for u (n, 3, 2) and level (n, 3), (n, 3)."""
    (ax, ay), (bx, by) = u[:, 1].T - u[:, 0].T, u[:, 2].T - u[:, 0].T
    a, b = level[:, 1] - level[:, 0], level[:, 2] - level[:, 0]
    twice = ax * by - ay * bx
    x, y = (a * by - ay * b) / twice, (ax * b - a * bx) / twice
    return np.stack([x, y, u[:, 0, 0] * x + u[:, 0, 1] * y - level[:, 0]], axis=1)


def _shares(u: Array, point: Array) -> Array:
    """Returns barycentric coordinates of points (n, 2) in triangles (n, 3, 2), shape (n, 3)."""
    to_corner = u - point[:, None]
    x, y = to_corner[..., 0], to_corner[..., 1]
    area = x[:, [1, 2, 0]] * y[:, [2, 0, 1]] - x[:, [2, 0, 1]] * y[:, [1, 2, 0]]
    shares: Array = area / area.sum(axis=1, keepdims=True)
    return shares

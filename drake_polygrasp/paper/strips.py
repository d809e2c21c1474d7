"""Intersections of strips, and of strips with convex polygons, in planes of the paper.

R^l and P of non-parallel sets are intersections of three strips (Sections 4.1 and 6). F of all
sets, and P of parallel sets and pairs, are the part of a convex hull within a strip (Sections 5 and
6).
"""

from __future__ import annotations

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, Shapes
from drake_polygrasp.vectors import dot


def strips_meet(turn: Array, low: Array, high: Array, slack: float) -> Bools:
    """Tests whether three strips low_i <= t_i . p <= high_i of a plane have an interior in common.

    The values t_i . p of a point satisfy sum turn_i (t_i . p) = 0 and no other relation, so the
    strips meet if and only if this plane cuts the box of their bounds.

    Args:
        turn: (t_2 x t_3, t_3 x t_1, t_1 x t_2) . N, shape (K, 3).
        low: lower bounds of the strips [m], shape (K, 3).
        high: upper bounds of the strips [m], shape (K, 3).
        slack: how far the plane must cut into the box [m].

    Returns:
        Whether the strips meet, shape (K,).
    """
    middle, half = (low + high) / 2, (high - low) / 2
    meet: Bools = np.abs(dot(turn, middle)) < dot(np.abs(turn), half) - slack
    return meet


def strips_polygon(that: Array, turn: Array, low: Array, high: Array) -> Array:
    """Computes the polygon in which three strips of a plane intersect.

    Args:
        that: unit normals t_i of the strips in coordinates of the plane, shape (K, 3, 2).
        turn: (t_2 x t_3, t_3 x t_1, t_1 x t_2) . N, shape (K, 3).
        low: lower bounds of the strips [m], shape (K, 3).
        high: upper bounds of the strips [m], shape (K, 3).

    Returns:
        Vertices in order, some repeated [m], shape (K, 10, 2); NaN where nothing is left.
    """
    rows = np.arange(len(that))
    last = np.argmax(np.abs(turn), axis=1)  # The other two strips are the least parallel pair.
    first, second = (last + 1) % 3, (last + 2) % 3
    bounds = np.stack([low, high], axis=-1)
    # A point moves along the second strip where only t_1 . p changes, and vice versa.
    area = turn[rows, last, None]
    along_1, along_2 = _quarter_turn(that[rows, first]), _quarter_turn(that[rows, second])
    of_1 = bounds[rows, first][:, [0, 1, 1, 0], None] * (-along_2 / area)[:, None]
    of_2 = bounds[rows, second][:, [0, 0, 1, 1], None] * (along_1 / area)[:, None]
    corners = clip_polygon(of_1 + of_2, that[rows, last], high[rows, last])
    return clip_polygon(corners, -that[rows, last], -low[rows, last])


def _quarter_turn(vectors: Array) -> Array:
    """Turns plane vectors (K, 2) counter-clockwise by a right angle."""
    turned: Array = vectors[:, ::-1] * np.array([-1.0, 1.0])
    return turned


def clip_polygon(vertices: Array, normal: Array, offset: Array) -> Array:
    """Cuts convex polygons with the half-planes normal . p <= offset.

    Args:
        vertices: vertices in order, repeated ones allowed [m], shape (K, V, 2).
        normal: normals of the half-planes, shape (K, 2).
        offset: offsets of the half-planes [m], shape (K,).

    Returns:
        Vertices in order, the last repeated as padding [m], shape (K, V + 2, 2); NaN where nothing
        is left.
    """
    num_rows, num_vertices, _ = vertices.shape
    rows, following = np.arange(num_rows)[:, None], _following(num_vertices)
    beyond = dot(vertices, normal[:, None]) - offset[:, None]
    inside = beyond <= 0
    crosses = inside != inside[:, following]
    span = np.where(crosses, beyond - beyond[:, following], 1.0)
    crossing = vertices + (beyond / span)[..., None] * (vertices[:, following] - vertices)

    points = np.stack([vertices, crossing], axis=2).reshape(num_rows, 2 * num_vertices, 2)
    left_out = ~np.stack([inside, crosses], axis=2).reshape(num_rows, 2 * num_vertices)
    order = np.argsort(left_out, axis=1, kind="stable")
    count = 2 * num_vertices - left_out.sum(axis=1, keepdims=True)
    slot = np.minimum(np.arange(num_vertices + 2), np.maximum(count - 1, 0))
    clipped: Array = points[rows, order[rows, slot]]
    clipped[count[:, 0] == 0] = np.nan
    return clipped


def _following(num_vertices: int) -> Ints:
    """Returns the index of the next vertex in a ring."""
    return np.arange(1, num_vertices + 1) % num_vertices


def area_and_centroid(vertices: Array) -> tuple[Array, Array]:
    """Computes areas and centroids of convex polygons.

    Args:
        vertices: vertices in order [m], shape (K, V, 2).

    Returns:
        Areas [m^2], shape (K,), and centroids [m], shape (K, 2).
    """
    p = vertices - vertices[:, :1]
    q = p[:, _following(p.shape[1])]
    twice = p[..., 0] * q[..., 1] - p[..., 1] * q[..., 0]
    area = twice.sum(axis=1) / 2
    moment = ((p + q) * twice[..., None]).sum(axis=1) / 6
    centroid = vertices[:, 0] + moment / np.where(area == 0, 1.0, area)[:, None]
    return np.abs(area), centroid


def hulls_in_strips(hulls: Shapes, low: Array, high: Array) -> tuple[Array, Array]:
    """Computes areas and centroids of the parts of convex polygons within strips low <= y <= high.

    Area and moments are integrals over y around the part's boundary. Along the strip's bounds y
    does not change, so only the hull's own edges, cut at the bounds, contribute.

    Args:
        hulls: convex polygons, shape (K,).
        low: lower bound of each strip [m], shape (K,).
        high: upper bound of each strip [m], shape (K,).

    Returns:
        Areas [m^2], shape (K,), and centroids [m], shape (K, 2).
    """
    points, owner = shapely.get_coordinates(hulls, return_index=True)
    rows = np.arange(len(hulls))
    starts, stops = np.searchsorted(owner, rows), np.searchsorted(owner, rows, side="right")
    origin = points[starts]
    x, y = (points - origin[owner]).T
    inside = np.minimum(np.maximum(y, (low - origin[:, 1])[owner]), (high - origin[:, 1])[owner])
    head = np.arange(1, len(owner) + 1)
    head[stops - 1] = starts
    rise = y[head] - y
    slope = (x[head] - x) / np.where(rise == 0, 1.0, rise)
    y_0, y_1 = inside, inside[head]
    x_0, x_1 = x + slope * (y_0 - y), x[head] + slope * (y_1 - y[head])
    moments = (y_1 - y_0) * np.stack(
        [
            3 * (x_0 + x_1),
            x_0 * x_0 + x_0 * x_1 + x_1 * x_1,
            x_0 * (2 * y_0 + y_1) + x_1 * (y_0 + 2 * y_1),
        ]
    )
    area, *moment = np.add.reduceat(moments, starts, axis=1) / 6
    centroid = origin + np.stack(moment, axis=1) / np.where(area == 0, 1.0, area)[:, None]
    return np.abs(area), centroid

"""Normals, frames and distances of arrays of triangles."""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array, Ints, batches
from drake_polygrasp.vectors import cross, dot

_PAIRS_AT_ONCE = 1 << 20
"""Number of pairs of points measured at once, our choice: about 40 MB of temporaries."""
_BINS = 8
"""Bins per axis, our choice: about 400 of them hold points of a round body."""


def distinct(rows: Array | Ints) -> tuple[Ints, Ints]:
    """Returns the distinct rows of an array.

    Args:
        rows: shape (M, 3).

    Returns:
        The index of the first row of each value, in ascending order of the values, shape (K,), and
        for each row the number 0..K-1 of its value, shape (M,).
    """
    order = np.lexsort(rows.T[::-1])  # Several times as fast as np.unique on rows.
    is_new = np.ones(len(rows), dtype=bool)
    is_new[1:] = (rows[order[1:]] != rows[order[:-1]]).any(axis=1)
    inverse = np.empty(len(rows), dtype=np.int64)
    inverse[order] = np.cumsum(is_new) - 1
    return order[is_new], inverse


def unit_normals(triangles: Array) -> tuple[Array, Array]:
    """Returns the unit normals, by the right-hand rule, and the areas of triangles.

    Args:
        triangles: [m], shape (T, 3, 3).

    Returns:
        Normals with components below 1e-12, which are rounding errors, set to 0, shape (T, 3); the
        normal is 0 where the area is. And areas [m^2], shape (T,).
    """
    normal = cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(normal, axis=1)
    return tidy(normal / np.where(length > 0, length, 1)[:, None]), length / 2


def tidy(vectors: Array) -> Array:
    """Returns unit vectors with components below 1e-12, which are rounding errors, set to 0.

    Args:
        vectors: nearly unit vectors, or 0, which stays 0; shape (..., 3).
    """
    vectors = np.where(np.abs(vectors) < 1e-12, 0.0, vectors)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))


def face_frame(normal: Array) -> Array:
    """Returns the orientation R_BF of a face with a given normal, or of many.

    Fz is along the normal, and Fx along the projection of the axis of B that is nearest to the
    plane, so that a face parallel to axes of B has a frame parallel to them.

    Args:
        normal: in B, nearly of unit length, shape (..., 3).

    Returns:
        Columns Fx, Fy, Fz, shape (..., 3, 3).
    """
    Fz = tidy(normal)
    axis = np.eye(3)[np.argmin(np.round(np.abs(Fz), 9), axis=-1)]
    Fx = tidy(axis - Fz * dot(axis, Fz)[..., None])
    return np.stack([Fx, tidy(cross(Fz, Fx)), Fz], axis=-1)


def diameter(points: Array) -> float:
    """Returns the greatest distance between two points.

    Points are binned, and only pairs of bins that can hold a greater distance than one already
    found are measured, so the time is not quadratic in the number of vertices of a round body.

    Args:
        points: [m], shape (V, 3).
    """
    points = points - points.mean(axis=0)
    points = points[distinct(points)[0]]
    size = np.ptp(points, axis=0).max() / _BINS
    bins = np.floor(points / size) if size > 0 else np.zeros_like(points)
    _, owner = distinct(bins)
    order = np.argsort(owner, kind="stable")
    points, owner = points[order], owner[order]
    start = np.flatnonzero(np.diff(owner, prepend=-1))
    low, high = np.minimum.reduceat(points, start), np.maximum.reduceat(points, start)
    bound = np.linalg.norm(np.maximum(high[:, None] - low[None], high[None] - low[:, None]), axis=2)
    end = points[0]
    for _ in range(4):
        end = points[np.argmax(np.linalg.norm(points - end, axis=1))]
    greatest = float(np.linalg.norm(points - end, axis=1).max())
    i, j = np.nonzero(np.triu(bound >= greatest))
    members = np.split(points, start[1:])
    for k in np.argsort(-bound[i, j], kind="stable"):
        if bound[i[k], j[k]] < greatest:
            break
        ends = members[i[k]]
        for rows in batches(len(ends), _PAIRS_AT_ONCE // len(members[j[k]])):
            gap = ends[rows, None] - members[j[k]]
            greatest = max(greatest, float(np.sqrt(np.einsum("abi,abi->ab", gap, gap).max())))
    return greatest


def point_triangle_distance(points: Array, triangles: Array) -> Array:
    """Returns the distance of each point to its triangle.

    The nearest point is the orthogonal projection when that lies within the triangle, else on a
    side.

    Args:
        points: [m], shape (..., 3).
        triangles: [m], shape (..., 3, 3); leading dimensions broadcast.

    Returns:
        [m], shape (...).
    """
    corner = [triangles[..., c, :] for c in range(3)]
    side = [head - tail for tail, head in zip(corner, corner[1:] + corner[:1], strict=True)]
    offset = [points - c for c in corner]
    normal = cross(side[0], side[1])
    square = dot(normal, normal)
    inside = square > 0
    on_sides = np.full(offset[0].shape[:-1], np.inf)
    for s, w in zip(side, offset, strict=True):
        inside = inside & (dot(cross(s, w), normal) >= 0)
        length = dot(s, s)
        along = dot(s, w) / np.where(length > 0, length, 1)
        nearest = w - np.clip(along, 0, 1)[..., None] * s
        on_sides = np.minimum(on_sides, np.sqrt(dot(nearest, nearest)))
    height = np.abs(dot(offset[0], normal))
    return np.where(inside, height / np.sqrt(np.where(square > 0, square, 1)), on_sides)


def nearest_on_triangles(point: Array, triangles: Array) -> Array:
    """Returns the point of each triangle nearest to one point.

    Args:
        point: [m], shape (3,).
        triangles: [m], shape (T, 3, 3); a triangle without area is taken for a segment or a point.

    Returns:
        Points [m], shape (T, 3).
    """
    normal = cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    square = dot(normal, normal)
    inside = square > 0
    nearest, least = np.empty((len(triangles), 3)), np.full(len(triangles), np.inf)
    for k in range(3):
        tail, side = triangles[:, k], triangles[:, (k + 1) % 3] - triangles[:, k]
        arm, length = point - tail, dot(side, side)
        inside &= dot(cross(side, arm), normal) >= 0
        along = np.clip(dot(side, arm) / np.where(length > 0, length, 1), 0, 1)
        on_side = tail + along[:, None] * side
        gap = dot(point - on_side, point - on_side)
        nearest[gap < least] = on_side[gap < least]
        least = np.minimum(least, gap)
    height = dot(point - triangles[:, 0], normal) / np.where(square > 0, square, 1)
    return np.where(inside[:, None], point - height[:, None] * normal, nearest)

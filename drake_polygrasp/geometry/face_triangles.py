"""Triangles of mesh faces of more than three corners, which may be concave.

Readers of mesh files cut such faces into triangles in ways of their own: Drake's clips ears, and
on concave faces some of its triangles lie outside the face. `faces_cut_wrongly` says of which
faces, and `triangulate` cuts a face as its outline says.
"""

from __future__ import annotations

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.geometry.triangles import face_frame
from drake_polygrasp.vectors import cross, dot, times

_ROUNDING = 1e-9
"""Of a face's area, ours: triangles turned against their face by less than this are none."""
_CROSSING = 1e-6
"""Of a face's area, ours: how much of it a crossing outline may count twice or not at all."""


def vector_areas(vertices: Array, corners: Ints, offsets: Ints) -> Array:
    """Returns the vector area of each face, which a plane face's normal is along (Newell).

    Args:
        vertices: shape (V, 3) [m].
        corners: vertex indices of all faces, one face after the other, shape (N,).
        offsets: where each face begins in `corners`, and N, shape (F + 1,).

    Returns:
        Shape (F, 3) [m^2]; 0 for faces without corners.
    """
    sizes = np.diff(offsets)
    first = np.repeat(vertices[corners[np.minimum(offsets[:-1], len(corners) - 1)]], sizes, axis=0)
    after = np.arange(1, len(corners) + 1)
    after[offsets[1:][sizes > 0] - 1] = offsets[:-1][sizes > 0]
    parts = cross(vertices[corners] - first, vertices[corners[after]] - first) / 2
    owner = np.repeat(np.arange(len(sizes)), sizes)
    return np.stack([np.bincount(owner, x, len(sizes)) for x in parts.T], axis=1)


def faces_cut_wrongly(vertices: Array, corners: Ints, offsets: Ints, triangles: Ints) -> Bools:
    """Returns which faces given triangles do not tile, shape (F,).

    Triangles between a face's corners that add up to its vector area, none of them turned against
    it, cover it once and nothing beside it. Faces without area are never wrong.

    Args:
        vertices: shape (V, 3) [m].
        corners: vertex indices of all faces, shape (N,).
        offsets: where each face begins in `corners`, and N, shape (F + 1,).
        triangles: vertex indices, shape (T, 3): two less than corners of each face, in its order.
    """
    face_area = vector_areas(vertices, corners, offsets)
    size = np.sqrt(dot(face_area, face_area))
    owner = np.repeat(np.arange(len(size)), np.maximum(np.diff(offsets) - 2, 0))
    a, b, c = (vertices[column] for column in triangles.T)
    area = cross(b - a, c - a) / 2
    turned = dot(area, face_area[owner]) < -_ROUNDING * size[owner] ** 2
    total = np.stack([np.bincount(owner, x, len(size)) for x in area.T], axis=1)
    missing = total - face_area
    wrong = np.sqrt(dot(missing, missing)) > _CROSSING * size
    wrong[owner[turned]] = True
    # Corners of other faces: the triangles are not what they are taken for.
    keys = np.unique(np.repeat(np.arange(len(size)), np.diff(offsets)) * len(vertices) + corners)
    foreign = ~np.isin(owner[:, None] * len(vertices) + triangles, keys)
    wrong[owner[foreign.any(axis=1)]] = True
    extent = _extent(vertices, corners, offsets)
    return np.asarray(wrong & (size > _ROUNDING * extent**2))


def _extent(vertices: Array, corners: Ints, offsets: Ints) -> Array:
    """The longest side of each face's bounding box, shape (F,)."""
    owner = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    low, high = (np.full((len(offsets) - 1, 3), x) for x in (np.inf, -np.inf))
    np.minimum.at(low, owner, vertices[corners])
    np.maximum.at(high, owner, vertices[corners])
    return np.asarray(np.where(high >= low, high - low, 0).max(axis=1, initial=0))


def triangulate(outline: Array, flatness: float = 0.0) -> Ints:
    """Cuts a nearly plane face into triangles between its corners, wound as its outline is.

    The outline may touch itself, as where a bridge joins a hole to the rim.

    Args:
        outline: the corners in order, shape (n, 3) [m].
        flatness: a face whose corners are all this near to one line [m] is cut somehow, for
            neighbours may need its sides.

    Returns:
        Indices of corners, shape (k, 3).

    Raises:
        ValueError: when the outline crosses itself.
    """
    kept = np.flatnonzero((outline != np.roll(outline, 1, axis=0)).any(axis=1))
    n = len(kept)
    if n < 3:
        return np.empty((0, 3), dtype=np.int64)
    outline = outline[kept]
    area = vector_areas(outline, np.arange(n), np.array([0, n]))[0]
    size = float(np.sqrt(dot(area, area)))
    if size <= _ROUNDING * np.ptp(outline, axis=0).max() ** 2 or _width(outline) <= flatness:
        return np.stack([np.full(n - 2, kept[0]), kept[1:-1], kept[2:]], axis=1)
    middle = outline.mean(axis=0)
    xy = times(outline - middle, face_frame(area / size)[:, :2])
    polygon = shapely.Polygon(xy)
    try:
        if not polygon.is_valid:
            polygon = shapely.make_valid(polygon)
        pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    except shapely.GEOSException:
        raise ValueError("its outline cannot be told") from None
    if abs(shapely.area(pieces).sum() - size) > _CROSSING * size:
        raise ValueError("its outline crosses itself")
    corners = shapely.get_coordinates(shapely.orient_polygons(pieces)).reshape(-1, 4, 2)[:, :3]
    # Where an outline touches itself, two corners are in one place, and either will do.
    tree = shapely.STRtree(shapely.points(xy))
    nearest = tree.nearest(shapely.points(corners.reshape(-1, 2)))
    off = np.linalg.norm(xy[nearest] - corners.reshape(-1, 2), axis=1)
    if (off > _CROSSING * np.sqrt(size)).any():
        raise ValueError("its outline crosses itself")
    return np.asarray(kept[nearest.reshape(-1, 3)])


def _width(outline: Array) -> float:
    """Greatest distance of corners from the line between two that are far from one another [m]."""
    start = outline[np.argmax(_lengths(outline - outline.mean(axis=0)))]
    arm = outline - start
    side = arm[np.argmax(_lengths(arm))]
    return float(_lengths(cross(arm, side)).max() / np.sqrt(dot(side, side)))


def _lengths(vectors: Array) -> Array:
    return np.sqrt(dot(vectors, vectors))

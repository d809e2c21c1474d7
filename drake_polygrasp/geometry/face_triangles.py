"""Triangulates mesh faces with more than three corners, which may be concave.

Mesh readers triangulate such faces in different ways. Drake's reader clips ears, and on concave
faces some of its triangles lie outside the face. `faces_cut_wrongly` finds these faces, and
`triangulate` cuts a face along its outline.
"""

from __future__ import annotations

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, distinct_values
from drake_polygrasp.geometry.triangles import face_frame
from drake_polygrasp.vectors import cross, dot, times

_ROUNDING = 1e-9
"""Times a face's area, our choice: smaller vector areas against the face are rounding errors."""
_CROSSING = 1e-6
"""Times a face's area, our choice: by how much the area of triangles may differ from that of the
face; a difference beyond it means that the outline crosses itself."""


def _vector_areas(vertices: Array, corners: Ints, offsets: Ints) -> Array:
    """Returns the vector area of each face, which is along the normal of a plane face (Newell).

    Args:
        vertices: shape (V, 3) [m].
        corners: vertex indices of all faces, one face after the other, shape (N,).
        offsets: index in `corners` at which each face begins, and N, shape (F + 1,).

    Returns:
        [m^2], shape (F, 3); 0 for faces without corners.
    """
    sizes = np.diff(offsets)
    first = np.repeat(vertices[corners[np.minimum(offsets[:-1], len(corners) - 1)]], sizes, axis=0)
    after = np.arange(1, len(corners) + 1)
    after[offsets[1:][sizes > 0] - 1] = offsets[:-1][sizes > 0]
    parts = cross(vertices[corners] - first, vertices[corners[after]] - first) / 2
    owner = np.repeat(np.arange(len(sizes)), sizes)
    return np.stack([np.bincount(owner, x, len(sizes)) for x in parts.T], axis=1)


def faces_cut_wrongly(vertices: Array, corners: Ints, offsets: Ints, triangles: Ints) -> Bools:
    """Returns which faces are not tiled by their triangles.

    Triangles between the corners of a face tile it if their vector areas add up to that of the
    face and none of them is turned against it. Faces without area are never wrong.

    Args:
        vertices: shape (V, 3) [m].
        corners: vertex indices of all faces, one face after the other, shape (N,).
        offsets: index in `corners` at which each face begins, and N, shape (F + 1,).
        triangles: vertex indices of the faces' triangles, one face after the other, shape (T, 3):
            for each face two fewer than it has corners.

    Returns:
        Shape (F,).
    """
    face_area = _vector_areas(vertices, corners, offsets)
    size = np.sqrt(dot(face_area, face_area))
    owner = np.repeat(np.arange(len(size)), np.maximum(np.diff(offsets) - 2, 0))
    a, b, c = (vertices[column] for column in triangles.T)
    area = cross(b - a, c - a) / 2
    turned = dot(area, face_area[owner]) < -_ROUNDING * size[owner] ** 2
    total = np.stack([np.bincount(owner, x, len(size)) for x in area.T], axis=1)
    missing = total - face_area
    wrong = np.sqrt(dot(missing, missing)) > _CROSSING * size
    wrong[owner[turned]] = True
    # A triangle with a corner of another face: the triangles are not in the order of the faces.
    keys = distinct_values(
        np.repeat(np.arange(len(size)), np.diff(offsets)) * len(vertices) + corners
    )
    foreign = ~np.isin(owner[:, None] * len(vertices) + triangles, keys)
    wrong[owner[foreign.any(axis=1)]] = True
    extent = _extent(vertices, corners, offsets)
    return np.asarray(wrong & (size > _ROUNDING * extent**2))


def _extent(vertices: Array, corners: Ints, offsets: Ints) -> Array:
    """Returns the longest side of each face's bounding box, shape (F,)."""
    owner = np.repeat(np.arange(len(offsets) - 1), np.diff(offsets))
    low, high = (np.full((len(offsets) - 1, 3), x) for x in (np.inf, -np.inf))
    np.minimum.at(low, owner, vertices[corners])
    np.maximum.at(high, owner, vertices[corners])
    return np.asarray(np.where(high >= low, high - low, 0).max(axis=1, initial=0))


def triangulate(outline: Array, flatness: float = 0.0) -> Ints:
    """Returns triangles between the corners of a nearly plane face, oriented like its outline.

    The outline may touch itself, as where a bridge joins a hole to the rim.

    Args:
        outline: the corners in order, shape (n, 3) [m].
        flatness: a face whose corners are all within this of one line [m] becomes a fan of
            triangles, because its neighbours may share its sides.

    Returns:
        Indices of corners, shape (k, 3).

    Raises:
        ValueError: when the outline crosses itself, or cannot be triangulated; the message
            completes "face 2: ".
    """
    kept = np.flatnonzero((outline != np.roll(outline, 1, axis=0)).any(axis=1))
    n = len(kept)
    if n < 3:
        return np.empty((0, 3), dtype=np.int64)
    outline = outline[kept]
    area = _vector_areas(outline, np.arange(n), np.array([0, n]))[0]
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
        raise ValueError("its outline cannot be triangulated") from None
    if abs(shapely.area(pieces).sum() - size) > _CROSSING * size:
        raise ValueError("its outline crosses itself")
    corners = shapely.get_coordinates(shapely.orient_polygons(pieces)).reshape(-1, 4, 2)[:, :3]
    # Where an outline touches itself two corners coincide, and either may be taken.
    tree = shapely.STRtree(shapely.points(xy))
    nearest = tree.nearest(shapely.points(corners.reshape(-1, 2)))
    off = np.linalg.norm(xy[nearest] - corners.reshape(-1, 2), axis=1)
    if (off > _CROSSING * np.sqrt(size)).any():
        raise ValueError("its outline crosses itself")
    return np.asarray(kept[nearest.reshape(-1, 3)])


def _width(outline: Array) -> float:
    """Returns the greatest distance of a corner from the line between two far apart [m]."""
    start = outline[np.argmax(_lengths(outline - outline.mean(axis=0)))]
    arm = outline - start
    side = arm[np.argmax(_lengths(arm))]
    return float(_lengths(cross(arm, side)).max() / np.sqrt(dot(side, side)))


def _lengths(vectors: Array) -> Array:
    """Returns the lengths of vectors."""
    return np.sqrt(dot(vectors, vectors))

"""The part of a face's plane that shells cover: sections (for Section 2 of the paper).

A solid covers, of a face's plane, its section by that plane moved outward by an infinitesimal
amount. The section is exact, because in that limit vertices on the plane count as below it: a
shell that stands on the face covers its footprint, and one that ends at the plane covers nothing.
Where shells overlap their winding numbers add up; a point is covered where the sum is positive.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, batches
from drake_polygrasp.geometry.polygons import Polygons, restore
from drake_polygrasp.geometry.tolerances import FLATNESS, LENGTH_TOLERANCE
from drake_polygrasp.vectors import times

_CRACK = 1e-4
"""Times L, our choice: size of the gaps and overlaps between the convex pieces into which
decomposition cuts a solid."""

_PAIRS_AT_ONCE = 1 << 20
"""Number of point-segment pairs compared at once, our choice: about 40 MB of temporaries."""


class Mesh(NamedTuple):
    """All shells of a body and of other bodies that cover it, oriented outward.

    Attributes:
        vertices: in B [m], shape (V, 3).
        corners: vertex indices of each triangle, shape (T, 3).
        shell: shell of each triangle, shape (T,).
        mu: friction coefficient of each triangle, shape (T,).
        curve: index of the part that is the curved solid which each triangle is a facet of, -1 for
            none, shape (T,).
        own: whether each triangle is of the body, not of another that covers it, shape (T,).
        low: corner of each shell's bounding box with the least coordinates [m], shape (S, 3).
        high: the opposite corner [m], shape (S, 3).
        closed: whether each shell is watertight, shape (S,).
        simple: whether each shell is a manifold, so that it does not cover itself, shape (S,).
    """

    vertices: Array
    corners: Ints
    shell: Ints
    mu: Array
    curve: Ints
    own: Bools
    low: Array
    high: Array
    closed: Bools
    simple: Bools


class Plane(NamedTuple):
    """A plane in which faces lie.

    Attributes:
        R_BF: columns Fx, Fy in the plane and Fz outward, shape (3, 3).
        offset: coordinate of the plane along Fz, from Bo [m].
        triangles: indices of the triangles in the plane, shape (K,).
    """

    R_BF: Array
    offset: float
    triangles: Ints


def covered(mesh: Mesh, plane: Plane, shells: Ints, L: float) -> Polygons:
    """Returns the areas of a plane that shells cover.

    A shell with vertices near the plane, but not on it, may stand on the plane but for a crack.
    Then what it covers at the height of a crack counts too.

    Args:
        mesh: the shells.
        plane: the plane.
        shells: indices of the shells that may cover parts of it.
        L: diameter of the body [m].

    Returns:
        Polygons in the coordinates of Fx and Fy [m], which may overlap.
    """
    corners = mesh.corners[np.isin(mesh.shell, shells)]
    xy = times(mesh.vertices, plane.R_BF[:, :2])
    height = times(mesh.vertices, plane.R_BF[:, 2]) - plane.offset
    on_plane = np.where(np.abs(height) <= FLATNESS * L, 0, height)
    areas = _section(corners, on_plane, xy, L)
    almost = np.abs(height[corners])
    if ((almost > LENGTH_TOLERANCE * L) & (almost < _CRACK * L)).any():
        areas = np.concatenate([areas, _section(corners, height - _CRACK * L, xy, L)])
    return np.concatenate([areas, _coincident(mesh, xy, height, L)])


def _coincident(mesh: Mesh, xy: Array, height: Array, L: float) -> Polygons:
    """Returns the triangles of other bodies in the plane, at `height` 0, that face outward."""
    other = mesh.corners[~mesh.own]
    other = other[(np.abs(height[other]) <= FLATNESS * L).all(axis=1)]
    u, v = xy[other[:, 1]] - xy[other[:, 0]], xy[other[:, 2]] - xy[other[:, 0]]
    return np.asarray(shapely.polygons(xy[other[u[:, 0] * v[:, 1] > u[:, 1] * v[:, 0]]]))


def _section(corners: Ints, height: Array, xy: Array, L: float) -> Polygons:
    """Returns the section of closed shells just above height 0."""
    segments = _segments(corners, height, xy)
    lines = shapely.linestrings(segments[(segments[:, 0] != segments[:, 1]).any(axis=1)])
    grid = LENGTH_TOLERANCE * L
    areas = shapely.get_parts(shapely.polygonize([shapely.union_all(lines, grid_size=grid)]))
    points = shapely.get_coordinates(shapely.point_on_surface(areas))
    solid = shapely.coverage_union_all(areas[_winding_number(points, segments) > 0])
    return restore(shapely.get_parts(solid), segments.reshape(-1, 2), grid)


def _segments(corners: Ints, height: Array, xy: Array) -> Array:
    """Returns segments where triangles cross height 0, with the inside on the left, (k, 2, 2)."""
    above = height[corners] > 0
    crossing = above.any(axis=1) != above.all(axis=1)
    corners, above = corners[crossing], above[crossing]
    lone_above = above.sum(axis=1) == 1
    lone = np.argmax(above == lone_above[:, None], axis=1)[:, None]
    ring = np.take_along_axis(corners, (lone + np.arange(3)) % 3, axis=1)
    # Interpolate from the lower vertex index to the higher: neighbours agree to the last bit.
    start = np.minimum(ring[:, :1], ring[:, 1:])
    end = np.maximum(ring[:, :1], ring[:, 1:])
    along = (height[start] / (height[start] - height[end]))[..., None]
    points = (1 - along) * xy[start] + along * xy[end]
    return np.where(lone_above[:, None, None], points, points[:, ::-1])


def _winding_number(points: Array, segments: Array) -> Ints:
    """Returns the winding numbers of closed chains of segments (k, 2, 2) around points, (n,)."""
    (ax, ay), (bx, by) = np.moveaxis(segments, 0, 2)
    turns = np.zeros(len(points), dtype=np.int64)
    for rows in batches(len(points), _PAIRS_AT_ONCE // max(1, len(segments))):
        x, y = points[rows, :1], points[rows, 1:]
        left = (bx - ax) * (y - ay) - (x - ax) * (by - ay)
        upward = (ay <= y) & (y < by) & (left > 0)
        downward = (by <= y) & (y < ay) & (left < 0)
        turns[rows] = upward.sum(axis=1) - downward.sum(axis=1)
    return turns

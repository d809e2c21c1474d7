"""Finds the facets that a fingertip may touch first when it misses a contact.

The fingertip moves along the contact's normal. Facets are projected along it and clipped to a
window around the contact. A facet is hidden where another one lies above it; the two planes are
compared at the corners of the overlap.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, Shapes, distinct_values
from drake_polygrasp.geometry.tolerances import FLATNESS, LENGTH_TOLERANCE, ON_SURFACE
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.vectors import dot

_UPRIGHT = 1e-6
"""Our choice: facets at a smaller cosine to the contact's normal are walls, seen as lines."""
_HALF_WAY = 0.5
"""Our choice: fingertips start half way to the part of the body opposite the contact, if any."""


class VisibleFacets(NamedTuple):
    """The facets visible from above a contact C, whose frame has Cz outward.

    Attributes:
        p_CV: corners of the convex hull of each facet's visible part, in order [m], shape (k, 3).
        nhat_C: outward unit normal of each facet, shape (n, 3).
        triangle: index of each facet's triangle, shape (n,).
        hole: distance from the contact, seen from above, to the nearest point under which there is
            no facet [m]; infinite if there is none.
        has_step: whether a facet ends above another one.
        is_blocked: whether the body fills part of the fingertips' path.
    """

    p_CV: list[Array]
    nhat_C: Array
    triangle: Ints
    hole: float
    has_step: bool
    is_blocked: bool


def visible_facets(triangles_C: Array, window: Array, diameter: float) -> VisibleFacets:
    """Returns the facets visible from above a contact within a window around it.

    Args:
        triangles_C: in the contact's frame, counter-clockwise from outside [m], shape (T, 3, 3).
        window: corners of a convex polygon about the contact in the plane of Cx and Cy [m],
            shape (k, 2).
        diameter: L of the body [m].
    """
    tolerance = LENGTH_TOLERANCE * diameter
    low, high = window.min(axis=0), window.max(axis=0)
    xy = triangles_C[:, :, :2]
    # Corner by corner over all triangles: several times faster than over the short axis.
    least = np.minimum(np.minimum(xy[:, 0], xy[:, 1]), xy[:, 2])
    greatest = np.maximum(np.maximum(xy[:, 0], xy[:, 1]), xy[:, 2])
    triangle = np.flatnonzero(((least <= high) & (greatest >= low)).all(axis=1))
    nhat, area = unit_normals(triangles_C[triangle])
    triangle, nhat = triangle[area > tolerance**2], nhat[area > tolerance**2]
    is_wall = np.abs(nhat[:, 2]) <= _UPRIGHT
    walls = triangles_C[triangle[is_wall]]
    triangle, nhat = triangle[~is_wall], nhat[~is_wall]
    frame = shapely.Polygon(window)
    shapes = shapely.intersection(shapely.polygons(xy[triangle]), frame)
    wide = _is_wide(shapes, tolerance)
    triangle, nhat, shapes = triangle[wide], nhat[wide], shapes[wide]
    planes = _planes(triangles_C[triangle, 0], nhat)
    start = _HALF_WAY * _ceiling(shapes, planes, ON_SURFACE * diameter)
    lowest, highest = _heights(shapes, planes)
    below = highest <= start
    blocked = bool((~below & (lowest < start)).any()) or _walls_cross(walls, frame, start)
    seen = below & (nhat[:, 2] > 0)
    triangle, nhat, shapes, planes = triangle[seen], nhat[seen], shapes[seen], planes[seen]
    shapes = _less_hidden(shapes, planes, tolerance)
    wide = _is_wide(shapes, tolerance)
    triangle, nhat, shapes, planes = triangle[wide], nhat[wide], shapes[wide], planes[wide]
    has_step = _has_step(shapes, planes, tolerance, FLATNESS * diameter)
    holes = shapely.get_parts(shapely.difference(frame, shapely.union_all(shapes)))
    holes = holes[_is_wide(holes, tolerance)]
    hole = float(shapely.distance(holes, shapely.Point(0, 0)).min(initial=np.inf))
    p_CV = []
    for hull, plane in zip(shapely.convex_hull(shapes), planes, strict=True):
        corners = shapely.get_coordinates(hull)[:-1]
        p_CV.append(np.column_stack([corners, dot(corners, plane[:2]) + plane[2]]))
    return VisibleFacets(p_CV, nhat, triangle, hole, has_step, blocked)


def _is_wide(shapes: Shapes, tolerance: float) -> Bools:
    """Returns which polygons are wider than a rounding error."""
    return np.asarray(2 * shapely.area(shapes) > tolerance * shapely.length(shapes))


def _planes(corner: Array, nhat: Array) -> Array:
    """Returns (a, b, c) of the planes z = a x + b y + c through points (n, 3), shape (n, 3)."""
    slope = -nhat[:, :2] / nhat[:, 2:]
    return np.column_stack([slope, corner[:, 2] - dot(slope, corner[:, :2])])


def _heights(shapes: Shapes, planes: Array) -> tuple[Array, Array]:
    """Returns the least and greatest heights of planes at the corners of shapes [m], (n,) each."""
    xy, owner = shapely.get_coordinates(shapes, return_index=True)
    z = dot(planes[owner, :2], xy) + planes[owner, 2]
    low, high = np.full(len(shapes), np.inf), np.full(len(shapes), -np.inf)
    np.minimum.at(low, owner, z)
    np.maximum.at(high, owner, z)
    return low, high


def _ceiling(shapes: Shapes, planes: Array, least: float) -> float:
    """Returns the height of the lowest facet more than `least` above the contact [m]."""
    height = planes[shapely.intersects_xy(shapes, 0.0, 0.0), 2]
    return float(height[height > least].min(initial=np.inf))


def _walls_cross(walls: Array, window: shapely.Polygon, height: float) -> bool:
    """Returns whether some wall (w, 3, 3) crosses a height within the window."""
    crossing = (walls[:, :, 2].min(axis=1) < height) & (walls[:, :, 2].max(axis=1) > height)
    for wall in walls[crossing]:
        ends = []
        for here, there in zip(wall, np.roll(wall, 1, axis=0), strict=True):
            if (here[2] < height) != (there[2] < height):
                share = (height - here[2]) / (there[2] - here[2])
                ends.append(here[:2] + share * (there[:2] - here[:2]))
        if shapely.intersects(window, shapely.LineString(ends)):
            return True
    return False


def _less_hidden(shapes: Shapes, planes: Array, tolerance: float) -> Shapes:
    """Returns the part of each shape that no other shape hides."""
    i, j, overlap = _overlaps(shapes, tolerance)
    low, high = _heights(overlap, planes[j] - planes[i])
    hides = high > tolerance
    shapes = shapes.copy()
    for k in distinct_values(i[hides]):
        pairs = np.flatnonzero(hides & (i == k))
        hiders = [
            overlap[pair]
            if low[pair] >= -tolerance
            else _where_positive(overlap[pair], planes[j[pair]] - planes[k])
            for pair in pairs
        ]
        shapes[k] = shapely.difference(shapes[k], shapely.union_all(hiders))
    return shapes


def _overlaps(shapes: Shapes, tolerance: float) -> tuple[Ints, Ints, Shapes]:
    """Returns pairs of overlapping shapes, each in both orders, and their intersections."""
    i, j = shapely.STRtree(shapes).query(shapes, predicate="intersects")
    i, j = i[i != j], j[i != j]
    overlap = shapely.intersection(shapes[i], shapes[j])
    wide = _is_wide(overlap, tolerance)
    return i[wide], j[wide], overlap[wide]


def _where_positive(shape: shapely.Polygon, plane: Array) -> shapely.Polygon:
    """Returns the part of a convex polygon where a x + b y + c > 0."""
    corners = shapely.get_coordinates(shape)[:-1]
    value = dot(corners, plane[:2]) + plane[2]
    kept = []
    for k in range(len(corners)):
        if (value[k - 1] > 0) != (value[k] > 0):
            share = value[k - 1] / (value[k - 1] - value[k])
            kept.append(corners[k - 1] + share * (corners[k] - corners[k - 1]))
        if value[k] > 0:
            kept.append(corners[k])
    return shapely.Polygon(kept) if len(kept) > 2 else shapely.Polygon()


def _has_step(shapes: Shapes, planes: Array, tolerance: float, least: float) -> bool:
    """Returns whether two adjacent shapes differ in height by more than `least` [m]."""
    i, j = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=tolerance)
    i, j = i[i < j], j[i < j]
    border = shapely.intersection(shapely.buffer(shapes[i], tolerance), shapes[j])
    long = shapely.length(border) > least
    i, j = i[long], j[long]
    apart = planes[j] - planes[i]
    low, high = _heights(border[long], apart)
    # The border strips are as wide as the tolerance, over which steep planes rise.
    rise = 2 * tolerance * np.sqrt(dot(apart[:, :2], apart[:, :2]))
    return bool((np.maximum(-low, high) > least + rise).any())

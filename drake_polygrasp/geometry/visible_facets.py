"""Finds the facets that a fingertip may touch first when it misses a contact.

The fingertip moves along the contact's normal. Facets are projected along it and clipped to a
window around the contact. A facet is hidden where another one lies above it; the two planes are
compared at the corners of the overlap.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, Shapes
from drake_polygrasp.geometry.tolerances import FLATNESS, LENGTH_TOLERANCE, ON_SURFACE, UPRIGHT
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.vectors import dot

_GRID = 1e-4
"""Times the tolerance, our choice: polygons are united and subtracted on a grid this fine, because
without one GEOS loses polygons whose common sides differ by rounding errors."""
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
    is_wall = np.abs(nhat[:, 2]) <= UPRIGHT
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
    shapes, is_whole = _less_hidden(shapes, planes, xy[triangle], tolerance)
    wide = _is_wide(shapes, tolerance)
    triangle, nhat, shapes, planes = triangle[wide], nhat[wide], shapes[wide], planes[wide]
    whole = np.where(is_whole[wide, None, None], triangles_C[triangle], np.nan)
    has_step = _has_step(shapes, planes, whole, tolerance, FLATNESS * diameter)
    floor = shapely.union_all(shapes, grid_size=_GRID * tolerance)
    holes = shapely.get_parts(shapely.difference(frame, floor))
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


def _less_hidden(
    shapes: Shapes, planes: Array, xy: Array, tolerance: float
) -> tuple[Shapes, Bools]:
    """Returns the part of each shape that no other hides, and whether that is all of it.

    Args:
        shapes: parts of triangles seen from above.
        planes: those of the triangles, shape (n, 3).
        xy: corners of the triangles, counter-clockwise, shape (n, 3, 2).
        tolerance: lengths below this are rounding errors [m].
    """
    i, j, overlap = _overlaps(shapes, xy, tolerance)
    low, high = _heights(overlap, planes[j] - planes[i])
    hides = high > tolerance
    shapes, is_whole, grid = shapes.copy(), np.ones(len(shapes), dtype=bool), _GRID * tolerance
    is_whole[i[hides]] = False
    for k in np.flatnonzero(~is_whole).tolist():
        pairs = np.flatnonzero(hides & (i == k))
        hiders = [
            overlap[pair]
            if low[pair] >= -tolerance
            else _where_positive(overlap[pair], planes[j[pair]] - planes[k])
            for pair in pairs
        ]
        hidden = shapely.union_all(hiders, grid_size=grid)
        shapes[k] = shapely.difference(shapes[k], hidden, grid_size=grid)
    return shapes, is_whole


def _overlaps(shapes: Shapes, xy: Array, tolerance: float) -> tuple[Ints, Ints, Shapes]:
    """Returns pairs of overlapping shapes, each in both orders, and their intersections."""
    i, j = shapely.STRtree(shapes).query(shapes)
    i, j = i[i < j], j[i < j]
    # Most neighbours only touch: a side of one triangle has the other beyond it.
    cross = ~(_are_beside(xy[i], xy[j], tolerance) | _are_beside(xy[j], xy[i], tolerance))
    i, j = i[cross], j[cross]
    overlap = shapely.intersection(shapes[i], shapes[j])
    wide = _is_wide(overlap, tolerance)
    i, j, overlap = i[wide], j[wide], overlap[wide]
    return np.append(i, j), np.append(j, i), np.append(overlap, overlap)


def _are_beside(xy: Array, others: Array, tolerance: float) -> Bools:
    """Returns whether a side of each triangle (P, 3, 2) has all of another one beyond it, (P,)."""
    side = np.roll(xy, -1, axis=1) - xy
    off = others[:, None] - xy[:, :, None]
    inward = side[:, :, None, 0] * off[..., 1] - side[:, :, None, 1] * off[..., 0]
    # Overlaps of half the width of a rounding error do not count as wide.
    least = 0.25 * tolerance * np.sqrt(dot(side, side))
    return np.asarray((inward.max(axis=2) <= least).any(axis=1))


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


def _has_step(shapes: Shapes, planes: Array, whole: Array, tolerance: float, least: float) -> bool:
    """Returns whether two adjacent shapes differ in height by more than `least` [m].

    Args:
        shapes: what is seen of triangles from above.
        planes: those of the triangles, shape (n, 3).
        whole: corners of triangles of which nothing is hidden [m], shape (n, 3, 3); not numbers for
            others.
        tolerance: lengths below this are rounding errors [m].
        least: height of a step [m].
    """
    i, j = shapely.STRtree(shapes).query(shapes, predicate="dwithin", distance=tolerance)
    i, j = i[i < j], j[i < j]
    # Triangles with a common side are as high along it.
    common = (whole[i][:, :, None] == whole[j][:, None]).all(axis=3).any(axis=2).sum(axis=1)
    i, j = i[common < 2], j[common < 2]
    border = shapely.intersection(shapely.buffer(shapes, tolerance)[i], shapes[j])
    long = shapely.length(border) > least
    i, j = i[long], j[long]
    apart = planes[j] - planes[i]
    low, high = _heights(border[long], apart)
    # The border strips are as wide as the tolerance, over which steep planes rise.
    rise = 2 * tolerance * np.sqrt(dot(apart[:, :2], apart[:, :2]))
    return bool((np.maximum(-low, high) > least + rise).any())

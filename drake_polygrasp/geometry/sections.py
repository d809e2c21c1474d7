"""What the shells of a body cover of a plane: sections (Section 2 of the paper).

A solid covers, on a face's plane, its section by that plane moved outward by an infinitesimal
amount. The section is exact, for in that limit vertices on the plane are simply below it: a shell
that stands on the face covers its footprint, one that ends there covers nothing. Where shells
overlap, they wind more than once around a point; inside is what they wind around at all.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, batches
from drake_polygrasp.geometry.tolerances import FLATNESS, LENGTH_TOLERANCE
from drake_polygrasp.vectors import times

Polygons = npt.NDArray[np.object_]

_CRACK = 1e-4
"""Times L, ours: the shells that convex decomposition makes of one solid touch but for gaps and
overlaps of this size."""

_PAIRS_AT_ONCE = 1 << 20
"""Of points and segments that are compared at once, ours: temporaries of some 40 MB."""
_LOST = 1e-9
"""Share of the area, ours: a union that misses no more has lost none."""


class Mesh(NamedTuple):
    """All shells of a body and its covers, outward.

    Rows of `corners`, `shell`, `mu`, `curve` and `own` are triangles.

    Attributes:
        vertices: in B [m], shape (V, 3).
        corners: vertex indices, shape (T, 3).
        shell: shell of each triangle, shape (T,).
        mu: friction coefficient of each triangle, shape (T,).
        curve: the curved solid that each triangle is a facet of, -1 for none.
        own: whether each triangle is of the body, or of another that only covers it, shape (T,).
        low: least corner of the bounding box of each shell, shape (S, 3).
        high: greatest corner of that box, shape (S, 3).
        closed: whether each shell is watertight, shape (S,).
        simple: whether each shell is a manifold, and so does not cover itself, shape (S,).
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
    """A plane of faces, Fz outward.

    Attributes:
        R_BF: axes of the plane; the third is its normal, shape (3, 3).
        offset: of the plane along Fz [m].
        triangles: those that lie in it.
    """

    R_BF: Array
    offset: float
    triangles: Ints


def covered(mesh: Mesh, plane: Plane, shells: Ints, L: float) -> Polygons:
    """The areas of the plane that `shells` cover, in the coordinates of Fx and Fy.

    A shell with vertices almost on the plane, above or below, may stand on it but for a crack:
    what it covers at the height of a crack counts too.
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
    """Other bodies' triangles in a plane, at `height` 0, that face as it does."""
    other = mesh.corners[~mesh.own]
    other = other[(np.abs(height[other]) <= FLATNESS * L).all(axis=1)]
    u, v = xy[other[:, 1]] - xy[other[:, 0]], xy[other[:, 2]] - xy[other[:, 0]]
    return np.asarray(shapely.polygons(xy[other[u[:, 0] * v[:, 1] > u[:, 1] * v[:, 0]]]))


def _section(corners: Ints, height: Array, xy: Array, L: float) -> Polygons:
    """The section just above height 0."""
    segments = _segments(corners, height, xy)
    lines = shapely.linestrings(segments[(segments[:, 0] != segments[:, 1]).any(axis=1)])
    grid = LENGTH_TOLERANCE * L
    areas = shapely.get_parts(shapely.polygonize([shapely.union_all(lines, grid_size=grid)]))
    points = shapely.get_coordinates(shapely.point_on_surface(areas))
    solid = shapely.coverage_union_all(areas[_winding_number(points, segments) > 0])
    return restore(shapely.get_parts(solid), segments.reshape(-1, 2), grid)


def merged(triangles: Polygons, grid: float) -> shapely.Geometry:
    """Their union: exact where they share whole sides and nothing else, else rounded to a grid."""
    try:
        union = shapely.coverage_union_all(triangles)
        total = shapely.area(triangles).sum()
        if shapely.is_valid(union) and abs(union.area - total) <= _LOST * total:
            return union
    except shapely.GEOSException:
        pass  # They are no coverage: some overlap.
    return shapely.union_all(triangles, grid_size=grid)


def restore(geometries: Polygons, vertices: Array, grid: float) -> Polygons:
    """Undo what rounding to the grid, which makes overlays robust, did to given vertices (k, 2).

    Of polygons, and into polygons: where snapping closes a gap, one may become several.
    """
    return valid(shapely.snap(geometries, shapely.multipoints(vertices), 2 * grid))


def valid(polygons: Sequence[shapely.Polygon] | Polygons) -> Polygons:
    """The polygons, in place of those whose rings cross the nearest that do not."""
    polygons = np.array(polygons, dtype=object)
    broken = ~shapely.is_valid(polygons)
    polygons[broken] = shapely.make_valid(
        polygons[broken], method="structure", keep_collapsed=False
    )
    return areas_of(polygons)


def areas_of(geometries: Sequence[shapely.Geometry] | Polygons) -> Polygons:
    """Their polygons, without the points and lines that overlays leave where areas touch."""
    parts = shapely.get_parts(shapely.get_parts(np.asarray(geometries, dtype=object)))
    return np.asarray(parts[shapely.get_dimensions(parts) == 2])


def _segments(corners: Ints, height: Array, xy: Array) -> Array:
    """Where triangles cross height 0, with the inside on the left, shape (k, 2, 2)."""
    above = height[corners] > 0
    crossing = above.any(axis=1) != above.all(axis=1)
    corners, above = corners[crossing], above[crossing]
    lone_above = above.sum(axis=1) == 1
    lone = np.argmax(above == lone_above[:, None], axis=1)[:, None]
    ring = np.take_along_axis(corners, (lone + np.arange(3)) % 3, axis=1)
    # From the lower vertex index to the higher, so that neighbours agree to the last bit.
    start = np.minimum(ring[:, :1], ring[:, 1:])
    end = np.maximum(ring[:, :1], ring[:, 1:])
    along = (height[start] / (height[start] - height[end]))[..., None]
    points = (1 - along) * xy[start] + along * xy[end]
    return np.where(lone_above[:, None, None], points, points[:, ::-1])


def _winding_number(points: Array, segments: Array) -> Ints:
    """How often closed chains of segments (k, 2, 2) wind around the points (n, 2), shape (n,)."""
    (ax, ay), (bx, by) = np.moveaxis(segments, 0, 2)
    turns = np.zeros(len(points), dtype=np.int64)
    for rows in batches(len(points), _PAIRS_AT_ONCE // max(1, len(segments))):
        x, y = points[rows, :1], points[rows, 1:]
        left = (bx - ax) * (y - ay) - (x - ax) * (by - ay)
        upward = (ay <= y) & (y < by) & (left > 0)
        downward = (by <= y) & (y < ay) & (left < 0)
        turns[rows] = upward.sum(axis=1) - downward.sum(axis=1)
    return turns

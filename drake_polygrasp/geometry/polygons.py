"""Unions, insets and clean-up of polygons in a plane."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.geometry.tolerances import FLATNESS, LENGTH_TOLERANCE

Polygons = npt.NDArray[np.object_]

_LOST = 1e-9
"""Fraction of the area, our choice: a larger loss shows that a union is wrong."""


def shrunk(polygons: npt.NDArray[np.object_], by: float | Array) -> npt.NDArray[np.object_]:
    """Returns polygons without the points near their edges, with sharp corners.

    Args:
        polygons: shapely Polygons [m], shape (n,).
        by: the distance [m], one for all or shape (n,).
    """
    # GEOS divides by zero at some corners, harmlessly, and NumPy would warn of it.
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(shapely.buffer(polygons, -by, join_style="mitre"))


def merged(triangles: Polygons, grid: float) -> shapely.Geometry:
    """Returns the union of triangles.

    It is exact where they share whole sides and nothing else; otherwise coordinates are rounded to
    a grid.

    Args:
        triangles: shapely Polygons [m], shape (K,).
        grid: spacing of the grid [m].
    """
    try:
        union = shapely.coverage_union_all(triangles)
        total = shapely.area(triangles).sum()
        if shapely.is_valid(union) and abs(union.area - total) <= _LOST * total:
            return union
    except shapely.GEOSException:
        pass  # Some triangles overlap.
    return shapely.union_all(triangles, grid_size=grid)


def restore(geometries: Polygons, vertices: Array, grid: float) -> Polygons:
    """Returns polygons whose vertices are snapped back to where they were before rounding.

    Rounding to a grid makes overlays robust.

    Args:
        geometries: polygons with rounded vertices, shape (n,).
        vertices: the exact vertices [m], shape (k, 2).
        grid: spacing of the grid [m].

    Returns:
        Polygons; one becomes several where snapping closes a gap.
    """
    return valid(shapely.snap(geometries, shapely.multipoints(vertices), 2 * grid))


def valid(polygons: Sequence[shapely.Polygon] | Polygons) -> Polygons:
    """Returns polygons, with those whose rings cross replaced by valid ones of the same structure.

    Args:
        polygons: polygons of any validity, shape (n,).
    """
    polygons = np.array(polygons, dtype=object)
    broken = ~shapely.is_valid(polygons)
    polygons[broken] = shapely.make_valid(
        polygons[broken], method="structure", keep_collapsed=False
    )
    return areas_of(polygons)


def areas_of(geometries: Sequence[shapely.Geometry] | Polygons) -> Polygons:
    """Returns the polygons of geometries, without the points and lines that overlays leave.

    Args:
        geometries: polygons, collections or multipart geometries, shape (n,).
    """
    parts = shapely.get_parts(shapely.get_parts(np.asarray(geometries, dtype=object)))
    return np.asarray(parts[shapely.get_dimensions(parts) == 2])


def tidy_polygons(polygons: Polygons, L: float) -> list[shapely.Polygon]:
    """Returns polygons without collinear vertices, slivers and sliver holes.

    Args:
        polygons: shapely Polygons [m], shape (n,).
        L: diameter of the body [m]; slivers are narrower than 2 `FLATNESS` L.
    """
    tidied: list[shapely.Polygon] = []
    for part in polygons[_wide(polygons, L)]:
        holes = shapely.polygons(np.array(part.interiors, dtype=object))
        shell, *rest = (_corners(ring, L) for ring in [part.exterior, *part.interiors])
        kept = [ring for ring, wide in zip(rest, _wide(holes, L), strict=True) if wide]
        # A hole that touches the rim at a vertex may reach beyond the straightened rim.
        tidied += shapely.orient_polygons(valid([shapely.Polygon(shell, kept)])).tolist()
    return tidied


def _wide(polygons: Polygons, L: float) -> Bools:
    """Returns which polygons are wider than 2 `FLATNESS` L somewhere."""
    return ~np.asarray(shapely.is_empty(shrunk(polygons, FLATNESS * L)), dtype=bool)


def _corners(ring: shapely.LinearRing, L: float) -> shapely.LinearRing:
    """Returns a ring without vertices within `FLATNESS` L of the line through their neighbours."""
    vertices = shapely.get_coordinates(ring)[:-1]
    from_middle = np.linalg.norm(vertices - vertices.mean(axis=0), axis=1)
    # The farthest vertex lies on no line between two others, so simplifying may start there.
    start = np.argmax(np.round(from_middle / (LENGTH_TOLERANCE * L)))
    vertices = np.roll(vertices, -start, axis=0)
    return shapely.simplify(shapely.LinearRing(vertices), FLATNESS * L)


def polygon_corners(polygons: Polygons) -> tuple[Array, Ints, Ints]:
    """Returns the corners of polygons, ring by ring, each ring closed by its first corner.

    `shapely.to_ragged_array` does the same, but imports `numpy.ma` first, which takes longer.

    Args:
        polygons: shape (n,), none empty.

    Returns:
        Corners, shape (V, 2); where the corners of each ring begin and the last end, shape
        (R + 1,); and where the rings of each polygon begin and the last end, shape (n + 1,).
    """
    rings, owner = shapely.get_rings(polygons, return_index=True)
    xy, ring = shapely.get_coordinates(rings, return_index=True)
    ring_offsets = np.searchsorted(ring, np.arange(len(rings) + 1))
    return xy, ring_offsets, np.searchsorted(owner, np.arange(len(polygons) + 1))

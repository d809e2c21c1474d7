"""Beyond the paper: sample points on regions, where contacts are tried."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import shapely

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.geometry.polygons import shrunk
from drake_polygrasp.geometry.regions import Regions, nearest_points
from drake_polygrasp.search.effort import Effort

POINTS_A_REGION = 2.5
"""Our choice: points for each region on objects of more than a few regions."""
MORE_POINTS = 2.5
"""Our choice: limit of these, times the points on objects of few regions."""
LEAST_A_REGION = 1.3
"""Our choice: points for each region at least."""
SCARCE = 1.5
"""Our choice: points are scarce where they are fewer than asked for by more than this factor; up to
its square times more are accepted instead."""
OUTLINE = 0.05
"""Our choice, times the distance of points: outlines are simplified by so much, because regions of
scans have many corners that matter to no contact."""


def num_points(num_regions: int, effort: Effort) -> int:
    """Computes how many points to sample.

    Args:
        num_regions: number of regions of the object.
        effort: sizes of the search.

    Returns:
        The number of points.
    """
    some = min(POINTS_A_REGION * num_regions, MORE_POINTS * effort.points)
    wanted = max(effort.points, some, LEAST_A_REGION * num_regions)
    return min(int(wanted), effort.most_points)


def sample_points(regions: Regions, num: int, *, may_exceed: bool = False) -> tuple[Ints, Array]:
    """Samples a point in the middle of each region and others on rings, equally far apart.

    The best contacts are often at a region's corners, which the outermost ring includes.

    Args:
        regions: where contacts may be.
        num: about how many points; of more regions only the largest have one.
        may_exceed: whether regions of equal size, which all have a ring or none, may have more
            points than `num` where without rings they have far fewer.

    Returns:
        Region of each point, shape (N,), and coordinates in the face's frame [m], shape (N, 2).
    """
    filled = np.flatnonzero(~shapely.is_empty(regions.polygon_F))
    largest = np.argsort(-regions.area[filled], kind="stable")[:num]
    row = filled[np.sort(largest)]
    level = regions.polygon_F[row]
    spacing = _spacing(level, num, may_exceed)
    middle = shapely.centroid(level)
    inside = shapely.intersects(level, middle)
    middle = np.where(inside, middle, shapely.point_on_surface(level))
    found = [(row, shapely.get_coordinates(middle))]
    wide = shapely.area(level) > (0.7 * spacing) ** 2
    while wide.any():
        level, row = level[wide], row[wide]
        outline = shapely.simplify(level, OUTLINE * spacing)
        rings, owner = _rings(shapely.segmentize(outline, spacing))
        found.append((row[owner], nearest_points(level[owner], rings)))
        level = shrunk(level, spacing)
        wide = ~shapely.is_empty(level)
    region, p_FC = zip(*found, strict=True)
    return np.concatenate(region), np.concatenate(p_FC)


def _spacing(polygons: npt.NDArray[np.object_], num: int, may_exceed: bool) -> float:
    """The distance between points that gives about `num` of them [m]."""
    area, length = shapely.area(polygons), shapely.length(polygons)

    def count(spacing: float) -> float:
        wide = area > (0.7 * spacing) ** 2
        rings = np.where(wide, length / spacing + area / spacing**2, 0.0)
        return float(len(area) + rings.sum())

    low, high = 1e-4 * np.sqrt(area.sum()), 10 * np.sqrt(area.sum())
    for _ in range(12):  # to a third of a percent
        middle = np.sqrt(low * high)
        low, high = (middle, high) if count(middle) > num else (low, middle)
    is_scarce = may_exceed and num > SCARCE * count(high) and count(low) < SCARCE**2 * num
    return float(low if is_scarce else high)


def _rings(polygons: npt.NDArray[np.object_]) -> tuple[Array, Ints]:
    """The vertices of all rings, each once, shape (V, 2), and whose they are, shape (V,)."""
    parts, part_owner = shapely.get_parts(polygons, return_index=True)
    rings, ring_part = shapely.get_rings(parts, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    repeated = np.append(ring[1:] != ring[:-1], True)
    return points[~repeated], part_owner[ring_part[ring[~repeated]]]

"""Beyond the paper: the parts of regions where fingertips have room, found before the search.

Contacts that move freely end where faces are longest, often in inner corners of the object, where
no fingertip fits. Regions lose here what is near to anything that rises out of their face, and to
obstacles. The final test on the true surface is `fingertip_fits`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Ints, Shapes, distinct_values, frozen
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.geometry.surface_contact import effective_tip_radius
from drake_polygrasp.geometry.tolerances import FLATNESS
from drake_polygrasp.vectors import circle, times, transformed

_FLAT = 4 * FLATNESS
"""Times L: what rises less belongs to the face."""
_TRIANGLES_AT_ONCE = 1 << 15
"""Our choice: triangles near regions processed together, some 100 MB."""
_QUARTER = 4
"""Segments of a quarter circle; polygons are drawn around the circles they replace."""


def with_tip_room(
    regions: Regions,
    polyhedron: Polyhedron,
    tip_radius: float,
    obstacles: Obstacles | None = None,
) -> Regions:
    """Cuts from regions the parts where a spherical fingertip has no room.

    A fingertip that touches a remaining point from outside penetrates nothing that rises from the
    face and no obstacle. Beside slanted walls a little more than necessary is removed.

    Args:
        regions: where contacts may be.
        polyhedron: the exposed surface of the body.
        tip_radius: radius of the fingertips [m]; 0 for no room beside the body.
        obstacles: other geometry that fingertips must not penetrate.

    Returns:
        The regions, with polygons that may be empty or have several parts.
    """
    L = polyhedron.diameter
    if tip_radius > 0 and not polyhedron.is_convex:
        # The facets of a patch rise from its plane, but belong to it.
        reach = 2 * np.array([face.reach for face in polyhedron.faces])[regions.face]
        lowest = np.maximum(_FLAT * L, reach)
        regions = _beside(regions, polyhedron.triangles_B, lowest, tip_radius)
    if obstacles is not None:
        tip_radius = effective_tip_radius(polyhedron, tip_radius)
        lowest = np.full(len(regions.face), _FLAT * L)
        regions = _beside(regions, obstacles.surface_B, lowest, tip_radius)
        regions = _outside(regions, obstacles, tip_radius)
    return regions


def _with_polygons(regions: Regions, polygons: Shapes) -> Regions:
    return replace(regions, polygon_F=frozen(polygons, object), area=frozen(shapely.area(polygons)))


def _beside(regions: Regions, triangles_B: Array, lowest: Array, tip_radius: float) -> Regions:
    """Removes what is near to the parts of triangles that rise above `lowest` [m], shape (n,)."""
    polygons = regions.polygon_F.copy()
    least_B, most_B = triangles_B.min(axis=1), triangles_B.max(axis=1)
    boxes_F = _room(polygons, lowest, tip_radius)
    middle_F, half_F = boxes_F.mean(axis=1), np.abs(boxes_F[:, 1] - boxes_F[:, 0]) / 2
    middle_B = regions.p_BF + transformed(regions.R_BF, middle_F)
    half_B = transformed(np.abs(regions.R_BF), half_F)
    shapely.prepare(polygons)
    rising: dict[int, Array] = {}
    count = 0
    for k, box_F in enumerate(boxes_F):
        near = (least_B <= middle_B[k] + half_B[k]) & (most_B >= middle_B[k] - half_B[k])
        triangles_F = times(triangles_B[near.all(axis=1)] - regions.p_BF[k], regions.R_BF[k])
        inside = (triangles_F.max(axis=1) > box_F[0]) & (triangles_F.min(axis=1) < box_F[1])
        rising[k] = triangles_F[inside.all(axis=1)]
        count += len(rising[k])
        if count > _TRIANGLES_AT_ONCE:
            _cut_off(polygons, rising, lowest, tip_radius)
            rising, count = {}, 0
    _cut_off(polygons, rising, lowest, tip_radius)
    return _with_polygons(regions, polygons)


def _cut_off(
    polygons: Shapes, rising: Mapping[int, Array], lowest: Array, tip_radius: float
) -> None:
    """Removes from polygons, by index, what is near to the triangles that rise from each."""
    sizes = [len(triangles_F) for triangles_F in rising.values()]
    owner = np.repeat(np.array(list(rising), dtype=np.int64), sizes)
    if not len(owner):
        return
    blocked, triangle = _blocked(np.concatenate([*rising.values()]), lowest[owner], tip_radius)
    owner = owner[triangle]
    near = shapely.intersects(polygons[owner], blocked)
    blocked, owner = blocked[near], owner[near]
    for k in distinct_values(owner):
        polygons[k] -= shapely.union_all(blocked[owner == k])


def _outside(regions: Regions, obstacles: Obstacles, tip_radius: float) -> Regions:
    """Removes the parts on which the centre of a fingertip is inside an obstacle.

    No fingertip on a part meets an obstacle's surface, so all its centres are inside or none is.
    """
    polygons = regions.polygon_F.copy()
    parts, owner = shapely.get_parts(polygons, return_index=True)
    parts, owner = parts[~shapely.is_empty(parts)], owner[~shapely.is_empty(parts)]
    xy = shapely.get_coordinates(shapely.point_on_surface(parts))
    p_FT = np.column_stack([xy, np.full(len(parts), tip_radius)])
    p_BT = regions.p_BF[owner] + np.einsum("nij,nj->ni", regions.R_BF[owner], p_FT)
    inside = obstacles.contain(p_BT)
    for k in distinct_values(owner[inside]):
        polygons[k] = shapely.MultiPolygon(parts[(owner == k) & ~inside].tolist())
    return _with_polygons(regions, polygons)


def _room(polygons: Shapes, lowest: Array, tip_radius: float) -> Array:
    """Computes boxes in F that contain all fingertips on the polygons, as corners (n, 2, 3)."""
    boxes = np.empty((len(polygons), 2, 3))
    boxes[:, :, :2] = shapely.bounds(polygons).reshape(-1, 2, 2)
    boxes[:, 0, :2] -= tip_radius
    boxes[:, 1, :2] += tip_radius
    boxes[:, 0, 2], boxes[:, 1, 2] = lowest, 2 * tip_radius
    return boxes


def _blocked(triangles_F: Array, lowest: Array, tip_radius: float) -> tuple[Shapes, Ints]:
    """What lies within `tip_radius` of the triangles' parts at the height of a tip, in the face.

    Args:
        triangles_F: shape (N, 3, 3) [m].
        lowest: what is lower belongs to the face [m], shape (N,).
        tip_radius: [m].

    Returns:
        Polygons, and which triangle each is of; none of triangles without such a part.
    """
    low, high = lowest[:, None], 2 * tip_radius
    tail, head = triangles_F, triangles_F[:, [1, 2, 0]]
    rise = head[..., 2] - tail[..., 2]
    rise = np.where(rise == 0, np.finfo(float).tiny, rise)
    with np.errstate(over="ignore"):  # Infinite ends are cut off below.
        ends = np.stack([low - tail[..., 2], high - tail[..., 2]]) / rise
    ends = np.clip(np.sort(ends, axis=0), 0.0, 1.0)
    height = tail[..., 2] + ends * rise
    slack = 1e-9 * tip_radius
    within = (height >= low - slack) & (height <= high + slack)
    inside = np.logical_and.reduce(within, axis=0)
    points = tail[..., :2] + ends[..., None] * (head - tail)[..., :2]
    # Hulls of the ends of each triangle's edges that are at such a height.
    triangle, part = np.unique(np.nonzero(inside)[0], return_inverse=True)
    flat = np.moveaxis(points, 0, 2)[inside].reshape(-1, 2)
    parts = shapely.convex_hull(shapely.linestrings(flat, indices=np.repeat(part, 2)))
    around = tip_radius / circle(np.array(np.pi / (4 * _QUARTER)))[0]
    return shapely.buffer(parts, around, quad_segs=_QUARTER), triangle

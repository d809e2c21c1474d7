"""Section 5 for two faces: R_maxT, the direction l_u, and the position of Pi_p.

Departures from the text: when R_maxT is a hole of A_i it has no lid edge l_u, and a fan of
directions stands in; which face holds two contacts is settled on the plane, before P, by 7.3's
rule (region_p.py).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Batch, Ints, Shapes, join_rows
from drake_polygrasp.digits import to_decimals
from drake_polygrasp.geometry.regions import Boundary
from drake_polygrasp.geometry.tolerances import ANGLE_TOLERANCE
from drake_polygrasp.paper.grasp_plane import (
    TIE,
    Planes,
    fan_directions,
    grouped_ties,
    inset,
    line_through,
    opposed_planes,
    ring_edges,
)
from drake_polygrasp.paper.planar import Scale, centroids
from drake_polygrasp.paper.position import Opposed
from drake_polygrasp.vectors import dot, unit

OVERLAP, FIRST, SECOND = 0, 1, 2  # R_maxT is A_12, R_1 or R_2


@dataclass(frozen=True, eq=False)
class Choices(Batch):
    """Directions l_u for pairs of faces, one row each.

    Attributes:
        owner: index of each row's pair, shape (R,).
        direction: l_u in coordinates (u, v) of Pi_s, shape (R, 2).
        widest: which region R_maxT is: OVERLAP, FIRST or SECOND, shape (R,).
        pocket: the part of hull(A_i^s) - A_i^s that holds R_i; A_12 where R_maxT is A_12, shape
            (R,).
    """

    owner: Ints
    direction: Array
    widest: Ints
    pocket: Shapes


def choices(sets: Opposed, scale: Scale) -> Choices:
    """R_maxT and l_u; a pair whose three regions are all empty has no row."""
    faces = sets.faces[:, :2]
    hulls, overlap = shapely.convex_hull(faces), shapely.intersection(*faces.T)
    # A convex face has no R_i.
    dented = shapely.area(hulls) - shapely.area(faces) > scale.area_slack
    outside = np.full_like(faces, None)
    outside[dented] = shapely.difference(hulls[dented], faces[dented])
    area = np.zeros((len(faces), 3))
    area[:, OVERLAP] = shapely.area(overlap)
    area[:, FIRST:][dented] = shapely.area(
        shapely.intersection(outside[dented], faces[:, ::-1][dented])
    )
    widest = np.argmax(area >= area.max(axis=1, keepdims=True) - scale.area_slack, axis=1)
    possible = area.max(axis=1) > scale.area_slack

    rows = np.flatnonzero(possible & (widest == OVERLAP))
    owner, direction = _longest_edges(overlap[rows], scale)
    found = [Choices(rows[owner], direction, widest[rows[owner]], overlap[rows[owner]])]

    rows = np.flatnonzero(possible & (widest != OVERLAP))
    holder = widest[rows] - 1
    if len(rows):
        pocket, owner = _pockets(outside[rows, holder], faces[rows, 1 - holder], scale)
        rows, holder = rows[owner], holder[owner]
        hull = hulls[rows, holder]
        owner, lid = _lids(hull, pocket, scale)
        found.append(Choices(rows[owner], lid, widest[rows[owner]], pocket[owner]))

        holes = np.delete(np.arange(len(rows)), owner)
        directions = fan_directions(hull[holes])
        owner = np.repeat(holes, directions.shape[1])
        found.append(
            Choices(rows[owner], directions.reshape(-1, 2), widest[rows[owner]], pocket[owner])
        )
    return join_rows(*found)


def _longest_edges(shapes: Shapes, scale: Scale) -> tuple[Ints, Array]:
    """The longest edges of each shape, one of each direction: owners (R,), vectors (R, 2)."""
    # An overlay leaves vertices in the middle of straight edges; preserving the topology, GEOS
    # keeps them where a ring would become a triangle.
    plain = shapely.simplify(shapes, scale.length_slack, preserve_topology=False)
    tail, head, owner = ring_edges(plain)
    edge = head - tail
    length = np.sqrt(dot(edge, edge))
    best = grouped_ties(length, owner, len(shapes), TIE * scale.diameter)
    edge, owner = edge[best], owner[best]
    turned = edge * np.where((edge[:, 1:] < 0) | ((edge[:, 1:] == 0) & (edge[:, :1] < 0)), -1, 1)
    angle = to_decimals(np.arctan2(turned[:, 1], turned[:, 0]))
    angle = np.where(angle > np.pi - ANGLE_TOLERANCE, 0.0, angle)
    order = np.lexsort((angle, owner))
    angle, owner, edge = angle[order], owner[order], edge[order]
    is_new = np.ones(len(owner), dtype=bool)
    is_new[1:] = (np.diff(owner) > 0) | (np.diff(angle) > ANGLE_TOLERANCE)
    return owner[is_new], edge[is_new]


def _pockets(outside: Shapes, other: Shapes, scale: Scale) -> tuple[Shapes, Ints]:
    """The parts of hull(A_i) - A_i that overlap the other face most, and whose they are."""
    parts, owner = shapely.get_parts(outside, return_index=True)
    area = shapely.area(shapely.intersection(parts, other[owner]))
    best = grouped_ties(area, owner, len(outside), scale.area_slack)
    return parts[best], owner[best]


def _lids(hull: Shapes, pocket: Shapes, scale: Scale) -> tuple[Ints, Array]:
    """Edges of the pockets that close them: owners (R,) and vectors (R, 2); none for a hole."""
    # Not the hull's own edges, one of which may span several pockets of a comb.
    tail, head, owner = ring_edges(pocket)
    edge = head - tail
    gap = shapely.distance(shapely.points((tail + head) / 2), shapely.boundary(hull)[owner])
    length = np.where(gap <= scale.length_slack, np.linalg.norm(edge, axis=1), -np.inf)
    lids = grouped_ties(length, owner, len(hull), 0.0)
    lids = lids[np.unique(owner[lids], return_index=True)[1]]
    return owner[lids], edge[lids]


def two_face_planes(
    edges: Boundary, sets: Opposed, rows: Choices, scale: Scale
) -> tuple[Planes, Ints]:
    """Planes Pi_p parallel to l_u, with their position; only those with R^s not empty.

    Returns:
        The planes, and the row of each in `rows`.
    """
    planes, kept = opposed_planes(edges, sets, rows.owner, rows.direction, scale)
    on_overlap = np.flatnonzero(rows.widest[kept] == OVERLAP)
    sets = sets.take(planes.owner[on_overlap])
    N = planes.nhat_B[on_overlap]
    # Heights along N of points (u, v) of Pi_s; N has no part along n_bs.
    to_height = np.stack([dot(sets.u, N), dot(sets.v, N)], axis=1)
    height = planes.height.copy()
    through = _height_in_overlap(sets, rows.pocket[kept][on_overlap], to_height, scale)
    # L_c misses A_12 where it runs between two parts of it: the rule for three faces stands in.
    height[on_overlap] = inset(
        np.where(np.isnan(through), height[on_overlap], through),
        planes.low[on_overlap],
        planes.high[on_overlap],
    )
    return replace(planes, height=height), kept


def _height_in_overlap(sets: Opposed, overlap: Shapes, to_height: Array, scale: Scale) -> Array:
    """Position of Pi_p when R_maxT = A_12: through c_m, the centroid of A_12, or the middle of L_c.

    Returns:
        N . p [m], shape (M,); NaN where L_c misses A_12.
    """
    cm = np.stack([dot(sets.u, scale.p_BBcm), dot(sets.v, scale.p_BBcm)], axis=1)
    centroid = centroids(overlap)
    has_cm = shapely.distance(overlap, shapely.points(cm)) <= scale.length_slack
    has_centroid = shapely.distance(overlap, shapely.points(centroid)) <= scale.length_slack
    point = np.where(has_cm[:, None], cm, centroid)

    rest = np.flatnonzero(~has_cm & ~has_centroid)
    if len(rest):
        L_c = line_through(centroid[rest], to_height[rest], scale)
        common = shapely.intersection(overlap[rest], L_c)
        pieces, owner = shapely.get_parts(common, return_index=True)
        order = np.lexsort((-shapely.length(pieces), owner))
        longest = order[np.unique(owner[order], return_index=True)[1]]
        point[rest] = np.nan
        point[rest[owner[longest]]] = centroids(pieces[longest])
    return dot(point, unit(to_height))

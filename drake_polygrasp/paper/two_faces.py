"""Section 5 for two faces: the region R_maxT, the direction l_u, and the position of Pi_p.

Departures from the text: where R_maxT is a hole of A_i, no edge closes it and there is no l_u, so a
fan of directions replaces it; which face holds two contacts is decided on the plane, before P is
computed, by the rule of 7.3 (see region_p.py).
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
    opposed_planes,
    ring_edges,
)
from drake_polygrasp.paper.planar import Scale, centroids, line_through
from drake_polygrasp.paper.position import Opposed
from drake_polygrasp.vectors import dot, unit

OVERLAP, FIRST, SECOND = 0, 1, 2
"""Which region R_maxT is: A_12, R_1 or R_2."""


@dataclass(frozen=True, eq=False)
class Choices(Batch):
    """Directions l_u of pairs of faces, one row for each direction.

    Attributes:
        owner: index of each row's pair, shape (R,).
        direction: l_u in coordinates (u, v) of Pi_s, shape (R, 2).
        widest: which region R_maxT is: OVERLAP, FIRST or SECOND, shape (R,).
        pocket: the part of hull(A_i^s) - A_i^s that contains R_i, or A_12 where R_maxT is A_12,
            shape (R,).
    """

    owner: Ints
    direction: Array
    widest: Ints
    pocket: Shapes


def choices(sets: Opposed, scale: Scale) -> Choices:
    """Finds R_maxT and l_u of pairs of faces (Section 5).

    Args:
        sets: the pairs on their Pi_s.
        scale: the object's size.

    Returns:
        The directions: several for a pair where edges are equally long or R_maxT is a hole, none
        where A_12, R_1 and R_2 are all empty.
    """
    faces = sets.faces[:, :2]
    hulls, overlap = shapely.convex_hull(faces), shapely.intersection(*faces.T)
    # The hull of a convex face leaves no R_i.
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
    """Finds the longest edges of each shape, one a direction: owners (R,) and vectors (R, 2)."""
    # Intersections have vertices in the middle of straight edges. Told to preserve the topology,
    # GEOS would keep those of rings that become triangles.
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
    """Finds the parts of hull(A_i^s) - A_i^s that overlap the other face most, and their owners."""
    parts, owner = shapely.get_parts(outside, return_index=True)
    area = shapely.area(shapely.intersection(parts, other[owner]))
    best = grouped_ties(area, owner, len(outside), scale.area_slack)
    return parts[best], owner[best]


def _lids(hull: Shapes, pocket: Shapes, scale: Scale) -> tuple[Ints, Array]:
    """Finds the longest edge that closes each pocket, none for a hole: owners and vectors."""
    # Edges of the pocket, not of the hull, whose edge may close several pockets of a comb.
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
    """Computes the planes Pi_p of pairs: through n_bs and l_u, at their position (Section 5).

    Args:
        edges: boundary of all regions.
        sets: the pairs on their Pi_s.
        rows: directions l_u, from `choices`.
        scale: the object's size.

    Returns:
        The planes whose R^s is not empty, and the row of each in `rows`.
    """
    planes, kept = opposed_planes(edges, sets, rows.owner, rows.direction, scale)
    on_overlap = np.flatnonzero(rows.widest[kept] == OVERLAP)
    sets = sets.take(planes.owner[on_overlap])
    N = planes.nhat_B[on_overlap]
    # Maps points (u, v) of Pi_s to heights along N, which is orthogonal to n_bs.
    to_height = np.stack([dot(sets.u, N), dot(sets.v, N)], axis=1)
    height = planes.height.copy()
    through = _height_in_overlap(sets, rows.pocket[kept][on_overlap], to_height, scale)
    # Where L_c runs between two parts of A_12, the rule for three faces applies.
    height[on_overlap] = inset(
        np.where(np.isnan(through), height[on_overlap], through),
        planes.low[on_overlap],
        planes.high[on_overlap],
    )
    return replace(planes, height=height), kept


def _height_in_overlap(sets: Opposed, overlap: Shapes, to_height: Array, scale: Scale) -> Array:
    """Positions Pi_p where R_maxT is A_12: through c_m, the centroid of A_12, or the middle of L_c.

    Where L_c cuts A_12 in several pieces, the middle of the longest is taken.

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

"""Section 5: orientation of the grasp plane Pi_p, the strip R^s that bounds it, and its position.

Where only labels would decide a choice of the text (which n'_i defines Pi_s, which of equally long
edges is the longest), each choice is a row, and the set later keeps the row of best quality. Other
departures: where s_e or l_u does not exist (one face inside the hole of another), a fan of eight
directions replaces it; Pi_p stays 2 percent inside R^s, because a centre of mass on the border of
R^s would give a plane that grazes an edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Batch, Bools, Ints, Shapes, gather
from drake_polygrasp.geometry.regions import Boundary, Regions
from drake_polygrasp.paper.planar import Scale, centroids, extents, line_through
from drake_polygrasp.paper.position import Opposed, PlaneDirections, hull_of
from drake_polygrasp.paper.strips import hulls_in_strips
from drake_polygrasp.vectors import circle, cross, dot, transformed, unit

INSET = 0.02
"""Our choice: share of R^s that Pi_p keeps from either end. It is small, because the edge clearance
has already been taken from the faces."""
FAN = 8
"""Our choice: number of directions that replace an undefined s_e or l_u."""
SHORT = 1e-6
"""Our choice, times L: centroids nearer to each other than this define no line."""
TIE = 1e-6
"""Our choice, relative to L or to an area: alternatives that differ by less are a tie, and each
becomes a row. It is wide, because files round coordinates; that is harmless, because only the row
of best quality is kept."""


@dataclass(frozen=True, eq=False)
class Planes(Batch):
    """Grasp planes Pi_p of sets of faces, one row for each choice of plane.

    Attributes:
        owner: index of each row's set in the batch that the rows were made from, shape (M,).
        region: regions A_1, A_2, A_3, shape (M, 3); for pairs A_3 is A_2, and which face holds two
            contacts is not decided yet.
        nhat_B: N, unit normal of Pi_p, shape (M, 3).
        along_B: unit normal of Pi_s, a direction in Pi_p, shape (M, 3): n_bs, or n'_i of the face
            that defines Pi_s.
        low, high: bounds of R^s along N [m], shape (M,).
        height: N . p of the points of Pi_p, the first choice [m], shape (M,).
        area_s: I^s, the area of F [m^2], shape (M,).
        d_1: distance from c_I^s, the centroid of F, to c_m^s [m], shape (M,).
    """

    owner: Ints
    region: Ints
    nhat_B: Array
    along_B: Array
    low: Array
    high: Array
    height: Array
    area_s: Array
    d_1: Array


def _plane(
    edges: Boundary,
    owner: Ints,
    region: Ints,
    N: Array,
    along: Array,
    low: Array,
    high: Array,
    scale: Scale,
) -> Planes:
    """Positions Pi_p: through c_m if F holds c_m^s, else through c_I^s, the centroid of F.

    F is the part of hull(A_1^s, A_2^s, A_3^s) within R^s.
    """
    axes = np.stack([cross(along, N), N], axis=1)
    index, flat = gather(edges.offsets, region.ravel())
    row = flat // 3
    points = transformed(axes[row], edges.tail[index])
    hull = shapely.convex_hull(shapely.linestrings(points, indices=row))
    area_s, centroid = hulls_in_strips(hull, low, high)
    cm = dot(axes, scale.p_BBcm)
    height, slack = cm[:, 1], scale.length_slack
    holds_cm = (height >= low - slack) & (height <= high + slack)
    holds_cm &= shapely.distance(hull, shapely.points(cm)) <= slack
    height = inset(np.where(holds_cm, height, centroid[:, 1]), low, high)
    offset = centroid - cm
    d_1 = np.sqrt(dot(offset, offset))
    return Planes(owner, region, N, along, low, high, height, area_s, d_1)


def inset(height: Array, low: Array, high: Array) -> Array:
    """Moves offsets of Pi_p that are too near to an end of R^s, by `INSET` of its width.

    Args:
        height: N . p of the plane [m], shape (M,).
        low: lower bound of R^s [m], shape (M,).
        high: upper bound of R^s [m], shape (M,).

    Returns:
        Offsets within the narrowed strip [m], shape (M,).
    """
    margin = INSET * (high - low)
    return np.minimum(np.maximum(height, low + margin), high - margin)


def other_heights(planes: Planes) -> Array:
    """Returns the offsets of Pi_p to try where P is empty at the first one.

    They are at 1/2, 1/4 and 3/4 of R^s, narrowed by `INSET`. The text does not foresee an empty P,
    which occurs because segments a_i are narrower than projections of whole faces.

    Args:
        planes: M planes.

    Returns:
        N . p [m], the offset nearest to the first choice first, shape (M, 3).
    """
    margin = INSET * (planes.high - planes.low)
    span = planes.high - planes.low - 2 * margin
    heights = (planes.low + margin)[:, None] + span[:, None] * np.array([0.5, 0.25, 0.75])
    distance = np.abs(heights - planes.height[:, None])
    # Rounded, so that equal distances keep their order.
    order = np.argsort(np.round(distance / span[:, None], 9), axis=1, kind="stable")
    return np.take_along_axis(heights, order, axis=1)


def nonparallel_planes(
    regions: Regions,
    edges: Boundary,
    region: Ints,
    on: PlaneDirections,
    low: Array,
    high: Array,
    scale: Scale,
) -> Planes:
    """Computes Pi_p of non-parallel sets: parallel to Pi_l, at a height within R^s (Section 5).

    The text lets Pi_s be orthogonal to any n'_i, but Q depends on which. We take that of the
    largest face, and all of several equally large ones, so that Q does not depend on labels.

    Args:
        regions: all regions.
        edges: their boundary.
        region: A_1, A_2, A_3 of each set, shape (M, 3).
        on: directions of the sets on Pi_l.
        low: lower bound of R^s along N [m], shape (M,).
        high: upper bound of R^s [m], shape (M,).
        scale: the object's size.

    Returns:
        The planes, at least one for each set.
    """
    area = regions.area[region]
    owner, face = _ties(area / area.max(axis=1, keepdims=True), TIE)
    on, along = on.take(owner), on.nprime[owner, face]
    return _plane(edges, owner, region[owner], on.nhat_B, along, low[owner], high[owner], scale)


def opposed_planes(
    edges: Boundary, sets: Opposed, owner: Ints, direction: Array, scale: Scale
) -> tuple[Planes, Ints]:
    """Computes Pi_p of parallel sets and pairs: through n_bs and a direction of Pi_s (Section 5).

    Args:
        edges: boundary of all regions.
        sets: the sets on their Pi_s.
        owner: index in `sets` of each direction's set, shape (R,).
        direction: s_e or l_u in coordinates (u, v) of Pi_s, not zero, shape (R, 2).
        scale: the object's size.

    Returns:
        The planes whose R^s is not empty, and the index of each one's direction.
    """
    sets = sets.take(owner)
    along_e = unit(direction[:, :1] * sets.u + direction[:, 1:] * sets.v)
    N = cross(along_e, sets.nhat_bs)
    low, high = extents(edges, sets.region.ravel(), np.repeat(N, 3, axis=0))
    low, high = low.reshape(-1, 3).max(axis=1), high.reshape(-1, 3).min(axis=1)
    rows = np.flatnonzero(high - low > scale.length_slack)
    planes = _plane(
        edges,
        owner[rows],
        sets.region[rows],
        N[rows],
        sets.nhat_bs[rows],
        low[rows],
        high[rows],
        scale,
    )
    return planes, rows


def _ties(score: Array, slack: float) -> tuple[Ints, Ints]:
    """Finds the entries within `slack` of the greatest of their row, as rows and columns.

    Rows whose entries are all -inf have none.
    """
    is_best = (score >= score.max(axis=1, keepdims=True) - slack) & np.isfinite(score)
    rows, columns = np.nonzero(is_best)
    return rows, columns


def grouped_ties(score: Array, owner: Ints, num_rows: int, slack: float) -> Ints:
    """Finds the items within `slack` of the greatest of their group.

    Args:
        score: value of each item, -inf for items that do not count, shape (R,).
        owner: group of each item, shape (R,).
        num_rows: number of groups.
        slack: values that differ by no more are a tie.

    Returns:
        Indices of the items, ascending; none of a group whose items do not count.
    """
    greatest = np.full(num_rows, -np.inf)
    np.maximum.at(greatest, owner, score)
    return np.flatnonzero((score >= greatest[owner] - slack) & np.isfinite(score))


def ring_edges(shapes: Shapes) -> tuple[Array, Array, Ints]:
    """Splits the rings of polygons or multipolygons into edges.

    Args:
        shapes: plane shapes, shape (M,).

    Returns:
        Tails and heads of the edges, shape (E, 2) each, and the index of each one's shape, shape
        (E,).
    """
    parts, part_owner = shapely.get_parts(shapes, return_index=True)
    rings, ring_part = shapely.get_rings(parts, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[:-1] == ring[1:]
    return points[:-1][same], points[1:][same], part_owner[ring_part[ring[:-1][same]]]


def fan_directions(hull: Shapes) -> Array:
    """Computes a fan of `FAN` directions that starts at the longest edge of each hull.

    Args:
        hull: convex polygons, shape (M,).

    Returns:
        Unit directions, pi / 8 apart, shape (M, 8, 2).
    """
    tail, head, owner = ring_edges(hull)
    length = np.linalg.norm(head - tail, axis=1)
    # Rounded, so that the first of equally long edges is taken.
    order = np.lexsort((np.arange(len(owner)), -np.round(length / length.max(initial=0), 9), owner))
    first = order[np.searchsorted(owner[order], np.arange(len(hull)))]
    edge = unit(head - tail)[first]
    across = np.column_stack([-edge[:, 1], edge[:, 0]])
    cosine, sine = circle(np.pi / FAN * np.arange(FAN)).T[..., None]
    turned: Array = cosine * edge[:, None, :] + sine * across[:, None, :]
    return turned


def _lengths_of_lines(
    sets: Opposed, hull: Shapes, through: Array, direction: Array, scale: Scale
) -> Array:
    """Computes the lengths in the hull of lines (M, J, 2) through points (M, 2), shape (M, J) [m].

    A line that does not meet both A_2^s and A_3^s, or has a zero direction, has length -inf.
    """
    lines = line_through(through[:, None], direction, scale)
    length = np.full(lines.shape, -np.inf)
    row, column = np.nonzero(direction.any(axis=-1))
    for face in sets.faces.T[1:]:
        meets = _chords(face[row], lines[row, column]) > scale.length_slack
        row, column = row[meets], column[meets]
    length[row, column] = _chords(hull[row], lines[row, column])
    return length


def _chords(shapes: Shapes, lines: Shapes) -> Array:
    """Computes the length of each line in its shape [m]."""
    chords: Array = shapely.length(shapely.intersection(shapes, lines))
    return chords


def parallel_directions(sets: Opposed, scale: Scale) -> tuple[Ints, Array]:
    """Finds s_e, the direction of Pi_p in Pi_s, for parallel sets (Section 5).

    It is the longest of l_e1, l_e2 and l_e3 that meet A_2^s and A_3^s, else the edge between A_2^s
    and A_3^s of their hull. Where neither exists, as for a face inside the hole of another, it is
    the longest of a fan of lines through the centroid of A_aux2.

    Args:
        sets: the M sets on Pi_s.
        scale: the object's size.

    Returns:
        Index of each direction's set, shape (R,), and s_e in coordinates (u, v) of Pi_s, shape
        (R, 2): several for a set where lengths are equal, none where no line meets both faces.
    """
    first, second, third = sets.faces.T
    hull = hull_of(sets.faces[:, 1:])
    auxiliary = shapely.intersection(first, hull)  # A_aux2
    centre, c_2, c_3 = centroids(np.stack([auxiliary, second, third]))
    candidates = np.stack([c_3 - c_2, c_2 - centre, c_3 - centre], axis=1)
    long = dot(candidates, candidates) > (SHORT * scale.diameter) ** 2
    candidates *= long[..., None]
    length = _lengths_of_lines(sets, hull, centre, candidates, scale)
    rows, column = _ties(length, TIE * scale.diameter)
    owners, directions = [rows], [candidates[rows, column]]

    rest = np.delete(np.arange(len(hull)), rows)
    if len(rest):
        rows, edge = _mixed_hull_edges(sets.take(rest), hull[rest], centre[rest], scale)
        owners.append(rest[rows])
        directions.append(edge)
        rest = np.delete(rest, rows)
    if len(rest):
        fan = fan_directions(hull_of(auxiliary[rest, None]))
        length = _lengths_of_lines(sets.take(rest), hull[rest], centre[rest], fan, scale)
        rows, column = _ties(length, TIE * scale.diameter)
        owners.append(rest[rows])
        directions.append(fan[rows, column])
    return np.concatenate(owners), np.concatenate(directions)


def _mixed_hull_edges(
    sets: Opposed, hull: Shapes, centre: Array, scale: Scale
) -> tuple[Ints, Array]:
    """Finds the edges of hull(A_2^s, A_3^s) between a vertex of one face and a vertex of the other.

    Of each set the edge nearest to the centroid of A_aux2 is taken, and all that are as near.
    """
    tail, head, owner = ring_edges(hull)
    corners = shapely.extract_unique_points(sets.faces[:, 1:])

    def belongs(points: Array, face: int) -> Bools:
        gap = shapely.distance(corners[owner, face], shapely.points(points))
        near: Bools = gap <= scale.length_slack
        return near

    mixed = (belongs(tail, 0) & belongs(head, 1)) | (belongs(tail, 1) & belongs(head, 0))
    tail, head, owner = tail[mixed], head[mixed], owner[mixed]
    distance = shapely.distance(
        shapely.linestrings(np.stack([tail, head], axis=1)), shapely.points(centre[owner])
    )
    best = grouped_ties(-distance, owner, len(hull), TIE * scale.diameter)
    return owner[best], (head - tail)[best]

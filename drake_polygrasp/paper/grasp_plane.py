"""Section 5: orientation of the grasp plane Pi_p, the strip R^s that bounds it, and its position.

A set may have several rows: where the text's choice is a tie that only labels would decide (which
n'_i defines Pi_s, the longest of equal edges), each choice is a row and the set keeps the row of
best quality. Other departures: where s_e or l_u does not exist (faces within faces, holes) a fan
of eight directions stands in; the offset stays 2 percent inside R^s, because a centre of mass on
its border would give a plane that grazes an edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Batch, Bools, Ints, Shapes, gather
from drake_polygrasp.geometry.regions import Boundary, Regions
from drake_polygrasp.paper.planar import Scale, centroids, extents
from drake_polygrasp.paper.position import Opposed, PlaneDirections, hull_of
from drake_polygrasp.paper.strips import hulls_in_strips
from drake_polygrasp.vectors import circle, cross, dot, transformed, unit

INSET = 0.02
"""Part of R^s that the plane keeps from its ends, ours: faces are eroded already."""
FAN = 8
"""Directions that stand in for an undefined s_e or l_u, ours."""
SHORT = 1e-6
"""Times L, ours: centroids nearer than this define no line."""
TIE = 1e-6
"""Relative to L or to the area, ours: choices nearer than this are a tie, and each is a row. Wide,
because files round coordinates, and harmless, because the best row is kept."""


@dataclass(frozen=True, eq=False)
class Planes(Batch):
    """Planes Pi_p for sets of faces, one row a choice.

    Attributes:
        owner: index of each row's set in the batch the rows were made from, shape (M,).
        region: A_1, A_2, A_3, shape (M, 3); for pairs A_3 is A_2, and roles are settled on the
            plane.
        nhat_B: N, unit normal of Pi_p, shape (M, 3).
        along_B: unit direction in Pi_p: n_bs, or n'_f of the face that defines Pi_s, shape (M, 3).
        low: lower bound of R^s along N [m], shape (M,).
        high: upper bound [m], shape (M,).
        height: first choice of N . p on Pi_p [m], shape (M,).
        area_s: i^s [m^2], shape (M,).
        d_1: distance from c_I^s to c_m^s [m], shape (M,).
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
    """Positions Pi_p: F = R^s cut with hull(A_1^s, A_2^s, A_3^s) holds c_m, else c_I^s is taken."""
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
    """Keeps offsets of planes away from the ends of R^s, each of shape (M,)."""
    margin = INSET * (high - low)
    return np.minimum(np.maximum(height, low + margin), high - margin)


def other_heights(planes: Planes) -> Array:
    """Where to try next when P is empty, nearest to the first choice first, shape (M, 3)."""
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
    """Planes parallel to Pi_l; Pi_s is orthogonal to n'_f of the largest face.

    The text lets Pi_s be orthogonal to any n'_i, but Q depends on which; the largest face (each
    of those equally large) makes it independent of labels.
    """
    area = regions.area[region]
    owner, face = ties(area / area.max(axis=1, keepdims=True), TIE)
    on, along = on.take(owner), on.nprime[owner, face]
    return _plane(edges, owner, region[owner], on.nhat_B, along, low[owner], high[owner], scale)


def opposed_planes(
    edges: Boundary, sets: Opposed, owner: Ints, direction: Array, scale: Scale
) -> tuple[Planes, Ints]:
    """Planes that contain n_bs and a direction of Pi_s; only those with R^s not empty.

    Args:
        edges: boundary of all regions.
        sets: the sets.
        owner: index of each row's set, shape (M,).
        direction: s_e or l_u in coordinates (u, v) of Pi_s, not zero, shape (M, 2).
        scale: the object's size.

    Returns:
        The planes, and the index of each in `owner`.
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


def ties(score: Array, slack: float) -> tuple[Ints, Ints]:
    """Rows and columns of the entries within `slack` of their row's greatest; none if -inf."""
    is_best = (score >= score.max(axis=1, keepdims=True) - slack) & np.isfinite(score)
    rows, columns = np.nonzero(is_best)
    return rows, columns


def grouped_ties(score: Array, owner: Ints, num_rows: int, slack: float) -> Ints:
    """Indices of the entries within `slack` of the greatest of their owner's."""
    greatest = np.full(num_rows, -np.inf)
    np.maximum.at(greatest, owner, score)
    return np.flatnonzero((score >= greatest[owner] - slack) & np.isfinite(score))


def ring_edges(shapes: Shapes) -> tuple[Array, Array, Ints]:
    """Tails and heads (E, 2) of all rings of polygons or multipolygons, and whose they are (E,)."""
    parts, part_owner = shapely.get_parts(shapes, return_index=True)
    rings, ring_part = shapely.get_rings(parts, return_index=True)
    points, ring = shapely.get_coordinates(rings, return_index=True)
    same = ring[:-1] == ring[1:]
    return points[:-1][same], points[1:][same], part_owner[ring_part[ring[:-1][same]]]


def line_through(point: Array, direction: Array, scale: Scale) -> Shapes:
    """Lines long enough to cross the object, shape (...,)."""
    reach = 4 * scale.diameter * unit(direction)
    lines: Shapes = shapely.linestrings(np.stack([point - reach, point + reach], axis=-2))
    return lines


def fan_directions(hull: Shapes) -> Array:
    """Eight directions counted from the longest edge of each hull, shape (M, 8, 2)."""
    tail, head, owner = ring_edges(hull)
    length = np.linalg.norm(head - tail, axis=1)
    # Rounded, so that of equal edges the first counts.
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
    """Length of line cut with hull for the lines that meet both A_2^s and A_3^s, else -inf.

    Args:
        sets: the sets, M rows.
        hull: hull(A_2^s, A_3^s), shape (M,).
        through: shape (M, 2).
        direction: shape (M, J, 2); a zero direction is no line.
        scale: the object's size.

    Returns:
        shape (M, J) [m].
    """
    lines = line_through(through[:, None], direction, scale)
    crossed = np.column_stack([hull, sets.faces[:, 1:]])[:, None]
    length = shapely.length(shapely.intersection(crossed, lines[..., None]))
    meets = (length[..., 1:] > scale.length_slack).all(axis=-1) & direction.any(axis=-1)
    return np.where(meets, length[..., 0], -np.inf)


def parallel_directions(sets: Opposed, scale: Scale) -> tuple[Ints, Array]:
    """s_e for parallel sets: one of l_e1, l_e2, l_e3, a hull edge, or one of the fan.

    Returns:
        Rows' sets, shape (R,), and s_e in coordinates of Pi_s, shape (R, 2); none for a set means
        that it has no direction.
    """
    first, second, third = sets.faces.T
    hull = hull_of(sets.faces[:, 1:])
    auxiliary = shapely.intersection(first, hull)  # A_aux2
    centre, c_2, c_3 = centroids(np.stack([auxiliary, second, third]))
    candidates = np.stack([c_3 - c_2, c_2 - centre, c_3 - centre], axis=1)
    long = dot(candidates, candidates) > (SHORT * scale.diameter) ** 2
    candidates *= long[..., None]
    length = _lengths_of_lines(sets, hull, centre, candidates, scale)
    rows, column = ties(length, TIE * scale.diameter)
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
        rows, column = ties(length, TIE * scale.diameter)
        owners.append(rest[rows])
        directions.append(fan[rows, column])
    return np.concatenate(owners), np.concatenate(directions)


def _mixed_hull_edges(
    sets: Opposed, hull: Shapes, centre: Array, scale: Scale
) -> tuple[Ints, Array]:
    """Edges of hull(A_2^s, A_3^s) from a vertex of one to a vertex of the other, nearest first."""
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

"""Sections 4.1 and 4.2, by position: sets of faces that lie opposite each other.

Non-parallel sets are tested on Pi_l (region R^l, portions A_li) and on Pi_s (strip R^s), parallel
sets and pairs on Pi_s alone. Departures from the text: step 1.3 repeats 1.1 and is skipped; C_ri
is a double cone, because a single one loses the faces on the other side of its apex; step 2.1
projects the portions A_li, because with whole faces steps 1.4 to 1.6 would have no effect.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Batch, Bools, Ints, Shapes, gather
from drake_polygrasp.digits import to_decimals
from drake_polygrasp.geometry.regions import Boundary, Regions
from drake_polygrasp.paper.planar import extents, orthonormal_pair, project, row_extremes
from drake_polygrasp.paper.strips import area_and_centroid, strips_meet, strips_polygon
from drake_polygrasp.vectors import cross, dot, product, transformed, unit


@dataclass(frozen=True, eq=False)
class PlaneDirections(Batch):
    """Directions of non-parallel sets in planes parallel to Pi_l.

    Attributes:
        nhat_B: N, unit normal of Pi_l, shape (M, 3).
        that: t_i = N x n'_i, unit, shape (M, 3, 3).
        nprime: unit directions of n'_i, the projections of n_i on Pi_l, shape (M, 3, 3).
        turn: (t_2 x t_3, t_3 x t_1, t_1 x t_2) . N, shape (M, 3).
    """

    nhat_B: Array
    that: Array
    nprime: Array
    turn: Array

    def polygon(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Computes area and centroid of the intersection of three strips: R^l (4.1) or P (6).

        Args:
            low: least t_i . p of strip i [m], shape (M, 3).
            high: greatest t_i . p of strip i [m], shape (M, 3).

        Returns:
            Areas [m^2], shape (M,), and the centroids' components parallel to Pi_l, expressed in B
            [m], shape (M, 3).
        """
        axes = np.stack([self.that[:, 0], cross(self.nhat_B, self.that[:, 0])], axis=1)
        that_2 = product(self.that, axes.swapaxes(1, 2))
        area, centroid = area_and_centroid(strips_polygon(that_2, self.turn, low, high))
        return area, transformed(axes.swapaxes(1, 2), centroid)


def plane_directions(N: Array, nhat: Array) -> PlaneDirections:
    """Computes the directions n'_i and t_i of non-parallel sets.

    Args:
        N: unit normals of Pi_l, shape (M, 3).
        nhat: inward unit normals n_i of the three faces, shape (M, 3, 3).

    Returns:
        The directions of the M sets.
    """
    nprime = unit(nhat - dot(N[:, None], nhat)[..., None] * N[:, None])
    that = cross(N[:, None], nprime)
    turn = dot(N[:, None], cross(that[:, [1, 2, 0]], that[:, [2, 0, 1]]))
    return PlaneDirections(N, that, nprime, turn)


def region_rl(
    edges: Boundary, region: Ints, on: PlaneDirections, length_slack: float
) -> tuple[Bools, Array, Array]:
    """Tests whether R^l is empty: steps 1.1 and 1.2 of Section 4.1.

    Args:
        edges: boundary of all regions.
        region: the three regions of each set, shape (M, 3).
        on: directions of the sets on Pi_l.
        length_slack: lengths below this are rounding errors [m].

    Returns:
        Whether R^l has an interior, shape (M,); low and high, the bounds of t_i . p in the three
        strips [m], shape (M, 3) each.
    """
    low, high = extents(edges, region.ravel(), on.that.reshape(-1, 3))
    low, high = low.reshape(-1, 3), high.reshape(-1, 3)
    return strips_meet(on.turn, low, high, length_slack), low, high


def strip_rs(
    edges: Boundary, region: Ints, on: PlaneDirections, apex: Array, gamma: Array
) -> tuple[Array, Array]:
    """Computes the strip R^s of heights along N common to the portions A_li: steps 1.4 to 2.2.

    Args:
        edges: boundary of all regions.
        region: the three regions of each set, shape (M, 3).
        on: directions of the sets on Pi_l.
        apex: centroid of R^l, in the plane through Bo parallel to Pi_l [m], shape (M, 3).
        gamma: half-angle alpha - phi of the cones C_ri [rad], shape (M,).

    Returns:
        Bounds low and high of R^s [m], shape (M,) each; low > high where R^s is empty.
    """
    low, high = portion_heights(edges, region, on, apex, gamma)
    return low.max(axis=1), high.min(axis=1)


def portion_heights(
    edges: Boundary, region: Ints, on: PlaneDirections, apex: Array, gamma: Array
) -> tuple[Array, Array]:
    """Computes the heights along N of the portions A_li within the cones C_ri: steps 1.4 to 2.1.

    Args:
        edges: boundary of all regions.
        region: the three regions of each set, shape (M, 3).
        on: directions of the sets on Pi_l.
        apex: centroid of R^l, in the plane through Bo parallel to Pi_l [m], shape (M, 3).
        gamma: half-angle alpha - phi of the cones C_ri [rad], shape (M,).

    Returns:
        Least and greatest height of each portion [m], shape (M, 3) each; least > greatest where a
        portion is empty.
    """
    rows = np.repeat(np.arange(len(region)), 3)
    low, high = _cone_heights(
        edges,
        region.ravel(),
        on.nhat_B[rows],
        on.that.reshape(-1, 3),
        on.nprime.reshape(-1, 3),
        apex[rows],
        to_decimals(np.tan(gamma))[rows],
    )
    return low.reshape(-1, 3), high.reshape(-1, 3)


def _cone_heights(
    edges: Boundary,
    region: Ints,
    N: Array,
    that: Array,
    nprime: Array,
    apex: Array,
    slope: Array,
) -> tuple[Array, Array]:
    """Computes the range of heights over A_li = {p in A_i: |t . (p - c)| <= slope |n' . (p - c)|}.

    Extremes lie on the region's edges within the double cone. The apex c need not be checked: where
    it is inside the face, heights rise into one wedge of the cone and fall into the other. Portions
    are cut on the face itself, because where phi = 0 its projection on Pi_l is only a segment.
    """
    index, owner = gather(edges.offsets, region)
    tail, head = edges.tail[index], edges.head[index]
    ends = np.stack([tail, head])
    from_apex = ends - apex[owner]
    across, height = dot(that[owner], from_apex), dot(N[owner], ends)
    along = slope[owner] * dot(nprime[owner], from_apex)
    # The part of each edge that is inside both bounds of each wedge, as shares from tail to head.
    wedges = np.array([[along - across, along + across], [-along - across, across - along]])
    start, end = _positive(wedges[:, :, 0], wedges[:, :, 1])
    s = np.stack([start.max(axis=1), end.min(axis=1)])
    heights = height[0] * (1 - s) + height[1] * s
    missed = s[0] > s[1]
    low = np.where(missed, np.inf, heights).min(axis=(0, 1))
    high = np.where(missed, -np.inf, heights).max(axis=(0, 1))
    return row_extremes(low, high, owner, len(region))


def _positive(at_tail: Array, at_head: Array) -> tuple[Array, Array]:
    """Finds where on edges, from 0 at the tail to 1 at the head, linear functions are not negative.

    Returns start and end of the part; end < start where there is none.
    """
    change = at_tail - at_head
    root = at_tail / np.where(change == 0, 1.0, change)
    start = np.where(change < 0, np.maximum(root, 0.0), 0.0)
    end = np.where(change > 0, np.minimum(root, 1.0), 1.0)
    end[(change == 0) & (at_tail < 0)] = -1.0
    return start, end


@dataclass(frozen=True, eq=False)
class Opposed(Batch):
    """Parallel triples, or pairs, projected on Pi_s.

    Pi_s is orthogonal to n_bs. The text does not define it for parallel sets; with this choice Pi_p
    contains a direction inside all three friction cones. For pairs A_3 is A_2.

    Attributes:
        region: regions A_1, A_2, A_3, shape (M, 3).
        nhat_bs: n_bs, unit, along the forces on A_2 and A_3 and against that on A_1, shape (M, 3).
        u, v: unit axes of Pi_s, with u x v = n_bs, shape (M, 3).
        faces: projections A_1^s, A_2^s, A_3^s in coordinates (u . p, v . p) [m], shape (M, 3).
    """

    region: Ints
    nhat_bs: Array
    u: Array
    v: Array
    faces: Shapes


def opposed(regions: Regions, region: Ints, nhat_bs: Array) -> Opposed:
    """Projects the faces of each parallel set or pair on its Pi_s.

    Args:
        regions: all regions.
        region: A_1, A_2, A_3 of each set, shape (M, 3).
        nhat_bs: n_bs, unit, shape (M, 3).

    Returns:
        The projected sets.
    """
    u, v = orthonormal_pair(nhat_bs)
    faces = project(regions, region.ravel(), np.repeat(u, 3, axis=0), np.repeat(v, 3, axis=0))
    return Opposed(region, nhat_bs, u, v, faces.reshape(-1, 3))


def hull_of(shapes: Shapes) -> Shapes:
    """Computes the convex hull of all shapes of each row.

    Args:
        shapes: plane shapes, shape (M, k).

    Returns:
        Convex hulls, shape (M,).
    """
    hulls: Shapes = shapely.convex_hull(shapely.geometrycollections(shapes))
    return hulls


def _overlaps(a: Shapes, b: Shapes, area_slack: float) -> Bools:
    """Tests, row by row, whether two shapes share more than `area_slack` [m^2]."""
    shares: Bools = shapely.area(shapely.intersection(a, b)) > area_slack
    return shares


def parallel_faces_meet(sets: Opposed, length_slack: float, area_slack: float) -> Bools:
    """Tests parallel sets by position (Section 4.1): A_1^s meets A_2^s, A_3^s or A_aux1.

    A_aux1 counts only the parts of the hull between A_2^s and A_3^s that touch both, as the text's
    "has vertices of A_2^s and vertices of A_3^s" says.

    Args:
        sets: the M sets on Pi_s.
        length_slack: lengths below this are rounding errors [m].
        area_slack: areas below this are rounding errors [m^2].

    Returns:
        Whether each set passes, shape (M,).
    """
    first, second, third = sets.faces.T
    meets = _overlaps(first, second, area_slack)
    rest = np.flatnonzero(~meets)
    meets[rest] = _overlaps(first[rest], third[rest], area_slack)
    rest = np.flatnonzero(~meets)
    hull = hull_of(sets.faces[rest, 1:])
    # A_aux1 is part of the hull, and cutting it out takes longest.
    near = shapely.intersects(first[rest], hull)
    rest, hull = rest[near], hull[near]
    between = shapely.difference(shapely.difference(hull, second[rest]), third[rest])
    parts, owner = shapely.get_parts(between, return_index=True)
    is_auxiliary = (shapely.distance(parts, second[rest][owner]) <= length_slack) & (
        shapely.distance(parts, third[rest][owner]) <= length_slack
    )
    parts, owner = parts[is_auxiliary], owner[is_auxiliary]
    meets[rest[owner[_overlaps(first[rest][owner], parts, area_slack)]]] = True
    return meets


def two_faces_meet(sets: Opposed, area_slack: float) -> Bools:
    """Tests pairs by position (Section 4.2): the convex hulls of A_1^s and A_2^s overlap.

    Args:
        sets: the M pairs on Pi_s.
        area_slack: areas below this are rounding errors [m^2].

    Returns:
        Whether each pair passes, shape (M,).
    """
    hulls = shapely.convex_hull(sets.faces[:, :2])
    return _overlaps(hulls[:, 0], hulls[:, 1], area_slack)

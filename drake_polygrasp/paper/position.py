"""Sections 4.1 and 4.2, "according to their positions": which sets of faces face each other.

Non-parallel sets are tested on Pi_l (region R^l, portions A_li) and on Pi_s (strip R^s), parallel
sets and pairs on Pi_s alone. Departures from the text: step 1.3 repeats 1.1 and is skipped; C_ri
is a double cone, for a single one loses faces behind or before its apex; step 2.1 projects the
portions A_li, without which steps 1.4 to 1.6 would have no effect.
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
    """Non-parallel sets on planes parallel to Pi_l.

    Attributes:
        nhat_B: N, unit normal of Pi_l, shape (M, 3).
        that: t_i = N x n'_i, unit, shape (M, 3, 3).
        nprime: unit directions of n'_i, shape (M, 3, 3).
        turn: (t_2 x t_3, t_3 x t_1, t_1 x t_2) . N, shape (M, 3).
    """

    nhat_B: Array
    that: Array
    nprime: Array
    turn: Array

    def polygon(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Area [m^2] and centroid of three strips' intersection (R^l or P).

        Args:
            low: shape (M, 3) [m].
            high: shape (M, 3) [m].

        Returns:
            Areas (M,), and the centroids as vectors within the plane through B's origin, (M, 3).
        """
        axes = np.stack([self.that[:, 0], cross(self.nhat_B, self.that[:, 0])], axis=1)
        that_2 = product(self.that, axes.swapaxes(1, 2))
        area, centroid = area_and_centroid(strips_polygon(that_2, self.turn, low, high))
        return area, transformed(axes.swapaxes(1, 2), centroid)


def plane_directions(N: Array, nhat: Array) -> PlaneDirections:
    """Directions on Pi_l from its normal, shape (M, 3), and the three normals, shape (M, 3, 3)."""
    nprime = unit(nhat - dot(N[:, None], nhat)[..., None] * N[:, None])
    that = cross(N[:, None], nprime)
    turn = dot(N[:, None], cross(that[:, [1, 2, 0]], that[:, [2, 0, 1]]))
    return PlaneDirections(N, that, nprime, turn)


def region_rl(
    edges: Boundary, region: Ints, on: PlaneDirections, length_slack: float
) -> tuple[Bools, Array, Array]:
    """Steps 1.1 and 1.2: bounds of the three strips along t_i, and whether R^l is not empty.

    Returns:
        Whether R^l has an interior, shape (M,); low and high, each of shape (M, 3) [m].
    """
    low, high = extents(edges, region.ravel(), on.that.reshape(-1, 3))
    low, high = low.reshape(-1, 3), high.reshape(-1, 3)
    return strips_meet(on.turn, low, high, length_slack), low, high


def strip_rs(
    edges: Boundary, region: Ints, on: PlaneDirections, apex: Array, gamma: Array
) -> tuple[Array, Array]:
    """Steps 1.4 to 2.2: the bounds of R^s along N, common to the portions A_li.

    Args as of `portion_heights`.

    Returns:
        low and high [m], each of shape (M,); low > high where they have no height in common.
    """
    low, high = portion_heights(edges, region, on, apex, gamma)
    return low.max(axis=1), high.min(axis=1)


def portion_heights(
    edges: Boundary, region: Ints, on: PlaneDirections, apex: Array, gamma: Array
) -> tuple[Array, Array]:
    """Steps 1.4 to 2.1: the bounds along N of the portions A_li within the cones C_ri.

    Args:
        edges: boundary of all regions.
        region: the sets, shape (M, 3).
        on: their directions on Pi_l.
        apex: centroid of R^l within the plane through B's origin [m], shape (M, 3).
        gamma: half-angle alpha - phi of C_ri [rad], shape (M,).

    Returns:
        low and high [m], each of shape (M, 3); low > high where a portion is empty.
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
    """Least and greatest height over A_li = {p in A_i: |t . (p - c)| <= slope |n' . (p - c)|}.

    The extremes are taken where an edge meets a wedge of the double cone; at an apex inside the
    face heights rise into one wedge and fall into the other. All is done on the face itself: where
    phi = 0 its projection on Pi_l is a mere segment.
    """
    index, owner = gather(edges.offsets, region)
    tail, head = edges.tail[index], edges.head[index]
    ends = np.stack([tail, head])
    from_apex = ends - apex[owner]
    across, height = dot(that[owner], from_apex), dot(N[owner], ends)
    along = slope[owner] * dot(nprime[owner], from_apex)
    # What both bounds of each wedge leave of each edge.
    wedges = np.array([[along - across, along + across], [-along - across, across - along]])
    start, end = _positive(wedges[:, :, 0], wedges[:, :, 1])
    s = np.stack([start.max(axis=1), end.min(axis=1)])
    heights = height[0] * (1 - s) + height[1] * s
    missed = s[0] > s[1]
    low = np.where(missed, np.inf, heights).min(axis=(0, 1))
    high = np.where(missed, -np.inf, heights).max(axis=(0, 1))
    return row_extremes(low, high, owner, len(region))


def _positive(at_tail: Array, at_head: Array) -> tuple[Array, Array]:
    """Where along edges, from 0 to 1, linear functions are >= 0; nowhere if the end is negative."""
    change = at_tail - at_head
    root = at_tail / np.where(change == 0, 1.0, change)
    start = np.where(change < 0, np.maximum(root, 0.0), 0.0)
    end = np.where(change > 0, np.minimum(root, 1.0), 1.0)
    end[(change == 0) & (at_tail < 0)] = -1.0
    return start, end


@dataclass(frozen=True, eq=False)
class Opposed(Batch):
    """Parallel triples and pairs on Pi_s, which is orthogonal to n_bs.

    The text never says what Pi_s is for parallel sets; orthogonal to n_bs, the plane Pi_p contains
    a direction inside all three cones. For pairs A_3 is A_2.

    Attributes:
        region: A_1, A_2, A_3, shape (M, 3).
        nhat_bs: unit, along the forces on A_2 and A_3 and against that on A_1, shape (M, 3).
        u: first unit axis of Pi_s, shape (M, 3).
        v: second, with u x v = n_bs, shape (M, 3).
        faces: projections A_1^s, A_2^s, A_3^s in coordinates (u, v) [m], shape (M, 3).
    """

    region: Ints
    nhat_bs: Array
    u: Array
    v: Array
    faces: Shapes


def opposed(regions: Regions, region: Ints, nhat_bs: Array) -> Opposed:
    """Projects the faces of each set on its Pi_s."""
    u, v = orthonormal_pair(nhat_bs)
    faces = project(regions, region.ravel(), np.repeat(u, 3, axis=0), np.repeat(v, 3, axis=0))
    return Opposed(region, nhat_bs, u, v, faces.reshape(-1, 3))


def hull_of(shapes: Shapes) -> Shapes:
    """Convex hull of all shapes of each row, (M, k) to (M,)."""
    hulls: Shapes = shapely.convex_hull(shapely.geometrycollections(shapes))
    return hulls


def overlaps(a: Shapes, b: Shapes, area_slack: float) -> Bools:
    """Whether shapes share an area, row by row."""
    shares: Bools = shapely.area(shapely.intersection(a, b)) > area_slack
    return shares


def parallel_faces_meet(sets: Opposed, length_slack: float, area_slack: float) -> Bools:
    """Section 4.1 for parallel sets: A_1^s meets A_2^s, A_3^s or A_aux1 between them."""
    first, second, third = sets.faces.T
    meets = overlaps(first, second, area_slack) | overlaps(first, third, area_slack)
    rest = np.flatnonzero(~meets)
    between = shapely.difference(
        shapely.difference(hull_of(sets.faces[rest, 1:]), second[rest]), third[rest]
    )
    parts, owner = shapely.get_parts(between, return_index=True)
    is_auxiliary = (shapely.distance(parts, second[rest][owner]) <= length_slack) & (
        shapely.distance(parts, third[rest][owner]) <= length_slack
    )
    parts, owner = parts[is_auxiliary], owner[is_auxiliary]
    meets[rest[owner[overlaps(first[rest][owner], parts, area_slack)]]] = True
    return meets


def two_faces_meet(sets: Opposed, area_slack: float) -> Bools:
    """Section 4.2: the convex hulls of A_1^s and A_2^s meet."""
    hulls = shapely.convex_hull(sets.faces[:, :2])
    return overlaps(hulls[:, 0], hulls[:, 1], area_slack)

"""Section 7: the contact points on the segments a_i.

Departures from the text. In 7.1, what steps 3 to 5 call P_1 is the point P_I where the three lines
of force meet, and "closest to a_2" is read as closest to c_a, because a_2 depends on labels. In
7.2, d_m is the distance of P_2 from L_p, as in 7.3, because that of P_1 is zero; both pairings of
sides with faces are tried. Distances and order are measured across n_bs, because a tilted a_i would
distort them. In 7.3, L_p may run through a hole of a_2: it is enough that a_2 has points on both
sides, and P_1 moves along a_1 until it has.
"""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.paper.planar import (
    Scale,
    centroids,
    clip_intervals,
    nearest,
    outer_ends,
    within,
)
from drake_polygrasp.paper.position import PlaneDirections
from drake_polygrasp.paper.region_p import Cut, segment_hulls
from drake_polygrasp.vectors import cross, dot

HALF = 0.5
"""The text's place of P_2 on its part of the segment: the middle."""
SPREADS = (0.5, 0.9)
"""Places that "enriched" tries, from 0 at L_p to 1 at the far end: the text's 0.5 halves the
triangle that Section 6 wants large, and 0.9 holds better on most objects."""
CLEARANCE = 0.02
"""Our choice: share of a_2's extent that 7.3 keeps on each side of L_p."""
EQUAL_AREA = 1e-9
"""Our choice, relative: triangles whose areas differ by less are a tie."""


def nonparallel_contacts(cut: Cut, on: PlaneDirections, scale: Scale) -> Array:
    """Constructs the contacts of non-parallel sets: on lines along n'_i through one point (7.1).

    Args:
        cut: M planes of non-parallel sets, with their segments and P.
        on: directions on Pi_l of the planes' sets.
        scale: the object's size.

    Returns:
        p_BC, contact points on A_1, A_2, A_3 expressed in B [m], shape (M, 3, 3); NaN where a line
        misses its segment.
    """
    rows = np.arange(len(cut.owner))
    across = cross(cut.along_B, cut.nhat_B)
    c_a_2 = centroids(segment_hulls(cut.segments, across, cut.along_B))
    c_a = c_a_2[:, :1] * across + c_a_2[:, 1:] * cut.along_B + cut.height[:, None] * cut.nhat_B

    offset = c_a - cut.p_Bc
    distance = np.abs(dot(on.that, offset[:, None]))
    nearest_line = distance <= distance.min(axis=1, keepdims=True) + scale.length_slack
    L_p = on.nprime[rows, np.argmax(nearest_line, axis=1)]
    # Positions along L_p from c_I^p: P covers [low, high], and P_m projects to `middle`.
    middle = dot(L_p, offset) / 2
    low, high = _reach_in_strips(cut, on, L_p)
    P_I = cut.p_Bc + np.clip(middle, low, high)[:, None] * L_p

    points, on_faces = _concurrent(cut, on, np.stack([P_I, cut.p_Bc], axis=1), scale)
    take_first = on_faces[:, 0] & _triangle_holds(points[:, 0], P_I, cut.nhat_B, scale)
    contacts = np.where(take_first[:, None, None], points[:, 0], points[:, 1])
    contacts[~take_first & ~on_faces[:, 1]] = np.nan
    return contacts


def _reach_in_strips(cut: Cut, on: PlaneDirections, L_p: Array) -> tuple[Array, Array]:
    """Computes the ends of L_p within P as signed distances from c_I^p [m], shape (M,) each."""
    ends = outer_ends(cut.segments.intervals)
    start = dot(on.that, cut.p_Bc[:, None])[..., None]
    rate = dot(on.that, L_p[:, None])[..., None]
    parallel = np.abs(rate) < 1e-9
    bounds = (ends - start) / np.where(parallel, 1.0, rate)
    low = np.where(parallel[..., 0], -np.inf, bounds.min(axis=-1)).max(axis=1)
    high = np.where(parallel[..., 0], np.inf, bounds.max(axis=-1)).min(axis=1)
    return low, np.maximum(low, high)


def _concurrent(cut: Cut, on: PlaneDirections, P_I: Array, scale: Scale) -> tuple[Array, Bools]:
    """Intersects lines along n'_i through points P_I with the lines of the segments a_i.

    For J points a row, shape (M, J, 3): the intersections, shape (M, J, 3, 3), and whether all
    three lie on their segments, shape (M, J).
    """
    s = dot(on.that[:, None], P_I[:, :, None])
    points = cut.segments.p_BS[:, None] + s[..., None] * cut.segments.slope_B[:, None]
    hit = within(cut.segments.intervals[:, None], s, scale.length_slack)
    hits: Bools = np.logical_and.reduce(hit, axis=2)
    return points, hits


def _triangle_holds(corners: Array, point: Array, N: Array, scale: Scale) -> Bools:
    """Tests whether points lie in the closed triangles of three corners in planes of normal N."""
    side = corners[:, [1, 2, 0]] - corners
    left = dot(N[:, None], cross(side, point[:, None] - corners))
    slack = scale.length_slack * np.sqrt(dot(side, side))
    holds: Bools = np.logical_and.reduce(left >= -slack, axis=1)
    holds |= np.logical_and.reduce(left <= slack, axis=1)
    return holds


def opposed_contacts(cut: Cut, scale: Scale, spread: Array) -> Array:
    """Constructs the contacts of parallel sets (7.2) and of pairs (7.3).

    P_1 lies on a_1 near c_a; P_2 and P_3 lie on either side of L_p, the line of force through P_1.

    Args:
        cut: M planes of parallel sets and pairs; 7.3 applies where a_2 and a_3 are the same.
        scale: the object's size.
        spread: place of P_2 on its part of the segments, from 0 at L_p to 1 at the far end, `HALF`
            in the text, shape (M,).

    Returns:
        p_BC, contact points on A_1, A_2, A_3 expressed in B [m], shape (M, 3, 3); for pairs the
        farther of P_2 and P_3 comes first. NaN where P_1 cannot be strictly between the others.
    """
    slack, rows = scale.length_slack, np.arange(len(cut.owner))
    across = cross(cut.along_B, cut.nhat_B)
    c_a = centroids(segment_hulls(cut.segments, across, cut.along_B))[:, 0]
    a_1, a_2, a_3 = cut.segments.intervals.swapaxes(0, 1)
    one_region = cut.region[:, 1] == cut.region[:, 2]
    one_face = one_region & ((a_2 == a_3) | np.isnan(a_2)).all(axis=(1, 2))
    low, high = outer_ends(a_2).T
    margin = CLEARANCE * (high - low)
    bounded = clip_intervals(a_1, low + margin, high - margin, slack)
    x_1 = nearest(np.where(one_face[:, None, None], bounded, a_1), c_a, slack)

    d = _either_side(cut.segments.intervals[:, 1:] - x_1[:, None, None, None], spread, slack)
    d[one_face, 1] = np.nan  # On one face the second pairing equals the first.
    x = x_1[:, None, None] + d
    p_BC = cut.segments.p_BS[:, None] + x[..., None] * cut.segments.slope_B[:, None]
    normal = cross(p_BC[:, :, 1] - p_BC[:, :, 0], p_BC[:, :, 2] - p_BC[:, :, 0])
    area = np.sqrt(dot(normal, normal))
    largest = np.fmax.reduce(area, axis=1, keepdims=True)
    best = np.argmax(area >= largest * (1 - EQUAL_AREA), axis=1)
    contacts: Array = p_BC[rows, best]

    reach = np.abs(d[rows, best])
    swap = one_region & (reach[:, 2] > reach[:, 1] + slack)
    contacts[swap] = contacts[swap][:, [0, 2, 1]]
    return contacts


def _either_side(beyond: Array, spread: Array, slack: float) -> Array:
    """Places P_2 and P_3 on opposite sides of L_p, for both pairings of sides with faces.

    Args:
        beyond: segments a_2 and a_3 as signed distances from L_p, positive on its right [m], shape
            (M, 2, S, 2).
        spread: place of P_2 on its part of the segments, shape (M,).
        slack: lengths below this are rounding errors [m].

    Returns:
        Signed distances of P_1, P_2, P_3 from L_p [m], shape (M, 2, 3): P_2 on the left in the
        first pairing, P_3 in the second. NaN where a side has no room.
    """
    # Distances on the left are mirrored, so that farther is greater on both sides; the axes are
    # (M, side, pairing, S, 2).
    away = np.stack([-beyond[..., ::-1], beyond[:, ::-1]], axis=1)
    away = clip_intervals(away, np.zeros(1), np.full(1, np.inf), slack)
    near, far = np.moveaxis(outer_ends(away), -1, 0)
    own = nearest(away, near + spread[:, None, None] * (far - near), slack)
    d_m = own.max(axis=1, keepdims=True)
    left, right = np.where(own >= d_m - slack, own, nearest(away, d_m, slack)).swapaxes(0, 1)
    d = np.zeros((len(beyond), 2, 3))
    d[:, 0, 1], d[:, 0, 2] = -left[:, 0], right[:, 0]
    d[:, 1, 1], d[:, 1, 2] = right[:, 1], -left[:, 1]
    d[~((left > slack) & (right > slack)), 1:] = np.nan
    return d

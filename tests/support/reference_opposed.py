"""Sections 4 to 7 of the paper for one set of two faces, or of three parallel ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import pairwise
from math import asin

import numpy as np
import shapely
from shapely import Point, Polygon

from drake_polygrasp.arrays import Array
from tests.support.reference_concurrent import Row, first_height, heights, spread
from tests.support.reference_geometry import (
    FAR,
    TIE,
    TOL,
    Doubts,
    Face,
    Interval,
    Section,
    angle,
    band,
    both_ways,
    centroid,
    chord,
    edge_vector,
    fan,
    hull,
    long_line,
    on_boundary,
    plane_axes,
    ring_edges,
    section,
    solid_parts,
    tips_plane,
    unit,
)


def parallel(faces: list[Face], n_bs: Array, alpha: float, doubts: Doubts) -> Iterator[Row]:
    """Sections 4.1, 5, 6 and 7.2 for three parallel faces, the first against the others."""
    u, v = plane_axes(n_bs)
    A = [face.project(u, v) for face in faces]
    hull_23 = hull(A[1], A[2])
    A_aux1 = [
        part
        for part in solid_parts(hull_23 - A[1] - A[2])
        if not any(doubts.exceeds("A_aux1", part.distance(A_i)) for A_i in A[1:])
    ]
    facing = [A[1], A[2], shapely.union_all(A_aux1)]
    if not doubts.exceeds("opposed", max((A[0] & other).area for other in facing)):
        yield Row("not_opposed")
        return
    directions = parallel_directions(A, hull_23, doubts)
    if not directions:
        yield Row("no_direction")
    n = [face.n for face in faces]
    pair_angle = angle(n[1], n[2])
    distinct = doubts.exceeds("equal normals", pair_angle, 1e-6)
    sin_phi = tips_plane(n)[1] if distinct else float(np.linalg.norm(n[0] + n[1])) / 2
    q4 = abs(1 - asin(sin_phi) / alpha)
    for x, y in directions:
        e = x * u + y * v

        n_dash = [np.array([e @ n_i, n_bs @ n_i]) for n_i in n]
        scored = Row("", q4=q4, q5=spread(n_dash, doubts, parallel=True))
        yield from plane_rows(faces, e, n_bs, None, lambda a: [tuple(a)], scored, doubts)


def parallel_directions(A: list[Polygon], hull_23: Polygon, doubts: Doubts) -> list[Array]:
    """Section 5: unit vectors along s_e for three parallel faces, several when tied."""
    A_aux2 = A[0] & hull_23
    g, c2, c3 = centroid(A_aux2), centroid(A[1]), centroid(A[2])
    lines = [c3 - c2, c2 - g, c3 - g]
    lines = [d for d in lines if doubts.exceeds("line", float(np.linalg.norm(d)), 1e-6)]
    if found := longest_crossings(g, lines, A, hull_23, doubts):
        return found
    corners_2, corners_3 = (shapely.MultiPoint(shapely.get_coordinates(A_i)) for A_i in A[1:])
    edges = []
    for edge in ring_edges(hull_23):
        start, end = map(Point, edge.coords)
        for one, other in ((start, end), (end, start)):
            if doubts.contains("vertex", corners_2, one) and doubts.contains(
                "vertex", corners_3, other
            ):
                edges.append(edge)
                break
    if edges:
        nearest = doubts.ties("hull edge", [edge.distance(Point(g)) for edge in edges], TIE)
        return both_ways([edge_vector(edges[i]) for i in nearest])
    return longest_crossings(g, fan(A_aux2.convex_hull, doubts), A, hull_23, doubts)


def longest_crossings(
    g: Array, directions: list[Array], A: list[Polygon], hull_23: Polygon, doubts: Doubts
) -> list[Array]:
    """Directions of the longest of the lines through g that cross both A_2 and A_3."""
    lines = [
        unit(d)
        for d in directions
        if doubts.exceeds("crossing", min(chord(g, unit(d), A_i, doubts) for A_i in A[1:]))
    ]
    if not lines:
        return []
    lengths = [-chord(g, d, hull_23, doubts) for d in lines]
    return both_ways([lines[i] for i in doubts.ties("longest line", lengths, TIE)])


def pair(a: Face, b: Face, alpha: float, doubts: Doubts) -> Iterator[Row]:
    """Sections 4.2, 5, 6, 7.2 and 7.3 for two faces."""
    n_bs = unit(b.n - a.n)
    axes = plane_axes(n_bs)
    A = [face.project(*axes) for face in (a, b)]
    hulls = [A_i.convex_hull for A_i in A]
    facing = [A[0] & A[1], (hulls[0] - A[0]) & A[1], (hulls[1] - A[1]) & A[0]]
    areas = [region.area for region in facing]
    if not (
        doubts.exceeds("opposed", (hulls[0] & hulls[1]).area)
        and doubts.exceeds("opposed", max(areas))
    ):
        yield Row("not_opposed")
        return
    sin_phi = float(np.linalg.norm(a.n + b.n)) / 2
    scored = Row("", q4=abs(1 - asin(sin_phi) / alpha), q5=1.0)
    winner = doubts.ties("R_maxT", [-area for area in areas])[0]
    if winner == 0:
        yield from facing_pair([a, b], facing[0], axes, n_bs, scored, doubts)
    else:
        one, comb = (b, a) if winner == 1 else (a, b)
        yield from pocket_pair(one, comb, axes, n_bs, scored, doubts)


def facing_pair(
    faces: list[Face],
    overlap: shapely.Geometry,
    axes: Array,
    n_bs: Array,
    scored: Row,
    doubts: Doubts,
) -> Iterator[Row]:
    """Two faces whose overlap A_12 is what opposes them."""
    A_12 = shapely.union_all(solid_parts(overlap))
    edges = [edge for part in shapely.get_parts(A_12) for edge in ring_edges(part)]
    longest = doubts.ties("l_u", [-edge.length for edge in edges], TIE)

    def offsets(N: Array) -> list[float]:
        return overlap_heights(A_12, axes @ N, doubts)

    def by_length(sections: list[Section]) -> Iterator[tuple[Section, ...]]:
        for longer in doubts.ties("roles", [-a_i.length for a_i in sections]):
            yield sections[1 - longer], sections[longer], sections[longer]

    for direction in both_ways([edge_vector(edges[i]) for i in longest]):
        yield from plane_rows(faces, direction @ axes, n_bs, offsets, by_length, scored, doubts)


def pocket_pair(
    one: Face, comb: Face, axes: Array, n_bs: Array, scored: Row, doubts: Doubts
) -> Iterator[Row]:
    """Two faces of which one reaches into a pocket of the other's outline, or over a hole in it."""
    A_1, A_2 = one.project(*axes), comb.project(*axes)
    whole = A_2.convex_hull
    pockets = solid_parts(whole - A_2)
    tied = doubts.ties("pocket", [-(pocket & A_1).area for pocket in pockets])
    if len(tied) > 1:
        doubts.add("pocket")
    for pocket in (pockets[k] for k in tied):

        def around_gap(
            sections: list[Section], pocket: Polygon = pocket
        ) -> Iterator[tuple[Section, ...]]:
            a_1, a = sorted(sections, key=lambda a_i: a_i.face is comb)
            gaps = []
            for left, right in pairwise(a.intervals):
                middle = axes @ a.at((left[1] + right[0]) / 2)
                if pocket.distance(Point(middle)) == 0:
                    gaps.append((left[1] - right[0], left, right))
            if not gaps:
                yield a_1, a, a
                return
            _, left, right = gaps[doubts.ties("gap", [gap[0] for gap in gaps])[0]]
            yield a_1, replace(a, intervals=[left]), replace(a, intervals=[right])

        lids = [edge_vector(edge) for edge in ring_edges(pocket) if on_boundary(edge, whole)]
        for direction in both_ways(lids[:1] or fan(whole, doubts)):
            yield from plane_rows(
                [one, comb], direction @ axes, n_bs, None, around_gap, scored, doubts
            )


def overlap_heights(A_12: shapely.Geometry, across: Array, doubts: Doubts) -> list[float]:
    """Section 5: where Pi_p passes when the faces' overlap opposes them, several when tied."""
    if doubts.contains("c_m in A_12", A_12, np.zeros(2)):
        return [0.0]
    c = centroid(A_12)
    if doubts.contains("centroid in A_12", A_12, c):
        return [float(across @ c)]
    pieces = [p for p in shapely.get_parts(long_line(c, across) & A_12) if p.length > TOL]
    longest = doubts.ties("L_c", [-piece.length for piece in pieces])
    return [float(across @ centroid(pieces[i])) for i in longest]


def plane_rows(
    faces: list[Face],
    e: Array,
    n_bs: Array,
    offsets: Callable[[Array], list[float]] | None,
    roles: Callable[[list[Section]], Iterable[tuple[Section, ...]]],
    scored: Row,
    doubts: Doubts,
) -> Iterator[Row]:
    """Sections 5 to 7 once the directions e and n_bs of Pi_p are known: a row per choice of roles.

    `roles` names a_1, a_2, a_3 among the sections at a height; a_2 is a_3 for one face twice.
    """
    N = unit(np.cross(e, n_bs))
    low, high = zip(*(face.extent(N) for face in faces), strict=True)
    lo, hi = max(low), min(high)
    if not doubts.exceeds("R^s", hi - lo):
        yield Row("rs_empty")
        return
    F = hull(*(face.project(e, N) for face in faces)) & band(lo, hi)
    scored = replace(scored, d1=float(np.linalg.norm(centroid(F))), Is=F.area)
    for first in [first_height(F, doubts)] if offsets is None else offsets(N):
        yield from height_rows(faces, e, n_bs, heights(first, lo, hi), roles, scored, doubts)


def height_rows(
    faces: list[Face],
    e: Array,
    n_bs: Array,
    tries: list[float],
    roles: Callable[[list[Section]], Iterable[tuple[Section, ...]]],
    scored: Row,
    doubts: Doubts,
) -> Iterator[Row]:
    """The rows at the first height at which P is not empty."""
    N = unit(np.cross(e, n_bs))
    for height in tries:
        sections = [section(face, N, height, e, doubts) for face in faces]
        rows = []
        for a in roles(sections) if all(a_i.intervals for a_i in sections) else ():
            points = [(e @ end, n_bs @ end) for a_i in a for end in a_i.ends()]
            whole = shapely.MultiPoint(points).convex_hull
            P = whole & shapely.box(a[0].lo, -FAR, a[0].hi, FAR)
            if doubts.exceeds("P", P.area):
                contacts = opposed_contacts(a, float(centroid(whole)[0]), len(faces), doubts)
                reason = "" if contacts else "wrong_order"
                d2 = float(np.linalg.norm(centroid(P)))
                rows.append(replace(scored, reason=reason, d2=d2, Ip=P.area, contacts=contacts))
        if rows:
            yield from rows
            return
    yield replace(scored, reason="p_empty")


def opposed_contacts(
    a: tuple[Section, ...], x_a: float, num_faces: int, doubts: Doubts
) -> tuple[tuple[Face, Array], ...]:
    """Sections 7.2 and 7.3: one contact on a_1 between two opposed to it; () if there is none."""
    a_1, a_2, a_3 = a
    places = a_1.intervals
    if a_2 is a_3:
        delta = 0.02 * (a_2.hi - a_2.lo)
        places = clipped(places, a_2.lo + delta, a_2.hi - delta)
        if not places:
            return ()
    moved = [min(max(x_a, lo), hi) for lo, hi in places]
    x_1 = moved[doubts.ties("P_1", [abs(x - x_a) for x in moved])[0]]
    triangles = []
    for left, right in ((a_2, a_3), (a_3, a_2))[: 1 if a_2 is a_3 else 2]:
        pair = both_sides(left, right, left is a_2, x_1, doubts)
        if pair is not None:
            d_2, d_3 = pair
            p_2, p_3 = left.at(x_1 - d_2), right.at(x_1 + d_3)
            doubled_area = np.linalg.norm(np.cross(p_2 - a_1.at(x_1), p_3 - a_1.at(x_1)))
            ordered = [(left.face, p_2), (right.face, p_3)]
            # Three faces: each with its own point; two: the farther first.
            if (num_faces == 3 and left is a_3) or (num_faces == 2 and d_3 > d_2 + TOL):
                ordered.reverse()
            triangles.append((doubled_area, ((a_1.face, a_1.at(x_1)), *ordered)))
    if not triangles:
        return ()
    largest = max(area for area, _ in triangles)
    return triangles[doubts.ties("pairing", [1 - area / largest for area, _ in triangles])[0]][1]


def both_sides(
    left: Section, right: Section, left_first: bool, x_1: float, doubts: Doubts
) -> tuple[float, float] | None:
    """The distances from L_p of the contacts left and right of it."""
    portions = [
        [(x_1 - hi, x_1 - lo) for lo, hi in reversed(clipped(left.intervals, -FAR, x_1))],
        [(lo - x_1, hi - x_1) for lo, hi in clipped(right.intervals, x_1, FAR)],
    ]
    if not all(doubts.exceeds("both sides", p[-1][1] if p else 0.0) for p in portions):
        return None
    middles = [nearest_in(p, (p[0][0] + p[-1][1]) / 2, doubts) for p in portions]
    order = [0, 1] if left_first else [1, 0]
    farther = order[doubts.ties("P_2", [-middles[side] for side in order])[0]]
    other = 1 - farther
    middles[other] = nearest_in(portions[other], middles[farther], doubts)
    return middles[0], middles[1]


def nearest_in(portion: list[Interval], distance: float, doubts: Doubts) -> float:
    """The point of the portion nearest to a distance; of two as near, the farther."""
    places = [min(max(distance, near), far) for near, far in portion]
    return places[doubts.ties("in portion", [abs(x - distance) for x in places])[-1]]


def clipped(intervals: list[Interval], lo: float, hi: float) -> list[Interval]:
    parts = [(max(a, lo), min(b, hi)) for a, b in intervals]
    return [(a, b) for a, b in parts if b - a > TOL]

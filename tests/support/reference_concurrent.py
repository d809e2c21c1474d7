"""Sections 4.1, 5, 6 and 7.1 of the paper for one set of three non-parallel faces."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import combinations
from math import asin, tan

import numpy as np
import shapely
from shapely import Point, Polygon

from drake_polygrasp.arrays import Array
from tests.support.reference_geometry import (
    TIE,
    TOL,
    Doubts,
    Face,
    Section,
    band,
    centroid,
    hull,
    long_line,
    section,
    strips,
    thickness,
    tips_plane,
    unit,
)

PROGRESS = (
    "orientation", "rl_empty", "not_opposed", "no_direction", "rs_empty", "p_empty",
    "off_face", "wrong_order", "",
)  # fmt: skip
"""How far a set can get, by the reason that stops it."""


@dataclass(frozen=True, eq=False)
class Row:
    """One way to evaluate a set, and how far it got: reason '' has contacts."""

    reason: str
    d1: float = 0.0
    d2: float = 0.0
    Is: float = 0.0
    Ip: float = 0.0
    q4: float = 0.0
    q5: float = 0.0
    contacts: tuple[tuple[Face, Array], ...] = field(default=())

    @property
    def has_P(self) -> bool:
        return PROGRESS.index(self.reason) > PROGRESS.index("p_empty")

    def position_quality(self, rho: float) -> float:
        """q1 q2 q3 on the object's scale."""
        near = max(0.0, 1 - self.d1 / rho) * max(0.0, 1 - self.d2 / rho)
        return near * (min(1.0, self.Is / rho**2) + min(1.0, self.Ip / rho**2)) / 2


def nonparallel(faces: list[Face], alpha: float, doubts: Doubts) -> Iterator[Row]:
    """Sections 4.1, 5, 6 and 7.1 for three non-parallel faces."""
    N, sin_phi = tips_plane([face.n for face in faces])
    phi = asin(sin_phi)
    n_dash = [face.n - sin_phi * N for face in faces]
    axes = [unit(n) for n in n_dash]
    t = [np.cross(N, axis) for axis in axes]
    basis = np.array([t[0], np.cross(N, t[0])])

    R_l = strips([(basis @ t_i, *face.extent(t_i)) for t_i, face in zip(t, faces, strict=True)])
    if not doubts.exceeds("R^l", thickness(R_l)):
        yield Row("rl_empty")
        return
    c_R = centroid(R_l) @ basis
    portions = []
    for face, axis, t_i in zip(faces, axes, t, strict=True):
        inner, outer = tan(alpha - phi) * axis - t_i, tan(alpha - phi) * axis + t_i
        for sign in (1, -1):
            wedge = face.clip(sign * inner, sign * inner @ c_R) & face.clip(
                sign * outer, sign * outer @ c_R
            )
            portions.append(face.polygon & wedge)
    A_l = [shapely.GeometryCollection(portions[i : i + 2]) for i in (0, 2, 4)]
    if any(part.is_empty for part in A_l):
        yield Row("rs_empty")
        return
    low, high = zip(*(f.extent(N, part) for f, part in zip(faces, A_l, strict=True)), strict=True)
    lo, hi = max(low), min(high)
    if not doubts.exceeds("R^s", hi - lo):
        yield Row("rs_empty")
        return

    q4 = abs(1 - phi / alpha)
    q5 = spread([basis @ n for n in n_dash], doubts)
    areas = [face.polygon.area for face in faces]
    for f in doubts.ties("largest face", [1 - area / max(areas) for area in areas], TIE):
        F = hull(*(face.project(t[f], N) for face in faces)) & band(lo, hi)
        known = Row("p_empty", d1=float(np.linalg.norm(centroid(F))), Is=F.area, q4=q4, q5=q5)
        for height in heights(first_height(F, doubts), lo, hi):
            a = [section(face, N, height, t_i, doubts) for face, t_i in zip(faces, t, strict=True)]
            P = strips([(basis @ t_i, a_i.lo, a_i.hi) for t_i, a_i in zip(t, a, strict=True)])
            if doubts.exceeds("P", thickness(P)):
                known = replace(known, d2=float(np.linalg.norm(centroid(P))), Ip=P.area)
                contacts = concurrent_contacts(a, t, basis, P, doubts)
                reason = "" if contacts else "off_face"
                known = replace(known, reason=reason, contacts=contacts)
                break
        yield known


def concurrent_contacts(
    a: list[Section], t: list[Array], basis: Array, P: Polygon, doubts: Doubts
) -> tuple[tuple[Face, Array], ...]:
    """Section 7.1: where lines along n'_i through one point meet the a_i; () if they do not."""
    c_I = centroid(P)
    c_a = centroid(hull(*(Point(basis @ end) for a_i in a for end in a_i.ends())))
    flat = [basis @ t_i for t_i in t]
    p = doubts.ties("L_p", [abs(t_i @ (c_a - c_I)) for t_i in flat])[0]
    along = np.array([-flat[p][1], flat[p][0]])
    P_I = c_I + along * (along @ (c_a - c_I)) / 2
    if not doubts.contains("P_m in P", P, P_I):
        ends = shapely.get_coordinates(long_line(c_I, along) & P)
        P_I = min(ends, key=lambda end: np.linalg.norm(end - c_a))
    for centre, inside in ((P_I, True), (c_I, False)):
        points = [point_at(a_i, t_i @ centre, doubts) for a_i, t_i in zip(a, flat, strict=True)]
        if any(point is None for point in points):
            continue
        triangle = hull(*(Point(basis @ point) for point in points))
        if not inside or doubts.contains("P_I in triangle", triangle, centre):
            return tuple((a_i.face, point) for a_i, point in zip(a, points, strict=True))
    return ()


def point_at(a: Section, x: float, doubts: Doubts) -> Array | None:
    outside = [max(lo - x, x - hi, 0.0) for lo, hi in a.intervals]
    return None if doubts.exceeds("on a_i", min(outside)) else a.at(x)


def first_height(F: shapely.Geometry, doubts: Doubts) -> float:
    """Section 5: through the centre of mass where that can be, else through F's centroid."""
    return 0.0 if doubts.contains("c_m in F", F, np.zeros(2)) else float(centroid(F)[1])


def heights(first: float, lo: float, hi: float) -> list[float]:
    """The offsets of Pi_p to try, in order."""
    margin = 0.02 * (hi - lo)
    lo, hi = lo + margin, hi - margin
    first = min(max(first, lo), hi)
    others = [lo + s * (hi - lo) for s in (0.5, 0.25, 0.75)]
    return [first, *sorted(others, key=lambda h: round(abs(h - first) / TOL))]


def spread(n_dash: list[Array], doubts: Doubts, parallel: bool = False) -> float:
    """q_5 of three faces (eq. 10)."""
    if not doubts.contains("q_5", hull(*map(Point, n_dash)), np.zeros(2)):
        return 0.0
    distances = [float(np.linalg.norm(a - b)) for a, b in combinations(n_dash, 2)]
    ratio = min(distances) / max(distances)
    return 1 - ratio if parallel else ratio

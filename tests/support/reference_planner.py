"""The paper's planner, one set of faces at a time: slow, plain, sharing no code with the package.

Every step is done here by another technique than in `drake_polygrasp.planning`: orientation by the
hull of Proposition 2, regions by clipping shapely polygons with large half-planes, sections by
cutting polygons with long lines, force closure by a linear program. A comparison so close that
rounding may turn it is recorded in `Outcome.doubts` by name.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import combinations
from math import acos, asin, atan, atan2, pi, sqrt

import numpy as np
from scipy.optimize import linprog
from shapely.affinity import scale

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.regions import Regions
from tests.support.reference_concurrent import PROGRESS, Row, nonparallel
from tests.support.reference_geometry import TOL, Doubts, Face, angle, tips_plane, unit
from tests.support.reference_opposed import pair, parallel

CONE_SIDES = 64
TipFits = Callable[[Array, Array], bool]


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of one set of faces."""

    reason: str
    kind: str | None = None
    Q: float | None = None
    """On the paper's scale; None when the set has no region P."""
    q: tuple[float, ...] | None = None
    p_BC: Array | None = None
    regions: tuple[int, ...] | None = None
    """Of the contacts."""
    alternatives: tuple[tuple[tuple[int, ...], Array], ...] = ()
    """`regions` and `p_BC` of all tied choices that are as good, these among them."""
    doubts: frozenset[str] = frozenset()

    @property
    def marginal(self) -> bool:
        return bool(self.doubts)


NOISE = 1e-5
"""Times rho: distances no longer than this are zero, 0/0 counts as 1."""


def reference_plan(
    regions: Regions,
    p_BBcm: Array,
    diameter: float,
    rho: float,
    tip_fits: TipFits | None = None,
) -> dict[tuple[int, ...], Outcome]:
    """The fate of every triple and pair of regions.

    Args:
        regions: The A_i, n rows.
        p_BBcm: Centre of mass [m], shape (3,).
        diameter: L [m].
        rho: Greatest distance from the centre of mass to the surface [m].
        tip_fits: Whether fingertips fit at contacts [m] with inward normals, both (3, 3).
    """
    faces = [
        Face(
            i,
            scale(regions.polygon_F[i], 1 / diameter, 1 / diameter, origin=(0, 0)),
            regions.R_BF[i],
            (regions.p_BF[i] - p_BBcm) / diameter,
            regions.nhat_TB_B[i],
        )
        for i in range(len(regions.face))
    ]
    rows, outcomes = {}, {}
    for size in (3, 2):
        for members in combinations(range(len(faces)), size):
            alpha = atan(max(regions.mu[list(members)]))
            doubts = Doubts()
            kind, found = evaluate([faces[i] for i in members], alpha, doubts)
            best = best_rows(found, rho / diameter, doubts)
            if kind and len({int(regions.face[i]) for i in members}) < 3:
                kind = "two_faces"
            rows[members] = best[0]
            outcome = Outcome(best[0].reason, kind)
            if not outcome.reason:
                ways = []
                for row in best:
                    points = p_BBcm + diameter * np.array([p for _, p in row.contacts])
                    ways.append((tuple(face.index for face, _ in row.contacts), points))
                chosen, p_BC = ways[0]
                n, mu = regions.nhat_TB_B[list(chosen)], regions.mu[list(chosen)]
                reason = last_steps(p_BC, n, mu, tip_fits, doubts)
                outcome = replace(
                    outcome, reason=reason, p_BC=p_BC, regions=chosen, alternatives=tuple(ways)
                )
            outcome = replace(outcome, doubts=frozenset(doubts))
            outcomes[members] = outcome
    return outcomes | paper_qualities(rows, outcomes, rho / diameter)


def paper_qualities(
    rows: dict[tuple[int, ...], Row], outcomes: dict[tuple[int, ...], Outcome], rho: float
) -> dict[tuple[int, ...], Outcome]:
    """Eq. 5-10: distances and areas are divided by their maxima over all sets with a region P."""
    scored = {members: row for members, row in rows.items() if row.has_P}

    def maximum(name: str) -> float:
        return max((getattr(row, name) for row in scored.values()), default=0.0)

    d1_max, d2_max, Is_max, Ip_max = map(maximum, ("d1", "d2", "Is", "Ip"))
    results = {}
    for members, row in scored.items():
        q = (
            1 - row.d1 / d1_max if d1_max > NOISE * rho else 1.0,
            1 - row.d2 / d2_max if d2_max > NOISE * rho else 1.0,
            (row.Is / Is_max + row.Ip / Ip_max) / 2,
            row.q4,
            row.q5,
        )
        results[members] = replace(outcomes[members], q=q, Q=float(np.prod(q)))
    return results


def best_rows(rows: list[Row], rho: float, doubts: Doubts) -> list[Row]:
    """The rows that got furthest and are tied for the best Q, then for the best q1 q2 q3."""
    furthest = max(PROGRESS.index(row.reason) for row in rows)
    rows = [row for row in rows if PROGRESS.index(row.reason) == furthest]
    Q = [-row.position_quality(rho) * row.q4 * row.q5 for row in rows]
    rows = [rows[i] for i in doubts.ties("Q", Q)]
    return [rows[i] for i in doubts.ties("Q", [-row.position_quality(rho) for row in rows])]


def last_steps(p_BC: Array, n: Array, mu: Array, tip_fits: TipFits | None, doubts: Doubts) -> str:
    """The reason of a set with contacts."""
    longest = max(np.linalg.norm(a - b) for a, b in combinations(p_BC, 2))
    doubled_area = np.linalg.norm(np.cross(p_BC[1] - p_BC[0], p_BC[2] - p_BC[0]))
    if not doubts.exceeds("collinear", doubled_area / longest**2 - 1e-3 + TOL):
        return "collinear"
    if tip_fits is not None and not tip_fits(p_BC, n):
        return "tip_blocked"
    return "certified" if force_closure(p_BC, n, mu) else "not_force_closure"


def force_closure(p_BC: Array, n: Array, mu: Array) -> bool:
    """Whether inscribed pyramids balance with every edge loaded; p_BC must not be collinear."""
    turn = 2 * pi * np.arange(CONE_SIDES) / CONE_SIDES
    p = (p_BC - p_BC.mean(axis=0)) / np.ptp(p_BC, axis=0).max()
    wrenches = []
    for p_i, n_i, mu_i in zip(p, n, mu, strict=True):
        t1, t2 = np.linalg.svd(n_i[None])[2][1:]
        f = n_i + mu_i * (np.outer(np.cos(turn), t1) + np.outer(np.sin(turn), t2))
        wrenches.append(np.hstack([f, np.cross(p_i, f)]))
    W = np.vstack(wrenches).T
    # Weights 1 + slack on top of a common least weight s: W (s 1 + slack) = 0 with total 1.
    A = np.vstack([np.column_stack([W.mean(axis=1), W]), np.ones(1 + W.shape[1])])
    program = linprog(-np.eye(1, A.shape[1])[0], A_eq=A, b_eq=np.eye(1, 7, 6)[0])
    return bool(program.success and program.x[0] > 1e-6)


def evaluate(faces: list[Face], alpha: float, doubts: Doubts) -> tuple[str | None, list[Row]]:
    """Sections 4 to 7 for one set: its kind, once its orientation passed, and its rows."""
    if not spans_space([face.n for face in faces], alpha, doubts):
        return None, [Row("orientation")]
    if len(faces) == 2:
        kind, rows = "two_faces", list(pair(faces[0], faces[1], alpha, doubts))
    elif opposition := parallel_axis([face.n for face in faces], alpha, doubts):
        k, n_bs = opposition
        faces = [faces[k], *faces[:k], *faces[k + 1 :]]
        kind, rows = "three_parallel_faces", list(parallel(faces, n_bs, alpha, doubts))
    else:
        kind, rows = "three_faces", list(nonparallel(faces, alpha, doubts))
    return kind, rows


def spans_space(n: list[Array], alpha: float, doubts: Doubts) -> bool:
    """Proposition 2: Pi_l cuts the cones and the hull of their boundaries there surrounds 0."""
    distinct = [a for i, a in enumerate(n) if all(np.linalg.norm(a - b) > 1e-6 for b in n[:i])]
    if len(distinct) == 1:
        return False
    if len(distinct) == 2:
        sin_phi = np.linalg.norm(distinct[0] + distinct[1]) / 2
        return doubts.exceeds("orientation", np.sin(alpha) - sin_phi)
    N, sin_phi = tips_plane(distinct)
    if not doubts.exceeds("orientation", alpha - asin(sin_phi)):
        return False
    half_angle = acos(np.cos(alpha) / sqrt(1 - sin_phi**2))
    x = unit(distinct[0] - sin_phi * N)
    angles = [atan2(np.cross(N, x) @ a, x @ a) for a in distinct]
    rim = np.sort([(a + b) % (2 * pi) for a in angles for b in (-half_angle, half_angle)])
    gaps = np.diff([*rim, rim[0] + 2 * pi])
    return doubts.exceeds("orientation", pi - gaps.max())


def parallel_axis(n: list[Array], alpha: float, doubts: Doubts) -> tuple[int, Array] | None:
    """Section 4.1: the index k of the opposing face and n_bs, when the set is parallel."""
    away = [-(n[k - 2] @ n[k - 1]) for k in range(3)]
    caps = []
    for k in doubts.ties("closest normals", away):
        axis, radius = least_cap([n[k - 2], n[k - 1], -n[k]])
        caps.append((radius, k, axis))
    radius, k, axis = caps[doubts.ties("least cap", [cap[0] for cap in caps])[0]]
    return (k, axis) if doubts.exceeds("parallel", alpha - radius) else None


def least_cap(points: list[Array]) -> tuple[Array, float]:
    """The spherical cap around three unit vectors, by trying every one that two or three define."""
    candidates = [a + b for a, b in combinations(points, 2)]
    across = np.cross(points[1] - points[0], points[2] - points[0])
    candidates += [across, -across]
    axes = [unit(c) for c in candidates if np.linalg.norm(c) > 1e-12]
    radii = [max(angle(axis, point) for point in points) for axis in axes]
    # A pair's midpoint serves best among equals: the plane of nearly equal tips is ill-defined.
    best = next(i for i, radius in enumerate(radii) if radius <= min(radii) + 1e-15)
    return axes[best], radii[best]

"""Beyond the paper: how near to the best grasp there is, by branch and bound over places.

The faces are cut into triangles, and triples of triangles into smaller ones, the most promising
first, until no triple could hold a grasp much better than the best known one. Whenever that
stops, no contacts on these regions have a greater epsilon than the greatest bound that is left.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from drake_polygrasp.arguments import Progress, no_progress
from drake_polygrasp.arrays import Array, Ints, join_rows
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.optimality.cell_bounds import KEPT, CellTriples, bounded
from drake_polygrasp.search.face_support import contacts_on, face_twists, points_in_faces, points_on
from drake_polygrasp.search.local_improvement import improved
from drake_polygrasp.search.triples import NO_TRIPLES, Triples
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_bound import critical_directions, epsilon_upper_bound

TOLERANCE = 0.01
"""Relative, ours: triples that could hold only a grasp better by less are not cut further."""
BATCH = 256
"""Triples that are halved at a time, ours."""
MOST_CELLS = 600
"""Ours: 4e7 triples, some tens of seconds; of more triangles only the whole is bounded."""
MOST_OPEN = 100_000
"""Triples that are kept at most, ours: half a kilobyte each."""
_WORTH = 1e-3
"""Relative, ours: a grasp is better when it is by more than this."""
_ROUNDS = (1,) * 8
"""Of improvement for every new best grasp, ours."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """What no grasp on the regions exceeds.

    Attributes:
        bound: epsilon of any three contacts is at most this.
        nodes: triples of triangles that were bounded.
        complete: whether none is left that could hold a grasp better by more than `TOLERANCE`.
        best: the best grasp met on the way, one row or none.
    """

    bound: float
    nodes: int
    complete: bool
    best: Triples


def bound_optimum(
    regions: Regions,
    p_BBcm: Array,
    rho: float,
    known: Triples,
    incumbent: float,
    nodes: int,
    roomy: Regions | None = None,
    progress: Progress = no_progress,
) -> Optimum:
    """An upper bound of epsilon over all places of three contacts.

    Args:
        regions: where contacts may be.
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        known: good grasps, best first, whose weakest directions the bounds start from.
        incumbent: epsilon of the best of them; a wrong one cannot make the bound wrong.
        nodes: how many triples of triangles to bound at most.
        roomy: the regions less where fingertips have no room, in which to look for grasps
            better than those known.
        progress: called with the triples bounded so far, and `nodes`.
    """
    roomy = roomy or regions
    best, goal = known.take(np.arange(0)), (1 + TOLERANCE) * incumbent
    cells, left = _roots(regions, p_BBcm, rho, _directions(regions, known, p_BBcm, rho), goal)
    count = 0
    while len(cells.bound) and cells.bound.max() > goal and count + 2 <= nodes:
        progress(count, nodes)
        order = np.argsort(-cells.bound, kind="stable")
        batch = min(BATCH, (nodes - count) // 2)
        halves, estimate = bounded(regions, _halved(cells.take(order[:batch])), goal)
        count += len(estimate)
        middle = int(estimate.argmax())
        if (1 + TOLERANCE) * estimate[middle] > (1 + _WORTH) * goal:
            p_BC = p_BBcm + rho * halves.middle[[middle]]
            better, epsilon = _improved(roomy, halves.region[[middle]], p_BC, p_BBcm, rho)
            if (1 + TOLERANCE) * epsilon > goal:
                best, goal = better, (1 + TOLERANCE) * epsilon
        cells, dropped = _greatest(join_rows(cells.take(order[batch:]), halves), goal)
        left = max(left, dropped)
    bound = max(left, cells.bound.max(initial=0.0))
    return Optimum(float(bound), count, bool(bound <= goal), best)


def _directions(regions: Regions, known: Triples, p_BBcm: Array, rho: float) -> Array:
    """Pure forces and torques, and what known grasps resist least, unit, shape (K, 6)."""
    axes = np.array([d for d in np.ndindex(3, 3, 3) if d != (1, 1, 1)]) - 1.0
    axes = np.concatenate([axes, -regions.nhat_TB_B])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    pure = np.concatenate([np.pad(axes, ((0, 0), (0, 3))), np.pad(axes, ((0, 0), (3, 0)))])
    if not len(known.region):
        return pure
    contacts = contacts_on(regions, known.region, known.p_BC)
    w, _ = critical_directions(*contacts, p_BBcm, rho, rotations=True)
    return np.concatenate([pure, w.reshape(-1, 6)])


def _roots(
    regions: Regions, p_BBcm: Array, rho: float, w: Array, goal: float
) -> tuple[CellTriples, float]:
    """The triples of the faces' triangles that may hold better grasps, and a bound of the rest."""
    triangles = shapely.constrained_delaunay_triangles(regions.polygon_F)
    parts, region = shapely.get_parts(triangles, return_index=True)
    p_FV = shapely.get_coordinates(parts).reshape(-1, 4, 2)[:, :3]
    r_CmV = (points_on(regions, region[:, None], p_FV) - p_BBcm) / rho
    h = face_twists(regions, region, w, p_BBcm, rho).support(p_FV).max(axis=1)
    none = CellTriples(
        np.empty((0, 3), dtype=np.int64),
        np.empty((0, 3, 3, 3)),
        np.empty(0),
        np.empty((0, KEPT, 6)),
    )
    if not len(region):
        return none, 0.0
    if len(region) > MOST_CELLS:
        return none, max(0.0, float(h.max(axis=0).min()))
    cells, left = none, 0.0
    for i in range(len(region)):
        j, k = np.triu_indices(len(region) - i)
        triples = np.column_stack([np.full(len(j), i), i + j, i + k])
        for some in np.array_split(triples, len(triples) // 4096 + 1):
            height = h[some].max(axis=1)
            bound = np.maximum(height.min(axis=1), 0.0)
            passing = np.flatnonzero(bound > goal)
            least = np.argsort(height[passing], axis=1, kind="stable")[:, :KEPT]
            some, bound = some[passing], bound[passing]
            fresh = CellTriples(region[some], r_CmV[some], bound, w[least])
            cells = join_rows(cells, fresh)
        cells, dropped = _greatest(cells, goal)
        left = max(left, dropped)
    return cells, max(left, goal)


def _halved(cells: CellTriples) -> CellTriples:
    """Each triple twice, its longest edge cut in the middle.

    Of two contacts in one cell a, at least one is in its half a_1, and is called the first, or
    both are in a_2: the triples (a_1, a) and (a_2, a_2).
    """
    r, row = cells.r_CmV, np.arange(len(cells.bound))
    edge = np.linalg.norm(np.roll(r, -1, axis=2) - r, axis=-1)
    # Rounded, so that symmetric cells are cut alike.
    longest = np.round(edge.reshape(-1, 9), 9).argmax(axis=1)
    i, tail = longest // 3, longest % 3
    head = (tail + 1) % 3
    middle = (r[row, i, tail] + r[row, i, head]) / 2
    first, second = r.copy(), r.copy()
    first[row, i, head] = middle
    same = (r == r[row, i][:, None]).all(axis=(2, 3))
    same &= cells.region == cells.region[row, i][:, None]
    for cell in range(3):
        twin = row[same[:, cell]]
        second[twin, cell, tail[twin]] = middle[twin]
    return join_rows(
        CellTriples(cells.region, first, cells.bound, cells.w),
        CellTriples(cells.region, second, cells.bound, cells.w),
    )


def _greatest(cells: CellTriples, goal: float) -> tuple[CellTriples, float]:
    """The triples of bounds above the goal, no more than fit, and the greatest of the others."""
    rows = np.flatnonzero(cells.bound > goal)
    rows = rows[np.argsort(-cells.bound[rows], kind="stable")][:MOST_OPEN]
    others = np.delete(cells.bound, rows)
    return cells.take(rows), float(others.max(initial=0.0))


def _improved(
    regions: Regions, region: Ints, p_BC: Array, p_BBcm: Array, rho: float
) -> tuple[Triples, float]:
    """A grasp, one row, moved while its epsilon rises; none where a contact is off its region."""
    p_FC = points_in_faces(regions, region, p_BC)
    if not shapely.intersects_xy(regions.polygon_F[region], p_FC[..., 0], p_FC[..., 1]).all():
        return NO_TRIPLES, 0.0
    p_BC, _ = improved(regions, region, p_BC, p_BBcm, rho, _ROUNDS)
    contacts = contacts_on(regions, region, p_BC)
    if not force_closure(*contacts).all():
        return NO_TRIPLES, 0.0
    return Triples(region, p_BC), float(epsilon_upper_bound(*contacts, p_BBcm, rho)[0])

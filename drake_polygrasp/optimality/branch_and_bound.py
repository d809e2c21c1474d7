"""Beyond the paper: an upper bound of epsilon over all contacts, by branch and bound.

Faces are cut into triangles, and triples of triangles are halved, the most promising first, until
no triple can contain a grasp much better than the best known one. Whenever this stops, no contacts
on the regions have an epsilon above the greatest bound that is left.
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
"""Our choice, relative: triples that cannot improve epsilon by more are not halved further."""
BATCH = 256
"""Our choice: number of triples halved at a time."""
MOST_CELLS = 600
"""Our choice: so many triangles make 4e7 triples and take some tens of seconds; of more triangles
only all together are bounded."""
MOST_OPEN = 100_000
"""Our choice: greatest number of triples kept, half a kilobyte each."""
_WORTH = 1e-3
"""Our choice, relative: a grasp counts as better when its epsilon is greater by more than this."""
_ROUNDS = (1,) * 8
"""Our choice: rounds of improvement for every new best grasp."""


@dataclass(frozen=True, eq=False)
class Optimum:
    """An upper bound of epsilon over all grasps on the regions.

    Attributes:
        bound: epsilon of any three contacts is at most this.
        nodes: number of triples of triangles bounded.
        complete: whether no triple is left that could improve epsilon by more than `TOLERANCE`.
        best: the best grasp found on the way, one row or none.
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
    """Bounds epsilon from above over all places of three contacts on the regions.

    Args:
        regions: where contacts may be.
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        known: good grasps, best first, whose weakest directions the bounds start from.
        incumbent: epsilon of the best of them; a wrong value cannot make the bound wrong.
        nodes: greatest number of triples of triangles to bound.
        roomy: the regions without the parts where fingertips have no room, in which better grasps
            than those known are looked for; None for all of the regions.
        progress: called with the number of triples bounded so far, and `nodes`.

    Returns:
        The bound, and the best grasp found on the way.
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
    """Returns pure forces, pure torques and what known grasps resist least, unit, shape (K, 6)."""
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
    """Lists the triples of the faces' triangles that may hold better grasps; bounds the rest."""
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
    """Halves each triple of cells at the middle of its longest edge.

    Where two contacts share a cell a, at least one is in its half a_1, and is called the first, or
    both are in a_2: then the halves are the triples (a_1, a) and (a_2, a_2).
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
    """Keeps triples with a bound above the goal, as many as fit, and bounds the others."""
    rows = np.flatnonzero(cells.bound > goal)
    rows = rows[np.argsort(-cells.bound[rows], kind="stable")][:MOST_OPEN]
    others = np.delete(cells.bound, rows)
    return cells.take(rows), float(others.max(initial=0.0))


def _improved(
    regions: Regions, region: Ints, p_BC: Array, p_BBcm: Array, rho: float
) -> tuple[Triples, float]:
    """Moves the contacts of one grasp to raise epsilon; none where one is off its region."""
    p_FC = points_in_faces(regions, region, p_BC)
    if not shapely.intersects_xy(regions.polygon_F[region], p_FC[..., 0], p_FC[..., 1]).all():
        return NO_TRIPLES, 0.0
    p_BC, _ = improved(regions, region, p_BC, p_BBcm, rho, _ROUNDS)
    contacts = contacts_on(regions, region, p_BC)
    if not force_closure(*contacts).all():
        return NO_TRIPLES, 0.0
    return Triples(region, p_BC), float(epsilon_upper_bound(*contacts, p_BBcm, rho)[0])

"""Beyond the paper: the best triples of sample points, however many triples there are.

For directions w that some grasps resist least, a triple of points is no better than
min_w max_i h_i(w) (see face_support.py); set_cover.py finds the triples for which that is greatest.
Directions come from grasps known before, then from the best triples themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.epsilon_bound import COARSE_TURNS, critical_directions
from drake_polygrasp.geometry.polyhedron import Regions
from drake_polygrasp.planning.effort import FULL, Effort
from drake_polygrasp.planning.face_support import points_on
from drake_polygrasp.planning.set_cover import Singles, cover
from drake_polygrasp.wrench import force_closure, frame_wrenches

MANY_POINTS = 160
"""Ours: of fewer points the first pass would see too few."""
MOST_PASSES = 5
"""Ours, where none of the triples holds yet, as on flat objects that lie on a table."""


@dataclass(frozen=True, eq=False)
class Triples:
    """Three contacts a row."""

    region: Ints
    """Shape (M, 3)."""
    p_BC: Array
    """[m], shape (M, 3, 3)."""

    def take(self, rows: Ints) -> Triples:
        """The same for some of the rows."""
        return Triples(self.region[rows], self.p_BC[rows])


def joined(first: Triples, second: Triples) -> Triples:
    """All rows of both."""
    return Triples(
        np.concatenate([first.region, second.region]), np.concatenate([first.p_BC, second.p_BC])
    )


def best_triples(
    regions: Regions,
    points: tuple[Ints, Array],
    known: Triples,
    p_BBcm: Array,
    rho: float,
    effort: Effort = FULL,
) -> Triples:
    """The triples of sample points that the weakest directions of grasps bound least.

    Args:
        regions: where contacts may be; polygons may be empty or have several parts.
        points: where they are tried, as of `sample_points`.
        known: some grasps that hold, best first; where there is none, random ones are drawn.
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        effort: how long is searched.

    Returns:
        Triples that are force closure, at most as many as points or `effort.kept` from each pass,
        those of the last one first.
    """
    region, p_FC = points
    if len(region) < 3:
        return known.take(np.arange(0))
    p_BC = points_on(regions, region, p_FC)
    cones = frame_wrenches(_frames(regions)[region], (p_BC - p_BBcm) / rho, regions.mu[region])
    if not len(known.region):
        known = _drawn(regions, region, p_BC, effort.drawn)
    strides = effort.strides[len(region) < MANY_POINTS :]
    w, found = np.empty((0, 6)), known.take(np.arange(0))
    sources = known.take(np.arange(min(effort.sources, len(known.region))))
    for number in range(MOST_PASSES):
        if number >= len(strides) and len(found.region):
            break
        w = np.concatenate([w, _weakest(regions, sources, p_BBcm, rho)])
        some = np.arange(0, len(region), strides[min(number, len(strides) - 1)])
        rows = some[cover(_support(cones[some], w), max(effort.kept, len(some)))]
        triples = Triples(region[rows], p_BC[rows])
        holding = _holding(regions, triples)
        holds, slips = (
            triples.take(holding),
            triples.take(np.setdiff1d(np.arange(len(rows)), holding)),
        )
        found = joined(holds, found)
        sources = joined(
            _first_of_sets(holds, effort.sources), _first_of_sets(slips, effort.sources)
        )
    return found


def _frames(regions: Regions) -> Array:
    """Inward normal and two tangents of each region as rows, shape (R, 3, 3)."""
    x, y, z = np.moveaxis(regions.R_BF, 2, 0)
    return np.stack([-z, x, y], axis=1)


def _support(cones: Array, w: Array) -> Singles:
    """h_i(w) of the contacts of cones (N, 3, 6) in directions (K, 6), shape (N, K).

    In single precision, for it only guides the search and there is much of it.
    """
    n, t_1, t_2 = cones.transpose(1, 0, 2).astype(np.float32) @ w.T.astype(np.float32)
    h: Singles = n + np.sqrt(t_1 * t_1 + t_2 * t_2)
    return h


def _weakest(regions: Regions, triples: Triples, p_BBcm: Array, rho: float) -> Array:
    nhat, mu = regions.nhat_TB_B[triples.region], regions.mu[triples.region]
    contacts = triples.p_BC, nhat, mu
    w, _ = critical_directions(*contacts, p_BBcm, rho, num_turns=COARSE_TURNS, rotations=True)
    return w.reshape(-1, 6)


def _holding(regions: Regions, triples: Triples) -> Ints:
    nhat, mu = regions.nhat_TB_B[triples.region], regions.mu[triples.region]
    return np.flatnonzero(force_closure(triples.p_BC, nhat, mu))


def _drawn(regions: Regions, region: Ints, p_BC: Array, num: int) -> Triples:
    """Random triples, those that hold first."""
    rows = np.random.default_rng(0).integers(0, len(region), (num, 3))
    triples = Triples(region[rows], p_BC[rows])
    holds = _holding(regions, triples)
    slips = np.setdiff1d(np.arange(num), holds)
    return joined(triples.take(holds), triples.take(slips))


def first_of_each_set(region: Ints) -> Ints:
    """The first row of each set of regions, ascending, (M, 3) to (K,)."""
    _, first = np.unique(set_numbers(region), return_index=True)
    return np.sort(first)


def set_numbers(region: Ints) -> Ints:
    """A number for each row's set of regions, equal for equal sets, (M, 3) to (M,)."""
    return set_keys(sets_of(region), int(region.max(initial=0)))


def set_keys(sets: Ints, greatest: int) -> Ints:
    """A number for each set of regions -1 to `greatest`, in the sets' order, (M, 3) to (M,)."""
    keys: Ints = (sets + 1) @ (greatest + 2) ** np.arange(3)[::-1]
    return keys


def sets_of(region: Ints) -> Ints:
    """The regions of each row once, ascending; -1 for a pair's third, (M, 3) to (M, 3)."""
    sets = np.sort(region, axis=1)
    low, high = sets[:, 0] == sets[:, 1], sets[:, 1] == sets[:, 2]
    sets[low, 1] = sets[low, 2]
    sets[low | high, 2] = -1
    return sets


def _first_of_sets(triples: Triples, num: int) -> Triples:
    return triples.take(first_of_each_set(triples.region)[:num])

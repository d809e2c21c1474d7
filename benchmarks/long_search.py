"""The best grasp known: a long random search, then contacts moved over the surface while it pays.

Far too slow to plan with. It says what fraction of the possible a fast method reaches, and errs on
the low side: the true optimum may be better.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.peers import (
    Surface,
    Triples,
    best_of,
    closed,
    draw_points,
    epsilon_of,
    random_triples,
    triples_at,
    upper_bound,
)
from drake_polygrasp.arrays import Array, Ints, join_rows
from drake_polygrasp.geometry.regions import nearest_points
from drake_polygrasp.grasp import GraspObject

NUM_TRIPLES = 50_000
_POOL = 10_000
"""Points that contacts may jump to."""
_JUMP = 0.3
"""Chance that a contact may change faces, and that it moves within its own."""


class Effort(NamedTuple):
    """How contacts are moved: the best `starts` rows, `tries` moves each a round."""

    starts: int
    tries: int
    rounds: int
    longest: float
    """Moves of the first round, over the diameter; they shrink to a thousandth."""


EFFORTS = (Effort(24, 16, 25, 0.3), Effort(6, 48, 40, 0.1))
"""Many starts, then the best of their ends."""


def best_known(
    object_: GraspObject,
    surface: Surface,
    tip_radius: float,
    rng: np.random.Generator,
    others: Triples,
    num: int = NUM_TRIPLES,
    efforts: tuple[Effort, ...] = EFFORTS,
) -> tuple[Triples, float]:
    """The best triple found and its epsilon, never less than of `others`, which must hold."""
    drawn = random_triples(surface, num, rng)
    drawn = drawn.take(closed(object_, drawn, tip_radius))
    drawn = drawn.take(_highest(upper_bound(object_, drawn), efforts[0].starts))
    search = _Search(object_, surface, tip_radius, *_pool(surface, rng), rng)
    found = join_rows(others, drawn)
    for effort in efforts:
        # Measured, for moves that follow a bound may end where it is wrong.
        epsilon = np.array(
            [epsilon_of(object_, found.take(np.array([k]))) for k in range(len(found.mu))]
        )
        starts = found.take(_highest(epsilon, effort.starts))
        found = join_rows(found, search.improved(starts, effort))
    return best_of(object_, found)


def _highest(values: Array, num: int) -> Ints:
    return np.argsort(-values, kind="stable")[:num]


def _pool(surface: Surface, rng: np.random.Generator) -> tuple[cKDTree, Ints]:
    points, region = draw_points(surface, (_POOL,), rng)
    return cKDTree(points), region


@dataclass(frozen=True, eq=False)
class _Search:
    """Contacts moved at random in ever smaller steps; a move stays where the bound rises."""

    object_: GraspObject
    surface: Surface
    tip_radius: float
    pool: cKDTree
    pool_region: Ints
    rng: np.random.Generator

    def improved(self, starts: Triples, effort: Effort) -> Triples:
        best, value = starts, upper_bound(self.object_, starts)
        L = self.object_.polyhedron.diameter
        owner = np.repeat(np.arange(len(value)), effort.tries)
        for step in L * np.geomspace(effort.longest, 1e-3, effort.rounds):
            tries = self._moved(best.take(owner), step)
            bounds = upper_bound(self.object_, tries)
            rows = np.flatnonzero(bounds > value[owner])
            rows = rows[closed(self.object_, tries.take(rows), self.tip_radius)]
            bound = bounds[rows]
            order = np.lexsort((-bound, owner[rows]))
            winner, first = np.unique(owner[rows[order]], return_index=True)
            chosen = order[first]
            better = bound[chosen] > value[winner]
            winner, chosen = winner[better], chosen[better]
            value[winner] = bound[chosen]
            source = np.arange(len(value))
            source[winner] = len(value) + rows[chosen]
            best = join_rows(best, tries).take(source)
        return best

    def _moved(self, triples: Triples, step: float) -> Triples:
        """Some of each row's contacts moved within their regions or to the pool."""
        rng = self.rng
        target = triples.p_BC + step * rng.normal(size=triples.p_BC.shape)
        moves = rng.random(triples.region.shape)
        p_BC, region = triples.p_BC.copy(), triples.region.copy()
        jump = moves < _JUMP
        _, index = self.pool.query(target[jump])
        p_BC[jump], region[jump] = self.pool.data[index], self.pool_region[index]
        slide = (moves >= _JUMP) & (moves < 2 * _JUMP)
        p_BC[slide] = self._nearest(target[slide], region[slide])
        return triples_at(self.surface.regions, p_BC, region)

    def _nearest(self, p: Array, region: Ints) -> Array:
        """The points of regions nearest to points in their planes."""
        regions = self.surface.regions
        R_BF, p_BF = regions.R_BF[region], regions.p_BF[region]
        xy = np.einsum("mij,mi->mj", R_BF[:, :, :2], p - p_BF)
        nearest = nearest_points(regions.polygon_F[region], xy)
        moved: Array = p_BF + np.einsum("mij,mj->mi", R_BF[:, :, :2], nearest)
        return moved

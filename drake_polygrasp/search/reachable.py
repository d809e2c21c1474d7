"""Beyond the paper: triples of sample points that a hand reaches.

The best triples of an object are often wider than a hand; where they are, all of the best ones are.
So triples within the hand's reach are drawn at random, and the best of these kept.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from math import comb

import numpy as np

from drake_polygrasp.arrays import Array, Batch, Bools, Ints
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.search.face_support import points_on
from drake_polygrasp.search.reach import Reach, TipTriple, tip_distances
from drake_polygrasp.search.selection import best_first
from drake_polygrasp.search.triples import NO_TRIPLES, Triples
from drake_polygrasp.vectors import dot
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_estimate import epsilon_estimates

NUM_DRAWN = 150_000
"""Our choice: triples drawn at random; fewer points have all their triples tried."""
KEPT_TRIPLES = 1000
"""Our choice: triples kept; three times as many covered the same objects."""
_MOST_ESTIMATED = 60_000
"""Our choice: estimates of epsilon at most."""


@dataclass(frozen=True, eq=False)
class TipPlaces(Batch):
    """Points where a hand's tips may touch, one row each.

    Attributes:
        region: region of each point, shape (N,).
        p_BC: the points [m], shape (N, 3).
        p_BT: centres of the tips that touch there [m], shape (N, 3).
        nhat_TB_B: inward unit normals, shape (N, 3).
        mu: friction coefficients, shape (N,).
    """

    region: Ints
    p_BC: Array
    p_BT: Array
    nhat_TB_B: Array
    mu: Array


def touching_places(regions: Regions, points: tuple[Ints, Array], tip_radius: float) -> TipPlaces:
    """Returns where the tips of a hand are when they touch sample points.

    Args:
        regions: where contacts may be.
        points: region of each sample point, shape (N,), and its coordinates in the face's frame
            [m], shape (N, 2).
        tip_radius: radius of the tips [m].
    """
    region, p_FC = points
    p_BC, nhat = points_on(regions, region, p_FC), regions.nhat_TB_B[region]
    return TipPlaces(region, p_BC, p_BC - tip_radius * nhat, nhat, regions.mu[region])


def reachable_triples(
    places: TipPlaces,
    reach: Reach,
    fingers: Sequence[TipTriple],
    p_BBcm: Array,
    rho: float,
    *,
    seed: int = 0,
    num_drawn: int = NUM_DRAWN,
    kept: int = KEPT_TRIPLES,
) -> Triples:
    """Finds force-closure triples whose tips are as far apart as the hand's can be.

    Args:
        places: where tips may touch.
        reach: what the hand reaches.
        fingers: the triples of tips that may grasp.
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        seed: seed of the random numbers.
        num_drawn: number of triples that are drawn.
        kept: greatest number of triples to return.

    Returns:
        The triples of greatest estimated epsilon, best first.
    """
    if len(places.region) < 3 or not len(reach.q):
        return NO_TRIPLES
    rows = _draw(len(places.region), num_drawn, seed)
    rows = rows[within_span(places.p_BT[rows], tip_distances(reach, fingers))]
    contacts = places.p_BC[rows], places.nhat_TB_B[rows], places.mu[rows]
    rows = rows[force_closure(*contacts)]
    rows = rows[:: 1 + len(rows) // _MOST_ESTIMATED]
    if not len(rows):
        return NO_TRIPLES
    contacts = places.p_BC[rows], places.nhat_TB_B[rows], places.mu[rows]
    rows = rows[best_first(epsilon_estimates(*contacts, p_BBcm, rho))[:kept]]
    return Triples(places.region[rows], places.p_BC[rows])


def within_span(p_BT: Array, span: Array) -> Bools:
    """Returns whether the tips of each triple are neither too near to each other nor too far apart.

    Args:
        p_BT: centres of the tips [m], shape (M, 3, 3).
        span: least and greatest distance of two tips [m], shape (2,).

    Returns:
        Shape (M,).
    """
    side = p_BT[:, [1, 2, 0]] - p_BT
    square = dot(side, side)
    inside: Bools = ((square >= span[0] ** 2) & (square <= span[1] ** 2)).all(axis=1)
    return inside


def _draw(num_points: int, num: int, seed: int) -> Ints:
    """Returns triples of points at random, each once; all where there are no more than `num`."""
    if comb(num_points, 3) <= num:
        return np.array(list(combinations(range(num_points), 3)), dtype=np.int64).reshape(-1, 3)
    rng = np.random.default_rng(seed)
    drawn = np.sort(rng.integers(num_points, size=(num, 3)), axis=1)
    drawn = drawn[(np.diff(drawn, axis=1) > 0).all(axis=1)]
    _, first = np.unique((drawn * num_points ** np.arange(3)).sum(axis=1), return_index=True)
    return drawn[np.sort(first)]

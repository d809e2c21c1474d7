"""Beyond the paper: what `method="enriched"` does more than the text, each step by a switch.

The text fixes one plane Pi_p and one triangle for each set of faces; its grasps reach about half
of the epsilon that is possible. Here its constructions are starts: contacts spread wider on their
segments, triples of sample points beside them, and all moved while epsilon rises.
"""

from __future__ import annotations

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.geometry.face_sets import rank_within_set, set_numbers
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.search.effort import FULL, Effort
from drake_polygrasp.search.face_support import contacts_on, points_in_faces
from drake_polygrasp.search.local_improvement import improved
from drake_polygrasp.search.triples import Triples
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_estimate import epsilon_estimates

PLACES = 4
"""Triples that are improved on one set of regions at most, ours: the next best are often the same
place."""
EQUAL = 1e-5
"""Relative, ours: estimates nearer than this, which have six digits, are a tie."""


def improved_triples(
    regions: Regions, starts: Triples, p_BBcm: Array, rho: float, effort: Effort = FULL
) -> Triples:
    """The best of the triples, improved: all a little, those that lead then to the end.

    A few may not hold any more.

    Args:
        regions: where contacts may be.
        starts: any number of triples, all `usable`.
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        effort: how many are improved, and how long.
    """
    estimate = estimates(regions, starts, p_BBcm, rho)
    rows = best_places(starts.region, estimate, effort.starts, PLACES)
    region, p_BC = starts.region[rows], starts.p_BC[rows]
    p_BC, _ = improved(regions, region, p_BC, p_BBcm, rho, effort.rounds)
    return Triples(region, p_BC)


def usable(regions: Regions, triples: Triples) -> Ints:
    """Rows that are force closure with all contacts in their regions."""
    rows = np.flatnonzero(_inside(regions, triples))
    triples = triples.take(rows)
    return rows[force_closure(*contacts_on(regions, triples.region, triples.p_BC))]


def estimates(regions: Regions, triples: Triples, p_BBcm: Array, rho: float) -> Array:
    """Of epsilon, shape (M,)."""
    contacts = contacts_on(regions, triples.region, triples.p_BC)
    return epsilon_estimates(*contacts, p_BBcm, rho)


def best_places(region: Ints, estimate: Array, num: int, places: int) -> Ints:
    """Rows of greatest estimate, (M,), some on each set of regions, (M, 3).

    Returns:
        Up to `num` rows, best first, at most `places` of them on one set.
    """
    rows = best_first(estimate)
    return rows[rank_within_set(set_numbers(region[rows])) < places][:num]


def best_first(value: Array) -> Ints:
    """Rows by falling value; of ties the first comes first."""
    return np.argsort(-rounded_for_ties(value), kind="stable")


def rounded_for_ties(value: Array) -> Array:
    """The values, with those that are a tie made equal."""
    scale = EQUAL * max(value.max(initial=0.0), np.finfo(float).tiny)
    rounded: Array = scale * np.round(value / scale)
    return rounded


def _inside(regions: Regions, triples: Triples) -> Bools:
    p_FC = points_in_faces(regions, triples.region, triples.p_BC)
    slack = 1e-9 * np.sqrt(regions.area.max(initial=0.0))
    near = shapely.dwithin(regions.polygon_F[triples.region], shapely.points(p_FC), slack)
    inside: Bools = np.logical_and.reduce(near, axis=1)
    return inside

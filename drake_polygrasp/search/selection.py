"""Beyond the paper: which triples are improved, and in what order triples are preferred.

The text fixes one plane Pi_p and one triangle for each set of faces; its grasps reach about half of
the epsilon that is possible. Here they are starting points, as are wider contacts on the same
segments and triples of sample points; all are moved while epsilon rises.
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
"""Our choice: greatest number of triples improved on one set of regions; the next best are often at
nearly the same place."""
EQUAL = 1e-5
"""Our choice, relative: estimates, which have six digits, are a tie where they differ by less."""


def improved_triples(
    regions: Regions, starts: Triples, p_BBcm: Array, rho: float, effort: Effort = FULL
) -> Triples:
    """Improves the best triples, in fewer and fewer rounds the less promising they are.

    A few results may not be force closure any more.

    Args:
        regions: where contacts may be.
        starts: any number of triples, all `usable`.
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        effort: how many are improved, and how long.

    Returns:
        The improved triples.
    """
    estimate = estimates(regions, starts, p_BBcm, rho)
    rows = best_places(starts.region, estimate, effort.starts, PLACES)
    region, p_BC = starts.region[rows], starts.p_BC[rows]
    p_BC, _ = improved(regions, region, p_BC, p_BBcm, rho, effort.rounds)
    return Triples(region, p_BC)


def usable(regions: Regions, triples: Triples) -> Ints:
    """Finds the triples that are force closure with all contacts in their regions.

    Args:
        regions: where contacts may be.
        triples: M triples.

    Returns:
        Their rows, ascending.
    """
    rows = np.flatnonzero(_inside(regions, triples))
    triples = triples.take(rows)
    return rows[force_closure(*contacts_on(regions, triples.region, triples.p_BC))]


def estimates(regions: Regions, triples: Triples, p_BBcm: Array, rho: float) -> Array:
    """Estimates epsilon of triples.

    Args:
        regions: where the contacts are.
        triples: M triples.
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].

    Returns:
        The estimates, shape (M,).
    """
    contacts = contacts_on(regions, triples.region, triples.p_BC)
    return epsilon_estimates(*contacts, p_BBcm, rho)


def best_places(region: Ints, estimate: Array, num: int, places: int) -> Ints:
    """Selects the triples of greatest estimate, not too many on one set of regions.

    Args:
        region: regions of each triple, shape (M, 3).
        estimate: estimate of each triple's epsilon, shape (M,).
        num: greatest number of triples in all.
        places: greatest number on one set.

    Returns:
        Rows of the triples, best first.
    """
    rows = best_first(estimate)
    return rows[rank_within_set(set_numbers(region[rows])) < places][:num]


def best_first(value: Array) -> Ints:
    """Orders rows by falling value; of a tie the first row comes first.

    Args:
        value: values, shape (M,).

    Returns:
        Rows, shape (M,).
    """
    return np.argsort(-rounded_for_ties(value), kind="stable")


def rounded_for_ties(value: Array) -> Array:
    """Rounds values so that those which are a tie become equal.

    Args:
        value: values, shape (M,).

    Returns:
        Rounded values, shape (M,).
    """
    scale = EQUAL * max(value.max(initial=0.0), np.finfo(float).tiny)
    rounded: Array = scale * np.round(value / scale)
    return rounded


def _inside(regions: Regions, triples: Triples) -> Bools:
    p_FC = points_in_faces(regions, triples.region, triples.p_BC)
    slack = 1e-9 * np.sqrt(regions.area.max(initial=0.0))
    near = shapely.dwithin(regions.polygon_F[triples.region], shapely.points(p_FC), slack)
    inside: Bools = np.logical_and.reduce(near, axis=1)
    return inside

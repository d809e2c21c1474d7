"""Beyond the paper: triples of sample points on each of many sets of faces, good or not.

triples.py finds the best triples, most of them on few sets. Where the question is which sets of
faces have any grasp, all triples of a few points are tested.
"""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array, Ints, join_rows
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.search.face_support import contacts_on, points_on
from drake_polygrasp.search.selection import best_places, estimates
from drake_polygrasp.search.set_bounds import Opposing
from drake_polygrasp.search.triples import NO_TRIPLES, Triples
from drake_polygrasp.wrenches.contacts import force_closure

_AT_ONCE = 100_000
"""Triples tested together, some tens of megabytes."""


def triples_on_each_set(
    regions: Regions,
    points: tuple[Ints, Array],
    p_BBcm: Array,
    rho: float,
    places: int,
    opposing: Opposing,
) -> Triples:
    """Finds triples of points that are force closure, the best on each set of regions.

    Args:
        regions: where contacts may be.
        points: their regions, shape (N,), and coordinates in the faces' frames [m], shape (N, 2).
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        places: greatest number of triples on one set.
        opposing: tests whether sets of regions oppose each other by orientation.

    Returns:
        The triples, those of greatest estimated epsilon first.
    """
    region, p_FC = points
    if len(region) < 3:
        return NO_TRIPLES
    p_BC, found = points_on(regions, region, p_FC), NO_TRIPLES
    j, k = np.triu_indices(len(region), 1)
    # Pairs j < k after i, for some i at a time.
    for first in range(0, len(region), max(1, _AT_ONCE // len(j))):
        i = np.arange(first, min(first + max(1, _AT_ONCE // len(j)), len(region)))
        row, pair = np.nonzero(j > i[:, None])
        rows = np.column_stack([i[row], j[pair], k[pair]])
        nhat, mu = regions.nhat_TB_B[region[rows]], regions.mu[region[rows]]
        rows = rows[opposing(nhat, mu)]
        triples = Triples(region[rows], p_BC[rows])
        holds = force_closure(*contacts_on(regions, triples.region, triples.p_BC))
        found = join_rows(found, triples.take(holds))
    estimate = estimates(regions, found, p_BBcm, rho)
    return found.take(best_places(found.region, estimate, len(estimate), places))

"""Beyond the paper: what `method="enriched"` does more than the text, each step by a switch.

The text fixes one plane Pi_p and one triangle for each set of faces; its grasps reach about half
of the epsilon that is possible. Here its constructions are starts: contacts spread wider on their
segments, triples of sample points beside them, and all moved while epsilon rises.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.epsilon_bound import COARSE_TURNS, epsilon_upper_bound
from drake_polygrasp.geometry.polyhedron import Regions
from drake_polygrasp.planning.effort import FULL, Effort
from drake_polygrasp.planning.face_support import points_in_faces
from drake_polygrasp.planning.improvement import improved
from drake_polygrasp.planning.search import Triples, set_numbers
from drake_polygrasp.wrench import force_closure

SPREADS = (0.5, 0.9)
"""Places of P_2 and P_3 on their halves of the segments, 1 at the far end.

The text's 0.5 defeats its own aim of a large triangle; on most objects 0.9 holds better.
"""
PLACES = 4
"""Triples that are improved on one set of regions at most, ours: the next best are often the same
place."""
EQUAL_BOUND = 1e-9
"""Relative, ours: bounds nearer than this are a tie."""


@dataclass(frozen=True)
class Steps:
    """Which steps beyond the paper `method="enriched"` takes."""

    spread: bool = True
    """`SPREADS`: wider triangles for parallel sets and pairs."""
    search: bool = True
    """search.py: triples of sample points, of any faces."""
    improve: bool = True
    """improvement.py: contacts move while epsilon rises."""


def improved_triples(
    regions: Regions, starts: Triples, p_BBcm: Array, rho: float, effort: Effort = FULL
) -> Triples:
    """The best of the triples, improved: all a little, those that lead then to the end.

    Args:
        regions: where contacts may be.
        starts: any number of triples, all `usable`.
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        effort: how many are improved, and how long.
    """
    bound = bounds(regions, starts, p_BBcm, rho)
    starts = starts.take(best_places(starts.region, bound, effort.starts, PLACES))
    if not len(starts.region):
        return starts
    p_BC, _ = improved(
        regions, starts.region, starts.p_BC, p_BBcm, rho, effort.rounds, effort.finalists
    )
    return Triples(starts.region, p_BC)


def usable(regions: Regions, triples: Triples) -> Ints:
    """Rows that are force closure with all contacts in their regions."""
    rows = np.flatnonzero(_inside(regions, triples))
    region = triples.region[rows]
    holds = force_closure(triples.p_BC[rows], regions.nhat_TB_B[region], regions.mu[region])
    return rows[holds]


def bounds(regions: Regions, triples: Triples, p_BBcm: Array, rho: float) -> Array:
    """Bounds of epsilon, coarse for there are many, shape (M,)."""
    contacts = triples.p_BC, regions.nhat_TB_B[triples.region], regions.mu[triples.region]
    return epsilon_upper_bound(*contacts, p_BBcm, rho, COARSE_TURNS)


def best_places(region: Ints, bound: Array, num: int, places: int) -> Ints:
    """Rows of greatest bound, (M,), some on each set of regions, (M, 3).

    Returns:
        Up to `num` rows, best first, at most `places` of them on one set.
    """
    rows = best_first(bound)
    return rows[place_in_set(set_numbers(region[rows])) < places][:num]


def best_first(value: Array) -> Ints:
    """Rows by falling value; of ties the first comes first."""
    scale = EQUAL_BOUND * max(value.max(initial=0.0), np.finfo(float).tiny)
    return np.argsort(-np.round(value / scale), kind="stable")


def place_in_set(number: Ints) -> Ints:
    """How many rows of the same set come before each, (M,) to (M,)."""
    order = np.argsort(number, kind="stable")
    ordered = number[order]
    start = np.searchsorted(ordered, ordered)
    place = np.empty_like(number)
    place[order] = np.arange(len(number)) - start
    return place


def _inside(regions: Regions, triples: Triples) -> Bools:
    p_FC = points_in_faces(regions, triples.region, triples.p_BC)
    slack = 1e-9 * np.sqrt(regions.area.max(initial=0.0))
    near = shapely.dwithin(regions.polygon_F[triples.region], shapely.points(p_FC), slack)
    inside: Bools = np.logical_and.reduce(near, axis=1)
    return inside

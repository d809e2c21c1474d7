"""Beyond the paper: bounds epsilon over all contacts on a set of faces, to select promising sets.

h_i is convex in the place of contact i (see face_support.py), so on a region it is greatest at a
corner. No three contacts on a set of regions have an epsilon above min_w max_r H_r(w), where r runs
over the regions of the set and H_r(w) is the greatest h_i(w) at the corners of r. set_cover.py
finds the triples of regions with the greatest bound, as it does for triples of points.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.geometry.face_sets import pairs
from drake_polygrasp.geometry.regions import Regions, boundary
from drake_polygrasp.search.set_cover import Singles, best_covering_triples
from drake_polygrasp.search.triples import (
    Triples,
    cone_support,
    cones_at,
    spread_directions,
    weakest_directions,
)

Opposing: TypeAlias = Callable[[Array, Array], Bools]
"""Tests whether the faces of pairs or triples oppose each other, from their normals and friction;
the pipeline passes in the paper's test."""

_ROUNDING = 1e-5
"""Our choice: bounds are computed in single precision, and are a tie where they differ by less."""
_AT_ONCE = 4096
"""Pairs whose supports are compared at once, some tens of megabytes."""


def promising_sets(
    regions: Regions,
    known: Triples,
    p_BBcm: Array,
    rho: float,
    *,
    above: float,
    most: int,
    opposing: Opposing,
) -> Ints:
    """Finds the sets of opposing regions on which grasps of the greatest epsilon may be.

    Args:
        regions: the eroded faces A_i.
        known: some good grasps; bounds also use the directions that these resist least.
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        above: sets that cannot have a greater epsilon are left out; negative for none.
        most: greatest number of triples of regions examined, and of sets returned.
        opposing: tests whether sets of regions oppose each other by orientation.

    Returns:
        Regions of each set, ascending, -1 for a pair's third, greatest bound first, shape (M, 3).
    """
    H = region_support(regions, known, p_BBcm, rho)
    triples = best_covering_triples(H, most)
    triples = triples[opposing(regions.nhat_TB_B[triples], regions.mu[triples])]
    couples = pairs(len(regions.face))
    couples = couples[opposing(regions.nhat_TB_B[couples], regions.mu[couples])]
    sets = np.concatenate([triples, np.pad(couples, ((0, 0), (0, 1)), constant_values=-1)])
    bound = np.round(np.concatenate([_bounds(H, triples), _bounds(H, couples)]) / _ROUNDING)
    order = np.lexsort((*sets.T[::-1], -bound))
    order = order[bound[order] > above / _ROUNDING - 1]
    best: Ints = sets[order[:most]]
    return best


def region_support(regions: Regions, known: Triples, p_BBcm: Array, rho: float) -> Singles:
    """Computes the greatest h(w) of a contact on each region, in many directions w.

    Args:
        regions: R regions.
        known: grasps whose weakest directions are among the w.
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].

    Returns:
        h(w), shape (R, K).
    """
    edges = boundary(regions)
    region = np.repeat(np.arange(len(regions.face)), np.diff(edges.offsets))
    cones = cones_at(regions, region, edges.tail, p_BBcm, rho)
    w = spread_directions(cones)
    if len(known.region):
        w = np.concatenate([w, weakest_directions(regions, known, p_BBcm, rho)])
    greatest: Singles = np.maximum.reduceat(cone_support(cones, w), edges.offsets[:-1], axis=0)
    return greatest


def _bounds(H: Singles, sets: Ints) -> Array:
    """min_w max_r H_r(w) of sets of two or three regions, (M, 2) or (M, 3) to (M,)."""
    parts = np.array_split(sets, len(sets) // _AT_ONCE + 1)
    return np.concatenate([H[part].max(axis=1).min(axis=1) for part in parts]).astype(float)

"""Beyond the paper: the best triples of sample points, found without examining all.

For any directions w, a triple resists no more than min_w max_i h_i(w) (see face_support.py);
set_cover.py finds the triples of greatest such bound. Some hundred directions spread over all
wrenches separate good triples from bad ones; the directions that the best triples resist least,
added in later passes, separate the best ones from each other.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from drake_polygrasp.arrays import Array, Batch, Ints, frozen, join_rows
from drake_polygrasp.geometry.face_sets import first_of_each_set
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.search.effort import FULL, Effort
from drake_polygrasp.search.face_support import contacts_on, points_on
from drake_polygrasp.search.set_cover import Singles, best_covering_triples
from drake_polygrasp.vectors import times, unit
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_bound import FEW_ANGLES, critical_directions
from drake_polygrasp.wrenches.support import frame_wrenches

MANY_POINTS = 160
"""Our choice: fewer points have two passes at most, because the first of three would see too
few."""
SHELLS = (2, 4, 6)
"""Our choice: squared lengths of directions; the last, 544 beside 312, pays with many points
only."""
LEVEL = 1e-9
"""Our choice, relative to the greatest reach: less counts as no reach of the wrenches."""
GUIDING_DIGITS = 9
"""Our choice: decimals of directions, which only guide the search in single precision."""
_ENOUGH = 0.3
"""Our choice, times what is kept: force-closure triples that end the passes."""
MOST_PASSES = 5
"""Our choice, for objects with few such triples, as scans and flat objects on a table."""


@dataclass(frozen=True, eq=False)
class Triples(Batch):
    """Three contacts on regions in each row.

    Attributes:
        region: region of each contact, shape (M, 3).
        p_BC: contact points expressed in B [m], shape (M, 3, 3).
    """

    region: Ints
    p_BC: Array


NO_TRIPLES = Triples(np.empty((0, 3), dtype=np.int64), np.empty((0, 3, 3)))


def best_triples(
    regions: Regions,
    points: tuple[Ints, Array],
    p_BBcm: Array,
    rho: float,
    effort: Effort = FULL,
) -> Triples:
    """Finds the triples of sample points with the greatest bound of epsilon.

    Args:
        regions: where contacts may be; polygons may be empty or have several parts.
        points: region of each sample point, shape (N,), and its coordinates in the face's frame
            [m], shape (N, 2).
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        effort: how much is searched.

    Returns:
        Force-closure triples, from each pass at most as many as points or `effort.kept`, those of
        the last pass first.
    """
    region, p_FC = points
    if len(region) < 3:
        return NO_TRIPLES
    p_BC = points_on(regions, region, p_FC)
    cones = cones_at(regions, region, p_BC, p_BBcm, rho)
    is_many = len(region) >= MANY_POINTS
    strides = effort.strides if is_many else effort.strides[-2:]
    w, found = spread_directions(cones, SHELLS if is_many else SHELLS[:-1]), NO_TRIPLES
    for number in range(MOST_PASSES):
        some = np.arange(0, len(region), strides[min(number, len(strides) - 1)])
        rows = some[
            best_covering_triples(cone_support(cones[some], w), max(effort.kept, len(some)))
        ]
        triples = Triples(region[rows], p_BC[rows])
        holding = _holding(regions, triples)
        holds = triples.take(holding)
        found = join_rows(holds, found)
        if number + 1 >= len(strides) and len(found.region) >= _ENOUGH * effort.kept:
            break
        slips = triples.take(np.setdiff1d(np.arange(len(rows)), holding, assume_unique=True))
        sources = join_rows(
            _first_of_sets(holds, effort.sources), _first_of_sets(slips, effort.sources)
        )
        w = np.concatenate([w, weakest_directions(regions, sources, p_BBcm, rho)])
    return found


def spread_directions(cones: Array, shells: tuple[int, ...] = SHELLS) -> Array:
    """Computes unit directions spread over all wrenches as the wrenches of contacts are.

    They are even where these wrenches reach equally far in all directions. Where they do not, as
    torques about a rod's axis, more directions are near those of less reach, the critical ones.

    Args:
        cones: wrenches that span the cones of N contacts, from `cones_at`, shape (N, 3, 6).
        shells: squared lengths of the lattice vectors used.

    Returns:
        Unit directions, shape (K, 6).
    """
    wrenches = cones.reshape(-1, 6)
    square, axes = np.linalg.eigh(times(wrenches.T, wrenches))
    reach = np.sqrt(np.maximum(square, LEVEL**2 * square[-1]))
    # The symmetric root does not depend on the choice of axes where eigenvalues are equal.
    directions = unit(times(times(_even_directions(shells), axes / reach), axes.T))
    # Eigenvectors come from LAPACK, whose last bits depend on the processor.
    return np.asarray(np.round(directions, GUIDING_DIGITS))


@cache
def _even_directions(shells: tuple[int, ...]) -> Array:
    """Vectors of the lattice D_6 of some squared lengths, shape (K, 6).

    The shortest are farther from each other than as many drawn at random, and leave less between.
    """
    lattice = np.indices((5,) * 6).reshape(6, -1).T - 2
    return frozen(lattice[np.isin((lattice**2).sum(axis=1), shells)])


def cones_at(regions: Regions, region: Ints, p_BC: Array, p_BBcm: Array, rho: float) -> Array:
    """Computes the wrenches of the inward normal and of two tangents mu long at points of regions.

    Args:
        regions: where the contacts are.
        region: region of each point, shape (N,).
        p_BC: points expressed in B [m], shape (N, 3).
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].

    Returns:
        Wrenches, shape (N, 3, 6).
    """
    return frame_wrenches(_frames(regions)[region], (p_BC - p_BBcm) / rho, regions.mu[region])


def _frames(regions: Regions) -> Array:
    """Inward normal and two tangents of each region as rows, shape (R, 3, 3)."""
    x, y, z = np.moveaxis(regions.R_BF, 2, 0)
    return np.stack([-z, x, y], axis=1)


def cone_support(cones: Array, w: Array) -> Singles:
    """Computes h_i(w) of contacts in single precision, which suffices to guide the search.

    Args:
        cones: wrenches from `cones_at`, shape (N, 3, 6).
        w: directions, shape (K, 6).

    Returns:
        h_i(w), shape (N, K).
    """
    rows, columns = cones.astype(np.float32), np.ascontiguousarray(w.T, dtype=np.float32)
    n, t_1, t_2 = np.einsum("ncd,dk->cnk", rows, columns)
    h: Singles = n + np.sqrt(t_1 * t_1 + t_2 * t_2)
    return h


def weakest_directions(regions: Regions, triples: Triples, p_BBcm: Array, rho: float) -> Array:
    """Computes the directions that triples resist least, some for each.

    Args:
        regions: where the contacts are.
        triples: M triples.
        p_BBcm: centre of mass from Bo, expressed in B [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].

    Returns:
        Unit directions, shape (K, 6).
    """
    contacts = contacts_on(regions, triples.region, triples.p_BC)
    w, _ = critical_directions(*contacts, p_BBcm, rho, num_angles=FEW_ANGLES, rotations=True)
    return w.reshape(-1, 6)


def _holding(regions: Regions, triples: Triples) -> Ints:
    return np.flatnonzero(force_closure(*contacts_on(regions, triples.region, triples.p_BC)))


def _first_of_sets(triples: Triples, num: int) -> Triples:
    return triples.take(first_of_each_set(triples.region)[:num])

"""Lower bounds of what contacts withstand anywhere in regions: a good twist for each facet.

Given a closed surface of simplices of generators around the origin (`simplex_cycle`) and a twist
w_s for each simplex s, the least over s of the least height of its six generators along w_s, over
N(w_s), is withstood in the norm N wherever the contacts are: docs/certificate.md has the proof. The
best twist of a simplex is its direction of least distance from the origin, swept; where that is not
enough a generator is added and the low facets around are replaced.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.region_bounds.best_forces import BestForces
from drake_polygrasp.region_bounds.load_norm import LoadNorm
from drake_polygrasp.region_bounds.side_by_side import Search, result_of
from drake_polygrasp.region_bounds.simplex_cycle import (
    coned,
    connected,
    modulo_2,
    simplex_boundary,
)
from drake_polygrasp.region_bounds.steepest import Steepen
from drake_polygrasp.region_bounds.swept_generators import SweptGenerators
from drake_polygrasp.wrenches.hulls import MOST_POINTS

_OLD_GAIN = 0.7
"""Our choice: a generator that is there already is taken if it gains this share of the best."""
_TIE = 11
"""Our choice: decimals of values that are compared: less is rounding."""
_MOST_FACETS = 8000
"""Our choice: a surface of more facets is not refined; a usual one has a few hundred."""
_GAIN = 1e-9
"""Our choice: what counts as higher; less is rounding."""
_LEAST_GOAL = 1e-3
"""Our choice: values are raised at least towards this."""
_TRIED = 8
"""Our choice: how many of the lowest facets say where contacts withstand little."""


@dataclass(frozen=True, eq=False)
class SweptFacets:
    """Simplices of generators with a twist each.

    Attributes:
        simplices: rows of indices of generators, shape (J, 6).
        twists: shape (J, 6).
        values: least height over N of each, shape (J,); not a number where it is not known.
    """

    simplices: Ints
    twists: Array
    values: Array

    def take(self, rows: Ints) -> SweptFacets:
        """Returns some of the facets.

        Args:
            rows: their indices.
        """
        return SweptFacets(self.simplices[rows], self.twists[rows], self.values[rows])

    def scaled(self, factor: Array) -> SweptFacets:
        """Returns the facets with values times factors.

        Args:
            factor: shape (J,).
        """
        return SweptFacets(self.simplices, self.twists, self.values * factor)

    def joined(self, other: SweptFacets) -> SweptFacets:
        """Returns these facets and others after them.

        Args:
            other: the facets after them.
        """
        return SweptFacets(
            np.concatenate([self.simplices, other.simplices]),
            np.concatenate([self.twists, other.twists]),
            np.concatenate([self.values, other.values]),
        )


@dataclass(frozen=True)
class Refinement:
    """How far a surface is refined.

    Attributes:
        at_once: generators that are added at most in a round.
        most_rounds: after how many rounds to stop.
        patience: how many rounds may pass without a better surface.
    """

    at_once: int
    most_rounds: int
    patience: int


def unswept(simplices: Ints, w: Array) -> SweptFacets:
    """Returns facets whose values are not known yet.

    Args:
        simplices: rows of indices of generators, shape (J, 6).
        w: twists, shape (J, 6).
    """
    return SweptFacets(simplices, w, np.full(len(w), np.nan))


def raised(
    generators: SweptGenerators,
    facets: SweptFacets,
    norm: LoadNorm,
    upper: Callable[[Array, float], Search[float]],
    tolerance: float,
    refinement: Refinement,
) -> Search[SweptFacets]:
    """Raises the least value until it is near an upper bound, by better twists and new facets.

    In each round the generators that pair most with the twists of the worst facets, wherever
    contacts are, are added; the low facets around that they overtop give way to their cones.

    Args:
        generators: to which are added.
        facets: a closed surface; those without values, and those of less than is asked for, get
            better twists first.
        norm: what twists are measured in.
        upper: given twists, shape (K, 6), or none, and what facets with these prove, finds the
            least upper bound that is known.
        tolerance: how far the lower bound may stay below the upper, over the upper.
        refinement: how many generators are added, and when to give up.

    Returns:
        The best surface that was met.
    """
    bound = yield from upper(np.zeros((0, 6)), 0.0)
    goal = max(bound * (1.0 - tolerance), _LEAST_GOAL)
    # Those below the goal count as unknown.
    facets = facets.scaled(np.where(facets.values >= goal, 1.0, np.nan))
    best, last = facets, 0
    for count in range(refinement.most_rounds + 1):
        facets = yield from _steepened(generators, facets, norm, goal)
        bound = yield from upper(lowest_twists(facets), float(facets.values.min()))
        goal = max(bound * (1.0 - tolerance), _LEAST_GOAL)
        least = facets.values.min()
        if count == 0 or least > best.values.min():
            best, last = facets, count
        is_enough = least >= (1.0 - tolerance) * bound or bound <= 0.0
        is_large = (
            len(facets.values) > _MOST_FACETS or len(generators) + refinement.at_once > MOST_POINTS
        )
        if (
            is_enough
            or is_large
            or count - last > refinement.patience
            or count == refinement.most_rounds
        ):
            break
        # What several generators replace together may be what was there before.
        at_once = refinement.at_once if count == last else 1
        worst, apex = yield from _apexes(generators, facets, goal, norm, at_once)
        if not len(worst):
            break
        facets = _replaced(generators, facets, worst, apex, norm, goal)
    return best


def _steepened(
    generators: SweptGenerators, facets: SweptFacets, norm: LoadNorm, goal: float
) -> Search[SweptFacets]:
    """Finds the values of facets that have none, with twists that reach the goal if they may."""
    fresh = np.isnan(facets.values)
    simplices, start = facets.simplices[fresh], facets.twists[fresh]
    w, value = yield from result_of(Steepen(generators, simplices, start, norm, goal))
    twists, values = facets.twists.copy(), facets.values.copy()
    twists[fresh], values[fresh] = w, value
    return SweptFacets(facets.simplices, twists, values)


def lowest_twists(facets: SweptFacets) -> Array:
    """Returns the twists of the facets of least values, shape (K, 6).

    Args:
        facets: of which a few are taken.
    """
    order = np.argsort(np.round(facets.values, _TIE), kind="stable")
    return facets.twists[order[:_TRIED]]


def _apexes(
    generators: SweptGenerators, facets: SweptFacets, goal: float, norm: LoadNorm, at_once: int
) -> Search[tuple[Ints, Ints]]:
    """Facets below the goal, worst first, and a generator for each that is to overtop it.

    A facet that the generator of one before overtops is left to that.
    """
    order = np.argsort(np.round(facets.values, _TIE), kind="stable")[:at_once]
    worst = order[facets.values[order] < goal]
    w = facets.twists[worst]
    heights = facets.values[worst] * norm.of(w)
    contact, force, most = yield from result_of(BestForces(generators, w))
    known = generators.heights_of_each(w, np.arange(len(generators)))
    highest = np.round(known, _TIE).argmax(axis=1)
    rows = np.arange(len(w))
    is_old = known[rows, highest] - heights >= _OLD_GAIN * np.maximum(most - heights, _GAIN)
    reached = generators.heights_of(w, contact, force)
    reached[:, is_old] = known[:, highest[is_old]]
    chosen: list[int] = []
    for k in rows[(most > heights + _GAIN) | is_old].tolist():
        if not (reached[k, chosen] > heights[k] + _OLD_GAIN * (most[k] - heights[k])).any():
            chosen.append(k)
    apex = highest.copy()
    new = [k for k in chosen if not is_old[k]]
    apex[new] = len(generators) + np.arange(len(new))
    if new:
        generators.add(contact[new], force[new])
    return worst[chosen], apex[chosen]


def _replaced(
    generators: SweptGenerators,
    facets: SweptFacets,
    worst: Ints,
    apex: Ints,
    norm: LoadNorm,
    goal: float,
) -> SweptFacets:
    """The facets with low ones that generators overtop replaced by their cones, without values.

    Facets that reach the goal stay, also where a generator overtops them: the surface need not be
    convex, and there would be ten times as many new facets.
    """
    low = np.flatnonzero(facets.values < goal)
    lowest, some = np.searchsorted(low, worst), facets.take(low)
    simplices, w = some.simplices, some.twists
    gain = generators.heights_of_each(w, apex) / norm.of(w)[:, None] - some.values[:, None]
    part = np.where(gain.max(axis=1) > _GAIN, np.round(gain, _TIE).argmax(axis=1), -1)
    part[lowest] = np.arange(len(lowest))
    seen = np.flatnonzero(connected(simplices, part, lowest))
    ridges, owner = simplex_boundary(simplices[seen], part[seen])
    tops = apex[part[seen][owner]]
    beside = (ridges != tops[:, None]).all(axis=1)
    cone, start = coned(ridges[beside], tops[beside]), w[seen][owner[beside]]
    kept = np.delete(np.arange(len(facets.values)), low[seen])
    left = modulo_2(np.concatenate([facets.simplices[kept], cone]))
    new = left[left >= len(kept)] - len(kept)
    return facets.take(kept[left[left < len(kept)]]).joined(unswept(cone[new], start[new]))

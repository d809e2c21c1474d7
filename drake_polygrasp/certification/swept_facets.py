"""Lower bounds of what contacts withstand anywhere in regions: a good twist for each facet.

Given a closed surface of simplices of generators around the origin (`simplex_cycle`) and a twist
w_s for each simplex s, the least over s of the least height of its six generators along w_s, over
N(w_s), is withstood in the norm N wherever the contacts are: docs/certificate.md has the proof. The
best twist of a simplex is its direction of least distance from the origin, swept; where that is not
enough a generator is added and the facets around are replaced.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.certification.simplex_cycle import (
    MOST_POINTS,
    coned,
    connected,
    modulo_2,
    simplex_boundary,
    solve_definite,
)
from drake_polygrasp.certification.swept_generators import SweptGenerators
from drake_polygrasp.wrenches.region_support import load_reach

_SOFT, _STIFFER, _STIFF = 3.0, 30.0, 1e5
"""Our choice: the penalty at first, its factor where Newton's method is near, and the greatest."""
_MOST_STEPS = 24
"""Our choice: steps of Newton's method; a median facet needs 5."""
_PARTS = np.array([1.0, 0.8, 0.6, 0.45, 0.3, 0.2, 0.1, 0.05])
"""Our choice: parts of a step of Newton's method that are tried."""
_NEAR = 1e-3
"""Our choice, relative: a step of Newton's method that is less is near."""
_OLD_GAIN = 0.7
"""Our choice: a generator that is there already is taken if it gains this share of the best."""
_DIGITS, _TIE = 9, 11
"""Our choice: decimals of twists, and of values that are compared: less is rounding."""
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
        values: least height over N of each, shape (J,).
    """

    simplices: Ints
    twists: Array
    values: Array

    def without(self, removed: Bools) -> SweptFacets:
        """Returns the other facets.

        Args:
            removed: which to leave out, shape (J,).
        """
        return SweptFacets(self.simplices[~removed], self.twists[~removed], self.values[~removed])

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


@dataclass(frozen=True)
class LoadNorm:
    """N(w): the greatest pairing of w with a unit load about a centre of mass that may be off.

    Attributes:
        com_error: how far it may be off, over rho.
        forces_only: whether loads are forces through the centre of mass, without torque.
    """

    com_error: float
    forces_only: bool = False

    def of(self, w: Array) -> Array:
        """Returns N of twists, shape (K,).

        Args:
            w: shape (K, 6).
        """
        reach = load_reach(w, self.com_error, forces_only=self.forces_only)
        return np.asarray(np.maximum(reach, 1e-300))

    def squares(self, w: Array) -> Array:
        """Returns six factors a with the sum of a w^2 close to N^2 near given twists, (K, 6).

        Args:
            w: the given twists, shape (K, 6).
        """
        s = self.com_error
        v, omega = np.sqrt((w[:, :3] ** 2).sum(axis=1)), np.sqrt((w[:, 3:] ** 2).sum(axis=1))
        ratio = np.clip(v / np.maximum(omega, 1e-12), 0.05, 20.0)
        # Without any weight rotations might grow without end.
        torque = 1e-4 if self.forces_only else 1.0
        factors = np.stack([1.0 + s / ratio, torque + s * s + s * ratio], axis=1)
        return np.repeat(factors, 3, axis=1)


def swept_facets(
    generators: SweptGenerators, simplices: Ints, w: Array, norm: LoadNorm
) -> SweptFacets:
    """Returns simplices with twists that are rounded to a few decimals.

    Args:
        generators: of which the simplices are.
        simplices: rows of their indices, shape (J, 6).
        w: twists, shape (J, 6).
        norm: what twists are measured in.
    """
    length = np.sqrt((w * w).sum(axis=1))[:, None]
    w = np.round(w / np.maximum(length, 1e-300), _DIGITS) + 0.0
    values = generators.heights(w, simplices).min(axis=1) / norm.of(w)
    return SweptFacets(simplices, w, values)


def steepest(
    generators: SweptGenerators, facets: SweptFacets, norm: LoadNorm, enough: float
) -> SweptFacets:
    """Returns facets with twists of larger values, for many at once.

    The best twist is the shortest that keeps all heights at one or above. Newton's method with an
    exact line search finds it for a quadratic penalty on what is below, ever stiffer.

    Args:
        generators: of which the facets are.
        facets: with the twists to begin at.
        norm: what twists are measured in.
        enough: the value that is asked for, positive; a twist of more is not improved.
    """
    simplices, best, best_value = facets.simplices, facets.twists.copy(), facets.values.copy()
    rows = np.flatnonzero(best_value < enough)
    if not len(rows):
        return facets
    w, stiffness = best[rows] / enough, np.full(len(rows), _SOFT)
    a = generators.at_corners(simplices[rows])
    heights = _paired(a, w)
    for _ in range(_MOST_STEPS):
        if not len(rows):
            break
        metric = norm.squares(w) * (enough * enough)
        new = _newton(a, heights, stiffness, metric)
        new = np.where(np.all(np.isfinite(new), axis=1, keepdims=True), new, w)
        step = new - w
        rise = _paired(a, step)
        share = _line_search(w, step, heights, rise, stiffness, metric)[:, None]
        is_near = np.abs(step).max(axis=1) <= _NEAR * np.abs(new).max(axis=1)
        w = w + share * step
        heights = heights + share * rise
        value = heights.min(axis=1) / norm.of(w)
        better = value > best_value[rows]
        best[rows[better]], best_value[rows[better]] = w[better], value[better]
        stiffness = np.where(is_near, stiffness * _STIFFER, stiffness)
        left = (best_value[rows] < enough) & (stiffness <= _STIFF)
        if not left.all():
            rows, w, heights, stiffness = rows[left], w[left], heights[left], stiffness[left]
            a = a[:, left]
    return swept_facets(generators, simplices, best, norm)


def _paired(a: Array, w: Array) -> Array:
    """The heights of wrenches (6, J, N) along a twist each, (J, N)."""
    return np.asarray(np.einsum("kjn,jk->jn", a, w))


def _newton(a: Array, heights: Array, stiffness: Array, metric: Array) -> Array:
    """The least of w.Mw + stiffness |1 - a w|^2 over 2, a what is below one at w, (J, 6)."""
    below = a * np.where(heights < 1.0, stiffness[:, None], 0.0)
    A = np.einsum("ijn,kjn->ikj", below, a)
    for i in range(6):
        A[i, i] += metric[:, i]
    return solve_definite(A, below.sum(axis=2)).T


def _line_search(
    w: Array, step: Array, heights: Array, rise: Array, stiffness: Array, metric: Array
) -> Array:
    """The share of each step, of a few, that lowers the penalised length most, (J,)."""
    first, second = (metric * step * w).sum(axis=1), (metric * step * step).sum(axis=1)
    share = _PARTS[:, None]
    lack = np.maximum((1.0 - heights) - share[..., None] * rise, 0.0)
    length = share * (2.0 * first + share * second)
    penalty = length + stiffness * np.einsum("sjn,sjn->sj", lack, lack)
    return np.asarray(_PARTS[penalty.argmin(axis=0)])


def raised(
    generators: SweptGenerators,
    facets: SweptFacets,
    norm: LoadNorm,
    upper: Callable[[Array], float],
    tolerance: float,
    refinement: Refinement,
) -> SweptFacets:
    """Raises the least value until it is near an upper bound, by better twists and new facets.

    In each round the generators that pair most with the twists of the worst facets, wherever
    contacts are, are added; the facets around that they overtop give way to their cones.

    Args:
        generators: to which are added.
        facets: a closed surface.
        norm: what twists are measured in.
        upper: given twists, shape (K, 6), or none, returns the least upper bound that is known.
        tolerance: how far the lower bound may stay below the upper, over the upper.
        refinement: how many generators are added, and when to give up.

    Returns:
        The best surface that was met.
    """
    fresh = np.ones(len(facets.values), dtype=bool)
    best, last = facets, 0
    bound = upper(np.zeros((0, 6)))
    for count in range(refinement.most_rounds + 1):
        goal = max(bound * (1.0 - tolerance), _LEAST_GOAL)
        low = np.asarray(fresh & (facets.values < goal))
        better = steepest(generators, facets.without(~low), norm, goal)
        twists, values = facets.twists.copy(), facets.values.copy()
        twists[low], values[low], fresh[low] = better.twists, better.values, False
        facets = SweptFacets(facets.simplices, twists, values)
        bound = upper(lowest_twists(facets))
        goal = max(bound * (1.0 - tolerance), _LEAST_GOAL)
        least = values.min()
        if least > best.values.min() or count == 0:
            best, last = facets, count
        is_enough = least >= (1.0 - tolerance) * bound or bound <= 0.0
        is_large = len(values) > _MOST_FACETS or len(generators) + refinement.at_once > MOST_POINTS
        if (
            is_enough
            or is_large
            or count - last > refinement.patience
            or count == refinement.most_rounds
        ):
            break
        worst, apex = _apexes(generators, facets, goal, norm, refinement.at_once)
        if not len(worst):
            break
        facets, fresh = _replaced(generators, facets, fresh, worst, apex, norm)
    return best


def lowest_twists(facets: SweptFacets) -> Array:
    """Returns the twists of the facets of least values, shape (K, 6).

    Args:
        facets: of which a few are taken.
    """
    order = np.argsort(np.round(facets.values, _TIE), kind="stable")
    return facets.twists[order[:_TRIED]]


def _apexes(
    generators: SweptGenerators, facets: SweptFacets, goal: float, norm: LoadNorm, at_once: int
) -> tuple[Ints, Ints]:
    """Facets below the goal, worst first, and a generator for each that is to overtop it.

    A facet that the generator of one before overtops is left to that.
    """
    order = np.argsort(np.round(facets.values, _TIE), kind="stable")[:at_once]
    worst = order[facets.values[order] < goal]
    w = facets.twists[worst]
    heights = facets.values[worst] * norm.of(w)
    contact, force, most = generators.best_forces(w)
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
    fresh: Bools,
    worst: Ints,
    apex: Ints,
    norm: LoadNorm,
) -> tuple[SweptFacets, Bools]:
    """The facets with those around some that generators overtop replaced by their cones."""
    simplices, w = facets.simplices, facets.twists
    gain = generators.heights_of_each(w, apex) / norm.of(w)[:, None] - facets.values[:, None]
    part = np.where(gain.max(axis=1) > _GAIN, np.round(gain, _TIE).argmax(axis=1), -1)
    part[worst] = np.arange(len(worst))
    seen = connected(simplices, part, worst)
    ridges, owner = simplex_boundary(simplices[seen], part[seen])
    tops = apex[part[seen][owner]]
    beside = (ridges != tops[:, None]).all(axis=1)
    cone, start = coned(ridges[beside], tops[beside]), w[seen][owner[beside]]
    num = int((~seen).sum())
    left = modulo_2(np.concatenate([simplices[~seen], cone]))
    kept, new = np.flatnonzero(~seen)[left[left < num]], left[left >= num] - num
    added = swept_facets(generators, cone[new], start[new], norm)
    is_kept = np.zeros(len(seen), dtype=bool)
    is_kept[kept] = True
    is_fresh = np.concatenate([fresh[kept], np.ones(len(new), dtype=bool)])
    return facets.without(~is_kept).joined(added), is_fresh

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
    simplex_boundary,
    simplex_keys,
    solve,
)
from drake_polygrasp.certification.swept_generators import SweptGenerators
from drake_polygrasp.wrenches.region_support import load_reach

_SOFT, _STIFFER, _STIFF = 3.0, 30.0, 1e5
"""Our choice: the penalty at first, its factor where Newton's method is near, and the greatest."""
_MOST_STEPS, _SEARCHES = 24, 6
"""Our choice: steps of Newton's method, and of its line searches; a median facet needs 5."""
_NEAR = 1e-3
"""Our choice, relative: a step of Newton's method that is less is near."""
_OLD_GAIN = 0.7
"""Our choice: a generator that is there already is taken if it gains this share of the best."""
_DIGITS, _TIE = 9, 11
"""Our choice: decimals of twists, and of values that are compared: less is rounding."""
_PATIENCE = 8
"""Our choice: after so many insertions that raised nothing the others are given up."""
_LEAST_GOAL = 1e-3
"""Our choice: values are raised at least towards this."""
_TRIED = 16
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
    w, stiffness = best[rows] / enough, np.full(len(rows), _SOFT)
    heights = generators.heights_at_corners(w, simplices[rows])
    for _ in range(_MOST_STEPS):
        if not len(rows):
            break
        metric = norm.squares(w) * (enough * enough)
        new = _newton(generators, simplices[rows], w, heights, stiffness, metric)
        new = np.where(np.all(np.isfinite(new), axis=1, keepdims=True), new, w)
        rise = generators.heights_at_corners(new, simplices[rows]) - heights
        share = _line_search(w, new - w, heights, rise, stiffness, metric)
        is_near = np.abs(new - w).max(axis=1) <= _NEAR * np.abs(new).max(axis=1)
        w = w + share[:, None] * (new - w)
        heights = heights + share[:, None, None] * rise
        value = heights.min(axis=(1, 2)) / norm.of(w)
        better = value > best_value[rows]
        best[rows[better]], best_value[rows[better]] = w[better], value[better]
        stiffness = np.where(is_near, stiffness * _STIFFER, stiffness)
        left = (best_value[rows] < enough) & (stiffness <= _STIFF)
        rows, w, heights, stiffness = rows[left], w[left], heights[left], stiffness[left]
    return swept_facets(generators, simplices, best, norm)


def _newton(
    generators: SweptGenerators,
    simplices: Ints,
    w: Array,
    heights: Array,
    stiffness: Array,
    metric: Array,
) -> Array:
    """The least of w.Mw + stiffness |1 - a w|^2 over 2, a what is below one at w, (J, 6)."""
    num = len(w)
    row, k, corner = np.nonzero(heights < 1.0)
    a = generators.wrenches(simplices[row, k], corner)
    A, b = np.empty((6, 6, num)), np.empty((6, num))
    for i in range(6):
        b[i] = np.bincount(row, weights=a[i], minlength=num) * stiffness
        for j in range(i + 1):
            A[i, j] = A[j, i] = np.bincount(row, weights=a[i] * a[j], minlength=num) * stiffness
        A[i, i] += metric[:, i]
    return solve(A, b).T


def _line_search(
    w: Array, step: Array, heights: Array, rise: Array, stiffness: Array, metric: Array
) -> Array:
    """The share of each step, 1 at most, that lowers the penalised length most, (J,)."""
    first, second = (metric * step * w).sum(axis=1), (metric * step * step).sum(axis=1)
    low, high, share = np.zeros(len(w)), np.ones(len(w)), np.ones(len(w))
    # The slope is piecewise linear and rises with the share.
    for _ in range(_SEARCHES):
        lack = np.maximum(1.0 - heights - share[:, None, None] * rise, 0.0)
        slope = first + share * second - stiffness * (lack * rise).sum(axis=(1, 2))
        curve = second + stiffness * (rise * rise * (lack > 0)).sum(axis=(1, 2))
        low, high = np.where(slope < 0, share, low), np.where(slope < 0, high, share)
        tried = share - slope / np.maximum(curve, 1e-300)
        share = np.where((tried > low) & (tried < high), tried, (low + high) / 2)
    return share


def raised(
    generators: SweptGenerators,
    facets: SweptFacets,
    norm: LoadNorm,
    upper: Callable[[Array], float],
    tolerance: float,
    most_insertions: int,
) -> SweptFacets:
    """Raises the least value until it is near an upper bound, by better twists and new facets.

    At the worst facet the generator that pairs most with its twist, wherever contacts are, is
    added; the facets around that it overtops give way to its cone.

    Args:
        generators: to which are added.
        facets: a closed surface.
        norm: what twists are measured in.
        upper: given twists, shape (K, 6), returns the least upper bound that is known with them.
        tolerance: how far the lower bound may stay below the upper, over the upper.
        most_insertions: after how many generators to stop.

    Returns:
        The best surface that was met.
    """
    fresh = np.ones(len(facets.values), dtype=bool)
    best, last, tried = facets, 0, set[int]()
    bound = upper(lowest_twists(facets))
    for count in range(most_insertions + 1):
        low = np.asarray(fresh & (facets.values < max(bound * (1.0 - tolerance), _LEAST_GOAL)))
        better = steepest(generators, facets.without(~low), norm, max(bound, 2 * _LEAST_GOAL))
        twists, values = facets.twists.copy(), facets.values.copy()
        twists[low], values[low], fresh[low] = better.twists, better.values, False
        facets = SweptFacets(facets.simplices, twists, values)
        worst = int(np.round(values, _TIE).argmin())
        bound = upper(lowest_twists(facets))
        least = values.min()
        if least > best.values.min() or count == 0:
            best, last = facets, count
        enough = least >= (1.0 - tolerance) * bound or bound <= 0.0 or count - last >= _PATIENCE
        if enough or count == most_insertions or len(generators) >= MOST_POINTS:
            break
        key = int(simplex_keys(facets.simplices[worst, None])[0])
        new = _apex(generators, facets, worst, norm, may_be_old=key not in tried)
        if new is None:
            break
        tried.add(key)
        facets, fresh = _replaced(generators, facets, fresh, worst, new, norm)
    return best


def lowest_twists(facets: SweptFacets) -> Array:
    """Returns the twists of the facets of least values, shape (K, 6).

    Args:
        facets: of which a few are taken.
    """
    order = np.argsort(np.round(facets.values, _TIE), kind="stable")
    return facets.twists[order[:_TRIED]]


def _apex(
    generators: SweptGenerators, facets: SweptFacets, at: int, norm: LoadNorm, *, may_be_old: bool
) -> int | None:
    """The generator to add at a facet; None where none gains."""
    w = facets.twists[at, None]
    height = float(facets.values[at] * norm.of(w)[0])
    contact, force, most = generators.best_forces(w[0])
    if most <= height + 1e-9:
        return None
    known = generators.heights(w, np.arange(len(generators))[None])[0]
    highest = int(np.round(known, _TIE).argmax())
    if may_be_old and known[highest] - height >= _OLD_GAIN * (most - height):
        return highest
    generators.add(np.array([contact]), force[None])
    return len(generators) - 1


def _replaced(
    generators: SweptGenerators,
    facets: SweptFacets,
    fresh: Bools,
    worst: int,
    new: int,
    norm: LoadNorm,
) -> tuple[SweptFacets, Bools]:
    """The facets with those around the worst that a generator overtops replaced by its cone."""
    simplices, w = facets.simplices, facets.twists
    height = generators.heights(w, np.full((len(w), 1), new))[:, 0] / norm.of(w)
    over = height > facets.values + 10.0**-_DIGITS
    over[worst] = True
    seen = connected(simplices, over, worst)
    ridges, owner = simplex_boundary(simplices[seen])
    start = w[seen][owner[(ridges != new).all(axis=1)]]
    cone = coned(ridges, new)
    # What is there twice is there an even number of times.
    twice = np.isin(simplex_keys(cone), simplex_keys(simplices[~seen]))
    removed = np.isin(simplex_keys(simplices), simplex_keys(cone)) | seen
    added = swept_facets(generators, cone[~twice], start[~twice], norm)
    is_fresh = np.concatenate([fresh[~removed], np.ones(len(added.values), dtype=bool)])
    return facets.without(removed).joined(added), is_fresh

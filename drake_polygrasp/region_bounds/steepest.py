"""Finds the twist of a simplex of generators along which the least of its heights is greatest.

That twist is the shortest that keeps all heights at one or above. Newton's method with a line
search finds it for a quadratic penalty on what is below, ever stiffer, for many simplices at once.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints, batches
from drake_polygrasp.region_bounds.load_norm import LoadNorm
from drake_polygrasp.region_bounds.side_by_side import Work
from drake_polygrasp.region_bounds.simplex_cycle import solve_definite
from drake_polygrasp.region_bounds.swept_generators import CORNERS_AT_ONCE, SweptGenerators

_SOFT, _STIFFER, _STIFF = 10.0, 30.0, 1e4
"""Our choice: the penalty at first, its factor where Newton's method is near, and the greatest."""
_MOST_STEPS = 16
"""Our choice: steps of Newton's method; a median facet needs 4."""
_NEAR = 1e-2
"""Our choice, relative: a step of Newton's method that is less is near."""
_LEVEL = 0.1
"""Our choice: a line search ends where the slope is less than this part of that at its start."""
_SECANTS, _LEAST_PART = 4, 0.02
"""Our choice: secants of a line search, and the least part of a step that is taken."""
_DIGITS = 9
"""Our choice: decimals of twists."""
_MOST_PASSES = 3
"""Our choice: how often corners are added. Of contacts with several pieces only that corner of each
counts at first that is lowest along the twist to begin at; then those that turn out lower."""
_FEWEST = 32
"""Our choice: how many simplices are done at once at least, however many corners they have."""


@dataclass(frozen=True, eq=False)
class Steepen(Work[tuple[Array, Array]]):
    """Asks for twists of large values, a value being the least height over the norm.

    The answer is the twists, rounded to a few decimals, shape (J, 6), and their values, (J,).

    Attributes:
        generators: of which the simplices are.
        simplices: rows of indices of generators, shape (J, 6).
        w: the twists to begin at, shape (J, 6).
        norm: what they are measured in.
        enough: the value that is asked for, positive; a twist of more is not improved.
    """

    generators: SweptGenerators
    simplices: Ints
    w: Array
    norm: LoadNorm
    enough: float

    def kind(self) -> Hashable:
        """Returns the numbers of corners and pieces, the same for those of one kind."""
        return self.generators.num_corners, self.generators.pieces.shape[1]

    @classmethod
    def together(cls, works: Sequence[Steepen]) -> list[tuple[Array, Array]]:
        """Finds the twists of all simplices, a block of them at once.

        Args:
            works: those of one kind.

        Returns:
            The answer to each.
        """
        simplices = _Simplices(works)
        norm, enough = simplices.norm, simplices.enough
        w = _rounded(np.concatenate([work.w for work in works]))
        values, lowest = simplices.along(np.arange(len(w)), w)
        rows = np.flatnonzero(values < enough)
        x, counted = w[rows], lowest[:, rows] if simplices.has_pieces else simplices.wrenches(rows)
        for _ in range(_MOST_PASSES):
            x, value = _raised(counted, x, norm.take(rows), enough[rows])
            reached = value
            if simplices.has_pieces:
                reached, lowest = simplices.along(rows, x)
            better = reached > values[rows]
            w[rows[better]], values[rows[better]] = x[better], reached[better]
            left = (values[rows] < enough[rows]) & (reached < value - _NEAR * np.abs(value))
            if not left.any():
                break
            rows, x = rows[left], x[left]
            counted = np.concatenate([counted[:, left], lowest[:, left]], axis=2)
        return simplices.split(w, values)


class _Simplices:
    """The simplices of several works, one after the other.

    Attributes:
        norm: of the twist of each.
        enough: the value that is asked for of each, shape (J,).
        has_pieces: whether contacts have several pieces.
    """

    def __init__(self, works: Sequence[Steepen]) -> None:
        self._works, counts = works, [len(work.w) for work in works]
        self._starts = np.cumsum([0, *counts])
        self._num_pieces = works[0].generators.pieces.shape[1]
        self.has_pieces = self._num_pieces > 1
        self.norm = LoadNorm.of_each([work.norm for work in works], counts)
        self.enough = np.repeat([work.enough for work in works], counts)

    def wrenches(self, rows: Ints) -> Array:
        """Returns the wrenches at all corners of generators of simplices, ascending, (6, J, N)."""
        first = np.searchsorted(rows, self._starts)
        parts = [
            work.generators.at_corners(work.simplices[rows[i:j] - start])
            for work, i, j, start in zip(self._works, first, first[1:], self._starts, strict=False)
            if i < j
        ]
        return np.concatenate(parts, axis=1) if parts else np.zeros((6, 0, 6))

    def along(self, rows: Ints, w: Array) -> tuple[Array, Array]:
        """Returns the values of simplices along twists, and the lowest corners of several pieces.

        Args:
            rows: the simplices, ascending, shape (J,).
            w: a twist for each, shape (J, 6).

        Returns:
            The values, shape (J,), and the wrenches of the corners, one of each piece, shape
            (6, J, 6 S); (6, J, 0) for contacts with a single piece.
        """
        num = 6 * self._num_pieces if self.has_pieces else 0
        values, lowest = np.empty(len(rows)), np.empty((6, len(rows), num))
        num_corners = 6 * self._works[0].generators.num_corners
        for block in batches(len(rows), max(_FEWEST, CORNERS_AT_ONCE // num_corners)):
            a = self.wrenches(rows[block])
            heights = _paired(a, w[block])
            values[block] = heights.min(axis=1) / self.norm.take(rows[block]).of(w[block])
            if self.has_pieces:
                shape = a.shape[1], num, -1
                at = heights.reshape(shape).argmin(axis=2)[None, :, :, None]
                lowest[:, block] = np.take_along_axis(a.reshape(6, *shape), at, 3)[..., 0]
        return values, lowest

    def split(self, w: Array, values: Array) -> list[tuple[Array, Array]]:
        """Returns twists and values of all simplices as answers to the works."""
        ends = self._starts[1:-1]
        return list(zip(np.split(w, ends), np.split(values, ends), strict=True))


def _raised(a: Array, w: Array, norm: LoadNorm, enough: Array) -> tuple[Array, Array]:
    """Twists (J, 6) of greater values (J,) for wrenches (6, J, N), enough (J,) if it may be."""
    best, best_value = w.copy(), np.empty(len(w))
    for block in batches(len(w), max(_FEWEST, CORNERS_AT_ONCE // a.shape[2])):
        some = a[:, block], w[block], norm.take(block), enough[block]
        best[block], best_value[block] = _raised_block(*some)
    return best, best_value


def _raised_block(a: Array, w: Array, norm: LoadNorm, enough: Array) -> tuple[Array, Array]:
    best, rows, goal = w.copy(), np.arange(len(w)), enough
    heights = _paired(a, w)
    best_value = heights.min(axis=1) / norm.of(w)
    w, heights = w / enough[:, None], heights / enough[:, None]
    stiffness = np.full(len(rows), _SOFT)
    for _ in range(_MOST_STEPS):
        metric = norm.squares(w) * (goal * goal)[:, None]
        new = _newton(a, heights, stiffness, metric)
        new = np.where(np.all(np.isfinite(new), axis=1, keepdims=True), new, w)
        step = new - w
        rise = _paired(a, step)
        part = _line_search(w, step, heights, rise, stiffness, metric)[:, None]
        is_near = np.abs(step).max(axis=1) <= _NEAR * np.abs(new).max(axis=1)
        w = w + part * step
        heights = heights + part * rise
        value = heights.min(axis=1) / norm.of(w)
        better = value > best_value[rows]
        best[rows[better]], best_value[rows[better]] = _rounded(w[better]), value[better]
        stiffness = np.where(is_near, stiffness * _STIFFER, stiffness)
        left = (best_value[rows] < goal) & (stiffness <= _STIFF)
        if not left.any():
            break
        if not left.all():
            rows, w, heights, stiffness = rows[left], w[left], heights[left], stiffness[left]
            a, norm, goal = a[:, left], norm.take(left), goal[left]
    return best, best_value


def _rounded(w: Array) -> Array:
    """Twists of unit length, rounded to a few decimals."""
    length = np.sqrt((w * w).sum(axis=1))[:, None]
    return np.asarray(np.round(w / np.maximum(length, 1e-300), _DIGITS) + 0.0)


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
    """The part of each step, at most 1, at which the penalised length is nearly least, (J,).

    It is convex, so its slope has one zero, which secants find.
    """
    first, second = (metric * step * w).sum(axis=1), (metric * step * step).sum(axis=1)

    def slope(part: Array, rows: Ints) -> Array:
        lack = np.maximum(1.0 - heights[rows] - part[:, None] * rise[rows], 0.0)
        pull = np.einsum("jn,jn->j", lack, rise[rows])
        return np.asarray(first[rows] + part * second[rows] - stiffness[rows] * pull)

    part = np.ones(len(w))
    rows = np.arange(len(w))
    below, above = slope(np.zeros(len(w)), rows), slope(part, rows)
    rows = np.flatnonzero(above > _LEVEL * np.abs(below))
    if not len(rows):
        return part
    below, above, low, high = below[rows], above[rows], np.zeros(len(rows)), np.ones(len(rows))
    for _ in range(_SECANTS):
        middle = low + (high - low) * np.clip(
            below / np.minimum(below - above, -1e-300), 0.05, 0.95
        )
        s = slope(middle, rows)
        falls = s < 0
        low, below = np.where(falls, middle, low), np.where(falls, s, below)
        high, above = np.where(falls, high, middle), np.where(falls, above, s)
    part[rows] = np.where(-below < above, np.maximum(low, _LEAST_PART), high)
    return part

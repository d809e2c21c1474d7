"""Finds the twist of a simplex of generators along which the least of its heights is greatest.

That twist is the shortest that keeps all heights at one or above, a quadratic program in six
unknowns. A dual active-set method solves it (Goldfarb & Idnani, 1983) for many simplices at once:
it begins with the lowest corner of each generator at one, lets corners go that hold the twist back,
and takes in the lowest corner that is below one.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass, fields

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints, batches
from drake_polygrasp.region_bounds.load_norm import LoadNorm
from drake_polygrasp.region_bounds.side_by_side import Work
from drake_polygrasp.region_bounds.swept_generators import CORNERS_AT_ONCE, SweptGenerators
from drake_polygrasp.wrenches.linear_systems import inverse_definite

_MOST_STEPS = 20
"""Our choice: changes of corners at one; three of four facets need one."""
_NEAR = 1e-3
"""Our choice: heights less than this below one are enough, and so is a value within this of another
that counted fewer corners, relative."""
_FALLS = 1e-9
"""Our choice: a share that falls by less is rounding."""
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
        x, counted = w[rows], lowest if simplices.has_pieces else simplices.wrenches(rows)
        for _ in range(_MOST_PASSES):
            x, value = _raised(counted, x, norm.take(rows), enough[rows])
            reached = value
            if simplices.has_pieces:
                reached, lowest = simplices.along(rows, x)
            better = reached > values[rows]
            w[rows[better]], values[rows[better]] = x[better], reached[better]
            below = reached < enough[rows]
            left = (values[rows] < enough[rows]) & (reached < value - _NEAR * np.abs(value))
            if not left.any():
                break
            rows, x = rows[left], x[left]
            counted = np.concatenate([counted[:, left], lowest[:, left[below]]], axis=2)
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
        if len(parts) == 1:  # most blocks; to join copies
            return parts[0]
        return np.concatenate(parts, axis=1) if parts else np.zeros((6, 0, 6))

    def along(self, rows: Ints, w: Array) -> tuple[Array, Array]:
        """Returns values of simplices along twists, and lowest corners of those that lack value.

        Args:
            rows: the simplices, ascending, shape (J,).
            w: a twist for each, shape (J, 6).

        Returns:
            The values, shape (J,), and wrenches of the lowest corners of the K simplices whose
            value is below `enough`, one of each piece, shape (6, K, 6 S); (6, 0, 0) for contacts
            with a single piece.
        """
        num = 6 * self._num_pieces if self.has_pieces else 0
        values, lowest = np.empty(len(rows)), [np.empty((6, 0, num))]
        num_corners = 6 * self._works[0].generators.num_corners
        for block in batches(len(rows), max(_FEWEST, CORNERS_AT_ONCE // num_corners)):
            a = self.wrenches(rows[block])
            heights = _paired(a, w[block])
            values[block] = heights.min(axis=1) / self.norm.take(rows[block]).of(w[block])
            if self.has_pieces:
                below = np.flatnonzero(values[block] < self.enough[rows[block]])
                by_piece = heights.reshape(len(heights), num, -1)[below]
                first = (below[:, None] * num + np.arange(num)) * by_piece.shape[2]
                at = first + by_piece.argmin(axis=2)
                lowest.append(a.reshape(6, -1).take(at, axis=1))
        return values, np.concatenate(lowest, axis=1)

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
    """What `_raised` finds for simplices whose corners fit a processor's cache."""
    best, rows, goal = w.copy(), np.arange(len(w)), enough
    heights = _paired(a, w)
    best_value = heights.min(axis=1) / norm.of(w)
    num = a.shape[2] // 6
    tight = (heights.reshape(-1, 6, num).argmin(axis=2) + num * np.arange(6)).T
    is_tight = np.ones_like(tight, dtype=bool)
    for _ in range(_MOST_STEPS):
        at = np.arange(len(rows)) * a.shape[2] + tight
        corners = a.reshape(6, -1).take(at, axis=1) * is_tight
        shortest = _Shortest.of(corners, is_tight, norm.squares(w).T)
        w = shortest.twists()
        heights = _paired(a, w)
        value = heights.min(axis=1) / norm.of(w)
        better = value > best_value[rows]
        best[rows[better]], best_value[rows[better]] = _rounded(w[better]), value[better]
        is_tight = is_tight & (shortest.share >= 0.0)
        lets_go = (is_tight != shortest.is_tight).any(axis=0)
        lowest = heights.argmin(axis=1)
        lack = 1.0 - heights[np.arange(len(rows)), lowest]
        left = np.flatnonzero((best_value[rows] < goal) & (lets_go | (lack > _NEAR)))
        if not len(left):
            break
        rows, w, goal, norm = rows[left], w[left], goal[left], norm.take(left)
        a, tight = a.take(left, axis=1), tight.take(left, axis=1)
        is_tight = is_tight.take(left, axis=1)
        k = np.flatnonzero(~lets_go[left])
        new = lowest[left[k]]
        slot = shortest.take(left[k]).slots(a[:, k, new], lack[left[k]])
        tight[slot, k], is_tight[slot, k] = new, True
    return best, best_value


@dataclass(frozen=True, eq=False)
class _Shortest:
    """The shortest twists that give the corners in six slots, some of them free, height one.

    Attributes:
        is_tight: which slots have a corner, shape (6, J).
        metric: factors whose sum with a twist's squares is its squared length, shape (6, J).
        scaled: wrenches of the corners over these, zero in free slots, shape (6, 6, J), slots
            second.
        inverse: of how corners pair with scaled ones, shape (6, 6, J); 1 for free slots.
        share: of each scaled wrench in the twist, shape (6, J). A negative one belongs to a corner
            that holds the twist back: without it a shorter twist does.
    """

    is_tight: Bools
    metric: Array
    scaled: Array
    inverse: Array
    share: Array

    @classmethod
    def of(cls, corners: Array, is_tight: Bools, metric: Array) -> _Shortest:
        """Returns the twists for wrenches of corners, zero in free slots, (6, 6, J)."""
        scaled = corners / metric[:, None]
        gram = np.einsum("csj,ctj->stj", scaled, corners)
        gram[range(6), range(6)] += ~is_tight
        inverse = inverse_definite(gram)
        share = _sum_of_products(inverse, is_tight)
        share = np.where(np.isfinite(share), share, -1.0) * is_tight
        return cls(is_tight, metric, scaled, inverse, share)

    def take(self, rows: Ints) -> _Shortest:
        """Returns some of the twists."""
        columns = (getattr(self, field.name) for field in fields(self))
        return _Shortest(*(column.take(rows, axis=-1) for column in columns))

    def twists(self) -> Array:
        """Returns the twists, shape (J, 6)."""
        return np.ascontiguousarray(_sum_of_products(self.scaled, self.share).T)

    def slots(self, corner: Array, lack: Array) -> Ints:
        """Returns the slot for one more corner of each twist, shape (J,).

        While the twist turns until the new corner has height one, shares of the others fall. The
        slot of the first whose share vanishes is taken, or a free one if none does.

        Args:
            corner: wrenches of the corners, shape (6, J).
            lack: by how much their heights are below one, shape (J,).
        """
        paired = np.einsum("csj,cj->sj", self.scaled, corner)
        fall = _sum_of_products(self.inverse, paired)
        turn = corner / self.metric - _sum_of_products(self.scaled, fall)
        rise = np.maximum((corner * turn).sum(axis=0), 1e-300)
        parts = np.where(fall > _FALLS, self.share / np.maximum(fall, _FALLS), np.inf)
        goes = self.is_tight.all(axis=0) | (parts.min(axis=0) * rise <= lack)
        slot: Ints = np.where(goes, parts.argmin(axis=0), self.is_tight.argmin(axis=0))
        return slot


def _rounded(w: Array) -> Array:
    """Twists of unit length, rounded to a few decimals."""
    length = np.sqrt((w * w).sum(axis=1))[:, None]
    return np.asarray(np.round(w / np.maximum(length, 1e-300), _DIGITS) + 0.0)


def _sum_of_products(a: Array, b: Array | Bools) -> Array:
    """The sums of a (6, 6, J) times b (6, J) over the second axis, (6, J).

    `einsum` adds those of a single column in another order than those of many.
    """
    with np.errstate(all="ignore"):
        return np.asarray((a * b).sum(axis=1))


def _paired(a: Array, w: Array) -> Array:
    """The heights of wrenches (6, J, N) along a twist each, (J, N)."""
    return np.asarray(np.einsum("kjn,jk->jn", a, w))

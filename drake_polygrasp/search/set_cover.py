"""Beyond the paper: the triples among many points that together reach highest in all directions.

A triple exceeds a threshold only if in each direction w one of its points does. That is a set
cover: a bit for each point and direction, and a triple passes when the bits of its points, joined,
are all ones.
"""

from __future__ import annotations

from functools import cache

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arrays import Array, Bools, Ints, frozen, ranges

Singles = npt.NDArray[np.float32]
Words = npt.NDArray[np.uint64]
ENOUGH = 0.75
"""Our choice: where fewer than this share of the triples wanted are found, the search is repeated
with a lower threshold."""
_SAMPLE = 500
"""Our choice: number of triples from which a first threshold is guessed."""
_BLOCK = 8
"""Times the number wanted: triples collected before the threshold is raised."""
_AT_ONCE = 400_000
"""Our choice: pairs times points examined together, some megabytes."""
_CACHED = 150_000
"""Numbers gathered at once, which stay in the cache."""
_ALL = np.uint64(0xFFFFFFFFFFFFFFFF)


def best_covering_triples(h: Singles, num: int) -> Ints:
    """Finds the triples i < j < k of greatest min_w max(h_i, h_j, h_k).

    Args:
        h: h_i(w) of N points and K directions, shape (N, K).
        num: how many triples; some of the last may be missing.

    Returns:
        Triples of points, greatest first, shape (at most num, 3).
    """
    for threshold in _thresholds(h, num):
        best = _above(h, threshold, num)
        if len(best) >= ENOUGH * num:
            break
    return best


def _thresholds(h: Singles, num: int) -> Singles:
    """Falling thresholds, from one that some more than `num` triples should pass to none at all."""
    N = len(h)
    height = np.sort(_heights(h, (N * _sample()).astype(np.int64)))
    share = min(1.0, max(12 * num / N**3, 2e-3))
    passing = share ** np.array([1.0, 3 / 4, 1 / 2, 1 / 4])
    return np.append(height[((1.0 - passing) * _SAMPLE).astype(int)], -np.inf)


@cache
def _sample() -> Array:
    """Triples spread evenly, as shares of how many points there are, shape (_SAMPLE, 3).

    They are multiples modulo 1 of powers of 1 / x, x^4 = x + 1: a sequence of low discrepancy.
    """
    powers = 1.2207440846057596 ** -np.arange(1.0, 4.0)
    return frozen((0.5 + np.arange(1, _SAMPLE + 1)[:, None] * powers) % 1.0)


def _above(h: Singles, threshold: float, num: int) -> Ints:
    """The `num` greatest of the triples above a threshold, which rises as they are found."""
    best, height = np.empty((0, 3), int), h[:0, 0]
    covers, fresh, first = _Covers(h > threshold), [best], 0
    while first < len(h):
        last = covers.last_at_once(first)
        fresh.append(covers.triples(first, last))
        first = last
        if sum(map(len, fresh)) > _BLOCK * num or first == len(h):
            best, height = _greatest(h, np.concatenate([best, *fresh]), num)
            fresh = []
            if first < len(h) and len(height) == num and height[-1] > threshold:
                threshold = height[-1]
                covers = _Covers(h > threshold)
    return best


class _Covers:
    """Triples i < j < k of points that cover all directions, from what each covers, shape (N, K).

    The search branches on the uncovered direction with the fewest covering points: j or k must
    cover it. The last point must cover the rarest direction still uncovered.
    """

    def __init__(self, above: Bools) -> None:
        N, K = above.shape
        rarest_first = np.argsort(above.sum(axis=0), kind="stable")
        # Directions that all points cover pad the last word; the last one means none is left.
        num_words = K // 64 + 1
        covered = np.ones((64 * num_words, N), dtype=bool)
        covered[:K] = above.T[rarest_first]
        self._words = _words(covered)
        # Similar directions are covered by the same points: words of dissimilar ones reject more.
        self._mixed = _words(covered.reshape(64, num_words, N).swapaxes(0, 1).reshape(-1, N))
        self._num_points = N
        self._covering = np.flatnonzero(covered)
        self._points = self._covering % N
        self._ends = np.append(0, np.cumsum(covered.sum(axis=1)))
        self._helps = np.triu(covered[self._rarest_left(self._words)], 1)
        self._num_helpers = np.append(0, np.cumsum(self._helps.sum(axis=1)))

    @staticmethod
    def _rarest_left(words: Words) -> Ints:
        """The first direction that is not covered, or the last of all, (L, M) to (M,)."""
        direction = np.full(words.shape[1], 64 * len(words) - 1)
        rows = np.arange(words.shape[1])
        for number, word in enumerate(words):
            left = ~word[rows]
            some = left != 0
            # The lowest bit, a power of two, is exact in floating point.
            lowest = (left[some] & -left[some]).astype(float)
            direction[rows[some]] = 64 * number + np.frexp(lowest)[1] - 1
            rows = rows[~some]
            if not len(rows):
                break
        return direction

    def last_at_once(self, first: int) -> int:
        """One more than the last i, of those from `first`, whose triples fit into the cache."""
        most = self._num_helpers[first] + _AT_ONCE // self._num_points
        return max(first + 1, int(np.searchsorted(self._num_helpers, most, side="right")) - 1)

    def triples(self, first: int, last: int) -> Ints:
        """Those with first <= i < last, ascending, shape (M, 3)."""
        i, j = np.nonzero(self._helps[first:last])
        i += first
        direction = self._rarest_left(self._words[:, i] | self._words[:, j])
        # Only later points than i.
        start = np.searchsorted(self._covering, direction * self._num_points + i, side="right")
        rows, pair = ranges(start, self._ends[direction + 1])
        k = self._points[rows]
        for word in self._mixed:
            covers = np.flatnonzero(((word[i] | word[j])[pair] | word[k]) == _ALL)
            pair, k = pair[covers], k[covers]
        i, j = i[pair], j[pair]
        # Where j and k both help i, the triple is met twice.
        new = (k != j) & ~(self._helps[i, k] & (k < j))
        i, j, k = i[new], j[new], k[new]
        found = np.column_stack([i, np.minimum(j, k), np.maximum(j, k)])
        return found[np.lexsort(found.T[::-1])]


def _words(bits: Bools) -> Words:
    """Bits (64 L, N) as L words of N points each, the lowest bit first, shape (L, N)."""
    octets = np.packbits(bits, axis=0, bitorder="little").reshape(-1, 8, bits.shape[1])
    return np.ascontiguousarray(octets.swapaxes(1, 2)).view("<u8")[..., 0]


def _greatest(h: Singles, triples: Ints, num: int) -> tuple[Ints, Singles]:
    height = _heights(h, triples)
    order = np.argsort(-height, kind="stable")[:num]
    return triples[order], height[order]


def _heights(h: Singles, triples: Ints) -> Singles:
    """min_w max(h_i, h_j, h_k) of triples (M, 3), shape (M,)."""
    height = np.empty(len(triples), h.dtype)
    for rows in np.array_split(np.arange(len(triples)), triples.size * h.shape[1] // _CACHED + 1):
        i, j, k = triples[rows].T
        # In place: new arrays of this size cost more than what is computed.
        highest = h.take(i, axis=0)
        np.maximum(highest, h.take(j, axis=0), out=highest)
        np.maximum(highest, h.take(k, axis=0), out=highest)
        height[rows] = highest.min(axis=1)
    return height

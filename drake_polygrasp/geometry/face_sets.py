"""Sets of two or three regions as rows of integers.

A set is a row of three ascending indices of regions, or of two and -1.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import comb

import numpy as np

from drake_polygrasp.arrays import Ints

CHUNK = 200_000
"""Number of triples evaluated at once, our choice: about 100 MB of temporaries."""


def triples(num_regions: int) -> Iterator[Ints]:
    """Yields all triples i < j < k of regions in lexicographic order, in chunks.

    Args:
        num_regions: number of regions.

    Yields:
        About `CHUNK` triples, shape (M, 3).
    """
    couples = pairs(num_regions)
    later = num_regions - 1 - np.arange(num_regions)
    counts = later * (later - 1) // 2
    chunk_of = np.cumsum(counts) // CHUNK
    for first in np.split(np.arange(num_regions), np.flatnonzero(np.diff(chunk_of)) + 1):
        i = np.repeat(first, counts[first])
        # The pairs of the regions after i are the last pairs of all.
        later_couples = [couples[len(couples) - count :] for count in counts[first]]
        yield np.column_stack([i, np.concatenate([couples[:0], *later_couples])])


def pairs(num_regions: int) -> Ints:
    """Returns all pairs i < j of regions in lexicographic order, shape (M, 2).

    Args:
        num_regions: number of regions.
    """
    region = np.arange(num_regions)
    return np.argwhere(region[:, None] < region)


def first_of_each_set(region: Ints) -> Ints:
    """Returns the first row of each set of regions, in the order of the rows.

    Args:
        region: the regions of three contacts, in any order, shape (M, 3).

    Returns:
        Indices of rows, one for each set, ascending, shape (K,).
    """
    return np.sort(in_order_of_sets(region))


def in_order_of_sets(region: Ints) -> Ints:
    """Returns the first row of each set of regions, in the lexicographic order of the sets.

    Args:
        region: the regions of three contacts, in any order, shape (M, 3).

    Returns:
        Indices of rows, one for each set, shape (K,).
    """
    _, first = np.unique(set_numbers(region), return_index=True)
    return first


def set_numbers(region: Ints) -> Ints:
    """Returns a number for the set of regions of each row, equal for equal sets.

    Args:
        region: the regions of three contacts, in any order, shape (M, 3).

    Returns:
        Shape (M,), in the lexicographic order of the sets.
    """
    return _set_keys(sets_of(region), int(region.max(initial=0)))


def _set_keys(sets: Ints, greatest: int) -> Ints:
    """Returns a number for each set of regions up to `greatest`, in lexicographic order, (M,)."""
    keys: Ints = ((sets + 1) * (greatest + 2) ** np.arange(3)[::-1]).sum(axis=1)
    return keys


def sets_of(region: Ints) -> Ints:
    """Returns the set of regions of each row.

    Args:
        region: the regions of three contacts, in any order, shape (M, 3).

    Returns:
        Each region once, ascending, and -1 for a third where there are two, shape (M, 3).
    """
    sets = np.sort(region, axis=1)
    low, high = sets[:, 0] == sets[:, 1], sets[:, 1] == sets[:, 2]
    sets[low, 1] = sets[low, 2]
    sets[low | high, 2] = -1
    return sets


def rank_within_set(number: Ints) -> Ints:
    """Returns how many earlier rows belong to the same set as each row.

    Args:
        number: the number of each row's set, shape (M,).

    Returns:
        Shape (M,).
    """
    order = np.argsort(number, kind="stable")
    ordered = number[order]
    start = np.searchsorted(ordered, ordered)
    place = np.empty_like(number)
    place[order] = np.arange(len(number)) - start
    return place


def all_sets(num_regions: int) -> Ints:
    """Returns all sets of regions: the triples, then the pairs with -1 as third, shape (M, 3).

    Args:
        num_regions: number of regions.
    """
    couples = np.pad(pairs(num_regions), ((0, 0), (0, 1)), constant_values=-1)
    return np.concatenate([*triples(num_regions), couples])


def rows_in_all_sets(num_regions: int, sets: Ints) -> Ints:
    """Returns the row of each set in `all_sets`.

    Args:
        num_regions: number of regions.
        sets: sets of these regions, shape (M, 3).

    Returns:
        Shape (M,).
    """
    i, j, k = sets.T
    from_i, from_j = num_regions - i, num_regions - j
    # All pairs or triples without those that begin with i or later, and then those before j and k.
    pair = _num_pairs(num_regions) - _num_pairs(from_i) + j - i - 1
    triple = _num_triples(num_regions) - _num_triples(from_i) + k - j - 1
    triple += _num_pairs(from_i - 1) - _num_pairs(from_j)
    rows: Ints = np.where(k < 0, _num_triples(num_regions) + pair, triple)
    return rows


def _num_pairs(count: Ints | int) -> Ints | int:
    return count * (count - 1) // 2


def _num_triples(count: Ints | int) -> Ints | int:
    return count * (count - 1) * (count - 2) // 6


def count_sets(num_regions: int) -> int:
    """Returns the number of triples and pairs of regions.

    Args:
        num_regions: number of regions.
    """
    return comb(num_regions, 3) + comb(num_regions, 2)


def with_sets(sets: Ints, more: Ints) -> Ints:
    """Returns sets followed by those of others that are not among them.

    Args:
        sets: sets without repetition, shape (M, 3).
        more: sets without repetition, shape (K, 3).

    Returns:
        Shape (N, 3), M <= N <= M + K.
    """
    greatest = int(max(sets.max(initial=0), more.max(initial=0)))
    is_new = ~np.isin(_set_keys(more, greatest), _set_keys(sets, greatest))
    return np.concatenate([sets, more[is_new]])


def find_rows(sets: Ints, wanted: Ints) -> Ints:
    """Returns the row of each wanted set.

    Args:
        sets: sets without repetition, shape (M, 3).
        wanted: sets that are all among them, shape (K, 3).

    Returns:
        Indices into `sets`, shape (K,).
    """
    greatest = int(sets.max(initial=0))
    keys = _set_keys(sets, greatest)
    order = np.argsort(keys, kind="stable")
    rows: Ints = order[np.searchsorted(keys[order], _set_keys(wanted, greatest))]
    return rows

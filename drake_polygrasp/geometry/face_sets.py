"""Sets of two or three regions as rows of integers: all of them, their keys, and where they are."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb

import numpy as np

from drake_polygrasp.arrays import Ints

CHUNK = 200_000
"""Triples evaluated at once, ours: some 100 MB of intermediate arrays."""


def triples(num_regions: int) -> Iterator[Ints]:
    """All i < j < k in lexicographic order, in chunks of about CHUNK rows of shape (M, 3)."""
    couples = pairs(num_regions)
    later = num_regions - 1 - np.arange(num_regions)
    counts = later * (later - 1) // 2
    chunk_of = np.cumsum(counts) // CHUNK
    for first in np.split(np.arange(num_regions), np.flatnonzero(np.diff(chunk_of)) + 1):
        i = np.repeat(first, counts[first])
        # The pairs of the regions after i are the last of all.
        later_couples = [couples[len(couples) - count :] for count in counts[first]]
        yield np.column_stack([i, np.concatenate([couples[:0], *later_couples])])


def pairs(num_regions: int) -> Ints:
    """All i < j, shape (M, 2)."""
    region = np.arange(num_regions)
    return np.argwhere(region[:, None] < region)


def first_of_each_set(region: Ints) -> Ints:
    """The first row of each set of regions, ascending, (M, 3) to (K,)."""
    return np.sort(in_order_of_sets(region))


def in_order_of_sets(region: Ints) -> Ints:
    """The first row of each set of regions, in the order of the sets, (M, 3) to (K,)."""
    _, first = np.unique(set_numbers(region), return_index=True)
    return first


def set_numbers(region: Ints) -> Ints:
    """A number for each row's set of regions, equal for equal sets, (M, 3) to (M,)."""
    return set_keys(sets_of(region), int(region.max(initial=0)))


def set_keys(sets: Ints, greatest: int) -> Ints:
    """A number for each set of regions -1 to `greatest`, in the sets' order, (M, 3) to (M,)."""
    keys: Ints = ((sets + 1) * (greatest + 2) ** np.arange(3)[::-1]).sum(axis=1)
    return keys


def sets_of(region: Ints) -> Ints:
    """The regions of each row once, ascending; -1 for a pair's third, (M, 3) to (M, 3)."""
    sets = np.sort(region, axis=1)
    low, high = sets[:, 0] == sets[:, 1], sets[:, 1] == sets[:, 2]
    sets[low, 1] = sets[low, 2]
    sets[low | high, 2] = -1
    return sets


def rank_within_set(number: Ints) -> Ints:
    """How many rows of the same set come before each, (M,) to (M,)."""
    order = np.argsort(number, kind="stable")
    ordered = number[order]
    start = np.searchsorted(ordered, ordered)
    place = np.empty_like(number)
    place[order] = np.arange(len(number)) - start
    return place


def all_sets(num_regions: int) -> Ints:
    """All triples, then all pairs with a third of -1, shape (M, 3)."""
    couples = np.pad(pairs(num_regions), ((0, 0), (0, 1)), constant_values=-1)
    return np.concatenate([*triples(num_regions), couples])


def count_sets(num_regions: int) -> int:
    """How many triples and pairs there are."""
    return comb(num_regions, 3) + comb(num_regions, 2)


def with_sets(sets: Ints, more: Ints) -> Ints:
    """Sets (M, 3), and those of more (K, 3) that are not among them, both without repetition."""
    greatest = int(max(sets.max(initial=0), more.max(initial=0)))
    is_new = ~np.isin(set_keys(more, greatest), set_keys(sets, greatest))
    return np.concatenate([sets, more[is_new]])


def find_rows(sets: Ints, wanted: Ints) -> Ints:
    """Where each wanted set is among the sets, which hold it."""
    greatest = int(sets.max(initial=0))
    keys = set_keys(sets, greatest)
    order = np.argsort(keys, kind="stable")
    rows: Ints = order[np.searchsorted(keys[order], set_keys(wanted, greatest))]
    return rows

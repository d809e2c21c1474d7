"""Batches of rows: what is taken and joined, in which order, and within batches of batches."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from drake_polygrasp.arrays import (
    Array,
    Batch,
    Ints,
    batches,
    distinct_values,
    join_rows,
)


@dataclass(frozen=True, eq=False)
class Points(Batch):
    p: Array


@dataclass(frozen=True, eq=False)
class Owned(Batch):
    owner: Ints
    points: Points


def owned(*owners: int) -> Owned:
    owner = np.array(owners)
    return Owned(owner, Points(10.0 * owner[:, None] + np.arange(3)))


def test_rows_are_taken_in_the_order_asked_by_index_mask_or_slice() -> None:
    some = owned(1, 2, 3)
    for rows, owners in (
        (np.array([2, 0, 2]), [3, 1, 3]),
        (np.array([False, True, True]), [2, 3]),
        (slice(1), [1]),
    ):
        taken = some.take(rows)
        assert taken.owner.tolist() == owners
        assert taken.points.p[:, 1].tolist() == [10 * owner + 1 for owner in owners]


def test_joined_rows_follow_each_other() -> None:
    joined = join_rows(owned(1, 2), owned(), owned(3))
    assert isinstance(joined, Owned)
    assert joined.owner.tolist() == [1, 2, 3]
    assert joined.points.p.tolist() == owned(1, 2, 3).points.p.tolist()


@pytest.mark.parametrize("axis", [None, 0, 1])
def test_distinct_values_are_numpy_s(axis: int | None) -> None:
    values = np.array([[2, 1, 2], [0, 1, 0], [2, 1, 2]])
    np.testing.assert_array_equal(distinct_values(values, axis), np.unique(values, axis=axis))


@pytest.mark.parametrize(("size", "expected"), [(2, [[0, 1], [2]]), (0, [[0], [1], [2]])])
def test_slices_hold_every_row_once_and_at_least_one_row_each(size, expected) -> None:
    assert [list(range(3))[some] for some in batches(3, size)] == expected

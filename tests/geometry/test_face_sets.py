"""Sets of faces: each once, in order, with the place of each row in its set."""

from __future__ import annotations

from itertools import combinations
from math import comb

import numpy as np
import pytest

from drake_polygrasp.geometry import face_sets
from drake_polygrasp.geometry.face_sets import (
    all_sets,
    pairs,
    rank_within_set,
    rows_in_all_sets,
    triples,
    with_sets,
)


@pytest.mark.parametrize("chunk", [1, 7, 50, 10**6])
def test_every_set_comes_once_and_in_order(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(face_sets, "CHUNK", chunk)
    for n in range(12):
        found = [tuple(row) for batch in triples(n) for row in batch.tolist()]
        assert found == list(combinations(range(n), 3))
        assert [tuple(row) for row in pairs(n).tolist()] == list(combinations(range(n), 2))
    sizes = [len(batch) for batch in triples(11)]
    assert max(sizes) < chunk + comb(10, 2)


def test_every_set_is_found_in_its_row() -> None:
    for n in range(9):
        sets = all_sets(n)
        np.testing.assert_array_equal(rows_in_all_sets(n, sets), np.arange(len(sets)))


def test_rows_of_one_set_are_counted() -> None:
    assert rank_within_set(np.array([7, 3, 7, 7, 3])).tolist() == [0, 0, 1, 2, 1]


def test_sets_are_joined_without_repetition() -> None:
    sets, more = np.array([[0, 1, 2], [0, 1, -1]]), np.array([[0, 1, -1], [1, 2, -1], [0, 1, 2]])
    assert with_sets(sets, more).tolist() == [[0, 1, 2], [0, 1, -1], [1, 2, -1]]
    assert with_sets(sets[:0], more).tolist() == more.tolist()

"""Searches side by side: what is done together, and in which order."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from drake_polygrasp.region_bounds.side_by_side import Search, Work, result_of, run_side_by_side


@dataclass(frozen=True)
class Doubling(Work[int]):
    """Asks for twice a number; large ones may wait."""

    number: int
    done: ClassVar[list[list[int]]] = []

    def kind(self) -> Hashable:
        return self.number >= 100

    def may_wait(self) -> bool:
        return self.number >= 100

    @classmethod
    def together(cls, works: Sequence[Doubling]) -> list[int]:
        cls.done.append([work.number for work in works])
        return [2 * work.number for work in works]


def doubled(*numbers: int) -> Search[list[int]]:
    results = []
    for number in numbers:
        results.append((yield from result_of(Doubling(number))))
    return results


def test_work_that_may_wait_is_done_once_all_searches_wait_for_it():
    Doubling.done.clear()
    found = run_side_by_side([doubled(100), doubled(1, 2, 101), doubled(3, 102), doubled(103)])
    assert found == [[200], [2, 4, 202], [6, 204], [206]]
    assert Doubling.done == [[1, 3], [2], [100, 101, 102, 103]]

"""Runs searches side by side, so that array work of one kind is done for all of them at once.

A search is a generator that yields the work that it waits for, and is sent what comes of it.
Searches of several grasps ask for the same kinds of work, each on arrays so short that calling
NumPy costs more than computing; together they take a fraction of the time.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Generator, Hashable, Sequence
from typing import Any, Generic, Self, TypeAlias, TypeVar

T = TypeVar("T")


class Work(ABC, Generic[T]):
    """Array work that a search waits for."""

    def kind(self) -> Hashable:
        """Returns what tells whether work can be done together: it can if kinds are equal."""
        return None

    def may_wait(self) -> bool:
        """Returns whether work of other kinds goes first, so that more of this is done together."""
        return False

    @classmethod
    @abstractmethod
    def together(cls, works: Sequence[Self]) -> list[T]:
        """Does work of one kind, each as it would be done alone.

        Args:
            works: what is asked for.

        Returns:
            What comes of each.
        """


Search: TypeAlias = Generator[Work[Any], Any, T]
"""A search that ends with a T."""


def result_of(work: Work[T]) -> Search[T]:
    """Yields work and returns what comes of it, for `yield from` in a search.

    Args:
        work: what a search waits for.

    Returns:
        What comes of it.
    """
    result: T = yield work
    return result


def run_side_by_side(searches: Sequence[Search[T]]) -> list[T]:
    """Runs searches to their ends; the kind of work for which most of them wait is done first.

    Work that may wait is done when all searches that have not ended wait for such.

    Args:
        searches: that have not begun.

    Returns:
        What each ends with.
    """
    results: dict[int, T] = {}
    answers: dict[int, Any] = dict.fromkeys(range(len(searches)))
    waiting: dict[int, Work[Any]] = {}
    while answers or waiting:
        for k, answer in answers.items():
            try:
                waiting[k] = searches[k].send(answer)
            except StopIteration as ended:
                results[k] = ended.value
        kinds: dict[Hashable, list[int]] = {}
        for k in sorted(waiting):
            kinds.setdefault((type(waiting[k]), waiting[k].kind()), []).append(k)
        urgent = [group for group in kinds.values() if not waiting[group[0]].may_wait()]
        most = max(urgent or kinds.values(), key=len, default=[])
        works = [waiting.pop(k) for k in most]
        answers = dict(zip(most, type(works[0]).together(works), strict=True)) if works else {}
    return [results[k] for k in range(len(searches))]

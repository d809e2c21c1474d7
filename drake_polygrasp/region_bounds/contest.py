"""Ends searches for bounds that cannot be as great as is asked."""

from __future__ import annotations

_MARGIN = 1e-3
"""Our choice, relative: how far below what is asked a search is lost. What it may prove is found on
a grid of forces, and may be too low by a part of this."""


class LostError(Exception):
    """A search cannot prove what is asked for."""


class Contest:
    """Searches that compete for the greatest lower bounds."""

    def __init__(self, wanted: int) -> None:
        """Knows of no search yet.

        Args:
            wanted: how many of the greatest bounds are asked for.
        """
        self._wanted = wanted
        self._proved: dict[int, float] = {}

    def enter(self, search: int, least: float, lower: float, ceiling: float) -> None:
        """Takes note of what a search has proved, and ends it if it is lost.

        Args:
            search: its number.
            least: what it is to prove at least; less does not count against others.
            lower: a lower bound that it has proved.
            ceiling: what it may prove at most.

        Raises:
            LostError: if it cannot reach `least`, or as many others as are wanted have proved more
                than it can.
        """
        if lower >= least:
            self._proved[search] = max(lower, self._proved.get(search, 0.0))
        others = sorted(bound for k, bound in self._proved.items() if k != search)
        if len(others) >= self._wanted:
            least = max(least, others[-self._wanted])
        if ceiling < least * (1.0 - _MARGIN):
            raise LostError

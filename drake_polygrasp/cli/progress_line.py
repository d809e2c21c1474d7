"""Shows progress as one line on standard error, overwritten and finally erased.

Nothing is shown where standard error is not a terminal.
"""

from __future__ import annotations

import sys
from time import perf_counter
from typing import Self

_DELAY_SECONDS = 1.0
"""Time before the line first appears [s]. Our choice."""
REFRESH_SECONDS = 0.5
"""Time between two updates of the line [s]. Our choice."""


class ProgressLine:
    """A line on the terminal that says what is being done, how much of it and for how long.

    It is a context manager: leaving it erases the line.

    Args:
        name: what is being done: "planning grasps of cube.sdf".
        unit: plural of what is counted ("grasps"); empty where nothing is.
        quiet: whether nothing is shown, not even on a terminal.
    """

    def __init__(self, name: str, unit: str = "", *, quiet: bool = False) -> None:
        self._name, self._unit = name, unit
        stream = sys.stderr
        self._shown = not quiet and stream is not None and stream.isatty()
        self._start, self._next = perf_counter(), _DELAY_SECONDS
        self._count, self._dirty = "", False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.erase()

    @property
    def elapsed(self) -> float:
        """Time since the start [s]."""
        return perf_counter() - self._start

    def erase(self) -> None:
        """Erases the line until it is next due, so that another may be printed."""
        if self._dirty:
            self._dirty = False
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

    def update(self, done: int, total: int) -> None:
        """Sets the counts to show, and refreshes the line if it is due.

        Args:
            done: how many units are done.
            total: how many there are.
        """
        self.show(f"{done:,} of {total:,} {self._unit}")

    def show(self, count: str) -> None:
        """Sets what is shown to be done, and refreshes the line if it is due.

        Args:
            count: how much is done, in words.
        """
        self._count = f" {count},"
        self.refresh()

    def refresh(self) -> None:
        """Rewrites the line if `REFRESH_SECONDS` have passed since the last time."""
        elapsed = self.elapsed
        if self._shown and elapsed >= self._next:
            self._next, self._dirty = elapsed + REFRESH_SECONDS, True
            line = f"\r{self._name} ...{self._count} {elapsed:.0f} s\x1b[K"
            print(line, end="", file=sys.stderr, flush=True)

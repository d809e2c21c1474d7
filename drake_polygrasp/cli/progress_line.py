"""One line of progress on standard error, where that is a terminal; written over and wiped off."""

from __future__ import annotations

import sys
from time import perf_counter
from typing import Self

PATIENCE, TICK = 1.0, 0.5
"""[s] before the first word on progress, and between the next; ours."""


class ProgressLine:
    """Says what is being done and for how long; after a second, and to a terminal only."""

    def __init__(self, name: str, unit: str = "", *, quiet: bool = False) -> None:
        """Of a task with a name for people, counted in units ("grasps") where it counts."""
        self._name, self._unit = name, unit
        stream = sys.stderr
        self._shown = not quiet and stream is not None and stream.isatty()
        self._start, self._next = perf_counter(), PATIENCE
        self._count, self._dirty = "", False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._dirty:
            print("\r\x1b[K", end="", file=sys.stderr, flush=True)

    @property
    def elapsed(self) -> float:
        """[s] since the start."""
        return perf_counter() - self._start

    def tell(self, done: int, total: int) -> None:
        """Says how many units are done, from the next tick on."""
        self._count = f" {done:,} of {total:,} {self._unit},"
        self.tick()

    def tick(self) -> None:
        """Writes the line anew if it is time to."""
        elapsed = self.elapsed
        if self._shown and elapsed >= self._next:
            self._next, self._dirty = elapsed + TICK, True
            line = f"\r{self._name} ...{self._count} {elapsed:.0f} s\x1b[K"
            print(line, end="", file=sys.stderr, flush=True)

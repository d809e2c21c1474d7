"""The callback by which long computations report their progress."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]
"""A function that is called with the number of steps done and the greatest number of steps."""


def no_progress(done: int, total: int) -> None:
    """Ignores the progress, for callers that pass no callback.

    Args:
        done: number of steps done.
        total: greatest number of steps.
    """

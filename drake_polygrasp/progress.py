"""How functions that take long say how far they are."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeAlias

Progress: TypeAlias = Callable[[int, int], None]
"""Called with how many pieces of the work are done, and of how many at most."""


def no_progress(done: int, total: int) -> None:
    """Tells nobody."""

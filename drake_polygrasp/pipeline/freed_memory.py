"""Keeps the memory that a plan frees, so that planning does not fault it in again and again."""

from __future__ import annotations

import numpy as np

_BYTES = 16 << 20
"""Our choice: more than a plan allocates and frees repeatedly."""


def keep_freed_memory() -> None:
    """Lets the C library keep what arrays free, instead of returning it to the system at once.

    glibc keeps twice the largest block that was ever freed, 128 kB at first. Until something
    frees more, a quick plan's arrays are returned and faulted in 2,000 times, which takes a
    quarter of its time. The block freed here is never touched and so costs nothing.
    """
    np.empty(_BYTES, dtype=np.uint8)

"""The types of arrays, the one way to make them read-only, ragged rows, and their memory."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Shapes = npt.NDArray[np.object_]
"""Of shapely geometries."""

_KEPT = 16 << 20
"""[bytes], ours: what a plan makes and frees again and again is less."""


def keep_freed_memory() -> None:
    """Lets the C library keep what arrays free, instead of returning it to the system at once.

    glibc keeps twice the largest block that was ever freed, 128 kB at first. Until something
    frees more, a quick plan's arrays are given back and faulted in 2,000 times, which takes a
    quarter of its time. This block is never touched and so costs nothing.
    """
    np.empty(_KEPT, dtype=np.uint8)


def batches(count: int, size: int) -> Iterator[slice]:
    """Yields slices of at most `size` rows that together are `count` rows, in order."""
    for start in range(0, count, max(1, size)):
        yield slice(start, min(start + size, count))


def frozen(values: npt.ArrayLike, dtype: Any = np.float64) -> npt.NDArray[Any]:
    """A read-only copy of `values`; -0.0 becomes 0.0, so that equal values print alike."""
    array = np.array(values, dtype=dtype)
    if array.dtype.kind == "f":
        array += 0.0
    array.flags.writeable = False
    return array


def gather(offsets: Ints, rows: Ints) -> tuple[Ints, Ints]:
    """Flat indices of the items of `rows`, and the row (0..K-1) that owns each of them."""
    return ranges(offsets[rows], offsets[rows + 1])


def ranges(starts: Ints, ends: Ints) -> tuple[Ints, Ints]:
    """The integers from each start to before its end, and whose (0..K-1) each of them is."""
    counts = ends - starts
    before = np.cumsum(counts) - counts
    owner = np.repeat(np.arange(len(starts)), counts)
    return np.arange(counts.sum()) + (starts - before)[owner], owner

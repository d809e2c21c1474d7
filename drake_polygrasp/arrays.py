"""Types of arrays, read-only copies, batches of rows, and ragged rows."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, Self, TypeVar

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Shapes = npt.NDArray[np.object_]
"""Of shapely geometries."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Base of dataclasses whose fields are arrays, or batches again, of one row for each item."""

    def take(self, rows: Ints | Bools | slice) -> Self:
        """Returns some of the rows.

        Args:
            rows: their indices, in the order wanted, a mask of all rows, or a slice of them.
        """
        return type(self)(
            *(
                column.take(rows) if isinstance(column, Batch) else column[rows]
                for column in self._columns()
            )
        )

    def _columns(self) -> list[Any]:
        return [getattr(self, field.name) for field in fields(self)]


AnyBatch = TypeVar("AnyBatch", bound=Batch)


def join_rows(first: AnyBatch, *others: AnyBatch) -> AnyBatch:
    """Returns all rows of batches of one type, in their order."""
    columns = zip(*(batch._columns() for batch in (first, *others)), strict=True)
    return type(first)(
        *(
            join_rows(*parts) if isinstance(parts[0], Batch) else np.concatenate(parts)
            for parts in columns
        )
    )


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

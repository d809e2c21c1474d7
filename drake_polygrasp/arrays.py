"""Array types, read-only copies, batches of rows, and ragged arrays."""

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
"""Arrays of shapely geometries."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Base of dataclasses whose fields are arrays, or batches, with one row for each item."""

    def take(self, rows: Ints | Bools | slice) -> Self:
        """Returns a batch of some of the rows.

        Args:
            rows: indices, in the order wanted; or a mask, shape (rows,); or a slice.
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
    """Returns one batch of the rows of several.

    Args:
        first: the batch whose rows come first.
        others: batches of the same type, in their order.
    """
    columns = zip(*(batch._columns() for batch in (first, *others)), strict=True)
    return type(first)(
        *(
            join_rows(*parts) if isinstance(parts[0], Batch) else np.concatenate(parts)
            for parts in columns
        )
    )


def batches(count: int, size: int) -> Iterator[slice]:
    """Yields slices that divide rows into parts of bounded size, in order.

    Args:
        count: number of rows.
        size: most rows in one slice; less than 1 counts as 1.
    """
    size = max(1, size)
    for start in range(0, count, size):
        yield slice(start, min(start + size, count))


def frozen(values: npt.ArrayLike, dtype: Any = np.float64) -> npt.NDArray[Any]:
    """Returns a read-only copy; -0.0 becomes 0.0, so that equal values print alike.

    Args:
        values: an array or nested sequence, any shape.
        dtype: element type of the copy.
    """
    array = np.array(values, dtype=dtype)
    if array.dtype.kind == "f":
        array += 0.0
    array.flags.writeable = False
    return array


def distinct_values(values: npt.NDArray[Any], axis: int | None = None) -> npt.NDArray[Any]:
    """Returns the distinct values of an array, ascending.

    `np.unique` does the same, but first imports `numpy.ma`, which takes longer than all calls of it
    in planning a small object.

    Args:
        values: any shape.
        axis: the axis along which equal rows count once; None for single values.

    Returns:
        One-dimensional, or with fewer rows along `axis`.
    """
    return np.unique(values, return_index=True, axis=axis)[0]


def gather(offsets: Ints, rows: Ints) -> tuple[Ints, Ints]:
    """Returns where the items of some rows of a ragged array are, and whose each of them is.

    Args:
        offsets: row r owns the items offsets[r] to offsets[r + 1] - 1, shape (R + 1,).
        rows: indices of rows, shape (K,).

    Returns:
        Indices of the N items of these rows, shape (N,), and the position in `rows` (0 to K - 1)
        of the row that owns each, shape (N,).
    """
    return ranges(offsets[rows], offsets[rows + 1])


def ranges(starts: Ints, ends: Ints) -> tuple[Ints, Ints]:
    """Returns the integers of several half-open ranges, and the range of each.

    Args:
        starts: first integer of each range, shape (K,).
        ends: one more than its last integer, shape (K,); equal to the start if it is empty.

    Returns:
        The N integers, range by range, shape (N,), and the index of the range (0 to K - 1) that
        each is from, shape (N,).
    """
    counts = ends - starts
    before = np.cumsum(counts) - counts
    owner = np.repeat(np.arange(len(starts)), counts)
    return np.arange(counts.sum()) + (starts - before)[owner], owner

"""The types of arrays, and the one way to make them read-only."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


def frozen(values: npt.ArrayLike, dtype: Any = np.float64) -> npt.NDArray[Any]:
    """A read-only copy of `values`; -0.0 becomes 0.0, so that equal values print alike."""
    array = np.array(values, dtype=dtype)
    if array.dtype.kind == "f":
        array += 0.0
    array.flags.writeable = False
    return array

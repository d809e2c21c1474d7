"""Numbers as grasp files state them: decimals of as many digits as mean something.

Numbers are rounded before anything is proved or bounded of them, so that what is claimed is true of
the decimals in the file, and so that the last bits of a computation, which differ between
processors, reach no file.
"""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal

import numpy as np

from drake_polygrasp.arrays import Array

EXACT = 12
"""Significant digits of contacts and of what follows from them exactly: a picometre on a metre."""
BOUNDS = 6
"""Significant digits of bounds, ours: they are a few percent from what they bound."""
_MOST_DECIMALS = 22
"""Powers of ten up to this are doubles, so that quotients by them are the nearest to decimals."""


def on_grid(lengths: Array, size: float, digits: int = EXACT) -> Array:
    """Rounds lengths to multiples of one power of ten, so that small ones keep no more of it.

    Args:
        lengths: of any shape [m].
        size: of what they are measured on [m]; it keeps `digits` significant digits.
        digits: how many.
    """
    decimals = min(digits - 1 - Decimal(size).adjusted(), _MOST_DECIMALS)
    # Adding 0.0 makes -0.0, which prints differently, 0.0.
    return np.asarray(np.round(lengths, decimals) + 0.0)


def to_decimals(values: Array) -> Array:
    """Rounds numbers of the order of one, as components of unit vectors and angles, to `EXACT`."""
    return np.asarray(np.round(values, EXACT) + 0.0)


def significant(values: Array, digits: int = EXACT) -> Array:
    """Rounds each number to significant digits; NaN and infinities stay."""
    rounded = [float(f"{value:.{digits - 1}e}") for value in np.ravel(values).tolist()]
    return np.array(rounded).reshape(np.shape(values)) + 0.0


def at_most(value: float, digits: int = BOUNDS) -> float:
    """Rounds a finite number down to significant digits: for what is claimed as a lower bound."""
    return float(Context(prec=digits, rounding=ROUND_FLOOR).create_decimal(repr(float(value))))


def at_least(value: float, digits: int = BOUNDS) -> float:
    """Rounds a finite number up to significant digits: for what is claimed as an upper bound."""
    return float(Context(prec=digits, rounding=ROUND_CEILING).create_decimal(repr(float(value))))

"""Rounds numbers to the decimals that grasp files state.

Contacts and forces are rounded before anything is proved of them, and bounds in the safe direction:
so claims are true of the decimals in the file, and the last bits of a computation, which differ
between processors, reach no file.
"""

from __future__ import annotations

from decimal import ROUND_CEILING, ROUND_FLOOR, Context, Decimal

import numpy as np

from drake_polygrasp.arrays import Array

EXACT = 12
"""Significant digits of contacts and of numbers that follow from them exactly: 1 pm on 1 m."""
BOUNDS = 6
"""Our choice: significant digits of bounds, which are a few percent from what they bound."""
_MOST_DECIMALS = 22
"""Powers of ten up to this exponent are doubles, so that dividing by them rounds correctly."""


def on_grid(lengths: Array, size: float, digits: int = EXACT) -> Array:
    """Rounds lengths to multiples of one power of ten, set by the size of the object.

    Args:
        lengths: lengths or coordinates [m], any shape.
        size: length that keeps `digits` significant digits, above 0 [m].
        digits: number of significant digits.

    Returns:
        The rounded lengths [m], same shape.
    """
    decimals = min(digits - 1 - Decimal(size).adjusted(), _MOST_DECIMALS)
    # Adding 0.0 makes -0.0, which prints differently, 0.0.
    return np.asarray(np.round(lengths, decimals) + 0.0)


def to_decimals(values: Array) -> Array:
    """Rounds numbers of the order of 1 to `EXACT` decimals.

    Args:
        values: components of unit vectors, angles [rad] or coefficients, any shape.

    Returns:
        The rounded numbers, same shape.
    """
    return np.asarray(np.round(values, EXACT) + 0.0)


def significant(values: Array, digits: int = EXACT) -> Array:
    """Rounds each number to significant digits; NaN and infinities stay.

    Args:
        values: numbers, any shape.
        digits: number of significant digits.

    Returns:
        The rounded numbers, same shape.
    """
    rounded = [float(f"{value:.{digits - 1}e}") for value in np.ravel(values).tolist()]
    return np.array(rounded).reshape(np.shape(values)) + 0.0


def at_most(value: float, digits: int = BOUNDS) -> float:
    """Rounds a finite number down to significant digits, for lower bounds.

    Args:
        value: the number.
        digits: number of significant digits.

    Returns:
        The greatest such decimal that is at most `value`.
    """
    return float(Context(prec=digits, rounding=ROUND_FLOOR).create_decimal(repr(float(value))))


def at_least(value: float, digits: int = BOUNDS) -> float:
    """Rounds a finite number up to significant digits, for upper bounds.

    Args:
        value: the number.
        digits: number of significant digits.

    Returns:
        The least such decimal that is at least `value`.
    """
    return float(Context(prec=digits, rounding=ROUND_CEILING).create_decimal(repr(float(value))))

"""Converts the words of a file to arrays of numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arrays import Array, Ints


def floats(words: list[bytes]) -> Array:
    """Returns words as numbers.

    Args:
        words: words of a file.

    Returns:
        The numbers, shape (n,).

    Raises:
        ValueError: naming the first word that is not one.
    """
    return np.asarray(_numbers(words, np.float64))


def integers(words: list[bytes]) -> Ints:
    """Returns words as whole numbers.

    Args:
        words: words of a file.

    Returns:
        The numbers, shape (n,).

    Raises:
        ValueError: naming the first word that is not one.
    """
    return np.asarray(_numbers(words, np.int64))


def _numbers(words: list[bytes], dtype: type) -> npt.NDArray[Any]:
    try:
        return np.array(words, dtype=bytes).astype(dtype) if words else np.empty(0, dtype)
    except (ValueError, OverflowError):
        wrong = next(word for word in words if not _is_number(word, dtype))
        raise ValueError(f"'{wrong[:40].decode(errors='replace')}' is not a number") from None


def _is_number(word: bytes, dtype: type) -> bool:
    try:
        np.array([word]).astype(dtype)
    except (ValueError, OverflowError):
        return False
    return True

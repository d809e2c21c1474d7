"""Algebra of short vectors: over the last axis of arrays of any shape, or over the first.

NumPy leaves `@`, `np.dot` and the norm of one vector to BLAS, whose last bits depend on the
processor. What decides what is planned is computed by the functions here instead, as sums in one
order everywhere.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arrays import Array


def dot(a: Array, b: Array) -> Array:
    """Scalar products."""
    product: Array = np.einsum("...i,...i->...", a, b)
    return product


def circle(angles: npt.NDArray[np.floating[Any]]) -> Array:
    """Points of the unit circle at angles [rad], (...) to (..., 2).

    To fourteen decimals, for the C library's last bits depend on the processor too.
    """
    points: Array = np.round(np.stack([np.cos(angles), np.sin(angles)], axis=-1), 14)
    return points


def times(vectors: Array, matrix: Array) -> Array:
    """Row vectors times one matrix or vector, (..., j) and (j, k) or (j,) to (..., k) or (...)."""
    *shape, _ = vectors.shape
    # One component after another of all vectors: contiguous, hence several times faster.
    columns = np.ascontiguousarray(vectors.reshape(-1, len(matrix)).T)
    if matrix.ndim == 1:
        values: Array = np.einsum("jn,j->n", columns, matrix)
        return values.reshape(shape)
    products: Array = np.einsum("jn,jk->kn", columns, matrix).T
    return products.reshape(*shape, matrix.shape[1])


def transformed(matrices: Array, vectors: Array) -> Array:
    """Matrices times column vectors, (..., i, j) and (..., j) to (..., i); shapes broadcast."""
    products: Array = np.einsum("...ij,...j->...i", matrices, vectors)
    return products


def product(a: Array, b: Array) -> Array:
    """Products of matrices, (..., i, j) and (..., j, k) to (..., i, k); shapes broadcast."""
    total: Array = a[..., :1] * b[..., :1, :]
    for j in range(1, a.shape[-1]):
        total += a[..., j, None] * b[..., None, j, :]
    return total


def cross(a: Array, b: Array) -> Array:
    """Vector products; several times faster than NumPy's for short arrays."""
    a_x, a_y, a_z = a[..., 0], a[..., 1], a[..., 2]
    b_x, b_y, b_z = b[..., 0], b[..., 1], b[..., 2]
    x = a_y * b_z - a_z * b_y
    product = np.empty((*x.shape, 3))
    product[..., 0] = x
    product[..., 1] = a_z * b_x - a_x * b_z
    product[..., 2] = a_x * b_y - a_y * b_x
    return product


def cross_first(a: Array, b: Array) -> Array:
    """Vector products over the first axis: of many vectors, each operation is contiguous."""
    x = a[1] * b[2] - a[2] * b[1]
    product = np.empty((3, *x.shape), x.dtype)
    product[0] = x
    product[1] = a[2] * b[0] - a[0] * b[2]
    product[2] = a[0] * b[1] - a[1] * b[0]
    return product


def unit(vectors: Array) -> Array:
    """The vectors divided by their lengths; zero stays zero."""
    length = np.sqrt(dot(vectors, vectors))[..., None]
    directions: Array = vectors / np.where(length > 0, length, 1.0)
    return directions

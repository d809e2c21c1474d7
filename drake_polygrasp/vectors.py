"""Algebra of short vectors, over the last axis of arrays of any shape or over the first.

NumPy leaves `@`, `np.dot` and the norm of one vector to BLAS, whose last bits depend on the
processor. Values that decide what is planned are computed by these functions instead, which add in
a fixed order on every processor.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arrays import Array


def dot(a: Array, b: Array) -> Array:
    """Returns scalar products.

    Args:
        a: vectors, shape (..., k).
        b: vectors; shapes broadcast.

    Returns:
        The products, shape (...).
    """
    product: Array = np.einsum("...i,...i->...", a, b)
    return product


def dot_first(a: Array, b: Array) -> Array:
    """Returns scalar products over the first axis, each the same whatever others there are.

    Args:
        a: vectors, shape (3, ...).
        b: vectors; shapes broadcast.

    Returns:
        The products, shape (...).
    """
    product: Array = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    return product


def circle(angles: npt.NDArray[np.floating[Any]]) -> Array:
    """Returns points of the unit circle, rounded to fourteen decimals.

    The last bits of the C library's sine and cosine depend on the processor too.

    Args:
        angles: angles from the x axis [rad], shape (...).

    Returns:
        The points (cos, sin), shape (..., 2).
    """
    points: Array = np.round(np.stack([np.cos(angles), np.sin(angles)], axis=-1), 14)
    return points


def times(vectors: Array, matrix: Array) -> Array:
    """Returns row vectors times one matrix or vector.

    Args:
        vectors: row vectors, shape (..., j).
        matrix: a matrix, shape (j, k), or a vector, shape (j,).

    Returns:
        The products, shape (..., k) or (...).
    """
    *shape, _ = vectors.shape
    # Component by component over all vectors, in contiguous memory: several times faster.
    columns = np.ascontiguousarray(vectors.reshape(-1, len(matrix)).T)
    if matrix.ndim == 1:
        values: Array = np.einsum("jn,j->n", columns, matrix)
        return values.reshape(shape)
    products: Array = np.einsum("jn,jk->kn", columns, matrix).T
    return products.reshape(*shape, matrix.shape[1])


def transformed(matrices: Array, vectors: Array) -> Array:
    """Returns matrices times column vectors.

    Args:
        matrices: matrices, shape (..., i, j).
        vectors: column vectors, shape (..., j); shapes broadcast.

    Returns:
        The products, shape (..., i).
    """
    products: Array = np.einsum("...ij,...j->...i", matrices, vectors)
    return products


def product(a: Array, b: Array) -> Array:
    """Returns products of matrices.

    Args:
        a: matrices, shape (..., i, j).
        b: matrices, shape (..., j, k); shapes broadcast.

    Returns:
        The products, shape (..., i, k).
    """
    total: Array = a[..., :1] * b[..., :1, :]
    for j in range(1, a.shape[-1]):
        total += a[..., j, None] * b[..., None, j, :]
    return total


def cross(a: Array, b: Array) -> Array:
    """Returns vector products, several times faster than NumPy's for short arrays.

    Args:
        a: vectors, shape (..., 3).
        b: vectors; shapes broadcast.

    Returns:
        The products a x b, shape (..., 3).
    """
    a_x, a_y, a_z = a[..., 0], a[..., 1], a[..., 2]
    b_x, b_y, b_z = b[..., 0], b[..., 1], b[..., 2]
    x = a_y * b_z - a_z * b_y
    product = np.empty((*x.shape, 3))
    product[..., 0] = x
    product[..., 1] = a_z * b_x - a_x * b_z
    product[..., 2] = a_x * b_y - a_y * b_x
    return product


def cross_first(a: Array, b: Array) -> Array:
    """Returns vector products over the first axis, whose components are contiguous in memory.

    Args:
        a: vectors, shape (3, ...).
        b: vectors; shapes broadcast.

    Returns:
        The products a x b, shape (3, ...).
    """
    x = a[1] * b[2] - a[2] * b[1]
    product = np.empty((3, *x.shape), x.dtype)
    product[0] = x
    product[1] = a[2] * b[0] - a[0] * b[2]
    product[2] = a[0] * b[1] - a[1] * b[0]
    return product


def unit(vectors: Array) -> Array:
    """Returns vectors divided by their lengths; zero stays zero.

    Args:
        vectors: vectors, shape (..., k).

    Returns:
        The unit vectors, same shape.
    """
    length = np.sqrt(dot(vectors, vectors))[..., None]
    directions: Array = vectors / np.where(length > 0, length, 1.0)
    return directions


def unit_first(vectors: Array) -> Array:
    """Returns vectors over the first axis divided by their lengths; zero stays zero.

    Args:
        vectors: vectors, shape (3, ...).

    Returns:
        The unit vectors, same shape.
    """
    length = np.sqrt(dot_first(vectors, vectors))
    directions: Array = vectors / np.where(length > 0, length, 1.0)
    return directions

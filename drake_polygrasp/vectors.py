"""Algebra of short vectors: over the last axis of arrays of any shape, or over the first."""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array


def dot(a: Array, b: Array) -> Array:
    """Scalar products."""
    product: Array = np.einsum("...i,...i->...", a, b)
    return product


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

"""Solves many small linear systems at once, with the same last bits on every processor."""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.vectors import cross_first, dot_first


def solve(matrices: Array, right: Array) -> Array:
    """Returns x of A x = b for many small systems, by elimination with row pivoting.

    Each operation is one on whole arrays, so the last bits are the same on every processor.

    Args:
        matrices: the matrices A, shape (n, n, J).
        right: the right-hand sides b, shape (n, J).

    Returns:
        The solutions x, shape (n, J); not finite if a matrix is singular.
    """
    n, _, num = matrices.shape
    A, b, all_ = matrices.copy(), right.copy(), np.arange(num)
    with np.errstate(all="ignore"):
        for k in range(n):
            pivot = k + np.abs(A[k:, k]).argmax(axis=0)
            row, value = A[pivot, :, all_].T.copy(), b[pivot, all_]
            A[pivot, :, all_], b[pivot, all_] = A[k].T, b[k]
            A[k], b[k] = row, value
            factors = A[k + 1 :, k] / row[k]
            A[k + 1 :, k:] -= factors[:, None] * row[k:]
            b[k + 1 :] -= factors * value
        for k in range(n - 1, -1, -1):
            for j in range(k + 1, n):
                b[k] -= A[k, j] * b[j]
            b[k] /= A[k, k]
    return b


def inverse_definite(matrices: Array) -> Array:
    """Returns the inverses of many symmetric positive definite matrices, by blocks of three.

    Like `solve`, the same on every processor.

    Args:
        matrices: shape (6, 6, J).

    Returns:
        The inverses, same shape; not finite if a matrix is singular.
    """
    P, Q, R = matrices[:3, :3], matrices[:3, 3:], matrices[3:, 3:]
    with np.errstate(all="ignore"):
        P_inverse = _inverse_of_three(P)
        X = np.einsum("abj,bcj->acj", P_inverse, Q)
        corner = _inverse_of_three(R - np.einsum("baj,bcj->acj", Q, X))
        Y = np.einsum("abj,bcj->acj", X, corner)
        inverse = np.empty_like(matrices)
        inverse[:3, :3] = P_inverse + (Y[:, None] * X).sum(axis=2)
    inverse[:3, 3:], inverse[3:, :3] = -Y, -Y.transpose(1, 0, 2)
    inverse[3:, 3:] = corner
    return inverse


def _inverse_of_three(matrices: Array) -> Array:
    """The inverses of symmetric matrices, (3, 3, J), by their cofactors."""
    cofactors = cross_first(matrices[:, [1, 2, 0]], matrices[:, [2, 0, 1]])
    return np.asarray(cofactors / dot_first(matrices[:, 0], cofactors[:, 0]))

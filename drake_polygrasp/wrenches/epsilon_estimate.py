"""Estimates of epsilon to search by, a few microseconds each: bounds of it in single precision.

Nothing may rest on them: what is found by them is proved, and measured, by others.
"""

from __future__ import annotations

import itertools
import math
from functools import cache
from typing import Any

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.vectors import cross_first
from drake_polygrasp.wrenches.epsilon_bound import COARSE_TURNS
from drake_polygrasp.wrenches.facet_twists import (
    TINY,
    FacetTwists,
    chunks,
    combined,
    facet_twists,
    grasps_last,
    not_flat,
    rim,
)

_PRODUCTS = np.array(
    [
        *itertools.combinations_with_replacement(range(3), 2),
        *((i, j) for j in (3, 4) for i in range(j + 1)),
    ]
).T
"""Of what multiplies s cos, s sin and s with each other, then of all with 1, then with t."""
_SIGNS = np.array([-1.0, 1.0])[:, None, None, None]


def epsilon_estimates(p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float) -> Array:
    """`epsilon_upper_bound` of `COARSE_TURNS` of contacts that hold, but for rounding.

    Arguments as there. Of most grasps six digits are right, of nearly degenerate ones three.

    Returns:
        Shape (M,), not negative.
    """
    estimates: list[Array] = []
    for rows in chunks(len(p_BC)):
        lines = _lines(p_BC[rows] - p_BBcm, nhat_TB_B[rows], mu[rows], rho)
        estimates.append(_radii(lines).min(axis=(0, 1, 2)))
    highest: Array = np.maximum(np.concatenate(estimates).astype(float), 0.0)
    return highest


def radii_of_lines(p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float) -> Array:
    """What `epsilon_estimates` are the least of: two for each line of twists, shape (M, L).

    They change smoothly as contacts move, with kinks where rims or discs change places. In single
    precision.
    """
    lines = _lines(p_BC - p_BBcm, nhat_TB_B, mu, rho)
    radii = _radii(lines)
    return radii.reshape(math.prod(radii.shape[:-1]), len(p_BC)).T


def _lines(p_BcmC_B: Array, nhat_TB_B: Array, mu: Array, rho: float) -> FacetTwists:
    nhat, r, some_mu = (_single(values) for values in (nhat_TB_B, p_BcmC_B / rho, mu))
    return facet_twists(_frames_alone(nhat, r), r, some_mu, COARSE_TURNS)


def _single(values: Array) -> Any:
    """In single precision, which `Array` does not speak of."""
    return values.astype(np.float32)


def _frames_alone(nhat: Array, r: Array) -> Array:
    """`contact_frames` of contacts that hold, of others anything, shape (M, 3, 3, 3)."""
    nhat, r = grasps_last(nhat), grasps_last(r)
    N = cross_first(r[:, 1] - r[:, 0], r[:, 2] - r[:, 1])[:, None]
    N = N / (np.sqrt((N * N).sum(axis=0)) + TINY)
    tangent = N - (N * nhat).sum(axis=0) * nhat
    tangent /= np.sqrt((tangent * tangent).sum(axis=0)) + TINY
    return np.stack([nhat, tangent, cross_first(nhat, tangent)], axis=1).T


def _radii(lines: FacetTwists) -> Array:
    """h(w) / |w| of the twists that `epsilon_bound` makes of lines, shape (2, T, 6, M).

    The twists themselves are not needed: squares of what is linear are quadratic forms. That is
    less arithmetic, and costs digits where squares cancel.
    """
    # From here on x is less by 1, so that h_k = 1 where (mu y)^2 + (mu z)^2 - x^2 vanishes.
    first = lines.linear.copy()
    first[0, 3] -= 1.0
    second = first.copy()
    second[0] *= -1.0
    second[1:3] *= lines.mu_k * lines.mu_k
    (c, square), (b, slope), (a, curvature) = _forms(first, second, lines)
    discriminant = b * b - a * c
    roots = np.sqrt(np.maximum(discriminant, 0.0)) * _SIGNS.astype(b.dtype)
    over = 1.0 / not_flat(a)
    t = (roots - b) * over
    missed = np.maximum(-discriminant, 0.0) * over
    x = combined(lines.points, first[0, :3]) * lines.s + first[0, 3]
    x_t = x + t * first[0, 4]
    h = np.maximum(1.0 + x_t + np.sqrt(np.maximum(x_t * x_t + missed, 0.0)), lines.h_j)
    length = np.sqrt(np.maximum(square + t * (2.0 * slope + t * curvature), TINY))
    radii: Array = h / length
    return radii


def _forms(first: Array, second: Array, lines: FacetTwists) -> tuple[Array, Array, Array]:
    """Sums over g_k's rows and over the twist's of products of what is linear, (9, 5, 6, M) each.

    As c + 2 b t + a t^2: c and b have shape (2, T, 6, M), a has (2, 6, M). Of the two, one is the
    other with rows multiplied.
    """
    i, j = _PRODUCTS
    each = first.take(i, axis=1)
    each *= second.take(j, axis=1)
    products = np.stack([each[:3].sum(axis=0), each[3:].sum(axis=0)])
    with_1, with_t = products[:, 6:10], products[:, 10:]
    points, s = lines.points, lines.s
    c = combined(_squares_of_rim(), products[:, :6])
    c *= s
    c += combined(2.0 * points, with_1[:, :3])
    c *= s
    c += with_1[:, 3, None]
    b = combined(points, with_t[:, :3])
    b *= s
    b += with_t[:, 3, None]
    return c, b, with_t[:, 4]


@cache
def _squares_of_rim() -> Array:
    """Products of two of each point's cos, sin and 1, as often as they occur, shape (T, 6)."""
    points, (i, j) = rim(COARSE_TURNS), _PRODUCTS[:, :6]
    return frozen(points[:, i] * points[:, j] * np.where(i == j, 1.0, 2.0))

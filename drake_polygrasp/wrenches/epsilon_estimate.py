"""Estimates of epsilon that guide a search: its upper bounds in single precision.

An estimate takes a few microseconds. It decides which grasps are tried, never what is stated of
them.
"""

from __future__ import annotations

import itertools
import math
from functools import cache
from typing import Any

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.vectors import cross_first
from drake_polygrasp.wrenches.epsilon_bound import FEW_ANGLES
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
"""Pairs (i, j) of the columns of `FacetTwists.linear` whose products occur in squares: the six of
s cos, s sin and s with each other, then the four with 1, then the five with t; shape (2, 15)."""
_SIGNS = np.array([-1.0, 1.0])[:, None, None, None]


def epsilon_estimates(p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float) -> Array:
    """Returns `epsilon_upper_bound` with `FEW_ANGLES` of force closure grasps, but for rounding.

    Six digits are right for most grasps, three for nearly degenerate ones.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].

    Returns:
        Shape (M,), at least 0; without meaning for grasps that are not force closure.
    """
    estimates: list[Array] = []
    for rows in chunks(len(p_BC)):
        families = _families(p_BC[rows] - p_BBcm, nhat_TB_B[rows], mu[rows], rho)
        estimates.append(_radii(families).min(axis=(0, 1, 2)))
    highest: Array = np.maximum(np.concatenate(estimates).astype(float), 0.0)
    return highest


def radii_of_lines(p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float) -> Array:
    """Returns h(w) / |w| of all facet twists, whose least is the estimate of epsilon.

    As contacts move each value changes smoothly, but for kinks where the maximum in h(w) passes
    from one contact to another.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].

    Returns:
        Two values for each family of twists, in single precision, shape (M, 12 `FEW_ANGLES`).
    """
    radii = _radii(_families(p_BC - p_BBcm, nhat_TB_B, mu, rho))
    return radii.reshape(math.prod(radii.shape[:-1]), len(p_BC)).T


def _families(p_BcmC_B: Array, nhat_TB_B: Array, mu: Array, rho: float) -> FacetTwists:
    """Returns the families of facet twists in single precision."""
    nhat, r, some_mu = (_single(values) for values in (nhat_TB_B, p_BcmC_B / rho, mu))
    return facet_twists(_contact_frames(nhat, r), r, some_mu, FEW_ANGLES)


def _single(values: Array) -> Any:
    """Returns the values in single precision, for which `Array` is not the type."""
    return values.astype(np.float32)


def _contact_frames(nhat: Array, r: Array) -> Array:
    """Returns `contacts.contact_frames` in single precision, shape (M, 3, 3, 3).

    They are right for force closure grasps only: no other axis replaces t_1 where it vanishes.
    """
    nhat, r = grasps_last(nhat), grasps_last(r)
    N = cross_first(r[:, 1] - r[:, 0], r[:, 2] - r[:, 1])[:, None]
    N = N / (np.sqrt((N * N).sum(axis=0)) + TINY)
    tangent = N - (N * nhat).sum(axis=0) * nhat
    tangent /= np.sqrt((tangent * tangent).sum(axis=0)) + TINY
    return np.stack([nhat, tangent, cross_first(nhat, tangent)], axis=1).T


def _radii(families: FacetTwists) -> Array:
    """Returns h(w) / |w| of the facet twists with h_k(w) = 1, shape (2, T, 6, M).

    Squared lengths are quadratic in the coefficients' factors s cos, s sin, s, 1 and t, so they
    are computed without the twists themselves. That takes less arithmetic than `epsilon_bound`,
    and loses digits where terms cancel.
    """
    # Let (x, y, z) be g_k in the frame of contact k, with 1 taken off x. Then h_k = 1 + x + mu
    # |(y, z)| is 1 where (mu y)^2 + (mu z)^2 - x^2 = 0.
    first = families.linear.copy()
    first[0, 3] -= 1.0
    second = first.copy()
    second[0] *= -1.0
    second[1:3] *= families.mu_k * families.mu_k
    (c, square), (b, slope), (a, curvature) = _forms(first, second, families)
    discriminant = b * b - a * c
    roots = np.sqrt(np.maximum(discriminant, 0.0)) * _SIGNS.astype(b.dtype)
    over = 1.0 / not_flat(a)
    t = (roots - b) * over
    missed = np.maximum(-discriminant, 0.0) * over
    x = combined(families.points, first[0, :3]) * families.s + first[0, 3]
    x_t = x + t * first[0, 4]
    h = np.maximum(1.0 + x_t + np.sqrt(np.maximum(x_t * x_t + missed, 0.0)), families.h_j)
    length = np.sqrt(np.maximum(square + t * (2.0 * slope + t * curvature), TINY))
    radii: Array = h / length
    return radii


def _forms(first: Array, second: Array, families: FacetTwists) -> tuple[Array, Array, Array]:
    """Returns c, b and a of the quadratic forms c + 2 b t + a t^2 of g_k and of w.

    Args:
        first: coefficients as in `FacetTwists.linear`, shape (9, 5, 6, M).
        second: the same with each row multiplied by a weight.
        families: what the angles and s are taken from.

    Returns:
        Sums of the products of both, over the rows of g_k and over those of w: c and b have shape
        (2, T, 6, M), a has shape (2, 6, M).
    """
    i, j = _PRODUCTS
    each = first.take(i, axis=1)
    each *= second.take(j, axis=1)
    products = np.stack([each[:3].sum(axis=0), each[3:].sum(axis=0)])
    with_1, with_t = products[:, 6:10], products[:, 10:]
    points, s = families.points, families.s
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
    """Returns the six products of cos, sin and 1 in the square of their sum, shape (T, 6)."""
    points, (i, j) = rim(FEW_ANGLES), _PRODUCTS[:, :6]
    return frozen(points[:, i] * points[:, j] * np.where(i == j, 1.0, 2.0))

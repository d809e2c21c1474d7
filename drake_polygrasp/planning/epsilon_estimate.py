"""Estimates of epsilon to search by, a few microseconds each: bounds of it in single precision.

Nothing may rest on them: what is found by them is proved, and measured, by others.
"""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.epsilon_bound import COARSE_TURNS
from drake_polygrasp.facet_lines import (
    TINY,
    Lines,
    chunks,
    combined,
    grasps_last,
    lines_of,
    not_flat,
)
from drake_polygrasp.vectors import cross_first

_PRODUCTS = np.array(list(itertools.combinations_with_replacement(range(3), 2))).T


def epsilon_estimates(p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float) -> Array:
    """`epsilon_upper_bound` of `COARSE_TURNS` of contacts that hold, but for rounding.

    Arguments as there. Of most grasps six digits are right, of nearly degenerate ones three.

    Returns:
        Shape (M,), not negative.
    """
    estimates: list[Array] = []
    for rows in chunks(len(p_BC)):
        placed = nhat_TB_B[rows], (p_BC[rows] - p_BBcm) / rho, mu[rows]
        nhat, r, some_mu = (_single(values) for values in placed)
        lines = lines_of(_frames_alone(nhat, r), r, some_mu, COARSE_TURNS)
        estimates.append(_least_radii(lines))
    highest: Array = np.maximum(np.concatenate(estimates).astype(float), 0.0)
    return highest


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


def _least_radii(lines: Lines) -> Array:
    """The least h(w) / |w| of the twists that `epsilon_bound` makes of lines, shape (M,).

    The twists themselves are not needed: squares of what is linear are quadratic forms. That is
    less arithmetic, and costs digits where squares cancel.
    """
    # From here on x is less by 1, so that h_k = 1 where (mu y)^2 + (mu z)^2 - x^2, which is
    # c + 2 b t + a t^2, vanishes.
    g_k, w = lines.linear[:3].copy(), lines.linear[3:]
    g_k[0, 3] -= 1.0
    x = combined(lines.points, g_k[0, :3]) * lines.s + g_k[0, 3]
    signed = g_k * np.stack([-np.ones_like(lines.mu_k), lines.mu_k**2, lines.mu_k**2])[:, None]
    c, b, a = _form(g_k, signed, lines)
    square, slope, curvature = _form(w, w, lines)
    discriminant = b * b - a * c
    root, over = np.sqrt(np.maximum(discriminant, 0.0)), 1.0 / not_flat(a)
    missed = np.maximum(-discriminant, 0.0) * over
    least = np.full(w.shape[-1], np.inf, w.dtype)
    for t in ((-b - root) * over, (-b + root) * over):
        x_t = x + t * g_k[0, 4]
        h = np.maximum(1.0 + x_t + np.sqrt(np.maximum(x_t * x_t + missed, 0.0)), lines.h_j)
        length = np.sqrt(np.maximum(square + t * (2.0 * slope + t * curvature), TINY))
        least = np.minimum(least, (h / length).min(axis=(0, 1)))
    return least


def _form(first: Array, second: Array, lines: Lines) -> tuple[Array, Array, Array]:
    """Products of what is linear, (L, 5, 6, M) each, as c + 2 b t + a t^2.

    c and b have shape (T, 6, M), a has (6, M). Of the two, one is the other with rows multiplied.
    """
    points, s = lines.points, lines.s
    i, j = _PRODUCTS
    squares = (first[:, i] * second[:, j]).sum(axis=0)
    with_1 = (first[:, :4] * second[:, 3, None]).sum(axis=0)
    with_t = (first * second[:, 4, None]).sum(axis=0)
    c = combined(points[:, i] * points[:, j] * np.where(i == j, 1.0, 2.0), squares)
    c *= s
    c += 2.0 * combined(points, with_1[:3])
    c *= s
    c += with_1[3]
    b = combined(points, with_t[:3])
    b *= s
    b += with_t[3]
    return c, b, with_t[4]

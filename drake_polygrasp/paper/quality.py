"""Section 6: the quality Q of a set of faces, equations 5 to 10.

The text divides distances and areas by their maxima over all valid sets, so Q of a set depends on
the other sets: it is 0 for a lone set off the centre of mass and for sets all equally far from it,
and one outlier flattens q_2. With `scale="object"` they are divided by rho and rho^2 instead, which
selects as well and needs no second pass over the sets.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.geometry.tolerances import ANGLE_TOLERANCE, FLATNESS
from drake_polygrasp.vectors import cross, dot

NOISE = FLATNESS
"""Our choice, times rho: on a symmetric object all distances are as long as the rounding in a file
makes them, and the greatest of such distances is no scale."""


def q_orientation(phi: Array, alpha: Array) -> Array:
    """Computes q_4 (eq. 9): how close the tips of the normals n_i are to Pi_p.

    Args:
        phi: angle of Section 4 between the normals and Pi_l, or the segment of a pair [rad], shape
            (M,).
        alpha: half-angle of the friction cones [rad], shape (M,).

    Returns:
        q_4, shape (M,).
    """
    return np.abs(1 - phi / alpha)


def q_directions(nhat: Array, N: Array, *, parallel: bool) -> Array:
    """Computes q_5 (eq. 10) of triples: how evenly normals oppose, or, if parallel, how exactly.

    Args:
        nhat: inward unit normals, shape (M, 3, 3).
        N: unit normals of Pi_p, shape (M, 3).
        parallel: whether the sets are parallel, which selects the case of eq. 10.

    Returns:
        q_5, shape (M,).
    """
    projected = nhat - dot(nhat, N[:, None])[..., None] * N[:, None]
    edge = projected - projected[:, [2, 0, 1]]
    side = np.sqrt(dot(edge, edge))
    longest = side.max(axis=1)
    ratio = side.min(axis=1) / np.where(longest > 0, longest, 1.0)
    value = 1 - ratio if parallel else ratio
    return np.where(_hull_has_origin(projected, N), value, 0.0)


def _hull_has_origin(projected: Array, N: Array) -> Bools:
    """Tests whether 0 is in the hull of three vectors orthogonal to N, closed and with a tolerance.

    It is closed, because on a cube the origin lies on the border of the hull for every triple.
    """
    following, preceding = projected[:, [1, 2, 0]], projected[:, [2, 0, 1]]
    weight = dot(N[:, None], cross(following, preceding))
    weight *= np.where(weight.sum(axis=1, keepdims=True) < 0, -1.0, 1.0)
    spread = np.abs(weight.sum(axis=1)) > 3 * ANGLE_TOLERANCE
    inside = (weight >= -ANGLE_TOLERANCE).all(axis=1)
    # Where all three lie on a line through the origin, it is between them if two are opposed.
    products = dot(projected, preceding).min(axis=1)
    flat: Bools = (np.abs(weight) <= ANGLE_TOLERANCE).all(axis=1) & (products <= 0)
    has: Bools = np.where(spread, inside, flat)
    return has


def q_positions(
    d_1: Array,
    d_2: Array,
    area_s: Array,
    area_p: Array,
    rho: float,
    scale: Literal["paper", "object"],
) -> Array:
    """Computes q_1, q_2 and q_3 (eq. 6 to 8).

    Args:
        d_1: distance from c_I^s to c_m^s [m], shape (M,).
        d_2: distance from c_I^p to c_m^p [m], shape (M,).
        area_s: I^s, the area of F [m^2], shape (M,).
        area_p: I^p, the area of P [m^2], shape (M,).
        rho: greatest distance from the centre of mass to the surface [m].
        scale: what distances and areas are divided by: "paper" for their maxima, where 0/0 counts
            as 1 and distances below `NOISE` rho as 0; "object" for rho and rho^2.

    Returns:
        The three factors, shape (M, 3).
    """
    if scale == "object":
        q_3 = (np.minimum(1, area_s / rho**2) + np.minimum(1, area_p / rho**2)) / 2
        return np.column_stack([np.maximum(0, 1 - d_1 / rho), np.maximum(0, 1 - d_2 / rho), q_3])
    q_1, q_2 = (
        np.abs(_ratio(d.max(initial=0) - d, d.max(initial=0), NOISE * rho)) for d in (d_1, d_2)
    )
    q_3 = (
        _ratio(area_s, area_s.max(initial=0), 0.0) + _ratio(area_p, area_p.max(initial=0), 0.0)
    ) / 2
    return np.column_stack([q_1, q_2, q_3])


def _ratio(value: Array, greatest: float, zero: float) -> Array:
    """Divides by the greatest value; returns 1 where that is zero but for rounding."""
    return value / greatest if greatest > zero else np.ones_like(value)

"""The contact triangle, contact frames, internal forces, and force closure in closed form.

The test for force closure is a filter in floating point; `certification.exact` proves.
"""

from __future__ import annotations

import itertools

import numpy as np

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.vectors import cross, cross_first, dot, unit

MIN_AREA_RATIO = 1e-3
"""Our choice: contacts whose triangle has twice an area below this, over the square of its longest
side, count as collinear. A test for zero would not do: collinear points, once rotated in floating
point, span an area near 1e-19 m^2."""
ON_A_SIDE = 1e-9
"""Our choice: unit vectors nearer to a plane than this count as lying in it."""
_PAIRS = np.array(list(itertools.combinations(range(6), 2)))
_ENDS = np.array([0, 1, 2, 0, 1, 2])


def contact_triangle(p_BC: Array) -> tuple[Array, Array]:
    """Returns contact points from their centroid, scaled by the longest side, and that side.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).

    Returns:
        The scaled points, zero where the three points coincide, shape (M, 3, 3), and the longest
        side [m], shape (M,).
    """
    sides = p_BC - p_BC.take((2, 0, 1), axis=1)
    longest = np.sqrt(dot(sides, sides).max(axis=1))
    centred = p_BC - (p_BC[:, :1] + p_BC[:, 1:2] + p_BC[:, 2:]) / 3.0
    scale = np.where(longest > 0, longest, 1.0)
    return centred / scale[:, None, None], longest


def plane_normal(p_BC: Array) -> Array:
    """Returns the unit normal of the plane Pi_p through the three contacts.

    Args:
        p_BC: contact points, shape (M, 3, 3).

    Returns:
        Shape (M, 3), counter-clockwise about the contacts in their order; zero where they are
        exactly collinear.
    """
    return unit(_area(p_BC))


def non_collinear(p_BC: Array) -> Bools:
    """Returns whether the contacts are clear of being collinear, as force closure requires.

    Args:
        p_BC: contact points, shape (M, 3, 3).

    Returns:
        Whether twice the triangle's area is at least `MIN_AREA_RATIO` times the square of its
        longest side, shape (M,).
    """
    p, longest = contact_triangle(p_BC)
    return _spans_plane(_area(p), longest)


def _area(p: Array) -> Array:
    """Returns twice the area of triangles, as vectors along their normals."""
    return cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def _spans_plane(area: Array, longest: Array) -> Bools:
    """Returns whether scaled triangles are clear of being collinear."""
    spread: Bools = (dot(area, area) >= MIN_AREA_RATIO**2) & (longest > 0)
    return spread


def edge_forces(p_BC: Array, x: Array) -> Array:
    """Returns the internal forces with given coefficients along the sides of the contact triangle.

    They are equal and opposite pairs, so they balance for every x. For contacts that are not
    collinear every set of balanced contact forces has this form (Murray, Li & Sastry, 1994, ch. 5).

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        x: coefficients x_12, x_13, x_23 of the sides [1/m], shape (M, 3).

    Returns:
        f_Bc_B, the force on B at each contact, with the unit of x times metres, shape (M, 3, 3).
    """
    along_12, along_13, along_23 = (
        x[:, k, None] * (p_BC[:, j] - p_BC[:, i])
        for k, (i, j) in enumerate(((0, 1), (0, 2), (1, 2)))
    )
    return np.stack(
        [along_12 + along_13, along_23 - along_12, -along_13 - along_23],
        axis=1,
    )


def contact_frames(p_BC: Array, nhat_TB_B: Array) -> Array:
    """Returns a right-handed orthonormal frame (nhat, t_1, t_2) at each contact.

    t_1 points along the projection of the contact plane's normal onto the tangent plane, so that
    results computed in these frames do not depend on the body frame. Where that projection
    vanishes (the grasp is then not force closure) an axis of B replaces the normal.

    Args:
        p_BC: contact points, shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).

    Returns:
        The frames' axes as rows, shape (M, 3, 3, 3).
    """
    N = plane_normal(p_BC)[:, None]
    tangent = N - dot(N, nhat_TB_B)[..., None] * nhat_TB_B
    vanishes = dot(tangent, tangent) <= ON_A_SIDE**2
    if vanishes.any():
        axis = np.eye(3)[np.round(np.abs(nhat_TB_B[vanishes]), 9).argmin(axis=-1)]
        tangent[vanishes] = cross(nhat_TB_B[vanishes], axis)
    frames = np.empty((*nhat_TB_B.shape, 3))
    frames[:, :, 0] = nhat_TB_B
    frames[:, :, 1] = unit(tangent)
    frames[:, :, 2] = cross(nhat_TB_B, frames[:, :, 1])
    return frames


def force_closure(p_BC: Array, nhat_TB_B: Array, mu: Array) -> Bools:
    """Returns whether each grasp is force closure, by the test of Li, Liu & Cai (2003).

    Three contacts are force closure iff they are not collinear, their plane meets the interior of
    every friction cone, and the planar grasp with the cones' sections in that plane is force
    closure: the origin is interior to the convex hull of the six planar wrenches along the edges
    of the sections. It is not interior iff some plane through the origin and two of the wrenches
    has all others on one closed side.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).

    Returns:
        Shape (M,); False for grasps within rounding of the boundary.
    """
    p, longest = contact_triangle(p_BC)
    area = _area(p)
    N = unit(area)
    sin_phi = dot(nhat_TB_B, N[:, None])
    cos_phi = np.sqrt(np.maximum(1.0 - sin_phi**2, 0.0))
    cos_alpha = 1.0 / np.sqrt(1.0 + mu**2)
    cuts = (cos_phi > cos_alpha + ON_A_SIDE).all(axis=1)
    closed: Bools = cuts & _spans_plane(area, longest)
    # The hull test is the most expensive part, and few grasps reach it.
    rows = np.flatnonzero(closed)
    p, N, cos_phi = p[rows], N[rows, None], cos_phi[rows]

    axis = unit(nhat_TB_B[rows] - sin_phi[rows, :, None] * N)
    cos_beta = np.minimum(cos_alpha[rows] / cos_phi, 1.0)[..., None]
    along, across = cos_beta * axis, np.sqrt(1.0 - cos_beta**2) * cross(N, axis)
    edges = np.concatenate([along - across, along + across], axis=1)
    # The planar wrench (fx, fy, tau) of each edge as a vector in B: the force, which lies in the
    # plane, plus the torque, which is along N. This needs no choice of axes in the plane.
    wrenches = unit(edges + cross(p.take(_ENDS, axis=1), edges)).transpose(2, 1, 0).copy()

    first, second = _PAIRS.T
    facet = cross_first(wrenches.take(first, axis=1), wrenches.take(second, axis=1))
    independent = (facet * facet).sum(axis=0) > ON_A_SIDE**2
    side = np.einsum("cfm,cwm->wfm", facet, wrenches)
    both = (side.max(axis=0) > ON_A_SIDE) & (side.min(axis=0) < -ON_A_SIDE)
    closed[rows] = (both | ~independent).all(axis=0) & independent.any(axis=0)
    return closed


def inner_forces(p_BC: Array, nhat_TB_B: Array, mu: Array) -> Array:
    """Returns internal forces strictly inside all friction cones, not those of greatest margin.

    Internal forces lie in the plane of the contacts, where each friction cone is a wedge of two
    half-planes. So the x whose forces are in all cones form a polyhedral cone of six half-spaces,
    and the sum of its extreme rays is inside it.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).

    Returns:
        x_12, x_13, x_23 as `edge_forces` takes them, of any length, shape (M, 3); without meaning
        where `force_closure` is False.
    """
    p, _ = contact_triangle(p_BC)
    N = plane_normal(p)[:, None]
    sin_phi = dot(nhat_TB_B, N)[..., None]
    # The force f is in the cone if |N x n . f| is at most this slope times n . f.
    slope = np.sqrt(np.maximum(mu[..., None] ** 2 - (1.0 + mu[..., None] ** 2) * sin_phi**2, 0.0))
    axis = nhat_TB_B - sin_phi * N
    inward = np.concatenate([slope * axis - cross(N, axis), slope * axis + cross(N, axis)], axis=1)
    sides = np.stack([edge_forces(p, np.tile(e, (len(p), 1))) for e in np.eye(3)], axis=-1)
    bounds = unit((inward[..., None] * np.tile(sides, (1, 2, 1, 1))).sum(axis=2))
    first, second = _PAIRS.T
    rays = unit(cross(bounds[:, first], bounds[:, second]))
    inside = dot(rays[:, :, None], bounds[:, None])
    sign = (inside >= -ON_A_SIDE).all(axis=2).astype(float) - (inside <= ON_A_SIDE).all(axis=2)
    x: Array = (sign[..., None] * rays).sum(axis=1)
    return x

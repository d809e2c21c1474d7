"""Which wrenches three frictional point contacts can apply, for many grasps at once.

Hard point contacts with Coulomb friction and the exact quadratic cone. A batch holds M grasps:
points `p_BC` (M, 3, 3) and inward unit normals `nhat_TB_B` (M, 3, 3), one row a contact, and
friction `mu` (M, 3). A wrench is (force, torque about the centre of mass / rho), six numbers of
one unit, and W is the convex hull of what the contacts apply with normal forces that add up to
1 (Ferrari & Canny, 1992). Everything here is a filter or a bound in floating point: the proof is
`certification.exact`.
"""

from __future__ import annotations

import itertools

import numpy as np

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.vectors import cross, cross_first, dot, unit

MIN_AREA_RATIO = 1e-3
"""Ours: twice the contacts' area over the square of their longest side, at least. A non-zero area
alone means nothing: collinear points, once turned, have one of 1e-19 m^2."""
ON_A_SIDE = 1e-9
"""Ours: of unit wrenches, what is nearer to a plane than this is on it."""
_PAIRS = np.array(list(itertools.combinations(range(6), 2)))
_ENDS = np.array([0, 1, 2, 0, 1, 2])


def contact_triangle(p_BC: Array) -> tuple[Array, Array]:
    """The contacts seen from their centroid, and their size.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).

    Returns:
        Points relative to the centroid and divided by the longest side (zero where the three
        points are one), shape (M, 3, 3), and the longest side [m], shape (M,).
    """
    sides = p_BC - p_BC.take((2, 0, 1), axis=1)
    longest = np.sqrt(dot(sides, sides).max(axis=1))
    centred = p_BC - (p_BC[:, :1] + p_BC[:, 1:2] + p_BC[:, 2:]) / 3.0
    scale = np.where(longest > 0, longest, 1.0)
    return centred / scale[:, None, None], longest


def plane_normal(p_BC: Array) -> Array:
    """Unit normal of the plane Pi_p through the contacts, shape (M, 3).

    Its sign follows the order of the contacts; it is zero where all three are exactly collinear.
    """
    return unit(_area(p_BC))


def non_collinear(p_BC: Array) -> Bools:
    """Whether the contacts span a triangle with room, shape (M,); needed for force closure."""
    p, longest = contact_triangle(p_BC)
    return _has_room(_area(p), longest)


def _area(p: Array) -> Array:
    """Twice the area of triangles, along their normals."""
    return cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0])


def _has_room(area: Array, longest: Array) -> Bools:
    spread: Bools = (dot(area, area) >= MIN_AREA_RATIO**2) & (longest > 0)
    return spread


def edge_forces(p_BC: Array, x: Array) -> Array:
    """The internal forces that push along the sides of the contact triangle.

    Equal and opposite pairs, so they balance whatever x is; for contacts that are not collinear
    they are all the forces that do (Murray, Li & Sastry, 1994, ch. 5).

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        x: x_12, x_13, x_23 [1/m], shape (M, 3).

    Returns:
        f_Bc_B, the force on B at each contact, shape (M, 3, 3).
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
    """Orthonormal (nhat, t_1, t_2) of each contact as rows, shape (M, 3, 3, 3).

    t_1 is the part of the contact plane's normal that is tangent to the face, so that nothing
    computed in these frames depends on the body frame; where that part vanishes (such a grasp
    cannot hold) t_1 is the part of an axis of B.
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
    """Whether each grasp is force closure, in closed form (Li, Liu & Cai, 2003), shape (M,).

    Three contacts are force closure iff they are not collinear, their plane cuts every friction
    cone in its interior, and the planar grasp it cuts out is force closure: the origin is interior
    to the hull of the six planar wrenches along the edges of the cut cones. That is so unless a
    plane through two of them and the origin has all others on one closed side.
    """
    p, longest = contact_triangle(p_BC)
    area = _area(p)
    N = unit(area)
    sin_phi = dot(nhat_TB_B, N[:, None])
    cos_phi = np.sqrt(np.maximum(1.0 - sin_phi**2, 0.0))
    cos_alpha = 1.0 / np.sqrt(1.0 + mu**2)
    cuts = (cos_phi > cos_alpha + ON_A_SIDE).all(axis=1)
    closed: Bools = cuts & _has_room(area, longest)
    # Few pass so far, and what follows costs most.
    rows = np.flatnonzero(closed)
    p, N, cos_phi = p[rows], N[rows, None], cos_phi[rows]

    axis = unit(nhat_TB_B[rows] - sin_phi[rows, :, None] * N)
    cos_beta = np.minimum(cos_alpha[rows] / cos_phi, 1.0)[..., None]
    along, across = cos_beta * axis, np.sqrt(1.0 - cos_beta**2) * cross(N, axis)
    edges = np.concatenate([along - across, along + across], axis=1)
    # (fx, fy, tau) of each edge without a choice of axes in the plane: the planar force turned
    # into B, plus its torque along N.
    wrenches = unit(edges + cross(p.take(_ENDS, axis=1), edges)).transpose(2, 1, 0).copy()

    first, second = _PAIRS.T
    facet = cross_first(wrenches.take(first, axis=1), wrenches.take(second, axis=1))
    independent = (facet * facet).sum(axis=0) > ON_A_SIDE**2
    side = np.einsum("cfm,cwm->wfm", facet, wrenches)
    both = (side.max(axis=0) > ON_A_SIDE) & (side.min(axis=0) < -ON_A_SIDE)
    closed[rows] = (both | ~independent).all(axis=0) & independent.any(axis=0)
    return closed

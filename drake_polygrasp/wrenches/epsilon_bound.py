"""Upper bounds of epsilon, and the directions w in which the support h(w) is least.

epsilon is the least h(w) over unit w, so h(w) / |w| of every w bounds it from above; here w ranges
over facet twists. `certification.robustness` bounds epsilon from below.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.vectors import cross, dot, unit
from drake_polygrasp.wrenches.contacts import contact_frames, plane_normal
from drake_polygrasp.wrenches.facet_twists import (
    TINY,
    FacetTwists,
    chunks,
    combined,
    facet_twists,
    not_flat,
)
from drake_polygrasp.wrenches.support import frame_wrenches

NUM_ANGLES = 16
"""Our choice: angles tried on the rim of a disc; 32 would lower the bound by 0.1 percent more."""
FEW_ANGLES = 8
"""Our choice, where many grasps are compared or the bound only guides a search."""


def epsilon_upper_bound(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    p_BBcm: Array,
    rho: float,
    num_angles: int = NUM_ANGLES,
) -> Array:
    """Returns an upper bound of each grasp's epsilon, close enough to rank and to prune by.

    The bound is the least h(w) / |w| over the facet twists. Where the facet of W nearest to the
    origin contains a friction disc, the bound tends to epsilon as the number of angles grows.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        num_angles: number of angles tried on the rim of each disc.

    Returns:
        Shape (M,), at least 0. The choice of the frame B and the order of the contacts do not
        matter.
    """
    bounds: list[Array] = []
    for rows in chunks(len(p_BC)):
        frames, r = _placed(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
        radii = _rim_twists(facet_twists(frames, r, mu[rows], num_angles)).radii()
        bounds.append(radii.min(axis=(0, 1, 2)))
    highest: Array = np.maximum(np.concatenate(bounds), 0.0)
    return highest


def critical_directions(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    p_BBcm: Array,
    rho: float,
    num: int = 12,
    num_angles: int = NUM_ANGLES,
    *,
    rotations: bool = False,
) -> tuple[Array, Array]:
    """Returns the unit directions w in which h(w) is least, which a better grasp has to improve.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        num: number of directions for each grasp.
        num_angles: number of angles tried on the rim of each disc.
        rotations: whether to try, beside facet twists, rotations about lines through the contacts
            and their centroid, along which objects often escape a grasp that is not force closure.

    Returns:
        Directions, ascending by h, shape (M, num, 6): facet twists that are local minima over the
        angle come before those that are not. And the least h found, at least 0, which bounds
        epsilon from above, shape (M,).
    """
    found = []
    for rows in chunks(len(p_BC)):
        frames, r = _placed(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
        twists = _rim_twists(facet_twists(frames, r, mu[rows], num_angles))
        radii = twists.radii()
        around = np.arange(num_angles)
        neighbours = np.minimum(radii[:, around - 1], radii[:, around + 1 - num_angles])
        order = np.where(radii <= neighbours, radii, radii + radii.max(initial=0.0))
        order = order.reshape(12 * num_angles, -1).T
        w = twists.directions().reshape(6, 12 * num_angles, -1).transpose(2, 1, 0)
        if rotations:
            others = _rotations(p_BC[rows], frames, p_BBcm, rho)
            cones = frame_wrenches(frames, r, mu[rows])
            w = np.concatenate([w, others], axis=1)
            order = np.concatenate([order, _radii(cones, others)], axis=1)
        best = np.argsort(order, axis=1, kind="stable")[:, :num]
        found.append(
            (unit(w[np.arange(len(r))[:, None], best]), np.maximum(order.min(axis=1), 0.0))
        )
    directions, bound = zip(*found, strict=True)
    return np.concatenate(directions), np.concatenate(bound)


def _placed(p_BC: Array, nhat_TB_B: Array, p_BBcm: Array, rho: float) -> tuple[Array, Array]:
    """Returns contact frames, shape (M, 3, 3, 3), and points from the centre of mass over rho."""
    return contact_frames(p_BC, nhat_TB_B), (p_BC - p_BBcm) / rho


@dataclass(frozen=True, eq=False)
class _RimTwists:
    """Facet twists `at + t along` with h_k(w) = 1: two of each family.

    Attributes:
        at: values at t = 0, with the rows of `FacetTwists.linear`, shape (9, T, 6, M).
        along: their derivatives by t, shape (9, 6, M).
        t: the two roots of h_k(w) = 1, shape (2, T, 6, M).
        h_j: h_j(w), shape (T, 6, M).
        mu_k: friction coefficient of contact k, shape (6, M).
    """

    at: Array
    along: Array
    t: Array
    h_j: Array
    mu_k: Array

    def directions(self) -> Array:
        """Returns the twists w, not of unit length, shape (6, 2, T, 6, M)."""
        return self.at[3:, None] + self.t * self.along[3:, None, None]

    def radii(self) -> Array:
        """Returns h(w) / |w|, shape (2, T, 6, M)."""
        x, y, z = (self.at[row] + self.t * self.along[row] for row in range(3))
        h = np.maximum(x + self.mu_k * np.sqrt(y * y + z * z), self.h_j)
        at, along = self.at[3:], self.along[3:, None]
        square = self.t * (2.0 * (at * along).sum(axis=0) + self.t * (along * along).sum(axis=0))
        square += (at * at).sum(axis=0)
        radii: Array = h / (np.sqrt(square) + TINY)
        return radii


def _rim_twists(families: FacetTwists) -> _RimTwists:
    """Returns the twists of each family that touch the rim of contact k's disc."""
    linear, mu_k = families.linear, families.mu_k
    at = combined(families.points, linear[:, :3])
    at *= families.s
    at += linear[:, 3, None]
    # h_k = 1 is quadratic in t.
    (x, y, z), (x_t, y_t, z_t) = at[:3], linear[:3, 4]
    a = mu_k**2 * (y_t * y_t + z_t * z_t) - x_t * x_t
    b = mu_k**2 * (y * y_t + z * z_t) + (1 - x) * x_t
    c = mu_k**2 * (y * y + z * z) - (1 - x) ** 2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    t = np.stack([-b - root, -b + root]) / not_flat(a)
    return _RimTwists(at, linear[:, 4], t, families.h_j, mu_k)


def _radii(cones: Array, w: Array) -> Array:
    """Returns h(w) / |w| for cones (M, 3, 3, 6) and directions (M, K, 6), shape (M, K)."""
    n, t_1, t_2 = np.einsum("mcrd,mkd->rmck", cones, w)
    h = (n + np.sqrt(t_1 * t_1 + t_2 * t_2)).max(axis=1)
    radii: Array = h / (np.sqrt(dot(w, w)) + TINY)
    return radii


def _rotations(p_BC: Array, frames: Array, p_BBcm: Array, rho: float) -> Array:
    """Returns twists of rotations about lines through each contact and the centroid, (M, 128, 6).

    The lines run along the normal, the sides and the altitudes of the contact triangle and along
    the axes of the contact frames; each is turned about in both senses.
    """
    N = plane_normal(p_BC)[:, None]
    sides = unit(p_BC - p_BC[:, (2, 0, 1)])
    axes = frames.reshape(-1, 9, 3)
    omega = np.concatenate([N, sides, cross(N, sides), axes], axis=1)[:, None]
    points = np.concatenate([p_BC, p_BC.mean(axis=1, keepdims=True)], axis=1)
    v = cross(p_BBcm - points[:, :, None], -omega)
    twists = np.concatenate([v, np.broadcast_to(rho * omega, v.shape)], axis=-1)
    twists = twists.reshape(-1, 64, 6)
    return np.concatenate([twists, -twists], axis=1)

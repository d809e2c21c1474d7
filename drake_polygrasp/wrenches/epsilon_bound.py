"""Where W reaches least far: bounds of epsilon from above, for many grasps at once.

Arrays, W and h are those of `contacts`. Nothing here is proved: `certification.robustness` bounds
epsilon from below too.
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

TURNS = 16
"""Ours: points of a rim that are tried; 32 lower the bound by 0.1 percent more."""
COARSE_TURNS = 8
"""Where many grasps are compared, or the bound is only a guide."""


def epsilon_upper_bound(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    p_BBcm: Array,
    rho: float,
    num_turns: int = TURNS,
) -> Array:
    """An upper bound of each grasp's epsilon, close to it: to rank and to prune.

    epsilon is the least h(w) over unit w, and any w bounds it: here those of
    `critical_directions`.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        num_turns: points of each rim that are tried.

    Returns:
        Shape (M,), not negative; it does not depend on the frame or the order of the contacts.
    """
    bounds: list[Array] = []
    for rows in chunks(len(p_BC)):
        frames, r = _placed(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
        radii = _rim_twists(facet_twists(frames, r, mu[rows], num_turns)).radii()
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
    num_turns: int = TURNS,
    *,
    rotations: bool = False,
) -> tuple[Array, Array]:
    """The unit w in which W reaches least far: what a change of the contacts must improve on.

    Arguments as of `epsilon_upper_bound`; with `rotations`, those about lines that the contacts
    single out count too, by which the object often leaves contacts that do not hold.

    Returns:
        `num` directions of least h for each grasp, shape (M, num, 6), and the least
        of h, which bounds epsilon from above where the grasp holds, shape (M,).
    """
    found = []
    for rows in chunks(len(p_BC)):
        frames, r = _placed(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
        twists = _rim_twists(facet_twists(frames, r, mu[rows], num_turns))
        radii = twists.radii()
        around = np.arange(num_turns)
        neighbours = np.minimum(radii[:, around - 1], radii[:, around + 1 - num_turns])
        order = np.where(radii <= neighbours, radii, radii + radii.max(initial=0.0))
        order = order.reshape(12 * num_turns, -1).T
        w = twists.directions().reshape(6, 12 * num_turns, -1).transpose(2, 1, 0)
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
    """Contact frames, shape (M, 3, 3, 3), and points from the centre of mass over rho."""
    return contact_frames(p_BC, nhat_TB_B), (p_BC - p_BBcm) / rho


@dataclass(frozen=True, eq=False)
class _RimTwists:
    """Twists on lines, `at` plus `t` times `along`; two on each, for each of T angles.

    Rows are those of `FacetTwists.linear`.
    """

    at: Array
    """Shape (9, T, 6, M)."""
    along: Array
    """Shape (9, 6, M)."""
    t: Array
    """Shape (2, T, 6, M)."""
    h_j: Array
    """Shape (T, 6, M)."""
    mu_k: Array
    """Shape (6, M)."""

    def directions(self) -> Array:
        """The twists, shape (6, 2, T, 6, M)."""
        return self.at[3:, None] + self.t * self.along[3:, None, None]

    def radii(self) -> Array:
        """h(w) / |w|, shape (2, T, 6, M)."""
        x, y, z = (self.at[row] + self.t * self.along[row] for row in range(3))
        h = np.maximum(x + self.mu_k * np.sqrt(y * y + z * z), self.h_j)
        at, along = self.at[3:], self.along[3:, None]
        square = self.t * (2.0 * (at * along).sum(axis=0) + self.t * (along * along).sum(axis=0))
        square += (at * at).sum(axis=0)
        radii: Array = h / (np.sqrt(square) + TINY)
        return radii


def _rim_twists(lines: FacetTwists) -> _RimTwists:
    linear, mu_k = lines.linear, lines.mu_k
    at = combined(lines.points, linear[:, :3])
    at *= lines.s
    at += linear[:, 3, None]
    # h_k = 1 is quadratic in t.
    (x, y, z), (x_t, y_t, z_t) = at[:3], linear[:3, 4]
    a = mu_k**2 * (y_t * y_t + z_t * z_t) - x_t * x_t
    b = mu_k**2 * (y * y_t + z * z_t) + (1 - x) * x_t
    c = mu_k**2 * (y * y + z * z) - (1 - x) ** 2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    t = np.stack([-b - root, -b + root]) / not_flat(a)
    return _RimTwists(at, linear[:, 4], t, lines.h_j, mu_k)


def _radii(cones: Array, w: Array) -> Array:
    """h(w) / |w| for cones (M, 3, 3, 6) and directions (M, K, 6), shape (M, K)."""
    n, t_1, t_2 = np.einsum("mcrd,mkd->rmck", cones, w)
    h = (n + np.sqrt(t_1 * t_1 + t_2 * t_2)).max(axis=1)
    radii: Array = h / (np.sqrt(dot(w, w)) + TINY)
    return radii


def _rotations(p_BC: Array, frames: Array, p_BBcm: Array, rho: float) -> Array:
    """Rotations about lines through each contact and their centroid, shape (M, 128, 6).

    The lines run along the contact frames' axes, the triangle's sides and its altitudes; a
    rotation is (velocity of the centre of mass, rho times angular velocity), which pairs with
    wrenches.
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

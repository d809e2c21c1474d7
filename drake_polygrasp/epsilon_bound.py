"""Where W reaches least far: bounds of epsilon from above, for many grasps at once.

Arrays, W and h are those of `wrench`. Nothing here is proved: `certification.wrench_space` bounds
epsilon from below too.
"""

from __future__ import annotations

import itertools

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.vectors import cross, dot, unit
from drake_polygrasp.wrench import cone_wrenches, contact_frames, plane_normal

_CHUNK = 64
"""Grasps at a time, which keeps the arrays of their directions in the cache."""
_TINY = 1e-100
"""Keeps divisions finite."""
_LEVEL = 1e-9
"""Ours: rates of less count as this much."""
_ORDERS = np.array(list(itertools.permutations(range(3)))).T
_TURNS = 16
"""Ours: points of a rim that are tried; 32 lower the bound by 0.1 percent more."""
_ANGLES = 2 * np.pi * (np.arange(_TURNS) + 0.5) / _TURNS
_COSINES, _SINES = np.cos(_ANGLES), np.sin(_ANGLES)
_NUM_TWISTS = 2 * _TURNS * _ORDERS.shape[1]


def epsilon_upper_bound(
    p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float
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

    Returns:
        Shape (M,), not negative; it does not depend on the frame or the order of the contacts.
    """
    bounds: list[Array] = []
    for rows in np.array_split(np.arange(len(p_BC)), len(p_BC) // _CHUNK + 1):
        contacts = p_BC[rows], nhat_TB_B[rows], mu[rows]
        cones = cone_wrenches(*contacts, p_BBcm, rho)
        twists = _rim_twists(*contacts, p_BBcm, rho)
        bound = _radii(cones, twists.reshape(len(rows), _NUM_TWISTS, 6)).min(axis=1)
        bounds.append(bound)
    highest: Array = np.maximum(np.concatenate(bounds), 0.0)
    return highest


def critical_directions(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    p_BBcm: Array,
    rho: float,
    num: int = 12,
    *,
    turns: bool = False,
) -> tuple[Array, Array]:
    """The unit w in which W reaches least far: what a change of the contacts must improve on.

    Contacts and scale as of `epsilon_upper_bound`; with `turns`, rotations about lines that the
    contacts single out count too, by which the object often leaves contacts that do not hold.

    Returns:
        `num` directions of little h for each grasp, in no order, shape (M, num, 6), and the least
        of h, which bounds epsilon from above where the grasp holds, shape (M,).
    """
    found = []
    for rows in np.array_split(np.arange(len(p_BC)), len(p_BC) // _CHUNK + 1):
        contacts = p_BC[rows], nhat_TB_B[rows], mu[rows]
        w = _rim_twists(*contacts, p_BBcm, rho)
        cones = cone_wrenches(*contacts, p_BBcm, rho)
        radius = _radii(cones, w.reshape(len(rows), _NUM_TWISTS, 6))
        radius = radius.reshape(w.shape[:-1])
        before, after = np.roll(radius, 1, axis=2), np.roll(radius, -1, axis=2)
        is_least = (radius <= before) & (radius <= after)
        order = np.where(is_least, radius, radius + radius.max(initial=0.0))
        w, order = w.reshape(len(rows), _NUM_TWISTS, 6), order.reshape(len(rows), _NUM_TWISTS)
        if turns:
            rotations = _rotations(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
            w = np.concatenate([w, rotations], axis=1)
            order = np.concatenate([order, _radii(cones, rotations)], axis=1)
        best = np.argpartition(order, num, axis=1)[:, :num]
        w = np.take_along_axis(w, best[..., None], axis=1)
        least = order.min(axis=1)
        found.append((unit(w), np.maximum(least, 0.0)))
    directions, bound = zip(*found, strict=True)
    return np.concatenate(directions), np.concatenate(bound)


def _rim_twists(p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float) -> Array:
    """Normals of the facets of W that hold one contact's disc whole, shape (M, 6, _TURNS, 2, 6).

    A contact's part of W is a disc, the wrenches of its cone with normal force 1. The facet
    nearest to the origin nearly always holds the disc of some contact i and touches the rims of
    the others, j and k, in a point each. Seen as a twist with velocities g at the contacts, such
    a w has g_i = n_i, and g_j and g_k with h = 1; rigidity leaves one freedom, the angle of the
    point on rim j, sampled here, and two solutions for k. (i, j, k) are all permutations.
    """
    i, j, k = _ORDERS
    frames = contact_frames(p_BC, nhat_TB_B)[:, j]
    r = (p_BC - p_BBcm) / rho
    r_i, r_ij, r_ik = (a[:, :, None] for a in (r[:, i], r[:, j] - r[:, i], r[:, k] - r[:, i]))
    n_i, n_j, n_k = (nhat_TB_B[:, c, None] for c in (i, j, k))
    mu_j, mu_k = mu[:, j, None], mu[:, k, None] ** 2

    along = _COSINES[:, None] * frames[:, :, None, 1] + _SINES[:, None] * frames[:, :, None, 2]
    along = along - mu_j[..., None] * n_j
    # g_j = n_j + s along has h_j = 1; rigidity: (g_j - n_i) . r_ij = 0.
    rate = dot(along, r_ij)
    s = dot(n_i - n_j, r_ij) / np.where(np.abs(rate) < _LEVEL, _LEVEL, rate)
    g_ij = n_j + s[..., None] * along - n_i
    omega = cross(r_ij, g_ij) / (dot(r_ij, r_ij) + _TINY)[..., None]
    # What is left is a turn t about r_ij; h_k = 1 is quadratic in it.
    g_k, rise = n_i + cross(omega, r_ik), cross(r_ij, r_ik)
    x, x_t = dot(n_k, g_k), dot(n_k, rise)
    a = mu_k * dot(rise, rise) - (1 + mu_k) * x_t * x_t
    b = mu_k * dot(g_k, rise) - (1 + mu_k) * x * x_t + x_t
    c = mu_k * dot(g_k, g_k) - (1 + mu_k) * x * x + 2 * x - 1
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    t = np.stack([-b - root, -b + root], axis=-1)
    t = t / np.where(np.abs(a) < _TINY, _TINY, a)[..., None]
    omega = omega[..., None, :] + t[..., None] * r_ij[..., None, :]
    v = n_i[..., None, :] - cross(omega, r_i[..., None, :])
    twists: Array = np.concatenate([v, omega], axis=-1)
    return twists


def _radii(cones: Array, w: Array) -> Array:
    """h(w) / |w| for cones (M, 3, 3, 6) and directions (M, K, 6), shape (M, K)."""
    rows = w @ cones.reshape(len(w), 9, 6).transpose(0, 2, 1)
    n, t_1, t_2 = rows[..., 0::3], rows[..., 1::3], rows[..., 2::3]
    h = n + np.sqrt(t_1 * t_1 + t_2 * t_2)
    highest = np.maximum(np.maximum(h[..., 0], h[..., 1]), h[..., 2])
    radius: Array = highest / (np.sqrt(np.einsum("mki,mki->mk", w, w)) + _TINY)
    return radius


def _rotations(p_BC: Array, nhat_TB_B: Array, p_BBcm: Array, rho: float) -> Array:
    """Rotations about lines through each contact and their centroid, shape (M, 128, 6).

    The lines run along the contact frames' axes, the triangle's sides and its altitudes; a
    rotation is (velocity of the centre of mass, rho times angular velocity), which pairs with
    wrenches.
    """
    N = plane_normal(p_BC)[:, None]
    sides = unit(p_BC - p_BC[:, (2, 0, 1)])
    frames = contact_frames(p_BC, nhat_TB_B).reshape(-1, 9, 3)
    omega = np.concatenate([N, sides, cross(N, sides), frames], axis=1)[:, None]
    points = np.concatenate([p_BC, p_BC.mean(axis=1, keepdims=True)], axis=1)
    v = cross(p_BBcm - points[:, :, None], -omega)
    twists = np.concatenate([v, np.broadcast_to(rho * omega, v.shape)], axis=-1)
    twists = twists.reshape(-1, 64, 6)
    return np.concatenate([twists, -twists], axis=1)

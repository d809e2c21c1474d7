"""Where W reaches least far: bounds of epsilon from above, for many grasps at once.

Arrays, W and h are those of `wrench`. Nothing here is proved: `certification.wrench_space` bounds
epsilon from below too.
"""

from __future__ import annotations

import itertools

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.vectors import cross, dot, unit
from drake_polygrasp.wrench import contact_frames, frame_wrenches, plane_normal

_CHUNK = 64
"""Grasps at a time, which keeps the arrays of their directions in the cache."""
_TINY = 1e-100
"""Keeps divisions finite."""
_LEVEL = 1e-9
"""Ours: rates of less count as this much."""
_ORDERS = np.array(list(itertools.permutations(range(3)))).T
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
    for rows in np.array_split(np.arange(len(p_BC)), len(p_BC) // _CHUNK + 1):
        frames, r = _placed(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
        twists = _rim_twists(frames, r, mu[rows], num_turns)
        bounds.append(_radii(frame_wrenches(frames, r, mu[rows]), twists).min(axis=1))
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
        `num` directions of little h for each grasp, in no order, shape (M, num, 6), and the least
        of h, which bounds epsilon from above where the grasp holds, shape (M,).
    """
    found = []
    before, after = np.arange(num_turns) - 1, np.arange(num_turns) + 1 - num_turns
    for rows in np.array_split(np.arange(len(p_BC)), len(p_BC) // _CHUNK + 1):
        frames, r = _placed(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
        w = _rim_twists(frames, r, mu[rows], num_turns)
        cones = frame_wrenches(frames, r, mu[rows])
        radius = _radii(cones, w)
        along_rims = radius.reshape(-1, num_turns)
        neighbours = np.minimum(along_rims[:, before], along_rims[:, after])
        is_least = (along_rims <= neighbours).reshape(radius.shape)
        order = np.where(is_least, radius, radius + radius.max(initial=0.0))
        if rotations:
            others = _rotations(p_BC[rows], frames, p_BBcm, rho)
            w = np.concatenate([w, others], axis=2)
            order = np.concatenate([order, _radii(cones, others)], axis=1)
        best = np.argpartition(order, num, axis=1)[:, :num]
        w = w[np.arange(len(rows))[:, None], :, best]
        found.append((unit(w), np.maximum(order.min(axis=1), 0.0)))
    directions, bound = zip(*found, strict=True)
    return np.concatenate(directions), np.concatenate(bound)


def _placed(p_BC: Array, nhat_TB_B: Array, p_BBcm: Array, rho: float) -> tuple[Array, Array]:
    """Contact frames, shape (M, 3, 3, 3), and points from the centre of mass over rho."""
    return contact_frames(p_BC, nhat_TB_B), (p_BC - p_BBcm) / rho


def _rim_twists(frames: Array, r: Array, mu: Array, num_turns: int) -> Array:
    """Normals of the facets of W that hold one contact's disc whole, shape (M, 6, 12 num_turns).

    A contact's part of W is a disc, the wrenches of its cone with normal force 1. The facet
    nearest to the origin nearly always holds the disc of some contact i and touches the rims of
    the others, j and k, in a point each. Seen as a twist with velocities g at the contacts, such
    a w has g_i = n_i, and g_j and g_k with h = 1; rigidity leaves one freedom, the angle of the
    point on rim j, sampled here, and two solutions for k. (i, j, k) are all permutations, and the
    twists of one of them and one root are consecutive, by angle.
    """
    i, j, k = _ORDERS
    M, num_orders = len(r), len(i)
    r_i, n_i, mu_j = r[:, i], frames[:, i, 0], mu[:, j, None]
    r_ij, r_ik = r[:, j] - r_i, r[:, k] - r_i

    # g_j = n_j + s (cos t_1 + sin t_2 - mu_j n_j) has h_j = 1: all that follows is linear in the
    # cosine, the sine, 1 and the change from n_i to n_j, and in the turn about r_ij that is left.
    change = np.concatenate([frames[:, j][:, :, (1, 2, 0)], frames[:, j, :1] - n_i[:, :, None]], 2)
    change[:, :, 2] *= -mu_j
    rate = (change @ r_ij[..., None])[..., 0]
    omega = np.empty((M, num_orders, 5, 3))
    omega[:, :, :4] = cross(r_ij[:, :, None], change)
    omega[:, :, :4] /= (dot(r_ij, r_ij) + _TINY)[..., None, None]
    omega[:, :, 4] = r_ij
    linear = np.empty((9, M, num_orders, 5))
    v = cross(r_i[:, :, None], omega)
    v[:, :, 3] += n_i
    g_k = cross(omega, r_ik[:, :, None])
    g_k[:, :, 3] += n_i
    for first, part in enumerate((g_k @ frames[:, k].swapaxes(2, 3), v, omega)):
        linear[3 * first : 3 * first + 3] = part.transpose(3, 0, 1, 2)

    # Rigidity: (g_j - n_i) . r_ij = 0.
    angles = 2 * np.pi * (np.arange(num_turns) + 0.5) / num_turns
    rim = np.stack([np.cos(angles), np.sin(angles), np.ones(num_turns)])
    turning = rate[..., :3] @ rim
    s = -rate[..., 3:] / np.where(np.abs(turning) < _LEVEL, _LEVEL, turning)
    moved = linear[..., 3:4] + s * (linear[..., :3] @ rim)
    # h_k = 1 is quadratic in the turn t.
    x, y, z = moved[:3]
    x_t, y_t, z_t = linear[:3, ..., 4:]
    mu_k = mu[:, k, None] ** 2
    a = mu_k * (y_t * y_t + z_t * z_t) - x_t * x_t
    b = mu_k * (y * y_t + z * z_t) + (1 - x) * x_t
    c = mu_k * (y * y + z * z) - (1 - x) ** 2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    t = np.stack([-b - root, -b + root], axis=2) / np.where(np.abs(a) < _TINY, _TINY, a)[..., None]
    twists = moved[3:, :, :, None] + t * linear[3:, :, :, 4, None, None]
    flat: Array = twists.reshape(6, M, 2 * num_orders * num_turns)
    return flat.swapaxes(0, 1)


def _radii(cones: Array, w: Array) -> Array:
    """h(w) / |w| for cones (M, 3, 3, 6) and directions (M, 6, K), shape (M, K)."""
    rows = cones.reshape(len(w), 9, 6) @ w
    n, t_1, t_2 = rows[:, 0::3], rows[:, 1::3], rows[:, 2::3]
    h = n + np.sqrt(t_1 * t_1 + t_2 * t_2)
    highest = np.maximum(np.maximum(h[:, 0], h[:, 1]), h[:, 2])
    radius: Array = highest / (np.sqrt(np.einsum("mik,mik->mk", w, w)) + _TINY)
    return radius


def _rotations(p_BC: Array, frames: Array, p_BBcm: Array, rho: float) -> Array:
    """Rotations about lines through each contact and their centroid, shape (M, 6, 128).

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
    twists = twists.reshape(-1, 64, 6).swapaxes(1, 2)
    return np.concatenate([twists, -twists], axis=2)

"""Where W reaches least far: bounds of epsilon from above, for many grasps at once.

Arrays, W and h are those of `wrench`. Nothing here is proved: `certification.wrench_space` bounds
epsilon from below too.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.vectors import cross, cross_first, dot, unit
from drake_polygrasp.wrench import contact_frames, frame_wrenches, plane_normal

_CHUNK = 256
"""Grasps at a time, which keeps the arrays of their directions in the cache."""
_TINY = 1e-30
"""Keeps divisions finite, in single precision too."""
_LEVEL = {"d": 1e-12, "f": 1e-6}
"""Ours: rates of less count as this much, by precision."""
_FLAT = {"d": 1e-100, "f": 1e-10}
"""Ours: curvatures of less count as this much, by precision."""
_ORDERS = np.array(list(itertools.permutations(range(3)))).T
_PRODUCTS = np.array(list(itertools.combinations_with_replacement(range(3), 2))).T
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
    for rows in _chunks(len(p_BC)):
        frames, r = _placed(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
        lines = _lines(*(_grasps_last(values) for values in (frames, r, mu[rows])))
        radii = _rim_twists(lines, num_turns).radii()
        bounds.append(radii.min(axis=(0, 1, 2)))
    highest: Array = np.maximum(np.concatenate(bounds), 0.0)
    return highest


def epsilon_estimates(p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float) -> Array:
    """Coarse bounds of epsilon in single precision, to search by: nothing may rest on them.

    Arguments as of `epsilon_upper_bound`. Of most grasps six digits are right, of nearly
    degenerate ones three.

    Returns:
        Shape (M,), not negative.
    """
    estimates: list[Array] = []
    for rows in _chunks(len(p_BC)):
        placed = nhat_TB_B[rows], (p_BC[rows] - p_BBcm) / rho, mu[rows]
        nhat, *others = (_grasps_last(values.astype(np.float32)) for values in placed)
        lines = _lines(_frames_alone(nhat, others[0]), *others)
        estimates.append(_least_radii(lines, COARSE_TURNS))
    highest: Array = np.maximum(np.concatenate(estimates).astype(float), 0.0)
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
    for rows in _chunks(len(p_BC)):
        frames, r = _placed(p_BC[rows], nhat_TB_B[rows], p_BBcm, rho)
        lines = _lines(*(_grasps_last(values) for values in (frames, r, mu[rows])))
        twists = _rim_twists(lines, num_turns)
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
        best = np.argpartition(order, num, axis=1)[:, :num]
        found.append(
            (unit(w[np.arange(len(r))[:, None], best]), np.maximum(order.min(axis=1), 0.0))
        )
    directions, bound = zip(*found, strict=True)
    return np.concatenate(directions), np.concatenate(bound)


def _chunks(num: int) -> list[slice]:
    return [slice(first, first + _CHUNK) for first in range(0, max(num, 1), _CHUNK)]


def _placed(p_BC: Array, nhat_TB_B: Array, p_BBcm: Array, rho: float) -> tuple[Array, Array]:
    """Contact frames, shape (M, 3, 3, 3), and points from the centre of mass over rho."""
    return contact_frames(p_BC, nhat_TB_B), (p_BC - p_BBcm) / rho


def _grasps_last(values: Array) -> Array:
    """The last axes of (M, contacts, ...) first: what is computed for all grasps is contiguous."""
    return np.ascontiguousarray(values.T)


def _frames_alone(nhat: Array, r: Array) -> Array:
    """`contact_frames` of contacts that hold, of others anything; grasps last.

    Of normals and points, shape (3, 3 contacts, M) both; the result is turned as `_grasps_last`
    turns frames, shape (3, 3 rows, 3 contacts, M).
    """
    N = cross_first(r[:, 1] - r[:, 0], r[:, 2] - r[:, 1])[:, None]
    N = N / (np.sqrt((N * N).sum(axis=0)) + _TINY)
    tangent = N - (N * nhat).sum(axis=0) * nhat
    tangent /= np.sqrt((tangent * tangent).sum(axis=0)) + _TINY
    return np.stack([nhat, tangent, cross_first(nhat, tangent)], axis=1)


@dataclass(frozen=True, eq=False)
class _Lines:
    """Lines of twists at which one contact's disc lies in a facet of W.

    A contact's part of W is a disc, the wrenches of its cone with normal force 1. The facet
    nearest to the origin nearly always holds the disc of some contact i and touches the rims of
    the others, j and k, in a point each. Seen as a twist with velocities g at the contacts, such
    a w has g_i = n_i, and g_j and g_k with h = 1. Rigidity leaves a turn t about r_ij, by which
    g_k is brought to h_k = 1, and the angle of the point on rim j, with g_j = n_j + s (cos t_1 +
    sin t_2 - mu_j n_j). (i, j, k) are all permutations.
    """

    linear: Array
    """What multiplies s cos, s sin, s, 1 and t, shape (9, 5, 6, M). Rows are x, y, z of g_k in
    k's own frame, then the twist: velocity of the centre of mass and rho times angular
    velocity."""
    rate: Array
    """The same of (g_j - n_i) . r_ij, which rigidity makes zero, without t, shape (4, 6, M)."""
    mu_j: Array
    """Shape (6, M)."""
    mu_k: Array
    """Shape (6, M)."""

    def s(self, rim: Array) -> Array:
        """Where rigidity puts g_j, for points of the rim (T, 3), shape (T, 6, M)."""
        turning = _combined(rim, self.rate[:3])
        level = _LEVEL[turning.dtype.char]
        s: Array = -self.rate[3] / np.where(np.abs(turning) < level, level, turning)
        return s

    def h_j(self, s: Array) -> Array:
        """The greatest h at contact j; that at contact i is 1."""
        return 1.0 + self.mu_j * (np.abs(s) - s)


def _lines(frames: Array, r: Array, mu: Array) -> _Lines:
    """The lines of grasps, from `_grasps_last` of frames, points and friction."""
    i, j, k = _ORDERS
    r_i, n_i = r[:, i], frames[:, 0, i]
    r_ij, r_ik = r[:, j] - r_i, r[:, k] - r_i
    n_j, t_1, t_2 = frames[:, :, j].swapaxes(0, 1)
    change = np.stack([t_1, t_2, -mu[j] * n_j, n_j - n_i], axis=1)
    linear = np.empty((9, 5, *n_i.shape[1:]), frames.dtype)
    v, omega = linear[3:6], linear[6:]
    omega[:, :4] = cross_first(r_ij[:, None], change) / ((r_ij * r_ij).sum(axis=0) + _TINY)
    omega[:, 4] = r_ij
    v[:] = cross_first(r_i[:, None], omega)
    g_k = cross_first(omega, r_ik[:, None])
    v[:, 3] += n_i
    g_k[:, 3] += n_i
    linear[:3] = (frames[:, :, None, k] * g_k[:, None]).sum(axis=0)
    return _Lines(linear, (change * r_ij[:, None]).sum(axis=0), mu[j], mu[k])


@dataclass(frozen=True, eq=False)
class _RimTwists:
    """Twists on lines, `at` plus `t` times `along`; two on each, for each of T angles.

    Rows are those of `_Lines.linear`.
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
        radii: Array = h / (np.sqrt(square) + _TINY)
        return radii


def _rim_twists(lines: _Lines, num_turns: int) -> _RimTwists:
    rim, linear, mu_k = _rim(num_turns), lines.linear, lines.mu_k
    s = lines.s(rim)
    at = _combined(rim, linear[:, :3])
    at *= s
    at += linear[:, 3, None]
    # h_k = 1 is quadratic in t.
    (x, y, z), (x_t, y_t, z_t) = at[:3], linear[:3, 4]
    a = mu_k**2 * (y_t * y_t + z_t * z_t) - x_t * x_t
    b = mu_k**2 * (y * y_t + z * z_t) + (1 - x) * x_t
    c = mu_k**2 * (y * y + z * z) - (1 - x) ** 2
    root = np.sqrt(np.maximum(b * b - a * c, 0.0))
    t = np.stack([-b - root, -b + root]) / _not_flat(a)
    return _RimTwists(at, linear[:, 4], t, lines.h_j(s), mu_k)


def _least_radii(lines: _Lines, num_turns: int) -> Array:
    """The least h(w) / |w| of the same twists, shape (M,), without the twists.

    Squares of what is linear in s cos, s sin, s, 1 and t are quadratic forms: a third of the
    arithmetic, half of the digits.
    """
    rim, linear, mu_k = _rim(num_turns), lines.linear, lines.mu_k
    s = lines.s(rim)
    g_k = linear[:3].copy()
    g_k[0, 3] -= 1.0
    x = _combined(rim, g_k[0, :3]) * s + g_k[0, 3]
    # (h_k - x)^2 - (1 - x)^2 = c + 2 b t + a t^2, and |w|^2 in the same way.
    signed = g_k * np.stack([-np.ones_like(mu_k), mu_k**2, mu_k**2])[:, None]
    c, b, a = _form(g_k, signed, s, rim)
    square, slope, curvature = _form(linear[3:], linear[3:], s, rim)
    discriminant = b * b - a * c
    root, over = np.sqrt(np.maximum(discriminant, 0.0)), 1.0 / _not_flat(a)
    missed = np.maximum(-discriminant, 0.0) * over
    h_j, least = lines.h_j(s), np.full(s.shape[-1], np.inf, s.dtype)
    for t in ((-b - root) * over, (-b + root) * over):
        x_t = x + t * g_k[0, 4]
        h = np.maximum(1.0 + x_t + np.sqrt(np.maximum(x_t * x_t + missed, 0.0)), h_j)
        length = np.sqrt(np.maximum(square + t * (2.0 * slope + t * curvature), _TINY))
        least = np.minimum(least, (h / length).min(axis=(0, 1)))
    return least


def _form(first: Array, second: Array, s: Array, rim: Array) -> tuple[Array, Array, Array]:
    """Products of what is linear, (L, 5, 6, M) each, as c + 2 b t + a t^2.

    c and b have shape (T, 6, M), a has (6, M). Of the two, one is the other with rows multiplied.
    """
    i, j = _PRODUCTS
    squares = (first[:, i] * second[:, j]).sum(axis=0)
    with_1 = (first[:, :4] * second[:, 3, None]).sum(axis=0)
    with_t = (first * second[:, 4, None]).sum(axis=0)
    c = _combined(rim[:, i] * rim[:, j] * np.where(i == j, 1.0, 2.0), squares)
    c *= s
    c += 2.0 * _combined(rim, with_1[:3])
    c *= s
    c += with_1[3]
    b = _combined(rim, with_t[:3])
    b *= s
    b += with_t[3]
    return c, b, with_t[4]


def _not_flat(a: Array) -> Array:
    level = _FLAT[a.dtype.char]
    return np.where(np.abs(a) < level, level, a)


@cache
def _rim(num_turns: int) -> Array:
    """Points (cos, sin, 1) around a unit circle, shape (num_turns, 3)."""
    angles = 2 * np.pi * (np.arange(num_turns) + 0.5) / num_turns
    return frozen(np.stack([np.cos(angles), np.sin(angles), np.ones(num_turns)], axis=1))


def _combined(weights: Array, values: Array) -> Array:
    """Weighted sums, (T, K) of (..., K, 6, M) to (..., T, 6, M)."""
    *shape, K, L, M = values.shape
    sums: Array = weights.astype(values.dtype) @ values.reshape(*shape, K, L * M)
    return sums.reshape(*shape, len(weights), L, M)


def _radii(cones: Array, w: Array) -> Array:
    """h(w) / |w| for cones (M, 3, 3, 6) and directions (M, K, 6), shape (M, K)."""
    n, t_1, t_2 = np.moveaxis(cones, 2, 0) @ w.swapaxes(1, 2)
    h = (n + np.sqrt(t_1 * t_1 + t_2 * t_2)).max(axis=1)
    radii: Array = h / (np.sqrt(dot(w, w)) + _TINY)
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

"""Candidate minimisers of h(w): twists whose supporting facet of W contains a whole friction disc.

The facet of W nearest to the origin, whose distance is epsilon, almost always has this form.

Arrays here have components first and grasps last, so that operations on all grasps run over
contiguous memory. The precision of the results is that of the arguments.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.vectors import circle, cross_first

_CHUNK = 256
"""Number of grasps processed together, so that their twists stay in the processor's cache."""
TINY = 1e-30
"""Keeps divisions finite, in single precision too."""
_LEAST_RATE = {"d": 1e-12, "f": 1e-6}
"""Our choice, by precision: divisors of smaller magnitude are replaced by this one."""
_LEAST_CURVATURE = {"d": 1e-100, "f": 1e-10}
"""Our choice, by precision: coefficients of t^2 of smaller magnitude are replaced by this one."""
_ORDERS = np.array(list(itertools.permutations(range(3)))).T


@dataclass(frozen=True, eq=False)
class FacetTwists:
    """Families of twists w(t), each with the friction disc of one contact in its supporting facet.

    A family belongs to a permutation (i, j, k) of the contacts, six in all, and to one of T angles
    theta on the rim of contact j's disc. A twist w gives the contacts velocities g_i, g_j and g_k:

    - g_i = n_i, so that w . x = 1 on the whole disc of contact i;
    - g_j = n_j + s (cos(theta) t_1 + sin(theta) t_2 - mu_j n_j), so that, for s >= 0, h_j(w) = 1,
      attained at the angle theta of the rim. The body is rigid, which determines s;
    - t is free: the rate of a rotation about the line through contacts i and j, which leaves g_i
      and g_j alone. The facet also touches the disc of contact k where t makes h_k(w) = 1.

    Attributes:
        linear: coefficients of s cos(theta), s sin(theta), s, 1 and t, shape (9, 5, 6, M): those of
            g_k in the frame of contact k in the first three rows, those of w in the other six.
        points: (cos(theta), sin(theta), 1) of the angles, shape (T, 3).
        s: the value of s that rigidity requires, of either sign, shape (T, 6, M).
        h_j: h_j(w), which is above 1 where s < 0, shape (T, 6, M).
        mu_k: friction coefficient of contact k, shape (6, M).
    """

    linear: Array
    points: Array
    s: Array
    h_j: Array
    mu_k: Array


def facet_twists(frames: Array, r: Array, mu: Array, num_angles: int) -> FacetTwists:
    """Returns the families of facet twists of M grasps.

    Args:
        frames: contact frames as `contacts.contact_frames` returns them, shape (M, 3, 3, 3).
        r: contact points from the centre of mass, divided by rho, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        num_angles: T, the number of angles on each rim.
    """
    frames, r, mu = grasps_last(frames), grasps_last(r), grasps_last(mu)
    i, j, k = _ORDERS
    # take is twice as fast as indexing.
    r_i, n_i, mu_j = r.take(i, axis=1), frames[:, 0].take(i, axis=1), mu.take(j, axis=0)
    r_ij, r_ik = r.take(j, axis=1) - r_i, r.take(k, axis=1) - r_i
    change = np.empty((3, 4, *n_i.shape[1:]), frames.dtype)
    change[:, (2, 0, 1)] = frames.take(j, axis=2)
    change[:, 3] = change[:, 2] - n_i
    change[:, 2] *= -mu_j
    linear = np.empty((9, 5, *n_i.shape[1:]), frames.dtype)
    v, omega = linear[3:6], linear[6:]
    omega[:, :4] = cross_first(r_ij[:, None], change) / ((r_ij * r_ij).sum(axis=0) + TINY)
    omega[:, 4] = r_ij
    v[:] = cross_first(r_i[:, None], omega)
    g_k = cross_first(omega, r_ik[:, None])
    v[:, 3] += n_i
    g_k[:, 3] += n_i
    linear[:3] = (frames.take(k, axis=2)[:, :, None] * g_k[:, None]).sum(axis=0)
    # Rigidity: (g_j - n_i) . r_ij = 0.
    points, rate = rim(num_angles), (change * r_ij[:, None]).sum(axis=0)
    turning = combined(points, rate[:3])
    level = _LEAST_RATE[turning.dtype.char]
    s = -rate[3] / np.where(np.abs(turning) < level, level, turning)
    return FacetTwists(linear, points, s, 1.0 + mu_j * (np.abs(s) - s), mu.take(k, axis=0))


def grasps_last(values: Array) -> Array:
    """Returns a contiguous copy with the axes reversed, so that grasps come last.

    Args:
        values: values of grasps, shape (M, contacts, ...).
    """
    return np.ascontiguousarray(values.T)


def chunks(num: int) -> list[slice]:
    """Returns slices of `_CHUNK` rows that together cover all grasps, at least one slice.

    Args:
        num: number of grasps.
    """
    return [slice(first, first + _CHUNK) for first in range(0, max(num, 1), _CHUNK)]


@cache
def rim(num_angles: int) -> Array:
    """Returns (cos, sin, 1) of angles spaced evenly around the circle, shape (num_angles, 3).

    Args:
        num_angles: number of angles.
    """
    points = circle(2 * np.pi * (np.arange(num_angles) + 0.5) / num_angles)
    return frozen(np.column_stack([points, np.ones(num_angles)]))


def combined(weights: Array, values: Array) -> Array:
    """Returns sums of values with T sets of weights, shape (..., T, 6, M).

    Args:
        weights: shape (T, K).
        values: shape (..., K, 6, M).
    """
    *shape, K, L, M = values.shape
    flat = values.reshape(*shape, K, L * M)
    sums: Array = np.einsum("tk,...kn->...tn", weights.astype(values.dtype), flat)
    return sums.reshape(*shape, len(weights), L, M)


def not_flat(a: Array) -> Array:
    """Returns coefficients with those near zero replaced, so that they can be divided by.

    Args:
        a: coefficients of t^2, of any shape.
    """
    level = _LEAST_CURVATURE[a.dtype.char]
    return np.where(np.abs(a) < level, level, a)

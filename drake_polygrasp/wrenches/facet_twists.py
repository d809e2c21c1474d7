"""Twists that hold one contact's disc in a facet of W: where W reaches least far, nearly always.

Arrays of lines have grasps last and components first, so that what is computed for all grasps is
contiguous; W and h are those of `contacts`. All is computed in the precision of what it is given.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.vectors import circle, cross_first

CHUNK = 256
"""Grasps at a time, which keeps the arrays of their twists in the cache."""
TINY = 1e-30
"""Keeps divisions finite, in single precision too."""
_SLOW = {"d": 1e-12, "f": 1e-6}
"""Ours: rates of less count as this much, by precision."""
_FLAT = {"d": 1e-100, "f": 1e-10}
"""Ours: curvatures of less count as this much, by precision."""
_ORDERS = np.array(list(itertools.permutations(range(3)))).T


@dataclass(frozen=True, eq=False)
class FacetTwists:
    """FacetTwists of twists at which one contact's disc lies in a facet of W.

    A contact's part of W is a disc, the wrenches of its cone with normal force 1. The facet
    nearest to the origin nearly always holds the disc of some contact i and touches the rims of
    the others, j and k, in a point each. Seen as a twist with velocities g at the contacts, such
    a w has g_i = n_i, and g_j and g_k with h = 1. Rigidity leaves a turn t about r_ij, by which
    g_k is brought to h_k = 1, and the angle of the point on rim j, of which T are tried, with
    g_j = n_j + s (cos t_1 + sin t_2 - mu_j n_j). (i, j, k) are all permutations.

    Attributes:
        linear: what multiplies s cos, s sin, s, 1 and t, shape (9, 5, 6, M). Rows are x, y, z of
            g_k in k's own frame, then the twist: velocity of the centre of mass and rho times
            angular velocity.
        points: cos, sin and 1 of the angles, shape (T, 3).
        s: where rigidity puts g_j, shape (T, 6, M).
        h_j: what h is at contact j, where it is 1 at contact i, shape (T, 6, M).
        mu_k: shape (6, M).
    """

    linear: Array
    points: Array
    s: Array
    h_j: Array
    mu_k: Array


def facet_twists(frames: Array, r: Array, mu: Array, num_turns: int) -> FacetTwists:
    """The lines of grasps.

    Args:
        frames: of contacts, as of `contacts.contact_frames`, shape (M, 3, 3, 3).
        r: points from the centre of mass over rho, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        num_turns: T, how many angles are tried.
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
    points, rate = rim(num_turns), (change * r_ij[:, None]).sum(axis=0)
    turning = combined(points, rate[:3])
    level = _SLOW[turning.dtype.char]
    s = -rate[3] / np.where(np.abs(turning) < level, level, turning)
    return FacetTwists(linear, points, s, 1.0 + mu_j * (np.abs(s) - s), mu.take(k, axis=0))


def grasps_last(values: Array) -> Array:
    """The last axes of (M, contacts, ...) first: what is computed for all grasps is contiguous."""
    return np.ascontiguousarray(values.T)


def chunks(num: int) -> list[slice]:
    """Rows of `CHUNK` grasps each, one slice at least."""
    return [slice(first, first + CHUNK) for first in range(0, max(num, 1), CHUNK)]


@cache
def rim(num_turns: int) -> Array:
    """Points (cos, sin, 1) around a unit circle, shape (num_turns, 3)."""
    points = circle(2 * np.pi * (np.arange(num_turns) + 0.5) / num_turns)
    return frozen(np.column_stack([points, np.ones(num_turns)]))


def combined(weights: Array, values: Array) -> Array:
    """Weighted sums, (T, K) of (..., K, 6, M) to (..., T, 6, M)."""
    *shape, K, L, M = values.shape
    flat = values.reshape(*shape, K, L * M)
    sums: Array = np.einsum("tk,...kn->...tn", weights.astype(values.dtype), flat)
    return sums.reshape(*shape, len(weights), L, M)


def not_flat(a: Array) -> Array:
    """The curvatures, kept off zero to divide by."""
    level = _FLAT[a.dtype.char]
    return np.where(np.abs(a) < level, level, a)

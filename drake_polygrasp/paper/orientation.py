"""Sections 4.1 and 4.2, "according to their orientations": which sets of faces oppose each other.

Proposition 2 asks that phi < alpha and that the origin lie in the hull of the boundary directions
of the planar cones. With "non-negative combination" and "interior of the hull", which is what its
proof needs, it says that the least spherical cap around the normals is wider than pi/2 - alpha.
We test the cap: it needs no plane Pi_l, which does not exist where two normals coincide, and
becomes Section 4.2's test for pairs there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.digits import to_decimals
from drake_polygrasp.geometry.face_sets import pairs, triples
from drake_polygrasp.geometry.tolerances import ANGLE_TOLERANCE, SAME_NORMAL
from drake_polygrasp.vectors import cross, dot, unit

_PAIRS = np.array([[1, 2], [0, 2], [0, 1]])  # the two others of each of three


def friction_angle(mu: Array) -> Array:
    """The paper's alpha for sets whose faces have coefficients mu of shape (M, k): the largest.

    Selection only filters, so it takes the most favourable cone; the certificate takes each
    contact's own.
    """
    return to_decimals(np.arctan(mu.max(axis=1)))


def least_ball_centre(tips: Array) -> Array:
    """Centre of the least ball around three points of shape (..., 3, 3); shape (..., 3).

    For unit vectors it points at the centre of their least spherical cap, and its length is the
    cosine of the cap's angular radius (caps of at most a half sphere).
    """
    opposite = tips[..., _PAIRS, :]
    edge = opposite[..., 1, :] - opposite[..., 0, :]
    square = dot(edge, edge)
    # Barycentric weights of the circumcentre; a right or obtuse angle leaves its opposite edge.
    weight = square * (square.sum(axis=-1, keepdims=True) - 2 * square)
    longest = np.argmax(square, axis=-1)
    by_edge = square.sum(axis=-1) <= 2 * square.max(axis=-1) * (1 + 1e-12)
    two = np.where(np.arange(3) == longest[..., None], 0.0, 0.5)
    total = np.where(by_edge, 1.0, weight.sum(axis=-1))
    weight = np.where(by_edge[..., None], two, weight / total[..., None])
    centre: Array = (weight[..., None] * tips).sum(axis=-2)
    return centre


def sine_of_tips_plane(nhat: Array) -> tuple[Array, Array]:
    """The paper's Pi_l: its unit normal N with N . n_i >= 0, and sin(phi) = N . n_i.

    Args:
        nhat: three distinct normals, shape (M, 3, 3).

    Returns:
        N, shape (M, 3), and sin(phi), shape (M,).
    """
    N = unit(cross(nhat[:, 1] - nhat[:, 0], nhat[:, 2] - nhat[:, 0]))
    height = dot(N[:, None], nhat).mean(axis=1)
    N = np.where(height[:, None] < 0, -N, N)
    return N, np.abs(height)


def opposes(nhat: Array, alpha: Array) -> Bools:
    """Proposition 2 for triples: shape (M, 3, 3) and (M,) to (M,)."""
    passes = _may_oppose(nhat, alpha)
    rows = np.flatnonzero(passes)
    centre = least_ball_centre(nhat[rows])
    passes[rows] = np.sqrt(dot(centre, centre)) < np.sin(alpha[rows]) - ANGLE_TOLERANCE
    return passes


def _may_oppose(nhat: Array, alpha: Array) -> Bools:
    """A cheaper condition that `opposes` implies, from the products of the normals alone."""
    a, b, c = dot(nhat[:, _PAIRS[:, 0]], nhat[:, _PAIRS[:, 1]]).T
    least = np.minimum(np.minimum(a, b), c)
    # Squared distance from the origin of the farthest pair's middle; the least ball's centre is
    # there if the triangle has no acute angle opposite, else in the tips' plane.
    by_pair = (1 + least) / 2
    gram = 1 + 2 * a * b * c - a * a - b * b - c * c
    cross = (1 - a) * (1 - b) + (1 - b) * (1 - c) + (1 - c) * (1 - a)
    cross = 2 * cross - (1 - a) ** 2 - (1 - b) ** 2 - (1 - c) ** 2
    obtuse = a + b + c - 2 * least >= 1
    square = np.where(obtuse, by_pair, gram / np.maximum(cross, 1e-12))
    may: Bools = square < np.sin(alpha) ** 2 + 1e-3
    return may


def pair_opposes(nhat: Array, alpha: Array) -> Bools:
    """Section 4.2 for pairs, phi = (pi - angle) / 2 < alpha: shape (M, 2, 3) and (M,) to (M,)."""
    passes: Bools = sine_of_pair(nhat) < np.sin(alpha) - ANGLE_TOLERANCE
    return passes


def sets_oppose(nhat: Array, mu: Array) -> Bools:
    """Whether the faces of pairs or of triples oppose each other.

    Args:
        nhat: inward unit normals, shape (M, 2, 3) or (M, 3, 3).
        mu: friction coefficients, shape (M, 2) or (M, 3).

    Returns:
        Shape (M,).
    """
    alpha = friction_angle(mu)
    return pair_opposes(nhat, alpha) if nhat.shape[1] == 2 else opposes(nhat, alpha)


def sine_of_pair(nhat: Array) -> Array:
    """sin(phi) of two faces, half the length of n_1 + n_2: shape (M, 2, 3) to (M,)."""
    total = nhat[:, 0] + nhat[:, 1]
    sine: Array = np.sqrt(dot(total, total)) / 2
    return sine


def least_opposing_friction(nhat: Array) -> float | None:
    """The coefficient above which some pair or triple opposes; None if there is none, (n, 3)."""
    if len(nhat) < 2:
        return None
    sine = sine_of_pair(nhat[pairs(len(nhat))]).min()
    for region in triples(len(nhat)):
        centre = least_ball_centre(nhat[region])
        sine = min(sine, np.linalg.norm(centre, axis=-1).min(initial=1.0))
    return float(np.tan(np.arcsin(sine))) if sine < 1 else None


@dataclass(frozen=True, eq=False)
class Parallel:
    """The triples that are parallel (4.1).

    Attributes:
        rows: which of the M triples they are, ascending, shape (K,).
        opposing: position 0, 1 or 2 of the face that opposes the two others, shape (K,).
        nhat_bs: unit n_bs: axis of the least cap around n_i, n_j and -n_k, shape (K, 3).
        radius: angular radius of that cap [rad], shape (K,).
    """

    rows: Ints
    opposing: Ints
    nhat_bs: Array
    radius: Array


def classify(nhat: Array, alpha: Array) -> Parallel:
    """Parallel sets are those with a direction inside C_i, C_j and -C_k (4.1).

    k is the normal outside the closest pair; where pairs are equally close, the least cap decides.
    """
    close = dot(nhat[:, _PAIRS[:, 0]], nhat[:, _PAIRS[:, 1]])
    is_closest = close >= close.max(axis=1, keepdims=True) - ANGLE_TOLERANCE
    # Within a cap of radius alpha no two vectors are more than 2 alpha apart.
    apart = np.maximum(close[:, [1, 2, 0]], close[:, [2, 0, 1]])
    may = (is_closest & (apart < -np.cos(2 * alpha)[:, None] + 1e-6)).any(axis=1)
    rows = np.flatnonzero(may | (alpha > np.pi / 2 - 1e-6))
    if not len(rows):
        return Parallel(rows, rows, np.empty((0, 3)), np.empty(0))

    flipped = nhat[rows, None] * (1 - 2 * np.eye(3))[None, :, :, None]
    axis = unit(least_ball_centre(flipped))
    sine = cross(axis[:, :, None], flipped)
    cosine = dot(axis[:, :, None], flipped)
    radius = to_decimals(np.arctan2(np.sqrt(dot(sine, sine)), cosine)).max(axis=-1)
    radius = np.where(is_closest[rows], radius, np.inf)
    opposing = np.argmax(radius <= radius.min(axis=1, keepdims=True) + ANGLE_TOLERANCE, axis=1)
    every = np.arange(len(rows))
    narrow = radius[every, opposing] < alpha[rows] - ANGLE_TOLERANCE
    return Parallel(
        rows[narrow],
        opposing[narrow],
        axis[every, opposing][narrow],
        radius[every, opposing][narrow],
    )


def sine_of_parallel(nhat: Array) -> Array:
    """sin(phi) of parallel sets, faces ordered A_1, A_2, A_3: shape (M, 3, 3) to (M,).

    The text leaves phi open where A_2 and A_3 have one normal, and so no plane through the tips:
    there it is that of the pair A_1, A_2.
    """
    gap = np.linalg.norm(nhat[:, 1] - nhat[:, 2], axis=-1)
    return np.where(gap > SAME_NORMAL, sine_of_tips_plane(nhat)[1], sine_of_pair(nhat[:, :2]))

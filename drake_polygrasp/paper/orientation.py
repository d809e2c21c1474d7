"""Sections 4.1 and 4.2, by orientation: sets of faces whose friction cones span all forces.

Proposition 2 requires phi < alpha and the origin in the hull of the boundary directions of the
cones in Pi_l. Its proof needs "non-negative combination" and "interior of the hull"; read so, it
says that the smallest spherical cap around n_1, n_2 and n_3 has an angular radius above
pi/2 - alpha. We test the cap, because it needs no Pi_l, which does not exist where two normals
coincide, and because it becomes Section 4.2's test for two faces there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.digits import to_decimals
from drake_polygrasp.geometry.face_sets import pairs, triples
from drake_polygrasp.geometry.tolerances import ANGLE_TOLERANCE, SAME_NORMAL
from drake_polygrasp.vectors import cross, dot, unit

_PAIRS = np.array([[1, 2], [0, 2], [0, 1]])
"""Row i holds the two faces other than i."""


def friction_angle(mu: Array) -> Array:
    """Computes the paper's alpha of each set of faces, from its largest friction coefficient.

    Selection only filters sets, so it assumes the widest cone; the certificate uses each contact's
    own coefficient.

    Args:
        mu: friction coefficients of the faces of each set, shape (M, k).

    Returns:
        alpha = arctan(mu) [rad], shape (M,).
    """
    return to_decimals(np.arctan(mu.max(axis=1)))


def least_ball_centre(tips: Array) -> Array:
    """Computes the centre of the smallest ball that contains three points.

    For unit vectors the centre points to the middle of the smallest spherical cap that contains
    them, and its length is the cosine of the cap's angular radius.

    Args:
        tips: three points, shape (..., 3, 3).

    Returns:
        The centre, shape (..., 3).
    """
    opposite = tips[..., _PAIRS, :]
    edge = opposite[..., 1, :] - opposite[..., 0, :]
    square = dot(edge, edge)
    # Barycentric weights of the circumcentre. In a right or obtuse triangle the smallest ball has
    # the longest edge as diameter.
    weight = square * (square.sum(axis=-1, keepdims=True) - 2 * square)
    longest = np.argmax(square, axis=-1)
    by_edge = square.sum(axis=-1) <= 2 * square.max(axis=-1) * (1 + 1e-12)
    two = np.where(np.arange(3) == longest[..., None], 0.0, 0.5)
    total = np.where(by_edge, 1.0, weight.sum(axis=-1))
    weight = np.where(by_edge[..., None], two, weight / total[..., None])
    centre: Array = (weight[..., None] * tips).sum(axis=-2)
    return centre


def sine_of_tips_plane(nhat: Array) -> tuple[Array, Array]:
    """Computes the plane Pi_l through the tips of three normals (Section 4.1), and sin(phi).

    phi is the angle between the normals and Pi_l, the same for all three.

    Args:
        nhat: three distinct unit normals a set, shape (M, 3, 3).

    Returns:
        N, the unit normal of Pi_l with N . n_i >= 0, shape (M, 3), and sin(phi) = N . n_i, shape
        (M,).
    """
    N = unit(cross(nhat[:, 1] - nhat[:, 0], nhat[:, 2] - nhat[:, 0]))
    height = dot(N[:, None], nhat).mean(axis=1)
    N = np.where(height[:, None] < 0, -N, N)
    return N, np.abs(height)


def opposes(nhat: Array, alpha: Array) -> Bools:
    """Tests Proposition 2 (Section 4.1): whether the friction cones of three faces span all forces.

    Args:
        nhat: inward unit normals, shape (M, 3, 3).
        alpha: half-angles of the friction cones [rad], shape (M,).

    Returns:
        Whether each set passes, shape (M,).
    """
    passes = _may_oppose(nhat, alpha)
    rows = np.flatnonzero(passes)
    centre = least_ball_centre(nhat[rows])
    passes[rows] = np.sqrt(dot(centre, centre)) < np.sin(alpha[rows]) - ANGLE_TOLERANCE
    return passes


def _may_oppose(nhat: Array, alpha: Array) -> Bools:
    """Tests a necessary condition for `opposes` that needs only the dot products of the normals."""
    a, b, c = dot(nhat[:, _PAIRS[:, 0]], nhat[:, _PAIRS[:, 1]]).T
    least = np.minimum(np.minimum(a, b), c)
    # Squared distance of the smallest ball's centre from the origin: in an obtuse triangle the
    # centre is the midpoint of the longest edge, else the point of Pi_l's parallel nearest to it.
    by_pair = (1 + least) / 2
    gram = 1 + 2 * a * b * c - a * a - b * b - c * c
    cross = (1 - a) * (1 - b) + (1 - b) * (1 - c) + (1 - c) * (1 - a)
    cross = 2 * cross - (1 - a) ** 2 - (1 - b) ** 2 - (1 - c) ** 2
    obtuse = a + b + c - 2 * least >= 1
    square = np.where(obtuse, by_pair, gram / np.maximum(cross, 1e-12))
    may: Bools = square < np.sin(alpha) ** 2 + 1e-3
    return may


def pair_opposes(nhat: Array, alpha: Array) -> Bools:
    """Tests Section 4.2's condition for two faces: phi = (pi - angle(n_1, n_2)) / 2 < alpha.

    Args:
        nhat: inward unit normals, shape (M, 2, 3).
        alpha: half-angles of the friction cones [rad], shape (M,).

    Returns:
        Whether each pair passes, shape (M,).
    """
    passes: Bools = sine_of_pair(nhat) < np.sin(alpha) - ANGLE_TOLERANCE
    return passes


def sets_oppose(nhat: Array, mu: Array) -> Bools:
    """Tests pairs or triples of faces by their orientations (Sections 4.1 and 4.2).

    Args:
        nhat: inward unit normals, shape (M, 2, 3) or (M, 3, 3).
        mu: friction coefficients, shape (M, 2) or (M, 3).

    Returns:
        Whether each set passes, shape (M,).
    """
    alpha = friction_angle(mu)
    return pair_opposes(nhat, alpha) if nhat.shape[1] == 2 else opposes(nhat, alpha)


def sine_of_pair(nhat: Array) -> Array:
    """Computes sin(phi) of two faces (Section 4.2), half the length of n_1 + n_2.

    Args:
        nhat: unit normals, shape (M, 2, 3).

    Returns:
        sin(phi), shape (M,).
    """
    total = nhat[:, 0] + nhat[:, 1]
    sine: Array = np.sqrt(dot(total, total)) / 2
    return sine


def least_opposing_friction(nhat: Array) -> float | None:
    """Computes the friction coefficient above which some set of faces passes by orientation.

    Args:
        nhat: inward unit normals of all faces, shape (n, 3).

    Returns:
        The coefficient, the same on all faces; None where no coefficient suffices.
    """
    if len(nhat) < 2:
        return None
    sine = sine_of_pair(nhat[pairs(len(nhat))]).min()
    for region in triples(len(nhat)):
        centre = least_ball_centre(nhat[region])
        sine = min(sine, np.linalg.norm(centre, axis=-1).min(initial=1.0))
    return float(np.tan(np.arcsin(sine))) if sine < 1 else None


@dataclass(frozen=True, eq=False)
class Parallel:
    """Triples that are parallel in the sense of Section 4.1: parallel forces can hold the object.

    Attributes:
        rows: indices of the parallel ones among the M triples, ascending, shape (K,).
        opposing: position 0, 1 or 2 of the face that opposes the two others, shape (K,).
        nhat_bs: n_bs, unit axis of the smallest cap around n_i, n_j and -n_k, shape (K, 3).
        radius: angular radius of that cap [rad], shape (K,).
    """

    rows: Ints
    opposing: Ints
    nhat_bs: Array
    radius: Array


def classify(nhat: Array, alpha: Array) -> Parallel:
    """Finds the parallel sets: those with a direction common to C_i, C_j and -C_k (Section 4.1).

    k is the face whose normal is not in the closest pair. The text does not say which pair counts
    where several are equally close: we take the one with the smallest cap around n_i, n_j and -n_k,
    and of equal caps the lowest k. A set is parallel when the cap's radius is below alpha.

    Args:
        nhat: inward unit normals, shape (M, 3, 3).
        alpha: half-angles of the friction cones [rad], shape (M,).

    Returns:
        The sets that are parallel.
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
    """Computes sin(phi) of parallel sets, which q_4 (eq. 9) uses.

    The text leaves phi open where A_2 and A_3 have the same normal and so no plane through the
    tips: then phi is that of the pair A_1, A_2.

    Args:
        nhat: unit normals of A_1, A_2 and A_3, A_1 being the opposing face, shape (M, 3, 3).

    Returns:
        sin(phi), shape (M,).
    """
    gap = np.linalg.norm(nhat[:, 1] - nhat[:, 2], axis=-1)
    return np.where(gap > SAME_NORMAL, sine_of_tips_plane(nhat)[1], sine_of_pair(nhat[:, :2]))

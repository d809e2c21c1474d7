"""Closed surfaces of 5-simplices in the space of wrenches: hulls, and what is made of them.

A surface is a list of simplices, rows of six ascending indices of points. It is closed where every
five points are in an even number of them: a cycle modulo 2, which has no boundary wherever its
points move. A row of five is called a ridge.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints

MOST_POINTS = 512
"""Our choice: what nine bits of a key tell apart."""
_FIVES = np.array(list(itertools.combinations(range(6), 5)))
_POWERS = MOST_POINTS ** np.arange(6)
_RAYS = 8
"""Our choice: how many rays are tried."""
_FLAT = 1e12
"""Our choice: what solutions are less than where points and origin are in no hyperplane."""
_CLEAR = 1e-6
"""Our choice, relative: how far from the rim of a simplex a ray must pass to be judged."""
_VISIBLE = 1e-10
"""Our choice: how far beyond a facet a point must be to count as outside."""


@dataclass(frozen=True, eq=False)
class Hull:
    """A convex hull with simplices for facets."""

    inside: Array
    """A point inside, shape (6,)."""
    simplices: Ints
    """Shape (J, 6)."""
    normals: Array
    """w.(x - inside) <= 1 is what each facet bounds, shape (J, 6)."""

    def twists(self) -> tuple[Array, Array]:
        """Returns facets as unit normals, shape (J, 6), and distances from the origin, (J,)."""
        length = np.sqrt((self.normals * self.normals).sum(axis=1))
        offset = 1.0 + (self.normals * self.inside).sum(axis=1)
        return self.normals / length[:, None], offset / length


def first_hull(points: Array) -> tuple[Hull, Ints] | None:
    """Returns a simplex of seven of the points, and their indices; None where points are flat."""
    chosen = [int((points * points).sum(axis=1).argmax())]
    rest = points - points[chosen[0]]
    scale = (rest * rest).sum(axis=1).max()
    basis: list[Array] = []
    for _ in range(6):
        square = (rest * rest).sum(axis=1)
        farthest = int(square.argmax())
        if square[farthest] <= 1e-12 * scale:
            return None
        chosen.append(farthest)
        basis.append(rest[farthest] / np.sqrt(square[farthest]))
        rest = rest - (rest * basis[-1]).sum(axis=1)[:, None] * basis[-1]
    order = np.sort(np.array(chosen))
    simplices = order[np.array(list(itertools.combinations(range(7), 6)))]
    inside = points[order].mean(axis=0)
    normals = solve((points[simplices] - inside).transpose(1, 2, 0), np.ones((6, 7))).T
    return Hull(inside, simplices, normals), order


def with_point(hull: Hull, points: Array, new: int) -> Hull:
    """Returns the hull of one more point: what sees it gives way to its cone.

    The plane of a new facet is that combination of the two planes at its ridge that holds the
    point, so that nothing is solved.
    """
    height = (hull.normals * (points[new] - hull.inside)).sum(axis=1)
    visible = height > 1.0 + _VISIBLE
    if not visible.any():
        return hull
    keys, rows = ridge_keys(hull.simplices), np.repeat(np.arange(len(visible)), 6)
    flat, seen = keys.ravel(), visible[rows]
    seen_keys, seen_at = flat[seen], np.flatnonzero(seen)
    hidden_at = np.flatnonzero(~seen)
    hidden_at = hidden_at[np.argsort(flat[hidden_at], kind="stable")]
    place = np.searchsorted(flat[hidden_at], seen_keys)
    place = np.minimum(place, len(hidden_at) - 1)
    rim = flat[hidden_at][place] == seen_keys
    near, far = rows[seen_at[rim]], rows[hidden_at[place[rim]]]
    share = ((1.0 - height[far]) / (height[near] - height[far]))[:, None]
    normals = share * hull.normals[near] + (1.0 - share) * hull.normals[far]
    ridges = hull.simplices[:, _FIVES].reshape(-1, 5)[seen_at[rim]]
    return Hull(
        hull.inside,
        np.concatenate([hull.simplices[~visible], coned(ridges, new)]),
        np.concatenate([hull.normals[~visible], normals]),
    )


def ridge_keys(simplices: Ints) -> Ints:
    """Returns a number for each of a simplex's six ridges, shape (J, 6)."""
    return np.asarray((simplices[:, _FIVES] * _POWERS[:5]).sum(axis=-1))


def simplex_keys(simplices: Ints) -> Ints:
    """Returns a number for each simplex, shape (J,)."""
    return np.asarray((simplices * _POWERS).sum(axis=-1))


def boundary(simplices: Ints) -> tuple[Ints, Ints]:
    """Returns the ridges in an odd number of simplices, (R, 5), and one such simplex of each."""
    _, first, counts = np.unique(ridge_keys(simplices), return_index=True, return_counts=True)
    odd = first[counts % 2 == 1]
    return simplices[:, _FIVES].reshape(-1, 5)[odd], odd // 6


def coned(ridges: Ints, apex: int) -> Ints:
    """Returns the simplices of ridges and one more point, those that have it left out."""
    ridges = ridges[(ridges != apex).all(axis=1)]
    return np.sort(np.column_stack([ridges, np.full(len(ridges), apex)]), axis=1)


def connected(simplices: Ints, among: Bools, start: int) -> Bools:
    """Returns those of some simplices that ridges connect with one of them, shape (J,)."""
    keys = ridge_keys(simplices)
    reached = np.zeros(len(simplices), dtype=bool)
    reached[start] = True
    front = keys[start]
    while len(front):
        grown = among & ~reached & np.isin(keys, front).any(axis=1)
        reached |= grown
        front = keys[grown].ravel()
    return reached


def is_closed(simplices: Ints) -> bool:
    """Whether every ridge is in an even number of simplices."""
    _, counts = np.unique(ridge_keys(simplices), return_counts=True)
    return bool((counts % 2 == 0).all())


def encloses(points: Array, simplices: Ints) -> bool:
    """Finds out whether a ray from the origin meets an odd number of simplices.

    Of a few rays the first counts that passes clear of all rims. A simplex whose points and the
    origin are in one hyperplane is met by no other ray.

    Args:
        points: shape (G, 6).
        simplices: rows of indices of points, shape (J, 6).

    Returns:
        Whether it does; no where no ray passes clear.
    """
    corners = points[simplices].transpose(2, 1, 0)
    for k in range(_RAYS):
        # Any directions do; these have no symmetry.
        ray = np.sin(1.0 + np.arange(6) * (1.7 + 0.9 * k))
        # Barycentric: sum of share_k points_k = distance ray, shares add up to 1.
        shares = solve(corners, np.repeat(ray[:, None], len(simplices), axis=1))
        size = np.abs(shares).max(axis=0)
        flat = ~(size < _FLAT)
        least = shares.min(axis=0) / np.where(flat | (size == 0), 1.0, size)
        if (flat | (np.abs(least) > _CLEAR)).all():
            return int((~flat & (least > 0)).sum()) % 2 == 1
    return False


def solve(matrices: Array, right: Array) -> Array:
    """Returns x of A x = b for many small systems, by elimination with row pivoting.

    One operation after another on whole arrays: the last bits are the same on every processor.

    Args:
        matrices: shape (n, n, J).
        right: shape (n, J).

    Returns:
        Shape (n, J); not finite where a matrix is singular.
    """
    n, _, num = matrices.shape
    A, b, all_ = matrices.copy(), right.copy(), np.arange(num)
    with np.errstate(all="ignore"):
        for k in range(n):
            pivot = k + np.abs(A[k:, k]).argmax(axis=0)
            row, value = A[pivot, :, all_].T.copy(), b[pivot, all_]
            A[pivot, :, all_], b[pivot, all_] = A[k].T, b[k]
            A[k], b[k] = row, value
            factors = A[k + 1 :, k] / row[k]
            A[k + 1 :, k:] -= factors[:, None] * row[k:]
            b[k + 1 :] -= factors * value
        for k in range(n - 1, -1, -1):
            for j in range(k + 1, n):
                b[k] -= A[k, j] * b[j]
            b[k] /= A[k, k]
    return b

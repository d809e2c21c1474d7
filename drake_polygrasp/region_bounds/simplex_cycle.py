"""Works on closed surfaces of 5-simplices in the space of wrenches.

A surface is a list of simplices, rows of six ascending indices of points. Five of them are a ridge.
A surface is closed if every ridge is in an even number of its simplices: a cycle modulo 2, which
has no boundary wherever its points move.
"""

from __future__ import annotations

import itertools

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints, distinct_values
from drake_polygrasp.wrenches.hulls import MOST_POINTS
from drake_polygrasp.wrenches.linear_systems import solve

_FIVES = np.array(list(itertools.combinations(range(6), 5)))
_POWERS = MOST_POINTS ** np.arange(6)
_RAYS = 8
"""Our choice: most rays that are tried."""
_FLAT = 1e12
"""Our choice: solutions are greater only if points and origin are in one hyperplane."""
_CLEAR = 1e-6
"""Our choice: least relative distance of a ray from the rims of simplices."""


def _ridge_keys(simplices: Ints) -> Ints:
    """Returns a number that identifies each of a simplex's six ridges, shape (J, 6)."""
    return np.asarray((simplices[:, _FIVES] * _POWERS[:5]).sum(axis=-1))


def simplex_boundary(simplices: Ints, part: Ints) -> tuple[Ints, Ints]:
    """Returns the boundaries of parts of a surface: ridges in an odd number of simplices of one.

    Args:
        simplices: rows of six ascending indices of points, shape (J, 6).
        part: number of the part that each is in, shape (J,).

    Returns:
        The ridges, shape (R, 5), and the index of one simplex with each, shape (R,).
    """
    keys = _ridge_keys(simplices) + part[:, None] * MOST_POINTS**5
    _, first, counts = np.unique(keys, return_index=True, return_counts=True)
    odd = first[counts % 2 == 1]
    return simplices[:, _FIVES].reshape(-1, 5)[odd], odd // 6


def coned(ridges: Ints, apex: int | Ints) -> Ints:
    """Returns the simplices of ridges and one more point each.

    Args:
        ridges: rows of five ascending indices of points, shape (R, 5).
        apex: index of the point, or of a point for each, shape (R,); none is in its ridge.

    Returns:
        The simplices, shape (R, 6).
    """
    return np.sort(np.column_stack([ridges, np.broadcast_to(apex, len(ridges))]), axis=1)


def modulo_2(simplices: Ints) -> Ints:
    """Returns one index of each simplex that is there an odd number of times, ascending.

    Args:
        simplices: rows of six ascending indices of points, shape (J, 6).
    """
    keys = (simplices * _POWERS).sum(axis=-1)
    _, first, counts = np.unique(keys, return_index=True, return_counts=True)
    return np.sort(first[counts % 2 == 1])


def connected(simplices: Ints, part: Ints, starts: Ints) -> Bools:
    """Finds the simplices that are connected with given ones within parts of a surface.

    Args:
        simplices: rows of six ascending indices of points, shape (J, 6).
        part: number of the part that each is in, shape (J,).
        starts: indices of simplices to start at, shape (N,).

    Returns:
        Whether each simplex is connected with one of those through ridges between simplices of its
        own part, shape (J,).
    """
    across = _across_ridges(simplices)
    reached = np.zeros(len(simplices), dtype=bool)
    reached[starts] = True
    front = starts
    while len(front):
        near = across[front]
        front = distinct_values(near[(part[near] == part[front, None]) & ~reached[near]])
        reached[front] = True
    return reached


def _across_ridges(simplices: Ints) -> Ints:
    """Returns a simplex across each ridge, shape (J, 6); where more meet they follow in a ring."""
    keys = _ridge_keys(simplices).ravel()
    order = np.argsort(keys, kind="stable")
    rank, is_new = np.arange(len(keys)), np.append(True, np.diff(keys[order]) > 0)
    is_last = np.append(is_new[1:], True)
    next_ = np.where(is_last, np.maximum.accumulate(np.where(is_new, rank, 0)), rank + 1)
    across = np.empty(len(keys), dtype=np.int64)
    across[order] = order[next_] // 6
    return across.reshape(-1, 6)


def is_closed(simplices: Ints) -> bool:
    """Returns whether every ridge is in an even number of simplices.

    Args:
        simplices: rows of six ascending indices of points, shape (J, 6).
    """
    _, counts = np.unique(_ridge_keys(simplices), return_counts=True)
    return bool((counts % 2 == 0).all())


def encloses(points: Array, simplices: Ints) -> bool:
    """Tells whether a ray from the origin meets an odd number of simplices.

    Among a few rays it takes the first that passes clear of all rims. A simplex that is in one
    hyperplane with the origin is met by none of these rays.

    Args:
        points: wrenches, shape (G, 6).
        simplices: rows of six indices of points, shape (J, 6).

    Returns:
        Whether it does; False also if no ray passes clear.
    """
    corners = points[simplices].transpose(2, 1, 0)
    for k in range(_RAYS):
        # Any directions are valid; these have no symmetry.
        ray = np.sin(1.0 + np.arange(6) * (1.7 + 0.9 * k))
        # Barycentric coordinates: sum of share_k points_k = distance ray, shares of total 1.
        shares = solve(corners, np.repeat(ray[:, None], len(simplices), axis=1))
        size = np.abs(shares).max(axis=0)
        flat = ~(size < _FLAT)
        least = shares.min(axis=0) / np.where(flat | (size == 0), 1.0, size)
        if (flat | (np.abs(least) > _CLEAR)).all():
            return int((~flat & (least > 0)).sum()) % 2 == 1
    return False

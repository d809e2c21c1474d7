"""Builds convex hulls of several sets of wrenches side by side, point by point.

The facets of all hulls are rows of the same arrays: a point added to each hull costs one round of
array work for all of them.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.wrenches.linear_systems import solve

MOST_POINTS = 512
"""Our choice: most points of a hull, so that an index has nine bits in a key."""
_FLAT = 1e-12
"""Our choice: a point is in the span of others if its squared distance from it is at most this part
of the greatest squared distance from the first point."""
_VISIBLE = 1e-10
"""Our choice: relative height above a facet from which a point counts as outside."""
_DIGITS = 9
"""Our choice: decimals of distances that are compared, for less is rounding."""
_SIXES = np.array(list(itertools.combinations(range(7), 6)))
_OTHERS = np.array([[j for j in range(6) if j != k] for k in range(6)])
_FOURS = np.array([[j for j in range(5) if j != k] for k in range(5)])
_POWERS = MOST_POINTS ** np.arange(4)


@dataclass(frozen=True, eq=False)
class Hulls:
    """Convex hulls, T of them, whose J facets are simplices.

    Attributes:
        inside: a point inside each, shape (T, 6).
        owner: the hull that each facet is of, shape (J,).
        simplices: rows of six ascending indices of points of its hull, shape (J, 6).
        normals: vectors w such that w.(x - inside) <= 1 for all points x of the hull, with equality
            on the facet, shape (J, 6).
        beyond: what is across each ridge, shape (J, 6): eight times the index of a facet plus the
            number of the same ridge there. Ridge k of a facet is without its vertex k.
    """

    inside: Array
    owner: Ints
    simplices: Ints
    normals: Array
    beyond: Ints

    def twists(self) -> tuple[Array, Array]:
        """Returns facets as unit normals, shape (J, 6), and distances from the origin, (J,)."""
        length = np.sqrt((self.normals * self.normals).sum(axis=1))
        offset = 1.0 + (self.normals * self.inside[self.owner]).sum(axis=1)
        return self.normals / length[:, None], offset / length

    def rows(self) -> list[Ints]:
        """Returns the facets of each hull, ascending."""
        order = np.argsort(self.owner, kind="stable")
        num = np.bincount(self.owner, minlength=len(self.inside))
        return np.split(order, np.cumsum(num))[:-1]

    def take(self, kept: Bools) -> Hulls:
        """Returns some of the hulls.

        Args:
            kept: which, shape (T,).
        """
        rows = kept[self.owner]
        place, number = np.cumsum(rows) - 1, np.cumsum(kept) - 1
        beyond = self.beyond[rows]
        return Hulls(
            self.inside[kept],
            number[self.owner[rows]],
            self.simplices[rows],
            self.normals[rows],
            _ridge(place[beyond >> 3], beyond & 7),
        )


def _ridge(facet: Ints, number: Ints | int) -> Ints:
    """Returns ridges of facets as `Hulls.beyond` states them; neighbours share one ridge or two."""
    return (facet << 3) + number


def hulls_of(points: Array) -> tuple[Hulls, Ints, Bools]:
    """Returns the hulls of those sets of points that span the space.

    Args:
        points: wrenches of each set, shape (S, G, 6).

    Returns:
        The T hulls; for each of them, shape (T, G), which point of its set has which index there;
        and whether each set spans the space, shape (S,).
    """
    seven, spans = spanning_points(points)
    points, seven = points[spans], seven[spans]
    sets, num = np.arange(len(points))[:, None], points.shape[1]
    others = np.ones(points.shape[:2], dtype=bool)
    others[sets, seven] = False
    order = np.column_stack([seven, np.nonzero(others)[1].reshape(len(points), num - 7)])
    hulls, all_ = simplex_hulls(points[sets, seven]), np.ones(len(points), dtype=bool)
    for k in range(7, num):
        hulls = with_points(hulls, points[sets[:, 0], order[:, k]], all_, k)
    return hulls, order, spans


def spanning_points(points: Array) -> tuple[Ints, Bools]:
    """Chooses seven points of each set that span the space.

    Args:
        points: wrenches of each set, shape (T, G, 6).

    Returns:
        Their ascending indices, shape (T, 7), and whether they do, shape (T,): not if all points of
        the set lie in a hyperplane.
    """
    sets = np.arange(len(points))
    chosen = [(points * points).sum(axis=2).argmax(axis=1)]
    rest = points - points[sets, chosen[0]][:, None]
    least = _FLAT * (rest * rest).sum(axis=2).max(axis=1)
    spans = np.ones(len(points), dtype=bool)
    for _ in range(6):
        square = (rest * rest).sum(axis=2)
        farthest = square.argmax(axis=1)
        chosen.append(farthest)
        far = square[sets, farthest]
        spans &= far > least
        axis = rest[sets, farthest] / np.sqrt(np.maximum(far, 1e-300))[:, None]
        rest = rest - (rest * axis[:, None]).sum(axis=2)[..., None] * axis[:, None]
    return np.sort(np.stack(chosen, axis=1), axis=1), spans


def simplex_hulls(points: Array) -> Hulls:
    """Returns the hulls of seven points each, which span the space.

    Args:
        points: wrenches, shape (T, 7, 6).
    """
    num = len(points)
    inside = points.mean(axis=1)
    corners = points[:, _SIXES] - inside[:, None, None]
    systems = corners.reshape(-1, 6, 6).transpose(1, 2, 0)
    normals = solve(systems, np.ones((6, 7 * num))).T
    owner = np.repeat(np.arange(num), 7)
    simplices = np.tile(_SIXES, (num, 1))
    # Facet k has all points but 6 - k, so beyond its ridge without point v is facet 6 - v, in whose
    # ascending points 6 - k comes one place earlier if it is above v.
    missing = np.tile(6 - np.arange(7), num)[:, None]
    number = missing - (missing > simplices)
    beyond = _ridge(6 - simplices + 7 * owner[:, None], number)
    return Hulls(inside, owner, simplices, normals, beyond)


def with_points(hulls: Hulls, points: Array, is_added: Bools, index: int) -> Hulls:
    """Adds a point to hulls: facets that see it are replaced by the cone from it.

    The plane of a new facet is the combination of the two planes at its ridge that contains the
    point, so no equations are solved.

    Args:
        hulls: hulls of some points each.
        points: the wrench to add to each, shape (T, 6).
        is_added: whether it is added, shape (T,).
        index: the index that it gets, greater than those before.

    Returns:
        The hulls with the points.
    """
    height = (hulls.normals * (points - hulls.inside)[hulls.owner]).sum(axis=1)
    sees = is_added[hulls.owner] & (height > 1.0 + _VISIBLE)
    near, k = np.nonzero(sees[:, None] & ~sees[hulls.beyond >> 3])
    across = hulls.beyond[near, k]
    far = across >> 3
    share = ((1.0 - height[far]) / (height[near] - height[far]))[:, None]
    normals = share * hulls.normals[near] + (1.0 - share) * hulls.normals[far]
    ridges = np.take_along_axis(hulls.simplices[near], _OTHERS[k], 1)
    owner, kept = hulls.owner[near], np.flatnonzero(~sees)
    place, fresh = np.cumsum(~sees) - 1, len(kept) + np.arange(len(near))
    beyond = _ridge(place[hulls.beyond >> 3], hulls.beyond & 7)
    beyond[far, across & 7] = _ridge(fresh, 5)
    cone = np.column_stack([_paired(ridges, owner, len(kept)), _ridge(place[far], across & 7)])
    return Hulls(
        hulls.inside,
        np.concatenate([hulls.owner[kept], owner]),
        np.concatenate(
            [hulls.simplices[kept], np.column_stack([ridges, np.full(len(ridges), index)])]
        ),
        np.concatenate([hulls.normals[kept], normals]),
        np.concatenate([beyond[kept], cone]),
    )


def _paired(ridges: Ints, owner: Ints, first: int) -> Ints:
    """Returns what is across the ridges of new facets, but for one ridge of each, shape (R, 5).

    The new facets, numbered from `first`, lead from given ridges to one more vertex. Their other
    ridges contain it, and two of them that share the other four vertices are across each other.
    """
    keys = (ridges[:, _FOURS] * _POWERS).sum(axis=2) + owner[:, None] * MOST_POINTS**4
    order = np.argsort(keys, axis=None, kind="stable")
    ridge = _ridge(first + order // 5, order % 5)
    across = np.empty(keys.size, dtype=np.int64)
    # The ridges around what is replaced are closed: every four vertices occur twice.
    across[order[::2]], across[order[1::2]] = ridge[1::2], ridge[::2]
    return across.reshape(-1, 5)


def nearest_facets(hulls: Hulls, offset: Array) -> Ints:
    """Returns the facet of each hull that is nearest to the origin, shape (T,).

    Args:
        hulls: the hulls.
        offset: distances of the facets, shape (J,).
    """
    rounded = np.round(offset, _DIGITS)
    least = np.full(len(hulls.inside), np.inf)
    np.minimum.at(least, hulls.owner, rounded)
    nearest = np.zeros(len(least), dtype=np.int64)
    first = np.flatnonzero(rounded == least[hulls.owner])[::-1]
    nearest[hulls.owner[first]] = first
    return nearest

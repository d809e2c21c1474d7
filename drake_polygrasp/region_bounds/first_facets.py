"""Finds surfaces to begin with: hulls that are near to what contacts reach at their middles."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints, join_rows
from drake_polygrasp.region_bounds.side_by_side import Work
from drake_polygrasp.region_bounds.swept_generators import SweptGenerators, uneven
from drake_polygrasp.vectors import cross, dot
from drake_polygrasp.wrenches.hulls import (
    Hulls,
    hulls_of,
    nearest_facets,
    with_points,
)

_MOST_ADDED = 40
"""Our choice: generators that are added to a hull at most."""
_TIE = 10
"""Our choice: decimals of heights that are compared, for less is rounding."""


@dataclass(frozen=True, eq=False)
class FirstSurface:
    """A hull of generators, and those that it needs.

    Attributes:
        contact: whose each generator to add is, shape (N,).
        force: its force for each piece of the contact, shape (N, S, 3).
        simplices: rows of indices of generators, shape (J, 6); none where these are flat.
        twists: unit normals, shape (J, 6).
        is_around: whether the origin is inside.
    """

    contact: Ints
    force: Array
    simplices: Ints
    twists: Array
    is_around: bool


@dataclass(frozen=True, eq=False)
class FirstFacets(Work[FirstSurface]):
    """Asks for a hull of wrenches at the middles that is near to its support.

    Attributes:
        generators: the first generators, of every contact as many.
        gap: how near its nearest facet comes, over the facet's distance from the origin.
    """

    generators: SweptGenerators
    gap: float

    def kind(self) -> Hashable:
        """Returns the number of generators and pieces, the same for those of one kind."""
        return len(self.generators), self.generators.pieces.shape[1]

    @classmethod
    def together(cls, works: Sequence[FirstFacets]) -> list[FirstSurface]:
        """Builds the hulls of all works, a point of each at a time.

        Args:
            works: those of one kind.

        Returns:
            The answer to each.
        """
        first = np.stack([work.generators.middle for work in works])
        hulls, order, spans = hulls_of(first)
        found = iter(_surfaces(hulls, order, [works[k] for k in np.flatnonzero(spans).tolist()]))
        return [
            next(found) if each else _none(work) for work, each in zip(works, spans, strict=True)
        ]


def _none(work: FirstFacets) -> FirstSurface:
    """No surface, for generators in a hyperplane."""
    num_pieces = work.generators.pieces.shape[1]
    no_simplices, no_twists = np.zeros((0, 6), dtype=int), np.zeros((0, 6))
    none = np.zeros(0, dtype=int), np.zeros((0, num_pieces, 3))
    return FirstSurface(*none, no_simplices, no_twists, False)


def _surfaces(hulls: Hulls, order: Ints, works: Sequence[FirstFacets]) -> list[FirstSurface]:
    """Adds to hulls of the first generators, which `hulls_of` found, those that they need."""
    if not works:
        return []
    num = order.shape[1]
    order = np.column_stack([order, np.tile(num + np.arange(_MOST_ADDED), (len(works), 1))])
    hulls, contact, force, count = _refined(hulls, works, num)
    w, offset = hulls.twists()
    surfaces = []
    for t, rows in enumerate(hulls.rows()):
        simplices = np.sort(order[t][hulls.simplices[rows]], axis=1)
        is_around = bool((offset[rows] > 0.0).all())
        added = contact[: count[t], t], force[: count[t], t]
        surfaces.append(FirstSurface(*added, simplices, w[rows], is_around))
    return surfaces


def _refined(
    hulls: Hulls, works: Sequence[FirstFacets], num: int
) -> tuple[Hulls, Ints, Array, Ints]:
    """Adds to hulls of `num` points until their nearest facets are near to the support.

    Returns:
        The hulls, contacts (N, T) and forces (N, T, S, 3) of generators in the order in which they
        were added, and of how many each hull is, (T,).
    """
    middles, gap = _Middles(works), np.array([work.gap for work in works])
    count, is_open = np.zeros(len(works), dtype=int), np.ones(len(works), dtype=bool)
    contacts, forces = [], []
    for k in range(num, num + _MOST_ADDED):
        w, offset = hulls.twists()
        nearest = nearest_facets(hulls, offset)
        contact, force, wrenches = middles.best(w[nearest], k)
        reached = (wrenches * w[nearest]).sum(axis=1)
        is_open &= reached > np.maximum(offset[nearest] * (1.0 + gap), 0.0)
        if not is_open.any():
            break
        hulls = with_points(hulls, wrenches, is_open, k)
        contacts.append(contact)
        forces.append(force)
        count += is_open
    shape = len(contacts), *middles.shape[::2], 3
    return hulls, np.array(contacts, dtype=int).reshape(shape[:2]), np.reshape(forces, shape), count


class _Middles:
    """The contacts of several grasps at their middles, with the cones of all pieces.

    Attributes:
        shape: numbers of grasps, contacts and pieces.
    """

    def __init__(self, works: Sequence[FirstFacets]) -> None:
        generators = [work.generators for work in works]
        pieces = [each.pieces.ravel() for each in generators]
        self.shape = len(works), *generators[0].pieces.shape
        self._cones = join_rows(
            *(g.contacts.cones.take(k) for g, k in zip(generators, pieces, strict=True))
        )
        self._r = np.stack([each.middles for each in generators])
        self._reference = np.stack([each.reference for each in generators])

    def best(self, w: Array, index: int) -> tuple[Ints, Array, Array]:
        """Finds the generators on rims of cones that pair most with a twist each.

        Args:
            w: a twist of each grasp, shape (T, 6).
            index: that the generators would get.

        Returns:
            Their contacts, shape (T,), a force for each piece, shape (T, S, 3), and their wrenches
            at the middles, shape (T, 6).
        """
        u = w[:, None, :3] + cross(w[:, None, 3:], self._r)
        axes = self._cones.frames[:, 1:].reshape(*self.shape, 2, 3)
        across = dot(axes, u[:, :, None, None]).reshape(-1, 2)
        turns = np.arctan2(across[:, 1], across[:, 0])
        force = self._cones.forces(turns, np.ones(len(turns))).reshape(*self.shape, 3)
        each, i = np.arange(len(w))[:, None], np.arange(3)
        heights = dot(force[each, i, self._reference], u)
        contact = np.round(heights, _TIE).argmax(axis=1)
        sets = each[:, 0]
        chosen = force[sets, contact]
        middle = uneven(chosen, np.array([index]))[sets, self._reference[sets, contact]]
        return contact, chosen, np.hstack([middle, cross(self._r[sets, contact], middle)])

"""Bounds the radii of balls about the origin inside the wrench sets of several grasps.

The wrench set W is the convex hull of three friction discs. A polytope spanned by points of W lies
inside W and bounds a radius from below; the support function of W in any direction bounds it from
above. Points of W that are farthest along the normals of the polytope's nearest facets are added to
it until the bounds are close.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints, batches, frozen
from drake_polygrasp.wrenches.hulls import (
    MOST_POINTS,
    Hulls,
    hulls_of,
    with_points,
)
from drake_polygrasp.wrenches.support import support

_AT_ONCE = 64
"""Our choice: grasps whose polytopes grow side by side; each has a few hundred facets."""
_ENOUGH_POINTS = 200
"""Our choice: polytopes of more points are refined no more; wider bounds are still bounds."""
_TIE = 1e-9
"""Our choice: relative difference up to which numbers count as equal."""
_DIGITS = 9
"""Our choice: decimals of points that are compared, over the size of W."""
_ROUNDING = 1e-14
"""Our choice: rounding error of a facet's offset, over the greatest point's length."""
_LEAST_RISE = 1e-9
"""Our choice: least height of new points above a facet, over the size of W: facets between points
that are closer would have normals of rounding errors."""
_LEAST_PART = 1e-9
"""Our choice: least length of the part of a normal in which radii are measured."""

# The part of a wrench in which a radius is measured.
WRENCH = slice(0, 6)
FORCE = slice(0, 3)


@dataclass(frozen=True, eq=False)
class Interval:
    """Bounds of a radius, and the polytope inside W that proves the lower one.

    Attributes:
        lower: lower bound; 0 if the polytope is degenerate or the origin is not inside it.
        upper: upper bound.
        normals: outward unit normals w of the polytope's facets, wrenches (force, torque / rho),
            shape (F, 6).
        offsets: distances of the facets from the origin, shape (F,): w.x is at least as much at
            each corner x of a facet.
    """

    lower: float
    upper: float
    normals: Array
    offsets: Array


def radius_intervals(
    cones: Array, part: slice, upper: Array, at_least: float, relative_gap: float
) -> list[Interval]:
    """Bounds the least h(w) / |part of w| over w, where h is the support function of W.

    Args:
        cones: from `cone_wrenches`, of M grasps, shape (M, 3, 3, 6).
        part: the part of wrenches in which the radius is measured, `WRENCH` or `FORCE`.
        upper: an upper bound of each radius, shape (M,).
        at_least: refining stops once an upper bound is below this.
        relative_gap: refining stops once the difference of the bounds over the upper one is below
            this.

    Returns:
        The bounds of each, and the polytope that proves the lower one.
    """
    return [
        interval
        for rows in batches(len(cones), _AT_ONCE)
        for interval in _side_by_side(cones[rows], part, upper[rows], at_least, relative_gap)
    ]


def _side_by_side(
    cones: Array, part: slice, upper: Array, at_least: float, relative_gap: float
) -> list[Interval]:
    """Bounds the radii of some grasps, as `radius_intervals` does of any number."""
    rims = [cones[:, :, 0] + sign * cones[:, :, row] for row in (1, 2) for sign in (1.0, -1.0)]
    points = np.concatenate(rims, axis=1)
    size = np.sqrt((points * points).sum(axis=2).max(axis=1))
    none = frozen(np.zeros((0, 6))), frozen(np.zeros(0))
    found = [Interval(0.0, max(each, 0.0), *none) for each in upper.tolist()]
    upper, grasp = upper.copy(), np.flatnonzero(upper >= at_least)
    hulls, order, spans = hulls_of(points[grasp])
    grasp = grasp[spans]
    if not len(grasp):
        return found
    polytopes = _Polytopes(grasp, hulls, np.take_along_axis(points[grasp], order[..., None], 1))
    while True:
        grasp, facets = polytopes.grasp, polytopes.nearest(cones, part)
        np.minimum.at(upper, grasp[facets.owner], facets.highest / facets.length)
        above, lower, rise = upper[grasp], np.zeros(len(grasp)), np.zeros(len(grasp))
        lower[facets.owner] = np.maximum(facets.offset / facets.length, 0.0)
        np.maximum.at(rise, facets.owner, facets.highest - facets.offset)
        is_open = (above - lower > relative_gap * above) & (above >= at_least)
        is_open &= (rise > _LEAST_RISE * size[grasp]) & (polytopes.num_points < _ENOUGH_POINTS)
        new, owner = facets.farthest(size[grasp])
        if not is_open.all():
            done = polytopes.take(~is_open)
            intervals = done.intervals(part, upper[done.grasp], _ROUNDING * size[done.grasp])
            for k, interval in zip(done.grasp.tolist(), intervals, strict=True):
                found[k] = interval
            if not is_open.any():
                return found
            polytopes, new = polytopes.take(is_open), new[is_open[owner]]
            owner = (np.cumsum(is_open) - 1)[owner[is_open[owner]]]
        polytopes = polytopes.grown(new, owner)


@dataclass(frozen=True, eq=False)
class _Facets:
    """Facets of polytopes that are nearest to the origin.

    Attributes:
        owner: the polytope that each is of, shape (N,).
        offset: their distances, shape (N,).
        length: length of the part of their normals in which radii are measured, shape (N,).
        h: support of each contact's disc along their normals, shape (N, 3).
        attained: points of the discs that attain it, shape (N, 3, 6).
    """

    owner: Ints
    offset: Array
    length: Array
    h: Array
    attained: Array

    @property
    def highest(self) -> Array:
        """The support of W along the normals, shape (N,)."""
        return np.asarray(self.h.max(axis=1))

    def farthest(self, size: Array) -> tuple[Array, Ints]:
        """Returns the points of W farthest along the normals, without copies.

        Args:
            size: length of the greatest point of each wrench set, shape (T,).

        Returns:
            The points, shape (K, 6), and their polytopes, ascending, shape (K,).
        """
        highest = self.highest
        facet, contact = np.nonzero(self.h >= (highest - _TIE * np.abs(highest))[:, None])
        new, owner = self.attained[facet, contact], self.owner[facet]
        keys = np.column_stack([owner, np.round(new / size[owner, None], _DIGITS)])
        _, first = np.unique(keys, axis=0, return_index=True)
        return new[first], owner[first]


@dataclass(frozen=True, eq=False)
class _Polytopes:
    """Polytopes inside wrench sets.

    Attributes:
        grasp: the grasp whose wrench set each is in, shape (T,).
        hulls: their facets.
        points: their corners and other points, shape (T, G, 6).
    """

    grasp: Ints
    hulls: Hulls
    points: Array

    @property
    def num_points(self) -> int:
        """How many points each has."""
        return len(self.points[0])

    def take(self, kept: Bools) -> _Polytopes:
        """Returns some of the polytopes: those of a mask, shape (T,)."""
        return _Polytopes(self.grasp[kept], self.hulls.take(kept), self.points[kept])

    def nearest(self, cones: Array, part: slice) -> _Facets:
        """Returns the facets of the least radius of each, and what W reaches along their normals.

        All ties count, because a choice among equals would depend on the frame.
        """
        (w, offset), owner = self.hulls.twists(), self.hulls.owner
        length = _length(w, part)
        radius, least = offset / length, np.full(len(self.grasp), np.inf)
        np.minimum.at(least, owner, radius)
        near = np.flatnonzero(radius <= (least + _TIE * np.abs(least))[owner])
        h, attained = support(cones[self.grasp[owner[near]]], w[near, None])
        return _Facets(owner[near], offset[near], length[near], h[:, 0], attained[:, 0])

    def intervals(self, part: slice, upper: Array, rounding: Array) -> list[Interval]:
        """Returns the bounds that each proves, with given upper bounds, shape (T,)."""
        w, _ = self.hulls.twists()
        corners = self.points[self.hulls.owner[:, None], self.hulls.simplices]
        # Whatever the error of w, no point of a facet is nearer to the origin than this.
        offset = (corners * w[:, None]).sum(axis=2).min(axis=1) - rounding[self.hulls.owner]
        radius, intervals = offset / _length(w, part), []
        for rows, highest in zip(self.hulls.rows(), upper.tolist(), strict=True):
            lower = max(0.0, float(radius[rows].min()))
            polytope = frozen(w[rows]), frozen(offset[rows])
            intervals.append(Interval(lower, max(lower, highest), *polytope))
        return intervals

    def grown(self, new: Array, owner: Ints) -> _Polytopes:
        """Adds points, (K, 6), to those whose indices are ascending, (K,), one at a time."""
        hulls, points = self.hulls, self.points
        count = np.bincount(owner, minlength=len(points))
        rank = np.arange(len(new)) - (np.cumsum(count) - count)[owner]
        for k in range(min(int(count.max()), MOST_POINTS - self.num_points)):
            these, added = owner[rank == k], points[:, 0].copy()
            added[these] = new[rank == k]
            is_added = np.zeros(len(points), dtype=bool)
            is_added[these] = True
            hulls = with_points(hulls, added, is_added, points.shape[1])
            points = np.concatenate([points, added[:, None]], axis=1)
        return _Polytopes(self.grasp, hulls, points)


def _length(w: Array, part: slice) -> Array:
    """Returns the lengths of the part of w in which radii are measured.

    A facet whose normal has no such part bounds nothing: the floor keeps its radius large.
    """
    return np.asarray(np.maximum(np.sqrt((w[:, part] ** 2).sum(axis=1)), _LEAST_PART))

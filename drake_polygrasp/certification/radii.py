"""Bounds the radii of balls about the origin inside the wrench sets of several grasps.

The wrench set W is the convex hull of three friction discs. A polytope spanned by points of W lies
inside W and bounds a radius from below; the support function of W in any direction bounds it from
above. Points of W that are farthest along the normals of the polytope's nearest facets are added to
it until the bounds are close.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.wrenches.hulls import (
    MOST_POINTS,
    Hulls,
    hulls_of,
    spanning_points,
    with_points,
)
from drake_polygrasp.wrenches.support import support

_ENOUGH_POINTS = 200
"""Our choice: polytopes of more points are refined no more; wider bounds are still bounds."""
_TIE = 1e-9
"""Our choice: relative difference up to which numbers count as equal."""
_DIGITS = 9
"""Our choice: decimals of points that are compared, over the size of W."""
_ROUNDING = 1e-14
"""Our choice: rounding error of a facet's offset, over the greatest point's length."""
_LEAST_RISE = 1e-7
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
    rims = [cones[:, :, 0] + sign * cones[:, :, row] for row in (1, 2) for sign in (1.0, -1.0)]
    points = np.concatenate(rims, axis=1)
    size = np.sqrt((points * points).sum(axis=2).max(axis=1))
    none = frozen(np.zeros((0, 6))), frozen(np.zeros(0))
    found = [Interval(0.0, max(each, 0.0), *none) for each in upper.tolist()]
    _, spans = spanning_points(points)
    grasp = np.flatnonzero(spans & (upper >= at_least))
    if not len(grasp):
        return found
    upper, (hulls, order) = upper.copy(), hulls_of(points[grasp])
    points = np.take_along_axis(points[grasp], order[..., None], 1)
    while True:
        w, offset = hulls.twists()
        length = _length(w, part)
        near = _nearest(hulls.owner, offset / length, len(points))
        owner = hulls.owner[near]
        h, attained = support(cones[grasp[owner]], w[near, None])
        highest = h[:, 0].max(axis=1)
        np.minimum.at(upper, grasp[owner], highest / length[near])
        lower, above = np.zeros(len(points)), upper[grasp]
        lower[owner] = np.maximum(offset[near] / length[near], 0.0)
        rises = np.zeros(len(points), dtype=bool)
        rises[owner[highest - offset[near] > _LEAST_RISE * size[grasp[owner]]]] = True
        is_open = (above - lower > relative_gap * above) & (above >= at_least)
        is_open &= rises & (points.shape[1] < _ENOUGH_POINTS)
        done = ~is_open
        rounding = _ROUNDING * size[grasp[done]]
        ended = _bounded(hulls.take(done), points[done], above[done], part, rounding)
        for k, interval in zip(grasp[done].tolist(), ended, strict=True):
            found[k] = interval
        if not is_open.any():
            return found
        tied = h[:, 0] >= (highest - _TIE * np.abs(highest))[:, None]
        facet, contact = np.nonzero(is_open[owner, None] & tied)
        new, owner = _unlike(attained[facet, 0, contact], owner[facet], size[grasp])
        number = np.cumsum(is_open) - 1
        grasp, hulls, points = grasp[is_open], hulls.take(is_open), points[is_open]
        hulls, points = _grown(hulls, points, new, number[owner])


def _bounded(
    hulls: Hulls, points: Array, upper: Array, part: slice, rounding: Array
) -> list[Interval]:
    """Returns the bounds that hulls of points, (T, G, 6), prove, with upper bounds, (T,)."""
    w, _ = hulls.twists()
    corners = points[hulls.owner[:, None], hulls.simplices]
    # Whatever the error of w, no point of a facet is nearer to the origin than this.
    offset = (corners * w[:, None]).sum(axis=2).min(axis=1) - rounding[hulls.owner]
    radius = offset / _length(w, part)
    intervals = []
    for rows, highest in zip(hulls.rows(), upper.tolist(), strict=True):
        lower = max(0.0, float(radius[rows].min()))
        polytope = frozen(w[rows]), frozen(offset[rows])
        intervals.append(Interval(lower, max(lower, highest), *polytope))
    return intervals


def _length(w: Array, part: slice) -> Array:
    """Returns the lengths of the part of w in which radii are measured.

    A facet whose normal has no such part bounds nothing: the floor keeps its radius large.
    """
    return np.asarray(np.maximum(np.sqrt((w[:, part] ** 2).sum(axis=1)), _LEAST_PART))


def _nearest(owner: Ints, radius: Array, num: int) -> Ints:
    """Returns the facets of the least radius of each hull.

    All ties count, because a choice among equals would depend on the frame.
    """
    least = np.full(num, np.inf)
    np.minimum.at(least, owner, radius)
    return np.flatnonzero(radius <= (least + _TIE * np.abs(least))[owner])


def _unlike(points: Array, owner: Ints, size: Array) -> tuple[Array, Ints]:
    """Returns points without copies, and their hulls, ascending."""
    keys = np.column_stack([owner, np.round(points / size[owner, None], _DIGITS)])
    _, first = np.unique(keys, axis=0, return_index=True)
    return points[first], owner[first]


def _grown(hulls: Hulls, points: Array, new: Array, owner: Ints) -> tuple[Hulls, Array]:
    """Adds points, (N, 6), to hulls whose indices are ascending, (N,), one of each at a time."""
    num, count = len(points), np.bincount(owner, minlength=len(points))
    rank = np.arange(len(new)) - (np.cumsum(count) - count)[owner]
    for k in range(min(int(count.max()), MOST_POINTS - points.shape[1])):
        these, added = owner[rank == k], points[:, 0].copy()
        added[these] = new[rank == k]
        is_added = np.zeros(num, dtype=bool)
        is_added[these] = True
        hulls = with_points(hulls, added, is_added, points.shape[1])
        points = np.concatenate([points, added[:, None]], axis=1)
    return hulls, points

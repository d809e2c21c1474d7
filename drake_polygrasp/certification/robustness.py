"""How good a grasp is: intervals, not estimates, and what they buy in a user's units.

W is the convex hull of the wrenches of the three exact friction cones with normal forces that
add up to 1, torques taken about the centre of mass and divided by rho; epsilon is the radius of
the largest ball in it about the origin (Ferrari & Canny, 1992). A polytope spanned by points of W
lies inside it and bounds epsilon from below; the support function of W in any direction bounds
it from above, closely in the directions that `epsilon_bound` singles out. Adding to the polytope
the support points of W along the normals of its nearest facets brings the two together where it
matters.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pydrake.geometry.optimization import HPolyhedron, VPolytope

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.wrenches.epsilon_bound import epsilon_upper_bound
from drake_polygrasp.wrenches.support import cone_wrenches, support

GRAVITY = 9.81
"""[m/s^2]"""
RELATIVE_GAP = 0.02
"""Ours: how far apart the bounds may stay, over the upper one."""
_MAX_ROUNDS = 20
"""Ours: 2 to 5 rounds are usual; what has not closed by now is returned as it is."""
_FACETS_A_ROUND = 6
"""Ours: a few facets at a time keep the hull small, and hulls are what costs."""
_TIE = 1e-9
"""Ours, relative: what differs by less is equal but for rounding."""
_QHULL_ROUNDING = 1e-9
"""Ours, times the greatest generator: what a facet may be off."""

_FREE_TORQUE = 1e-6
"""Times rho, ours: divided by so little, torques are all but free, and epsilon is r_w."""

# Which part of a wrench a radius is measured in.
_WRENCH = slice(0, 6)
_FORCE = slice(0, 3)


@dataclass(frozen=True, eq=False)
class Interval:
    """Bounds of a radius, and the polytope inside W that proves the lower one.

    Attributes:
        lower: 0 where the polytope is degenerate or the origin is not inside it.
        upper: at most this.
        normals: outward unit facet normals w, shape (F, 6): wrenches (force, torque / rho).
        offsets: facets w.g <= offset, shape (F,).
    """

    lower: float
    upper: float
    normals: Array
    offsets: Array


def epsilon_interval(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    p_BBcm: Array,
    rho: float,
    *,
    at_least: float = 0.0,
    relative_gap: float = RELATIVE_GAP,
) -> Interval:
    """Bounds of epsilon, the largest wrench that unit total normal force withstands anywhere.

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, shape (3,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        at_least: stop refining once the upper bound is below this: the grasp has lost already.
        relative_gap: how far apart the bounds may stay, over the upper one.
    """
    contacts = p_BC[None], nhat_TB_B[None], mu[None]
    upper = epsilon_upper_bound(*contacts, p_BBcm, rho)
    cones = cone_wrenches(*contacts, p_BBcm, rho)
    return _radius_interval(cones, _WRENCH, float(upper[0]), at_least, relative_gap)


def squeeze_interval(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    p_BBcm: Array,
    rho: float,
    *,
    relative_gap: float = RELATIVE_GAP,
) -> Interval:
    """Bounds of r_w, the largest force through the centre of mass withstood in any direction.

    As `epsilon_interval`, for unit total normal force; without torque only the force part of a
    facet's normal counts.
    """
    contacts = p_BC[None], nhat_TB_B[None], mu[None]
    upper = epsilon_upper_bound(*contacts, p_BBcm, _FREE_TORQUE * rho)
    cones = cone_wrenches(*contacts, p_BBcm, rho)
    return _radius_interval(cones, _FORCE, float(upper[0]) * (1.0 + _TIE), 0.0, relative_gap)


def _radius_interval(
    cones: Array, part: slice, upper: float, at_least: float, relative_gap: float
) -> Interval:
    """Bounds of min over w of h(w) / |part of w|, which is `upper` at most.

    For cones of one grasp, shape (1, 3, 3, 6).
    """
    points = np.concatenate(
        [cones[0, :, 0] + sign * cones[0, :, row] for row in (1, 2) for sign in (1.0, -1.0)]
    )
    lower, normals, offsets = 0.0, np.zeros((0, 6)), np.zeros(0)
    for _ in range(_MAX_ROUNDS):
        facets = None if upper < at_least else _facets(points)
        if facets is None:
            break
        normals, offsets = facets
        h, attained = (values[0] for values in support(cones, normals[None]))
        highest = h.max(axis=1)
        # The floor: a facet that bounds no force has no part in it and no say.
        length = np.maximum(np.linalg.norm(normals[:, part], axis=1), _QHULL_ROUNDING)
        upper = min(upper, float((highest / length).min()))
        radius = offsets / length
        lower = max(0.0, float(radius.min()))
        if upper - lower <= relative_gap * upper:
            break
        # With all ties, for a choice among equals would follow the frame and not the grasp.
        last = np.sort(radius)[:_FACETS_A_ROUND][-1]
        near = radius <= min(last * (1.0 + _TIE), (1.0 - relative_gap) * upper)
        tied = h >= highest[:, None] - _TIE * np.abs(highest)[:, None]
        known = len(points)
        points = _with_points(points, attained[near[:, None] & tied])
        if len(points) == known:
            break
    upper = max(upper, lower)
    return Interval(lower, upper, frozen(normals), frozen(offsets))


def _facets(points: Array) -> tuple[Array, Array] | None:
    """Facets w.g <= offset of the hull, moved in by Qhull's rounding; None if it has no volume."""
    try:
        hull = HPolyhedron(VPolytope(points.T))
    except (RuntimeError, SystemExit):  # Drake's failed assertions are SystemExit.
        return None
    length = np.linalg.norm(hull.A(), axis=1)
    rounding = _QHULL_ROUNDING * np.linalg.norm(points, axis=1).max()
    return hull.A() / length[:, None], hull.b() / length - rounding


def _with_points(points: Array, new: Array) -> Array:
    """The points and those of the new ones that are no copies: symmetric facets share them."""
    distance = np.linalg.norm(new[:, None] - np.concatenate([points, new])[None], axis=-1)
    earlier = np.arange(len(points) + len(new)) < len(points) + np.arange(len(new))[:, None]
    copies = ((distance < _QHULL_ROUNDING) & earlier).any(axis=1)
    return np.concatenate([points, new[~copies]])


def placement_tolerance(
    epsilon: float, mu: Array, rho: float, edge_distance: float | None = None
) -> float:
    """How far all three contacts may stray at once, along their faces, and still hold [m].

    A contact moved by d moves the wrenches of its cone by at most d sqrt(1 + mu^2) / rho.

    Args:
        epsilon: a lower bound.
        mu: friction coefficients, shape (3,).
        rho: what torques are divided by [m].
        edge_distance: least distance from a contact to an edge of its face [m], not exceeded;
            None where no face is known.
    """
    tolerance = epsilon * rho / math.hypot(1.0, float(mu.max()))
    return tolerance if edge_distance is None else min(tolerance, edge_distance)


def tilt_tolerance(epsilon: float, p_BC: Array, mu: Array, p_BBcm: Array, rho: float) -> float:
    """How far all three normals may be tilted at once and still hold [rad].

    A normal tilted by theta moves the wrenches of its cone by at most
    2 sin(theta / 2) sqrt(1 + mu^2) sqrt(1 + r^2 / rho^2), r the contact's distance from the
    centre of mass. Arguments as in `friction_tolerance`.
    """
    moved = 2.0 * math.hypot(1.0, float(mu.max())) * _torque_factor(p_BC, p_BBcm, rho)
    return 2.0 * math.asin(min(1.0, epsilon / moved))


def friction_tolerance(epsilon: float, p_BC: Array, mu: Array, p_BBcm: Array, rho: float) -> float:
    """How much less all three friction coefficients may be at once and still hold.

    Friction less by d moves wrenches by at most d sqrt(1 + r^2 / rho^2). Placement, tilt and
    friction share one epsilon: each tolerance is for that error alone.

    Args:
        epsilon: a lower bound.
        p_BC: contact points [m], shape (3, 3).
        mu: friction coefficients, shape (3,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: what torques are divided by [m].
    """
    return min(epsilon / _torque_factor(p_BC, p_BBcm, rho), float(mu.min()))


def _torque_factor(p_BC: Array, p_BBcm: Array, rho: float) -> float:
    return math.hypot(1.0, float(np.linalg.norm(p_BC - p_BBcm, axis=1).max()) / rho)


def squeeze_force(
    p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float, mass: float
) -> float | None:
    """Total normal force that holds the weight in every orientation [N].

    The weight m g acts at the centre of mass and needs m g / r_w, r_w from `squeeze_interval`'s
    lower end; None where that is 0.
    """
    r_w = squeeze_interval(p_BC, nhat_TB_B, mu, p_BBcm, rho).lower
    return mass * GRAVITY / r_w if r_w > 0.0 else None

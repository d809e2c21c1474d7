"""Bounds epsilon, and with it the errors that a grasp withstands and the squeeze it needs.

The wrench set W is the convex hull of the wrenches of the three exact friction cones with normal
forces of total 1, torques taken about the centre of mass and divided by rho. epsilon is the radius
of the largest ball about the origin in W (Ferrari & Canny, 1992). A polytope spanned by points of W
lies inside W and bounds epsilon from below; the support function of W in any direction bounds it
from above, closely in the directions that `epsilon_bound` finds. Support points of W along the
normals of the polytope's nearest facets are added to it until the bounds are close.
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
"""Acceleration of gravity [m/s^2]."""
RELATIVE_GAP = 0.02
"""Our choice: greatest difference of the bounds, over the upper one."""
_MAX_ROUNDS = 20
"""Our choice: most rounds; 2 to 5 are usual. Wider bounds are still bounds."""
_FACETS_A_ROUND = 6
"""Our choice: facets refined at a time; few keep the hulls, which take most time, small."""
_TIE = 1e-9
"""Our choice: relative difference up to which numbers count as equal."""
_QHULL_ROUNDING = 1e-9
"""Our choice: error of a facet's offset, over the greatest point's length."""
_FREE_TORQUE = 1e-6
"""Our choice: with this fraction of rho, torques cost almost nothing and the upper bound of epsilon
is one of r_w."""

# The part of a wrench in which a radius is measured.
_WRENCH = slice(0, 6)
_FORCE = slice(0, 3)


@dataclass(frozen=True, eq=False)
class Interval:
    """Bounds of a radius, and the polytope inside W that proves the lower one.

    Attributes:
        lower: lower bound; 0 if the polytope is degenerate or the origin is not inside it.
        upper: upper bound.
        normals: outward unit normals w of the polytope's facets, wrenches (force, torque / rho),
            shape (F, 6).
        offsets: offsets of the facets w.g <= offset, shape (F,).
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
    """Bounds epsilon, the size of the wrench withstood in every direction by unit normal force.

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, shape (3,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        at_least: refining stops once the upper bound is below this.
        relative_gap: refining stops once the difference of the bounds over the upper one is below
            this.

    Returns:
        The bounds, and the polytope that proves the lower one.
    """
    contacts = p_BC[None], nhat_TB_B[None], mu[None]
    (epsilon,) = epsilon_intervals(
        *contacts, p_BBcm, rho, at_least=at_least, relative_gap=relative_gap
    )
    return epsilon


def epsilon_intervals(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    p_BBcm: Array,
    rho: float,
    *,
    at_least: float = 0.0,
    relative_gap: float = RELATIVE_GAP,
) -> list[Interval]:
    """Bounds epsilon of M grasps, each as `epsilon_interval` does.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        at_least: refining stops once the upper bound is below this.
        relative_gap: refining stops once the difference of the bounds over the upper one is below
            this.

    Returns:
        The bounds of each, and the polytope that proves the lower one.
    """
    upper = epsilon_upper_bound(p_BC, nhat_TB_B, mu, p_BBcm, rho)
    cones = cone_wrenches(p_BC, nhat_TB_B, mu, p_BBcm, rho)
    return [
        _radius_interval(one[None], _WRENCH, highest, at_least, relative_gap)
        for one, highest in zip(cones, upper.tolist(), strict=True)
    ]


def squeeze_interval(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    p_BBcm: Array,
    rho: float,
    *,
    relative_gap: float = RELATIVE_GAP,
) -> Interval:
    """Bounds r_w, the force through the centre of mass withstood in every direction.

    It is for unit total normal force, like epsilon, but only the force part of a facet's normal
    counts.

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, shape (3,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        relative_gap: refining stops once the difference of the bounds over the upper one is below
            this.

    Returns:
        The bounds, and the polytope that proves the lower one.
    """
    contacts = p_BC[None], nhat_TB_B[None], mu[None]
    (r_w,) = _squeeze_intervals(*contacts, p_BBcm, rho, relative_gap)
    return r_w


def _squeeze_intervals(
    p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float, relative_gap: float
) -> list[Interval]:
    """Bounds r_w of M grasps."""
    upper = epsilon_upper_bound(p_BC, nhat_TB_B, mu, p_BBcm, _FREE_TORQUE * rho) * (1.0 + _TIE)
    cones = cone_wrenches(p_BC, nhat_TB_B, mu, p_BBcm, rho)
    return [
        _radius_interval(one[None], _FORCE, highest, 0.0, relative_gap)
        for one, highest in zip(cones, upper.tolist(), strict=True)
    ]


def _radius_interval(
    cones: Array, part: slice, upper: float, at_least: float, relative_gap: float
) -> Interval:
    """Bounds the least h(w) / |part of w| over w for the cones of one grasp, (1, 3, 3, 6)."""
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
        # A facet whose normal has no such part bounds nothing; the floor keeps its radius large.
        length = np.maximum(np.linalg.norm(normals[:, part], axis=1), _QHULL_ROUNDING)
        upper = min(upper, float((highest / length).min()))
        radius = offsets / length
        lower = max(0.0, float(radius.min()))
        if upper - lower <= relative_gap * upper:
            break
        # All ties count, because a choice among equals would depend on the frame.
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
    """Computes the hull's facets w.g <= offset, less Qhull's rounding; None if it is flat."""
    try:
        hull = HPolyhedron(VPolytope(points.T))
    except (RuntimeError, SystemExit):  # Drake's failed assertions are SystemExit.
        return None
    length = np.linalg.norm(hull.A(), axis=1)
    rounding = _QHULL_ROUNDING * np.linalg.norm(points, axis=1).max()
    return hull.A() / length[:, None], hull.b() / length - rounding


def _with_points(points: Array, new: Array) -> Array:
    """Adds new points that are not copies; symmetric facets share support points."""
    distance = np.linalg.norm(new[:, None] - np.concatenate([points, new])[None], axis=-1)
    earlier = np.arange(len(points) + len(new)) < len(points) + np.arange(len(new))[:, None]
    copies = ((distance < _QHULL_ROUNDING) & earlier).any(axis=1)
    return np.concatenate([points, new[~copies]])


def placement_tolerance(
    epsilon: float, mu: Array, rho: float, edge_distance: float | None = None
) -> float:
    """Computes how far contacts may move along their faces at once and keep force closure.

    Moving a contact by d moves the wrenches of its cone by at most d sqrt(1 + mu^2) / rho.

    Args:
        epsilon: lower bound of epsilon.
        mu: friction coefficients, shape (3,).
        rho: length by which torques are divided [m].
        edge_distance: least distance from a contact to an edge of its face [m], which the result
            does not exceed; None if no face is known.

    Returns:
        A distance [m]; each contact may move by less, all at once.
    """
    tolerance = epsilon * rho / math.hypot(1.0, float(mu.max()))
    return tolerance if edge_distance is None else min(tolerance, edge_distance)


def tilt_tolerance(epsilon: float, p_BC: Array, mu: Array, p_BBcm: Array, rho: float) -> float:
    """Computes how far normals may tilt at once and keep force closure.

    Tilting a normal by theta moves the wrenches of its cone by at most
    2 sin(theta / 2) sqrt(1 + mu^2) sqrt(1 + r^2 / rho^2), where r is the contact's distance from
    the centre of mass.

    Args:
        epsilon: lower bound of epsilon.
        p_BC: contact points [m], shape (3, 3).
        mu: friction coefficients, shape (3,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: length by which torques are divided [m].

    Returns:
        An angle [rad]; each normal may tilt by less, all at once.
    """
    moved = 2.0 * math.hypot(1.0, float(mu.max())) * _torque_factor(p_BC, p_BBcm, rho)
    return 2.0 * math.asin(min(1.0, epsilon / moved))


def friction_tolerance(epsilon: float, p_BC: Array, mu: Array, p_BBcm: Array, rho: float) -> float:
    """Computes how far friction coefficients may drop at once and keep force closure.

    A drop by d moves wrenches by at most d sqrt(1 + r^2 / rho^2), where r is the contact's distance
    from the centre of mass. Each of the three tolerances uses all of epsilon, so it is for its kind
    of error alone.

    Args:
        epsilon: lower bound of epsilon.
        p_BC: contact points [m], shape (3, 3).
        mu: friction coefficients, shape (3,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: length by which torques are divided [m].

    Returns:
        A difference; each coefficient may be lower by less, all at once.
    """
    return min(epsilon / _torque_factor(p_BC, p_BBcm, rho), float(mu.min()))


def _torque_factor(p_BC: Array, p_BBcm: Array, rho: float) -> float:
    return math.hypot(1.0, float(np.linalg.norm(p_BC - p_BBcm, axis=1).max()) / rho)


def squeeze_force(
    p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float, mass: float
) -> float | None:
    """Computes the total normal force that holds the weight in every orientation.

    The weight m g acts at the centre of mass and needs m g / r_w, with the lower bound of r_w.

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, shape (3,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        mass: mass of the object [kg].

    Returns:
        The force [N]; None if the lower bound of r_w is 0.
    """
    (force,) = squeeze_forces(p_BC[None], nhat_TB_B[None], mu[None], p_BBcm, rho, mass)
    return force


def squeeze_forces(
    p_BC: Array, nhat_TB_B: Array, mu: Array, p_BBcm: Array, rho: float, mass: float
) -> list[float | None]:
    """Computes `squeeze_force` of M grasps.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        mass: mass of the object [kg].

    Returns:
        The force of each [N]; None if the lower bound of r_w is 0.
    """
    return [
        mass * GRAVITY / r_w.lower if r_w.lower > 0.0 else None
        for r_w in _squeeze_intervals(p_BC, nhat_TB_B, mu, p_BBcm, rho, RELATIVE_GAP)
    ]

"""Bounds epsilon, and with it the errors that a grasp withstands and the squeeze it needs.

The wrench set W is the convex hull of the wrenches of the three exact friction cones with normal
forces of total 1, torques taken about the centre of mass and divided by rho. epsilon is the radius
of the largest ball about the origin in W (Ferrari & Canny, 1992). `radii` bounds it from both
sides, from above beginning with what `epsilon_bound` finds.
"""

from __future__ import annotations

import math

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.radii import FORCE, WRENCH, Interval, radius_intervals
from drake_polygrasp.wrenches.epsilon_bound import epsilon_upper_bound
from drake_polygrasp.wrenches.support import cone_wrenches

GRAVITY = 9.81
"""Acceleration of gravity [m/s^2]."""
RELATIVE_GAP = 0.02
"""Our choice: greatest difference of the bounds, over the upper one."""
_FREE_TORQUE = 1e-6
"""Our choice: with this fraction of rho, torques cost almost nothing and the upper bound of epsilon
is one of r_w."""
_ROUNDING = 1e-9
"""Our choice: relative rounding error of that bound."""


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
    return radius_intervals(cones, WRENCH, upper, at_least, relative_gap)


def squeeze_intervals(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    p_BBcm: Array,
    rho: float,
    *,
    relative_gap: float = RELATIVE_GAP,
) -> list[Interval]:
    """Bounds r_w of M grasps, the force through the centre of mass withstood in every direction.

    It is for unit total normal force, like epsilon, but only the force part of a facet's normal
    counts.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        relative_gap: refining stops once the difference of the bounds over the upper one is below
            this.

    Returns:
        The bounds of each, and the polytope that proves the lower one.
    """
    upper = epsilon_upper_bound(p_BC, nhat_TB_B, mu, p_BBcm, _FREE_TORQUE * rho) * (1.0 + _ROUNDING)
    cones = cone_wrenches(p_BC, nhat_TB_B, mu, p_BBcm, rho)
    return radius_intervals(cones, FORCE, upper, 0.0, relative_gap)


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
        for r_w in squeeze_intervals(p_BC, nhat_TB_B, mu, p_BBcm, rho)
    ]

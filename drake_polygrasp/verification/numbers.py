"""Compares the numbers that a grasp file states of a grasp with recomputed ones; needs no model.

Each violated claim is one message. A stated value is rejected only if it is more favourable than
the recomputed one.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification import exact
from drake_polygrasp.certification.convex import find_internal_forces, friction_at
from drake_polygrasp.certification.radii import Interval
from drake_polygrasp.certification.robustness import (
    GRAVITY,
    RELATIVE_GAP,
    epsilon_intervals,
    friction_tolerance,
    placement_tolerance,
    squeeze_intervals,
    tilt_tolerance,
)
from drake_polygrasp.files.stated_grasp import StatedGrasp, StatedObject
from drake_polygrasp.grasp import Grasp, Quality
from drake_polygrasp.wrenches.contacts import edge_forces

_FORCE_TOLERANCE = 1e-9
"""Our choice: error of forces of total 1; printed doubles are exact to 1e-15."""
ROUNDING = 1e-9
"""Our choice: relative rounding error of closed forms."""
_HULL_ROUNDING = 1e-6
"""Our choice: relative rounding error of bounds that hulls give."""
_GAPS = (RELATIVE_GAP, 1e-3, 1e-5)
"""Our choice: relative gaps of bounds, tried in turn. Which facets are refined differs between
versions and, by rounding, between machines, so a stated bound may be closer than a recomputed one
of the usual gap."""
_PLANE_TOLERANCE = 1e-5
"""Our choice: greatest distance of contacts from their grasp plane, over rho; faces are flat to
1e-6 L."""


def force_violations(stated: StatedGrasp) -> Iterator[str]:
    """Checks the internal force of a grasp, and the contact forces that are stated beside it.

    Args:
        stated: a grasp of a file.

    Yields:
        One message for each violation: the internal force is no proof of force closure, its contact
        forces differ from the stated `f_Bc_B`, or their normal parts do not add up to 1.
    """
    grasp, x = stated.grasp, stated.certificate.internal_force
    check = check_proof(grasp, x)
    if not check.ok:
        yield check.reason
    f_Bc_B = edge_forces(grasp.p_BC[None], x[None])[0]
    if not (np.abs(stated.f_Bc_B - f_Bc_B) <= _FORCE_TOLERANCE).all():
        yield "f_Bc_B is not what internal_force makes it"
    if not abs((grasp.nhat_TB_B * f_Bc_B).sum() - 1) <= _FORCE_TOLERANCE:
        yield "the normal forces do not add up to 1"


def check_proof(grasp: Grasp, x: Array) -> exact.Check:
    """Checks in exact arithmetic that an internal force proves a grasp force closure.

    Args:
        grasp: three contacts.
        x: the internal force x_12, x_13, x_23 [1/m], shape (3,).

    Returns:
        The check, with the reason if it fails.
    """
    return exact.check_force_closure(*_contacts(grasp), x.tolist())


def number_violations(
    grasps: Sequence[StatedGrasp], object_: StatedObject, clearances: Sequence[float | None]
) -> list[list[str]]:
    """Recomputes the numbers of certificates and compares them with the stated ones.

    Args:
        grasps: grasps of a file, proved by their internal forces.
        object_: the object that the file states, for its mass, centre of mass and rho.
        clearances: for each grasp the least distance from a contact to an edge of its face [m],
            which bounds the placement tolerance; None if no face is known.

    Returns:
        For each grasp one message for each number that is more favourable than the recomputed one.
    """
    faults: list[list[str]] = [[] for _ in grasps]
    left = [*range(len(grasps))]
    for relative_gap in _GAPS:
        bounds = _bounds([grasps[k] for k in left], object_, relative_gap)
        open_ = []
        for k, found in zip(left, bounds, strict=True):
            compared = grasps[k], object_, clearances[k], *found
            faults[k] = [*_bound_violations(*compared, _HULL_ROUNDING)]
            # Closer bounds cannot confirm a number that is off by more than the gap of these.
            lasting = any(_bound_violations(*compared, 2 * relative_gap))
            open_ += [k] if faults[k] and not lasting else []
        left = open_
    return [
        [*_plain_violations(stated, object_), *own]
        for stated, own in zip(grasps, faults, strict=True)
    ]


def _plain_violations(stated: StatedGrasp, object_: StatedObject) -> Iterator[str]:
    """Yields violations that need no bounds of epsilon."""
    grasp, claim = stated.grasp, stated.certificate
    if not max(grasp.faces) < object_.num_faces:
        yield f"faces names face {max(grasp.faces)}, and there are {object_.num_faces} from 0"
    if (grasp.kind == "two_faces") != (len(set(grasp.faces)) == 2):
        yield f"kind is {grasp.kind}, which the contacts' faces {list(grasp.faces)} are not"
    if not _holds_plane(stated, _PLANE_TOLERANCE * object_.rho):
        yield "the contacts are not in the grasp plane"
    if claim.mu_min is not None and not _proves_mu_min(stated, claim.mu_min):
        yield f"mu_min is {claim.mu_min:.6g}, which no internal force proves"
    if claim.mu_min is None and claim.mu_min_internal_force is not None:
        yield "mu_min_internal_force is there, but no mu_min that it would prove"
    yield from _quality_violations(grasp.quality)
    margin = exact.attained_margin(*_contacts(grasp), claim.internal_force.tolist())
    yield from _excess("margin", claim.margin, margin, ROUNDING)


def _bounds(
    grasps: Sequence[StatedGrasp], object_: StatedObject, relative_gap: float
) -> list[tuple[Interval, float]]:
    """Bounds epsilon and the squeeze force [N]; the latter is infinite if it is unknown."""
    if not grasps:
        return []
    p_BC, nhat_TB_B, mu = (
        np.stack([getattr(stated.grasp, name) for stated in grasps])
        for name in ("p_BC", "nhat_TB_B", "mu")
    )
    scale = object_.p_BBcm, object_.rho
    epsilons = epsilon_intervals(p_BC, nhat_TB_B, mu, *scale, relative_gap=relative_gap)
    forces = np.full(len(grasps), np.inf)
    states = np.array([stated.certificate.squeeze_force is not None for stated in grasps])
    if object_.mass is not None and states.any():
        contacts = p_BC[states], nhat_TB_B[states], mu[states]
        squeezes = squeeze_intervals(*contacts, *scale, relative_gap=relative_gap)
        r_w = np.array([each.lower for each in squeezes])
        forces[states] = np.where(r_w > 0, object_.mass * GRAVITY / r_w, np.inf)
    return list(zip(epsilons, forces.tolist(), strict=True))


def _bound_violations(
    stated: StatedGrasp,
    object_: StatedObject,
    clearance: float | None,
    epsilon: Interval,
    squeeze: float,
    slack: float,
) -> Iterator[str]:
    """Yields numbers that are more favourable than bounds by more than `slack`, relative."""
    claim, lower = stated.certificate, epsilon.lower
    p_BC, mu, p_BBcm, rho = stated.grasp.p_BC, stated.grasp.mu, object_.p_BBcm, object_.rho
    yield from _excess("epsilon_lower", claim.epsilon_lower, lower, slack)
    # On any machine, an upper bound is within RELATIVE_GAP of epsilon.
    within = max(1.01 * RELATIVE_GAP, slack)
    yield from _excess("epsilon_upper", claim.epsilon_upper, epsilon.upper, within)
    yield from _lack("epsilon_upper", claim.epsilon_upper, lower, slack)
    placement = placement_tolerance(lower, mu, rho, clearance)
    yield from _excess("placement_tolerance", claim.placement_tolerance, placement, slack)
    tilt = tilt_tolerance(lower, p_BC, mu, p_BBcm, rho)
    yield from _excess("tilt_tolerance", claim.tilt_tolerance, tilt, slack)
    friction = friction_tolerance(lower, p_BC, mu, p_BBcm, rho)
    yield from _excess("friction_tolerance", claim.friction_tolerance, friction, slack)
    yield from _lack("squeeze_force", claim.squeeze_force, squeeze, slack)


def _excess(name: str, value: float | None, limit: float, rounding: float) -> Iterator[str]:
    if value is not None and not value <= limit * (1 + rounding):
        yield f"{name} is {value:.6g}, more than the {limit:.6g} recomputed"


def _lack(name: str, value: float | None, limit: float, rounding: float) -> Iterator[str]:
    if value is not None and not value >= limit * (1 - rounding):
        yield f"{name} is {value:.6g}, less than the {limit:.6g} recomputed"


def _contacts(grasp: Grasp) -> tuple[list[list[float]], list[list[float]], list[float]]:
    return grasp.p_BC.tolist(), grasp.nhat_TB_B.tolist(), grasp.mu.tolist()


def _holds_plane(stated: StatedGrasp, tolerance: float) -> bool:
    """Tells whether the contacts lie in the grasp plane."""
    plane = stated.grasp.grasp_plane
    height = (stated.grasp.p_BC - plane.p_BP) @ plane.nhat_B
    unit = abs(plane.nhat_B @ plane.nhat_B - 1) <= ROUNDING
    return bool(unit and (np.abs(height) <= tolerance).all())


def _proves_mu_min(stated: StatedGrasp, mu_min: float) -> bool:
    """Tells whether the file's internal force, or else one found here, proves it at `mu_min`."""
    grasp, witness = stated.grasp, stated.certificate.mu_min_internal_force
    mu = friction_at(grasp.mu, mu_min)
    if witness is None:
        witness = find_internal_forces(grasp.p_BC[None], grasp.nhat_TB_B[None], mu[None])[0]
    return check_proof(replace(grasp, mu=mu), witness).ok


def _quality_violations(quality: Quality | None) -> Iterator[str]:
    """Yields violations of equation 5, the part of the paper's Q that needs no planner."""
    if quality is None:
        return
    if not all(0 <= q <= 1 + ROUNDING for q in quality.q):
        yield f"quality q is {list(quality.q)}, and each is from 0 to 1"
    yield from _excess("quality Q", quality.Q, math.prod(quality.q), ROUNDING)

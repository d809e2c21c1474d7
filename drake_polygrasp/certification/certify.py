"""Proves grasps, and computes the certificates of those that are force closure."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification import exact
from drake_polygrasp.certification.convex import (
    Escape,
    find_escape,
    find_internal_forces,
    least_frictions,
)
from drake_polygrasp.certification.radii import Interval
from drake_polygrasp.certification.robustness import (
    epsilon_intervals,
    friction_tolerance,
    placement_tolerance,
    squeeze_forces,
    tilt_tolerance,
)
from drake_polygrasp.digits import EXACT, at_least, at_most
from drake_polygrasp.grasp import Certificate, CertifiedGrasp, Grasp, Verdict
from drake_polygrasp.wrenches.contacts import inner_forces

_CLEAR_MARGIN = 1e-4
"""Our choice: where some internal force has this margin, the rounded one of greatest margin, which
is known to 1e-6, passes the exact check too."""


@dataclass(frozen=True, eq=False)
class Proof:
    """The answer to whether a grasp is force closure, with its proof.

    Attributes:
        verdict: HOLDS if the grasp is proved force closure, FAILS if it is proved not to be.
        reason: why it fails or is undecided; empty if it holds.
        internal_force: x_12, x_13, x_23 [1/m], shape (3,), which `exact.check_force_closure`
            accepts; None unless the grasp holds.
        margin: how far inside the friction cones `internal_force` is, in (0, 1]; 0 unless the grasp
            holds.
        escape: a motion that no contact force resists, if one was found for a grasp that fails.
    """

    verdict: Verdict
    reason: str = ""
    internal_force: Array | None = None
    margin: float = 0.0
    escape: Escape | None = None


def prove(grasp: Grasp) -> Proof:
    """Proves a grasp force closure, or finds how the object escapes.

        proof = prove(grasp)
        print(proof.verdict, proof.reason)

    Args:
        grasp: three contacts.

    Returns:
        The verdict and its proof.
    """
    return prove_many(grasp.p_BC[None], grasp.nhat_TB_B[None], grasp.mu[None])[0]


def prove_many(p_BC: Array, nhat_TB_B: Array, mu: Array) -> list[Proof]:
    """Proves M grasps force closure, or finds how the object escapes them.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).

    Returns:
        One proof for each grasp. HOLDS only if an internal force passes the exact check; FAILS if
        the contacts violate its assumptions (collinear, say) or an escaping twist passes its own
        exact check; else UNDECIDED.
    """
    x = find_internal_forces(p_BC, nhat_TB_B, mu)
    return [_judge(*grasp) for grasp in zip(p_BC, nhat_TB_B, mu, x, strict=True)]


def prove_any(p_BC: Array, nhat_TB_B: Array, mu: Array) -> list[Proof]:
    """Proves M grasps as `prove_many` does, but not with the internal forces of greatest margin.

    It takes a third of the time, where verdicts are all that is asked for.

    Args:
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients, shape (M, 3).

    Returns:
        One proof for each grasp, with the verdict of `prove_many`.
    """
    with np.errstate(all="ignore"):  # numbers that are not finite fail the exact check
        x = inner_forces(p_BC, nhat_TB_B, mu)
    proofs = [_checked(*grasp) for grasp in zip(p_BC, nhat_TB_B, mu, x, strict=True)]
    rest = [k for k, proof in enumerate(proofs) if proof.margin < _CLEAR_MARGIN]
    if rest:
        for k, proof in zip(rest, prove_many(p_BC[rest], nhat_TB_B[rest], mu[rest]), strict=True):
            proofs[k] = proof
    return proofs


def _checked(p_BC: Array, nhat_TB_B: Array, mu: Array, x: Array) -> Proof:
    """Returns what an internal force proves: that the grasp holds, or nothing."""
    check, margin = exact.check_and_margin(
        p_BC.tolist(), nhat_TB_B.tolist(), mu.tolist(), x.tolist()
    )
    if not check.ok:
        return Proof(Verdict.UNDECIDED, check.reason)
    return Proof(Verdict.HOLDS, internal_force=frozen(x), margin=at_most(margin, EXACT))


def _judge(p_BC: Array, nhat_TB_B: Array, mu: Array, x: Array) -> Proof:
    proof = _checked(p_BC, nhat_TB_B, mu, x)
    if proof.verdict is Verdict.HOLDS:
        return proof
    presumed = exact.check_contacts(p_BC.tolist(), nhat_TB_B.tolist(), mu.tolist())
    if not presumed.ok:
        return Proof(Verdict.FAILS, presumed.reason)
    escape = find_escape(p_BC, nhat_TB_B, mu)
    if escape is None:
        best = proof.reason if np.isfinite(x).all() else "no internal force is found"
        return Proof(Verdict.UNDECIDED, f"too close to call: no escape is found, and {best}")
    if escape.hinge is None:
        return Proof(Verdict.FAILS, "the object can leave along a twist", escape=escape)
    i, j = (k + 1 for k in escape.hinge)
    reason = f"the object can turn about the line from contact {i} to contact {j}"
    return Proof(Verdict.FAILS, reason, escape=escape)


@dataclass(frozen=True, eq=False)
class ProvedGrasp:
    """A grasp that is proved force closure, and what else is known of it.

    Attributes:
        grasp: three contacts.
        proof: that it holds.
        edge_distance: least distance from a contact to an edge of its face [m], which the
            placement tolerance does not exceed; None if no face is known.
        epsilon: result of `epsilon_interval`; None if it is not known.
    """

    grasp: Grasp
    proof: Proof
    edge_distance: float | None = None
    epsilon: Interval | None = None


def certify_proved(
    grasps: Sequence[ProvedGrasp], *, mass: float | None, p_BBcm: Array, rho: float
) -> list[CertifiedGrasp]:
    """Computes certificates of grasps that are proved force closure.

    Args:
        grasps: grasps of one object.
        mass: mass of the object [kg]; None if it is unknown.
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].

    Returns:
        Each grasp with its certificate.
    """
    if not grasps:
        return []
    contacts = _stacked([each.grasp for each in grasps])
    unknown = [each.grasp for each in grasps if each.epsilon is None]
    found = iter(epsilon_intervals(*_stacked(unknown), p_BBcm, rho) if unknown else ())
    epsilons = [each.epsilon or next(found) for each in grasps]
    internal = np.stack([_internal_force(each.proof) for each in grasps])
    frictions = least_frictions(*contacts, internal)
    squeezes: Sequence[float | None] = [None] * len(grasps)
    if mass is not None:
        squeezes = squeeze_forces(*contacts, p_BBcm, rho, mass)
    certified = []
    for each, (mu_min, witness), epsilon, squeeze in zip(
        grasps, frictions, epsilons, squeezes, strict=True
    ):
        grasp, lower = each.grasp, at_most(epsilon.lower)
        placement = placement_tolerance(lower, grasp.mu, rho, each.edge_distance)
        tilt = tilt_tolerance(lower, grasp.p_BC, grasp.mu, p_BBcm, rho)
        friction = friction_tolerance(lower, grasp.p_BC, grasp.mu, p_BBcm, rho)
        certificate = Certificate(
            internal_force=_internal_force(each.proof),
            margin=each.proof.margin,
            mu_min=mu_min,
            mu_min_internal_force=witness,
            epsilon_lower=lower,
            epsilon_upper=at_least(epsilon.upper),
            placement_tolerance=at_most(placement),
            tilt_tolerance=at_most(tilt),
            friction_tolerance=at_most(friction),
            squeeze_force=None if squeeze is None else at_least(squeeze),
        )
        certified.append(CertifiedGrasp(grasp, certificate))
    return certified


def _stacked(grasps: Sequence[Grasp]) -> tuple[Array, Array, Array]:
    """Returns contact points, normals and friction coefficients of grasps."""
    return (
        np.stack([grasp.p_BC for grasp in grasps]),
        np.stack([grasp.nhat_TB_B for grasp in grasps]),
        np.stack([grasp.mu for grasp in grasps]),
    )


def _internal_force(proof: Proof) -> Array:
    assert proof.internal_force is not None
    return proof.internal_force

"""Bounds of epsilon for all placements of contacts in regions, with all other errors at once.

The lower bound is proved by a closed surface of simplices (`swept_facets`), which is returned; the
upper one is what the worst placement withstands that was found (`worst_placement`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.certification.exact import MAX_TILT, narrowed_friction
from drake_polygrasp.certification.region_pieces import RegionPiece
from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.certification.simplex_cycle import (
    encloses,
    first_hull,
    is_closed,
    with_point,
)
from drake_polygrasp.certification.swept_facets import (
    LoadNorm,
    Refinement,
    SweptFacets,
    lowest_twists,
    raised,
    swept_facets,
)
from drake_polygrasp.certification.swept_generators import RangingContacts, SweptGenerators
from drake_polygrasp.certification.worst_placement import (
    Placeable,
    WorstPlacement,
    padded,
    placeable,
)
from drake_polygrasp.digits import at_least, at_most
from drake_polygrasp.vectors import dot
from drake_polygrasp.wrenches.contacts import contact_frames
from drake_polygrasp.wrenches.epsilon_bound import critical_directions

_SQUEEZE_GAP = 0.1
"""Our choice: how far the squeeze force may be above the least that is known to be needed. Fingers
squeeze harder than by a tenth more, and a closer bound takes as long as that of epsilon."""
_RELATIVE_GAP = 0.02
"""Our choice: how far apart the bounds may stay, over the upper one."""
_GROWTH = (0.2, 0.5, 0.7, 0.8, 0.85, 0.9, 0.925, 0.95, 0.97, 0.985, 1.0)
_ATTEMPTS = (
    (0.02, Refinement(at_once=4, most_rounds=16, patience=3), (1.0,)),
    (0.05, Refinement(at_once=1, most_rounds=30, patience=7), _GROWTH),
)
"""Our choice: how near to its support a hull comes, over its own distance, how far its facets are
refined, and the shares by which regions grow around their middles until these prove something."""
_MOST_CRITICAL = 12
_DIGITS = 9
"""Our choice: decimals of what is compared."""
_STEEPEST, _HAIR = 1e9, 1e-14
"""Our choice: the tangent of a right angle; and what tangents and friction are off, relative."""
_FIRST_TURNS = np.array([0.3, 1.9, 3.4, 5.0])
_MOST_FIRST = 40
"""Our choice: generators that are added at most to the first hull."""
_ROUNDING = 1e-12
"""A height is a sum of six products below 2 (1 + mu), each off by a few times 2^-53 of that: this
much, times 1 + mu, is taken off heights for it, and of their quotients for the norms' roundings."""


@dataclass(frozen=True, eq=False)
class FacetProof:
    """A closed surface around the origin that proves a lower bound.

    Attributes:
        bound: what is proved, in the norm of the loads.
        simplices: rows of indices of generators, shape (J, 6).
        twists: a twist for each, shape (J, 6).
    """

    bound: float
    simplices: Ints
    twists: Array


@dataclass(frozen=True, eq=False)
class RegionProof:
    """All that `exact_cycle` needs, beside the regions and errors, to check the bounds.

    Attributes:
        contact: 0, 1 or 2: whose each generator is, shape (G,).
        force: its force for each piece of its contact's region, shape (G, S, 3); the last is
            repeated for contacts of fewer pieces.
        epsilon: proof of `epsilon_lower`; None where that is 0.
        weight: proof of the squeeze force; None where there is none.
    """

    contact: Ints
    force: Array
    epsilon: FacetProof | None
    weight: FacetProof | None


@dataclass(frozen=True, eq=False)
class RegionEpsilon:
    """What a grasp withstands for every placement of its contacts, tilt, friction and so on.

    Attributes:
        epsilon_lower: wrenches of this length are withstood per total normal force, whatever is
            off within the errors; 0 where nothing is proved.
        epsilon_upper: some placement within the errors withstands no more.
        squeeze_force: total normal force that holds the weight in every orientation [N]; None
            where no mass is known or none is proved to.
        proof: what proves these.
    """

    epsilon_lower: float
    epsilon_upper: float
    squeeze_force: float | None
    proof: RegionProof


def region_epsilon(
    regions: Sequence[Sequence[RegionPiece]],
    mu: Array,
    p_BBcm: Array,
    rho: float,
    *,
    tilt_error: float = 0.0,
    friction_error: float = 0.0,
    com_error: float = 0.0,
    mass: float | None = None,
    relative_gap: float = _RELATIVE_GAP,
) -> RegionEpsilon:
    """Bounds what a grasp withstands wherever its contacts are in three regions.

    Args:
        regions: the pieces on one of which each contact is; on an edge between two it has the
            normal of one of them, but for the tilt.
        mu: friction coefficients, shape (3,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        tilt_error: angle by which normals may differ from the surface's [rad].
        friction_error: share by which friction coefficients may be less.
        com_error: how far the centre of mass may be off [m].
        mass: of the body [kg]; None where it is unknown.
        relative_gap: how far apart the bounds of epsilon may stay, over the upper one.

    Returns:
        The bounds with their proof, rounded to the safe side.
    """
    errors = tilt_error, friction_error
    is_within = 0.0 <= tilt_error <= MAX_TILT and 0.0 <= friction_error < 1.0
    left = [
        narrowed_friction(m, *errors, piece.tan_spread) if is_within else 0
        for m, region in zip(mu.tolist(), regions, strict=True)
        for piece in region
    ]
    narrowed = np.maximum(np.array(left, dtype=float) * (1.0 - _HAIR), 0.0)
    contacts = _ranging(regions, narrowed, tilt_error if is_within else MAX_TILT, p_BBcm, rho)
    least = (1.0 - friction_error) * mu[contacts.contact]
    task = _Task(
        contacts,
        _critical(contacts),
        placeable(regions, least.tolist(), p_BBcm, rho),
        placeable(regions, narrowed.tolist(), p_BBcm, rho),
        tilt_error,
        relative_gap,
    )
    norms = [LoadNorm(com_error / rho, forces_only) for forces_only in (False, True)]
    outcomes = []
    for gap, refinement, shares in _ATTEMPTS:
        outcomes.append(_attempt(task, norms if mass else norms[:1], gap, refinement, shares))
        if not outcomes[-1].is_open:
            break
    outcome = max(outcomes, key=_Outcome.bounds)
    upper = min(each.upper for each in outcomes)
    epsilon, weight = outcome.proofs[0], outcome.proofs[1] if mass else None
    lower = epsilon.bound if epsilon else 0.0
    squeeze = at_least(mass * GRAVITY / weight.bound) if mass and weight else None
    made = outcome.generators
    proof = RegionProof(frozen(made.contact, int), frozen(made.force), epsilon, weight)
    return RegionEpsilon(lower, at_least(max(upper, lower, 0.0)), squeeze, proof)


@dataclass(frozen=True, eq=False)
class _Task:
    """What is bounded.

    Attributes:
        contacts: where they range.
        start: twists along which little is withstood, shape (K, 6).
        possible: where contacts may be, with the friction that they may have.
        served: the same, with the friction that is left for forces that serve all tilts.
        tilt_error: of the normals in `possible` [rad].
        relative_gap: how far apart the bounds may stay.
    """

    contacts: RangingContacts
    start: Array
    possible: list[Placeable]
    served: list[Placeable]
    tilt_error: float
    relative_gap: float


@dataclass(frozen=True, eq=False)
class _Outcome:
    """Proofs in each norm, the upper bound in the first, and whether a finer hull may do better."""

    generators: SweptGenerators
    proofs: list[FacetProof | None]
    upper: float
    is_open: bool

    def bounds(self) -> tuple[float, ...]:
        """What is proved in each norm."""
        return tuple(proof.bound if proof else 0.0 for proof in self.proofs)


def _attempt(
    task: _Task,
    norms: Sequence[LoadNorm],
    gap: float,
    refinement: Refinement,
    shares: Sequence[float],
) -> _Outcome:
    """Proves what facets of a hull prove that is within a gap of its support."""
    generators = SweptGenerators(task.contacts)
    simplices, w = _first_facets(generators, gap)
    is_around = bool(task.contacts.mu.min() > 0.0) and encloses(generators.middle, simplices)
    proofs: list[FacetProof | None] = []
    is_open = False
    for norm in norms:
        apart = max(task.relative_gap, _SQUEEZE_GAP if norm.forces_only else 0.0)
        facets, tried = SweptFacets(simplices, w, np.zeros(len(w))), [task.start]
        proof = None
        if is_around:
            ceiling = _Ceiling(generators, task.served, norm)
            ceiling.lowered(task.start)
            for share in shares:
                generators.range_by(share)
                facets = swept_facets(generators, facets.simplices, facets.twists, norm)
                facets = raised(generators, facets, norm, ceiling.lowered, apart, refinement)
                # What is lost in smaller regions is not found in larger ones.
                if facets.values.min() <= 0.0:
                    break
            generators.range_by(1.0)
            proof = _proved(generators, facets, norm)
            if proof is not None:
                simplices, w = facets.simplices, facets.twists
            is_open |= proof is None and ceiling.bound > 0.0
            tried.append(ceiling.w[None])
        proofs.append(proof)
        if norm is norms[0]:
            worst = WorstPlacement(task.possible, task.tilt_error, norm)
            upper = worst.lowered(np.concatenate([*tried, lowest_twists(facets)]))
    return _Outcome(generators, proofs, upper, is_open)


def _ranging(
    regions: Sequence[Sequence[RegionPiece]], mu: Array, tilt: float, p_BBcm: Array, rho: float
) -> RangingContacts:
    contact = np.array([i for i, region in enumerate(regions) for _ in region])
    pieces = [piece for region in regions for piece in region]
    nhat = np.stack([piece.nhat_TB_B for piece in pieces])
    corners = [(piece.p_BV - p_BBcm) / rho for piece in pieces]
    centres = np.stack([r_V.mean(axis=0) for r_V in corners])
    reference = []
    for i in range(3):
        own = np.flatnonzero(contact == i)
        off = centres[own] - centres[own].mean(axis=0)
        reference.append(own[np.round(dot(off, off), _DIGITS).argmin()])
    middles = centres[reference]
    tan_tilt = math.tan(tilt)
    spread = np.array([piece.tan_spread for piece in pieces])
    rest = 1.0 - tan_tilt * spread
    tangent = np.where(rest > 0, (tan_tilt + spread) / np.where(rest > 0, rest, 1.0), _STEEPEST)
    return RangingContacts(
        contact=contact,
        reference=np.array(reference),
        r_V=padded(corners),
        frames=contact_frames(middles[None], nhat[None])[0],
        mu=mu,
        tangent=tangent * (1.0 + _HAIR),
    )


def _critical(contacts: RangingContacts) -> Array:
    """Twists along which the cones at the regions' middles reach little, (K, 6)."""
    k = contacts.reference
    place = contacts.middles()[None], contacts.frames[k, 0][None], contacts.mu[k][None]
    critical, _ = critical_directions(*place, np.zeros(3), 1.0, num=_MOST_CRITICAL)
    return np.asarray(np.round(critical[0], _DIGITS))


def _first_facets(generators: SweptGenerators, gap: float) -> tuple[Ints, Array]:
    """The facets of a hull, as simplices and twists; none where the generators are flat."""
    generators.add_rims(_FIRST_TURNS)
    first = first_hull(generators.middle)
    if first is None:
        return np.zeros((0, 6), dtype=int), np.zeros((0, 6))
    hull, order = first
    for k in range(len(generators)):
        if k not in order:
            hull = with_point(hull, generators.middle, k)
    for _ in range(_MOST_FIRST):
        w, offset = hull.twists()
        lowest = int(np.round(offset, _DIGITS).argmin())
        generators.add_best_at_middles(w[lowest])
        reached = float((generators.middle[-1] * w[lowest]).sum())
        if reached <= max(float(offset[lowest]) * (1.0 + gap), 0.0):
            break
        hull = with_point(hull, generators.middle, len(generators) - 1)
    return hull.simplices, hull.twists()[0]


class _Ceiling:
    """What forces that serve all tilts may prove at most, by the twists that were tried."""

    def __init__(
        self, generators: SweptGenerators, served: Sequence[Placeable], norm: LoadNorm
    ) -> None:
        self._generators, self._norm = generators, norm
        self._worst, self.bound = WorstPlacement(served, 0.0, norm), math.inf

    @property
    def w(self) -> Array:
        """The twist along which they prove least."""
        return self._worst.w

    def lowered(self, w: Array) -> float:
        """The least bound with more twists."""
        before = self._worst.bound
        if len(w) and self._worst.lowered(w) < before:
            _, _, most = self._generators.best_forces(self.w[None])
            self.bound = min(self.bound, float(most[0] / self._norm.of(self.w[None])[0]))
        return self.bound


def _proved(generators: SweptGenerators, facets: SweptFacets, norm: LoadNorm) -> FacetProof | None:
    """What facets prove, less rounding errors; None where that is nothing."""
    mu = float(generators.contacts.mu.max())
    heights = generators.heights(facets.twists, facets.simplices).min(axis=1)
    least = float(((heights - _ROUNDING * (1.0 + mu)) / norm.of(facets.twists)).min())
    around = is_closed(facets.simplices) and encloses(generators.middle, facets.simplices)
    if least <= 0.0 or not around:
        return None
    bound = at_most(least * (1.0 - _ROUNDING))
    return FacetProof(bound, frozen(facets.simplices, int), frozen(facets.twists))

"""Bounds of epsilon for all placements of contacts in regions, with all other errors at once.

The lower bound is proved by a closed surface of simplices (`swept_facets`), which is returned; the
upper one is what the worst placement withstands that was found (`worst_placement`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TypeAlias

import numpy as np

from drake_polygrasp.arrays import Array, Ints, batches, frozen
from drake_polygrasp.certification.exact import MAX_TILT, narrowed_friction
from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.digits import at_least, at_most
from drake_polygrasp.region_bounds.ceiling import Ceiling, Compare
from drake_polygrasp.region_bounds.contest import Contest, LostError
from drake_polygrasp.region_bounds.first_facets import FirstFacets
from drake_polygrasp.region_bounds.load_norm import LoadNorm
from drake_polygrasp.region_bounds.ranging_contacts import HAIR, RangingContacts, ranging_contacts
from drake_polygrasp.region_bounds.region_task import RegionTask
from drake_polygrasp.region_bounds.side_by_side import Search, result_of, run_side_by_side
from drake_polygrasp.region_bounds.simplex_cycle import encloses, is_closed
from drake_polygrasp.region_bounds.swept_facets import (
    Refinement,
    SweptFacets,
    lowest_twists,
    raised,
    unswept,
)
from drake_polygrasp.region_bounds.swept_generators import SweptGenerators
from drake_polygrasp.region_bounds.worst_placement import Placeable, WorstPlacement, placeable
from drake_polygrasp.wrenches.epsilon_bound import critical_directions

_GROWTH = (0.2, 0.5, 0.7, 0.8, 0.85, 0.9, 0.925, 0.95, 0.97, 0.985, 1.0)
_Attempt: TypeAlias = tuple[float, Refinement, tuple[float, ...]]
_WAYS: tuple[tuple[_Attempt, ...], ...] = (
    ((0.02, Refinement(4, 16, 3), (1.0,)), (0.05, Refinement(1, 30, 7), _GROWTH)),
    ((0.05, Refinement(2, 60, 12), (1.0,)),),
    ((0.05, Refinement(1, 60, 12), (1.0,)),),
    ((0.02, Refinement(4, 30, 6), (0.5, 0.8, 0.9, 1.0)),),
    ((0.05, Refinement(1, 60, 12), _GROWTH),),
    ((0.1, Refinement(1, 90, 20), (1.0,)),),
)
"""Our choice: how near to its support a hull comes, over its own distance, how far its facets are
refined (at once, most rounds, patience), and the shares by which regions grow around their middles;
the next attempt of a way follows where one proves nothing."""
NUM_WAYS = len(_WAYS)
"""How many ways there are to seek bounds. None finds the closest everywhere."""
_TOGETHER = 24
"""Our choice: grasps that are bounded side by side; more take more memory and little less time."""
_MOST_CRITICAL = 12
_DIGITS = 9
"""Our choice: decimals of what is compared."""
_FIRST_TURNS = np.array([0.3, 1.9, 3.4, 5.0])
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


def region_epsilon(task: RegionTask) -> RegionEpsilon:
    """Bounds what a grasp withstands wherever its contacts are in three regions.

    Args:
        task: the grasp and its errors.

    Returns:
        The bounds with their proof, rounded to the safe side.
    """
    (bounds,) = region_epsilons([task])
    return bounds


def region_epsilons(tasks: Sequence[RegionTask]) -> list[RegionEpsilon]:
    """Bounds what grasps withstand, each as `region_epsilon` does but all in one go.

    Args:
        tasks: the grasps and their errors.

    Returns:
        The bounds of each.
    """
    found = greatest_epsilons(tasks, [-math.inf] * len(tasks), len(tasks))
    return [bounds for bounds in found if bounds is not None]


def greatest_epsilons(
    tasks: Sequence[RegionTask], least: Sequence[float], wanted: int
) -> list[RegionEpsilon | None]:
    """Bounds what those grasps withstand whose lower bounds of epsilon are greatest.

    Args:
        tasks: the grasps and their errors.
        least: what the lower bound of each must be at least; minus infinity for any.
        wanted: how many grasps are asked for.

    Returns:
        The bounds of each, as `region_epsilon` finds them; None for grasps whose bound is below
        `least`, or was found not to be among the best `wanted` before their search ended.
    """
    contest = Contest(wanted)
    found: list[RegionEpsilon | None] = []
    for part in batches(len(tasks), _TOGETHER):
        problems = _problems_of(tasks[part])
        searches = [
            _bounds_unless_lost(problem, asked, partial(contest.enter, k, asked))
            for k, (problem, asked) in enumerate(
                zip(problems, least[part], strict=True), len(found)
            )
        ]
        found += run_side_by_side(searches)
    return found


def _bounds_unless_lost(
    problem: _Problem, least: float, compare: Compare
) -> Search[RegionEpsilon | None]:
    """Bounds what a grasp withstands; None where that is too little."""
    try:
        bounds = yield from _bounds(problem, compare)
    except LostError:
        return None
    return bounds if bounds.epsilon_lower >= least else None


def _bounds(problem: _Problem, compare: Compare) -> Search[RegionEpsilon]:
    """Bounds what a grasp withstands, with the proof."""
    task, norms = problem.task, [LoadNorm(problem.task.com_error / problem.task.rho)]
    if task.mass:
        norms.append(LoadNorm(task.com_error / task.rho, forces_only=True))
    outcomes = []
    for gap, refinement, shares in _WAYS[task.way]:
        outcome = yield from _attempt(problem, norms, compare, gap, refinement, shares)
        outcomes.append(outcome)
        if not outcome.is_open:
            break
    outcome = max(outcomes, key=_Outcome.bounds)
    upper = min(each.upper for each in outcomes)
    epsilon, weight = outcome.proofs[0], outcome.proofs[1] if task.mass else None
    lower = epsilon.bound if epsilon else 0.0
    squeeze = at_least(task.mass * GRAVITY / weight.bound) if task.mass and weight else None
    made = outcome.generators
    proof = RegionProof(frozen(made.contact, int), frozen(made.force), epsilon, weight)
    return RegionEpsilon(lower, at_least(max(upper, lower, 0.0)), squeeze, proof)


@dataclass(frozen=True, eq=False)
class _Problem:
    """What a search for bounds is given.

    Attributes:
        task: the grasp and its errors.
        contacts: where they range.
        start: twists along which little is withstood, shape (K, 6).
        possible: where contacts may be, with the friction that they may have.
        served: the same, with the friction that is left for forces that serve all tilts.
    """

    task: RegionTask
    contacts: RangingContacts
    start: Array
    possible: Placeable
    served: Placeable


def _problems_of(tasks: Sequence[RegionTask]) -> list[_Problem]:
    """Returns what searches for bounds are given."""
    narrowed = [_narrowed(task) for task in tasks]
    contacts = [
        ranging_contacts(
            task.regions, friction, min(max(task.tilt_error, 0.0), MAX_TILT), task.p_BBcm, task.rho
        )
        for task, friction in zip(tasks, narrowed, strict=True)
    ]
    problems = []
    starts = _critical(contacts)
    for task, friction, ranging, start in zip(tasks, narrowed, contacts, starts, strict=True):
        least = (1.0 - task.friction_error) * task.mu[ranging.contact]
        possible = placeable(task.regions, least, task.p_BBcm, task.rho)
        problems.append(_Problem(task, ranging, start, possible, possible.with_friction(friction)))
    return problems


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
    problem: _Problem,
    norms: Sequence[LoadNorm],
    compare: Compare,
    gap: float,
    refinement: Refinement,
    shares: Sequence[float],
) -> Search[_Outcome]:
    """Proves what facets of a hull prove that is within a gap of its support."""
    task, generators = problem.task, SweptGenerators(problem.contacts)
    generators.add_rims(_FIRST_TURNS)
    first = yield from result_of(FirstFacets(generators, gap))
    generators.add(first.contact, first.force)
    start = unswept(first.simplices, first.twists)
    is_around = first.is_around and bool(problem.contacts.cones.mu.min() > 0.0)
    proofs: list[FacetProof | None] = []
    is_open = False
    for norm in norms:
        apart = max(task.relative_gap, task.squeeze_gap if norm.forces_only else 0.0)
        facets, tried = start.scaled(1.0 / norm.of(start.twists)), [problem.start]
        proof = None
        if is_around:
            heard = compare if norm is norms[0] else None
            ceiling = Ceiling(generators, problem.served, norm, heard)
            yield from ceiling.lowered(problem.start, 0.0)
            for share in shares:
                generators.range_by(share)
                if len(shares) > 1:
                    facets = unswept(facets.simplices, facets.twists)
                facets = yield from raised(
                    generators, facets, norm, ceiling.lowered, apart, refinement
                )
                # What is lost in smaller regions is not found in larger ones.
                if facets.values.min() <= 0.0:
                    break
            else:
                proof = _proved(generators, facets, norm)
            generators.range_by(1.0)
            if proof is not None:
                # The heights are the same in any norm.
                start = facets.scaled(norm.of(facets.twists))
            is_open |= proof is None and ceiling.bound > 0.0
            tried.append(ceiling.w[None])
        proofs.append(proof)
        if norm is norms[0]:
            worst = WorstPlacement(problem.possible, task.tilt_error, norm)
            upper = yield from worst.lowered(np.concatenate([*tried, lowest_twists(facets)]))
    return _Outcome(generators, proofs, upper, is_open)


def _narrowed(task: RegionTask) -> Array:
    """The friction that is left for forces that serve all tilts in each piece, (P,)."""
    errors = task.tilt_error, task.friction_error
    if not (0.0 <= task.tilt_error <= MAX_TILT and 0.0 <= task.friction_error < 1.0):
        return np.zeros(sum(map(len, task.regions)))
    left = [
        narrowed_friction(m, *errors, piece.tan_spread)
        for m, region in zip(task.mu.tolist(), task.regions, strict=True)
        for piece in region
    ]
    return np.asarray(np.maximum(np.array(left, dtype=float) * (1.0 - HAIR), 0.0))


def _critical(several: Sequence[RangingContacts]) -> Array:
    """Twists along which the cones at the regions' middles reach little, (N, K, 6)."""
    cones = [contacts.cones.take(contacts.reference) for contacts in several]
    w, _ = critical_directions(
        np.stack([contacts.middles() for contacts in several]),
        np.stack([each.frames[:, 0] for each in cones]),
        np.stack([each.mu for each in cones]),
        np.zeros(3),
        1.0,
        num=_MOST_CRITICAL,
    )
    return np.asarray(np.round(w, _DIGITS))


def _proved(generators: SweptGenerators, facets: SweptFacets, norm: LoadNorm) -> FacetProof | None:
    """What facets prove, less rounding errors; None where that is nothing."""
    mu = float(generators.contacts.cones.mu.max())
    heights = generators.heights(facets.twists, facets.simplices).min(axis=1)
    least = float(((heights - _ROUNDING * (1.0 + mu)) / norm.of(facets.twists)).min())
    around = is_closed(facets.simplices) and encloses(generators.middle, facets.simplices)
    if least <= 0.0 or not around:
        return None
    bound = at_most(least * (1.0 - _ROUNDING))
    return FacetProof(bound, frozen(facets.simplices, int), frozen(facets.twists))

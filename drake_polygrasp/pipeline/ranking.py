"""Puts proved candidates in order, best first, and certifies those that are returned."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from drake_polygrasp.arrays import frozen
from drake_polygrasp.certification.certify import ProvedGrasp, certify_proved
from drake_polygrasp.certification.radii import Interval
from drake_polygrasp.certification.robustness import RELATIVE_GAP, epsilon_intervals
from drake_polygrasp.digits import on_grid, significant, to_decimals
from drake_polygrasp.geometry.surface_contact import edge_distance
from drake_polygrasp.grasp import CertifiedGrasp, Grasp, GraspPlane, Quality
from drake_polygrasp.pipeline.candidates import KINDS, ProjectedCandidates
from drake_polygrasp.pipeline.error_levels import ProvedLevel, bounded_levels, first_levels
from drake_polygrasp.pipeline.fallback import sets_held
from drake_polygrasp.pipeline.judge import Judge
from drake_polygrasp.pipeline.judging import LEAST_RANKED, SETS_TRIED, SPARE
from drake_polygrasp.pipeline.region_certificates import Errors
from drake_polygrasp.region_bounds.region_task import BOUNDS_GAP, QUICK_GAP
from drake_polygrasp.settings import Rank
from drake_polygrasp.wrenches.epsilon_bound import epsilon_upper_bound

_TRIED_OF_A_SET = 3
"""Our choice: candidates of a set that are asked whether they bear errors, best first."""


@dataclass(frozen=True, order=True)
class _Ranked:
    """A proved candidate; sorts best first."""

    score: float
    """Negative, rounded to 1e-9 as the margin is, so that ties stay ties."""
    margin: float
    faces: tuple[int, ...]
    row: int


def certify_best(
    judges: Sequence[Judge], errors: Sequence[Errors], rank: Rank, top: int
) -> tuple[CertifiedGrasp, ...]:
    """Ranks what is proved, the best candidate of each set of faces, and certifies the best.

    Args:
        judges: the candidates and their proofs, as `prove_in_turn` returns them. Sets of later ones
            count where those before have fewer than `top`.
        errors: what grasps are tried for, greatest first; empty for none.
        rank: what puts one grasp before another.
        top: how many grasps to return at most.

    Returns:
        The grasps with their certificates, best first.
    """
    if errors:
        return _bearing_errors(judges, errors, rank, top)
    (judge,) = judges
    ranked = _ranked_candidates(judge, rank)
    first = _first_of_each_set(judge.work, ranked)
    measured = _of_greatest_epsilon(judge.work, first, top) if rank == "epsilon" else {}
    rows = list(measured) or [entry.row for entry in first[:top]]
    return _certified(judge, rows, [measured.get(row) for row in rows])


def grasp_at(judge: Judge, row: int) -> Grasp:
    """Returns a proved candidate without its certificate.

    Args:
        judge: the candidates and their proofs.
        row: index of the candidate.
    """
    return _grasp(judge.work, row)


def certify_candidate(judge: Judge, row: int) -> CertifiedGrasp:
    """Certifies one proved candidate, for exact contacts.

    Args:
        judge: the candidates and their proofs.
        row: index of the candidate.

    Returns:
        The grasp with its certificate, without a `region`.
    """
    (certified,) = _certified(judge, [row], [None])
    return certified


def _bearing_errors(
    judges: Sequence[Judge], errors: Sequence[Errors], rank: Rank, top: int
) -> tuple[CertifiedGrasp, ...]:
    """Certifies the best sets with the errors that they bear.

    By epsilon, grasps come first that bear the greatest errors with enough epsilon left, and those
    last that bear none; among equals the least epsilon under errors counts.
    """
    quick = judges[0].work.request.settings.effort == "quick"
    by_epsilon = rank == "epsilon"
    compared = top if quick or not by_epsilon else max(top + SPARE, LEAST_RANKED)
    found: list[_Bearing] = []
    for position, judge in enumerate(judges):
        if len(found) >= top:
            break
        held = sets_held(judges[:position], judge.work.request.regions)
        before = {tuple(row) for row in held.tolist()}
        groups = _best_of_each_set(judge, rank, before)
        tried = groups[: SETS_TRIED * compared] if by_epsilon else groups[:compared]
        found += _first_bearing(judge, tried, errors, compared - len(found))
    found = sorted(found, key=lambda each: each.held.level)[:compared]  # stable
    wanted, gap = top if by_epsilon else len(found), QUICK_GAP if quick else BOUNDS_GAP
    graded = _certified_bearings(found, errors, wanted, gap)
    if not by_epsilon:
        graded.sort(key=lambda pair: pair[0].ranked)
    return tuple(certified for _, certified in graded[:top])


@dataclass(frozen=True, eq=False)
class _Bearing:
    """A proved candidate, and the greatest errors that it was found to bear."""

    judge: Judge
    ranked: _Ranked
    held: ProvedLevel


def _certified_bearings(
    bearings: Sequence[_Bearing], errors: Sequence[Errors], wanted: int, gap: float
) -> list[tuple[_Bearing, CertifiedGrasp]]:
    """Certifies the best candidates, with bounds under the errors that each bears, best first.

    Those that bear none come last, by epsilon.
    """
    if not bearings:
        return []
    object_ = bearings[0].judge.work.request.object_
    bounded = bounded_levels(object_, [each.held for each in bearings], errors, wanted, gap)
    exact = _certified_for_exact_contacts([bearings[each.index] for each in bounded])
    certified = [
        (bearing, replace(grasp, region=each.region))
        for (bearing, grasp), each in zip(exact, bounded, strict=True)
    ]
    if len(certified) < wanted:
        others = _certified_for_exact_contacts([b for b in bearings if b.held.proved is None])
        certified += sorted(others, key=lambda pair: -pair[1].certificate.epsilon_lower)
    return certified


def _certified_for_exact_contacts(
    bearings: Sequence[_Bearing],
) -> list[tuple[_Bearing, CertifiedGrasp]]:
    """Certifies candidates, in their order, without errors."""
    found: dict[tuple[Judge, int], CertifiedGrasp] = {}
    for judge in dict.fromkeys(each.judge for each in bearings):
        rows = [each.ranked.row for each in bearings if each.judge is judge]
        certified = _certified(judge, rows, [None] * len(rows))
        found |= {(judge, row): grasp for row, grasp in zip(rows, certified, strict=True)}
    return [(each, found[each.judge, each.ranked.row]) for each in bearings]


def _best_of_each_set(
    judge: Judge, rank: Rank, without: set[tuple[int, ...]]
) -> list[list[_Ranked]]:
    """Returns up to `_TRIED_OF_A_SET` candidates of each set of regions, best first.

    Args:
        judge: the candidates and their proofs.
        rank: what puts one before another.
        without: sets that are left out.
    """
    sets = judge.work.plan.sets
    groups: dict[int, list[_Ranked]] = {}
    for entry in _ranked_candidates(judge, rank):
        set_index = int(judge.work.candidates.set_index[entry.row])
        groups.setdefault(set_index, []).append(entry)
    return [
        entries[:_TRIED_OF_A_SET]
        for set_index, entries in groups.items()
        if tuple(sets[set_index].tolist()) not in without
    ]


def _first_bearing(
    judge: Judge, groups: list[list[_Ranked]], errors: Sequence[Errors], wanted: int
) -> list[_Bearing]:
    """Finds sets that bear the greatest errors; then others, best first, that bear less.

    Args:
        judge: the candidates and their proofs.
        groups: candidates of each set, best first.
        errors: what they are tried for, greatest first.
        wanted: how many sets to return at most.
    """
    found: list[_Bearing] = []
    others: list[list[_Ranked]] = []
    tried = 0
    while tried < len(groups) and len(found) < wanted:
        some = groups[tried : tried + wanted - len(found)]
        tried += len(some)
        for entries, bearing in zip(some, _bearings(judge, some, errors, range(1)), strict=True):
            if bearing.held.proved:
                found.append(bearing)
            else:
                others.append(entries)
    less = range(1, len(errors))
    return found + _bearings(judge, others[: wanted - len(found)], errors, less)


def _bearings(
    judge: Judge, groups: list[list[_Ranked]], errors: Sequence[Errors], levels: range
) -> list[_Bearing]:
    """Finds the first candidate of each set that bears the greatest errors.

    Args:
        judge: the candidates and their proofs.
        groups: candidates of each set, best first.
        errors: what they are tried for, greatest first.
        levels: indices of the errors that are tried; the greater ones were tried before.
    """
    grasps = [[_grasp(judge.work, entry.row) for entry in entries] for entries in groups]
    none = len(errors)
    bearings = []
    for k, found in enumerate(first_levels(judge.work.request.object_, grasps, errors, levels)):
        index, held = found or (0, ProvedLevel(grasps[k][0], none, None))
        bearings.append(_Bearing(judge, groups[k][index], held))
    return bearings


def _ranked_candidates(judge: Judge, rank: Rank) -> list[_Ranked]:
    """Returns all proved candidates, best first, by the friction that errors leave."""
    work, rows = judge.work, np.array(sorted(judge.proofs), dtype=np.int64)
    margin = np.array([judge.proofs[row].margin for row in rows.tolist()])
    if rank == "Q":
        score = work.candidates.Q[rows]
    elif rank == "margin" or len(rows) == 1:  # one alone needs no score
        score = margin
    else:
        object_ = work.request.object_
        contacts = work.narrowed_contacts_of(rows)
        score = epsilon_upper_bound(*contacts, object_.p_BBcm, object_.rho)
    return sorted(
        _Ranked(-round(float(s), 9), -round(float(m), 9), tuple(work.face[row].tolist()), int(row))
        for s, m, row in zip(score, margin, rows, strict=True)
    )


def _first_of_each_set(work: ProjectedCandidates, ranked: list[_Ranked]) -> list[_Ranked]:
    """Returns the best candidate of each set, best first."""
    seen: set[int] = set()
    first = []
    for entry in ranked:
        set_index = int(work.candidates.set_index[entry.row])
        if set_index not in seen:
            seen.add(set_index)
            first.append(entry)
    return first


def _of_greatest_epsilon(
    work: ProjectedCandidates, ranked: list[_Ranked], top: int
) -> dict[int, Interval]:
    """Returns the `top` rows of greatest epsilon, best first, with its bounds.

    Scores are upper bounds: candidates are measured until that of none of the rest is above the
    intervals of the best by more than these are wide.
    """
    found: list[tuple[_Ranked, Interval]] = []
    tried = 0
    while tried < len(ranked):
        full = len(found) == top
        least = min(epsilon.upper for _, epsilon in found) if full else -np.inf
        some = [
            entry
            for entry in ranked[tried : tried + top]
            if -entry.score * (1.0 - RELATIVE_GAP) > least
        ]
        if not some:
            break
        tried += len(some)
        epsilons = _epsilons(work, some, at_least=-found[-1][0].score if full else 0.0)
        found += [
            (replace(entry, score=-round(epsilon.lower, 9)), epsilon)
            for entry, epsilon in zip(some, epsilons, strict=True)
        ]
        found = sorted(found, key=lambda pair: pair[0])[:top]
    return {entry.row: epsilon for entry, epsilon in found}


def _epsilons(work: ProjectedCandidates, entries: list[_Ranked], at_least: float) -> list[Interval]:
    """Bounds epsilon of candidates, closely only if it reaches `at_least`."""
    rows = np.array([entry.row for entry in entries], dtype=np.int64)
    p_BC, nhat_TB_B, mu = (values[rows] for values in work.contacts)
    scale = work.request.object_.p_BBcm, work.request.object_.rho
    return epsilon_intervals(p_BC, nhat_TB_B, mu, *scale, at_least=at_least)


def _certified(
    judge: Judge, rows: list[int], intervals: list[Interval | None]
) -> tuple[CertifiedGrasp, ...]:
    """Certifies proved candidates; bounds epsilon where no interval of it is given."""
    work, order = judge.work, np.array(rows, dtype=np.int64)
    p_BC, face = work.candidates.p_BC[order], work.face[order]
    polyhedron = work.request.object_.polyhedron
    clearance = edge_distance(polyhedron, p_BC.reshape(-1, 3), face.ravel()).reshape(-1, 3)
    grasps = [
        ProvedGrasp(_grasp(work, row), judge.proofs[row], least, epsilon)
        for row, least, epsilon in zip(rows, clearance.min(axis=1).tolist(), intervals, strict=True)
    ]
    object_ = work.request.object_
    certified = certify_proved(grasps, mass=object_.mass, p_BBcm=object_.p_BBcm, rho=object_.rho)
    return tuple(replace(each, tip_radius=work.request.tip_radius) for each in certified)


def _grasp(work: ProjectedCandidates, row: int) -> Grasp:
    rows = work.candidates
    a, b, c = work.face[row].tolist()
    return Grasp(
        frozen(rows.p_BC[row]),
        frozen(work.nhat_TB_B[row]),
        frozen(work.mu[row]),
        KINDS[work.kind[row]],
        (a, b, c),
        GraspPlane(
            frozen(to_decimals(rows.nhat_B[row])),
            frozen(on_grid(rows.p_BP[row], work.request.object_.polyhedron.diameter)),
        ),
        _quality(work, row),
    )


def _quality(work: ProjectedCandidates, row: int) -> Quality | None:
    q_1, q_2, q_3, q_4, q_5 = q = to_decimals(work.candidates.q[row]).tolist()
    if np.isnan(q).any():
        return None
    scale: Literal["paper", "object"] = (
        "paper" if work.request.settings.method == "paper" else "object"
    )
    return Quality(scale, float(significant(np.prod(q))), (q_1, q_2, q_3, q_4, q_5))

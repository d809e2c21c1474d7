"""Adds candidates when the first search finds fewer grasps than asked for, or to evaluate all sets.

First come contacts at denser points, then force-closure triples of few points on any set of faces,
then the paper's stages on sets not evaluated before, in descending order of their bounds of
epsilon. The number of grasps asked for decides only when this ends, not what is tried in which
order. So a plan for more grasps finds all that a plan for fewer does, and `explain_sets`, which
goes to the end, rejects no set on which a plan has a certified grasp.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from drake_polygrasp.arrays import Bools, Ints, join_rows
from drake_polygrasp.geometry.face_sets import (
    CHUNK,
    in_order_of_sets,
    rows_in_all_sets,
    sets_of,
    with_sets,
)
from drake_polygrasp.paper.orientation import sets_oppose
from drake_polygrasp.paper.reasons import CODE, SetPlan, has_contacts
from drake_polygrasp.pipeline.candidates import (
    ProjectedCandidates,
    project_candidates,
)
from drake_polygrasp.pipeline.judge import Judge
from drake_polygrasp.pipeline.proposals import quick_points
from drake_polygrasp.pipeline.request import PlanRequest
from drake_polygrasp.search.effort import ANY_SETS, CHUNKS, DENSE, FULL
from drake_polygrasp.search.every_set import triples_on_each_set
from drake_polygrasp.search.fingertip_room import with_tip_room
from drake_polygrasp.search.sample_points import num_points, sample_points
from drake_polygrasp.search.selection import (
    PLACES,
    best_first,
    best_places,
    estimates,
    improved_triples,
)
from drake_polygrasp.search.set_bounds import promising_sets
from drake_polygrasp.search.triples import NO_TRIPLES, Triples, best_triples
from drake_polygrasp.wrenches.contacts import force_closure


def extended(request: PlanRequest, judge: Judge) -> Iterator[ProjectedCandidates]:
    """Yields candidates with more of them each time, until `ANY_SETS` sets are evaluated.

    New candidates and sets follow the old ones, which keep their indices. The caller must call
    `judge.extend` with each batch before it asks for the next.

    Args:
        request: the request.
        judge: the judge of the candidates so far.
    """
    if request.steps.search and _may_hold_elsewhere(request, judge):
        yield _with_denser_points(request, judge.work)
        yield _with_all_points(request, judge.work)
    num_sets = request.num_allowed_sets
    best = _best_known(request, judge.work)
    for most in CHUNKS:
        if most < num_sets and len(judge.work.plan.sets) < num_sets:
            scale = request.object_.p_BBcm, request.object_.rho
            sets = promising_sets(
                request.regions, best, *scale, above=-np.inf, most=most, opposing=sets_oppose
            )
            yield _with(request, judge.work, sets, NO_TRIPLES)
    if len(judge.work.plan.sets) < num_sets <= ANY_SETS:
        yield _with(request, judge.work, request.every_set, NO_TRIPLES)


def on_each_set(
    request: PlanRequest, work: ProjectedCandidates, asked: Bools | None = None
) -> Iterator[ProjectedCandidates]:
    """Yields candidates with all that `extended` would add, and then those of all sets, in parts.

    The method "paper" adds only those of all sets.

    Args:
        request: the request.
        work: the candidates so far.
        asked: which of `request.every_set` the paper's stages evaluate at last, shape (S,); None
            for all.

    Raises:
        UsageError: when there are more than `request.MOST_SETS` sets.
    """
    request.require_countable()
    searches = request.settings.method == "enriched" and request.steps.search
    if searches and _may_hold_elsewhere(request, Judge(work)):
        work = _with_denser_points(request, work)
        yield work
        work = _with_all_points(request, work)
        yield work
    every = request.every_set
    is_fresh = np.ones(len(every), dtype=bool) if asked is None else asked.copy()
    is_fresh[rows_in_all_sets(len(request.regions.face), work.plan.sets)] = False
    fresh = every[is_fresh]
    for part in np.array_split(fresh, len(fresh) // CHUNK + 1):
        work = _followed_by(request, work, part, NO_TRIPLES)
        yield work


def _may_hold_elsewhere(request: PlanRequest, judge: Judge) -> bool:
    """Returns whether a set without a certified grasp has faces that can oppose each other."""
    code = judge.set_codes()
    closed = np.isin(code, (CODE["certified"], CODE["orientation"]))
    return len(code) < request.num_allowed_sets or not bool(closed.all())


def _with_denser_points(request: PlanRequest, work: ProjectedCandidates) -> ProjectedCandidates:
    triples = _denser_triples(request)
    sets = sets_of(triples.region[in_order_of_sets(triples.region)])
    return _with(request, work, sets, triples)


def _with_all_points(request: PlanRequest, work: ProjectedCandidates) -> ProjectedCandidates:
    """Adds triples of few points on all sets whose faces can oppose each other."""
    scale = request.object_.p_BBcm, request.object_.rho
    points = quick_points(request)
    triples = triples_on_each_set(request.regions, points, *scale, PLACES, sets_oppose)
    sets = sets_of(triples.region[in_order_of_sets(triples.region)])
    return _with(request, work, sets, triples)


def _denser_triples(request: PlanRequest) -> Triples:
    """Returns triples of denser points, at most `PLACES` per set, and the best of them improved."""
    regions, scale = request.regions, (request.object_.p_BBcm, request.object_.rho)
    clear = with_tip_room(
        regions, request.object_.polyhedron, request.tip_radius, request.obstacles
    )
    points = sample_points(clear, num_points(len(regions.face), DENSE), may_exceed=True)
    found = best_triples(clear, points, *scale, DENSE)
    if not len(found.region):
        return found
    estimate = estimates(clear, found, *scale)
    best = found.take(best_places(found.region, estimate, len(estimate), PLACES))
    better = improved_triples(clear, found, *scale) if request.steps.improve else NO_TRIPLES
    return join_rows(better, best)


def _best_known(request: PlanRequest, work: ProjectedCandidates) -> Triples:
    """Returns the force-closure candidates of greatest estimated epsilon, with tip room or not."""
    rows = np.flatnonzero(has_contacts(work.candidates.p_BC))
    rows = rows[force_closure(*work.narrowed_contacts_of(rows))]
    triples = Triples(work.candidates.region[rows], work.candidates.p_BC[rows])
    estimate = estimates(request.regions, triples, request.object_.p_BBcm, request.object_.rho)
    return triples.take(best_first(estimate)[: FULL.sources])


def _with(
    request: PlanRequest, work: ProjectedCandidates, sets: Ints, triples: Triples
) -> ProjectedCandidates:
    """Adds triples, and the paper's candidates on those sets that are new."""
    return _followed_by(
        request, work, with_sets(work.plan.sets, sets)[len(work.plan.sets) :], triples
    )


def _followed_by(
    request: PlanRequest, work: ProjectedCandidates, fresh: Ints, triples: Triples
) -> ProjectedCandidates:
    """Adds triples, and the paper's candidates on new sets."""
    old, new = work.plan, request.plan(fresh)
    shifted = replace(new.candidates, set_index=new.candidates.set_index + len(old.sets))
    plan = SetPlan(
        np.concatenate([old.sets, new.sets]),
        np.concatenate([old.code, new.code]),
        join_rows(old.candidates, shifted),
    )
    return work.followed_by(
        project_candidates(request, plan, triples, len(old.candidates.set_index))
    )

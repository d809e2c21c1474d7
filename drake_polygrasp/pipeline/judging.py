"""Which candidates are proved: the most promising first, and longer where few of them hold."""

from __future__ import annotations

from typing import Literal

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.certify import Proof
from drake_polygrasp.geometry.face_sets import place_in_set
from drake_polygrasp.paper.reasons import CODE, UNJUDGED
from drake_polygrasp.pipeline.candidates import KINDS, Contenders
from drake_polygrasp.pipeline.longer_search import completed, extended
from drake_polygrasp.pipeline.proposals import constructed, enriched, quick
from drake_polygrasp.pipeline.request import PlanRequest
from drake_polygrasp.search.effort import ANY_SETS, MORE_SETS, EffortName
from drake_polygrasp.search.selection import Steps, tied
from drake_polygrasp.wrenches.epsilon_estimate import epsilon_estimates

Rank = Literal["epsilon", "margin", "Q"]

SETS_OF_A_KIND = 10
"""Sets of each kind that are proved at least to be ranked by margin, ours: Q favours two-face
sets, though three faces hold best on most objects without parallel faces."""
SPARE = 2
"""Sets proved beyond those wanted, for estimates do not quite rank as epsilon, ours."""


def proved(
    request: PlanRequest, steps: Steps, rank: Rank, top: int, effort: EffortName
) -> tuple[Contenders, dict[int, Proof]]:
    """Proposes candidates and proves the best of them, until `top` sets of faces have a grasp.

    Arguments as of `plan_grasps`.

    Returns:
        All candidates, and the proofs of those that are found to hold.
    """
    if effort == "complete":
        work = everything(request, steps)
        return work, work.judge(np.flatnonzero(work.outcome == UNJUDGED))
    if request.method == "paper" or rank != "epsilon":
        work = constructed(request, steps)
        return work, _judged_by_quality(work, rank, top)
    if effort == "quick":
        work, estimate = quick(request, top)
        if request.object_.polyhedron.is_patch.any():  # there, seats turn normals
            estimate = _estimates(work)
        if proofs := _judged_by_estimate(work, estimate, top, {}):
            return work, proofs
    work = enriched(request, steps)
    proofs = _judged_by_estimate(work, _estimates(work), top + SPARE, {})
    longer = extended(request, steps, work)
    while len(work.sets_of(proofs)) < top:
        seen = len(work.plan.sets)
        more = next(longer, None) if seen < (MORE_SETS if proofs else ANY_SETS) else None
        if more is None:
            break
        work = more
        proofs |= _judged_by_estimate(work, _estimates(work), top + SPARE, proofs)
    return work, proofs


def everything(request: PlanRequest, steps: Steps) -> Contenders:
    """All candidates that plans of any effort but quick have, and every set of faces."""
    if request.method == "paper":
        return constructed(request, steps)
    return completed(request, steps, enriched(request, steps))


def _judged_by_quality(work: Contenders, rank: Rank, top: int) -> dict[int, Proof]:
    if rank == "Q":
        rows = np.arange(len(work.outcome))
        return work.judge_best(rows, work.candidates.Q, top)
    proofs: dict[int, Proof] = {}
    for kind in range(len(KINDS)):
        rows = np.flatnonzero(work.kind == kind)
        proofs |= work.judge_best(rows, work.candidates.Q[rows], max(top, SETS_OF_A_KIND))
    return proofs


def _estimates(work: Contenders) -> Array:
    """Estimates epsilon of all candidates that hold or may hold; 0 for others, shape (M,)."""
    rows = np.flatnonzero(np.isin(work.outcome, (UNJUDGED, CODE["certified"])))
    object_, estimate = work.request.object_, np.zeros(len(work.outcome))
    estimate[rows] = epsilon_estimates(*work.contacts_of(rows), object_.p_BBcm, object_.rho)
    return estimate


def _judged_by_estimate(
    work: Contenders, estimate: Array, wanted: int, known: dict[int, Proof]
) -> dict[int, Proof]:
    """Proofs of the best of each set, by estimates of epsilon, until with known ones enough hold.

    The two best of a set come first, for the others are often the same place; others follow only
    where these fail.
    """
    rows = np.flatnonzero(work.outcome == UNJUDGED)
    score = tied(estimate[rows])
    order = np.argsort(-score, kind="stable")
    rows, score = rows[order], score[order]
    is_first = place_in_set(work.candidates.set_index[rows]) < 2
    proofs = work.judge_best(rows[is_first], score[is_first], wanted, known)
    held = work.sets_of([*known, *proofs])
    others, score = rows[~is_first], score[~is_first]
    if len(held) < wanted:
        return proofs | work.judge_best(others, score, wanted, [*known, *proofs])
    # Of sets whose two best fail, another may be better than the last of those wanted.
    best = np.zeros(len(work.plan.sets))
    proved = [*known, *proofs]
    np.maximum.at(best, work.candidates.set_index[proved], estimate[proved])
    last = np.sort(best[held])[-wanted]
    failing = ~np.isin(work.candidates.set_index[others], held)
    return proofs | work.judge(others[failing & (score > last)])

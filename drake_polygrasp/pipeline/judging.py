"""Chooses which candidates are proved: the most promising first, and more if few of them hold."""

from __future__ import annotations

from itertools import chain, islice

import numpy as np

from drake_polygrasp.arguments import Progress, no_progress
from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.certification.certify import prove_any
from drake_polygrasp.geometry.face_sets import rank_within_set, rows_in_all_sets
from drake_polygrasp.paper.reasons import unplanned
from drake_polygrasp.pipeline.candidates import KINDS, project_candidates
from drake_polygrasp.pipeline.judge import Judge
from drake_polygrasp.pipeline.longer_search import extended, on_each_set
from drake_polygrasp.pipeline.proposals import constructed, enriched, quick
from drake_polygrasp.pipeline.request import PlanRequest
from drake_polygrasp.search.effort import ANY_SETS, MORE_SETS
from drake_polygrasp.search.selection import rounded_for_ties
from drake_polygrasp.settings import Rank

SETS_OF_A_KIND = 10
"""Least number of sets of each kind that are proved to be ranked by margin. Our choice: Q favours
sets of two faces, though on most objects without parallel faces three hold best."""
LEAST_RANKED = 10
"""Our choice: sets at least whose least epsilon under errors is compared."""
SETS_TRIED = 3
"""Our choice: sets that are tried for errors, over those whose least epsilon is compared."""
_STEPS_WITH_ANOTHER = 2
"""Steps of the longer search that propose denser points; later ones evaluate more sets."""
SPARE = 2
"""Number of sets proved beyond those wanted. Our choice: estimates may rank near ties wrongly."""


def prove_candidates(request: PlanRequest, *, another_follows: bool = False) -> Judge:
    """Proposes candidates and proves the best, until enough sets of faces have a grasp.

    Args:
        request: the request, whose settings say how many sets are enough.
        another_follows: whether a request with less errors follows, so that the longer search is
            only of denser points, and ends with the first grasp.

    Returns:
        The judge, with all candidates and the proofs of those that hold.
    """
    rank, top, effort = request.settings.rank, request.settings.top, request.settings.effort
    if effort == "complete":
        return judge_all(request)
    if request.settings.method == "paper" or rank != "epsilon":
        judge = Judge(constructed(request))
        _judge_by_quality(judge, rank, top)
        return judge
    if effort == "quick":
        work, estimate = quick(request, top)
        judge = Judge(work)
        if request.object_.polyhedron.is_patch.any():  # projection changes normals of patches
            estimate = judge.estimates()
        _judge_by_estimate(judge, estimate, top)
        if judge.proofs or another_follows:
            return judge
    judge = Judge(enriched(request))
    wanted = SETS_TRIED * max(top + SPARE, LEAST_RANKED) if request.errors else top + SPARE
    _judge_by_estimate(judge, judge.estimates(), wanted)
    longer = islice(extended(request, judge), _STEPS_WITH_ANOTHER if another_follows else None)
    while len(judge.held_sets) < (1 if another_follows else top):
        seen = len(judge.work.plan.sets)
        more = next(longer, None) if seen < (MORE_SETS if judge.proofs else ANY_SETS) else None
        if more is None:
            break
        judge.extend(more)
        _judge_by_estimate(judge, judge.estimates(), wanted)
    return judge


def judge_all(request: PlanRequest) -> Judge:
    """Judges all candidates of effort "complete": the paper's and the search's on every set.

    They include those of effort "full".

    Args:
        request: the request.

    Returns:
        The judge, with the outcomes of all candidates.

    Raises:
        UsageError: when there are more than `request.MOST_SETS` sets.
    """
    if request.settings.method == "paper":
        judge = Judge(constructed(request))
    else:
        judge = Judge(enriched(request))
        for work in on_each_set(request, judge.work):
            judge.extend(work)
    judge.judge(judge.open_rows)
    return judge


def judge_each_set(
    request: PlanRequest, asked: Bools | None = None, progress: Progress = no_progress
) -> Judge:
    """Judges candidates of effort "complete" on each set of faces, until one of them holds.

    Args:
        request: the request.
        asked: which of `request.every_set` are judged, shape (S,); None for all.
        progress: called with the number of sets that are evaluated and the number of all.

    Returns:
        The judge. On a set where a candidate holds, others may not be judged.

    Raises:
        UsageError: when there are more than `request.MOST_SETS` sets.
    """
    request.require_countable()
    if asked is None:
        asked = np.ones(request.num_allowed_sets, dtype=bool)
    if request.settings.method == "paper":
        first = project_candidates(request, unplanned(request.every_set[:0]), None)
    else:
        first = enriched(request)
    judge, num_regions = Judge(first, prove_any), len(request.regions.face)
    for work in chain([first], on_each_set(request, first, asked)):
        judge.extend(work)
        judge.judge_each_set(asked[rows_in_all_sets(num_regions, work.plan.sets)])
        progress(len(work.plan.sets), len(asked))
    return judge


def _judge_by_quality(judge: Judge, rank: Rank, top: int) -> None:
    work = judge.work
    if rank == "Q":
        judge.judge_best(np.arange(len(work.outcome)), work.candidates.Q, top)
        return
    for kind in range(len(KINDS)):
        rows = np.flatnonzero(work.kind == kind)
        # No set has candidates of two kinds.
        wanted = len(judge.held_sets) + max(top, SETS_OF_A_KIND)
        judge.judge_best(rows, work.candidates.Q[rows], wanted)


def _judge_by_estimate(judge: Judge, estimate: Array, wanted: int) -> None:
    """Judges the best candidates of each set, by estimates of epsilon, until `wanted` sets hold.

    The two best of each set come first, because others are often at nearly the same contacts. The
    others are judged only on sets whose two best fail.
    """
    work, rows = judge.work, judge.open_rows
    score = rounded_for_ties(estimate[rows])
    order = np.argsort(-score, kind="stable")
    rows, score = rows[order], score[order]
    is_first = rank_within_set(work.candidates.set_index[rows]) < 2
    judge.judge_best(rows[is_first], score[is_first], wanted)
    held = judge.held_sets
    others, score = rows[~is_first], score[~is_first]
    if len(held) < wanted:
        judge.judge_best(others, score, wanted)
        return
    # On a set whose two best fail, another candidate may be better than the last one wanted.
    best = np.zeros(len(work.plan.sets))
    proved = [*judge.proofs]
    np.maximum.at(best, work.candidates.set_index[proved], estimate[proved])
    last = np.sort(best[held])[-wanted]
    failing = ~np.isin(work.candidates.set_index[others], held)
    judge.judge(others[failing & (score > last)])

"""Proposes and proves grasps that a hand may reach, the most promising first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_polygrasp.arrays import Array, Ints, join_rows
from drake_polygrasp.geometry.face_sets import in_order_of_sets, rank_within_set, sets_of
from drake_polygrasp.grasp import CertifiedGrasp, Grasp, GraspObject
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.scene import HandScene
from drake_polygrasp.hands.starts import start_overlaps
from drake_polygrasp.paper.reasons import unplanned
from drake_polygrasp.pipeline.candidates import project_candidates
from drake_polygrasp.pipeline.judge import Judge
from drake_polygrasp.pipeline.proposals import quick
from drake_polygrasp.pipeline.ranking import certify_candidate, grasp_at
from drake_polygrasp.pipeline.request import PlanRequest, make_request
from drake_polygrasp.search.fingertip_room import with_tip_room
from drake_polygrasp.search.reach import OUT_OF_REACH, Reach, TipTriple, reach_scores
from drake_polygrasp.search.reachable import reachable_triples, touching_places
from drake_polygrasp.search.sample_points import sample_points
from drake_polygrasp.search.selection import best_first
from drake_polygrasp.search.triples import Triples
from drake_polygrasp.settings import PlanOptions

EDGE_CLEARANCE = 0.3
"""Our choice, times the tip radius: distance of contacts from edges. With 1 percent of the object's
diameter instead, 6 of 99 lifts in simulation were lost, and with this none."""
_LEAST_POINTS, _POINTS_A_REGION, _MOST_POINTS = 140, 2.5, 400
"""Our choice: sample points; fewer leave out contacts of small faces."""
_OF_A_SET = 6
"""Our choice: candidates on one set of faces at most; others are at nearly the same contacts."""
_PROVED = 400
"""Our choice: candidates that are proved, in a fifth of a second."""
_QUICK = 10
"""Our choice: grasps for which the quick search proposes triples besides; on small objects two more
had a grasp that way."""
_COST_OF_REACH = 0.15
"""Our choice: by how much a candidate's value drops for each unit of the root of its score; epsilon
counts as 1 for the best."""
_OVERLAP_COST = 40.0
"""Our choice [1/m]: by how much its value drops with the depth of overlap at its best start. The
first candidate then had a posture for 90 in 100 objects, without it for 77."""


@dataclass(frozen=True, eq=False)
class HandCandidates:
    """Proved grasps that a hand may reach, the most promising first.

    Attributes:
        judge: all candidates and their proofs.
        rows: indices of these grasps among them, shape (N,).
        value: what orders them: epsilon over the best, less what their reach costs, shape (N,).
        num_out_of_reach: number of force-closure candidates beside these that are out of reach.
        widths: least and greatest distance between the tips of such candidates [m], shape (2,);
            NaN where there are none.
    """

    judge: Judge
    rows: Ints
    value: Array
    num_out_of_reach: int
    widths: Array

    @property
    def set_index(self) -> Ints:
        """Number of the set of faces of each grasp, shape (N,)."""
        return self.judge.work.candidates.set_index[self.rows]

    @property
    def request(self) -> PlanRequest:
        """What was asked of contacts."""
        return self.judge.work.request

    def take(self, order: Ints) -> HandCandidates:
        """Returns some of the grasps, in another order.

        Args:
            order: positions in `rows`.
        """
        return replace(self, rows=self.rows[order], value=self.value[order])

    def grasp(self, index: int) -> Grasp:
        """Returns a grasp without its certificate.

        Args:
            index: its position in `rows`.
        """
        return grasp_at(self.judge, int(self.rows[index]))

    def certified(self, index: int) -> CertifiedGrasp:
        """Returns a grasp with its certificate, for exact contacts.

        Args:
            index: its position in `rows`.
        """
        return certify_candidate(self.judge, int(self.rows[index]))


def propose_with_clearance(
    object_: GraspObject,
    options: PlanOptions,
    reach: Reach,
    hand: Hand,
    clearance: float,
    seed: int,
) -> tuple[HandCandidates, tuple[str, ...]]:
    """Proposes candidates that keep as much distance from edges as leaves any.

    Args:
        object_: what to grasp.
        options: what is asked of contacts, of errors only those that are given; without an edge
            clearance, it is `EDGE_CLEARANCE` tip radii, or less where no candidate is left.
        reach: what the hand reaches.
        hand: the hand.
        clearance: distance of fingertips from obstacles [m].
        seed: seed of the random numbers.

    Returns:
        The candidates, and a warning where they are nearer to edges.

    Raises:
        UsageError: when an option is not what it may be for this object.
    """
    object_ = _with_tip_friction(object_, hand)
    tried = [options.edge_clearance]
    if options.edge_clearance is None and options.tip_radius is not None:
        wide = EDGE_CLEARANCE * options.tip_radius
        tried = [wide, 0.5 * wide, None]
    for edge_clearance in tried:
        asked = replace(options.without_default_errors, edge_clearance=edge_clearance)
        request = make_request(object_, asked)
        found = propose_for_hand(request, reach, hand.fingers, clearance=clearance, seed=seed)
        if len(found.rows):
            break
    if edge_clearance == tried[0] or not len(found.rows):
        return found, ()
    least = (
        "1 percent of the object's diameter" if edge_clearance is None else f"{edge_clearance:g} m"
    )
    return found, (
        f"no candidate keeps {EDGE_CLEARANCE:g} tip radii from edges; contacts keep {least}, where "
        "lifts fail more often",
    )


def propose_for_hand(
    request: PlanRequest,
    reach: Reach,
    fingers: Sequence[TipTriple],
    *,
    clearance: float,
    seed: int,
) -> HandCandidates:
    """Proposes triples of contacts that a hand reaches, and proves the best.

    Args:
        request: the request; its tip radius is the hand's.
        reach: what the hand reaches.
        fingers: the triples of tips that may grasp.
        clearance: distance of fingertips from obstacles [m].
        seed: seed of the random numbers.

    Returns:
        The proved candidates within reach.
    """
    object_, regions, tip_radius = request.object_, request.regions, request.tip_radius
    clear = with_tip_room(regions, object_.polyhedron, tip_radius, request.obstacles)
    num = min(max(_LEAST_POINTS, int(_POINTS_A_REGION * len(regions.face))), _MOST_POINTS)
    places = touching_places(clear, sample_points(clear, num, may_exceed=True), tip_radius)
    if request.obstacles is not None:
        blocked = request.obstacles.block(places.p_BT, tip_radius + clearance)
        places = places.take(~blocked)
    scale = object_.p_BBcm, object_.rho
    triples = reachable_triples(places, reach, fingers, *scale, seed=seed)
    known, _ = quick(request, _QUICK)
    triples = join_rows(triples, Triples(known.candidates.region, known.candidates.p_BC))
    sets = sets_of(triples.region[in_order_of_sets(triples.region)])
    judge = Judge(project_candidates(request, unplanned(sets), triples))
    rows = judge.open_rows
    p_BC, nhat, _ = judge.work.contacts_of(rows)
    p_BT = p_BC - tip_radius * nhat
    if request.obstacles is not None and len(rows):
        blocked = request.obstacles.block(p_BT.reshape(-1, 3), tip_radius + clearance)
        is_clear = ~blocked.reshape(-1, 3).any(axis=1)
        rows, p_BT, nhat = rows[is_clear], p_BT[is_clear], nhat[is_clear]
    score = reach_scores(reach, fingers, p_BT, nhat)
    near = score <= OUT_OF_REACH
    side = p_BT - p_BT[:, [1, 2, 0]]
    width = np.sqrt((side**2).sum(axis=-1))[~near]
    widths = np.array([width.min(), width.max()]) if len(width) else np.full(2, np.nan)
    value = _values(judge, rows[near], score[near])
    order = best_first(value)
    number = judge.work.candidates.set_index[rows[near]][order]
    order = order[rank_within_set(number) < _OF_A_SET][:_PROVED]
    chosen = rows[near][order]
    judge.judge(chosen)
    holds = np.isin(chosen, [*judge.proofs])
    return HandCandidates(judge, chosen[holds], value[order][holds], int((~near).sum()), widths)


def _values(judge: Judge, rows: Ints, score: Array) -> Array:
    """Returns epsilon of candidates over the best, less what their distance from reach costs."""
    estimate = judge.estimates()[rows]
    best = max(float(estimate.max(initial=0.0)), np.finfo(float).tiny)
    value: Array = estimate / best - _COST_OF_REACH * np.sqrt(score)
    return value


def in_order_of_overlap(found: HandCandidates, scene: HandScene, reach: Reach) -> HandCandidates:
    """Returns candidates by falling value, less what the overlap at their best start costs.

    Args:
        found: the candidates.
        scene: hand, object and what is around it.
        reach: what the hand reaches.
    """
    overlap = start_overlaps(scene, reach, [found.grasp(k) for k in range(len(found.rows))])
    value = found.value - _OVERLAP_COST * np.minimum(overlap, 1.0)
    return found.take(best_first(value - value.min(initial=0.0)))


def _with_tip_friction(object_: GraspObject, hand: Hand) -> GraspObject:
    """Returns the object with no more friction than a contact with the hand's tips has in Drake.

    Drake combines the coefficients a and b of a pair to 2 a b / (a + b).
    """
    tip = min(tip.mu for tip in hand.tips)
    polyhedron = object_.polyhedron
    faces = tuple(
        replace(face, mu=min(face.mu, 2 * face.mu * tip / (face.mu + tip)))
        for face in polyhedron.faces
    )
    if all(one.mu == other.mu for one, other in zip(faces, polyhedron.faces, strict=True)):
        return object_
    return replace(object_, polyhedron=replace(polyhedron, faces=faces))

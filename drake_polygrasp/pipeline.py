"""Plan, certify, rank: the one place that knows both the planner and the certificate."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.certification.certify import Proof
from drake_polygrasp.certification.wrench_space import RELATIVE_GAP, Interval
from drake_polygrasp.contenders import KINDS, Contenders, contenders
from drake_polygrasp.epsilon_bound import COARSE_TURNS, TURNS, epsilon_upper_bound
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.geometry.polyhedron import Regions
from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
from drake_polygrasp.planning.orientation import least_opposing_friction
from drake_polygrasp.planning.outcome import CODE, REASONS, UNJUDGED, Method, SetPlan, has_contacts
from drake_polygrasp.planning.sample_points import num_points
from drake_polygrasp.planning.search import (
    Triples,
    best_triples,
    first_of_each_set,
    joined,
    sets_of,
)
from drake_polygrasp.planning.tip_room import with_tip_room
from drake_polygrasp.planning.variants import (
    Steps,
    best_first,
    improved_triples,
    place_in_set,
    usable,
)
from drake_polygrasp.task import Task, make_task, rows_of

Rank = Literal["epsilon", "margin", "Q"]

SETS_OF_A_KIND = 10
"""Sets of each kind that are proved at least to be ranked by margin, ours: Q favours two-face
sets, though three faces hold best on most objects without parallel faces."""
MANY_REGIONS = 24
"""Ours: of more, only the sets that the search finds go through the paper's stages."""
CHOSEN_SETS = 100
"""How many sets the search then chooses, ours."""
SPARE = 2
"""Sets proved beyond those wanted, for bounds of epsilon do not quite rank as epsilon, ours."""


@dataclass(frozen=True, order=True)
class _Ranked:
    """A proved candidate; sorts best first."""

    score: float
    """Negative, rounded to 1e-9 as the margin is, so that ties stay ties."""
    margin: float
    faces: tuple[int, ...]
    row: int


@dataclass(frozen=True, eq=False)
class GraspPlan:
    """Certified grasps of an object, best first, and what became of all its sets of faces."""

    grasps: tuple[CertifiedGrasp, ...]
    num_sets: int
    """Sets of three and of two regions."""
    reasons: dict[str, int]
    """How many sets ended with each reason; they add up to num_sets."""
    seconds: dict[str, float]
    """plan: up to ranked, exactly certified grasps; certify: their intervals and tolerances."""
    settings: dict[str, Any]
    """What it takes to repeat the plan, for the grasp file."""
    mu_needed: float | None
    """Without a certified grasp: the friction above which some set would pass orientation."""
    excluded_faces: tuple[int, ...] = ()
    """Faces whose every set is excluded, ascending."""

    @property
    def num_certified(self) -> int:
        """Sets with a certified grasp, of those evaluated."""
        return self.reasons.get("certified", 0)


@dataclass(frozen=True, eq=False)
class Explanation:
    """What became of every set of faces."""

    faces: Ints
    """Faces of each set, ascending; -1 for a pair's third, shape (M, 3)."""
    reasons: list[str]
    """One of outcome.REASONS each, never "not_evaluated"."""
    counts: dict[str, int]
    mu_needed: float | None
    excluded_faces: tuple[int, ...] = ()
    """Faces whose every set is excluded, ascending."""


def plan_grasps(
    object_: GraspObject,
    *,
    method: Method = "enriched",
    top: int = 10,
    rank: Rank | None = None,
    edge_clearance: float | None = None,
    tip_radius: float | None = None,
    avoid_directions: Iterable[npt.ArrayLike] = (),
    exclude_faces: Iterable[int] = (),
    obstacles: Obstacles | None = None,
    steps: Steps | None = None,
) -> GraspPlan:
    """Plans grasps of an object and proves every one that it returns.

    Args:
        object_: what to grasp; friction is that of its faces.
        method: "paper" constructs one grasp for each set of faces as the text says; "enriched"
            also tries variants of it and, ranking by epsilon, other contacts on the same faces.
        top: how many grasps to return at most, one for each set of faces.
        rank: what puts one grasp before another (default: "epsilon"; "Q" for the paper).
        edge_clearance: least distance of a contact from its face's edges [m] (default: 0.01 L or
            a fifth of the face's inradius, whichever is less).
        tip_radius: fingertips of this radius [m] must fit (default: 0.02 L; 0: points).
        avoid_directions: vectors in B, shape (3,) each; no contact is where the outward normal is
            within 45 degrees of one: (0, 0, -1) avoids the underside of what stands on a table.
        exclude_faces: indices of faces that have no contact. Patches of a curved surface overlap;
            there, directions are the surer way.
        obstacles: what fingertips must not penetrate beside the object; see
            `obstacles_from_plant`.
        steps: what "enriched" does beyond the paper (default: all).

    Raises:
        UsageError: when a parameter is not what it may be.
    """
    start = perf_counter()
    rank = rank or ("Q" if method == "paper" else "epsilon")
    if top < 1:
        raise UsageError(f"top is {top}; it must be at least 1")
    if rank not in ("epsilon", "margin", "Q"):
        raise UsageError(f"rank is {rank!r}; it must be 'epsilon', 'margin' or 'Q'")
    task = make_task(
        object_, method, edge_clearance, tip_radius, avoid_directions, exclude_faces, obstacles
    )
    steps = steps or Steps()
    if method == "enriched" and rank == "epsilon":
        work = _enriched(task, steps)
        proofs = _judged_by_bound(work, top + SPARE)
    else:
        work = _constructed(task, steps)
        proofs = _judged_by_quality(work, rank, top)
    order = _ranked(work, proofs, rank)
    planned = perf_counter()
    grasps = _certified(work, proofs, order, rank, top)
    certified = perf_counter()
    return GraspPlan(
        grasps,
        task.num_sets,
        task.counts(work.set_codes()),
        {"plan": planned - start, "certify": certified - planned},
        task.settings | {"rank": rank, "top": top},
        None if grasps else least_opposing_friction(task.regions.nhat_TB_B),
        task.excluded_faces,
    )


def explain_sets(
    object_: GraspObject,
    *,
    method: Method = "enriched",
    edge_clearance: float | None = None,
    tip_radius: float | None = None,
    avoid_directions: Iterable[npt.ArrayLike] = (),
    exclude_faces: Iterable[int] = (),
    obstacles: Obstacles | None = None,
) -> Explanation:
    """Follows every set of faces through the paper's stages; arguments as of `plan_grasps`.

    Sets that only `plan_grasps` finds a grasp for, beyond the paper, are certified too.
    """
    task = make_task(
        object_, method, edge_clearance, tip_radius, avoid_directions, exclude_faces, obstacles
    )
    work = _constructed(task, Steps())
    work.judge(np.flatnonzero(work.outcome == UNJUDGED))
    code = work.set_codes()
    if method == "enriched":
        beyond = _enriched(task, Steps())
        _judged_by_bound(beyond, SETS_OF_A_KIND + SPARE)
        found = beyond.plan.sets[beyond.set_codes() == CODE["certified"]]
        code[rows_of(work.plan.sets, found)] = CODE["certified"]
    counts = task.counts(code)
    sets, code = task.with_excluded(work.plan.sets, code)
    # A pair's third region, -1, becomes face -1.
    faces = np.append(task.every_face, -1)[sets]
    return Explanation(
        frozen(faces, np.int64),
        [REASONS[c] for c in code],
        counts,
        None if counts.get("certified") else least_opposing_friction(task.regions.nhat_TB_B),
        task.excluded_faces,
    )


def _constructed(task: Task, steps: Steps) -> Contenders:
    """The paper's stages on every set."""
    return contenders(task, task.plan(steps), None)


def _enriched(task: Task, steps: Steps) -> Contenders:
    """The paper's constructions, triples of sample points, and the best of both improved."""
    regions, scale = task.regions, (task.object_.p_BBcm, task.object_.rho)
    if not (steps.search or steps.improve):
        return _constructed(task, steps)
    clear = with_tip_room(regions, task.object_.polyhedron, task.tip_radius, task.obstacles)
    none = Triples(np.empty((0, 3), dtype=np.int64), np.empty((0, 3, 3)))
    if steps.search and len(regions.face) > MANY_REGIONS:
        found = best_triples(clear, none, *scale, num_points(len(regions.face)))
        first = first_of_each_set(found.region)[:CHOSEN_SETS]
        found, plan = found.take(first), task.plan(steps, sets_of(found.region[first]))
        known = _known(clear, plan)
    else:
        plan = task.plan(steps)
        known = _known(clear, plan)
        found = best_triples(clear, known, *scale) if steps.search else none
    triples = joined(known, found)
    better = improved_triples(clear, triples, *scale) if steps.improve else found
    return contenders(task, plan, better)


def _known(regions: Regions, plan: SetPlan) -> Triples:
    """The constructions that are usable, best Q first."""
    rows = plan.candidates
    rows = rows.take(has_contacts(rows.p_BC))
    known = Triples(rows.region, rows.p_BC).take(best_first(rows.Q))
    return known.take(usable(regions, known))


def _judged_by_quality(work: Contenders, rank: Rank, top: int) -> dict[int, Proof]:
    if rank == "Q":
        rows = np.arange(len(work.outcome))
        return work.judge_best(rows, work.candidates.Q, top)
    proofs: dict[int, Proof] = {}
    for kind in range(len(KINDS)):
        rows = np.flatnonzero(work.kind == kind)
        proofs |= work.judge_best(rows, work.candidates.Q[rows], max(top, SETS_OF_A_KIND))
    return proofs


def _judged_by_bound(work: Contenders, wanted: int) -> dict[int, Proof]:
    """Proofs of the two best of each set, by their bounds of epsilon; the rest only if needed."""
    rows = np.flatnonzero(work.outcome == UNJUDGED)
    bound = _bound(work, rows, COARSE_TURNS)
    order = np.lexsort((rows, -np.round(bound, 9)))
    rows, bound = rows[order], bound[order]
    is_first = place_in_set(work.candidates.set_index[rows]) < 2
    proofs = work.judge_best(rows[is_first], bound[is_first], wanted)
    if len({int(work.candidates.set_index[row]) for row in proofs}) < wanted:
        proofs |= work.judge_best(rows[~is_first], bound[~is_first], wanted)
    return proofs


def _bound(work: Contenders, rows: Ints, num_turns: int = TURNS) -> Array:
    p_BC, nhat_TB_B, mu = (values[rows] for values in work.contacts)
    object_ = work.task.object_
    return epsilon_upper_bound(p_BC, nhat_TB_B, mu, object_.p_BBcm, object_.rho, num_turns)


def _ranked(work: Contenders, proofs: dict[int, Proof], rank: Rank) -> list[_Ranked]:
    """The best candidate of each set, best first."""
    rows = np.array(sorted(proofs), dtype=np.int64)
    margin = np.array([proofs[row].margin for row in rows.tolist()])
    if rank == "Q":
        score = work.candidates.Q[rows]
    else:
        score = margin if rank == "margin" else _bound(work, rows)
    entries = sorted(
        _Ranked(-round(float(s), 9), -round(float(m), 9), tuple(work.face[row].tolist()), int(row))
        for s, m, row in zip(score, margin, rows, strict=True)
    )
    seen: set[int] = set()
    first = []
    for entry in entries:
        set_index = int(work.candidates.set_index[entry.row])
        if set_index not in seen:
            seen.add(set_index)
            first.append(entry)
    return first


def _certified(
    work: Contenders, proofs: dict[int, Proof], ranked: list[_Ranked], rank: Rank, top: int
) -> tuple[CertifiedGrasp, ...]:
    """The `top` best with their certificates.

    The score of rank "epsilon" is an upper bound: candidates are measured until that of none of the
    rest is above the intervals of the best by more than these are wide.
    """
    if rank != "epsilon":
        return tuple(work.certified(entry.row, proofs[entry.row]) for entry in ranked[:top])
    found: list[tuple[_Ranked, Interval]] = []
    for entry in ranked:
        full = len(found) == top
        least = min(epsilon.upper for _, epsilon in found) if full else -np.inf
        if -entry.score * (1.0 - RELATIVE_GAP) <= least:
            break
        epsilon = work.epsilon(entry.row, at_least=-found[-1][0].score if full else 0.0)
        found.append((replace(entry, score=-round(epsilon.lower, 9)), epsilon))
        found = sorted(found, key=lambda pair: pair[0])[:top]
    return tuple(work.certified(e.row, proofs[e.row], epsilon) for e, epsilon in found)

"""Candidate grasps on their way to proof: on the true surface, with room for tips, certified."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints, frozen
from drake_polygrasp.certification.certify import Proof, certify, prove_many
from drake_polygrasp.certification.robustness import Interval, epsilon_interval
from drake_polygrasp.digits import on_grid, significant, to_decimals
from drake_polygrasp.geometry.face_sets import rows_of, sets_of
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.geometry.seating import (
    TIP_SLACK,
    edge_distance,
    face_of,
    least_tip,
    seat,
    tip_fits,
    tips_are_apart,
)
from drake_polygrasp.geometry.tolerances import LENGTH_TOLERANCE
from drake_polygrasp.grasp import CertifiedGrasp, Grasp, GraspPlane, Kind, Quality, Verdict
from drake_polygrasp.paper.orientation import classify, friction_angle
from drake_polygrasp.paper.reasons import (
    CODE,
    EQUAL_QUALITY,
    UNJUDGED,
    Candidates,
    SetPlan,
    has_contacts,
)
from drake_polygrasp.pipeline.request import Codes, PlanRequest
from drake_polygrasp.search.triples import Triples
from drake_polygrasp.vectors import dot
from drake_polygrasp.wrenches.contacts import force_closure, non_collinear, plane_normal

KINDS: tuple[Kind, ...] = ("three_faces", "three_parallel_faces", "two_faces")

_OUTCOME = {
    Verdict.HOLDS: CODE["certified"],
    Verdict.FAILS: CODE["not_force_closure"],
    Verdict.UNDECIDED: CODE["undecided"],
}


@dataclass(frozen=True, eq=False)
class Contenders:
    """Candidate grasps; `outcome` alone changes, as they are judged."""

    request: PlanRequest
    plan: SetPlan
    candidates: Candidates
    """With contacts moved to the true surface; q is NaN where the paper's stages give none."""
    nhat_TB_B: Array
    mu: Array
    face: Ints
    kind: Ints
    """Position in KINDS."""
    outcome: Codes
    """Position in REASONS of each candidate; UNJUDGED where it may still hold."""

    @property
    def contacts(self) -> tuple[Array, Array, Array]:
        """What the functions of `wrenches` take first."""
        return self.candidates.p_BC, self.nhat_TB_B, self.mu

    def contacts_of(self, rows: Ints) -> tuple[Array, Array, Array]:
        """`contacts` of some candidates."""
        return self.candidates.p_BC[rows], self.nhat_TB_B[rows], self.mu[rows]

    def judge(self, rows: Ints) -> dict[int, Proof]:
        """Whether tips fit and the exact certificate holds; the proofs of those that hold.

        Contacts must be where `verify` finds them too: on the exposed surface, with the body
        behind them and no more friction than is there.
        """
        if not len(rows):
            return {}
        found = face_of(self.request.object_.polyhedron, *self._flat(rows)).reshape(-1, 3)
        there = np.append(self.request.object_.polyhedron.mu, -np.inf)[found]
        on_face = self.mu[rows] <= there
        # On curved surfaces, whose faces are patches, the true normals decide what is excluded.
        avoided = self.request.exclusion.avoids(self.nhat_TB_B[rows].reshape(-1, 3), found.ravel())
        avoided = avoided.reshape(-1, 3)[on_face.all(axis=1)]
        rows = self._passed(rows, on_face, "off_face")
        rows = self._passed(rows, ~avoided, "excluded")
        for reason, passes in (
            ("tip_blocked", fits),
            ("obstructed", is_clear),
        ):
            rows = self._passed(rows, passes(self.request, *self._flat(rows)), reason)
        proofs = prove_many(*self.contacts_of(rows))
        self.outcome[rows] = [_OUTCOME[proof.verdict] for proof in proofs]
        return {
            int(row): proof
            for row, proof in zip(rows, proofs, strict=True)
            if proof.verdict is Verdict.HOLDS
        }

    def _flat(self, rows: Ints) -> tuple[Array, Array]:
        """The contacts of some candidates, one row a contact."""
        return self.candidates.p_BC[rows].reshape(-1, 3), self.nhat_TB_B[rows].reshape(-1, 3)

    def _passed(self, rows: Ints, passes: Bools, reason: str) -> Ints:
        """The rows all of whose contacts pass; to the rest, it becomes their reason."""
        whole = np.logical_and.reduce(passes.reshape(-1, 3), axis=1)
        self.outcome[rows[~whole]] = CODE[reason]
        return rows[whole]

    def judge_best(
        self, rows: Ints, score: Array, wanted: int, known: Iterable[int] = ()
    ) -> dict[int, Proof]:
        """Judges candidates of best score until `wanted` sets hold and the next score is less.

        Scores nearer than EQUAL_QUALITY are a tie.

        Args:
            rows: the candidates.
            score: of each.
            wanted: how many sets are to hold, with those of known rows.
            known: candidates that hold.

        Returns:
            The proofs of those that are found to hold.
        """
        waiting = self.outcome[rows] == UNJUDGED
        rows, score = rows[waiting], np.round(score[waiting] / EQUAL_QUALITY)
        order = np.lexsort((rows, -score))
        rows, score = rows[order], score[order]
        set_index = self.candidates.set_index
        proofs: dict[int, Proof] = {}
        while len(rows):
            held = self.sets_of([*known, *proofs])
            missing = wanted - len(held)
            if missing <= 0:
                break
            _, first = np.unique(set_index[rows], return_index=True)
            fresh = np.sort(first[~np.isin(set_index[rows[first]], held)])
            last = fresh[missing - 1] if missing <= len(fresh) else -1
            # Whole ties, so that which of them are judged does not depend on their order.
            count = int(np.searchsorted(-score, -score[last], side="right"))
            proofs |= self.judge(rows[:count])
            rows, score = rows[count:], score[count:]
        return proofs

    def epsilon(self, row: int, at_least: float) -> Interval:
        """Bounds of a candidate's epsilon, close ones only if it reaches `at_least`."""
        p_BC, nhat_TB_B, mu = (values[row] for values in self.contacts)
        scale = self.request.object_.p_BBcm, self.request.object_.rho
        return epsilon_interval(p_BC, nhat_TB_B, mu, *scale, at_least=at_least)

    def certified(
        self, rows: Ints, proofs: list[Proof], intervals: list[Interval | None]
    ) -> tuple[CertifiedGrasp, ...]:
        """Proved candidates with their certificates; None where epsilon is not measured yet."""
        p_BC, face = self.candidates.p_BC[rows], self.face[rows]
        polyhedron = self.request.object_.polyhedron
        clearance = edge_distance(polyhedron, p_BC.reshape(-1, 3), face.ravel()).reshape(-1, 3)
        return tuple(
            self._certified(*each)
            for each in zip(rows.tolist(), proofs, intervals, clearance.min(axis=1), strict=True)
        )

    def _certified(
        self, row: int, proof: Proof, epsilon: Interval | None, clearance: float
    ) -> CertifiedGrasp:
        rows, object_ = self.candidates, self.request.object_
        a, b, c = self.face[row].tolist()
        grasp = Grasp(
            frozen(rows.p_BC[row]),
            frozen(self.nhat_TB_B[row]),
            frozen(self.mu[row]),
            KINDS[self.kind[row]],
            (a, b, c),
            GraspPlane(
                frozen(to_decimals(rows.nhat_B[row])),
                frozen(on_grid(rows.p_BP[row], object_.polyhedron.diameter)),
            ),
            self._quality(row),
        )
        certified = certify(
            grasp,
            mass=object_.mass,
            p_BBcm=object_.p_BBcm,
            rho=object_.rho,
            edge_distance=float(clearance),
            proof=proof,
            epsilon=epsilon,
        )
        assert isinstance(certified, CertifiedGrasp)  # it is proved already
        return replace(certified, tip_radius=self.request.tip_radius)

    def _quality(self, row: int) -> Quality | None:
        q_1, q_2, q_3, q_4, q_5 = q = to_decimals(self.candidates.q[row]).tolist()
        if np.isnan(q).any():
            return None
        scale: Literal["paper", "object"] = "paper" if self.request.method == "paper" else "object"
        return Quality(scale, float(significant(np.prod(q))), (q_1, q_2, q_3, q_4, q_5))

    def followed_by(self, more: Contenders) -> Contenders:
        """These candidates and then others, whose plan has all sets of both."""
        return Contenders(
            self.request,
            more.plan,
            joined_candidates(self.candidates, more.candidates),
            *(
                np.concatenate([getattr(self, name), getattr(more, name)])
                for name in ("nhat_TB_B", "mu", "face", "kind", "outcome")
            ),
        )

    def sets_of(self, rows: Iterable[int]) -> Ints:
        """The sets of some candidates, each once, ascending positions."""
        sets: Ints = np.unique(self.candidates.set_index[np.fromiter(rows, dtype=np.int64)])
        return sets

    def set_codes(self) -> Codes:
        """What became of each set: the best of its candidates' outcomes."""
        code = self.plan.code.copy()
        standing = np.select(
            [self.outcome == CODE["certified"], self.outcome == UNJUDGED], [0, 1], 2
        )
        # A set that no stage of the paper lets pass keeps its reason unless a grasp of it holds, or
        # one that may hold has not been judged.
        speaks = (standing <= 1) | ~np.isnan(self.candidates.q).any(axis=1)
        # Written in this order, the best and then the first candidate of a set has the last word.
        order = np.lexsort((-np.arange(len(standing)), -standing))
        order = order[speaks[order]]
        code[self.candidates.set_index[order]] = self.outcome[order]
        return code


def fits(request: PlanRequest, p_BC: Array, nhat_TB_B: Array) -> Bools:
    """Whether tips have room at contacts on the surface [m], (M, 3) each to (M,)."""
    return tip_fits(request.object_.polyhedron, p_BC, nhat_TB_B, request.tip_radius)


def is_clear(request: PlanRequest, p_BC: Array, nhat_TB_B: Array) -> Bools:
    """Whether no obstacle is where a tip would be, or within a crack's width of a point, (M,)."""
    if request.obstacles is None:
        return np.ones(len(p_BC), dtype=bool)
    polyhedron = request.object_.polyhedron
    tip_radius = least_tip(polyhedron, request.tip_radius)
    reach = tip_radius - TIP_SLACK * polyhedron.diameter
    return ~request.obstacles.block(p_BC - tip_radius * nhat_TB_B, reach)


def contenders(
    request: PlanRequest, plan: SetPlan, triples: Triples | None, first: int = 0
) -> Contenders:
    """All that was constructed, and triples of the plan's sets, as far as the closed form.

    Contacts are rounded to the digits that a grasp file states: all that follows is of these.

    Args:
        request: what to plan for.
        plan: sets of regions and what the paper's stages make of them.
        triples: more contacts on these sets.
        first: the first of the constructions that is not among other candidates already.
    """
    polyhedron, regions = request.object_.polyhedron, request.regions
    rows = plan.candidates.take(np.arange(first, len(plan.candidates.set_index)))
    if triples is not None:
        rows = joined_candidates(rows, _candidates_of(regions, plan, triples))
    face, mu = regions.face[rows.region], regions.mu[rows.region]
    built = has_contacts(rows.p_BC)
    outcome = np.where(built, UNJUDGED, plan.code[rows.set_index]).astype(np.int8)
    p_BC, nhat_TB_B = rows.p_BC.copy(), regions.nhat_TB_B[rows.region]
    seats = seat(polyhedron, p_BC[built].reshape(-1, 3), face[built].ravel())
    p_BC[built] = on_grid(seats.p_BC, polyhedron.diameter).reshape(-1, 3, 3)
    nhat_TB_B[built] = seats.nhat_TB_B.reshape(-1, 3, 3)
    nhat_TB_B = to_decimals(nhat_TB_B)
    on_surface = np.zeros(len(built), dtype=bool)
    on_surface[built] = seats.ok.reshape(-1, 3).all(axis=1)
    outcome[built & ~on_surface] = CODE["off_face"]
    alive = np.flatnonzero(outcome == UNJUDGED)
    slips = alive[~force_closure(p_BC[alive], nhat_TB_B[alive], mu[alive])]
    spread = non_collinear(p_BC[slips])
    outcome[slips] = np.where(spread, CODE["not_force_closure"], CODE["collinear"])
    alive = np.flatnonzero(outcome == UNJUDGED)
    apart = tips_are_apart(polyhedron, p_BC[alive], nhat_TB_B[alive], request.tip_radius)
    outcome[alive[~apart]] = CODE["tip_blocked"]
    distinct = 1 + (np.diff(np.sort(face, axis=1), axis=1) > 0).sum(axis=1)
    kind = np.where(distinct == 2, 2, rows.is_parallel)
    nhat_B, p_BP = _planes_of(p_BC, rows, LENGTH_TOLERANCE * polyhedron.diameter)
    seated = Candidates(rows.set_index, rows.region, rows.is_parallel, p_BC, nhat_B, p_BP, rows.q)
    return Contenders(request, plan, seated, nhat_TB_B, mu, face, kind, outcome)


def _planes_of(p_BC: Array, rows: Candidates, slack: float) -> tuple[Array, Array]:
    """Normals and points of Pi_p; where seating moved contacts off it, the plane through them."""
    nhat_B, p_BP = rows.nhat_B.copy(), rows.p_BP.copy()
    off = np.abs(dot(nhat_B[:, None], p_BC - p_BP[:, None])).max(axis=1)
    moved = np.flatnonzero(off > slack)
    N = plane_normal(p_BC[moved])
    N *= np.where(dot(N, nhat_B[moved]) < 0, -1.0, 1.0)[:, None]
    nhat_B[moved] = N
    p_BP[moved] -= dot(N, p_BP[moved] - p_BC[moved, 0])[:, None] * N
    return nhat_B, p_BP


def joined_candidates(first: Candidates, second: Candidates) -> Candidates:
    """All rows of both."""
    return Candidates(
        *(
            np.concatenate([getattr(first, column.name), getattr(second, column.name)])
            for column in fields(Candidates)
        )
    )


def _candidates_of(regions: Regions, plan: SetPlan, triples: Triples) -> Candidates:
    """Triples as candidates, contacts in the paper's order: first A_1, which the others oppose."""
    nhat, mu = regions.nhat_TB_B[triples.region], regions.mu[triples.region]
    parallel = classify(nhat, friction_angle(mu))
    is_parallel = np.zeros(len(mu), dtype=bool)
    is_parallel[parallel.rows] = True
    first = np.zeros(len(mu), dtype=np.int64)
    first[parallel.rows] = parallel.opposing
    turned = (first[:, None] + np.arange(3)) % 3
    region = np.take_along_axis(triples.region, turned, axis=1)
    p_BC = np.take_along_axis(triples.p_BC, turned[..., None], axis=1)

    index = rows_of(plan.sets, sets_of(triples.region))
    q = np.full((len(index), 5), np.nan)
    sets, row = np.unique(plan.candidates.set_index, return_index=True)
    position = np.minimum(np.searchsorted(sets, index), max(len(sets) - 1, 0))
    if len(sets):
        has_quality = sets[position] == index
        q[has_quality] = plan.candidates.q[row[position[has_quality]]]
    return Candidates(index, region, is_parallel, p_BC, plane_normal(p_BC), p_BC.mean(axis=1), q)

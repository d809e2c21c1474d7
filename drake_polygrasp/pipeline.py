"""Plan, certify, rank: the one place that knows both the planner and the certificate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from drake_polygrasp.certification.certify import Proof, certify, prove_many
from drake_polygrasp.errors import UsageError
from drake_polygrasp.grasp import (
    Array,
    CertifiedGrasp,
    Grasp,
    GraspObject,
    GraspPlane,
    Ints,
    Kind,
    Quality,
    Verdict,
    frozen,
)
from drake_polygrasp.planning.orientation import least_opposing_friction
from drake_polygrasp.planning.planner import (
    CODE,
    EQUAL_QUALITY,
    REASONS,
    UNJUDGED,
    Candidates,
    Method,
    SetPlan,
    has_contacts,
    plan_sets,
)
from drake_polygrasp.polyhedron import (
    CLEARANCE_OF_INRADIUS,
    DEFAULT_CLEARANCE,
    Regions,
    erode,
)
from drake_polygrasp.seating import edge_distance, seat, tip_fits
from drake_polygrasp.wrench import epsilon_upper_bound, force_closure, non_collinear

Rank = Literal["epsilon", "margin", "Q"]

TIP_RADIUS = 0.02
"""Default fingertip radius times the diameter L, ours."""
SETS_OF_A_KIND = 10
"""Sets of each kind that `method="enriched"` proves at least, ours: Q favours two-face sets, though
three faces hold best on most objects without parallel faces."""

Codes = npt.NDArray[np.int8]
_KINDS: tuple[Kind, ...] = ("three_faces", "three_parallel_faces", "two_faces")
_OUTCOME = {
    Verdict.HOLDS: CODE["certified"],
    Verdict.FAILS: CODE["not_force_closure"],
    Verdict.UNDECIDED: CODE["undecided"],
}
_AHEAD = 2
"""Candidates judged at once for each grasp still missing, ours."""


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
    """One of planner.REASONS each, never "not_evaluated"."""
    counts: dict[str, int]
    mu_needed: float | None


def plan_grasps(
    object_: GraspObject,
    *,
    method: Method = "enriched",
    top: int = 10,
    rank: Rank | None = None,
    edge_clearance: float | None = None,
    tip_radius: float | None = None,
) -> GraspPlan:
    """Plans grasps of an object and proves every one that it returns.

    Args:
        object_: what to grasp; friction is that of its faces.
        method: "paper" constructs one grasp for each set of faces as the text says; "enriched"
            also tries variants of it.
        top: how many grasps to return at most, one for each set of faces.
        rank: what puts one grasp before another (default: "epsilon"; "Q" for the paper).
        edge_clearance: least distance of a contact from its face's edges [m] (default: 0.01 L or
            a fifth of the face's inradius, whichever is less).
        tip_radius: fingertips of this radius [m] must fit (default: 0.02 L; 0: points).

    Raises:
        UsageError: when a parameter is not what it may be.
    """
    start = perf_counter()
    rank = rank or ("Q" if method == "paper" else "epsilon")
    if top < 1:
        raise UsageError(f"top is {top}; it must be at least 1")
    if rank not in ("epsilon", "margin", "Q"):
        raise UsageError(f"rank is {rank!r}; it must be 'epsilon', 'margin' or 'Q'")
    work = _construct(object_, method, edge_clearance, tip_radius)
    if rank == "Q":
        proofs = work.judge_best(np.arange(len(work.outcome)), top)
    else:
        proofs = {}
        for kind in range(len(_KINDS)):
            rows = np.flatnonzero(work.kind == kind)
            proofs |= work.judge_best(rows, max(top, SETS_OF_A_KIND))
    order = work.ranked(proofs, rank)
    planned = perf_counter()
    grasps = work.certified(order, rank, top)
    certified = perf_counter()
    code = work.set_codes()
    return GraspPlan(
        grasps,
        len(code),
        _counts(code),
        {"plan": planned - start, "certify": certified - planned},
        work.settings | {"rank": rank, "top": top},
        None if grasps else least_opposing_friction(work.regions.nhat_TB_B),
    )


def explain_sets(
    object_: GraspObject,
    *,
    method: Method = "enriched",
    edge_clearance: float | None = None,
    tip_radius: float | None = None,
) -> Explanation:
    """Follows every set of faces to its end; arguments as of `plan_grasps`."""
    work = _construct(object_, method, edge_clearance, tip_radius)
    work.judge(np.flatnonzero(work.outcome == UNJUDGED))
    code = work.set_codes()
    # A pair's third region, -1, becomes face -1.
    faces = np.append(work.regions.face, -1)[work.plan.sets]
    counts = _counts(code)
    return Explanation(
        frozen(faces, np.int64),
        [REASONS[c] for c in code],
        counts,
        None if counts.get("certified") else least_opposing_friction(work.regions.nhat_TB_B),
    )


def _counts(code: Codes) -> dict[str, int]:
    counts = np.bincount(code, minlength=len(REASONS))
    return {reason: int(n) for reason, n in zip(REASONS, counts, strict=True) if n}


def _construct(
    object_: GraspObject, method: Method, edge_clearance: float | None, tip_radius: float | None
) -> _Work:
    """Everything up to contacts on the true surface that pass the closed form."""
    if method not in get_args(Method):
        raise UsageError(f"method is {method!r}; it must be one of {', '.join(get_args(Method))}")
    for name, length in (("edge_clearance", edge_clearance), ("tip_radius", tip_radius)):
        if length is not None and not 0 <= length < np.inf:
            raise UsageError(f"{name} is {length}; it must be a length in metres, 0 or more")
    L = object_.polyhedron.diameter
    tip = TIP_RADIUS * L if tip_radius is None else tip_radius
    settings: dict[str, Any] = {
        "method": method,
        "edge_clearance": DEFAULT_CLEARANCE * L if edge_clearance is None else edge_clearance,
        "tip_radius": tip,
    }
    if edge_clearance is None:
        settings["edge_clearance_share_of_inradius"] = CLEARANCE_OF_INRADIUS

    regions = erode(object_.polyhedron, edge_clearance)
    plan = plan_sets(regions, object_.p_BBcm, L, object_.rho, method)
    rows = plan.candidates
    face = regions.face[rows.region]
    mu = regions.mu[rows.region]
    outcome = plan.code[rows.set_index]
    built = has_contacts(rows.p_BC)
    outcome[built] = UNJUDGED
    p_BC, nhat_TB_B = rows.p_BC.copy(), regions.nhat_TB_B[rows.region]
    seats = seat(object_.polyhedron, p_BC[built].reshape(-1, 3), face[built].ravel())
    p_BC[built], nhat_TB_B[built] = (
        seats.p_BC.reshape(-1, 3, 3),
        seats.nhat_TB_B.reshape(-1, 3, 3),
    )
    on_surface = np.zeros(len(built), dtype=bool)
    on_surface[built] = seats.ok.reshape(-1, 3).all(axis=1)
    outcome[built & ~on_surface] = CODE["off_face"]
    alive = np.flatnonzero(outcome == UNJUDGED)
    outcome[alive[~non_collinear(p_BC[alive])]] = CODE["collinear"]
    alive = np.flatnonzero(outcome == UNJUDGED)
    holds = force_closure(p_BC[alive], nhat_TB_B[alive], mu[alive])
    outcome[alive[~holds]] = CODE["not_force_closure"]
    distinct = 1 + (np.diff(np.sort(face, axis=1), axis=1) > 0).sum(axis=1)
    kind = np.where(distinct == 2, 2, rows.is_parallel)
    return _Work(
        object_,
        method,
        regions,
        plan,
        replace(rows, p_BC=p_BC),
        nhat_TB_B,
        mu,
        face,
        kind,
        outcome,
        tip,
        settings,
    )


@dataclass(frozen=True, eq=False)
class _Work:
    """Candidate grasps on their way to proof; `outcome` alone changes, as they are judged."""

    object_: GraspObject
    method: Method
    regions: Regions
    plan: SetPlan
    candidates: Candidates
    """With contacts moved to the true surface."""
    nhat_TB_B: Array
    mu: Array
    face: Ints
    kind: Ints
    """Position in _KINDS."""
    outcome: Codes
    """Position in REASONS of each candidate; UNJUDGED where it may still hold."""
    tip_radius: float
    settings: dict[str, Any]

    def judge(self, rows: Ints) -> dict[int, Proof]:
        """Whether tips fit and the exact certificate holds; the proofs of those that hold."""
        if self.tip_radius > 0:
            fits = tip_fits(
                self.object_.polyhedron,
                self.candidates.p_BC[rows].reshape(-1, 3),
                self.nhat_TB_B[rows].reshape(-1, 3),
                self.tip_radius,
            )
            fits = np.logical_and.reduce(fits.reshape(-1, 3), axis=1)
            self.outcome[rows[~fits]] = CODE["tip_blocked"]
            rows = rows[fits]
        proofs = prove_many(self.candidates.p_BC[rows], self.nhat_TB_B[rows], self.mu[rows])
        self.outcome[rows] = [_OUTCOME[proof.verdict] for proof in proofs]
        return {
            int(row): proof
            for row, proof in zip(rows, proofs, strict=True)
            if proof.verdict is Verdict.HOLDS
        }

    def judge_best(self, rows: Ints, wanted: int) -> dict[int, Proof]:
        """Judges candidates of best Q until `wanted` sets hold and the next Q is less."""
        rows = rows[self.outcome[rows] == UNJUDGED]
        Q = np.round(self.candidates.Q[rows] / EQUAL_QUALITY)
        order = np.lexsort((rows, -Q))
        rows, Q = rows[order], Q[order]
        proofs: dict[int, Proof] = {}
        while len(rows):
            held = {int(self.candidates.set_index[row]) for row in proofs}
            missing = wanted - len(held)
            if missing <= 0:
                break
            # Whole ties, so that which of them are judged does not depend on their order.
            level = Q[min(_AHEAD * missing, len(rows)) - 1]
            count = int(np.searchsorted(-Q, -level, side="right"))
            proofs |= self.judge(rows[:count])
            rows, Q = rows[count:], Q[count:]
        return proofs

    def ranked(self, proofs: dict[int, Proof], rank: Rank) -> list[_Ranked]:
        """The best candidate of each set, best first."""
        rows = np.array(sorted(proofs), dtype=np.int64)
        margin = np.array([proofs[row].margin for row in rows.tolist()])
        if rank == "Q":
            score = self.candidates.Q[rows]
        elif rank == "margin":
            score = margin
        else:
            score = epsilon_upper_bound(
                self.candidates.p_BC[rows],
                self.nhat_TB_B[rows],
                self.mu[rows],
                self.object_.p_BBcm,
                self.object_.rho,
            )
        entries = sorted(
            _Ranked(
                -round(float(s), 9), -round(float(m), 9), tuple(self.face[row].tolist()), int(row)
            )
            for s, m, row in zip(score, margin, rows, strict=True)
        )
        seen: set[int] = set()
        first = []
        for entry in entries:
            set_index = int(self.candidates.set_index[entry.row])
            if set_index not in seen:
                seen.add(set_index)
                first.append(entry)
        return first

    def certified(self, ranked: list[_Ranked], rank: Rank, top: int) -> tuple[CertifiedGrasp, ...]:
        """The `top` best with their certificates.

        The score of rank "epsilon" is an upper bound: candidates are measured until none of the
        rest can win.
        """
        found: list[tuple[_Ranked, CertifiedGrasp]] = []
        for entry in ranked:
            if len(found) >= top:
                if rank != "epsilon" or -entry.score <= sorted(-e.score for e, _ in found)[-top]:
                    break
            certified = self._certify(entry.row)
            if rank == "epsilon":
                entry = replace(entry, score=-round(certified.certificate.epsilon_lower, 9))
            found.append((entry, certified))
        found.sort(key=lambda pair: pair[0])
        return tuple(certified for _, certified in found[:top])

    def _certify(self, row: int) -> CertifiedGrasp:
        rows = self.candidates
        kind: Kind = _KINDS[self.kind[row]]
        faces = self.face[row]
        q_1, q_2, q_3, q_4, q_5 = rows.q[row].tolist()
        grasp = Grasp(
            frozen(rows.p_BC[row]),
            frozen(self.nhat_TB_B[row]),
            frozen(self.mu[row]),
            kind,
            (int(faces[0]), int(faces[1]), int(faces[2])),
            GraspPlane(frozen(rows.nhat_B[row]), frozen(rows.p_BP[row])),
            Quality(
                "paper" if self.method == "paper" else "object",
                float(rows.Q[row]),
                (q_1, q_2, q_3, q_4, q_5),
            ),
        )
        object_ = self.object_
        certified = certify(
            grasp,
            mass=object_.mass,
            p_BBcm=object_.p_BBcm,
            rho=object_.rho,
            edge_distance=float(edge_distance(object_.polyhedron, grasp.p_BC, faces).min()),
        )
        assert isinstance(certified, CertifiedGrasp)  # it is proved already
        return certified

    def set_codes(self) -> Codes:
        """What became of each set: the best of its candidates' outcomes."""
        code = self.plan.code.copy()
        standing = np.select(
            [self.outcome == CODE["certified"], self.outcome == UNJUDGED], [0, 1], 2
        )
        # Written in this order, the best and then the first candidate of a set has the last word.
        order = np.lexsort((-np.arange(len(standing)), -standing))
        code[self.candidates.set_index[order]] = self.outcome[order]
        return code

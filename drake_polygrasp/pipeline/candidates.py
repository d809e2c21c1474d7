"""Projects candidate contacts onto the true surface, on which they are proved."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints, distinct_values, join_rows
from drake_polygrasp.digits import on_grid, to_decimals
from drake_polygrasp.geometry.face_sets import find_rows, sets_of
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.geometry.surface_contact import (
    TIP_SLACK,
    effective_tip_radius,
    fingertip_fits,
    fingertips_are_apart,
    project_contacts,
)
from drake_polygrasp.geometry.tolerances import LENGTH_TOLERANCE
from drake_polygrasp.grasp import Kind
from drake_polygrasp.paper.orientation import classify, friction_angle
from drake_polygrasp.paper.reasons import (
    CODE,
    UNJUDGED,
    Candidates,
    Codes,
    SetPlan,
    has_contacts,
)
from drake_polygrasp.pipeline.request import PlanRequest
from drake_polygrasp.search.triples import Triples
from drake_polygrasp.vectors import dot
from drake_polygrasp.wrenches.contacts import force_closure, non_collinear, plane_normal

KINDS: tuple[Kind, ...] = ("three_faces", "three_parallel_faces", "two_faces")
"""Kinds of grasps, by the numbers in `ProjectedCandidates.kind`."""


@dataclass(frozen=True, eq=False)
class ProjectedCandidates:
    """Candidate grasps with their contacts on the true surface, one row each.

    Rows are immutable; a `Judge` keeps the outcomes of their proofs.

    Attributes:
        request: the request.
        plan: sets of regions, and the results of the paper's stages on them.
        candidates: candidates with contacts on the true surface; q is NaN if the paper's stages
            give none.
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        mu: friction coefficients of the model, which proofs use, shape (M, 3).
        face: indices of the faces of the contacts, shape (M, 3).
        kind: index in KINDS, shape (M,).
        outcome: index in REASONS; UNJUDGED if the candidate may still hold, shape (M,).
    """

    request: PlanRequest
    plan: SetPlan
    candidates: Candidates
    nhat_TB_B: Array
    mu: Array
    face: Ints
    kind: Ints
    outcome: Codes

    @property
    def contacts(self) -> tuple[Array, Array, Array]:
        """Contact points [m], inward unit normals and the model's friction of all candidates."""
        return self.candidates.p_BC, self.nhat_TB_B, self.mu

    def contacts_of(self, rows: Ints) -> tuple[Array, Array, Array]:
        """Returns `contacts` of some candidates.

        Args:
            rows: indices of the candidates, shape (N,).
        """
        return self.candidates.p_BC[rows], self.nhat_TB_B[rows], self.mu[rows]

    def narrowed_contacts_of(self, rows: Ints) -> tuple[Array, Array, Array]:
        """Returns contacts of some candidates with the friction that errors leave.

        Args:
            rows: indices of the candidates, shape (N,).
        """
        return *self.contacts_of(rows)[:2], self.request.mu_left[self.face[rows]]

    def one_row_a_contact(self, rows: Ints) -> tuple[Array, Array]:
        """Returns contact points [m] and normals of some candidates, shape (3 N, 3) each.

        Args:
            rows: indices of the candidates, shape (N,).
        """
        return self.candidates.p_BC[rows].reshape(-1, 3), self.nhat_TB_B[rows].reshape(-1, 3)

    def followed_by(self, more: ProjectedCandidates) -> ProjectedCandidates:
        """Returns these candidates, followed by others.

        Args:
            more: candidates of the same request, whose plan has the sets of both.
        """
        return ProjectedCandidates(
            self.request,
            more.plan,
            join_rows(self.candidates, more.candidates),
            *(
                np.concatenate([getattr(self, name), getattr(more, name)])
                for name in ("nhat_TB_B", "mu", "face", "kind", "outcome")
            ),
        )

    def sets_of(self, rows: Iterable[int]) -> Ints:
        """Returns the sets of some candidates, each once, as ascending indices in the plan.

        Args:
            rows: indices of the candidates.
        """
        sets: Ints = distinct_values(self.candidates.set_index[np.fromiter(rows, dtype=np.int64)])
        return sets


def has_fingertip_room(request: PlanRequest, p_BC: Array, nhat_TB_B: Array) -> Bools:
    """Returns whether fingertips penetrate the object nowhere, shape (M,).

    Args:
        request: the request, with the object and the tip radius.
        p_BC: contact points on the surface [m], shape (M, 3).
        nhat_TB_B: inward unit normals, shape (M, 3).
    """
    return fingertip_fits(request.object_.polyhedron, p_BC, nhat_TB_B, request.tip_radius)


def clear_of_obstacles(request: PlanRequest, p_BC: Array, nhat_TB_B: Array) -> Bools:
    """Returns whether fingertips penetrate no obstacle, shape (M,).

    Args:
        request: the request, with the obstacles and the tip radius.
        p_BC: contact points on the surface [m], shape (M, 3).
        nhat_TB_B: inward unit normals, shape (M, 3).
    """
    if request.obstacles is None:
        return np.ones(len(p_BC), dtype=bool)
    polyhedron = request.object_.polyhedron
    tip_radius = effective_tip_radius(polyhedron, request.tip_radius)
    reach = tip_radius - TIP_SLACK * polyhedron.diameter
    return ~request.obstacles.block(p_BC - tip_radius * nhat_TB_B, reach)


def project_candidates(
    request: PlanRequest, plan: SetPlan, triples: Triples | None, first: int = 0
) -> ProjectedCandidates:
    """Projects candidates onto the true surface and tests their force closure in closed form.

    Contacts are rounded to the digits that a grasp file states, so proofs hold for what is written.

    Args:
        request: the request.
        plan: sets of regions, and the results of the paper's stages on them.
        triples: more contacts on these sets.
        first: index of the first of the plan's candidates to project; those before are projected
            already.

    Returns:
        The plan's candidates from `first` on, then the triples. The outcome tells those that are
        not on the surface, not force closure, or whose fingertips overlap.
    """
    polyhedron, regions = request.object_.polyhedron, request.regions
    rows = plan.candidates.take(np.arange(first, len(plan.candidates.set_index)))
    if triples is not None:
        rows = join_rows(rows, _candidates_of(regions, plan, triples))
    face, mu_left = regions.face[rows.region], regions.mu[rows.region]
    built = has_contacts(rows.p_BC)
    outcome = np.where(built, UNJUDGED, plan.code[rows.set_index]).astype(np.int8)
    p_BC, nhat_TB_B = rows.p_BC.copy(), regions.nhat_TB_B[rows.region]
    projected = project_contacts(polyhedron, p_BC[built].reshape(-1, 3), face[built].ravel())
    p_BC[built] = on_grid(projected.p_BC, polyhedron.diameter).reshape(-1, 3, 3)
    nhat_TB_B[built] = projected.nhat_TB_B.reshape(-1, 3, 3)
    nhat_TB_B = to_decimals(nhat_TB_B)
    on_surface = np.zeros(len(built), dtype=bool)
    on_surface[built] = projected.ok.reshape(-1, 3).all(axis=1)
    outcome[built & ~on_surface] = CODE["off_face"]
    alive = np.flatnonzero(outcome == UNJUDGED)
    slips = alive[~force_closure(p_BC[alive], nhat_TB_B[alive], mu_left[alive])]
    spread = non_collinear(p_BC[slips])
    outcome[slips] = np.where(spread, CODE["not_force_closure"], CODE["collinear"])
    alive = np.flatnonzero(outcome == UNJUDGED)
    apart = fingertips_are_apart(polyhedron, p_BC[alive], nhat_TB_B[alive], request.tip_radius)
    outcome[alive[~apart]] = CODE["tip_blocked"]
    distinct = 1 + (np.diff(np.sort(face, axis=1), axis=1) > 0).sum(axis=1)
    kind = np.where(distinct == 2, 2, rows.is_parallel)
    nhat_B, p_BP = _planes_of(p_BC, rows, LENGTH_TOLERANCE * polyhedron.diameter)
    mu = polyhedron.mu[face]
    candidates = replace(rows, p_BC=p_BC, nhat_B=nhat_B, p_BP=p_BP)
    return ProjectedCandidates(request, plan, candidates, nhat_TB_B, mu, face, kind, outcome)


def _planes_of(p_BC: Array, rows: Candidates, slack: float) -> tuple[Array, Array]:
    """Returns normals and points of Pi_p; of the contacts' plane if projection moved them off."""
    nhat_B, p_BP = rows.nhat_B.copy(), rows.p_BP.copy()
    off = np.abs(dot(nhat_B[:, None], p_BC - p_BP[:, None])).max(axis=1)
    moved = np.flatnonzero(off > slack)
    N = plane_normal(p_BC[moved])
    N *= np.where(dot(N, nhat_B[moved]) < 0, -1.0, 1.0)[:, None]
    nhat_B[moved] = N
    p_BP[moved] -= dot(N, p_BP[moved] - p_BC[moved, 0])[:, None] * N
    return nhat_B, p_BP


def _candidates_of(regions: Regions, plan: SetPlan, triples: Triples) -> Candidates:
    """Returns triples as candidates in the paper's order: first A_1, which the others oppose."""
    nhat, mu = regions.nhat_TB_B[triples.region], regions.mu[triples.region]
    parallel = classify(nhat, friction_angle(mu))
    is_parallel = np.zeros(len(mu), dtype=bool)
    is_parallel[parallel.rows] = True
    first = np.zeros(len(mu), dtype=np.int64)
    first[parallel.rows] = parallel.opposing
    turned = (first[:, None] + np.arange(3)) % 3
    region = np.take_along_axis(triples.region, turned, axis=1)
    p_BC = np.take_along_axis(triples.p_BC, turned[..., None], axis=1)

    index = find_rows(plan.sets, sets_of(triples.region))
    q = np.full((len(index), 5), np.nan)
    sets, row = np.unique(plan.candidates.set_index, return_index=True)
    position = np.minimum(np.searchsorted(sets, index), max(len(sets) - 1, 0))
    if len(sets):
        has_quality = sets[position] == index
        q[has_quality] = plan.candidates.q[row[position[has_quality]]]
    return Candidates(index, region, is_parallel, p_BC, plane_normal(p_BC), p_BC.mean(axis=1), q)

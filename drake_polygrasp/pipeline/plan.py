"""Plans, proves and ranks grasps, by the paper, the search beyond it and the certificate."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from time import perf_counter
from typing import Literal

import numpy.typing as npt

from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
from drake_polygrasp.pipeline.fallback import (
    errors_in_turn,
    make_requests,
    prove_in_turn,
    sets_and_codes,
)
from drake_polygrasp.pipeline.freed_memory import keep_freed_memory
from drake_polygrasp.pipeline.ranking import certify_best
from drake_polygrasp.settings import EffortName, Method, PlanOptions, PlanSettings, Rank, Steps

PlanOutcome = Literal["grasps", "none_found", "no_certified_grasp"]
"""How planning ends: with grasps; with none, though not every set of faces was evaluated; or with
none on any set."""


@dataclass(frozen=True, eq=False)
class GraspPlan:
    """Certified grasps of an object, best first, and what became of all its sets of faces.

    Attributes:
        object_: the object.
        grasps: certified grasps, best first, at most one for each set of faces.
        num_sets: number of all sets of three and of two regions. A region is what the edge
            clearance leaves of a face.
        reasons: number of sets by how they ended: "certified", the step that rejected them, or
            "not_evaluated"; the numbers add up to `num_sets`. No set is rejected for default errors
            alone: where enough grasps bear those, the others are not evaluated.
        seconds: time taken [s]: "plan" until enough grasps are proved, "certify" for ranking,
            bounds of epsilon and tolerances.
        settings: settings that repeat the plan, for `save_grasps`.
        mu_needed: friction coefficient above which the normals of some set can oppose each other;
            None if there are grasps.
        excluded_faces: indices of faces of which every set is excluded, ascending.
    """

    object_: GraspObject
    grasps: tuple[CertifiedGrasp, ...]
    num_sets: int
    reasons: dict[str, int]
    seconds: dict[str, float]
    settings: PlanSettings
    mu_needed: float | None
    excluded_faces: tuple[int, ...] = ()

    @property
    def num_certified(self) -> int:
        """Number of sets of faces on which a grasp was proved.

        Planning ends when enough grasps are proved, so more sets may have one. Effort "complete"
        evaluates all sets, and then the number does not depend on `top`.
        """
        return self.reasons.get("certified", 0)

    @property
    def num_not_evaluated(self) -> int:
        """Number of sets of faces that were not evaluated, or not completely."""
        return self.reasons.get("not_evaluated", 0)

    @property
    def outcome(self) -> PlanOutcome:
        """How planning ended.

        "grasps"; "none_found" if there are none, but some sets were not evaluated; or
        "no_certified_grasp" if there is none on any set.
        """
        if self.grasps:
            return "grasps"
        return "none_found" if self.num_not_evaluated else "no_certified_grasp"


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
    effort: EffortName = "full",
    placement_error: float | None = None,
    tilt_error: float | None = None,
    friction_error: float | None = None,
    com_error: float | None = None,
) -> GraspPlan:
    """Plans grasps of an object and proves each one that it returns.

        plan = plan_grasps(box, top=3, avoid_directions=[(0, 0, -1)])
        for certified in plan.grasps:
            print(certified.grasp.p_BC, certified.certificate.epsilon_lower)

    Lengths below in L are fractions of the object's diameter.

    Grasps are planned to bear errors of hand and model, all at once: each one's `region` states and
    proves those that it bears. Ranking by epsilon, grasps that bear all errors come first, and the
    least epsilon under them counts. Default errors cost no grasp: where fewer than `top` are found
    that may bear them, narrow faces follow, on which contacts keep half of the inradius from edges,
    and then grasps that are planned without errors. A grasp is tried for half and a quarter of the
    default errors where it is not proved to bear them all or they leave less than a tenth of its
    epsilon. `region` is None where none are proved, and everywhere if all four errors are 0
    (`**NO_ERRORS`), which ranks by the epsilon of exact contacts.

    Args:
        object_: object to grasp, with the friction of its faces.
        method: "paper" constructs one grasp for each set of faces as the text says; "enriched"
            also tries variants of it and, ranking by epsilon, other contacts on the same faces.
        top: greatest number of grasps to return, one for each set of faces. If
            `edge_clearance` cuts a face in two, each part counts as a face.
        rank: order of the grasps: "epsilon", "margin" or the paper's "Q" (default: "epsilon"; "Q"
            for the paper).
        edge_clearance: least distance of contacts from the edges of their faces [m] (default: 0.01
            L or a fifth of the face's inradius, whichever is less).
        tip_radius: radius of the spherical fingertips that must fit [m] (default: 0.02 L; 0:
            points).
        avoid_directions: vectors in B, shape (3,) each; no contact has an outward normal within 45
            degrees of one. (0, 0, -1) avoids the underside of an object on a table.
        exclude_faces: indices of faces without contacts. Patches of a curved surface overlap, so
            there it is safer to avoid directions.
        obstacles: solids beside the object that fingertips must not penetrate; see
            `obstacles_from_plant`.
        steps: which steps beyond the paper "enriched" takes, a `settings.Steps` (default: all).
        effort: "full" searches longer if it finds fewer grasps than `top`: denser points, then sets
            of faces that it left out, up to 32,000 of them, or 300,000 while it has no grasp.
            "quick" searches few points without the paper's stages, so its grasps have no Q; if it
            finds none, "full" follows, and bounds of epsilon under errors may be 5 percent apart
            instead of 2. It is for "enriched" ranked by epsilon. "complete" evaluates every set of
            faces, however long that takes.
        placement_error: distance by which a contact may miss its place along its face, in any
            direction [m] (default: 0.02 L). Contacts keep at least this distance from edges.
        tilt_error: angle by which the true normal at a contact may tilt [rad], 0 to 1.5 (default: 5
            degrees).
        friction_error: share by which friction coefficients may be less, 0 to below 1
            (default: 0.2). Grasps are planned with the friction that the worst tilt and coefficient
            leave; proofs and `Grasp.mu` have the model's. Default tilt and friction errors are
            halved together until they leave a third of the friction.
        com_error: distance by which the centre of mass may be off, in any direction [m] (default:
            0.02 L). For the method "paper", all four are 0 unless given.

    Returns:
        The plan. If it has no grasps, `outcome` says whether all sets of faces were evaluated.

    Raises:
        UsageError: when an argument has the wrong type or value, or does not go with another.
    """
    start = perf_counter()
    keep_freed_memory()
    options = PlanOptions(
        method=method,
        top=top,
        rank=rank,
        edge_clearance=edge_clearance,
        tip_radius=tip_radius,
        avoid_directions=avoid_directions,
        exclude_faces=exclude_faces,
        obstacles=obstacles,
        steps=steps,
        effort=effort,
        placement_error=placement_error,
        tilt_error=tilt_error,
        friction_error=friction_error,
        com_error=com_error,
    )
    requests = make_requests(object_, options)
    judges = prove_in_turn(requests)
    planned = perf_counter()
    settings = requests[0].settings
    grasps = certify_best(judges, errors_in_turn(requests), settings.rank, settings.top)
    certified = perf_counter()
    request = requests[-1]
    return GraspPlan(
        object_,
        grasps,
        request.num_sets,
        request.counts(sets_and_codes(requests, judges)[1]),
        {"plan": planned - start, "certify": certified - planned},
        settings,
        None if grasps else request.mu_needed,
        request.excluded_faces,
    )

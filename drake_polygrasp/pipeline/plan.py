"""Plans, proves and ranks grasps, by the paper, the search beyond it and the certificate."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from time import perf_counter
from typing import Literal

import numpy.typing as npt

from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
from drake_polygrasp.paper.orientation import least_opposing_friction
from drake_polygrasp.pipeline.freed_memory import keep_freed_memory
from drake_polygrasp.pipeline.judging import prove_candidates
from drake_polygrasp.pipeline.ranking import certify_best
from drake_polygrasp.pipeline.request import make_request
from drake_polygrasp.settings import EffortName, Method, PlanOptions, PlanSettings, Rank, Steps

PlanOutcome = Literal["grasps", "none_found", "no_certified_grasp"]
"""How planning ends: with grasps; with none, though not every set of faces was evaluated; or with
none on any set."""


@dataclass(frozen=True, eq=False)
class GraspPlan:
    """Certified grasps of an object, best first, and what became of all its sets of faces.

    Attributes:
        grasps: certified grasps, best first, one for each set of faces.
        num_sets: sets of three and of two regions.
        reasons: how many sets ended with each reason; they add up to num_sets.
        seconds: plan: until enough grasps are proved; certify: ranking, bounds of epsilon and
            tolerances.
        settings: what repeats the plan, for the grasp file.
        mu_needed: without a certified grasp: the friction above which some set would pass
            orientation.
        excluded_faces: faces whose every set is excluded, ascending.
    """

    grasps: tuple[CertifiedGrasp, ...]
    num_sets: int
    reasons: dict[str, int]
    seconds: dict[str, float]
    settings: PlanSettings
    mu_needed: float | None
    excluded_faces: tuple[int, ...] = ()

    @property
    def num_certified(self) -> int:
        """Sets on which a grasp was proved so far.

        Planning ends when enough grasps are proved, so more sets may have one, unless all were
        evaluated: effort "complete" does, and then the number does not depend on `top`.
        """
        return self.reasons.get("certified", 0)

    @property
    def num_not_evaluated(self) -> int:
        """Sets of which nothing is known: they were not looked at, or not to the end."""
        return self.reasons.get("not_evaluated", 0)

    @property
    def outcome(self) -> PlanOutcome:
        """Whether there are grasps, and if not, whether every set of faces was evaluated."""
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
) -> GraspPlan:
    """Plans grasps of an object and proves every one that it returns.

    Args:
        object_: what to grasp; friction is that of its faces.
        method: "paper" constructs one grasp for each set of faces as the text says; "enriched"
            also tries variants of it and, ranking by epsilon, other contacts on the same faces.
        top: how many grasps to return at most, one for each set of faces; of a face that the
            clearance cuts in two, each part counts as one.
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
        effort: how long to search. "full" goes on where it finds fewer grasps than `top`: with
            denser points, then with sets of faces that it left out, up to 32,000 of them, or
            300,000 where it finds none. "quick" searches a few points, without the paper's stages,
            so that grasps have no Q; where it finds none, "full" follows. It is for "enriched",
            ranked by epsilon. "complete" evaluates every set of faces, however long that takes.

    Returns:
        The plan. Where it has no grasps, `outcome` says whether all sets of faces were evaluated.

    Raises:
        UsageError: when a parameter is not what it may be.
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
    )
    request = make_request(object_, options)
    judge = prove_candidates(request)
    planned = perf_counter()
    grasps = certify_best(judge, request.settings.rank, request.settings.top)
    certified = perf_counter()
    return GraspPlan(
        grasps,
        request.num_sets,
        request.counts(judge.set_codes()),
        {"plan": planned - start, "certify": certified - planned},
        request.settings,
        None if grasps else least_opposing_friction(request.regions.nhat_TB_B),
        request.excluded_faces,
    )

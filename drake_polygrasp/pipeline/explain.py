"""Follows every set of faces to its end: proved, or the reason why not."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arguments import Progress, check_progress
from drake_polygrasp.arrays import Ints, frozen
from drake_polygrasp.geometry.face_sets import rows_in_all_sets
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.reasons import CODE, REASONS, Codes
from drake_polygrasp.pipeline.fallback import make_requests, sets_held, sets_inside
from drake_polygrasp.pipeline.judging import judge_each_set
from drake_polygrasp.pipeline.request import PlanRequest
from drake_polygrasp.settings import Method, PlanOptions

_SETTLED = tuple(CODE[reason] for reason in ("certified", "orientation"))
"""Codes of sets about which a request with less friction says nothing else."""


@dataclass(frozen=True, eq=False)
class Explanation:
    """How every set of two or three faces ended: with a proved grasp, or with a reason.

    Attributes:
        faces: indices of the faces of each set, ascending, shape (M, 3); the third of a pair is -1.
        reasons: how each set ended: "certified", or the step that rejected it, such as
            "orientation", "rl_empty" or "tip_blocked". `docs/paper.md` explains them all.
        counts: number of sets by reason.
        mu_needed: friction coefficient above which the normals of some set can oppose each other;
            None if a grasp is certified.
        excluded_faces: indices of faces of which every set is excluded, ascending.
        tip_radius: radius of the fingertips that had to fit [m].
        edge_clearance: least distance of contacts from edges, if it was given [m].
        placement_error: distance by which contacts may miss along their faces, if it was given
            [m]; else 0. So are the next two.
        tilt_error: angle by which normals may tilt [rad].
        friction_error: share by which friction coefficients may be less.
    """

    faces: Ints
    reasons: list[str]
    counts: dict[str, int]
    mu_needed: float | None
    excluded_faces: tuple[int, ...] = ()
    tip_radius: float = 0.0
    edge_clearance: float | None = None
    placement_error: float = 0.0
    tilt_error: float = 0.0
    friction_error: float = 0.0


def explain_sets(
    object_: GraspObject,
    *,
    method: Method = "enriched",
    edge_clearance: float | None = None,
    tip_radius: float | None = None,
    avoid_directions: Iterable[npt.ArrayLike] = (),
    exclude_faces: Iterable[int] = (),
    obstacles: Obstacles | None = None,
    placement_error: float | None = None,
    tilt_error: float | None = None,
    friction_error: float | None = None,
    com_error: float | None = None,
    progress: Progress | None = None,
) -> Explanation:
    """Evaluates every set of faces and says how it ended, by the steps of the paper.

    A set is certified if either the paper's steps or, with "enriched", the search beyond them finds
    a grasp that is proved: these are all sets that `plan_grasps` can certify.

        explanation = explain_sets(box, method="paper")
        print(explanation.counts)

    Args:
        object_: object to grasp, with the friction of its faces.
        method: "paper" follows the text alone, "enriched" also what `plan_grasps` does beyond it.
        edge_clearance: least distance of contacts from the edges of their faces [m] (default: 0.01
            of the object's diameter or a fifth of the face's inradius, whichever is less).
        tip_radius: radius of the spherical fingertips that must fit [m] (default: 0.02 of the
            diameter; 0: points).
        avoid_directions: vectors in B, shape (3,) each; no contact has an outward normal within 45
            degrees of one.
        exclude_faces: indices of faces without contacts.
        obstacles: solids beside the object that fingertips must not penetrate.
        placement_error: distance by which a contact may miss its place along its face, in any
            direction [m]. Contacts keep at least this distance from edges. The default of this and
            the next two is that of `plan_grasps`: sets that hold only without it are certified.
        tilt_error: angle by which the true normal at a contact may tilt [rad], 0 to 1.5.
        friction_error: share by which friction coefficients may be less, 0 to below 1.
            Grasps are planned with the friction that the worst tilt and coefficient leave; proofs
            have the model's.
        com_error: distance by which the centre of mass may be off, in any direction [m]. No set is
            rejected for it: it lowers only bounds of grasps.
        progress: called with the number of sets that are evaluated and the number of all.

    Returns:
        The sets of faces with their reasons.

    Raises:
        UsageError: when an argument has the wrong type or value.
    """
    tell = check_progress("progress", progress)
    options = PlanOptions(
        method=method,
        edge_clearance=edge_clearance,
        tip_radius=tip_radius,
        avoid_directions=avoid_directions,
        exclude_faces=exclude_faces,
        obstacles=obstacles,
        placement_error=placement_error,
        tilt_error=tilt_error,
        friction_error=friction_error,
        com_error=com_error,
    )
    requests = make_requests(object_, options)
    request, (sets, code) = requests[-1], _sets_and_codes(requests, tell)
    counts = request.counts(code)
    sets, code = request.with_excluded(sets, code)
    # A pair's third region, -1, becomes face -1.
    faces = np.append(request.every_face, -1)[sets]
    return Explanation(
        frozen(faces, np.int64),
        [REASONS[c] for c in code],
        counts,
        None if counts.get("certified") else request.mu_needed,
        request.excluded_faces,
        request.tip_radius,
        request.settings.fixed_clearance,
        request.settings.placement_error,
        request.settings.tilt_error,
        request.settings.friction_error,
    )


def _sets_and_codes(requests: Sequence[PlanRequest], tell: Progress) -> tuple[Ints, Codes]:
    """Returns all sets of the last request and how they ended: positions in REASONS."""
    *others, request = requests
    num_regions = len(request.regions.face)
    last = judge_each_set(request, None, tell)
    sets, code = last.work.plan.sets, last.set_codes()
    # The others have less friction and smaller regions, but points of their own: they matter where
    # a set may hold on which the last finds nothing.
    row = rows_in_all_sets(num_regions, sets)
    doubtful = np.zeros(len(sets), dtype=bool)
    doubtful[row] = ~np.isin(code, _SETTLED)
    if doubtful.any():
        judges = [judge_each_set(other, sets_inside(other, request, doubtful)) for other in others]
        holds = np.zeros(len(sets), dtype=bool)
        holds[rows_in_all_sets(num_regions, sets_held(judges, request.regions))] = True
        code[holds[row]] = CODE["certified"]
    return sets, code

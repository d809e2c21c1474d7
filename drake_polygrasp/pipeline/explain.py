"""Follows every set of faces to its end: proved, or the reason why not."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arrays import Ints, frozen
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.orientation import least_opposing_friction
from drake_polygrasp.paper.reasons import REASONS
from drake_polygrasp.pipeline.judge import Judge
from drake_polygrasp.pipeline.judging import all_candidates
from drake_polygrasp.pipeline.request import make_request
from drake_polygrasp.settings import Method, PlanOptions


@dataclass(frozen=True, eq=False)
class Explanation:
    """What became of every set of faces.

    Attributes:
        faces: faces of each set, ascending; -1 for a pair's third, shape (M, 3).
        reasons: one of reasons.REASONS each, never "not_evaluated".
        counts: how many sets ended with each reason.
        mu_needed: the friction above which some set would pass orientation; None where a grasp
            is certified.
        excluded_faces: faces whose every set is excluded, ascending.
        tip_radius: of the fingertips planned for [m].
        edge_clearance: least distance of contacts from edges that was asked for [m], or None.
    """

    faces: Ints
    reasons: list[str]
    counts: dict[str, int]
    mu_needed: float | None
    excluded_faces: tuple[int, ...] = ()
    tip_radius: float = 0.0
    edge_clearance: float | None = None


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

    Sets that only the search beyond the paper finds a grasp for are certified too: all that
    `plan_grasps` certifies, however many grasps it is asked for.
    """
    options = PlanOptions(
        method=method,
        edge_clearance=edge_clearance,
        tip_radius=tip_radius,
        avoid_directions=avoid_directions,
        exclude_faces=exclude_faces,
        obstacles=obstacles,
    )
    request = make_request(object_, options)
    judge = Judge(all_candidates(request))
    judge.judge(judge.open_rows)
    code = judge.set_codes()
    counts = request.counts(code)
    sets, code = request.with_excluded(judge.work.plan.sets, code)
    # A pair's third region, -1, becomes face -1.
    faces = np.append(request.every_face, -1)[sets]
    return Explanation(
        frozen(faces, np.int64),
        [REASONS[c] for c in code],
        counts,
        None if counts.get("certified") else least_opposing_friction(request.regions.nhat_TB_B),
        request.excluded_faces,
        request.tip_radius,
        edge_clearance,
    )

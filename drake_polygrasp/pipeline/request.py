"""What to plan for, checked: an object, and what is asked of contacts beyond that they hold."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arguments import check_choice, check_instance, check_length
from drake_polygrasp.arrays import Ints
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.body_identity import check_same_body
from drake_polygrasp.geometry.exclusion import Exclusion, exclusion
from drake_polygrasp.geometry.face_sets import all_sets, count_sets, find_rows
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.geometry.regions import (
    CLEARANCE_OF_INRADIUS,
    DEFAULT_CLEARANCE,
    Regions,
    erode,
)
from drake_polygrasp.geometry.surface_contact import effective_tip_radius
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.reasons import CODE, REASONS, UNJUDGED, Method, SetPlan
from drake_polygrasp.paper.stages import plan_sets
from drake_polygrasp.search.selection import Steps

Codes = npt.NDArray[np.int8]
TIP_RADIUS = 0.02
"""Default fingertip radius times the diameter L, ours."""
MOST_SETS = 20_000_000
"""Sets that are followed one by one at most, ours: some minutes and 2 GB; 490 regions have as
many."""


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """What to plan for, checked.

    Attributes:
        object_: what to grasp.
        method: "paper" or "enriched".
        every_face: the face of each region that erosion leaves, shape (n,).
        kept: those that are not excluded, shape (m,).
        regions: these, one row each.
        tip_radius: fingertips that must fit [m].
        exclusion: where no contact may be.
        obstacles: what fingertips must not penetrate beside the object.
        settings: what repeats it, for the grasp file.
    """

    object_: GraspObject
    method: Method
    every_face: Ints
    kept: Ints
    regions: Regions
    tip_radius: float
    exclusion: Exclusion
    obstacles: Obstacles | None
    settings: dict[str, Any]

    @property
    def num_sets(self) -> int:
        """Sets of three and of two regions, with those that have an excluded one."""
        return count_sets(len(self.every_face))

    @property
    def num_allowed_sets(self) -> int:
        """Those without an excluded region."""
        return count_sets(len(self.kept))

    @property
    def excluded_faces(self) -> tuple[int, ...]:
        """Faces whose every set is excluded, ascending."""
        return self.exclusion.excluded_faces(self.object_.polyhedron)

    def counts(self, code: Codes) -> dict[str, int]:
        """How many sets ended with each reason, by the codes of those that were evaluated."""
        counts = np.bincount(code, minlength=len(REASONS))
        counts[UNJUDGED] += self.num_allowed_sets - len(code)
        counts[CODE["excluded"]] += self.num_sets - self.num_allowed_sets
        return {reason: int(n) for reason, n in zip(REASONS, counts, strict=True) if n}

    def with_excluded(self, sets: Ints, code: Codes) -> tuple[Ints, Codes]:
        """Sets among `regions`, (M, 3), and their codes: the same for those of every region."""
        if len(self.kept) == len(self.every_face):
            return sets, code
        every = all_sets(len(self.every_face))
        codes = np.full(len(every), CODE["excluded"], dtype=np.int8)
        codes[find_rows(every, np.append(self.kept, -1)[sets])] = code
        return every, codes

    @property
    def every_set(self) -> Ints:
        """All sets of `regions`, shape (M, 3), -1 for a pair's third."""
        return all_sets(len(self.regions.face))

    def require_countable(self) -> None:
        """Raises UsageError when all sets are more than `MOST_SETS`."""
        if self.num_allowed_sets > MOST_SETS:
            raise UsageError(
                f"{self.num_allowed_sets:,} sets of faces are too many to follow one by one, which "
                f"is done up to {MOST_SETS:,}; the method 'enriched', ranked by epsilon, searches "
                "them without, unless its effort is 'complete'; else exclude faces or directions"
            )

    def plan(self, steps: Steps, chosen: Ints | None = None) -> SetPlan:
        """The paper's stages on all sets or on chosen ones.

        Raises UsageError when all are more than `MOST_SETS`.
        """
        if chosen is None:
            self.require_countable()
        L = self.object_.polyhedron.diameter
        return plan_sets(
            self.regions,
            self.object_.p_BBcm,
            L,
            self.object_.rho,
            self.method,
            spread=steps.spread,
            chosen=chosen,
        )


def make_request(
    object_: GraspObject,
    method: Method,
    edge_clearance: float | None,
    tip_radius: float | None,
    avoid_directions: Iterable[npt.ArrayLike],
    exclude_faces: Iterable[int],
    obstacles: Obstacles | None,
) -> PlanRequest:
    """The request that `plan_grasps` is given; see there.

    Raises UsageError when a parameter is not what it may be.
    """
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    check_choice("method", method, get_args(Method))
    if edge_clearance is not None:
        edge_clearance = check_length("edge_clearance", edge_clearance)
    if tip_radius is not None:
        tip_radius = check_length("tip_radius", tip_radius)
    if obstacles is not None:
        check_instance("obstacles", obstacles, Obstacles, "as obstacles_from_plant returns them")
        check_same_body("obstacles", obstacles.body, object_.body)
    L = object_.polyhedron.diameter
    tip = TIP_RADIUS * L if tip_radius is None else tip_radius
    settings: dict[str, Any] = {
        "method": method,
        "edge_clearance": DEFAULT_CLEARANCE * L if edge_clearance is None else edge_clearance,
        "tip_radius": tip,
    }
    if edge_clearance is None:
        settings["edge_clearance_share_of_inradius"] = CLEARANCE_OF_INRADIUS
    excluded = exclusion(object_.polyhedron, avoid_directions, exclude_faces)
    settings |= excluded.settings
    if obstacles is not None:
        width = 2 * effective_tip_radius(object_.polyhedron, tip)
        if width > obstacles.reach:
            raise UsageError(
                f"obstacles are known within {obstacles.reach:g} m of the object, and a fingertip "
                f"is {width:g} m wide; take them with a greater reach"
            )
        settings["obstacles"] = obstacles.names
    regions = erode(object_.polyhedron, edge_clearance)
    kept = ~excluded.avoids(regions.nhat_TB_B, regions.face)
    return PlanRequest(
        object_,
        method,
        regions.face,
        np.flatnonzero(kept),
        regions if kept.all() else regions.take(kept),
        tip,
        excluded,
        obstacles,
        settings,
    )

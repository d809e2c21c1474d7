"""What to plan for, checked: an object, and what is asked of contacts beyond that they hold."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from drake_polygrasp.arguments import check_instance
from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.body_identity import check_same_body
from drake_polygrasp.geometry.exclusion import Exclusion, require_faces
from drake_polygrasp.geometry.face_sets import all_sets, count_sets, rows_in_all_sets
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.regions import Regions, default_placement_errors, erode
from drake_polygrasp.geometry.surface_contact import effective_tip_radius
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.paper.orientation import least_opposing_friction
from drake_polygrasp.paper.reasons import CODE, REASONS, UNJUDGED, Codes, SetPlan
from drake_polygrasp.paper.stages import plan_sets
from drake_polygrasp.pipeline.friction_left import friction_left, friction_that_leaves
from drake_polygrasp.pipeline.region_certificates import Errors
from drake_polygrasp.settings import PlanOptions, PlanSettings, Steps

MOST_SETS = 20_000_000
"""Our choice: sets that are followed one by one at most, in some minutes and 2 GB; 490 regions have
as many."""


@dataclass(frozen=True, eq=False)
class PlanRequest:
    """What to plan for, checked.

    Attributes:
        object_: what to grasp.
        options: what is asked.
        settings: what repeats it on this object, for the grasp file.
        every_face: the face of each region that erosion leaves, shape (n,).
        kept: those that are not excluded, shape (m,).
        regions: these, one row each; their friction is what errors leave.
        mu_left: friction of each face that errors of tilt and friction leave, for search,
            improvement and filters, shape (F,). Proofs are of the model's.
        exclusion: where no contact may be.
        errors: errors that grasps are to bear; None where there are none.
    """

    object_: GraspObject
    options: PlanOptions
    settings: PlanSettings
    every_face: Ints
    kept: Ints
    regions: Regions
    mu_left: Array
    exclusion: Exclusion
    errors: Errors | None

    @property
    def tip_radius(self) -> float:
        """Radius of the fingertips that must fit [m]."""
        return self.settings.tip_radius

    @property
    def obstacles(self) -> Obstacles | None:
        """What fingertips must not penetrate beside the object."""
        return self.options.obstacles

    @property
    def steps(self) -> Steps:
        """The steps that are taken beyond the paper, where the method takes any."""
        return self.options.steps or Steps()

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

    @property
    def mu_needed(self) -> float | None:
        """Friction above which some set passes orientation for all errors; None if none does."""
        mu = least_opposing_friction(self.regions.nhat_TB_B)
        errors = self.settings.tilt_error, self.settings.friction_error
        return None if mu is None else friction_that_leaves(mu, *errors)

    def counts(self, code: Codes) -> dict[str, int]:
        """Counts the sets by the reasons with which they ended.

        Args:
            code: positions in REASONS of the sets that were evaluated, shape (M,).

        Returns:
            The number of sets of each reason that occurs; the rest are "not_evaluated" or
            "excluded".
        """
        counts = np.bincount(code, minlength=len(REASONS))
        counts[UNJUDGED] += self.num_allowed_sets - len(code)
        counts[CODE["excluded"]] += self.num_sets - self.num_allowed_sets
        return {reason: int(n) for reason, n in zip(REASONS, counts, strict=True) if n}

    def with_excluded(self, sets: Ints, code: Codes) -> tuple[Ints, Codes]:
        """Adds the sets that have an excluded region to all others.

        Args:
            sets: all sets among `regions`, shape (M, 3), -1 for a pair's third.
            code: their positions in REASONS, shape (M,).

        Returns:
            The sets among all regions that erosion leaves, and their positions in REASONS.
        """
        if len(self.kept) == len(self.every_face):
            return sets, code
        every = all_sets(len(self.every_face))
        codes = np.full(len(every), CODE["excluded"], dtype=np.int8)
        kept = np.append(self.kept, -1)[sets]  # a pair's third stays -1
        codes[rows_in_all_sets(len(self.every_face), kept)] = code
        return every, codes

    @property
    def every_set(self) -> Ints:
        """All sets of `regions`, shape (M, 3), -1 for a pair's third."""
        return all_sets(len(self.regions.face))

    def require_countable(self) -> None:
        """Refuses objects whose sets are too many to follow one by one.

        Raises:
            UsageError: when they are more than `MOST_SETS`.
        """
        if self.num_allowed_sets > MOST_SETS:
            raise UsageError(
                f"{self.num_allowed_sets:,} sets of faces are too many to follow one by one, which "
                f"is done up to {MOST_SETS:,}; exclude faces or directions. Plans of the method "
                "'enriched', ranked by epsilon, search them without, unless effort is 'complete'"
            )

    def plan(self, chosen: Ints | None = None) -> SetPlan:
        """Runs the paper's stages on all sets or on chosen ones.

        Args:
            chosen: sets among `regions`, shape (M, 3), -1 for a pair's third; None for all.

        Returns:
            The sets with their reasons and constructed contacts.

        Raises:
            UsageError: when all are asked for and are more than `MOST_SETS`.
        """
        if chosen is None:
            self.require_countable()
        L = self.object_.polyhedron.diameter
        return plan_sets(
            self.regions,
            self.object_.p_BBcm,
            L,
            self.object_.rho,
            self.options.method,
            spread=self.steps.spread,
            chosen=chosen,
        )


def make_request(
    object_: GraspObject, options: PlanOptions, *, on_narrow_faces: bool = False
) -> PlanRequest:
    """Resolves what is asked of a plan for an object.

    Args:
        object_: what to grasp.
        options: what is asked.
        on_narrow_faces: whether the default placement error is at most half of a face's inradius,
            so that narrow faces have contacts too.

    Returns:
        The request, with the regions of faces that contacts may use.

    Raises:
        UsageError: when an option is not what it may be for this object.
    """
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    polyhedron = object_.polyhedron
    settings = options.resolve(polyhedron.diameter, float(polyhedron.mu.max(initial=0.0)))
    settings = replace(settings, mu=object_.mu)
    require_faces(polyhedron, settings.exclude_faces)
    if options.obstacles is not None:
        check_same_body("obstacles", options.obstacles.body, object_.body)
        width = 2 * effective_tip_radius(polyhedron, settings.tip_radius)
        if width > options.obstacles.reach:
            raise UsageError(
                f"obstacles are known within {options.obstacles.reach:g} m of the object, and a "
                f"fingertip is {width:g} m wide; take them with a greater reach"
            )
    excluded = settings.exclusion
    placement = np.full(len(polyhedron.faces), settings.placement_error)
    if on_narrow_faces:
        placement = placement_errors(polyhedron, settings)
    regions = erode(polyhedron, settings.fixed_clearance, least_clearance=placement)
    kept = ~excluded.avoids(regions.nhat_TB_B, regions.face)
    mu_left = friction_left(polyhedron.mu, settings.tilt_error, settings.friction_error)
    regions = replace(regions, mu=frozen(mu_left[regions.face]))
    return PlanRequest(
        object_,
        options,
        settings,
        regions.face,
        np.flatnonzero(kept),
        regions if kept.all() else regions.take(kept),
        mu_left,
        excluded,
        Errors(frozen(placement), settings.tilt_error, settings.friction_error, settings.com_error)
        if settings.has_errors
        else None,
    )


def placement_errors(polyhedron: Polyhedron, settings: PlanSettings) -> Array:
    """Returns by how much a contact on each face may miss, at most half of a narrow one's inradius.

    Args:
        polyhedron: the object's surface.
        settings: those of a plan.

    Returns:
        [m], shape (F,).
    """
    if settings.placement_error_share_of_inradius is not None:
        return default_placement_errors(polyhedron)
    return np.full(len(polyhedron.faces), settings.placement_error)

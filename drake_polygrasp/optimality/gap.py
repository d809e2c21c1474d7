"""How near a plan's best grasp is to the best possible one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arguments import Progress, check_count, check_instance, check_progress
from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.certification.certify import prove_many
from drake_polygrasp.certification.robustness import epsilon_interval
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.regions import Regions, erode
from drake_polygrasp.geometry.surface_contact import fingertip_fits, fingertips_are_apart
from drake_polygrasp.grasp import GraspObject, Verdict
from drake_polygrasp.optimality.branch_and_bound import Optimum, bound_optimum
from drake_polygrasp.pipeline.plan import GraspPlan
from drake_polygrasp.pipeline.request import placement_errors
from drake_polygrasp.search.fingertip_room import with_tip_room
from drake_polygrasp.search.triples import Triples

NODES = 100_000
"""Our choice: about a minute."""
_RELATIVE_GAP = 1e-3
"""Our choice: relative width of the interval of epsilon that the bound is compared with."""


@dataclass(frozen=True, eq=False)
class BetterGrasp:
    """A grasp of greater epsilon than any of a plan's: proved, and with room for fingertips.

    Attributes:
        faces: faces of its contacts, ascending.
        p_BC: contact points expressed in B [m], shape (3, 3).
        epsilon: a lower bound of its epsilon.
    """

    faces: tuple[int, int, int]
    p_BC: Array
    epsilon: float


@dataclass(frozen=True, eq=False)
class OptimalityGap:
    """An upper bound of epsilon over all grasps, and how far a plan is below it.

    Attributes:
        epsilon_bound: no three contacts on the plan's regions have a greater epsilon.
        epsilon: a lower bound of epsilon of the plan's best grasp, 0 where there is none.
        rank: rank of that grasp in the plan, from 1; 0 where there is none.
        nodes: number of triples of pieces of faces bounded.
        complete: whether the search ended by itself, so that more nodes would not lower the bound.
        better: a better grasp found on the way, which is not in the plan; None where none was.
    """

    epsilon_bound: float
    epsilon: float
    rank: int
    nodes: int
    complete: bool
    better: BetterGrasp | None

    @property
    def relative_gap(self) -> float | None:
        """Share by which the bound exceeds the plan's best epsilon; None without a grasp."""
        return self.epsilon_bound / self.epsilon - 1.0 if self.epsilon else None


def epsilon_gap(
    object_: GraspObject,
    plan: GraspPlan,
    *,
    nodes: int = NODES,
    progress: Progress | None = None,
) -> OptimalityGap:
    """Bounds epsilon over all contacts that keep the plan's distance from edges.

    The bound ignores fingertips and obstacles; as these only exclude grasps, it holds with them
    too. It is computed in floating point, and takes as planes faces of a mesh that are flat to
    `FLATNESS`.

    Args:
        object_: the object that was planned for.
        plan: its plan, from `plan_grasps`.
        nodes: greatest number of triples of pieces of faces to bound; the same number gives the
            same result.
        progress: called with the number bounded so far, and `nodes`.

    Returns:
        The bound, how far the plan's best grasp is below it, and a better grasp if one was found.

    Raises:
        UsageError: when nodes is less than 1, or the body has patches of a curved or noisy
            surface, whose contacts leave the planes that the bound is for.
    """
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    check_instance("plan", plan, GraspPlan, "as plan_grasps returns it")
    nodes = check_count("nodes", nodes)
    tell = check_progress("progress", progress)
    require_planar(object_)
    regions = _regions(object_, plan)
    scale = object_.p_BBcm, object_.rho
    best, epsilon = 0, 0.0
    for rank, certified in enumerate(plan.grasps, start=1):
        grasp = certified.grasp
        if certified.certificate.epsilon_upper > epsilon:
            contacts = grasp.p_BC, grasp.nhat_TB_B, grasp.mu
            lower = epsilon_interval(*contacts, *scale, relative_gap=_RELATIVE_GAP).lower
            best, epsilon = (rank, lower) if lower > epsilon else (best, epsilon)
    tip_radius = plan.settings.tip_radius
    roomy = with_tip_room(regions, object_.polyhedron, tip_radius)
    optimum = bound_optimum(regions, *scale, _known(regions, plan), epsilon, nodes, roomy, tell)
    # Obstacles are not part of the plan's settings, only their names.
    obstructed = plan.settings.obstacles is not None
    better = None if obstructed else _better(object_, regions, optimum, epsilon, tip_radius)
    bound = max(optimum.bound, epsilon)
    return OptimalityGap(bound, epsilon, best, optimum.nodes, optimum.complete, better)


def require_planar(object_: GraspObject) -> None:
    """Checks that the body has planar faces only.

    Args:
        object_: the object to grasp.

    Raises:
        UsageError: when the body has patches of a curved or noisy surface.
    """
    if object_.polyhedron.is_patch.any():
        raise UsageError(
            "the bound of epsilon is for planar faces, and this body has patches of a curved or "
            "noisy surface; simplify the body, or leave the gap out"
        )


def _regions(object_: GraspObject, plan: GraspPlan) -> Regions:
    settings = plan.settings
    placement = placement_errors(object_.polyhedron, settings)
    regions = erode(object_.polyhedron, settings.fixed_clearance, least_clearance=placement)
    excluded = plan.settings.exclusion.avoids(regions.nhat_TB_B, regions.face)
    return regions.take(~excluded)


def _known(regions: Regions, plan: GraspPlan) -> Triples:
    """Returns the plan's grasps, each contact on the first region of its face.

    Regions of one face share its plane, and that is all that is used.
    """
    faces = np.array([certified.grasp.faces for certified in plan.grasps], dtype=np.int64)
    p_BC = np.array([certified.grasp.p_BC for certified in plan.grasps])
    region: Ints = np.searchsorted(regions.face, faces.reshape(-1, 3))
    return Triples(region, p_BC.reshape(-1, 3, 3))


def _better(
    object_: GraspObject, regions: Regions, optimum: Optimum, epsilon: float, tip_radius: float
) -> BetterGrasp | None:
    """Returns the best grasp found on the way, if it is proved, has room, and is better."""
    for region, p_BC in zip(optimum.best.region, optimum.best.p_BC, strict=True):
        contacts = p_BC, regions.nhat_TB_B[region], regions.mu[region]
        lower = epsilon_interval(*contacts, object_.p_BBcm, object_.rho).lower
        (proof,) = prove_many(*(values[None] for values in contacts))
        fits = fingertip_fits(object_.polyhedron, *contacts[:2], tip_radius).all()
        p, nhat = p_BC[None], regions.nhat_TB_B[region][None]
        apart = fingertips_are_apart(object_.polyhedron, p, nhat, tip_radius)
        if lower > epsilon and proof.verdict is Verdict.HOLDS and fits and apart[0]:
            a, b, c = regions.face[region].tolist()
            return BetterGrasp((a, b, c), frozen(p_BC), lower)
    return None

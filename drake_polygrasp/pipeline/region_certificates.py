"""Certifies the errors that a grasp bears: of contacts, normals, friction and centre of mass."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arguments import check_instance
from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.certification.contact_regions import CertifiedRegions, certify_regions
from drake_polygrasp.certification.region_search import RegionClaim, find_common_forces
from drake_polygrasp.digits import at_most
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.landing_points import landing_points
from drake_polygrasp.geometry.placement_regions import regions_of_grasps
from drake_polygrasp.geometry.surface_pieces import SurfacePiece
from drake_polygrasp.grasp import (
    AnyGrasp,
    CertifiedGrasp,
    Grasp,
    GraspObject,
    RegionCertificate,
    grasp_of,
)
from drake_polygrasp.region_bounds.region_epsilon import RegionEpsilon, greatest_epsilons
from drake_polygrasp.region_bounds.region_task import BOUNDS_GAP, RegionTask
from drake_polygrasp.settings import ERROR_NAMES, check_errors


@dataclass(frozen=True, eq=False)
class Errors:
    """Errors that a grasp is to bear at once.

    Attributes:
        placement: how far a contact on each face may be off in its tangent plane [m], shape (F,).
        tilt: angle by which a normal may differ from the surface's [rad].
        friction: share by which friction coefficients may be less.
        com: how far the centre of mass may be off [m].
    """

    placement: Array
    tilt: float
    friction: float
    com: float

    def on(self, face: Ints) -> tuple[float, ...]:
        """Returns the errors of a grasp on faces: three placements, tilt, friction and com.

        Args:
            face: indices of the faces of its contacts, shape (3,).
        """
        return *self.placement[face].tolist(), self.tilt, self.friction, self.com

    def with_less(self, names: Collection[str], share: float) -> Errors:
        """Returns the errors, some of them times a share.

        Args:
            names: those of `ERROR_NAMES` that become less.
            share: factor, 0 to 1.
        """
        factor = {name: share if name in names else 1.0 for name in ERROR_NAMES}
        placement, tilt, friction, com = factor.values()
        return Errors(
            frozen(self.placement * placement),
            self.tilt * tilt,
            self.friction * friction,
            self.com * com,
        )


def least_epsilon(grasp: CertifiedGrasp) -> float:
    """Returns the lower bound of epsilon under the errors that a grasp bears.

    Args:
        grasp: the grasp; without a `region`, for exact contacts.
    """
    region = grasp.region
    return grasp.certificate.epsilon_lower if region is None else region.epsilon_lower or 0.0


def certify_region(
    object_: GraspObject,
    grasp: AnyGrasp,
    *,
    placement_error: float = 0.0,
    tilt_error: float = 0.0,
    friction_error: float = 0.0,
    com_error: float = 0.0,
) -> RegionCertificate | None:
    """Proves that a grasp stays force closure under errors of several kinds, all at once.

        best = plan_grasps(box, edge_clearance=0.005).grasps[0]
        region = certify_region(box, best, placement_error=0.005, tilt_error=0.05)
        print(region.epsilon_lower if region else "not proved")

    The errors are of place, tilt, friction and centre of mass. `Certificate` has tolerances of one
    kind of error at a time.

    Args:
        object_: object that is grasped.
        grasp: grasp of it, alone or with its certificate.
        placement_error: by how much each contact may be off in its tangent plane, in any direction
            [m].
        tilt_error: angle by which each normal may differ from the surface's [rad], from 0 to 1.5.
        friction_error: share by which friction coefficients may be less, from 0 to below 1.
        com_error: by how much the centre of mass may be off, in any direction [m].

    Returns:
        The certificate, which a grasp carries as `CertifiedGrasp.region` and a grasp file states;
        None if a fingertip that misses may touch nothing, or another part than the contact's
        surface, or if no internal force is found that proves all placements.

    Raises:
        UsageError: if an argument is not what it must be.
    """
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    contacts = grasp_of(grasp)
    num_faces = len(object_.polyhedron.faces)
    if not max(contacts.faces) < num_faces:
        raise UsageError(
            f"the grasp is on face {max(contacts.faces)}, and the object has {num_faces} faces "
            "from 0; give the object that it was planned on"
        )
    errors = check_errors(
        placement_error=placement_error,
        tilt_error=tilt_error,
        friction_error=friction_error,
        com_error=com_error,
    )
    placement, tilt, friction, com = errors.values()
    return certify_errors(
        object_, contacts, Errors(frozen(np.full(num_faces, placement)), tilt, friction, com)
    )


def certify_errors(object_: GraspObject, grasp: Grasp, errors: Errors) -> RegionCertificate | None:
    """Proves that a grasp bears errors, and bounds epsilon and squeeze force under them.

    Args:
        object_: what is grasped.
        grasp: three contacts on its surface.
        errors: what may happen at once.

    Returns:
        The certificate; None where contacts may touch what they must not, or no internal force
        proves all placements.
    """
    (proved,) = prove_errors(object_, [(grasp, errors)])
    return None if proved is None else bound_errors(object_, [(grasp, proved)], [-math.inf], 1)[0]


@dataclass(frozen=True, eq=False)
class ProvedErrors:
    """Errors that a grasp bears, with the proof.

    Attributes:
        errors: what may happen at once.
        pieces: for each contact, the surface that it may touch.
        regions: the internal force that proves all placements.
    """

    errors: Errors
    pieces: tuple[tuple[SurfacePiece, ...], ...]
    regions: CertifiedRegions


def prove_errors(
    object_: GraspObject, grasps: Sequence[tuple[Grasp, Errors]]
) -> list[ProvedErrors | None]:
    """Proves that grasps stay force closure under errors.

    Args:
        object_: what is grasped.
        grasps: three contacts on its surface each, and what may happen at once.

    Returns:
        The proof of each; None where contacts may touch what they must not, or no internal force
        proves all placements.
    """
    proved: list[ProvedErrors | None] = [None] * len(grasps)
    tried = _held_at_points(object_, grasps)
    if not tried:
        return proved
    regions = regions_of_grasps(object_.polyhedron, *_contacts([grasps[k] for k in tried]))
    held = [(k, pieces) for k, pieces in zip(tried, regions, strict=True) if pieces is not None]
    claims = [_claim(*grasps[k], pieces) for k, pieces in held]
    for (k, pieces), certified in zip(held, certify_regions(claims), strict=True):
        if certified is not None:
            proved[k] = ProvedErrors(grasps[k][1], pieces, certified)
    return proved


def _held_at_points(object_: GraspObject, grasps: Sequence[tuple[Grasp, Errors]]) -> list[int]:
    """Returns the grasps that an internal force holds at a few points where fingertips may land.

    No internal force holds the others in their regions either, which take far longer to find.
    """
    on_patches = object_.polyhedron.is_patch
    asked = [k for k, (grasp, _) in enumerate(grasps) if on_patches[list(grasp.faces)].any()]
    if not asked:
        return list(range(len(grasps)))
    p_BC, nhat_TB_B, face, radius = _contacts([grasps[k] for k in asked])
    points, normals = landing_points(
        object_.polyhedron,
        p_BC.reshape(-1, 3),
        nhat_TB_B.reshape(-1, 3),
        face.ravel(),
        radius.ravel(),
    )
    pieces = [
        tuple(SurfacePiece(p[None], nhat) for p, nhat in zip(*each, strict=True))
        for each in zip(points, normals, strict=True)
    ]
    claims = [_claim(*grasps[k], pieces[3 * n : 3 * n + 3]) for n, k in enumerate(asked)]
    found = find_common_forces(claims)
    lost = {k for k, force in zip(asked, found, strict=True) if force is None}
    return [k for k in range(len(grasps)) if k not in lost]


def _claim(
    grasp: Grasp, errors: Errors, regions: Sequence[tuple[SurfacePiece, ...]]
) -> RegionClaim:
    """Returns what is to be proved of a grasp whose contacts may be in regions."""
    contacts = grasp.p_BC, grasp.nhat_TB_B, grasp.mu
    radius = _radii(grasp, errors)
    return RegionClaim(*contacts, regions, np.array(radius), errors.tilt, errors.friction)


def _contacts(grasps: Sequence[tuple[Grasp, Errors]]) -> tuple[Array, Array, Ints, Array]:
    """Returns points, normals, faces and placement errors of contacts, with rows for grasps."""
    return (
        np.stack([grasp.p_BC for grasp, _ in grasps]),
        np.stack([grasp.nhat_TB_B for grasp, _ in grasps]),
        np.array([grasp.faces for grasp, _ in grasps]),
        np.array([_radii(*each) for each in grasps]),
    )


def _radii(grasp: Grasp, errors: Errors) -> list[float]:
    """Returns the placement errors of the three contacts, as a file states them [m]."""
    return [at_most(r) for r in errors.placement[list(grasp.faces)].tolist()]


def bound_errors(
    object_: GraspObject,
    grasps: Sequence[tuple[Grasp, ProvedErrors]],
    least: Sequence[float],
    wanted: int,
    relative_gap: float = BOUNDS_GAP,
) -> list[RegionCertificate | None]:
    """Bounds epsilon and squeeze force under errors that grasps bear.

    Args:
        object_: what is grasped.
        grasps: grasps of it, each with the errors and their proof.
        least: what the lower bound of epsilon of each must be at least; minus infinity for any.
        wanted: how many grasps are asked for, those of greatest lower bounds.
        relative_gap: how far apart the bounds of epsilon may stay, over the upper one.

    Returns:
        The certificate of each; None for those below `least`, and for some of those that are not
        among the best `wanted`.
    """
    tasks = [
        RegionTask(
            proved.pieces,
            grasp.mu,
            object_.p_BBcm,
            object_.rho,
            object_.mass,
            proved.errors.tilt,
            proved.errors.friction,
            proved.errors.com,
            relative_gap,
        )
        for grasp, proved in grasps
    ]
    return [
        None if bounds is None else _certificate(proved, bounds)
        for (_, proved), bounds in zip(grasps, greatest_epsilons(tasks, least, wanted), strict=True)
    ]


def _certificate(proved: ProvedErrors, bounds: RegionEpsilon) -> RegionCertificate:
    return RegionCertificate(
        placement_error=proved.regions.placement_error,
        tilt_error=proved.errors.tilt,
        friction_error=proved.errors.friction,
        com_error=proved.errors.com,
        internal_force=proved.regions.internal_force,
        pieces=proved.pieces,
        epsilon_lower=bounds.epsilon_lower,
        epsilon_upper=bounds.epsilon_upper,
        squeeze_force=bounds.squeeze_force,
    )

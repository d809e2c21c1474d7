"""Certifies the errors that a grasp bears: of contacts, normals, friction and centre of mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.contact_regions import certify_regions
from drake_polygrasp.digits import at_most
from drake_polygrasp.geometry.placement_regions import placement_region
from drake_polygrasp.grasp import Grasp, GraspObject, RegionCertificate


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

    def scaled(self, share: float) -> Errors:
        """Returns a share of all errors."""
        return Errors(
            frozen(self.placement * share),
            self.tilt * share,
            self.friction * share,
            self.com * share,
        )


def certify_errors(object_: GraspObject, grasp: Grasp, errors: Errors) -> RegionCertificate | None:
    """Proves that a grasp bears errors.

    Args:
        object_: what is grasped.
        grasp: three contacts on its surface.
        errors: what may happen at once.

    Returns:
        The certificate; None where contacts may touch what they must not, or no internal force
        proves all placements.
    """
    radii = [at_most(r) for r in errors.placement[list(grasp.faces)].tolist()]
    pieces = []
    for p_BC, nhat_TB_B, face, radius in zip(
        grasp.p_BC, grasp.nhat_TB_B, grasp.faces, radii, strict=True
    ):
        region = placement_region(object_.polyhedron, p_BC, nhat_TB_B, face, radius)
        if not region.pieces:
            return None
        pieces.append(region.pieces)
    proved = certify_regions(
        grasp.p_BC,
        grasp.nhat_TB_B,
        grasp.mu,
        pieces,
        placement_error=np.array(radii),
        tilt_error=errors.tilt,
        friction_error=errors.friction,
    )
    if proved is None:
        return None
    return RegionCertificate(
        placement_error=proved.placement_error,
        tilt_error=errors.tilt,
        friction_error=errors.friction,
        com_error=errors.com,
        internal_force=proved.internal_force,
        pieces=tuple(pieces),
    )

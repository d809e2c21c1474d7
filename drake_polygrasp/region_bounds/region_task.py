"""States a grasp and the errors under which its bounds are sought."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.region_pieces import RegionPiece
from drake_polygrasp.grasp import Grasp, RegionCertificate

BOUNDS_GAP = 0.02
"""Our choice: how far apart the bounds of epsilon may stay, over the upper one."""
QUICK_GAP = 0.05
"""Our choice: the same for quick plans."""
SQUEEZE_GAP = 0.1
"""Our choice: how far the squeeze force may be above the least that is known to be needed. Fingers
squeeze harder than by a tenth more, and a closer bound takes as long as that of epsilon."""


@dataclass(frozen=True, eq=False)
class RegionTask:
    """A grasp whose bounds are sought, with what may be off at once.

    Attributes:
        regions: the pieces on one of which each contact is; on an edge between two it has the
            normal of one of them, but for the tilt.
        mu: friction coefficients, shape (3,).
        p_BBcm: centre of mass [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        mass: of the body [kg]; None where it is unknown.
        tilt_error: angle by which normals may differ from the surface's [rad].
        friction_error: share by which friction coefficients may be less.
        com_error: how far the centre of mass may be off [m].
        relative_gap: how far apart the bounds of epsilon may stay, over the upper one.
        squeeze_gap: how far the squeeze force may be above the least that is needed, relative.
        way: index of the way in which bounds are sought, below `region_epsilon.NUM_WAYS`; 0 is the
            usual one.
    """

    regions: Sequence[Sequence[RegionPiece]]
    mu: Array
    p_BBcm: Array
    rho: float
    mass: float | None = None
    tilt_error: float = 0.0
    friction_error: float = 0.0
    com_error: float = 0.0
    relative_gap: float = BOUNDS_GAP
    squeeze_gap: float = SQUEEZE_GAP
    way: int = 0


def task_of(
    region: RegionCertificate, grasp: Grasp, p_BBcm: Array, rho: float, mass: float | None
) -> RegionTask:
    """Returns the task of a grasp with the errors that it is certified to bear.

    Args:
        region: the errors, and the surface that contacts may touch.
        grasp: the grasp.
        p_BBcm: centre of mass of the object [m], shape (3,).
        rho: greatest distance from the centre of mass to the surface [m].
        mass: of the object [kg]; None where it is unknown.
    """
    errors = region.tilt_error, region.friction_error, region.com_error
    return RegionTask(region.pieces, grasp.mu, p_BBcm, rho, mass, *errors)

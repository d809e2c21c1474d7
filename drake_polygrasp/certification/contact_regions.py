"""Certifies that one internal force proves force closure for all placements in three regions.

Only what `exact.check_region` accepts is returned; `region_search` finds what it is asked about.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.region_pieces import RegionPiece, check_pieces
from drake_polygrasp.certification.region_search import RegionClaim, find_common_forces
from drake_polygrasp.digits import EXACT, at_most, on_grid
from drake_polygrasp.vectors import circle, times
from drake_polygrasp.wrenches.contacts import contact_frames

_NUM_CORNERS = 24
"""Our choice: corners of the polygon around a disc, which are then 1 percent outside it."""
_SHRINK = (0.9995, 0.998, 0.995, 0.99, 0.98, 0.95)
"""Our choice: fractions of the computed radius that are tried in turn."""


@dataclass(frozen=True, eq=False)
class DiscPolygon:
    """A polygon around a disc in a planar face.

    Attributes:
        p_BV: corners, counter-clockwise about the normal [m], shape (n, 3).
        nhat_TB_B: inward unit normal, shape (3,).
        tan_spread: 0, because the face is planar.
    """

    p_BV: Array
    nhat_TB_B: Array
    tan_spread: float = 0.0


@dataclass(frozen=True, eq=False)
class CertifiedRegions:
    """A proof that a grasp is force closure for all placements of its contacts in three regions.

    Attributes:
        internal_force: x_12, x_13, x_23 [1/m], shape (3,), one for all placements.
        regions: for each contact the pieces whose union it may be in.
        placement_error: distance by which each contact may be off [m], shape (3,), for which its
            region was made.
        tilt_error: greatest angle between normals and the surface's [rad].
        friction_error: greatest relative loss of friction coefficients.
    """

    internal_force: Array
    regions: tuple[tuple[RegionPiece, ...], ...]
    placement_error: Array
    tilt_error: float
    friction_error: float


def certify_regions(claims: Sequence[RegionClaim]) -> list[CertifiedRegions | None]:
    """Proves grasps for all placements of their contacts in given regions.

    Args:
        claims: the contacts of each grasp, their regions and what else may be off.

    Returns:
        The certificate of each grasp, exactly checked; None if no x is found that passes.
    """
    found = find_common_forces(claims)
    return [
        None if best is None else _checked(claim, best[0])
        for claim, best in zip(claims, found, strict=True)
    ]


def _checked(claim: RegionClaim, x: Array) -> CertifiedRegions | None:
    """Returns the certificate if x passes the exact check."""
    errors = claim.tilt_error, claim.friction_error
    if not check_pieces(claim.regions, claim.mu, x, *errors).ok:
        return None
    kept = tuple(tuple(region) for region in claim.regions)
    return CertifiedRegions(x, kept, frozen(claim.placement_error), *errors)


def largest_certified_radius(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    radii: Array,
    *,
    size: float,
    tilt_error: float = 0.0,
    friction_error: float = 0.0,
) -> CertifiedRegions | None:
    """Proves a grasp for the largest discs about contacts on planar faces, in given proportions.

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, shape (3,).
        radii: greatest useful radii [m], positive, shape (3,); all are scaled by one factor.
        size: diameter of the object [m]; corners keep twelve digits of it.
        tilt_error: greatest angle between normals and the surface's [rad].
        friction_error: greatest relative loss of friction coefficients.

    Returns:
        The certificate, exactly checked, with the proved radii as its placement error; None if no x
        is found that passes.
    """
    discs = _discs(p_BC, nhat_TB_B, radii, size)
    claim = RegionClaim(p_BC, nhat_TB_B, mu, discs, radii, tilt_error, friction_error)
    (found,) = find_common_forces([claim], as_scale=True)
    if found is None:
        return None
    x, scale = found
    for part in _SHRINK:
        reached = np.array([at_most(min(part * scale, 1.0) * r) for r in radii.tolist()])
        discs = _discs(p_BC, nhat_TB_B, reached, size)
        smaller = replace(claim, regions=discs, placement_error=reached)
        if (proved := _checked(smaller, x)) is not None:
            return proved
    return None


def _discs(
    p_BC: Array, nhat_TB_B: Array, radii: Array, size: float
) -> tuple[tuple[RegionPiece, ...], ...]:
    frames = contact_frames(p_BC[None], nhat_TB_B[None])[0]
    ring = circle(2 * np.pi * np.arange(_NUM_CORNERS) / _NUM_CORNERS) / np.cos(np.pi / _NUM_CORNERS)
    # Wider by more than the rounding of the corners.
    widths = radii * (1 + 1e-9) + size * 1e-11
    return tuple(
        (DiscPolygon(frozen(on_grid(p + w * times(ring, frame[1:]), size, EXACT)), frozen(n)),)
        for p, n, w, frame in zip(p_BC, nhat_TB_B, widths, frames, strict=True)
    )

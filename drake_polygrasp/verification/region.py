"""Whether a grasp's region is proved by its internal force, and covers what contacts may touch."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import shapely
from pydrake.geometry.optimization import VPolytope

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.certification import exact
from drake_polygrasp.certification.region_pieces import check_pieces
from drake_polygrasp.files.stated_grasp import StatedGrasp, StatedObject
from drake_polygrasp.geometry.placement_regions import placement_region
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.surface_contact import LocatedContacts
from drake_polygrasp.geometry.surface_pieces import SurfacePiece
from drake_polygrasp.geometry.tolerances import ANGLE_TOLERANCE, LENGTH_TOLERANCE
from drake_polygrasp.geometry.triangles import face_frame
from drake_polygrasp.grasp import RegionCertificate
from drake_polygrasp.region_bounds.region_epsilon import NUM_WAYS, RegionEpsilon, region_epsilons
from drake_polygrasp.region_bounds.region_task import BOUNDS_GAP, QUICK_GAP, SQUEEZE_GAP, task_of
from drake_polygrasp.vectors import cross, dot, times

_SEARCHES = (
    *((BOUNDS_GAP, SQUEEZE_GAP, 0), (QUICK_GAP, SQUEEZE_GAP, 0), (0.01, 0.02, 0)),
    *((0.004, 0.004, way) for way in range(NUM_WAYS)),
)
"""Our choice: relative gaps to which epsilon and squeeze force are bounded, and the ways. Where the
usual search does not bear a number out another may, for versions differ in the bounds they find."""
_ROUNDING = 1e-6
"""Our choice, relative: what processors change in bounds of six digits."""
_UPPER_SLACK = 0.1
"""Our choice, relative: upper bounds are of the worst placement that a search finds, and a search
for closer bounds may find one that is less bad."""
_Pieces = tuple[tuple[SurfacePiece, ...], ...]


def region_violations(stated: StatedGrasp) -> Iterator[str]:
    """Yields why a file's numbers do not prove the region that it states.

    Args:
        stated: a grasp, with a region or without.

    Yields:
        One message for each violated claim.
    """
    region, grasp = stated.region, stated.grasp
    if region is None:
        return
    check = _check_claim(region, region.pieces, grasp.mu)
    if not check.ok:
        yield f"the region is not proved: {check.reason}"
    size = float(np.ptp(grasp.p_BC, axis=0).max())
    for i, pieces in enumerate(region.pieces):
        if len(pieces) == 1 and not pieces[0].tan_spread:
            corners, normal = pieces[0].p_BV.tolist(), pieces[0].nhat_TB_B.tolist()
            disc = grasp.p_BC[i].tolist(), normal, float(region.placement_error[i])
            if not (check := exact.contains_disc(corners, *disc, size)).ok:
                yield f"the region of contact {i + 1} does not hold its disc: {check.reason}"


def _check_claim(region: RegionCertificate, pieces: _Pieces, mu: Array) -> exact.Check:
    """Checks exactly that a region's internal force proves force closure on given pieces."""
    errors = region.tilt_error, region.friction_error
    return check_pieces(pieces, mu, region.internal_force, *errors)


def region_number_violations(
    grasps: Sequence[StatedGrasp], object_: StatedObject
) -> list[list[str]]:
    """Finds the bounds under errors that are stated more favourably than they are recomputed.

    Args:
        grasps: whose regions are proved, or that have none.
        object_: their object, whose mass, centre of mass and rho count.

    Returns:
        For each grasp one message for each violated claim.
    """
    violations: list[list[str]] = [[] for _ in grasps]
    left = [(k, region) for k, g in enumerate(grasps) if (region := g.region) and _states(region)]
    body = object_.p_BBcm, object_.rho, object_.mass
    known: dict[int, RegionEpsilon] = {}
    usual = {k: task_of(region, grasps[k].grasp, *body) for k, region in left}
    for gap, squeeze_gap, way in _SEARCHES:
        tasks = [
            replace(usual[k], relative_gap=gap, squeeze_gap=squeeze_gap, way=way) for k, _ in left
        ]
        for (k, region), found in zip(left, region_epsilons(tasks), strict=True):
            known[k] = _together(known.get(k, found), found)
            violations[k] = list(_bound_violations(region, known[k]))
        left = [(k, region) for k, region in left if violations[k]]
    return violations


def _together(one: RegionEpsilon, other: RegionEpsilon) -> RegionEpsilon:
    """Returns the most favourable bounds of two searches; all of them are proved."""
    squeezes = [s for s in (one.squeeze_force, other.squeeze_force) if s is not None]
    return replace(
        other,
        epsilon_lower=max(one.epsilon_lower, other.epsilon_lower),
        epsilon_upper=max(one.epsilon_upper, other.epsilon_upper),
        squeeze_force=min(squeezes, default=None),
    )


def _states(region: RegionCertificate) -> bool:
    """Whether a region states any bound."""
    bounds = region.epsilon_lower, region.epsilon_upper, region.squeeze_force
    return any(bound is not None for bound in bounds)


def _bound_violations(region: RegionCertificate, found: RegionEpsilon) -> Iterator[str]:
    lower, upper, squeeze = region.epsilon_lower, region.epsilon_upper, region.squeeze_force
    if lower is not None and not lower <= found.epsilon_lower * (1 + _ROUNDING):
        yield f"region.epsilon_lower is {lower:.6g}, more than the {found.epsilon_lower:.6g} found"
    if upper is not None and not upper >= found.epsilon_lower * (1 - _ROUNDING):
        yield f"region.epsilon_upper is {upper:.6g}, less than the {found.epsilon_lower:.6g} found"
    if upper is not None and not upper <= found.epsilon_upper * (1 + _UPPER_SLACK) + _ROUNDING:
        yield f"region.epsilon_upper is {upper:.6g}, more than the {found.epsilon_upper:.6g} found"
    if squeeze is not None and found.squeeze_force is None:
        yield f"region.squeeze_force is {squeeze:.6g}, and none is found that holds the weight"
    elif squeeze is not None and not squeeze >= (least := found.squeeze_force or 0.0) * (
        1 - _ROUNDING
    ):
        yield f"region.squeeze_force is {squeeze:.6g}, less than the {least:.6g} found"


def region_surface_violations(
    stated: StatedGrasp, polyhedron: Polyhedron, touched: LocatedContacts
) -> Iterator[str]:
    """Yields where contacts may touch other surface than the region that a file states.

    The surface is sought around the contacts as stated, as planners do, and then around those that
    are found. The two differ by rounding errors, but where parts cross at very small angles, the
    lines in which they cross differ by much more.

    Args:
        stated: a grasp, with a region or without.
        polyhedron: the model's surface.
        touched: its contacts, as they are found there.

    Yields:
        One message for each violated claim.
    """
    region, grasp = stated.region, stated.grasp
    if region is None:
        return
    violation = ""
    for contacts in ((grasp.p_BC, grasp.nhat_TB_B), (touched.p_BC, touched.nhat_TB_B)):
        violation = _surface_violation(region, grasp.mu, polyhedron, touched.face, *contacts)
        if not violation:
            return
    yield violation


def _surface_violation(
    region: RegionCertificate,
    mu: Array,
    polyhedron: Polyhedron,
    face: Ints,
    p_BC: Array,
    nhat_TB_B: Array,
) -> str:
    """Returns which surface around three contacts a region lacks, or why that proves no closure."""
    found = []
    for i, (k, radius) in enumerate(zip(face, region.placement_error, strict=True)):
        around = placement_region(polyhedron, p_BC[i], nhat_TB_B[i], int(k), float(radius))
        if not around.pieces:
            return f"contact {i + 1} may not miss by {radius:.6g} m: {around.reason}"
        found.append(around.pieces)
        for piece in around.pieces:
            if not any(_holds(held, piece, polyhedron.diameter) for held in region.pieces[i]):
                return (
                    f"the region of contact {i + 1} lacks a part of the surface that it may touch"
                )
    # On the boundary of closure the tolerances above would let pass what does not hold.
    check = _check_claim(region, tuple(found), np.minimum(mu, polyhedron.mu[face]))
    return "" if check.ok else f"with the surface's own pieces, {check.reason}"


def _holds(held: SurfacePiece, piece: SurfacePiece, diameter: float) -> bool:
    """Whether one piece contains another, with all its normals."""
    tolerance = 10 * LENGTH_TOLERANCE * diameter
    across = cross(held.nhat_TB_B, piece.nhat_TB_B)
    leaning = np.arctan2(np.sqrt(dot(across, across)), dot(held.nhat_TB_B, piece.nhat_TB_B))
    if leaning + np.arctan(piece.tan_spread) > np.arctan(held.tan_spread) + 10 * ANGLE_TOLERANCE:
        return False
    p_FV, p_FH = (
        times(p - held.p_BV[0], face_frame(held.nhat_TB_B)) for p in (piece.p_BV, held.p_BV)
    )
    low, high = p_FH.min(axis=0) - tolerance, p_FH.max(axis=0) + tolerance
    if not ((low <= p_FV) & (p_FV <= high)).all():
        return False
    if high[2] - low[2] <= 4 * tolerance:
        polygon = shapely.convex_hull(shapely.MultiPoint(p_FH[:, :2]))
        return bool(shapely.distance(polygon, shapely.points(p_FV[:, :2])).max() <= tolerance)
    # Pieces that were found here too have the same corners; only others need a program each.
    apart = np.array([np.abs(p_FH - p).max(axis=1).min() > tolerance for p in p_FV])
    hull = VPolytope(p_FH.T)
    return all(hull.PointInSet(p, tolerance) for p in p_FV[apart])

"""Finds one internal force for all placements of three contacts in regions.

A friction cone is an intersection of half-spaces. Grasps whose regions have as many pieces are
searched together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from drake_polygrasp.arrays import Array, Ints, batches, frozen
from drake_polygrasp.certification.convex import find_internal_forces
from drake_polygrasp.certification.exact import MAX_TILT, narrowed_friction
from drake_polygrasp.certification.half_spaces import FACTORS, HalfSpaces, tangents_of
from drake_polygrasp.certification.region_pieces import RegionPiece, padded
from drake_polygrasp.vectors import circle, dot

_NUM_TANGENTS, _FEWEST_TANGENTS = 768, 32
"""Our choice: half-spaces of the cone at a contact, divided among its pieces; least for a piece."""
_AT_ONCE = 1 << 18
"""Our choice: pairs of directions and pieces at once, with 16 corners each about 30 MB."""
_I = range(3)


@dataclass(frozen=True, eq=False)
class RegionClaim:
    """Three contacts, and the errors that are to be proved.

    Attributes:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, shape (3,).
        regions: the pieces of each contact's region, rounded as a file will state them.
        placement_error: distances for which the regions were made [m], shape (3,).
        tilt_error: greatest angle between normals and the surface's [rad].
        friction_error: greatest relative loss of friction coefficients.
    """

    p_BC: Array
    nhat_TB_B: Array
    mu: Array
    regions: Sequence[Sequence[RegionPiece]]
    placement_error: Array
    tilt_error: float = 0.0
    friction_error: float = 0.0


def find_common_forces(
    claims: Sequence[RegionClaim], *, as_scale: bool = False
) -> list[tuple[Array, float] | None]:
    """Finds the x of each grasp that has the most room in its regions; it is not checked yet.

    Args:
        claims: the contacts of each grasp, their regions and what else may be off.
        as_scale: whether the x is wanted that allows the largest scale of the regions instead.

    Returns:
        For each grasp x [1/m], shape (3,), rounded and with total normal force 1, and that room or
        scale; None if the errors leave no friction, or it is not positive.
    """
    found: list[tuple[Array, float] | None] = [None] * len(claims)
    alike: dict[tuple[int, ...], list[_Start]] = {}
    for start in _starts(claims):
        alike.setdefault(tuple(map(len, start.claim.regions)), []).append(start)
    for sizes, starts in alike.items():
        num_tangents = max(_NUM_TANGENTS // max(sizes), _FEWEST_TANGENTS)
        for some in batches(len(starts), _AT_ONCE // (sum(sizes) ** 2 * num_tangents)):
            spaces = _half_spaces(starts[some], num_tangents)
            best = zip(*spaces.greatest(as_scale=as_scale), strict=True)
            for start, (x, reached) in zip(starts[some], best, strict=True):
                if reached > 0:
                    found[start.position] = frozen(x), float(reached)
    return found


class _Start(NamedTuple):
    """What the search for a grasp starts with.

    Attributes:
        position: of its claim among those that were given.
        claim: the contacts, their regions and what else may be off.
        friction: what the errors leave on each piece, positive, shape (S,).
        force: internal force of the largest margin for nominal contacts [1/m], shape (3,).
    """

    position: int
    claim: RegionClaim
    friction: Array
    force: Array


def _starts(claims: Sequence[RegionClaim]) -> list[_Start]:
    """Returns the starts of claims with friction left and an internal force, in their order."""
    narrowed: dict[tuple[float, ...], float] = {}
    held: list[tuple[int, RegionClaim, list[list[float]]]] = []
    for position, claim in enumerate(claims):
        errors = claim.tilt_error, claim.friction_error
        if not (0 <= errors[0] <= MAX_TILT and 0 <= errors[1] < 1):
            continue
        friction = []
        for mu, region in zip(claim.mu.tolist(), claim.regions, strict=True):
            kinds = [(mu, *errors, piece.tan_spread) for piece in region]
            narrowed |= {k: float(narrowed_friction(*k)) for k in {*kinds} - narrowed.keys()}
            friction.append([narrowed[kind] for kind in kinds])
        if min(map(min, friction)) > 0:
            held.append((position, claim, friction))
    if not held:
        return []
    p_BC = np.stack([claim.p_BC for _, claim, _ in held])
    nhat_TB_B = np.stack([claim.nhat_TB_B for _, claim, _ in held])
    widest = np.array([[max(each) for each in friction] for *_, friction in held])
    forces = find_internal_forces(p_BC, nhat_TB_B, widest)
    starts = [
        _Start(position, claim, np.concatenate(friction), force)
        for (position, claim, friction), force in zip(held, forces, strict=True)
    ]
    return [start for start in starts if np.isfinite(start.force).all()]


def _half_spaces(starts: Sequence[_Start], num_tangents: int) -> HalfSpaces:
    """Prepares the search of N grasps whose regions have as many pieces.

    Args:
        starts: the grasps, and what their search starts with.
        num_tangents: number of half-spaces of each piece.
    """
    claims = [start.claim for start in starts]
    friction = np.stack([start.friction for start in starts])
    contact = np.repeat(_I, [len(region) for region in claims[0].regions])
    p_BC = np.stack([claim.p_BC for claim in claims])
    nhat_TB_B = np.stack([claim.nhat_TB_B for claim in claims])
    pieces = [piece for claim in claims for region in claim.regions for piece in region]
    tangents = circle(2 * np.pi * np.arange(num_tangents) / num_tangents)
    normals = np.stack([piece.nhat_TB_B for piece in pieces]).reshape(*friction.shape, 3)
    u = np.einsum("jt,nsjx->nsxt", np.ascontiguousarray(tangents.T), tangents_of(normals))
    u += (friction[..., None] * normals)[..., None]
    corners = padded([piece.p_BV for piece in pieces]).reshape(*friction.shape, -1, 3)
    lowest, highest = _extents(u, contact, corners - p_BC[:, contact, None])
    centred = p_BC - p_BC.mean(axis=1, keepdims=True)
    along = np.einsum("nsxt,nkx->nskt", u, centred)
    pushes = dot(nhat_TB_B[:, :, None], centred[:, None])
    return HalfSpaces(
        nominal=np.einsum("nskt,skx->nsxt", along, FACTORS[contact]),
        lowest=lowest,
        highest=highest,
        contact=np.broadcast_to(contact, friction.shape),
        push=np.einsum("nik,ikx->nx", pushes, FACTORS),
        start=np.stack([start.force for start in starts]),
    )


def _extents(u: Array, contact: Ints, corners: Array) -> tuple[Array, Array]:
    """Returns how far regions extend along directions of pieces.

    Args:
        u: directions of each piece, shape (N, S, 3, T).
        contact: whose each piece is, shape (S,).
        corners: of each piece, from its contact's nominal point [m], shape (N, S, V, 3).

    Returns:
        The least and greatest u.p over the region of each contact [m], shape (N, S, 3, T); over the
        piece alone for its own contact.
    """
    low, high = np.empty((2, *u.shape))
    for k in _I:
        own, others = contact == k, contact != k
        region = corners[:, own].reshape(len(corners), -1, 3)
        along = np.einsum("nsxt,nvx->nsvt", u[:, others], region)
        low[:, others, k], high[:, others, k] = along.min(axis=2), along.max(axis=2)
        along = np.einsum("nsxt,nsvx->nsvt", u[:, own], corners[:, own])
        low[:, own, k], high[:, own, k] = along.min(axis=2), along.max(axis=2)
    return low, high

"""Contacts that may be anywhere in their regions, and the friction cones that they have there."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Batch, Ints
from drake_polygrasp.certification.region_pieces import RegionPiece, padded
from drake_polygrasp.vectors import circle, dot, dot_first
from drake_polygrasp.wrenches.contacts import contact_frames

_INSIDE = 1.0 - 1e-7
"""Our choice: rims of cones are approached so far, that rounding leaves forces inside."""
_STEEPEST = 1e9
"""Our choice: the tangent of a right angle."""
HAIR = 1e-14
"""Our choice, relative: what tangents and friction are off."""
_DIGITS = 9
"""Our choice: decimals of lengths that are compared."""


@dataclass(frozen=True, eq=False)
class LeaningCones(Batch):
    """Friction cones about P normals that may lean.

    Attributes:
        frames: stated inward unit normal, and two unit vectors across it, shape (P, 3, 3).
        mu: the friction that is left about the stated normal, shape (P,).
        tangent: of the angle by which normals may differ from the stated one, shape (P,).
    """

    frames: Array
    mu: Array
    tangent: Array

    def forces(self, turns: Array, shares: Array) -> Array:
        """Returns forces of each cone, as long as may be.

        Args:
            turns: around the normals [rad], shape (..., P).
            shares: of the friction that they use, shape (..., P).

        Returns:
            Shape (..., P, 3).
        """
        n, t_1, t_2 = self.frames[:, 0], self.frames[:, 1], self.frames[:, 2]
        slope = _INSIDE * self.mu * shares
        across = circle(turns) * slope[..., None]
        f = n + across[..., :1] * t_1 + across[..., 1:] * t_2
        return np.asarray(f / self._normal_parts(slope)[..., None])

    def limits(self, velocities: Array) -> Array:
        """Returns what forces of each cone pair to at most with velocities.

        Args:
            velocities: shape (3, V, P).

        Returns:
            Shape (V, P).
        """
        along = dot_first(velocities, self.frames[:, 0].T[:, None])
        squares = dot_first(velocities, velocities)
        across = np.sqrt(np.maximum(squares - along * along, 0.0))
        # As the slope rises, the pairing rises to the velocity's length, where the force is along
        # that, and falls again; where the normal part is limited by the tilt, it only rises or only
        # falls.
        bend = np.minimum(self.mu, self.tangent)
        ends = [(along + slope * across) / self._normal_parts(slope) for slope in (bend, self.mu)]
        at_bend = np.where(across <= bend * along, np.sqrt(squares), ends[0])
        return np.asarray(np.maximum(at_bend, ends[1]))

    def _normal_parts(self, slope: Array) -> Array:
        """Returns the greatest normal part of forces of normal part 1 and a tangential part.

        It is about the normal along the force, or turned towards it as far as may be.
        """
        turned = (1.0 + self.tangent * slope) / np.sqrt(1.0 + self.tangent * self.tangent)
        return np.where(slope <= self.tangent, np.sqrt(1.0 + slope * slope), turned)


@dataclass(frozen=True, eq=False)
class RangingContacts:
    """Pieces of the regions of three contacts, P in all, those of contact 1 first.

    Attributes:
        contact: whose each piece is, ascending, shape (P,).
        reference: a piece of each contact near its region's middle, shape (3,).
        r_V: corners from the centre of mass over rho, some repeated, shape (P, V, 3).
        cones: the friction cones of the pieces.
    """

    contact: Ints
    reference: Ints
    r_V: Array
    cones: LeaningCones

    def middles(self) -> Array:
        """Returns a point of each region's piece of reference, shape (3, 3)."""
        return np.asarray(self.r_V[self.reference].mean(axis=1))


def ranging_contacts(
    regions: Sequence[Sequence[RegionPiece]], mu: Array, tilt: float, p_BBcm: Array, rho: float
) -> RangingContacts:
    """Returns the contacts of three regions.

    Args:
        regions: the pieces of each.
        mu: the friction that is left for each piece, those of contact 1 first, shape (P,).
        tilt: angle by which normals may differ from the surface's [rad].
        p_BBcm: nominal centre of mass [m], shape (3,).
        rho: what torques are divided by [m].
    """
    contact = np.array([i for i, region in enumerate(regions) for _ in region])
    pieces = [piece for region in regions for piece in region]
    nhat = np.stack([piece.nhat_TB_B for piece in pieces])
    corners = [(piece.p_BV - p_BBcm) / rho for piece in pieces]
    centres = np.stack([r_V.mean(axis=0) for r_V in corners])
    reference = []
    for i in range(3):
        own = np.flatnonzero(contact == i)
        off = centres[own] - centres[own].mean(axis=0)
        reference.append(own[np.round(dot(off, off), _DIGITS).argmin()])
    middles = centres[reference]
    tan_tilt = math.tan(tilt)
    spread = np.array([piece.tan_spread for piece in pieces])
    rest = 1.0 - tan_tilt * spread
    tangent = np.where(rest > 0, (tan_tilt + spread) / np.where(rest > 0, rest, 1.0), _STEEPEST)
    return RangingContacts(
        contact=contact,
        reference=np.array(reference),
        r_V=padded(corners),
        cones=LeaningCones(
            contact_frames(middles[None], nhat[None])[0], mu, tangent * (1.0 + HAIR)
        ),
    )

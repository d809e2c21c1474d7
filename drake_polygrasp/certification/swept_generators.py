"""Forces that serve contacts all over their regions, and how far their wrenches stay along a twist.

A generator is a contact with one force for each piece of its region. The force is in the friction
cone about every normal that the contact may have in that piece, tilted or not, and its normal part
is 1 at most for each of them. While the contact is anywhere in the piece, the force's wrench pairs
with a twist w = (v, omega) to at least its least value at the piece's corners r,

    f.(v + omega x r),

for that is linear in r. All lengths are over rho, and from the nominal centre of mass.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.vectors import circle, cross, dot

_DIGITS = 9
"""Our choice: decimals of forces, so that what follows from them does not hang on last bits."""
_INSIDE = 1.0 - 1e-7
"""Our choice: rims of cones are approached so far, that rounding leaves forces inside."""
_UNEVEN = 2e-6
"""Our choice: parts by which generators differ in length, so that no facet of a hull has more than
six of them: four of one cone would span a flat one."""
_TURNS = 2.0 * np.pi * np.arange(24) / 24
_SHARES = np.array([1.0, 0.6, 0.2])
_REFINEMENTS = 5
"""Our choice: halvings of the steps; the last is of 0.008 rad, which is 3e-5 of the friction."""
_STEPS = np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)], dtype=float)
_TIE = 10
"""Our choice: decimals of heights that are compared, for less is rounding."""


@dataclass(frozen=True, eq=False)
class RangingContacts:
    """Pieces of the regions of three contacts, P in all, those of contact 1 first.

    Attributes:
        contact: whose each piece is, ascending, shape (P,).
        reference: a piece of each contact near its region's middle, shape (3,).
        r_V: corners from the centre of mass over rho, some repeated, shape (P, V, 3).
        frames: inward unit normal, and two unit vectors across it, shape (P, 3, 3).
        mu: the friction that is left about the stated normal, shape (P,).
        tangent: of the angle by which normals may differ from the stated one, shape (P,).
    """

    contact: Ints
    reference: Ints
    r_V: Array
    frames: Array
    mu: Array
    tangent: Array

    def middles(self) -> Array:
        """Returns a point of each region's piece of reference, shape (3, 3)."""
        return np.asarray(self.r_V[self.reference].mean(axis=1))

    def forces(self, turns: Array, shares: Array) -> Array:
        """Returns forces of each piece, as long as may be.

        Args:
            turns: around the normals [rad], shape (N, P).
            shares: of the friction that they use, shape (N, P).

        Returns:
            Shape (N, P, 3).
        """
        n, t_1, t_2 = self.frames[:, 0], self.frames[:, 1], self.frames[:, 2]
        slope = _INSIDE * self.mu * shares
        across = circle(turns) * slope[..., None]
        f = n + across[..., :1] * t_1 + across[..., 1:] * t_2
        # The greatest normal part: with the normal along f, or turned towards it as far as may be.
        turned = (1.0 + self.tangent * slope) / np.sqrt(1.0 + self.tangent * self.tangent)
        length = np.where(slope <= self.tangent, np.sqrt(1.0 + slope * slope), turned)
        return np.asarray(f / length[..., None])


class SweptGenerators:
    """Generators of three ranging contacts, to which more are added.

    Attributes:
        contacts: the contacts.
        contact: whose each generator is, shape (G,).
        force: a force for each piece of its contact, shape (G, S, 3); the last is repeated for
            contacts of fewer pieces.
        middle: wrenches at the middles of the pieces of reference, shape (G, 6).
    """

    def __init__(self, contacts: RangingContacts) -> None:
        """Has no generators yet.

        Args:
            contacts: whose generators will be added.
        """
        self.contacts = contacts
        pieces = [np.flatnonzero(contacts.contact == i) for i in range(3)]
        most = max(map(len, pieces))
        # Repeated pieces change no minimum.
        self._pieces = np.stack(
            [np.concatenate([p, np.repeat(p[-1:], most - len(p))]) for p in pieces]
        )
        self._middles = contacts.middles()
        self._reference = contacts.reference - np.array([piece[0] for piece in pieces])
        self.contact = np.zeros(0, dtype=int)
        self.force = np.zeros((0, most, 3))
        self.middle = np.zeros((0, 6))
        num = most * contacts.r_V.shape[1]
        self._share = 1.0
        self._full = self._rows = np.zeros((6, 0, num))

    def __len__(self) -> int:
        """Counts generators."""
        return len(self.contact)

    def add(self, contact: Ints, force: Array) -> None:
        """Adds generators, their forces rounded and shortened by a hair.

        Args:
            contact: whose they are, shape (N,).
            force: one for each piece of the contact, shape (N, S, 3).
        """
        k = len(self) + np.arange(len(contact))
        hair = 1.0 - _UNEVEN * (1.0 + (k * 0.6180339887) % 1.0)
        force = np.asarray(np.round(force * hair[:, None, None], _DIGITS) + 0.0)
        first, r = force[np.arange(len(k)), self._reference[contact]], self._middles[contact]
        rows = self._rows_of(contact, force)
        self.contact = np.concatenate([self.contact, contact])
        self.force = np.concatenate([self.force, force])
        self.middle = np.concatenate([self.middle, np.hstack([first, cross(r, first)])])
        self._full = np.concatenate([self._full, rows], axis=1)
        self.range_by(self._share)

    def range_by(self, share: float) -> None:
        """Shrinks wrenches towards those in `middle`, for a surface that grows with its regions.

        Args:
            share: of the way from those to the wrenches in the regions, 1 for all of it.
        """
        self._share = share
        middle = self.middle.T[:, :, None]
        self._rows = self._full if share == 1.0 else middle + share * (self._full - middle)

    def add_rims(self, turns: Array) -> None:
        """Adds generators on the rims of each contact's cones.

        Args:
            turns: around the normals [rad], shape (N,).
        """
        count = len(self.contacts.contact)
        turned = np.repeat(turns[:, None], count, axis=1)
        forces = self.contacts.forces(turned, np.ones((len(turns), count)))
        for i in range(3):
            self.add(np.full(len(turns), i), forces[:, self._pieces[i]])

    def _rows_of(self, contact: Ints, force: Array) -> Array:
        """Wrenches at every corner, (6, N, V)."""
        r = self.contacts.r_V[self._pieces[contact]]
        f = np.broadcast_to(force[:, :, None], r.shape)
        wrenches = np.concatenate([f, cross(r, f)], axis=-1).reshape(len(contact), -1, 6)
        return np.ascontiguousarray(wrenches.transpose(2, 0, 1))

    def heights_at_corners(self, w: Array, which: Ints) -> Array:
        """Returns what generators pair to with twists at every corner.

        Args:
            w: twists, shape (J, 6).
            which: generators of each twist, shape (J, N).

        Returns:
            Shape (J, N, V).
        """
        rows, columns = self._rows[:, which], w.T[:, :, None, None]
        paired = rows[0] * columns[0]
        for k in range(1, 6):
            paired += rows[k] * columns[k]
        return np.asarray(paired)

    def heights(self, w: Array, which: Ints) -> Array:
        """Returns the least of `heights_at_corners` over corners, shape (J, N).

        Args:
            w: twists, shape (J, 6).
            which: generators of each twist, shape (J, N).
        """
        return np.asarray(self.heights_at_corners(w, which).min(axis=-1))

    def wrenches(self, which: Ints, corner: Ints) -> Array:
        """Returns wrenches at single corners, shape (6, N).

        Args:
            which: generators, shape (N,).
            corner: a corner for each, shape (N,).
        """
        return np.asarray(self._rows[:, which, corner])

    def best_forces(self, w: Array) -> tuple[int, Array, float]:
        """Finds the generator that pairs most with one twist, wherever contacts are.

        For every piece the best force is sought on a polar grid that is refined, for the height is
        concave in the force.

        Args:
            w: the twist, shape (6,).

        Returns:
            The contact, its forces, shape (S, 3), and the height.
        """
        c = self.contacts
        count = len(c.contact)
        u = w[:3] + cross(w[3:], c.r_V)
        turns = np.append(np.repeat(_TURNS, len(_SHARES)), 0.0)
        shares = np.append(np.tile(_SHARES, len(_TURNS)), 0.0)
        turns, shares = (np.repeat(x[:, None], count, axis=1) for x in (turns, shares))
        turn_step, share_step, rows = np.pi / len(_TURNS), 0.2, np.arange(count)
        for _ in range(_REFINEMENTS + 1):
            force = c.forces(turns, shares)
            heights = dot(force[:, :, None], u).min(axis=-1)
            best = np.round(heights, _TIE).argmax(axis=0)
            found, reached = force[best, rows], heights[best, rows]
            turns = turns[best, rows] + _STEPS[:, :1] * turn_step
            shares = np.clip(shares[best, rows] + _STEPS[:, 1:] * share_step, 0.0, 1.0)
            turn_step, share_step = turn_step / 2, share_step / 2
        least = np.array([reached[self._pieces[i]].min() for i in range(3)])
        contact = int(np.round(least, _TIE).argmax())
        return contact, found[self._pieces[contact]], float(least[contact])

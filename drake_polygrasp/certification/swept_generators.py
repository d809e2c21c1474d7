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
            turns: around the normals [rad], shape (..., P).
            shares: of the friction that they use, shape (..., P).

        Returns:
            Shape (..., P, 3).
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
        self._full = self._corners = np.zeros((0, num, 6))

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
        corners = self._corners_of(contact, force)
        self.contact = np.concatenate([self.contact, contact])
        self.force = np.concatenate([self.force, force])
        self.middle = np.concatenate([self.middle, np.hstack([first, cross(r, first)])])
        self._full = np.concatenate([self._full, corners])
        self.range_by(self._share)

    def range_by(self, share: float) -> None:
        """Shrinks wrenches towards those in `middle`, for a surface that grows with its regions.

        Args:
            share: of the way from those to the wrenches in the regions, 1 for all of it.
        """
        self._share = share
        middle = self.middle[:, None]
        self._corners = self._full if share == 1.0 else middle + share * (self._full - middle)

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

    def _corners_of(self, contact: Ints, force: Array) -> Array:
        """Wrenches at every corner, (N, V, 6)."""
        r = self.contacts.r_V[self._pieces[contact]]
        f = np.broadcast_to(force[:, :, None], r.shape)
        num = self._full.shape[1]
        return np.concatenate([f, cross(r, f)], axis=-1).reshape(len(contact), num, 6)

    def at_corners(self, which: Ints) -> Array:
        """Returns wrenches of generators at every corner, shape (6, J, N V).

        Args:
            which: generators, shape (J, N).
        """
        wrenches = self._corners[which].reshape(len(which), -1, 6)
        return np.ascontiguousarray(wrenches.transpose(2, 0, 1))

    def heights(self, w: Array, which: Ints) -> Array:
        """Returns the least that generators pair to with a twist, over corners, shape (J, N).

        Args:
            w: twists, shape (J, 6).
            which: generators of each twist, shape (J, N).
        """
        return np.asarray(np.einsum("jnvk,jk->jnv", self._corners[which], w).min(axis=-1))

    def heights_of_each(self, w: Array, which: Ints) -> Array:
        """Returns the least heights of some generators along each twist, shape (K, N).

        Args:
            w: twists, shape (K, 6).
            which: generators, shape (N,).
        """
        return _least_heights(self._corners[which], w)

    def heights_of(self, w: Array, contact: Ints, force: Array) -> Array:
        """Returns the least heights of generators that need not have been added, shape (K, N).

        Args:
            w: twists, shape (K, 6).
            contact: whose the generators are, shape (N,).
            force: a force for each piece of its contact, shape (N, S, 3).
        """
        return _least_heights(self._corners_of(contact, force), w)

    def add_best_at_middles(self, w: Array) -> None:
        """Adds the generator on the rims of cones that pairs most with a twist at the middles.

        Args:
            w: the twist, shape (6,).
        """
        c, middles = self.contacts, self._middles
        u = w[:3] + cross(w[3:], middles)
        across = dot(c.frames[:, 1:], u[c.contact][:, None])
        force = c.forces(np.arctan2(across[:, 1], across[:, 0]), np.ones(len(across)))
        heights = dot(force[c.reference], u)
        best = int(np.round(heights, _TIE).argmax())
        self.add(np.array([best]), force[self._pieces[best]][None])

    def best_forces(self, w: Array) -> tuple[Ints, Array, Array]:
        """Finds for each twist the generator that pairs most with it, wherever contacts are.

        For every piece the best force is sought on a polar grid that is refined, for the height is
        concave in the force.

        Args:
            w: twists, shape (K, 6).

        Returns:
            The contacts, shape (K,), their forces, shape (K, S, 3), and the heights, shape (K,).
        """
        c = self.contacts
        shape = len(w), len(c.contact)
        u = w[:, None, None, :3] + cross(w[:, None, None, 3:], c.r_V)
        turns = np.append(np.repeat(_TURNS, len(_SHARES)), 0.0)
        shares = np.append(np.tile(_SHARES, len(_TURNS)), 0.0)
        turns, shares = (
            np.broadcast_to(x[:, None, None], (len(x), *shape)) for x in (turns, shares)
        )
        turn_step, share_step, steps = np.pi / len(_TURNS), 0.2, _STEPS[:, :, None, None]
        for _ in range(_REFINEMENTS + 1):
            force = c.forces(turns, shares)
            heights = dot(force[..., None, :], u).min(axis=-1)
            best = np.round(heights, _TIE).argmax(axis=0)[None]
            turn, share, reached = (
                np.take_along_axis(x, best, 0)[0] for x in (turns, shares, heights)
            )
            found = np.take_along_axis(force, best[..., None], 0)[0]
            turns = turn + steps[:, 0] * turn_step
            shares = np.clip(share + steps[:, 1] * share_step, 0.0, 1.0)
            turn_step, share_step = turn_step / 2, share_step / 2
        least = np.stack([reached[:, own].min(axis=1) for own in self._pieces], axis=1)
        contact = np.round(least, _TIE).argmax(axis=1)
        rows = np.arange(len(w))
        return contact, found[rows[:, None], self._pieces[contact]], least[rows, contact]


def _least_heights(corners: Array, w: Array) -> Array:
    """The least pairing of wrenches (N, V, 6) with each twist (K, 6) over V, (K, N)."""
    return np.asarray(np.einsum("nvk,jk->jnv", corners, w).min(axis=-1))

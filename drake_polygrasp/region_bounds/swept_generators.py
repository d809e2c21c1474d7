"""Forces that serve contacts all over their regions, and how far their wrenches stay along a twist.

A generator is a contact with one force for each piece of its region. The force is in the friction
cone about every normal that the contact may have in that piece, tilted or not, and its normal part
is 1 at most for each of them. While the contact is anywhere in the piece, the force's wrench pairs
with a twist w = (v, omega) to at least its least value at the piece's corners r,

    f.(v + omega x r),

for that is linear in r. All lengths are over rho, and from the nominal centre of mass.
"""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array, Ints, batches
from drake_polygrasp.region_bounds.ranging_contacts import RangingContacts
from drake_polygrasp.vectors import cross

_DIGITS = 9
"""Our choice: decimals of forces, so that what follows from them does not hang on last bits."""
_UNEVEN = 2e-6
"""Our choice: parts by which generators differ in length, so that no facet of a hull has more than
six of them: four of one cone would span a flat one."""
CORNERS_AT_ONCE = 65536
"""Our choice: how many corners are paired at once, for their arrays to fit a processor's cache."""


class SweptGenerators:
    """Generators of three ranging contacts, to which more are added.

    Attributes:
        contacts: the contacts.
        contact: whose each generator is, shape (G,).
        force: a force for each piece of its contact, shape (G, S, 3); the last is repeated for
            contacts of fewer pieces.
        middle: wrenches at the middles of the pieces of reference, shape (G, 6).
        pieces: the pieces of each contact, some repeated, shape (3, S).
        middles: middle of each contact's piece of reference, shape (3, 3).
        reference: which of its contact's pieces that is, shape (3,).
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
        self.pieces = np.stack(
            [np.concatenate([p, np.repeat(p[-1:], most - len(p))]) for p in pieces]
        )
        self.middles = contacts.middles()
        self.reference = contacts.reference - np.array([piece[0] for piece in pieces])
        self.contact = np.zeros(0, dtype=int)
        self.force = np.zeros((0, most, 3))
        self.middle = np.zeros((0, 6))
        num = most * contacts.r_V.shape[1]
        self._share = 1.0
        self._full = self._corners = np.zeros((6, 0, num))

    @property
    def num_corners(self) -> int:
        """How many corners a contact's pieces have together."""
        return int(self._full.shape[2])

    @property
    def ranges_fully(self) -> bool:
        """Whether wrenches are those all over the regions, not shrunk towards those in `middle`."""
        return self._share == 1.0

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
        force = uneven(force, k)
        first, r = force[np.arange(len(k)), self.reference[contact]], self.middles[contact]
        corners = self._corners_of(contact, force)
        self.contact = np.concatenate([self.contact, contact])
        self.force = np.concatenate([self.force, force])
        self.middle = np.concatenate([self.middle, np.hstack([first, cross(r, first)])])
        self._full = np.concatenate([self._full, corners], axis=1)
        self.range_by(self._share)

    def range_by(self, share: float) -> None:
        """Shrinks wrenches towards those in `middle`, for a surface that grows with its regions.

        Args:
            share: of the way from those to the wrenches in the regions, 1 for all of it.
        """
        self._share = share
        middle = self.middle.T[..., None]
        self._corners = self._full if share == 1.0 else middle + share * (self._full - middle)

    def add_rims(self, turns: Array) -> None:
        """Adds generators on the rims of each contact's cones.

        Args:
            turns: around the normals [rad], shape (N,).
        """
        count = len(self.contacts.contact)
        turned = np.repeat(turns[:, None], count, axis=1)
        forces = self.contacts.cones.forces(turned, np.ones((len(turns), count)))
        self.add(
            np.repeat(np.arange(3), len(turns)),
            forces[:, self.pieces].transpose(1, 0, 2, 3).reshape(-1, *self.force.shape[1:]),
        )

    def _corners_of(self, contact: Ints, force: Array) -> Array:
        """Wrenches at every corner, (6, N, V)."""
        r = self.contacts.r_V[self.pieces[contact]]
        f = np.broadcast_to(force[:, :, None], r.shape)
        wrenches = np.concatenate([f, cross(r, f)], axis=-1).reshape(len(r), self.num_corners, 6)
        return np.ascontiguousarray(wrenches.transpose(2, 0, 1))

    def at_corners(self, which: Ints) -> Array:
        """Returns wrenches of generators at every corner, shape (6, J, N V).

        Args:
            which: generators, shape (J, N).
        """
        return np.asarray(self._corners.take(which, axis=1).reshape(6, len(which), -1))

    def heights(self, w: Array, which: Ints) -> Array:
        """Returns the least that generators pair to with a twist, over corners, shape (J, N).

        Args:
            w: twists, shape (J, 6).
            which: generators of each twist, shape (J, N).
        """
        heights = np.empty(which.shape)
        for rows in batches(len(which), CORNERS_AT_ONCE // (which.shape[1] * self.num_corners)):
            paired = np.einsum("kjn,jk->jn", self.at_corners(which[rows]), w[rows])
            heights[rows] = paired.reshape(*which[rows].shape, -1).min(axis=-1)
        return heights

    def heights_of_each(self, w: Array, which: Ints) -> Array:
        """Returns the least heights of some generators along each twist, shape (K, N).

        Args:
            w: twists, shape (K, 6).
            which: generators, shape (N,).
        """
        return _least_heights(self._corners.take(which, axis=1), w)

    def heights_of(self, w: Array, contact: Ints, force: Array) -> Array:
        """Returns the least heights of generators that need not have been added, shape (K, N).

        Args:
            w: twists, shape (K, 6).
            contact: whose the generators are, shape (N,).
            force: a force for each piece of its contact, shape (N, S, 3).
        """
        return _least_heights(self._corners_of(contact, force), w)


def uneven(force: Array, index: Ints) -> Array:
    """Returns forces as generators have them, rounded and shortened by a hair each.

    Args:
        force: shape (N, S, 3).
        index: of the generators, shape (N,), or one for all, shape (1,).
    """
    hair = 1.0 - _UNEVEN * (1.0 + (index * 0.6180339887) % 1.0)
    return np.asarray(np.round(force * hair[:, None, None], _DIGITS) + 0.0)


def _least_heights(corners: Array, w: Array) -> Array:
    """The least pairing of wrenches (6, N, V) with each twist (K, 6) over V, (K, N)."""
    return np.asarray(np.einsum("knv,jk->jnv", corners, w).min(axis=-1))

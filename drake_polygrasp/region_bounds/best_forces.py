"""Finds the force of a contact that pairs most with a twist, wherever in its region the contact is.

A force has a height for every corner of the piece that it is for; the least counts. It is concave
in the force, so a polar grid of the friction cone that is refined around the best finds it.
"""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints, join_rows
from drake_polygrasp.region_bounds.ranging_contacts import LeaningCones
from drake_polygrasp.region_bounds.side_by_side import Work
from drake_polygrasp.region_bounds.swept_generators import SweptGenerators
from drake_polygrasp.vectors import cross_first

_NUM_TURNS = 24
_TURNS = np.append(np.repeat(2.0 * np.pi * np.arange(_NUM_TURNS) / _NUM_TURNS, 3), 0.0)
_SHARES = np.append(np.tile([1.0, 0.6, 0.2], _NUM_TURNS), 0.0)
"""Our choice: directions around the normal [rad], with the shares of the friction that forces along
them use at first; and the normal itself."""
_REFINEMENTS = 5
"""Our choice: halvings of the steps; the last is of 0.008 rad, which is 3e-5 of the friction."""
_STEPS = np.array([(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1)], dtype=float)
_NEAR = 1e-9
"""Our choice: contacts whose limit is this much below what another reaches are left out; ties
differ by less."""
_TIE = 10
"""Our choice: decimals of heights that are compared, for less is rounding."""


@dataclass(frozen=True, eq=False)
class BestForces(Work[tuple[Ints, Array, Array]]):
    """Asks for the generator that pairs most with each twist, wherever contacts are.

    The answer is the contacts, shape (K,), their forces for each piece, shape (K, S, 3), and the
    heights that these reach, shape (K,).

    Attributes:
        generators: among whose contacts the best is chosen.
        w: twists, shape (K, 6).
    """

    generators: SweptGenerators
    w: Array

    def kind(self) -> Hashable:
        """Returns the number of corners, which is the same for those of one kind."""
        return int(self.generators.contacts.r_V.shape[1])

    @classmethod
    def together(cls, works: Sequence[BestForces]) -> list[tuple[Ints, Array, Array]]:
        """Finds the best forces of all twists of all pieces at once.

        Args:
            works: those of one kind.

        Returns:
            The answer to each.
        """
        contacts = [work.generators.contacts for work in works]
        num = [len(c.contact) for c in contacts]
        piece = [np.tile(np.arange(n), len(work.w)) for n, work in zip(num, works, strict=True)]
        w = [np.repeat(work.w, n, axis=0) for n, work in zip(num, works, strict=True)]
        r_V = np.concatenate([c.r_V[k] for c, k in zip(contacts, piece, strict=True)])
        cones = join_rows(*(c.cones.take(k) for c, k in zip(contacts, piece, strict=True)))
        twists = np.concatenate(w).T
        # Components first, then corners: sums and minima then run over whole arrays.
        velocities = twists[:3, None] + cross_first(twists[3:, None], r_V.transpose(2, 1, 0))
        starts = np.cumsum([0, *map(len, piece)])
        owner = np.concatenate([c.contact[k] for c, k in zip(contacts, piece, strict=True)])
        # Rows of one contact and twist follow each other.
        first = np.flatnonzero(np.diff(owner, prepend=-1))
        lengths = np.diff(first, append=len(owner))
        limits = cones.limits(velocities).min(axis=0)
        limit = np.minimum.reduceat(limits, first).reshape(-1, 3)
        force, height = np.zeros((len(owner), 3)), np.full(len(owner), -np.inf)
        tried = np.arange(3) == limit.argmax(axis=1)[:, None]
        while tried.any():
            rows = np.flatnonzero(np.repeat(tried.ravel(), lengths))
            force[rows], height[rows] = _greatest(velocities[:, :, rows], cones.take(rows))
            reached = np.minimum.reduceat(height, first).reshape(-1, 3)
            # The other contacts are tried only where they may reach as much.
            most = reached.max(axis=1)[:, None]
            tried = (limit > most - _NEAR) & ~np.isfinite(reached)
        return [
            _best_of(work, part, height)
            for work, part, height in zip(
                works, np.split(force, starts[1:-1]), np.split(height, starts[1:-1]), strict=True
            )
        ]


def _greatest(velocities: Array, cones: LeaningCones) -> tuple[Array, Array]:
    """Finds the force of each cone whose least pairing with its corners' velocities is greatest.

    Args:
        velocities: of the corners of P pieces, shape (3, V, P).
        cones: of the pieces.

    Returns:
        The forces, shape (P, 3), and their least pairings, shape (P,).
    """
    turns, shares = _TURNS[:, None], _SHARES[:, None]
    columns = np.arange(velocities.shape[2])
    turn_step, share_step, steps = np.pi / _NUM_TURNS, 0.2, _STEPS[:, :, None]
    for _ in range(_REFINEMENTS + 1):
        force = cones.forces(turns, shares)
        f, u = np.ascontiguousarray(force.transpose(2, 0, 1)), velocities[:, :, None]
        heights = (f[0] * u[0] + f[1] * u[1] + f[2] * u[2]).min(axis=0)
        best = np.round(heights, _TIE).argmax(axis=0)
        turn, share = (np.broadcast_to(x, heights.shape)[best, columns] for x in (turns, shares))
        turns = turn + steps[:, 0] * turn_step
        shares = np.clip(share + steps[:, 1] * share_step, 0.0, 1.0)
        turn_step, share_step = turn_step / 2, share_step / 2
    return force[best, columns], heights[best, columns]


def _best_of(work: BestForces, force: Array, height: Array) -> tuple[Ints, Array, Array]:
    """The best contact of each twist, given forces and heights of each twist and piece."""
    pieces, rows = work.generators.pieces, np.arange(len(work.w))
    force, height = force.reshape(len(rows), -1, 3), height.reshape(len(rows), -1)
    least = height[:, pieces].min(axis=2)
    contact = np.round(least, _TIE).argmax(axis=1)
    return contact, force[rows[:, None], pieces[contact]], least[rows, contact]

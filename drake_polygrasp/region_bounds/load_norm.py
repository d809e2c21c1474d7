"""Measures twists by the loads that grasps are to withstand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.wrenches.region_support import load_reach


@dataclass(frozen=True, eq=False)
class LoadNorm:
    """N(w): the greatest pairing of w with a unit load about a centre of mass that may be off.

    Attributes:
        com_error: how far it may be off, over rho; one, or one for each twist, shape (K,).
        forces_only: whether loads are forces through the centre of mass, without torque; one, or
            one for each twist, shape (K,).
    """

    com_error: float | Array
    forces_only: bool | Bools = False

    @classmethod
    def of_each(cls, norms: Sequence[LoadNorm], counts: Sequence[int]) -> LoadNorm:
        """Returns norms of some twists each as one of them all.

        Args:
            norms: of one number each.
            counts: of the twists that each is of.
        """
        com_error = np.array([norm.com_error for norm in norms], dtype=float)
        forces_only = np.array([norm.forces_only for norm in norms], dtype=bool)
        return cls(np.repeat(com_error, counts), np.repeat(forces_only, counts))

    def take(self, rows: Ints | Bools | slice) -> LoadNorm:
        """Returns the norm of some of the twists.

        Args:
            rows: which.
        """
        return LoadNorm(np.asarray(self.com_error)[rows], np.asarray(self.forces_only)[rows])

    def of(self, w: Array) -> Array:
        """Returns N of twists, shape (K,).

        Args:
            w: shape (K, 6).
        """
        reach = load_reach(w, self.com_error, forces_only=self.forces_only)
        return np.asarray(np.maximum(reach, 1e-300))

    def squares(self, w: Array) -> Array:
        """Returns six factors a with the sum of a w^2 close to N^2 near given twists, (K, 6).

        Args:
            w: the given twists, shape (K, 6).
        """
        s = self.com_error
        v, omega = np.sqrt((w[:, :3] ** 2).sum(axis=1)), np.sqrt((w[:, 3:] ** 2).sum(axis=1))
        ratio = np.clip(v / np.maximum(omega, 1e-12), 0.05, 20.0)
        # Without any weight rotations might grow without end.
        torque = np.where(self.forces_only, 1e-4, 1.0)
        factors = np.stack([1.0 + s / ratio, torque + s * s + s * ratio], axis=1)
        return np.repeat(factors, 3, axis=1)

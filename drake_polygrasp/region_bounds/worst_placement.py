"""Upper bounds of what contacts withstand anywhere in regions: places where they do not.

For a fixed twist w the worst place and normal of each contact are its own affair, so that
K(w) / N(w), K the greatest over contacts of their least support, is what one placement withstands
at most. The directions in which that placement withstands least lead to a lower bound yet.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.certification.region_pieces import RegionPiece, padded
from drake_polygrasp.region_bounds.load_norm import LoadNorm
from drake_polygrasp.region_bounds.side_by_side import Search, Work, result_of
from drake_polygrasp.vectors import cross, unit
from drake_polygrasp.wrenches.epsilon_bound import critical_directions
from drake_polygrasp.wrenches.region_support import least_tilted_support, worst_centres_of_mass

_DIRECTIONS, _ROUNDS = 12, 3
"""Our choice: of the worst placement's directions, and how often a worse one is looked for."""
_GAIN = 1e-3
"""Our choice, relative: a bound that falls by less is not followed further."""
_DIGITS, _TIE = 9, 11
"""Our choice: decimals of twists, and of values that are compared: less is rounding."""
_NO_TORQUE = 1e-6
"""Our choice: divided by so little, torques are all but free."""


@dataclass(frozen=True, eq=False)
class Placeable:
    """Polygons, or single points, that contacts may be on; S of as many corners.

    Attributes:
        contact: whose each is, shape (S,).
        r_V: corners from the centre of mass over rho, in order, some repeated, shape (S, V, 3).
        nhat: inward unit normals, shape (S, 3).
        mu: friction coefficients, shape (S,).
    """

    contact: Ints
    r_V: Array
    nhat: Array
    mu: Array


def placeable(
    regions: Sequence[Sequence[RegionPiece]], mu: Sequence[float], p_BBcm: Array, rho: float
) -> list[Placeable]:
    """Returns flat pieces, and the corners of the others.

    Args:
        regions: pieces of the three contacts.
        mu: a friction coefficient for each piece, those of contact 1 first.
        p_BBcm: nominal centre of mass [m], shape (3,).
        rho: what torques are divided by [m].
    """
    flat, points = [], []
    pieces = [(i, piece) for i, region in enumerate(regions) for piece in region]
    for (i, piece), m in zip(pieces, mu, strict=True):
        r_V = (piece.p_BV - p_BBcm) / rho
        if piece.tan_spread == 0:
            flat.append((i, r_V, piece.nhat_TB_B, m))
        else:
            points += [(i, r[None], piece.nhat_TB_B, m) for r in r_V]
    groups = []
    for group in filter(None, (flat, points)):
        groups.append(
            Placeable(
                np.array([i for i, _, _, _ in group]),
                padded([r_V for _, r_V, _, _ in group]),
                np.stack([nhat for _, _, nhat, _ in group]),
                np.array([m for _, _, _, m in group]),
            )
        )
    return groups


@dataclass(frozen=True, eq=False)
class _Worst:
    """A placement, what it withstands at most, and along which twist."""

    bound: float
    w: Array
    r: Array
    nhat: Array
    mu: Array


@dataclass(frozen=True, eq=False)
class _LeastSupport(Work[tuple[Array, Array, Array]]):
    """Asks for the least support of each of S polygons along each of K twists.

    The answer is that of `least_tilted_support`, its first axes (K, S).
    """

    group: Placeable
    w: Array
    tilt: float

    def kind(self) -> tuple[int, float]:
        return self.group.r_V.shape[1], self.tilt

    @classmethod
    def together(cls, works: Sequence[_LeastSupport]) -> list[tuple[Array, Array, Array]]:
        shapes = [(len(work.w), len(work.group.mu)) for work in works]
        groups = [
            (work.group, np.tile(np.arange(num), k))
            for work, (k, num) in zip(works, shapes, strict=True)
        ]
        h, r, n = least_tilted_support(
            np.concatenate(
                [np.repeat(w.w, num, axis=0) for w, (_, num) in zip(works, shapes, strict=True)]
            ),
            np.concatenate([group.r_V[k] for group, k in groups]),
            np.concatenate([group.nhat[k] for group, k in groups]),
            np.concatenate([group.mu[k] for group, k in groups]),
            works[0].tilt,
        )
        ends = np.cumsum([k * num for k, num in shapes])[:-1]
        parts = zip(np.split(h, ends), np.split(r, ends), np.split(n, ends), strict=True)
        return [
            (h.reshape(shape), r.reshape(*shape, 3), n.reshape(*shape, 3))
            for (h, r, n), shape in zip(parts, shapes, strict=True)
        ]


@dataclass(frozen=True, eq=False)
class _CriticalTwists(Work[Array]):
    """Asks for the twists along which three contacts withstand least, (_DIRECTIONS, 6)."""

    r: Array
    nhat: Array
    mu: Array

    @classmethod
    def together(cls, works: Sequence[_CriticalTwists]) -> list[Array]:
        r, nhat = np.stack([work.r for work in works]), np.stack([work.nhat for work in works])
        mu = np.stack([work.mu for work in works])
        return list(critical_directions(r, nhat, mu, np.zeros(3), 1.0, num=_DIRECTIONS)[0])


class WorstPlacement:
    """The worst placement that is known of three contacts in regions.

    Attributes:
        bound: what it withstands at most, in the norm; infinite before the first twists.
        w: the twist along which that is so, shape (6,).
    """

    def __init__(self, groups: Sequence[Placeable], tilt_error: float, norm: LoadNorm) -> None:
        """Knows none yet.

        Args:
            groups: where contacts may be.
            tilt_error: angle by which normals may turn [rad].
            norm: what twists are measured in.
        """
        self._groups, self._tilt, self._norm = groups, tilt_error, norm
        zeros = np.zeros((3, 3))
        self._worst = _Worst(math.inf, np.zeros(6), zeros, zeros, np.zeros(3))

    @property
    def bound(self) -> float:
        """What the placement withstands at most."""
        return self._worst.bound

    @property
    def w(self) -> Array:
        """The twist along which that is so."""
        return self._worst.w

    def lowered(self, w: Array) -> Search[float]:
        """Finds the least bound that is known with more twists.

        Args:
            w: twists, shape (K, 6).

        Returns:
            The bound.
        """
        before = self.bound
        yield from self._try(w)
        for _ in range(_ROUNDS):
            if self.bound >= before * (1.0 - _GAIN):
                break
            before = self.bound
            critical = yield from self._critical(self._worst)
            yield from self._try(critical)
        return self.bound

    def _critical(self, worst: _Worst) -> Search[Array]:
        """Twists along which one placement withstands least, with the worst centre of mass."""
        d = worst_centres_of_mass(worst.w[None], self._norm.com_error)[0]
        scale = _NO_TORQUE if self._norm.forces_only else 1.0
        place = (worst.r - d) / scale, worst.nhat, worst.mu
        w = (yield from result_of(_CriticalTwists(*place))).copy()
        w[:, 3:] /= scale
        # They turn about d; twists here turn about the nominal centre of mass.
        w[:, :3] -= cross(w[:, 3:], d)
        return np.round(unit(w), _DIGITS)

    def _try(self, w: Array) -> Search[None]:
        """Takes the best of some twists if it is better."""
        rows = np.arange(len(w))
        best = np.full((len(w), 3), math.inf)
        r, nhat, mu = np.zeros((len(w), 3, 3)), np.zeros((len(w), 3, 3)), np.zeros((len(w), 3))
        for group in self._groups:
            h, places, normals = yield from result_of(_LeastSupport(group, w, self._tilt))
            for i in range(3):
                own = np.flatnonzero(group.contact == i)
                if not len(own):
                    continue
                k = own[np.round(h[:, own], _TIE).argmin(axis=1)]
                lower = h[rows, k] < best[:, i]
                best[lower, i], mu[lower, i] = h[rows, k][lower], group.mu[k][lower]
                r[lower, i], nhat[lower, i] = places[rows, k][lower], normals[rows, k][lower]
        value = best.max(axis=1) / self._norm.of(w)
        k = int(np.round(value, _TIE).argmin())
        if value[k] < self.bound:
            self._worst = _Worst(float(value[k]), w[k], r[k], nhat[k], mu[k])

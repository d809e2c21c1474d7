"""Upper bounds of what contacts withstand anywhere in regions: places where they do not.

For a fixed twist w the worst place and normal of each contact are its own affair, so that
K(w) / N(w), K the greatest over contacts of their least support, is what one placement withstands
at most. The directions in which that placement withstands least lead to a lower bound yet.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from drake_polygrasp.arrays import Array, Ints, ranges
from drake_polygrasp.certification.region_pieces import RegionPiece, padded
from drake_polygrasp.region_bounds.load_norm import LoadNorm
from drake_polygrasp.region_bounds.side_by_side import Search, Work, result_of
from drake_polygrasp.vectors import cross, dot_first, unit
from drake_polygrasp.wrenches.epsilon_bound import critical_directions
from drake_polygrasp.wrenches.region_support import (
    PlanePolygons,
    least_tilted_support,
    support_range,
    worst_centres_of_mass,
)

_DIRECTIONS, _ROUNDS = 12, 3
"""Our choice: of the worst placement's directions, and how often a worse one is looked for."""
_GAIN = 1e-3
"""Our choice, relative: a bound that falls by less is not followed further."""
_DIGITS, _TIE = 9, 11
"""Our choice: decimals of twists, and of values that are compared: less is rounding."""
_NEAR = 1e-9
"""Our choice: what is farther above a bound is neither below nor equal to it but for rounding."""
_NO_TORQUE = 1e-6
"""Our choice: divided by so little, torques are all but free."""


@dataclass(frozen=True, eq=False)
class Placeable:
    """Polygons, or single points, that contacts may be on; S of as many corners.

    Attributes:
        contact: whose each is, ascending, shape (S,).
        piece: index of the piece that each is of, shape (S,).
        polygons: from the centre of mass over rho.
        centre: a point of each, shape (3, S).
        radius: distance from that to the farthest corner, shape (S,).
        nhat: inward unit normals, shape (3, S).
        mu: friction coefficients, shape (S,).
    """

    contact: Ints
    piece: Ints
    polygons: PlanePolygons
    centre: Array
    radius: Array
    nhat: Array
    mu: Array

    @classmethod
    def joined(cls, several: Sequence[Placeable]) -> Placeable:
        """Returns the polygons of several grasps as one, grasp by grasp.

        Args:
            several: polygons of as many corners.
        """
        return cls(
            np.concatenate([each.contact for each in several]),
            np.concatenate([each.piece for each in several]),
            PlanePolygons.joined([each.polygons for each in several]),
            np.concatenate([each.centre for each in several], axis=1),
            np.concatenate([each.radius for each in several]),
            np.concatenate([each.nhat for each in several], axis=1),
            np.concatenate([each.mu for each in several]),
        )

    def with_friction(self, mu: Array) -> Placeable:
        """Returns the same polygons with other friction.

        Args:
            mu: a friction coefficient for each piece.
        """
        return replace(self, mu=mu[self.piece])


def placeable(
    regions: Sequence[Sequence[RegionPiece]], mu: Array, p_BBcm: Array, rho: float
) -> Placeable:
    """Returns flat pieces, and the corners of the others.

    Args:
        regions: pieces of the three contacts.
        mu: a friction coefficient for each piece, those of contact 1 first, shape (P,).
        p_BBcm: nominal centre of mass [m], shape (3,).
        rho: what torques are divided by [m].
    """
    pieces = [(i, piece) for i, region in enumerate(regions) for piece in region]
    places: list[Array] = []
    index: list[int] = []
    for k, (_, piece) in enumerate(pieces):
        r_V = (piece.p_BV - p_BBcm) / rho
        parts = [r_V] if piece.tan_spread == 0 else [r[None] for r in r_V]
        places += parts
        index += [k] * len(parts)
    polygons, of_piece = PlanePolygons.of(padded(places)), np.array(index)
    centre = polygons.corners.mean(axis=1)
    spokes = polygons.corners - centre[:, None]
    return Placeable(
        np.array([i for i, _ in pieces])[of_piece],
        of_piece,
        polygons,
        centre,
        np.sqrt(dot_first(spokes, spokes).max(axis=0)),
        np.stack([piece.nhat_TB_B for _, piece in pieces], axis=1)[:, of_piece],
        mu[of_piece],
    )


@dataclass(frozen=True, eq=False)
class _Worst:
    """A placement, what it withstands at most, and along which twist."""

    bound: float
    w: Array
    r: Array
    nhat: Array
    mu: Array


@dataclass(frozen=True, eq=False)
class _Lowered(Work[_Worst]):
    """Asks for the worst placement that is found from a known one and more twists.

    Attributes:
        placeable: where contacts may be.
        tilt: angle by which normals may turn [rad].
        norm: what twists are measured in.
        known: the placement.
        w: the twists, shape (K, 6).
    """

    placeable: Placeable
    tilt: float
    norm: LoadNorm
    known: _Worst
    w: Array

    def kind(self) -> Hashable:
        return self.placeable.polygons.num_corners, self.tilt

    def may_wait(self) -> bool:
        # Tilts are tried last in a search, and nothing else depends on what comes of them.
        return self.tilt > 0.0

    @classmethod
    def together(cls, works: Sequence[_Lowered]) -> list[_Worst]:
        worst = [work.known for work in works]
        going, w = list(range(len(works))), [work.w for work in works]
        for count in range(_ROUNDS + 1):
            if count:
                w = _critical_twists([works[k].norm for k in going], [worst[k] for k in going])
            known = [worst[k] for k in going]
            found = _worst_along([works[k] for k in going], known, w)
            for k, placement in zip(going, found, strict=True):
                worst[k] = placement
            pairs = zip(going, known, found, strict=True)
            going = [k for k, old, new in pairs if new.bound < old.bound * (1.0 - _GAIN)]
            if not going:
                break
        return worst


def _worst_along(
    works: Sequence[_Lowered], known: Sequence[_Worst], twists: Sequence[Array]
) -> list[_Worst]:
    """Returns the worst placement along some twists for each work, or the known one if it is worse.

    Bounds of the support show which twists and polygons may matter, mostly few. Only along those
    the least support is found; first along the most promising twist where none is known yet.
    """
    counts = np.array([len(each) for each in twists])
    w, owner = np.concatenate(twists), np.repeat(np.arange(len(works)), counts)
    reach = LoadNorm.of_each([work.norm for work in works], counts.tolist()).of(w)
    placed = Placeable.joined([work.placeable for work in works])
    ends = np.cumsum([len(work.placeable.mu) for work in works])
    polygon, twist = ranges(np.append(0, ends[:-1])[owner], ends[owner])
    contact, near = 3 * twist + placed.contact[polygon], _NEAR * reach[twist]
    pairs = w.T[:, twist], placed.nhat[:, polygon], placed.mu[polygon]
    place = placed.centre[:, polygon], placed.radius[polygon]
    low, high = support_range(pairs[0], *place, *pairs[1:], works[0].tilt)
    of_contact, of_work = _starts(contact), _starts(owner)
    matters = low <= np.minimum.reduceat(high, of_contact)[contact] + near
    lowest = np.minimum.reduceat(low, of_contact).reshape(-1, 3).max(axis=1) / reach

    bound = np.array([each.bound for each in known])
    value, mu = np.full(len(w), math.inf), np.zeros((len(w), 3))
    r, nhat = np.zeros((len(w), 3, 3)), np.zeros((len(w), 3, 3))
    is_first = np.isfinite(bound)[owner]
    is_first[_first_least(lowest, of_work)] = True
    for part in (is_first, ~is_first):
        tried = part & (lowest <= bound[owner] + _NEAR)
        rows = np.flatnonzero(tried[twist] & matters)
        if not len(rows):
            continue
        w_p, nhat_p, mu_p = (values[..., rows] for values in pairs)
        h, places, normals = least_tilted_support(
            w_p, placed.polygons.take(polygon[rows]), nhat_p, mu_p, works[0].tilt
        )
        best = _first_least(np.round(h, _TIE), _starts(contact[rows]))
        value[tried] = h[best].reshape(-1, 3).max(axis=1) / reach[tried]
        r[tried] = places[:, best].T.reshape(-1, 3, 3)
        nhat[tried] = normals[:, best].T.reshape(-1, 3, 3)
        mu[tried] = mu_p[best].reshape(-1, 3)
        bound = np.minimum(bound, np.minimum.reduceat(value, of_work))
    found = _first_least(np.round(value, _TIE), of_work)
    return [
        _Worst(float(value[k]), w[k], r[k], nhat[k], mu[k]) if value[k] < each.bound else each
        for k, each in zip(found, known, strict=True)
    ]


def _critical_twists(norms: Sequence[LoadNorm], worst: Sequence[_Worst]) -> list[Array]:
    """Returns twists along which placements withstand least, with the worst centre of mass."""
    com_error = np.array([norm.com_error for norm in norms], dtype=float)
    d = worst_centres_of_mass(np.stack([each.w for each in worst]), com_error)[:, None]
    scale = np.array([_NO_TORQUE if norm.forces_only else 1.0 for norm in norms])[:, None, None]
    r, nhat = np.stack([each.r for each in worst]), np.stack([each.nhat for each in worst])
    mu = np.stack([each.mu for each in worst])
    w, _ = critical_directions((r - d) / scale, nhat, mu, np.zeros(3), 1.0, num=_DIRECTIONS)
    w[..., 3:] /= scale
    # They turn about d; twists here turn about the nominal centre of mass.
    w[..., :3] -= cross(w[..., 3:], d)
    return list(np.round(unit(w), _DIGITS))


def _starts(owners: Ints) -> Ints:
    """Returns where each run of equal values begins."""
    return np.flatnonzero(np.concatenate([[True], owners[1:] != owners[:-1]]))


def _first_least(values: Array, starts: Ints) -> Ints:
    """Returns the index of the first least value of each run."""
    lengths = np.concatenate([starts[1:], [len(values)]]) - starts
    is_least = values == np.minimum.reduceat(values, starts).repeat(lengths)
    least = np.flatnonzero(is_least)
    return least[least.searchsorted(starts)]


class WorstPlacement:
    """The worst placement that is known of three contacts in regions.

    Attributes:
        bound: what it withstands at most, in the norm; infinite before the first twists.
        w: the twist along which that is so, shape (6,).
    """

    def __init__(self, placeable: Placeable, tilt_error: float, norm: LoadNorm) -> None:
        """Knows none yet.

        Args:
            placeable: where contacts may be.
            tilt_error: angle by which normals may turn [rad].
            norm: what twists are measured in.
        """
        self._placeable, self._tilt, self._norm = placeable, tilt_error, norm
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
        asked = _Lowered(self._placeable, self._tilt, self._norm, self._worst, w)
        self._worst = yield from result_of(asked)
        return self.bound

"""Finds one internal force that proves force closure for all placements in three regions.

Only what `exact.check_region` accepts is returned. A friction cone is an intersection of
half-spaces, and the least distance of f_i inside them is a concave function of x. It is maximised
over the plane of x with normal forces of total 1 by cutting planes: linear programs in two
variables, each with the half-spaces that the last solution violates most.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.certification.convex import find_internal_forces
from drake_polygrasp.certification.exact import MAX_TILT, narrowed_friction
from drake_polygrasp.certification.region_pieces import RegionPiece, check_pieces, padded
from drake_polygrasp.digits import EXACT, at_most, on_grid, significant
from drake_polygrasp.vectors import circle, cross, dot, times, unit
from drake_polygrasp.wrenches.contacts import contact_frames

_NUM_CORNERS = 24
"""Our choice: corners of the polygon around a disc, which are then 1 percent outside it."""
_NUM_TANGENTS, _FEWEST_TANGENTS = 768, 32
"""Our choice: half-spaces of the cone at a contact, divided among its pieces; least for a piece."""
_SHRINK = (0.9995, 0.998, 0.995, 0.99, 0.98, 0.95)
"""Our choice: fractions of the computed radius that are tried in turn."""
_RESOLVED_DIGITS = 6
"""Our choice: digits of x; more would gain less radius than the first shrinking loses."""
_KEPT, _MAX_STEPS = 12, 60
"""Our choice: half-spaces kept from one linear program to the next; most linear programs."""
_STEPS_BACK = (0.0, 1e-4, 1e-3, 1e-2)
"""Our choice: fractions of the way back to the x of the largest margin that are tried."""
_TOLERANCE = 1e-5
"""Our choice: relative error of the maximum."""
_BOUND = 10.0
"""Our choice: greatest distance of x from that of the largest margin, over the latter's length."""
_TRIPLES: Ints = np.array(list(itertools.combinations(range(_KEPT + 3 + 4), 3)))
_I = range(3)
_ONE = np.ones(1)
_LEAST_WEIGHT = 1e-300
_FACTORS = np.array(
    [
        [[-1.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        [[1.0, 0.0, 0.0], [-1.0, 0.0, -1.0], [0.0, 0.0, 1.0]],
        [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, -1.0]],
    ]
)
"""f_i is the sum over k of (_FACTORS[i, k] . x) p_BC[k]."""


@dataclass(frozen=True, eq=False)
class DiscPolygon:
    """A polygon around a disc in a planar face.

    Attributes:
        p_BV: corners, counter-clockwise about the normal [m], shape (n, 3).
        nhat_TB_B: inward unit normal, shape (3,).
        tan_spread: 0, because the face is planar.
    """

    p_BV: Array
    nhat_TB_B: Array
    tan_spread: float = 0.0


@dataclass(frozen=True, eq=False)
class CertifiedRegions:
    """A proof that a grasp is force closure for all placements of its contacts in three regions.

    Attributes:
        internal_force: x_12, x_13, x_23 [1/m], shape (3,), one for all placements.
        regions: for each contact the pieces whose union it may be in.
        placement_error: distance by which each contact may be off [m], shape (3,), for which its
            region was made.
        tilt_error: greatest angle between normals and the surface's [rad].
        friction_error: greatest relative loss of friction coefficients.
    """

    internal_force: Array
    regions: tuple[tuple[RegionPiece, ...], ...]
    placement_error: Array
    tilt_error: float
    friction_error: float


def certify_regions(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    regions: Sequence[Sequence[RegionPiece]],
    *,
    placement_error: Array,
    tilt_error: float = 0.0,
    friction_error: float = 0.0,
) -> CertifiedRegions | None:
    """Proves a grasp for all placements of its contacts in given regions.

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, shape (3,).
        regions: the pieces of each contact's region, rounded as a file will state them.
        placement_error: distances for which the regions were made [m], shape (3,).
        tilt_error: greatest angle between normals and the surface's [rad].
        friction_error: greatest relative loss of friction coefficients.

    Returns:
        The certificate, exactly checked; None if no x is found that passes.
    """
    errors = tilt_error, friction_error
    search = _search(p_BC, nhat_TB_B, mu, regions, *errors)
    found = None if search is None else search.maximum(as_scale=False)
    if found is None or not check_pieces(regions, mu, found[0], *errors).ok:
        return None
    kept = tuple(tuple(region) for region in regions)
    return CertifiedRegions(found[0], kept, frozen(placement_error), *errors)


def largest_certified_radius(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    radii: Array,
    *,
    size: float,
    tilt_error: float = 0.0,
    friction_error: float = 0.0,
) -> CertifiedRegions | None:
    """Proves a grasp for the largest discs about contacts on planar faces, in given proportions.

    Args:
        p_BC: contact points [m], shape (3, 3).
        nhat_TB_B: inward unit normals, shape (3, 3).
        mu: friction coefficients, shape (3,).
        radii: greatest useful radii [m], positive, shape (3,); all are scaled by one factor.
        size: diameter of the object [m]; corners keep twelve digits of it.
        tilt_error: greatest angle between normals and the surface's [rad].
        friction_error: greatest relative loss of friction coefficients.

    Returns:
        The certificate, exactly checked, with the proved radii as its placement error; None if no x
        is found that passes.
    """
    errors = tilt_error, friction_error
    search = _search(p_BC, nhat_TB_B, mu, _discs(p_BC, nhat_TB_B, radii, size), *errors)
    found = None if search is None else search.maximum(as_scale=True)
    if found is None:
        return None
    x, scale = found
    for part in _SHRINK:
        reached = np.array([at_most(min(part * scale, 1.0) * r) for r in radii.tolist()])
        discs = _discs(p_BC, nhat_TB_B, reached, size)
        if check_pieces(discs, mu, x, *errors).ok:
            return CertifiedRegions(x, discs, frozen(reached), *errors)
    return None


def _discs(
    p_BC: Array, nhat_TB_B: Array, radii: Array, size: float
) -> tuple[tuple[RegionPiece, ...], ...]:
    frames = contact_frames(p_BC[None], nhat_TB_B[None])[0]
    ring = circle(2 * np.pi * np.arange(_NUM_CORNERS) / _NUM_CORNERS) / np.cos(np.pi / _NUM_CORNERS)
    # Wider by more than the rounding of the corners.
    widths = radii * (1 + 1e-9) + size * 1e-11
    return tuple(
        (DiscPolygon(frozen(on_grid(p + w * times(ring, frame[1:]), size, EXACT)), frozen(n)),)
        for p, n, w, frame in zip(p_BC, nhat_TB_B, widths, frames, strict=True)
    )


@dataclass(frozen=True, eq=False)
class _Search:
    """The R half-spaces u.f_i > 0 of all pieces of all contacts, as functions of x.

    Attributes:
        nominal: u.f_i is nominal . x for contacts at their nominal points c, shape (R, 3).
        lowest: least u.(p - c_k) over corners p of region k, shape (R, 3).
        highest: greatest u.(p - c_k), shape (R, 3).
        factors: coefficients of u.(p - c_k) in u.f_i are factors @ x, shape (R, 3, 3).
        contact: contact i of each half-space, shape (R,).
        push: the total normal force is push . x for contacts at c, shape (3,).
        start: x of the largest margin at c, shape (3,).
    """

    nominal: Array
    lowest: Array
    highest: Array
    factors: Array
    contact: Ints
    push: Array
    start: Array

    def loss(self, x: Array) -> Array:
        """Returns the greatest loss of u.f_i in the regions: loss . x near x, shape (R, 3)."""
        at_worst = np.where(times(self.factors, x) > 0, self.lowest, self.highest)
        loss: Array = -np.einsum("rk,rkx->rx", at_worst, self.factors)
        return loss

    def maximum(self, *, as_scale: bool) -> tuple[Array, float] | None:
        """Finds the x that allows the largest scale of the regions, or has the most room in them.

        Returns:
            x, rounded and with total normal force 1, and that scale or room; None if neither is
            positive.
        """
        x = best = self.start
        most = -np.inf
        rows: Ints = np.concatenate([self._of(i)[:: max(1, len(self._of(i)) // 4)][:4] for i in _I])
        losses = self.loss(x)[rows]
        for _ in range(_MAX_STEPS):
            loss = self.loss(x)
            value = self._value(x, as_scale)
            if float(value.min()) > most:
                best, most = x, float(value.min())
            new = np.array([self._of(i)[value[self._of(i)].argmin()] for i in _I])
            rows, losses = np.concatenate([rows, new]), np.concatenate([losses, loss[new]])
            scale = most if as_scale else 1.0
            weights = np.maximum(times(losses, best), _LEAST_WEIGHT) if as_scale else _ONE
            planes = self.nominal[rows] - scale * losses
            x, room = self._most_room(planes, np.broadcast_to(weights, len(rows)))
            # Losses are convex in x, so the planes at any x bound the room from above.
            if not as_scale and max(float(room.min()), most) <= 0:
                return None
            missing = float(room.min()) if as_scale else float(room.min()) - most
            if missing <= _TOLERANCE * (most if as_scale else 1.0):
                break
            kept = np.argsort(room, kind="stable")[:_KEPT]
            rows, losses = rows[kept], losses[kept]
        # The best x may leave one contact without force, and zero is strictly inside no cone.
        tried = [self._printed(best + part * (self.start - best)) for part in _STEPS_BACK]
        reached = [float(self._value(x, as_scale).min()) for x in tried]
        k = int(np.argmax(reached))
        return (tried[k], reached[k]) if reached[k] > 0 else None

    def _printed(self, x: Array) -> Array:
        rounded = np.round(x / np.abs(x).max(), _RESOLVED_DIGITS)
        return frozen(significant(rounded / float(dot(self.push, rounded))))

    def _of(self, i: int) -> Ints:
        rows: Ints = np.flatnonzero(self.contact == i)
        return rows

    def _value(self, x: Array, as_scale: bool) -> Array:
        gain, cost = times(self.nominal, x), times(self.loss(x), x)
        value: Array = gain / np.maximum(cost, _LEAST_WEIGHT) if as_scale else gain - cost
        return value

    def _most_room(self, planes: Array, weights: Array) -> tuple[Array, Array]:
        """Maximises the least of planes . x / weights; returns x and these _KEPT + 3 quotients."""
        across = _across(self.push)
        span = _BOUND * float(np.sqrt(dot(self.start, self.start)))
        offset = np.concatenate([times(planes, self.start), np.full(4, span)])
        slope = np.zeros((len(offset), 3))
        slope[:-4, :2], slope[:-4, 2] = times(planes, across.T), -weights
        slope[-4:, :2] = [[1, 0], [-1, 0], [0, 1], [0, -1]]
        r, a = slope[_TRIPLES], offset[_TRIPLES]
        normals = np.stack([cross(r[:, j - 2], r[:, j - 1]) for j in range(3)], axis=1)
        with np.errstate(all="ignore"):
            y = -(a[..., None] * normals).sum(axis=1) / dot(r[:, 0], normals[:, 0])[:, None]
        is_met = np.isfinite(y).all(axis=1) & (np.abs(y[:, :2]) <= span * (1 + 1e-9)).all(axis=1)
        x = self.start + times(np.where(is_met[:, None], y[:, :2], 0.0), across)
        room = times(x, planes.T) / weights
        k = int(room.min(axis=1).argmax())
        return x[k], room[k]


def _across(vectors: Array) -> Array:
    """Returns two unit vectors orthogonal to vectors (..., 3) and each other, (..., 2, 3)."""
    first = unit(cross(vectors, np.eye(3)[np.abs(vectors).argmin(axis=-1)]))
    return np.stack([first, unit(cross(vectors, first))], axis=-2)


def _search(
    p_BC: Array,
    nhat_TB_B: Array,
    mu: Array,
    regions: Sequence[Sequence[RegionPiece]],
    tilt_error: float,
    friction_error: float,
) -> _Search | None:
    """Prepares the search; None if the errors leave no friction, or no x for nominal contacts."""
    if not (0 <= tilt_error <= MAX_TILT and 0 <= friction_error < 1):
        return None
    errors = tilt_error, friction_error
    pieces = [(i, piece) for i, region in enumerate(regions) for piece in region]
    kinds = [(float(mu[i]), piece.tan_spread) for i, piece in pieces]
    left = {(m, s): float(narrowed_friction(m, *errors, s)) for m, s in dict.fromkeys(kinds)}
    if min(left.values()) <= 0:
        return None
    contact, friction = np.array([i for i, _ in pieces]), np.array([left[kind] for kind in kinds])
    widest = np.array([friction[contact == i].max() for i in _I])
    start = find_internal_forces(p_BC[None], nhat_TB_B[None], widest[None])[0]
    if not np.isfinite(start).all():
        return None
    num_tangents = max(_NUM_TANGENTS // max(map(len, regions)), _FEWEST_TANGENTS)
    turns = circle(2 * np.pi * np.arange(num_tangents) / num_tangents)
    normals = np.stack([piece.nhat_TB_B for _, piece in pieces])
    u = friction[:, None, None] * normals[:, None] + np.einsum(
        "tj,pji->pti", turns, _across(normals)
    )
    extents = _extents(u, contact, [piece.p_BV - p_BC[i] for i, piece in pieces])
    centred = p_BC - p_BC.mean(axis=0)
    owners = np.repeat(contact, num_tangents)
    nominal = np.einsum("rk,rkx->rx", times(u.reshape(-1, 3), centred.T), _FACTORS[owners])
    push = sum((times(times(n, centred.T), f) for n, f in zip(nhat_TB_B, _FACTORS, strict=True)))
    return _Search(
        nominal=nominal,
        lowest=extents[0],
        highest=extents[1],
        factors=_FACTORS[owners],
        contact=owners,
        push=np.asarray(push),
        start=start,
    )


def _extents(u: Array, contact: Ints, corners: Sequence[Array]) -> tuple[Array, Array]:
    """Returns how far regions extend along directions of pieces.

    Args:
        u: directions of each piece, shape (P, T, 3).
        contact: whose each piece is, shape (P,).
        corners: of each piece, from its contact's nominal point [m], shapes (V, 3).

    Returns:
        The least and greatest u.p over the region of each contact [m], shape (P T, 3); over the
        piece alone for its own contact.
    """
    low, high = np.empty((2, *u.shape[:2], 3))
    for k in _I:
        p = np.concatenate([c for c, i in zip(corners, contact, strict=True) if i == k])
        along = times(u[contact != k], p.T)
        low[contact != k, :, k], high[contact != k, :, k] = along.min(-1), along.max(-1)
    own = np.einsum("ptk,pvk->ptv", u, padded(corners))
    rows = np.arange(len(u))
    low[rows, :, contact], high[rows, :, contact] = own.min(-1), own.max(-1)
    return low.reshape(-1, 3), high.reshape(-1, 3)

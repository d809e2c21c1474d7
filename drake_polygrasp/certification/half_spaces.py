"""Maximises the room, or the scale, that half-spaces leave to internal forces, for many grasps.

The least distance of f_i inside half-spaces is a concave function of x. It is maximised over the
plane of x with normal forces of total 1 by cutting planes: linear programs in two variables, each
with the half-spaces that the last solution violates most. Grasps take these steps side by side, and
each gets what it gets alone.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Batch, Bools, Ints
from drake_polygrasp.digits import significant
from drake_polygrasp.vectors import cross, cross_first, dot, unit

FACTORS = np.array(
    [
        [[-1.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        [[1.0, 0.0, 0.0], [-1.0, 0.0, -1.0], [0.0, 0.0, 1.0]],
        [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, -1.0]],
    ]
)
"""f_i is the sum over k of (FACTORS[i, k] . x) p_BC[k]."""
_RESOLVED_DIGITS = 6
"""Our choice: digits of x; more would gain less radius than the first shrinking loses."""
_KEPT, _NEW, _MAX_STEPS = 12, 3, 60
"""Our choice: half-spaces kept from one linear program to the next, those added to them, one of
each contact, and most linear programs."""
_STEPS_BACK = (0.0, 1e-4, 1e-3, 1e-2)
"""Our choice: fractions of the way back to the x of the largest margin that are tried."""
_TOLERANCE = 1e-5
"""Our choice: relative error of the maximum."""
_BOUND = 10.0
"""Our choice: greatest distance of x from that of the largest margin, over the latter's length."""
_LEAST_WEIGHT = 1e-300
_SQUARE = np.array([[1.0, -1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -1.0]])
"""Inward normals of the sides of the square that bounds x."""
_CORNERS: Ints = np.array(list(itertools.combinations(range(_KEPT + _NEW + 4), 3))).T
"""The planes that meet at each corner of a linear program: kept ones, new ones and the square."""
_NEW_CORNERS = _CORNERS[:, ((_CORNERS >= _KEPT) & (_CORNERS < _KEPT + _NEW)).any(axis=0)]
"""Those on a new plane."""


@dataclass(frozen=True, eq=False)
class _Losses(Batch):
    """The greatest losses of u.f_i in the regions, as functions of x.

    Attributes:
        signs: whether the factor of each contact point in each f_i is positive, shape (N, S, 3).
        loss: the greatest loss is loss . x for all x with these signs, shape (N, S, 3, T).
    """

    signs: Bools
    loss: Array


@dataclass(frozen=True, eq=False)
class HalfSpaces(Batch):
    """The half-spaces u.f_i > 0 of N grasps, T for each of S pieces, as functions of x.

    Attributes:
        nominal: u.f_i is nominal . x for contacts at their nominal points c, shape (N, S, 3, T).
        lowest: least u.(p - c_k) over corners p of region k [m], shape (N, S, 3, T).
        highest: greatest u.(p - c_k) [m], shape (N, S, 3, T).
        contact: contact i of each piece, ascending, the same for all grasps, shape (N, S).
        push: the total normal force is push . x for contacts at c [m], shape (N, 3).
        start: x of the largest margin at c [1/m], shape (N, 3).
    """

    nominal: Array
    lowest: Array
    highest: Array
    contact: Ints
    push: Array
    start: Array

    def greatest(self, *, as_scale: bool) -> tuple[Array, Array]:
        """Finds the x that has the most room, or allows the largest scale of the regions.

        Args:
            as_scale: whether the largest scale is wanted.

        Returns:
            For each grasp x [1/m], shape (N, 3), rounded and with total normal force 1, and that
            room or scale, shape (N,): minus infinity where the linear programs leave none.
        """
        best, most = self.start.copy(), np.full(len(self.start), -np.inf)
        is_open, is_lost = np.full(len(best), True), np.full(len(best), False)
        here, x, corners = self, self.start, _CORNERS
        worst, rows = self._losses(x), self._first_rows()
        losses = _at(worst.loss, rows)
        for _ in range(_MAX_STEPS):
            worst = here._losses(x, worst)
            value = here._value(worst, x, as_scale)
            reached = value.min(axis=(1, 2))
            better = reached > most[is_open]
            best[is_open] = np.where(better[:, None], x, best[is_open])
            most[is_open] = highest = np.where(better, reached, most[is_open])
            new = here._worst_rows(value)
            rows = np.concatenate([rows, new], axis=1)
            losses = np.concatenate([losses, _at(worst.loss, new)], axis=1)
            planes, weights = _at(here.nominal, rows), np.ones(rows.shape)
            if as_scale:
                planes = planes - highest[:, None, None] * losses
                weights = np.maximum(_along(losses, best[is_open]), _LEAST_WEIGHT)
            else:
                planes = planes - losses
            x, room = _most_room(planes, weights, here.push, here.start, corners)
            # Losses are convex in x, so the planes at any x bound the room from above.
            bound = room.min(axis=1)
            if as_scale:
                ended = bound <= _TOLERANCE * highest
            else:
                is_lost[is_open] = lost = np.maximum(bound, highest) <= 0
                ended = lost | (bound - highest <= _TOLERANCE)
                # The planes stay: as the last x is beyond a new one, the next is on a new one.
                corners = _NEW_CORNERS
            is_open[is_open] = stay = ~ended
            if not stay.any():
                break
            kept = np.argsort(room, axis=1, kind="stable")[:, :_KEPT]
            rows = np.take_along_axis(rows, kept, axis=1)
            losses = np.take_along_axis(losses, kept[..., None], axis=1)
            if ended.any():
                here, worst = here.take(stay), worst.take(stay)
                x, rows, losses = x[stay], rows[stay], losses[stay]
        x, reached = self._printed(best, as_scale)
        return x, np.where(is_lost, -np.inf, reached)

    def _printed(self, best: Array, as_scale: bool) -> tuple[Array, Array]:
        """Returns rounded x near given ones, and the room or scale that they leave.

        The best x may leave one contact without force, and zero is strictly inside no cone.
        """
        tried, reached, worst = [], [], None
        for part in _STEPS_BACK:
            x = best + part * (self.start - best)
            rounded = np.round(x / np.abs(x).max(axis=1, keepdims=True), _RESOLVED_DIGITS)
            x = significant(rounded / dot(self.push, rounded)[:, None])
            worst = self._losses(x, worst)
            tried.append(x)
            reached.append(self._value(worst, x, as_scale).min(axis=(1, 2)))
        n, k = np.arange(len(best)), np.argmax(reached, axis=0)
        return np.stack(tried)[k, n], np.stack(reached)[k, n]

    def _losses(self, x: Array, last: _Losses | None = None) -> _Losses:
        """Returns the greatest losses near x; only signs that differ from the last ones cost time.

        Args:
            x: shape (N, 3).
            last: the losses near another x; None if there are none.
        """
        factors = FACTORS[self.contact]
        signs = np.einsum("nskx,nx->nsk", factors, x) > 0
        if last is not None:
            changed = (signs != last.signs).any(axis=(1, 2))
            if not changed.any():
                return last
            if not changed.all():
                loss = last.loss.copy()
                loss[changed] = self.take(changed)._losses(x[changed]).loss
                return _Losses(signs, loss)
        at_worst = np.where(signs[..., None], self.lowest, self.highest)
        return _Losses(signs, np.einsum("nskt,nskx->nsxt", at_worst, -factors))

    def _value(self, worst: _Losses, x: Array, as_scale: bool) -> Array:
        """Returns the room, or the scale, that each half-space leaves, shape (N, S, T)."""
        gain = np.einsum("nsxt,nx->nst", self.nominal, x)
        cost = np.einsum("nsxt,nx->nst", worst.loss, x)
        value: Array = gain / np.maximum(cost, _LEAST_WEIGHT) if as_scale else gain - cost
        return value

    def _first_rows(self) -> Ints:
        """Returns four half-spaces of each contact to start with, shape (N, 12)."""
        sizes = np.bincount(self.contact[0]) * self.nominal.shape[-1]
        starts = np.cumsum(sizes) - sizes
        rows = starts[:, None] + np.arange(_KEPT // 3) * (sizes // (_KEPT // 3))[:, None]
        return np.tile(rows.ravel(), (len(self.contact), 1))

    def _worst_rows(self, value: Array) -> Ints:
        """Returns the half-space of least value of each contact, shape (N, 3)."""
        tangent, least = value.argmin(axis=2), value.min(axis=2)
        own = self.contact[:, None] == np.arange(3)[:, None]
        piece = np.where(own, least[:, None], np.inf).argmin(axis=2)
        rows: Ints = piece * value.shape[2] + np.take_along_axis(tangent, piece, axis=1)
        return rows


def tangents_of(normals: Array) -> Array:
    """Returns two unit vectors orthogonal to given vectors and to each other.

    Args:
        normals: vectors, shape (..., 3).

    Returns:
        The unit vectors, shape (..., 2, 3).
    """
    first = unit(cross(normals, np.eye(3)[np.abs(normals).argmin(axis=-1)]))
    return np.stack([first, unit(cross(normals, first))], axis=-2)


def _at(functions: Array, rows: Ints) -> Array:
    """Returns functions (N, S, 3, T) of half-spaces of index s T + t, shape (N, R, 3)."""
    piece, tangent = np.divmod(rows, functions.shape[-1])
    chosen: Array = functions[np.arange(len(rows))[:, None], piece, :, tangent]
    return chosen


def _most_room(
    planes: Array, weights: Array, push: Array, start: Array, corners: Ints
) -> tuple[Array, Array]:
    """Maximises the least of planes . x / weights over x = start + y . across.

    Args:
        planes: functions of x, shape (N, R, 3).
        weights: what their values are divided by, shape (N, R).
        push: what both rows of `across` are orthogonal to, shape (N, 3).
        start: shape (N, 3).
        corners: the planes of each corner that may be the maximum; those of the square follow the
            R given ones; shape (3, K).

    Returns:
        x, shape (N, 3), and the R quotients there, shape (N, R).
    """
    across = tangents_of(push)
    span = _BOUND * np.sqrt(dot(start, start))[:, None]
    # Each plane is offset + slope . (y, room) >= 0.
    offset = np.concatenate([_along(planes, start), np.broadcast_to(span, (len(span), 4))], axis=1)
    slope = np.zeros((3, *offset.shape))
    slope[:2, :, :-4] = np.einsum("nrx,nax->anr", planes, across)
    slope[2, :, :-4] = -weights
    slope[:2, :, -4:] = _SQUARE[:, None]
    r, a = [slope[..., plane] for plane in corners], [offset[:, plane] for plane in corners]
    normals = [cross_first(r[j - 2], r[j - 1]) for j in range(3)]
    with np.errstate(all="ignore"):
        y = -(a[0] * normals[0] + a[1] * normals[1] + a[2] * normals[2])
        y /= np.einsum("xnk,xnk->nk", r[0], normals[0])
    is_met = np.isfinite(y).all(axis=0) & (np.abs(y[:2]) <= span * (1 + 1e-9)).all(axis=0)
    x = start[..., None] + np.einsum("ank,nax->nxk", np.where(is_met, y[:2], 0.0), across)
    room = np.einsum("nxk,nrx->nrk", x, planes)
    room /= weights[..., None]
    n, k = np.arange(len(start)), room.min(axis=1).argmax(axis=1)
    return x[n, :, k], room[n, :, k]


def _along(planes: Array, x: Array) -> Array:
    """Returns functions (N, R, 3) of x, one (N, 3) for each grasp, shape (N, R)."""
    values: Array = np.einsum("xnr,nx->nr", np.moveaxis(planes, -1, 0).copy(), x)
    return values

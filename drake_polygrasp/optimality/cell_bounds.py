"""Beyond the paper: bounds of epsilon that hold wherever contacts lie in three triangular cells.

epsilon is the least h(w) over unit w (see face_support.py), and h_i is convex in the place of
contact i, so over a cell it is greatest at a corner. Two bounds follow for a triple of cells:

- One direction: h(w) is at most the greatest h_i(w) over cells and corners, which is the support
  function of the nine discs at the corners. A descent looks for the w at which it is least. The
  error is proportional to the size of the cells.
- Directions that turn with the contacts: w(c) = w_0 + B (c - c_0), with w_0 . B = 0 so that
  |w(c)| >= 1. Then epsilon <= h(w(c); c). The velocity at contact i is linear in each of the three
  places but for the term B_i (c_i - c_i0) x (c_i - c_i0), which differs from its interpolation
  between the corners by at most a third of its value along an edge. So h(w(c); c) <=
  sum_m lambda_m F_m, where F_m are its values at the 27 triples of corners plus that remainder,
  and lambda are the weights that interpolate c. The same lambda serve all directions, so any
  weights nu of directions give the bound max_m sum_k nu_k F_km, and a matrix game finds the best
  nu. With B chosen to keep the three h_i equal, the error is quadratic in the size of the cells.

Positions are relative to the centre of mass and divided by rho, so a direction is a twist.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Batch, Ints
from drake_polygrasp.geometry.regions import Regions
from drake_polygrasp.search.face_support import contacts_on
from drake_polygrasp.vectors import cross
from drake_polygrasp.wrenches.contacts import force_closure
from drake_polygrasp.wrenches.epsilon_bound import critical_directions

KEPT = 12
"""Our choice: number of directions that the halves of a cell start from."""
TURNING = 8
"""Our choice: number of directions that turn with the contacts."""
STARTS = 4
"""Our choice: known directions that the descent starts from; twice as many are drawn at random."""
_DRAWN = np.random.default_rng(0).normal(size=(128, 6))
_STEPS = np.geomspace(0.3, 0.003, 20)
_SOFTNESS = np.geomspace(0.5, 0.003, 20)
_CORNERS = np.indices((3, 3, 3)).reshape(3, 27)
_GAME_STEPS = 12
"""Our choice: further steps lower bounds by less than a thousandth."""
_TINY = 1e-12


@dataclass(frozen=True, eq=False)
class CellTriples(Batch):
    """Triples of triangular cells on regions, one a row, and what is known of the grasps in them.

    Attributes:
        region: region of each cell, shape (N, 3).
        r_CmV: corners from the centre of mass, divided by rho, expressed in B, shape (N, 3 cells,
            3 corners, 3).
        bound: upper bound of epsilon of all grasps in the triple, shape (N,).
        w: unit directions that give low bounds, shape (N, KEPT, 6).
    """

    region: Ints
    r_CmV: Array
    bound: Array
    w: Array

    @property
    def middle(self) -> Array:
        """The cells' centroids, as `r_CmV`, shape (N, 3, 3)."""
        centroid: Array = self.r_CmV.mean(axis=2)
        return centroid


def bounded(regions: Regions, cells: CellTriples, threshold: float) -> tuple[CellTriples, Array]:
    """Lowers the bounds of triples of cells, no further than needed to fall below a threshold.

    Args:
        regions: where the cells lie.
        cells: N triples of cells.
        threshold: bounds at or below this are not lowered further.

    Returns:
        The triples with their new bounds, and a close upper estimate of epsilon of contacts in the
        middles of the cells, 0 where these are not force closure, shape (N,).
    """
    contacts = contacts_on(regions, cells.region, cells.middle)
    critical, estimate = critical_directions(*contacts, np.zeros(3), 1.0, TURNING)
    estimate = np.where(force_closure(*contacts), estimate, 0.0)
    discs = _corner_discs(regions, cells)
    w = np.concatenate([cells.w, critical], axis=1)
    h = _highest(discs, w)
    bound = np.minimum(cells.bound, h.min(axis=1))
    kept = _least(w, h, KEPT)

    rows = np.flatnonzero(bound > threshold)
    some, w, h = discs[rows], w[rows], h[rows]
    found = _descended(some, _starts(some, w, h))
    w, h = np.concatenate([w, found], axis=1), np.concatenate([h, _highest(some, found)], axis=1)
    bound[rows] = np.minimum(bound[rows], h.min(axis=1))
    kept[rows] = _least(w, h, KEPT)

    rows = np.flatnonzero(bound > threshold)
    open_ = cells.take(rows)
    turn = turning(regions, open_, critical[rows])
    F = [
        corner_values(regions, open_, critical[rows], turn),
        corner_values(regions, open_, kept[rows, :STARTS], None),
    ]
    bound[rows] = np.minimum(bound[rows], game_bound(np.concatenate(F, axis=1)))
    return CellTriples(cells.region, cells.r_CmV, np.maximum(bound, 0.0), kept), estimate


def _corner_discs(regions: Regions, cells: CellTriples) -> Array:
    """Computes the wrenches of nhat, mu t_1 and mu t_2 at the nine corners, shape (N, 9, 3, 6)."""
    R_BF, mu = regions.R_BF[cells.region], regions.mu[cells.region][..., None]
    force = np.stack([-R_BF[..., 2], mu * R_BF[..., 0], mu * R_BF[..., 1]], axis=2)
    torque = cross(cells.r_CmV[:, :, :, None], force[:, :, None])
    force = np.broadcast_to(force[:, :, None], torque.shape)
    discs: Array = np.concatenate([force, torque], axis=-1).reshape(-1, 9, 3, 6)
    return discs


def _rows(discs: Array, w: Array) -> Array:
    N, D = discs.shape[:2]
    rows: Array = (w @ discs.reshape(N, 3 * D, 6).transpose(0, 2, 1)).reshape(N, w.shape[1], D, 3)
    return rows


def _highest(discs: Array, w: Array) -> Array:
    """Computes h(w) of the hull of discs (N, D, 3, 6) in directions (N, K, 6), shape (N, K)."""
    rows = _rows(discs, w)
    h: Array = (rows[..., 0] + np.hypot(rows[..., 1], rows[..., 2])).max(axis=-1)
    return h


def _least(w: Array, h: Array, num: int) -> Array:
    order = np.argsort(h, axis=1, kind="stable")[:, :num]
    return np.take_along_axis(w, order[..., None], axis=1)


def _moment(discs: Array) -> Array:
    """Computes the second moment of the discs' wrenches, a metric in which their hull is round."""
    moment = np.einsum("nari,narj,r->nij", discs, discs, (1.0, 0.5, 0.5), optimize=True)
    floor = 1e-9 * np.trace(moment, axis1=1, axis2=2)
    whole: Array = moment + floor[:, None, None] * np.eye(6)
    return whole


def _starts(discs: Array, w: Array, h: Array) -> Array:
    """Selects the best of directions w and of others drawn evenly in the hull's metric."""
    drawn = _DRAWN @ np.linalg.inv(np.linalg.cholesky(_moment(discs)))
    drawn /= np.linalg.norm(drawn, axis=-1, keepdims=True)
    others = _least(drawn, _highest(discs, drawn), 2 * STARTS)
    return np.concatenate([_least(w, h, STARTS), others], axis=1)


def _descended(discs: Array, w: Array) -> Array:
    """Descends from directions w along gradients of h that is smoothed less and less."""
    moment = _moment(discs)
    inverse = np.linalg.inv(moment)
    flat = discs.reshape(len(discs), 3 * discs.shape[1], 6)

    def length(a: Array) -> Array:
        square = ((a @ moment) * a).sum(-1, keepdims=True)
        root: Array = np.sqrt(np.maximum(square, _TINY**2))
        return root

    best, least = w, _highest(discs, w)
    w = w / length(w)
    for step, softness in zip(_STEPS, _SOFTNESS, strict=True):
        rows = _rows(discs, w)
        tangential = np.hypot(rows[..., 1], rows[..., 2]) + _TINY
        h = rows[..., 0] + tangential
        highest = h.max(axis=-1, keepdims=True)
        norm = np.linalg.norm(w, axis=-1, keepdims=True)
        lower = (highest / norm)[..., 0] < least
        least = np.where(lower, (highest / norm)[..., 0], least)
        best = np.where(lower[..., None], w / norm, best)
        weights = np.exp((h - highest) / (softness * np.abs(highest) + 1e-9))
        weights /= weights.sum(axis=-1, keepdims=True)
        value = (weights * h).sum(axis=-1, keepdims=True)
        rows[..., 1:] *= (weights / tangential)[..., None]
        rows[..., 0] = weights
        slope = rows.reshape(*w.shape[:2], flat.shape[1]) @ flat
        descent = (slope - value * w / norm**2) @ inverse
        w = w - step * descent / length(descent)
        w /= length(w)
    last = w / np.linalg.norm(w, axis=-1, keepdims=True)
    lower = _highest(discs, last) < least
    return np.where(lower[..., None], last, best)


def turning(regions: Regions, cells: CellTriples, w: Array) -> Array:
    """Computes how directions should turn so that, as contacts move, the three h_i stay equal.

    A least-squares problem weighs the changes of the differences of the h_i, and of the tangential
    velocity at each contact, above all where it is nearly zero, because h_i has a kink there.

    Args:
        regions: where the cells lie.
        cells: N triples of cells.
        w: unit directions, shape (N, K, 6).

    Returns:
        B, the derivative of w by the contacts' places, shape (N, K, 6, 3 contacts, 3), with
        w . B = 0.
    """
    N, K = w.shape[:2]
    r_0 = cells.middle[:, None]
    nhat, mu = regions.nhat_TB_B[cells.region][:, None], regions.mu[cells.region][:, None]
    shape = (N, K, 3, 3)
    size = np.linalg.norm(cells.r_CmV - r_0[:, 0, :, None], axis=-1).max(axis=(1, 2))
    size = size[:, None, None]
    v, omega = w[..., None, :3], np.broadcast_to(w[..., None, 3:], shape)
    g = v + cross(omega, r_0)
    tangential = g - (nhat * g).sum(-1, keepdims=True) * nhat
    speed = np.linalg.norm(tangential, axis=-1)
    force = nhat + mu[..., None] * tangential / (speed + 1e-3 * size + _TINY)[..., None]

    axes = np.moveaxis(regions.R_BF[cells.region][:, None, :, :, :2], -1, 0)
    axes = axes * (mu * size / (speed + size + _TINY))[..., None]
    # Derivatives of a force's power at a contact by w and by the contact's place.
    forces = [force, *axes]
    by_w = [np.concatenate([f, cross(np.broadcast_to(r_0, shape), f)], axis=-1) for f in forces]
    by_c = [cross(f, omega) for f in forces]
    J, C = np.zeros((N, K, 10, 6)), np.zeros((N, K, 10, 3, 3))
    for i, j in ((0, 1), (1, 2), (2, 0)):
        J[:, :, i] = by_w[0][:, :, i] - by_w[0][:, :, j]
        C[:, :, i, i], C[:, :, i, j] = by_c[0][:, :, i], -by_c[0][:, :, j]
        for axis in (1, 2):
            J[:, :, 3 * axis + i] = by_w[axis][:, :, i]
            C[:, :, 3 * axis + i, i] = by_c[axis][:, :, i]
    J[:, :, 9] = w
    J_T = J.transpose(0, 1, 3, 2)
    free = -np.linalg.solve(J_T @ J + 1e-6 * np.eye(6), J_T @ C.reshape(N, K, 10, 9))
    B: Array = free - w[..., None] * (w[..., None, :] @ free)
    return B.reshape(N, K, 6, 3, 3)


def corner_values(regions: Regions, cells: CellTriples, w: Array, B: Array | None) -> Array:
    """Computes F, upper bounds of h at the 27 triples of corners with the remainder of turning.

    Args:
        regions: where the cells lie.
        cells: N triples of cells.
        w: unit directions at the middles of the cells, shape (N, K, 6).
        B: derivative of w from `turning`; None for directions that do not turn.

    Returns:
        F, shape (N, K, 27).
    """
    nhat, mu = regions.nhat_TB_B[cells.region], regions.mu[cells.region]
    w = w[:, :, None]
    remainder = np.zeros((*w.shape[:2], 3))
    if B is not None:
        offset = cells.r_CmV - cells.middle[:, :, None]
        edge = np.roll(offset, -1, axis=2) - offset
        spin = np.einsum("nkaic,nivc->nkiva", B[:, :, 3:], edge, optimize=True)
        bend = np.linalg.norm(cross(spin, edge[:, None]), axis=-1).max(axis=-1) / 3
        remainder = np.sqrt(1 + mu**2)[:, None] * bend
        turned = np.einsum("nkaic,nivc->nkiva", B, offset, optimize=True)
        for i in range(3):
            w = w + turned[:, :, i, _CORNERS[i]]
    F = np.full((*w.shape[:2], 27), -np.inf)
    for i in range(3):
        r = cells.r_CmV[:, None, i, _CORNERS[i]]
        g = w[..., :3] + cross(w[..., 3:], r)
        normal = (g @ nhat[:, None, i, :, None])[..., 0]
        tangential = np.sqrt(np.maximum((g * g).sum(-1) - normal**2, 0.0))
        h = normal + mu[:, None, i, None] * tangential + remainder[:, :, i, None]
        F = np.maximum(F, h)
    return F


def game_bound(F: Array) -> Array:
    """Bounds the value of matrix games from above: min over weights nu of max_m sum_k nu_k F_km.

    An interior-point method approaches the minimum. Every step has valid weights, so the result is
    a bound however far it gets.

    Args:
        F: values of K directions at M triples of corners, shape (N, K, M).

    Returns:
        The bounds, shape (N,).
    """
    N, K, _ = F.shape
    lowest = F.min(axis=(1, 2), keepdims=True)
    scale = F.max(axis=(1, 2), keepdims=True) - lowest + _TINY
    A = (F - lowest) / scale
    best = A.max(axis=2).min(axis=1)
    nu, t, barrier = np.full((N, K), 1.0 / K), np.full(N, 2.0), 0.1
    diagonal = np.arange(K)
    system, right = np.zeros((N, K + 2, K + 2)), np.zeros((N, K + 2))
    system[:, K + 1, :K] = system[:, :K, K + 1] = 1.0
    for _ in range(_GAME_STEPS):
        slack = 1.0 / (t[:, None] - (nu[:, None] @ A)[:, 0])
        scaled = A * slack[:, None]
        system[:, :K, :K] = scaled @ scaled.transpose(0, 2, 1)
        system[:, diagonal, diagonal] += 1.0 / nu**2
        # Nearly equal columns make the system singular.
        system[:, diagonal, diagonal] *= 1.0 + 1e-9
        system[:, :K, K] = system[:, K, :K] = -(scaled @ slack[..., None])[..., 0]
        system[:, K, K] = (slack * slack).sum(axis=1)
        right[:, :K] = 1.0 / nu - scaled.sum(axis=2)
        right[:, K] = slack.sum(axis=1) - 1.0 / barrier
        step = np.linalg.solve(system, right[..., None])[..., 0]
        d_nu, d_t = step[:, :K], step[:, K]
        d_slack = d_t[:, None] - (d_nu[:, None] @ A)[:, 0]
        toward = np.maximum((-d_slack * slack).max(axis=1), (-d_nu / nu).max(axis=1))
        length = np.minimum(1.0, 0.95 / np.maximum(toward, _TINY))
        nu, t = nu + length[:, None] * d_nu, t + length * d_t
        barrier *= 0.25
        weights = nu / nu.sum(axis=1, keepdims=True)
        best = np.minimum(best, (weights[:, None] @ A)[:, 0].max(axis=1))
    bound: Array = best * scale[:, 0, 0] + lowest[:, 0, 0]
    return bound

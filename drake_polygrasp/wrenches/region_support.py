"""The least support h(w) over errors in contact points, contact normals and the centre of mass.

For fixed w the contacts' errors act independently: the least h(w) over all placements is the
greatest of the least h_i(w) of the single contacts. The functions take many twists and contacts at
once, whose leading axes broadcast; torques are about the nominal centre of mass.
"""

from __future__ import annotations

import math

import numpy as np

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.vectors import cross, dot, unit
from drake_polygrasp.wrenches.facet_twists import TINY

_TILTED_ROUNDS = 2
"""Our choice: points and normals are minimised over in turn; a second round lowers h by at most
1e-4 h."""


def least_support(w: Array, r_V: Array, nhat: Array, mu: Array) -> tuple[Array, Array]:
    """Returns the least h_i(w) of a contact anywhere in a plane convex polygon, in closed form.

    Along an edge, h_i is linear plus mu times the square root of a quadratic. Inside, h_i is linear
    on rays from the point without tangential velocity, so the least is there or on an edge.

    Args:
        w: twists, shape (..., 6).
        r_V: corners of a polygon in order, from the centre of mass, divided by rho, shape
            (..., V, 3); corners may be repeated, and a polygon may be a single point.
        nhat: inward unit normal of the contact, which need not be the polygon's, shape (..., 3).
        mu: friction coefficient, shape (...).

    Returns:
        The least h_i(w), shape (...), and a point that attains it, from the centre of mass, divided
        by rho, shape (..., 3).
    """
    r = _candidate_places(w, r_V, nhat, mu)
    u = _velocities(w, r)
    return _least(_support_at(u, nhat[..., None, :], mu[..., None]), r)


def _velocities(w: Array, r: Array) -> Array:
    """Returns the velocities u that twists (..., 6) give to points, shape (..., N, 3)."""
    return np.asarray(w[..., None, :3] + cross(w[..., None, 3:], r))


def _least(h: Array, values: Array) -> tuple[Array, Array]:
    """Returns the least h of the last axis, shape (...), and the value with it, (..., 3)."""
    best = h.argmin(axis=-1)[..., None]
    attained = np.take_along_axis(values, best[..., None], -2)[..., 0, :]
    return np.take_along_axis(h, best, -1)[..., 0], attained


def _candidate_places(w: Array, r_V: Array, nhat: Array, mu: Array) -> Array:
    """Returns points, one on each edge and one without slip, among which h_i is least.

    Their shape is (..., V + 1, 3).
    """
    v, omega = w[..., :3], w[..., 3:]
    sides = np.roll(r_V, -1, axis=-2) - r_V
    # The velocity at each corner, and its change along each edge, shape (..., V, 3).
    u = v[..., None, :] + cross(omega[..., None, :], r_V)
    du = cross(omega[..., None, :], sides)
    n = nhat[..., None, :]
    push, slope = dot(u, n), dot(du, n)
    t, dt = u - push[..., None] * n, du - slope[..., None] * n
    q_0, q_1, q_2 = dot(t, t), dot(t, dt), dot(dt, dt)
    with np.errstate(all="ignore"):
        # The slip at s on an edge is the root of q_0 + 2 q_1 s + q_2 s^2, least at `middle`. Where
        # friction grows faster than the push falls, h is least `offset` beyond; else h is monotone.
        middle = -q_1 / q_2
        least_slip = np.sqrt(np.maximum(q_0 - q_1 * q_1 / q_2, 0.0))
        excess = mu[..., None] ** 2 * q_2 - slope * slope
        offset = -slope * least_slip / np.sqrt(q_2 * excess)
        s = middle + np.where(excess > 0, offset, -np.sign(slope) * np.inf)
    s = np.where(q_2 > TINY, s, np.where(slope < 0, 1.0, 0.0))
    s = np.clip(np.nan_to_num(s), 0.0, 1.0)[..., None]
    still = _still_points(v, omega, r_V, nhat)
    return np.concatenate([r_V + s * sides, still[..., None, :]], axis=-2)


def _support_at(u: Array, nhat: Array, mu: Array) -> Array:
    """Returns h_i of contacts that move with velocities u."""
    push = dot(u, nhat)
    t = u - push[..., None] * nhat
    h: Array = push + mu * np.sqrt(dot(t, t))
    return h


def _still_points(v: Array, omega: Array, r_V: Array, nhat: Array) -> Array:
    """Returns the point of each polygon without tangential velocity, else a corner, (..., 3)."""
    first = r_V[..., 0, :]
    spokes = r_V - first[..., None, :]
    # The first side may have no length, so the axes of the plane come from the farthest corner and
    # the one farthest to its side.
    _, e_1 = _least(-dot(spokes, spokes), spokes)
    e_1 = unit(e_1)
    beside = spokes - dot(spokes, e_1[..., None, :])[..., None] * e_1[..., None, :]
    _, e_2 = _least(-dot(beside, beside), beside)
    e_2 = unit(e_2)
    u, u_1, u_2 = v + cross(omega, first), cross(omega, e_1), cross(omega, e_2)
    t, t_1, t_2 = (x - dot(x, nhat)[..., None] * nhat for x in (u, u_1, u_2))
    a, b, c = dot(t_1, t_1), dot(t_1, t_2), dot(t_2, t_2)
    x, y = -dot(t, t_1), -dot(t, t_2)
    determinant = a * c - b * b
    safe = np.where(determinant > TINY, determinant, 1.0)
    along, across = (c * x - b * y) / safe, (a * y - b * x) / safe
    r = first + along[..., None] * e_1 + across[..., None] * e_2
    sides = np.roll(r_V, -1, axis=-2) - r_V
    normal = cross(e_1, e_2)[..., None, :]
    side = dot(cross(sides, r[..., None, :] - r_V), normal)
    inside = ((side >= 0).all(-1) | (side <= 0).all(-1)) & (determinant > TINY)
    return np.where(inside[..., None], r, first)


def worst_normals(u: Array, nhat: Array, mu: Array, tilt: float) -> Array:
    """Returns the unit normals within an angle of the given ones that make h_i least.

    h_i depends on the normal only through the angle between normal and velocity. As the angle
    grows from 0 to pi, h_i rises and then falls, so the least is at the smallest or the largest
    angle that is allowed.

    Args:
        u: velocities at the contacts, shape (..., 3).
        nhat: inward unit normals, shape (..., 3).
        mu: friction coefficients, shape (...).
        tilt: greatest angle between a returned normal and the given one [rad].

    Returns:
        Shape (..., 3).
    """
    push = dot(u, nhat)
    t = u - push[..., None] * nhat
    slip = np.sqrt(dot(t, t))
    still = slip <= 1e-12 * np.sqrt(dot(u, u)) + TINY
    axis = np.eye(3)[np.abs(nhat).argmin(axis=-1)]
    across = np.where(still[..., None], cross(nhat, axis), t)
    across = unit(across)
    # A normal turns no further than onto the line of the velocity.
    length = np.sqrt(push * push + slip * slip)
    near = slip < math.tan(tilt) * np.abs(push)
    safe = np.where(near, length, 1.0)
    keep = np.where(near, np.abs(push) / safe, math.cos(tilt))
    turn = np.where(near, slip / safe, math.sin(tilt))
    keeps, turns, h = [], [], []
    for forward in (True, False):
        capped = (push > 0) == forward
        keeps.append(np.where(capped, keep, math.cos(tilt)))
        turns.append((1.0 if forward else -1.0) * np.where(capped, turn, math.sin(tilt)))
        slips = keeps[-1] * slip - turns[-1] * push
        h.append(keeps[-1] * push + turns[-1] * slip + mu * np.abs(slips))
    towards = h[0] < h[1]
    keep, turn = np.where(towards, keeps[0], keeps[1]), np.where(towards, turns[0], turns[1])
    return unit(keep[..., None] * nhat + turn[..., None] * across)


def least_tilted_support(
    w: Array, r_V: Array, nhat: Array, mu: Array, tilt: float
) -> tuple[Array, Array, Array]:
    """Returns a small h_i(w) of a contact anywhere in a polygon with a normal that may tilt.

    It is an upper bound of the least h_i(w), attained by the point and the normal returned with
    it; without tilt it is the least.

    Args:
        w: twists, shape (..., 6).
        r_V: corners of a convex polygon in order, from the centre of mass, divided by rho, shape
            (..., V, 3).
        nhat: inward unit normal of the contact, shape (..., 3).
        mu: friction coefficient, shape (...).
        tilt: greatest angle between a normal and `nhat` [rad].

    Returns:
        h_i(w), shape (...), the points, from the centre of mass, divided by rho, shape (..., 3),
        and the normals, shape (..., 3).
    """
    if r_V.shape[-2] == 1:
        u = _velocities(w, r_V)[..., 0, :]
        n = worst_normals(u, nhat, mu, tilt) if tilt > 0.0 else np.broadcast_to(nhat, u.shape)
        return _support_at(u, n, mu), np.broadcast_to(r_V[..., 0, :], u.shape), n
    if tilt <= 0.0:
        h, places = least_support(w, r_V, nhat, mu)
        return h, places, np.broadcast_to(nhat, places.shape)
    r = _candidate_places(w, r_V, nhat, mu)
    r = np.concatenate([r, np.broadcast_to(r_V, (*r.shape[:-2], *r_V.shape[-2:]))], axis=-2)
    for _ in range(_TILTED_ROUNDS):
        u = _velocities(w, r)
        n = worst_normals(u, np.broadcast_to(nhat[..., None, :], u.shape), mu[..., None], tilt)
        h, normals = _least(_support_at(u, n, mu[..., None]), n)
        h, places = least_support(w, r_V, normals, mu)
        r = places[..., None, :]
    return h, places, normals


def load_reach(w: Array, com_error: float | Array, *, forces_only: bool | Bools = False) -> Array:
    """Returns the greatest power of a unit load under w where the centre of mass may be off.

    A load about a centre of mass that is off by d has the power of the same load about the nominal
    one under the twist (v + omega x d, omega). The greatest power is the greatest length of that
    twist over |d| <= com_error: a norm of w, at least |w|.

    Args:
        w: twists, shape (K, 6).
        com_error: greatest distance of the centre of mass from the nominal one, divided by rho; one
            or one for each twist, shape (K,).
        forces_only: whether loads are forces through the centre of mass, without torque; the
            length is then that of v + omega x d alone. One, or one for each twist, shape (K,).

    Returns:
        Shape (K,).
    """
    v, omega = w[:, :3], w[:, 3:]
    turn = cross(omega, v)
    spin = dot(omega, omega)
    square = dot(v, v) + com_error * (2.0 * np.sqrt(dot(turn, turn)) + com_error * spin)
    return np.asarray(np.sqrt(square + np.where(forces_only, 0.0, spin)))


def worst_centres_of_mass(w: Array, com_error: float | Array) -> Array:
    """Returns the errors d of the centre of mass that attain `load_reach`.

    Args:
        w: twists, shape (K, 6).
        com_error: greatest distance of the centre of mass from the nominal one, divided by rho; one
            or one for each twist, shape (K,).

    Returns:
        From the nominal centre of mass, divided by rho, shape (K, 3). Zero where v and omega are
        parallel, where any d across omega would attain it.
    """
    v, omega = w[:, :3], w[:, 3:]
    spin = dot(omega, omega)
    safe = np.where(spin > 0, spin, 1.0)
    beside = v - (dot(v, omega) / safe)[:, None] * omega
    farthest = np.broadcast_to(com_error, len(w))[:, None]
    return np.asarray(farthest * unit(cross(unit(beside), unit(omega))))

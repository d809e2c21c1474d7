"""The least support h(w) over errors in contact points, contact normals and the centre of mass.

For fixed w the contacts' errors act independently: the least h(w) over all placements is the
greatest of the least h_i(w) of the single contacts. Torques are about the nominal centre of mass.
Arrays of contacts have components first and contacts last, so that operations on all contacts run
over contiguous memory.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.vectors import cross, cross_first, dot, dot_first, unit, unit_first
from drake_polygrasp.wrenches.facet_twists import TINY

_TILTED_ROUNDS = 2
"""Our choice: points and normals are minimised over in turn; a second round lowers h by at most
1e-4 h."""


@dataclass(frozen=True, eq=False)
class PlanePolygons:
    """N plane convex polygons of V corners each, which may be repeated, or single points.

    Attributes:
        vectors: corners in order, from the centre of mass, divided by rho; the side that follows
            each; and two orthogonal unit vectors in the plane, which are zero where there are none,
            shape (3, 2 V + 2, N).
        inward: vectors in the plane that are normal to the sides, all pointing inwards or all
            outwards, shape (3, V, N).
    """

    vectors: Array
    inward: Array

    @classmethod
    def of(cls, r_V: Array) -> PlanePolygons:
        """Returns polygons with what follows from their corners.

        Args:
            r_V: corners, shape (N, V, 3).
        """
        corners = np.ascontiguousarray(r_V.transpose(2, 1, 0))
        spokes = corners - corners[:, :1]
        # The first side may have no length, so the axes of the plane come from the farthest corner
        # and the one farthest to its side.
        _, e_1 = _least(-dot_first(spokes, spokes), spokes)
        e_1 = unit_first(e_1)[:, None]
        beside = spokes - dot_first(spokes, e_1) * e_1
        _, e_2 = _least(-dot_first(beside, beside), beside)
        e_2 = unit_first(e_2)[:, None]
        sides = np.roll(corners, -1, axis=1) - corners
        vectors = np.concatenate([corners, sides, e_1, e_2], axis=1)
        return cls(vectors, cross_first(cross_first(e_1, e_2), sides))

    @classmethod
    def joined(cls, polygons: Sequence[PlanePolygons]) -> PlanePolygons:
        """Returns several polygons of as many corners as one.

        Args:
            polygons: in their order.
        """
        vectors = np.concatenate([each.vectors for each in polygons], axis=2)
        return cls(vectors, np.concatenate([each.inward for each in polygons], axis=2))

    def take(self, rows: Ints) -> PlanePolygons:
        """Returns some of the polygons.

        Args:
            rows: their indices.
        """
        return PlanePolygons(self.vectors[:, :, rows], self.inward[:, :, rows])

    @property
    def num_corners(self) -> int:
        """V."""
        return len(self.inward[0])

    @property
    def corners(self) -> Array:
        """The corners, shape (3, V, N)."""
        return self.vectors[:, : self.num_corners]


def least_support(w: Array, polygons: PlanePolygons, nhat: Array, mu: Array) -> tuple[Array, Array]:
    """Returns the least h_i(w) of a contact anywhere in a plane convex polygon, in closed form.

    Along an edge, h_i is linear plus mu times the square root of a quadratic. Inside, h_i is linear
    on rays from the point without tangential velocity, so the least is there or on an edge.

    Args:
        w: twists, shape (6, N).
        polygons: where each contact may be.
        nhat: inward unit normals of the contacts, which need not be the polygons', shape (3, N).
        mu: friction coefficients, shape (N,).

    Returns:
        The least h_i(w), shape (N,), and points that attain it, from the centre of mass, divided by
        rho, shape (3, N).
    """
    return _least_of(polygons, _velocities(w, polygons), nhat, mu)


def _velocities(w: Array, polygons: PlanePolygons) -> Array:
    """Returns velocities of corners, and what is added along sides and axes, as in `vectors`."""
    velocities = cross_first(w[3:, None], polygons.vectors)
    velocities[:, : polygons.num_corners] += w[:3, None]
    return velocities


def _least_of(
    polygons: PlanePolygons, velocities: Array, nhat: Array, mu: Array
) -> tuple[Array, Array]:
    """Returns what `least_support` does."""
    r, push, t = _candidate_places(polygons, velocities, nhat, mu)
    return _least(push + mu * np.sqrt(dot_first(t, t)), r)


def _least(h: Array, values: Array) -> tuple[Array, Array]:
    """Returns the least h of the first axis, shape (N,), and the value with it, (3, N)."""
    best, rows = h.argmin(axis=0), np.arange(h.shape[1])
    return h[best, rows], values[:, best, rows]


def _candidate_places(
    polygons: PlanePolygons, velocities: Array, nhat: Array, mu: Array
) -> tuple[Array, Array, Array]:
    """Returns points, one on each edge and one without slip, among which h_i is least.

    Returns:
        The points, shape (3, V + 1, N), and their normal and tangential velocities, shapes
        (V + 1, N) and (3, V + 1, N).
    """
    V = polygons.num_corners
    normal = dot_first(velocities, nhat[:, None])
    tangential = velocities - normal * nhat[:, None]
    slope, t, dt = normal[V:-2], tangential[:, :V], tangential[:, V:-2]
    q_0, q_1, q_2 = dot_first(t, t), dot_first(t, dt), dot_first(dt, dt)
    with np.errstate(all="ignore"):
        # The slip at s on an edge is the root of q_0 + 2 q_1 s + q_2 s^2, least at `middle`. Where
        # friction grows faster than the push falls, h is least `offset` beyond; else h is monotone.
        middle = -q_1 / q_2
        least_slip = np.sqrt(np.maximum(q_0 - q_1 * q_1 / q_2, 0.0))
        excess = mu**2 * q_2 - slope * slope
        offset = -slope * least_slip / np.sqrt(q_2 * excess)
        s = middle + np.where(excess > 0, offset, -np.sign(slope) * np.inf)
    s = np.where(q_2 > TINY, s, np.where(slope < 0, 1.0, 0.0))
    s = np.fmin(np.fmax(s, 0.0), 1.0)  # not a number counts as 0
    along, across = _still_points(polygons, tangential)
    parts = (polygons.vectors, normal[None], tangential)
    r, pushes, slips = (
        np.concatenate(
            [
                x[:, :V] + s * x[:, V:-2],
                (x[:, 0] + along * x[:, -2] + across * x[:, -1])[:, None],
            ],
            axis=1,
        )
        for x in parts
    )
    return r, pushes[0], slips


def _still_points(polygons: PlanePolygons, tangential: Array) -> tuple[Array, Array]:
    """Returns where in the plane of each polygon a point has no tangential velocity.

    Args:
        polygons: N polygons.
        tangential: velocities as in `vectors`, shape (3, 2 V + 2, N).

    Returns:
        Lengths along both axes from the first corner to the point, each of shape (N,); zero if it
        is not in the polygon.
    """
    t, t_1, t_2 = tangential[:, 0], tangential[:, -2], tangential[:, -1]
    a, b, c = dot_first(t_1, t_1), dot_first(t_1, t_2), dot_first(t_2, t_2)
    x, y = -dot_first(t, t_1), -dot_first(t, t_2)
    determinant = a * c - b * b
    safe = np.where(determinant > TINY, determinant, 1.0)
    along, across = (c * x - b * y) / safe, (a * y - b * x) / safe
    corners, e_1, e_2 = polygons.corners, polygons.vectors[:, -2], polygons.vectors[:, -1]
    from_corners = (corners[:, 0] + along * e_1 + across * e_2)[:, None] - corners
    side = dot_first(polygons.inward, from_corners)
    inside = ((side >= 0).all(axis=0) | (side <= 0).all(axis=0)) & (determinant > TINY)
    return np.where(inside, along, 0.0), np.where(inside, across, 0.0)


def worst_normals(u: Array, nhat: Array, mu: Array, tilt: float) -> tuple[Array, Array]:
    """Returns the unit normals within an angle of the given ones that make h_i least.

    h_i depends on the normal only through the angle between normal and velocity. As the angle
    grows from 0 to pi, h_i rises and then falls, so the least is at the smallest or the largest
    angle that is allowed.

    Args:
        u: velocities at the contacts, shape (3, ...).
        nhat: inward unit normals; shapes broadcast.
        mu: friction coefficients, shape (...); shapes broadcast.
        tilt: greatest angle between a returned normal and the given one [rad].

    Returns:
        The least h_i, shape (...), and the normals, shape (3, ...).
    """
    push = dot_first(u, nhat)
    t = u - push * nhat
    slip = np.sqrt(dot_first(t, t))
    still = slip <= 1e-12 * np.sqrt(dot_first(u, u)) + TINY
    axis = np.eye(3)[:, np.abs(nhat).argmin(axis=0)]
    across = unit_first(np.where(still, cross_first(nhat, axis), t))
    # A normal turns no further than onto the line of the velocity.
    length = np.sqrt(push * push + slip * slip)
    near = slip < math.tan(tilt) * np.abs(push)
    safe = np.where(near, length, 1.0)
    keep = np.where(near, np.abs(push) / safe, math.cos(tilt))
    turn = np.where(near, slip / safe, math.sin(tilt))
    # Forwards, then backwards; towards the line of the velocity first where the contact is pushed.
    capped = np.stack([push > 0, push <= 0])
    keeps = np.where(capped, keep, math.cos(tilt))
    turns = np.where(capped, turn, math.sin(tilt))
    turns[1] *= -1.0
    h = keeps * push + turns * slip + mu * np.abs(keeps * slip - turns * push)
    forwards = h[0] < h[1]
    keep, turn = np.where(forwards, keeps[0], keeps[1]), np.where(forwards, turns[0], turns[1])
    return np.where(forwards, h[0], h[1]), unit_first(keep * nhat + turn * across)


def least_tilted_support(
    w: Array, polygons: PlanePolygons, nhat: Array, mu: Array, tilt: float
) -> tuple[Array, Array, Array]:
    """Returns a small h_i(w) of a contact anywhere in a polygon with a normal that may tilt.

    It is an upper bound of the least h_i(w), attained by the point and the normal returned with
    it; without tilt it is the least.

    Args:
        w: twists, shape (6, N).
        polygons: where each contact may be.
        nhat: inward unit normals of the contacts, shape (3, N).
        mu: friction coefficients, shape (N,).
        tilt: greatest angle between a normal and `nhat` [rad].

    Returns:
        h_i(w), shape (N,), the points, from the centre of mass, divided by rho, shape (3, N), and
        the normals, shape (3, N).
    """
    velocities = _velocities(w, polygons)
    if tilt <= 0.0:
        return *_least_of(polygons, velocities, nhat, mu), nhat
    _, push, t = _candidate_places(polygons, velocities, nhat, mu)
    u = np.concatenate([push * nhat[:, None] + t, velocities[:, : polygons.num_corners]], axis=1)
    for _ in range(_TILTED_ROUNDS):
        _, normals = _least(*worst_normals(u, nhat[:, None], mu, tilt))
        h, places = _least_of(polygons, velocities, normals, mu)
        u = (w[:3] + cross_first(w[3:], places))[:, None]
    return h, places, normals


def support_range(
    w: Array, centre: Array, radius: Array, nhat: Array, mu: Array, tilt: float
) -> tuple[Array, Array]:
    """Bounds the least h_i(w) of a contact anywhere in a ball with a normal that may tilt.

    h_i is convex in the place, so that it is nowhere below its tangent at the centre. Normals that
    turn by an angle change it by at most sqrt(1 + mu^2) times the angle and the velocity.

    Args:
        w: twists, shape (6, N).
        centre: centres of balls, from the centre of mass, divided by rho, shape (3, N).
        radius: their radii, divided by rho, shape (N,).
        nhat: inward unit normals of the contacts, shape (3, N).
        mu: friction coefficients, shape (N,).
        tilt: greatest angle between a normal and `nhat` [rad].

    Returns:
        A lower bound, and an upper bound, which is h_i at the centre; each of shape (N,).
    """
    u = w[:3] + cross_first(w[3:], centre)
    push = dot_first(u, nhat)
    t = u - push * nhat
    slip = np.sqrt(dot_first(t, t))
    highest = push + mu * slip
    slope = cross_first(nhat + mu / np.maximum(slip, TINY) * t, w[3:])
    lowest = highest - radius * np.sqrt(dot_first(slope, slope))
    if tilt > 0.0:
        speed = np.sqrt(dot_first(u, u)) + radius * np.sqrt(dot_first(w[3:], w[3:]))
        lowest = lowest - tilt * np.sqrt(1.0 + mu * mu) * speed
    return lowest, highest


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

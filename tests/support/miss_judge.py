"""An independent judge of grasps whose fingertips miss: draws errors, casts rays, tests closure.

It shares no code with the package. A fingertip is a point that comes along the nominal normal of
its contact, displaced in the plane of the contact, and touches what it first meets: a triangle or
the true surface of a curved solid, with the normal and the friction there.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, QhullError

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_ROUNDING = 1e-9
"""Relative: closer to the edge of a cone is not inside."""
_CRACK = 1e-14
"""Times L: rays do not pass between triangles that share an edge, for all that rounding does."""
_RIM = 1 - 1e-9
"""Part of the radius at which the rim is sampled: discs touch the edges of their faces."""
_PAIRS = tuple(itertools.combinations(range(6), 2))


class Errors(NamedTuple):
    """How far things may be from where a grasp has them.

    Attributes:
        placement: of each contact in the plane through it [m], shape (3,).
        tilt: angle between the true normals and those of the touched surface [rad].
        friction: share of the friction coefficients.
        com: distance of the centre of mass [m].
    """

    placement: Array
    tilt: float
    friction: float
    com: float


@dataclass(frozen=True, eq=False)
class Solid:
    """A curved solid in its frame G, with its axis along Gz.

    Attributes:
        kind: "ellipsoid", "cylinder" or "capsule".
        R_BG: shape (3, 3).
        p_BG: shape (3,) [m].
        radii: semi-axes; or radius, radius, half the length of the cylindrical part [m].
        mu: friction coefficient.
    """

    kind: str
    R_BG: Array
    p_BG: Array
    radii: Array
    mu: float


@dataclass(frozen=True, eq=False)
class Surface:
    """What fingertips may touch, in B.

    Attributes:
        triangles: counter-clockwise from outside [m], shape (T, 3, 3).
        mu: friction coefficient of each, 0 where nothing may be touched, shape (T,).
        solids: curved solids; no triangles stand for them.
        L: diameter [m].
    """

    triangles: Array
    mu: Array
    solids: Sequence[Solid] = ()
    L: float = 1.0


@dataclass(frozen=True, eq=False)
class Hits:
    """Where rays first meet a surface.

    Attributes:
        depth: along the ray [m], infinite where it meets nothing, shape (N,).
        inward: unit normals into the body, shape (N, 3).
        mu: friction coefficients, 0 where nothing is met or it is met from behind, shape (N,).
    """

    depth: Array
    inward: Array
    mu: Array

    @classmethod
    def nothing(cls, count: int) -> Hits:
        return cls(np.full(count, np.inf), np.tile([0.0, 0.0, 1.0], (count, 1)), np.zeros(count))

    def or_nearer(self, other: Hits) -> Hits:
        nearer = other.depth < self.depth
        return Hits(
            np.where(nearer, other.depth, self.depth),
            np.where(nearer[:, None], other.inward, self.inward),
            np.where(nearer, other.mu, self.mu),
        )


@dataclass(frozen=True, eq=False)
class Trials:
    """Grasps with errors drawn.

    Attributes:
        p: contact points [m], shape (N, 3, 3); NaN where a fingertip meets nothing.
        n: inward unit normals, shape (N, 3, 3).
        mu: friction coefficients, shape (N, 3).
        p_com: centres of mass [m], shape (N, 3).
        off: whether a fingertip misses the body, shape (N,).
        holds: whether the grasp is force closure, shape (N,).
    """

    p: Array
    n: Array
    mu: Array
    p_com: Array
    off: Bools
    holds: Bools = field(init=False)

    def __post_init__(self) -> None:
        holds = np.zeros(len(self.p), dtype=bool)
        rows = np.flatnonzero(~self.off & (self.mu > 0).all(axis=1))
        holds[rows] = is_force_closure(self.p[rows], self.n[rows], self.mu[rows])
        object.__setattr__(self, "holds", holds)


def draw(
    surface: Surface,
    p: Array,
    n: Array,
    mu: Array,
    p_com: Array,
    errors: Errors,
    count: int,
    rng: np.random.Generator,
    *,
    on_rim: bool = False,
) -> Trials:
    """Draws errors: places uniform in discs, normals in cones, friction in its interval.

    Args:
        surface: what is grasped.
        p: the contacts of the grasp [m], shape (3, 3).
        n: their inward unit normals, shape (3, 3).
        mu: their friction coefficients, shape (3,); where the surface has less, that counts.
        p_com: centre of mass [m], shape (3,).
        errors: how far things may be off.
        count: how many trials.
        rng: where random numbers come from.
        on_rim: whether every error is as large as it may be: places on the rims of discs, normals
            on cones, friction at its least.
    """
    points, normals, friction = (np.empty((count, 3, *shape)) for shape in ((3,), (3,), ()))
    for i in range(3):
        x_axis, y_axis = tangents(n[i])
        turn = rng.uniform(0, 2 * np.pi, count)
        shares = np.full(count, _RIM) if on_rim else np.sqrt(rng.uniform(size=count))
        radius = errors.placement[i] * shares
        place = p[i] + radius[:, None] * (
            np.cos(turn)[:, None] * x_axis + np.sin(turn)[:, None] * y_axis
        )
        start = _start_height(surface, p[i], n[i])
        hits = cast(surface, place - start * n[i], n[i])
        met = np.where(np.isfinite(hits.depth), hits.depth, np.nan)
        points[:, i] = place + (met - start)[:, None] * n[i]
        lowest = np.cos(errors.tilt)
        normals[:, i] = _tilted(hits.inward, lowest, lowest if on_rim else 1.0, rng)
        most = 1 - errors.friction if on_rim else 1 + errors.friction
        friction[:, i] = np.minimum(hits.mu, mu[i]) * rng.uniform(1 - errors.friction, most, count)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    shift = errors.com * (np.ones(count) if on_rim else np.cbrt(rng.uniform(size=count)))
    off = ~np.isfinite(points).all(axis=(1, 2))
    return Trials(points, normals, friction, p_com + shift[:, None] * direction, off)


def _start_height(surface: Surface, p: Array, n: Array) -> float:
    """From where a fingertip comes: far outside, or half way to what is opposite its contact."""
    far = 3 * surface.L
    opposite = float(cast(surface, (p - 1e-6 * surface.L * n)[None], -n).depth[0])
    return min(far, 0.5 * opposite)


def _tilted(n: Array, least: float, most: float, rng: np.random.Generator) -> Array:
    """Unit vectors about others (N, 3), the cosines of their angles uniform in an interval."""
    x_axis, y_axis = tangents(n)
    cosine = rng.uniform(least, most, len(n))[:, None]
    turn = rng.uniform(0, 2 * np.pi, len(n))[:, None]
    across = np.cos(turn) * x_axis + np.sin(turn) * y_axis
    tilted: Array = cosine * n + np.sqrt(1 - cosine**2) * across
    return tilted


def tangents(n: Array) -> tuple[Array, Array]:
    """Two unit vectors perpendicular to unit vectors and to each other, shapes (..., 3)."""
    axis = np.eye(3)[np.abs(n).argmin(axis=-1)]
    x_axis = np.cross(n, axis)
    x_axis /= np.linalg.norm(x_axis, axis=-1, keepdims=True)
    return x_axis, np.cross(n, x_axis)


def cast(surface: Surface, start: Array, along: Array) -> Hits:
    """Where rays from points (N, 3) [m] along one unit vector (3,) first meet a surface."""
    found = _cast_on_triangles(surface, start, along)
    for solid in surface.solids:
        found = found.or_nearer(_cast_on_solid(solid, start, along))
    return found


def _cast_on_triangles(surface: Surface, start: Array, along: Array) -> Hits:
    """Which triangles, seen along the rays, hold each ray's point; the nearest of those ahead."""
    found, tolerance = Hits.nothing(len(start)), _CRACK * surface.L
    if not len(surface.triangles):
        return found
    view = np.column_stack([*tangents(along), along])
    seen, points = surface.triangles @ view, start @ view
    low, high = points[:, :2].min(axis=0) - tolerance, points[:, :2].max(axis=0) + tolerance
    near = (seen[:, :, :2].max(axis=1) >= low) & (seen[:, :, :2].min(axis=1) <= high)
    for k in np.flatnonzero(near.all(axis=1) & (seen[:, :, 2].max(axis=1) >= points[:, 2].min())):
        corners = seen[k]
        normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
        size = np.linalg.norm(normal)
        if abs(normal[2]) <= 1e-12 * size or size == 0:  # seen from its side
            continue
        within = np.ones(len(points), dtype=bool)
        for a, b in ((0, 1), (1, 2), (2, 0)):
            side = (corners[b] - corners[a])[:2]
            arm = points[:, :2] - corners[a, :2]
            outside = np.sign(normal[2]) * (side[0] * arm[:, 1] - side[1] * arm[:, 0])
            within &= outside >= -tolerance * np.linalg.norm(side)
        depth = (corners[0] - points) @ normal / normal[2]
        depth = np.where(within & (depth > 0), depth, np.inf)
        inward = np.tile(-(view @ normal) / size, (len(points), 1))
        # Met from behind, the fingertip began inside the body.
        mu = np.full(len(points), surface.mu[k] if normal[2] < 0 else 0.0)
        found = found.or_nearer(Hits(depth, inward, mu))
    return found


def _cast_on_solid(solid: Solid, start: Array, along: Array) -> Hits:
    points, direction = (start - solid.p_BG) @ solid.R_BG, along @ solid.R_BG
    half = solid.radii[2]
    if solid.kind == "ellipsoid":
        depth = _entry(points / solid.radii, np.broadcast_to(direction / solid.radii, points.shape))
        at = points + np.where(np.isfinite(depth), depth, 0.0)[:, None] * direction
        outward = at / solid.radii**2
        return _hits(solid, depth, outward)
    flat = np.array([1.0, 1.0, 0.0]) / solid.radii[0]
    depth = _entry(points * flat, np.broadcast_to(direction * flat, points.shape))
    at = points + np.where(np.isfinite(depth), depth, 0.0)[:, None] * direction
    depth = np.where(np.abs(at[:, 2]) <= half, depth, np.inf)
    found = _hits(solid, depth, at * [1.0, 1.0, 0.0])
    for end in (-half, half):
        if solid.kind == "capsule":
            ball = (points - [0, 0, end]) / solid.radii[0]
            way = np.broadcast_to(direction / solid.radii[0], points.shape)
            depth = _entry(ball, way)
            at = ball + np.where(np.isfinite(depth), depth, 0.0)[:, None] * way
            depth = np.where(at[:, 2] * np.sign(end) >= 0, depth, np.inf)
            found = found.or_nearer(_hits(solid, depth, at))
        elif direction[2] * end < 0:
            depth = (end - points[:, 2]) / direction[2]
            at = points + depth[:, None] * direction
            inside = (np.hypot(at[:, 0], at[:, 1]) <= solid.radii[0]) & (depth > 0)
            outward = np.tile([0.0, 0.0, np.sign(end)], (len(points), 1))
            found = found.or_nearer(_hits(solid, np.where(inside, depth, np.inf), outward))
    return found


def _hits(solid: Solid, depth: Array, outward_G: Array) -> Hits:
    length = np.linalg.norm(outward_G, axis=1, keepdims=True)
    inward = -(outward_G / np.where(length > 0, length, 1.0)) @ solid.R_BG.T
    return Hits(depth, inward, np.full(len(depth), solid.mu))


def _entry(points: Array, along: Array) -> Array:
    """How far points (N, 3) go along vectors until they enter the unit ball; else infinite."""
    a, b = (along**2).sum(axis=1), (points * along).sum(axis=1)
    c = (points**2).sum(axis=1) - 1
    discriminant = b * b - a * c
    meets = (discriminant > 0) & (a > 0)
    depth = np.full(len(points), np.inf)
    depth[meets] = (-b[meets] - np.sqrt(discriminant[meets])) / a[meets]
    return np.where(depth > 0, depth, np.inf)


def is_force_closure(p: Array, n: Array, mu: Array) -> Bools:
    """Whether each grasp has an internal force strictly inside its friction cones.

    Three forces in balance lie in the plane of the contacts and are those of three springs along
    its sides. Cones cut that plane in sectors, each bounded by two lines: six linear inequalities
    in the springs' three forces. These have a solution iff the sum of the extreme rays is one; that
    it is one is then checked on the cones themselves.

    Args:
        p: contact points [m], shape (N, 3, 3).
        n: inward unit normals, shape (N, 3, 3).
        mu: friction coefficients, shape (N, 3).
    """
    sides = p[:, [1, 2, 2]] - p[:, [0, 0, 1]]
    plane = np.cross(sides[:, 0], sides[:, 1])
    longest = (sides**2).sum(axis=2).max(axis=1)
    area = np.linalg.norm(plane, axis=1)
    spread = area > _ROUNDING * longest
    plane = plane / np.where(spread, area, 1.0)[:, None]
    sides = sides / np.sqrt(np.where(longest > 0, longest, 1.0))[:, None, None]

    least = 1 / np.sqrt(1 + mu**2)
    section = n - (n * plane[:, None]).sum(axis=2, keepdims=True) * plane[:, None]
    length = np.linalg.norm(section, axis=2)
    cut = (length > least + _ROUNDING).all(axis=1)
    length = np.maximum(length, least)
    middle = section / length[..., None]
    aside = np.cross(plane[:, None], middle)
    cosine = (least / length)[..., None]
    sine = np.sqrt(np.maximum(1 - cosine**2, 0))
    # Inward normals, in the plane, of the lines that bound each sector.
    inward = np.stack([sine * middle + cosine * aside, sine * middle - cosine * aside], axis=2)
    signs = np.zeros((3, 3, 3))  # contact, spring: which way a spring pushes a contact
    for spring, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
        signs[i, spring, spring], signs[j, spring, spring] = 1, -1
    push = np.einsum("csk,nkd->ncsd", signs, sides)
    A = np.einsum("ncbd,ncsd->ncbs", inward, push).reshape(len(p), 6, 3)
    size = np.linalg.norm(A, axis=2, keepdims=True)
    A = A / np.where(size > 0, size, 1.0)
    x = np.zeros((len(p), 3))
    for a, b in _PAIRS:
        ray = np.cross(A[:, a], A[:, b])
        norm = np.linalg.norm(ray, axis=1, keepdims=True)
        ray = ray / np.where(norm > 1e-12, norm, np.inf)
        for signed in (ray, -ray):
            allowed = (np.einsum("nks,ns->nk", A, signed) >= -_ROUNDING).all(axis=1)
            x += np.where(allowed[:, None], signed, 0.0)
    force = np.einsum("ncsd,ns->ncd", push, x)
    magnitude = np.linalg.norm(force, axis=2)
    along = (force * n).sum(axis=2)
    inside = ((along > (least + _ROUNDING) * magnitude) & (magnitude > _ROUNDING)).all(axis=1)
    return np.asarray(spread & cut & inside)


def epsilons(p: Array, n: Array, mu: Array, p_com: Array, rho: float, *, sides: int = 24) -> Array:
    """Lower bounds of epsilon, within a percent: of cones with `sides` edges inside the true ones.

    Args:
        p: contact points [m], shape (N, 3, 3).
        n: inward unit normals, shape (N, 3, 3).
        mu: friction coefficients, shape (N, 3).
        p_com: centres of mass [m], shape (N, 3).
        rho: what torques are divided by [m].
        sides: edges of each cone.

    Returns:
        Shape (N,); 0 where the origin is not inside.
    """
    turn = 2 * np.pi * np.arange(sides)[:, None] / sides
    found = []
    for p_k, n_k, mu_k, com in zip(p, n, mu, p_com, strict=True):
        wrenches = []
        for i in range(3):
            x_axis, y_axis = tangents(n_k[i])
            f = n_k[i] + mu_k[i] * (np.cos(turn) * x_axis + np.sin(turn) * y_axis)
            wrenches.append(np.hstack([f, np.cross((p_k[i] - com) / rho, f)]))
        try:
            hull = ConvexHull(np.concatenate(wrenches), qhull_options="QJ Pp")
        except QhullError:
            found.append(0.0)
        else:
            found.append(max(0.0, float((-hull.equations[:, -1]).min())))
    return np.array(found)

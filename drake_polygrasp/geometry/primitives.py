"""Curved solids in closed form: spheres, ellipsoids, cylinders and capsules.

They are planned on as the polyhedra that `tessellation` inscribes; contacts and clearances are
those of the true surface. Each solid G is centred at Go, its axis of revolution along Gz.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.vectors import circle, dot, times

_SIDES = 18
"""Ours: facets of 20 degrees lean from the surface by 10, less than most friction angles."""
_ROUNDING = 1e-9
"""Relative, our choice: above rounding errors of coordinates."""
_ROUNDS = 200
"""Ours: steps of iterations that converge to rounding errors in far fewer."""


@dataclass(frozen=True, eq=False)
class Primitive:
    """A curved solid and its pose.

    Attributes:
        kind: a sphere is an ellipsoid.
        R_BG: axes of the shape in B, shape (3, 3).
        p_BG: [m], shape (3,).
        radii: semi-axes along Gx, Gy, Gz; of cylinder and capsule, of the circle, twice, and half
            the length of the axis between the centres of their ends [m], shape (3,).
    """

    kind: Literal["ellipsoid", "cylinder", "capsule"]
    R_BG: Array
    p_BG: Array
    radii: Array

    @property
    def bend(self) -> float:
        """Least radius of curvature of the curved surface [m]."""
        if self.kind == "ellipsoid":
            return float(self.radii.min() ** 2 / self.radii.max())
        return float(self.radii[0])

    def project(self, p_B: Array) -> tuple[Array, Array]:
        """Points of the curved surface near points p_B [m], and outward normals there; (M, 3)."""
        p_G = times(p_B - self.p_BG, self.R_BG)
        if self.kind == "ellipsoid":
            p_G = p_G / np.linalg.norm(p_G / self.radii, axis=1, keepdims=True)
            nhat_G = p_G / self.radii**2
            nhat_G /= np.linalg.norm(nhat_G, axis=1, keepdims=True)
        else:
            axis = self._axis_point(p_G)
            nhat_G = p_G - axis
            nhat_G /= np.linalg.norm(nhat_G, axis=1, keepdims=True)
            p_G = axis + self.radii[0] * nhat_G
        return self.p_BG + times(p_G, self.R_BG.T), times(nhat_G, self.R_BG.T)

    def distance(self, p_B: Array) -> Array:
        """Signed distance of points p_B (M, 3) [m], negative inside, (M,).

        Inside ellipsoids only the sign is meant.
        """
        p_G = times(p_B - self.p_BG, self.R_BG)
        if self.kind == "ellipsoid":
            return self._distance_from_ellipsoid(p_G)
        if self.kind == "capsule":
            return np.asarray(np.linalg.norm(p_G - self._axis_point(p_G), axis=1) - self.radii[0])
        beyond = (
            np.stack([np.sqrt(p_G[:, 0] ** 2 + p_G[:, 1] ** 2), np.abs(p_G[:, 2])], 1)
            - self.radii[1:]
        )
        outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0))

    def depths(self, p_B: Array, direction_B: Array) -> Array:
        """Computes how far points can move along a direction until they enter the solid.

        Args:
            p_B: points outside the solid or on it [m], shape (M, 3).
            direction_B: a unit vector, shape (3,).

        Returns:
            Distances [m], shape (M,); NaN where the solid is missed, or entered through an end of
            a cylinder.
        """
        p_G, along = times(p_B - self.p_BG, self.R_BG), times(direction_B, self.R_BG)
        if self.kind == "ellipsoid":
            return _entry(p_G / self.radii, along / self.radii, 1.0)
        radius, half = self.radii[0], self.radii[2]
        flat = np.array([1.0, 1.0, 0.0])
        depth = _entry(p_G * flat, along * flat, radius)
        z = p_G[:, 2] + depth * along[2]
        depth = np.where(np.abs(z) <= half * (1 + _ROUNDING), depth, np.nan)
        if self.kind == "capsule":
            for end in (-half, half):
                at_end = _entry(p_G - end * np.array([0.0, 0.0, 1.0]), along, radius)
                depth = np.fmin(depth, at_end)
        return depth

    def normals_around(self, p_B: Array) -> Array:
        """Returns vectors whose convex cone holds all normals of the curve in a polytope.

        Args:
            p_B: the polytope's corners, near the curve [m], shape (M, 3).

        Returns:
            Outward vectors of any length, shape (M, 3) or, where a capsule's end begins between
            the corners, (2 M, 3).
        """
        p_G = times(p_B - self.p_BG, self.R_BG)
        if self.kind == "ellipsoid":
            return times(p_G / self.radii**2, self.R_BG.T)
        normal = p_G - self._axis_point(p_G)
        part = np.digitize(p_G[:, 2], np.array([-1.0, 1.0]) * self.radii[2])
        if self.kind == "capsule" and (part != part[0]).any():
            # z less its part on the axis is no linear function, but within its range.
            low, high = normal.copy(), normal.copy()
            low[:, 2], high[:, 2] = normal[:, 2].min(), normal[:, 2].max()
            normal = np.concatenate([low, high])
        return times(normal, self.R_BG.T)

    def on_curve(self, p_B: Array, tolerance: float) -> Bools:
        """Whether points p_B (M, 3) [m] are within `tolerance` [m] of the curved surface, (M,)."""
        near = np.linalg.norm(self.project(p_B)[0] - p_B, axis=1) <= tolerance
        if self.kind == "cylinder":
            z = times(p_B - self.p_BG, self.R_BG[:, 2])
            near &= np.abs(z) <= self.radii[2] + tolerance
        return np.asarray(near)

    def is_curved(self, nhat_B: Array) -> Bools:
        """Which facets with normals (T, 3) stand for curved surface, not a cylinder's ends."""
        along = np.abs(times(nhat_B, self.R_BG[:, 2]))
        return np.asarray((self.kind != "cylinder") | (along < np.sqrt(0.5)))

    def farthest(self, p_B: Array) -> float:
        """Greatest distance of a point p_B (3,) [m] to the solid.

        By climbing: the point of the solid farthest along the last direction is farther away.
        """
        p_G = times(p_B - self.p_BG, self.R_BG)
        start = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)]) - 1.0
        direction = start / np.linalg.norm(start, axis=1, keepdims=True)
        for _ in range(_ROUNDS):
            arm = self._support(direction) - p_G
            direction = arm / np.linalg.norm(arm, axis=1, keepdims=True)
        return float(np.linalg.norm(arm, axis=1).max())

    def height(self, direction_B: Array) -> float:
        """How far the solid reaches along a unit vector (3,), from Bo [m]."""
        top = self._support(times(direction_B, self.R_BG)[None])[0]
        return float(times(self.p_BG, direction_B) + times(top, times(direction_B, self.R_BG)))

    def _support(self, direction: Array) -> Array:
        """Points of the solid farthest along unit vectors, both in G, (M, 3)."""
        if self.kind == "ellipsoid":
            scaled = direction * self.radii
            return np.asarray(self.radii * scaled / np.linalg.norm(scaled, axis=1, keepdims=True))
        round_part = direction.copy()
        if self.kind == "cylinder":
            round_part[:, 2] = 0
            length = np.linalg.norm(round_part, axis=1, keepdims=True)
            round_part /= np.where(length > 0, length, 1)
        end = np.where(direction[:, 2] < 0, -1, 1) * self.radii[2]
        return np.asarray(self.radii[0] * round_part + end[:, None] * [0, 0, 1])

    def _axis_point(self, p_G: Array) -> Array:
        """The points of the axis nearest to p_G; a cylinder's goes on beyond its ends."""
        z = p_G[:, 2]
        if self.kind == "capsule":
            z = np.clip(z, -self.radii[2], self.radii[2])
        return np.asarray(z[:, None] * [0.0, 0.0, 1.0])

    def _distance_from_ellipsoid(self, p_G: Array) -> Array:
        """The nearest point is a^2 p / (a^2 + t); its t >= 0 by bisection (Eberly)."""
        square = self.radii**2
        level = np.linalg.norm(p_G / self.radii, axis=1)
        low, high = np.zeros(len(p_G)), np.linalg.norm(p_G * self.radii, axis=1)
        for _ in range(_ROUNDS):
            t = (low + high) / 2
            outside = np.linalg.norm(self.radii * p_G / (square + t[:, None]), axis=1) > 1
            low, high = np.where(outside, t, low), np.where(outside, high, t)
        gap = p_G - square * p_G / (square + high[:, None])
        inside = (level - 1) * self.radii.min()
        return np.asarray(np.where(level > 1, np.linalg.norm(gap, axis=1), inside))


def _entry(points: Array, along: Array, radius: float) -> Array:
    """Where rays from points (M, 3) enter a sphere about the origin, NaN where they miss it.

    In units of `along`, which has any length.
    """
    a, b, c = dot(along, along), times(points, along), dot(points, points) - radius**2
    if a <= 0:
        return np.full(len(points), np.nan)
    square = b**2 - a * c
    root = np.sqrt(np.where(square >= 0, square, np.nan))
    # Of the two forms of the root, the one without cancellation on the surface.
    return np.asarray(c / np.where(b < 0, root - b, np.nan))


def tessellation(primitive: Primitive) -> Array:
    """Triangles of a polyhedron inscribed in a solid.

    In B [m], shape (T, 3, 3), counter-clockwise from outside. Facets are planar: they are
    trapezoids between circles of latitude, and discs at the poles, so that none is a needle.
    """
    step = 2 * math.pi / _SIDES
    radius, (a, b, c) = np.ones(1), primitive.radii
    if primitive.kind == "cylinder":
        radius, z, scale = np.ones(2), np.array([-c, c]), np.array([a, a, 1])
    else:
        latitude = np.arange(step / 2, np.pi, step)
        down, radius = circle(latitude).T
        z, scale = -down, np.array([a, b, c])
        if primitive.kind == "capsule":
            latitude = np.append(np.arange(step / 2, np.pi / 2, step), np.pi / 2)
            down, radius = circle(latitude).T
            z = -down * a - c
            radius, z = np.append(radius, radius[::-1]), np.append(z, -z[::-1])
            scale = np.array([a, a, 1])
    rings = np.empty((len(z), _SIDES, 3))
    rings[..., :2] = radius[:, None, None] * circle(step * np.arange(_SIDES))
    rings[..., 2] = z[:, None]
    rings = primitive.p_BG + times(rings * scale, primitive.R_BG.T)
    after = np.roll(rings, -1, axis=1)
    low, high, low_after, high_after = rings[:-1], rings[1:], after[:-1], after[1:]
    first = np.repeat(rings[[0, -1], :1], _SIDES - 2, axis=1)
    bottom = np.stack([first[0], after[0, 1:-1], rings[0, 1:-1]], axis=1)
    top = np.stack([first[1], rings[-1, 1:-1], after[-1, 1:-1]], axis=1)
    walls = np.stack([low, low_after, high_after, low, high_after, high], axis=2)
    return np.concatenate([walls.reshape(-1, 3, 3), bottom, top])


def sagitta(primitive: Primitive, triangles: Array) -> float:
    """How far the curved surface rises above a facet made of triangles (k, 3, 3) [m]."""
    nhat, _ = unit_normals(triangles)
    edges = (triangles + np.roll(triangles, -1, axis=1)) / 2
    inner = np.concatenate([edges.reshape(-1, 3), triangles.reshape(-1, 3).mean(0, keepdims=True)])
    surface, _ = primitive.project(inner)
    return float(times(surface - triangles[0, 0], nhat[0]).max())

"""Curved solids in closed form: spheres, ellipsoids, cylinders and capsules.

Planning uses the polyhedra that `tessellation` inscribes in them; contacts and clearances are those
of the true surface. The frame G of a solid has its origin Go at the centre and, for cylinders and
capsules, Gz along the axis of revolution.
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
"""Our choice: facets span 20 degrees and lean from the surface by at most 10, less than most
friction angles."""
_ROUNDING = 1e-9
"""Relative tolerance, our choice: above rounding errors of coordinates."""
_ROUNDS = 200
"""Our choice: number of iterations, far more than convergence to rounding errors takes."""


@dataclass(frozen=True, eq=False)
class Primitive:
    """A curved solid and its pose.

    Attributes:
        kind: the shape; spheres are ellipsoids.
        R_BG: axes of the shape in B, shape (3, 3).
        p_BG: its centre [m], shape (3,).
        radii: semi-axes of an ellipsoid along Gx, Gy, Gz [m], shape (3,). For cylinders and
            capsules the radius, the radius again, and half the length of the axis, which ends at
            the discs of a cylinder and at the centres of a capsule's hemispheres.
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
        """Projects points onto the curved surface.

        Args:
            p_B: points off the centre or axis [m], shape (M, 3).

        Returns:
            Points of the surface [m] and outward unit normals there, shape (M, 3) each. On
            ellipsoids they are in the direction of the point from the centre, on others they are
            the nearest; a cylinder goes on beyond its ends.
        """
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
        """Returns the signed distance of points from the solid, negative inside.

        Args:
            p_B: points [m], shape (M, 3).

        Returns:
            [m], shape (M,); inside ellipsoids only the sign is exact.
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

    def nearest_outside(self, p_B: Array) -> Array:
        """Returns the points of an ellipsoid that are nearest to points outside it.

        Args:
            p_B: points outside an ellipsoid [m], shape (M, 3).

        Returns:
            [m], shape (M, 3).
        """
        p_G = times(p_B - self.p_BG, self.R_BG)
        return self.p_BG + times(self._nearest_on_ellipsoid(p_G), self.R_BG.T)

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
        """Returns vectors whose convex cone contains all normals of the surface in a polytope.

        Args:
            p_B: corners of the polytope, near the curved surface [m], shape (M, 3).

        Returns:
            Outward vectors of any length, shape (M, 3), or (2 M, 3) where a capsule's hemisphere
            begins between the corners.
        """
        p_G = times(p_B - self.p_BG, self.R_BG)
        if self.kind == "ellipsoid":
            return times(p_G / self.radii**2, self.R_BG.T)
        normal = p_G - self._axis_point(p_G)
        part = np.digitize(p_G[:, 2], np.array([-1.0, 1.0]) * self.radii[2])
        if self.kind == "capsule" and (part != part[0]).any():
            # The normal's z component is not linear in the point, but within its range.
            low, high = normal.copy(), normal.copy()
            low[:, 2], high[:, 2] = normal[:, 2].min(), normal[:, 2].max()
            normal = np.concatenate([low, high])
        return times(normal, self.R_BG.T)

    def on_curve(self, p_B: Array, tolerance: float) -> Bools:
        """Returns which points are on the curved surface.

        Args:
            p_B: points [m], shape (M, 3).
            tolerance: greatest distance from the surface [m].

        Returns:
            Shape (M,).
        """
        near = np.linalg.norm(self.project(p_B)[0] - p_B, axis=1) <= tolerance
        if self.kind == "cylinder":
            z = times(p_B - self.p_BG, self.R_BG[:, 2])
            near &= np.abs(z) <= self.radii[2] + tolerance
        return np.asarray(near)

    def is_curved(self, nhat_B: Array) -> Bools:
        """Returns which facets of the tessellation are inscribed in the curved surface.

        The others are the ends of a cylinder.

        Args:
            nhat_B: outward unit normals of the facets, shape (T, 3).

        Returns:
            Shape (T,).
        """
        along = np.abs(times(nhat_B, self.R_BG[:, 2]))
        return np.asarray((self.kind != "cylinder") | (along < np.sqrt(0.5)))

    def farthest(self, p_B: Array) -> float:
        """Returns the greatest distance of a point from points of the solid [m].

        It climbs: the point of the solid that is extreme in the last direction is farther away.

        Args:
            p_B: the point [m], shape (3,).
        """
        p_G = times(p_B - self.p_BG, self.R_BG)
        start = np.array([v for v in np.ndindex(3, 3, 3) if v != (1, 1, 1)]) - 1.0
        direction = start / np.linalg.norm(start, axis=1, keepdims=True)
        for _ in range(_ROUNDS):
            arm = self._support(direction) - p_G
            direction = arm / np.linalg.norm(arm, axis=1, keepdims=True)
        return float(np.linalg.norm(arm, axis=1).max())

    def height(self, direction_B: Array) -> float:
        """Returns the support of the solid: its greatest coordinate along a direction, from Bo [m].

        Args:
            direction_B: a unit vector, shape (3,).
        """
        top = self._support(times(direction_B, self.R_BG)[None])[0]
        return float(times(self.p_BG, direction_B) + times(top, times(direction_B, self.R_BG)))

    def _support(self, direction: Array) -> Array:
        """Returns the extreme points of the solid along unit vectors, both in G, shape (M, 3)."""
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
        """Returns the points of the axis nearest to p_G; that of a cylinder is not bounded."""
        z = p_G[:, 2]
        if self.kind == "capsule":
            z = np.clip(z, -self.radii[2], self.radii[2])
        return np.asarray(z[:, None] * [0.0, 0.0, 1.0])

    def _distance_from_ellipsoid(self, p_G: Array) -> Array:
        """Returns signed distances of points from an ellipsoid; inside only the sign is exact."""
        level = np.linalg.norm(p_G / self.radii, axis=1)
        distance = (level - 1) * self.radii.min()
        rows = np.flatnonzero(level > 1)
        if len(rows):
            gap = p_G[rows] - self._nearest_on_ellipsoid(p_G[rows])
            distance[rows] = np.linalg.norm(gap, axis=1)
        return np.asarray(distance)

    def _nearest_on_ellipsoid(self, p_G: Array) -> Array:
        """Returns the nearest points of an ellipsoid to points outside it (Eberly).

        They are a^2 p / (a^2 + t), with t >= 0 found by bisection.
        """
        square = self.radii**2
        low, high = np.zeros(len(p_G)), np.linalg.norm(p_G * self.radii, axis=1)
        for _ in range(_ROUNDS):
            t = (low + high) / 2
            outside = np.linalg.norm(self.radii * p_G / (square + t[:, None]), axis=1) > 1
            low, high = np.where(outside, t, low), np.where(outside, high, t)
        return np.asarray(square * p_G / (square + high[:, None]))


def _entry(points: Array, along: Array, radius: float) -> Array:
    """Returns where rays from points (M, 3) enter a sphere about the origin, NaN if they miss it.

    The results are multiples of `along`, which may have any length.
    """
    a, b, c = dot(along, along), times(points, along), dot(points, points) - radius**2
    if a <= 0:
        return np.full(len(points), np.nan)
    square = b**2 - a * c
    root = np.sqrt(np.where(square >= 0, square, np.nan))
    # This form of the smaller root has no cancellation for points on the surface.
    return np.asarray(c / np.where(b < 0, root - b, np.nan))


def tessellation(primitive: Primitive) -> Array:
    """Returns the triangles of a polyhedron inscribed in a solid.

    Its facets are trapezoids between circles of latitude and polygons at the poles, so that none is
    a needle.

    Args:
        primitive: the solid.

    Returns:
        In B, counter-clockwise from outside [m], shape (T, 3, 3).
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
    """Returns how far the curved surface rises above a planar facet of its tessellation [m].

    Args:
        primitive: the curved solid.
        triangles: the triangles of the facet [m], shape (k, 3, 3).
    """
    nhat, _ = unit_normals(triangles)
    edges = (triangles + np.roll(triangles, -1, axis=1)) / 2
    inner = np.concatenate([edges.reshape(-1, 3), triangles.reshape(-1, 3).mean(0, keepdims=True)])
    surface, _ = primitive.project(inner)
    return float(times(surface - triangles[0, 0], nhat[0]).max())

"""Scans of everyday things: closed meshes of star-shaped solids, with noise."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.spatial import ConvexHull

from drake_polygrasp.arrays import Array

Radius = Callable[[Array], Array]
"""From unit vectors (N, 3) to the distance of the surface from the centre along each [m], (N,)."""


def scan(radius: Radius, num_triangles: int, noise: float, seed: int) -> Array:
    """Triangles (T, 3, 3) [m] of a star-shaped surface, counter-clockwise from outside.

    Vertices lie on a spiral around the centre, each moved by `noise` [m] (one standard deviation
    along each axis).
    """
    count = num_triangles // 2 + 2
    k = np.arange(count) + 0.5
    polar, turn = np.arccos(1 - 2 * k / count), np.pi * (1 + np.sqrt(5)) * k
    nhat = np.c_[np.cos(turn) * np.sin(polar), np.sin(turn) * np.sin(polar), np.cos(polar)]
    corners = ConvexHull(nhat).simplices
    inward = np.linalg.det(nhat[corners]) < 0
    corners[inward] = corners[inward, ::-1]
    points = nhat * radius(nhat)[:, None]
    points += noise * np.random.default_rng(seed).normal(size=points.shape)
    triangles: Array = points[corners]
    return triangles


def rounded_box(half: Array, rounding: float) -> Radius:
    """A box of half widths `half` [m], edges included, that are rounded by `rounding` [m]."""

    def distance(p: Array) -> Array:
        beyond = np.abs(p) - (np.asarray(half) - rounding)
        outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0) - rounding)

    return _where_zero(distance, float(np.linalg.norm(half)))


def can(radius: float, half_height: float, rounding: float) -> Radius:
    """A cylinder along z with rounded rims [m]."""

    def distance(p: Array) -> Array:
        across = np.hypot(p[:, 0], p[:, 1]) - (radius - rounding)
        along = np.abs(p[:, 2]) - (half_height - rounding)
        beyond = np.column_stack([across, along])
        outside = np.linalg.norm(np.maximum(beyond, 0), axis=1)
        return np.asarray(outside + np.minimum(beyond.max(axis=1), 0) - rounding)

    return _where_zero(distance, float(np.hypot(radius, half_height)))


def bottle(radius: float, half_height: float, rounding: float) -> Radius:
    """A can with a neck of 0.4 of its radius, half as long as the can."""
    body, neck = (
        can(radius, half_height, rounding),
        can(0.4 * radius, 2 * half_height, rounding / 2),
    )

    def outline(nhat: Array) -> Array:
        return np.where(nhat[:, 2] > 0, np.maximum(body(nhat), neck(nhat)), body(nhat))

    return outline


def blob(mean: float, seed: int) -> Radius:
    """A pebble of `mean` radius [m]: a few waves of random directions and phases, 12 percent."""
    rng = np.random.default_rng(seed)
    waves, phase = rng.normal(size=(6, 3)) * 2.0, rng.uniform(0, 2 * np.pi, 6)

    def outline(nhat: Array) -> Array:
        return np.asarray(mean * (1 + 0.02 * np.cos(nhat @ waves.T + phase).sum(axis=1)))

    return outline


def _where_zero(distance: Callable[[Array], Array], farthest: float) -> Radius:
    """Where rays leave a convex solid of signed distance `distance`, by bisection."""

    def radius(nhat: Array) -> Array:
        low, high = np.zeros(len(nhat)), np.full(len(nhat), farthest)
        for _ in range(60):
            middle = (low + high) / 2
            inside = distance(middle[:, None] * nhat) < 0
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        return low

    return radius

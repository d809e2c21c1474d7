"""Is a contact on the true surface? Judged from raw triangles, one by one, with code of its own.

A body is a list of parts, each an array of closed, outward-oriented triangles of shape (T, 3, 3).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drake_polygrasp.arrays import Array, Bools


def nearest_point(p: Array, triangle: Array) -> Array:
    """The point of the triangle nearest to p: by the region of barycentric coordinates p is in."""
    a, b, c = triangle
    ab, ac = b - a, c - a
    gram = np.array([[ab @ ab, ab @ ac], [ab @ ac, ac @ ac]])
    s, t = np.linalg.solve(gram, [ab @ (p - a), ac @ (p - a)])
    if s >= 0 and t >= 0 and s + t <= 1:
        return a + s * ab + t * ac
    ends = [(a, b), (b, c), (c, a)]
    along = [np.clip((p - x) @ (y - x) / ((y - x) @ (y - x)), 0, 1) for x, y in ends]
    on_sides = [x + k * (y - x) for k, (x, y) in zip(along, ends, strict=True)]
    return min(on_sides, key=lambda q: float(np.linalg.norm(p - q)))


def distance(p: Array, parts: Sequence[Array]) -> float:
    """From a point to the nearest triangle of all parts."""
    return min(float(np.linalg.norm(p - nearest_point(p, t))) for part in parts for t in part)


def winding_number(points: Array, triangles: Array) -> Array:
    """The solid angle under which the triangles are seen from each point, over 4 pi; shape (M,)."""
    a, b, c = np.moveaxis(triangles[None] - points[:, None, None], 2, 0)
    x, y, z = (np.linalg.norm(v, axis=-1) for v in (a, b, c))
    volume = np.einsum("mti,mti->mt", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("mti,mti->mt", u, v) for u, v in ((a, b), (b, c), (c, a)))
    return np.arctan2(volume, x * y * z + ab * z + bc * x + ca * y).sum(axis=1) / (2 * np.pi)


def inside(points: Array, parts: Sequence[Array]) -> Bools:
    """Whether the points are inside any part, shape (M,)."""
    return np.any([winding_number(points, part) > 0.5 for part in parts], axis=0)


def is_exposed(p_BC: Array, nhat_TB_B: Array, parts: Sequence[Array], step: float) -> Bools:
    """Whether a step outward from each contact leads into the open, and inward into the body."""
    outside = ~inside(p_BC - step * nhat_TB_B, parts)
    return outside & inside(p_BC + step * nhat_TB_B, parts)


def on_surface(p: Array, nhat: Array, parts: Sequence[Array], L: float) -> bool:
    """Whether one contact is on an exposed triangle to 1e-6 L with its inward normal to 1e-6."""
    for triangle in np.concatenate(list(parts)):
        outward = np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0])
        outward /= np.linalg.norm(outward)
        off = np.linalg.norm(p - nearest_point(p, triangle))
        if off <= 1e-6 * L and np.linalg.norm(outward + nhat) <= 1e-6:
            return bool(is_exposed(p[None], nhat[None], parts, 1e-4 * L)[0])
    return False

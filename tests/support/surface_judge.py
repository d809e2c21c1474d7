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


def distances(points: Array, triangles: Array) -> Array:
    """From points (M, 3) to triangles (T, 3, 3), by their edges and their planes, (M, T)."""
    nearest = np.full((len(points), len(triangles)), np.inf)
    within = np.ones_like(nearest, dtype=bool)
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    size = np.linalg.norm(normal, axis=1)
    for k in range(3):
        start, side = triangles[:, k], triangles[:, (k + 1) % 3] - triangles[:, k]
        arm = points[:, None] - start
        share = np.einsum("mti,ti->mt", arm, side) / np.maximum((side**2).sum(axis=1), 1e-300)
        gap = arm - np.clip(share, 0, 1)[..., None] * side
        nearest = np.minimum(nearest, np.linalg.norm(gap, axis=2))
        within &= np.einsum("mti,ti->mt", arm, np.cross(normal, side)) >= 0
    height = np.abs(np.einsum("mti,ti->mt", points[:, None] - triangles[:, 0], normal))
    flat = size > 0
    height[:, flat] /= size[flat]
    return np.where(within & flat, height, nearest)


def contact_faults(
    p_BC: Array,
    nhat_TB_B: Array,
    raw: Sequence[Array],
    solids: Sequence[Array],
    L: float,
    tip_radius: float = 0.0,
) -> list[str]:
    """What is wrong with contacts (M, 3) on a body, in words.

    `raw` are the triangles as a file has them, in any sense of rotation; `solids` the closed,
    outward-oriented shells they were made from.
    """
    triangles = np.concatenate(list(raw))
    nhat = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    nhat /= np.maximum(np.linalg.norm(nhat, axis=1, keepdims=True), 1e-300)
    gap = distances(p_BC, triangles)
    faults = [f"{p} is off the surface" for p in p_BC[gap.min(axis=1) > 1e-6 * L]]
    lean = np.minimum(
        np.linalg.norm(nhat_TB_B[:, None] - nhat, axis=2),
        np.linalg.norm(nhat_TB_B[:, None] + nhat, axis=2),
    )
    wrong = ~((gap <= 1e-6 * L) & (lean <= 1e-6)).any(axis=1)
    faults += [
        f"{n} is no normal at {p}" for p, n in zip(p_BC[wrong], nhat_TB_B[wrong], strict=True)
    ]
    for step in (1e-5, 1e-4, 9e-4):
        faults += [f"{p} is covered" for p in p_BC[inside(p_BC - step * L * nhat_TB_B, solids)]]
    faults += [f"{p} is hollow" for p in p_BC[~inside(p_BC + 1e-5 * L * nhat_TB_B, solids)]]
    room = distances(p_BC - tip_radius * nhat_TB_B, triangles).min(axis=1)
    return faults + [f"no tip fits at {p}" for p in p_BC[room < tip_radius - 3e-5 * L]]

"""Arrays of triangles: welding, closed shells, orientation, distance, what they enclose.

The section of a polyhedron that the paper takes for granted: a model's collision geometry is a
soup of triangles, and only closed, outward-oriented shells have an inside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints

_POINTS_AT_ONCE = 1 << 12
"""Ours: temporaries of some ten megabytes."""
_BINS = 8
"""A side, ours: some 400 bins on the surface of a round body."""
_RAY = np.array([[0.6, -0.48, 0.64], [0.8, 0.36, -0.48], [0.0, 0.8, 0.6]])
"""A rotation, ours, whose third column no usual face is parallel to."""


class Shells(NamedTuple):
    """Triangles by vertex index, each shell oriented outward."""

    corners: Ints
    """Vertex indices, shape (T, 3), counter-clockwise from outside."""
    shell: Ints
    """The shell of each triangle, numbered from 0 in the order of first triangles, shape (T,)."""
    closed: Bools
    """Whether each shell is watertight, shape (S,)."""
    simple: Bools
    """Whether no edge of each shell has more than two of its triangles, shape (S,)."""


def weld(triangles: Array, tolerance: float) -> tuple[Array, Ints]:
    """Vertices (V, 3) and vertex indices (T, 3) of triangles (T, 3, 3).

    Coordinates that differ by less than `tolerance` are one, also across a chain of such, so that
    no grid line can part two equal vertices.
    """
    points = triangles.reshape(-1, 3)
    bins = np.empty(points.shape, dtype=np.int64)
    for axis, values in enumerate(points.T):
        order = np.argsort(values, kind="stable")
        bins[order, axis] = np.cumsum(np.diff(values[order], prepend=-np.inf) > tolerance)
    _, first, inverse = np.unique(bins, axis=0, return_index=True, return_inverse=True)
    return points[first], inverse.reshape(-1, 3).astype(np.int64)


def connected_components(num_nodes: int, a: Ints, b: Ints) -> Ints:
    """The least node of each node's component in the graph of links a[k] - b[k]."""
    label = np.arange(num_nodes)
    while True:
        least = np.minimum(label[a], label[b])
        lower = label.copy()
        for ends in (a, b, label[a], label[b]):
            np.minimum.at(lower, ends, least)
        lower = lower[lower]
        if np.array_equal(lower, label):
            return label
        label = lower


def oriented_shells(vertices: Array, corners: Ints) -> Shells:
    """The shells of a mesh, each oriented so that its volume is positive.

    Triangles that share an edge with no third are of one shell, and must run along it in opposite
    senses; shells that contradict this are mended. Shells that this leaves open may be closed by
    edges of more triangles, where solids touch or overlap; across those the file's sense counts.
    """
    a, b, c = corners.T
    corners = corners[(a != b) & (b != c) & (c != a)]
    edge, forward = _half_edges(corners)
    paired = np.bincount(edge)[edge] == 2
    first, second = _links(edge, np.flatnonzero(paired))
    flips = forward[first] == forward[second]
    shell, reverse = _shells(len(corners), first // 3, second // 3, flips)
    is_open = _open_shells(_reversed(corners, reverse), shell)[shell]
    third, fourth = _links(edge, np.flatnonzero(~paired & np.repeat(is_open, 3)))
    first, second = np.append(first, third) // 3, np.append(second, fourth) // 3
    flips = np.append(flips, np.zeros(len(third), dtype=bool))
    shell, reverse = _shells(len(corners), first, second, flips)
    corners = _reversed(corners, reverse)
    inward = np.bincount(shell, weights=_signed_volumes(vertices, corners, shell)) < 0
    return Shells(
        corners=_reversed(corners, inward[shell]),
        shell=shell,
        closed=~_open_shells(corners, shell),
        simple=np.bincount(shell, weights=np.isin(np.arange(len(shell)), third // 3)) == 0,
    )


def _half_edges(corners: Ints) -> tuple[Ints, Bools]:
    """Of the three sides of each triangle: undirected edge (3T,) and whether it runs upward."""
    tail, head = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    _, edge = np.unique(low * (high.max(initial=0) + 1) + high, return_inverse=True)
    return edge.astype(np.int64), tail < head


def edge_neighbors(corners: Ints) -> tuple[Ints, Ints]:
    """Pairs (t, u) of triangles that share an edge, each in both orders, by ascending t."""
    edge, _ = _half_edges(corners)
    first, second = _links(edge, np.arange(edge.size))
    t, u = np.append(first, second) // 3, np.append(second, first) // 3
    order = np.lexsort((u, t))
    return t[order], u[order]


def _links(edge: Ints, half_edges: Ints) -> tuple[Ints, Ints]:
    """Pairs that make a chain of those of the given half-edges that share an edge."""
    half_edges = half_edges[np.argsort(edge[half_edges], kind="stable")]
    same = np.diff(edge[half_edges]) == 0
    return half_edges[:-1][same], half_edges[1:][same]


def _shells(T: int, t: Ints, u: Ints, flips: Bools) -> tuple[Ints, Bools]:
    """The shell of each of T triangles, and whether it must be reversed to agree with the first.

    Linked triangles t[k] and u[k] agree, or do when one is reversed. Solved on the double cover,
    where node t is triangle t as it is and node t + T its reverse.
    """
    turn = np.where(flips, T, 0)
    cover = connected_components(2 * T, np.append(t, t + T), np.append(u + turn, u + T - turn))
    as_is, reverse = cover[:T], cover[T:]
    _, shell = np.unique(np.minimum(as_is, reverse), return_inverse=True)
    return shell.astype(np.int64), reverse < as_is


def _reversed(corners: Ints, which: Bools) -> Ints:
    return np.where(which[:, None], corners[:, ::-1], corners)


def _open_shells(corners: Ints, shell: Ints) -> Bools:
    """Whether some edge of each shell is not run along equally often in both senses."""
    edge, forward = _half_edges(corners)
    num_shells = int(shell.max(initial=-1)) + 1
    _, side = np.unique(edge * num_shells + np.repeat(shell, 3), return_inverse=True)
    unbalanced = np.bincount(side, weights=np.where(forward, 1, -1)) != 0
    return np.bincount(np.repeat(shell, 3), weights=unbalanced[side]) > 0


def _signed_volumes(vertices: Array, corners: Ints, shell: Ints) -> Array:
    """Of the tetrahedra from each shell's mean vertex, so that open shells have a sign too."""
    triangles = vertices[corners]
    count = np.bincount(shell)[:, None]
    sums = [np.bincount(shell, weights=x) for x in triangles.mean(axis=1).T]
    a, b, c = np.moveaxis(triangles - (np.stack(sums, axis=1) / count)[shell][:, None], 1, 0)
    return np.asarray(np.einsum("ij,ij->i", a, np.cross(b, c)) / 6)


def unit_normals(triangles: Array) -> tuple[Array, Array]:
    """Unit normals (T, 3) by the right-hand rule, and areas (T,).

    Components below 1e-12, rounding errors, become 0; a triangle without area has normal 0.
    """
    cross = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.linalg.norm(cross, axis=1)
    return tidy(cross / np.where(length > 0, length, 1)[:, None]), length / 2


def tidy(vectors: Array) -> Array:
    """Unit vectors (..., 3) without components below 1e-12; zero vectors stay."""
    vectors = np.where(np.abs(vectors) < 1e-12, 0.0, vectors)
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.asarray(vectors / np.where(length > 0, length, 1))


def face_frame(normal: Array) -> Array:
    """R_BF (3, 3) with Fz along `normal`, and Fx near the body axis most nearly in the plane.

    So the axes of an axis-aligned face are axis-aligned.
    """
    Fz = tidy(normal)
    axis = np.eye(3)[np.argmin(np.round(np.abs(Fz), 9))]
    Fx = tidy(axis - Fz * (axis @ Fz))
    return np.stack([Fx, tidy(np.cross(Fz, Fx)), Fz], axis=1)


def diameter(points: Array) -> float:
    """Greatest distance between two of the points (V, 3).

    Points are binned; only pairs of bins that may hold a greater distance than one already found
    are measured, so that a round body of many vertices takes no square of their number.
    """
    points = np.unique(points - points.mean(axis=0), axis=0)
    size = np.ptp(points, axis=0).max() / _BINS
    bins = np.floor(points / size) if size > 0 else np.zeros_like(points)
    _, owner = np.unique(bins, axis=0, return_inverse=True)
    order = np.argsort(owner.ravel(), kind="stable")
    points, owner = points[order], owner.ravel()[order]
    start = np.flatnonzero(np.diff(owner, prepend=-1))
    low, high = np.minimum.reduceat(points, start), np.maximum.reduceat(points, start)
    bound = np.linalg.norm(np.maximum(high[:, None] - low[None], high[None] - low[:, None]), axis=2)
    end = points[0]
    for _ in range(4):
        end = points[np.argmax(np.linalg.norm(points - end, axis=1))]
    greatest = float(np.linalg.norm(points - end, axis=1).max())
    i, j = np.nonzero(np.triu(bound >= greatest))
    members = np.split(points, start[1:])
    for k in np.argsort(-bound[i, j], kind="stable"):
        if bound[i[k], j[k]] < greatest:
            break
        gap = members[i[k]][:, None] - members[j[k]]
        greatest = max(greatest, float(np.sqrt(np.einsum("abi,abi->ab", gap, gap).max())))
    return greatest


def winding_numbers(points: Array, triangles: Array) -> Ints:
    """How often closed, outward-oriented triangles (T, 3, 3) wind around points (M, 3); (M,).

    Counts signed crossings of a ray from each point. Sides belong to one of the two triangles
    that share them, so that none is counted twice.
    """
    if not len(triangles) or not len(points):
        return np.zeros(len(points), dtype=np.int64)
    # Along no axis, where the walls of made things would hold the whole ray.
    points, triangles = points @ _RAY, triangles @ _RAY
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    i, t = tree.query(shapely.points(points[:, :2]))
    i, t = (x[points[i, 2] <= high[t, 2]] for x in (i, t))
    corner = triangles[t] - points[i][:, None]
    head = np.roll(corner, -1, axis=1)
    left = corner[..., 0] * head[..., 1] - head[..., 0] * corner[..., 1]
    upward = (corner[..., 1] <= 0) & (head[..., 1] > 0) & (left > 0)
    downward = (head[..., 1] <= 0) & (corner[..., 1] > 0) & (left < 0)
    turns = upward.sum(axis=1) - downward.sum(axis=1)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    above = np.einsum("ni,ni->n", corner[:, 0], normal) * np.sign(normal[:, 2]) > 0
    winding = np.bincount(i, weights=turns * above, minlength=len(points))
    return winding.astype(np.int64)


def point_triangle_distance(points: Array, triangles: Array) -> Array:
    """Distance of each point to its triangle; shapes (..., 3) and (..., 3, 3) broadcast to (...).

    The nearest point is the orthogonal projection when that lies within the triangle, else on a
    side.
    """
    corner = np.moveaxis(triangles, -2, 0)
    side = np.roll(corner, -1, axis=0) - corner
    offset = points - corner
    normal = np.cross(side[0], side[1])
    square = np.einsum("...i,...i->...", normal, normal)
    inside = square > 0
    on_sides = np.full(offset.shape[1:-1], np.inf)
    for s, w in zip(side, offset, strict=True):
        inside = inside & (np.einsum("...i,...i->...", np.cross(s, w), normal) >= 0)
        length = np.einsum("...i,...i->...", s, s)
        along = np.einsum("...i,...i->...", s, w) / np.where(length > 0, length, 1)
        nearest = w - np.clip(along, 0, 1)[..., None] * s
        on_sides = np.minimum(on_sides, np.linalg.norm(nearest, axis=-1))
    height = np.abs(np.einsum("...i,...i->...", offset[0], normal))
    return np.where(inside, height / np.sqrt(np.where(square > 0, square, 1)), on_sides)


def pairs_closer_than(points: Array, triangles: Array, reach: float) -> tuple[Ints, Ints, Array]:
    """Pairs (point, triangle) within `reach`, and their distances; shapes (N,), (N,), (N,).

    Only triangles whose bounding box is within reach are measured.
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    tree = shapely.STRtree(shapely.box(low[:, 0], low[:, 1], high[:, 0], high[:, 1]))
    found: list[tuple[Ints, Ints, Array]] = []
    for k in range(0, len(points), _POINTS_AT_ONCE):
        rows = points[k : k + _POINTS_AT_ONCE]
        x, y, z = rows.T
        i, j = tree.query(shapely.box(x - reach, y - reach, x + reach, y + reach))
        level = (z[i] >= low[j, 2] - reach) & (z[i] <= high[j, 2] + reach)
        i, j = i[level], j[level]
        distance = point_triangle_distance(rows[i], triangles[j])
        near = distance <= reach
        found.append((k + i[near], j[near], distance[near]))
    if not found:
        return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    point, triangle, distance = (np.concatenate(x) for x in zip(*found, strict=True))
    return point, triangle, distance

"""Arrays of triangles: welding, closed shells, orientation, distance. Pure numpy.

The section of a polyhedron that the paper takes for granted: a model's collision geometry is a
soup of triangles, and only closed, outward-oriented shells have an inside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from drake_polygrasp.grasp import Array, Bools, Ints

_CHUNK = 1 << 20
"""Pairs handled at once, ours: temporaries of some ten megabytes."""


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


def diameter(points: Array) -> float:
    """Greatest distance between two of the points (V, 3)."""
    points = np.unique(points - points.mean(axis=0), axis=0)
    step = max(1, _CHUNK // len(points))
    greatest = 0.0
    square = np.einsum("ij,ij->i", points, points)
    for k in range(0, len(points), step):
        rows = slice(k, k + step)
        distance = square[rows, None] + square - 2 * points[rows] @ points.T
        i, j = np.unravel_index(np.argmax(distance), distance.shape)
        greatest = max(greatest, float(np.linalg.norm(points[k + i] - points[j])))
    return greatest


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
    found: list[tuple[Ints, Ints, Array]] = []
    step = max(1, _CHUNK // max(1, len(triangles)))
    for k in range(0, len(points), step):
        rows = points[k : k + step, None]
        gap = np.maximum(0, np.maximum(low - rows, rows - high))
        i, j = np.nonzero(np.einsum("ijk,ijk->ij", gap, gap) <= reach**2)
        distance = point_triangle_distance(points[k + i], triangles[j])
        near = distance <= reach
        found.append((k + i[near], j[near], distance[near]))
    if not found:
        return np.empty(0, np.int64), np.empty(0, np.int64), np.empty(0)
    point, triangle, distance = (np.concatenate(x) for x in zip(*found, strict=True))
    return point, triangle, distance

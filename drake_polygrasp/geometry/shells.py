"""Shells: soups of triangles welded, freed of copies and oriented outward.

The section of a polyhedron that the paper takes for granted: a model's collision geometry is a
soup of triangles, and only closed, outward-oriented shells have an inside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import distinct, unit_normals

_JUST_OUTSIDE = 1e-4
"""Times the size of a triangle, ours: where to look whether another shell is around it."""


class Shells(NamedTuple):
    """Triangles by vertex index, each shell oriented outward.

    Attributes:
        corners: vertex indices, shape (T, 3), counter-clockwise from outside.
        shell: the shell of each triangle, numbered from 0 in the order of first triangles, shape
            (T,).
        closed: whether each shell is watertight, shape (S,).
        simple: whether no edge of each shell has more than two of its triangles, shape (S,).
        turned: whether each triangle ran the other way as it was given, shape (T,).
    """

    corners: Ints
    shell: Ints
    closed: Bools
    simple: Bools
    turned: Bools


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
    first, inverse = distinct(bins)
    return points[first], inverse.reshape(-1, 3)


def without_doubles(corners: Ints) -> Ints:
    """Triangles (T, 3) by vertex index, without collapsed ones and copies by mistake.

    Solids may share a triangle, but each has another one on each of its sides. Copies that too few
    others go with on two sides are therefore left out.
    """
    collapsed = (corners == np.roll(corners, 1, axis=1)).any(axis=1)
    corners = corners[~collapsed | collapsed.all()]
    while True:
        first, group = distinct(np.sort(corners, axis=1))
        if len(first) == len(corners):
            return corners
        copies = np.bincount(group)[group]
        edge, _ = _half_edges(corners)
        others = np.bincount(edge)[edge].reshape(-1, 3) - copies[:, None]
        too_few = ((others > 0) & (others < copies[:, None])).sum(axis=1) >= 2
        spare = first[too_few[first] & (copies[first] > 1)]
        if not len(spare):
            return corners
        corners = np.delete(corners, spare, axis=0)


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
        turned=reverse ^ inward[shell],
    )


def faces_inward(triangles: Array, tolerance: float) -> Bools:
    """Returns which triangles of a mesh face into the solid that they bound, shape (T,).

    The walls of a cavity, a shell within another one, face inward by right. Sheets that enclose
    nothing have no inside.

    Args:
        triangles: shape (T, 3, 3) [m].
        tolerance: coordinates that differ by less are one [m].
    """
    vertices, corners = weld(triangles, tolerance)
    rows = np.flatnonzero((corners != np.roll(corners, 1, axis=1)).all(axis=1))
    shells = oriented_shells(vertices, corners[rows])
    inward = np.zeros(len(triangles), dtype=bool)
    if not shells.turned.any():
        return inward
    turned = shells.turned
    volume = np.bincount(shells.shell, _signed_volumes(vertices, shells.corners, shells.shell))
    area = np.bincount(shells.shell, unit_normals(vertices[shells.corners])[1])
    turned = turned & (volume > tolerance * area)[shells.shell]
    inward[rows] = turned & ~_within_another(vertices[shells.corners], shells)[shells.shell]
    return inward


def _within_another(triangles: Array, shells: Shells) -> Bools:
    """Which shells are within another one: just outside them is inside, shape (S,)."""
    nhat, area = unit_normals(triangles)
    order = np.lexsort((-area, shells.shell))
    largest = order[np.flatnonzero(np.diff(shells.shell[order], prepend=-1))]
    step = _JUST_OUTSIDE * np.sqrt(area[largest])[:, None] * nhat[largest]
    closed = TriangleSoup(triangles[shells.closed[shells.shell]])
    return closed.winding_numbers(triangles[largest].mean(axis=1) + step) > 0


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

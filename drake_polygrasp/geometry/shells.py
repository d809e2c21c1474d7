"""Welds triangles into shells, removes duplicates and orients the shells outward.

The paper starts from a polyhedron. A model's collision geometry is an unordered list of triangles,
of which only closed, outward-oriented shells have an inside.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.geometry.open_shells import open_shells_inward
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import distinct, unit_normals
from drake_polygrasp.geometry.two_sided import links_in_front

_JUST_OUTSIDE = 1e-4
"""Times the square root of a triangle's area, our choice: height over the triangle of the point
that is tested for being inside another shell."""

_NO_VOLUME = 1e-6
"""Times the sum of the volumes of tetrahedra from a shell's middle to its triangles, our choice: a
shell whose signed volumes add up to less encloses nothing."""


class Shells(NamedTuple):
    """Triangles by vertex index, in shells that are oriented outward.

    Attributes:
        corners: vertex indices, shape (T, 3), counter-clockwise from outside.
        shell: the shell of each triangle, numbered from 0 by first triangles, shape (T,).
        closed: whether each shell is watertight, shape (S,).
        simple: whether each shell has at most two triangles at every edge, shape (S,).
        turned: whether each triangle was given with the opposite orientation, shape (T,).
        spare: whether each triangle is of the inner side of a solid whose faces are all stated both
            ways round, shape (T,).
    """

    corners: Ints
    shell: Ints
    closed: Bools
    simple: Bools
    turned: Bools
    spare: Bools


def weld(triangles: Array, tolerance: float) -> tuple[Array, Ints]:
    """Returns the vertices of triangles, where nearly equal ones are one, and vertex indices.

    Along each axis, neighbours among the sorted coordinates are equal if their gap is at most the
    tolerance. Unlike rounding to a grid, this never separates coordinates that differ by less.

    Args:
        triangles: [m], shape (T, 3, 3).
        tolerance: the greatest gap between equal coordinates [m].

    Returns:
        Vertices [m], shape (V, 3), and the indices of each triangle's corners, shape (T, 3).
    """
    points = triangles.reshape(-1, 3)
    bins = np.empty(points.shape, dtype=np.int64)
    for axis, values in enumerate(points.T):
        order = np.argsort(values, kind="stable")
        bins[order, axis] = np.cumsum(np.diff(values[order], prepend=-np.inf) > tolerance)
    first, inverse = distinct(bins)
    return points[first], inverse.reshape(-1, 3)


def without_doubles(corners: Ints) -> Ints:
    """Returns the triangles without degenerate ones and without spurious copies.

    Two solids can share a triangle, but then each of them has another triangle at each of its
    sides. A copy is spurious if, on two or more of its sides, there are other triangles but fewer
    than there are copies.

    Args:
        corners: vertex indices, shape (T, 3).

    Returns:
        Rows of `corners`, shape (N, 3); all of them if all are degenerate.
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
    """Returns the least node of each node's connected component in a graph.

    Args:
        num_nodes: number of nodes.
        a: one end of each link, shape (K,).
        b: its other end, shape (K,).

    Returns:
        Shape (num_nodes,).
    """
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
    """Returns the shells of a mesh, each oriented outward.

    Closed ones have a positive volume. Open ones are oriented as the file gives most of their area,
    or the other way where they would face into what all open shells enclose together.

    Two triangles that share an edge with no third belong to one shell and are oriented
    consistently: they run along the edge in opposite senses. Shells that this leaves open may be
    joined at edges of more than two triangles, where solids touch or overlap; there triangles keep
    the orientation that the file gives them. A solid whose faces are all stated both ways round is
    two coincident shells.

    Args:
        vertices: [m], shape (V, 3).
        corners: vertex indices, shape (T, 3); triangles with a repeated vertex are left out.
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
    shell, apart = _sides_apart(vertices, corners, shell)
    inward = np.bincount(shell, weights=_signed_volumes(vertices, corners, shell)) < 0
    is_open = _open_shells(corners, shell)
    if is_open.any():
        inward[is_open] = _open_inward(vertices, corners, shell, reverse, is_open)[is_open]
    return Shells(
        corners=_reversed(corners, inward[shell]),
        shell=shell,
        closed=~is_open,
        simple=np.bincount(shell, weights=np.isin(np.arange(len(shell)), third // 3)) == 0,
        turned=reverse ^ inward[shell],
        spare=apart & inward[shell],
    )


def _open_inward(
    vertices: Array, corners: Ints, shell: Ints, reverse: Bools, is_open: Bools
) -> Bools:
    """Returns which of the open shells to reverse, by shell; `reverse` says where the file differs.

    Each is first oriented as the file gives most of its area.
    """
    rows = np.flatnonzero(is_open[shell])
    _, area = unit_normals(vertices[corners[rows]])
    sign = np.where(reverse[rows], -area, area)
    against = np.bincount(shell[rows], sign, minlength=len(is_open)) < 0
    given = _reversed(corners[rows], against[shell[rows]])
    wrong = open_shells_inward(vertices[given], shell[rows])
    against[: len(wrong)] ^= wrong
    return against


def _sides_apart(vertices: Array, corners: Ints, shell: Ints) -> tuple[Ints, Bools]:
    """Returns the shells, and which triangles are of those that are taken apart here.

    A shell whose faces are all stated both ways round becomes two, one for each side. Both are
    closed, and coincide. A sheet that is stated both ways round has a rim, which joins its two
    sides: it encloses no volume and stays one shell.
    """
    volume = _signed_volumes(vertices, corners, shell)
    total = np.bincount(shell, np.abs(volume))
    hollow = np.abs(np.bincount(shell, volume)) <= _NO_VOLUME * total
    rows = np.flatnonzero((hollow & ~_open_shells(corners, shell))[shell])
    is_apart = np.zeros(len(shell), dtype=bool)
    if not len(rows):
        return shell, is_apart
    edge, forward = _half_edges(corners[rows])
    first, second = links_in_front(vertices, corners[rows], edge, forward)
    as_they_are = np.zeros(len(first), dtype=bool)
    side, _ = _shells(len(rows), first // 3, second // 3, as_they_are)
    volume = _signed_volumes(vertices, corners[rows], side)
    solid = np.abs(np.bincount(side, volume)) > _NO_VOLUME * np.bincount(side, np.abs(volume))
    solid &= ~_open_shells(corners[rows], side)
    left = np.bincount(shell[rows], ~solid[side], minlength=len(total))
    split = left[shell[rows]] == 0
    apart = shell.copy()
    apart[rows[split]] = len(total) + side[split]
    is_apart[rows[split]] = True
    _, first_row, apart = np.unique(apart, return_index=True, return_inverse=True)
    order = np.argsort(np.argsort(first_row, kind="stable"), kind="stable")
    return order[apart], is_apart


def faces_inward(triangles: Array, tolerance: float) -> tuple[Bools, Bools]:
    """Returns which triangles of a mesh face into the solid that they bound, and which are spare.

    A shell inside another one is the wall of a cavity and rightly faces inward. Sheets that
    enclose no volume have no inside. Of a solid whose faces are all stated both ways round, the
    triangles of the inner side are spare.

    Args:
        triangles: [m], shape (T, 3, 3).
        tolerance: coordinates that differ by less are equal [m].

    Returns:
        Both of shape (T,).
    """
    vertices, corners = weld(triangles, tolerance)
    rows = np.flatnonzero((corners != np.roll(corners, 1, axis=1)).all(axis=1))
    shells = oriented_shells(vertices, corners[rows])
    inward, spare = np.zeros((2, len(triangles)), dtype=bool)
    spare[rows] = shells.spare
    if not shells.turned.any():
        return inward, spare
    turned = shells.turned
    volume = np.bincount(shells.shell, _signed_volumes(vertices, shells.corners, shells.shell))
    area = np.bincount(shells.shell, unit_normals(vertices[shells.corners])[1])
    turned = turned & (~shells.closed | (volume > tolerance * area))[shells.shell]
    inward[rows] = turned & ~_within_another(vertices[shells.corners], shells)[shells.shell]
    return inward & ~spare, spare


def _within_another(triangles: Array, shells: Shells) -> Bools:
    """Returns which shells are inside another one, by a point just outside of each, shape (S,)."""
    nhat, area = unit_normals(triangles)
    order = np.lexsort((-area, shells.shell))
    largest = order[np.flatnonzero(np.diff(shells.shell[order], prepend=-1))]
    step = _JUST_OUTSIDE * np.sqrt(area[largest])[:, None] * nhat[largest]
    closed = TriangleSoup(triangles[shells.closed[shells.shell]])
    return closed.winding_numbers(triangles[largest].mean(axis=1) + step) > 0


def _half_edges(corners: Ints) -> tuple[Ints, Bools]:
    """Returns the undirected edge of each triangle's three sides, and their sense.

    Returns:
        The number of the edge, shape (3 T,), and whether the side runs from the lower to the
        higher vertex index, shape (3 T,).
    """
    tail, head = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    _, edge = np.unique(low * (high.max(initial=0) + 1) + high, return_inverse=True)
    return edge.astype(np.int64), tail < head


def edge_neighbors(corners: Ints) -> tuple[Ints, Ints]:
    """Returns pairs of triangles that share an edge.

    Where more than two share one, they are paired in a chain.

    Args:
        corners: vertex indices, shape (T, 3).

    Returns:
        t and u of the pairs, each pair in both orders, by ascending t, shape (N,) each.
    """
    edge, _ = _half_edges(corners)
    first, second = _links(edge, np.arange(edge.size))
    t, u = np.append(first, second) // 3, np.append(second, first) // 3
    order = np.lexsort((u, t))
    return t[order], u[order]


def _links(edge: Ints, half_edges: Ints) -> tuple[Ints, Ints]:
    """Returns pairs of half-edges that link those of the same edge in a chain."""
    half_edges = half_edges[np.argsort(edge[half_edges], kind="stable")]
    same = np.diff(edge[half_edges]) == 0
    return half_edges[:-1][same], half_edges[1:][same]


def _shells(T: int, t: Ints, u: Ints, flips: Bools) -> tuple[Ints, Bools]:
    """Returns the shell of each of T triangles, and whether to reverse it to agree with the first.

    Linked triangles t[k] and u[k] agree as they are, or, where `flips` says so, with one of them
    reversed. This is solved on the double cover of the graph, where node t is triangle t as it is
    and node t + T the same triangle reversed.
    """
    turn = np.where(flips, T, 0)
    cover = connected_components(2 * T, np.append(t, t + T), np.append(u + turn, u + T - turn))
    as_is, reverse = cover[:T], cover[T:]
    _, shell = np.unique(np.minimum(as_is, reverse), return_inverse=True)
    return shell.astype(np.int64), reverse < as_is


def _reversed(corners: Ints, which: Bools) -> Ints:
    """Returns triangles with some of them reversed."""
    return np.where(which[:, None], corners[:, ::-1], corners)


def _open_shells(corners: Ints, shell: Ints) -> Bools:
    """Returns which shells have an edge that is not traversed equally often in both senses."""
    edge, forward = _half_edges(corners)
    num_shells = int(shell.max(initial=-1)) + 1
    _, side = np.unique(edge * num_shells + np.repeat(shell, 3), return_inverse=True)
    unbalanced = np.bincount(side, weights=np.where(forward, 1, -1)) != 0
    return np.bincount(np.repeat(shell, 3), weights=unbalanced[side]) > 0


def _signed_volumes(vertices: Array, corners: Ints, shell: Ints) -> Array:
    """Returns the signed volumes of tetrahedra from each shell's mean point to its triangles."""
    triangles = vertices[corners]
    count = np.bincount(shell)[:, None]
    sums = [np.bincount(shell, weights=x) for x in triangles.mean(axis=1).T]
    a, b, c = np.moveaxis(triangles - (np.stack(sums, axis=1) / count)[shell][:, None], 1, 0)
    return np.asarray(np.einsum("ij,ij->i", a, np.cross(b, c)) / 6)

"""Pairs the triangles at an edge by the space in front of them, for meshes of two-sided faces.

Some programs export every face twice, once each way round, so that renderers show both sides. Such
a mesh is two coincident surfaces, one that faces outward and one that faces inward.
"""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.geometry.tolerances import SAME_NORMAL
from drake_polygrasp.vectors import cross, dot, unit


def links_in_front(vertices: Array, corners: Ints, edge: Ints, forward: Bools) -> tuple[Ints, Ints]:
    """Returns pairs of half-edges whose triangles bound the same wedge of space in front of them.

    Around an edge, each triangle faces the next one that faces it. Triangles that coincide back to
    back do not face each other.

    Args:
        vertices: [m], shape (V, 3).
        corners: vertex indices, counter-clockwise from the front, shape (T, 3).
        edge: number of the edge of each triangle's three sides, shape (3 T,).
        forward: whether each side runs from the lower to the higher vertex index, shape (3 T,).

    Returns:
        Half-edges, numbered as `edge`, shape (N,) each; a half-edge that no other faces is in none.
    """
    tail, head = corners.ravel(), np.roll(corners, -1, axis=1).ravel()
    apex = np.roll(corners, 1, axis=1).ravel()
    low, high = vertices[np.minimum(tail, head)], vertices[np.maximum(tail, head)]
    along = unit(high - low)
    reach = vertices[apex] - low
    reach = unit(reach - dot(reach, along)[:, None] * along)
    _, first = np.unique(edge, return_index=True)
    start = reach[first][edge]
    # Angles about the edge, from the triangle of its first half-edge.
    angle = np.arctan2(dot(cross(along, start), reach), dot(start, reach))
    angle = np.where(angle < -SAME_NORMAL, angle + 2 * np.pi, np.maximum(angle, 0.0))
    order = np.lexsort((angle, edge))
    new = (np.diff(angle[order], prepend=0.0) > SAME_NORMAL) | (
        np.diff(edge[order], prepend=-1) > 0
    )
    place = np.empty(len(order), dtype=np.int64)
    place[order] = np.cumsum(new)
    # Triangles that run forward face greater angles.
    order = np.lexsort((forward, place))
    begin = np.searchsorted(edge[order], edge[order], side="left")
    end = np.searchsorted(edge[order], edge[order], side="right")
    rank = np.arange(len(order)) + 1
    after = order[np.where(rank < end, rank, begin)]
    faced = forward[order] & ~forward[after]
    return order[faced], after[faced]

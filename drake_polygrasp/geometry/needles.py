"""Tight bounding boxes of triangles, also of long and narrow ones (needles) oblique to the axes.

The box of such a needle can have thousands of times its area, and the boxes of a mesh of needles,
as on finely tessellated cylinders, would be near every point. Needles are therefore cut into
pieces.
"""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.vectors import circle, times

_MAX_PIECES = 32
"""Our choice: each piece takes about 500 bytes in a tree."""
_FAT = 4.0
"""Our choice: a triangle whose box has more than this times its area, seen along z, is a needle."""
_SLIM = 2.0
"""Our choice: slimness, in the sense of `_slimness`, of the needles that decide the rotation."""
_TINY = np.finfo(float).tiny
_ROUNDING = 1e-12
"""Times a box's diagonal, our choice: added to boxes of pieces against rounding errors."""


def bounding_boxes(triangles: Array) -> tuple[Array, Array, Ints]:
    """Returns bounding boxes whose union contains the triangles: several for each needle.

    The number of pieces of a needle grows with the area of its box, seen along z, relative to the
    area that the whole mesh has for each triangle.

    Args:
        triangles: shape (T, 3, 3).

    Returns:
        The boxes' corners of least and of greatest coordinates, shape (N, 3) each, and the triangle
        of each box, shape (N,). Without needles N is T, in the order of the triangles.
    """
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    if not len(triangles):
        return low, high, np.empty(0, dtype=np.int64)
    count = _num_pieces(triangles, low, high)
    single, needles = np.flatnonzero(count == 1), np.flatnonzero(count > 1)
    if not len(needles):
        return low, high, np.arange(len(triangles))
    owner = np.repeat(needles, count[needles])
    piece = np.arange(len(owner)) - np.searchsorted(owner, owner)
    ends = np.stack([piece, piece + 1], axis=1) / count[owner, None]
    points = _slab_corners(triangles[owner], ends)
    slack = _ROUNDING * np.linalg.norm(high - low, axis=1)[owner, None]
    return (
        np.concatenate([low[single], points.min(axis=1) - slack]),
        np.concatenate([high[single], points.max(axis=1) + slack]),
        np.concatenate([single, owner]),
    )


def along_needles(triangles: Array) -> Array:
    """Returns a rotation about z that aligns most needles with x.

    Args:
        triangles: shape (T, 3, 3).

    Returns:
        R, shape (3, 3); row vectors times R are in the frame for boxes. It is the identity unless
        it at least halves the total area of the boxes, seen along z.
    """
    low, high = triangles.min(axis=1, initial=np.inf), triangles.max(axis=1, initial=-np.inf)
    needles = triangles[_slimness(triangles, low, high) >= _SLIM]
    if not len(needles):
        return np.eye(3)
    sides = (np.roll(needles, -1, axis=1) - needles)[..., :2]
    length = np.linalg.norm(sides, axis=2)
    x, y = sides[np.arange(len(sides)), np.argmax(length, axis=1)].T
    # Sides have no sense, so the doubled angle is averaged.
    angle = np.arctan2((2 * x * y).sum(), (x**2 - y**2).sum()) / 2
    c, s = circle(angle)
    turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    turned = np.ptp(times(triangles, turn), axis=1)[:, :2].prod(axis=1).sum()
    return turn if turned < (high - low)[:, :2].prod(axis=1).sum() / 2 else np.eye(3)


def _num_pieces(triangles: Array, low: Array, high: Array) -> Ints:
    """Returns into how many pieces to cut each triangle, shape (T,)."""
    box = (high - low)[:, :2].prod(axis=1)
    area_for_each = np.ptp(triangles[..., :2].reshape(-1, 2), axis=0).prod() / len(triangles)
    share = np.sqrt(box / max(area_for_each, _TINY))
    pieces = np.minimum(_slimness(triangles, low, high), share)
    return np.asarray(np.clip(pieces, 1, _MAX_PIECES), dtype=np.int64)


def _slimness(triangles: Array, low: Array, high: Array) -> Array:
    """Returns the area of each box, seen along z, over `_FAT` times that of its triangle, (T,)."""
    box = (high - low)[:, :2].prod(axis=1)
    (ax, ay), (bx, by) = np.moveaxis(triangles[:, 1:, :2] - triangles[:, :1, :2], 0, 2)
    area = np.abs(ax * by - bx * ay) / 2
    return np.asarray(box / np.maximum(_FAT * area, 1e-6 * box + _TINY))


def _slab_corners(triangles: Array, ends: Array) -> Array:
    """Returns points whose convex hull contains the slice of each triangle between two cuts.

    Args:
        triangles: shape (N, 3, 3).
        ends: where the cuts, perpendicular to the longest side, meet it, as fractions of its
            length, shape (N, 2).

    Returns:
        Shape (N, 5, 3).
    """
    length = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    turn = (np.argmax(length, axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(triangles, turn[..., None], axis=1), 1, 0)
    side = b - a
    foot = np.einsum("ni,ni->n", c - a, side) / np.einsum("ni,ni->n", side, side)
    foot = np.clip(foot, 0, 1)[:, None]
    on_side = a[:, None] + ends[..., None] * side[:, None]
    before = np.where(foot > 0, ends / np.where(foot > 0, foot, 1), 1)
    after = np.where(foot < 1, (1 - ends) / np.where(foot < 1, 1 - foot, 1), 1)
    rise = np.clip(np.minimum(before, after), 0, 1)[..., None]
    legs = np.where((ends <= foot)[..., None], a[:, None], b[:, None])
    across = legs + rise * (c[:, None] - legs)
    holds_c = (ends[:, :1] <= foot) & (foot <= ends[:, 1:])
    apex = np.where(holds_c, c, on_side[:, 0])
    return np.concatenate([on_side, across, apex[:, None]], axis=1)

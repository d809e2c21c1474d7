"""Cavities that the parts of a body seal, where no finger gets (ours; no section of the paper).

Parts that enclose a room touch, overlap or leave cracks, so that their surfaces alone do not tell
inside from outside. A grid does: cells that the surface leaves free and that no chain of free
neighbours joins to the outside are in a solid or in a cavity. A sphere as large as `sealed_at`
says never leaves free cells, so what it reaches from outside is not sealed; ways narrower than a
cell lead nowhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints, frozen
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.shells import connected_components
from drake_polygrasp.geometry.triangle_soup import TriangleSoup

_CELLS = 128
"""Per diameter L, ours: cells of 0.008 L, so that spheres of 0.0135 L, smaller than a fingertip,
reach whatever is open to them."""
_SAMPLES = 2
"""Per side of a cell, ours: samples of the surface so near to each other leave no way through it
from a cell to its neighbour."""
_BEYOND = 0.5
"""Times L, ours: how far beyond the body rooms that it makes with other bodies are followed."""
_AT_ONCE = 64
"""Triangles that are sampled together, ours: some 100 MB at most."""


@dataclass(frozen=True, eq=False)
class Cavities:
    """The cells of a grid that are in sealed cavities.

    Attributes:
        p_BG: the grid's least corner in B, shape (3,) [m].
        side: of a cell [m].
        sealed: shape (nx, ny, nz).
    """

    p_BG: Array
    side: float
    sealed: Bools

    def sealed_at(self, p_BC: Array, nhat_TB_B: Array) -> Bools:
        """Whether contacts p_BC [m] with inward normals, both (M, 3), face a sealed cell, (M,).

        A sphere that touches there from outside, of radius sqrt(3) times a cell's side, holds the
        whole cell that its centre is in. If it fits, that cell is free, and tells; if it does not,
        the contact passes.
        """
        center = p_BC - np.sqrt(3) * self.side * nhat_TB_B
        cell = np.floor((center - self.p_BG) / self.side).astype(np.int64)
        inside = ((cell >= 0) & (cell < self.sealed.shape)).all(axis=1)
        found = np.zeros(len(p_BC), dtype=bool)
        found[inside] = self.sealed[tuple(cell[inside].T)]
        return found


def find_cavities(
    triangles: Array, closed: Bools, primitives: Sequence[Primitive], L: float, own: Bools
) -> Cavities | None:
    """The sealed cavities of a body of triangles (T, 3, 3) [m], outward; None when it has none.

    `closed` (T,) are triangles of closed shells, which with the curved solids tell what is solid.
    Of triangles that are not the body's `own` (T,), those within `_BEYOND` L of it count.
    """
    side = L / _CELLS
    least = triangles[own].min(axis=(0, 1)) - _BEYOND * L
    most = triangles[own].max(axis=(0, 1)) + _BEYOND * L
    walls = np.concatenate([triangles[own], _within(triangles[~own], least, most, L)])
    # A layer of cells all round is outside, whatever rounding does.
    low = np.maximum(walls.min(axis=(0, 1)), least) - 1.5 * side
    high = np.minimum(walls.max(axis=(0, 1)), most)
    shape = np.ceil((high - low) / side).astype(np.int64) + 1
    free = np.ones(tuple(shape), dtype=bool)
    for some in np.array_split(walls, len(walls) // _AT_ONCE + 1):
        samples = _samples(some, side / _SAMPLES)
        samples = samples[((samples >= least) & (samples <= most)).all(axis=1)]
        free[tuple(np.floor((samples - low) / side).astype(np.int64).T)] = False
    run, room = _rooms(free)
    rooms = np.unique(room[room != room[0]])  # The first cell is outside.
    first = np.searchsorted(run.ravel(), rooms)
    middle = low + side * (np.column_stack(np.unravel_index(first, free.shape)) + 0.5)
    solid = TriangleSoup(triangles[closed]).winding_numbers(middle) > 0
    for primitive in primitives:
        solid |= primitive.distance(middle) < 0
    if solid.all():
        return None
    sealed = free & np.isin(room, rooms[~solid])[run]
    return Cavities(frozen(low), float(side), frozen(sealed, bool))


def _within(triangles: Array, low: Array, high: Array, size: float) -> Array:
    """What of triangles (T, 3, 3) is within a box, in pieces of at most `size`, (N, 3, 3).

    Pieces may reach out of it.
    """
    while True:
        outside = (triangles.min(axis=1) > high) | (triangles.max(axis=1) < low)
        triangles = triangles[~outside.any(axis=1)]
        sides = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
        large = sides.max(axis=1) > size
        if not large.any():
            return triangles
        a, b, c = np.moveaxis(triangles[large], 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        quarters = [
            np.stack(q, axis=1) for q in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        ]
        triangles = np.concatenate([triangles[~large], *quarters])


def _samples(triangles: Array, spacing: float) -> Array:
    """Points of triangles (T, 3, 3), of each in rows along its longest side, shape (N, 3)."""
    length = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    turn = (np.argmax(length, axis=1)[:, None] + np.arange(3)) % 3
    a, b, c = np.moveaxis(np.take_along_axis(triangles, turn[..., None], axis=1), 1, 0)
    longest = length.max(axis=1)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.where(longest > 0, longest, 1)
    columns = np.ceil(longest / spacing).astype(np.int64) + 1
    rows = np.ceil(height / spacing).astype(np.int64) + 1
    owner = np.repeat(np.arange(len(triangles)), columns * rows)
    place = np.arange(len(owner)) - np.repeat(
        np.cumsum(columns * rows) - columns * rows, columns * rows
    )
    u = (place % columns[owner] / np.maximum(columns[owner] - 1, 1))[:, None]
    v = (place // columns[owner] / np.maximum(rows[owner] - 1, 1))[:, None]
    return np.asarray((1 - v) * (a[owner] + u * (b - a)[owner]) + v * c[owner])


def _rooms(free: Bools) -> tuple[Ints, Ints]:
    """The run of free cells along z that each cell is in or behind, and the room of each run.

    Shapes (nx, ny, nz) and (R,). Rooms, named by their first run, are what runs that are
    neighbours join.
    """
    starts = free.copy()
    starts[..., 1:] &= ~free[..., :-1]
    run = np.cumsum(starts.ravel()).reshape(free.shape) - 1
    links: list[tuple[Ints, Ints]] = []
    for near, far in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        both = free[near] & free[far]
        both[..., 1:] &= ~both[..., :-1]  # Two runs that are neighbours are so from one cell on.
        links.append((run[near][both], run[far][both]))
    a, b = (np.concatenate(ends) for ends in zip(*links, strict=True))
    return run, connected_components(int(run.flat[-1]) + 1, a, b)

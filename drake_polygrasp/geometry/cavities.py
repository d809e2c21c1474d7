"""Finds cavities enclosed by the parts of a body, whose walls no finger can reach.

The paper does not treat them. Parts around a cavity touch, overlap or leave cracks, so their
surfaces do not separate inside from outside. A grid does: free cells, which the surface does not
touch, lie in a solid or in a cavity unless a chain of free neighbours joins them to the outside.
The centre of a sphere of the radius in `Cavities.sealed_at` moves through free cells only, so
whatever such a sphere reaches from outside is not sealed. Gaps narrower than a cell are closed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints, distinct_values, frozen
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.shells import connected_components
from drake_polygrasp.geometry.tolerances import LENGTH_TOLERANCE
from drake_polygrasp.geometry.triangle_soup import TriangleSoup
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.vectors import dot, times

_CELLS = 128
"""Cells per diameter L, our choice: with cells of 0.008 L, spheres of radius 0.0135 L, smaller than
a fingertip, reach every open part of the surface."""
_SAMPLES = 2
"""Samples of the surface per side of a cell, our choice: dense enough that no chain of free cells
passes through the surface."""
_BEYOND = 0.5
"""Times L, our choice: how far beyond the body the grid reaches, for cavities that other bodies
help to enclose."""
_AT_ONCE = 64
"""Number of triangles sampled together, our choice: about 100 MB at most."""

_MOST_CONVEX = 3
"""Number of convex solids that enclose nothing, wherever they are."""
_MOST_PAIRS = 1_000_000
"""Number of triangles times vertices of a solid that is looked at for being convex. Our choice:
about as long as searching the grid takes."""


@dataclass(frozen=True, eq=False)
class Cavities:
    """Cells of a grid, parallel to the axes of B, that lie in sealed cavities.

    Attributes:
        p_BG: the corner of the grid with the least coordinates [m], shape (3,).
        side: side of a cell [m].
        sealed: whether each cell is in a cavity, shape (nx, ny, nz).
    """

    p_BG: Array
    side: float
    sealed: Bools

    def sealed_at(self, p_BC: Array, nhat_TB_B: Array) -> Bools:
        """Returns which contacts are on walls of sealed cavities.

        The test asks about the cell that holds the centre of a sphere which touches the contact
        from outside. Its radius is sqrt(3) times the cell's side, so the sphere contains the whole
        cell: if the sphere fits, the cell is free and classified. If it does not fit, the contact
        counts as not sealed.

        Args:
            p_BC: contact points [m], shape (M, 3).
            nhat_TB_B: inward unit normals, shape (M, 3).

        Returns:
            Shape (M,).
        """
        center = p_BC - np.sqrt(3) * self.side * nhat_TB_B
        cell = np.floor((center - self.p_BG) / self.side).astype(np.int64)
        inside = ((cell >= 0) & (cell < self.sealed.shape)).all(axis=1)
        found = np.zeros(len(p_BC), dtype=bool)
        found[inside] = self.sealed[tuple(cell[inside].T)]
        return found


def enclose_nothing(vertices: Array, corners: Ints, shell: Ints, closed: Bools, L: float) -> bool:
    """Returns whether a body has no cavity because it is the union of few convex solids.

    A union of convex sets has the homology of its nerve, the complex of which sets meet. That of
    three sets has no hollow, as four vertices are the fewest that bound a tetrahedron, so what the
    sets leave of space is connected (Alexander duality). Sets that are widened to close the gaps
    between them stay convex.

    Args:
        vertices: shape (V, 3) [m].
        corners: indices of the corners of triangles, counter-clockwise from outside, shape (T, 3).
        shell: the shell that each triangle belongs to, shape (T,).
        closed: whether each shell is closed, shape (S,).
        L: diameter of the body [m].
    """
    if len(closed) > _MOST_CONVEX or not closed.all():
        return False
    for k in range(len(closed)):
        own = corners[shell == k]
        points = vertices[distinct_values(own)]
        if len(own) * len(points) > _MOST_PAIRS:
            return False
        nhat, _ = unit_normals(vertices[own])
        above = times(points, nhat.T) - dot(vertices[own[:, 0]], nhat)
        if above.max() > LENGTH_TOLERANCE * L:
            return False
    return True


def find_cavities(
    triangles: Array, closed: Bools, primitives: Sequence[Primitive], L: float, own: Bools
) -> Cavities | None:
    """Returns the sealed cavities of a body, None when it has none.

    Args:
        triangles: triangles of the body and of bodies around it, counter-clockwise from outside
            [m], shape (T, 3, 3).
        closed: whether each triangle is of a closed shell, shape (T,). Closed shells and curved
            solids tell which free cells are solid.
        primitives: the curved solids of all these bodies.
        L: diameter of the body [m].
        own: whether each triangle is of the body itself, shape (T,). Triangles of other bodies
            count within `_BEYOND` L of it.
    """
    side = L / _CELLS
    least = triangles[own].min(axis=(0, 1)) - _BEYOND * L
    most = triangles[own].max(axis=(0, 1)) + _BEYOND * L
    walls = np.concatenate([triangles[own], _within(triangles[~own], least, most, L)])
    # The margin makes the outermost layer of cells outside, in spite of rounding.
    low = np.maximum(walls.min(axis=(0, 1)), least) - 1.5 * side
    high = np.minimum(walls.max(axis=(0, 1)), most)
    shape = np.ceil((high - low) / side).astype(np.int64) + 1
    free = np.ones(tuple(shape), dtype=bool)
    for some in np.array_split(walls, len(walls) // _AT_ONCE + 1):
        samples = _samples(some, side / _SAMPLES)
        samples = samples[((samples >= least) & (samples <= most)).all(axis=1)]
        free[tuple(np.floor((samples - low) / side).astype(np.int64).T)] = False
    run, component = _components(free)
    inner = distinct_values(component[component != component[0]])  # The first cell is outside.
    first = np.searchsorted(run.ravel(), inner)
    middle = low + side * (np.column_stack(np.unravel_index(first, free.shape)) + 0.5)
    solid = TriangleSoup(triangles[closed]).winding_numbers(middle) > 0
    for primitive in primitives:
        solid |= primitive.distance(middle) < 0
    if solid.all():
        return None
    sealed = free & np.isin(component, inner[~solid])[run]
    return Cavities(frozen(low), float(side), frozen(sealed, bool))


def _within(triangles: Array, low: Array, high: Array, size: float) -> Array:
    """Returns pieces of triangles that meet a box.

    Args:
        triangles: shape (T, 3, 3).
        low: corner of the box with the least coordinates, shape (3,).
        high: the opposite corner, shape (3,).
        size: longest side that a piece may have.

    Returns:
        Triangles that cover all of the given ones inside the box, shape (N, 3, 3); they may reach
        out of it.
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
    """Returns points of triangles (T, 3, 3) in rows along each one's longest side, shape (N, 3)."""
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


def _components(free: Bools) -> tuple[Ints, Ints]:
    """Returns the connected components of free cells, by runs of free cells along z.

    Returns:
        For each cell the last run that begins at it or before it in the order of memory, which is
        the cell's own run if it is free, shape (nx, ny, nz). And for each run the first run of its
        component, shape (R,).
    """
    starts = free.copy()
    starts[..., 1:] &= ~free[..., :-1]
    run = np.cumsum(starts.ravel()).reshape(free.shape) - 1
    links: list[tuple[Ints, Ints]] = []
    for near, far in ((np.s_[1:], np.s_[:-1]), (np.s_[:, 1:], np.s_[:, :-1])):
        both = free[near] & free[far]
        both[..., 1:] &= ~both[..., :-1]  # One link where two runs begin to be neighbours.
        links.append((run[near][both], run[far][both]))
    a, b = (np.concatenate(ends) for ends in zip(*links, strict=True))
    return run, connected_components(int(run.flat[-1]) + 1, a, b)

"""Finds which open shells face inward, by how much solid angle all of them cover together.

A shell that is not closed may be a piece of a surface: a lid whose edge has more vertices than the
wall below it, or the wall of a bore. Its own shape does not tell on which side the solid is, but
all pieces together do.
"""

from __future__ import annotations

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints, batches
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.vectors import cross, cross_first, dot

_MAX_SAMPLES = 4
"""How many triangles of a shell are asked. Our choice."""
_MAX_PAIRS = 4_000_000
"""Most pairs of sample and triangle, our choice: a second."""
_PAIRS_AT_ONCE = 1 << 15
_ROUNDING = 1e-9
"""Smaller winding numbers are rounding errors, our choice."""


def open_shells_inward(triangles: Array, shell: Ints) -> Bools:
    """Returns which shells face inward, where all of them together bound solids with gaps.

    The winding number of a solid's surface jumps from 0 to 1 at each triangle: its mean of both
    sides, the solid angle that all other triangles cover as a share of the sphere, is 1/2 where
    triangles face outward and -1/2 where they face inward. Gaps bring it nearer to 0.

    Args:
        triangles: triangles of open shells, oriented alike within each [m], shape (T, 3, 3).
        shell: the shell of each triangle, shape (T,).

    Returns:
        By shell, up to the highest number, shape (S,).
    """
    shells, number = np.unique(shell, return_inverse=True)
    _, area = unit_normals(triangles)
    order = np.lexsort((-area, number))
    rank = np.arange(len(order)) - np.searchsorted(number[order], number[order])
    most = min(_MAX_SAMPLES, max(1, _MAX_PAIRS // (len(shells) * len(triangles))))
    samples = order[rank < most]
    winding = np.zeros(len(samples))
    if len(shells) * len(triangles) <= _MAX_PAIRS:
        for some in batches(len(samples), max(1, _PAIRS_AT_ONCE // len(triangles))):
            winding[some] = _solid_angles(triangles, samples[some]) / (4 * np.pi)
        mean = np.bincount(number[samples], area[samples] * winding)
        inward = mean < -_ROUNDING * np.bincount(number[samples], area[samples])
    else:  # Very many pieces keep the file's orientation, or are all turned.
        about = triangles - triangles.mean(axis=(0, 1))
        volume = dot(about[:, 0], cross(about[:, 1], about[:, 2])).sum()
        inward = np.full(len(shells), volume < 0)
    found = np.zeros(int(shell.max(initial=-1)) + 1, dtype=bool)
    found[shells] = inward
    return found


def _solid_angles(triangles: Array, samples: Ints) -> Array:
    """Returns the signed solid angle of all other triangles from the middle of each sample."""
    corners = np.ascontiguousarray(triangles.transpose(1, 2, 0))
    middle = np.ascontiguousarray(triangles[samples].mean(axis=1).T)
    a, b, c = (corner[:, None] - middle[:, :, None] for corner in corners)
    length_a, length_b, length_c = (np.sqrt((x * x).sum(axis=0)) for x in (a, b, c))
    triple = (a * cross_first(b, c)).sum(axis=0)
    rest = length_a * length_b * length_c
    rest += (a * b).sum(axis=0) * length_c
    rest += (b * c).sum(axis=0) * length_a
    rest += (c * a).sum(axis=0) * length_b
    angle = 2 * np.arctan2(triple, rest)
    angle[np.arange(len(samples)), samples] = 0.0
    return np.asarray(angle.sum(axis=1))

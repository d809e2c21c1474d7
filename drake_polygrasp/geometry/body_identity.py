"""What tells one body from another, so that what was measured around one is not used for another.

The names of bodies do not suffice, for a model may bear any name in a plant, and shapes do not, for
a plant may hold many of one shape. Objects of files have no name in a plant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.triangles import unit_normals

_SAME = 1e-6
"""Times the diagonal of the bounding box, ours: what measures of one surface may differ by."""


@dataclass(frozen=True, eq=False)
class BodyIdentity:
    """A body's surface in its frame B, in a few lengths, and its names in plants.

    Attributes:
        lengths: as of `surface_lengths` [m], shape (16,).
        names: of the body in one plant or several; none for an object of a file.
    """

    lengths: Array
    names: tuple[str, ...] = ()

    def is_shape_of(self, other: BodyIdentity) -> bool:
        """Whether both have the same surface in the same frame."""
        slack = _SAME * np.linalg.norm(self.lengths[3:6] - self.lengths[:3])
        return bool((np.abs(self.lengths - other.lengths) <= slack).all())

    def may_be(self, other: BodyIdentity) -> bool:
        """Whether both may be one body: of one shape, and of one name where both have some."""
        shared = set(self.names) & set(other.names)
        return self.is_shape_of(other) and bool(shared or not self.names or not other.names)


def check_same_body(what: str, around: BodyIdentity | None, body: BodyIdentity | None) -> None:
    """Raises UsageError when what was measured around one body is used for another.

    Args:
        what: what was measured, in the plural.
        around: the body that it was measured around; unknown if None.
        body: the body that it is used for; unknown if None.
    """
    if around is None or body is None or around.may_be(body):
        return
    here = f"the object is {_quoted(body.names)}" if body.names else "the object is not that body"
    if set(around.names) & set(body.names):
        here = "the object has another surface, or another frame"
    raise UsageError(
        f"the {what} are those around {_quoted(around.names)}, and {here}; take them for the body "
        "that is grasped, in the same frame"
    )


def surface_lengths(triangles_B: Array) -> Array:
    """Returns lengths that tell surfaces apart: least and greatest corner, area and moments.

    Args:
        triangles_B: the surface in any order, before parts are united [m], shape (T, 3, 3).

    Returns:
        The corners of the bounding box, the centroid, the root of the area, and second moments
        about the centroid by area and the box's diagonal [m], shape (16,).
    """
    points = triangles_B.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    _, area = unit_normals(triangles_B)
    total = max(float(area.sum()), np.finfo(float).tiny)
    share = area / total
    centroid = share @ triangles_B.mean(axis=1)
    about = triangles_B - centroid
    # The mean of x x' over a triangle, by its corners a, b, c and their sum s: (aa' + .. + ss')/12.
    sums = about.sum(axis=1)
    second = np.einsum("t,tki,tkj->ij", share, about, about)
    second += np.einsum("t,ti,tj->ij", share, sums, sums)
    size = max(float(np.linalg.norm(high - low)), np.finfo(float).tiny)
    moments = second[np.triu_indices(3)] / (12 * size)
    return frozen(np.concatenate([low, high, centroid, [np.sqrt(total)], moments]))


def _quoted(names: tuple[str, ...]) -> str:
    return ", ".join(f"'{name}'" for name in names) or "a body"

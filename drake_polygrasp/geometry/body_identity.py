"""Checks that obstacles taken around one body are not used for another one.

Names alone do not identify a body, because a model can have any name in a plant; shapes alone do
not, because a plant can hold several bodies of one shape. Objects loaded from files have no name
in a plant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.triangles import unit_normals

_SAME = 1e-6
"""Times the diagonal of the bounding box, our choice: lengths of one surface that is loaded twice
differ by less."""


@dataclass(frozen=True, eq=False)
class BodyIdentity:
    """Lengths that characterise a body's surface in its frame B, and the body's names in plants.

    Attributes:
        lengths: what `surface_lengths` returns [m], shape (16,).
        names: scoped names of the body in one or several plants; empty for an object from a file.
    """

    lengths: Array
    names: tuple[str, ...] = ()

    def is_shape_of(self, other: BodyIdentity) -> bool:
        """Returns whether both have the same surface, expressed in the same frame.

        Args:
            other: the body to compare with.
        """
        slack = _SAME * np.linalg.norm(self.lengths[3:6] - self.lengths[:3])
        return bool((np.abs(self.lengths - other.lengths) <= slack).all())

    def may_be(self, other: BodyIdentity) -> bool:
        """Returns whether both can be the same body.

        They can if they have the same surface and, where both have names, a name in common.

        Args:
            other: the body to compare with.
        """
        shared = set(self.names) & set(other.names)
        return self.is_shape_of(other) and bool(shared or not self.names or not other.names)


def check_same_body(what: str, around: BodyIdentity | None, body: BodyIdentity | None) -> None:
    """Checks that data taken around one body are used for the same body.

    Args:
        what: name of the data in the plural, for the message, such as "obstacles".
        around: the body that they were taken around; None if unknown, which passes.
        body: the body that they are used for; None if unknown, which passes.

    Raises:
        UsageError: when the two cannot be the same body.
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
    """Returns lengths by which surfaces can be told apart.

    Args:
        triangles_B: all triangles of the parts, in any order [m], shape (T, 3, 3).

    Returns:
        The two corners of the bounding box, the centroid of the surface, the square root of its
        area, and its six second moments about the centroid divided by its area and the box's
        diagonal [m], shape (16,).
    """
    points = triangles_B.reshape(-1, 3)
    low, high = points.min(axis=0), points.max(axis=0)
    _, area = unit_normals(triangles_B)
    total = max(float(area.sum()), np.finfo(float).tiny)
    share = area / total
    centroid = share @ triangles_B.mean(axis=1)
    about = triangles_B - centroid
    # The mean of x x' over a triangle with corners a, b, c and their sum s is
    # (a a' + b b' + c c' + s s') / 12.
    sums = about.sum(axis=1)
    second = np.einsum("t,tki,tkj->ij", share, about, about)
    second += np.einsum("t,ti,tj->ij", share, sums, sums)
    size = max(float(np.linalg.norm(high - low)), np.finfo(float).tiny)
    moments = second[np.triu_indices(3)] / (12 * size)
    return frozen(np.concatenate([low, high, centroid, [np.sqrt(total)], moments]))


def _quoted(names: tuple[str, ...]) -> str:
    """Returns names of a body as they appear in messages."""
    return ", ".join(f"'{name}'" for name in names) or "a body"

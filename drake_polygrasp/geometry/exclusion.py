"""Faces and directions of outward normals that the user excludes from contact."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arguments import refuse
from drake_polygrasp.arrays import Array, Bools, Ints, frozen
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.tolerances import ANGLE_TOLERANCE
from drake_polygrasp.vectors import times, unit

AVOID_ANGLE = np.pi / 4
"""[rad], our choice: contacts whose outward normal is within this of a direction to avoid are
excluded."""


@dataclass(frozen=True, eq=False)
class Exclusion:
    """Faces and directions that contacts avoid; it is true if anything is excluded.

    Attributes:
        directions_B: unit vectors to avoid, shape (D, 3).
        faces: indices of excluded faces, ascending, without repetition.
        angle: outward normals within this angle of a direction are excluded [rad].
    """

    directions_B: Array
    faces: tuple[int, ...]
    angle: float = AVOID_ANGLE

    def __bool__(self) -> bool:
        return bool(self.faces) or len(self.directions_B) > 0

    def avoids(self, nhat_TB_B: Array, face: Ints) -> Bools:
        """Returns which contacts are excluded, by their face or their normal.

        Args:
            nhat_TB_B: inward unit normals, shape (M, 3).
            face: index of each contact's face, shape (M,).

        Returns:
            Shape (M,).
        """
        if not self:
            return np.zeros(len(face), dtype=bool)
        cosine = times(-nhat_TB_B, self.directions_B.T)
        points_there = (cosine >= np.cos(self.angle) - ANGLE_TOLERANCE).any(axis=1)
        return np.asarray(points_there | np.isin(face, np.array(self.faces, dtype=np.int64)))

    def excluded_faces(self, polyhedron: Polyhedron) -> tuple[int, ...]:
        """Returns the faces that are excluded as a whole, ascending.

        Args:
            polyhedron: the body's surface.
        """
        nhat_TB_B = -polyhedron.R_BF[:, :, 2]
        excluded = self.avoids(nhat_TB_B, np.arange(len(nhat_TB_B)))
        return tuple(np.flatnonzero(excluded).tolist())


def exclusion(
    directions_B: Sequence[Sequence[float]] = (),
    faces: Sequence[int] = (),
    angle: float | None = None,
) -> Exclusion:
    """Returns the exclusion of directions and faces of a body.

    Args:
        directions_B: unit vectors in B, as `unit_direction` returns them, shape (D, 3). Faces and
            contacts whose outward normal is within `angle` of one are excluded; (0, 0, -1) excludes
            the underside of an object that stands with Bz upward.
        faces: indices of faces, ascending, without repetition.
        angle: the angle [rad]; None for `AVOID_ANGLE`.
    """
    directions = frozen(np.reshape(directions_B, (-1, 3)))
    return Exclusion(directions, tuple(faces), AVOID_ANGLE if angle is None else angle)


def require_faces(polyhedron: Polyhedron, faces: Sequence[int]) -> None:
    """Checks that a body has the faces that are to be excluded.

    Args:
        polyhedron: the body's surface.
        faces: indices of faces.

    Raises:
        UsageError: when an index is not that of a face.
    """
    num_faces = len(polyhedron.faces)
    for face in faces:
        if not 0 <= face < num_faces:
            raise UsageError(
                f"face {face} cannot be excluded: the object's faces are 0 to {num_faces - 1}"
            )


def unit_direction(
    direction: npt.ArrayLike, name: str = "a direction to avoid"
) -> tuple[float, float, float]:
    """Returns a direction as a unit vector.

    Args:
        direction: a vector of any length but 0, shape (3,).
        name: what messages call it.

    Raises:
        UsageError: when it is not three finite numbers, or all are 0.
    """
    try:
        vector = np.array(direction, dtype=float)
    except (TypeError, ValueError, OverflowError):
        vector = np.empty(0)
    largest = np.abs(vector).max(initial=0.0)
    if vector.shape != (3,) or not 0 < largest < np.inf:
        raise refuse(name, direction, "three finite numbers, not all 0")
    # Scaled first, so that squares neither underflow nor overflow.
    vector = vector / largest
    x, y, z = unit(vector).tolist()
    return x, y, z

"""Where no finger may touch, by the user's word: faces by index, and directions they point in."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from operator import index
from typing import Any

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arguments import check_items
from drake_polygrasp.arrays import Array, Bools, Ints, frozen
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.tolerances import ANGLE_TOLERANCE
from drake_polygrasp.vectors import times, unit

AVOID_ANGLE = np.pi / 4
"""[rad], ours: an outward normal this near a direction to avoid points that way."""


@dataclass(frozen=True, eq=False)
class Exclusion:
    """Faces and directions to avoid; see `exclusion` for the meaning of what is given.

    Attributes:
        directions_B: unit vectors, shape (D, 3).
        faces: indices, ascending, each once.
        angle: [rad], between an outward normal and a direction.
    """

    directions_B: Array
    faces: tuple[int, ...]
    angle: float = AVOID_ANGLE

    def __bool__(self) -> bool:
        return bool(self.faces) or len(self.directions_B) > 0

    def avoids(self, nhat_TB_B: Array, face: Ints) -> Bools:
        """Which contacts are excluded, by inward normals (M, 3) and faces (M,); shape (M,)."""
        if not self:
            return np.zeros(len(face), dtype=bool)
        cosine = times(-nhat_TB_B, self.directions_B.T)
        points_there = (cosine >= np.cos(self.angle) - ANGLE_TOLERANCE).any(axis=1)
        return np.asarray(points_there | np.isin(face, np.array(self.faces, dtype=np.int64)))

    def excluded_faces(self, polyhedron: Polyhedron) -> tuple[int, ...]:
        """The faces that are excluded whole, ascending."""
        nhat_TB_B = -polyhedron.R_BF[:, :, 2]
        excluded = self.avoids(nhat_TB_B, np.arange(len(nhat_TB_B)))
        return tuple(np.flatnonzero(excluded).tolist())

    @property
    def settings(self) -> dict[str, Any]:
        """What repeats it, for the grasp file; nothing where nothing is excluded."""
        settings: dict[str, Any] = {}
        if len(self.directions_B):
            settings = {"avoid_directions": self.directions_B, "avoid_angle": self.angle}
        if self.faces:
            settings["exclude_faces"] = self.faces
        return settings


def exclusion(
    polyhedron: Polyhedron,
    avoid_directions: Iterable[npt.ArrayLike] = (),
    exclude_faces: Iterable[int] = (),
) -> Exclusion:
    """What to avoid on a body.

    Args:
        polyhedron: the body's surface.
        avoid_directions: vectors in B of any length, shape (3,) each. A face or a contact whose
            outward normal is within `AVOID_ANGLE` of one is excluded; (0, 0, -1) stands for the
            underside of what stands on a table.
        exclude_faces: indices of faces.

    Raises:
        UsageError: when a direction is no direction, or there is no face of an index.
    """
    directions = [
        _unit(direction) for direction in check_items("avoid_directions", avoid_directions)
    ]
    indices = check_items("exclude_faces", exclude_faces)
    faces = sorted({_face_index(face, len(polyhedron.faces)) for face in indices})
    return Exclusion(frozen(np.reshape(directions, (-1, 3))), tuple(faces))


def _unit(direction: npt.ArrayLike) -> Array:
    try:
        vector = np.array(direction, dtype=float)
    except (TypeError, ValueError):
        vector = np.empty(0)
    largest = np.abs(vector).max(initial=0.0)
    if vector.shape != (3,) or not 0 < largest < np.inf:
        raise UsageError(
            f"a direction to avoid is {direction!r}; it must be three finite numbers, not all 0"
        )
    # Divided twice, so that squares neither vanish nor overflow.
    vector = vector / largest
    return unit(vector)


def _face_index(face: int, num_faces: int) -> int:
    try:
        position = index(face)
    except TypeError:
        position = -1
    if not 0 <= position < num_faces:
        raise UsageError(
            f"face {face!r} cannot be excluded: the object's faces are 0 to {num_faces - 1}"
        )
    return position

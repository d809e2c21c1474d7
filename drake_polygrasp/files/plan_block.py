"""A grasp file's plan block: settings of any kind, and those among them that others go by."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from drake_polygrasp.arrays import frozen
from drake_polygrasp.files.plain_yaml import Block
from drake_polygrasp.geometry.exclusion import AVOID_ANGLE, Exclusion

_UNIT = 1e-9
"""Ours: of a unit vector's length."""


def read_settings(block: Block, num_faces: int) -> dict[str, Any]:
    """The settings of a plan on an object of so many faces.

    Raises GraspFileError for a setting that a verification goes by and that cannot be.
    """
    if "mu" in block.data:
        block.number("mu", "positive")
    if "tip_radius" in block.data:
        block.number("tip_radius", "zero or positive")
    if "avoid_directions" in block.data:
        with np.errstate(over="ignore"):
            length = np.linalg.norm(block.vectors("avoid_directions"), axis=1)
        if not (np.abs(length - 1) <= _UNIT).all():
            raise block.refuse("avoid_directions", "a list of unit vectors")
        if not block.number("avoid_angle", "positive") < np.pi:
            raise block.refuse("avoid_angle", "an angle in radians below pi")
    if "exclude_faces" in block.data:
        faces = block.items("exclude_faces")
        if not all(type(face) is int and 0 <= face < num_faces for face in faces):
            raise block.refuse("exclude_faces", f"a list of indices of faces below {num_faces}")
    names = block.items("obstacles") if "obstacles" in block.data else []
    if not all(isinstance(name, str) for name in names):
        raise block.refuse("obstacles", "a list of names")
    return block.data


def exclusion_of(settings: Mapping[str, Any]) -> Exclusion:
    """Where no finger may be by settings that were read."""
    return Exclusion(
        frozen(np.reshape(settings.get("avoid_directions", []), (-1, 3))),
        tuple(settings.get("exclude_faces", ())),
        settings.get("avoid_angle", AVOID_ANGLE),
    )

"""Reads the plan block of a grasp file."""

from __future__ import annotations

import numpy as np

from drake_polygrasp.files.plain_yaml import Block
from drake_polygrasp.files.stated_grasp import StatedPlan

_UNIT = 1e-9
"""How far the length of a unit vector may be from 1. Our choice."""


def read_plan(block: Block, num_faces: int) -> StatedPlan:
    """Reads a plan block and checks what a verification uses, and errors; others may be anything.

    Args:
        block: the plan block.
        num_faces: how many faces the object has.

    Returns:
        What the file states of the plan.

    Raises:
        GraspFileError: when such a value has the wrong type or range.
    """
    if "mu" in block.data:
        block.number("mu", "positive")
    if "tip_radius" in block.data:
        block.number("tip_radius", "zero or positive")
    for name in ("placement_error", "tilt_error", "friction_error", "com_error"):
        if name in block.data:
            block.number(name, "zero or positive")
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
    return StatedPlan(block.data)

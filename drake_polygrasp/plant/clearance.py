"""Checks by SceneGraph that fingertips penetrate no link on a joint and no body of the scene."""

from __future__ import annotations

import math
from typing import NamedTuple

from drake_polygrasp.geometry.tolerances import FLATNESS
from drake_polygrasp.loading.surroundings import Surroundings
from drake_polygrasp.plant.scratch_plant import ScratchScene
from drake_polygrasp.plant.surface_distance import SurfaceDistance


class Clearance(NamedTuple):
    """Clearance of fingertips from the geometry around the object.

    Attributes:
        margin: tolerance minus the deepest penetration [m]; infinite if there is no geometry.
        faults: a message for each penetration beyond the tolerance, the deepest first.
    """

    margin: float
    faults: tuple[str, ...]


def check_clearance(scene: ScratchScene, surroundings: Surroundings) -> Clearance:
    """Measures how far fingertips are from links on the object's joints and from other bodies.

    The tolerance is 2 `FLATNESS` L, the accuracy to which obstacles are modelled in planning. The
    planner itself keeps fingertips clear to `TIP_SLACK` L.

    Args:
        scene: object and grasp.
        surroundings: other bodies of the user's scene.

    Returns:
        The clearance, with one message for each fingertip and shape that overlap.

    Raises:
        RuntimeError: when Drake rejects a shape; SystemExit when one of its assertions fails.
    """
    tolerance = 2 * FLATNESS * scene.object_.polyhedron.diameter
    margin, faults = math.inf, list[tuple[float, str]]()
    for name, shape, X_BG in (*scene.solid.covers, *surroundings.parts):
        surface = SurfaceDistance([(shape, X_BG)])
        for i, p_BT in enumerate(scene.p_BT, start=1):
            depth = scene.tip_radius - surface.nearest(p_BT).distance
            margin = min(margin, tolerance - depth)
            if depth > tolerance:
                faults.append((depth, f"fingertip {i} penetrates '{name}' by {depth:.2g} m"))
    faults.sort(key=lambda fault: -fault[0])
    return Clearance(margin, tuple(message for _, message in faults))

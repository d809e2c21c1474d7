"""Checks that fingertips penetrate neither links on joints nor the user's scene, by SceneGraph."""

from __future__ import annotations

import math
from typing import NamedTuple

from drake_polygrasp.geometry.tolerances import FLATNESS
from drake_polygrasp.loading.surroundings import Surroundings
from drake_polygrasp.plant.scratch_plant import ScratchScene
from drake_polygrasp.plant.surface_distance import SurfaceDistance


class Clearance(NamedTuple):
    """How clear fingertips are of what stands around the object.

    Attributes:
        margin: what the deepest penetration leaves of its tolerance [m]; infinite if nothing is
            near.
        faults: which fingertip penetrates what, and by how much; the deepest first.
    """

    margin: float
    faults: tuple[str, ...]


def check_clearance(scene: ScratchScene, surroundings: Surroundings) -> Clearance:
    """Measures from the fingertips' centres to links on the object's joints and all around it.

    The tolerance is 2 `FLATNESS` L, for what stands around was not modelled closer; the planner
    keeps fingertips clear to `TIP_SLACK` L.

    Raises:
        RuntimeError: when Drake takes a shape for no geometry, or SystemExit where it asserts so.
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
    return Clearance(margin, tuple(said for _, said in faults))

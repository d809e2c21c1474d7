"""Checks that fingertips can move to their contacts along the normals in the user's scene."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from drake_polygrasp.plant.fingertips import FingertipSpheres

_TOUCHING = 0.99
"""Times the tip radius: geometry farther than this from a fingertip's centre is not hit.

Our choice: below 1, so that the object touched at the contacts does not count as hit."""


def is_approach_clear(
    plant: MultibodyPlant,
    context: Context,
    spheres: FingertipSpheres,
    standoff: float,
    num_steps: int = 20,
) -> bool:
    """Checks that fingertips can move to their contacts along the normals without a collision.

    Args:
        plant: finalized plant, connected to a SceneGraph, without the fingertips.
        context: context of the plant, with the poses of its bodies.
        spheres: fingertips at their contacts, in the world frame W.
        standoff: distance from the contacts at which they start [m].
        num_steps: number of steps of the motion; only positions at their ends are checked.

    Returns:
        True if the fingertips do not overlap each other at the contacts, nor the geometry of the
        plant at any position.
    """
    radius = spheres.radius
    if any(np.linalg.norm(p - q) < 2 * radius for p, q in combinations(spheres.p_HT, 2)):
        return False
    query = plant.get_geometry_query_input_port().Eval(context)
    steps = np.linspace(0.0, standoff, num_steps + 1)[:, None, None]
    return all(
        near.distance > _TOUCHING * radius
        for p_WT in (spheres.p_HT - steps * spheres.nhat_H).reshape(-1, 3)
        for near in query.ComputeSignedDistanceToPoint(p_WT, 2 * radius)
    )

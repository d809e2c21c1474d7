"""Whether fingertips reach their contacts in the user's scene, along the normals."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.systems.framework import Context

from drake_polygrasp.plant.fingertips import FingertipSpheres

_TOUCHING = 0.99
"""Times the radius, our choice: what comes no nearer to a fingertip's centre is not in its way."""


def is_approach_clear(
    plant: MultibodyPlant,
    context: Context,
    spheres: FingertipSpheres,
    standoff: float,
    num_steps: int = 20,
) -> bool:
    """Tells whether fingertips that come straight to their contacts meet nothing on their way.

    Args:
        plant: finalized, connected to a SceneGraph, and without the fingertips.
        context: the plant's, which says where everything is.
        spheres: the fingertips at their contacts, in the world.
        standoff: how far from the contacts they start, along the normals [m].
        num_steps: into how many steps the way is divided; only their ends are looked at.

    Returns:
        Whether they clear each other at the contacts, and all geometry of the plant everywhere.
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

"""A hand of three fingertips on a carriage H, which moves along x, y and z of the world W."""

from __future__ import annotations

from functools import partial

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp import UsageError
from drake_polygrasp.certification import hold, normal_forces
from drake_polygrasp.plant import (
    Fingertips,
    add_fingertips,
    add_slider,
    connect_commands,
    contact_material,
    fingertip_modulus,
)
from drake_polygrasp.visualization import CONTACTS, rgb
from examples.choose_grasp import STANDOFF, Target
from examples.motion import Array, Motion

CARRIAGE_MASS, CARRIAGE_STIFFNESS = 1.0, 1e6
"""[kg] and [N/m]: it holds to its commands stiffly."""
TIP_MASS = 0.05
"""[kg]"""
TIP_TRAVEL = 0.5
"""Times L: how far the whole squeeze would push a tip against its spring."""


def add_hand(
    plant: MultibodyPlant, body: RigidBody, target: Target, mu: float | None
) -> Fingertips:
    """Adds a carriage at the world's origin, and on it the fingertips at their contacts.

    Their friction is that planned with, or `mu` where that is less.
    """
    instance, carriage = plant.AddModelInstance("carriage"), plant.world_body()
    for name, axis in zip("xyz", np.eye(3), strict=True):
        carriage = add_slider(
            plant, instance, name, carriage, axis, CARRIAGE_MASS, CARRIAGE_STIFFNESS
        )
    plant.set_gravity_enabled(instance, False)
    radius = target.tip_radius
    return add_fingertips(
        plant,
        body,
        target.spheres(mu),
        mass=TIP_MASS,
        stiffness=target.squeeze / (TIP_TRAVEL * target.object_.polyhedron.diameter),
        material=partial(
            contact_material,
            modulus=fingertip_modulus(target.squeeze / 3.0, radius),
            resolution=radius,
        ),
        hand=carriage,
        colours=[(*rgb(colour), 1.0) for colour in CONTACTS],
    )


def plan_forces(target: Target, motion: Motion) -> Array:
    """Normal forces that planned friction asks for during a motion [N], shape (N, 3)."""
    object_, grasp = target.object_, target.found.grasp
    loads = target.loads(motion.a_WH)
    holding = hold(grasp, object_.p_BBcm, object_.rho, loads, target.squeeze)
    if holding is None:
        raise UsageError(f"no squeeze of {target.squeeze:.1f} N bears weight and inertia")
    return motion.progress_in("squeeze")[:, None] * normal_forces(grasp, holding.f_Bc_B)


def connect_hand(builder: DiagramBuilder, tips: Fingertips, motion: Motion, forces: Array) -> None:
    """Commands a hand: the carriage's motion, the fingertips' approach and their forces."""
    plant, time = tips.plant, motion.time
    connect_commands(builder, plant, tips.hand.model_instance(), time, motion.p_WH)
    gap = STANDOFF * (1.0 - motion.progress_in("approach"))
    # The tips' own inertia is no force on the object.
    feed = forces + TIP_MASS * motion.a_WH @ tips.nhat_H.T
    connect_commands(builder, plant, tips.instance, time, np.column_stack([-gap] * 3), feed)

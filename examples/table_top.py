"""A plant with an object on a table, whose top is at z = 0.

Contact is hydroelastic: the object is rigid, with its true surface, and what touches it compliant.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydrake.geometry import Box, MeshcatVisualizer, SceneGraph, SceneGraphConfig
from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import RigidBody
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, DiagramBuilder

from drake_polygrasp import ModelError, UsageError, object_from_plant
from drake_polygrasp.loading import add_model
from drake_polygrasp.plant import DISSIPATION, contact_material

TIME_STEP = 1e-3
"""[s]"""
STICTION_SPEED = 1e-5
"""[m/s]: what sticks creeps more slowly."""
TABLE_MU = 0.5
TABLE_MODULUS = 3e5
"""[Pa], of a rubber mat: time steps of a millisecond let light objects rattle on harder ones."""
TABLE_DISSIPATION = 50.0
"""[s/m]"""
TILT = RotationMatrix(RollPitchYaw(0.03, 0.03, 0.0))
"""At which objects are put down, lest they balance on a corner."""
_COLOUR = np.array([0.8, 0.72, 0.6, 1.0])


class TableTop(NamedTuple):
    """A diagram in the making: a table and an object B, with room for more."""

    builder: DiagramBuilder
    plant: MultibodyPlant
    scene_graph: SceneGraph
    body: RigidBody

    def finalize(self) -> None:
        """Finalizes the plant; ModelError when its object cannot be moved."""
        self.plant.Finalize()
        self.plant.set_stiction_tolerance(STICTION_SPEED)
        name = self.body.name()
        if not self.body.is_floating_base_body():
            raise ModelError(f"'{name}' is fixed; remove what holds it")
        inertia = self.body.default_spatial_inertia().CopyToFullMatrix6()
        if not np.linalg.eigvalsh(inertia).min() > 0:
            raise ModelError(f"'{name}' has no mass or inertia; state both")

    def visualizer(self, meshcat: object) -> MeshcatVisualizer | None:
        """What publishes to a Meshcat, if there is one."""
        if meshcat is None:
            return None
        return MeshcatVisualizer.AddToBuilder(self.builder, self.scene_graph, meshcat)


def make_table_top(model_file: Path) -> TableTop:
    """Adds an object and a table to a new plant, which is not finalized.

    ModelError when the file cannot be read, or does not hold one body.
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, TIME_STEP)
    plant.set_contact_model(ContactModel.kHydroelastic)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    config = SceneGraphConfig()
    config.default_proximity_properties.compliance_type = "rigid"
    config.default_proximity_properties.hunt_crossley_dissipation = DISSIPATION
    scene_graph.set_config(config)
    # Prefixed, lest a model be named as the hand is.
    bodies = add_model(plant, model_file, name_prefix="object")
    if len(bodies) != 1:
        names = ", ".join(f"'{body.name()}'" for body in bodies)
        raise ModelError(
            f"{model_file} has several bodies to pick up: {names}; leave one of them"
            if bodies
            else f"{model_file}: no collision geometry; a grasp needs what fingers can touch"
        )
    world, top, X_WG = plant.world_body(), Box(0.8, 0.8, 0.04), RigidTransform([0.0, 0.0, -0.02])
    material = contact_material(
        TABLE_MU, modulus=TABLE_MODULUS, resolution=0.04, dissipation=TABLE_DISSIPATION
    )
    plant.RegisterCollisionGeometry(world, X_WG, top, "table", material)
    plant.RegisterVisualGeometry(world, X_WG, top, "table", _COLOUR)
    return TableTop(builder, plant, scene_graph, bodies[0])


def settle(model_file: Path) -> tuple[MultibodyPlant, RigidBody, Context]:
    """Lets an object come to rest on the table: the plant, its body, and the plant's context."""
    table_top = make_table_top(model_file)
    table_top.finalize()
    plant, body = table_top.plant, table_top.body
    simulator = Simulator(table_top.builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    object_ = object_from_plant(plant, body, context)
    p_WV = object_.polyhedron.triangles_B.reshape(-1, 3) @ TILT.matrix().T
    plant.SetFreeBodyPose(context, body, RigidTransform(TILT, [0.0, 0.0, 1e-3 - p_WV[:, 2].min()]))
    quiet = 0
    for k in range(1, 51):
        simulator.AdvanceTo(0.1 * k)
        V_WB = plant.EvalBodySpatialVelocityInWorld(context, body)
        quiet = quiet + 1 if np.abs(V_WB.get_coeffs()).max() < 1e-3 else 0
        if quiet == 3:
            return plant, body, context
    raise UsageError(f"{model_file}: it does not come to rest on a table")

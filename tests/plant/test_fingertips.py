"""Fingertips in a plant of anyone's push as hard as they are told, wherever the hand is turned."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest
from pydrake.geometry import Box, SceneGraphConfig
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    CalcContactFrictionFromSurfaceProperties,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
)
from pydrake.multibody.tree import SpatialInertia
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp import ModelError
from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.holding_forces import friction_needed
from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.loading.model_in_plant import add_model
from drake_polygrasp.plant.approach import is_approach_clear
from drake_polygrasp.plant.fingertips import (
    FingertipSpheres,
    add_fingertips,
    contact_material,
    fingertip_friction,
    fingertip_modulus,
    fingertip_spheres,
)
from drake_polygrasp.plant.harness import GraspSimulation, connect_commands, tangential
from tests.support.plant_scenes import MODELS, cube_grasp

RADIUS = 0.01
FORCES = np.array([8.0, 4.0, 4.0])
"""One finger against two [N]."""
CUBE = MODELS / "cube" / "cube.sdf"


def squeezed(contact: ContactModel, X_WH: RigidTransform) -> Array:
    """Normal forces measured on the cube in a hand that is welded to the world at a pose [N]."""
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    plant.set_contact_model(contact)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    config = SceneGraphConfig()
    config.default_proximity_properties.compliance_type = "rigid"
    scene_graph.set_config(config)
    plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
    (body,) = add_model(plant, CUBE)
    hand = plant.AddRigidBody(
        "palm", body.model_instance(), SpatialInertia.SolidSphereWithMass(1.0, 0.1)
    )
    plant.WeldFrames(plant.world_frame(), hand.body_frame(), X_WH)
    spheres = fingertip_spheres(cube_grasp(), RADIUS, fingertip_friction(cube_grasp().mu, 0.3))
    material = partial(contact_material, point_stiffness=1e5)
    if contact == ContactModel.kHydroelastic:
        modulus = fingertip_modulus(FORCES.mean(), RADIUS)
        material = partial(contact_material, modulus=modulus, resolution=RADIUS)
    tips = add_fingertips(
        plant, body, spheres, mass=0.05, stiffness=10.0, material=material, hand=hand
    )
    plant.Finalize()
    time, still = np.array([0.0, 0.1, 1.0]), np.zeros((3, 3))
    ramp = np.array([0.0, 1.0, 1.0])[:, None] * FORCES
    connect_commands(builder, plant, tips.instance, time, still, ramp)
    simulation = GraspSimulation(builder.Build(), tips)
    plant.SetFreeBodyPose(simulation.context, body, X_WH)
    simulation.advance_to(0.4, FORCES)
    np.testing.assert_allclose(simulation.record.X_HB[0].translation(), 0.0, atol=1e-3)
    return np.asarray(simulation.record.normal_force[0])


@pytest.mark.parametrize("contact", [ContactModel.kPoint, ContactModel.kHydroelastic])
@pytest.mark.parametrize("roll", [0.0, 1.0])
def test_measured_forces_are_those_commanded(contact: ContactModel, roll: float) -> None:
    X_WH = RigidTransform(RollPitchYaw(roll, 0.5 * roll, 0.2 * roll), [0.0, 0.0, roll])
    # The springs take 10 N/m of what contact gives way, a fraction of a millimetre.
    np.testing.assert_allclose(squeezed(contact, X_WH), FORCES, rtol=0.01)


def test_drake_makes_the_friction_of_the_pair_from_that_of_the_fingertip() -> None:
    mu, mu_object = np.array([0.1, 0.3, 0.5]), np.array([0.3, 0.3, 0.8])
    mu_T = fingertip_friction(mu, mu_object)
    for tip, surface, wanted in zip(mu_T, mu_object, mu, strict=True):
        pair = CalcContactFrictionFromSurfaceProperties(
            CoulombFriction(tip, tip), CoulombFriction(surface, surface)
        )
        assert pair.dynamic_friction() == pytest.approx(wanted, rel=1e-12)


def test_spheres_touch_from_outside_where_the_object_is() -> None:
    X_HB = RigidTransform(RollPitchYaw(0.1, 0.2, 0.3), [1.0, 2.0, 3.0])
    spheres = fingertip_spheres(cube_grasp(), RADIUS, cube_grasp().mu, X_HB)
    p_HC = spheres.p_HT + RADIUS * spheres.nhat_H
    np.testing.assert_allclose(X_HB.inverse().multiply(p_HC.T).T, cube_grasp().p_BC, atol=1e-15)
    normals = spheres.nhat_H @ X_HB.rotation().matrix()
    np.testing.assert_allclose(normals, cube_grasp().nhat_TB_B, atol=1e-15)


def test_what_moves_along_a_normal_does_not_move_across_it() -> None:
    p, n = cube_grasp().p_BC, cube_grasp().nhat_TB_B
    np.testing.assert_allclose(tangential(p + 0.1 * n, n), tangential(p, n), atol=1e-15)
    across = np.cross(n, [0.0, 0.0, 0.1])
    np.testing.assert_allclose(tangential(p + across, n) - tangential(p, n), across, atol=1e-15)


@pytest.mark.parametrize(("wall", "clear"), [(0.045, False), (0.065, False), (0.075, True)])
def test_what_stands_within_the_standoff_is_in_the_way(wall: float, clear: bool) -> None:
    # The fingertip of contact 1 comes along x, from 0.03 + 0.02, and reaches 2 radii beyond.
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 0.0)
    X_WG, friction = RigidTransform([wall + 0.005, 0.0, 0.0]), CoulombFriction(0.5, 0.5)
    plant.RegisterCollisionGeometry(plant.world_body(), X_WG, Box(0.01, 0.2, 0.2), "wall", friction)
    plant.Finalize()
    diagram = builder.Build()
    context = diagram.CreateDefaultContext()
    spheres = fingertip_spheres(cube_grasp(), RADIUS, cube_grasp().mu)
    at = plant.GetMyContextFromRoot(context)
    assert is_approach_clear(plant, at, spheres, standoff=0.02) == clear
    overlapping = FingertipSpheres(spheres.p_HT, spheres.nhat_H, 0.0201, spheres.mu)
    assert not is_approach_clear(plant, at, overlapping, standoff=0.0)


@pytest.mark.parametrize("squeeze", [6.0, 10.0])
def test_the_friction_needed_of_opposed_contacts_is_load_over_squeeze(squeeze: float) -> None:
    weight = np.array([0.0, 0.0, -0.1512 * GRAVITY, 0.0, 0.0, 0.0])
    needed = friction_needed(cube_grasp(), np.zeros(3), 0.05, weight, squeeze)
    assert needed == pytest.approx(0.1512 * GRAVITY / squeeze, abs=2e-3)


def test_a_model_is_added_under_a_prefix_and_a_bad_one_is_refused() -> None:
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    bodies = [add_model(plant, CUBE, name_prefix=name)[0] for name in ("left", "right")]
    names = [plant.GetModelInstanceName(body.model_instance()) for body in bodies]
    assert names == ["left::cube", "right::cube"]
    with pytest.raises(ModelError, match="there is no such model file"):
        add_model(plant, "missing.sdf")

"""A grasp as a system holds what forces can hold."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from pydrake.common.value import AbstractValue
from pydrake.math import RigidTransform, RollPitchYaw
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import BodyIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import DiagramBuilder
from pydrake.systems.primitives import ConstantValueSource, ConstantVectorSource

from drake_polygrasp import GraspForces, UsageError
from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.plant.scratch_plant import ScratchScene
from tests.support.common import grasp
from tests.support.plant_scenes import cube_grasp, model, top_grasp, top_scene

X_WB = RigidTransform(RollPitchYaw(0.4, -0.7, 1.9), [0.1, 0.2, 0.3])


def pose_after(
    scene: ScratchScene, squeeze: float, f: Array, tau: Array | None = None
) -> tuple[RigidTransform, bool]:
    """Where the object is after half a second of gravity, and whether the forces held it."""
    builder = DiagramBuilder()
    plant, _ = AddMultibodyPlantSceneGraph(builder, 1e-3)
    body = plant.AddRigidBody("object", scene.solid.M_BBo_B)
    plant.Finalize()
    forces = builder.AddSystem(GraspForces(scene.object_, scene.grasp, squeeze, body))
    F_BBcm_W = SpatialForce(tau=np.zeros(3) if tau is None else tau, f=f)
    load = builder.AddSystem(ConstantValueSource(AbstractValue.Make(F_BBcm_W)))
    builder.Connect(plant.get_body_poses_output_port(), forces.GetInputPort("body_poses"))
    builder.Connect(load.get_output_port(), forces.GetInputPort("F_BBcm_W"))
    builder.Connect(
        forces.GetOutputPort("applied_spatial_force"), plant.get_applied_spatial_force_input_port()
    )
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    plant.SetPositions(
        context, np.append(X_WB.rotation().ToQuaternion().wxyz(), X_WB.translation())
    )
    simulator.AdvanceTo(0.5)
    holds = forces.GetOutputPort("holds").Eval(forces.GetMyContextFromRoot(simulator.get_context()))
    return plant.EvalBodyPoseInWorld(context, body), bool(holds[0])


def test_forces_that_hold_the_weight_leave_the_object_where_it_is() -> None:
    scene = top_scene("skewed_block")
    weight = scene.solid.M_BBo_B.get_mass() * GRAVITY
    pose, holds = pose_after(scene, 8 * weight, np.array([0, 0, -weight]))
    assert holds
    assert pose.IsNearlyEqualTo(X_WB, 1e-9)


def test_a_squeeze_that_is_not_told_of_the_weight_lets_it_fall() -> None:
    scene = top_scene("skewed_block")
    weight = scene.solid.M_BBo_B.get_mass() * GRAVITY
    pose, holds = pose_after(scene, 8 * weight, np.zeros(3))
    assert holds
    # Of the body's centre of mass, in free fall.
    fallen = X_WB.translation() - pose.translation()
    assert fallen[2] == pytest.approx(GRAVITY * 0.5**2 / 2, rel=0.01)
    np.testing.assert_allclose(pose.rotation().matrix(), X_WB.rotation().matrix(), atol=1e-6)


def test_a_squeeze_too_weak_for_the_weight_says_so() -> None:
    scene = top_scene("skewed_block")
    weight = scene.solid.M_BBo_B.get_mass() * GRAVITY
    _, holds = pose_after(scene, weight, np.array([0, 0, -weight]))
    assert not holds


def test_what_cannot_squeeze_is_refused() -> None:
    cube = model("cube")
    one_face = grasp(cube_grasp().p_BC, [[1, 0, 0]] * 3, 0.3)
    with pytest.raises(UsageError, match="force closure"):
        GraspForces(cube, one_face, 10.0, BodyIndex(1))
    with pytest.raises(UsageError, match="squeeze"):
        GraspForces(cube, cube_grasp(), 0.0, BodyIndex(1))


def test_a_torque_is_borne_as_a_torque() -> None:
    """A load of weight and torque: the forces' wrench about the centre of mass is its negative."""
    scene = top_scene("skewed_block")
    weight = scene.solid.M_BBo_B.get_mass() * GRAVITY
    f, tau = np.array([0.0, 0.0, -weight]), weight * scene.object_.rho * np.array([0.1, 0.05, -0.1])
    forces = GraspForces(scene.object_, scene.grasp, 8 * weight, BodyIndex(1))
    context = forces.CreateDefaultContext()
    X_WB = RigidTransform(RollPitchYaw(0.4, -0.7, 1.9), [0.1, 0.2, 0.3])
    forces.GetInputPort("body_poses").FixValue(context, [RigidTransform(), X_WB])
    forces.GetInputPort("F_BBcm_W").FixValue(context, SpatialForce(tau=tau, f=f))
    assert forces.GetOutputPort("holds").Eval(context)[0] == 1.0
    applied = forces.GetOutputPort("applied_spatial_force").Eval(context)
    f_W = np.array([force.F_Bq_W.translational() for force in applied])
    arm_B = np.array([force.p_BoBq_B for force in applied]) - scene.object_.p_BBcm
    arm_W = arm_B @ X_WB.rotation().matrix().T
    np.testing.assert_allclose(f_W.sum(axis=0), -f, atol=1e-6 * weight)
    np.testing.assert_allclose(
        np.cross(arm_W, f_W).sum(axis=0), -tau, atol=1e-6 * weight * scene.object_.rho
    )


def test_force_and_torque_cannot_be_confused() -> None:
    forces = GraspForces(model("cube"), top_grasp("cube")[0], 10.0, BodyIndex(1))
    with pytest.raises(UsageError, match=r"now 'F_BBcm_W' and takes a SpatialForce"):
        forces.GetInputPort("load_W")
    with pytest.raises(UsageError, match="'body_poses' or 'F_BBcm_W'"):
        forces.GetInputPort("load")
    builder = DiagramBuilder()
    builder.AddSystem(forces)
    six = builder.AddSystem(ConstantVectorSource(np.zeros(6)))
    with pytest.raises(RuntimeError, match="vector-valued and abstract-valued"):
        builder.Connect(six.get_output_port(), forces.GetInputPort("F_BBcm_W"))


def test_what_slips_about_a_line_is_no_grasp_to_hold_with() -> None:
    """Two opposed fingers, one of them twice, balance each other and let the cube turn."""
    p_BC = cube_grasp().p_BC.copy()
    p_BC[1:, 1] = 0.0
    with pytest.raises(UsageError, match="not proved force closure"):
        GraspForces(model("cube"), replace(cube_grasp(), p_BC=p_BC), 10.0, BodyIndex(1))


def test_a_body_of_another_plant_is_said() -> None:
    forces = GraspForces(model("cube"), cube_grasp(), 10.0, BodyIndex(7))
    context = forces.CreateDefaultContext()
    forces.GetInputPort("body_poses").FixValue(context, [RigidTransform()])
    with pytest.raises(UsageError, match="index 7, and the plant has 1 bodies"):
        forces.GetOutputPort("holds").Eval(context)

"""Whole hands close, squeeze and lift in simulation; without torques or friction they do not."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp import (
    HandController,
    HandError,
    ModelError,
    UsageError,
    lift_with_hand,
    load_hand,
    load_object,
    plan_hand_grasps,
    save_grasps,
    verify_file,
)
from drake_polygrasp.cli.main import main
from drake_polygrasp.files.stated_grasp import StatedPlan
from drake_polygrasp.grasp import Verdict
from drake_polygrasp.hand_grasp import HandGrasp
from drake_polygrasp.plant import HandTimes, add_hand_actuators
from drake_polygrasp.plant.hand_lift import HELD_RISE, LIFT, judge_lift
from drake_polygrasp.plant.supports import support_points
from tests.support.hands import CUBE, MODELS, PATIENCE, own_hand, own_hand_grasps, planned

FOUR_FINGERS = Path(__file__).parents[1] / "hands" / "four_fingers.hand.yaml"
LIFTED = [CUBE, MODELS / "t_block" / "t_block.urdf", MODELS / "wedge" / "wedge.urdf"]


def short(model: Path) -> str:
    return model.stem


@pytest.mark.parametrize("model", LIFTED, ids=short)
def test_the_planned_torques_lift_and_hold_and_their_absence_does_not(model: Path) -> None:
    object_, _ = planned(model)
    for each in own_hand_grasps(model)[:2]:
        held = lift_with_hand(object_, each.certified, own_hand(), each)
        assert held.held
        assert held.rise == pytest.approx(LIFT, abs=1e-3)
        assert held.slip <= 5e-4
        # The squeeze was planned with 0.8 of the friction, and carries more than the weight.
        idle = lift_with_hand(object_, each.certified, own_hand(), each, feedforward=False)
        assert not idle.held
        slippery = lift_with_hand(object_, each.certified, own_hand(), each, mu=0.05)
        assert not slippery.held


def test_an_object_without_inertia_is_not_lifted_and_that_is_said(tmp_path: Path) -> None:
    file = tmp_path / "flat.sdf"
    text, count = re.subn("<izz>.*</izz>", "<izz>0</izz>", CUBE.read_text())
    assert count == 1
    file.write_text(text)
    each = own_hand_grasps(CUBE)[0]
    with pytest.raises(ModelError, match="no rotational inertia about some axis"):
        lift_with_hand(load_object(file), each.certified, own_hand(), each)
    verdict = judge_lift(load_object(file), each.certified, own_hand(), each)
    assert verdict.verdict is Verdict.UNDECIDED


def test_joints_that_mimic_others_follow_them_in_the_lift() -> None:
    hand, cube = load_hand(FOUR_FINGERS), load_object(CUBE)
    each = plan_hand_grasps(cube, hand, top=1, load_mass=0.15, budget=PATIENCE).grasps[0]
    assert len(each.torque.torque) < len(each.q)
    assert lift_with_hand(cube, each.certified, hand, each).held
    assert not lift_with_hand(cube, each.certified, hand, each, feedforward=False).held


def test_an_object_is_lifted_off_its_supports() -> None:
    object_, _ = planned(CUBE)
    each = own_hand_grasps(CUBE, up=True)[0]
    held = lift_with_hand(object_, each.certified, own_hand(), each)
    assert held.stood
    assert held.held
    assert not lift_with_hand(object_, each.certified, own_hand(), each, feedforward=False).held


def test_an_object_stands_on_its_lowest_corners_if_its_weight_is_above_them() -> None:
    cube = load_object(CUBE)
    up = np.array([0.0, 0.0, 1.0])
    points = support_points(cube, up)
    assert points is not None
    assert points[:, 2] == pytest.approx(cube.polyhedron.triangles_B[..., 2].min(), abs=1e-12)
    assert (np.abs(points[:, :2]) > 0.025).all()
    assert (np.abs(points[:, :2]) < 0.03).all()
    assert support_points(cube, np.array([0.6, 0.0, 0.8])) is None
    assert support_points(cube, np.full(3, 1 / np.sqrt(3))) is None
    beside = replace(cube, p_BBcm=np.array([0.04, 0.0, 0.0]))
    assert support_points(beside, up) is None


def own_plant(with_actuators: bool) -> tuple[MultibodyPlant, Any]:
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
    model = own_hand().add_to(plant, scene_graph)
    if with_actuators:
        add_hand_actuators(own_hand(), plant, model.instance)
    plant.Finalize()
    return plant, model.instance


def commands(controller: HandController, time: float) -> tuple[Any, Any]:
    context = controller.CreateDefaultContext()
    context.SetTime(time)
    state, torque = (
        controller.GetOutputPort(name).Eval(context) for name in ("desired_state", "feedforward")
    )
    return state, torque


def test_a_controller_waits_open_closes_and_squeezes() -> None:
    plant, instance = own_plant(with_actuators=True)
    each = own_hand_grasps(CUBE)[0]
    times = HandTimes(start=1.0, close=0.4, squeeze=0.2)
    controller = HandController(own_hand(), plant, instance, each, times)
    names = [
        plant.get_joint_actuator(index).joint().name()
        for index in plant.GetJointActuatorIndices(instance)
    ]
    opened, closed = (np.array([q[name] for name in names]) for q in (each.pregrasp.q, each.q))
    full = np.array([each.torque.torque[name] for name in names])
    for time, share, push in ((0.0, 0, 0), (1.0, 0, 0), (1.2, 0.5, 0), (1.4, 1, 0), (1.5, 1, 0.5)):
        state, torque = commands(controller, time)
        assert state[:9] == pytest.approx(opened + share * (closed - opened), abs=1e-12)
        assert torque == pytest.approx(push * full, abs=1e-12)
    state, torque = commands(controller, 5.0)
    assert state == pytest.approx(np.append(closed, np.zeros(9)), abs=1e-12)
    assert torque == pytest.approx(full, abs=1e-12)
    # The desired speeds are the derivatives of the desired positions.
    before, after = (commands(controller, 1.13 + step)[0][:9] for step in (-1e-5, 1e-5))
    assert commands(controller, 1.13)[0][9:] == pytest.approx((after - before) / 2e-5, rel=1e-6)
    assert times.end == pytest.approx(1.6)


def test_a_controller_refuses_a_plant_without_the_hands_actuators() -> None:
    each = own_hand_grasps(CUBE)[0]
    plant = MultibodyPlant(1e-3)
    instance = plant.AddModelInstance("nothing")
    plant.Finalize()
    with pytest.raises(HandError, match="no actuator of joint 'first_bend'; call add_hand_act"):
        HandController(own_hand(), plant, instance, each)
    plant, instance = own_plant(with_actuators=True)
    with pytest.raises(UsageError, match="placement is"):
        HandController(own_hand(), plant, instance, each.certified)  # type: ignore[arg-type]


def test_gains_are_those_of_the_description() -> None:
    plant, instance = own_plant(with_actuators=True)
    actuators = [
        plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices(instance)
    ]
    assert len(actuators) == 9  # The model has its own; none is added beside them.
    for actuator in actuators:
        gains = actuator.get_controller_gains()
        assert (gains.p, gains.d) == (4.0, 0.05)
    assert len(own_plant(with_actuators=False)[0].GetJointActuatorIndices()) == 9


def test_a_hand_that_the_world_holds_lifts_nothing() -> None:
    each = own_hand_grasps(CUBE)[0]
    fixed = replace(own_hand(), floats=False)
    object_, _ = planned(CUBE)
    with pytest.raises(UsageError, match="welded to the world"):
        lift_with_hand(object_, each.certified, fixed, each)


def weakened(each: HandGrasp) -> HandGrasp:
    """A grasp whose squeeze holds nothing, honestly stated."""
    torque = each.torque
    small = replace(
        torque,
        f_Bc_B=1e-3 * torque.f_Bc_B,
        torque={name: 1e-3 * value for name, value in torque.torque.items()},
    )
    return replace(each, torque=small)


def test_verify_lifts_in_a_plant_and_says_what_it_saw(tmp_path: Path, capsys: Any) -> None:
    object_, _ = planned(CUBE)
    good = own_hand_grasps(CUBE)[0]
    file, copy = tmp_path / "cube.grasp.yaml", tmp_path / "in" / "cube.grasp.yaml"
    copy.parent.mkdir()
    save_grasps(file, object_, [good, weakened(good)], StatedPlan())
    report = verify_file(file, plant=True)
    verdicts = [grasp.plant.verdicts[-1] for grasp in report.grasps if grasp.plant is not None]
    assert [verdict.name for verdict in verdicts] == ["hand", "hand"]
    assert [verdict.verdict for verdict in verdicts] == [Verdict.HOLDS, Verdict.FAILS]
    assert verdicts[0].margin == pytest.approx((1 - HELD_RISE) * LIFT, abs=1e-3)
    assert "rises 100 mm" in verdicts[0].reason
    assert "loses the object" in verdicts[1].reason
    assert report.holds is False
    assert main(["verify", str(file), "--plant", "-o", str(copy)]) == 1
    assert "hand" in capsys.readouterr().out
    document = yaml.safe_load(copy.read_text())
    assert document["grasps"][0]["plant"]["verdicts"][-1]["name"] == "hand"
    assert verify_file(copy).grasps[0].hand is not None

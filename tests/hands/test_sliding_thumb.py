"""A hand of MJCF whose thumb slides: a length of a prismatic joint counts as an angle of others."""

from __future__ import annotations

from pathlib import Path

import pytest
from pydrake.geometry import SceneGraph
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, MultibodyPlant
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp import load_hand
from drake_polygrasp.hands.library import draw_postures
from drake_polygrasp.plant import add_hand_actuators

HAND = Path(__file__).with_name("sliding_thumb.hand.yaml")


def plant_and_scene() -> tuple[MultibodyPlant, SceneGraph]:
    return AddMultibodyPlantSceneGraph(DiagramBuilder(), 1e-3)  # type: ignore[no-any-return]


def test_random_postures_use_the_range_of_a_sliding_joint() -> None:
    hand = load_hand(HAND)
    slides = draw_postures(hand, 2000, 0).q[:, hand.joints.index("thumb_x")]
    # Its limits are -90 and -30 mm, of which 0.03 * 5 cm are kept; 2000 draws come near both.
    assert -0.0885 <= slides.min() <= -0.088
    assert -0.032 <= slides.max() <= -0.0315


def test_gains_of_sliding_joints_are_as_stiff_at_the_tip() -> None:
    hand = load_hand(HAND)
    plant, scene_graph = plant_and_scene()
    model = hand.add_to(plant, scene_graph)
    add_hand_actuators(hand, plant, model.instance)
    gains = {
        actuator.joint().name(): actuator.get_controller_gains()
        for actuator in map(plant.get_joint_actuator, plant.GetJointActuatorIndices())
    }
    assert (gains["a_yaw"].p, gains["a_yaw"].d) == (4.0, 0.05)
    # A lever of 5 cm that turns with 4 N m/rad yields by 1 m per 4 / 0.05**2 N.
    assert gains["thumb_x"].p == pytest.approx(1600)
    assert gains["thumb_z"].d == pytest.approx(20)

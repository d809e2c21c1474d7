"""Lifts an object with a whole hand in simulation: approach, close, squeeze, lift, hold.

The palm moves on two prismatic joints, along its way and then up. The object stands on small
spheres under its support polygon, or, if it would not stand, floats without weight until the hand
squeezes it. Joints are held by the hand's PD control; what lifts is the feedforward of the planned
torques.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydrake.geometry import Meshcat
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from drake_polygrasp.arguments import (
    check_flag,
    check_instance,
    check_number,
    check_packages,
    check_paths,
)
from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import ModelError, UsageError
from drake_polygrasp.grasp import AnyGrasp, GraspObject, PlantVerdict, Verdict, grasp_of
from drake_polygrasp.hand_grasp import HandPlacement
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.plant.drake_calls import Refusal, ask_drake
from drake_polygrasp.plant.hand_control import HandController, HandTimes, smooth_positions
from drake_polygrasp.plant.harness import connect_commands
from drake_polygrasp.plant.lift_plant import LiftPlant
from drake_polygrasp.plant.load_test import PADS
from drake_polygrasp.plant.loads import NO_INERTIA, has_inertia
from drake_polygrasp.plant.scratch_plant import make_scene

LIFT = 0.10
"""Height of the lift [m]. Our choice."""
HELD_RISE = 0.8
"""Share of the lift that a held object rises with the hand. Our choice."""
_TIMES = HandTimes(start=0.7)
_APPROACH, _REST, _RISE, _HOLD = 0.5, 0.2, 0.6, 0.5
"""Times of the palm's way, of rest before lifting, of lifting and of holding [s]. Our choice."""
_SAMPLE = 0.02


@dataclass(frozen=True)
class LiftOutcome:
    """What a simulated lift shows.

    Attributes:
        rise: how far the object rises with the hand [m].
        slip: greatest displacement of a contact from its tip while it is lifted and held [m].
        touching: whether each of the three tips touches the object in the end.
        stood: whether the object stood on supports; otherwise it floated until it was squeezed.
        on_pads: whether tips touched pads in place of the object's surface, which is no hull.
    """

    rise: float
    slip: float
    touching: tuple[bool, bool, bool]
    stood: bool
    on_pads: bool

    @property
    def held(self) -> bool:
        """Whether the object rose with the hand, and all three tips touch it."""
        return self.rise > HELD_RISE * LIFT and all(self.touching)


def lift_with_hand(
    object_: GraspObject,
    grasp: AnyGrasp,
    hand: Hand,
    placement: HandPlacement,
    *,
    mu: float | None = None,
    feedforward: bool = True,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
    meshcat: Meshcat | None = None,
) -> LiftOutcome:
    """Simulates a hand that comes, closes, squeezes, lifts the object by 10 cm and holds it.

        best = plan_hand_grasps(box, hand).grasps[0]
        print(lift_with_hand(box, best.certified, hand, best).held)

    Args:
        object_: the object, loaded from a file.
        grasp: three contacts.
        hand: the hand.
        placement: how it holds them.
        mu: friction coefficient of all surfaces (default: the contacts', and the object's).
        feedforward: whether the planned torques are applied, or PD control alone.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.
        meshcat: Meshcat in which a recording is published (default: none).

    Returns:
        What happened.

    Raises:
        UsageError: when an argument has the wrong type or value, the mass is not known, or the
            hand's model is welded to the world.
        ModelError: when the object came from no file, the file cannot be read again or states no
            rotational inertia about some axis, or Drake refuses to simulate the object.
    """
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    contacts = grasp_of(grasp)
    check_instance("hand", hand, Hand, "as load_hand returns it")
    check_instance("placement", placement, HandPlacement, "such as a grasp of plan_hand_grasps")
    if mu is not None:
        mu = check_number("mu", mu, "a friction coefficient above 0", above=0.0)
    feedforward = check_flag("feedforward", feedforward)
    package_paths = check_paths("package_paths", package_paths)
    packages = check_packages("packages", packages)
    if meshcat is not None:
        check_instance("meshcat", meshcat, Meshcat)
    if not hand.floats:
        raise UsageError(
            f"hand '{hand.name}' is welded to the world by its model, so it lifts nothing; leave "
            "out the weld"
        )
    scene = make_scene(object_, contacts, hand.tips[0].radius, package_paths, packages)
    mass = placement.torque.mass or object_.mass
    if mass is None:
        raise UsageError("the mass of the object is not known; give the mass of the load")
    if not has_inertia(scene.solid):
        raise ModelError(f"{NO_INERTIA}, so Drake cannot simulate it; state its inertia")
    if mu is not None:
        scene = replace(scene, grasp=replace(scene.grasp, mu=np.full(3, mu)))
    factor = 1.0 if feedforward else 0.0
    found = ask_drake(
        lambda: _simulate(LiftPlant(scene, hand, placement, mass, meshcat), hand, placement, factor)
    )
    if isinstance(found, Refusal):
        raise ModelError(f"Drake refuses to simulate this lift: {found.reason}")
    return found


def judge_lift(
    object_: GraspObject,
    grasp: AnyGrasp,
    hand: Hand,
    placement: HandPlacement,
    *,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> PlantVerdict:
    """Returns the verdict "hand" of a simulated lift.

    Args:
        object_: the object, loaded from a file.
        grasp: three contacts.
        hand: the hand.
        placement: how it holds them.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.
    """
    try:
        found = lift_with_hand(
            object_, grasp, hand, placement, package_paths=package_paths, packages=packages
        )
    except (ModelError, UsageError) as error:
        return PlantVerdict("hand", Verdict.UNDECIDED, None, "m", f"not run: {error}")
    if all(found.touching):
        reason = f"rises {1000 * found.rise:.0f} mm, slips {1000 * found.slip:.2g} mm"
    else:
        reason = f"tip '{placement.fingers[found.touching.index(False)]}' loses the object"
    if found.on_pads:
        reason += f"; {PADS}"
    # An object that is thrown, or that a tip has left, is lost whatever its height.
    margin = found.rise - HELD_RISE * LIFT if all(found.touching) else -LIFT
    verdict = Verdict.HOLDS if found.held else Verdict.FAILS
    return PlantVerdict("hand", verdict, max(margin, -LIFT), "m", reason)


def _simulate(
    lift: LiftPlant, hand: Hand, placement: HandPlacement, feedforward: float
) -> LiftOutcome:
    """Simulates a lift: approach, close, squeeze, rest, lift, hold."""
    plant, builder, instance = lift.plant, lift.builder, lift.model.instance
    controller = builder.AddSystem(
        HandController(hand, plant, instance, placement, _TIMES, feedforward=feedforward)
    )
    builder.Connect(
        controller.GetOutputPort("desired_state"), plant.get_desired_state_input_port(instance)
    )
    builder.Connect(
        controller.GetOutputPort("feedforward"), plant.get_actuation_input_port(instance)
    )
    lift_at = _TIMES.end + _REST
    end = lift_at + _RISE + _HOLD
    time = np.linspace(0.0, end, round(end / _SAMPLE) + 1)
    way = smooth_positions(time, 0.1, _APPROACH, placement.pregrasp.distance, 0.0)
    rise = smooth_positions(time, lift_at, _RISE, 0.0, LIFT)
    connect_commands(builder, plant, lift.carriages, time, np.column_stack([way, rise]))
    simulator = Simulator(builder.Build())
    context = plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    _start(lift, placement, context)
    if lift.visualizer is not None:
        lift.visualizer.StartRecording()
    in_tips: list[Array] = []
    heights: list[float] = []
    try:
        for t in time[1:].tolist():
            lift.put_weight(context, min(max((t - _TIMES.end) / _REST, 0.0), 1.0))
            simulator.AdvanceTo(t)
            if t >= lift_at:
                in_tips.append(lift.contacts_in_tips(context))
                heights.append(lift.height(context))
    except RuntimeError as error:  # A thrown object ends in numbers that are not finite.
        if "finite" not in str(error):
            raise
        lost = (False, False, False)
        return LiftOutcome(-math.inf, math.inf, lost, lift.stood, lift.on_pads)
    if lift.visualizer is not None:
        lift.visualizer.StopRecording()
        lift.visualizer.PublishRecording()
    slip = float(np.linalg.norm(np.array(in_tips) - in_tips[0], axis=-1).max())
    risen = heights[-1] - heights[0]
    return LiftOutcome(risen, slip, lift.touching(context), lift.stood, lift.on_pads)


def _start(lift: LiftPlant, placement: HandPlacement, context: Context) -> None:
    """Puts the hand in its pregrasp at the far end of the way, and the object at its place."""
    positions = lift.plant.GetPositions(context)
    for joint in lift.model.joints:
        positions[joint.position_start()] = placement.pregrasp.q[joint.name()]
    way = lift.plant.GetJointByName("way", lift.carriages)
    positions[way.position_start()] = placement.pregrasp.distance
    lift.plant.SetPositions(context, positions)
    lift.plant.SetFreeBodyPose(context, lift.body, lift.X_WB)

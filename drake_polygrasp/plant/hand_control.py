"""Closes a hand on an object and squeezes it: a system of a Drake diagram."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JointActuator, ModelInstanceIndex, PdControllerGains
from pydrake.systems.framework import BasicVector, Context, LeafSystem

from drake_polygrasp.arguments import check_instance, check_number
from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import HandError
from drake_polygrasp.hand_grasp import HandPlacement
from drake_polygrasp.hands.hand import Hand


class HandTimes(NamedTuple):
    """When a hand closes and squeezes.

    Attributes:
        start: time at which the fingers begin to close [s].
        close: time that closing takes [s].
        squeeze: time in which the torques then grow [s].
    """

    start: float = 0.0
    close: float = 0.4
    squeeze: float = 0.3

    @property
    def end(self) -> float:
        """Time at which the hand squeezes with its full torques [s]."""
        return self.start + self.close + self.squeeze


def add_hand_actuators(hand: Hand, plant: MultibodyPlant, instance: ModelInstanceIndex) -> None:
    """Gives the independent joints of a hand actuators, where it has none, and PD control.

    The gains are those of the hand's description; of prismatic joints those that hold as stiffly at
    the end of a lever of `hand.LEVER`.

    Args:
        hand: the hand.
        plant: a plant with the hand that is not finalized yet.
        instance: the hand's model instance.
    """
    present = {actuator.joint().name(): actuator for actuator in _actuators(plant, instance)}
    kp, kd = hand.description.kp, hand.description.kd
    of_joint = hand.effort.tolist(), hand.joint_units.tolist()
    for name, effort, unit in zip(hand.independent, *of_joint, strict=True):
        if name not in present:
            joint = plant.GetJointByName(name, instance)
            most = effort if math.isfinite(effort) else math.inf
            present[name] = plant.AddJointActuator(name, joint, most)
        present[name].set_controller_gains(PdControllerGains(p=kp / unit**2, d=kd / unit**2))


def _actuators(plant: MultibodyPlant, instance: ModelInstanceIndex) -> list[JointActuator]:
    """Returns a model instance's actuators; before Finalize, Drake lists only all of a plant."""
    every = [plant.get_joint_actuator(index) for index in plant.GetJointActuatorIndices()]
    return [actuator for actuator in every if actuator.model_instance() == instance]


class HandController(LeafSystem):  # type: ignore[misc]  # Drake's stubs are not followed.
    """Commands a hand that waits in its pregrasp, closes, squeezes, and holds.

        controller = builder.AddSystem(HandController(hand, plant, instance, best, times))
        builder.Connect(
            controller.GetOutputPort("desired_state"),
            plant.get_desired_state_input_port(instance),
        )
        builder.Connect(
            controller.GetOutputPort("feedforward"), plant.get_actuation_input_port(instance)
        )

    The joints track positions by the plant's own PD control (`add_hand_actuators`); torques that
    squeeze the object are added to it. Moving the palm is the arm's.
    """

    def __init__(
        self,
        hand: Hand,
        plant: MultibodyPlant,
        instance: ModelInstanceIndex,
        placement: HandPlacement,
        times: HandTimes = HandTimes(),  # noqa: B008 - immutable
        *,
        feedforward: float = 1.0,
    ) -> None:
        """Declares the ports.

        Args:
            hand: the hand.
            plant: a finalized plant with the hand.
            instance: the hand's model instance.
            placement: how the hand holds the object.
            times: when it closes and squeezes.
            feedforward: factor on the torques of the squeeze; 0 for PD control alone.

        Raises:
            UsageError: when an argument has the wrong type or value.
            HandError: when the plant lacks an actuator of the hand.
        """
        super().__init__()
        check_instance("hand", hand, Hand, "as load_hand returns it")
        check_instance("plant", plant, MultibodyPlant)
        check_instance("placement", placement, HandPlacement, "such as a grasp of a hand's plan")
        factor = check_number("feedforward", feedforward, "a number, 1 for the planned torques")
        self._times = times
        actuators = _actuators(plant, instance)
        missing = {*hand.independent} - {actuator.joint().name() for actuator in actuators}
        if missing:
            raise HandError(
                f"the plant has no actuator of joint '{min(missing)}'; call add_hand_actuators "
                "before plant.Finalize()"
            )
        names = [actuator.joint().name() for actuator in actuators]
        self._open = np.array([placement.pregrasp.q[name] for name in names])
        self._closed = np.array([placement.q[name] for name in names])
        self._torque = factor * np.array([placement.torque.torque.get(name, 0.0) for name in names])
        n = len(names)
        self.DeclareVectorOutputPort("desired_state", BasicVector(2 * n), self._calc_state)
        self.DeclareVectorOutputPort("feedforward", BasicVector(n), self._calc_torque)

    def _calc_state(self, context: Context, output: BasicVector) -> None:
        times = self._times
        share, rate = _smooth((context.get_time() - times.start) / times.close)
        way = self._closed - self._open
        output.SetFromVector(np.concatenate([self._open + share * way, rate / times.close * way]))

    def _calc_torque(self, context: Context, output: BasicVector) -> None:
        times = self._times
        share, _ = _smooth((context.get_time() - times.start - times.close) / times.squeeze)
        output.SetFromVector(share * self._torque)


def _smooth(share: float) -> tuple[float, float]:
    """Returns a share of a motion that starts and ends at rest, and its rate of change."""
    s = min(max(share, 0.0), 1.0)
    return s * s * (3 - 2 * s), 6 * s * (1 - s)


def smooth_positions(
    time: Array, start: float, duration: float, first: float, last: float
) -> Array:
    """Returns positions of a motion that starts and ends at rest.

    Args:
        time: N times [s], shape (N,).
        start: time at which the motion starts [s].
        duration: time that it takes [s].
        first: position before.
        last: position after.

    Returns:
        Positions at these times, shape (N,).
    """
    shares = np.array([_smooth((t - start) / duration)[0] for t in time])
    return np.asarray(first + shares * (last - first))

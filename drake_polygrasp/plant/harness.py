"""Simulates a grasp by fingertips in a plant, sample by sample, and records what they do."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from pydrake.geometry import MeshcatVisualizer
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.plant.fingertips import Fingertips


def tangential(p_HC: Array, nhat_H: Array) -> Array:
    """Returns the parts of positions across the normals along which fingertips slide [m].

    How these change is how contacts slip on their fingertips.

    Args:
        p_HC: contacts in the hand [m], shape (..., 3, 3).
        nhat_H: unit normals, shape (3, 3).
    """
    along = np.einsum("...ij,ij->...i", p_HC, nhat_H)
    return np.asarray(p_HC - along[..., None] * nhat_H)


class GraspSample(NamedTuple):
    """What is recorded at one time.

    Attributes:
        time: [s].
        X_WB: pose of the object in the world.
        X_HB: pose of the object in the hand.
        normal_force: of the fingertips on the object [N], shape (3,).
        planned_force: what they were commanded to push [N], shape (3,).
    """

    time: float
    X_WB: RigidTransform
    X_HB: RigidTransform
    normal_force: Array
    planned_force: Array


@dataclass(frozen=True, eq=False)
class GraspRecord:
    """What fingertips and object did, at N times.

    Attributes:
        time: [s], shape (N,).
        X_WB: poses of the object in the world, N of them.
        X_HB: poses of the object in the hand, N of them.
        normal_force: of the fingertips on the object [N], shape (N, 3).
        planned_force: what they were commanded to push [N], shape (N, 3).
    """

    time: Array
    X_WB: tuple[RigidTransform, ...]
    X_HB: tuple[RigidTransform, ...]
    normal_force: Array
    planned_force: Array


class GraspSimulation:
    """A diagram with fingertips in a plant, advanced from sample to sample.

        simulation = GraspSimulation(diagram, tips, visualizer)
        with simulation.recording():
            for t, force in zip(times, forces):
                simulation.advance_to(t, force)
        record = simulation.record

    Attributes:
        root_context: the diagram's context.
        context: the plant's context.
        samples: what was recorded so far.
    """

    def __init__(
        self, diagram: Diagram, fingertips: Fingertips, visualizer: MeshcatVisualizer | None = None
    ) -> None:
        """Starts a simulation from the diagram's default state.

        Args:
            diagram: holds the fingertips' plant, and what commands them.
            fingertips: what holds the object.
            visualizer: of the diagram, where a recording is wanted.
        """
        self._simulator, self._visualizer = Simulator(diagram), visualizer
        self._fingertips = fingertips
        self.root_context: Context = self._simulator.get_mutable_context()
        self.context: Context = fingertips.plant.GetMyMutableContextFromRoot(self.root_context)
        self.samples: list[GraspSample] = []

    @contextmanager
    def recording(self) -> Iterator[None]:
        """Records for Meshcat what happens inside, and publishes it at the end.

        An object that flies off beyond what Drake can compute ends the recording and is no error.
        """
        if self._visualizer is not None:
            self._visualizer.StartRecording()
        try:
            yield
        except RuntimeError as error:  # What flies off ends in numbers that are not finite.
            if "finite" not in str(error) or not self.samples:
                raise
        if self._visualizer is not None:
            self._visualizer.StopRecording()
            self._visualizer.PublishRecording()

    def advance_to(self, time: float, planned_force: Array) -> GraspSample:
        """Simulates until a time [s], and records what is then.

        Args:
            time: not before that of the context.
            planned_force: what the fingertips are commanded to push [N], shape (3,).

        Returns:
            The new sample.

        Raises:
            RuntimeError: when Drake computes numbers that are not finite.
        """
        self._simulator.AdvanceTo(time)
        tips = self._fingertips
        sample = GraspSample(
            self.root_context.get_time(),
            tips.plant.EvalBodyPoseInWorld(self.context, tips.body),
            tips.X_HB(self.context),
            tips.normal_forces(self.context),
            planned_force,
        )
        self.samples.append(sample)
        return sample

    @property
    def record(self) -> GraspRecord:
        """All samples so far; there must be one."""
        time, X_WB, X_HB, normal_force, planned_force = zip(*self.samples, strict=True)
        return GraspRecord(frozen(time), X_WB, X_HB, frozen(normal_force), frozen(planned_force))


def connect_commands(
    builder: DiagramBuilder,
    plant: MultibodyPlant,
    instance: ModelInstanceIndex,
    time: Array,
    positions: Array,
    forces: Array | None = None,
) -> None:
    """Commands the n actuators of a model instance along time: positions, and forces on top.

    Args:
        builder: of the diagram that the plant is part of.
        plant: a finalized plant.
        instance: model instance of the actuators, fingertips' for example.
        time: of the commands [s], shape (N,); positions are cubic in between, forces linear.
        positions: of the joints [m], shape (N, n); the PD control holds to them and their speeds.
        forces: that add to it [N], shape (N, n) (default: none).
    """
    speeds = np.gradient(positions, time, axis=0)
    path = PiecewisePolynomial.CubicHermite(time, positions.T, speeds.T)
    source = builder.AddSystem(TrajectorySource(path, 1))
    builder.Connect(source.get_output_port(), plant.get_desired_state_input_port(instance))
    if forces is not None:
        feed = builder.AddSystem(
            TrajectorySource(PiecewisePolynomial.FirstOrderHold(time, forces.T))
        )
        builder.Connect(feed.get_output_port(), plant.get_actuation_input_port(instance))

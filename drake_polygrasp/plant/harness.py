"""Simulates fingertips that hold an object, and records forces and poses sample by sample."""

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
    """Returns the components of contact positions across the normals, along which fingertips slide.

    Their change is the slip of the contacts on their fingertips.

    Args:
        p_HC: contact points in H [m], shape (..., 3, 3).
        nhat_H: unit normals in H, shape (3, 3).

    Returns:
        Positions without their parts along the normals [m], shape (..., 3, 3).
    """
    along = np.einsum("...ij,ij->...i", p_HC, nhat_H)
    return np.asarray(p_HC - along[..., None] * nhat_H)


class GraspSample(NamedTuple):
    """Forces and poses at one time.

    Attributes:
        time: time [s].
        X_WB: pose of the object in the world.
        X_HB: pose of the object in the hand.
        normal_force: normal forces of the fingertips on the object [N], shape (3,).
        planned_force: normal forces that were commanded [N], shape (3,).
    """

    time: float
    X_WB: RigidTransform
    X_HB: RigidTransform
    normal_force: Array
    planned_force: Array


@dataclass(frozen=True, eq=False)
class GraspRecord:
    """Forces and poses at N times.

    Attributes:
        time: times [s], shape (N,).
        X_WB: N poses of the object in the world.
        X_HB: N poses of the object in the hand.
        normal_force: normal forces of the fingertips on the object [N], shape (N, 3).
        planned_force: normal forces that were commanded [N], shape (N, 3).
    """

    time: Array
    X_WB: tuple[RigidTransform, ...]
    X_HB: tuple[RigidTransform, ...]
    normal_force: Array
    planned_force: Array


class GraspSimulation:
    """Simulation of a diagram with fingertips in a plant, advanced from sample to sample.

        simulation = GraspSimulation(diagram, tips, visualizer)
        with simulation.recording():
            for t, force in zip(times, forces):
                simulation.advance_to(t, force)
        record = simulation.record

    Attributes:
        root_context: context of the diagram.
        context: context of the plant.
        samples: the samples so far.
    """

    def __init__(
        self, diagram: Diagram, fingertips: Fingertips, visualizer: MeshcatVisualizer | None = None
    ) -> None:
        """Starts a simulation from the diagram's default state.

        Args:
            diagram: diagram with the fingertips' plant and the systems that command them.
            fingertips: fingertips that hold the object.
            visualizer: the diagram's visualizer, to record for Meshcat (default: no recording).
        """
        self._simulator, self._visualizer = Simulator(diagram), visualizer
        self._fingertips = fingertips
        self.root_context: Context = self._simulator.get_mutable_context()
        self.context: Context = fingertips.plant.GetMyMutableContextFromRoot(self.root_context)
        self.samples: list[GraspSample] = []

    @contextmanager
    def recording(self) -> Iterator[None]:
        """Records the simulation within a `with` block for Meshcat, and publishes it at the end.

        If the object is thrown so far that Drake computes numbers that are not finite, the block
        ends early and no error is raised.

        Yields:
            None.
        """
        if self._visualizer is not None:
            self._visualizer.StartRecording()
        try:
            yield
        except RuntimeError as error:  # A thrown object ends in numbers that are not finite.
            if "finite" not in str(error) or not self.samples:
                raise
        if self._visualizer is not None:
            self._visualizer.StopRecording()
            self._visualizer.PublishRecording()

    def advance_to(self, time: float, planned_force: Array) -> GraspSample:
        """Simulates until a given time, and records a sample.

        Args:
            time: time [s], not before that of the context.
            planned_force: normal forces that are commanded [N], shape (3,).

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
        """All samples so far, at least one."""
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
    """Adds sources that command the n actuators of a model instance over time.

    Args:
        builder: builder of the diagram that the plant is part of.
        plant: a finalized plant.
        instance: model instance of the actuators, such as that of fingertips.
        time: times of the commands [s], shape (N,). Positions are interpolated by cubics, forces
            linearly.
        positions: commanded positions of the joints [m], shape (N, n); the PD control tracks them
            and their time derivatives.
        forces: forces added to those of the PD control [N], shape (N, n) (default: none).
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

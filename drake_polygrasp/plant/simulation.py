"""Simulates fingertips that hold the object under loads, in a discrete plant with Drake's contact.

Each fingertip slides on a prismatic joint along its contact's normal. A soft spring with a
commanded end pushes it with the normal force that `holding_forces` plans for the load, so the hand
redistributes forces as force closure allows. Across the normal the joint is rigid: friction has to
hold the tangential part of the load. The weight acts at the centre of mass along each axis of B, so
the hand need not turn, and each load starts from the settled squeeze.

Stiffness and speeds scale with the squeeze and with the object's diameter L.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import Meshcat, MeshcatVisualizer
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    DiscreteContactApproximation,
    ExternallyAppliedSpatialForce,
)
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.certification.holding_forces import Holding, normal_forces
from drake_polygrasp.plant.fingertips import Fingertips, add_fingertips, contact_material
from drake_polygrasp.plant.harness import GraspSimulation, tangential
from drake_polygrasp.plant.scratch_plant import (
    ScratchScene,
    add_covers,
    add_pads,
    add_surface,
    tip_spheres,
)

MAX_TIME_STEP = 1e-3
"""Longest time step [s]. Our choice."""
MIN_TIME_STEP = 5e-6
"""Shortest time step [s]. Our choice: with shorter ones, simulation would take minutes."""
MAX_SPEED_STEP = 1.0
"""Bound of squeeze times time step, over the object's mass and diameter [1/s]. Our choice: Drake's
sticking contact creeps by about a thousandth of a step's impulse over the mass, however much
friction is left. An object squeezed with a hundred times its weight would creep for numerical
reasons alone; this bound keeps such creep below a third of `MAX_CREEP`."""
BOX_MOBILITY = 7.0
"""Greatest speed per impulse at a point of a uniform box, at its corners, times its mass. An object
with greater mobility, from a small stated inertia or a far centre of mass, takes the time step of a
smaller mass."""
SAMPLE = 0.01
"""Time between samples and between changes of commands [s]. Our choice."""
SETTLE_TIME = 0.1
"""Time in which the squeeze grows, and again until the object is at rest [s]. Our choice."""
RAMP_TIME = 0.05
"""Time in which a load grows [s]. Our choice."""
HOLD_TIME = 0.1
"""Time under the full load [s]; creep is measured in its second half. Our choice."""
TIP_TRAVEL = 0.03
"""Deflection of the springs if the whole squeeze acted on one, over L. Our choice: so soft that
creep within the bounds changes no force by more than a few percent."""
CONTACT_STIFFNESS = 1000.0
"""Stiffness of contact over that of the springs. Our choice: penetration then takes a thousandth of
a spring's force."""
STICTION_SPEED = 1e-4
"""Drake's stiction tolerance over L [1/s]. Our choice: sticking contacts creep at about this speed
at 0.7 of the friction limit and ten times as fast at 0.995, so friction holds up to its limit."""
MAX_CREEP = 3e-3
"""Greatest speed of creep over L [1/s]. Our choice: an object that creeps faster slides or rolls
out of the grasp within seconds."""
MAX_SLIP = 2e-3
"""Greatest displacement of a contact across its normal under a load, over L. Our choice."""
FORCE_TOLERANCE = 0.05
"""Greatest deviation of a settled normal force from the planned one, over the mean planned force.
Our choice."""
TIP_MASS = 1.0
"""Mass of a fingertip over the object's. Our choice: fingers are no lighter than their object."""
_OBJECT_COLOUR = np.array([0.6, 0.6, 0.6, 0.5])


@dataclass(frozen=True, eq=False)
class SimulationRecord:
    """Forces and slip at N samples: first while the squeeze settles, then under each load in turn.

    Attributes:
        time: times [s], shape (N,).
        load: index of the load, -1 while the squeeze settles, shape (N,).
        slip_W: displacement of each contact across its normal since the load began [m], shape
            (N, 3, 3).
        normal_force: normal forces of the fingertips on the object [N], shape (N, 3).
        planned_force: normal forces that were commanded [N], shape (N, 3).
    """

    time: Array
    load: Ints
    slip_W: Array
    normal_force: Array
    planned_force: Array


@dataclass(frozen=True)
class SimulationOutcome:
    """Margins of a simulation: 1 minus the greatest value over its bound, negative if exceeded.

    Attributes:
        slip, creep, force: margins of `MAX_SLIP`, `MAX_CREEP` and `FORCE_TOLERANCE`.
        lost: index of the first load (-1: the squeeze alone) under which a fingertip lost contact,
            or None.
    """

    slip: float
    creep: float
    force: float
    lost: int | None

    @property
    def margin(self) -> float:
        """The least of the three margins, but at least -1; -1 if a fingertip lost contact."""
        left = min(self.slip, self.creep, self.force)
        return max(left, -1.0) if self.lost is None else -1.0


def time_step(scene: ScratchScene, squeeze: float) -> float:
    """Returns the longest time step [s] that divides `SAMPLE` and keeps numerical creep small.

    It may be below `MIN_TIME_STEP`; then the object is not simulated.

    Args:
        scene: object and grasp.
        squeeze: total normal force [N].
    """
    L = scene.object_.polyhedron.diameter
    longest = min(MAX_TIME_STEP, MAX_SPEED_STEP * _contact_mass(scene) * L / squeeze)
    return SAMPLE / math.ceil(float(SAMPLE / longest) * (1 - 1e-9))


def _contact_mass(scene: ScratchScene) -> float:
    """Returns the object's mass, or less if its mobility at a contact exceeds a box's [kg]."""
    p_BBcm, rho = scene.solid.M_BBo_B.get_com(), scene.object_.rho
    M_BBcm_B = scene.solid.M_BBo_B.Shift(p_BBcm)
    mass, inertia = M_BBcm_B.get_mass(), M_BBcm_B.CalcRotationalInertia()
    moment, axes = np.linalg.eigh(inertia.CopyToFullMatrix3())
    # Columns are torques of unit forces at each contact, shape (3, 3, 3), about principal axes.
    arm = np.cross((scene.grasp.p_BC - p_BBcm)[:, None], np.eye(3)).swapaxes(1, 2)
    torque = axes.T @ arm / np.sqrt(np.maximum(moment, 1e-12 * mass * rho**2))[:, None]
    mobility = 1.0 / mass + np.linalg.norm(torque, ord=2, axis=(1, 2)).max() ** 2
    return float(min(mass, BOX_MOBILITY / mobility))


def settings() -> dict[str, Any]:
    """Returns the parameters that all simulations share, by the names that grasp files state."""
    return {
        "contact_approximation": "lagged",
        "settle_time": 2 * SETTLE_TIME,
        "load_time": RAMP_TIME + HOLD_TIME,
        "tip_mass_per_object_mass": TIP_MASS,
        "tip_travel_per_diameter": TIP_TRAVEL,
        "contact_stiffness_ratio": CONTACT_STIFFNESS,
        "stiction_speed_per_diameter": STICTION_SPEED,
        "max_creep_per_diameter": MAX_CREEP,
        "max_slip_per_diameter": MAX_SLIP,
        "force_tolerance": FORCE_TOLERANCE,
    }


def simulate(
    scene: ScratchScene,
    squeeze_f_B: Array,
    holding: Holding,
    meshcat: Meshcat | None = None,
    refinement: int = 1,
) -> SimulationRecord:
    """Simulates fingertips that squeeze an object, and then hold it under each load.

    Args:
        scene: object and grasp, whose friction is simulated even if forces were planned with
            another.
        squeeze_f_B: contact forces on B without a load [N], shape (3, 3); their normal parts are
            commanded.
        holding: loads, and contact forces that balance each; their normal parts are commanded.
        meshcat: Meshcat in which a recording is published (default: none).
        refinement: the time step is that of `time_step` over this.

    Returns:
        The record. It ends early if the object is thrown so far that Drake computes numbers that
        are not finite.
    """
    squeeze = normal_forces(scene.grasp, squeeze_f_B)
    pushes = normal_forces(scene.grasp, holding.f_Bc_B)
    step = time_step(scene, float(squeeze.sum())) / refinement
    return _LoadTest(scene, squeeze, step, meshcat).run(holding.wrench_B, pushes)


def judge(trace: SimulationRecord, num_loads: int, diameter: float) -> SimulationOutcome:
    """Compares a simulation with the bounds of slip, creep and force.

    Args:
        trace: the simulation.
        num_loads: number of loads that it should contain; a missing one counts as lost.
        diameter: diameter L of the object [m].

    Returns:
        The margins.
    """
    slip, creep, force = 0.0, 0.0, 0.0
    half = round(HOLD_TIME / SAMPLE / 2)
    for load in range(-1, num_loads):
        rows = np.flatnonzero(trace.load == load)
        held = rows[-half:] if load < 0 else rows
        if not len(rows) or not (trace.normal_force[held] > 0).all():
            return SimulationOutcome(1.0, 1.0, 1.0, load)
        end, before = rows[-1], rows[-1 - half]
        planned = trace.planned_force[end]
        force = max(force, np.abs(trace.normal_force[end] - planned).max() / planned.mean())
        if load >= 0:
            slip = max(slip, _longest(trace.slip_W[rows]))
            run = _longest(trace.slip_W[end] - trace.slip_W[before])
            creep = max(creep, run / (half * SAMPLE))
    return SimulationOutcome(
        float(1.0 - slip / (MAX_SLIP * diameter)),
        float(1.0 - creep / (MAX_CREEP * diameter)),
        float(1.0 - force / FORCE_TOLERANCE),
        None,
    )


def _longest(vectors: Array) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max())


class _LoadTest:
    """Simulation of object and fingertips under loads, sample by sample."""

    def __init__(
        self, scene: ScratchScene, squeeze: Array, step: float, meshcat: Meshcat | None
    ) -> None:
        self._scene, self._squeeze = scene, squeeze
        self._stiffness = float(squeeze.sum()) / (TIP_TRAVEL * scene.object_.polyhedron.diameter)
        builder = DiagramBuilder()
        self._plant, scene_graph = AddMultibodyPlantSceneGraph(builder, step)
        self._fingertips = self._add_bodies()
        self._finish_plant()
        visualizer = None
        if meshcat is not None:
            visualizer = MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
        self._simulation = GraspSimulation(builder.Build(), self._fingertips, visualizer)
        self._loads: list[int] = []
        self._slip_W: list[Array] = []

    def _add_bodies(self) -> Fingertips:
        plant, scene, stiffness = self._plant, self._scene, self._stiffness
        # Two equal surfaces in series have half the stiffness of one.
        contact = 2.0 * CONTACT_STIFFNESS * stiffness
        body = plant.AddRigidBody("object", scene.solid.M_BBo_B)
        covers = [(shape, X_BG) for _, shape, X_BG in scene.solid.covers]
        for k, (shape, X_BG) in enumerate((*scene.solid.parts, *covers)):
            plant.RegisterVisualGeometry(body, X_BG, shape, f"surface_{k}", _OBJECT_COLOUR)
        # Point contact uses a mesh's convex hull, which fills notches.
        on_pads = not scene.solid.is_hulls
        if on_pads:
            add_pads(plant, body, scene, contact)
        else:
            add_surface(plant, body, scene, contact)
            add_covers(plant, body, scene, contact)
        return add_fingertips(
            plant,
            body,
            tip_spheres(scene, on_pad=on_pads),
            mass=TIP_MASS * scene.solid.M_BBo_B.get_mass(),
            stiffness=stiffness,
            material=partial(contact_material, point_stiffness=contact),
        )

    def _finish_plant(self) -> None:
        plant = self._plant
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
        plant.SetUseSampledOutputPorts(False)
        # The object's weight is a load.
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        plant.Finalize()
        plant.set_stiction_tolerance(STICTION_SPEED * self._scene.object_.polyhedron.diameter)

    def run(self, wrench_B: Array, pushes: Array) -> SimulationRecord:
        """Simulates the squeeze, then loads wrench_B (K, 6) with commanded forces (K, 3) [N]."""
        with self._simulation.recording():
            self._settle()
            context = self._simulation.root_context
            settled = context.get_discrete_state_vector().CopyToVector()
            for load, (wrench, push) in enumerate(zip(wrench_B, pushes, strict=True)):
                context.SetDiscreteState(settled)
                self._hold(load, wrench, push)
        record = self._simulation.record
        return SimulationRecord(
            record.time,
            frozen(self._loads, np.int64),
            frozen(self._slip_W),
            record.normal_force,
            record.planned_force,
        )

    def _settle(self) -> None:
        start = self._tangential(self._object_pose())
        for k in range(round(2 * SETTLE_TIME / SAMPLE)):
            share = min(1.0, (k + 1) * SAMPLE / SETTLE_TIME)
            self._step(-1, np.zeros(6), share * self._squeeze, start)

    def _hold(self, load: int, wrench: Array, push: Array) -> None:
        start = self._tangential(self._object_pose())
        for k in range(round((RAMP_TIME + HOLD_TIME) / SAMPLE)):
            share = min(1.0, (k + 1) * SAMPLE / RAMP_TIME)
            command = self._squeeze + share * (push - self._squeeze)
            self._step(load, share * wrench, command, start)

    def _step(self, load: int, wrench: Array, push: Array, start: Array) -> None:
        plant, tips, simulation = self._plant, self._fingertips, self._simulation
        force = ExternallyAppliedSpatialForce()
        force.body_index = tips.body.index()
        force.p_BoBq_B = self._scene.object_.p_BBcm
        force.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
        plant.get_applied_spatial_force_input_port().FixValue(simulation.context, Value([force]))
        desired = np.append(push / self._stiffness, np.zeros(3))
        plant.get_desired_state_input_port(tips.instance).FixValue(simulation.context, desired)
        sample = simulation.advance_to(simulation.root_context.get_time() + SAMPLE, push)
        self._loads.append(load)
        self._slip_W.append(self._tangential(sample.X_HB) - start)

    def _object_pose(self) -> RigidTransform:
        return self._fingertips.X_HB(self._simulation.context)

    def _tangential(self, X_WB: RigidTransform) -> Array:
        """Returns the positions of B's contacts across the normals along which tips slide [m]."""
        grasp = self._scene.grasp
        return tangential(X_WB.multiply(grasp.p_BC.T).T, grasp.nhat_TB_B)

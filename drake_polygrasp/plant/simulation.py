"""Fingertips that hold the object through time, in discrete time with Drake's own contact.

Each tip slides on a prismatic joint along its contact's normal; a soft spring, whose far end is
commanded, pushes it with the force that `holding_forces` plans for the load at hand, so the hand
redistributes forces as force closure promises it can. Sideways the joint is rigid: friction has
to bear what the normal forces leave. Gravity acts as the object's weight at its centre of mass,
turned instead of the hand, and each load starts again from the settled squeeze.

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
"""[s]"""
MIN_TIME_STEP = 5e-6
"""[s], ours: where contact bears only shorter steps, simulation would take minutes."""
MAX_SPEED_STEP = 1.0
"""[1/s], ours: of the squeeze times the time step, over the object's mass and diameter. Drake's
contact gives way, however much friction is left, at about a thousandth of the impulse of a step
over the mass, so that what is squeezed a hundred times as hard as it weighs creeps for numerical
reasons alone; such steps keep that below a third of `MAX_CREEP`."""
BOX_MOBILITY = 7.0
"""Over the mass: how much speed an impulse at a contact gives a uniform box there at most, at its
corners. What turns more easily, by a small stated inertia or a far centre of mass, takes steps as
a lesser mass."""
SAMPLE = 0.01
"""[s] between samples, at which commands change too."""
SETTLE_TIME = 0.1
"""[s] to build up the squeeze, and as long again to come to rest."""
RAMP_TIME = 0.05
"""[s] for a load to grow."""
HOLD_TIME = 0.1
"""[s] under the whole load; creep is measured in its second half."""
TIP_TRAVEL = 0.03
"""Times L, ours: how far the squeeze would push a tip against its spring. That is so soft that an
object which creeps within the bounds changes no force by more than a few percent."""
CONTACT_STIFFNESS = 1000.0
"""Times the spring's, ours: contact takes a thousandth of the spring's travel from its force."""
STICTION_SPEED = 1e-4
"""[L/s], ours: sticking contacts creep about this fast at 0.7 of their friction, and ten times as
fast at 0.995: up to its limit, as Coulomb's, friction holds."""
MAX_CREEP = 3e-3
"""[L/s], ours: what creeps faster slides or rolls out of the grasp within seconds."""
MAX_SLIP = 2e-3
"""Times L, ours: what a load may add to the sideways motion of a contact on its tip."""
FORCE_TOLERANCE = 0.05
"""Ours: settled normal forces are within this of those planned, relative to their mean."""
TIP_MASS = 1.0
"""Times the object's, ours: fingers are no lighter than what they hold."""
_OBJECT_COLOUR = np.array([0.6, 0.6, 0.6, 0.5])


@dataclass(frozen=True, eq=False)
class SimulationRecord:
    """What happened, N samples: first the settling, then every load in turn.

    Attributes:
        time: [s], shape (N,).
        load: index of the load, -1 while settling, shape (N,).
        slip_W: how far each contact has moved sideways on its tip since the load began [m], (N, 3,
            3).
        normal_force: of tips on the object [N], shape (N, 3).
        planned_force: the normal force that each tip was commanded [N], shape (N, 3).
    """

    time: Array
    load: Ints
    slip_W: Array
    normal_force: Array
    planned_force: Array


@dataclass(frozen=True)
class SimulationOutcome:
    """What the worst load leaves of each bound, as a share of it; negative where exceeded.

    Attributes:
        slip, creep, force: what is left of `MAX_SLIP`, `MAX_CREEP` and `FORCE_TOLERANCE`.
        lost: the first load (-1: the squeeze alone) under which a tip lost the object.
    """

    slip: float
    creep: float
    force: float
    lost: int | None

    @property
    def margin(self) -> float:
        """What is left of the tightest bound; -1 where it is exceeded twofold or a tip is lost."""
        left = min(self.slip, self.creep, self.force)
        return max(left, -1.0) if self.lost is None else -1.0


def time_step(scene: ScratchScene, squeeze: float) -> float:
    """Returns the time step [s]: the longest that divides `SAMPLE` and that Drake's contact bears.

    One below `MIN_TIME_STEP` is for no simulation.

    Args:
        scene: object and fingertips.
        squeeze: total normal force [N].
    """
    L = scene.object_.polyhedron.diameter
    longest = min(MAX_TIME_STEP, MAX_SPEED_STEP * _contact_mass(scene) * L / squeeze)
    return SAMPLE / math.ceil(float(SAMPLE / longest) * (1 - 1e-9))


def _contact_mass(scene: ScratchScene) -> float:
    """The object's mass, or less where impulses at its contacts turn it more than a box [kg]."""
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
    """The parameters that all simulations share, for reports."""
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
    scene: ScratchScene, squeeze_f_B: Array, holding: Holding, meshcat: Meshcat | None = None
) -> SimulationRecord:
    """Squeeze an object, and load it.

    The trace ends early where the object is lost beyond what Drake can compute.

    Args:
        scene: object and fingertips; its friction counts, whatever the forces were planned with.
        squeeze_f_B: forces planned on B without a load [N], shape (3, 3); their normal parts are
            commanded.
        holding: the loads, and the forces planned against them.
        meshcat: the caller's own, where a recording is published.
    """
    squeeze = normal_forces(scene.grasp, squeeze_f_B)
    pushes = normal_forces(scene.grasp, holding.f_Bc_B)
    return _LoadTest(scene, squeeze, meshcat).run(holding.wrench_B, pushes)


def judge(trace: SimulationRecord, num_loads: int, diameter: float) -> SimulationOutcome:
    """Hold a trace under `num_loads` loads against the bounds, for an object of `diameter` [m]."""
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
    """A diagram of object and fingertips, loaded sample by sample."""

    def __init__(self, scene: ScratchScene, squeeze: Array, meshcat: Meshcat | None) -> None:
        self._scene, self._squeeze = scene, squeeze
        self._stiffness = float(squeeze.sum()) / (TIP_TRAVEL * scene.object_.polyhedron.diameter)
        builder = DiagramBuilder()
        step = time_step(scene, float(squeeze.sum()))
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
        # Two surfaces in series.
        contact = 2.0 * CONTACT_STIFFNESS * stiffness
        body = plant.AddRigidBody("object", scene.solid.M_BBo_B)
        covers = [(shape, X_BG) for _, shape, X_BG in scene.solid.covers]
        for k, (shape, X_BG) in enumerate((*scene.solid.parts, *covers)):
            plant.RegisterVisualGeometry(body, X_BG, shape, f"surface_{k}", _OBJECT_COLOUR)
        # Point contact would fill the notches of what is not convex.
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
        """Settle, then every load of wrench_B, shape (K, 6), against pushes [N], shape (K, 3)."""
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
        """Where the contacts fixed in B are, across the normals along which tips slide [m]."""
        grasp = self._scene.grasp
        return tangential(X_WB.multiply(grasp.p_BC.T).T, grasp.nhat_TB_B)

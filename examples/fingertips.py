"""A plant with a table, an object and three fingertips on a carriage.

The carriage H moves along x, y and z of the world W and holds to its commands stiffly. Each tip T
slides on it along the normal of its contact, pushed by a commanded force and drawn by a soft spring
to a commanded position; sideways it is rigid. Contact is hydroelastic: the object is rigid, with
its true surface, tips and table are compliant. A tip's contact is a small disc, not a point: it
also resists twisting, by about a tenth of what friction times a tip's radius would.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    AddCompliantHydroelasticProperties,
    AddContactMaterial,
    Box,
    GeometryId,
    Meshcat,
    MeshcatVisualizer,
    ProximityProperties,
    SceneGraph,
    SceneGraphConfig,
    Sphere,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
    MultibodyPlant,
)
from pydrake.multibody.tree import (
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RigidBody,
    SpatialInertia,
)
from pydrake.systems.framework import Context, Diagram, DiagramBuilder
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import ModelError
from drake_polygrasp.loading.packages import find_packages, use_packages
from drake_polygrasp.loading.parsed_model import drake_errors_as_model_errors
from drake_polygrasp.visualization.palette import CONTACTS, rgb

TIME_STEP = 1e-3
"""[s]"""
STICTION_SPEED = 1e-5
"""[m/s]: what sticks creeps more slowly."""
DISSIPATION = 1.0
"""[s/m], Hunt & Crossley's, of object and tips."""
TIP_MASS = 0.05
"""[kg]"""
TIP_PENETRATION = 0.02
"""Times a tip's radius, under the mean force."""
CARRIAGE_STIFFNESS = 1e6
"""[N/m]"""
TABLE_MU = 0.5
TABLE_MODULUS = 3e5
"""[Pa], of a rubber mat: time steps of a millisecond let light objects rattle on harder ones."""
TABLE_DISSIPATION = 50.0
"""[s/m]"""
_TABLE_COLOUR = np.array([0.8, 0.72, 0.6, 1.0])


@dataclass(frozen=True, eq=False)
class Fingertips:
    """Three spheres, where they touch the object."""

    p_WT: Array
    """Centres [m], shape (3, 3)."""
    nhat_W: Array
    """Into the object, shape (3, 3)."""
    mu: Array
    """Of their surfaces, shape (3,)."""
    radius: float
    """[m]"""
    mean_force: float
    """That they are made for [N]."""
    stiffness: float
    """Of the springs along the normals [N/m]."""


@dataclass(frozen=True, eq=False)
class Commands:
    """What the hand is told, N samples."""

    time: Array
    """[s], shape (N,)."""
    p_WH: Array
    """Where the carriage H goes, which starts at W [m], shape (N, 3)."""
    gap: Array
    """How far the springs hold the tips off [m], shape (N,)."""
    push: Array
    """Forces along the normals [N], shape (N, 3)."""

    @property
    def positions(self) -> Array:
        """Of the carriage's joints and of the tips' [m], shape (N, 6)."""
        return np.column_stack([self.p_WH, *[-self.gap] * 3])


@dataclass(frozen=True, eq=False)
class Scene:
    """A diagram of all that there is."""

    diagram: Diagram
    plant: MultibodyPlant
    body: RigidBody
    """The object B."""
    tips: tuple[GeometryId, ...]
    visualizer: MeshcatVisualizer | None

    def X_WB(self, context: Context) -> RigidTransform:
        """The object's pose, of the plant's context."""
        return self.plant.EvalBodyPoseInWorld(context, self.body)

    def pushes(self, context: Context, nhat_W: Array) -> Array:
        """Of the tips on the object, along nhat_W, shape (3, 3), [N], shape (3,)."""
        results = self.plant.get_contact_results_output_port().Eval(context)
        surface = set(self.plant.GetCollisionGeometriesForBody(self.body))
        f_Bc_W = np.zeros((3, 3))
        for k in range(results.num_hydroelastic_contacts()):
            info = results.hydroelastic_contact_info(k)
            M, N = info.contact_surface().id_M(), info.contact_surface().id_N()
            # Drake reports the force on the body of M.
            if M in surface and N in self.tips:
                f_Bc_W[self.tips.index(N)] += info.F_Ac_W().translational()
            elif N in surface and M in self.tips:
                f_Bc_W[self.tips.index(M)] -= info.F_Ac_W().translational()
        return np.asarray((f_Bc_W * nhat_W).sum(axis=1))


def build_scene(
    model_file: Path,
    tips: Fingertips | None = None,
    commands: Commands | None = None,
    meshcat: Meshcat | None = None,
) -> Scene:
    """An object on a table whose top is at z = 0, and fingertips that follow commands, if any.

    Raises ModelError when the model cannot be read, or is not one body that may move and be held.
    """
    builder = DiagramBuilder()
    plant, scene_graph = AddMultibodyPlantSceneGraph(builder, TIME_STEP)
    plant.set_contact_model(ContactModel.kHydroelastic)
    plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
    _make_rigid_by_default(scene_graph)
    body = _add_object(plant, model_file)
    _add_table(plant)
    ids = () if tips is None else _add_hand(plant, tips)
    plant.Finalize()
    _check_free(body, model_file)
    plant.set_stiction_tolerance(STICTION_SPEED)
    if commands is not None:
        _connect(builder, plant, commands)
    visualizer = None
    if meshcat is not None:
        visualizer = MeshcatVisualizer.AddToBuilder(builder, scene_graph, meshcat)
    return Scene(builder.Build(), plant, body, ids, visualizer)


def _make_rigid_by_default(scene_graph: SceneGraph) -> None:
    config = SceneGraphConfig()
    config.default_proximity_properties.compliance_type = "rigid"
    config.default_proximity_properties.hunt_crossley_dissipation = DISSIPATION
    scene_graph.set_config(config)


def _add_object(plant: MultibodyPlant, model_file: Path) -> RigidBody:
    # Prefixed, lest a model be named as the hand is.
    parser = Parser(plant, model_name_prefix="object")
    use_packages(parser, find_packages(model_file))
    with drake_errors_as_model_errors(model_file):
        models = parser.AddModels(str(model_file))
    bodies = [plant.get_body(index) for model in models for index in plant.GetBodyIndices(model)]
    solid = [body for body in bodies if plant.GetCollisionGeometriesForBody(body)]
    if not solid:
        raise ModelError(
            f"{model_file}: no collision geometry; a grasp needs what fingers can touch"
        )
    if len(solid) > 1:
        names = ", ".join(f"'{body.name()}'" for body in solid)
        raise ModelError(f"{model_file} has several bodies to pick up: {names}; leave one of them")
    return solid[0]


def _check_free(body: RigidBody, model_file: Path) -> None:
    if not body.is_floating_base_body():
        raise ModelError(f"{model_file}: '{body.name()}' is fixed; remove what holds it")
    if not np.linalg.eigvalsh(body.default_spatial_inertia().CopyToFullMatrix6()).min() > 0:
        raise ModelError(f"{model_file}: '{body.name()}' has no mass or inertia; state both")


def _add_table(plant: MultibodyPlant) -> None:
    world, top, X_WG = plant.world_body(), Box(0.8, 0.8, 0.04), RigidTransform([0.0, 0.0, -0.02])
    material = _compliant(TABLE_MODULUS, 0.04, TABLE_MU, TABLE_DISSIPATION)
    plant.RegisterCollisionGeometry(world, X_WG, top, "table", material)
    plant.RegisterVisualGeometry(world, X_WG, top, "table", _TABLE_COLOUR)


def _add_hand(plant: MultibodyPlant, tips: Fingertips) -> tuple[GeometryId, ...]:
    hand = plant.AddModelInstance("hand")
    carriage = plant.world_body()
    for name, axis in zip(("x", "y", "carriage"), np.eye(3), strict=True):
        carriage = _add_slide(plant, hand, name, carriage, axis, 1.0, CARRIAGE_STIFFNESS)
    # A ball's pressure is modulus times penetration over radius, on a disc of that penetration.
    modulus = tips.mean_force / (np.pi * (TIP_PENETRATION * tips.radius) ** 2)
    ids = []
    for i, (p_WT, nhat_W) in enumerate(zip(tips.p_WT, tips.nhat_W, strict=True)):
        name, shape, X_TS = f"tip_{i + 1}", Sphere(tips.radius), RigidTransform(p_WT)
        tip = _add_slide(plant, hand, name, carriage, nhat_W, TIP_MASS, tips.stiffness)
        material = _compliant(modulus, tips.radius, float(tips.mu[i]))
        ids.append(plant.RegisterCollisionGeometry(tip, X_TS, shape, name, material))
        colour = np.array([*rgb(CONTACTS[i]), 1.0])
        plant.RegisterVisualGeometry(tip, X_TS, shape, name, colour)
    # It bears itself.
    plant.set_gravity_enabled(hand, False)
    return tuple(ids)


def _add_slide(
    plant: MultibodyPlant,
    hand: ModelInstanceIndex,
    name: str,
    parent: RigidBody,
    axis: Array,
    mass: float,
    stiffness: float,
) -> RigidBody:
    """A body that a spring and a damper hold on a prismatic joint."""
    body = plant.AddRigidBody(name, hand, SpatialInertia.SolidSphereWithMass(mass, 0.01))
    joint = plant.AddJoint(PrismaticJoint(name, parent.body_frame(), body.body_frame(), axis))
    gains = PdControllerGains(p=stiffness, d=2.0 * np.sqrt(stiffness * mass))
    plant.AddJointActuator(name, joint).set_controller_gains(gains)
    return body


def _compliant(
    modulus: float, resolution: float, mu: float, dissipation: float = DISSIPATION
) -> ProximityProperties:
    properties = ProximityProperties()
    AddCompliantHydroelasticProperties(resolution, modulus, properties)
    # Static and dynamic alike: Drake's discrete contact knows the latter only.
    friction = CoulombFriction(mu, mu)
    AddContactMaterial(dissipation=dissipation, friction=friction, properties=properties)
    return properties


def _connect(builder: DiagramBuilder, plant: MultibodyPlant, commands: Commands) -> None:
    hand, time = plant.GetModelInstanceByName("hand"), commands.time
    q = commands.positions
    path = PiecewisePolynomial.CubicHermite(time, q.T, np.gradient(q, time, axis=0).T)
    u = np.hstack([np.zeros((len(time), 3)), commands.push])
    force = PiecewisePolynomial.FirstOrderHold(time, u.T)
    position_source = builder.AddSystem(TrajectorySource(path, 1))
    force_source = builder.AddSystem(TrajectorySource(force))
    builder.Connect(position_source.get_output_port(), plant.get_desired_state_input_port(hand))
    builder.Connect(force_source.get_output_port(), plant.get_actuation_input_port(hand))

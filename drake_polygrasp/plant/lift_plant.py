"""A plant in which a whole hand lifts an object: two carriages, the hand, the object, its supports.

The palm moves on two prismatic joints, along its way and then up. The object stands on small
spheres under its support polygon; where it would fall over, it has no weight until that is applied.
"""

from __future__ import annotations

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    Meshcat,
    MeshcatVisualizer,
    RoleAssign,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.math import SpatialForce
from pydrake.multibody.plant import (
    AddMultibodyPlantSceneGraph,
    ContactModel,
    DiscreteContactApproximation,
    ExternallyAppliedSpatialForce,
)
from pydrake.multibody.tree import RigidBody, SpatialInertia
from pydrake.systems.framework import Context, DiagramBuilder

from drake_polygrasp.arrays import Array
from drake_polygrasp.certification.robustness import GRAVITY
from drake_polygrasp.geometry.triangles import face_frame
from drake_polygrasp.hand_grasp import HandPlacement
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.in_plant import HandInPlant
from drake_polygrasp.plant.fingertips import (
    add_slider,
    contact_forces,
    contact_material,
    fingertip_friction,
)
from drake_polygrasp.plant.hand_control import add_hand_actuators
from drake_polygrasp.plant.scratch_plant import ScratchScene, add_pads
from drake_polygrasp.plant.supports import SUPPORT_RADIUS, support_points

TIME_STEP = 2e-3
"""Time step [s]. Our choice: half of it changes no verdict on our models."""
STICTION = 1e-4
"""Drake's stiction tolerance [m/s]. Our choice: tips creep by less than a tenth of a millimetre
while they hold; by ten times as much with the convex approximation of friction (SAP)."""
POINT_STIFFNESS = 1e5
"""Stiffness of contact [N/m]. Our choice: fingertips penetrate by a tenth of a millimetre."""
CARRIAGE_MASS, CARRIAGE_STIFFNESS = 1.0, 1e5
"""Of the palm's prismatic joints [kg, N/m]. Our choice: they yield by micrometres."""
_COLOUR = np.array([0.6, 0.6, 0.6, 0.7])


class LiftPlant:
    """A plant with a hand on two carriages and the object that it lifts. Up is z of the world.

    Attributes:
        builder: builder of the diagram that the plant is part of.
        plant: the plant, finalized.
        model: the hand's elements in it.
        carriages: model instance of the palm's joints "way" and "rise".
        body: body B of the object.
        X_WB: pose of the object before it is lifted.
        stood: whether the object stands on supports; otherwise gravity does not act on it.
        on_pads: whether tips touch pads in place of the object's surface, which is no hull.
        visualizer: publishes to Meshcat; None without one.
    """

    def __init__(
        self,
        scene: ScratchScene,
        hand: Hand,
        placement: HandPlacement,
        mass: float,
        meshcat: Meshcat | None,
    ) -> None:
        """Builds the plant.

        Args:
            scene: object and grasp, with the friction that is simulated.
            hand: the hand, which nothing holds in its model.
            placement: how it holds the object.
            mass: mass of the object [kg].
            meshcat: Meshcat to publish to; None for none.
        """
        self._scene, self._hand, self._placement, self._mass = scene, hand, placement, mass
        up_B = placement.torque.up_B
        up_B = placement.pregrasp.direction_B if up_B is None else up_B
        supports = support_points(scene.object_, up_B)
        self.stood = supports is not None
        frame = face_frame(up_B).T
        self.X_WB = RigidTransform(RotationMatrix.ProjectToRotationMatrix(frame))
        self.builder = DiagramBuilder()
        self.plant, self._scene_graph = AddMultibodyPlantSceneGraph(self.builder, TIME_STEP)
        self._supports: list[GeometryId] = []
        self.body = self._add_object()
        self.model = self._add_hand()
        self.on_pads = bool(self._pads)
        if supports is not None:
            self._add_supports(supports)
        self._finish(meshcat)

    def _add_object(self) -> RigidBody:
        plant, scene = self.plant, self._scene
        instance = plant.AddModelInstance("grasped_object")
        M_BBo_B = scene.solid.M_BBo_B
        inertia = SpatialInertia(
            self._mass, M_BBo_B.get_com(), M_BBo_B.get_unit_inertia(), skip_validity_check=True
        )
        body = plant.AddRigidBody("grasped_object", instance, inertia)
        covers = [(shape, X_BG) for _, shape, X_BG in scene.solid.covers]
        parts = [*scene.solid.parts, *covers]
        material = contact_material(scene.mu_object, point_stiffness=POINT_STIFFNESS)
        for k, (shape, X_BG) in enumerate(parts):
            plant.RegisterVisualGeometry(body, X_BG, shape, f"surface_{k}", _COLOUR)
        self._surface = [
            plant.RegisterCollisionGeometry(body, X_BG, shape, f"surface_{k}", material)
            for k, (shape, X_BG) in enumerate(parts)
        ]
        self._pads: list[GeometryId] = []
        if not scene.solid.is_hulls:
            self._pads = add_pads(plant, body, scene, POINT_STIFFNESS)
        return body

    def _add_hand(self) -> HandInPlant:
        plant, hand, placement = self.plant, self._hand, self._placement
        model = hand.add_to(plant, self._scene_graph, weld_root=False)
        plant.set_gravity_enabled(model.instance, False)
        add_hand_actuators(hand, plant, model.instance)
        self.carriages = plant.AddModelInstance("carriages")
        plant.set_gravity_enabled(self.carriages, False)
        R_WB = self.X_WB.rotation()
        way_W = R_WB @ placement.pregrasp.direction_B
        drive = CARRIAGE_MASS, CARRIAGE_STIFFNESS
        world, z = plant.world_body(), np.array([0.0, 0.0, 1.0])
        way = add_slider(plant, self.carriages, "way", world, way_W, *drive)
        rise = add_slider(plant, self.carriages, "rise", way, z, *drive)
        context = hand.set_positions(hand.joint_array(placement.q))
        palm, root = hand.in_plant.palm, hand.in_plant.root
        X_PalmRoot = root.body_frame().CalcPose(context, palm)
        X_WRoot = self.X_WB @ placement.X_BPalm @ X_PalmRoot
        plant.WeldFrames(rise.body_frame(), model.root.body_frame(), X_WRoot)
        self._set_friction(model)
        return model

    def _set_friction(self, model: HandInPlant) -> None:
        """Gives used tips the friction that their pair with the object has at the contacts."""
        scene, plant = self._scene, self.plant
        of_tips = fingertip_friction(scene.grasp.mu, scene.mu_object)
        names = [tip.name for tip in self._hand.tips]
        self._used = [names.index(name) for name in self._placement.fingers]
        self._tips = [frozenset(model.tip_geometries[k]) for k in self._used]
        for index in plant.GetBodyIndices(model.instance):
            for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index)):
                own = scene.mu_object
                for i, tip in enumerate(self._tips):
                    if geometry in tip:
                        own = float(of_tips[i])
                material = contact_material(own, point_stiffness=POINT_STIFFNESS)
                self._scene_graph.AssignRole(
                    plant.get_source_id(), geometry, material, RoleAssign.kReplace
                )

    def _add_supports(self, p_BS: Array) -> None:
        """Adds spheres that carry the object and touch nothing else."""
        plant, world = self.plant, self.plant.world_body()
        material = contact_material(self._scene.mu_object, point_stiffness=POINT_STIFFNESS)
        below = np.array([0.0, 0.0, -SUPPORT_RADIUS])
        self._supports = [
            plant.RegisterCollisionGeometry(
                world,
                RigidTransform(self.X_WB @ p + below),
                Sphere(SUPPORT_RADIUS),
                f"support_{k}",
                material,
            )
            for k, p in enumerate(p_BS)
        ]

    def _finish(self, meshcat: Meshcat | None) -> None:
        plant = self.plant
        plant.set_contact_model(ContactModel.kPoint)
        plant.set_discrete_contact_approximation(DiscreteContactApproximation.kLagged)
        plant.SetUseSampledOutputPorts(False)
        plant.mutable_gravity_field().set_gravity_vector([0.0, 0.0, -GRAVITY])
        if not self.stood:
            plant.set_gravity_enabled(self.body.model_instance(), False)
        plant.Finalize()
        plant.set_stiction_tolerance(STICTION)
        self._filter_collisions()
        self.visualizer = None
        if meshcat is not None:
            self.visualizer = MeshcatVisualizer.AddToBuilder(
                self.builder, self._scene_graph, meshcat
            )

    def contacts_in_tips(self, context: Context) -> Array:
        """Returns where the object's contacts are in the frames of their tips [m], shape (3, 3).

        Args:
            context: context of the plant.
        """
        X_WB = self.plant.EvalBodyPoseInWorld(context, self.body)
        p_WC = (X_WB @ self._scene.grasp.p_BC.T).T
        frames = [self.model.tip_frames[k] for k in self._used]
        return np.array(
            [
                frame.CalcPoseInWorld(context).inverse() @ p
                for frame, p in zip(frames, p_WC, strict=True)
            ]
        )

    def _filter_collisions(self) -> None:
        """Supports carry the object alone; where there are pads, tips touch these alone."""
        plant = self.plant
        surface, pads = GeometrySet(self._surface), GeometrySet(self._pads)
        hand = GeometrySet(
            [
                geometry
                for index in plant.GetBodyIndices(self.model.instance)
                for geometry in plant.GetCollisionGeometriesForBody(plant.get_body(index))
            ]
        )
        supports = GeometrySet(self._supports)
        filters = CollisionFilterDeclaration().ExcludeBetween(supports, hand)
        filters.ExcludeBetween(supports, pads)
        if self._pads:
            filters.ExcludeBetween(surface, hand)
        self._scene_graph.collision_filter_manager().Apply(filters)

    def height(self, context: Context) -> float:
        """Returns the height of the object's centre of mass [m].

        Args:
            context: context of the plant.
        """
        X_WB = self.plant.EvalBodyPoseInWorld(context, self.body)
        return float((X_WB @ self._scene.object_.p_BBcm)[2])

    def put_weight(self, context: Context, share: float) -> None:
        """Applies a share of its weight to an object that does not stand.

        Args:
            context: context of the plant.
            share: share of the weight.
        """
        if self.stood:
            return
        weight = ExternallyAppliedSpatialForce()
        weight.body_index = self.body.index()
        weight.p_BoBq_B = self._scene.object_.p_BBcm
        force = np.array([0.0, 0.0, -share * self._mass * GRAVITY])
        weight.F_Bq_W = SpatialForce(tau=np.zeros(3), f=force)
        port = self.plant.get_applied_spatial_force_input_port()
        port.FixValue(context, Value([weight]))

    def touching(self, context: Context) -> tuple[bool, bool, bool]:
        """Returns whether each tip pushes on the object.

        Args:
            context: context of the plant.
        """
        on_object = {*(self._pads or self._surface)}
        pairs = [
            {source, target}
            for source, target, _ in contact_forces(
                self.plant.get_contact_results_output_port().Eval(context)
            )
        ]
        first, second, third = (
            any(pair & tip and pair & on_object for pair in pairs) for tip in self._tips
        )
        return first, second, third

"""A hand, an object and what is around it in one scratch plant, for distances and kinematics."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from pydrake.geometry import (
    Box,
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    HalfSpace,
    ProximityProperties,
    QueryObject,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.multibody.tree import JacobianWrtVariable, RigidBody, SpatialInertia
from pydrake.systems.framework import Context, DiagramBuilder

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.errors import ModelError
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.hands.hand import Hand
from drake_polygrasp.hands.in_plant import HandInPlant
from drake_polygrasp.loading.object_model import load_solid
from drake_polygrasp.loading.surroundings import Surroundings

FAR = 0.05
"""Distances above this are not measured [m]. Our choice."""
_GROUND = 4.0
"""Width of the box that stands for a half-space, of which Drake measures few distances [m]. Our
choice: wider than any reach of a hand from its object."""

Fingers = tuple[int, int, int]
"""Indices of the tips that touch contacts 1, 2 and 3."""
Pairs = Sequence[tuple[GeometryId, GeometryId]]


class HandScene:
    """One plant with a hand whose root is fixed, and a body B that carries all that is around it.

    The body moves relative to the hand, so that models whose root is welded to the world can be
    posed like others. Tips that touch the object are left out of its collisions: each triple of
    tips has a context of its own with those filters.

    Attributes:
        hand: the hand.
        object_: the object.
        surroundings: names of what is around the object.
        plant: the plant, finalized.
        model: the hand's elements in it.
        body: body B.
        q_indices: where the positions of `hand.joints` are in the plant's, shape (n,).
        independent: positions of the independent joints among `hand.joints`, shape (k,).
        misfits: how far the geometry of each tip reaches beyond its sphere [m], shape (T,).
    """

    def __init__(
        self,
        hand: Hand,
        object_: GraspObject,
        *,
        surroundings: Surroundings | None = None,
        package_paths: Sequence[str | Path] = (),
        packages: Mapping[str, str | Path] | None = None,
    ) -> None:
        """Builds the plant.

        Args:
            hand: the hand.
            object_: the object, loaded from a file.
            surroundings: other bodies of the scene, at their poses in B (default: none).
            package_paths: folders searched for the packages of package:// URIs.
            packages: folders of packages by name.

        Raises:
            ModelError: when the object came from no file, or the file cannot be read again.
            HandError: when the hand's model cannot be read again.
        """
        if object_.source is None:
            raise ModelError(
                "to pose a hand, the object is loaded again from its own file, and it has none; "
                "give object_from_plant the body's model_file"
            )
        self.hand, self.object_ = hand, object_
        self.surroundings = () if surroundings is None else surroundings.names
        builder = DiagramBuilder()
        # Discrete, since plants in continuous time refuse the couplings of some hands.
        self.plant, self._scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
        self.model: HandInPlant = hand.add_to(self.plant, self._scene_graph)
        instance = self.plant.AddModelInstance("drake_polygrasp_object")
        inertia = SpatialInertia.SolidSphereWithMass(1.0, 0.1)
        self.body: RigidBody = self.plant.AddRigidBody("object", instance, inertia)
        solid = load_solid(object_.source, package_paths, packages)
        covers = [(shape, X_BG) for _, shape, X_BG in solid.covers]
        parts = () if surroundings is None else surroundings.parts
        around = [*covers, *((shape, X_BG) for _, shape, X_BG in parts)]
        self._object_ids = [self._add(shape, X_BG) for shape, X_BG in solid.parts]
        self._around_ids = [self._add(*_measurable(shape, X_BG)) for shape, X_BG in around]
        self.plant.Finalize()
        self._diagram = builder.Build()
        joints = {joint.name(): joint for joint in self.model.joints}
        ordered = [joints[name] for name in hand.joints]
        self.q_indices: Ints = np.array([joint.position_start() for joint in ordered])
        self._v_indices: Ints = np.array([joint.velocity_start() for joint in ordered])
        self.independent: Ints = np.array([hand.joints.index(name) for name in hand.independent])
        self.misfits = tuple(max(0.0, -tip.fit.least) for tip in hand.tips)
        self._contexts: dict[frozenset[int], Context] = {}
        self._roots: list[Context] = []
        self._tip_ids = [frozenset(ids) for ids in self.model.tip_geometries]
        self._link_ids = [self._geometries_of(body) for body in self.model.tip_bodies]

    def _add(self, shape: Shape, X_BG: RigidTransform) -> GeometryId:
        count = self.plant.num_collision_geometries()
        return self.plant.RegisterCollisionGeometry(
            self.body, X_BG, shape, f"part_{count}", ProximityProperties()
        )

    def _geometries_of(self, body: RigidBody) -> list[GeometryId]:
        """Returns the collision geometries of a tip's body and of bodies that are fixed to it."""
        return [
            geometry
            for fixed in self.plant.GetBodiesWeldedTo(body)
            for geometry in self.plant.GetCollisionGeometriesForBody(fixed)
        ]

    def context(self, fingers: Sequence[int] = ()) -> Context:
        """Returns the plant's context in which given tips may touch the object.

        Args:
            fingers: indices of the tips whose bodies do not collide with the object.
        """
        key = frozenset(fingers)
        if key not in self._contexts:
            root = self._diagram.CreateDefaultContext()
            manager = self._scene_graph.collision_filter_manager(
                self._scene_graph.GetMyMutableContextFromRoot(root)
            )
            links = [geometry for k in sorted(key) for geometry in self._link_ids[k]]
            manager.Apply(
                CollisionFilterDeclaration().ExcludeBetween(
                    GeometrySet(links), GeometrySet(self._object_ids)
                )
            )
            self._contexts[key] = self.plant.GetMyMutableContextFromRoot(root)
            # The root context owns the plant's.
            self._roots.append(root)
        return self._contexts[key]

    def place(self, context: Context, X_BPalm: RigidTransform, q: Array) -> None:
        """Sets the posture of the hand and its pose relative to B.

        Args:
            context: a context of the plant.
            X_BPalm: pose of the palm frame in B.
            q: joint positions in the order of `hand.joints` [rad or m], shape (n,).
        """
        positions = self.plant.GetPositions(context)
        positions[self.q_indices] = q
        self.plant.SetPositions(context, positions)
        X_WP = self.model.palm.CalcPoseInWorld(context)
        self.plant.SetFreeBodyPose(context, self.body, X_WP @ X_BPalm.inverse())

    def posture(self, positions: Array) -> tuple[RigidTransform, Array]:
        """Returns the palm's pose X_BPalm in B and the hand's joint positions.

        Args:
            positions: positions of the whole plant.
        """
        context = self.context()
        self.plant.SetPositions(context, positions)
        return self.palm_pose(context), positions[self.q_indices]

    def palm_pose(self, context: Context) -> RigidTransform:
        """Returns the palm's pose X_BPalm in B.

        Args:
            context: a context of the plant.
        """
        return self.model.palm.CalcPose(context, self.body.body_frame())

    def tips(self, context: Context, fingers: Sequence[int]) -> tuple[Array, Array]:
        """Returns where tips are and look, by forward kinematics.

        Args:
            context: a context of the plant.
            fingers: indices of m tips.

        Returns:
            Centres of their spheres in B [m], shape (m, 3), and their axes in B, shape (m, 3).
        """
        p_BT, axis_B = np.empty((len(fingers), 3)), np.empty((len(fingers), 3))
        for i, k in enumerate(fingers):
            X_BF = self.model.tip_frames[k].CalcPose(context, self.body.body_frame())
            p_BT[i] = X_BF.multiply(self.hand.tips[k].p_FT)
            axis_B[i] = X_BF.rotation().multiply(self.hand.tips[k].axis_F)
        return p_BT, axis_B

    def tip_rotation(self, context: Context, finger: int) -> RotationMatrix:
        """Returns the orientation of a tip's frame F in B.

        Args:
            context: a context of the plant.
            finger: index of the tip.
        """
        frame = self.model.tip_frames[finger]
        return frame.CalcPose(context, self.body.body_frame()).rotation()

    def jacobians(self, context: Context, fingers: Sequence[int], p_BC: Array) -> Array:
        """Returns how points that are fixed to tips move with the joints while the palm is fixed.

        Args:
            context: a context of the plant.
            fingers: indices of m tips.
            p_BC: where the point of each tip is now [m], shape (m, 3).

        Returns:
            Angular and translational velocities in B per speed of each joint, shape (m, 6, n), in
            the order of `hand.joints`.
        """
        J = np.empty((len(fingers), 6, len(self.hand.joints)))
        world = self.plant.world_frame()
        R_BW = self.body.EvalPoseInWorld(context).rotation().inverse().matrix()
        for i, k in enumerate(fingers):
            frame = self.model.tip_frames[k]
            p_FC = frame.CalcPose(context, self.body.body_frame()).inverse().multiply(p_BC[i])
            J_W = self.plant.CalcJacobianSpatialVelocity(
                context, JacobianWrtVariable.kV, frame, p_FC, world, world
            )[:, self._v_indices]
            J[i, :3], J[i, 3:] = R_BW @ J_W[:3], R_BW @ J_W[3:]
        return J

    def overlap(self, context: Context) -> float:
        """Returns how deep the deepest overlap of the hand is [m]; 0 if nothing overlaps.

        Args:
            context: a context of the plant.
        """
        pairs = self._query(context).ComputePointPairPenetration()
        return max((float(pair.depth) for pair in pairs), default=0.0)

    def clearance(self, context: Context) -> float:
        """Returns the least distance of the hand to itself, the object and what is around it [m].

        Args:
            context: a context of the plant.

        Returns:
            The distance, negative for an overlap; at most `FAR`.
        """
        pairs = self._query(context).ComputeSignedDistancePairwiseClosestPoints(FAR)
        return min((float(pair.distance) for pair in pairs), default=FAR)

    def link_pairs(self, finger: int) -> Pairs:
        """Returns pairs of geometries: the rest of a tip's body, and the object.

        Args:
            finger: index of the tip.
        """
        links = [g for g in self._link_ids[finger] if g not in self._tip_ids[finger]]
        return [(link, part) for link in links for part in self._object_ids]

    def tip_pairs(self, finger: int) -> Pairs:
        """Returns pairs of geometries: those that a tip's sphere stands for, and the object.

        There are none if the tip's geometry is that sphere itself: planning has compared it with
        the object's true surface, not with the convex hulls to which Drake measures.

        Args:
            finger: index of the tip.
        """
        ids = self._tip_ids[finger]
        if all(self._is_sphere(finger, geometry) for geometry in ids):
            return []
        # Sets have no order of their own.
        ordered = [g for g in self.model.tip_geometries[finger] if g in ids]
        return [(tip, part) for tip in ordered for part in self._object_ids]

    def _is_sphere(self, finger: int, geometry: GeometryId) -> bool:
        inspector, tip = self._scene_graph.model_inspector(), self.hand.tips[finger]
        shape = inspector.GetShape(geometry)
        if not isinstance(shape, Sphere):
            return False
        X_FL = self.model.tip_frames[finger].CalcPoseInBodyFrame(self.context()).inverse()
        p_FT = X_FL.multiply(inspector.GetPoseInFrame(geometry).translation())
        return bool(
            abs(shape.radius() - tip.radius) <= 1e-6 and np.abs(p_FT - tip.p_FT).max() <= 1e-6
        )

    def distances(self, context: Context, pairs: Pairs) -> Iterator[float]:
        """Yields the signed distance of each pair of geometries [m].

        Args:
            context: a context of the plant.
            pairs: pairs of geometries.
        """
        query = self._query(context)
        for a, b in pairs:
            yield float(query.ComputeSignedDistancePairClosestPoints(a, b).distance)

    def _query(self, context: Context) -> QueryObject:
        query: QueryObject = self.plant.get_geometry_query_input_port().Eval(context)
        return query


def _measurable(shape: Shape, X_BG: RigidTransform) -> tuple[Shape, RigidTransform]:
    """Returns a shape that Drake measures distances to: a box in place of a half-space."""
    if not isinstance(shape, HalfSpace):
        return shape, X_BG
    lower = RigidTransform(np.array([0.0, 0.0, -_GROUND / 2]))
    return Box(_GROUND, _GROUND, _GROUND), X_BG @ lower

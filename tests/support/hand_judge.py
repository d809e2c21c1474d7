"""An independent judge of hand grasps: the models as Drake parses them, posed by joint names."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from pydrake.geometry import GeometryId, QueryObject
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import Parser
from pydrake.multibody.plant import AddMultibodyPlantSceneGraph
from pydrake.systems.framework import DiagramBuilder

from drake_polygrasp.arrays import Array
from drake_polygrasp.hands.hand import Hand


class HandJudge:
    """A hand that floats beside an object that is welded to the world, so that W is B."""

    def __init__(self, hand: Hand, hand_model: Path, object_model: Path, *others: Path) -> None:
        builder = DiagramBuilder()
        self.plant, scene_graph = AddMultibodyPlantSceneGraph(builder, 1e-3)
        parser = Parser(self.plant)
        (self.hand_instance,) = parser.AddModels(str(hand_model))
        (object_instance,) = parser.AddModels(str(object_model))
        bodies = [self.plant.get_body(i) for i in self.plant.GetBodyIndices(object_instance)]
        self.object_body = bodies[0]
        self.plant.WeldFrames(self.plant.world_frame(), self.object_body.body_frame())
        for other in others:
            Parser(self.plant, other.stem).AddModels(str(other))
        self.plant.Finalize()
        self.hand, self._inspector = hand, scene_graph.model_inspector()
        self._root = builder.Build()
        self._root_context = self._root.CreateDefaultContext()
        self.context = self.plant.GetMyMutableContextFromRoot(self._root_context)

    def place(self, X_BPalm: RigidTransform, q: Mapping[str, float]) -> None:
        """Poses the hand, each joint by its name."""
        for name, position in q.items():
            joint = self.plant.GetJointByName(name, self.hand_instance)
            self.plant.SetPositions(self.context, self.hand_instance, self._with(joint, position))
        palm = self.plant.GetFrameByName(self.hand.description.palm_frame, self.hand_instance)
        root = self.plant.GetBodyByName(self.hand.root, self.hand_instance)
        X_PalmRoot = palm.CalcPose(self.context, root.body_frame()).inverse()
        self.plant.SetFreeBodyPose(self.context, root, X_BPalm @ X_PalmRoot)

    def _with(self, joint: object, position: float) -> Array:
        positions = self.plant.GetPositions(self.context)
        positions[joint.position_start()] = position  # type: ignore[attr-defined]
        return np.asarray(self.plant.GetPositionsFromArray(self.hand_instance, positions))

    def tip_centres(self, fingers: tuple[str, ...]) -> Array:
        """Centres of the tips' spheres in B [m], by names of tips."""
        by_name = {tip.name: tip for tip in self.hand.description.tips}
        centres = []
        for name in fingers:
            frame = self.plant.GetFrameByName(by_name[name].frame, self.hand_instance)
            centres.append(frame.CalcPoseInWorld(self.context) @ by_name[name].p_FT)
        return np.array(centres)

    def tip_axes(self, fingers: tuple[str, ...]) -> Array:
        """Axes of the tips in B, by names of tips."""
        by_name = {tip.name: tip for tip in self.hand.description.tips}
        axes = []
        for name in fingers:
            frame = self.plant.GetFrameByName(by_name[name].frame, self.hand_instance)
            axes.append(frame.CalcPoseInWorld(self.context).rotation() @ by_name[name].axis_F)
        return np.array(axes)

    def distances(self, limit: float = 0.04) -> dict[tuple[str, str], float]:
        """Signed distances of all pairs of geometry within a limit, by names "body/geometry"."""
        query: QueryObject = self.plant.get_geometry_query_input_port().Eval(self.context)
        found: dict[tuple[str, str], float] = {}
        for pair in query.ComputeSignedDistancePairwiseClosestPoints(limit):
            names = sorted((self._name(pair.id_A), self._name(pair.id_B)))
            found[names[0], names[1]] = pair.distance
        return found

    def _name(self, geometry: GeometryId) -> str:
        frame = self._inspector.GetFrameId(geometry)
        body = self.plant.GetBodyFromFrameId(frame)
        own = "object" if body.index() == self.object_body.index() else body.name()
        return f"{own}/{self._inspector.GetName(geometry).rpartition('::')[2]}"

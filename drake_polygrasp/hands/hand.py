"""A hand as a value: names, limits, couplings and fingertips, with forward kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from pydrake.geometry import QueryObject, SceneGraph, SceneGraphInspector
from pydrake.multibody.parsing import PackageMap
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import JacobianWrtVariable, ModelInstanceIndex
from pydrake.systems.framework import Context, Diagram

from drake_polygrasp.arguments import check_array
from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.errors import HandError
from drake_polygrasp.hands.description import HandDescription
from drake_polygrasp.hands.in_plant import HandInPlant, add_hand, find_hand, in_order, listed
from drake_polygrasp.hands.tip_fit import TipFit
from drake_polygrasp.loading.model_source import ModelFiles

LEVER = 0.05
"""Motion of a prismatic joint that counts as much as 1 rad of another [m]. Our choice: about what
that moves a fingertip."""


@dataclass(frozen=True, eq=False)
class Tip:
    """A fingertip of a hand, by the names of its model.

    Attributes:
        name: what the description calls it.
        frame: name of its frame F.
        body: name of the body that carries F.
        p_FT: centre of the sphere that stands for it [m], shape (3,).
        radius: radius of that sphere [m].
        axis_F: unit vector in which its pad looks, shape (3,).
        geometries: names of the collision geometries that it stands for.
        mu: its friction coefficient.
        fit: signed distances from the sphere to the geometries.
    """

    name: str
    frame: str
    body: str
    p_FT: Array
    radius: float
    axis_F: Array
    geometries: tuple[str, ...]
    mu: float
    fit: TipFit


@dataclass(frozen=True, eq=False)
class Hand:
    """A hand: its joints, fingertips and limits, with forward kinematics.

        hand = load_hand("models/hands/three_finger/three_finger.hand.yaml")
        p_PT, axis_P = hand.tip_points(0.5 * (hand.lower + hand.upper))

    Positions q are arrays in the order of `joints`, shape (n,). P is the palm's frame.

    Attributes:
        description: what its file states.
        joints: names of its n joints.
        lower: least positions [rad or m], shape (n,).
        upper: greatest positions, shape (n,).
        independent: names of the k independent joints.
        E: q = E z + e0 with the positions z of the independent joints, shape (n, k).
        e0: shape (n,).
        effort: greatest effort of each independent joint [N m or N], shape (k,); NaN if unknown.
        effort_from: where each effort is stated: "description", "model" or "unknown".
        tips: the fingertips.
        fingers: triples of indices of tips that may grasp, each ascending.
        root: name of the body that carries the hand.
        floats: whether the model leaves the root free.
        sha256: hex digest of description, model and meshes; None without a description file.
        in_plant: its elements in a plant of its own.
    """

    description: HandDescription
    joints: tuple[str, ...]
    lower: Array
    upper: Array
    independent: tuple[str, ...]
    E: Array
    e0: Array
    effort: Array
    effort_from: tuple[str, ...]
    tips: tuple[Tip, ...]
    fingers: tuple[tuple[int, int, int], ...]
    root: str
    floats: bool
    sha256: str | None
    in_plant: HandInPlant
    _files: ModelFiles = field(repr=False)
    _package_map: PackageMap = field(repr=False)
    _diagram: Diagram = field(repr=False)
    _context: Context = field(repr=False)

    @property
    def name(self) -> str:
        """Name of the hand."""
        return self.description.name

    @property
    def joint_units(self) -> Array:
        """Positions of the independent joints that count as much as 1 rad, shape (k,).

        1 of revolute joints, and `LEVER` of prismatic ones.
        """
        types = {joint.name(): joint.type_name() for joint in self.in_plant.joints}
        return np.array([LEVER if types[n] == "prismatic" else 1.0 for n in self.independent])

    @property
    def model_suffix(self) -> str:
        """Suffix of the model file, in lower case: ".sdf"."""
        return self._files.model_file.suffix.lower()

    @property
    def approach_P(self) -> Array:
        """Unit vector from the palm to the object, shape (3,)."""
        return self.description.approach_P

    def joint_dict(self, q: Array) -> dict[str, float]:
        """Returns positions by the names of joints.

        Args:
            q: positions [rad or m], shape (n,).
        """
        q = check_array("q", q, (len(self.joints),))
        return dict(zip(self.joints, q.tolist(), strict=True))

    def joint_array(self, q: Mapping[str, float]) -> Array:
        """Returns positions in the order of `joints`, shape (n,).

        Args:
            q: positions [rad or m] of all joints, by their names.

        Raises:
            HandError: when a joint is missing or unknown.
        """
        for name in q:
            if name not in self.joints:
                raise HandError(
                    f"hand '{self.name}' has no joint '{name}'; its joints: {listed(self.joints)}"
                )
        missing = [name for name in self.joints if name not in q]
        if missing:
            raise HandError(f"positions of joints {listed(missing)} of '{self.name}' are missing")
        return check_array("q", [q[name] for name in self.joints], (len(self.joints),))

    def set_positions(self, q: Array) -> Context:
        """Returns the context of the hand's own plant, with the hand put at a posture.

        Args:
            q: positions [rad or m], shape (n,).
        """
        context = self.in_plant.plant.GetMyMutableContextFromRoot(self._context)
        self.in_plant.plant.SetPositions(context, q)
        return context

    def query(self, q: Array) -> QueryObject:
        """Returns the geometry of the hand alone at a posture, for distances and overlaps.

        Args:
            q: positions [rad or m], shape (n,).
        """
        port = self.in_plant.plant.get_geometry_query_input_port()
        return port.Eval(self.set_positions(q))

    def tip_points(self, q: Array) -> tuple[Array, Array]:
        """Returns where the T fingertips are: centres p_PT [m] and axes in P, shape (T, 3) each.

        Args:
            q: positions [rad or m], shape (n,).
        """
        context = self.set_positions(q)
        plant, palm = self.in_plant.plant, self.in_plant.palm
        p_PT, axis_P = np.empty((len(self.tips), 3)), np.empty((len(self.tips), 3))
        for i, (tip, frame) in enumerate(zip(self.tips, self.in_plant.tip_frames, strict=True)):
            X_PF = plant.CalcRelativeTransform(context, palm, frame)
            p_PT[i], axis_P[i] = X_PF @ tip.p_FT, X_PF.rotation() @ tip.axis_F
        return p_PT, axis_P

    def tip_jacobians(self, q: Array) -> Array:
        """Returns the derivatives of the tips' centres p_PT by all joints, shape (T, 3, n).

        Multiplied by E they are those by the independent joints.

        Args:
            q: positions [rad or m], shape (n,).
        """
        context = self.set_positions(q)
        plant, palm = self.in_plant.plant, self.in_plant.palm
        return np.stack(
            [
                plant.CalcJacobianTranslationalVelocity(
                    context, JacobianWrtVariable.kQDot, frame, tip.p_FT, palm, palm
                )
                for tip, frame in zip(self.tips, self.in_plant.tip_frames, strict=True)
            ]
        )

    def add_to(
        self, plant: MultibodyPlant, scene_graph: SceneGraph, *, weld_root: bool = True
    ) -> HandInPlant:
        """Adds the hand to a plant, with the collision filters that its description asks for.

        Args:
            plant: the plant, not finalized yet.
            scene_graph: the SceneGraph that it is registered with.
            weld_root: whether a root that floats is welded to the world, at the world's frame.

        Returns:
            The hand's elements in the plant, the joints in the order of `joints`.

        Raises:
            HandError: when the model cannot be loaded.
        """
        found = add_hand(
            self.description,
            self._files,
            self._package_map,
            plant,
            scene_graph,
            weld_root=weld_root,
        )
        return in_order(found, self.joints, self.description.where)

    def find_in(
        self,
        plant: MultibodyPlant,
        inspector: SceneGraphInspector,
        instance: ModelInstanceIndex,
    ) -> HandInPlant:
        """Finds the hand's elements in a plant that has it already, as one model instance.

        Args:
            plant: the plant.
            inspector: inspector of its SceneGraph.
            instance: the hand's model instance.

        Returns:
            The hand's elements, the joints in the order of `joints`.

        Raises:
            HandError: when the plant lacks what the hand has.
        """
        found = find_hand(plant, inspector, instance, self.description)
        return in_order(found, self.joints, self.description.where)

    def positions(
        self, plant: MultibodyPlant, instance: ModelInstanceIndex, q: Mapping[str, float]
    ) -> Array:
        """Returns positions in a plant's own order, for `plant.SetPositions(context, instance, .)`.

        Args:
            plant: a finalized plant that has the hand as one model instance.
            instance: the hand's model instance.
            q: positions [rad or m] of all joints, by their names.

        Returns:
            Positions of the instance, shape (n,).

        Raises:
            HandError: when a joint is missing or unknown, or the instance is not this hand.
        """
        values = self.joint_array(q)
        joints = [plant.get_joint(index) for index in plant.GetJointIndices(instance)]
        moving = {j.name(): j.position_start() for j in joints if j.num_positions() == 1}
        if {*moving} != {*self.joints}:
            raise HandError(
                f"the model instance has joints {listed(sorted(moving))}, not those of hand "
                f"'{self.name}'; name the hand's own instance"
            )
        order = np.argsort([moving[name] for name in self.joints])
        return frozen(values[order])

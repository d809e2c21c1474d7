"""Adds a hand to a plant, and finds its elements there by their names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pydrake.geometry import (
    CollisionFilterDeclaration,
    GeometryId,
    GeometrySet,
    SceneGraph,
    SceneGraphInspector,
)
from pydrake.multibody.parsing import PackageMap
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import Frame, Joint, ModelInstanceIndex, RigidBody

from drake_polygrasp.arrays import Ints, frozen
from drake_polygrasp.errors import HandError, ModelError
from drake_polygrasp.hands.description import HandDescription, TipDescription
from drake_polygrasp.loading.model_in_plant import add_model_files
from drake_polygrasp.loading.model_source import ModelFiles

_MAX_NAMES = 12
"""How many names a message lists. Our choice."""


@dataclass(frozen=True, eq=False)
class HandInPlant:
    """The elements of a hand in one plant.

    Attributes:
        plant: the plant.
        instance: the hand's model instance.
        palm: the palm's frame P.
        root: the body that carries the hand.
        floats: whether no joint of the plant holds the root.
        joints: the joints with positions, in the plant's order of joints.
        tip_frames: frame F of each tip.
        tip_bodies: body of each tip.
        tip_geometries: collision geometries of each tip.
    """

    plant: MultibodyPlant
    instance: ModelInstanceIndex
    palm: Frame
    root: RigidBody
    floats: bool
    joints: tuple[Joint, ...]
    tip_frames: tuple[Frame, ...]
    tip_bodies: tuple[RigidBody, ...]
    tip_geometries: tuple[tuple[GeometryId, ...], ...]

    def q_indices(self) -> Ints:
        """Returns where each joint's position is in the plant's q, shape (n,).

        The plant must be finalized.
        """
        return frozen([joint.position_start() for joint in self.joints], dtype=int)

    def v_indices(self) -> Ints:
        """Returns where each joint's velocity is in the plant's v, shape (n,).

        The plant must be finalized.
        """
        return frozen([joint.velocity_start() for joint in self.joints], dtype=int)


def add_hand(
    description: HandDescription,
    files: ModelFiles,
    package_map: PackageMap,
    plant: MultibodyPlant,
    scene_graph: SceneGraph,
    *,
    weld_root: bool,
) -> HandInPlant:
    """Adds a hand's model to a plant, with the collision filters that its description asks for.

    Args:
        description: the hand.
        files: its model file and all that it refers to.
        package_map: the packages that URIs may name.
        plant: the plant, not finalized yet.
        scene_graph: the SceneGraph that it is registered with.
        weld_root: whether a root that floats is welded to the world, at the world's frame.

    Returns:
        The hand's elements in the plant.

    Raises:
        HandError: when the model cannot be loaded, or lacks what the description names.
    """
    where = description.where
    try:
        models = add_model_files(plant, files, package_map)
    except ModelError as error:
        raise HandError(f"{where}: model: {error}") from error
    models = [model for model in models if plant.GetBodyIndices(model)]
    if len(models) != 1:
        names = [plant.GetModelInstanceName(model) for model in models]
        raise HandError(
            f"{where}: {files.model_file} has {len(models)} models, {listed(names) or 'none'}; "
            "name a file with the hand alone"
        )
    found = find_hand(plant, scene_graph.model_inspector(), models[0], description)
    if found.floats and weld_root:
        plant.WeldFrames(plant.world_frame(), found.root.body_frame())
    _apply_filters(description, found, scene_graph)
    return found


def _apply_filters(
    description: HandDescription, found: HandInPlant, scene_graph: SceneGraph
) -> None:
    """Excludes the pairs of bodies that the description ignores from all distances."""
    plant = found.plant
    for pair in description.ignore_collisions:
        sets = []
        for name in pair:
            if not plant.HasBodyNamed(name, found.instance):
                raise HandError(
                    f"{description.where}: ignore_collisions names '{name}', which is no body of "
                    "the model"
                )
            body = plant.GetBodyByName(name, found.instance)
            sets.append(GeometrySet(plant.GetCollisionGeometriesForBody(body)))
        filters = CollisionFilterDeclaration().ExcludeBetween(*sets)
        scene_graph.collision_filter_manager().Apply(filters)


def find_hand(
    plant: MultibodyPlant,
    inspector: SceneGraphInspector,
    instance: ModelInstanceIndex,
    description: HandDescription,
) -> HandInPlant:
    """Returns the elements of a hand that is one model instance of a plant.

    Args:
        plant: the plant, finalized or not.
        inspector: inspector of its SceneGraph.
        instance: the hand's model instance.
        description: the hand.

    Raises:
        HandError: when the plant lacks what the description names.
    """
    where = description.where
    bodies = [plant.get_body(index) for index in plant.GetBodyIndices(instance)]
    joints = [plant.get_joint(index) for index in plant.GetJointIndices(instance)]
    palm = _frame(plant, instance, description.palm_frame, f"{where}: palm.frame")
    frames, tip_bodies, geometries = [], [], []
    for i, tip in enumerate(description.tips):
        frame = _frame(plant, instance, tip.frame, f"{where}: tips[{i}].frame")
        frames.append(frame)
        tip_bodies.append(frame.body())
        geometries.append(
            _geometries(plant, inspector, frame.body(), tip, f"{where}: tips[{i}].geometries")
        )
    root, floats = _find_root(plant, bodies, joints, where)
    return HandInPlant(
        plant,
        instance,
        palm,
        root,
        floats,
        tuple(joint for joint in joints if _moves(joint, bodies, where)),
        tuple(frames),
        tuple(tip_bodies),
        tuple(geometries),
    )


def in_order(found: HandInPlant, joints: Sequence[str], where: str) -> HandInPlant:
    """Returns a hand's elements with the joints in a given order.

    Args:
        found: the elements.
        joints: names of the joints.
        where: what messages call the hand.

    Raises:
        HandError: when the plant has other joints.
    """
    by_name = {joint.name(): joint for joint in found.joints}
    if len(by_name) != len(found.joints) or {*by_name} != {*joints}:
        raise HandError(
            f"{where}: the model instance has joints {listed(sorted(by_name))}, not those of the "
            f"hand, {listed(joints)}"
        )
    return replace(found, joints=tuple(by_name[name] for name in joints))


def short_name(name: str) -> str:
    """Returns the name of a geometry without the scope of its model, as descriptions state it.

    Args:
        name: the name in the SceneGraph, "model::name".
    """
    return name.rpartition("::")[2]


def _find_root(
    plant: MultibodyPlant, bodies: Sequence[RigidBody], joints: Sequence[Joint], where: str
) -> tuple[RigidBody, bool]:
    """Returns the body that carries all others, and whether nothing holds it."""
    inner = {int(body.index()) for body in bodies}
    moved = {
        int(joint.child_body().index())
        for joint in joints
        if int(joint.parent_body().index()) in inner
    }
    roots = [body for body in bodies if int(body.index()) not in moved]
    if len(roots) != 1:
        raise HandError(
            f"{where}: the model has {len(roots)} parts that no joint connects: "
            f"{listed([body.name() for body in roots])}; one hand is one chain of joints"
        )
    every = [plant.get_joint(index) for index in plant.GetJointIndices()]
    held = any(
        joint.child_body().index() == roots[0].index() and not _is_free(joint) for joint in every
    )
    return roots[0], not held


def _is_free(joint: Joint) -> bool:
    """Returns whether a joint is the one that Drake adds to bodies that float."""
    return joint.type_name() in ("quaternion_floating", "rpy_floating")


def _moves(joint: Joint, bodies: Sequence[RigidBody], where: str) -> bool:
    """Returns whether a joint has a position; HandError for other kinds than the two known."""
    if joint.num_positions() == 0 or _is_free(joint):
        return False
    if joint.type_name() not in ("revolute", "prismatic"):
        raise HandError(
            f"{where}: joint '{joint.name()}' is {joint.type_name()}; a hand's joints are revolute "
            "or prismatic: replace it, or make it fixed"
        )
    if joint.parent_body().index() not in [body.index() for body in bodies]:
        raise HandError(
            f"{where}: joint '{joint.name()}' moves the whole hand; name a model of the hand alone"
        )
    return True


def _frame(plant: MultibodyPlant, instance: ModelInstanceIndex, name: str, key: str) -> Frame:
    if not plant.HasFrameNamed(name, instance):
        names = [plant.get_frame(index).name() for index in plant.GetFrameIndices(instance)]
        joints = [plant.get_joint(index).name() for index in plant.GetJointIndices(instance)]
        # Drake adds frames of its own at joints.
        added = {f"{joint}_{end}" for joint in joints for end in ("parent", "child")}
        names = [name for name in names if name not in added]
        raise HandError(f"{key} is '{name}', which the model lacks; its frames: {listed(names)}")
    return plant.GetFrameByName(name, instance)


def _geometries(
    plant: MultibodyPlant,
    inspector: SceneGraphInspector,
    body: RigidBody,
    tip: TipDescription,
    key: str,
) -> tuple[GeometryId, ...]:
    own = {short_name(inspector.GetName(g)): g for g in plant.GetCollisionGeometriesForBody(body)}
    for name in tip.geometries:
        if name not in own:
            raise HandError(
                f"{key} names '{name}', which is no collision geometry of '{body.name()}', the "
                f"body of frame '{tip.frame}'; it has {listed(list(own)) or 'none'}"
            )
    return tuple(own[name] for name in tip.geometries)


def listed(names: Sequence[str]) -> str:
    """Returns the first of some names for a message, quoted, and how many more there are.

    Args:
        names: the names.
    """
    shown = ", ".join(f"'{name}'" for name in names[:_MAX_NAMES])
    more = len(names) - _MAX_NAMES
    return f"{shown} and {more} more" if more > 0 else shown

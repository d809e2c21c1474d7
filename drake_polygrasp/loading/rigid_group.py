"""Finds the links that weld joints make one rigid body, and those on its other joints.

Fixed joints of URDF and SDF, bodies without joints of MJCF and welds added by directives or by code
are all weld joints of the plant. The world is part of no body: links welded to it, but not to one
another, are separate bodies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from pydrake.geometry import GeometryId, SceneGraphInspector
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BodyIndex,
    Joint,
    QuaternionFloatingJoint,
    RigidBody,
    RpyFloatingJoint,
    SpatialInertia,
    WeldJoint,
)
from pydrake.systems.framework import Context

_WORLD = 0
"""The index of a plant's world body."""


class Link(NamedTuple):
    """A link of a rigid body.

    Attributes:
        body: the link, as a body of the plant.
        X_BL: pose of its frame L in B.
    """

    body: RigidBody
    X_BL: RigidTransform


class Collider(NamedTuple):
    """A collision geometry of a rigid body.

    Attributes:
        geometry: its id in the SceneGraph.
        X_BG: pose of its frame G in B.
        link: the link that has it.
    """

    geometry: GeometryId
    X_BG: RigidTransform
    link: RigidBody


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """A rigid body: all links that are fixed to one another.

    Attributes:
        body: the link whose frame is B.
        links: the links of the rigid body, `body` included, in the plant's order.
        on_joints: other links that joints connect with these, directly or through one another, at
            their poses in the context.
        tied_by: names of the joints, other than floating ones, between these links and the world.
    """

    body: RigidBody
    links: tuple[Link, ...]
    on_joints: tuple[Link, ...]
    tied_by: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the links."""
        return tuple(self.name_of(link.body) for link in self.links)

    def name_of(self, link: RigidBody) -> str:
        """Returns the name of a link, scoped by its model's where that is not that of `body`.

        Args:
            link: a link of the plant.
        """
        same_model = link.model_instance() == self.body.model_instance()
        return str(link.name() if same_model else link.scoped_name())

    def colliders(
        self, plant: MultibodyPlant, inspector: SceneGraphInspector
    ) -> tuple[Collider, ...]:
        """Returns the collision geometries of all links, in the order of links.

        Args:
            plant: the plant.
            inspector: the inspector of its SceneGraph.
        """
        return tuple(_colliders(plant, inspector, self.links))

    def covers(self, plant: MultibodyPlant, inspector: SceneGraphInspector) -> tuple[Collider, ...]:
        """Returns the collision geometries of links on joints.

        Args:
            plant: the plant.
            inspector: the inspector of its SceneGraph.
        """
        return tuple(_colliders(plant, inspector, self.on_joints))

    def names_on_joints(self) -> tuple[str, ...]:
        """Returns the names of links on joints, except those without mass and geometry."""
        return tuple(
            self.name_of(link)
            for link, _ in self.on_joints
            if link.default_mass() > 0 or link.GetParentPlant().GetCollisionGeometriesForBody(link)
        )

    def spatial_inertia(self, context: Context) -> SpatialInertia:
        """Returns M_BBo_B, the spatial inertia of all links about Bo, expressed in B.

        Args:
            context: the plant's context, whose parameters state the links' masses.
        """
        M_BBo_B = SpatialInertia.Zero()
        for link, X_BL in self.links:
            M_LLo_L = link.CalcSpatialInertiaInBodyFrame(context)
            if len(self.links) == 1:
                return M_LLo_L
            if M_LLo_L.get_mass() > 0:
                M_BBo_B += M_LLo_L.ReExpress(X_BL.rotation()).Shift(-X_BL.translation())
        return M_BBo_B


def find_group(plant: MultibodyPlant, body: RigidBody, context: Context) -> RigidGroup:
    """Finds the rigid body that a link belongs to.

    Args:
        plant: the plant, finalized.
        body: the link whose frame is to be B; not the world.
        context: the plant's context, which states the poses of welded frames on their links and the
            positions of joints.

    Returns:
        The link and all that welds join to it, other than through the world; and the links that
        other than floating joints connect with these.
    """
    X_BL = {int(body.index()): RigidTransform()}
    joints = _joints(plant)
    frontier = list(X_BL)
    while frontier:
        near = frontier.pop()
        for joint in joints:
            far = _across(joint, near)
            if far is None or far in X_BL or not isinstance(joint, WeldJoint):
                continue
            if far == _WORLD:
                continue
            X_PC = _weld_pose(joint, context)
            is_parent = int(joint.parent_body().index()) == near
            X_BL[far] = X_BL[near] @ (X_PC if is_parent else X_PC.inverse())
            frontier.append(far)
    links = tuple(Link(plant.get_body(BodyIndex(k)), X_BL[k]) for k in sorted(X_BL))
    tied_by = tuple(
        joint.name()
        for joint in joints
        if any(_across(joint, k) == _WORLD for k in X_BL) and not _is_free(joint)
    )
    on_joints = tuple(
        Link(link, plant.CalcRelativeTransform(context, body.body_frame(), link.body_frame()))
        for link in (plant.get_body(BodyIndex(k)) for k in _connected(joints, set(X_BL)))
    )
    return RigidGroup(body, links, on_joints, tied_by)


def _connected(joints: Sequence[Joint], links: set[int]) -> list[int]:
    """Returns indices of bodies that joints, other than floating ones, connect with the links.

    Connections through the world do not count.
    """
    found, frontier = set(links), list(links)
    while frontier:
        near = frontier.pop()
        for joint in joints:
            far = _across(joint, near)
            if far is not None and far != _WORLD and far not in found and not _is_free(joint):
                found.add(far)
                frontier.append(far)
    return sorted(found - links)


def rigid_bodies(plant: MultibodyPlant) -> list[list[RigidBody]]:
    """Returns the links of each rigid body of a plant, the world excepted.

    Args:
        plant: the plant, finalized.

    Returns:
        Rigid bodies in the plant's order of their first links. Each begins with its base link,
        which is not the child of a weld within it; the others follow in the plant's order.
    """
    welds = [joint for joint in _joints(plant) if isinstance(joint, WeldJoint)]
    label = list(range(plant.num_bodies()))
    pairs = [(int(w.parent_body().index()), int(w.child_body().index())) for w in welds]
    pairs = [pair for pair in pairs if _WORLD not in pair]
    for a, b in pairs:
        low, high = sorted((label[a], label[b]))
        label = [low if k == high else k for k in label]
    children = {b for _, b in pairs}
    bodies = []
    for group in sorted(set(label[1:])):
        members = [k for k in range(1, len(label)) if label[k] == group]
        base = next((k for k in members if k not in children), members[0])
        members.remove(base)
        bodies.append([plant.get_body(BodyIndex(k)) for k in (base, *members)])
    return bodies


def bodies_beside(plant: MultibodyPlant, group: RigidGroup) -> tuple[str, ...]:
    """Returns the names of other rigid bodies with geometry that the world holds.

    Args:
        plant: the plant, finalized.
        group: a rigid body.

    Returns:
        Names of bodies that joints, other than floating ones, connect with the world, and of the
        world itself if it has geometry; none where the world does not hold `group` either.
    """
    if not group.tied_by:
        return ()
    counted = {int(link.body.index()) for link in (*group.links, *group.on_joints)}
    held = {
        _across(joint, _WORLD)
        for joint in _joints(plant)
        if _across(joint, _WORLD) is not None and not _is_free(joint)
    }
    bodies = [[plant.world_body()]]
    for body in rigid_bodies(plant):
        indices = {int(link.index()) for link in body}
        if indices & held and not indices & counted:
            bodies.append(body)
    return tuple(
        group.name_of(body[0])
        for body in bodies
        if any(plant.GetCollisionGeometriesForBody(link) for link in body)
    )


def _joints(plant: MultibodyPlant) -> list[Joint]:
    return [plant.get_joint(index) for index in plant.GetJointIndices()]


def _across(joint: Joint, near: int) -> int | None:
    """Returns the index of the body at the joint's other end, None where `near` is at neither."""
    parent, child = int(joint.parent_body().index()), int(joint.child_body().index())
    return child if near == parent else parent if near == child else None


def _is_free(joint: Joint) -> bool:
    return isinstance(joint, QuaternionFloatingJoint | RpyFloatingJoint)


def _weld_pose(joint: WeldJoint, context: Context) -> RigidTransform:
    """Returns X_PC of the weld's parent and child body, without the rounding of world poses."""
    X_PF = joint.frame_on_parent().CalcPoseInBodyFrame(context)
    X_CM = joint.frame_on_child().CalcPoseInBodyFrame(context)
    return X_PF @ joint.X_FM() @ X_CM.inverse()


def _colliders(
    plant: MultibodyPlant, inspector: SceneGraphInspector, links: tuple[Link, ...]
) -> Iterator[Collider]:
    """Yields the links' geometries with a proximity role."""
    for link, X_BL in links:
        for geometry in plant.GetCollisionGeometriesForBody(link):
            if inspector.GetProximityProperties(geometry) is not None:
                yield Collider(geometry, X_BL @ inspector.GetPoseInFrame(geometry), link)

"""Links that a model fixes to one another: one rigid body, in the frame B of one of them.

URDF's and SDF's fixed joints, MJCF's bodies without joints and welds added by directives or by code
are all weld joints of the plant. The world belongs to no body: what is welded to it apart from one
another are separate bodies.
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
    """A body of the plant as seen from B."""

    body: RigidBody
    X_BL: RigidTransform


class Collider(NamedTuple):
    """A collision geometry of a link."""

    geometry: GeometryId
    X_BG: RigidTransform
    link: RigidBody


@dataclass(frozen=True, eq=False)
class RigidGroup:
    """All links that are fixed to one another, one of which is the body B.

    Attributes:
        body: its frame is B.
        links: those of the rigid body, B's own among them, in the plant's order.
        on_joints: other links that joints, and links on joints, connect with these, where they are
            now.
        tied_by: names of joints that fix links to the world, or let them move on it but not freely.
    """

    body: RigidBody
    links: tuple[Link, ...]
    on_joints: tuple[Link, ...]
    tied_by: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Of the links, with their model's name where that is not B's."""
        return tuple(self.name_of(link.body) for link in self.links)

    def name_of(self, link: RigidBody) -> str:
        """What messages and files call a link."""
        same_model = link.model_instance() == self.body.model_instance()
        return str(link.name() if same_model else link.scoped_name())

    def colliders(
        self, plant: MultibodyPlant, inspector: SceneGraphInspector
    ) -> tuple[Collider, ...]:
        """The collision geometries of all links, in the links' order and then each link's own."""
        return tuple(_colliders(plant, inspector, self.links))

    def covers(self, plant: MultibodyPlant, inspector: SceneGraphInspector) -> tuple[Collider, ...]:
        """The collision geometries of links on joints."""
        return tuple(_colliders(plant, inspector, self.on_joints))

    def names_on_joints(self) -> tuple[str, ...]:
        """Of the links on joints, but for those that are mere frames."""
        return tuple(
            self.name_of(link)
            for link, _ in self.on_joints
            if link.default_mass() > 0 or link.GetParentPlant().GetCollisionGeometriesForBody(link)
        )

    def spatial_inertia(self, context: Context) -> SpatialInertia:
        """M_BBo_B of all links together, by the masses in the plant's context."""
        M_BBo_B = SpatialInertia.Zero()
        for link, X_BL in self.links:
            M_LLo_L = link.CalcSpatialInertiaInBodyFrame(context)
            if len(self.links) == 1:
                return M_LLo_L
            if M_LLo_L.get_mass() > 0:
                M_BBo_B += M_LLo_L.ReExpress(X_BL.rotation()).Shift(-X_BL.translation())
        return M_BBo_B


def find_group(plant: MultibodyPlant, body: RigidBody, context: Context) -> RigidGroup:
    """The rigid body that a link belongs to, in that link's frame.

    Args:
        plant: finalized.
        body: whose frame is to be B; not the world.
        context: the plant's, which says where welded frames are on their links, and how joints
            stand.

    Returns:
        The link and all others that welds join to it, but not through the world; and what hangs on
        these by joints that do not let it float.
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
    """Indices of bodies that joints connect with the links, but not freely or by the world."""
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
    """All links of a plant but the world, those of one rigid body together.

    Each rigid body begins with its base link, which is no weld's child within it; the others
    follow in the plant's order, as the rigid bodies do by their first link.
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
    """Names of other rigid bodies with geometry that the world holds as it holds the group.

    None where the group is free to move; the world itself where it has geometry.
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
    """The index of the body at the joint's other end, None where the body is at neither."""
    parent, child = int(joint.parent_body().index()), int(joint.child_body().index())
    return child if near == parent else parent if near == child else None


def _is_free(joint: Joint) -> bool:
    return isinstance(joint, QuaternionFloatingJoint | RpyFloatingJoint)


def _weld_pose(joint: WeldJoint, context: Context) -> RigidTransform:
    """X_PC of the parent and the child body, to the last bit as the model states it."""
    X_PF = joint.frame_on_parent().CalcPoseInBodyFrame(context)
    X_CM = joint.frame_on_child().CalcPoseInBodyFrame(context)
    return X_PF @ joint.X_FM() @ X_CM.inverse()


def _colliders(
    plant: MultibodyPlant, inspector: SceneGraphInspector, links: tuple[Link, ...]
) -> Iterator[Collider]:
    for link, X_BL in links:
        for geometry in plant.GetCollisionGeometriesForBody(link):
            if inspector.GetProximityProperties(geometry) is not None:
                yield Collider(geometry, X_BL @ inspector.GetPoseInFrame(geometry), link)

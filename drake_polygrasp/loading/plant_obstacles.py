"""Makes obstacles from the other bodies of the user's plant: `obstacles_from_plant`."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np
from pydrake.geometry import Box, GeometryId, HalfSpace, QueryObject, Role, SceneGraphInspector
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, ModelInstanceIndex, RigidBody
from pydrake.systems.framework import Context

from drake_polygrasp.arguments import check_items, check_length
from drake_polygrasp.arrays import Array, Bools, frozen
from drake_polygrasp.errors import ModelError, UsageError
from drake_polygrasp.geometry.body_identity import BodyIdentity
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.geometry.shells import oriented_shells, weld
from drake_polygrasp.geometry.surface import Part
from drake_polygrasp.geometry.tolerances import LENGTH_TOLERANCE
from drake_polygrasp.loading.body_object import identity_of
from drake_polygrasp.loading.live_plant import describe, find_body, query_of
from drake_polygrasp.loading.parsed_model import drake_errors_as_model_errors
from drake_polygrasp.loading.rigid_group import Collider, find_group
from drake_polygrasp.loading.shapes import part_of

Ignored: TypeAlias = RigidBody | ModelInstanceIndex | GeometryId


def obstacles_from_plant(
    plant: MultibodyPlant,
    body: RigidBody | BodyIndex | str,
    context: Context,
    *,
    ignore: Collection[Ignored] = (),
    reach: float | None = None,
) -> Obstacles:
    """Returns the obstacles around a body, at the poses in the context.

    They are all collision geometry of the scene except the body's own and that of bodies welded to
    it, other than through the world. Links on its joints are obstacles, also where the object was
    loaded with them as covers. A Mesh is its true surface, as in Drake's signed distance to a
    point, not its convex hull.

        obstacles = obstacles_from_plant(plant, body, context, ignore=[gripper_model])
        plan = plan_grasps(object_, obstacles=obstacles)
        p_BC = plan.grasps[0].grasp.p_BC
        p_WC = (obstacles.X_WB @ p_BC.T).T

    Args:
        plant: the plant, finalized, and connected to a SceneGraph in a diagram.
        body: the body to grasp, its index or its name.
        context: the plant's context, taken from the diagram's.
        ignore: bodies, model instances and geometries that are not obstacles, such as the gripper.
        reach: distance from the body's bounding box beyond which geometry is left out [m], at least
            a fingertip's diameter (default: the box's diagonal).

    Returns:
        The obstacles in the body's frame B.

    Raises:
        UsageError: when plant, body and context do not belong together, or `reach` is not a length.
        ModelError: when the body has no collision geometry, or an obstacle has no surface.
    """
    body = find_body(plant, body)
    query = query_of(plant, body, context)
    inspector = query.inspector()
    body_frame = plant.GetBodyFrameIdOrThrow(body.index())
    X_WB = query.GetPoseInWorld(body_frame)
    own = find_group(plant, body, context).colliders(plant, inspector)
    corners = [_corners_B(inspector, geometry, X_BG) for geometry, X_BG, _ in own]
    bounded = [c for c in corners if c is not None]
    if not bounded:
        raise ModelError(f"{describe(body)} has no collision geometry that fingers can hold")
    low, high = np.min(bounded, axis=(0, 1)), np.max(bounded, axis=(0, 1))
    diagonal = float(np.linalg.norm(high - low))
    reach = diagonal if reach is None else check_length("reach", reach)

    parts: dict[GeometryId, Part] = {}
    for geometry in other_geometries(plant, query, {collider.geometry for collider in own}, ignore):
        part = _part(query, geometry, X_WB, (low - reach, high + reach))
        if part is not None:
            parts[geometry] = part
    surfaces = [outward_triangles(part) for part in parts.values() if part.primitive is None]
    none = np.empty((0, 3, 3)), np.empty(0, dtype=bool)
    triangles, closed = (np.concatenate(x) for x in zip(none, *surfaces, strict=True))
    names = dict.fromkeys(geometry_name(plant, inspector, geometry) for geometry in parts)
    return Obstacles(
        X_WB=X_WB,
        names=tuple(names),
        triangles_B=frozen(triangles),
        closed=frozen(closed, bool),
        primitives=tuple(p.primitive for p in parts.values() if p.primitive is not None),
        reach=reach,
        body=live_identity(inspector, own, body),
    )


def live_identity(
    inspector: SceneGraphInspector, own: Sequence[Collider], body: RigidBody
) -> BodyIdentity:
    """Returns the identity by which later calls recognise a body of a plant.

    Args:
        inspector: the inspector of the plant's SceneGraph.
        own: the body's collision geometries.
        body: the body.

    Raises:
        ModelError: when one of its shapes cannot be read.
    """
    parts = []
    for geometry, X_BG, _ in own:
        with drake_errors_as_model_errors(describe(body)):
            part = part_of(inspector.GetShape(geometry), X_BG, mu=0.0)
        parts += [] if part is None else [part]
    return identity_of(parts, (str(body.scoped_name()),))


def other_geometries(
    plant: MultibodyPlant,
    query: QueryObject[Any],
    own: Collection[GeometryId],
    ignore: Collection[Ignored],
) -> Iterator[GeometryId]:
    """Yields the collision geometries of a scene, in the order of their registration.

    Args:
        plant: the plant.
        query: the query object of its SceneGraph.
        own: geometries of the body to grasp, which are left out.
        ignore: bodies, model instances and geometries that are left out too.

    Raises:
        UsageError: when `ignore` holds anything else.
    """
    inspector = query.inspector()
    ignore = check_items("ignore", ignore)
    for item in ignore:
        if not isinstance(item, Ignored):
            raise UsageError(
                f"{item!r} cannot be ignored: give bodies, model instances or geometries of the "
                "plant, not their names"
            )
    models = {item for item in ignore if isinstance(item, ModelInstanceIndex)}
    bodies = {item.index() for item in ignore if isinstance(item, RigidBody)}
    geometries = {item for item in ignore if isinstance(item, GeometryId)}.union(own)
    for geometry in sorted(
        inspector.GetAllGeometryIds(Role.kProximity), key=lambda geometry: geometry.get_value()
    ):
        body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
        of_body = body is not None and (body.index() in bodies or body.model_instance() in models)
        if geometry not in geometries and not of_body:
            yield geometry


def geometry_name(
    plant: MultibodyPlant, inspector: SceneGraphInspector, geometry: GeometryId
) -> str:
    """Returns the name of an obstacle: its body's, or its own where the body is the world.

    Args:
        plant: the plant.
        inspector: the inspector of its SceneGraph.
        geometry: the obstacle, which may also belong to no body of the plant.
    """
    body = plant.GetBodyFromFrameId(inspector.GetFrameId(geometry))
    if body is None or body.index() == plant.world_body().index():
        return str(inspector.GetName(geometry))
    return str(body.scoped_name())


def _part(
    query: QueryObject[Any],
    geometry: GeometryId,
    X_WB: RigidTransform,
    near: tuple[Array, Array],
) -> Part | None:
    """Returns a geometry as a part, None where its bounding box is outside the box `near`.

    A half space is replaced by a box that has the same points inside `near`.
    """
    inspector = query.inspector()
    shape, name = inspector.GetShape(geometry), inspector.GetName(geometry)
    if inspector.IsDeformableGeometry(geometry):
        raise ModelError(f"obstacle '{name}' is deformable; put its geometry into `ignore`")
    X_BG = X_WB.inverse() @ query.GetPoseInWorld(geometry)
    if isinstance(shape, HalfSpace):
        return half_space_part(X_BG, near)
    corners = _corners_B(inspector, geometry, X_BG)
    if corners is not None:
        apart = (corners.min(axis=0) > near[1]) | (corners.max(axis=0) < near[0])
        if apart.any():
            return None
    with drake_errors_as_model_errors(f"obstacle '{name}'"):
        part = part_of(shape, X_BG, mu=0.0)
    if part is None:
        raise ModelError(
            f"obstacle '{name}' is a {type(shape).__name__}, which has no surface to measure; "
            "put its body or geometry into `ignore`"
        )
    return part


def half_space_part(X_BG: RigidTransform, near: tuple[Array, Array]) -> Part | None:
    """Returns a box with the points of the half space z_G <= 0 in a box, None without any.

    Args:
        X_BG: pose of the half space's frame G in B.
        near: least and greatest corner of the box in B [m], shape (3,) each.
    """
    middle = (near[0] + near[1]) / 2
    radius = float(np.linalg.norm(near[1] - near[0])) / 2
    p_G = X_BG.inverse() @ middle
    if p_G[2] > radius:
        return None
    depth = 2 * radius + max(0.0, -p_G[2])
    p_GC = np.array([p_G[0], p_G[1], -depth / 2])
    box = Box(4 * radius, 4 * radius, depth)
    return part_of(box, X_BG @ RigidTransform(p_GC), mu=0.0)


def _corners_B(
    inspector: SceneGraphInspector, geometry: GeometryId, X_BG: RigidTransform
) -> Array | None:
    """Returns the corners of a geometry's bounding box [m], shape (8, 3); None if unbounded."""
    obb = inspector.GetObbInGeometryFrame(geometry)
    if obb is None:
        return None
    signs = np.array(list(np.ndindex(2, 2, 2))) * 2.0 - 1.0
    X_BO = X_BG @ obb.pose()
    return np.asarray((X_BO @ (signs * obb.half_width()).T).T)


def outward_triangles(part: Part) -> tuple[Array, Bools]:
    """Returns a part's triangles, turned outward, and whether the shell of each is closed.

    Args:
        part: a part of triangles.

    Returns:
        Triangles [m], shape (T, 3, 3), and flags, shape (T,).
    """
    size = float(np.ptp(part.triangles_B.reshape(-1, 3), axis=0).max())
    vertices, corners = weld(part.triangles_B, LENGTH_TOLERANCE * size)
    shells = oriented_shells(vertices, corners)
    return vertices[shells.corners], shells.closed[shells.shell]

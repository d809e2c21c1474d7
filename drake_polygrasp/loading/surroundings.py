"""Reads the other bodies of the user's scene as Drake's shapes, for checks in our own plants.

The planner avoids `Obstacles`, which are triangles and curved solids; here are Drake's own shapes
of the same bodies, so that the check shares nothing with the planner.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydrake.geometry import HalfSpace, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import Context, DiagramBuilder

from drake_polygrasp.arguments import check_instance, check_path, check_paths
from drake_polygrasp.arrays import frozen
from drake_polygrasp.errors import ModelError, UsageError
from drake_polygrasp.geometry.body_identity import BodyIdentity
from drake_polygrasp.geometry.obstacles import Obstacles
from drake_polygrasp.grasp import GraspObject, ModelSource
from drake_polygrasp.loading.live_plant import find_body, query_of
from drake_polygrasp.loading.object_model import scoped_name
from drake_polygrasp.loading.parsed_model import (
    ParsedFiles,
    ParsedModel,
    choose_body,
    drake_errors_as_model_errors,
    parse_files,
)
from drake_polygrasp.loading.plant_object import object_from_plant
from drake_polygrasp.loading.plant_obstacles import (
    Ignored,
    geometry_name,
    half_space_part,
    live_identity,
    other_geometries,
    outward_triangles,
)
from drake_polygrasp.loading.rigid_group import find_group
from drake_polygrasp.loading.shapes import part_of, repaired


@dataclass(frozen=True, eq=False)
class Surroundings:
    """Collision geometry around a body, at fixed poses in its frame B.

    Attributes:
        parts: name, shape and pose X_BG of each collision geometry. The name is its body's, or its
            own where it belongs to the world.
        body: identity of the body that these surround; None where it is not known.
    """

    parts: tuple[tuple[str, Shape, RigidTransform], ...]
    body: BodyIdentity | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parts, each once."""
        return tuple(dict.fromkeys(name for name, _, _ in self.parts))


def surroundings_from_plant(
    plant: MultibodyPlant,
    body: RigidBody | BodyIndex | str,
    context: Context,
    *,
    ignore: Collection[Ignored] = (),
) -> Surroundings:
    """Returns the collision geometry around a body at the poses in the context.

    `certify_in_plant` checks that no fingertip penetrates it.

        around = surroundings_from_plant(plant, body, context, ignore=[gripper])
        report = certify_in_plant(mug, plan.grasps[0], surroundings=around)

    Args:
        plant: the plant, finalized, and connected to a SceneGraph in a diagram.
        body: the body to grasp, its index or its name.
        context: the plant's context, taken from the diagram's.
        ignore: bodies, model instances and geometries that are left out, such as the gripper.

    Raises:
        UsageError: when plant, body and context do not belong together.
        ModelError: when a shape cannot be read, or is deformable.
    """
    body = find_body(plant, body)
    query = query_of(plant, body, context)
    inspector = query.inspector()
    X_BW = query.GetPoseInWorld(plant.GetBodyFrameIdOrThrow(body.index())).inverse()
    colliders = find_group(plant, body, context).colliders(plant, inspector)
    own = {collider.geometry for collider in colliders}
    parts = []
    for geometry in other_geometries(plant, query, own, ignore):
        name = geometry_name(plant, inspector, geometry)
        if inspector.IsDeformableGeometry(geometry):
            raise ModelError(f"obstacle '{name}' is deformable; put its geometry into `ignore`")
        with drake_errors_as_model_errors(f"obstacle '{name}'"):
            shape = repaired(inspector.GetShape(geometry))
        parts.append((name, shape, X_BW @ query.GetPoseInWorld(geometry)))
    return Surroundings(tuple(parts), live_identity(inspector, colliders, body))


def obstacles_of(surroundings: Surroundings, object_: GraspObject, reach: float) -> Obstacles:
    """Returns surroundings as obstacles of contacts, as `obstacles_from_plant` returns them.

    Args:
        surroundings: what is around the object.
        object_: the object.
        reach: distance from the object's bounding box beyond which geometry is left out [m].

    Raises:
        ModelError: when a shape has no surface.
    """
    corners = object_.polyhedron.triangles_B.reshape(-1, 3)
    near = corners.min(axis=0) - reach, corners.max(axis=0) + reach
    names, parts = [], []
    for name, shape, X_BG in surroundings.parts:
        if isinstance(shape, HalfSpace):
            part = half_space_part(X_BG, near)
        else:
            with drake_errors_as_model_errors(f"obstacle '{name}'"):
                part = part_of(shape, X_BG, mu=0.0)
            if part is None:
                raise ModelError(
                    f"obstacle '{name}' is a {type(shape).__name__}, which has no surface to "
                    "measure; leave it out of the surroundings"
                )
            p_B = part.triangles_B.reshape(-1, 3)
            if (p_B.min(axis=0) > near[1]).any() or (p_B.max(axis=0) < near[0]).any():
                continue
        if part is not None:
            names.append(name)
            parts.append(part)
    surfaces = [outward_triangles(part) for part in parts if part.primitive is None]
    none = np.empty((0, 3, 3)), np.empty(0, dtype=bool)
    triangles, closed = (np.concatenate(x) for x in zip(none, *surfaces, strict=True))
    return Obstacles(
        X_WB=RigidTransform(),
        names=tuple(dict.fromkeys(names)),
        triangles_B=frozen(triangles),
        closed=frozen(closed, bool),
        primitives=tuple(part.primitive for part in parts if part.primitive is not None),
        reach=reach,
        body=surroundings.body,
    )


def load_surroundings(
    scene_file: str | Path,
    object_: GraspObject,
    *,
    mu: float | None = None,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> Surroundings:
    """Returns the collision geometry around an object in a scene file, at its default poses.

    Args:
        scene_file: model directives, or another file that Drake's Parser reads. It holds the object
            too, under the names of its model and body, or its body's name alone.
        object_: the object to grasp, loaded from a file.
        mu: friction coefficient that the object was loaded with in place of its model's.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.

    Returns:
        The collision geometry of all other bodies, in the object's frame B.

    Raises:
        UsageError: when an argument has the wrong type or value, or the object came from no file.
        ModelError: when the scene cannot be loaded, or its body differs from the object.
    """
    check_path("scene_file", scene_file)
    check_instance("object_", object_, GraspObject, "as load_object returns it")
    package_paths = check_paths("package_paths", package_paths)
    if object_.source is None:
        raise UsageError(
            "the object came from no file, so it cannot be found in a scene; load it from one"
        )
    source = object_.source
    full_name = scoped_name(source)
    files = parse_files(scene_file, package_paths, packages)
    try:
        parsed = choose_body(files, full_name)
    except ModelError as error:
        if f"no body '{full_name}'" not in str(error):
            raise
        # Directives may give the model another name.
        parsed = _choose_by_body_alone(files, scene_file, source)
    builder = DiagramBuilder()
    plant, scene_graph = builder.AddSystem(parsed.plant), builder.AddSystem(parsed.scene_graph)
    builder.Connect(scene_graph.get_query_output_port(), plant.get_geometry_query_input_port())
    builder.Connect(
        plant.get_geometry_pose_output_port(),
        scene_graph.get_source_pose_port(plant.get_source_id()),
    )
    with drake_errors_as_model_errors(scene_file):
        context = plant.GetMyContextFromRoot(builder.Build().CreateDefaultContext())
    body = parsed.group.body
    try:
        # Raises unless it has the object's surface and mass, and its friction at least.
        object_from_plant(
            plant,
            body,
            context,
            model_file=source.model_file,
            body_name=full_name,
            mu=mu,
            package_paths=package_paths,
            packages=packages,
            patch_angle=source.patch_angle,
            patch_depth=source.patch_depth,
            joints_free=source.joints_free,
            scale=source.scale,
        )
    except ModelError as error:
        raise ModelError(f"{scene_file} holds another object: {error}") from error
    # Links on its joints belong to the object, also where it was loaded without them.
    own = [cover.geometry for cover in parsed.group.covers(plant, scene_graph.model_inspector())]
    around = surroundings_from_plant(plant, body, context, ignore=own)
    return replace(around, body=object_.body)  # In the scene it may have another name.


def _choose_by_body_alone(
    files: ParsedFiles, scene_file: str | Path, source: ModelSource
) -> ParsedModel:
    try:
        return choose_body(files, source.body_name)
    except ModelError as error:
        if "several bodies to grasp" not in str(error):
            raise
        raise ModelError(
            f"{scene_file} has several bodies '{source.body_name}'; give the model of the one that "
            f"is grasped the name '{source.model_name}'"
        ) from error

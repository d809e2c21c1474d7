"""From a model file to the object to grasp.

Drake reads the files; what it assumes silently where they say nothing is looked up in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from pydrake.geometry import GeometryId, SceneGraphInspector, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia

from drake_polygrasp.grasp import GraspObject, ModelSource
from drake_polygrasp.loading.body_object import (
    DEFAULT_MU,
    MassProperties,
    check_friction,
    collision_surface,
    lesser_friction,
    object_of,
    stated_friction,
)
from drake_polygrasp.loading.model_source import is_uri
from drake_polygrasp.loading.model_statements import Statements, read_statements
from drake_polygrasp.loading.parsed_model import parse_model
from drake_polygrasp.loading.shapes import is_hull


@dataclass(frozen=True)
class Solid:
    """A body as its model has it."""

    M_BBo_B: SpatialInertia
    """About Bo, expressed in B."""
    parts: tuple[tuple[Shape, RigidTransform], ...]
    """Each collision geometry G's shape and pose X_BG."""
    is_hulls: bool
    """Whether each part is its own convex hull, which is what point contact makes of a Mesh."""


def load_object(
    model_file: str | Path,
    *,
    body_name: str | None = None,
    mu: float | None = None,
    package_paths: Sequence[str | Path] = (),
    patch_angle: float | None = None,
    patch_depth: float | None = None,
) -> GraspObject:
    """Load the body to grasp from a file that Drake's Parser reads.

    `model_file` is a path or a package:// URI. Packages are searched below `package_paths` and
    in the folders above the model file. `body_name` may be left out when just one body has
    collision geometry; `model::body` tells bodies of one name apart. `mu` replaces the friction
    of the model, which is else the lesser of each geometry's static and dynamic coefficients:
    in discrete time Drake's bodies slide at the dynamic one. Surfaces of very many facets become
    patches whose normals lean by at most `patch_angle` [rad] (default: 12 degrees) and whose
    facets lie about `patch_depth` [m] (default: 0.005 of the diameter) off a plane.

    Raises ModelError when a file is missing or malformed, the body cannot be told, or its
    collision geometry is nothing to hold; UsageError when `mu` is not above 0 or a patch cannot
    be as asked for.
    """
    check_friction(mu, str(model_file))
    files, plant, scene_graph, body, warnings = parse_model(model_file, body_name, package_paths)
    statements = read_statements(files.documents, body.name())
    where = f"{files.model_file}: body '{body.name()}'"
    inspector = scene_graph.model_inspector()
    geometries = plant.GetCollisionGeometriesForBody(body)
    if mu is None:
        friction, assumed = _friction(inspector, geometries, statements, where)
        warnings += assumed
    else:
        friction = [mu] * len(geometries)
    polyhedron = collision_surface(inspector, geometries, friction, where, patch_angle, patch_depth)
    has_mass = statements.mass and body.default_mass() > 0
    source = ModelSource(
        model_file=model_file if is_uri(model_file) else files.model_file.absolute(),
        sha256=files.sha256,
        model_name=plant.GetModelInstanceName(body.model_instance()),
        body_name=body.name(),
        patch_angle=patch_angle,
        patch_depth=patch_depth,
    )
    stated = _mass(plant, body) if has_mass else None
    return object_of(polyhedron, stated, where, warnings, source)


def load_solid(source: ModelSource, package_paths: Sequence[str | Path] = ()) -> Solid:
    """The body that an object came from, read again, for plants of our own.

    Raises ModelError as `load_object` does.
    """
    body_name = f"{source.model_name}::{source.body_name}"
    _, plant, scene_graph, body, _ = parse_model(source.model_file, body_name, package_paths)
    inspector = scene_graph.model_inspector()
    parts = tuple(
        (inspector.GetShape(geometry).Clone(), inspector.GetPoseInFrame(geometry))
        for geometry in plant.GetCollisionGeometriesForBody(body)
    )
    return Solid(
        body.default_spatial_inertia(),
        parts,
        all(is_hull(shape) for shape, _ in parts),
    )


def _friction(
    inspector: SceneGraphInspector,
    geometries: list[GeometryId],
    statements: Statements,
    where: str,
) -> tuple[list[float], list[str]]:
    """The coefficient of each geometry, and what was assumed of it."""
    friction: list[float] = []
    warnings: list[str] = []
    for k, geometry in enumerate(geometries):
        pair = stated_friction(inspector, geometry)
        # Drake's default; only the file can tell whether it was meant.
        if pair is None or (pair == (1, 1) and not statements.state_friction(k, len(geometries))):
            friction.append(DEFAULT_MU)
            warnings.append(f"{where} states no friction; {DEFAULT_MU} is assumed")
        else:
            mu, said = lesser_friction(*pair, inspector.GetName(geometry), where)
            friction.append(mu)
            warnings += said
    return friction, warnings


def _mass(plant: MultibodyPlant, body: RigidBody) -> MassProperties:
    context = plant.CreateDefaultContext()
    return MassProperties(body.get_mass(context), body.CalcCenterOfMassInBodyFrame(context))

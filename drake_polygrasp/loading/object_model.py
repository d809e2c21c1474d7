"""From a model file to the object to grasp.

Drake reads the files; what it assumes silently where they say nothing is looked up in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.geometry import GeometryId, SceneGraphInspector, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody, SpatialInertia

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.errors import ModelError, UsageError
from drake_polygrasp.geometry.patches import PATCH_ANGLE
from drake_polygrasp.geometry.polyhedron import (
    FLATNESS,
    Polyhedron,
    farthest_distance,
    volume_centroid,
)
from drake_polygrasp.geometry.surface import Part, build_polyhedron
from drake_polygrasp.grasp import GraspObject, ModelSource
from drake_polygrasp.loading.model_source import is_uri
from drake_polygrasp.loading.model_statements import MAX_FRICTION, Statements, read_statements
from drake_polygrasp.loading.parsed_model import blaming, parse_model
from drake_polygrasp.loading.shapes import is_hull, part_of

DEFAULT_MU = 0.3
"""The paper's own coefficient, for models that state none."""
_FRICTION = f"it must be above 0 and at most {MAX_FRICTION:g}"


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
    patch_angle: float = PATCH_ANGLE,
    patch_depth: float | None = None,
) -> GraspObject:
    """Load the body to grasp from a file that Drake's Parser reads.

    `model_file` is a path or a package:// URI. Packages are searched below `package_paths` and
    in the folders above the model file. `body_name` may be left out when just one body has
    collision geometry; `model::body` tells bodies of one name apart. `mu` replaces the friction
    of the model, which is else the lesser of each geometry's static and dynamic coefficients:
    in discrete time Drake's bodies slide at the dynamic one. Surfaces of very many facets become
    patches whose normals lean by at most `patch_angle` [rad] and whose facets lie about
    `patch_depth` [m] (default: 0.005 of the diameter) off a plane.

    Raises ModelError when a file is missing or malformed, the body cannot be told, or its
    collision geometry is nothing to hold; UsageError when `mu` is not above 0.
    """
    if mu is not None and not 0 < mu <= MAX_FRICTION:
        raise UsageError(f"the friction given for {model_file} is {mu}; {_FRICTION}")
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
    polyhedron = _polyhedron(inspector, geometries, friction, where, patch_angle, patch_depth)
    if not polyhedron.watertight:
        warnings.append(f"{where}: its surface is not closed; what lies inside is a guess")
    has_mass = statements.mass and body.default_mass() > 0
    mass, p_BBcm = _mass(plant, body) if has_mass else (None, volume_centroid(polyhedron))
    if mass is None:
        warnings.append(f"{where} states no mass; its centre is taken to be that of the volume")
    with np.errstate(all="ignore"):
        rho = farthest_distance(polyhedron, p_BBcm)
    if not np.isfinite(rho):
        raise ModelError(f"{where}: its centre of mass is beyond measure; state it in metres")
    return GraspObject(
        polyhedron=polyhedron,
        mass=mass,
        p_BBcm=frozen(p_BBcm),
        rho=rho,
        source=ModelSource(
            model_file=model_file if is_uri(model_file) else files.model_file.absolute(),
            sha256=files.sha256,
            model_name=plant.GetModelInstanceName(body.model_instance()),
            body_name=body.name(),
        ),
        warnings=tuple(dict.fromkeys(warnings)),
    )


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
        properties = inspector.GetProximityProperties(geometry)
        name = inspector.GetName(geometry)
        stated = properties.HasProperty("material", "coulomb_friction")
        if stated:
            pair = properties.GetProperty("material", "coulomb_friction")
            static, dynamic = pair.static_friction(), pair.dynamic_friction()
            # Drake's default; only the file can tell whether it was meant.
            stated = (static, dynamic) != (1, 1) or statements.state_friction(k, len(geometries))
        if not stated:
            friction.append(DEFAULT_MU)
            warnings.append(f"{where} states no friction; {DEFAULT_MU} is assumed")
            continue
        friction.append(min(static, dynamic))
        if static != dynamic:
            warnings.append(
                f"{where}: the friction of '{name}' is {static} static, {dynamic} dynamic; "
                f"{min(static, dynamic)} is used, for Drake's discrete contact slides at the latter"
            )
        if not 0 < friction[-1] <= MAX_FRICTION:
            raise ModelError(f"{where}: the friction of '{name}' is {friction[-1]}; {_FRICTION}")
    return friction, warnings


def _polyhedron(
    inspector: SceneGraphInspector,
    geometries: list[GeometryId],
    friction: Sequence[float],
    where: str,
    patch_angle: float,
    patch_depth: float | None,
) -> Polyhedron:
    parts: list[Part] = []
    for geometry, mu in zip(geometries, friction, strict=True):
        shape = inspector.GetShape(geometry)
        with blaming(where):
            part = part_of(shape, inspector.GetPoseInFrame(geometry), mu)
        if part is None:
            raise ModelError(
                f"{where}: collision geometry '{inspector.GetName(geometry)}' is a "
                f"{type(shape).__name__}, which fingers cannot hold; remove it or replace it"
            )
        parts.append(part)
    try:
        polyhedron = build_polyhedron(parts, patch_angle, patch_depth)
    except ModelError as error:
        raise ModelError(f"{where}: {error}") from error
    if _is_flat(polyhedron):
        raise ModelError(f"{where}: its surface is flat; a grasp needs a solid")
    return polyhedron


def _is_flat(polyhedron: Polyhedron) -> bool:
    vertices = polyhedron.triangles_B.reshape(-1, 3)
    about = vertices - vertices.mean(axis=0)
    _, axes = np.linalg.eigh(about.T @ about)
    return bool(np.ptp(about @ axes[:, 0]) <= FLATNESS * polyhedron.diameter)


def _mass(plant: MultibodyPlant, body: RigidBody) -> tuple[float, Array]:
    context = plant.CreateDefaultContext()
    return body.get_mass(context), body.CalcCenterOfMassInBodyFrame(context)

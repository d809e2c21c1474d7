"""From a model file, or a body in a plant, to the object to grasp.

Drake reads the files; what it assumes silently where they say nothing is looked up in them.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from textwrap import shorten
from typing import NamedTuple

import numpy as np
from pydrake.geometry import (
    GeometryId,
    Mesh,
    SceneGraph,
    SceneGraphInspector,
    Shape,
)
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody, SpatialInertia

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.errors import ModelError, PolygraspError, UsageError
from drake_polygrasp.grasp import GraspObject, ModelSource
from drake_polygrasp.mesh_file import check_mesh_file
from drake_polygrasp.model_source import (
    ModelFiles,
    find_packages,
    is_uri,
    locate,
    model_digest,
    read_model_files,
)
from drake_polygrasp.model_statements import MAX_FRICTION, Statements, read_statements
from drake_polygrasp.patches import PATCH_ANGLE
from drake_polygrasp.polyhedron import (
    FLATNESS,
    Polyhedron,
    farthest_distance,
    volume_centroid,
)
from drake_polygrasp.shapes import is_hull, part_of
from drake_polygrasp.surface import Part, build_polyhedron

__all__ = ["DEFAULT_MU", "Solid", "load_object", "load_solid", "model_digest"]

DEFAULT_MU = 0.3
"""The paper's own coefficient, for models that state none."""
_FRICTION = f"it must be above 0 and at most {MAX_FRICTION:g}"
MAX_REASON = 400
"""Of Drake's words on a file, ours: it may quote the whole file."""


@dataclass(frozen=True)
class Solid:
    """A body as its model has it."""

    M_BBo_B: SpatialInertia
    """About Bo, expressed in B."""
    parts: tuple[tuple[Shape, RigidTransform], ...]
    """Each collision geometry G's shape and pose X_BG."""
    is_hulls: bool
    """Whether each part is its own convex hull, which is what point contact makes of a Mesh."""


class _Opened(NamedTuple):
    """What a model file holds, the body that was asked for, and what Drake warned of."""

    files: ModelFiles
    plant: MultibodyPlant
    scene_graph: SceneGraph
    body: RigidBody
    warnings: list[str]


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
    files, plant, scene_graph, body, warnings = _open(model_file, body_name, package_paths)
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
    _, plant, scene_graph, body, _ = _open(source.model_file, body_name, package_paths)
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


def _open(
    model_file: str | Path, body_name: str | None, package_paths: Sequence[str | Path]
) -> _Opened:
    packages = find_packages(model_file, package_paths)
    files = read_model_files(locate(model_file, packages), packages)
    for mesh in files.meshes:
        check_mesh_file(mesh)
    with _drake_warnings() as warnings, _blaming(files.model_file):
        plant, scene_graph = _parse(files.model_file, packages)
    body = _choose_body(plant, body_name, files.model_file)
    return _Opened(files, plant, scene_graph, body, warnings)


@contextmanager
def _blaming(where: Path | str) -> Iterator[None]:
    """Drake's errors, failed assertions too, which it raises as SystemExit, become ModelErrors."""
    try:
        yield
    except (PolygraspError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        reason = shorten(str(error), MAX_REASON)
        raise ModelError(f"{where}: Drake cannot load it: {reason}") from error


@contextmanager
def _drake_warnings() -> Iterator[list[str]]:
    """Collects what Drake would log."""

    class Collector(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            messages.append(shorten(record.getMessage(), MAX_REASON))

    messages: list[str] = []
    logger, collector = logging.getLogger("drake"), Collector(logging.WARNING)
    propagate, logger.propagate = logger.propagate, False
    logger.addHandler(collector)
    try:
        yield messages
    finally:
        logger.removeHandler(collector)
        logger.propagate = propagate


def _parse(model_file: Path, packages: PackageMap) -> tuple[MultibodyPlant, SceneGraph]:
    plant, scene_graph = _empty_plant()
    parser = Parser(plant, scene_graph)
    parser.package_map().AddMap(packages)
    try:
        parser.AddModels(str(model_file))
    except RuntimeError:
        if model_file.suffix.lower() != ".obj":
            raise
        plant, scene_graph = _empty_plant()
        _add_surface(plant, model_file)
    plant.Finalize()
    return plant, scene_graph


def _empty_plant() -> tuple[MultibodyPlant, SceneGraph]:
    plant, scene_graph = MultibodyPlant(time_step=0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    return plant, scene_graph


def _add_surface(plant: MultibodyPlant, mesh_file: Path) -> None:
    """What the Parser makes of an OBJ file, but of one whose triangles give no mass properties."""
    logging.getLogger("drake").warning(
        "%s: its triangles are flat, open or wound inward, so that Drake finds no mass in them; "
        "a ball of 1 kg stands in for it",
        mesh_file,
    )
    name, mesh = mesh_file.stem, Mesh(str(mesh_file))
    ball = SpatialInertia.SolidSphereWithMass(1.0, 1.0)
    body = plant.AddRigidBody(name, plant.AddModelInstance(name), ball)
    friction = CoulombFriction(1.0, 1.0)  # The Parser's own.
    plant.RegisterCollisionGeometry(body, RigidTransform(), mesh, name, friction)


def _choose_body(plant: MultibodyPlant, name: str | None, model_file: Path) -> RigidBody:
    bodies = [plant.get_body(BodyIndex(k)) for k in range(1, plant.num_bodies())]
    if name is not None:
        named = [body for body in bodies if name in (body.name(), str(body.scoped_name()))]
        if not named:
            raise ModelError(f"no body '{name}' in {model_file}; it has {_names(bodies)}")
        bodies = named
    solid = [body for body in bodies if plant.GetCollisionGeometriesForBody(body)]
    if not solid:
        raise ModelError(
            f"{model_file}: no collision geometry on {_names(bodies) or 'any body'}; "
            "a grasp needs what fingers can touch"
        )
    if len(solid) > 1:
        raise ModelError(
            f"{model_file} has several bodies to grasp: {_names(solid)}; "
            "name one of them (body_name, --body)"
        )
    return solid[0]


def _names(bodies: list[RigidBody]) -> str:
    """Quoted, with the model's name where the body's alone would not tell them apart."""
    short = [body.name() for body in bodies]
    unique = len(set(short)) == len(short)
    return ", ".join(f"'{body.name() if unique else body.scoped_name()}'" for body in bodies)


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
        with _blaming(where):
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

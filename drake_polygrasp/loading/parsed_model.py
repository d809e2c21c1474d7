"""Parses a model file with Drake, and chooses the rigid body to grasp."""

from __future__ import annotations

import logging
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from pydrake.geometry import Mesh, SceneGraph, Shape
from pydrake.math import RigidTransform
from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import CoulombFriction, MultibodyPlant
from pydrake.multibody.tree import CalcSpatialInertia, RigidBody, SpatialInertia
from pydrake.systems.framework import Context

from drake_polygrasp.errors import ModelError, PolygraspError, SeveralBodiesError
from drake_polygrasp.loading.collision_mesh import read_collision_mesh
from drake_polygrasp.loading.drake_messages import collect_drake_log, drake_reason
from drake_polygrasp.loading.mesh_file import check_meshes
from drake_polygrasp.loading.model_source import ModelFiles, read_model_files
from drake_polygrasp.loading.packages import (
    find_packages,
    locate,
    missing_package,
    use_packages,
    without_network,
)
from drake_polygrasp.loading.rigid_group import RigidGroup, find_group, rigid_bodies

_DENSITY = 1000.0
"""Density by which Drake's Parser gives an OBJ file its mass [kg/m^3]."""


class ParsedFiles(NamedTuple):
    """What Drake's Parser made of a model file, with all its bodies.

    Attributes:
        files: the model file and all that it refers to.
        plant: the finalized plant.
        scene_graph: its scene graph.
        warnings: what Drake logged, and what it left out.
    """

    files: ModelFiles
    plant: MultibodyPlant
    scene_graph: SceneGraph
    warnings: tuple[str, ...]


class ParsedModel(NamedTuple):
    """A parsed model and the rigid body chosen in it.

    Attributes:
        files: the model file and all that it refers to.
        plant: the finalized plant that Drake made of it.
        scene_graph: its scene graph.
        context: the plant's default context: the model's default posture.
        group: the chosen rigid body.
        warnings: what Drake logged, and what it left out.
    """

    files: ModelFiles
    plant: MultibodyPlant
    scene_graph: SceneGraph
    context: Context
    group: RigidGroup
    warnings: list[str]


def parse_files(
    model_file: str | Path,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
    scale: float | None = None,
) -> ParsedFiles:
    """Parses a model file with all that it refers to.

    Meshes are checked before Drake reads them, because some malformed ones abort the process.

    Args:
        model_file: a path, or a package:// URI.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.
        scale: factor on the lengths of an OBJ file; None for 1.

    Returns:
        The files and the finalized plant.

    Raises:
        ModelError: when a file is missing or malformed.
    """
    package_map = find_packages(model_file, package_paths, packages)
    files = read_model_files(locate(model_file, package_map), package_map)
    check_meshes(files.meshes, files.model_file)
    with collect_drake_log() as log, drake_errors_as_model_errors(files.model_file, log.errors):
        plant, scene_graph = _parse(files.model_file, package_map, scale)
    return ParsedFiles(files, plant, scene_graph, (*log.merged(), *files.warnings))


def choose_body(parsed: ParsedFiles, body_name: str | None = None) -> ParsedModel:
    """Finds the rigid body to grasp in a parsed model.

    Args:
        parsed: the model.
        body_name: name of one of the body's links, alone or as "model::link"; None for the only
            rigid body that has collision geometry.

    Returns:
        The model with the body, in the default posture.

    Raises:
        ModelError: when there is no such body, several, or none with collision geometry.
    """
    files, plant, scene_graph, warnings = parsed
    body = _choose_body(plant, body_name, files.model_file, warnings)
    context = plant.CreateDefaultContext()
    group = find_group(plant, body, context)
    return ParsedModel(files, plant, scene_graph, context, group, list(warnings))


@contextmanager
def drake_errors_as_model_errors(where: Path | str, logged: Sequence[str] = ()) -> Iterator[None]:
    """Turns Drake's errors into ModelErrors, failed assertions, raised as SystemExit, included.

    Args:
        where: the file or geometry that messages name.
        logged: errors that Drake logged before; the last often has details that the error lacks.

    Yields:
        None; the body of the `with` statement may call Drake.

    Raises:
        ModelError: when Drake raises an error.
    """
    try:
        yield
    except (PolygraspError, MemoryError):
        raise
    except (Exception, SystemExit) as error:
        reason = missing_package(str(error)) or drake_reason(str(error), where, logged)
        raise ModelError(f"{where}: Drake cannot load it: {reason}") from error


def _parse(
    model_file: Path, package_map: PackageMap, scale: float | None
) -> tuple[MultibodyPlant, SceneGraph]:
    """Returns a finalized plant of the model; an OBJ file that the Parser rejects is added here."""
    plant, scene_graph = _empty_plant()
    if scale is not None:
        _add_surface(plant, model_file, scale)
        plant.Finalize()
        return plant, scene_graph
    parser = Parser(plant, scene_graph)
    use_packages(parser, package_map)
    try:
        with without_network():
            parser.AddModels(str(model_file))
    except RuntimeError:
        if model_file.suffix.lower() != ".obj":
            raise
        plant, scene_graph = _empty_plant()
        _add_surface(plant, model_file, 1.0)
    plant.Finalize()
    return plant, scene_graph


def _empty_plant() -> tuple[MultibodyPlant, SceneGraph]:
    plant, scene_graph = MultibodyPlant(time_step=0.0), SceneGraph()
    plant.RegisterAsSourceForSceneGraph(scene_graph)
    return plant, scene_graph


def _add_surface(plant: MultibodyPlant, mesh_file: Path, scale: float) -> None:
    """Adds an OBJ file as Drake's Parser does, but scaled, and also where it encloses no volume."""
    name, mesh = mesh_file.stem, Mesh(str(mesh_file), scale)
    M_BBo_B = _spatial_inertia(read_collision_mesh(mesh).shape)
    if M_BBo_B is None:
        logging.getLogger("drake").warning(
            "%s: its triangles are flat or open, so that Drake cannot compute its mass; that of a "
            "sphere of 1 kg is used",
            mesh_file,
        )
        M_BBo_B = SpatialInertia.SolidSphereWithMass(1.0, 1.0)
    body = plant.AddRigidBody(name, plant.AddModelInstance(name), M_BBo_B)
    friction = CoulombFriction(1.0, 1.0)  # The Parser's default.
    plant.RegisterCollisionGeometry(body, RigidTransform(), mesh, name, friction)


def _spatial_inertia(shape: Shape) -> SpatialInertia | None:
    """Returns M_BBo_B of the shape, None where it encloses no volume."""
    try:
        return CalcSpatialInertia(shape, _DENSITY)
    except (Exception, SystemExit):
        return None


def _choose_body(
    plant: MultibodyPlant, name: str | None, model_file: Path, warnings: Sequence[str]
) -> RigidBody:
    """Returns the link of that name on a rigid body with collision geometry.

    Without a name, returns the base link of the only such body.
    """
    groups = rigid_bodies(plant)
    bodies = [body for group in groups for body in group]
    if name is not None:
        named = [body for body in bodies if name in (body.name(), str(body.scoped_name()))]
        if not named:
            raise ModelError(f"no body '{name}' in {model_file}; it has {_quoted(bodies)}")
        bodies = named
        groups = [group for group in groups if any(body in group for body in named)]
    solid = [group for group in groups if any(_is_solid(plant, body) for body in group)]
    if not solid:
        left_out = [warning for warning in warnings if "leaves out" in warning]
        ignored = [warning for warning in warnings if "ignor" in warning.lower()]
        raise ModelError(
            f"{model_file}: no collision geometry on {_quoted(bodies) or 'any body'}; "
            "a grasp needs a surface to touch, so add some (visual geometry does not count)"
            + (f"; Drake says: {drake_reason(ignored[0], model_file)}" if ignored else "")
            + "".join(f"; {warning}" for warning in left_out)
        )
    chosen = [body for group in solid for body in group if body in bodies]
    if name is None:
        chosen = [group[0] for group in solid]
    elif len(chosen) > 1:
        chosen = [body for body in chosen if _is_solid(plant, body)] or chosen
    if len(chosen) > 1:
        several = SeveralBodiesError(
            f"{model_file} has several bodies to grasp: {_quoted(chosen)}; "
            "name one of them (body_name, --body)"
        )
        several.bodies = tuple(_names(chosen))
        raise several
    return chosen[0]


def _is_solid(plant: MultibodyPlant, body: RigidBody) -> bool:
    return bool(plant.GetCollisionGeometriesForBody(body))


def _names(bodies: list[RigidBody]) -> list[str]:
    """Returns names of bodies, with the model's where their names alone are not unique."""
    short = [body.name() for body in bodies]
    unique = len(set(short)) == len(short)
    return [body.name() if unique else str(body.scoped_name()) for body in bodies]


def _quoted(bodies: list[RigidBody]) -> str:
    return ", ".join(f"'{name}'" for name in _names(bodies))

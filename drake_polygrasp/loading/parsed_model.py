"""Drake reads a model file: its parser, what it would log, and the body that was asked for."""

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

from drake_polygrasp.errors import ModelError, PolygraspError
from drake_polygrasp.loading.collision_mesh import read_collision_mesh
from drake_polygrasp.loading.drake_messages import collect_drake_log, drake_reason
from drake_polygrasp.loading.mesh_file import check_mesh_file
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
"""[kg/m^3], the Parser's own for an OBJ file."""


class ParsedFiles(NamedTuple):
    """What Drake made of a model file, with all its bodies.

    Attributes:
        files: the model file and all that it refers to.
        plant: the finalized plant.
        scene_graph: its scene graph.
        warnings: what Drake warned of.
    """

    files: ModelFiles
    plant: MultibodyPlant
    scene_graph: SceneGraph
    warnings: tuple[str, ...]


class ParsedModel(NamedTuple):
    """What a model file holds, the rigid body that was asked for, and what Drake warned of.

    Attributes:
        files: the model file and all that it refers to.
        plant: the finalized plant that Drake made of it.
        scene_graph: its scene graph.
        context: the plant's own, with the model's defaults.
        group: the links that move as one with the chosen body.
        warnings: what a reader should know of how the model was read.
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

    Meshes are checked before Drake may read them, for some that are malformed end the process.

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
    for mesh in files.meshes:
        check_mesh_file(mesh)
    with collect_drake_log() as log, drake_errors_as_model_errors(files.model_file, log.errors):
        plant, scene_graph = _parse(files.model_file, package_map, scale)
    return ParsedFiles(files, plant, scene_graph, tuple(log.merged()))


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
    """Drake's errors, failed assertions too, which it raises as SystemExit, become ModelErrors.

    The errors that Drake `logged` before may say more.
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
    """What the Parser makes of an OBJ file, but scaled, and also where Drake finds no mass."""
    name, mesh = mesh_file.stem, Mesh(str(mesh_file), scale)
    M_BBo_B = _spatial_inertia(read_collision_mesh(mesh).shape)
    if M_BBo_B is None:
        logging.getLogger("drake").warning(
            "%s: its triangles are flat or open, so that Drake finds no mass in them; a ball of "
            "1 kg stands in for it",
            mesh_file,
        )
        M_BBo_B = SpatialInertia.SolidSphereWithMass(1.0, 1.0)
    body = plant.AddRigidBody(name, plant.AddModelInstance(name), M_BBo_B)
    friction = CoulombFriction(1.0, 1.0)  # The Parser's own.
    plant.RegisterCollisionGeometry(body, RigidTransform(), mesh, name, friction)


def _spatial_inertia(shape: Shape) -> SpatialInertia | None:
    """About Bo, expressed in B; None where the shape encloses no volume."""
    try:
        return CalcSpatialInertia(shape, _DENSITY)
    except (Exception, SystemExit):
        return None


def _choose_body(
    plant: MultibodyPlant, name: str | None, model_file: Path, warnings: Sequence[str]
) -> RigidBody:
    """The link of that name on a rigid body that can be held, or the base link of the only one."""
    groups = rigid_bodies(plant)
    bodies = [body for group in groups for body in group]
    if name is not None:
        named = [body for body in bodies if name in (body.name(), str(body.scoped_name()))]
        if not named:
            raise ModelError(f"no body '{name}' in {model_file}; it has {_names(bodies)}")
        bodies = named
        groups = [group for group in groups if any(body in group for body in named)]
    solid = [group for group in groups if any(_is_solid(plant, body) for body in group)]
    if not solid:
        ignored = [warning for warning in warnings if "ignor" in warning.lower()]
        raise ModelError(
            f"{model_file}: no collision geometry on {_names(bodies) or 'any body'}; "
            "a grasp needs what fingers can touch"
            + (f"; Drake says: {drake_reason(ignored[0], model_file)}" if ignored else "")
        )
    chosen = [body for group in solid for body in group if body in bodies]
    if name is None:
        chosen = [group[0] for group in solid]
    elif len(chosen) > 1:
        chosen = [body for body in chosen if _is_solid(plant, body)] or chosen
    if len(chosen) > 1:
        raise ModelError(
            f"{model_file} has several bodies to grasp: {_names(chosen)}; "
            "name one of them (body_name, --body)"
        )
    return chosen[0]


def _is_solid(plant: MultibodyPlant, body: RigidBody) -> bool:
    return bool(plant.GetCollisionGeometriesForBody(body))


def _names(bodies: list[RigidBody]) -> str:
    """Quoted, with the model's name where the body's alone would not tell them apart."""
    short = [body.name() for body in bodies]
    unique = len(set(short)) == len(short)
    return ", ".join(f"'{body.name() if unique else body.scoped_name()}'" for body in bodies)

"""Adds a model file to the user's plant, with the checks and packages of `load_object`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pydrake.multibody.parsing import PackageMap, Parser
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import ModelInstanceIndex, RigidBody

from drake_polygrasp.loading.drake_messages import collect_drake_log
from drake_polygrasp.loading.mesh_file import check_meshes
from drake_polygrasp.loading.model_source import ModelFiles, read_model_files
from drake_polygrasp.loading.packages import find_packages, locate, use_packages, without_network
from drake_polygrasp.loading.parsed_model import drake_errors_as_model_errors


def add_model(
    plant: MultibodyPlant,
    model_file: str | Path,
    *,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
    name_prefix: str | None = None,
) -> list[RigidBody]:
    """Adds all models of a file to a plant, after the checks of `load_object`.

        plant, _ = AddMultibodyPlantSceneGraph(builder, time_step=1e-3)
        (body,) = add_model(plant, "models/l_bracket/l_bracket.sdf")
        plant.Finalize()

    Meshes are checked before Drake reads them, because some malformed ones abort the process.

    Args:
        plant: the plant, registered with a SceneGraph and not finalized yet.
        model_file: a path, or a package:// URI.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.
        name_prefix: scope put before the names of the file's models, as "prefix::model".

    Returns:
        The bodies that have collision geometry, in the file's order.

    Raises:
        ModelError: when a file is missing or malformed.
    """
    package_map = find_packages(model_file, package_paths, packages)
    files = read_model_files(locate(model_file, package_map), package_map)
    models = add_model_files(plant, files, package_map, name_prefix or "")
    bodies = [plant.get_body(index) for model in models for index in plant.GetBodyIndices(model)]
    return [body for body in bodies if plant.GetCollisionGeometriesForBody(body)]


def add_model_files(
    plant: MultibodyPlant, files: ModelFiles, package_map: PackageMap, name_prefix: str = ""
) -> list[ModelInstanceIndex]:
    """Adds all models of files that were read already to a plant.

    Args:
        plant: the plant, registered with a SceneGraph and not finalized yet.
        files: the model file and all that it refers to.
        package_map: the packages that URIs may name.
        name_prefix: scope put before the names of the file's models; empty for none.

    Returns:
        The models added.

    Raises:
        ModelError: when a mesh or the model is malformed.
    """
    check_meshes(files.meshes, files.model_file)
    parser = Parser(plant, model_name_prefix=name_prefix)
    use_packages(parser, package_map)
    with (
        collect_drake_log() as log,
        drake_errors_as_model_errors(files.model_file, log.errors),
        without_network(),
    ):
        models: list[ModelInstanceIndex] = parser.AddModels(str(files.model_file))
    return models

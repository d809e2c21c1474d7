"""Finds and loads the model that a grasp file names, with the options that the file states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pydrake.multibody.parsing import PackageMap

from drake_polygrasp.arguments import check_paths
from drake_polygrasp.errors import ModelError
from drake_polygrasp.files.grasp_file import load_grasps
from drake_polygrasp.files.stated_grasp import GraspFile
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.model_source import model_digest
from drake_polygrasp.loading.object_model import reload_object
from drake_polygrasp.loading.packages import find_packages, resolve


def find_stated_model(file: GraspFile, package_map: PackageMap) -> Path:
    """Returns the path of the model file that a grasp file names.

    Args:
        file: the grasp file.
        package_map: folders of packages, as `find_packages` finds them.

    Returns:
        The path of a file that exists.

    Raises:
        ModelError: when there is no such file or package.
    """
    model_file = resolve(file.object_.model_file, file.path.parent, package_map)
    try:
        found = model_file.is_file()
    except OSError:  # a name too long for any file
        found = False
    if not found:
        raise ModelError(f"{model_file}: there is no such model file; {file.path} names it")
    return model_file


def load_stated_object(
    file: GraspFile,
    model_file: Path,
    package_paths: Sequence[Path | str] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> GraspObject:
    """Loads the object of a grasp file with the options and the friction that the file states.

    Args:
        file: the grasp file.
        model_file: its model, as `find_stated_model` returns it; it may have changed since.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.

    Returns:
        The object as the model has it now.

    Raises:
        ModelError: when the model cannot be loaded or has no such body.
        MissingPackageError: when a package that it refers to is not found.
    """
    source = file.object_.source_at(model_file)
    return reload_object(source, mu=file.plan.mu, package_paths=package_paths, packages=packages)


def load_planned_object(
    grasp_file: Path | str,
    package_paths: Sequence[Path | str] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> GraspObject:
    """Loads the object that the grasps of a file were planned on, with the same options.

        cube = load_planned_object("cube.grasp.yaml")
        plan = plan_grasps(cube, obstacles=obstacles)

    Args:
        grasp_file: the grasp file, which says how its model was loaded.
        package_paths: folders searched for the packages of package:// URIs.
        packages: folders of packages by name.

    Returns:
        The object.

    Raises:
        GraspFileError: when the file cannot be read or breaks the format.
        ModelError: when its model is missing, malformed or has changed since.
        MissingPackageError: when a package that it refers to is not found.
    """
    package_paths = check_paths("package_paths", package_paths)
    file = load_grasps(grasp_file)
    model_file = find_stated_model(file, find_packages(file.path, package_paths, packages))
    if model_digest(model_file, package_paths, packages) != file.object_.sha256:
        raise ModelError(
            f"{model_file}: has changed since the grasps of {file.path} were planned; plan again"
        )
    return load_stated_object(file, model_file, package_paths, packages)

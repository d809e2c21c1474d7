"""Finds and loads the model that a grasp file names, with the options that the file states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from pydrake.multibody.parsing import PackageMap

from drake_polygrasp.errors import ModelError
from drake_polygrasp.files.stated_grasp import GraspFile
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.object_model import reload_object
from drake_polygrasp.loading.packages import resolve


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

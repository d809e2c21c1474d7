"""Finds the packages that a model's URIs name, for this package's own readers and for Drake's.

A package is a folder with a package.xml, as in ROS, which states its name; or a Gazebo model
folder, which has a model.config and is named as the folder. The siblings of a model's Gazebo folder
are packages too, since Gazebo looks for models in the folder above. Nothing is downloaded: Drake's
remote packages are used only if a copy is on this machine.
"""

from __future__ import annotations

import logging
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from pydrake.multibody.parsing import PackageMap, Parser

from drake_polygrasp.arguments import check_packages
from drake_polygrasp.errors import MissingPackageError, ModelError
from drake_polygrasp.loading.model_document import read_xml

_URI = re.compile(r"(?s)([a-z0-9+.-]+)://([^/]*)(/*)(.*)")
_SCHEMES = ("package", "model", "file")
_NETWORK = "DRAKE_ALLOW_NETWORK"
"""The environment variable that tells Drake whether it may download packages."""
_UNKNOWN = re.compile(r"unknown package '([^']*)'")
_DOWNLOADING = re.compile(r"when downloading '([^']*)'")


def is_uri(model_file: str | Path) -> bool:
    """Returns whether a model file is given as a package://, model:// or file:// URI.

    Args:
        model_file: a path or URI.
    """
    match = _URI.match(str(model_file))
    return match is not None and match[1] in _SCHEMES


def locate(model_file: str | Path, package_map: PackageMap) -> Path:
    """Returns the path of a model file.

    Args:
        model_file: a path, or a URI.
        package_map: the known packages.
    """
    is_path = not is_uri(model_file)
    return Path(model_file) if is_path else resolve(str(model_file), Path(), package_map)


def resolve(uri: str, folder: Path, package_map: PackageMap) -> Path:
    """Returns the path of a URI, or of a path relative to a folder.

    Args:
        uri: the URI or path.
        folder: the folder that a path is relative to.
        package_map: the known packages.

    Raises:
        MissingPackageError: when its package is unknown, or not on this machine.
        ModelError: when Drake does not read URIs of that form.
    """
    uri = uri.strip()
    match = _URI.match(uri)
    if match is None:
        return folder / uri
    scheme, name, slash, inner = match.groups()
    if scheme not in _SCHEMES:
        raise ModelError(f"{uri}: nothing is downloaded by {scheme}; name a file or a package")
    if not slash:
        raise ModelError(f"{uri}: Drake needs a slash after the package's name; write {uri}/")
    if scheme == "file":
        return Path("/", inner)
    if not package_map.Contains(name):
        raise MissingPackageError(f"{uri}: package '{name}' is unknown; {_remedy(name)}")
    try:
        with without_network():
            return Path(package_map.GetPath(name)) / inner
    except RuntimeError:
        raise MissingPackageError(f"{uri}: {_remote(name)}") from None


def find_packages(
    model_file: str | Path,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> PackageMap:
    """Finds the packages that a model's URIs may name.

    Args:
        model_file: the model. Packages whose folders hold it are found, and the siblings of a
            Gazebo model folder; none where it is a URI.
        package_paths: folders searched for packages.
        packages: folders of packages by name, which take precedence.

    Returns:
        These packages and Drake's own.

    Raises:
        ModelError: when a folder does not exist, or a package.xml below `package_paths` is
            malformed.
        UsageError: when `packages` is not a mapping of names to folders.
    """
    found = PackageMap.MakeEmpty()
    for name, folder in check_packages("packages", packages).items():
        if not Path(folder).is_dir():
            raise ModelError(f"{folder}: no such folder of package '{name}'")
        found.Add(name, str(Path(folder).absolute()))
    for folder in package_paths:
        _add_below(found, folder)
    if not is_uri(model_file):
        _add_above(found, Path(model_file))
    own = PackageMap()
    for name in found.GetPackageNames():
        if own.Contains(name):
            own.Remove(name)
    found.AddMap(own)
    return found


def _add_below(found: PackageMap, folder: str | Path) -> None:
    """Adds the packages in a folder and below it."""
    if not Path(folder).is_dir():
        raise ModelError(f"{folder}: no such folder to search for packages")
    try:
        found.PopulateFromFolder(str(Path(folder).absolute()))
    except (Exception, SystemExit) as error:
        raise ModelError(f"{folder}: a package below it cannot be read: {error}") from error
    for where, names, files in os.walk(folder):
        names[:] = sorted(name for name in names if not name.startswith("."))
        if "model.config" in files:
            _add(found, Path(where).absolute())


def _add_above(found: PackageMap, model_file: Path) -> None:
    """Adds the packages whose folders hold a model, and a Gazebo model folder's siblings."""
    above = (*model_file.absolute().parents, *model_file.resolve().parents)
    for folder in dict.fromkeys(above):
        if (folder / "package.xml").is_file():
            # Drake would not look above the model, so a malformed package.xml there is no error.
            with suppress(ModelError):
                package = read_xml(folder / "package.xml", "package")
                _add(found, folder, (package.findtext("name") or "").strip())
        if (folder / "model.config").is_file():
            _add(found, folder)
            for sibling in sorted(folder.parent.glob("*/model.config")):
                _add(found, sibling.parent)


def _add(found: PackageMap, folder: Path, name: str | None = None) -> None:
    """Adds a package by its name, by default the folder's, unless the name is taken."""
    name = folder.name if name is None else name
    if name and not found.Contains(name):
        found.Add(name, str(folder))


def use_packages(parser: Parser, package_map: PackageMap) -> None:
    """Replaces the packages that a parser knows.

    Args:
        parser: Drake's parser.
        package_map: the packages, as `find_packages` returns them.
    """
    own = parser.package_map()
    for name in own.GetPackageNames():
        own.Remove(name)
    own.AddMap(package_map)


@contextmanager
def without_network() -> Iterator[None]:
    """Keeps Drake from downloading packages; copies that it has downloaded before are used.

    Yields:
        None; on leaving, the environment is as before.
    """

    # Drake logs that it is downloading even where it may not.
    def is_true(record: logging.LogRecord) -> bool:
        return "PackageMap: Downloading" not in record.getMessage()

    logger = logging.getLogger("drake")
    logger.addFilter(is_true)
    before = os.environ.get(_NETWORK)
    os.environ[_NETWORK] = "none"
    try:
        yield
    finally:
        logger.removeFilter(is_true)
        if before is None:
            del os.environ[_NETWORK]
        else:
            os.environ[_NETWORK] = before


def missing_package(reason: str) -> str | None:
    """Returns which package Drake did not find and what to do; None for other errors of Drake.

    Args:
        reason: the message of Drake's error.
    """
    if name := _DOWNLOADING.search(reason):
        return _remote(name[1])
    if name := _UNKNOWN.search(reason):
        return f"package '{name[1]}' is unknown; {_remedy(name[1])}"
    return None


def _remote(name: str) -> str:
    """Returns what to do about a package that Drake would download."""
    return (
        f"package '{name}' is one that Drake downloads, and nothing is downloaded here; "
        f"name a copy of it: packages={{'{name}': DIR}} (--package {name}=DIR)"
    )


def _remedy(name: str) -> str:
    """Returns what to do about an unknown package."""
    return (
        f"name its folder, packages={{'{name}': DIR}} (--package {name}=DIR), or a folder above "
        "its package.xml or model.config in package_paths (--package-path)"
    )

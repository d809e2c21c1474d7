"""Finds the packages that a model's URIs name, for us and for Drake alike.

A package is a folder with a package.xml, as in ROS, named in it; or a Gazebo model folder, one with
a model.config, named as the folder is, whose siblings are packages too, since Gazebo looks for
models in the folder above. Nothing is downloaded: Drake's own remote packages count only where a
copy is there.
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
"""The environment variable that Drake asks before it downloads a package."""
_UNKNOWN = re.compile(r"unknown package '([^']*)'")
_DOWNLOADING = re.compile(r"when downloading '([^']*)'")


def is_uri(model_file: str | Path) -> bool:
    """Whether it is a package://, model:// or file:// URI and not a path."""
    match = _URI.match(str(model_file))
    return match is not None and match[1] in _SCHEMES


def locate(model_file: str | Path, package_map: PackageMap) -> Path:
    """Returns the path of a model file that may be a URI."""
    is_path = not is_uri(model_file)
    return Path(model_file) if is_path else resolve(str(model_file), Path(), package_map)


def resolve(uri: str, folder: Path, package_map: PackageMap) -> Path:
    """Returns the path of a URI, or of a path relative to `folder`.

    Raises MissingPackageError when its package is unknown, or not on this machine; ModelError when
    Drake reads no such URI.
    """
    uri = uri.strip()
    match = _URI.match(uri)
    if match is None:
        return folder / uri
    scheme, name, slash, inner = match.groups()
    if scheme not in _SCHEMES:
        raise ModelError(f"{uri}: nothing is fetched by {scheme}; name a file or a package")
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
    """Finds the packages that are known to a model.

    Args:
        model_file: those whose folders hold it are known, and if that is a Gazebo model folder, its
            siblings; nothing is known of a URI.
        package_paths: folders that are searched for packages.
        packages: folders of packages by name, before all others.

    Returns:
        These and Drake's own.

    Raises:
        ModelError: when a folder is none, or a package.xml below `package_paths` is malformed.
        UsageError: when `packages` are not folders by name.
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
    above = (*model_file.absolute().parents, *model_file.resolve().parents)
    for folder in dict.fromkeys(above):
        if (folder / "package.xml").is_file():
            # Drake would not look above the model: what is no package.xml is none of its business.
            with suppress(ModelError):
                package = read_xml(folder / "package.xml", "package")
                _add(found, folder, (package.findtext("name") or "").strip())
        if (folder / "model.config").is_file():
            _add(found, folder)
            for sibling in sorted(folder.parent.glob("*/model.config")):
                _add(found, sibling.parent)


def _add(found: PackageMap, folder: Path, name: str | None = None) -> None:
    """Adds a package under its name, which is else the folder's, unless the name is taken."""
    name = folder.name if name is None else name
    if name and not found.Contains(name):
        found.Add(name, str(folder))


def use_packages(parser: Parser, package_map: PackageMap) -> None:
    """Makes a map that `find_packages` returned the parser's own."""
    own = parser.package_map()
    for name in own.GetPackageNames():
        own.Remove(name)
    own.AddMap(package_map)


@contextmanager
def without_network() -> Iterator[None]:
    """Keeps Drake from downloading packages; copies that it has downloaded before are used."""

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
    """Says which package Drake missed in words for people, None where its error is another."""
    if name := _DOWNLOADING.search(reason):
        return _remote(name[1])
    if name := _UNKNOWN.search(reason):
        return f"package '{name[1]}' is unknown; {_remedy(name[1])}"
    return None


def _remote(name: str) -> str:
    return (
        f"package '{name}' is one that Drake downloads, and nothing is downloaded here; "
        f"name a copy of it: packages={{'{name}': DIR}} (--package {name}=DIR)"
    )


def _remedy(name: str) -> str:
    return (
        f"name its folder, packages={{'{name}': DIR}} (--package {name}=DIR), or a folder above "
        "its package.xml or model.config in package_paths (--package-path)"
    )

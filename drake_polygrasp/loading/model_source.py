"""The files a model is made of: where they are, and the digest that identifies them all."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from pydrake.multibody.parsing import PackageMap

from drake_polygrasp.errors import ModelError
from drake_polygrasp.input_file import read_bytes
from drake_polygrasp.loading.mesh_file import MAX_BYTES
from drake_polygrasp.loading.model_checks import check_link
from drake_polygrasp.loading.model_document import Addition, read_directives, read_xml

SUFFIXES = (".sdf", ".urdf", ".xml", ".dmd.yaml", ".obj")
"""What Drake's Parser reads."""
_ROOTS = {".sdf": "sdf", ".urdf": "robot", ".xml": "mujoco"}
"""The element that Drake reads of a document."""
_URI = re.compile(r"(package|model|file)://")


@dataclass
class ModelFiles:
    """All files of a model, each once, in document order."""

    model_file: Path
    documents: dict[Path, Element | None] = field(default_factory=dict)
    """The model and what it includes; parsed when it is XML."""
    meshes: dict[Path, None] = field(default_factory=dict)
    """Collision meshes."""
    additions: dict[Path, list[Addition]] = field(default_factory=dict)
    """What each file of model directives adds."""
    includes: dict[tuple[Path, str], Path] = field(default_factory=dict)
    """The document that each SDF include or directive means, by including document and URI."""

    @property
    def sha256(self) -> str:
        """Hex digest of the concatenated digests of documents, then meshes."""
        digests = hashlib.sha256()
        for path in dict.fromkeys([*self.documents, *self.meshes]):
            content = read_bytes(path, "model", MAX_BYTES, ModelError)
            digests.update(hashlib.sha256(content).digest())
        return digests.hexdigest()


def model_digest(model_file: str | Path, package_paths: Sequence[str | Path] = ()) -> str:
    """The SHA-256 that identifies a model: of the concatenated digests of its files.

    The model file comes first, then included files, then collision meshes, in document order, each
    once. `model_file` may be a package:// URI; `package_paths` are searched for packages.
    Raises ModelError when a file is missing or malformed.
    """
    packages = find_packages(model_file, package_paths)
    return read_model_files(locate(model_file, packages), packages).sha256


def is_uri(model_file: str | Path) -> bool:
    """Whether it is a package://, model:// or file:// URI and not a path."""
    return bool(_URI.match(str(model_file)))


def locate(model_file: str | Path, packages: PackageMap) -> Path:
    """The path of a model file that may be a URI."""
    return resolve(str(model_file), Path(), packages) if is_uri(model_file) else Path(model_file)


def find_packages(model_file: str | Path, package_paths: Sequence[str | Path] = ()) -> PackageMap:
    """Packages below `package_paths`, and those whose folders hold the model file."""
    packages = PackageMap()
    for folder in package_paths:
        if not Path(folder).is_dir():
            raise ModelError(f"{folder}: no such folder to search for packages")
        packages.PopulateFromFolder(str(folder))
    if not is_uri(model_file):
        for folder in Path(model_file).resolve().parents:
            if (folder / "package.xml").is_file():
                _add_package(packages, folder / "package.xml")
    return packages


def _add_package(packages: PackageMap, package_xml: Path) -> None:
    name = (read_xml(package_xml).findtext("name") or "").strip()
    if name and not packages.Contains(name):
        packages.Add(name, str(package_xml.parent))


def resolve(uri: str, folder: Path, packages: PackageMap) -> Path:
    """The path of a URI or of a path relative to `folder`."""
    scheme, _, rest = uri.strip().rpartition("://")
    if not scheme:
        return folder / rest
    if scheme not in ("file", "package", "model"):
        raise ModelError(f"{uri}: nothing is fetched by {scheme}; name a file or a package")
    if scheme == "file":
        return Path(rest)
    name, _, inner = rest.partition("/")
    if not packages.Contains(name):
        raise ModelError(
            f"{uri}: package '{name}' is unknown; name a folder above its package.xml in "
            "package_paths (--package-path)"
        )
    return Path(packages.GetPath(name)) / inner


def read_model_files(model_file: Path, packages: PackageMap) -> ModelFiles:
    """Follow includes and collision meshes.

    Raises ModelError when a document is missing or malformed, or for the size of a box that Drake
    would replace by its own.
    """
    files = ModelFiles(model_file)
    _read_document(model_file, packages, files, ())
    return files


def _read_document(
    path: Path, packages: PackageMap, files: ModelFiles, including: tuple[Path, ...]
) -> Path:
    """Adds the document and what it includes; `including` are those that led to it, resolved.

    Returns the document's path, which is another one where `path` is a folder.
    """
    if path.is_dir():
        # The newest version is listed last.
        names = [sdf.text or "" for sdf in read_xml(path / "model.config").findall("sdf")]
        path = path / (names or [""])[-1].strip()
    if path.resolve() in including:
        raise ModelError(f"{path}: includes itself; break the circle")
    if path in files.documents:
        return path
    if path.exists() and not path.name.lower().endswith(SUFFIXES):
        raise ModelError(f"{path}: Drake reads {', '.join(SUFFIXES)}, not this; convert it")
    files.documents[path] = None
    including = (*including, path.resolve())
    if path.suffix.lower() == ".obj":
        files.meshes[path] = None
    elif path.suffix.lower() == ".yaml":
        files.additions[path] = read_directives(path)
        for added in files.additions[path]:
            _include(added.uri, path, packages, files, including)
    else:
        root = files.documents[path] = read_xml(path, _ROOTS.get(path.suffix.lower()))
        if root.tag == "mujoco":
            _read_mjcf(root, path.parent, files, including)
        elif root.tag == "robot":
            _read_urdf(root, path, packages, files)
        else:
            _read_sdf(root, path, packages, files, including)
    return path


def _include(
    uri: str, path: Path, packages: PackageMap, files: ModelFiles, including: tuple[Path, ...]
) -> None:
    """Reads a document that the document at `path` includes."""
    included = _read_document(resolve(uri, path.parent, packages), packages, files, including)
    files.includes[path, uri.strip()] = included


def _read_sdf(
    root: Element,
    path: Path,
    packages: PackageMap,
    files: ModelFiles,
    including: tuple[Path, ...],
) -> None:
    for element in root.iter():
        if element.tag == "include":
            _include(element.findtext("uri") or "", path, packages, files, including)
        elif element.tag == "collision":
            for mesh in element.findall("geometry/mesh"):
                _add_mesh(mesh.findtext("uri"), path, packages, files)
        elif element.tag == "link":
            check_link(element, path, urdf=False)


def _read_urdf(root: Element, path: Path, packages: PackageMap, files: ModelFiles) -> None:
    """Follows what Drake reads of it: no includes, and of links their own collisions."""
    for link in root.findall("link"):
        check_link(link, path, urdf=True)
        for mesh in link.findall("collision/geometry/mesh"):
            _add_mesh(mesh.get("filename"), path, packages, files)


def _add_mesh(uri: str | None, path: Path, packages: PackageMap, files: ModelFiles) -> None:
    if not (uri or "").strip():
        raise ModelError(f"{path}: a collision mesh names no file; name one")
    files.meshes[resolve(uri or "", path.parent, packages)] = None


def _read_mjcf(root: Element, folder: Path, files: ModelFiles, including: tuple[Path, ...]) -> None:
    """As Drake does: what is included stands in the model itself, and the last compiler rules."""
    _splice_includes(root, folder, files, including)
    assets = folder
    for compiler in root.findall("compiler"):
        stated = compiler.get("meshdir", compiler.get("assetdir"))
        assets = assets if stated is None else folder / stated
    for mesh in root.iter("mesh"):
        if mesh.get("file"):
            files.meshes[assets / mesh.get("file", "")] = None


def _splice_includes(
    element: Element, folder: Path, files: ModelFiles, including: tuple[Path, ...]
) -> None:
    """Put the elements of included files in the place of each include, at any depth.

    Their names are relative to `folder`, that of the model, also where included files include.
    """
    children: list[Element] = []
    for child in element:
        if child.tag == "include":
            if not child.get("file"):
                raise ModelError(f"{including[-1]}: an include names no file; name one")
            path = folder / child.get("file", "")
            if path.resolve() in including:
                raise ModelError(f"{path}: includes itself; break the circle")
            files.documents.setdefault(path, None)
            root = read_xml(path)
            _splice_includes(root, folder, files, (*including, path.resolve()))
            children += root
        else:
            _splice_includes(child, folder, files, including)
            children.append(child)
    element[:] = children

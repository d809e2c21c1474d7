"""Finds all files that a model refers to, and computes the digest that identifies them."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from pydrake.multibody.parsing import PackageMap

from drake_polygrasp.errors import ModelError
from drake_polygrasp.input_file import read_bytes
from drake_polygrasp.loading.gltf_file import gltf_buffer_files
from drake_polygrasp.loading.mesh_file import MAX_BYTES
from drake_polygrasp.loading.model_checks import check_expanded, check_link, check_names
from drake_polygrasp.loading.model_document import Addition, read_directives, read_xml
from drake_polygrasp.loading.packages import find_packages, is_uri, locate, resolve

SUFFIXES = (".sdf", ".urdf", ".xml", ".dmd.yaml", ".obj")
"""Suffixes of the model files that Drake's Parser reads."""
_ROOTS = {".sdf": "sdf", ".urdf": "robot", ".xml": "mujoco"}
"""Tag of the element that Drake reads in a document."""


@dataclass
class ModelFiles:
    """All files of a model, each once, in document order.

    Attributes:
        model_file: the file given to the Parser.
        documents: the model file and those that it includes, with their elements if XML.
        meshes: collision meshes, as keys.
        additions: what each file of model directives adds.
        includes: the document that an SDF include or a directive refers to, by including document
            and URI.
        warnings: what Drake leaves out of the model without a word, a sentence each, as keys.
    """

    model_file: Path
    documents: dict[Path, Element | None] = field(default_factory=dict)
    meshes: dict[Path, None] = field(default_factory=dict)
    additions: dict[Path, list[Addition]] = field(default_factory=dict)
    includes: dict[tuple[Path, str], Path] = field(default_factory=dict)
    warnings: dict[str, None] = field(default_factory=dict)

    @property
    def sha256(self) -> str:
        """Hex SHA-256 of the concatenated digests of documents, then meshes with their buffers."""
        digests = hashlib.sha256()
        waiting = [*self.documents, *self.meshes]
        seen: set[Path] = set()
        while waiting:
            path = waiting.pop(0)
            if path in seen:
                continue
            seen.add(path)
            content = read_bytes(path, "model", MAX_BYTES, ModelError)
            digests.update(hashlib.sha256(content).digest())
            if path.suffix.lower() == ".gltf":
                waiting = gltf_buffer_files(content, path.parent) + waiting
        return digests.hexdigest()


def model_digest(
    model_file: str | Path,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
) -> str:
    """Computes the SHA-256 that identifies a model: of the concatenated digests of its files.

    The model file comes first, then included files, then collision meshes, in document order, each
    once.

    Args:
        model_file: a path or a package:// URI.
        package_paths: folders searched for packages.
        packages: folders of packages by name.

    Returns:
        The hex digest.

    Raises:
        ModelError: when a file is missing or malformed.
    """
    package_map = find_packages(model_file, package_paths, packages)
    return read_model_files(locate(model_file, package_map), package_map).sha256


def read_model_files(model_file: Path, package_map: PackageMap) -> ModelFiles:
    """Finds the documents and collision meshes that Drake opens, by following includes.

    Args:
        model_file: path of the model file.
        package_map: the packages that URIs may name.

    Returns:
        The files, each once, in document order.

    Raises:
        ModelError: when a document is missing or malformed, or states a size that Drake would
            silently replace.
    """
    files = ModelFiles(model_file)
    _Reader(files, package_map).read(model_file, (), None)
    return files


def _newest(config: Element) -> str:
    """Returns the first file that a model.config names for the newest version of SDF."""
    versions = [
        (tuple(int(part) for part in re.findall(r"\d+", sdf.get("version", "0"))), sdf.text or "")
        for sdf in config.findall("sdf")
    ]
    return max(versions, key=lambda version: version[0], default=((), ""))[1].strip()


@dataclass
class _Reader:
    """Follows a model's files as Drake's parsers do."""

    files: ModelFiles
    package_map: PackageMap
    visited: set[tuple[Path, Path]] = field(default_factory=set)
    """Documents read, each with the folder that its meshes' paths are relative to."""

    def read(self, path: Path, including: tuple[Path, ...], folder: Path | None) -> Path:
        """Adds a document and what it includes.

        Args:
            path: the document, or a folder with a model.config.
            including: the documents that led to it, with links resolved.
            folder: folder of the SDF file that Drake's parser began with, to which meshes' paths in
                SDF are relative; None for the document's own.

        Returns:
            The document's path.
        """
        if path.is_dir():
            config = path / "model.config"
            if not config.exists():
                raise ModelError(f"{path}: is a folder without a model.config; name a model in it")
            path = path / _newest(read_xml(config, "model"))
        if path.resolve() in including:
            raise ModelError(f"{path}: includes itself; break the circle of includes")
        if not path.name.lower().endswith(SUFFIXES):
            if not path.exists():
                raise ModelError(f"{path}: there is no such model file; mend the path")
            if path.name.endswith(".grasp.yaml"):
                raise ModelError(
                    f"{path}: is a grasp file, not a model; load_planned_object loads its object"
                )
            raise ModelError(f"{path}: Drake reads {', '.join(SUFFIXES)}, not this; convert it")
        suffix = path.suffix.lower()
        if suffix != ".sdf" or folder is None:
            folder = path.parent
        if (path, folder) not in self.visited:
            self.visited.add((path, folder))
            self._read_new(path, suffix, (*including, path.resolve()), folder)
        return path

    def _read_new(self, path: Path, suffix: str, including: tuple[Path, ...], folder: Path) -> None:
        files = self.files
        files.documents.setdefault(path, None)
        if suffix == ".obj":
            files.meshes[path] = None
            return
        if suffix == ".yaml":
            files.additions[path] = read_directives(path)
            for added in files.additions[path]:
                target = self._resolve(added.uri, path, path.parent)
                files.includes[path, added.uri] = self.read(target, including, None)
            return
        root = read_xml(path, _ROOTS[suffix])
        if root.tag != _ROOTS[suffix]:
            raise ModelError(
                f"{path}: its first element is <{root.tag}>, and Drake reads <{_ROOTS[suffix]}> of "
                f"a {suffix} file; rename the file, or convert it"
            )
        if root.tag == "sdf" and "version" not in root.attrib:
            raise ModelError(f'{path}: its <sdf> states no version; write <sdf version="1.9">')
        check_names(root, path)
        files.documents[path] = root
        if root.tag == "mujoco":
            self._read_mjcf(root, path, folder, including)
        elif root.tag == "robot":
            self._read_urdf(root, path, folder)
        else:
            self._read_sdf(root, path, including, folder)

    def _read_sdf(
        self, root: Element, path: Path, including: tuple[Path, ...], folder: Path
    ) -> None:
        for element in root.iter():
            if element.tag == "include":
                uri = (element.findtext("uri") or "").strip()
                target = self._included(uri, path)
                self.files.includes[path, uri] = self.read(target, including, folder)
            elif element.tag == "collision":
                for mesh in element.findall("geometry/mesh"):
                    self._add_mesh(mesh.findtext("uri"), path, folder)
                    if mesh.find("submesh") is not None:
                        self.files.warnings[
                            f"{path}: Drake reads no <submesh> and takes all of "
                            f"{mesh.findtext('uri')}; write that part to a file of its own"
                        ] = None
            elif element.tag == "link":
                check_link(element, path, urdf=False)

    def _included(self, uri: str, path: Path) -> Path:
        """Returns the path of a document that an SDF document includes."""
        target = self._resolve(uri, path, path.parent)
        if is_uri(uri) or target == Path(uri):
            return target
        beside, here = target.exists(), Path(uri).exists()
        if (beside or here) and not (beside and here and target.samefile(uri)):
            raise ModelError(
                f"{path}: includes '{uri}', which Drake looks for in the current folder and not "
                "beside the model; write a package:// or file:// URI"
            )
        return target

    def _read_urdf(self, root: Element, path: Path, folder: Path) -> None:
        """Adds the meshes of links' own collisions; Drake reads no includes in URDF."""
        check_expanded(root, path)
        for link in root.findall("link"):
            check_link(link, path, urdf=True)
            for mesh in link.findall("collision/geometry/mesh"):
                self._add_mesh(mesh.get("filename"), path, folder)

    def _add_mesh(self, uri: str | None, path: Path, folder: Path) -> None:
        if uri is None or not uri.strip():
            raise ModelError(f"{path}: a collision mesh names no file; name one")
        self.files.meshes[self._resolve(uri, path, folder)] = None

    def _resolve(self, uri: str, path: Path, folder: Path) -> Path:
        """Returns the path of a URI in the document at `path`, which errors name."""
        try:
            return resolve(uri, folder, self.package_map)
        except ModelError as error:
            raise type(error)(f"{path}: {error}") from error

    def _read_mjcf(
        self, root: Element, path: Path, folder: Path, including: tuple[Path, ...]
    ) -> None:
        """Adds includes and meshes as Drake does: the last <compiler> says where meshes are."""
        self._splice_includes(root, folder, including)
        if next(root.iter("replicate"), None) is not None:
            self.files.warnings[
                f"{path}: Drake reads no <replicate> and leaves out what it repeats; write the "
                "copies out"
            ] = None
        assets = folder
        for compiler in root.findall("compiler"):
            stated = compiler.get("meshdir", compiler.get("assetdir"))
            assets = assets if stated is None else folder / stated
        for mesh in root.iter("mesh"):
            if mesh.get("file"):
                self.files.meshes[assets / mesh.get("file", "")] = None

    def _splice_includes(self, element: Element, folder: Path, including: tuple[Path, ...]) -> None:
        """Replaces each include, at any depth, by the elements of the included file.

        File names are relative to `folder`, the model's, also within included files.
        """
        children: list[Element] = []
        for child in element:
            if child.tag == "include":
                if not child.get("file"):
                    raise ModelError(f"{including[-1]}: an include names no file; name one")
                path = folder / child.get("file", "")
                if path.resolve() in including:
                    raise ModelError(f"{path}: includes itself; break the circle of includes")
                self.files.documents.setdefault(path, None)
                root = read_xml(path)
                check_names(root, path)
                self._splice_includes(root, folder, (*including, path.resolve()))
                children += root
            else:
                self._splice_includes(child, folder, including)
                children.append(child)
        element[:] = children

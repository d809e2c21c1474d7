"""The files a model is made of, and what they state in so many words.

After parsing, Drake cannot tell friction or mass that a file states from its own defaults, and
it replaces impossible sizes and masses by others. The files tell.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

from pydrake.multibody.parsing import LoadModelDirectives, PackageMap

from drake_polygrasp.errors import ModelError

SUFFIXES = (".sdf", ".urdf", ".xml", ".dmd.yaml", ".obj")
"""What Drake's Parser reads."""
_PREFIXED_TAG = re.compile(rb"(</?\w+):(?=\w)")
_FRICTION_TAGS = ("mu", "mu2", "drake_mu_static", "drake_mu_dynamic")
_URI = re.compile(r"(package|model|file)://")


@dataclass
class ModelFiles:
    """All files of a model, each once, in document order."""

    model_file: Path
    documents: dict[Path, ElementTree.Element | None] = field(default_factory=dict)
    """The model and what it includes; parsed when it is XML."""
    meshes: dict[Path, None] = field(default_factory=dict)
    """Collision meshes."""

    @property
    def sha256(self) -> str:
        """Hex digest of the concatenated digests of documents, then meshes."""
        digests = hashlib.sha256()
        for path in dict.fromkeys([*self.documents, *self.meshes]):
            digests.update(hashlib.sha256(path.read_bytes()).digest())
        return digests.hexdigest()


@dataclass(frozen=True)
class Statements:
    """What the files say of one link."""

    mass: bool
    """Whether they state a mass."""
    friction: tuple[bool, ...]
    """Whether they state friction, of each collision geometry in document order."""

    def state_friction(self, k: int, count: int) -> bool:
        """Of the k-th of `count` geometries; when Drake dropped some, whether all state it."""
        return self.friction[k] if len(self.friction) == count else all(self.friction)


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
    name = (_read_xml(package_xml).findtext("name") or "").strip()
    if name and not packages.Contains(name):
        packages.Add(name, str(package_xml.parent))


def resolve(uri: str, folder: Path, packages: PackageMap) -> Path:
    """The path of a URI or of a path relative to `folder`."""
    scheme, _, rest = uri.strip().rpartition("://")
    if not scheme:
        return folder / rest
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
    _read_document(model_file, packages, files)
    return files


def _read_document(path: Path, packages: PackageMap, files: ModelFiles) -> None:
    if path.is_dir():
        # The newest version is listed last.
        names = [sdf.text or "" for sdf in _read_xml(path / "model.config").findall("sdf")]
        path = path / (names or [""])[-1].strip()
    if path in files.documents:
        return
    if not path.is_file():
        raise ModelError(f"{path}: there is no such model file")
    if not path.name.lower().endswith(SUFFIXES):
        raise ModelError(f"{path}: Drake reads {', '.join(SUFFIXES)}, not this")
    files.documents[path] = None
    if path.suffix.lower() == ".obj":
        files.meshes[path] = None
    elif path.suffix.lower() == ".yaml":
        for uri in _directive_files(path):
            _read_document(resolve(uri, path.parent, packages), packages, files)
    else:
        root = files.documents[path] = _read_xml(path)
        reader = _read_mjcf if root.tag == "mujoco" else _read_sdf_or_urdf
        reader(root, path, packages, files)


def _directive_files(path: Path) -> list[str]:
    try:
        directives = LoadModelDirectives(str(path)).directives
    except (Exception, SystemExit) as error:
        raise ModelError(f"{path}: no model directives: {error}") from error
    adding = [d.add_model or d.add_directives for d in directives]
    return [d.file for d in adding if d]


def _read_xml(path: Path) -> ElementTree.Element:
    try:
        # Drake's own parsers need no declaration of the drake: prefix.
        return ElementTree.fromstring(_PREFIXED_TAG.sub(rb"\1_", path.read_bytes()))
    except (OSError, ElementTree.ParseError) as error:
        raise ModelError(f"{path}: cannot be read as XML: {error}") from error


def _read_sdf_or_urdf(
    root: ElementTree.Element, path: Path, packages: PackageMap, files: ModelFiles
) -> None:
    for element in root.iter():
        if element.tag == "include":
            uri = element.findtext("uri") or ""
            _read_document(resolve(uri, path.parent, packages), packages, files)
        elif element.tag == "collision":
            for mesh in element.iter("mesh"):
                uri = mesh.get("filename") or mesh.findtext("uri") or ""
                files.meshes[resolve(uri, path.parent, packages)] = None
            for box in element.iter("box"):
                _check_size(box if root.tag == "robot" else box.find("size"), path)


def _check_size(element: ElementTree.Element | None, path: Path) -> None:
    numbers = [] if element is None else _numbers(element, "size")
    if len(numbers) != 3 or not all(number > 0 for number in numbers):
        raise ModelError(f"{path}: the size of a collision box must be three numbers above 0")


def _read_mjcf(
    root: ElementTree.Element, path: Path, packages: PackageMap, files: ModelFiles
) -> None:
    compiler = root.find("compiler")
    folder = path.parent
    if compiler is not None:
        folder = folder / (compiler.get("meshdir") or compiler.get("assetdir") or "")
    for element in root.iter():
        if element.tag == "include":
            _read_document(path.parent / element.get("file", ""), packages, files)
        elif element.tag == "mesh" and element.get("file"):
            files.meshes[folder / element.get("file", "")] = None


def read_statements(files: ModelFiles, link_name: str) -> Statements:
    """What the files say of the link; where several bear the name, what all of them say.

    Raises ModelError for a mass that Drake would replace by its own.
    """
    found: list[Statements] = []
    for path, root in files.documents.items():
        if root is not None and root.tag == "mujoco":
            bodies = [body for body in root.iter("body") if body.get("name") == link_name]
            found += [_mjcf_body(body, root) for body in bodies]
        elif root is not None:
            links = [link for link in root.iter("link") if link.get("name") == link_name]
            found += [_sdf_or_urdf_link(link, path) for link in links]
    if len(found) == 1:
        return found[0]
    friction = [stated for one in found for stated in one.friction]
    stated = bool(friction) and all(friction)
    return Statements(bool(found) and all(one.mass for one in found), (stated,))


def _sdf_or_urdf_link(link: ElementTree.Element, path: Path) -> Statements:
    inertial = link.find("inertial")
    mass = None if inertial is None else inertial.find("mass")
    if mass is not None and not all(number > 0 for number in _numbers(mass, "value")):
        raise ModelError(f"{path}: link '{link.get('name')}' has a mass that is not above 0")
    automatic = inertial is not None and inertial.get("auto") == "true"
    friction = (
        any(element.tag in _FRICTION_TAGS for element in collision.iter())
        for collision in link.iter("collision")
    )
    return Statements(mass is not None or automatic, tuple(friction))


def _mjcf_body(body: ElementTree.Element, root: ElementTree.Element) -> Statements:
    """MJCF always means a mass, of its default density; friction may come from its defaults."""
    default = any(geom.get("friction") for d in root.iter("default") for geom in d.iter("geom"))
    friction = tuple(default or bool(geom.get("friction")) for geom in body.findall("geom"))
    return Statements(True, friction)


def _numbers(element: ElementTree.Element, attribute: str) -> list[float]:
    """Of an URDF attribute or an SDF text; a lone NaN when they are none."""
    try:
        return [float(word) for word in (element.get(attribute) or element.text or "").split()]
    except ValueError:
        return [float("nan")]

"""Finds where a model's documents state each model instance that Drake made of them.

Links of one name are told apart as Drake does, by the scoped name of their model: models in models
and worlds, includes under other names or merged into the model that includes them, and model
directives that add a file more than once.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from xml.etree.ElementTree import Element

from drake_polygrasp.loading.model_source import ModelFiles


class Dialect(StrEnum):
    """The language of a model's document."""

    SDF = "sdf"
    URDF = "urdf"
    MJCF = "mjcf"
    OBJ = "obj"


@dataclass(frozen=True)
class StatedModel:
    """A model as a document states it.

    Attributes:
        element: <model> of SDF, <robot> of URDF, <mujoco> of MJCF with what it includes; an empty
            element for OBJ.
        dialect: the language of the document.
        path: the document.
    """

    element: Element
    dialect: Dialect
    path: Path


_MERGED = ("true", "1")
"""Values of an include's attribute `merge` that merge it."""


def find_instances(files: ModelFiles) -> dict[str, list[StatedModel]]:
    """Returns the models that the files state, by the name of the model instance that Drake adds.

    Args:
        files: all files of the model.

    Returns:
        One model for each name; several where an include merges one into another.
    """
    found: dict[str, list[StatedModel]] = {}
    for name, model in _models(files, files.model_file, None, ""):
        found.setdefault(name, []).append(model)
    return found


def _models(
    files: ModelFiles, path: Path, name: str | None, parent: str
) -> Iterator[tuple[str, StatedModel]]:
    """Yields the models of a document that is added under `name`, or under its own."""
    for added in files.additions.get(path, ()):
        file = files.includes[path, added.uri]
        yield from _models(files, file, added.name, _join(parent, added.namespace))
    root = files.documents.get(path)
    if path.suffix.lower() == ".obj":
        yield _join(parent, name or path.stem), StatedModel(Element("obj"), Dialect.OBJ, path)
    if root is None:
        return
    if root.tag == "robot":
        yield _join(parent, name or root.get("name")), StatedModel(root, Dialect.URDF, path)
    elif root.tag == "mujoco":
        yield _join(parent, name or root.get("model")), StatedModel(root, Dialect.MJCF, path)
    else:
        for scope in (root, *root.findall("world")):
            for model in scope.findall("model"):
                own = _join(parent, name or sdf_name(model))
                yield from _sdf_model(files, model, path, own)
            for include in scope.findall("include"):
                yield from _included(files, include, path, parent, name)


def _sdf_model(
    files: ModelFiles, model: Element, path: Path, name: str
) -> Iterator[tuple[str, StatedModel]]:
    """Yields an SDF model, the models nested in it and those that it includes."""
    yield name, StatedModel(model, Dialect.SDF, path)
    for nested in model.findall("model"):
        yield from _sdf_model(files, nested, path, _join(name, sdf_name(nested)))
    for include in model.findall("include"):
        yield from _included(files, include, path, name)


def _included(
    files: ModelFiles, include: Element, path: Path, parent: str, name: str | None = None
) -> Iterator[tuple[str, StatedModel]]:
    """Yields the models of an SDF include, under the scope of their parent if it merges them."""
    file = files.includes.get((path, (include.findtext("uri") or "").strip()))
    if file is None:
        return
    name = name or (include.findtext("name") or "").strip() or None
    models = _models(files, file, name, parent)
    if include.get("merge", "").strip().lower() not in _MERGED:
        yield from models
        return
    own = None
    for scoped_name, model in models:
        own = own or scoped_name  # The merged model comes before those in it.
        yield _join(parent, scoped_name.removeprefix(own).removeprefix("::")), model


def sdf_name(element: Element) -> str:
    """Returns the name of an SDF element, without surrounding spaces as Drake reads it.

    Args:
        element: an element of an SDF document.
    """
    return element.get("name", "").strip()


def _join(parent: str, name: str | None) -> str:
    """Joins names as Drake's ScopedName does."""
    return "::".join(part for part in (parent, name or "") if part)

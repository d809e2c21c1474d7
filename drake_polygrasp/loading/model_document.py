"""Reads one document of a model, XML or directives, and refuses what would hurt to read."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from xml.etree.ElementTree import Element

import yaml
from pydrake.multibody.parsing import LoadModelDirectives

from drake_polygrasp.errors import ModelError, with_remedy
from drake_polygrasp.input_file import read_bytes
from drake_polygrasp.loading.xml_reader import parse_xml

MAX_BYTES = 20_000_000
"""Of a document, ours: some hundred thousand collision geometries."""
_MAX_NODES = 1_000_000
"""Of directives with their aliases written out, ours."""


@dataclass(frozen=True)
class Addition:
    """What one of a file's model directives adds: a model, or further directives.

    Attributes:
        uri: what to add: a path or a URI, as stated.
        name: of the model; None for directives.
        namespace: of the directives' models.
    """

    uri: str
    name: str | None
    namespace: str = ""


def read_directives(path: Path) -> list[Addition]:
    """Reads what model directives add; ModelError when they are no directives."""
    content = read_bytes(path, "model", MAX_BYTES, ModelError)
    try:
        if _expanded_size(yaml.compose(content, Loader=yaml.BaseLoader), {}) > _MAX_NODES:
            raise ModelError(f"{path}: its aliases expand beyond measure; write them out")
        directives = LoadModelDirectives(str(path)).directives
    except ModelError:
        raise
    except (Exception, SystemExit) as error:
        raise ModelError(f"{path}: no model directives: {error}") from error
    return [
        Addition(d.add_model.file, d.add_model.name)
        if d.add_model
        else Addition(d.add_directives.file, None, d.add_directives.model_namespace or "")
        for d in directives
        if d.add_model or d.add_directives
    ]


def _expanded_size(node: yaml.Node, known: dict[yaml.Node, int]) -> int:
    """How many nodes there are when every alias is written out."""
    if node not in known:
        known[node] = 1  # An alias may stand inside what it refers to.
        parts = chain.from_iterable(node.value) if isinstance(node, yaml.MappingNode) else ()
        parts = node.value if isinstance(node, yaml.SequenceNode) else parts
        known[node] += sum(_expanded_size(part, known) for part in parts)
    return known[node]


def read_xml(path: Path, tag: str | None = None) -> Element:
    """Reads an XML document as Drake does, names as they are written (`xml_reader`).

    Args:
        path: the document.
        tag: of the element to return; Drake takes the first of its name.

    Returns:
        The first element at the top that has the tag or, where none has, the first of all.

    Raises:
        ModelError: when it is no XML that Drake reads, or declares entities.
    """
    content = read_bytes(path, "model", MAX_BYTES, ModelError)
    try:
        elements = parse_xml(content)
    except ValueError as error:
        reason = with_remedy(error, "mend it there")
        raise ModelError(f"{path}: cannot be read as XML: {reason}") from error
    if not elements:
        raise ModelError(f"{path}: cannot be read as XML: it has no element; mend it there")
    return next((element for element in elements if element.tag == tag), elements[0])

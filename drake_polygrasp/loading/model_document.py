"""Reads one document of a model, XML or directives, of bounded size."""

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

_MAX_BYTES = 20_000_000
"""Greatest size of a document. Our choice: some hundred thousand collision geometries."""
_MAX_NODES = 1_000_000
"""Most YAML nodes of directives, with their aliases expanded. Our choice."""


@dataclass(frozen=True)
class Addition:
    """A model, or a file of further directives, that a model directive adds.

    Attributes:
        uri: path or URI of the file to add, as stated.
        name: name given to the model; None for directives.
        namespace: namespace of the models that further directives add.
    """

    uri: str
    name: str | None
    namespace: str = ""


def read_directives(path: Path) -> list[Addition]:
    """Reads what a file of model directives adds.

    Args:
        path: the file.

    Returns:
        Models and files of further directives, in the file's order.

    Raises:
        ModelError: when it cannot be read as model directives.
    """
    content = read_bytes(path, "model", _MAX_BYTES, ModelError)
    try:
        if _expanded_size(yaml.compose(content, Loader=yaml.BaseLoader), {}) > _MAX_NODES:
            raise ModelError(
                f"{path}: its aliases expand to more than {_MAX_NODES} values; write them out"
            )
        directives = LoadModelDirectives(str(path)).directives
    except ModelError:
        raise
    except RecursionError:
        raise ModelError(f"{path}: cannot be read as model directives: nested too deeply") from None
    except (Exception, SystemExit) as error:
        raise ModelError(f"{path}: cannot be read as model directives: {error}") from error
    return [
        Addition(d.add_model.file, d.add_model.name)
        if d.add_model
        else Addition(d.add_directives.file, None, d.add_directives.model_namespace or "")
        for d in directives
        if d.add_model or d.add_directives
    ]


def _expanded_size(node: yaml.Node, known: dict[yaml.Node, int]) -> int:
    """Returns the number of nodes with every alias expanded."""
    if node not in known:
        known[node] = 1  # Ends the recursion where an alias is inside what it refers to.
        parts = chain.from_iterable(node.value) if isinstance(node, yaml.MappingNode) else ()
        parts = node.value if isinstance(node, yaml.SequenceNode) else parts
        known[node] += sum(_expanded_size(part, known) for part in parts)
    return known[node]


def read_xml(path: Path, tag: str | None = None) -> Element:
    """Reads an XML document as Drake does, with names as they are written (see `xml_reader`).

    Args:
        path: the document.
        tag: tag of the element to return; Drake takes the first of that tag.

    Returns:
        The first element at the top that has the tag or, where none has, the first of all.

    Raises:
        ModelError: when Drake cannot read it as XML, or it declares entities.
    """
    content = read_bytes(path, "model", _MAX_BYTES, ModelError)
    try:
        elements = parse_xml(content)
    except ValueError as error:
        reason = with_remedy(error, "correct it there")
        raise ModelError(f"{path}: cannot be read as XML: {reason}") from error
    if not elements:
        raise ModelError(f"{path}: cannot be read as XML: it has no element; name another file")
    return next((element for element in elements if element.tag == tag), elements[0])

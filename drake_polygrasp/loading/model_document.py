"""Reads one document of a model, XML or directives, and refuses what would hurt to read."""

from __future__ import annotations

import re
from itertools import chain
from pathlib import Path
from xml.etree import ElementTree

import yaml
from pydrake.multibody.parsing import LoadModelDirectives

from drake_polygrasp.errors import ModelError
from drake_polygrasp.input_file import read_bytes

MAX_BYTES = 20_000_000
"""Of a document, ours: some hundred thousand collision geometries."""
_MAX_NODES = 1_000_000
"""Of directives with their aliases written out, ours."""
_PREFIXED_TAG = re.compile(rb"(</?\w+):(?=\w)")


def directive_files(path: Path) -> list[str]:
    """The URIs of the files that model directives add; ModelError when they are no directives."""
    content = read_bytes(path, "model", MAX_BYTES, ModelError)
    try:
        if _expanded_size(yaml.compose(content, Loader=yaml.BaseLoader), {}) > _MAX_NODES:
            raise ModelError(f"{path}: its aliases expand beyond measure; write them out")
        directives = LoadModelDirectives(str(path)).directives
    except ModelError:
        raise
    except (Exception, SystemExit) as error:
        raise ModelError(f"{path}: no model directives: {error}") from error
    adding = [d.add_model or d.add_directives for d in directives]
    return [d.file for d in adding if d]


def _expanded_size(node: yaml.Node, known: dict[yaml.Node, int]) -> int:
    """How many nodes there are when every alias is written out."""
    if node not in known:
        known[node] = 1  # An alias may stand inside what it refers to.
        parts = chain.from_iterable(node.value) if isinstance(node, yaml.MappingNode) else ()
        parts = node.value if isinstance(node, yaml.SequenceNode) else parts
        known[node] += sum(_expanded_size(part, known) for part in parts)
    return known[node]


def read_xml(path: Path) -> ElementTree.Element:
    """The root of an XML document, with prefix_tag for prefix:tag; ModelError when it is none."""
    content = read_bytes(path, "model", MAX_BYTES, ModelError)
    if b"<!ENTITY" in content:
        raise ModelError(
            f"{path}: declares XML entities, which Drake does not read; write them out"
        )
    try:
        content.decode()
        # Drake's own parsers need no declaration of the drake: prefix.
        return ElementTree.fromstring(_PREFIXED_TAG.sub(rb"\1_", content))
    except UnicodeDecodeError:
        raise ModelError(f"{path}: is not UTF-8 text; save it as such") from None
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise ModelError(f"{path}: cannot be read as XML: {error}; mend it there") from error

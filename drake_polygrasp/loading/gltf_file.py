"""Checks a glTF file before Drake reads it, and finds the buffer files it refers to.

Drake's reader follows every index and offset in the file without checking its range.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import ModelError
from drake_polygrasp.input_file import read_bytes

_COMPONENTS = {5120: 1, 5121: 1, 5122: 2, 5123: 2, 5125: 4, 5126: 4}
"""Bytes of each component type, by the format's codes."""
_FLOAT = 5126
_COUNTS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
"""Components of an element of each type."""


def gltf_positions(content: bytes, folder: Path, max_bytes: int) -> Array:
    """Returns the vertex positions of all meshes of a glTF file.

    Args:
        content: the file.
        folder: its folder, where its buffers are.
        max_bytes: greatest size of a buffer file.

    Returns:
        Positions before its nodes transform them, shape (V, 3).

    Raises:
        ValueError: when an index or an offset is out of range, or it is not a glTF file.
        ModelError: when one of its buffers cannot be read.
    """
    try:
        root = json.loads(content)
        if not str(root["asset"]["version"]).startswith("2."):
            raise ValueError("it is not glTF of version 2")
        _check_nodes(root)
        buffers = [_buffer(buffer, folder, max_bytes) for buffer in root.get("buffers", [])]
        primitives = [primitive for mesh in root["meshes"] for primitive in mesh["primitives"]]
        used = [a for p in primitives for a in [*p["attributes"].values(), p.get("indices", 0)]]
        for accessor in used:
            _item(root, "accessors", accessor)
        for accessor in root["accessors"]:
            _check_accessor(accessor, root, buffers)
        positions = [
            _positions(_item(root, "accessors", p["attributes"]["POSITION"]), root, buffers)
            for p in primitives
        ]
    except KeyError as error:
        raise ValueError(f"it is not valid glTF: {error} is missing") from None
    except (TypeError, AttributeError, IndexError):
        raise ValueError("it is not valid glTF: a value has the wrong type or length") from None
    except json.JSONDecodeError as error:
        raise ValueError(f"it is not glTF: {error}") from None
    return np.concatenate([np.empty((0, 3)), *positions])


def gltf_buffer_files(content: bytes, folder: Path) -> list[Path]:
    """Returns the files that hold a glTF file's buffers; none where it cannot be read.

    Args:
        content: the file.
        folder: its folder, to which the buffers' names are relative.
    """
    try:
        uris = [buffer.get("uri") for buffer in json.loads(content).get("buffers", [])]
    except (ValueError, TypeError, AttributeError):
        return []
    # Like Drake, does not decode %-escapes in names.
    return [folder / x for x in uris if isinstance(x, str) and not x.startswith("data:")]


def _item(root: Mapping[str, Any], kind: str, index: object) -> Any:
    """Returns an item by its index, which must be in range."""
    items = root.get(kind, [])
    if type(index) is not int or not 0 <= index < len(items):
        raise ValueError(f"it refers to number {index!r} of {len(items)} {kind}, from 0")
    return items[index]


def _check_nodes(root: Mapping[str, Any]) -> None:
    """Checks that nodes form trees: each has at most one parent, and there are no cycles."""
    nodes = root["nodes"]
    parents: dict[int, int] = {}
    for k, node in enumerate(nodes):
        if "mesh" in node:
            _item(root, "meshes", node["mesh"])
        for child in node.get("children", []):
            _item(root, "nodes", child)
            if child in parents:
                raise ValueError(f"its node {child} has two parents")
            parents[child] = k
    for k in range(len(nodes)):
        depth, above = 0, parents.get(k)
        while above is not None:
            depth, above = depth + 1, parents.get(above)
            if depth > len(nodes):
                raise ValueError("its nodes contain themselves")
    scene = _item(root, "scenes", root.get("scene", 0))
    for node in scene["nodes"]:
        _item(root, "nodes", node)
    if not any("mesh" in node for node in nodes):
        raise ValueError("it has no mesh")


def _buffer(buffer: Mapping[str, Any], folder: Path, max_bytes: int) -> bytes:
    """Reads a buffer, which must have the stated length at least."""
    uri = str(buffer["uri"])
    if uri.startswith("data:"):
        data = base64.b64decode(uri.partition(",")[2])
    else:
        data = read_bytes(folder / uri, "mesh buffer", max_bytes, ModelError)
    if len(data) < _size(buffer, "byteLength"):
        raise ValueError(f"a buffer of {buffer['byteLength']} bytes has {len(data)}")
    return data


def _check_accessor(
    accessor: Mapping[str, Any], root: Mapping[str, Any], buffers: Sequence[bytes]
) -> None:
    """Checks that an accessor reads within its buffer."""
    for view, offset, size in _ranges(accessor, root):
        place = _item(root, "bufferViews", view)
        _item(root, "buffers", place["buffer"])
        end = _size(place, "byteOffset") + _size(place, "byteLength")
        if offset + size > _size(place, "byteLength") or end > len(buffers[place["buffer"]]):
            raise ValueError("an accessor reads beyond its buffer")


def _ranges(accessor: Mapping[str, Any], root: Mapping[str, Any]) -> Iterator[tuple[int, int, int]]:
    """Yields what an accessor reads: index of a view, offset in it and number of bytes."""
    element = _COMPONENTS[accessor["componentType"]] * _COUNTS[accessor["type"]]
    count = _size(accessor, "count")
    if count < 1:
        raise ValueError("an accessor has no elements")
    if "bufferView" in accessor:
        view = _item(root, "bufferViews", accessor["bufferView"])
        stride = _size(view, "byteStride") or element
        yield accessor["bufferView"], _size(accessor, "byteOffset"), (count - 1) * stride + element
    if "sparse" in accessor:
        raise ValueError("it has sparse accessors; write them out")


def _positions(
    accessor: Mapping[str, Any], root: Mapping[str, Any], buffers: Sequence[bytes]
) -> Array:
    """Returns the vectors of an accessor that was checked, shape (V, 3)."""
    if accessor["componentType"] != _FLOAT or accessor["type"] != "VEC3":
        raise ValueError("its positions are not vectors of floats")
    view = root["bufferViews"][accessor["bufferView"]]
    start = _size(view, "byteOffset") + _size(accessor, "byteOffset")
    stride = _size(view, "byteStride") or 12
    floats = np.ndarray((accessor["count"], 3), "<f4", buffers[view["buffer"]], start, (stride, 4))
    return floats.astype(np.float64)


def _size(item: Mapping[str, Any], key: str) -> int:
    """Returns a count, offset or length, 0 where it is not stated."""
    value = item.get(key, 0)
    if type(value) is not int or value < 0:
        raise ValueError(f"its {key} is {value!r}, not a size")
    return value

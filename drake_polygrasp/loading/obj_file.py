"""Reads vertices and faces of a Wavefront OBJ file as Drake does, and writes such a file."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.loading.numbers import floats, integers

_LINE_ENDS = re.compile(rb"\r\n?")
_COMMENTS = re.compile(rb"#[^\n]*")
_CONTINUED = re.compile(rb"^[ \t]*[vf][ \t][^\n]*\\[ \t]*$", re.MULTILINE)
_RECORDS = re.compile(rb"^[ \t]*([vf])[ \t]([^\n]*)", re.MULTILINE)
_TEXTURE_AND_NORMAL = re.compile(rb"/\S*")
_BYTE_ORDER_MARK = b"\xef\xbb\xbf"


@dataclass(frozen=True, eq=False)
class ObjFile:
    """Vertices and faces of an OBJ file, in its order.

    Attributes:
        vertices: coordinates as stated, before scaling, shape (V, 3).
        corners: vertex indices, from 0, of all faces one after another, shape (N,).
        offsets: where each face begins in `corners`, and then N, shape (F + 1,).
    """

    vertices: Array
    corners: Ints
    offsets: Ints


def read_obj(content: bytes) -> ObjFile:
    """Reads vertices and faces of an OBJ file.

    Colours, textures, normals, lines and points are ignored.

    Args:
        content: the file.

    Returns:
        Its vertices and faces.

    Raises:
        ValueError: when it is malformed, or Drake would misread it.
    """
    content = _LINE_ENDS.sub(b"\n", content.removeprefix(_BYTE_ORDER_MARK))
    content = _COMMENTS.sub(b"", content)
    if continued := _CONTINUED.search(content):
        line = content.count(b"\n", 0, continued.start()) + 1
        raise ValueError(
            f"line {line} is continued on the next by '\\', as Rhino writes long lines, and "
            "Drake does not read that; export triangles, or join the lines"
        )
    records = _RECORDS.findall(content)
    coordinates = [line.split()[:3] for kind, line in records if kind == b"v"]
    if any(len(row) < 3 for row in coordinates):
        raise ValueError("a vertex has fewer than three coordinates")
    vertices = floats([x for row in coordinates for x in row]).reshape(-1, 3)
    faces = [_TEXTURE_AND_NORMAL.sub(b"", line).split() for kind, line in records if kind == b"f"]
    sizes = np.array([len(face) for face in faces], dtype=np.int64)
    stated = integers([corner for face in faces for corner in face])
    kinds = np.array([kind == b"v" for kind, _ in records], dtype=bool)
    # A negative index counts back from the last vertex before its face.
    known = np.repeat(np.cumsum(kinds)[~kinds], sizes)
    wrong = (stated == 0) | (stated > len(vertices)) | (stated < -known)
    if wrong.any():
        raise ValueError(
            f"a face refers to vertex {stated[np.argmax(wrong)]}, but there are {len(vertices)}"
        )
    corners = np.where(stated > 0, stated - 1, known + stated)
    is_face = sizes >= 3  # Drake ignores others.
    return ObjFile(
        vertices,
        corners[np.repeat(is_face, sizes)],
        np.append(0, np.cumsum(sizes[is_face])),
    )


def write_obj(vertices: Array, triangles: Ints) -> str:
    """Returns the text of an OBJ file.

    Args:
        vertices: coordinates [m], shape (V, 3).
        triangles: vertex indices from 0, shape (T, 3).
    """
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
    return "\n".join([*lines, ""])

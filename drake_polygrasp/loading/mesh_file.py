"""Checks a mesh file before Drake reads it.

Drake trusts mesh files: an index out of range or a file without faces aborts the process, and a
coordinate that is not a number silently becomes 0.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from drake_polygrasp.arrays import Array, Ints
from drake_polygrasp.errors import ModelError, with_remedy
from drake_polygrasp.input_file import read_bytes
from drake_polygrasp.loading.gltf_file import gltf_positions
from drake_polygrasp.loading.numbers import floats, integers
from drake_polygrasp.loading.obj_file import read_obj

MAX_BYTES = 100_000_000
"""Greatest size of a mesh file. Our choice: several times that of MAX_TRIANGLES triangles."""
MAX_TRIANGLES = 100_000
"""Greatest number of triangles. Our choice: five times a dense scan's; as many noisy ones are read
in half a minute."""
_MAX_COORDINATE = 1e9
"""Greatest coordinate [m, before scaling]. Our choice: far beyond any object, and far below where
squares overflow."""
_MIN_COUNT = 4
"""Fewest vertices or triangles that enclose a volume."""


def check_meshes(mesh_files: Iterable[Path], model_file: Path) -> None:
    """Checks that Drake can safely read the collision meshes of a model.

    Args:
        mesh_files: .obj, .vtk and .gltf files.
        model_file: the model, which messages name too.

    Raises:
        ModelError: when it cannot.
    """
    for mesh_file in mesh_files:
        try:
            check_mesh_file(mesh_file)
        except ModelError as error:
            if mesh_file == model_file:
                raise
            raise ModelError(f"{model_file}: {error}") from error


def check_mesh_file(mesh_file: Path) -> None:
    """Checks that Drake can safely read a collision mesh.

    Args:
        mesh_file: an .obj, .vtk or .gltf file.

    Raises:
        ModelError: when it cannot.
    """
    suffix = mesh_file.suffix.lower()
    if suffix not in (".obj", ".vtk", ".gltf"):
        raise ModelError(
            f"{mesh_file}: Drake reads no triangles from '{suffix}' collision meshes; "
            "convert it to .obj or .vtk"
        )
    content = read_bytes(mesh_file, "mesh", MAX_BYTES, ModelError)
    try:
        if suffix == ".gltf":
            _check_gltf(content, mesh_file.parent)
        else:
            (_check_obj if suffix == ".obj" else _check_vtk)(content)
    except ValueError as error:
        raise ModelError(f"{mesh_file}: {with_remedy(error, 'repair the mesh')}") from error


def _check_obj(content: bytes) -> None:
    # A rough count comes first, because reading takes memory for each line.
    _check_count(content.count(b"\nf ") + content.count(b"\nf\t"))
    obj = read_obj(content)
    _check_vertices(obj.vertices)
    num_triangles = int((np.diff(obj.offsets) - 2).sum())
    if num_triangles < _MIN_COUNT:
        raise ValueError(f"a solid needs at least {_MIN_COUNT} triangles, it has {num_triangles}")
    _check_count(num_triangles)


def _check_gltf(content: bytes, folder: Path) -> None:
    positions = gltf_positions(content, folder, MAX_BYTES)
    _check_count(len(positions))
    _check_vertices(positions)


def _check_vtk(content: bytes) -> None:
    """Checks a legacy ASCII file; Drake itself refuses binary ones that are not tetrahedra."""
    words = content.split()
    if b"BINARY" in words[:64]:
        return
    start, (count,) = _section(words, b"POINTS", 1)
    _check_count(count)
    start += 1  # The data type's name.
    coordinates = floats(words[start : start + 3 * count])
    if len(coordinates) < 3 * count:
        raise ValueError(f"it states {count} points and has fewer")
    _check_vertices(coordinates.reshape(-1, 3))
    start, (num_cells, size) = _section(words, b"CELLS", 2)
    if not num_cells:
        raise ValueError("it has no cells")
    _check_count(num_cells)
    if b"CONNECTIVITY" in words:
        start = words.index(b"CONNECTIVITY") + 2
        corners = integers(words[start : start + size])
    else:
        corners = integers(words[start : start + size])
        sizes = np.arange(len(corners)) % 5 == 0
        if len(corners) != 5 * num_cells or (corners[sizes] != 4).any():
            raise ValueError("its cells are not all tetrahedra")
        corners = corners[~sizes]
    if ((corners < 0) | (corners >= count)).any():
        raise ValueError(f"a cell refers to a point outside 0 to {count - 1}")


def _section(words: list[bytes], keyword: bytes, num_sizes: int) -> tuple[int, Ints]:
    """Returns where the numbers after a keyword and its sizes begin, and the sizes."""
    try:
        start = words.index(keyword) + 1
    except ValueError:
        raise ValueError(f"it has no {keyword.decode()}") from None
    sizes = integers(words[start : start + num_sizes])
    if len(sizes) < num_sizes or (sizes < 0).any():
        raise ValueError(f"the sizes after {keyword.decode()} are missing or negative")
    return start + num_sizes, sizes


def _check_count(count: int) -> None:
    """Refuses too many triangles, tetrahedra or points."""
    if count > MAX_TRIANGLES:
        raise ValueError(f"its {count} elements are more than {MAX_TRIANGLES}; simplify it")


def _check_vertices(vertices: Array) -> None:
    """Refuses too few vertices, and coordinates that are not finite or too large."""
    if len(vertices) < _MIN_COUNT:
        raise ValueError(f"a solid needs at least {_MIN_COUNT} vertices, it has {len(vertices)}")
    wrong = ~np.isfinite(vertices).all(axis=1)
    if wrong.any():
        raise ValueError(f"vertex {np.argmax(wrong) + 1} is not finite")
    wrong = (np.abs(vertices) > _MAX_COORDINATE).any(axis=1)
    if wrong.any():
        raise ValueError(f"vertex {np.argmax(wrong) + 1} lies beyond {_MAX_COORDINATE:g}")

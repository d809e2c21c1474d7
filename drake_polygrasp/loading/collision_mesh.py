"""Reads the surface of a Mesh, Convex or Box shape, and repairs meshes that Drake misreads.

Drake takes mesh files literally: it divides concave faces of more than three corners into triangles
some of which lie outside the face, takes the winding of triangles for inside and outside even where
it is inverted or faces are stated both ways round, and cannot measure distances to a mesh with a
vertex that no triangle uses. Such meshes are repaired here to what the file means. A warning then
says so, because the user's own plant has Drake's surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pydrake.common import MemoryFile
from pydrake.geometry import (
    AddRigidHydroelasticProperties,
    Box,
    Convex,
    GeometryInstance,
    InMemoryMesh,
    Mesh,
    ProximityProperties,
    ReadObjToTriangleSurfaceMesh,
    SceneGraph,
    TriangleSurfaceMesh,
)
from pydrake.math import RigidTransform

from drake_polygrasp.arrays import Array, Ints, distinct_values, frozen
from drake_polygrasp.errors import ModelError, with_remedy
from drake_polygrasp.geometry.face_triangles import faces_cut_wrongly, triangulate
from drake_polygrasp.geometry.shells import faces_inward
from drake_polygrasp.geometry.tolerances import FLATNESS, LENGTH_TOLERANCE
from drake_polygrasp.input_file import read_bytes
from drake_polygrasp.loading.drake_messages import collect_drake_log
from drake_polygrasp.loading.mesh_file import MAX_BYTES
from drake_polygrasp.loading.obj_file import read_obj, write_obj


@dataclass(frozen=True, eq=False)
class CollisionMesh:
    """A shape's surface in its geometry frame G.

    Attributes:
        shape: the shape to use in our own plants: the given one, or a repaired Mesh in memory.
        triangles_G: corners of its triangles in G [m], outward by the right-hand rule, shape
            (T, 3, 3).
        warnings: how it differs from the geometry that Drake makes of the shape, a sentence each.
    """

    shape: Box | Convex | Mesh
    triangles_G: Array
    warnings: tuple[str, ...] = ()


def read_collision_mesh(shape: Box | Convex | Mesh) -> CollisionMesh:
    """Returns the true surface of a shape.

    A Mesh keeps its notches, which Drake's point contact fills because it uses the convex hull; a
    glTF mesh is its convex hull, since Drake has nothing else of it. What Drake logs about a mesh
    is dropped: it said so when it parsed the model.

    Args:
        shape: the shape.

    Returns:
        The surface, repaired where Drake would misread it.

    Raises:
        ModelError: when a mesh cannot be read, or a face of it crosses itself.
    """
    warnings: list[str] = []
    if isinstance(shape, Mesh) and shape.extension() == ".gltf":
        warnings.append(
            f"{_source(shape)[0]}: Drake collides with the convex hull of a glTF mesh, and grasps "
            "are planned on it; if the mesh is not convex, convert it to .obj or .vtk, or contacts "
            "may touch nothing"
        )
        shape = Convex(shape.source(), np.asarray(shape.scale3()))
    with collect_drake_log():
        vertices, triangles = _arrays(_drake_mesh(shape))
    if not isinstance(shape, Mesh):
        return CollisionMesh(shape, vertices[triangles], tuple(warnings))
    name, content = _source(shape)
    if shape.extension() == ".obj":
        try:
            triangles = _with_whole_faces(content, shape, name, vertices, triangles, warnings)
        except ValueError as error:
            raise ModelError(f"{name}: {with_remedy(error, 'repair the mesh')}") from error
    triangles = _outward(name, vertices, triangles, warnings)
    num_spare = len(vertices) - len(distinct_values(triangles))
    if num_spare:
        warnings.append(
            f"{name}: no face uses {num_spare} of its {len(vertices)} vertices, which are left "
            "out; Drake's convex hull includes them"
        )
    if not warnings:
        return CollisionMesh(shape, vertices[triangles])
    return CollisionMesh(_in_memory(vertices, triangles), vertices[triangles], tuple(warnings))


def _source(shape: Mesh) -> tuple[str, bytes]:
    """Returns what messages call the mesh, and its file's content."""
    source = shape.source()
    if source.is_path():
        path = Path(source.path())
        return str(path), read_bytes(path, "mesh", MAX_BYTES, ModelError)
    file = source.in_memory().mesh_file
    return file.filename_hint() or "a mesh in memory", file.contents()


def _drake_mesh(shape: Box | Convex | Mesh) -> TriangleSurfaceMesh:
    """Returns the mesh that rigid hydroelastic contact makes of a shape."""
    if isinstance(shape, Mesh) and shape.extension() == ".obj" and shape.source().is_path():
        # The same triangles, read several times as fast.
        return ReadObjToTriangleSurfaceMesh(shape.source().path(), np.asarray(shape.scale3()))
    scene_graph = SceneGraph()
    instance = GeometryInstance(RigidTransform(), shape, "surface")
    properties = ProximityProperties()
    AddRigidHydroelasticProperties(properties)
    instance.set_proximity_properties(properties)
    geometry = scene_graph.RegisterAnchoredGeometry(scene_graph.RegisterSource("source"), instance)
    return scene_graph.model_inspector().maybe_get_hydroelastic_mesh(geometry)


def _arrays(mesh: TriangleSurfaceMesh) -> tuple[Array, Ints]:
    """Returns vertices [m], shape (V, 3), and the indices of each triangle's, shape (T, 3)."""
    triangles = mesh.triangles()
    corners = (t.vertex(k) for t in triangles for k in range(3))
    index = np.fromiter(corners, np.int64, 3 * len(triangles))
    return np.array(mesh.vertices()).reshape(-1, 3), index.reshape(-1, 3)


def _with_whole_faces(
    content: bytes, shape: Mesh, name: str, vertices: Array, triangles: Ints, warnings: list[str]
) -> Ints:
    """Returns Drake's triangles, replaced in faces that they do not tile by triangles that do.

    Raises ValueError when a face crosses itself.
    """
    obj = read_obj(content)
    sizes = np.diff(obj.offsets)
    if (sizes == 3).all() and len(sizes) == len(triangles):
        return triangles
    corners = obj.corners
    if np.prod(np.sign(shape.scale3())) < 0:  # Drake reverses mirrored faces.
        corners = np.concatenate([face[::-1] for face in np.split(corners, obj.offsets[1:-1])])
    if (sizes - 2).sum() == len(triangles):
        wrong = faces_cut_wrongly(vertices, corners, obj.offsets, triangles)
    else:
        wrong = sizes > 3  # Drake stopped within some face and does not say in which.
        triangles = np.zeros(((sizes - 2).sum(), 3), dtype=np.int64)
        triangles[np.repeat(~wrong, sizes - 2)] = corners[np.repeat(~wrong, sizes)].reshape(-1, 3)
    if not wrong.any():
        return triangles
    flatness = FLATNESS * float(np.linalg.norm(np.ptp(vertices, axis=0)))
    kept = np.split(triangles, np.cumsum(sizes - 2)[:-1])
    for k in np.flatnonzero(wrong):
        face = corners[obj.offsets[k] : obj.offsets[k + 1]]
        try:
            kept[k] = face[triangulate(vertices[face], flatness)]
        except ValueError as error:
            raise ValueError(f"face {k + 1}: {error}") from error
    warnings.append(
        f"{name}: Drake divides its concave faces into wrong triangles; grasps are planned on the "
        "faces as the file means them, but your own plant has Drake's: export triangles"
    )
    return np.concatenate(kept)


def _outward(name: str, vertices: Array, triangles: Ints, warnings: list[str]) -> Ints:
    """Returns the triangles, those that face inward reversed and those that are spare left out."""
    tolerance = LENGTH_TOLERANCE * float(np.ptp(vertices[triangles], axis=(0, 1)).max(initial=0))
    inward, spare = faces_inward(vertices[triangles], tolerance)
    if spare.any():
        warnings.append(
            f"{name}: {2 * spare.sum()} of its {len(spare)} triangles are a solid's faces, stated "
            "both ways round; grasps are planned on the solid, but in your own plant nothing is "
            "inside: export one-sided faces"
        )
    if inward.any():
        which = (
            "its triangles face inward"
            if inward.all()
            else f"{inward.sum()} of its {len(inward)} triangles face inward"
        )
        warnings.append(
            f"{name}: {which}; grasps are planned with them turned outward, but in your own plant "
            "inside and outside are swapped there: reverse the faces in the file"
        )
    return np.where(inward[:, None], triangles[:, ::-1], triangles)[~spare]


def _in_memory(vertices: Array, triangles: Ints) -> Mesh:
    """Returns a mesh of triangles, without the vertices that none of them uses."""
    used, index = np.unique(triangles, return_inverse=True)
    text = write_obj(frozen(vertices[used]), index.reshape(-1, 3))
    return Mesh(InMemoryMesh(mesh_file=MemoryFile(text, ".obj", "mended.obj")))

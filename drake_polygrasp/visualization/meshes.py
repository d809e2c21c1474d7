"""Triangles and edges of faces, to be drawn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import Face, Polyhedron

FEW = 40
"""Ours: more numbers than these hide each other, and the object."""


def shape_triangles(face: Face, shape_F: shapely.Geometry, lift: float = 0.0) -> Array:
    """A shape on a face, in the coordinates of Fx and Fy [m], as triangles in B.

    Args:
        face: the face.
        shape_F: a Polygon or MultiPolygon.
        lift: how far to lift it off the face [m].

    Returns:
        Corners [m], counter-clockwise from outside, shape (T, 3, 3).
    """
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(shape_F))
    corners_F = shapely.get_coordinates(shapely.orient_polygons(pieces)).reshape(-1, 4, 2)[:, :3]
    p_BV: Array = face.p_BF + corners_F @ face.R_BF[:, :2].T + lift * face.R_BF[:, 2]
    return p_BV


def face_triangles(face: Face, lift: float = 0.0) -> Array:
    """A whole face, lifted off the surface by `lift` [m]; as `shape_triangles`."""
    return shape_triangles(face, face.polygon_F, face.reach + lift)


def surface_triangles(polyhedron: Polyhedron) -> Array:
    """The surface [m], shape (T, 3, 3): its faces, or the model's triangles where it is curved."""
    if is_curved(polyhedron):
        return polyhedron.own_triangles_B
    return np.concatenate([face_triangles(face) for face in polyhedron.faces])


def is_curved(polyhedron: Polyhedron) -> bool:
    """Whether some faces are patches, which may overlap and only lie near the surface."""
    return bool(polyhedron.is_patch.any())


def section_lines(polyhedron: Polyhedron, nhat_B: Array, height: float) -> Array:
    """Where the plane nhat_B . p = height cuts the surface: lines [m], shape (E, 2, 3)."""
    triangles = surface_triangles(polyhedron)
    above = triangles @ nhat_B - height
    # Half-open: a corner on the plane is below it, and two sides of a triangle cross or none.
    following, above_following = np.roll(triangles, -1, axis=1), np.roll(above, -1, axis=1)
    crosses = (above > 0) != (above_following > 0)
    fraction = (above / np.where(crosses, above - above_following, 1.0))[..., None]
    points: Array = (triangles + fraction * (following - triangles))[crosses]
    return points.reshape(-1, 2, 3)


def numbered_faces(polyhedron: Polyhedron) -> list[int]:
    """Indices of faces that have their number whether touched or not: flat ones, if they are few.

    Others are numbered where a grasp touches them.
    """
    flat = [k for k, face in enumerate(polyhedron.faces) if face.reach == 0]
    return flat if len(flat) <= FEW else []


def face_edges(faces: Sequence[Face]) -> Array:
    """The edges of faces [m], shape (E, 2, 3)."""
    edges = [np.empty((0, 2, 3))]
    for face in faces:
        for ring in shapely.get_rings(face.polygon_F):
            p_BV = face.p_BF + shapely.get_coordinates(ring) @ face.R_BF[:, :2].T
            edges.append(np.stack([p_BV[:-1], p_BV[1:]], axis=1))
    return np.concatenate(edges)

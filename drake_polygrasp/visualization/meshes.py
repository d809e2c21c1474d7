"""Computes triangles, edges and outlines to be drawn."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import Face, Polyhedron
from drake_polygrasp.geometry.surface_pieces import SurfacePiece
from drake_polygrasp.geometry.triangles import face_frame

FEW = 40
"""Our choice: more numbers than this hide each other and the object."""


def shape_triangles(face: Face, shape_F: shapely.Geometry, lift: float = 0.0) -> Array:
    """Triangulates a shape on a face.

    Args:
        face: the face.
        shape_F: Polygon or MultiPolygon in the coordinates along Fx and Fy [m].
        lift: distance from the face's plane, outward [m].

    Returns:
        Corners in B [m], counter-clockwise from outside, shape (T, 3, 3).
    """
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(shape_F))
    corners_F = shapely.get_coordinates(shapely.orient_polygons(pieces)).reshape(-1, 4, 2)[:, :3]
    p_BV: Array = face.p_BF + corners_F @ face.R_BF[:, :2].T + lift * face.R_BF[:, 2]
    return p_BV


def face_triangles(face: Face, lift: float = 0.0) -> Array:
    """Triangulates a whole face.

    Args:
        face: the face.
        lift: distance from the surface, outward [m].

    Returns:
        Corners in B [m], counter-clockwise from outside, shape (T, 3, 3).
    """
    return shape_triangles(face, face.polygon_F, face.reach + lift)


def surface_triangles(polyhedron: Polyhedron) -> Array:
    """Returns the surface as triangles: those of its faces, or the model's own if it has patches.

    Args:
        polyhedron: the surface.

    Returns:
        Corners in B [m], shape (T, 3, 3).
    """
    if is_curved(polyhedron):
        return polyhedron.own_triangles_B
    return np.concatenate([face_triangles(face) for face in polyhedron.faces])


def is_curved(polyhedron: Polyhedron) -> bool:
    """Returns whether some faces are patches, which may overlap and lie only near the surface.

    Args:
        polyhedron: the surface.
    """
    return bool(polyhedron.is_patch.any())


def section_lines(polyhedron: Polyhedron, nhat_B: Array, height: float) -> Array:
    """Intersects a surface with the plane nhat_B . p = height.

    Args:
        polyhedron: the surface.
        nhat_B: unit normal of the plane, shape (3,).
        height: height of the plane along the normal [m].

    Returns:
        Ends of the line segments in B [m], shape (E, 2, 3).
    """
    triangles = surface_triangles(polyhedron)
    above = triangles @ nhat_B - height
    # A corner on the plane counts as below it, so two sides of a triangle cross it, or none.
    following, above_following = np.roll(triangles, -1, axis=1), np.roll(above, -1, axis=1)
    crosses = (above > 0) != (above_following > 0)
    fraction = (above / np.where(crosses, above - above_following, 1.0))[..., None]
    points: Array = (triangles + fraction * (following - triangles))[crosses]
    return points.reshape(-1, 2, 3)


def numbered_faces(polyhedron: Polyhedron) -> list[int]:
    """Returns the indices of faces that are always numbered: the planar ones, if they are few.

    Other faces are numbered if a grasp touches them.

    Args:
        polyhedron: the surface.
    """
    flat = [k for k, face in enumerate(polyhedron.faces) if face.reach == 0]
    return flat if len(flat) <= FEW else []


def face_edges(faces: Sequence[Face]) -> Array:
    """Returns the edges of faces.

    Args:
        faces: the faces.

    Returns:
        Ends of the edges in B [m], shape (E, 2, 3).
    """
    edges = [np.empty((0, 2, 3))]
    for face in faces:
        for ring in shapely.get_rings(face.polygon_F):
            p_BV = face.p_BF + shapely.get_coordinates(ring) @ face.R_BF[:, :2].T
            edges.append(np.stack([p_BV[:-1], p_BV[1:]], axis=1))
    return np.concatenate(edges)


def piece_outline(piece: SurfacePiece, lift: float = 0.0) -> Array:
    """Returns the outline of a piece as seen along its normal, on its outermost plane.

    Args:
        piece: piece of a body's surface.
        lift: distance from that plane, outward [m].

    Returns:
        Corners in order [m], shape (n, 3).
    """
    R_BF = face_frame(-piece.nhat_TB_B)
    p_FV = piece.p_BV @ R_BF
    hull = shapely.convex_hull(shapely.MultiPoint(p_FV[:, :2]))
    xy = shapely.get_coordinates(hull)[:-1]
    height = np.full((len(xy), 1), p_FV[:, 2].max() + lift)
    return np.asarray(np.hstack([xy, height]) @ R_BF.T)

"""Draws a grasp in a still 3-D picture, in the colours of the Meshcat scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import shapely
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection
from mpl_toolkits.mplot3d.axes3d import Axes3D

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import surface_vertices
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.visualization.camera import best_view, view_of_faces
from drake_polygrasp.visualization.meshes import (
    face_edges,
    face_triangles,
    numbered_faces,
    piece_outline,
    surface_triangles,
)
from drake_polygrasp.visualization.palette import CONTACTS, INK, OBJECT, PLANE, rgb
from drake_polygrasp.visualization.shown_grasp import FORCE_SCALE, ShownGrasp
from drake_polygrasp.wrenches.contacts import edge_forces

_MM = 1e3


def draw_sketch(ax: Axes3D, object_: GraspObject, grasp: ShownGrasp | None = None) -> None:
    """Draws an object and, if one is given, a grasp of it: contacts, forces and their triangle.

    Where the grasp has a region, the surface that its contacts may touch is outlined.

        draw_sketch(plt.figure().add_subplot(projection="3d"), box, plan.grasps[0])

    Args:
        ax: axes with `projection="3d"`, in mm.
        object_: object to draw.
        grasp: grasp to draw; only the faces that it touches are numbered (default: none, and all
            faces are numbered).
    """
    tints = {} if grasp is None else _tints(grasp.grasp.faces)
    _draw_surface(ax, object_, tints)
    if grasp is not None:
        _draw_contacts(ax, object_, grasp)
    _turn(ax, best_view(grasp))


def draw_faces(ax: Axes3D, object_: GraspObject, faces: Sequence[int]) -> None:
    """Draws an object with some faces tinted and numbered.

    Args:
        ax: axes with `projection="3d"`, in mm.
        object_: object to draw.
        faces: indices of three faces, in the order of colours; a pair names one twice.
    """
    _draw_surface(ax, object_, _tints(faces))
    _turn(ax, view_of_faces(np.array([-object_.polyhedron.faces[k].R_BF[:, 2] for k in faces])))


def _tints(faces: Sequence[int]) -> dict[int, str]:
    """Returns the colour of each face; a face that is named twice has the first of its colours."""
    return dict(reversed(list(zip(faces, CONTACTS, strict=True))))


def _draw_surface(ax: Axes3D, object_: GraspObject, tints: Mapping[int, str]) -> None:
    """Draws the surface; tinted faces are numbered, or all if none is tinted."""
    faces = object_.polyhedron.faces
    for colour, triangles, opacity in (
        (OBJECT, surface_triangles(object_.polyhedron), 0.2),
        *((tint, face_triangles(faces[k]), 0.45) for k, tint in tints.items()),
    ):
        ax.add_collection3d(Poly3DCollection(_MM * triangles, facecolors=(*rgb(colour), opacity)))
    edges = _MM * face_edges([face for face in faces if face.reach == 0])
    if len(edges):
        ax.add_collection3d(Line3DCollection(edges, colors=INK, linewidths=0.7))
    for k in tints or numbered_faces(object_.polyhedron):
        x, y = shapely.get_coordinates(shapely.point_on_surface(faces[k].polygon_F))[0]
        p_BN = faces[k].p_BF + faces[k].R_BF[:, :2] @ (x, y)
        ax.text(*_MM * p_BN, str(k), color=INK, fontsize=9, weight="bold", ha="center", va="center")
    ax.plot(*_MM * object_.p_BBcm[:, None], "o", color=INK, markersize=3)
    _frame(ax, _MM * surface_vertices(object_.polyhedron))


def _draw_contacts(ax: Axes3D, object_: GraspObject, grasp: ShownGrasp) -> None:
    p_BC = grasp.grasp.p_BC
    f_Bc_B = edge_forces(p_BC[None], grasp.certificate.internal_force[None])[0]
    ax.add_collection3d(
        Poly3DCollection(_MM * p_BC[None], facecolors=(*rgb(PLANE), 0.4), edgecolors=PLANE)
    )
    scale = _MM * FORCE_SCALE * object_.polyhedron.diameter
    for p_BCi, f_B, colour in zip(p_BC, f_Bc_B, CONTACTS, strict=True):
        ax.plot(*_MM * p_BCi[:, None], "o", color=colour, markersize=6)
        ax.quiver(*_MM * p_BCi, *scale * f_B, color=colour, linewidth=2)
    if grasp.region is not None:
        for pieces, colour in zip(grasp.region.pieces, CONTACTS, strict=True):
            outlines = [_MM * piece_outline(piece) for piece in pieces]
            ax.add_collection3d(
                Poly3DCollection(outlines, facecolors=(*rgb(colour), 0.5), edgecolors=INK)
            )


def _turn(ax: Axes3D, eye: Array) -> None:
    x, y, z = eye
    ax.view_init(elev=np.degrees(np.arcsin(z)), azim=np.degrees(np.arctan2(y, x)))


def _frame(ax: Axes3D, vertices: Array) -> None:
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low)
    ax.set_axis_off()

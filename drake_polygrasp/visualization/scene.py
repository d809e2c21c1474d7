"""Draws an object and its grasps in Meshcat.

Everything is drawn in body frame B below one path, whose transform can be set to X_WB to show the
body elsewhere. Sizes of marks are fractions of the object's diameter L.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, Rgba, Sphere

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import Face
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.visualization.camera import best_view
from drake_polygrasp.visualization.labels import label_F
from drake_polygrasp.visualization.marks import (
    draw_arrow,
    draw_friction_cone,
    draw_pieces,
    set_mesh,
    set_shape,
)
from drake_polygrasp.visualization.meshes import (
    face_edges,
    face_triangles,
    numbered_faces,
    shape_triangles,
    surface_triangles,
)
from drake_polygrasp.visualization.palette import CONTACTS, COVER, INK, OBJECT, PLANE, rgb
from drake_polygrasp.visualization.shown_grasp import FORCE_SCALE, ShownGrasp, plane_corners
from drake_polygrasp.wrenches.contacts import edge_forces

PATH = "polygrasp"
"""Path in Meshcat's tree below which all is drawn."""
_TIP, _MARK, _CONE, _LABEL = 0.02, 0.012, 0.14, 0.06
"""Our choice, over L: radii of fingertips and points, side of cones, height of numbers."""
_LIFT = 1e-3
"""Our choice: distance of marks from the face that they lie on, over L; at 0 the two flicker."""

_NOWHERE = np.empty((0, 3))


def draw_object(
    meshcat: Meshcat,
    object_: GraspObject,
    *,
    path: str = PATH,
    keep_clear_B: Array = _NOWHERE,
    eye_B: Array | None = None,
) -> None:
    """Draws an object: translucent faces with edges and numbers, and its centre of mass.

    Links on its joints are lighter. Patches of a curved surface have neither edges nor numbers;
    faces have no numbers if there are many, except those that a grasp touches.

    Args:
        meshcat: Meshcat to draw in; nothing outside `path` is changed.
        object_: object to draw.
        path: path below which it is drawn in body frame B, as `path`/object.
        keep_clear_B: points in B that numbers avoid if they can [m], shape (K, 3).
        eye_B: unit vector in B to the eye that reads numbers upright, shape (3,) (default: that of
            `look_at` without a grasp).
    """
    eye_B = best_view(None) if eye_B is None else eye_B
    L, faces = object_.polyhedron.diameter, object_.polyhedron.faces
    path = f"{path}/object"
    meshcat.Delete(path)
    set_mesh(meshcat, f"{path}/faces", surface_triangles(object_.polyhedron), OBJECT, 0.35)
    if object_.polyhedron.is_covered:
        set_mesh(meshcat, f"{path}/links_on_joints", object_.polyhedron.covers_B, COVER, 0.35)
    flat = [face for face in faces if face.reach == 0]
    ends = face_edges(flat)
    if len(ends):
        meshcat.SetLineSegments(f"{path}/edges", ends[:, 0].T, ends[:, 1].T, 1.5, Rgba(*rgb(INK)))
    for k in numbered_faces(object_.polyhedron):
        _draw_number(meshcat, f"{path}/numbers/{k}", faces[k], k, L, keep_clear_B, eye_B)
    set_shape(meshcat, f"{path}/centre_of_mass", Sphere(_MARK * L), INK, 1.0, object_.p_BBcm)


def draw_grasp(
    meshcat: Meshcat,
    object_: GraspObject,
    grasp: ShownGrasp,
    *,
    tip_radius: float | None = None,
    path: str = f"{PATH}/grasp",
) -> None:
    """Draws one grasp on its object.

    In the colours of contacts 1, 2 and 3: their faces, fingertips and friction cones, and the
    internal force as arrows, `FORCE_SCALE` L long for the total normal force. Dark discs show how
    far contacts may be misplaced; where errors are proved to be borne, outlines around the contacts
    show the surface that they may touch. The grasp plane and the contact triangle have one colour.

    Args:
        meshcat: Meshcat to draw in; nothing outside `path` is changed.
        object_: its object.
        grasp: grasp to draw; arrows and discs are those of its certificate.
        tip_radius: radius of the fingertips [m] (default: 0.02 L; 0: marked points).
        path: path below which it is drawn in body frame B.
    """
    meshcat.Delete(path)
    L = object_.polyhedron.diameter
    contacts, certificate = grasp.grasp, grasp.certificate
    f_Bc_B = edge_forces(contacts.p_BC[None], certificate.internal_force[None])[0]
    tinted: set[int] = set()
    numbered = numbered_faces(object_.polyhedron)
    for i, colour in enumerate(CONTACTS):
        p_BC, nhat_B, mu = contacts.p_BC[i], contacts.nhat_TB_B[i], float(contacts.mu[i])
        here = f"{path}/contact_{i + 1}"
        k = contacts.faces[i]
        if k not in tinted and k < len(object_.polyhedron.faces):
            tinted.add(k)
            face = object_.polyhedron.faces[k]
            set_mesh(meshcat, f"{here}/face", face_triangles(face, _LIFT * L), colour, 0.45)
            if k not in numbered:
                seen = _marks_B(grasp, L), best_view(grasp)
                _draw_number(meshcat, f"{here}/number", face, k, L, *seen)
        tip = _TIP * L if tip_radius is None else tip_radius
        sphere, p_BT = Sphere(tip or _MARK * L), p_BC - tip * nhat_B
        set_shape(meshcat, f"{here}/fingertip", sphere, colour, 0.75, p_BT)
        # Fingertips are drawn last, so that the discs show through them.
        meshcat.SetProperty(f"{here}/fingertip/<object>", "renderOrder", 2.0)
        draw_friction_cone(meshcat, f"{here}/friction_cone", p_BC, nhat_B, mu, _CONE * L, colour)
        draw_arrow(meshcat, f"{here}/force", p_BC, FORCE_SCALE * L * f_Bc_B[i], 0.007 * L, colour)
        if (region := grasp.region) is not None:
            draw_pieces(meshcat, f"{here}/region", region.pieces[i], 3 * _LIFT * L, colour)
        if tolerance := certificate.placement_tolerance:
            disc = Cylinder(tolerance, 2 * _LIFT * L)
            p_BD = p_BC - 2 * _LIFT * L * nhat_B
            set_shape(meshcat, f"{here}/placement", disc, INK, 0.6, p_BD, nhat_B)
    _draw_plane(meshcat, f"{path}/plane", object_, grasp)
    _draw_triangle(meshcat, f"{path}/triangle", contacts.p_BC, L)


def draw_grasps(
    meshcat: Meshcat,
    object_: GraspObject,
    grasps: Sequence[ShownGrasp],
    *,
    tip_radius: float | None = None,
    path: str = PATH,
) -> None:
    """Draws an object and all of its ranked grasps, of which the first is visible.

        draw_grasps(meshcat, box, plan.grasps)
        show_rank(meshcat, 2, len(plan.grasps))

    Args:
        meshcat: Meshcat to draw in; nothing outside `path` is changed.
        object_: object to draw.
        grasps: its grasps, best first.
        tip_radius: radius of the fingertips [m] (default: 0.02 L; 0: marked points).
        path: path below which all is drawn in body frame B.
    """
    L, first = object_.polyhedron.diameter, grasps[0] if grasps else None
    marks_B = _NOWHERE if first is None else _marks_B(first, L)
    draw_object(meshcat, object_, path=path, keep_clear_B=marks_B, eye_B=best_view(first))
    meshcat.Delete(f"{path}/grasps")
    for rank, grasp in enumerate(grasps, start=1):
        draw_grasp(meshcat, object_, grasp, tip_radius=tip_radius, path=f"{path}/grasps/{rank}")
    show_rank(meshcat, 1, len(grasps), path)


def show_rank(meshcat: Meshcat, rank: int, count: int, path: str = PATH) -> None:
    """Shows one of the grasps that `draw_grasps` drew, and hides the others.

    Args:
        meshcat: Meshcat in which they are drawn.
        rank: rank of the grasp to show, from 1.
        count: number of grasps.
        path: path below which they were drawn.
    """
    for other in range(1, count + 1):
        meshcat.SetProperty(f"{path}/grasps/{other}", "visible", other == rank)


def _marks_B(grasp: ShownGrasp, L: float) -> Array:
    """Returns points of a grasp's fingertips and cones, which numbers avoid [m], shape (9, 3)."""
    along = L * np.array([[-_TIP], [_CONE / 2], [_CONE]])
    p_BC, nhat_B = grasp.grasp.p_BC[:, None], grasp.grasp.nhat_TB_B[:, None]
    return np.asarray(p_BC + along * nhat_B).reshape(-1, 3)


def _draw_number(
    meshcat: Meshcat,
    path: str,
    face: Face,
    k: int,
    L: float,
    keep_clear_B: Array,
    eye_B: Array,
) -> None:
    """Draws the number of a face, visible from outside only."""
    label = label_F(face, k, _LABEL * L, keep_clear_B, eye_B)
    triangles = shape_triangles(face, label, face.reach + 2 * _LIFT * L)
    set_mesh(meshcat, path, triangles, INK, 1.0, Meshcat.SideOfFaceToRender.kFrontSide)


def _draw_plane(meshcat: Meshcat, path: str, object_: GraspObject, grasp: ShownGrasp) -> None:
    """Draws a rectangle of the grasp plane around the object."""
    corners = plane_corners(object_, grasp)
    set_mesh(meshcat, f"{path}/area", corners[[[0, 1, 2], [0, 2, 3]]], PLANE, 0.2)
    border = np.roll(corners, -1, axis=0)
    meshcat.SetLineSegments(f"{path}/border", corners.T, border.T, 1.5, Rgba(*rgb(PLANE)))


def _draw_triangle(meshcat: Meshcat, path: str, p_BC: Array, L: float) -> None:
    set_mesh(meshcat, f"{path}/area", p_BC[None], PLANE, 0.5)
    for i, (p_BA, p_BE) in enumerate(zip(p_BC, np.roll(p_BC, -1, axis=0), strict=True)):
        side = p_BE - p_BA
        length = float(np.linalg.norm(side))
        rod = Cylinder(0.003 * L, length)
        set_shape(
            meshcat, f"{path}/side_{i + 1}", rod, PLANE, 1.0, (p_BA + p_BE) / 2, side / length
        )

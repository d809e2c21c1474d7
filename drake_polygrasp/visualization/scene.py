"""Draws an object and its grasps in Meshcat.

Everything is drawn in body frame B below one path, whose transform can be set to X_WB to show the
body elsewhere. Sizes of marks are fractions of the object's diameter L.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import shapely
from pydrake.geometry import Cylinder, Meshcat, Rgba, Sphere
from pydrake.math import RotationMatrix

from drake_polygrasp.arrays import Array
from drake_polygrasp.files.stated_grasp import StatedGrasp
from drake_polygrasp.geometry.polyhedron import Face, surface_vertices
from drake_polygrasp.grasp import CertifiedGrasp, GraspObject
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
from drake_polygrasp.wrenches.contacts import edge_forces

PATH = "polygrasp"
"""Path in Meshcat's tree below which all is drawn."""
FORCE_SCALE = 0.5
"""Our choice: length of an arrow for the total normal force, over L."""
_TIP, _MARK, _CONE, _LABEL = 0.02, 0.012, 0.14, 0.06
"""Our choice, over L: radii of fingertips and points, side of cones, height of numbers."""
_FROM_AFAR = 4.8
"""Our choice: distance of the eye, over the radius of what it sees in an angle of 30 degrees."""
_LIFT = 1e-3
"""Our choice: distance of marks from the face that they lie on, over L; at 0 the two flicker."""

_NOWHERE = np.empty((0, 3))

ShownGrasp = CertifiedGrasp | StatedGrasp
"""A grasp of a plan, or of a grasp file."""


def draw_object(
    meshcat: Meshcat, object_: GraspObject, *, path: str = PATH, keep_clear_B: Array = _NOWHERE
) -> None:
    """Draws an object: translucent faces with edges and numbers, and its centre of mass.

    Links on its joints are lighter. Patches of a curved surface have neither edges nor numbers;
    faces have no numbers if there are many, except those that a grasp touches.

    Args:
        meshcat: Meshcat to draw in; nothing outside `path` is changed.
        object_: object to draw.
        path: path below which it is drawn in body frame B, as `path`/object.
        keep_clear_B: points in B that numbers avoid if they can [m], shape (K, 3).
    """
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
        _draw_number(meshcat, f"{path}/numbers/{k}", faces[k], k, L, keep_clear_B)
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
                _draw_number(meshcat, f"{here}/number", face, k, L, contacts.p_BC)
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
    _draw_plane(meshcat, f"{path}/plane", object_, contacts.grasp_plane.nhat_B, contacts.p_BC)
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
    contacts_B = grasps[0].grasp.p_BC if grasps else _NOWHERE
    draw_object(meshcat, object_, path=path, keep_clear_B=contacts_B)
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


def look_at(
    meshcat: Meshcat,
    object_: GraspObject,
    grasp: ShownGrasp | None = None,
    *,
    radius: float | None = None,
) -> None:
    """Sets the camera and a plain background of a Meshcat that shows only this object.

    Among a few views from above around the object, it takes the one that sees most of the grasp
    plane and of the touched faces.

    Args:
        meshcat: Meshcat whose camera is set.
        object_: object to look at, drawn with B at the world's origin.
        grasp: grasp to see (default: the object only).
        radius: radius of a ball about the object that is seen whole [m] (default: L / 2).
    """
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)
    for property_ in ("top_color", "bottom_color"):
        meshcat.SetProperty("/Background/<object>", property_, [1.0, 1.0, 1.0])
    L = object_.polyhedron.diameter
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "near", 0.01 * L)
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", 30.0)
    vertices = surface_vertices(object_.polyhedron)
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    distance = _FROM_AFAR * (L / 2 if radius is None else max(radius, L / 2))
    meshcat.SetCameraPose(centre + distance * best_view(grasp), centre)


def best_view(grasp: ShownGrasp | None) -> Array:
    """Returns the direction from the object to the eye that `look_at` chooses.

    Args:
        grasp: grasp to see, if any.

    Returns:
        A unit vector in B, shape (3,).
    """
    views = _views()
    if grasp is None:
        return np.asarray(views[0])
    plane = np.abs(views @ grasp.grasp.grasp_plane.nhat_B)
    # Rounding makes nearly equal views ties, of which the first counts.
    return np.asarray(views[np.argmax(np.round(plane + _seen(views, grasp.grasp.nhat_TB_B), 1))])


def view_of_faces(nhat_B: Array) -> Array:
    """Returns the direction to the eye that sees most of some faces.

    Args:
        nhat_B: their inward unit normals, shape (K, 3).

    Returns:
        A unit vector in B, shape (3,).
    """
    views = _views()
    return np.asarray(views[np.argmax(np.round(_seen(views, nhat_B), 1))])


def _seen(views: Array, nhat_B: Array) -> Array:
    """Returns how much of the faces each view sees, shape (V,)."""
    return np.asarray(np.minimum(-views @ nhat_B.T, 0.5).sum(axis=1) / 3)


def _views() -> Array:
    azimuth = np.radians(np.arange(-60, 300, 30))
    elevation = np.radians([[25], [45]])
    views: Array = np.stack(
        np.broadcast_arrays(
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ),
        axis=-1,
    ).reshape(-1, 3)
    return views


def _draw_number(
    meshcat: Meshcat, path: str, face: Face, k: int, L: float, keep_clear_B: Array
) -> None:
    """Draws the number of a face, visible from outside only."""
    label = label_F(face, k, _LABEL * L, keep_clear_B)
    triangles = shape_triangles(face, label, face.reach + 2 * _LIFT * L)
    set_mesh(meshcat, path, triangles, INK, 1.0, Meshcat.SideOfFaceToRender.kFrontSide)


def _draw_plane(
    meshcat: Meshcat, path: str, object_: GraspObject, nhat_B: Array, p_BC: Array
) -> None:
    """Draws a rectangle of the grasp plane around the object."""
    axes = RotationMatrix.MakeFromOneVector(nhat_B, 2).matrix()[:, :2]
    L = object_.polyhedron.diameter
    xy = (surface_vertices(object_.polyhedron) - p_BC[0]) @ axes
    # GEOS 3.14 returns a sliver if corners of the hull are equal up to rounding.
    hull = shapely.set_precision(shapely.convex_hull(shapely.multipoints(xy)), 1e-9 * L)
    around = shapely.buffer(shapely.oriented_envelope(hull), 0.06 * L, join_style="mitre")
    corners = p_BC[0] + shapely.get_coordinates(around)[:4] @ axes.T
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

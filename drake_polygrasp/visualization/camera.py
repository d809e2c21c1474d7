"""Chooses from where an object and its grasps are seen, and how far away the eye is."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import Meshcat

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.polyhedron import surface_vertices
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.visualization.shown_grasp import FORCE_SCALE, ShownGrasp, plane_corners
from drake_polygrasp.wrenches.contacts import edge_forces

_ANGLE = np.radians(30.0)
"""Our choice: angle of view [rad], small so that parallel edges look parallel."""
_AIR = 1.06
"""Our choice: distance of the eye, over that from which what is drawn fills the picture."""
_ROOM = 1.0
"""Our choice: the largest diameter of objects for which Meshcat's lamps are far enough away [m]."""
_DAYLIGHT = {
    "AmbientLight": 1.6,
    "FillLight": 1.2,
    "PointLightNegativeX": 0.0,
    "PointLightPositiveX": 0.0,
}
"""Our choice: intensities of light that does not depend on how large an object is."""


def look_at(
    meshcat: Meshcat,
    object_: GraspObject,
    grasp: ShownGrasp | None = None,
    *,
    others: Sequence[ShownGrasp] = (),
    radius: float = 0.0,
) -> None:
    """Sets the camera and a plain background of a Meshcat that shows only this object.

    Among a few views from above around the object, it takes the one that sees most of the grasp
    plane and of the touched faces, from where all that is drawn of grasps fits a square picture.

    Args:
        meshcat: Meshcat whose camera is set.
        object_: object to look at, drawn with B at the world's origin.
        grasp: grasp to see (default: the object only).
        others: grasps that fit the picture too, for whoever goes through ranked grasps.
        radius: radius of a ball about the object that fits the picture too [m].
    """
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)
    for property_ in ("top_color", "bottom_color"):
        meshcat.SetProperty("/Background/<object>", property_, [1.0, 1.0, 1.0])
    L = object_.polyhedron.diameter
    if L > _ROOM:
        for light, intensity in _DAYLIGHT.items():
            meshcat.SetProperty(f"/Lights/{light}/<object>", "intensity", intensity)
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "near", 0.01 * L)
    meshcat.SetProperty("/Cameras/default/rotated/<object>", "fov", float(np.degrees(_ANGLE)))
    vertices = surface_vertices(object_.polyhedron)
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    shown = [*others] if grasp is None else [grasp, *others]
    points = np.concatenate([vertices, *(_extent(object_, each) for each in shown)])
    eye_B = best_view(grasp)
    distance = max(_distance(points - centre, eye_B), radius / np.sin(_ANGLE / 2))
    meshcat.SetCameraPose(centre + _AIR * distance * eye_B, centre)


def _extent(object_: GraspObject, grasp: ShownGrasp) -> Array:
    """Returns the outermost points of what is drawn of a grasp in B [m], shape (P, 3)."""
    contacts, L = grasp.grasp, object_.polyhedron.diameter
    f_Bc_B = edge_forces(contacts.p_BC[None], grasp.certificate.internal_force[None])[0]
    arrows = contacts.p_BC + FORCE_SCALE * L * f_Bc_B
    return np.concatenate([contacts.p_BC, arrows, plane_corners(object_, grasp)])


def _distance(points: Array, eye_B: Array) -> float:
    """Returns how far the eye has to be from the origin to see points, shape (P, 3) [m]."""
    right = np.cross([0.0, 0.0, 1.0], eye_B)
    right /= np.linalg.norm(right)
    across = np.abs(points @ np.array([right, np.cross(eye_B, right)]).T).max(axis=1)
    return float((across / np.tan(_ANGLE / 2) + points @ eye_B).max())


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

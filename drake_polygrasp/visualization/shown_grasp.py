"""Defines what a picture of a grasp shows besides the object: its plane, and how long arrows are.

Sizes are fractions of the object's diameter L.
"""

from __future__ import annotations

import numpy as np
import shapely
from pydrake.math import RotationMatrix

from drake_polygrasp.arrays import Array
from drake_polygrasp.files.stated_grasp import StatedGrasp
from drake_polygrasp.geometry.polyhedron import surface_vertices
from drake_polygrasp.grasp import CertifiedGrasp, GraspObject

ShownGrasp = CertifiedGrasp | StatedGrasp
"""A grasp of a plan, or of a grasp file."""
FORCE_SCALE = 0.5
"""Our choice: length of an arrow for the total normal force, over L."""
_AROUND = 0.06
"""Our choice: how far the grasp plane is drawn beyond the object, over L."""


def plane_corners(object_: GraspObject, grasp: ShownGrasp) -> Array:
    """Returns the corners of a rectangle in the grasp plane that reaches around the object.

    Args:
        object_: the object.
        grasp: its grasp.

    Returns:
        Corners in B, in order around the rectangle [m], shape (4, 3).
    """
    L, p_BC = object_.polyhedron.diameter, grasp.grasp.p_BC
    axes = RotationMatrix.MakeFromOneVector(grasp.grasp.grasp_plane.nhat_B, 2).matrix()[:, :2]
    xy = (surface_vertices(object_.polyhedron) - p_BC[0]) @ axes
    # GEOS 3.14 returns a sliver if corners of the hull are equal up to rounding.
    hull = shapely.set_precision(shapely.convex_hull(shapely.multipoints(xy)), 1e-9 * L)
    around = shapely.buffer(shapely.oriented_envelope(hull), _AROUND * L, join_style="mitre")
    return np.asarray(p_BC[0] + shapely.get_coordinates(around)[:4] @ axes.T)

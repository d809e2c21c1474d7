"""Where an object stands on a horizontal plane, so that small spheres may carry it there.

A box that lies on a box has a single point contact in Drake's contact model, and rocks on it.
"""

from __future__ import annotations

import math

import numpy as np
import shapely

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.triangles import face_frame
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.vectors import unit

SUPPORT_RADIUS = 0.004
"""Radius of the spheres that carry the object [m]. Our choice: so small that they are far apart."""
_STANDS = 0.05
"""The centre of mass is at least this times the size of the support polygon within it."""
_LEVEL = 1e-3
"""Corners this much higher than the lowest, over L, still stand on the plane."""
_MOST_SUPPORTS = 8


def support_points(object_: GraspObject, up_B: Array) -> Array | None:
    """Returns where an object stands on a horizontal plane.

    Args:
        object_: the object.
        up_B: unit vector against gravity, shape (3,).

    Returns:
        Points under its lowest corners [m], at most 8, shape (n, 3); None if it would fall over.
    """
    frame = face_frame(up_B)
    points = object_.polyhedron.triangles_B.reshape(-1, 3) @ frame
    low = points[:, 2].min()
    lowest = points[points[:, 2] <= low + _LEVEL * object_.polyhedron.diameter, :2]
    polygon = shapely.MultiPoint(lowest).convex_hull
    centre = shapely.Point((object_.p_BBcm @ frame)[:2])
    if polygon.geom_type != "Polygon" or not polygon.contains(centre):
        return None
    if polygon.exterior.distance(centre) < _STANDS * math.sqrt(polygon.area):
        return None
    corners = np.array(polygon.exterior.coords)[:-1]
    chosen = corners[np.unique(np.linspace(0, len(corners) - 1, _MOST_SUPPORTS).astype(int))]
    # A little within the corners, where the surface is level.
    inward = unit(chosen.mean(axis=0) - chosen) * min(SUPPORT_RADIUS, math.sqrt(polygon.area) / 10)
    return np.column_stack([chosen + inward, np.full(len(chosen), low)]) @ frame.T

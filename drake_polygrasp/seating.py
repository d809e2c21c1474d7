"""Contacts and the surface they are on: the true point and normal, edges, room for a fingertip."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.grasp import Array, Bools, Ints
from drake_polygrasp.polyhedron import (
    ANGLE_TOLERANCE,
    FLATNESS,
    LENGTH_TOLERANCE,
    SAME_NORMAL,
    Face,
    Polyhedron,
    is_convex,
)
from drake_polygrasp.triangles import pairs_closer_than, unit_normals

ON_SURFACE = 1e-6
"""Times the diameter L, ours: a tenth of a micrometre on a decimetre."""
_STEEPEST = np.cos(0.02)
"""Ours: a triangle that leans out of its face by more than 0.02 rad is a needle, and its normal
noise."""


class Seats(NamedTuple):
    """Contacts on the true surface."""

    p_BC: Array
    """[m], shape (M, 3)."""
    nhat_TB_B: Array
    """Inward unit normals, shape (M, 3)."""
    ok: Bools
    """Whether there is a true surface to touch, shape (M,)."""


def seat(polyhedron: Polyhedron, p_BC: Array, face: Ints) -> Seats:
    """Move contacts on faces to the triangles that the faces were merged from.

    A face is flat; its triangles lie up to `FLATNESS` L off it. Contacts p_BC [m], shape (M, 3),
    move along the normals of their faces `face`, shape (M,), to the outermost triangle there, and
    take on its normal.
    """
    p_BC, nhat_TB_B, ok = p_BC.copy(), np.zeros_like(p_BC), np.zeros(len(p_BC), dtype=bool)
    nhat, _ = unit_normals(polyhedron.triangles_B)
    for k in np.unique(face):
        rows = np.flatnonzero(face == k)
        p_BC[rows], nhat_TB_B[rows], ok[rows] = _seat_on_face(
            polyhedron, nhat, polyhedron.faces[k], p_BC[rows]
        )
    return Seats(p_BC, nhat_TB_B, ok)


def _seat_on_face(polyhedron: Polyhedron, nhat: Array, face: Face, p_BC: Array) -> Seats:
    L, Fz = polyhedron.diameter, face.R_BF[:, 2]
    height = (polyhedron.triangles_B - face.p_BF) @ Fz
    flat = (np.abs(height).max(axis=1) <= 2 * FLATNESS * L) & (nhat @ Fz >= _STEEPEST)
    triangles, nhat = polyhedron.triangles_B[flat], nhat[flat]
    tree = shapely.STRtree(shapely.polygons((triangles - face.p_BF) @ face.R_BF[:, :2]))
    points = shapely.points((p_BC - face.p_BF) @ face.R_BF[:, :2])
    i, t = tree.query(points, predicate="dwithin", distance=LENGTH_TOLERANCE * L)
    rise = np.einsum("ij,ij->i", triangles[t, 0] - p_BC[i], nhat[t]) / (nhat[t] @ Fz)
    rise = np.where(np.abs(rise) > LENGTH_TOLERANCE * L, rise, 0)
    order = np.lexsort((t, -rise, i))
    _, first = np.unique(i[order], return_index=True)
    best = order[first]
    i, t = i[best], t[best]
    seated, ok = p_BC.copy(), np.zeros(len(p_BC), dtype=bool)
    seated[i] += rise[best, None] * Fz
    ok[i] = True
    inward = np.tile(-Fz, (len(p_BC), 1))
    leaning = np.linalg.norm(nhat[t] - Fz, axis=1) > ANGLE_TOLERANCE
    inward[i[leaning]] = -nhat[t[leaning]]
    return Seats(seated, inward, ok)


def face_of(polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array) -> Ints:
    """The face that each contact is on, -1 where it is on none; shape (M,).

    A contact p_BC [m], shape (M, 3), is on a face when it is within `ON_SURFACE` L of the exposed
    polygon, and of a triangle whose normal is within `SAME_NORMAL` of the contact's inward normal,
    shape (M, 3). Of several faces the one of least friction is meant.
    """
    L = polyhedron.diameter
    nhat, _ = unit_normals(polyhedron.triangles_B)
    i, t, _ = pairs_closer_than(p_BC, polyhedron.triangles_B, ON_SURFACE * L)
    on_triangle = np.zeros(len(p_BC), dtype=bool)
    on_triangle[i[np.linalg.norm(nhat[t] + nhat_TB_B[i], axis=1) <= SAME_NORMAL]] = True
    found = np.full(len(p_BC), -1)
    for k in sorted(range(len(polyhedron.faces)), key=lambda k: -polyhedron.faces[k].mu):
        face = polyhedron.faces[k]
        p_FC = (p_BC - face.p_BF) @ face.R_BF
        near = on_triangle & (np.abs(p_FC[:, 2]) <= 2 * FLATNESS * L)
        near &= nhat_TB_B @ face.R_BF[:, 2] <= -_STEEPEST
        distance = shapely.distance(face.polygon_F, shapely.points(p_FC[near, :2]))
        found[np.flatnonzero(near)[distance <= ON_SURFACE * L]] = k
    return found


def edge_distance(polyhedron: Polyhedron, p_BC: Array, face: Ints) -> Array:
    """Distance of contacts from the edges of their faces [m], 0 off them; shape (M,).

    Of p_BC [m], shape (M, 3), on the faces `face`, shape (M,).
    """
    R_BF = np.array([f.R_BF for f in polyhedron.faces])[face]
    p_BF = np.array([f.p_BF for f in polyhedron.faces])[face]
    polygons = np.array([f.polygon_F for f in polyhedron.faces], dtype=object)[face]
    points = shapely.points(np.einsum("nij,ni->nj", R_BF[:, :, :2], p_BC - p_BF))
    distance = shapely.distance(shapely.boundary(polygons), points)
    return np.where(shapely.intersects(polygons, points), distance, 0)


def tip_fits(polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, tip_radius: float) -> Bools:
    """Whether a sphere of `tip_radius` [m] that touches from outside penetrates nothing.

    Of contacts p_BC [m] on the exposed surface with inward normals, both (M, 3); shape (M,). The
    distance from the sphere's centre to all triangles decides: beside the contact the sphere is
    outside every part, and one that crosses no triangle is outside all the way. Facets may rise
    out of their face by `FLATNESS` L.
    """
    if is_convex(polyhedron):
        return np.ones(len(p_BC), dtype=bool)
    p_BT = p_BC - tip_radius * nhat_TB_B
    reach = tip_radius - 2 * FLATNESS * polyhedron.diameter
    blocked, _, _ = pairs_closer_than(p_BT, polyhedron.triangles_B, reach)
    fits = np.ones(len(p_BC), dtype=bool)
    fits[blocked] = False
    return fits

"""Contacts and the surface they are on: the true point and normal, edges, room for a fingertip."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.geometry.facets import (
    facets_of,
    is_covered,
    level_distance,
    seat_on_patch,
    touch_patch,
)
from drake_polygrasp.geometry.polyhedron import (
    ANGLE_TOLERANCE,
    FLATNESS,
    LENGTH_TOLERANCE,
    ON_SURFACE,
    SAME_NORMAL,
    Face,
    Polyhedron,
    is_convex,
)
from drake_polygrasp.geometry.triangles import pairs_closer_than, unit_normals

CRACK = 1e-3
"""Times L, ours: gaps narrower than this are closed to any finger, even a point."""
_JUST_INSIDE = 1e-8
"""Times L, ours: as little as can be told from rounding, for beside a sharp edge more leads out."""
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
    """Move contacts on faces and patches to the true surface.

    A face is flat; its triangles lie up to `FLATNESS` L off it, those of a patch farther. Contacts
    p_BC [m], shape (M, 3), move along the normals of their faces `face`, shape (M,), to the
    outermost triangle there, and take on its normal; on patches of a curved solid they take its
    nearest point. Where that is covered or in a sealed cavity, or the triangle is a sliver, there
    is no seat.
    """
    p_BC, nhat_TB_B, ok = p_BC.copy(), np.zeros_like(p_BC), np.zeros(len(p_BC), dtype=bool)
    facets = facets_of(polyhedron)
    for k in np.unique(face):
        rows, on = np.flatnonzero(face == k), polyhedron.faces[k]
        p_BC[rows], nhat_TB_B[rows], ok[rows] = (
            seat_on_patch(polyhedron, facets, on, p_BC[rows])
            if on.reach
            else _seat_on_face(polyhedron, facets.nhat, on, p_BC[rows])
        )
    # True faces are cut where they are covered by anything but curved solids.
    is_patch = np.array([on.reach > 0 for on in polyhedron.faces])
    doubtful = np.flatnonzero(ok & (is_patch[face] | bool(polyhedron.primitives)))
    ok[doubtful] = ~is_covered(polyhedron, p_BC[doubtful], nhat_TB_B[doubtful])
    if polyhedron.cavities is not None:
        ok &= ~polyhedron.cavities.sealed_at(p_BC, nhat_TB_B)
    return Seats(p_BC, nhat_TB_B, ok)


def _seat_on_face(polyhedron: Polyhedron, nhat: Array, face: Face, p_BC: Array) -> Seats:
    L, Fz = polyhedron.diameter, face.R_BF[:, 2]
    flat = _flat(face, polyhedron.triangles_B, nhat, L)
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


class Touch(NamedTuple):
    """Contacts that were stated, as the surface itself has them."""

    face: Ints
    """The face that each contact is on, -1 where it is on none, shape (M,)."""
    p_BC: Array
    """On a triangle of the face [m], shape (M, 3)."""
    nhat_TB_B: Array
    """That triangle's inward unit normal, shape (M, 3)."""


def touch(polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array) -> Touch:
    """The exposed surface at contacts p_BC [m] with inward normals, both of shape (M, 3).

    A contact is on a face when it is within `ON_SURFACE` L of the exposed polygon, and of a
    triangle of it whose normal is within `SAME_NORMAL` of the contact's, when no triangle of the
    face covers it, and the body is behind it. Of several faces the one of least friction is meant.
    On patches the triangle, or the curved solid, must itself be exposed, and the nearest patch is
    meant. Contacts on no face are returned as they are.
    """
    L, triangles = polyhedron.diameter, polyhedron.triangles_B
    nhat, _ = unit_normals(triangles)
    i, t, _ = pairs_closer_than(p_BC, triangles, ON_SURFACE * L)
    leaning = np.linalg.norm(nhat[t] + nhat_TB_B[i], axis=1)
    # Of several triangles the one of the nearest normal comes first.
    order = np.lexsort((t, leaning, i))
    i, t = (of[order[leaning[order] <= SAME_NORMAL]] for of in (i, t))
    face, p, n = np.full(len(p_BC), -1), p_BC.copy(), nhat_TB_B.copy()
    exact = [k for k, of in enumerate(polyhedron.faces) if not of.reach]
    for k in sorted(exact, key=lambda k: -polyhedron.faces[k].mu):
        on_plane = _flat(polyhedron.faces[k], triangles[t], nhat[t], L)
        if not on_plane.any():
            continue
        rows, first = np.unique(i[on_plane], return_index=True)
        below = _distance_beside(polyhedron.faces[k], p_BC[rows]) <= ON_SURFACE * L
        rows, nearest = rows[below], t[on_plane][first[below]]
        rise = np.einsum("ij,ij->i", triangles[nearest, 0] - p_BC[rows], nhat[nearest])
        face[rows], n[rows] = k, -nhat[nearest]
        p[rows] = p_BC[rows] + rise[:, None] * nhat[nearest]
    found = np.flatnonzero(face >= 0)
    seats = seat(polyhedron, p_BC[found], face[found])
    outermost = np.linalg.norm(seats.p_BC - p_BC[found], axis=1) <= ON_SURFACE * L
    covered = found[~(seats.ok & outermost)]
    face[covered], p[covered], n[covered] = -1, p_BC[covered], nhat_TB_B[covered]
    if len(exact) < len(polyhedron.faces):
        rows = np.setdiff1d(np.flatnonzero(face < 0), covered)
        best = np.full(len(p_BC), -1)
        best[i[::-1]] = t[::-1]
        face[rows], p[rows], n[rows] = touch_patch(
            polyhedron, p_BC[rows], nhat_TB_B[rows], best[rows]
        )
    if polyhedron.watertight:
        # Where a shell crosses itself, some of its walls have the body on their other side.
        hollow = ~is_covered(polyhedron, p, -n, _JUST_INSIDE)
        face[hollow], p[hollow], n[hollow] = -1, p_BC[hollow], nhat_TB_B[hollow]
    return Touch(face, p, n)


def face_of(polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array) -> Ints:
    """The face that each contact is on, -1 where it is on none; as of `touch`, shape (M,)."""
    return touch(polyhedron, p_BC, nhat_TB_B).face


def _flat(face: Face, triangles: Array, nhat: Array, L: float) -> Bools:
    """Which triangles (T, 3, 3) of normals (T, 3) lie in the face's plane, on either side of it."""
    Fz = face.R_BF[:, 2]
    height = np.abs((triangles - face.p_BF) @ Fz).max(axis=1)
    return np.asarray((height <= 2 * FLATNESS * L) & (nhat @ Fz >= _STEEPEST))


def _distance_beside(face: Face, p_BC: Array) -> Array:
    """Distance of points, seen along the face's normal, from its polygon [m], shape (M,)."""
    xy = (p_BC - face.p_BF) @ face.R_BF[:, :2]
    return np.asarray(shapely.distance(face.polygon_F, shapely.points(xy)))


def edge_distance(polyhedron: Polyhedron, p_BC: Array, face: Ints) -> Array:
    """Distance of contacts from the edges of their faces [m], 0 off them; shape (M,).

    Of p_BC [m], shape (M, 3), on the faces `face`, shape (M,). On patches, from the sides of the
    facet; on curved solids, how far the normal stays the same to a milliradian.
    """
    distance = np.zeros(len(p_BC))
    is_patch = np.array([on.reach > 0 for on in polyhedron.faces])[face]
    if is_patch.any():
        distance[is_patch] = level_distance(polyhedron, p_BC[is_patch], face[is_patch])
    for k in np.unique(face[~is_patch]):
        rows, on = np.flatnonzero(face == k), polyhedron.faces[k]
        points = shapely.points((p_BC[rows] - on.p_BF) @ on.R_BF[:, :2])
        to_edges = shapely.distance(shapely.boundary(on.polygon_F), points)
        distance[rows] = np.where(shapely.intersects(on.polygon_F, points), to_edges, 0)
    return distance


def least_tip(polyhedron: Polyhedron, tip_radius: float) -> float:
    """The radius of the sphere that must fit [m].

    A point, of `tip_radius` 0, must still find the surface open to the width of a `CRACK`.
    """
    return max(tip_radius, CRACK / 2 * polyhedron.diameter)


def tip_fits(polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, tip_radius: float) -> Bools:
    """Whether a sphere of `tip_radius` [m] that touches from outside penetrates nothing.

    Of contacts p_BC [m] on the exposed surface with inward normals, both (M, 3); shape (M,). The
    distance from the sphere's centre to all triangles and curved solids decides: beside the
    contact the sphere is outside every part, and one that crosses none is outside all the way.
    Facets may rise out of their face by `FLATNESS` L. Tips have the radius of `least_tip` at least.
    """
    if is_convex(polyhedron):
        return np.ones(len(p_BC), dtype=bool)
    L = polyhedron.diameter
    tip_radius = least_tip(polyhedron, tip_radius)
    p_BT = p_BC - tip_radius * nhat_TB_B
    reach = tip_radius - 2 * FLATNESS * L
    blocked, _, _ = pairs_closer_than(p_BT, polyhedron.triangles_B, reach)
    fits = np.ones(len(p_BC), dtype=bool)
    fits[blocked] = False
    for solid in polyhedron.primitives:
        fits &= solid.distance(p_BT) >= reach
    return fits

"""Contacts on patches: the facets and curved solids that patches stand for.

Planning takes a patch for a plane; fingers touch one of its facets, or the curved solid under it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.geometry.polyhedron import Face, Polyhedron
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.tolerances import ON_SURFACE, SAME_NORMAL
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.vectors import times

_STEEPEST_ON_PATCH = np.cos(0.6)
"""Our choice, about 35 degrees: facets that lean more from their patch are noise, not touched."""
_SLIVER = 2e-5
"""Times L, our choice: facets with a smaller inradius are slivers, whose normals are noise."""
_OFF_EDGE = 3e-6
"""Times L, our choice: distance of contacts from edges of facets, with which all checks agree."""
_JUST_OUTSIDE = 1e-5
"""Times L, our choice: height over a contact of the point that is tested for being covered."""
_LEVEL = 1e-3
"""Times the least radius of curvature, our choice: over this distance the normal turns by at most a
milliradian, and the surface counts as flat."""


def is_covered(
    polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, step: float = _JUST_OUTSIDE
) -> Bools:
    """Returns which contacts are covered by a part of the body or by another body.

    Args:
        polyhedron: the body.
        p_BC: contact points on the surface [m], shape (M, 3).
        nhat_TB_B: inward unit normals, shape (M, 3).
        step: distance outside the contact, over L, of the point that is tested for being inside.

    Returns:
        Shape (M,).
    """
    outside = p_BC - step * polyhedron.diameter * nhat_TB_B
    covered = polyhedron.solids.winding_numbers(outside) > 0
    for solid in (*polyhedron.primitives, *polyhedron.covering):
        covered |= solid.distance(outside) < 0
    return covered


class Facets(NamedTuple):
    """Properties of all triangles of a body.

    Attributes:
        nhat: outward unit normals, shape (T, 3).
        mu: friction coefficient of each triangle's face or patch, NaN without one, shape (T,).
        wide: whether each triangle is no sliver, shape (T,).
    """

    nhat: Array
    mu: Array
    wide: Bools


def facets_of(polyhedron: Polyhedron) -> Facets:
    """Returns the properties of a body's triangles that `project_on_patch` needs.

    Args:
        polyhedron: the body.
    """
    nhat, _ = unit_normals(polyhedron.triangles_B)
    mu = np.append(polyhedron.mu, np.nan)[polyhedron.triangle_face]
    return Facets(nhat, mu, _inradius(polyhedron.triangles_B) >= _SLIVER * polyhedron.diameter)


def project_on_patch(
    polyhedron: Polyhedron, facets: Facets, face: Face, p_BC: Array
) -> tuple[Array, Array, Bools]:
    """Projects contacts from the plane of a patch onto the surface under it.

    Contacts keep away from the edges of facets, where the normal is ambiguous.

    Args:
        polyhedron: the body.
        facets: properties of its triangles.
        face: the patch.
        p_BC: contacts on the plane of the patch [m], shape (M, 3).

    Returns:
        Points on the surface [m] and inward unit normals, shape (M, 3) each, and whether there is
        a facet to touch, shape (M,).
    """
    if face.primitive is not None:
        projected, outward = face.primitive.project(p_BC)
        return projected, -outward, np.ones(len(p_BC), dtype=bool)
    L, Fz, nhat = polyhedron.diameter, face.R_BF[:, 2], facets.nhat
    near = facets.wide & (facets.mu == face.mu) & (times(nhat, Fz) >= _STEEPEST_ON_PATCH)
    candidates = np.flatnonzero(near)
    height = times(polyhedron.triangles_B[candidates] - face.p_BF, Fz)
    candidates = candidates[np.abs(height).max(axis=1, initial=0) <= 2 * face.reach]
    triangles = polyhedron.triangles_B[candidates]
    tree = shapely.STRtree(shapely.polygons(times(triangles - face.p_BF, face.R_BF[:, :2])))
    points = shapely.points(times(p_BC - face.p_BF, face.R_BF[:, :2]))
    i, t = tree.query(points, predicate="intersects")
    t = candidates[t]
    rise = np.einsum("ij,ij->i", polyhedron.triangles_B[t, 0] - p_BC[i], nhat[t]) / times(
        nhat[t], Fz
    )
    order = np.lexsort((t, -rise, i))
    i, first = np.unique(i[order], return_index=True)
    t, rise = t[order][first], rise[order][first]
    projected, inward = p_BC.copy(), np.tile(-Fz, (len(p_BC), 1))
    ok = np.zeros(len(p_BC), dtype=bool)
    projected[i] = _off_edges(p_BC[i] + rise[:, None] * Fz, polyhedron.triangles_B[t], L)
    inward[i], ok[i] = -nhat[t], True
    return projected, inward, ok


def _inradius(triangles: Array) -> Array:
    """Returns the inradii of triangles."""
    _, area = unit_normals(triangles)
    perimeter = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=2).sum(axis=1)
    return np.asarray(2 * area / np.where(perimeter > 0, perimeter, 1))


def _off_edges(points: Array, triangles: Array, L: float) -> Array:
    """Returns points (M, 3) of triangles (M, 3, 3), those on edges moved towards the incentre."""
    side = np.linalg.norm(np.roll(triangles, 1, axis=1) - np.roll(triangles, -1, axis=1), axis=2)
    incenter = np.einsum("ni,nij->nj", side, triangles) / side.sum(axis=1)[:, None]
    radius, distance = _inradius(triangles), _side_distance(points, triangles)
    step = (_OFF_EDGE * L - distance) / np.maximum(radius - distance, 1e-300)
    return np.asarray(points + np.clip(step, 0, 1)[:, None] * (incenter - points))


def _side_distance(points: Array, triangles: Array) -> Array:
    """Returns the distances of points (M, 3) from the sides of their triangles (M, 3, 3), (M,)."""
    side = np.roll(triangles, -1, axis=1) - triangles
    arm = np.cross(points[:, None] - triangles, side)
    length = np.linalg.norm(side, axis=2)
    return np.asarray((np.linalg.norm(arm, axis=2) / length).min(axis=1))


def locate_on_patch(
    polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, triangle: Ints
) -> tuple[Ints, Array, Array]:
    """Returns the patches that contacts are on, and the exact points and normals there.

    Args:
        polyhedron: the body.
        p_BC: contact points [m], shape (M, 3).
        nhat_TB_B: inward unit normals, shape (M, 3).
        triangle: the triangle that each contact is on, -1 for none, shape (M,).

    Returns:
        The patch, -1 where the surface is covered or not of a patch, shape (M,); and the point on
        the surface [m] and its inward unit normal, shape (M, 3) each, which are those of the
        contact where there is no patch.
    """
    face = np.where(triangle >= 0, polyhedron.triangle_face[triangle], -1)
    face[~np.append(polyhedron.is_faceted, False)[face]] = -1
    nhat, _ = unit_normals(polyhedron.triangles_B)
    on = np.flatnonzero(face >= 0)
    p, n = p_BC.copy(), nhat_TB_B.copy()
    n[on] = -nhat[triangle[on]]
    rise = np.einsum("ij,ij->i", polyhedron.triangles_B[triangle[on], 0] - p_BC[on], n[on])
    p[on] += rise[:, None] * n[on]
    for solid in polyhedron.primitives:
        surface, outward = solid.project(p_BC)
        along = np.linalg.norm(outward + nhat_TB_B, axis=1) <= SAME_NORMAL
        rows = np.flatnonzero(solid.on_curve(p_BC, ON_SURFACE * polyhedron.diameter) & along)
        face[rows], p[rows], n[rows] = (
            _nearest_facet(polyhedron, solid, p_BC[rows]),
            surface[rows],
            -outward[rows],
        )
    lost = (face < 0) | is_covered(polyhedron, p, n)
    if polyhedron.cavities is not None:
        lost |= polyhedron.cavities.sealed_at(p, n)
    face[lost], p[lost], n[lost] = -1, p_BC[lost], nhat_TB_B[lost]
    return face, p, n


def _nearest_facet(polyhedron: Polyhedron, solid: Primitive, p_BC: Array) -> Ints:
    """Returns the patch of a curved solid nearest to each of its points p_BC, shape (M,)."""
    found, least = np.full(len(p_BC), -1), np.full(len(p_BC), np.inf)
    for k, face in enumerate(polyhedron.faces):
        if face.primitive is solid:
            p_FC = times(p_BC - face.p_BF, face.R_BF)
            beside = shapely.distance(face.polygon_F, shapely.points(p_FC[:, :2]))
            distance = np.sqrt(beside**2 + p_FC[:, 2] ** 2)
            nearer = distance < least
            found[nearer], least[nearer] = k, distance[nearer]
    return found


def level_distance(polyhedron: Polyhedron, p_BC: Array, face: Ints) -> Array:
    """Returns how far from contacts on patches the surface is flat.

    That is the distance to the sides of the facet, or, on curved solids, a distance over which the
    normal turns by at most a milliradian.

    Args:
        polyhedron: the body.
        p_BC: contact points [m], shape (M, 3).
        face: index of each contact's patch, shape (M,).

    Returns:
        [m], shape (M,).
    """
    solids = [polyhedron.faces[k].primitive for k in face]
    distance = np.array([0.0 if solid is None else _LEVEL * solid.bend for solid in solids])
    rows = np.flatnonzero([solid is None for solid in solids])
    if not len(rows):
        return distance
    nhat, _ = unit_normals(polyhedron.triangles_B)
    Fz = polyhedron.R_BF[face, :, 2]
    i, t, _ = polyhedron.surface.closer_than(p_BC, ON_SURFACE * polyhedron.diameter)
    on = np.isin(i, rows) & (np.einsum("ij,ij->i", nhat[t], Fz[i]) > 0)
    i, t = i[on], t[on]
    np.maximum.at(distance, i, _side_distance(p_BC[i], polyhedron.triangles_B[t]))
    return distance

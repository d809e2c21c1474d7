"""Projects contacts onto the true surface, locates stated ones, and tests that fingertips fit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, distinct_values
from drake_polygrasp.geometry.face_contacts import (
    coordinates_in_planes,
    face_planes,
    first_of_runs,
    project_on_faces,
    triangles_in_planes,
)
from drake_polygrasp.geometry.facets import (
    facets_of,
    is_covered,
    level_distance,
    locate_on_patch,
    project_on_patch,
)
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.tolerances import ON_SURFACE, SAME_NORMAL
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.vectors import dot, times

CRACK = 1e-3
"""Times L, our choice: gaps narrower than this admit no finger, not even a point."""
TIP_SLACK = ON_SURFACE / 2
"""Times L, our choice: allowed penetration of a fingertip, half of what the plant's check of the
geometry allows, so that all checks agree."""
_JUST_INSIDE = 1e-8
"""Times L, our choice: depth under a contact of the point that is tested for being inside, little
more than rounding errors, because next to a sharp edge a deeper point would be outside."""


class ProjectedContacts(NamedTuple):
    """Contacts on the true surface.

    Attributes:
        p_BC: contact points [m], shape (M, 3).
        nhat_TB_B: inward unit normals, shape (M, 3).
        ok: whether there is a surface to touch, shape (M,). Where there is none, point and normal
            have no meaning.
    """

    p_BC: Array
    nhat_TB_B: Array
    ok: Bools


def project_contacts(polyhedron: Polyhedron, p_BC: Array, face: Ints) -> ProjectedContacts:
    """Projects contacts from the planes of faces and patches onto the true surface.

    The triangles of a face lie up to `FLATNESS` L off its plane, those of a patch farther. Contacts
    move along the normal of the face to the outermost triangle there and take its normal; on
    patches of a curved solid they move to a point of that solid. The projection fails where the
    surface is covered or in a sealed cavity, or where the triangle is a sliver.

    Args:
        polyhedron: the body.
        p_BC: contacts on the planes of their faces [m], shape (M, 3).
        face: index of each contact's face or patch, shape (M,).

    Returns:
        Points and normals, and where the projection succeeds.
    """
    p_BC, nhat_TB_B, ok = p_BC.copy(), np.zeros_like(p_BC), np.zeros(len(p_BC), dtype=bool)
    is_patch = polyhedron.is_patch[face]
    flat, curved = np.flatnonzero(~is_patch), np.flatnonzero(is_patch)
    p_BC[flat], nhat_TB_B[flat], ok[flat] = project_on_faces(polyhedron, p_BC[flat], face[flat])
    if len(curved):
        facets = facets_of(polyhedron)
        for k in distinct_values(face[curved]):
            rows = np.flatnonzero(face == k)
            p_BC[rows], nhat_TB_B[rows], ok[rows] = project_on_patch(
                polyhedron, facets, polyhedron.faces[k], p_BC[rows]
            )
    # Faces are already cut to their exposed part, except where curved solids cover them.
    doubtful = np.flatnonzero(ok & (is_patch | bool(polyhedron.primitives or polyhedron.covering)))
    ok[doubtful] = ~is_covered(polyhedron, p_BC[doubtful], nhat_TB_B[doubtful])
    if polyhedron.cavities is not None:
        ok &= ~polyhedron.cavities.sealed_at(p_BC, nhat_TB_B)
    return ProjectedContacts(p_BC, nhat_TB_B, ok)


class LocatedContacts(NamedTuple):
    """The exact points and normals of the surface at stated contacts.

    Attributes:
        face: the face that each contact is on, -1 for none, shape (M,).
        p_BC: points on triangles of the faces [m], shape (M, 3).
        nhat_TB_B: inward unit normals of these triangles, shape (M, 3).
    """

    face: Ints
    p_BC: Array
    nhat_TB_B: Array


def locate_contacts(polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array) -> LocatedContacts:
    """Finds the faces that stated contacts are on.

    A contact is on a face if it is within `ON_SURFACE` L of the exposed polygon and of one of its
    triangles, if the normals of contact and triangle differ by at most `SAME_NORMAL`, if no other
    triangle of the face covers it, and if the body is behind it. Among several faces the one of
    lowest friction is taken. On patches the triangle or the curved solid must itself be exposed,
    and on a curved solid the nearest patch is taken.

    Args:
        polyhedron: the body.
        p_BC: contact points [m], shape (M, 3).
        nhat_TB_B: inward unit normals, shape (M, 3).

    Returns:
        Faces, points and normals; contacts on no face keep their points and normals.
    """
    L = polyhedron.diameter
    i, t, _ = polyhedron.surface.closer_than(p_BC, ON_SURFACE * L)
    triangles, nhat = polyhedron.triangles_B[t], unit_normals(polyhedron.triangles_B[t])[0]
    lean = nhat + nhat_TB_B[i]
    leaning = np.sqrt(dot(lean, lean))
    # The triangle with the most similar normal comes first.
    order = np.lexsort((t, leaning, i))
    order = order[leaning[order] <= SAME_NORMAL]
    i, t, triangles, nhat = i[order], t[order], triangles[order], nhat[order]
    face, p, n = np.full(len(p_BC), -1), p_BC.copy(), nhat_TB_B.copy()
    exact = np.flatnonzero(~polyhedron.is_patch)
    k, pair = triangles_in_planes(polyhedron, exact, triangles, nhat)
    first = first_of_runs(k * len(p_BC) + i[pair])
    k, pair = k[first], pair[first]
    xy = coordinates_in_planes(face_planes(polyhedron, k), p_BC[i[pair]])
    below = shapely.distance(polyhedron.polygon_F[k], shapely.points(xy)) <= ON_SURFACE * L
    k, pair = k[below], pair[below]
    order = np.lexsort((-k, polyhedron.mu[k], i[pair]))
    least = order[first_of_runs(i[pair[order]])]
    k, pair = k[least], pair[least]
    rows, n_t = i[pair], nhat[pair]
    face[rows], n[rows] = k, -n_t
    p[rows] += dot(triangles[pair, 0] - p_BC[rows], n_t)[:, None] * n_t
    found = np.flatnonzero(face >= 0)
    projected = project_contacts(polyhedron, p_BC[found], face[found])
    outermost = np.linalg.norm(projected.p_BC - p_BC[found], axis=1) <= ON_SURFACE * L
    covered = found[~(projected.ok & outermost)]
    face[covered], p[covered], n[covered] = -1, p_BC[covered], nhat_TB_B[covered]
    if len(exact) < len(polyhedron.faces):
        rows = np.setdiff1d(np.flatnonzero(face < 0), covered)
        best = np.full(len(p_BC), -1)
        best[i[::-1]] = t[::-1]
        face[rows], p[rows], n[rows] = locate_on_patch(
            polyhedron, p_BC[rows], nhat_TB_B[rows], best[rows]
        )
    if polyhedron.watertight:
        # Where a shell intersects itself, some of its triangles have the body on the wrong side.
        hollow = ~is_covered(polyhedron, p, -n, _JUST_INSIDE)
        face[hollow], p[hollow], n[hollow] = -1, p_BC[hollow], nhat_TB_B[hollow]
    return LocatedContacts(face, p, n)


def face_at(polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array) -> Ints:
    """Returns the face that each contact is on, as `locate_contacts` finds it.

    Args:
        polyhedron: the body.
        p_BC: contact points [m], shape (M, 3).
        nhat_TB_B: inward unit normals, shape (M, 3).

    Returns:
        Indices of faces, -1 for none, shape (M,).
    """
    return locate_contacts(polyhedron, p_BC, nhat_TB_B).face


def edge_distance(polyhedron: Polyhedron, p_BC: Array, face: Ints) -> Array:
    """Returns the distances of contacts from the edges of their faces.

    On patches the sides of the facet are its edges; on curved solids it is a distance over which
    the normal turns by at most a milliradian.

    Args:
        polyhedron: the body.
        p_BC: contact points [m], shape (M, 3).
        face: index of each contact's face, shape (M,).

    Returns:
        [m], shape (M,); 0 for contacts off their faces.
    """
    distance = np.zeros(len(p_BC))
    is_patch = polyhedron.is_patch[face]
    if is_patch.any():
        distance[is_patch] = level_distance(polyhedron, p_BC[is_patch], face[is_patch])
    for k in distinct_values(face[~is_patch]):
        rows, on = np.flatnonzero(face == k), polyhedron.faces[k]
        points = shapely.points(times(p_BC[rows] - on.p_BF, on.R_BF[:, :2]))
        to_edges = shapely.distance(shapely.boundary(on.polygon_F), points)
        distance[rows] = np.where(shapely.intersects(on.polygon_F, points), to_edges, 0)
    return distance


def effective_tip_radius(polyhedron: Polyhedron, tip_radius: float) -> float:
    """Returns the radius of the sphere that must fit at a contact, at least half a `CRACK` [m].

    Args:
        polyhedron: the body.
        tip_radius: radius of the fingertip [m]; 0 for a point, which must still reach the contact.
    """
    return max(tip_radius, CRACK / 2 * polyhedron.diameter)


def fingertip_fits(
    polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, tip_radius: float
) -> Bools:
    """Returns at which contacts a spherical fingertip penetrates nothing.

    The test is the distance from the sphere's centre to all triangles and curved solids: a sphere
    that touches an exposed contact from outside and intersects no surface is outside every part.
    It fails where a neighbouring facet rises into the tip by more than `TIP_SLACK` L.

    Args:
        polyhedron: the body.
        p_BC: contact points on the exposed surface [m], shape (M, 3).
        nhat_TB_B: inward unit normals, shape (M, 3).
        tip_radius: radius of the fingertips [m], raised to that of `effective_tip_radius`.

    Returns:
        Shape (M,).
    """
    slack = TIP_SLACK * polyhedron.diameter
    if polyhedron.greatest_rise <= slack:
        return np.ones(len(p_BC), dtype=bool)
    tip_radius = effective_tip_radius(polyhedron, tip_radius)
    p_BT = p_BC - tip_radius * nhat_TB_B
    reach = tip_radius - slack
    fits = ~polyhedron.surface.within(p_BT, reach)
    for solid in (*polyhedron.primitives, *polyhedron.covering):
        fits &= solid.distance(p_BT) >= reach
    return fits


def fingertips_are_apart(
    polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, tip_radius: float
) -> Bools:
    """Returns at which grasps no two spherical fingertips overlap.

    Args:
        polyhedron: the body.
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        tip_radius: radius of the fingertips [m], raised to that of `effective_tip_radius`.

    Returns:
        Shape (M,).
    """
    tip_radius = effective_tip_radius(polyhedron, tip_radius)
    p_BT = p_BC - tip_radius * nhat_TB_B
    gap = p_BT - np.roll(p_BT, 1, axis=1)
    least = 2 * tip_radius - TIP_SLACK * polyhedron.diameter
    return np.asarray(np.sqrt(dot(gap, gap)).min(axis=1) >= least)

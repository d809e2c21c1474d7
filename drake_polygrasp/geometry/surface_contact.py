"""Contacts and the surface they are on: the true point and normal, edges, room for a fingertip."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, batches
from drake_polygrasp.geometry.facets import (
    facets_of,
    is_covered,
    level_distance,
    locate_on_patch,
    project_on_patch,
)
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.tolerances import (
    ANGLE_TOLERANCE,
    FLATNESS,
    LENGTH_TOLERANCE,
    ON_SURFACE,
    SAME_NORMAL,
)
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.vectors import dot, product, times, transformed

CRACK = 1e-3
"""Times L, ours: gaps narrower than this are closed to any finger, even a point."""
TIP_SLACK = ON_SURFACE / 2
"""Times L, ours: how deep a fingertip may be in what it touches for all checks to agree that it is
outside: half of what the plant's check of the geometry allows."""
_JUST_INSIDE = 1e-8
"""Times L, ours: as little as can be told from rounding, for beside a sharp edge more leads out."""
_PAIRS_AT_ONCE = 1 << 20
"""Of faces and triangles that are compared at once, ours: temporaries of some 50 MB."""
_STEEPEST = np.cos(0.02)
"""Ours: a triangle that leans out of its face by more than 0.02 rad is a needle, and its normal
noise."""


class ProjectedContacts(NamedTuple):
    """Contacts on the true surface.

    Attributes:
        p_BC: [m], shape (M, 3).
        nhat_TB_B: inward unit normals, shape (M, 3).
        ok: whether there is a true surface to touch, shape (M,).
    """

    p_BC: Array
    nhat_TB_B: Array
    ok: Bools


def project_contacts(polyhedron: Polyhedron, p_BC: Array, face: Ints) -> ProjectedContacts:
    """Move contacts on faces and patches to the true surface.

    A face is flat; its triangles lie up to `FLATNESS` L off it, those of a patch farther. Contacts
    p_BC [m], shape (M, 3), move along the normals of their faces `face`, shape (M,), to the
    outermost triangle there, and take on its normal; on patches of a curved solid they take its
    nearest point. Where that is covered or in a sealed cavity, or the triangle is a sliver, there
    no point of the true surface is found.
    """
    p_BC, nhat_TB_B, ok = p_BC.copy(), np.zeros_like(p_BC), np.zeros(len(p_BC), dtype=bool)
    is_patch = polyhedron.is_patch[face]
    flat, curved = np.flatnonzero(~is_patch), np.flatnonzero(is_patch)
    p_BC[flat], nhat_TB_B[flat], ok[flat] = _seat_on_faces(polyhedron, p_BC[flat], face[flat])
    if len(curved):
        facets = facets_of(polyhedron)
        for k in np.unique(face[curved]):
            rows = np.flatnonzero(face == k)
            p_BC[rows], nhat_TB_B[rows], ok[rows] = project_on_patch(
                polyhedron, facets, polyhedron.faces[k], p_BC[rows]
            )
    # True faces are cut where they are covered by anything but curved solids.
    doubtful = np.flatnonzero(ok & (is_patch | bool(polyhedron.primitives or polyhedron.covering)))
    ok[doubtful] = ~is_covered(polyhedron, p_BC[doubtful], nhat_TB_B[doubtful])
    if polyhedron.cavities is not None:
        ok &= ~polyhedron.cavities.sealed_at(p_BC, nhat_TB_B)
    return ProjectedContacts(p_BC, nhat_TB_B, ok)


def _seat_on_faces(polyhedron: Polyhedron, p_BC: Array, face: Ints) -> ProjectedContacts:
    L, planes = polyhedron.diameter, _planes(polyhedron, face)
    Fz = planes.R_BF[:, :, 2]
    height = np.abs(dot(p_BC - planes.p_BF, Fz)).max(initial=0.0)
    # Whatever triangle of its face a contact is above or below is within reach.
    reach = height + 2 * (FLATNESS + LENGTH_TOLERANCE) * L
    projected, inward, ok = p_BC.copy(), -Fz, np.zeros(len(p_BC), dtype=bool)
    for pairs in polyhedron.surface.near(p_BC, reach):
        i, rise, nhat = _outermost(polyhedron, planes, p_BC, *pairs)
        projected[i] += rise[:, None] * Fz[i]
        ok[i] = True
        lean = nhat - Fz[i]
        leaning = np.sqrt(dot(lean, lean)) > ANGLE_TOLERANCE
        inward[i[leaning]] = -nhat[leaning]
    return ProjectedContacts(projected, inward, ok)


def _outermost(
    polyhedron: Polyhedron, planes: _Planes, p_BC: Array, i: Ints, t: Ints
) -> tuple[Ints, Array, Array]:
    """Of pairs of contacts i (N,) and triangles t (N,), the outermost above or below each contact.

    Returns the contacts that have one, how high it is over them [m], and its outward normal.
    """
    L, Fz = polyhedron.diameter, planes.R_BF[:, :, 2]
    triangles, nhat = polyhedron.triangles_B[t], unit_normals(polyhedron.triangles_B[t])[0]
    xyz = product(triangles - planes.p_BF[i, None], planes.R_BF[i])
    keep = _is_flat(xyz[..., 2], dot(nhat, Fz[i]), L)
    beside = _beside(_Planes(planes.R_BF[i[keep]], planes.p_BF[i[keep]]), p_BC[i[keep]])
    keep[keep] = shapely.dwithin(
        shapely.polygons(xyz[keep, :, :2]), shapely.points(beside), LENGTH_TOLERANCE * L
    )
    i, t, triangles, nhat = i[keep], t[keep], triangles[keep], nhat[keep]
    rise = dot(triangles[:, 0] - p_BC[i], nhat) / dot(nhat, Fz[i])
    rise = np.where(np.abs(rise) > LENGTH_TOLERANCE * L, rise, 0)
    order = np.lexsort((t, -rise, i))
    best = order[_first_of_each(i[order])]
    return i[best], rise[best], nhat[best]


class LocatedContacts(NamedTuple):
    """Contacts that were stated, as the surface itself has them.

    Attributes:
        face: the face that each contact is on, -1 where it is on none, shape (M,).
        p_BC: on a triangle of the face [m], shape (M, 3).
        nhat_TB_B: that triangle's inward unit normal, shape (M, 3).
    """

    face: Ints
    p_BC: Array
    nhat_TB_B: Array


def locate_contacts(polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array) -> LocatedContacts:
    """The exposed surface at contacts p_BC [m] with inward normals, both of shape (M, 3).

    A contact is on a face when it is within `ON_SURFACE` L of the exposed polygon, and of a
    triangle of it whose normal is within `SAME_NORMAL` of the contact's, when no triangle of the
    face covers it, and the body is behind it. Of several faces the one of least friction is meant.
    On patches the triangle, or the curved solid, must itself be exposed, and the nearest patch is
    meant. Contacts on no face are returned as they are.
    """
    L = polyhedron.diameter
    i, t, _ = polyhedron.surface.closer_than(p_BC, ON_SURFACE * L)
    triangles, nhat = polyhedron.triangles_B[t], unit_normals(polyhedron.triangles_B[t])[0]
    lean = nhat + nhat_TB_B[i]
    leaning = np.sqrt(dot(lean, lean))
    # Of several triangles the one of the nearest normal comes first.
    order = np.lexsort((t, leaning, i))
    order = order[leaning[order] <= SAME_NORMAL]
    i, t, triangles, nhat = i[order], t[order], triangles[order], nhat[order]
    face, p, n = np.full(len(p_BC), -1), p_BC.copy(), nhat_TB_B.copy()
    exact = np.flatnonzero(~polyhedron.is_patch)
    k, pair = _flat_pairs(polyhedron, exact, triangles, nhat)
    first = _first_of_each(k * len(p_BC) + i[pair])
    k, pair = k[first], pair[first]
    xy = _beside(_planes(polyhedron, k), p_BC[i[pair]])
    below = shapely.distance(polyhedron.polygon_F[k], shapely.points(xy)) <= ON_SURFACE * L
    k, pair = k[below], pair[below]
    order = np.lexsort((-k, polyhedron.mu[k], i[pair]))
    least = order[_first_of_each(i[pair[order]])]
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
        # Where a shell crosses itself, some of its walls have the body on their other side.
        hollow = ~is_covered(polyhedron, p, -n, _JUST_INSIDE)
        face[hollow], p[hollow], n[hollow] = -1, p_BC[hollow], nhat_TB_B[hollow]
    return LocatedContacts(face, p, n)


def face_at(polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array) -> Ints:
    """Returns the face that `locate_contacts` finds for each contact, -1 for none, shape (M,)."""
    return locate_contacts(polyhedron, p_BC, nhat_TB_B).face


class _Planes(NamedTuple):
    """The frames F of faces, one for each of some contacts."""

    R_BF: Array
    """Shape (M, 3, 3)."""
    p_BF: Array
    """[m], shape (M, 3)."""


def _planes(polyhedron: Polyhedron, face: Ints) -> _Planes:
    return _Planes(polyhedron.R_BF[face], polyhedron.p_BF[face])


def _beside(planes: _Planes, p_BC: Array) -> Array:
    """Points, one for each plane, seen along its normal [m], shape (M, 2)."""
    return transformed(planes.R_BF[:, :, :2].swapaxes(1, 2), p_BC - planes.p_BF)


def _flat_pairs(
    polyhedron: Polyhedron, face: Ints, triangles: Array, nhat: Array
) -> tuple[Ints, Ints]:
    """Which faces which triangles (T, 3, 3) of normals (T, 3) lie in, and which those are."""
    none = np.empty(0, dtype=np.int64)
    found = [(none, none)]
    for rows in batches(len(face), _PAIRS_AT_ONCE // max(1, len(triangles))):
        planes = _planes(polyhedron, face[rows])
        cosine = times(planes.R_BF[:, :, 2], nhat.T)
        k, t = np.nonzero(cosine >= _STEEPEST)
        height = dot(triangles[t] - planes.p_BF[k, None], planes.R_BF[k, None, :, 2])
        flat = _is_flat(height, cosine[k, t], polyhedron.diameter)
        found.append((face[rows][k[flat]], t[flat]))
    k, t = (np.concatenate(x) for x in zip(*found, strict=True))
    return k, t


def _is_flat(height: Array, cosine: Array, L: float) -> Bools:
    """Whether triangles whose vertices are at heights (T, 3) over a plane lie in it, on a side."""
    return np.asarray((np.abs(height).max(axis=1) <= 2 * FLATNESS * L) & (cosine >= _STEEPEST))


def _first_of_each(keys: Ints) -> Ints:
    """Where each run of equal keys begins."""
    return np.flatnonzero(np.diff(keys, prepend=-1))


def edge_distance(polyhedron: Polyhedron, p_BC: Array, face: Ints) -> Array:
    """Distance of contacts from the edges of their faces [m], 0 off them; shape (M,).

    Of p_BC [m], shape (M, 3), on the faces `face`, shape (M,). On patches, from the sides of the
    facet; on curved solids, how far the normal stays the same to a milliradian.
    """
    distance = np.zeros(len(p_BC))
    is_patch = polyhedron.is_patch[face]
    if is_patch.any():
        distance[is_patch] = level_distance(polyhedron, p_BC[is_patch], face[is_patch])
    for k in np.unique(face[~is_patch]):
        rows, on = np.flatnonzero(face == k), polyhedron.faces[k]
        points = shapely.points(times(p_BC[rows] - on.p_BF, on.R_BF[:, :2]))
        to_edges = shapely.distance(shapely.boundary(on.polygon_F), points)
        distance[rows] = np.where(shapely.intersects(on.polygon_F, points), to_edges, 0)
    return distance


def effective_tip_radius(polyhedron: Polyhedron, tip_radius: float) -> float:
    """The radius of the sphere that must fit [m].

    A point, of `tip_radius` 0, must still find the surface open to the width of a `CRACK`.
    """
    return max(tip_radius, CRACK / 2 * polyhedron.diameter)


def fingertip_fits(
    polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, tip_radius: float
) -> Bools:
    """Whether a sphere of `tip_radius` [m] that touches from outside penetrates nothing.

    Of contacts p_BC [m] on the exposed surface with inward normals, both (M, 3); shape (M,). The
    distance from the sphere's centre to all triangles and curved solids decides: beside the
    contact the sphere is outside every part, and one that crosses none is outside all the way.
    Where a neighbouring facet rises toward the tip by more than `TIP_SLACK` L, the tip touches that
    one instead. Tips have the radius of `effective_tip_radius` at least.
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
    """Returns whether the fingertips of each grasp overlap nowhere, shape (M,).

    Args:
        polyhedron: the body.
        p_BC: contact points [m], shape (M, 3, 3).
        nhat_TB_B: inward unit normals, shape (M, 3, 3).
        tip_radius: of spherical fingertips [m]; that of `effective_tip_radius` at least.
    """
    tip_radius = effective_tip_radius(polyhedron, tip_radius)
    p_BT = p_BC - tip_radius * nhat_TB_B
    gap = p_BT - np.roll(p_BT, 1, axis=1)
    least = 2 * tip_radius - TIP_SLACK * polyhedron.diameter
    return np.asarray(np.sqrt(dot(gap, gap)).min(axis=1) >= least)

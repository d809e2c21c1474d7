"""Contacts on planar faces: projection onto the faces' triangles, and the triangles of a plane."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, batches
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.tolerances import ANGLE_TOLERANCE, FLATNESS, LENGTH_TOLERANCE
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.vectors import dot, product, times, transformed

_PAIRS_AT_ONCE = 1 << 20
"""Number of face-triangle pairs compared at once, our choice: about 50 MB of temporaries."""
_STEEPEST = np.cos(0.02)
"""Our choice: triangles that lean from their face by more than 0.02 rad are needles, whose normals
are noise."""


class FacePlanes(NamedTuple):
    """The frames F of faces.

    Attributes:
        R_BF: orientations, shape (M, 3, 3).
        p_BF: origins [m], shape (M, 3).
    """

    R_BF: Array
    p_BF: Array


def face_planes(polyhedron: Polyhedron, face: Ints) -> FacePlanes:
    """Returns the frames of some faces.

    Args:
        polyhedron: the body.
        face: indices of the faces, shape (M,).
    """
    return FacePlanes(polyhedron.R_BF[face], polyhedron.p_BF[face])


def coordinates_in_planes(planes: FacePlanes, p_BC: Array) -> Array:
    """Returns the coordinates of points in planes, along Fx and Fy.

    Args:
        planes: the planes.
        p_BC: a point for each plane [m], shape (M, 3).

    Returns:
        [m], shape (M, 2).
    """
    return transformed(planes.R_BF[:, :, :2].swapaxes(1, 2), p_BC - planes.p_BF)


def project_on_faces(polyhedron: Polyhedron, p_BC: Array, face: Ints) -> tuple[Array, Array, Bools]:
    """Projects contacts from the planes of faces onto their triangles.

    Args:
        polyhedron: the body.
        p_BC: contacts on the planes of their faces [m], shape (M, 3).
        face: index of each contact's face, shape (M,).

    Returns:
        Points on the outermost triangles [m] and their inward unit normals, shape (M, 3) each, and
        whether there is a triangle and it is not of another plane's face of less friction, shape
        (M,).
    """
    L, planes = polyhedron.diameter, face_planes(polyhedron, face)
    Fz = planes.R_BF[:, :, 2]
    height = np.abs(dot(p_BC - planes.p_BF, Fz)).max(initial=0.0)
    # Every triangle of its face above or below a contact is within this distance.
    reach = height + 2 * (FLATNESS + LENGTH_TOLERANCE) * L
    projected, inward, ok = p_BC.copy(), -Fz, np.zeros(len(p_BC), dtype=bool)
    for pairs in polyhedron.surface.near(p_BC, reach):
        i, t, rise, nhat = _outermost(polyhedron, planes, p_BC, *pairs)
        projected[i] += rise[:, None] * Fz[i]
        ok[i] = ~_is_of_less_friction(polyhedron, t, face[i])
        lean = nhat - Fz[i]
        leaning = np.sqrt(dot(lean, lean)) > ANGLE_TOLERANCE
        inward[i[leaning]] = -nhat[leaning]
    return projected, inward, ok


def _is_of_less_friction(polyhedron: Polyhedron, triangle: Ints, face: Ints) -> Bools:
    """Returns which triangles are of a face in another plane that has less friction, shape (N,).

    Faces in one plane share no area, but those in planes that differ by about `FLATNESS` may.
    """
    other = polyhedron.triangle_face[triangle]
    found = np.flatnonzero((other >= 0) & (polyhedron.mu[other] < polyhedron.mu[face]))
    less = np.zeros(len(face), dtype=bool)
    here, there = face_planes(polyhedron, face[found]), face_planes(polyhedron, other[found])
    differs = (here.R_BF[..., 2] != there.R_BF[..., 2]) | (here.p_BF != there.p_BF)
    less[found] = differs.any(axis=1)
    return less


def _outermost(
    polyhedron: Polyhedron, planes: FacePlanes, p_BC: Array, i: Ints, t: Ints
) -> tuple[Ints, Ints, Array, Array]:
    """Returns the outermost triangle above or below each contact.

    Args:
        polyhedron: the body.
        planes: the frame of each contact's face.
        p_BC: all contacts [m], shape (M, 3).
        i: contact of each pair, shape (N,).
        t: triangle of each pair, shape (N,).

    Returns:
        The contacts that have one, the triangle, its height over them [m], and its outward normal.
    """
    L, Fz = polyhedron.diameter, planes.R_BF[:, :, 2]
    triangles, nhat = polyhedron.triangles_B[t], unit_normals(polyhedron.triangles_B[t])[0]
    xyz = product(triangles - planes.p_BF[i, None], planes.R_BF[i])
    keep = _is_flat(xyz[..., 2], dot(nhat, Fz[i]), L)
    rows = i[keep]
    beside = coordinates_in_planes(FacePlanes(planes.R_BF[rows], planes.p_BF[rows]), p_BC[rows])
    keep[keep] = shapely.dwithin(
        shapely.polygons(xyz[keep, :, :2]), shapely.points(beside), LENGTH_TOLERANCE * L
    )
    i, t, triangles, nhat = i[keep], t[keep], triangles[keep], nhat[keep]
    rise = dot(triangles[:, 0] - p_BC[i], nhat) / dot(nhat, Fz[i])
    rise = np.where(np.abs(rise) > LENGTH_TOLERANCE * L, rise, 0)
    order = np.lexsort((t, -rise, i))
    best = order[first_of_runs(i[order])]
    return i[best], t[best], rise[best], nhat[best]


def triangles_in_planes(
    polyhedron: Polyhedron, face: Ints, triangles: Array, nhat: Array
) -> tuple[Ints, Ints]:
    """Returns pairs of a face and a triangle that lies in its plane, facing as it does.

    Args:
        polyhedron: the body.
        face: indices of faces, shape (K,).
        triangles: [m], shape (T, 3, 3).
        nhat: their outward unit normals, shape (T, 3).

    Returns:
        Faces, shape (N,), and indices of triangles, shape (N,).
    """
    none = np.empty(0, dtype=np.int64)
    found = [(none, none)]
    for rows in batches(len(face), _PAIRS_AT_ONCE // max(1, len(triangles))):
        planes = face_planes(polyhedron, face[rows])
        cosine = times(planes.R_BF[:, :, 2], nhat.T)
        k, t = np.nonzero(cosine >= _STEEPEST)
        height = dot(triangles[t] - planes.p_BF[k, None], planes.R_BF[k, None, :, 2])
        flat = _is_flat(height, cosine[k, t], polyhedron.diameter)
        found.append((face[rows][k[flat]], t[flat]))
    k, t = (np.concatenate(x) for x in zip(*found, strict=True))
    return k, t


def _is_flat(height: Array, cosine: Array, L: float) -> Bools:
    """Returns which triangles lie in a plane, by heights (T, 3) and cosines of normals (T,)."""
    return np.asarray((np.abs(height).max(axis=1) <= 2 * FLATNESS * L) & (cosine >= _STEEPEST))


def first_of_runs(keys: Ints) -> Ints:
    """Returns the index at which each run of equal keys begins.

    Args:
        keys: integers that are not negative, shape (N,).
    """
    return np.flatnonzero(np.diff(keys, prepend=-1))

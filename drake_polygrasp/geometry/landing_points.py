"""Finds points where a fingertip may land that misses its contact, on the facets that lean most.

They are in the region that `placement_region` finds, if it finds one, at a tenth of its cost. What
fails at these points fails in the region.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from drake_polygrasp.arrays import Array, Bools, Ints, batches
from drake_polygrasp.geometry.face_pieces import Around, around_contacts
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.tolerances import ON_SURFACE, UPRIGHT
from drake_polygrasp.geometry.triangles import nearest_on_triangles, unit_normals
from drake_polygrasp.vectors import circle, dot, transformed

_DIRECTIONS = circle(2 * np.pi * np.arange(6) / 6)
"""Our choice: directions in the tangent plane, shape (D, 2); the steepest facet of each counts."""
_INSIDE = 0.999
"""Our choice: facets count that are so near to the contact, over the radius of errors."""
_AT_ONCE = 1 << 16
"""Our choice: pairs of contacts and triangles at once: about 30 MB."""


def landing_points(
    polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, face: Ints, radius: Array
) -> tuple[Array, Array]:
    """Returns contacts, each with points on the steepest facets where a fingertip may land instead.

    Args:
        polyhedron: the body.
        p_BC: contacts on the true surface [m], shape (M, 3).
        nhat_TB_B: inward unit normals there, shape (M, 3).
        face: indices of the faces or patches that they are on, shape (M,).
        radius: greatest errors in the tangent planes [m], shape (M,).

    Returns:
        The contact and up to six points around it [m], shape (M, 7, 3), with the inward unit
        normals there, shape (M, 7, 3). The contact stands for points that are not found; on planar
        faces and curved solids for all.
    """
    num = 1 + len(_DIRECTIONS)
    points, normals = (np.repeat(values[:, None], num, axis=1) for values in (p_BC, nhat_TB_B))
    is_curved = np.array([each.primitive is not None for each in polyhedron.faces])
    rows = np.flatnonzero(polyhedron.is_patch[face] & ~is_curved[face])
    around = around_contacts(polyhedron, p_BC[rows], nhat_TB_B[rows], radius[rows])
    near = [
        polyhedron.own_triangles_near(p, outward, reach)
        for p, outward, reach in zip(
            around.p_BC, around.R_BC[..., 2], around.reach.tolist(), strict=True
        )
    ]
    most = max(map(len, near), default=1)
    for some in batches(len(rows), _AT_ONCE // most):
        contact, place, p_BQ, nhat = _on_facets(polyhedron, around.take(some), near[some])
        points[rows[some][contact], 1 + place] = p_BQ
        normals[rows[some][contact], 1 + place] = nhat
    return points, normals


def _on_facets(
    polyhedron: Polyhedron, around: Around, near: Sequence[Ints]
) -> tuple[Ints, Ints, Array, Array]:
    """Returns points around contacts, each on the facet that leans most along a direction.

    Args:
        polyhedron: the body.
        around: the contacts.
        near: indices of the body's own triangles near each.

    Returns:
        For each of K points the contact and the direction, shape (K,) each, the point and the
        inward normal there, shape (K, 3) each.
    """
    owner = np.repeat(np.arange(len(near)), [len(each) for each in near])
    corners = polyhedron.own_triangles_B[np.concatenate(near)] - around.p_BC[owner, None]
    triangles = np.einsum("nvj,njk->nvk", corners, around.R_BC[owner])
    radius = around.radius[owner]
    low, high = triangles[..., :2].min(axis=1), triangles[..., :2].max(axis=1)
    nhat, area = unit_normals(triangles)
    seen = ((low <= radius[:, None]) & (high >= -radius[:, None])).all(axis=1)
    seen &= (np.abs(nhat[:, 2]) > UPRIGHT) & (area > around.tolerance**2)
    owner, triangles, nhat, radius = owner[seen], triangles[seen], nhat[seen], radius[seen]
    inside, xy = _in_discs(triangles, radius)
    lean = np.where(inside & (nhat[:, 2] > 0), dot(_DIRECTIONS[:, None], nhat[:, :2]), -np.inf)
    starts = np.flatnonzero(np.diff(owner, prepend=-1))
    lengths = np.diff(starts, append=len(owner))
    # Inside cavities fingertips start half way to what is above: contacts there are left out.
    over = np.maximum.reduceat(_heights(triangles, nhat, np.zeros_like(xy)), starts)
    is_open = over <= ON_SURFACE * polyhedron.diameter
    found = []
    for k, values in enumerate(lean):
        steepest = np.lexsort((-values, owner))[starts]
        heights = _heights(triangles, nhat, np.repeat(xy[steepest], lengths, axis=0))
        z = heights[steepest]
        is_met = np.maximum.reduceat(heights, starts) <= z + around.tolerance
        rows = np.flatnonzero(is_open & is_met & np.isfinite(values[steepest]))
        facet, contact = steepest[rows], owner[starts[rows]]
        p_CQ = np.column_stack([xy[facet], z[rows]])
        p_BQ = around.p_BC[contact] + transformed(around.R_BC[contact], p_CQ)
        inward = -transformed(around.R_BC[contact], nhat[facet])
        found.append((contact, np.full(len(rows), k), p_BQ, inward))
    contact, place, p_BQ, inward = (np.concatenate(each) for each in zip(*found, strict=True))
    return contact, place, p_BQ, inward


def _in_discs(triangles_C: Array, radius: Array) -> tuple[Bools, Array]:
    """Returns which triangles reach well into discs, and a point of each there.

    Points are between the triangle's nearest point and its centroid, seen along the normal.

    Args:
        triangles_C: N triangles in frames of contacts [m], shape (N, 3, 3).
        radius: of the disc about the contact in the tangent plane [m], shape (N,).

    Returns:
        Shape (N,), and the points [m], shape (N, 2).
    """
    flat = triangles_C * [1.0, 1.0, 0.0]
    nearest = nearest_on_triangles(np.zeros(3), flat)[:, :2]
    inward = flat.mean(axis=1)[:, :2] - nearest
    distance, length = np.sqrt(dot(nearest, nearest)), np.sqrt(dot(inward, inward))
    share = np.clip((radius - distance) / np.where(length > 0, length, 1), 0, 1)
    return distance < _INSIDE * radius, nearest + share[:, None] * inward


def _heights(triangles_C: Array, nhat: Array, xy: Array) -> Array:
    """Returns the heights of triangles that are not upright over a point of the plane each [m].

    Args:
        triangles_C: N triangles in frames of contacts [m], shape (N, 3, 3).
        nhat: their normals, shape (N, 3).
        xy: the points [m], shape (N, 2).

    Returns:
        Shape (N,); minus infinity where the triangle is not over the point.
    """
    off = triangles_C[:, :, :2] - xy[:, None]
    head = np.roll(off, -1, axis=1)
    turns = off[..., 0] * head[..., 1] - head[..., 0] * off[..., 1]
    over = (turns >= 0).all(axis=1) | (turns <= 0).all(axis=1)
    z = triangles_C[:, 0, 2] + dot(nhat[:, :2], off[:, 0]) / nhat[:, 2]
    return np.where(over, z, -np.inf)

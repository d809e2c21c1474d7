"""Pieces of the true surface of spheres, ellipsoids, cylinders and capsules around a contact.

A fingertip that moves along the contact's normal n and misses by q in the tangent plane enters the
solid at the depth t(q). The solid is convex, so t is a convex function. Over a convex polygon Q of
misses the surface therefore lies between its tangent plane at one of its points, which it nowhere
rises above, and the hull of its points at the corners of Q, which it nowhere sinks below. The
corners of both planes' parts over Q span a polytope that holds the piece.

Its normals have the direction of a linear function A of the point: A = diag(1 / radii^2) in the
frame of an ellipsoid, the part across the axis on a cylinder. The directions within an angle of a
fixed one are a convex cone, so the greatest angle between A p and a fixed normal, over all p in the
polytope, is at one of its corners.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.digits import at_least
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.surface_pieces import SurfacePiece, rounded_piece
from drake_polygrasp.vectors import dot, times

_SPREAD = np.radians(1.0)
"""Our choice: the angle between normals of one piece, a fifth of the default tilt."""
_MOST_PIECES = 64
"""Our choice: of wide regions on sharp curves, pieces have normals that differ by more."""
_ROUNDING = 1e-9
"""Our choice, added to tangents: normals and corners are rounded to twelve digits."""


class _Cell(NamedTuple):
    """A convex polygon of misses and the polytope of surface over it."""

    q: Array
    """Corners in the tangent plane [m], shape (k, 2)."""
    p_BV: Array
    """[m], shape (2 k, 3)."""
    nhat_B: Array
    """Outward unit normal of the surface over the middle, shape (3,)."""
    cosine: float
    """Least cosine of the angle between that and normals of the piece."""


def curved_pieces(
    solid: Primitive, p_BC: Array, R_BC: Array, polygon: Array, diameter: float
) -> tuple[SurfacePiece, ...]:
    """Returns pieces of a solid's surface that cover what fingertips may touch around a contact.

    Args:
        solid: whose curved surface the contact is on.
        p_BC: the contact [m], shape (3,).
        R_BC: columns Cx, Cy in the tangent plane and Cz outward, shape (3, 3).
        polygon: convex, about the contact in the coordinates of Cx and Cy [m], shape (k, 2).
        diameter: L of the body [m].

    Returns:
        At most 64 pieces; none where some fingertip would meet no curved surface.
    """
    first = _cell(solid, p_BC, R_BC, polygon)
    if first is None:
        return ()
    cells = [first]
    while len(cells) < _MOST_PIECES:
        widest = int(np.argmin(np.round([cell.cosine for cell in cells], 12)))
        if cells[widest].cosine >= np.cos(_SPREAD):
            break
        halves = [_cell(solid, p_BC, R_BC, q) for q in _halves(solid, p_BC, R_BC, cells[widest].q)]
        # What is entered at the corners of a polygon is entered everywhere within.
        cells[widest : widest + 1] = [half for half in halves if half is not None]
    if min(cell.cosine for cell in cells) <= 0:
        return ()
    return tuple(
        rounded_piece(
            cell.p_BV,
            -cell.nhat_B,
            diameter,
            at_least(np.sqrt(max(0.0, 1 - cell.cosine**2)) / cell.cosine + _ROUNDING),
        )
        for cell in cells
    )


def _cell(solid: Primitive, p_BC: Array, R_BC: Array, q: Array) -> _Cell | None:
    """None where a fingertip over a corner meets no curved surface."""
    start = p_BC + times(np.concatenate([q, q.mean(axis=0)[None]]), R_BC[:, :2].T)
    inward = -R_BC[:, 2]
    depth = solid.depths(start, inward)
    if np.isnan(depth).any():
        return None
    surface = start + depth[:, None] * inward
    _, nhat = solid.project(surface[-1:])
    level = dot(surface[-1] - start[:-1], nhat[0]) / dot(inward, nhat[0])
    p_BV = np.concatenate([surface[:-1], start[:-1] + level[:, None] * inward])
    normals = solid.normals_around(p_BV)
    length = np.sqrt(dot(normals, normals))
    return _Cell(q, p_BV, nhat[0], float((times(normals, nhat[0]) / length).min()))


def _halves(solid: Primitive, p_BC: Array, R_BC: Array, q: Array) -> tuple[Array, Array]:
    """A polygon cut through its middle, across the direction in which normals turn most."""
    start = p_BC + times(q, R_BC[:, :2].T)
    surface = start - solid.depths(start, -R_BC[:, 2])[:, None] * R_BC[:, 2]
    _, nhat = solid.project(surface)
    turned = dot(nhat[:, None] - nhat, nhat[:, None] - nhat)
    i, j = np.unravel_index(np.argmax(np.round(turned, 12)), turned.shape)
    side = times(q - q.mean(axis=0), q[j] - q[i])
    return _part(q, side), _part(q, -side)


def _part(q: Array, side: Array) -> Array:
    """The part of a convex polygon where a linear function with values `side` is at most 0."""
    corners = []
    for k in range(len(q)):
        here, there = side[k - 1], side[k]
        if (here <= 0) != (there <= 0):
            corners.append(q[k - 1] + here / (here - there) * (q[k] - q[k - 1]))
        if there <= 0:
            corners.append(q[k])
    return np.array(corners)

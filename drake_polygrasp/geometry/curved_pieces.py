"""Pieces of the surface of spheres, ellipsoids, cylinders and capsules around a contact.

A fingertip that moves along the contact's inward normal with an offset q in the tangent plane
enters the solid at the depth t(q). The solid is convex, so t is a convex function. Over a convex
polygon Q of offsets the surface therefore lies below its tangent plane at any of its points, and
above the convex hull of its points at the corners of Q. The corners of the hull, and those of the
part of the tangent plane over Q, span a polytope that contains the piece.

The surface normals have the direction of a linear function A of the point: A = diag(1 / radii^2)
in the frame of an ellipsoid, and the part perpendicular to the axis on a cylinder. The directions
within an angle of a fixed one form a convex cone, so the greatest angle between A p and a fixed
normal, over all points p of the polytope, is attained at one of its corners.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from drake_polygrasp.arrays import Array
from drake_polygrasp.digits import at_least
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.surface_pieces import SurfacePiece, greatest_tangent, rounded_piece
from drake_polygrasp.vectors import dot, times

_SPREAD = np.radians(0.75)
"""Our choice: angle between the normals of one piece, a seventh of the default tilt."""
_MOST_PIECES = 12
"""Our choice: greatest number of pieces, for bounds under errors take time in proportion; in wide
regions on sharp curves the normals of a piece therefore differ by more than `_SPREAD`."""
_DECIMALS = 6
"""Our choice: of twice the directions in which regions are cut, so that these do not hang on last
bits."""
_ROUNDING = 1e-9
"""Our choice, added to tangents of angles: normals and corners are rounded to twelve digits."""


class _Cell(NamedTuple):
    """A convex polygon of offsets, and the polytope that contains the surface over it.

    Attributes:
        q: corners of the polygon in the tangent plane [m], shape (k, 2).
        p_BV: corners of the polytope [m], shape (2 k, 3).
        nhat_B: outward unit normal of the surface over the polygon's mean corner, shape (3,).
        tangent: of the greatest angle between that normal and others of the piece.
    """

    q: Array
    p_BV: Array
    nhat_B: Array
    tangent: float


def curved_pieces(
    solid: Primitive, p_BC: Array, R_BC: Array, polygon: Array, diameter: float
) -> tuple[SurfacePiece, ...]:
    """Returns pieces that cover the part of a curved surface around a contact.

    Args:
        solid: the solid with the curved surface that the contact is on.
        p_BC: the contact [m], shape (3,).
        R_BC: columns Cx, Cy in the tangent plane and Cz outward, shape (3, 3).
        polygon: corners of the convex polygon of offsets of fingertips from the contact, in the
            coordinates of Cx and Cy [m], shape (k, 2).
        diameter: L of the body [m].

    Returns:
        At most 12 pieces; none if at some offset a fingertip would not meet the curved surface.
    """
    cells = []
    for q in _tiles(solid, p_BC, R_BC, polygon):
        # Rays that enter the surface at the corners of a polygon enter it everywhere inside.
        cell = _cell(solid, p_BC, R_BC, q)
        if cell is None:
            return ()
        cells.append(cell)
    if not all(math.isfinite(cell.tangent) for cell in cells):
        return ()
    return tuple(
        rounded_piece(cell.p_BV, -cell.nhat_B, diameter, at_least(cell.tangent + _ROUNDING))
        for cell in cells
    )


def _cell(solid: Primitive, p_BC: Array, R_BC: Array, q: Array) -> _Cell | None:
    """Returns the cell of a polygon; None if the surface is missed at a corner."""
    start = p_BC + times(np.concatenate([q, q.mean(axis=0)[None]]), R_BC[:, :2].T)
    inward = -R_BC[:, 2]
    depth = solid.depths(start, inward)
    if np.isnan(depth).any():
        return None
    surface = start + depth[:, None] * inward
    _, nhat = solid.project(surface[-1:])
    level = dot(surface[-1] - start[:-1], nhat[0]) / dot(inward, nhat[0])
    p_BV = np.concatenate([surface[:-1], start[:-1] + level[:, None] * inward])
    return _Cell(q, p_BV, nhat[0], greatest_tangent(solid.normals_around(p_BV), nhat[0]))


def _tiles(solid: Primitive, p_BC: Array, R_BC: Array, q: Array) -> list[Array]:
    """Cuts a polygon into a grid along the directions in which normals turn most and least."""
    start = p_BC + times(q, R_BC[:, :2].T)
    depth = solid.depths(start, -R_BC[:, 2])
    if np.isnan(depth).any():
        return [q]
    _, nhat = solid.project(start - depth[:, None] * R_BC[:, 2])
    q_0 = q - q.mean(axis=0)
    # How the normal turns is nearly linear in q: least squares by the normal equations.
    spread = np.einsum("ki,kj->ij", q_0, q_0)
    turned = np.einsum("ki,kj->ij", q_0, times(nhat, R_BC[:, :2]))
    (p, q_xy), (q_yx, r) = spread
    turns = np.einsum("ij,jk->ik", [[r, -q_xy], [-q_yx, p]], turned) / (p * r - q_xy * q_yx)
    mixed, apart = turns[0, 1] + turns[1, 0], turns[0, 0] - turns[1, 1]
    if max(abs(mixed), abs(apart)) < 1e-6 * np.abs(turns).max():  # the same in all directions
        mixed = apart = 0.0
    else:
        # On a cylinder `mixed` is zero but for last bits, whose sign must not matter.
        mixed, apart = np.round(np.array([mixed, apart]) / np.sqrt(mixed**2 + apart**2), _DECIMALS)
    angle = 0.5 * float(np.arctan2(mixed + 0.0, apart + 0.0))
    c, s = round(math.cos(angle), 12), round(math.sin(angle), 12)
    along = np.array([[c, s], [-s, c]])
    x = times(q, along.T)
    width = np.ptp(x, axis=0)
    half_turn = np.round(np.abs(np.einsum("ij,jk,ik->i", along, turns, along)) * width / 2, 12)
    num = np.array([1, 1])
    while ((half_turn / num) ** 2).sum() > _SPREAD**2:
        more = num + (np.arange(2) == int(half_turn[1] / num[1] > half_turn[0] / num[0]))
        if more.prod() > _MOST_PIECES:
            break
        num = more
    tiles = [q]
    for j in range(2):
        cuts = x[:, j].min() + width[j] * np.arange(1, num[j]) / num[j]
        for cut in cuts.tolist():
            tiles = _cut(tiles, along[j], cut)
    return tiles


def _cut(tiles: list[Array], along: Array, at: float) -> list[Array]:
    """Cuts all convex polygons that a line crosses in two."""
    parts = []
    for q in tiles:
        side = np.round(times(q, along) - at, 15)
        crosses = side.min() < 0 < side.max()
        parts += [_part(q, side), _part(q, -side)] if crosses else [q]
    return parts


def _part(q: Array, side: Array) -> Array:
    """Returns the part of a convex polygon where a function, `side` at its corners, is <= 0."""
    corners = []
    for k in range(len(q)):
        here, there = side[k - 1], side[k]
        if (here <= 0) != (there <= 0):
            corners.append(q[k - 1] + here / (here - there) * (q[k] - q[k - 1]))
        if there <= 0:
            corners.append(q[k])
    return np.array(corners)

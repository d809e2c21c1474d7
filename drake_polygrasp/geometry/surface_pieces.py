"""Convex pieces of the true surface, and polygons that contain a disc."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from drake_polygrasp.arrays import Array, Bools, frozen
from drake_polygrasp.digits import on_grid, to_decimals
from drake_polygrasp.vectors import circle, cross, dot

SIDES = 16
"""Number of sides of polygons around discs, our choice: their corners are 2 percent farther out."""
_HAIR = 4e-11
"""Times the diameter L, our choice: rounding to twelve digits moves a corner by less."""


@dataclass(frozen=True, eq=False)
class SurfacePiece:
    """A convex set that contains a piece of the true surface, with a bound on its normals.

    Attributes:
        p_BV: corners of a convex polygon, in order, or of a convex polytope that contains the piece
            [m], shape (n, 3).
        nhat_TB_B: an inward unit normal, shape (3,).
        tan_spread: upper bound of the tangent of the angle between `nhat_TB_B` and the true inward
            normal at any point of the piece.
    """

    p_BV: Array
    nhat_TB_B: Array
    tan_spread: float = 0.0


def rounded_piece(
    p_BV: Array, nhat_TB_B: Array, diameter: float, tan_spread: float = 0.0
) -> SurfacePiece:
    """Returns a piece rounded to the digits that grasp files state.

    Args:
        p_BV: corners [m], shape (n, 3).
        nhat_TB_B: inward unit normal, shape (3,).
        diameter: L of the body [m].
        tan_spread: upper bound of the tangent of the angle to the true normals, for the rounded
            normal.
    """
    return SurfacePiece(
        frozen(on_grid(p_BV, diameter)), frozen(to_decimals(nhat_TB_B)), float(tan_spread)
    )


def rounded_pieces(p_BV: Sequence[Array], nhat_TB_B: Array, diameter: float) -> list[SurfacePiece]:
    """Returns planar pieces rounded to the digits that grasp files state.

    Args:
        p_BV: corners of each [m], shapes (n, 3).
        nhat_TB_B: inward unit normals, shape (M, 3).
        diameter: L of the body [m].
    """
    ends = np.cumsum([len(corners) for corners in p_BV])
    corners = np.split(on_grid(np.concatenate(p_BV), diameter), ends[:-1])
    normals = to_decimals(nhat_TB_B)
    return [SurfacePiece(frozen(p), frozen(n)) for p, n in zip(corners, normals, strict=True)]


def greatest_tangent(normals: Array, nhat: Array) -> float:
    """Returns the tangent of the greatest angle between normals and one of them.

    It is not computed from cosines, whose last bits are angles of 2e-8.

    Args:
        normals: vectors of any length, shape (n, 3).
        nhat: a unit vector, shape (3,).

    Returns:
        The tangent; infinite where an angle is a right one or greater.
    """
    across, along = cross(normals, nhat), dot(normals, nhat)
    if not (along > 0).all():
        return float("inf")
    return float((np.sqrt(dot(across, across)) / along).max())


def widened(radius: Array, diameter: float) -> Array:
    """Returns slightly greater radii, whose polygons still contain the discs after rounding [m].

    Args:
        radius: radii of discs [m], shape (M,).
        diameter: L of the body [m].
    """
    return radius + _HAIR * diameter


def regular_directions(first: Array) -> Array:
    """Returns the outward normals of regular polygons of `SIDES` sides, shape (..., SIDES, 2).

    Args:
        first: the first normal of each, unit vectors, shape (..., 2).
    """
    c, s = circle(2 * np.pi * np.arange(SIDES) / SIDES).T
    x, y = first[..., :1], first[..., 1:]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def tangent_polygon(directions: Array, radius: Array) -> Array:
    """Returns the corners of polygons whose sides are tangent to discs about the origin.

    Args:
        directions: outward unit normals of the sides in any order, less than half a turn from one
            to the next, shape (..., n, 2).
        radius: radii of the discs [m], shape (...); shapes broadcast.

    Returns:
        Counter-clockwise [m], shape (..., n, 2).
    """
    turn = np.arctan2(directions[..., 1], directions[..., 0])
    order = np.argsort(turn, axis=-1, kind="stable")
    tail = np.take_along_axis(directions, order[..., None], axis=-2)
    middle = tail + np.concatenate([tail[..., 1:, :], tail[..., :1, :]], axis=-2)
    # Two tangents meet on the bisector of their normals.
    factor = 2 * radius[..., None] / dot(middle, middle)
    return np.asarray(middle * factor[..., None])


def discs_in_polygons(
    sides: Array, inside: Bools, radius: Array, tolerance: float
) -> list[Array | None]:
    """Returns convex polygons that contain discs about the origin and lie in other polygons.

    The corners of a regular polygon around a disc can cross a side that the disc does not reach.
    Where they do, the polygon gets another side, perpendicular to the line from the origin to the
    nearest point of the side that they cross, which separates the disc from it.

    Args:
        sides: ends of the sides of M polygons of any shape, also with holes [m], shape
            (M, n, 2, 2); sides may be there twice.
        inside: whether the origin is in each, shape (M,).
        radius: radii of the discs [m], shape (M,).
        tolerance: how far discs may reach over a side [m].

    Returns:
        Corners of each, counter-clockwise [m], shapes (k, 2); None if the disc is not in the
        polygon.
    """
    found: list[Array | None] = [None] * len(sides)
    nearest = _nearest_on_sides(sides)
    distance = np.sqrt(dot(nearest, nearest))
    order = np.argsort(np.round(distance / tolerance), axis=1, kind="stable")
    nearest = np.take_along_axis(nearest, order[..., None], axis=1)
    distance = np.take_along_axis(distance, order, axis=1)
    least = distance[:, 0]
    rows = np.flatnonzero(inside & (least >= radius - tolerance) & (least > tolerance))
    distance, radius = distance[rows], radius[rows]
    toward = nearest[rows] / distance[..., None]
    directions = regular_directions(toward[:, 0])
    while len(rows):
        corners = tangent_polygon(directions, radius)
        # How far the corners reach beyond the line that separates the disc from each side.
        beyond = np.einsum("mnj,mkj->mnk", toward, corners).max(axis=-1)
        excess = beyond - np.maximum(distance, radius[:, None])
        crosses = excess.max(axis=1) > tolerance
        for m in np.flatnonzero(~crosses).tolist():
            found[rows[m]] = corners[m]
        worst = np.round(excess / tolerance).argmax(axis=1)
        added = toward[np.arange(len(rows)), worst, None]
        directions = np.concatenate([directions, added], axis=1)[crosses]
        rows, toward, distance, radius = (a[crosses] for a in (rows, toward, distance, radius))
    return found


def _nearest_on_sides(sides: Array) -> Array:
    """Returns the point of each side nearest to the origin, shape (M, n, 2)."""
    tail, side = sides[:, :, 0], sides[:, :, 1] - sides[:, :, 0]
    # Some rings repeat a point.
    length2 = np.maximum(dot(side, side), np.finfo(float).tiny)
    along = np.clip(-dot(tail, side) / length2, 0, 1)
    return np.asarray(tail + along[..., None] * side)

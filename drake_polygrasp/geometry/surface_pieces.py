"""Convex pieces of the true surface, and polygons that contain a disc."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.digits import on_grid, to_decimals
from drake_polygrasp.vectors import circle, dot, times

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


def widened(radius: float, diameter: float) -> float:
    """Returns a slightly greater radius, whose polygons still contain the disc after rounding [m].

    Args:
        radius: radius of the disc [m].
        diameter: L of the body [m].
    """
    return radius + _HAIR * diameter


def regular_directions(first: Array) -> Array:
    """Returns the outward normals of a regular polygon of `SIDES` sides, shape (SIDES, 2).

    Args:
        first: the first normal, a unit vector, shape (2,).
    """
    c, s = circle(2 * np.pi * np.arange(SIDES) / SIDES).T
    return np.stack([c * first[0] - s * first[1], s * first[0] + c * first[1]], axis=1)


def tangent_polygon(directions: Array, radius: float) -> Array:
    """Returns the corners of the polygon whose sides are tangent to a disc about the origin.

    Args:
        directions: outward unit normals of its sides in any order, less than half a turn from one
            to the next, shape (n, 2).
        radius: radius of the disc [m].

    Returns:
        Counter-clockwise [m], shape (n, 2).
    """
    turn = np.arctan2(directions[:, 1], directions[:, 0])
    tail = directions[np.argsort(turn, kind="stable")]
    middle = tail + np.roll(tail, -1, axis=0)
    # Two tangents meet on the bisector of their normals.
    return np.asarray(middle * (2 * radius / dot(middle, middle))[:, None])


def disc_on_face(polygon: shapely.Polygon, radius: float, tolerance: float) -> Array | None:
    """Returns a convex polygon that contains the disc about the origin and lies in another polygon.

    The corners of a regular polygon around the disc can cross an edge that the disc does not reach.
    Where they do, the polygon gets another side, perpendicular to the line from the origin to the
    nearest point of the edge, which separates the disc from the edge.

    Args:
        polygon: polygon of any shape, also with holes [m].
        radius: radius of the disc [m].
        tolerance: how far the disc may reach over an edge [m].

    Returns:
        Corners counter-clockwise [m], shape (n, 2); None if the disc is not in the polygon.
    """
    nearest = _nearest_on_boundary(polygon)
    distance = np.sqrt(dot(nearest, nearest))
    order = np.argsort(np.round(distance / tolerance), kind="stable")
    nearest, distance = nearest[order], distance[order]
    inside = shapely.intersects_xy(polygon, 0.0, 0.0)
    if not inside or distance[0] < radius - tolerance or distance[0] <= tolerance:
        return None
    toward = nearest / distance[:, None]
    directions = regular_directions(toward[0])
    while True:
        corners = tangent_polygon(directions, radius)
        # How far the corners reach beyond the line that separates the disc from each segment.
        excess = times(toward, corners.T).max(axis=1) - np.maximum(distance, radius)
        if excess.max() <= tolerance:
            return corners
        worst = int(np.argmax(np.round(excess / tolerance)))
        directions = np.concatenate([directions, toward[[worst]]])


def _nearest_on_boundary(polygon: shapely.Polygon) -> Array:
    """Returns the point of each boundary segment nearest to the origin, shape (n, 2)."""
    tails, heads = [], []
    for ring in (polygon.exterior, *polygon.interiors):
        xy = shapely.get_coordinates(ring)
        tails.append(xy[:-1])
        heads.append(xy[1:])
    tail, side = np.concatenate(tails), np.concatenate(heads) - np.concatenate(tails)
    # Some rings repeat a point.
    length2 = np.maximum(dot(side, side), np.finfo(float).tiny)
    along = np.clip(-dot(tail, side) / length2, 0, 1)
    return np.asarray(tail + along[:, None] * side)

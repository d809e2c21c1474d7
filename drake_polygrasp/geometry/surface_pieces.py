"""Convex pieces of the true surface, and the polygons around a disc of which they are cut."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.digits import on_grid, to_decimals
from drake_polygrasp.vectors import circle, dot, times

SIDES = 16
"""Our choice: a regular polygon of so many sides around a disc is 2 percent wider than the disc."""
_HAIR = 4e-11
"""Times the diameter L, our choice: more than rounding to twelve digits moves a corner."""


@dataclass(frozen=True, eq=False)
class SurfacePiece:
    """A piece of the true surface, with a bound of how its normals vary."""

    p_BV: Array
    """Corners of a convex polygon, in order, or of a convex polytope, that holds the piece [m],
    shape (n, 3)."""
    nhat_TB_B: Array
    """An inward unit normal, shape (3,)."""
    tan_spread: float = 0.0
    """Upper bound of the tangent of the angle between `nhat_TB_B` and the true inward normal at any
    point of the piece."""


def rounded_piece(
    p_BV: Array, nhat_TB_B: Array, diameter: float, tan_spread: float = 0.0
) -> SurfacePiece:
    """Returns a piece in the digits that grasp files state.

    Args:
        p_BV: corners [m], shape (n, 3).
        nhat_TB_B: inward unit normal, shape (3,).
        diameter: L of the body [m].
        tan_spread: as in `SurfacePiece`.
    """
    return SurfacePiece(
        frozen(on_grid(p_BV, diameter)), frozen(to_decimals(nhat_TB_B)), float(tan_spread)
    )


def widened(radius: float, diameter: float) -> float:
    """Returns a radius so much greater that polygons around it hold the disc once rounded [m]."""
    return radius + _HAIR * diameter


def regular_directions(first: Array) -> Array:
    """Returns the outward normals of a regular polygon of `SIDES` sides, shape (SIDES, 2).

    Args:
        first: the first of them, a unit vector, shape (2,).
    """
    c, s = circle(2 * np.pi * np.arange(SIDES) / SIDES).T
    return np.stack([c * first[0] - s * first[1], s * first[0] + c * first[1]], axis=1)


def tangent_polygon(directions: Array, radius: float) -> Array:
    """Returns the corners of the polygon whose sides touch a disc about the origin, (n, 2).

    Args:
        directions: outward unit normals of its sides, shape (n, 2), less than half a turn from
            one to the next; they need not be in order.
        radius: of the disc [m].
    """
    turn = np.arctan2(directions[:, 1], directions[:, 0])
    tail = directions[np.argsort(turn, kind="stable")]
    middle = tail + np.roll(tail, -1, axis=0)
    # Two tangents meet on the bisector of their normals.
    return np.asarray(middle * (2 * radius / dot(middle, middle))[:, None])


def disc_on_face(polygon: shapely.Polygon, radius: float, tolerance: float) -> Array | None:
    """Returns a convex polygon that holds the disc about the origin and lies in another polygon.

    A regular polygon around the disc has corners beyond it, and near edges they would poke out.
    Where a boundary segment is nearer than a corner, the polygon gets a side square to the line
    to the segment's nearest point: the disc is on one side of it and the segment on the other.

    Args:
        polygon: of any shape, holes included, around the origin [m].
        radius: of the disc [m].
        tolerance: the disc may reach over an edge by this [m].

    Returns:
        Corners counter-clockwise, shape (n, 2), or None where the disc is not in the polygon.
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
        # How far the polygon reaches toward each segment, beyond the line that parts the two.
        excess = times(toward, corners.T).max(axis=1) - np.maximum(distance, radius)
        if excess.max() <= tolerance:
            return corners
        worst = int(np.argmax(np.round(excess / tolerance)))
        directions = np.concatenate([directions, toward[[worst]]])


def _nearest_on_boundary(polygon: shapely.Polygon) -> Array:
    """The point of each boundary segment nearest to the origin, shape (n, 2)."""
    tails, heads = [], []
    for ring in (polygon.exterior, *polygon.interiors):
        xy = shapely.get_coordinates(ring)
        tails.append(xy[:-1])
        heads.append(xy[1:])
    tail, side = np.concatenate(tails), np.concatenate(heads) - np.concatenate(tails)
    along = np.clip(-dot(tail, side) / dot(side, side), 0, 1)
    return np.asarray(tail + along[:, None] * side)

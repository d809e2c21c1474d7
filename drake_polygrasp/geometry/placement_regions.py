"""The part of the true surface that a fingertip may touch when it misses its contact.

The fingertip is a point that moves along the contact's normal and touches the surface where it
first meets it. It starts outside the body or, where a part of the body is opposite the contact,
half way to that part. The contact can be on a planar face, on facets smaller than the error, or on
a curved solid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools
from drake_polygrasp.digits import at_least
from drake_polygrasp.geometry.curved_pieces import curved_pieces
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.surface_pieces import (
    SurfacePiece,
    disc_on_face,
    regular_directions,
    rounded_piece,
    tangent_polygon,
    widened,
)
from drake_polygrasp.geometry.tolerances import ANGLE_TOLERANCE, FLATNESS, LENGTH_TOLERANCE
from drake_polygrasp.geometry.triangles import face_frame, point_triangle_distance, unit_normals
from drake_polygrasp.geometry.visible_facets import visible_facets
from drake_polygrasp.vectors import dot, times

MOST_PIECES = 100
"""Our choice: if there are more pieces, those with similar normals are combined."""
_SIMILAR = np.radians(0.5)
"""Our choice: angle between normals that are combined first; doubled until few enough are left."""
_ROUNDING = 1e-9
"""Our choice, added to tangents of angles: normals are rounded to twelve digits."""
_PLACES = 33
_ROUNDS = 8
"""Our choice, like `_PLACES`: each round narrows the interval between points by a factor of 16."""


@dataclass(frozen=True, eq=False)
class PlacementRegion:
    """The part of the surface that a fingertip may touch around a contact.

    Attributes:
        pieces: convex pieces that cover it; empty if there is no region.
        reason: why there is no region; empty if there is one.
    """

    pieces: tuple[SurfacePiece, ...]
    reason: str = ""


def placement_region(
    polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, face: int, radius: float
) -> PlacementRegion:
    """Returns the part of the true surface that a fingertip may touch when it misses a contact.

    Args:
        polyhedron: the body.
        p_BC: the contact on the true surface [m], shape (3,).
        nhat_TB_B: the inward unit normal there, shape (3,).
        face: index of the face or patch that the contact is on.
        radius: greatest error of the fingertip in the tangent plane, in any direction [m].

    Returns:
        Convex pieces that cover it: on a planar face one polygon that contains the disc of errors
        and stays on the face; on facets one piece for each facet that may be touched first; on a
        curved solid pieces of its true surface. No pieces, but the reason, if the fingertip may
        miss the body, or touch another part of it or another body.
    """
    on, L = polyhedron.faces[face], polyhedron.diameter
    R_BC = face_frame(-nhat_TB_B)
    r = widened(radius, L)
    window = tangent_polygon(regular_directions(np.array([1.0, 0.0])), r)
    reach = float(np.sqrt(dot(window, window).max()))
    around = _Around(p_BC, R_BC, r, window, reach, LENGTH_TOLERANCE * L)
    piece = None
    if not on.reach:
        piece = _on_face(polyhedron, face, around)
    if piece is not None:
        region = PlacementRegion((piece,))
    elif on.primitive is not None:
        region = _on_solid(polyhedron, on.primitive, around)
    else:
        region = _on_facets(polyhedron, around, on.mu)
    if not region.pieces:
        return region
    corners = np.concatenate([piece.p_BV for piece in region.pieces])
    lowest = float(times(corners - p_BC, R_BC[:, 2]).min())
    for solid in (*polyhedron.primitives, *polyhedron.covering):
        if solid is not on.primitive and _is_in_the_way(solid, around, lowest, L):
            return PlacementRegion((), "the fingertip may touch another, curved part first")
    if (
        len(polyhedron.covers_B)
        and _is_over(around.seen(polyhedron.covers_B), around, lowest).any()
    ):
        return PlacementRegion((), "the fingertip may touch another body first")
    return region


class _Around(NamedTuple):
    """A contact and the neighbourhood that its errors lead to.

    Attributes:
        p_BC: the contact [m], shape (3,).
        R_BC: columns Cx, Cy in the tangent plane and Cz outward, shape (3, 3).
        radius: greatest error, enlarged against rounding [m].
        window: corners of a polygon that contains the disc of errors, in the coordinates of Cx and
            Cy [m], shape (k, 2).
        reach: greatest distance of the window's corners from the contact [m].
        tolerance: lengths below this are rounding errors [m].
    """

    p_BC: Array
    R_BC: Array
    radius: float
    window: Array
    reach: float
    tolerance: float

    def seen(self, p_B: Array) -> Array:
        """Returns points of B in the frame of the contact [m], shape (..., 3)."""
        return times(p_B - self.p_BC, self.R_BC)


def _on_face(polyhedron: Polyhedron, face: int, around: _Around) -> SurfacePiece | None:
    """Returns a polygon on a planar face; None if the face lacks the disc or is not met first."""
    on = polyhedron.faces[face]
    p_CF, R_CF = around.seen(on.p_BF), times(on.R_BF.T, around.R_BC).T
    polygon = shapely.transform(on.polygon_F, lambda xy: p_CF[:2] + times(xy, R_CF[:2, :2].T))
    corners = disc_on_face(polygon, around.radius, around.tolerance)
    if corners is None:
        return None
    triangles = around.seen(polyhedron.triangles_B)
    near = np.flatnonzero(_is_near(triangles, around))
    triangles, of_face = triangles[near], polyhedron.triangle_face[near] == face
    if not _is_level(triangles[of_face], around).all():
        return None
    rises = triangles[:, :, 2].max(axis=1) > 2 * FLATNESS * polyhedron.diameter
    if rises.any() and not polyhedron.is_convex:
        # Shrink the window a little, because walls may stand on the rim of the disc.
        window = corners * (1 - 2 * around.tolerance / around.radius)
        seen = visible_facets(triangles, window, polyhedron.diameter)
        if seen.is_blocked or seen.has_step or not of_face[seen.triangle].all():
            return None
    p_BV = around.p_BC + times(corners, around.R_BC[:, :2].T)
    return rounded_piece(p_BV, -around.R_BC[:, 2], polyhedron.diameter)


def _on_solid(polyhedron: Polyhedron, solid: Primitive, around: _Around) -> PlacementRegion:
    """Returns the region around a contact on a curved solid."""
    pieces = curved_pieces(solid, around.p_BC, around.R_BC, around.window, polyhedron.diameter)
    if not pieces:
        return PlacementRegion((), "the fingertip may miss the curved surface")
    triangles = polyhedron.own_triangles_B
    others = triangles[~_stand_for(solid, triangles, around.tolerance)]
    corners = others.reshape(-1, 3)
    hidden = (solid.distance(corners) <= around.tolerance).reshape(-1, 3).all(axis=1)
    lowest = min(float(around.seen(piece.p_BV)[:, 2].min()) for piece in pieces)
    if _is_over(around.seen(others[~hidden]), around, lowest).any():
        return PlacementRegion((), "the fingertip may touch another part first")
    return PlacementRegion(pieces)


def _on_facets(polyhedron: Polyhedron, around: _Around, mu: float) -> PlacementRegion:
    """Returns the region around a contact on facets, or on a face that lacks the disc.

    The friction coefficient of all its facets must be at least the contact's `mu`.
    """
    triangles, face = polyhedron.own_triangles_B, polyhedron.own_triangle_face
    for solid in polyhedron.primitives:
        others = ~_stand_for(solid, triangles, around.tolerance)
        triangles, face = triangles[others], face[others]
    # Facets of no face may be of any part.
    friction = np.append(polyhedron.mu, polyhedron.mu.min())[face]
    seen = visible_facets(around.seen(triangles), around.window, polyhedron.diameter)
    for fails, reason in (
        (seen.is_blocked, "a wall of the body is in the fingertip's path"),
        (seen.hole < around.radius - around.tolerance, "the fingertip may miss the body"),
        (seen.has_step, "the surface has a step where the fingertip may land"),
        (
            (friction[seen.triangle] < mu).any(),
            "a part with less friction may be where the fingertip lands",
        ),
    ):
        if fails:
            return PlacementRegion((), reason)
    p_BV = [around.p_BC + times(p_CV, around.R_BC.T) for p_CV in seen.p_CV]
    nhat_TB_B = -times(seen.nhat_C, around.R_BC.T)
    pieces = [
        rounded_piece(corners, nhat, polyhedron.diameter)
        for corners, nhat in zip(p_BV, nhat_TB_B, strict=True)
    ]
    return PlacementRegion(_few_pieces(pieces, polyhedron.diameter))


def _few_pieces(pieces: Sequence[SurfacePiece], diameter: float) -> tuple[SurfacePiece, ...]:
    """Returns at most `MOST_PIECES` pieces that cover given planar ones.

    If there are more, those with normals within half a degree of one are replaced by a box around
    them with the spread of their normals. The angle is doubled until few enough are left.
    """
    angle = _SIMILAR
    while len(pieces) > MOST_PIECES:
        nhat = np.array([piece.nhat_TB_B for piece in pieces])
        waiting, groups = np.arange(len(pieces)), []
        while len(waiting):
            like = dot(nhat[waiting], nhat[waiting[0]]) >= np.cos(angle)
            like[0] = True
            groups.append(waiting[like])
            waiting = waiting[~like]
        if len(groups) <= MOST_PIECES:
            return tuple(_joined([pieces[k] for k in group], diameter) for group in groups)
        angle *= 2
    return tuple(pieces)


def _joined(pieces: Sequence[SurfacePiece], diameter: float) -> SurfacePiece:
    """Returns a box along the first piece's normal that contains all pieces."""
    nhat_TB_B = pieces[0].nhat_TB_B
    R_BF = face_frame(nhat_TB_B)
    p_FV = times(np.concatenate([piece.p_BV for piece in pieces]), R_BF)
    outline = shapely.oriented_envelope(shapely.MultiPoint(p_FV[:, :2]))
    rectangle = shapely.get_coordinates(outline)[:4]
    box = [
        np.column_stack([rectangle, np.full(4, z)]) for z in (p_FV[:, 2].min(), p_FV[:, 2].max())
    ]
    cosine = min(float(dot(piece.nhat_TB_B, nhat_TB_B)) for piece in pieces)
    spread = np.sqrt(max(0.0, 1 - cosine**2)) / cosine + _ROUNDING
    p_BV = times(np.concatenate(box), R_BF.T)
    return rounded_piece(p_BV, nhat_TB_B, diameter, at_least(spread))


def _stand_for(solid: Primitive, triangles: Array, tolerance: float) -> Bools:
    """Returns which triangles (T, 3, 3) are inscribed in the curved surface of a solid, (T,)."""
    nhat, _ = unit_normals(triangles)
    on_curve = solid.on_curve(triangles.reshape(-1, 3), 10 * tolerance).reshape(-1, 3)
    return np.asarray(on_curve.all(axis=1) & solid.is_curved(nhat))


def _is_near(triangles_C: Array, around: _Around) -> Bools:
    """Returns which triangles (T, 3, 3) are within reach, seen along the contact's normal, (T,)."""
    flat = triangles_C * [1.0, 1.0, 0.0]
    return np.asarray(point_triangle_distance(np.zeros(3), flat) <= around.reach)


def _is_level(triangles_C: Array, around: _Around) -> Bools:
    """Returns which triangles are in the contact's tangent plane, but for rounding errors, (T,)."""
    nhat, area = unit_normals(triangles_C)
    level = np.abs(triangles_C[:, :, 2]).max(axis=1) <= around.tolerance
    upright = np.sqrt(dot(nhat[:, :2], nhat[:, :2])) <= ANGLE_TOLERANCE
    return np.asarray(level & (upright | (area <= around.tolerance**2)))


def _is_over(triangles_C: Array, around: _Around, lowest: float) -> Bools:
    """Returns which triangles (T, 3, 3) are within reach and rise above a height [m], (T,)."""
    rises = triangles_C[:, :, 2].max(axis=1) > lowest
    return np.asarray(_is_near(triangles_C, around) & rises)


def _is_in_the_way(solid: Primitive, around: _Around, lowest: float, L: float) -> bool:
    """Returns whether a solid is within reach of the path from far outside to `lowest`."""
    outward = around.R_BC[:, 2]
    if solid.height(outward) - dot(around.p_BC, outward) <= lowest + around.tolerance:
        return False
    low, high = lowest, lowest + 4 * L
    # Along a line, the distance from a convex solid has a single minimum.
    for _ in range(_ROUNDS):
        t = np.linspace(low, high, _PLACES)
        distance = solid.distance(around.p_BC + t[:, None] * outward)
        if distance.min() <= around.reach:
            return True
        k = int(np.argmin(distance))
        low, high = t[max(k - 1, 0)], t[min(k + 1, _PLACES - 1)]
    return False

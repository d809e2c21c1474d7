"""The part of the true surface that a fingertip may touch when it misses its contact.

The fingertip is a point that moves along the contact's normal and touches the surface where it
first meets it. It starts outside the body or, where a part of the body is opposite the contact,
half way to that part. The contact can be on a planar face, on facets smaller than the error, or on
a curved solid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints
from drake_polygrasp.digits import at_least
from drake_polygrasp.geometry.curved_pieces import curved_pieces
from drake_polygrasp.geometry.face_pieces import (
    Around,
    around_contacts,
    is_near,
    pieces_on_faces,
)
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.surface_pieces import (
    SurfacePiece,
    greatest_tangent,
    rounded_piece,
)
from drake_polygrasp.geometry.triangles import face_frame, unit_normals
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
    around = around_contacts(polyhedron, p_BC[None], nhat_TB_B[None], np.array([radius]))
    (piece,) = pieces_on_faces(polyhedron, np.array([face]), around)
    return _region(polyhedron, face, around.take(0), piece)


def regions_of_grasps(
    polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, face: Ints, radius: Array
) -> list[tuple[tuple[SurfacePiece, ...], ...] | None]:
    """Returns the pieces of `placement_region` for the three contacts of N grasps.

    Args:
        polyhedron: the body.
        p_BC: contacts on the true surface [m], shape (N, 3, 3).
        nhat_TB_B: inward unit normals there, shape (N, 3, 3).
        face: indices of the faces or patches that they are on, shape (N, 3).
        radius: greatest errors in the tangent planes [m], shape (N, 3).

    Returns:
        For each grasp the pieces of each contact; None if one of these has no region.
    """
    around = around_contacts(
        polyhedron, p_BC.reshape(-1, 3), nhat_TB_B.reshape(-1, 3), radius.ravel()
    )
    on_faces = pieces_on_faces(polyhedron, face.ravel(), around)
    found: list[tuple[tuple[SurfacePiece, ...], ...] | None] = []
    for n, faces in enumerate(face.tolist()):
        pieces = []
        for i, k in enumerate(faces):
            m = 3 * n + i
            region = _region(polyhedron, k, around.take(m), on_faces[m])
            if not region.pieces:
                break
            pieces.append(region.pieces)
        found.append(tuple(pieces) if len(pieces) == 3 else None)
    return found


def _region(
    polyhedron: Polyhedron, face: int, around: Around, piece: SurfacePiece | None
) -> PlacementRegion:
    """Returns the region around a contact.

    Args:
        polyhedron: the body.
        face: index of the face or patch that the contact is on.
        around: the contact.
        piece: the region on its planar face, as `pieces_on_faces` finds it.
    """
    on, L = polyhedron.faces[face], polyhedron.diameter
    if piece is not None:
        region = PlacementRegion((piece,))
    elif on.primitive is not None:
        region = _on_solid(polyhedron, on.primitive, around)
    else:
        region = _on_facets(polyhedron, around, on.mu)
    solids = [s for s in (*polyhedron.primitives, *polyhedron.covering) if s is not on.primitive]
    covers_B = polyhedron.covers_B
    if not region.pieces or not (solids or len(covers_B)):
        return region
    corners = np.concatenate([piece.p_BV for piece in region.pieces])
    lowest = float(times(corners - around.p_BC, around.R_BC[:, 2]).min())
    if any(_is_in_the_way(solid, around, lowest, L) for solid in solids):
        return PlacementRegion((), "the fingertip may touch another, curved part first")
    if len(covers_B) and _is_over(around.seen(covers_B), around, lowest).any():
        return PlacementRegion((), "the fingertip may touch another body first")
    return region


def _on_solid(polyhedron: Polyhedron, solid: Primitive, around: Around) -> PlacementRegion:
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


def _on_facets(polyhedron: Polyhedron, around: Around, mu: float) -> PlacementRegion:
    """Returns the region around a contact on facets, or on a face that lacks the disc.

    The friction coefficient of all its facets must be at least the contact's `mu`.
    """
    near = polyhedron.own_triangles_near(around.p_BC, around.R_BC[:, 2], float(around.reach))
    triangles, face = polyhedron.own_triangles_B[near], polyhedron.own_triangle_face[near]
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
    normals = np.stack([piece.nhat_TB_B for piece in pieces])
    spread = at_least(greatest_tangent(normals, nhat_TB_B) + _ROUNDING)
    return rounded_piece(times(np.concatenate(box), R_BF.T), nhat_TB_B, diameter, spread)


def _stand_for(solid: Primitive, triangles: Array, tolerance: float) -> Bools:
    """Returns which triangles (T, 3, 3) are inscribed in the curved surface of a solid, (T,)."""
    nhat, _ = unit_normals(triangles)
    on_curve = solid.on_curve(triangles.reshape(-1, 3), 10 * tolerance).reshape(-1, 3)
    return np.asarray(on_curve.all(axis=1) & solid.is_curved(nhat))


def _is_over(triangles_C: Array, around: Around, lowest: float) -> Bools:
    """Returns which triangles (T, 3, 3) are within reach and rise above a height [m], (T,)."""
    rises = triangles_C[:, :, 2].max(axis=1) > lowest
    return np.asarray(is_near(triangles_C, around.reach) & rises)


def _is_in_the_way(solid: Primitive, around: Around, lowest: float, L: float) -> bool:
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

"""Polygons on planar faces that contain where fingertips may land, for many contacts at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import shapely

from drake_polygrasp.arrays import Array, Bools, Ints, batches
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.surface_pieces import (
    SurfacePiece,
    discs_in_polygons,
    regular_directions,
    rounded_pieces,
    tangent_polygon,
    widened,
)
from drake_polygrasp.geometry.tolerances import ANGLE_TOLERANCE, FLATNESS, LENGTH_TOLERANCE
from drake_polygrasp.geometry.triangles import face_frame, point_triangle_distance, unit_normals
from drake_polygrasp.geometry.visible_facets import visible_facets
from drake_polygrasp.vectors import dot, times, transformed

_AT_ONCE = 1 << 16
"""Our choice: pairs of contacts and triangles, or sides of faces, at once: about 30 MB."""


class Around(NamedTuple):
    """Contacts and the neighbourhoods that their errors lead to; one, or many in leading axes.

    Attributes:
        p_BC: the contact [m], shape (..., 3).
        R_BC: columns Cx, Cy in the tangent plane and Cz outward, shape (..., 3, 3).
        radius: greatest error, enlarged against rounding [m], shape (...).
        window: corners of a polygon that contains the disc of errors, in the coordinates of Cx and
            Cy [m], shape (..., k, 2).
        reach: greatest distance of the window's corners from the contact [m], shape (...).
        tolerance: lengths below this are rounding errors [m].
    """

    p_BC: Array
    R_BC: Array
    radius: Array
    window: Array
    reach: Array
    tolerance: float

    def take(self, rows: int | Ints | slice) -> Around:
        """Returns some of many.

        Args:
            rows: indices, or one index for a single contact.
        """
        return self._replace(
            p_BC=self.p_BC[rows],
            R_BC=self.R_BC[rows],
            radius=self.radius[rows],
            window=self.window[rows],
            reach=self.reach[rows],
        )

    def seen(self, p_B: Array) -> Array:
        """Returns points of B in the frame of one contact.

        Args:
            p_B: points [m], shape (..., 3).

        Returns:
            The points [m], shape (..., 3).
        """
        return times(p_B - self.p_BC, self.R_BC)


def around_contacts(polyhedron: Polyhedron, p_BC: Array, nhat_TB_B: Array, radius: Array) -> Around:
    """Returns M contacts and the neighbourhoods that their errors lead to.

    Args:
        polyhedron: the body.
        p_BC: contacts on the true surface [m], shape (M, 3).
        nhat_TB_B: inward unit normals there, shape (M, 3).
        radius: greatest error of each in its tangent plane [m], shape (M,).
    """
    L = polyhedron.diameter
    r = widened(radius, L)
    window = tangent_polygon(regular_directions(np.array([1.0, 0.0])), r)
    reach = np.sqrt(dot(window, window).max(axis=-1))
    return Around(p_BC, face_frame(-nhat_TB_B), r, window, reach, LENGTH_TOLERANCE * L)


def pieces_on_faces(
    polyhedron: Polyhedron, face: Ints, around: Around
) -> list[SurfacePiece | None]:
    """Returns polygons on the planar faces of contacts that contain where they may be.

    Args:
        polyhedron: the body.
        face: index of each contact's face or patch, shape (M,).
        around: the M contacts.

    Returns:
        For each contact a polygon that contains the disc of errors and stays on the face; None on a
        patch, or where the face lacks the disc or is not what a fingertip meets first.
    """
    found: list[SurfacePiece | None] = [None] * len(face)
    discs = _discs_on_faces(polyhedron, face, around)
    size = _AT_ONCE // len(polyhedron.triangles_B)
    for some in batches(len(discs), size):
        rows, corners = [m for m, _ in discs[some]], [each for _, each in discs[some]]
        here = around.take(np.array(rows))
        is_met = _is_met_first(polyhedron, face[rows], here, corners)
        p_BV = [
            p + times(xy, R[:, :2].T)
            for p, R, xy in zip(here.p_BC, here.R_BC, corners, strict=True)
        ]
        pieces = rounded_pieces(p_BV, -here.R_BC[..., 2], polyhedron.diameter)
        for m, piece, ok in zip(rows, pieces, is_met, strict=True):
            found[m] = piece if ok else None
    return found


def is_near(triangles_C: Array, reach: Array | float) -> Bools:
    """Returns which triangles are within reach, seen along the contact's normal.

    Args:
        triangles_C: in the frame of the contact [m], shape (..., 3, 3).
        reach: distance from it [m]; its shape broadcasts.

    Returns:
        Shape (...).
    """
    flat = triangles_C * [1.0, 1.0, 0.0]
    return np.asarray(point_triangle_distance(np.zeros(3), flat) <= reach)


def _discs_on_faces(polyhedron: Polyhedron, face: Ints, around: Around) -> list[tuple[int, Array]]:
    """Returns the contacts whose planar face has the disc of errors, with corners about it (k, 2).

    Corners are in the coordinates of Cx and Cy [m].
    """
    found: list[tuple[int, Array]] = []
    planar = np.flatnonzero(~polyhedron.is_patch[face])
    if not len(planar):
        return found
    sides_F = _sides(polyhedron, face[planar])
    for some in batches(len(planar), _AT_ONCE // sides_F.shape[1]):
        rows = planar[some]
        here, on = around.take(rows), face[rows]
        R_BF, p_BF = polyhedron.R_BF[on], polyhedron.p_BF[on]
        p_FC = transformed(R_BF.swapaxes(1, 2), here.p_BC - p_BF)
        inside = shapely.intersects_xy(polyhedron.polygon_F[on], p_FC[:, 0], p_FC[:, 1])
        p_CF = np.einsum("mj,mjk->mk", p_BF - here.p_BC, here.R_BC)[:, :2]
        R_CF = np.einsum("mjf,mjk->mkf", R_BF, here.R_BC)[:, :2, :2]
        sides = p_CF[:, None, None] + np.einsum("mnef,mkf->mnek", sides_F[some], R_CF)
        discs = discs_in_polygons(sides, inside, here.radius, here.tolerance)
        found += [(m, xy) for m, xy in zip(rows.tolist(), discs, strict=True) if xy is not None]
    return found


def _sides(polyhedron: Polyhedron, face: Ints) -> Array:
    """Returns the sides of planar faces, of as many by repeating the last [m], (M, n, 2, 2)."""
    held = {}
    for k in dict.fromkeys(face.tolist()):
        polygon = polyhedron.faces[k].polygon_F
        rings = [shapely.get_coordinates(r) for r in (polygon.exterior, *polygon.interiors)]
        held[k] = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    most = np.arange(max(map(len, held.values())))
    alike = {k: sides[np.minimum(most, len(sides) - 1)] for k, sides in held.items()}
    return np.stack([alike[k] for k in face.tolist()])


def _is_met_first(
    polyhedron: Polyhedron, face: Ints, around: Around, corners: Sequence[Array]
) -> Bools:
    """Returns whether fingertips meet the face of each contact first, and it is level there, (M,).

    Args:
        polyhedron: the body.
        face: the planar face of each contact, shape (M,).
        around: the M contacts.
        corners: polygons on the faces, in the coordinates of Cx and Cy [m].
    """
    shape = len(face), -1, 3, 3
    offset = (polyhedron.triangles_B.reshape(-1, 3) - around.p_BC[:, None]).transpose(2, 0, 1)
    seen = np.einsum("jmn,mjk->kmn", np.ascontiguousarray(offset), around.R_BC)
    triangles = np.moveaxis(seen, 0, -1).reshape(shape)
    near = is_near(triangles, around.reach[:, None])
    of_face = polyhedron.triangle_face == face[:, None]
    is_level = _is_level(triangles, around.tolerance)
    is_met: Bools = (is_level | ~(near & of_face)).all(axis=1)
    if polyhedron.is_convex:
        return is_met
    rises = near & (triangles[..., 2].max(axis=-1) > 2 * FLATNESS * polyhedron.diameter)
    for m in np.flatnonzero(is_met & rises.any(axis=1)).tolist():
        # Shrink the window a little, because walls may stand on the rim of the disc.
        window = corners[m] * (1 - 2 * around.tolerance / around.radius[m])
        visible = visible_facets(triangles[m, near[m]], window, polyhedron.diameter)
        is_own = of_face[m, near[m]][visible.triangle].all()
        is_met[m] = is_own and not (visible.is_blocked or visible.has_step)
    return is_met


def _is_level(triangles_C: Array, tolerance: float) -> Bools:
    """Returns which triangles are in the contact's tangent plane, but for rounding errors."""
    nhat, area = unit_normals(triangles_C.reshape(-1, 3, 3))
    nhat, area = nhat.reshape(triangles_C.shape[:-1]), area.reshape(triangles_C.shape[:-2])
    level = np.abs(triangles_C[..., 2]).max(axis=-1) <= tolerance
    upright = np.sqrt(dot(nhat[..., :2], nhat[..., :2])) <= ANGLE_TOLERANCE
    return np.asarray(level & (upright | (area <= tolerance**2)))

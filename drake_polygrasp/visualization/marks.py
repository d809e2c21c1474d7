"""Draws single marks in Meshcat: meshes, shapes, cones, arrows and pieces of a surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from pydrake.geometry import Cylinder, Meshcat, MeshcatCone, Rgba, Shape
from pydrake.math import RigidTransform, RotationMatrix

from drake_polygrasp.arrays import Array
from drake_polygrasp.geometry.surface_pieces import SurfacePiece
from drake_polygrasp.visualization.meshes import piece_outline
from drake_polygrasp.visualization.palette import INK, rgb

_MANY = 2000
"""Our choice: meshes of more triangles share vertices, which keeps pages small but rounds edges."""


def set_mesh(
    meshcat: Meshcat,
    path: str,
    triangles: Array,
    colour: str,
    opacity: float,
    side: Meshcat.SideOfFaceToRender = Meshcat.SideOfFaceToRender.kDoubleSide,
) -> None:
    """Draws triangles.

    Args:
        meshcat: Meshcat to draw in.
        path: path of the mesh in its tree.
        triangles: corners in B [m], shape (T, 3, 3).
        colour: "#rrggbb".
        opacity: from 0 to 1.
        side: the side from which they are visible.
    """
    p_BV = triangles.reshape(-1, 3)
    vertex = np.arange(len(p_BV))
    if len(triangles) > _MANY:
        p_BV, vertex = np.unique(p_BV, axis=0, return_inverse=True)
    index = vertex.reshape(-1, 3)
    meshcat.SetTriangleMesh(path, p_BV.T, index.T, Rgba(*rgb(colour), opacity), side=side)
    _let_through(meshcat, path, opacity)


def set_shape(
    meshcat: Meshcat,
    path: str,
    shape: Shape,
    colour: str,
    opacity: float,
    p_BS: Array,
    zhat_B: Array | None = None,
) -> None:
    """Draws a shape.

    Args:
        meshcat: Meshcat to draw in.
        path: path of the shape in its tree.
        shape: shape to draw, in its own frame S.
        colour: "#rrggbb".
        opacity: from 0 to 1.
        p_BS: position of So [m], shape (3,).
        zhat_B: unit vector along Sz, shape (3,); None if S is aligned with B.
    """
    meshcat.SetObject(path, shape, Rgba(*rgb(colour), opacity))
    _let_through(meshcat, path, opacity)
    # By default Meshcat draws by distance, and meshes, whose vertices are in B, count as at Bo.
    meshcat.SetProperty(f"{path}/<object>", "renderOrder", 1.0)
    meshcat.SetTransform(path, _pose(p_BS, zhat_B))


def draw_friction_cone(
    meshcat: Meshcat, path: str, p_BC: Array, nhat_B: Array, mu: float, side: float, colour: str
) -> None:
    """Draws a friction cone, with sides of one length for any friction.

    Args:
        meshcat: Meshcat to draw in.
        path: path of the cone in its tree.
        p_BC: apex [m], shape (3,).
        nhat_B: unit vector along its axis, shape (3,).
        mu: friction coefficient.
        side: length of its sides [m].
        colour: "#rrggbb".
    """
    height = side / np.hypot(1.0, mu)
    cone = MeshcatCone(height, mu * height, mu * height)
    set_shape(meshcat, path, cone, colour, 0.3, p_BC, nhat_B)


def draw_arrow(
    meshcat: Meshcat, path: str, p_BA: Array, v_B: Array, radius: float, colour: str
) -> None:
    """Draws an arrow; a short one is only a head.

    Args:
        meshcat: Meshcat to draw in.
        path: path of the arrow in its tree.
        p_BA: where it begins [m], shape (3,).
        v_B: from there to its tip [m], shape (3,).
        radius: radius of its shaft [m].
        colour: "#rrggbb".
    """
    length = float(np.linalg.norm(v_B))
    if length == 0:
        return
    zhat_B = v_B / length
    head = min(6 * radius, length)
    wide = 0.4 * head
    # Meshcat's cone has its apex at the origin and opens along +z.
    cone = MeshcatCone(head, wide, wide)
    set_shape(meshcat, f"{path}/head", cone, colour, 1.0, p_BA + v_B, -zhat_B)
    if length > head:
        shaft = Cylinder(radius, length - head)
        middle = p_BA + (length - head) / 2 * zhat_B
        set_shape(meshcat, f"{path}/shaft", shaft, colour, 1.0, middle, zhat_B)


def draw_pieces(
    meshcat: Meshcat, path: str, pieces: Sequence[SurfacePiece], lift: float, colour: str
) -> None:
    """Draws the surface that a contact may touch, as filled outlines of its pieces.

    Args:
        meshcat: Meshcat to draw in.
        path: path of the drawing in its tree.
        pieces: pieces of the surface around one contact.
        lift: distance from the surface, outward [m].
        colour: "#rrggbb".
    """
    outlines = [piece_outline(piece, lift) for piece in pieces]
    # A file may state pieces without an area; verify refuses them.
    outlines = [outline for outline in outlines if len(outline) > 2]
    if not outlines:
        return
    fans = [
        np.stack([np.broadcast_to(p[0], p[1:-1].shape), p[1:-1], p[2:]], axis=1) for p in outlines
    ]
    set_mesh(meshcat, f"{path}/area", np.concatenate(fans), colour, 0.5)
    start = np.concatenate(outlines)
    end = np.concatenate([np.roll(p, -1, axis=0) for p in outlines])
    meshcat.SetLineSegments(f"{path}/border", start.T, end.T, 1.5, Rgba(*rgb(INK)))


def _let_through(meshcat: Meshcat, path: str, opacity: float) -> None:
    """Allows parts behind a translucent one to be drawn after it."""
    if opacity < 1:
        meshcat.SetProperty(f"{path}/<object>", "material.depthWrite", False)


def _pose(p_BS: Array, zhat_B: Array | None) -> RigidTransform:
    R_BS = RotationMatrix() if zhat_B is None else RotationMatrix.MakeFromOneVector(zhat_B, 2)
    return RigidTransform(R_BS, p_BS)

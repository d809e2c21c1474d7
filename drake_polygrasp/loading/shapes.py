"""Converts Drake's collision shapes to triangles and curved solids in the body frame B."""

from __future__ import annotations

import numpy as np
from pydrake.geometry import (
    Box,
    Capsule,
    Convex,
    Cylinder,
    Ellipsoid,
    Mesh,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform

from drake_polygrasp.arrays import frozen
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.surface import Part, curved_part
from drake_polygrasp.geometry.tolerances import FLATNESS
from drake_polygrasp.geometry.triangles import unit_normals
from drake_polygrasp.loading.collision_mesh import read_collision_mesh

_MAX_PAIRS = 1 << 22
"""Pairs of vertex and triangle compared at once: arrays of some ten megabytes. Our choice."""


def part_of(shape: Shape, X_BG: RigidTransform, mu: float) -> Part | None:
    """Returns a shape as a part of a body's surface, None for one without a bounded surface.

    Args:
        shape: a collision shape of Drake.
        X_BG: pose of its geometry frame G in the body frame B.
        mu: its friction coefficient.
    """
    solid = _curved_solid(shape, X_BG)
    if solid is not None:
        return curved_part(solid, mu)
    if isinstance(shape, Box | Convex | Mesh):
        mesh = read_collision_mesh(shape)
        p_BV = X_BG.multiply(mesh.triangles_G.reshape(-1, 3).T).T
        return Part(np.asarray(p_BV).reshape(-1, 3, 3), mu, warnings=mesh.warnings)
    return None


def repaired(shape: Shape) -> Shape:
    """Returns a copy of a shape for our own plants, with a Mesh that Drake would misread repaired.

    Args:
        shape: a collision shape of Drake.
    """
    return (read_collision_mesh(shape).shape if isinstance(shape, Mesh) else shape).Clone()


def is_hull(shape: Shape) -> bool:
    """Returns whether a shape is its own convex hull.

    Args:
        shape: a collision shape of Drake.
    """
    if not isinstance(shape, Mesh):
        return True
    triangles = read_collision_mesh(shape).triangles_G
    vertices = np.unique(triangles.reshape(-1, 3), axis=0)
    tolerance = FLATNESS * np.ptp(vertices, axis=0).max()
    nhat, _ = unit_normals(triangles)
    level = np.einsum("ti,ti->t", triangles[:, 0], nhat) + tolerance
    step = max(1, _MAX_PAIRS // len(vertices))
    return all(
        bool((vertices @ nhat[k : k + step].T <= level[k : k + step]).all())
        for k in range(0, len(nhat), step)
    )


def _curved_solid(shape: Shape, X_BG: RigidTransform) -> Primitive | None:
    """Returns a curved shape in closed form, None for a shape of flat faces or without bounds."""
    R_BG, p_BG = frozen(X_BG.rotation().matrix()), frozen(X_BG.translation())
    match shape:
        case Sphere():
            return Primitive("ellipsoid", R_BG, p_BG, frozen([shape.radius()] * 3))
        case Ellipsoid():
            return Primitive("ellipsoid", R_BG, p_BG, frozen([shape.a(), shape.b(), shape.c()]))
        case Cylinder() | Capsule():
            radii = frozen([shape.radius(), shape.radius(), shape.length() / 2])
            if isinstance(shape, Cylinder):
                return Primitive("cylinder", R_BG, p_BG, radii)
            return Primitive("capsule", R_BG, p_BG, radii)
    return None

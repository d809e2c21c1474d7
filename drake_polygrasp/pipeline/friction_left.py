"""The friction that is left to plan with when normals may tilt and coefficients be less."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from drake_polygrasp.arrays import Array, frozen
from drake_polygrasp.certification.exact import narrowed_friction
from drake_polygrasp.errors import UsageError
from drake_polygrasp.grasp import GraspObject

NO_FRICTION = 1e-6
"""Our choice: what faces plan with that have no friction left, too little for any grasp."""


def friction_left(mu: Array, tilt_error: float, friction_error: float) -> Array:
    """Computes the friction at which force closure holds for all errors of tilt and friction.

    mu' = (m - T) / (1 + m T) with m = (1 - friction_error) mu and T = tan(tilt_error): a force
    within arctan(mu') of a normal is within arctan(m) of every normal tilted by tilt_error.

    Args:
        mu: friction coefficients of faces, shape (n,).
        tilt_error: by how much normals may tilt [rad], 0 to 1.5.
        friction_error: share by which friction coefficients may be less, 0 to below 1.

    Returns:
        Narrowed coefficients, shape (n,): `mu` itself without errors, and `NO_FRICTION` for faces
        that keep none.

    Raises:
        UsageError: when no face keeps any.
    """
    if not len(mu) or not (tilt_error or friction_error):
        return mu
    kept, row = np.unique(mu, return_inverse=True)
    left = np.array(
        [float(narrowed_friction(m, tilt_error, friction_error)) for m in kept.tolist()]
    )
    if left.max() <= NO_FRICTION:
        angle = math.atan((1 - friction_error) * float(kept.max()))
        most = math.floor(1e4 * max(0.0, angle - 2 * NO_FRICTION)) / 1e4
        also = f" and friction_error {friction_error:g} leave" if friction_error else " leaves"
        raise UsageError(
            f"tilt_error {tilt_error:g} rad{also} no friction at mu {kept.max():g}; the tilt must "
            f"be at most {most:g}"
        )
    return frozen(np.maximum(left, NO_FRICTION)[row])


def friction_that_leaves(mu: float, tilt_error: float, friction_error: float) -> float | None:
    """Computes the friction of which `friction_left` leaves as much as is given.

    Args:
        mu: the narrowed coefficient.
        tilt_error: by how much normals may tilt [rad].
        friction_error: share by which friction coefficients may be less.

    Returns:
        The coefficient; None where none suffices.
    """
    if not (tilt_error or friction_error):
        return mu
    tangent = math.tan(tilt_error)
    if mu * tangent >= 1:
        return None
    return (mu + tangent) / (1 - mu * tangent) / (1 - friction_error)


def with_friction_left(
    object_: GraspObject, tilt_error: float, friction_error: float
) -> GraspObject:
    """Returns an object whose faces have the friction that `friction_left` computes.

    Args:
        object_: what to grasp.
        tilt_error: by how much normals may tilt [rad].
        friction_error: share by which friction coefficients may be less.

    Raises:
        UsageError: when no face keeps any friction.
    """
    polyhedron = object_.polyhedron
    left = friction_left(polyhedron.mu, tilt_error, friction_error).tolist()
    faces = (replace(face, mu=mu) for face, mu in zip(polyhedron.faces, left, strict=True))
    return replace(object_, polyhedron=replace(polyhedron, faces=tuple(faces)))

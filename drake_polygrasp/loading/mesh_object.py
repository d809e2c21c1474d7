"""Makes the object from arrays of vertices and triangles: `object_from_mesh`."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from drake_polygrasp.arguments import check_array, check_number, check_text, refuse
from drake_polygrasp.arrays import Array, Ints, frozen
from drake_polygrasp.errors import UsageError
from drake_polygrasp.geometry.patches import check_tolerances
from drake_polygrasp.geometry.surface import Part
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.body_object import (
    DEFAULT_MU,
    MassProperties,
    object_of,
)
from drake_polygrasp.loading.mesh_file import MAX_TRIANGLES
from drake_polygrasp.loading.model_checks import MAX_FRICTION


def object_from_mesh(
    vertices: npt.ArrayLike,
    faces: npt.ArrayLike,
    *,
    mu: float = DEFAULT_MU,
    mass: float | None = None,
    p_BBcm: npt.ArrayLike | None = None,
    name: str = "mesh",
    patch_angle: float | None = None,
    patch_depth: float | None = None,
) -> GraspObject:
    """Makes the object to grasp from a triangle mesh in memory, such as perception reconstructs.

        mug = object_from_mesh(mesh.vertices, mesh.faces, mu=0.4, mass=0.3)
        plan = plan_grasps(mug, effort="quick")

    Frame B is the frame of the vertices. The object came from no model file, so its grasps are not
    written to grasp files.

    Args:
        vertices: points in B [m], shape (V, 3).
        faces: indices of the corners of triangles, of either orientation, shape (T, 3).
        mu: friction coefficient of all faces, above 0.
        mass: mass [kg], above 0; None where it is unknown.
        p_BBcm: centre of mass [m], shape (3,); by default the centroid of the volume.
        name: what warnings and errors call the object.
        patch_angle: as for `load_object` [rad].
        patch_depth: as for `load_object` [m].

    Returns:
        The object, with warnings on how the mesh was read.

    Raises:
        UsageError: when an argument has the wrong type, shape or value.
        ModelError: when the mesh is flat or has no surface to grasp.
    """
    check_text("name", name)
    points, corners = _checked(vertices, faces)
    demand = f"a friction coefficient, above 0 and at most {MAX_FRICTION:g}"
    mu = check_number("mu", mu, demand, above=0.0, most=MAX_FRICTION)
    check_tolerances(patch_angle, patch_depth)
    centre = None if p_BBcm is None else check_array("p_BBcm", p_BBcm, (3,))
    if mass is not None:
        mass = check_number("mass", mass, "a mass in kg, above 0", above=0.0)
    part = Part(frozen(points[corners]), mu)
    # The stated mass is set in the end, where the centre is known.
    stated = None if centre is None else MassProperties(1.0, centre)
    object_ = object_of([part], [], stated, name, [], None, patch_angle, patch_depth)
    return object_.with_mass(mass)


def _checked(vertices: npt.ArrayLike, faces: npt.ArrayLike) -> tuple[Array, Ints]:
    """Returns the arrays of a mesh, or raises UsageError."""
    try:
        points, corners = np.asarray(vertices, dtype=float), np.asarray(faces)
    except (TypeError, ValueError, OverflowError) as error:
        raise UsageError(
            f"vertices, faces: {error}; give arrays of shapes (V, 3), (T, 3)"
        ) from None
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise refuse("vertices", vertices, "finite points, shape (V, 3)")
    if corners.ndim != 2 or corners.shape[1] != 3 or corners.dtype.kind not in "iu":
        raise refuse("faces", faces, "whole numbers, shape (T, 3)")
    if not len(corners) or corners.min() < 0 or corners.max() >= len(points):
        raise refuse("faces", faces, f"indices of the {len(points)} vertices")
    if len(corners) > MAX_TRIANGLES:
        raise UsageError(
            f"faces: {len(corners)} triangles are more than {MAX_TRIANGLES}; simplify the mesh"
        )
    return points, corners.astype(np.int64)

"""Makes the object to grasp from a body of the user's plant: `object_from_plant`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydrake.geometry import SceneGraphInspector
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import BodyIndex, RigidBody
from pydrake.systems.framework import Context

from drake_polygrasp.arguments import (
    check_flag,
    check_packages,
    check_path,
    check_paths,
    check_text,
)
from drake_polygrasp.arrays import Array
from drake_polygrasp.errors import ModelError, UsageError
from drake_polygrasp.geometry.patches import check_tolerances
from drake_polygrasp.geometry.polyhedron import Polyhedron
from drake_polygrasp.geometry.primitives import Primitive
from drake_polygrasp.geometry.tolerances import LENGTH_TOLERANCE
from drake_polygrasp.grasp import GraspObject
from drake_polygrasp.loading.body_object import (
    DEFAULT_MU,
    check_friction,
    collision_parts,
    covering_parts,
    describe_group,
    friction_warnings,
    identity_of,
    lesser_friction,
    mass_properties,
    object_of,
    quote_names,
    stated_friction,
)
from drake_polygrasp.loading.live_plant import describe, find_body, query_of
from drake_polygrasp.loading.object_model import load_object
from drake_polygrasp.loading.rigid_group import Collider, find_group

_ROUNDING = 1e-9
"""Relative difference of masses that count as equal, between file and plant. Our choice."""


def object_from_plant(
    plant: MultibodyPlant,
    body: RigidBody | BodyIndex | str,
    context: Context,
    *,
    model_file: str | Path | None = None,
    body_name: str | None = None,
    mu: float | None = None,
    package_paths: Sequence[str | Path] = (),
    packages: Mapping[str, str | Path] | None = None,
    patch_angle: float | None = None,
    patch_depth: float | None = None,
    joints_free: bool = False,
    scale: float | None = None,
) -> GraspObject:
    """Makes the object to grasp from a body of a plant, with what is welded to it.

        context = plant.GetMyContextFromRoot(diagram_context)
        body = plant.GetBodyByName("mug")
        mug = object_from_plant(plant, body, context)
        plan = plan_grasps(mug, obstacles=obstacles_from_plant(plant, body, context))

    Args:
        plant: the plant, finalized, and connected to a SceneGraph in a diagram.
        body: the body to grasp, its index or its name; its frame is B. Bodies welded to it, other
            than through the world, are part of the object.
        context: the plant's context, taken from the diagram's; its parameters state the masses.
        model_file: the file that the body came from, a path or a URI. A grasp file names its model,
            so it is needed to write one. The object is then loaded from the file, and compared
            with the plant's body.
        body_name: the body's name in `model_file` (default: its name in the plant).
        mu: friction coefficient of all faces, above 0. By default each geometry's, the lesser of
            static and dynamic: the file's if `model_file` is given, else the plant's.
        package_paths: folders searched for the packages of `model_file`.
        packages: folders of packages of `model_file` by name.
        patch_angle: greatest angle between the normal of a patch and those of its facets [rad]
            (default: 12 degrees).
        patch_depth: greatest distance of facets from the plane of their patch [m], about (default:
            0.005 of the object's diameter).
        joints_free: whether links on its joints are ignored; by default they cover its faces at
            their poses in the context. `obstacles_from_plant` has them in either case.
        scale: factor for the lengths of `model_file`, an .obj file (default: 1).

    Returns:
        The object; without `model_file`, its `source` is None.

    Raises:
        UsageError: when plant, body and context do not belong together, or an argument has the
            wrong type or value.
        ModelError: when the collision geometry cannot be grasped, or `model_file` cannot be
            loaded, or its body differs in shape, mass or greater friction from the plant's.
    """
    body = find_body(plant, body)
    inspector = query_of(plant, body, context).inspector()
    where = describe(body)
    check_friction(mu, where)
    check_tolerances(patch_angle, patch_depth)
    joints_free = check_flag("joints_free", joints_free)
    package_paths = check_paths("package_paths", package_paths)
    if model_file is not None:
        check_path("model_file", model_file)
    if body_name is not None:
        check_text("body_name", body_name)
    check_packages("packages", packages)
    if scale is not None and model_file is None:
        raise UsageError("scale is of model_file: give that, or leave scale out")
    group = find_group(plant, body, context)
    colliders = group.colliders(plant, inspector)
    if not colliders:
        raise ModelError(f"{where} has no collision geometry; a grasp needs a surface to touch")
    friction, warnings = _friction(inspector, colliders, mu, where)
    parts = collision_parts(inspector, colliders, friction, where)
    covers = () if joints_free else group.covers(plant, inspector)
    warnings += describe_group(group, where, joints_free)
    live = object_of(
        parts,
        covering_parts(inspector, covers, where),
        mass_properties(group, context),
        where,
        warnings,
        None,
        patch_angle,
        patch_depth,
    )
    identity = identity_of(parts, (str(body.scoped_name()),))
    if model_file is None:
        return replace(live, body=identity, mu=mu)
    from_file = load_object(
        model_file,
        body_name=body_name or body.name(),
        mu=mu,
        package_paths=package_paths,
        packages=packages,
        patch_angle=patch_angle,
        patch_depth=patch_depth,
        joints_free=joints_free,
        scale=scale,
    )
    for difference in _differences(live, from_file):
        links = f"; in the plant it is {quote_names(group.names)}" if len(group.links) > 1 else ""
        raise ModelError(f"{where} is not the body of {model_file}: {difference}{links}")
    return replace(from_file, body=identity)


def _friction(
    inspector: SceneGraphInspector,
    colliders: Sequence[Collider],
    mu: float | None,
    where: str,
) -> tuple[list[float], list[str]]:
    """Returns the coefficient of each geometry, and warnings."""
    if mu is not None:
        return [mu] * len(colliders), []
    friction: list[float] = []
    stated: list[tuple[str, tuple[float, float]]] = []
    for geometry, _, _ in colliders:
        name, pair = inspector.GetName(geometry), stated_friction(inspector, geometry)
        if pair is None:
            friction.append(DEFAULT_MU)
        else:
            stated.append((name, pair))
            friction.append(lesser_friction(*pair, name, where))
    warnings = [*friction_warnings(stated, where)]
    if len(stated) < len(colliders):
        warnings.append(f"{where} states no friction; {DEFAULT_MU} is assumed")
    unsaid = [name for name, pair in stated if pair == (1, 1)]
    if unsaid:
        warnings.append(
            f"{where}: the friction of {quote_names(unsaid)} is 1, which is also Drake's default "
            "where a model states none; give mu to plan with less"
        )
    return friction, warnings


def _differences(live: GraspObject, from_file: GraspObject) -> Iterator[str]:
    """Yields why grasps of the file's object may not hold the plant's."""
    here, there = live.polyhedron, from_file.polyhedron
    tolerance = LENGTH_TOLERANCE * there.diameter
    for how in _unlike(_own_geometry(here), _own_geometry(there), tolerance):
        yield f"the collision geometry differs{how}"
    for how in _unlike(_covers(here), _covers(there), tolerance):
        yield (
            f"the geometry of links on its joints differs{how}; with joints_free=True these are "
            "obstacles only"
        )
    if from_file.mass is not None:
        if live.mass is None or abs(live.mass - from_file.mass) > _ROUNDING * from_file.mass:
            yield f"its mass is {live.mass} kg, the file's {from_file.mass} kg"
        if not (np.abs(live.p_BBcm - from_file.p_BBcm) <= _ROUNDING * from_file.rho).all():
            p_BBcm = from_file.p_BBcm.tolist()
            yield f"its centre of mass is {live.p_BBcm.tolist()}, the file's {p_BBcm}"
    mu = [[face.mu for face in polyhedron.faces] for polyhedron in (here, there)]
    if len(mu[0]) != len(mu[1]) or any(a < b for a, b in zip(*mu, strict=True)):
        yield f"its friction is {min(mu[0])}, the file's {max(mu[1])}; give mu to plan with less"


class _Geometry(NamedTuple):
    """Triangles [m], shape (T, 3, 3), and the curved solids that some of them approximate."""

    triangles_B: Array
    solids: tuple[Primitive, ...]

    @property
    def lengths(self) -> Array:
        """Coordinates of triangles' corners, and centres and radii of curved solids [m]."""
        curved = [np.append(solid.p_BG, solid.radii) for solid in self.solids]
        return np.concatenate([self.triangles_B.ravel(), *curved])


def _own_geometry(polyhedron: Polyhedron) -> _Geometry:
    return _Geometry(polyhedron.own_triangles_B, polyhedron.primitives)


def _covers(polyhedron: Polyhedron) -> _Geometry:
    return _Geometry(polyhedron.covers_B, polyhedron.covering)


def _unlike(here: _Geometry, there: _Geometry, tolerance: float) -> Iterator[str]:
    """Yields how two geometries differ by more than a tolerance [m]; empty text for in kind."""
    kinds = [[solid.kind for solid in geometry.solids] for geometry in (here, there)]
    if here.triangles_B.shape != there.triangles_B.shape or kinds[0] != kinds[1]:
        yield ""
    elif not (np.abs(here.lengths - there.lengths) <= tolerance).all():
        yield " in size or place"

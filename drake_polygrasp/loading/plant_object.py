"""From a body of a plant in its user's diagram to the object to grasp."""

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
"""Ours, relative: the same body by file and by code."""


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
    """The object to grasp, from a body of a plant.

        context = plant.GetMyContextFromRoot(diagram_context)
        body = plant.GetBodyByName("mug")
        mug = object_from_plant(plant, body, context)
        plan = plan_grasps(mug, obstacles=obstacles_from_plant(plant, body, context))

    Args:
        plant: finalized, and connected to a SceneGraph in a diagram.
        body: what to grasp, whose frame is B, or its index or name; bodies welded to it, but not
            through the world, are part of it.
        context: the plant's, from the diagram's; its parameters state mass and centre of mass.
        model_file: the file that the body came from, a path or a package:// URI. It is needed to
            write a grasp file, which names its model; without it, `source` is None. The object is
            then the file's, once its body proves to be the same solid.
        body_name: the body's name in `model_file` (default: its name in the plant).
        mu: replaces the friction of the plant, which is else the lesser of each geometry's static
            and dynamic coefficients; with `model_file`, the file's.
        package_paths: folders to search for the packages of `model_file`.
        packages: folders of packages of `model_file` by name.
        patch_angle: how far normals of a patch may lean [rad], as of `load_object`.
        patch_depth: how far its facets may lie off a plane [m], as of `load_object`.
        joints_free: whether to ignore the links on its joints, which else cover it as they stand in
            the context; `obstacles_from_plant` has them in either case.
        scale: of `model_file`, an .obj file, as of `load_object`.

    Raises:
        UsageError: when plant, body and context do not belong together, or `mu` is not above 0.
        ModelError: when the collision geometry is nothing to hold, or `model_file` cannot be
            loaded or has another solid, or more friction, than the plant.
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
        raise ModelError(f"{where} has no collision geometry; a grasp needs what fingers can touch")
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
        return replace(live, body=identity)
    filed = load_object(
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
    for difference in _differences(live, filed):
        fixed = f"; in the plant it is {quote_names(group.names)}" if len(group.links) > 1 else ""
        raise ModelError(f"{where} is not what {model_file} has: {difference}{fixed}")
    return replace(filed, body=identity)


def _friction(
    inspector: SceneGraphInspector,
    colliders: Sequence[Collider],
    mu: float | None,
    where: str,
) -> tuple[list[float], list[str]]:
    """The coefficient of each geometry, and what there is to say of it."""
    if mu is not None:
        return [mu] * len(colliders), []
    friction: list[float] = []
    warnings: list[str] = []
    for geometry, _, _ in colliders:
        name, pair = inspector.GetName(geometry), stated_friction(inspector, geometry)
        if pair is None:
            friction.append(DEFAULT_MU)
            warnings.append(f"{where} states no friction; {DEFAULT_MU} is assumed")
            continue
        least, said = lesser_friction(*pair, name, where)
        friction.append(least)
        warnings += said
        if pair == (1, 1):
            warnings.append(
                f"{where}: the friction of '{name}' is 1, which is also Drake's where a model "
                "states none; give mu to plan with less"
            )
    return friction, warnings


def _differences(live: GraspObject, filed: GraspObject) -> Iterator[str]:
    """Why a grasp of the file's object would be none of the plant's."""
    here, there = live.polyhedron, filed.polyhedron
    slack = LENGTH_TOLERANCE * there.diameter
    for how in _unlike(_own_geometry(here), _own_geometry(there), slack):
        yield f"the collision geometry differs{how}"
    for how in _unlike(_covers(here), _covers(there), slack):
        yield (
            f"the geometry of links on its joints differs{how}; with joints_free=True these are "
            "obstacles alone"
        )
    if filed.mass is not None:
        if live.mass is None or abs(live.mass - filed.mass) > _ROUNDING * filed.mass:
            yield f"its mass is {live.mass} kg, the file's {filed.mass} kg"
        if not (np.abs(live.p_BBcm - filed.p_BBcm) <= _ROUNDING * filed.rho).all():
            yield (
                f"its centre of mass is {live.p_BBcm.tolist()}, the file's {filed.p_BBcm.tolist()}"
            )
    mu = [[face.mu for face in polyhedron.faces] for polyhedron in (here, there)]
    if len(mu[0]) != len(mu[1]) or any(a < b for a, b in zip(*mu, strict=True)):
        yield f"its friction is {min(mu[0])}, the file's {max(mu[1])}; give mu to plan with less"


class _Geometry(NamedTuple):
    """Triangles [m], shape (T, 3, 3), and curved solids, which some of them only suggest."""

    triangles_B: Array
    solids: tuple[Primitive, ...]

    @property
    def lengths(self) -> Array:
        """Corners of triangles, and centres and radii of curved solids [m]."""
        curved = [np.append(solid.p_BG, solid.radii) for solid in self.solids]
        return np.concatenate([self.triangles_B.ravel(), *curved])


def _own_geometry(polyhedron: Polyhedron) -> _Geometry:
    return _Geometry(polyhedron.own_triangles_B, polyhedron.primitives)


def _covers(polyhedron: Polyhedron) -> _Geometry:
    return _Geometry(polyhedron.covers_B, polyhedron.covering)


def _unlike(here: _Geometry, there: _Geometry, slack: float) -> Iterator[str]:
    """How two geometries differ by more than `slack` [m], in a word or none."""
    kinds = [[solid.kind for solid in geometry.solids] for geometry in (here, there)]
    if here.triangles_B.shape != there.triangles_B.shape or kinds[0] != kinds[1]:
        yield ""
    elif not (np.abs(here.lengths - there.lengths) <= slack).all():
        yield " in size or place"
